#!/usr/bin/env python3
"""Collects the evidence of explanations on draws of the study, and fits a conditional logit to it.

  explanations.py collect STUDY [--left-out] [--most N] [--program FILE | --label NAME]
                          appends to explanations.csv; draws that are there are not done again
  explanations.py fit [--write]
                          prints weights, and the reliability of cross-validated probabilities

STUDY is a folder of `scripts/study` with records (`one records`), and with classes where `cosines` was run. --left-out takes the hidden effect and
those alike out of the catalogue: then none of these is right. The program is the example `explanations` of the crate
discrepancy: cargo build --release -p discrepancy --example explanations. --label takes the reports of a study that was run
(`scripts/study run`, `one run`, `one leave-out`) under that label instead. Rows with each_axis 0 are of programs that had one weight for
both axes; of exact records, whose right explanation leaves nothing on either axis. Rows of seeds 15 and 3769683697404522 are of
programs whose amplitude variation was that of the derivative.

Conditional logit (McFadden 1974): of a record, explanation j has the probability exp(w'x_j) / sum_k exp(w'x_k). The weights
maximise the log-likelihood of the right explanations minus RIDGE |w|^2 / 2.
"""

import argparse
import csv
import itertools
import json
import math
import operator
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
TABLE = HERE / "explanations.csv"
WEIGHTS = HERE / "weights.json"
RIG = HERE.parents[1] / "plant" / "rig.toml"
PROGRAM = HERE.parents[1] / "target" / "release" / "examples" / "explanations"

EVIDENCE = ["loss_per_dof", "behind", "parameters_moved", "amplitude_variation", "smallest_amplitude", "small_beside", "share"]
COLUMNS = ["seed", "draw", "left_out", "background", "hidden", "kind", "sets", "right", *EVIDENCE, "each_axis"]
# Cosine above which two effects count as one class, as in the study.
TWIN_COSINE = 0.95

Row = dict[str, str]
Vector = list[float]


def name(effect: dict[str, object]) -> str:
    """Effect and place, as `piston-leakage drive`."""
    where = effect["where"]
    if isinstance(where, dict):
        where = f"{where['axis']}.{where['element']}" if where["element"] else where["axis"]
    return f"{effect['effect']} {where}"


def collect(arguments: argparse.Namespace) -> None:
    study: Path = arguments.study
    plan = json.loads((study / "draws.json").read_text())
    done = {(row["seed"], row["draw"], row["left_out"]) for row in rows()}
    added = 0
    for draw in in_turn(plan["draws"]):
        if added == arguments.most:
            break
        number, hidden = draw["number"], draw["hidden"]
        key = (str(plan["seed"]), str(number), str(int(arguments.left_out)))
        record = study / "records" / f"{number:04}" / "train" / "measurement.csv"
        classes = study / "classes" / f"{number:04}.json"
        if key in done or (arguments.left_out and len(hidden) != 1):
            continue
        twins = twins_of(classes, hidden)
        without = sorted({twin.split()[0] for twin in set().union(*twins)}) if arguments.left_out else []
        if arguments.label:
            report = study / "runs" / arguments.label / f"{number:04}" / "report.json"
            explanations = json.loads(report.read_text()).get("explanations") if report.exists() else None
        elif record.exists():
            command = [arguments.program, RIG, record, *without]
            explanations = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        else:
            explanations = None
        if not explanations:
            continue
        append(judged(key, explanations, truths(draw, left_out=arguments.left_out), twins, draw))
        added += 1


def truths(draw: dict, *, left_out: bool) -> set[str]:
    """Kinds of explanations that may be right: that small effects of the background are missing is true as well."""
    if left_out:
        return {"none-of-these"}
    if draw["hidden"]:
        return {"effects"}
    numbers = "parameters" if draw["wrong_parameters"] else "nothing"
    return {numbers, "none-of-these"} if draw.get("background") else {numbers}


def in_turn(draws: list[dict]) -> list[dict]:
    """Kinds of draws in turn, so that what is done at any time is a little of each."""
    ranked = []
    kinds: dict[str, list[dict]] = {}
    for draw in draws:
        kinds.setdefault(draw["kind"], []).append(draw)
    for of_kind in kinds.values():
        ranked += [((at + 0.5) / len(of_kind), draw["number"], draw) for at, draw in enumerate(of_kind)]
    return [draw for _, _, draw in sorted(ranked, key=lambda entry: entry[:2])]


def twins_of(classes: Path, hidden: list[dict]) -> list[set[str]]:
    """What each hidden effect may be called: where no classes are known, an effect is alone in its own."""
    if not classes.exists():
        return [{name(own)} for own in hidden]
    known = json.loads(classes.read_text())["hidden"]
    return [
        {name(own), *(name(other) for other in entry["members"] if other["cosine"] > TWIN_COSINE and other["where"])}
        for own, entry in zip(hidden, known, strict=True)
    ]


