"""The command line of the workflow, for the reference competitors.

    program.py METHOD close --rig rig.toml --train A.csv [B.csv ...] --test C.csv --out DIR

writes DIR/report.json and never fails on a record: what cannot be used is `bad-data`, with the reason. `--test` is opened for
`gap` alone.
"""

import argparse
import json
import math
import os
import sys
import time
import traceback

import numpy as np

import candidates
import library
import naming
import record
import rig as rig_file
import sindy
import stepwise

METHODS = {"stepwise-bic": stepwise.select, "pysindy-stlsq": sindy.stlsq, "pysindy-ensemble": sindy.ensemble}
SCHEMA = 1


def parse(arguments):
    parser = argparse.ArgumentParser(prog="program.py METHOD", description="A reference competitor of the study.")
    commands = parser.add_subparsers(dest="command", required=True)
    close = commands.add_parser("close", help="find what a rig file's model lacks, from records")
    close.add_argument("--rig", required=True)
    close.add_argument("--train", required=True, nargs="+")
    close.add_argument("--test", required=True)
    close.add_argument("--out", required=True)
    return parser.parse_args(arguments)


def empty(verdict, reason=None):
    report = {
        "schema_version": SCHEMA, "verdict": verdict, "named": [], "parameters": [], "outside": None, "gap": {}, "candidates": [],
        "not_excited": [], "detection_limits": {}, "next": None,
    }  # fmt: skip
    return report | ({"reason": reason} if reason else {})


def judge(method, rig, trains, test_path):
    regression = library.build(trains, rig)
    choice = METHODS[method](regression)
    effects, parameters = naming.named(regression, choice)
    if effects:
        verdict = "ambiguous" if any(effect["alternatives"] for effect in effects) else "named"
    else:
        verdict = "parameters-only" if parameters else "nothing-missing"
    ranked = sorted(choice.scores.items(), key=lambda item: -item[1] if np.isfinite(item[1]) else math.inf)
    report = empty(verdict)
    report["named"], report["parameters"] = effects, parameters
    report["candidates"] = [scored(regression, place, score) for place, score in ranked[:20] if np.isfinite(score)]
    report["not_excited"] = naming.not_excited(regression)
    for place in trains[0].axes:
        unseen = [{"effect": effect, "where": {"axis": place, "element": None}} for effect in candidates.WITHOUT_SIGNATURE]
        report["not_excited"] += unseen
    report["detection_limits"] = naming.detection_limits(regression)
    report["gap"] = gap(rig, test_path, regression, choice)
    return report


def scored(regression, place, score):
    one = regression.candidates[place]
    return {"effect": one.effect, "where": {"axis": one.place, "element": one.element}, "score": float(score)}


def gap(rig, test_path, regression, choice):
    """Rms of each balance on the held-out record before and after, in units of its noise, which is the floor."""
    try:
        test = library.build([record.read(test_path)], rig, regression.scale, only=choice.chosen)
    except record.BadData:
        return {}
    after = test.y - test.columns @ choice.coefficients if choice.chosen else test.y
    out = {}
    for label, key in enumerate(test.names):
        rows = test.balance == label
        if rows.any():
            first, last = float(np.sqrt(np.mean(test.y[rows] ** 2))), float(np.sqrt(np.mean(after[rows] ** 2)))
            closed = (first - last) / (first - 1.0) if first > 1.2 else None
            out[f"{key[0]}_{key[1]}_balance"] = {"before": first, "after": last, "floor": 1.0, "closed": closed}
    return out


def finite(value):
    """JSON holds no NaN: absence is null."""
    if isinstance(value, dict):
        return {key: finite(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [finite(inner) for inner in value]
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    return value


def main():
    if len(sys.argv) < 2 or sys.argv[1] not in METHODS:
        sys.exit(f"program.py: the method is one of {', '.join(METHODS)}")
    method, options, began = sys.argv[1], parse(sys.argv[2:]), time.monotonic()
    os.makedirs(options.out, exist_ok=True)
    try:
        rig = rig_file.read(options.rig)
    except (OSError, KeyError, ValueError) as error:
        sys.exit(f"{method}: cannot use {options.rig}: {error!r}")
    try:
        report = judge(method, rig, [record.read(path) for path in options.train], options.test)
    except (record.BadData, OSError) as error:
        report = empty("bad-data", str(error))
    except Exception:  # a competitor that falls over has lost the record, not the study
        traceback.print_exc()
        report = empty("bad-data", "the program fell over: " + traceback.format_exc(limit=1).strip().splitlines()[-1])
    with open(os.path.join(options.out, "report.json"), "w", encoding="utf-8") as file:
        json.dump(finite(report), file, indent=1, allow_nan=False)
    names = ", ".join(effect["effect"] for effect in report["named"]) or "-"
    print(f"{method}: {report['verdict']}, named {names}, {time.monotonic() - began:.1f} s")


if __name__ == "__main__":
    main()
