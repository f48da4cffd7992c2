"""The local balances of a record: what the model does not explain, sample by sample, with any effect compensated.

    flow_a, flow_b   d(p V)/dt / p_N - model flow                       normal m3/s
    force            F_pn - m a - friction - F_load, while it slides    N
    break            F_pn less the break-away force, once each start    N
    sensor           force sensor less what it should read              N
    gap              x_load - x_drive less what the contact takes       m, linked records with both axes

A column of a regression is the difference that compensating an effect of one unit makes (candidates.py), so each law stands once,
in this file or in flows.py.
"""

from dataclasses import dataclass, replace

import numpy as np

import flows
from signals import FORCE, PERIOD_S, RATE, curvature, delayed, filtered, slope, smooth
from signals import noise_of_curvature, noise_of_force, noise_of_slope, noise_of_velocity, slow_slope

# Sliding: fast enough that the sign of the smoothed velocity is sure (1 mm/s of noise).
SLIDING_M_PER_S = 6e-3
REST_M_PER_S = 1.2e-3
GAS = 287.0
C_V, C_P = 718.0, 1005.0


@dataclass
class View:
    """One axis in its own extension: smoothed, and as sampled where a balance has a kernel of its own."""

    name: str
    u: np.ndarray
    xi: np.ndarray
    v: np.ndarray
    a: np.ndarray
    pa: np.ndarray
    pb: np.ndarray
    force: np.ndarray
    pa_mid: np.ndarray
    pb_mid: np.ndarray
    raw: dict
    measured: tuple
    supply: np.ndarray
    other_drawn: np.ndarray
    mass_kg: float
    carriage_kg: float
    linked: bool
    sign: float
    moved: bool = False


def earlier(y, delay_s):
    """The signal without a delay; its smoothed part is shifted: interpolation lessens noise, which would look like an effect."""
    if not delay_s:
        return y
    smoothed = smooth(y)
    return y + delayed(smoothed, -delay_s) - smoothed


def corrected(record, name, rig, effects):
    """The axis' readings with sensor effects taken off: y - offset, y - gain y, y + lag dy/dt, y a while later.

    What is taken off is made of smoothed signals: a share of the noise, taken off, would look like an effect.
    """
    data = record.axes[name]
    own = lambda effect, key, element=None: effects.get((effect, key, element) if element else (effect, key), 0.0)
    skew = lambda y, element: earlier(y, own("time-skew", "delay_ms", element) * 1e-3)
    x = data.x - (rig.load_offset_m if name == "load" else 0.0)
    x = skew(x, "position") + own("position-sensor-lag", "time_constant_ms") * 1e-3 * slope(x)
    x = x - own("position-sensor-gain", "gain_percent") / 100 * smooth(x) - own("position-sensor-offset", "offset_mm") * 1e-3
    # The gain meets what the sensor should read, not its noise, wherever that is known.
    gain = own("force-sensor-gain", "gain_percent") / 100 if record.linked else 0.0
    force = skew(data.force, "force") * (1.0 - gain) - own("force-sensor-offset", "offset_n")
    pressures = []
    for element, p in (("a", data.pa), ("b", data.pb)):
        p = skew(p, element) + own("pressure-sensor-lag", "time_constant_ms", element) * 1e-3 * slope(p)
        p = p - own("pressure-sensor-gain", "gain_percent", element) / 100 * smooth(p)
        pressures.append(p - own("pressure-sensor-offset", "offset_mbar", element) * 100.0)
    return x, force, pressures