def stands_for(names: list[str], twins: list[set[str]]) -> bool:
    """Whether each hidden effect is one of the names, and each name one of them."""
    if len(names) != len(twins):
        return False
    if not names:
        return True
    return any(
        names[0] in twin and stands_for(names[1:], twins[:at] + twins[at + 1 :]) for at, twin in enumerate(twins)
    )


def judged(key: tuple[str, str, str], explanations: list[dict], truth: set[str], twins: list[set[str]], draw: dict) -> list[Row]:
    made = []
    for explanation in explanations:
        sets = [[name(effect) for effect in effects] for effects in explanation["sets"]]
        right = explanation["kind"] in truth
        if explanation["kind"] == "effects":
            right = right and any(stands_for(names, twins) for names in sets)
        evidence = explanation["evidence"] or {}
        numbers = {field: evidence.get(field) for field in EVIDENCE}
        made.append(
            {
                **dict(zip(COLUMNS, key, strict=False)),
                "background": str(int(bool(draw.get("background")))),
                "hidden": " + ".join(name(effect) for effect in draw["hidden"]),
                "kind": explanation["kind"],
                "sets": " | ".join(" + ".join(names) for names in sets),
                "right": str(int(right)),
                **{field: "" if number is None else f"{number:.6g}" for field, number in numbers.items()},
                "each_axis": "1",
            }
        )
    if all(row["right"] == "0" for row in made):
        made[-1]["right"] = "1"
    return made


def rows() -> list[Row]:
    if not TABLE.exists():
        return []
    with TABLE.open(newline="") as table:
        return list(csv.DictReader(table))


def append(made: list[Row]) -> None:
    new = not TABLE.exists()
    with TABLE.open("a", newline="") as table:
        writer = csv.DictWriter(table, COLUMNS, lineterminator="\n")
        if new:
            writer.writeheader()
        writer.writerows(made)
    right = next(row for row in made if row["right"] == "1")
    print(f"seed {right['seed']} draw {right['draw']}: {right['kind']} {right['sets']}", flush=True)


# Regressors: constants of the kinds, then evidence on the scales on which the program decides; their names are those of weights.json.
REGRESSORS = [
    "parameters", "effects", "none_of_these", "selected", "behind", "excess", "excess_of_effects", "parameters_alone",
    "variation", "amplitude",
]  # fmt: skip
# Of the normal prior of a weight, whose standard deviation is its inverse square root; and the probability of none of these whatever
# the evidence says. Both minimise the cross-validated log loss of the draws of seed 15.
RIDGE = 0.5
LAPSE = 0.02
FOLDS = 10
# Ends of the bins of probability.
BINS = [0.0, 0.1, 0.5, 0.9, 0.99, 1.0]
STEPS = 60


def regressors(row: Row, *, selected: bool) -> Vector:
    """Of an explanation; `selected` is the set of effects that the search chose, the first of them."""
    kind = row["kind"]
    if kind == "none-of-these":
        return [float(regressor == "none_of_these") for regressor in REGRESSORS]
    moved = float(row["parameters_moved"])
    amplitude = float(row["smallest_amplitude"] or 1)
    # Amplitudes that cannot be compared between windows count as varying by their size.
    variation = float(row["amplitude_variation"] or 1) if kind == "effects" else 0.0
    excess = math.log1p(max(float(row["loss_per_dof"]), 0) / 0.08)
    return [
        float(kind == "parameters"),
        float(kind == "effects"),
        0.0,
        float(selected),
        math.log1p(float(row["behind"]) / 9),
        excess,
        excess if kind == "effects" else 0.0,
        math.log(max(moved, 1e-3) / 0.1) if kind == "parameters" else 0.0,
        math.log1p(variation / 0.1),
        math.log(min(max(amplitude, 1), 10)),
    ]


def records() -> list[tuple[list[Vector], list[bool]]]:
    """Regressors of the explanations of each record, and which are right."""
    of: dict[tuple[str, str, str], list[Row]] = {}
    for row in rows():
        of.setdefault((row["seed"], row["draw"], row["left_out"]), []).append(row)
    known = []
    for record in of.values():
        first = next((at for at, row in enumerate(record) if row["kind"] == "effects"), None)
        rows_of = [regressors(row, selected=at == first) for at, row in enumerate(record)]
        known.append((rows_of, [row["right"] == "1" for row in record]))
    return known


def probabilities(weights: Vector, explanations: list[Vector]) -> Vector:
    utilities = [sum(map(operator.mul, weights, x)) for x in explanations]
    most = max(utilities)
    shares = [math.exp(utility - most) for utility in utilities]
    return [share / sum(shares) for share in shares]


def moments(shares: Vector, explanations: list[Vector]) -> tuple[Vector, list[Vector]]:
    """Mean and covariance of the regressors."""
    size = range(len(explanations[0]))
    mean = [sum(p * x[i] for p, x in zip(shares, explanations, strict=True)) for i in size]
    return mean, [
        [sum(p * (x[i] - mean[i]) * (x[j] - mean[j]) for p, x in zip(shares, explanations, strict=True)) for j in size]
        for i in size
    ]


