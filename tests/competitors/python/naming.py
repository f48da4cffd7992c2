"""From selected columns to the report's names, values and errors; shared by all competitors."""

from dataclasses import dataclass

import numpy as np


@dataclass
class Choice:
    """What a regression selected: places in the library, their coefficients, and what else would have done nearly as well."""

    chosen: list
    coefficients: np.ndarray
    alternatives: dict
    scores: dict


def fit(regression, chosen, ridge=1e-9):
    """Least squares of the chosen columns."""
    columns = regression.columns[:, chosen]
    gram = columns.T @ columns
    gram += ridge * np.diag(np.diag(gram) + 1e-30)
    return np.linalg.solve(gram, columns.T @ regression.y)


def clustered_errors(regression, chosen, coefficients):
    """Standard errors with blocks of time as the independent units (sandwich), never below those of independent rows."""
    columns = regression.columns[:, chosen]
    left = regression.y - columns @ coefficients
    bread = np.linalg.pinv(columns.T @ columns)
    scores = columns * left[:, None]
    _, block = np.unique(regression.block, return_inverse=True)
    sums = np.zeros((block.max() + 1, len(chosen)))
    np.add.at(sums, block, scores)
    sandwich = bread @ (sums.T @ sums) @ bread
    return np.sqrt(np.maximum(np.diag(sandwich), np.diag(bread)))


# Standard errors, clustered, that a column must be away from nothing.
SURE = 3.5


def stands(regression, chosen, coefficients):
    """Whether each column stands by clustered errors."""
    return bool(np.all(np.abs(coefficients) > SURE * clustered_errors(regression, chosen, coefficients)))


def entry(one, value, error):
    parameters = [{"name": one.key, "value": value, "unit": one.unit, "standard_error": error}]
    return {"effect": one.effect, "where": {"axis": one.place, "element": one.element}, "parameters": parameters}


def spread_of_shape(one, library):
    """For the best of a few amounts: half the way to the next one."""
    same = [c.amount for c in library if (c.effect, c.place, c.key) == (one.effect, one.place, one.key)]
    return 0.5 * min((abs(amount - one.amount) for amount in same if amount != one.amount), default=one.amount)


def named(regression, choice):
    """The `named` and `parameters` lists of the report."""
    errors = clustered_errors(regression, choice.chosen, choice.coefficients) if choice.chosen else []
    whole = float(regression.y @ regression.y)
    effects, parameters = [], []
    for position, (place, coefficient) in enumerate(zip(choice.chosen, choice.coefficients, strict=True)):
        one = regression.candidates[place]
        error = one.error(coefficient, errors[position]) if one.law != "grid" else spread_of_shape(one, regression.candidates)
        made = entry(one, one.value(coefficient), error)
        if one.is_parameter:
            numbers = {key: made["parameters"][0][key] for key in ("value", "unit", "standard_error")}
            parameters.append({"name": one.effect, "axis": one.place} | numbers)
            continue
        rest = [p for p in choice.chosen if p != place]
        without = regression.y - regression.columns[:, rest] @ fit(regression, rest) if rest else regression.y
        with_it = regression.y - regression.columns[:, choice.chosen] @ choice.coefficients
        excess = max(whole - len(regression.y), 1.0)
        made["share_explained"] = float(np.clip((without @ without - with_it @ with_it) / excess, 0.0, 1.0))
        made["alternatives"] = [alternative(regression, other) for other in choice.alternatives.get(place, [])]
        merge(effects, made)
    return effects, parameters


def alternative(regression, place):
    """The same kind of entry for a column that would have done nearly as well, by itself."""
    one = regression.candidates[place]
    coefficient = fit(regression, [place])
    error = clustered_errors(regression, [place], coefficient)[0]
    made = entry(one, one.value(coefficient[0]), one.error(coefficient[0], error) or spread_of_shape(one, regression.candidates))
    return made | {"share_explained": None, "alternatives": []}


def merge(effects, made):
    """Two columns of one effect at one place are one effect with two numbers."""
    for there in effects:
        if (there["effect"], there["where"]) == (made["effect"], made["where"]):
            keys = [p["name"] for p in there["parameters"]]
            there["parameters"] += [p for p in made["parameters"] if p["name"] not in keys]
            there["share_explained"] = min(1.0, there["share_explained"] + made["share_explained"])
            return
    effects.append(made)


def not_excited(regression):
    """Effects whose smallest amount that occurs would not be seen: 3 standard errors by itself."""
    out = []
    for place, one in enumerate(regression.candidates):
        strength = float(np.linalg.norm(regression.columns[:, place]))
        least = one.least / abs(one.amount) if one.law in ("linear", "far", "give") and one.least else 1.0
        if strength * least * 4.0 < 3.0 and not one.is_parameter:
            out.append({"effect": one.effect, "where": {"axis": one.place, "element": one.element}})
    unique = []
    return [x for x in out if x not in unique and not unique.append(x)]


def detection_limits(regression):
    """Amount that makes 3 standard errors by itself, in the effect's unit; the least over the columns of an effect."""
    limits = {}
    for place, one in enumerate(regression.candidates):
        strength = float(np.linalg.norm(regression.columns[:, place]))
        if strength > 0.0 and one.law == "linear" and not one.is_parameter:
            name = ".".join(part for part in (one.effect, one.place, one.element) if part)
            limit = {"value": 3.0 * abs(one.amount) / strength, "unit": one.unit}
            if name not in limits or limit["value"] < limits[name]["value"]:
                limits[name] = limit
    return limits
