"""The study of any plant: hidden terms on three plants that are not the rig, closed blind as model files, and scored.

Every record is integrated by scipy; `discrepancy close` sees a model file and two records. docs: tests/docs/model-study.md.
"""

import argparse
import json
import math
import os
import subprocess
import sys
import tomllib
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
from plants import NAMES, PLANTS
from scipy.integrate import solve_ivp
from scipy.stats import beta

ROOT = Path(__file__).resolve().parents[2]
LEDGER = ROOT / "tests/study/evidence/ledger.toml"
TIME_OUT_S = 300
# Standard errors of an interval of 90 %.
INTERVAL = 1.645
# What a hidden term leaves after a refit of the model alone, over the noise: log-uniform.
SIZE = (4.0, 20.0)
# The same of the background.
BACKGROUND = (0.3, 1.0)
# Share of the noise's power that is a first-order process of 15 samples.
COLOURED = 0.3
# Every how many draws are closed with a suspect beside that is alike to the hidden term.
TWINS = 2
# Of twice the log likelihood, less penalties: below it two suspects are the same to a record (docs/model-files.md).
APART = 10.0


class Record:
    """One simulation: time, input, what is measured without noise, and the path of the states."""

    def __init__(self, plant, p, signal, hidden, a, background, method=None):
        self.t = plant.step_s * np.arange(plant.samples)
        rates, step_s, last = plant.rates(p, hidden, a, background), plant.step_s, plant.samples - 2

        def slope(t, y):
            place = min(int(t / step_s), last)
            share = t / step_s - place
            return rates(t, y.tolist(), values[place] + share * (values[place + 1] - values[place]))

        values = signal.tolist()
        start = np.concatenate([plant.start, np.full(2, signal[0])])
        scale, tolerance = (0.01 if plant.name == "oscillator" else 1.0), (1e-5 if method == "LSODA" else 1e-7)
        done = solve_ivp(
            slope,
            (0, self.t[-1]),
            start,
            method or plant.method,
            self.t,
            rtol=tolerance,
            atol=tolerance * scale,
            max_step=25 * step_s,
        )
        if not done.success:
            raise ArithmeticError(done.message)
        self.signal, self.path, self.hidden, self.a = signal, done.y, hidden, a
        self.measured = plant.measured(done.y, self.t, hidden, a)

    def write(self, file, plant, random):
        """As a user's file: time, input, outputs with noise."""
        noisy = [each + sigma * noise(random, len(self.t)) for each, sigma in zip(self.measured, plant.noise, strict=True)]
        [source] = tomllib.loads(plant.body)["inputs"]
        table = np.column_stack([self.t, self.signal, *noisy])
        np.savetxt(file, table, fmt="%.9g", delimiter=",", header=",".join(["t_s", source, *plant.outputs]), comments="")


def noise(random, count):
    """White noise with a coloured part, of deviation 1."""
    white = random.standard_normal(count)
    keep, coloured = math.exp(-1 / 15), np.zeros(count)
    for at, kick in enumerate(random.standard_normal(count) * math.sqrt(1 - keep**2)):
        coloured[at] = (keep * coloured[at - 1] if at else 0.0) + kick
    return math.sqrt(1 - COLOURED) * white + math.sqrt(COLOURED) * coloured