def view(record, name, rig, effects, other_drawn=None):
    x, force, (pa, pb) = corrected(record, name, rig, effects)
    drive = name == "drive"
    xi = x if drive else rig.stroke_m - x
    area = effects.get(("parameter:piston-area", "factor"), 1.0)
    volume = effects.get(("dead-volume", "volume_cm3"), rig.dead_volume_m3 * 1e6) * 1e-6
    volume_a = rig.dead_volume_m3 + rig.area_a_m2 * xi
    volume_b = rig.dead_volume_m3 + rig.area_b_m2 * (rig.stroke_m - xi)
    # Differences to the file meet smoothed signals: times the noise they would explain noise.
    more_a = volume - rig.dead_volume_m3 + (area - 1.0) * rig.area_a_m2 * smooth(xi)
    more_b = volume - rig.dead_volume_m3 + (area - 1.0) * rig.area_b_m2 * (rig.stroke_m - smooth(xi))
    measured = (slope(pa * volume_a) / rig.normal_pa, slope(pb * volume_b) / rig.normal_pa)
    supply = np.full(len(x), rig.supply_pa) if record.supply_pa is None else record.supply_pa
    mass = rig.drive_kg + record.added_mass_kg if drive else rig.load_kg
    return View(
        name=name, u=record.axes[name].u, xi=smooth(xi), v=slope(xi), a=curvature(xi), pa=smooth(pa), pb=smooth(pb),
        force=smooth(force), pa_mid=middle(smooth(pa)), pb_mid=middle(smooth(pb)),
        raw={"xi": xi, "pa": pa, "pb": pb, "force": force, "air_a": pa * volume_a + smooth(pa) * more_a,
             "air_b": pb * volume_b + smooth(pb) * more_b},
        measured=measured, supply=supply,
        other_drawn=np.zeros(len(x)) if other_drawn is None else other_drawn,
        mass_kg=mass, carriage_kg=rig.carriage_kg + record.added_mass_kg if drive else 0.0,
        linked=record.linked, sign=1.0 if drive else -1.0,
    )  # fmt: skip


def middle(y):
    """Between each sample and the next: what acts over the period."""
    return 0.5 * (y + np.append(y[1:], y[-1]))


def step(y):
    """Change over each period."""
    return np.append(np.diff(y), 0.0)


def heat(data, rig, effects):
    """What the energy balance adds to the stored-air rate of each chamber, as normal flow, at the measured rates."""
    h = effects.get(("heat-exchange", "coefficient_w_per_m2_k"))
    if not h:
        return 0.0, 0.0
    added, wall = [], np.sqrt(4 * np.pi * rig.area_a_m2)
    for pressure, area, length, flow in (
        (data.pa, rig.area_a_m2, data.xi, data.measured[0]),
        (data.pb, rig.area_b_m2, rig.stroke_m - data.xi, data.measured[1]),
    ):
        volume = rig.dead_volume_m3 + area * np.clip(length, 0.0, None)
        surface = 2 * area + wall * (volume / area)
        work = np.gradient(volume, 1e-3) * pressure
        added.append(heated(pressure, volume, surface, work, flow, h, rig))
    return added


def heated(pressure, volume, surface, work, flow, h, rig):
    t0, gamma, share = rig.temperature_k, C_P / C_V, GAS / C_V
    temperature, out = t0, np.empty_like(pressure)
    rows = zip(pressure.tolist(), volume.tolist(), surface.tolist(), work.tolist(), flow.tolist(), strict=True)
    for place, (p, v, s, w, q) in enumerate(rows):
        # d(pV)/dt = p_N q gamma T_f / T0 + (R/c_v) (h S (T0 - T) - p dV/dt); inflow comes at T0.
        entering = 1.0 if q > 0 else temperature / t0
        rate = q * gamma * entering + share * (h * s * (t0 - temperature) - w) / rig.normal_pa
        out[place] = rate - q
        mass = p * v / (GAS * temperature)
        stored, carried = rate * rig.normal_pa / GAS, temperature * q * rig.normal_pa / (GAS * t0)
        temperature += PERIOD_S * (stored - carried) / mass
        temperature = min(max(temperature, 0.6 * t0), 1.6 * t0)
    return out


def friction(data, rig, effects):
    """Sliding friction along the motion, without its sign, N."""
    sign = np.sign(data.v)
    viscous = rig.viscous_n_s_per_m * effects.get(("parameter:viscous-friction", "factor"), 1.0)
    sliding = rig.sliding_n * effects.get(("parameter:sliding-friction", "factor"), 1.0)
    side = 1.0 + sign * effects.get(("friction-asymmetry", "asymmetry_percent"), 0.0) / 100
    level = sliding * side
    width = effects.get(("stribeck-friction", "velocity_mm_per_s"))
    if width:
        level = level + (rig.break_away_n - rig.sliding_n) * np.exp(-((np.abs(data.v) / (width * 1e-3)) ** 2))
    gauge = (data.pa + data.pb - 2 * rig.atmosphere_pa) * 1e-5
    level = level + effects.get(("pressure-dependent-friction", "slope_n_per_bar"), 0.0) * gauge
    level = level + over_position(data, rig, effects, "position-dependent-friction", data.xi)
    return np.maximum(level, 0.0) + viscous * side * np.abs(data.v)


