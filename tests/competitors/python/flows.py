"""Valve, lines and lags: the flow into each chamber as the model has it, with any effect of the catalogue switched on.

`effects` holds numbers in the units of the effects' data sheets, by (effect, key). Flows are normal m3/s into the chamber. What
an effect needs of the flow itself (drops in lines, silencer, droop) it takes from `measured`, which balances.py gives it.
"""

import numpy as np
from scipy.signal import cont2discrete, lfilter

from signals import PERIOD_S, delayed, lag, lag_mean

PARTS = 10


def spool(u, rig, effects):
    """Spool over time, PARTS samples a period."""
    u = u + effects.get(("valve-offset", "offset_percent"), 0.0) / 100.0
    half = effects.get(("valve-hysteresis", "half_width_percent"), 0.0) / 100.0
    if half:
        u = play(u, half)
    u = np.clip(u, -1.0, 1.0)
    delay_s = effects.get(("command-dead-time", "delay_ms"), 0.0) * 1e-3
    fine = np.repeat(u, PARTS)
    if delay_s:
        shift = int(round(delay_s / PERIOD_S * PARTS))
        fine = np.concatenate([np.full(shift, fine[0]), fine])[: len(fine)]
    part_s = PERIOD_S / PARTS
    frequency = effects.get(("spool-second-order", "natural_frequency_hz"))
    rate = effects.get(("spool-rate-limit", "rate_per_s"))
    tau_s = effects.get(("parameter:spool-time-constant", "factor"), 1.0) * rig.spool_s
    if frequency:
        w, z = 2 * np.pi * frequency, effects.get(("spool-second-order", "damping"), 0.7)
        top, bottom, _ = cont2discrete(([w * w], [1.0, 2 * z * w, w * w]), part_s)
        return lfilter(top.ravel(), bottom, fine - fine[0]) + fine[0]
    if rate:
        return rate_limited(fine, tau_s, rate, part_s)
    return lag(fine, tau_s, part_s)


def play(u, half):
    out = np.empty_like(u)
    last = u[0]
    for place, value in enumerate(u):
        last = min(max(last, value - half), value + half)
        out[place] = last
    return out


def rate_limited(u, tau_s, rate, part_s):
    """Only where a lag would be faster than the rate does anything differ; those stretches are stepped one by one."""
    keep, most = np.exp(-part_s / tau_s), rate * part_s
    free = lag(u, tau_s, part_s)
    if np.max(np.abs(np.diff(free)), initial=0.0) <= most:
        return free
    out, last = np.empty_like(u), u[0]
    for place, value in enumerate(u.tolist()):
        step = (value - last) * (1.0 - keep)
        last += min(max(step, -most), most)
        out[place] = last
    return out


def conductances(s, rig, effects):
    """K_V of the four edges, means over each period: supply to a, a to exhaust, supply to b, b to exhaust."""
    dead = effects.get(("valve-dead-zone", "dead_zone_percent"), 0.0) / 100.0
    if dead:
        s = np.sign(s) * np.clip(np.abs(s) - dead, 0.0, None) / (1.0 - dead)
    opening = np.clip(np.abs(s), 0.0, 1.0)
    bend = effects.get(("valve-characteristic", "bend_percent"), 0.0) / 100.0
    ratio = effects.get(("valve-characteristic", "edge_ratio_percent"), 0.0) / 100.0
    if bend:
        opening = np.clip(opening + 2.0 * bend * opening * (1.0 - opening), 0.0, 1.0)
    scale = effects.get(("parameter:kv-scale", "factor"), 1.0)
    supply = np.interp(opening, rig.opening, rig.kv_supply) * (1.0 + ratio / 2.0) * scale
    exhaust = np.interp(opening, rig.opening, rig.kv_exhaust) * (1.0 - ratio / 2.0) * scale
    floor = effects.get(("valve-null-leakage", "leakage_percent"), 0.0) / 100.0 * rig.kv_supply[-1]
    edges = [np.where(s > 0, supply, 0.0), np.where(s < 0, exhaust, 0.0)]
    edges += [np.where(s < 0, supply, 0.0), np.where(s > 0, exhaust, 0.0)]
    return [np.maximum(edge, floor).reshape(-1, PARTS).mean(axis=1) for edge in edges]


def orifice(conductance, far, port, effects):
    """Flow from far to port through a conductance, paper eq. (4), or the ellipse of ISO 6358 with another critical ratio."""
    up, down = np.maximum(far, port), np.minimum(far, port)
    critical = effects.get(("critical-pressure-ratio", "critical_ratio"), 0.5)
    if critical == 0.5:
        middle = np.maximum(down, 0.5 * up)
        flow = conductance * np.sqrt((up - middle) * middle)
    else:
        share = np.clip((down / up - critical) / (1.0 - critical), 0.0, 1.0)
        flow = 0.5 * conductance * up * np.sqrt(1.0 - share * share)
    return np.sign(far - port) * flow


