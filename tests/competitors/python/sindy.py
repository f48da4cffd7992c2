"""PySINDy's optimisers on the same library: sequentially thresholded least squares, alone and as an ensemble.

The states are the stored air of both chambers and the momentum; their rates less the baseline's are the targets, stacked, so that an effect has
one coefficient in all equations. Columns are scaled to unit rms in units of noise: the threshold is on what a term contributes. It is the
largest one of a grid whose error on the last third of the record is within one standard error of the best (Hastie, Tibshirani, Friedman
2009, 7.10).
"""

import warnings

import numpy as np
from pysindy.optimizers import STLSQ, EnsembleOptimizer

from naming import Choice, fit

# Contribution of a term, rms over all rows, in units of noise.
THRESHOLDS = np.geomspace(0.01, 1.0, 13)
# Ridge of each regression: columns that are alike share what they explain.
RIDGE = 1e-2
MODELS, INCLUDED = 30, 0.8
MOST = 4


def scaled(regression):
    rms = np.sqrt((regression.columns**2).mean(axis=0))
    live = np.flatnonzero(rms * np.sqrt(len(regression.y)) > 1.0)
    return live, regression.columns[:, live] / rms[live], rms


def thresholded(columns, y, threshold):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        optimizer = STLSQ(threshold=threshold, alpha=RIDGE, max_iter=20)
        optimizer.fit(columns, y[:, None])
    return optimizer.coef_.ravel()


def held_out(regression):
    """Rows of the last third of each record, by time."""
    record = regression.block // 10_000
    out = np.zeros(len(regression.y), bool)
    for number in np.unique(record):
        own = record == number
        out |= own & (regression.block >= np.quantile(regression.block[own], 2 / 3))
    return out


def best_threshold(regression, columns):
    test = held_out(regression)
    blocks = regression.block[test]
    errors = []
    for threshold in THRESHOLDS:
        coefficients = thresholded(columns[~test], regression.y[~test], threshold)
        left = regression.y[test] - columns[test] @ coefficients
        errors.append(np.array([np.mean(left[blocks == b] ** 2) for b in np.unique(blocks)]))
    errors.append(np.array([np.mean(regression.y[test][blocks == b] ** 2) for b in np.unique(blocks)]))
    means = np.array([error.mean() for error in errors])
    best = int(np.argmin(means))
    margin = errors[best].std() / np.sqrt(len(errors[best]))
    # The last entry is the baseline alone.
    simplest = max(place for place in range(len(means)) if means[place] <= means[best] + margin)
    return THRESHOLDS[simplest] if simplest < len(THRESHOLDS) else None


def stlsq(regression):
    live, columns, rms = scaled(regression)
    threshold = best_threshold(regression, columns)
    if threshold is None:
        return Choice([], np.zeros(0), {}, {})
    coefficients = thresholded(columns, regression.y, threshold)
    return chosen_from(regression, live, coefficients, np.abs(coefficients))


def ensemble(regression):
    live, columns, rms = scaled(regression)
    threshold = best_threshold(regression, columns)
    if threshold is None:
        return Choice([], np.zeros(0), {}, {})
    np.random.seed(1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        single = STLSQ(threshold=threshold, alpha=RIDGE, max_iter=20)
        many = EnsembleOptimizer(single, bagging=True, n_models=MODELS)
        many.fit(columns, regression.y[:, None])
    coefficients = np.array(many.coef_list).reshape(MODELS, -1)
    inclusion = np.mean(coefficients != 0.0, axis=0)
    median = np.median(coefficients, axis=0) * (inclusion >= INCLUDED)
    return chosen_from(regression, live, median, inclusion * np.abs(median))


def chosen_from(regression, live, coefficients, score):
    """The strongest terms, each effect once, fitted again without the ridge; the others of nearly the same strength as alternatives."""
    order = [place for place in np.argsort(-score) if coefficients[place] != 0.0]
    chosen, others, seen = [], [], set()
    for place in order:
        one = regression.candidates[live[place]]
        key = (one.effect, one.place, one.element)
        if key in seen:
            continue
        seen.add(key)
        strong = score[place] >= 0.3 * score[order[0]] and len(chosen) < MOST
        (chosen if strong else others).append(int(live[place]))
    # As any user would: a term of the wrong sign or too small to be one is struck out, and the rest fitted again.
    while chosen:
        fitted = fit(regression, chosen)
        bad = [p for p, c in zip(chosen, fitted, strict=True) if not regression.candidates[p].plausible(c)]
        if not bad:
            break
        chosen.remove(bad[-1])
    fitted = fit(regression, chosen) if chosen else np.zeros(0)
    scores = {int(live[place]): float(score[place]) for place in order}
    return Choice(chosen, fitted, {chosen[0]: others[:2]} if chosen else {}, scores)