def over_position(data, rig, effects, effect, x):
    own = lambda key, default=0.0: effects.get((effect, key), default)
    out = np.zeros_like(x)
    if own("bump_n"):
        out += own("bump_n") * np.exp(-(((x - own("centre_mm", 250.0) * 1e-3) / (own("width_mm", 60.0) * 1e-3)) ** 2))
    half = rig.stroke_m / 2
    out += (own("slope_n") - own("spring_n")) * (x - half) / half
    if own("ripple_n"):
        out += own("ripple_n") * np.sin(2 * np.pi * x / (own("pitch_mm", 50.0) * 1e-3))
    return out


def axis_balances(data, rig, effects, known_flows=None):
    """Residuals of one axis by balance, one value for each sample; `known_flows` are the chambers', where they are known."""
    out = flow_balances(data, rig, effects) if known_flows is None else known_flows
    return out | force_balances(data, rig, effects)


# Effects that need the flow itself. They get the model's: the measured one carries the very noise that they would explain.
NEED_FLOW = {
    "line-resistance", "check-valve-restriction", "silencer-back-pressure", "end-cushion", "supply-droop", "heat-exchange",
}  # fmt: skip


def flow_balances(data, rig, effects):
    if any(key[0] in NEED_FLOW for key in effects):
        known = flows.chamber_flows(data, rig, {})
        for _ in range(3):
            # Half way each time: a drop lessens the flow that makes it.
            model = flows.chamber_flows(replace(data, measured=known), rig, effects)
            known = [0.5 * (before + after) for before, after in zip(known, model, strict=True)]
        data = replace(data, measured=known)
    model = flows.chamber_flows(data, rig, effects)
    leak = flows.leakages(data, rig, effects)
    warm = heat(data, rig, effects)
    rates = [step(data.raw[air]) / PERIOD_S / rig.normal_pa for air in ("air_a", "air_b")]
    return {
        "flow_a": filtered(rates[0] - model[0] - leak[0] - warm[0], RATE),
        "flow_b": filtered(rates[1] - model[1] - leak[1] - warm[1], RATE),
    }


def force_balances(data, rig, effects):
    area = effects.get(("parameter:piston-area", "factor"), 1.0)
    mass = data.mass_kg * effects.get(("parameter:mass", "factor"), 1.0)
    raw = data.raw
    pneumatic = raw["pa"] * rig.area_a_m2 - raw["pb"] * rig.area_b_m2
    pneumatic = pneumatic + (area - 1.0) * (data.pa * rig.area_a_m2 - data.pb * rig.area_b_m2)
    pneumatic -= area * rig.atmosphere_pa * (rig.area_a_m2 - rig.area_b_m2)
    x = data.xi if data.sign > 0 else rig.stroke_m - data.xi
    applied = effects.get(("inclination", "force_n"), 0.0)
    applied = data.sign * (applied + over_position(data, rig, effects, "position-dependent-force", x))
    if ("end-cushion", "cushion_kv_m3_per_h") in effects:
        stop = effects.get(("end-cushion", "stop_stiffness_n_per_m"), 0.0)
        applied = applied + stop * (np.clip(1e-3 - data.xi, 0, None) - np.clip(data.xi - rig.stroke_m + 1e-3, 0, None))
    # Linked, the sensor tells the contact force; what lies between piston and sensor is the rest of the mass.
    between = mass - data.carriage_kg if data.linked else mass
    load = raw["force"] if data.linked else 0.0
    driving = pneumatic + applied - load
    velocity = np.gradient(raw["xi"], PERIOD_S)
    acceleration = (step(raw["xi"]) - np.append(0.0, step(raw["xi"])[:-1])) / PERIOD_S**2
    viscous = rig.viscous_n_s_per_m * (velocity - data.v)
    resisting = np.sign(data.v) * friction(data, rig, effects) + viscous
    gain = 1.0 + effects.get(("force-sensor-gain", "gain_percent"), 0.0) / 100
    expected = 0.0 if data.linked else data.carriage_kg * gain * acceleration
    return {
        "force": filtered(driving - between * acceleration - resisting, FORCE),
        "break": filtered(driving, BRIEF),
        "sensor": filtered(raw["force"] - expected, FORCE),
    }