def supply_pressure(base, measured, edges, rig, effects, other):
    """Set pressure less the droop of a regulator that gives the flow which the measured chambers take from it."""
    base = base * effects.get(("parameter:supply-pressure", "factor"), 1.0)
    droop = effects.get(("supply-droop", "droop_bar"), 0.0) * 1e5
    if not droop:
        return base
    drawn = np.where(edges[0] > 0, np.maximum(measured[0], 0), 0) + np.where(edges[2] > 0, np.maximum(measured[1], 0), 0)
    # A node of 0.5 l behind a regulator follows in about 10 ms.
    return base - droop * lag(((drawn + other) / rig.full_flow) ** 2, 0.01)


def exhaust_pressure(measured, edges, rig, effects):
    """Pressure before a silencer of so many times the largest exhaust K_V, through which both chambers vent."""
    ratio = effects.get(("silencer-back-pressure", "silencer_kv_ratio"))
    if not ratio:
        return rig.exhaust_pa
    fed = np.where(edges[1] > 0, np.maximum(-measured[0], 0), 0) + np.where(edges[3] > 0, np.maximum(-measured[1], 0), 0)
    conductance = ratio * rig.kv_exhaust[-1]
    # Below twice the outside pressure; beyond it the silencer chokes and the pressure grows in proportion.
    slow = rig.exhaust_pa + (fed / conductance) ** 2 / rig.exhaust_pa
    return lag(np.where(slow < 2 * rig.exhaust_pa, slow, 2 * fed / conductance), 0.003)


def port_drop(flow, chamber, to_end, rig, effects):
    """What the port has above the chamber, Pa, at the measured flow."""
    drop = np.zeros_like(chamber)
    line = effects.get(("line-resistance", "drop_bar"), 0.0) * 1e5
    if line:
        drop += line * flow * np.abs(flow) / rig.full_flow**2 * (0.5 * rig.supply_pa / chamber)
    cracking = effects.get(("check-valve-restriction", "cracking_pressure_bar"), 0.0) * 1e5
    if cracking:
        drop += cracking * np.tanh(flow / (0.01 * rig.full_flow))
    kv = effects.get(("check-valve-restriction", "orifice_kv_m3_per_h"))
    if kv:
        drop += series(flow, chamber, kv)
    kv = effects.get(("end-cushion", "cushion_kv_m3_per_h"))
    if kv:
        near = to_end < effects.get(("end-cushion", "length_mm"), 20.0) * 1e-3
        drop += np.where(near & (flow < 0), series(flow, chamber, kv), 0.0)
    return drop


def series(flow, chamber, kv):
    """Drop of an orifice next to the chamber, capped where it would choke."""
    conductance = kv * 25.9 / 3600.0 / 1e5
    return np.sign(flow) * np.minimum((flow / conductance) ** 2 / chamber, 0.5 * chamber)


def chamber_flows(data, rig, effects):
    """Model flows into a and b, lagged, and without what leaks within or out of the cylinder."""
    edges = conductances(spool(data.u, rig, effects), rig, effects)
    supply = supply_pressure(data.supply, data.measured, edges, rig, effects, data.other_drawn)
    exhaust = exhaust_pressure(data.measured, edges, rig, effects)
    tau_s = effects.get(("parameter:flow-lag", "factor"), 1.0) * rig.flow_lag_s
    delay_s = effects.get(("line-delay", "length_m"), 0.0) * 2.9e-3
    flows = []
    for chamber, pressure, to_end in ((0, data.pa_mid, data.xi), (1, data.pb_mid, rig.stroke_m - data.xi)):
        port = pressure + port_drop(data.measured[chamber], pressure, to_end, rig, effects)
        fill, vent = edges[2 * chamber], edges[2 * chamber + 1]
        flow = orifice(fill, supply, port, effects) - orifice(vent, port, exhaust, effects)
        flow = lag_mean(flow, tau_s)
        flows.append(delayed(flow, delay_s) if delay_s else flow)
    return flows


def leakages(data, rig, effects):
    """What leaks into a and b, normal m3/s: laminar, k (p1^2 - p2^2) with k from 6 to 1 bar."""
    scale = 1e-3 / 60.0 / (6e5**2 - 1e5**2)
    piston = effects.get(("piston-leakage", "leakage_nl_per_min"), 0.0) * scale * (data.pa**2 - data.pb**2)
    rod_a = effects.get(("rod-leakage", "leakage_nl_per_min", "a"), 0.0) * scale * (data.pa**2 - rig.atmosphere_pa**2)
    rod_b = effects.get(("rod-leakage", "leakage_nl_per_min", "b"), 0.0) * scale * (data.pb**2 - rig.atmosphere_pa**2)
    return -piston - rod_a, piston - rod_b
