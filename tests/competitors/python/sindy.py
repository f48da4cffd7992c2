"""PySINDy's optimisers on the same library: sequentially thresholded least squares, alone and as an ensemble.

The states are the stored air of both chambers and the momentum; their rates less the baseline's are the targets, stacked, so that
an effect has one coefficient in all equations. Columns are scaled to unit rms in units of noise: the threshold is on what a term
contributes. Threshold and ridge are the sparsest of a grid that is no worse than the best on the last third of the record by more
than 2.5 standard errors of the difference, stretch by stretch (after the one-standard-error rule of Hastie, Tibshirani, Friedman
2009, 7.10).
"""

import warnings

import numpy as np
from pysindy.optimizers import STLSQ, EnsembleOptimizer

from naming import Choice, fit

# Contribution of a term, rms over all rows, in units of noise.
THRESHOLDS = np.geomspace(0.01, 1.0, 13)
# Ridges for each row: columns that are alike share what they explain instead of cancelling each other.
RIDGES = (1e-4, 1e-3, 1e-2)
MODELS, INCLUDED = 30, 0.8
MOST = 4
# Standard errors by which a fuller model must be better on what it did not see.
SURE = 2.5
# A term goes when the fit loses less than this share of what it loses with the strongest one, or less than 6 sigma.
LEAST_LOSS, LEAST_GAIN = 0.05, 36.0


def scaled(regression):
    rms = np.sqrt((regression.columns**2).mean(axis=0))
    live = np.flatnonzero(rms * np.sqrt(len(regression.y)) > 1.0)
    return live, regression.columns[:, live] / rms[live], rms


def compressed(columns, y):
    """Fewer rows with the same sums of squares: least squares cannot tell the triangle of a QR decomposition from the rows."""
    triangle = np.linalg.qr(np.column_stack([columns, y]), mode="r")
    return triangle[:, :-1], triangle[:, -1]


def thresholded(columns, y, threshold, ridge):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        optimizer = STLSQ(threshold=threshold, alpha=ridge, max_iter=20)
        optimizer.fit(columns, y[:, None])
    return optimizer.coef_.ravel()


def held_out(regression):
    """Rows of the last third of each record, by time."""
    record = regression.block // 10_000
    out = np.zeros(len(regression.y), bool)
    # Rows of priors belong to no record, and are no test.
    for number in np.unique(record[record >= 0]):
        own = record == number
        out |= own & (regression.block >= np.quantile(regression.block[own], 2 / 3))
    return out


def tuned(regression, columns):
    """Threshold and ridge by held-out error; `None` when the baseline alone is as good."""
    test = held_out(regression)
    _, block = np.unique(regression.block[test], return_inverse=True)

    def errors(left):
        return np.bincount(block, left**2) / np.bincount(block)

    tried = [(0, None, errors(regression.y[test]))]
    short, rest = compressed(columns[~test], regression.y[~test]), np.count_nonzero(~test)
    for ridge in RIDGES:
        for threshold in THRESHOLDS:
            coefficients = thresholded(*short, threshold, ridge * rest)
            left = regression.y[test] - columns[test] @ coefficients
            tried.append((np.count_nonzero(coefficients), (threshold, ridge), errors(left)))
    best = min(tried, key=lambda entry: entry[2].mean())[2]
    # In pairs: what differs is told apart from how much the stretches of a record differ among themselves.
    worse = [entry[2] - best for entry in tried]
    good = [entry for entry, more in zip(tried, worse, strict=True) if more.mean() <= SURE * more.std() / np.sqrt(len(more))]
    return min(good, key=lambda entry: (entry[0], entry[2].mean()))[1]


def stlsq(regression):
    live, columns, _ = scaled(regression)
    setting = tuned(regression, columns)
    if setting is None:
        return Choice([], np.zeros(0), {}, {})
    threshold, ridge = setting
    coefficients = thresholded(*compressed(columns, regression.y), threshold, ridge * len(regression.y))
    return chosen_from(regression, live, coefficients, np.abs(coefficients))