class Draw:
    """A plant, its numbers, a hidden term or none, and two inputs."""

    def __init__(self, seed, number, is_null):
        self.random = np.random.default_rng([seed, int(is_null), number])
        self.plant = PLANTS[NAMES[number % 3]]
        self.p = {name: value * self.around(0.15) for name, (value, _) in self.plant.numbers.items()}
        self.guess = {name: round(value * self.around(0.15), 6) for name, value in self.p.items()}
        names = list(self.plant.suspects)
        self.hidden = None if is_null else names[number // 3 % len(names)]
        self.signals = [self.plant.signal(self.random) for _ in range(2)]
        self.size = math.exp(self.random.uniform(*map(math.log, SIZE)))
        self.background_size = math.exp(self.random.uniform(*map(math.log, BACKGROUND)))
        self.a, self.background, self.reached = 0.0, 1.0, 0.0

    def around(self, spread):
        """A factor near 1."""
        return math.exp(spread * self.random.standard_normal())

    def simulated(self, p=None, hidden=None, a=0.0, background=0.0, signal=0, method="LSODA"):
        """A record of the plant."""
        return Record(self.plant, p or self.p, self.signals[signal], hidden, a, background, method)

    def scaled(self, record):
        """All outputs in units of their noise."""
        return np.concatenate([each / sigma for each, sigma in zip(record.measured, self.plant.noise, strict=True)])

    def sized(self):
        """Chooses amplitudes by what a refit of the plant's own numbers leaves of their change."""
        base = self.scaled(self.simulated())
        columns = []
        for name, value in self.p.items():
            moved = self.scaled(self.simulated({**self.p, name: value * 1.01}))
            columns.append((moved - base) / np.linalg.norm(moved - base))
        basis, _ = np.linalg.qr(np.column_stack(columns))

        def left(**change):
            d = self.scaled(self.simulated(**change)) - base
            return math.sqrt(np.mean((d - basis @ (basis.T @ d)) ** 2))

        for _ in range(3):
            self.background *= (self.background_size / left(background=self.background)) ** 0.9
        if self.hidden:
            self.a = self.plant.first[self.hidden]
            for _ in range(6):
                self.reached = left(hidden=self.hidden, a=self.a)
                if abs(math.log(self.size / self.reached)) < 0.1:
                    break
                self.a *= min(max(self.size / self.reached, 0.2), 5.0) ** 0.8

    def write(self, folder):
        """Records as a user has them; gives the hidden term's number on the training record."""
        folder.mkdir(parents=True, exist_ok=True)
        number = None
        for signal, name in enumerate(("train.csv", "test.csv")):
            record = self.simulated(None, self.hidden, self.a, self.background, signal, self.plant.method)
            record.write(folder / name, self.plant, self.random)
            if signal == 0 and self.hidden:
                number = self.plant.amplitude(self.hidden, self.a, record.path)
        (folder / "model.toml").write_text(self.plant.file(self.guess))
        return number


def close(program, folder, model, out):
    """The report of a closing; a text where there is none."""
    words = [
        program,
        "close",
        "--no-discover",
        "--model",
        folder / model,
        "--train",
        folder / "train.csv",
        "--test",
        folder / "test.csv",
        "--out",
        folder / out,
    ]
    try:
        done = subprocess.run([*words, "--threads", "1"], capture_output=True, text=True, timeout=TIME_OUT_S)
    except subprocess.TimeoutExpired:
        return f"longer than {TIME_OUT_S} s"
    report = folder / out / "report.json"
    if done.returncode not in (0, 1) or not report.is_file():
        return f"exit code {done.returncode}: {done.stderr.strip()[-300:]}"
    return json.loads(report.read_text())


def one(program, seed, number, is_null, folder):
    """Makes, closes and describes a draw; its truth and its verdict in one row."""
    kept = folder / "row.json"
    if kept.is_file():
        return json.loads(kept.read_text())
    draw = Draw(seed, number, is_null)
    draw.sized()
    amplitude = draw.write(folder)
    plant = draw.plant
    row = {
        "plant": plant.name,
        "number": number,
        "hidden": draw.hidden,
        "place": draw.hidden and plant.suspects[draw.hidden][0],
        "size": draw.reached,
        "numbers": {**draw.p},
        "amplitude": amplitude,
    }
    row |= judged(row, close(program, folder, "model.toml", "out"))
    if draw.hidden:
        (folder / "withheld.toml").write_text(plant.file(draw.guess, without=draw.hidden))
        row["withheld"] = withheld(row, close(program, folder, "withheld.toml", "withheld"))
        if number % TWINS == 0:
            (folder / "twins.toml").write_text(plant.file(draw.guess, alike=draw.hidden))
            row["twins"] = twins(draw.hidden, close(program, folder, "twins.toml", "twins"))
    kept.write_text(json.dumps(row))
    return row


def judged(row, report):
    """What a report says, beside the truth."""
    if isinstance(report, str):
        return {"failed": report, "named": [], "right": False, "located": False, "intervals": []}
    # A name that the headline takes back, since a held-out record gets worse with it, is no name.
    report["named"] = [] if report["taken_back"] else report["named"]
    named = [each["suspect"] for each in report["named"]]
    others = {other for each in report["named"] for other in each["alternatives"]}
    pairs = [set(pair["suspects"]) for pair in report["structure"]["twins"]]
    # Suspects that structure calls the same are one answer; every other alternative makes it a wrong one.
    same = {row["hidden"]}.union(*(pair for pair in pairs if row["hidden"] in pair)) if row["hidden"] else set()
    right = len(named) == 1 and row["hidden"] in {*named, *others} and {*named, *others} <= same
    intervals = []
    for number in report["parameters"]:
        truth = row["numbers"].get(number["name"]) if number["suspect"] is None else None
        if number["suspect"] == row["hidden"] and number["name"] == "a":
            truth = row["amplitude"]
        if truth is not None and number["standard_error"]:
            kind = "own" if number["suspect"] is None else "term"
            intervals.append([kind, number["name"], (number["value"] - truth) / number["standard_error"]])
    return {
        "failed": None,
        "verdict": report["verdict"],
        "named": named,
        "others": sorted(others),
        "right": right,
        "places": [each["place"] for each in report["named"]],
        "located": bool(named) and is_place(report["named"][0]["place"], row["place"]),
        "confirmed": report["confirmed"],
        "intervals": intervals,
        "discovered": report.get("discovered"),
    }


def withheld(row, report):
    """Where a report places what no suspect of it is."""
    if isinstance(report, str):
        return {"failed": report, "located": False, "variable": False, "named place": False}
    named = [[each["suspect"], each["place"]] for each in report["named"]]
    said = report["located"]
    located = said is not None and is_place(said["place"], row["place"])
    return {
        "failed": None,
        "named": named,
        "said": said,
        "located": located,
        "variable": located and set(said["variables"]) == PLANTS[row["plant"]].variables[row["hidden"]],
        "named place": bool(named) and is_place(named[0][1], row["place"]),
        "verdict": report["verdict"],
    }


def twins(hidden, report):
    """Of pairs with the hidden term that structure calls the same, which fits cannot tell apart either."""
    if isinstance(report, str):
        return {"failed": report, "pairs": [], "confirmed": []}
    pairs = [sorted(pair["suspects"]) for pair in report["structure"]["twins"] if hidden in pair["suspects"]]
    worth = {each["suspect"]: each["gain"] - each["penalty"] for each in report["suspects"]}
    return {"failed": None, "pairs": pairs, "confirmed": [abs(worth[one] - worth[two]) < APART for one, two in pairs]}


def is_place(said, place):
    """Whether the report's words ("equation of wl") name a place."""
    return said.split()[-1] == place


def share(good, of):
    """`good/of (share, exact 95 % interval)`."""
    if of == 0:
        return "0/0"
    low = beta.ppf(0.025, good, of - good + 1) if good else 0.0
    high = beta.ppf(0.975, good + 1, of - good) if good < of else 1.0
    return f"{good}/{of} = {100 * good / of:.0f} % ({100 * low:.0f} to {100 * high:.0f})"


def table(hidden, nulls):
    """The score as a table of Markdown."""
    named = [row for row in hidden if row["named"]]
    right = [row for row in hidden if row["right"]]
    inside = [[kind, abs(z) <= INTERVAL] for row in right for kind, _, z in row["intervals"]]
    all_inside = [abs(z) <= INTERVAL for row in hidden for _, _, z in row["intervals"]]
    confirmed = [each for row in hidden for each in row.get("twins", {"confirmed": []})["confirmed"]]
    failed = [row["failed"] or row.get("twins", {"failed": None})["failed"] for row in hidden + nulls]
    rows = [
        ("right name", share(len(right), len(hidden)), "at least 90 %"),
        (
            "null records with a name",
            share(sum(bool(row["named"] or row["failed"]) for row in nulls), len(nulls)),
            "at most 1 of 40",
        ),
        ("all draws: place right", share(sum(row["located"] for row in hidden), len(hidden)), ""),
        ("named: place right", share(sum(row["located"] for row in named), len(named)), "at least 95 %"),
        ("right name: 90 % intervals that hold, of the plant's numbers", counted(inside, "own"), "85 to 95 %"),
        ("the same of the term's number", counted(inside, "term"), "85 to 95 %"),
        ("all draws: 90 % intervals that hold", share(sum(all_inside), len(all_inside)), ""),
        ("true suspect withheld: place that is said", of_withheld(hidden, "located"), "at least 80 %"),
        ("the same, and the variables", of_withheld(hidden, "variable"), "at least 80 %"),
        ("the same: place of what is named instead", of_withheld(hidden, "named place"), ""),
        ("twins by structure that fits cannot tell either", share(sum(confirmed), len(confirmed)), "at least 90 %"),
        ("crashes, time-outs (counted as wrong)", str(sum(map(bool, failed))), ""),
    ]
    for plant in NAMES:
        mine = [row for row in hidden if row["plant"] == plant]
        rows.append((f"right name, {plant}", share(sum(row["right"] for row in mine), len(mine)), ""))
    return "\n".join(
        ["| question | score (exact 95 % interval) | asked |", "|---|---|---|", *(f"| {' | '.join(row)} |" for row in rows)]
    )


def of_withheld(hidden, what):
    """Share of the draws with the true suspect withheld."""
    return share(sum(row["withheld"][what] for row in hidden), len(hidden))


def counted(inside, kind):
    """Share of the intervals of one kind."""
    mine = [good for each, good in inside if each == kind]
    return share(sum(mine), len(mine))


def known(seed):
    """Whether a seed may be drawn from: below 100 for development, else it stands in the ledger."""
    return seed < 100 or seed in {each["seed"] for each in tomllib.loads(LEDGER.read_text())["fresh"]}


def run(program, seed, out, task):
    """One draw, with a line of progress."""
    number, is_null = task
    folder = out / f"{'null' if is_null else 'draw'}-{number:02}"
    row = one(program, seed, number, is_null, folder)
    said = row["failed"] or f"{row['verdict']} {' or '.join([*row['named'], *row['others']])}"
    print(
        f"{folder.name} {row['plant']} {row['hidden'] or 'nothing'} ({row['size']:.1f} noise): {said}",
        file=sys.stderr,
        flush=True,
    )
    return row


def main():
    """The command line; see scripts/model-study --help."""
    parser = argparse.ArgumentParser(prog="scripts/model-study")
    parser.add_argument("--program", required=True)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--draws", type=int, default=60)
    parser.add_argument("--nulls", type=int, default=40)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--out", type=Path, required=True)
    asked = parser.parse_args()
    if not known(asked.seed):
        print(f"scripts/model-study: seed {asked.seed} is not in {LEDGER}: scripts/study seed makes its entry", file=sys.stderr)
        return 2
    tasks = [(number, False) for number in range(asked.draws)] + [(number, True) for number in range(asked.nulls)]

    with ProcessPoolExecutor(asked.jobs) as pool:
        rows = list(pool.map(partial(run, asked.program, asked.seed, asked.out), tasks))
    (asked.out / "rows.json").write_text(json.dumps(rows, indent=1))
    print(table(rows[: asked.draws], rows[asked.draws :]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