def gap_balance(drive, load, rig, effects):
    """Distance of the eyes less gap and compression; the contact force is what the load's sensor reads, negative."""
    force = -load.force
    stretch = (rig.stroke_m - load.xi) - drive.xi
    gap = effects.get(("coupling-backlash", "gap_mm"), rig.gap_m * 1e3) * 1e-3
    # The column of the compliance is linear in 1/k.
    give = 1.0 / rig.stiffness_n_per_m + effects.get(("coupling-compliance", "give_m_per_n"), 0.0)
    return filtered(stretch - np.sign(force) * gap / 2 - force * give, FORCE)


def whole_samples(record):
    """Where every sample that the kernels see is there."""
    size = 31
    whole = np.convolve(record.usable.astype(float), np.ones(size), "same") > size - 0.5
    whole[: 5 * size] = False  # the start: states that the record does not hold
    whole[-size:] = False
    return whole


def masks(record, views, events, rig):
    """Which samples of each balance can be used, on the baseline's signals."""
    whole, out = whole_samples(record), {}
    for name, data in views.items():
        top, bottom = 0.98 * rig.supply_pa, rig.exhaust_pa + 5e3
        for chamber, pressure in (("flow_a", data.pa), ("flow_b", data.pb)):
            inside = (pressure < top) & (pressure > bottom)
            out[name, chamber] = whole & inside
        ends = (data.xi > 1.5e-3) & (data.xi < rig.stroke_m - 1.5e-3)
        out[name, "force"] = whole & ends & (steady(np.abs(data.v) > SLIDING_M_PER_S) > 0)
        out[name, "break"] = np.ones(len(events[name].places), bool)
        out[name, "sensor"] = whole & ends if not data.linked else np.zeros_like(whole)
    if len(views) == 2 and record.linked:
        out["linkage", "gap"] = whole & (np.abs(views["load"].force) > 15.0)
    return out


def steady(flag):
    """A flag that holds for the whole kernel: no stick, no reversal within it."""
    return np.convolve(flag.astype(float), np.ones(31), "same") > 30.5


def rest_s(data):
    """For how long the axis had been at rest before each sample."""
    rest = np.abs(slow_slope(data.raw["xi"])) < REST_M_PER_S
    count, out = 0.0, np.zeros(len(rest))
    for place, flag in enumerate(rest.tolist()):
        out[place] = count
        count = count + PERIOD_S if flag else 0.0
    return out


@dataclass
class Starts:
    """Slow starts from rest: where the driving force was largest, which way it went, for how long the axis had rested."""

    places: np.ndarray
    directions: np.ndarray
    rested_s: np.ndarray


# Over so many samples, since what matters at a start lasts milliseconds.
BRIEF = np.ones(7) / 7
# A force that grows faster than this overshoots the break-away force by more than the noise before anything is seen to move.
SLOW_N_PER_S = 400.0


def starts(allowed, data, driving):
    rested = rest_s(data)
    ends = np.flatnonzero((rested[:-1] > 0.05) & (rested[1:] == 0.0)) + 1
    found = []
    for end in ends:
        fast = np.flatnonzero(np.abs(data.v[end : end + 60]) > SLIDING_M_PER_S)
        if not allowed[end] or not len(fast):
            continue
        direction = np.sign(data.v[end + fast[0]])
        first = max(end - 20, 0)
        place = first + int(np.argmax(direction * driving[first : end + fast[0] + 1]))
        rate = abs(driving[place] - driving[max(place - 20, 0)]) / (20 * PERIOD_S)
        if rate < SLOW_N_PER_S:
            found.append((place, direction, rested[end - 1]))
    places, directions, rests = zip(*found, strict=True) if found else ((), (), ())
    return Starts(np.array(places, int), np.array(directions, float), np.array(rests, float))


