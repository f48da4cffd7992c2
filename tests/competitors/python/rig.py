"""The rig file's numbers in SI, as far as the balances need them."""

import tomllib
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Rig:
    """Numbers of rig.toml; pressures absolute in Pa, K_V in m3/s per Pa of choked upstream pressure times 2."""

    supply_pa: float
    exhaust_pa: float
    atmosphere_pa: float
    normal_pa: float
    temperature_k: float
    spool_s: float
    flow_lag_s: float
    opening: np.ndarray
    kv_supply: np.ndarray
    kv_exhaust: np.ndarray
    stroke_m: float
    area_a_m2: float
    area_b_m2: float
    dead_volume_m3: float
    break_away_n: float
    sliding_n: float
    viscous_n_s_per_m: float
    drive_kg: float
    carriage_kg: float
    load_kg: float
    gap_m: float
    stiffness_n_per_m: float
    load_offset_m: float
    position_noise_m: float
    pressure_noise_pa: float
    force_noise_n: float

    @property
    def full_flow(self):
        """Choked flow of the supply edge at full opening, m3/s."""
        return 0.5 * self.kv_supply[-1] * self.supply_pa


# Paper eq. (4): Q_N [m3/h] = 25.9 K_V sqrt(dp p) with p in bar; a conductance c in m3/s per Pa gives c sqrt(dp p).
KV_TO_CONDUCTANCE = 25.9 / 3600.0 / 1e5


def read(path):
    with open(path, "rb") as file:
        rig = tomllib.load(file)
    supply, gas, valve, cylinder = rig["supply"], rig["gas"], rig["valve"], rig["cylinder"]
    friction, mass, linkage, sensors = rig["friction"], rig["mass"], rig["linkage"], rig["sensors"]
    return Rig(
        supply_pa=supply["pressure_bar"] * 1e5,
        exhaust_pa=supply["exhaust_pressure_bar"] * 1e5,
        atmosphere_pa=supply["atmospheric_pressure_bar"] * 1e5,
        normal_pa=float(gas["normal_pressure_pa"]),
        temperature_k=gas["temperature_k"],
        spool_s=valve["spool_time_constant_ms"] * 1e-3,
        flow_lag_s=valve["flow_lag_time_constant_ms"] * 1e-3,
        opening=np.array(valve["opening"], float),
        kv_supply=np.array(valve["kv_supply_m3_per_h"], float) * KV_TO_CONDUCTANCE,
        kv_exhaust=np.array(valve["kv_exhaust_m3_per_h"], float) * KV_TO_CONDUCTANCE,
        stroke_m=cylinder["stroke_mm"] * 1e-3,
        area_a_m2=cylinder["piston_area_mm2"] * 1e-6,
        area_b_m2=cylinder["annulus_area_mm2"] * 1e-6,
        dead_volume_m3=cylinder["dead_volume_cm3"] * 1e-6,
        break_away_n=float(friction["break_away_force_n"]),
        sliding_n=float(friction["sliding_force_n"]),
        viscous_n_s_per_m=friction["viscous_n_per_mm_per_s"] * 1e3,
        drive_kg=mass["drive_kg"],
        carriage_kg=mass["carriage_kg"],
        load_kg=mass["load_kg"],
        gap_m=linkage["gap_mm"] * 1e-3,
        stiffness_n_per_m=float(linkage["stiffness_n_per_m"]),
        load_offset_m=sensors["load_position_offset_mm"] * 1e-3,
        position_noise_m=max(sensors["position_noise_um"] * 1e-6, 5e-6),
        pressure_noise_pa=max(float(sensors["pressure_noise_pa"]), 20.0),
        force_noise_n=max(float(sensors["force_noise_n"]), 0.02),
    )
