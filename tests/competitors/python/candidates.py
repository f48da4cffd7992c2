"""The library: what each effect of the catalogue would look like in the balances, and how a coefficient becomes its value.

A candidate is a small amount of an effect, compensated; its column is the difference that makes in all balances. The number of an
effect is

    linear    neutral + coefficient * amount                 most effects, from small amounts
    far       the same from a large amount, near which the coefficient must stay (0.6 to 1.7): delays, lags, volumes
    inverse   amount / coefficient                           what grows as the number falls (heat exchange)
    root      amount / sqrt(coefficient)                     the same for orifices, whose drop falls with the square
    grid      amount, the coefficient should be 1            shapes that are not linear; the best of a few amounts is taken
"""

from dataclasses import dataclass

# Effects without a signature in these balances at this noise: micrometres before break-away.
WITHOUT_SIGNATURE = ("presliding",)


@dataclass(frozen=True)
class Candidate:
    """One column of the library."""

    effect: str
    place: str
    element: str | None
    key: str
    unit: str
    amount: float
    compensated: tuple
    law: str = "linear"
    neutral: float = 0.0
    least: float = 0.0
    one_sided: bool = True
    # Standard deviation of the coefficient that is expected beforehand; parameters have one.
    prior: float | None = None

    @property
    def is_parameter(self):
        return self.effect.startswith("parameter:")

    def value(self, coefficient):
        if self.law in ("linear", "far"):
            return self.neutral + coefficient * self.amount
        if self.law == "inverse":
            return self.amount / max(coefficient, 1e-3)
        if self.law == "root":
            return self.amount / max(coefficient, 1e-3) ** 0.5
        if self.law == "give":
            return 1.0 / max(1.0 / self.neutral + coefficient * self.amount, 1e-8)
        return self.amount

    def error(self, coefficient, error):
        """Standard error of the value by the slope of the law."""
        up, down = self.value(coefficient + 0.5 * error), self.value(coefficient - 0.5 * error)
        return abs(up - down) if self.law != "grid" else None

    def plausible(self, coefficient):
        """Whether a coefficient has the sign and the size that the effect could have; a shape has the size 1."""
        if self.law in ("grid", "inverse", "root"):
            return 0.3 < coefficient < 3.0
        if self.law == "far":
            return 0.6 < coefficient < 1.7
        if self.one_sided and coefficient <= 0.0:
            return False
        return abs(coefficient * self.amount) >= self.least