def ensemble(regression):
    live, columns, _ = scaled(regression)
    setting = tuned(regression, columns)
    if setting is None:
        return Choice([], np.zeros(0), {}, {})
    threshold, ridge = setting
    np.random.seed(1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        single = STLSQ(threshold=threshold, alpha=ridge * len(regression.y), max_iter=20)
        many = EnsembleOptimizer(single, bagging=True, n_models=MODELS)
        many.fit(columns, regression.y[:, None])
    coefficients = np.array(many.coef_list).reshape(MODELS, -1)
    inclusion = inclusion_of_effects(regression, live, coefficients)
    mean = coefficients.mean(axis=0) * (inclusion >= INCLUDED)
    return chosen_from(regression, live, mean, inclusion * np.abs(mean))


def inclusion_of_effects(regression, live, coefficients):
    """In how many of the models an effect is: by any of its columns, between which the models toss a coin."""
    keys = [(one.effect, one.place, one.element) for one in (regression.candidates[place] for place in live)]
    out = np.zeros(len(live))
    for key in set(keys):
        own = np.array([other == key for other in keys])
        out[own] = np.mean(np.any(coefficients[:, own] != 0.0, axis=1))
    return out


def chosen_from(regression, live, coefficients, score):
    """The terms that are left when those which matter least go one by one, as for a user who wants names and not thirty terms."""
    order = [place for place in np.argsort(-score) if coefficients[place] != 0.0]
    chosen = best_columns(regression, live, coefficients, order)
    last = []
    while chosen:
        fitted = fit(regression, chosen)
        losses = drop_losses(regression, chosen, fitted)
        implausible = [not regression.candidates[p].plausible(c) for p, c in zip(chosen, fitted, strict=True)]
        worst = min(range(len(chosen)), key=lambda place: (not implausible[place], losses[place]))
        enough = not any(implausible) and len(chosen) <= MOST and losses[worst] > LEAST_LOSS * max(losses)
        if enough and losses[worst] > LEAST_GAIN:
            break
        last = [chosen.pop(worst), *last]
    fitted = fit(regression, chosen) if chosen else np.zeros(0)
    scores = {int(live[place]): float(score[place]) for place in order}
    alternatives = {chosen[0]: [p for p in last[:2] if not regression.candidates[p].is_parameter]} if chosen else {}
    return Choice(chosen, fitted, alternatives, scores)


def best_columns(regression, live, coefficients, order):
    """For each number of an effect that has terms: the one of its columns that explains best what the other terms leave to it."""
    keys = [key_of(regression.candidates[place]) for place in live]
    columns = regression.columns[:, live]
    scaled_back = coefficients / (np.sqrt((columns**2).mean(axis=0)) + 1e-300)
    left = regression.y - columns @ scaled_back
    chosen, seen = [], set()
    for key in (keys[place] for place in order):
        if key in seen:
            continue
        seen.add(key)
        own = [place for place, other in enumerate(keys) if other == key]
        part = left + columns[:, own] @ scaled_back[own]
        strength = (columns[:, own] ** 2).sum(axis=0)
        single = columns[:, own].T @ part / strength
        fitting = [n for n, place in enumerate(own) if regression.candidates[live[place]].plausible(single[n])]
        if fitting:
            best = max(fitting, key=lambda n: single[n] ** 2 * strength[n])
            chosen.append(int(live[own[best]]))
    return chosen


def key_of(one):
    return one.effect, one.place, one.element, one.key


def drop_losses(regression, chosen, fitted):
    """What the fit loses with each term, in units of chi2, for small changes of the others: c^2 / (G^-1)_jj."""
    columns = regression.columns[:, chosen]
    inverse = np.linalg.pinv(columns.T @ columns)
    return list(fitted**2 / np.maximum(np.diag(inverse), 1e-300))
