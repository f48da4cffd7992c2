"""Columns and residuals of one or several records, stacked and in units of their noise: what the regressions work on."""

from dataclasses import dataclass

import numpy as np

import balances
import candidates

# One row in 10 ms: the kernels leave about one independent value in that time.
EVERY = 10
# Standard errors count in stretches of this length, within which nothing is independent.
BLOCK_S = 0.5


@dataclass
class Regression:
    """y = columns @ coefficients + noise of size 1."""

    candidates: list
    columns: np.ndarray
    y: np.ndarray
    block: np.ndarray
    balance: np.ndarray
    names: list
    scale: dict


def build(records, rig, scale=None, only=None):
    """Stacks the records' balances in units of `scale`, by default their noise; `only` takes these places of the library."""
    library = []
    for place in records[0].axes:
        library += candidates.of_axis(place, rig)
    library += candidates.of_supply()
    if records[0].linked and len(records[0].axes) == 2:
        library += candidates.of_linkage(rig)
    library = library if only is None else [library[place] for place in only]
    columns, ys, blocks, labels, names = [], [], [], [], None
    for number, record in enumerate(records):
        events = balances.find_starts(record, rig)
        base, views = balances.residuals(record, rig, events)
        masks = balances.masks(record, views, events, rig)
        names = names or list(base)
        scale = scale or balances.noise(rig, views)
        rows = {key: rows_of(key, masks[key]) for key in names}
        moved = [moved_balances(record, rig, events, base, one) for one in library]
        for label, key in enumerate(names):
            rows_here = rows[key]
            ys.append(base[key][rows_here] / scale[key])
            parts = [change[key][rows_here] / scale[key] for change in moved]
            columns.append(np.column_stack(parts) if parts else np.zeros((len(rows_here), 0)))
            time = events[key[0]].places[rows_here] * 1e-3 if key[1] == "break" else rows_here * 1e-3
            blocks.append((time / BLOCK_S).astype(int) + 10_000 * number)
            labels.append(np.full(len(rows_here), label))
    parts = np.vstack(columns), np.concatenate(ys), np.concatenate(blocks), np.concatenate(labels)
    regression = Regression(library, *parts, names, dict(scale))
    if only is None:
        coarser(regression)
        add_priors(regression)
    return regression


def coarser(regression):
    """Where even all candidates together leave more than the noise of the data sheet (coloured, jitter), that is the noise."""
    columns, y = regression.columns, regression.y
    rms = np.sqrt((columns**2).mean(axis=0)) + 1e-12
    gram = (columns / rms).T @ (columns / rms)
    # A ridge of a hundredth of a column's own weight: many columns are nearly alike.
    ridge = 0.01 * len(y) * np.eye(len(rms))
    left = y - (columns / rms) @ np.linalg.solve(gram + ridge, (columns / rms).T @ y)
    for label, key in enumerate(regression.names):
        rows = regression.balance == label
        if rows.sum() > 20:
            factor = max(1.0, float(np.sqrt(np.mean(left[rows] ** 2))))
            regression.scale[key] *= factor
            regression.y[rows] /= factor
            regression.columns[rows] /= factor


def rows_of(key, mask):
    places = np.flatnonzero(mask)
    return places if key[1] == "break" else places[places % EVERY == 0]


def moved_balances(record, rig, events, base, one):
    """What one amount of the candidate makes in each balance."""
    moved, _ = balances.residuals(record, rig, events, one.place, dict(one.compensated), base)
    return {key: base[key] - moved[key] for key in base}


def add_priors(regression):
    """A row for each parameter that says 0 within its tolerance: several that are off together would else cost nothing."""
    rows = np.zeros((0, len(regression.candidates)))
    for place, one in enumerate(regression.candidates):
        if one.prior:
            row = np.zeros((1, len(regression.candidates)))
            row[0, place] = 1.0 / one.prior
            rows = np.vstack([rows, row])
    regression.columns = np.vstack([regression.columns, rows])
    regression.y = np.concatenate([regression.y, np.zeros(len(rows))])
    regression.block = np.concatenate([regression.block, np.full(len(rows), -1)])
    regression.balance = np.concatenate([regression.balance, np.full(len(rows), -1)])