# Effect, key, unit, amount, least that counts as one (a quarter of the smallest that occurs), one-sided, elements.
AXIS_EFFECTS = [
    ("valve-dead-zone", "dead_zone_percent", "%", 0.5, 0.12, True),
    ("valve-hysteresis", "half_width_percent", "%", 0.5, 0.05, True),
    ("valve-offset", "offset_percent", "%", 0.3, 0.12, False),
    ("valve-null-leakage", "leakage_percent", "%", 0.3, 0.05, True),
    ("valve-characteristic", "bend_percent", "%", 3.0, 1.2, False),
    ("valve-characteristic", "edge_ratio_percent", "%", 3.0, 1.2, False),
    ("line-delay", "length_m", "m", 0.3, 0.12, True),
    ("line-resistance", "drop_bar", "bar", 0.05, 0.012, True),
    ("check-valve-restriction", "cracking_pressure_bar", "bar", 0.05, 0.012, True),
    ("command-dead-time", "delay_ms", "ms", 0.3, 0.2, True),
    ("piston-leakage", "leakage_nl_per_min", "Nl/min", 1.0, 0.05, True),
    ("friction-asymmetry", "asymmetry_percent", "%", 3.0, 1.2, False),
    ("pressure-dependent-friction", "slope_n_per_bar", "N/bar", 0.3, 0.05, True),
    ("position-dependent-friction", "slope_n", "N", 2.0, 0.5, False),
    ("inclination", "force_n", "N", 2.0, 0.5, False),
    ("position-dependent-force", "spring_n", "N", 2.0, 0.5, False),
    ("rest-time-dependent-break-away", "growth_percent", "%", 10.0, 5.0, True),
    ("position-sensor-lag", "time_constant_ms", "ms", 0.3, 0.2, True),
    ("position-sensor-offset", "offset_mm", "mm", 0.3, 0.03, False),
    ("position-sensor-gain", "gain_percent", "%", 0.2, 0.03, False),
    ("force-sensor-offset", "offset_n", "N", 1.0, 0.25, False),
    ("force-sensor-gain", "gain_percent", "%", 1.0, 0.12, False),
]
CHAMBER_EFFECTS = [
    ("rod-leakage", "leakage_nl_per_min", "Nl/min", 1.0, 0.05, True),
    ("pressure-sensor-lag", "time_constant_ms", "ms", 0.5, 0.2, True),
    ("pressure-sensor-offset", "offset_mbar", "mbar", 10.0, 2.5, False),
    ("pressure-sensor-gain", "gain_percent", "%", 0.3, 0.06, False),
]
# Shapes that are not linear, by (effect, key, unit, law, amounts, more of the effect's numbers).
SHAPES = [
    ("spool-second-order", "natural_frequency_hz", "Hz", "grid", (60.0, 75.0, 90.0, 110.0), {"damping": 0.7}),
    ("spool-rate-limit", "rate_per_s", "1/s", "grid", (25.0, 50.0, 100.0, 180.0), {}),
    ("check-valve-restriction", "orifice_kv_m3_per_h", "m^3/h", "root", (1.0,), {}),
    ("silencer-back-pressure", "silencer_kv_ratio", "", "root", (0.4, 1.0, 2.0), {}),
    ("end-cushion", "cushion_kv_m3_per_h", "m^3/h", "root", (0.03, 0.1, 0.25), {"stop_stiffness_n_per_m": 1e6}),
    ("heat-exchange", "coefficient_w_per_m2_k", "W/(m^2 K)", "grid", (15.0, 30.0, 60.0, 120.0), {}),
    ("stribeck-friction", "velocity_mm_per_s", "mm/s", "grid", (4.0, 8.0, 15.0, 30.0, 45.0), {}),
]
# Factors of the baseline's numbers, carried along: a wrong number is no missing effect. The shares are
# the least that counts, and the tolerance of the file: what stands there was measured or comes from a data sheet.
PARAMETERS = [
    ("mass", "kg", 0.01, 0.03),
    ("viscous-friction", "N/(mm/s)", 0.01, 0.05),
    ("sliding-friction", "N", 0.01, 0.05),
    ("break-away-force", "N", 0.03, 0.05),
    ("supply-pressure", "bar", 0.005, 0.03),
    ("spool-time-constant", "ms", 0.1, 0.2),
    ("flow-lag", "ms", 0.03, 0.1),
    ("kv-scale", "", 0.005, 0.05),
    ("piston-area", "mm^2", 0.008, 0.01),
]


def parameter_value(name, rig, place):
    """The baseline's number in the file's unit; a scale is 1."""
    mass = rig.load_kg if place == "load" else rig.drive_kg
    return {
        "mass": mass,
        "viscous-friction": rig.viscous_n_s_per_m * 1e-3,
        "sliding-friction": rig.sliding_n,
        "break-away-force": rig.break_away_n,
        "supply-pressure": rig.supply_pa * 1e-5,
        "spool-time-constant": rig.spool_s * 1e3,
        "flow-lag": rig.flow_lag_s * 1e3,
        "kv-scale": 1.0,
        "piston-area": rig.area_a_m2 * 1e6,
    }[name]


def of_axis(place, rig):
    """All candidates of one axis."""
    out = []
    for effect, key, unit, amount, least, one_sided in AXIS_EFFECTS:
        out.append(Candidate(effect, place, None, key, unit, amount, (((effect, key), amount),), "linear", 0.0, least, one_sided))
    for element in ("a", "b"):
        for effect, key, unit, amount, least, one_sided in CHAMBER_EFFECTS:
            compensated = (((effect, key, element), amount),)
            out.append(Candidate(effect, place, element, key, unit, amount, compensated, "linear", 0.0, least, one_sided))
    for element in ("position", "force", "a", "b"):
        compensated = ((("time-skew", "delay_ms", element), 1.0),)
        out.append(Candidate("time-skew", place, element, "delay_ms", "ms", 1.0, compensated, "linear", 0.0, 0.2))
    for effect, key, unit, law, amounts, more in SHAPES:
        for amount in amounts:
            rest = tuple(((effect, other), value) for other, value in more.items())
            out.append(Candidate(effect, place, None, key, unit, amount, (((effect, key), amount), *rest), law))
    out += nonlinear_but_monotone(place, rig) + over_position(place) + far(place)
    for name, unit, share, tolerance in PARAMETERS:
        value, effect = parameter_value(name, rig, place), f"parameter:{name}"
        compensated, least = (((effect, "factor"), 1.01),), share * value
        numbers = (unit, 0.01 * value, compensated, "linear", value, least, False, tolerance / 0.01)
        out.append(Candidate(effect, place, None, name, *numbers))
    return out


