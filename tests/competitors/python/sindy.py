"""PySINDy's optimisers on the same library: sequentially thresholded least squares, alone and as an ensemble.

The states are the stored air of both chambers and the momentum; their rates less the baseline's are the targets, stacked, so that
an effect has one coefficient in all equations. Columns are scaled to unit rms in units of noise: the threshold is on what a term
contributes. Threshold and ridge are those of a grid whose terms, pruned and fitted again, have the least BIC (Mangan, Kutz, Brunton,
Proctor 2017, for AIC). The error on a held-out third was tried first: effects that show in a few moments only went unseen.
"""

import warnings

import numpy as np
from pysindy.optimizers import STLSQ, EnsembleOptimizer

from naming import Choice, fit, stands

# Contribution of a term, rms over all rows, in units of noise.
THRESHOLDS = np.geomspace(0.01, 1.0, 13)
# Ridges for each row: columns that are alike share what they explain instead of cancelling each other.
RIDGES = (1e-4, 1e-3, 1e-2)
MODELS, INCLUDED = 30, 0.8
MOST = 4


def scaled(regression):
    rms = np.sqrt((regression.columns**2).mean(axis=0))
    live = np.flatnonzero(rms * np.sqrt(len(regression.y)) > 1.0)
    return live, regression.columns[:, live] / rms[live]


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


def bic(regression, chosen, fitted, live):
    left = regression.y - regression.columns[:, chosen] @ fitted
    return left @ left + len(chosen) * (np.log(len(left)) + 2 * np.log(len(live)))


def tuned(regression, live, columns):
    """The best choice over the grid with its threshold and ridge; no terms when the baseline alone is as good."""
    short, rows = compressed(columns, regression.y), len(regression.y)
    best = regression.y @ regression.y, Choice([], np.zeros(0), {}, {}), None
    for ridge in RIDGES:
        for threshold in THRESHOLDS:
            coefficients = thresholded(*short, threshold, ridge * rows)
            choice = chosen_from(regression, live, coefficients, np.abs(coefficients))
            score = bic(regression, choice.chosen, choice.coefficients, live)
            if score < best[0]:
                best = score, choice, (threshold, ridge)
    return best[1:]


def stlsq(regression):
    live, columns = scaled(regression)
    return tuned(regression, live, columns)[0]


def ensemble(regression):
    live, columns = scaled(regression)
    nothing, setting = tuned(regression, live, columns)
    if setting is None:
        return nothing
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
    """Those of the terms that lower the BIC when added one by one, the strongest first: several that cancel each other do not."""
    order = [place for place in np.argsort(-score) if coefficients[place] != 0.0]
    support = best_columns(regression, live, coefficients, order)
    chosen, best = [], float(regression.y @ regression.y)
    while len(chosen) < MOST:
        tried = []
        for place in support:
            trial = sorted([*chosen, place])
            if place not in chosen:
                fitted = fit(regression, trial)
                if all(regression.candidates[p].plausible(c) for p, c in zip(trial, fitted, strict=True)):
                    tried.append((bic(regression, trial, fitted, live), trial))
        better = (one for one in sorted(tried) if one[0] < best)
        taken = next((one for one in better if stands(regression, one[1], fit(regression, one[1]))), None)
        if taken is None:
            break
        best, chosen = taken
    fitted = fit(regression, chosen) if chosen else np.zeros(0)
    scores = {int(live[place]): float(score[place]) for place in order}
    return Choice(chosen, fitted, {}, scores)


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