def break_baseline(data, rig, effects, own):
    """Break-away force with its sign, at each start."""
    direction = own.directions
    level = rig.break_away_n * effects.get(("parameter:break-away-force", "factor"), 1.0)
    level = level * (1.0 + direction * effects.get(("friction-asymmetry", "asymmetry_percent"), 0.0) / 100)
    growth = effects.get(("rest-time-dependent-break-away", "growth_percent"), 0.0) / 100
    onset = effects.get(("rest-time-dependent-break-away", "onset_s"), 0.1)
    if growth:
        level = level + rig.break_away_n * growth * np.log1p(own.rested_s / onset) / np.log1p(10.0 / onset)
    gauge = (data.pa + data.pb - 2 * rig.atmosphere_pa)[own.places] * 1e-5
    level = level + effects.get(("pressure-dependent-friction", "slope_n_per_bar"), 0.0) * gauge
    return direction * level


def find_starts(record, rig):
    """The starts of each axis, on the baseline's signals."""
    events = {}
    for name in record.axes:
        data = view(record, name, rig, {})
        driving = axis_balances(data, rig, {})["break"]
        events[name] = starts(whole_samples(record), data, driving)
    return events


# What acts on the motion alone, and leaves the balances of the chambers as they are.
MOTION_ONLY = {
    "friction-asymmetry", "pressure-dependent-friction", "position-dependent-friction", "inclination", "stribeck-friction",
    "position-dependent-force", "rest-time-dependent-break-away", "force-sensor-offset", "force-sensor-gain", "parameter:mass",
    "parameter:viscous-friction", "parameter:sliding-friction", "parameter:break-away-force",
}  # fmt: skip


def residuals(record, rig, events, place=None, effects=None, base=None):
    """All balances of a record, with effects compensated at one place (drive, load, linkage, supply).

    `base` are those without, from which comes what the place leaves alone.
    """
    effects = effects or {}
    views = {name: view(record, name, rig, effects if name == place else {}) for name in record.axes}
    if place == "supply" and len(views) == 2:
        for name, other in (("drive", "load"), ("load", "drive")):
            drawn = np.clip(views[other].measured[0], 0, None) + np.clip(views[other].measured[1], 0, None)
            views[name] = replace(views[name], other_drawn=drawn)
    out = dict(base) if base else {}
    motion_only = base is not None and all(key[0] in MOTION_ONLY for key in effects)
    for name, data in views.items():
        if base is not None and place not in (name, "supply"):
            continue
        known = {balance: base[name, balance] for balance in ("flow_a", "flow_b")} if motion_only else None
        for balance, values in axis_balances(data, rig, effects, known).items():
            if balance == "break":
                own = events[name]
                values = values[own.places] - break_baseline(data, rig, effects, own)
            out[name, balance] = values
    if len(views) == 2 and record.linked:
        out["linkage", "gap"] = gap_balance(views["drive"], views["load"], rig, effects if place == "linkage" else {})
    return out, views


def noise(rig, views):
    """Noise of each balance that the sensors alone make, one number each, at mid-stroke and 4 bar."""
    pressure, position = rig.pressure_noise_pa, rig.position_noise_m
    out = {}
    for name, data in views.items():
        for chamber, area in (("flow_a", rig.area_a_m2), ("flow_b", rig.area_b_m2)):
            volume = rig.dead_volume_m3 + area * rig.stroke_m / 2
            rate = np.hypot(volume * noise_of_slope(pressure), 4e5 * area * noise_of_slope(position))
            out[name, chamber] = rate / rig.normal_pa
        smoothed = noise_of_force(pressure) * np.hypot(rig.area_a_m2, rig.area_b_m2)
        inertia = data.mass_kg * noise_of_curvature(position)
        out[name, "force"] = np.hypot(np.hypot(smoothed, inertia), rig.viscous_n_s_per_m * noise_of_velocity(position))
        out[name, "break"] = 3.0
        out[name, "sensor"] = np.hypot(noise_of_force(rig.force_noise_n), data.carriage_kg * noise_of_curvature(position))
    if len(views) == 2:
        out["linkage", "gap"] = np.sqrt(2) * noise_of_force(position)
    return out