def nonlinear_but_monotone(place, rig):
    """Effects whose number has a neutral value of its own."""
    effect, key, volume = "dead-volume", "volume_cm3", rig.dead_volume_m3 * 1e6
    more = (((effect, key), volume + 2.0),)
    out = [Candidate(effect, place, None, key, "cm^3", 2.0, more, "linear", volume, 0.5, False)]
    effect, key = "critical-pressure-ratio", "critical_ratio"
    for below, law in ((0.05, "linear"), (0.15, "far"), (0.3, "far")):
        out.append(Candidate(effect, place, None, key, "", -below, (((effect, key), 0.5 - below),), law, 0.5, 0.012))
    return out


# Larger amounts of what is linear for small ones only: (effect, key, unit, elements, amounts).
FAR = [
    ("line-delay", "length_m", "m", (None,), (0.8, 1.6, 3.0)),
    ("command-dead-time", "delay_ms", "ms", (None,), (1.0, 2.0, 4.0)),
    ("position-sensor-lag", "time_constant_ms", "ms", (None,), (2.0, 5.0)),
    ("pressure-sensor-lag", "time_constant_ms", "ms", ("a", "b"), (3.0, 7.0)),
    ("time-skew", "delay_ms", "ms", ("position", "force", "a", "b"), (2.5, 5.0)),
    ("valve-dead-zone", "dead_zone_percent", "%", (None,), (2.0, 4.0)),
    ("valve-hysteresis", "half_width_percent", "%", (None,), (1.0, 2.0)),
    ("friction-asymmetry", "asymmetry_percent", "%", (None,), (-40.0, 40.0)),
    ("line-resistance", "drop_bar", "bar", (None,), (0.3,)),
    ("check-valve-restriction", "cracking_pressure_bar", "bar", (None,), (0.3,)),
]


def far(place):
    out = []
    for effect, key, unit, elements, amounts in FAR:
        for element in elements:
            path = (effect, key, element) if element else (effect, key)
            out += [Candidate(effect, place, element, key, unit, a, ((path, a),), "far") for a in amounts]
    return out


def over_position(place):
    """Bumps and ripples at a few places and pitches."""
    out = []
    for centre in (100.0, 150.0, 200.0, 250.0, 300.0, 350.0, 400.0):
        effect = "position-dependent-friction"
        compensated = (((effect, "bump_n"), 2.0), ((effect, "centre_mm"), centre))
        out.append(Candidate(effect, place, None, "bump_n", "N", 2.0, compensated, "linear", 0.0, 0.5, True))
    for effect in ("position-dependent-friction", "position-dependent-force"):
        for pitch in (20.0, 25.0, 32.0, 40.0, 50.0, 63.0, 80.0, 100.0):
            compensated = (((effect, "ripple_n"), 2.0), ((effect, "pitch_mm"), pitch))
            out.append(Candidate(effect, place, None, "ripple_n", "N", 2.0, compensated, "linear", 0.0, 0.5, True))
    return out


def of_supply():
    compensated = ((("supply-droop", "droop_bar"), 0.1),)
    return [Candidate("supply-droop", "supply", None, "droop_bar", "bar", 0.1, compensated, "linear", 0.0, 0.025)]


def of_linkage(rig):
    gap = rig.gap_m * 1e3
    compensated = ((("coupling-backlash", "gap_mm"), gap + 0.05),)
    give = ((("coupling-compliance", "give_m_per_n"), 1e-7),)
    return [
        Candidate("coupling-backlash", "linkage", None, "gap_mm", "mm", 0.05, compensated, "linear", gap, 0.012, False),
        Candidate("coupling-compliance", "linkage", None, "stiffness_n_per_m", "N/m", 1e-7, give, "give", rig.stiffness_n_per_m,
                  2e-8, False),
    ]  # fmt: skip