def solved(matrix: list[Vector], vector: Vector) -> Vector:
    """Gaussian elimination with pivots."""
    rows_left = [[*row, value] for row, value in zip(matrix, vector, strict=True)]
    size = len(vector)
    for at in range(size):
        pivot = max(range(at, size), key=lambda row: abs(rows_left[row][at]))
        rows_left[at], rows_left[pivot] = rows_left[pivot], rows_left[at]
        for row in range(size):
            if row != at:
                factor = rows_left[row][at] / rows_left[at][at]
                rows_left[row] = [x - factor * y for x, y in zip(rows_left[row], rows_left[at], strict=True)]
    return [rows_left[at][-1] / rows_left[at][at] for at in range(size)]


def objective(weights: Vector, chosen: list[tuple[list[Vector], list[bool]]]) -> float:
    likelihood = 0.0
    for explanations, right in chosen:
        shares = probabilities(weights, explanations)
        likelihood += math.log(max(sum(itertools.compress(shares, right)), 1e-300))
    return likelihood - 0.5 * RIDGE * sum(weight * weight for weight in weights)


def fitted(chosen: list[tuple[list[Vector], list[bool]]]) -> Vector:
    """Newton's method with halved steps; of several right explanations the covariance of all bounds the curvature."""
    size = range(len(REGRESSORS))
    weights = [0.0 for _ in size]
    for _ in range(STEPS):
        gradient = [-RIDGE * weight for weight in weights]
        curvature = [[RIDGE * (i == j) for j in size] for i in size]
        for explanations, right in chosen:
            shares = probabilities(weights, explanations)
            mean, covariance = moments(shares, explanations)
            of_right = sum(itertools.compress(shares, right))
            for i in size:
                at_right = sum(p * x[i] for p, x, is_right in zip(shares, explanations, right, strict=True) if is_right)
                gradient[i] += at_right / max(of_right, 1e-300) - mean[i]
                curvature[i] = [one + other for one, other in zip(curvature[i], covariance[i], strict=True)]
        step = solved(curvature, gradient)
        before, length = objective(weights, chosen), 1.0
        while length > 1e-4:
            tried = [weight + length * change for weight, change in zip(weights, step, strict=True)]
            if objective(tried, chosen) >= before:
                break
            length /= 2
        if length <= 1e-4 or max(map(abs, step)) < 1e-9:
            break
        weights = tried
    return weights


def fit(arguments: argparse.Namespace) -> None:
    known = records()
    weights = dict(zip(REGRESSORS, fitted(known), strict=True)) | {"lapse": LAPSE}
    if arguments.write:
        rounded = {regressor: round(weight, 4) for regressor, weight in weights.items()}
        WEIGHTS.write_text(json.dumps(rounded, indent=2) + "\n")
    for regressor, weight in weights.items():
        print(f"{regressor:16} {weight:8.3f}")
    said: list[tuple[float, bool]] = []
    loss, first = 0.0, 0
    for fold in range(FOLDS):
        of_others = fitted([record for at, record in enumerate(known) if at % FOLDS != fold])
        for explanations, right in known[fold::FOLDS]:
            shares = [(1 - LAPSE) * share for share in probabilities(of_others, explanations)]
            shares[-1] += LAPSE  # none of these comes last
            loss -= math.log(max(sum(itertools.compress(shares, right)), 1e-300))
            first += right[shares.index(max(shares))]
            said += zip(shares, right, strict=True)
    print(f"{len(known)} records in {FOLDS} folds that the weights did not see: mean log loss {loss / len(known):.3f},")
    print(f"the right explanation is the most probable one of {first}")
    print("probability     explanations  mean said  right")
    for low, high in itertools.pairwise(BINS):
        of_bin = [(p, right) for p, right in said if low <= p < high or p == high == 1]
        if of_bin:
            mean = sum(p for p, _ in of_bin) / len(of_bin)
            right_share = sum(right for _, right in of_bin) / len(of_bin)
            print(f"{low:5.2f} to {high:5.2f} {len(of_bin):15} {mean:10.3f} {right_share:6.3f}")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    collecting = commands.add_parser("collect")
    collecting.add_argument("study", type=Path)
    collecting.add_argument("--left-out", action="store_true")
    collecting.add_argument("--most", type=int, help="draws that are added at most")
    collecting.add_argument("--program", type=Path, default=PROGRAM)
    collecting.add_argument("--label", help="reports of a study that was run, in place of the program")
    collecting.set_defaults(run=collect)
    fitting = commands.add_parser("fit")
    fitting.add_argument("--write", action="store_true", help="writes weights.json, which the program holds")
    fitting.set_defaults(run=fit)
    arguments = parser.parse_args()
    arguments.run(arguments)
    return 0


if __name__ == "__main__":
    sys.exit(main())
