"""Reads measurement.csv onto an even grid of 1 ms, with a mask of what can be used."""

import re
from dataclasses import dataclass

import numpy as np

PERIOD_S = 1e-3
COLUMNS = {"u": "valve", "x": "position_m", "force": "force_N", "pa": "pressure_a_Pa", "pb": "pressure_b_Pa"}


class BadData(Exception):
    """A record that no balance can be made of."""


@dataclass
class AxisData:
    """One axis on the grid: valve held, the rest interpolated over at most a few missing samples."""

    u: np.ndarray
    x: np.ndarray
    force: np.ndarray
    pa: np.ndarray
    pb: np.ndarray


@dataclass
class Record:
    """A record: what was measured of each axis, which samples are there, how the rig was set up."""

    axes: dict
    usable: np.ndarray
    linked: bool
    added_mass_kg: float
    supply_pa: np.ndarray | None


def read(path):
    linked, added, lines = False, 0.0, []
    with open(path, encoding="utf-8") as file:
        for number, line in enumerate(file):
            if not line.startswith("#"):
                lines.append(line)
            elif number == 0:
                linked = "linked=true" in line
                found = re.search(r"added_mass_kg=([0-9.eE+-]+)", line)
                added = float(found[1]) if found else 0.0
    if len(lines) < 500:
        raise BadData(f"{path}: {max(len(lines) - 1, 0)} rows; at least 500 are needed")
    names = [name.strip() for name in lines[0].split(",")]
    try:
        table = np.genfromtxt(lines[1:], delimiter=",", dtype=float)
    except ValueError as error:
        raise BadData(f"{path}: {error}") from error
    if "time_s" not in names or table.ndim != 2 or table.shape[1] != len(names):
        raise BadData(f"{path}: no table with time_s")
    column = {name: table[:, place] for place, name in enumerate(names)}
    return on_grid(path, column, linked, added)


def on_grid(path, column, linked, added):
    time = column["time_s"]
    good = np.isfinite(time)
    order = np.argsort(time[good], kind="stable")
    time = time[good][order]
    time, first = np.unique(time, return_index=True)
    if len(time) < 500:
        raise BadData(f"{path}: fewer than 500 different times")
    grid = np.arange(time[0], time[-1] + 0.5 * PERIOD_S, PERIOD_S)
    if len(grid) > 50 * len(time):
        raise BadData(f"{path}: rows are {np.median(np.diff(time))} s apart; 1 ms is needed")
    # A sample is there if a row lies within 0.6 ms of it; derivatives need their neighbours too.
    near = np.clip(np.searchsorted(time, grid), 1, len(time) - 1)
    distance = np.minimum(np.abs(grid - time[near - 1]), np.abs(time[near] - grid))
    usable = distance < 0.6 * PERIOD_S

    def spread(name, held=False):
        nonlocal usable
        values = column[name][good][order][first]
        there = np.isfinite(values)
        if there.sum() < 500:
            raise BadData(f"{path}: column {name} has {there.sum()} values")
        if held:
            place = np.searchsorted(time[there], grid + 1e-9, side="right") - 1
            return values[there][np.clip(place, 0, None)]
        if not there.all():
            usable &= np.interp(grid, time, there.astype(float)) > 0.99
        return np.interp(grid, time[there], values[there])

    axes = {}
    for axis in ("drive", "load"):
        named = {key: f"{axis}_{name}" for key, name in COLUMNS.items()}
        there = [name in column for name in named.values()]
        if all(there):
            data = AxisData(**{key: spread(name, held=key == "u") for key, name in named.items()})
            check(path, axis, data)
            axes[axis] = data
        elif any(there):
            raise BadData(f"{path}: {axis} lacks " + ", ".join(n for n in named.values() if n not in column))
    if not axes:
        raise BadData(f"{path}: columns of neither axis")
    supply = spread("supply_pressure_Pa") if "supply_pressure_Pa" in column else None
    return Record(axes, usable, linked, added, supply)


def check(path, axis, data):
    """Refuses what cannot be a measurement of this rig at all."""
    if np.max(np.abs(data.u)) > 1.001:
        raise BadData(f"{path}: {axis}_valve beyond -1 to 1")
    for name, values in (("pressure_a_Pa", data.pa), ("pressure_b_Pa", data.pb)):
        if np.median(values) < 5e4 or np.median(values) > 2e6:
            raise BadData(f"{path}: {axis}_{name} around {np.median(values):.3g} is no absolute pressure in Pa")
    for name in ("x", "pa", "pb"):
        if np.ptp(getattr(data, name)) == 0.0:
            raise BadData(f"{path}: {axis}_{COLUMNS[name]} never changes")
