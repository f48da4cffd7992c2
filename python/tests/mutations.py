"""Mistakes made in tests/firmware on purpose, and which tests of docs/examples/pytest notice them: scripts/firmware-mutations."""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
import xml.etree.ElementTree as xml
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FIRMWARE = ROOT / "tests/firmware"
SUITE = ROOT / "docs/examples/pytest/test_firmware.py"
PAGE = ROOT / "docs/mistakes-on-purpose.md"
PROGRAMS = ("firmware-embedded", "firmware-socketcan")
BEGIN, END = "<!-- scripts/firmware-mutations --write -->\n", "<!-- end -->\n"


@dataclass(frozen=True)
class Mutation:
    """One change of the firmware's sources, and the test that CI holds against it."""

    name: str
    about: str
    file: str
    old: str
    new: str
    caught_by: str


def mutations():
    """Those of tests/firmware/mutations.toml."""
    with open(FIRMWARE / "mutations.toml", "rb") as file:
        rows = tomllib.load(file)["mutation"]
    return [Mutation(row["name"], row["about"], row["file"], row["from"], row["to"], row["caught_by"]) for row in rows]


def _make(sources, build, *targets):
    make = ["make", "-s", "-C", sources, f"BUILD={build}", f"PYTHON={sys.executable}", f"DBC={ROOT / 'protocol/rig.dbc'}"]
    subprocess.run([*make, *targets], check=True, stdout=subprocess.DEVNULL)


def codec(folder):
    """The codec of rig.dbc in `folder`, compiled, which no mistake touches."""
    _make(FIRMWARE, folder, folder / "rig.o")
    return folder


def build(folder, codec_folder, mutation=None, programs=PROGRAMS[:1]):
    """The firmware in `folder`/build, changed or as it is, with the codec; by default for the embedded bus alone.

    :raises ValueError: the text to be changed does not stand in its file exactly once.
    """
    sources = folder / "firmware"
    shutil.copytree(FIRMWARE, sources)
    if mutation:
        text = (sources / mutation.file).read_text()
        if text.count(mutation.old) != 1:
            raise ValueError(f"{mutation.name}: what it changes stands {text.count(mutation.old)} times in {mutation.file}")
        (sources / mutation.file).write_text(text.replace(mutation.old, mutation.new))
    shutil.copytree(codec_folder, folder / "build")
    _make(sources, folder / "build", *(folder / "build" / program for program in programs))
    return folder / "build"


def run(folder, firmware, *options):
    """Runs the suite's tests against a firmware; gives what became of each: "passed", "failed" or "error"."""
    report = folder / "junit.xml"
    environment = {**os.environ, "AIRBENCH_FIRMWARE": str(firmware)}
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", f"--junitxml={report}", f"--basetemp={folder / 'runs'}"]
    done = subprocess.run([*command, *options, SUITE], env=environment, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1):
        raise RuntimeError(done.stdout + done.stderr)
    return {case.get("name"): _outcome(case) for case in xml.parse(report).iter("testcase")}


def _outcome(case):
    return next((kind for kind, tag in (("failed", "failure"), ("error", "error")) if case.find(tag) is not None), "passed")


def table(matrix, tests):
    """Mutations as rows, tests as columns."""
    names = [name.removeprefix("test_").replace("_", " ") for name in tests]
    lines = [f"{number}. {name}" for number, name in enumerate(names, 1)]
    lines += ["", "| mistake | " + " | ".join(str(number) for number in range(1, len(tests) + 1)) + " | caught by |"]
    lines.append("|---" * (len(tests) + 2) + "|")
    for mutation, outcomes in matrix:
        marks = ["" if outcomes[name] == "passed" else "x" for name in tests]
        lines.append(f"| {mutation.name}: {mutation.about} | " + " | ".join(marks) + f" | {sum(map(bool, marks))} |")
    return "\n".join(lines) + "\n"


def main():
    """Runs all tests against all mutations; exit code 1 when one is not caught, or the unchanged firmware fails."""
    parser = argparse.ArgumentParser(prog="scripts/firmware-mutations", description=main.__doc__)
    parser.add_argument("--write", action="store_true", help=f"put the table into {PAGE.relative_to(ROOT)}")
    parser.add_argument("name", nargs="*", help="mutations of tests/firmware/mutations.toml; without one all of them")
    arguments = parser.parse_args()
    known = mutations()
    if unknown := set(arguments.name) - {mutation.name for mutation in known}:
        parser.error(f"no mutation {', '.join(sorted(unknown))}: {', '.join(mutation.name for mutation in known)}")
    chosen = [mutation for mutation in known if not arguments.name or mutation.name in arguments.name]
    matrix = []
    good = True
    for mutation in [None, *chosen]:
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            outcomes = run(folder, build(folder, codec(folder / "codec"), mutation, PROGRAMS), "-n", "2")
        failed = [name for name, outcome in outcomes.items() if outcome != "passed"]
        good &= bool(failed) if mutation else not failed
        print(f"{mutation.name if mutation else 'unchanged'}: {', '.join(failed) or 'all tests passed'}", flush=True)
        if mutation:
            matrix.append((mutation, outcomes))
    source = SUITE.read_text()
    text = table(matrix, sorted(matrix[0][1], key=lambda name: source.index(f"def {name}(")))
    print(f"\n{text}", end="")
    if arguments.write:
        page = PAGE.read_text()
        before, rest = page.split(BEGIN)
        PAGE.write_text(f"{before}{BEGIN}\n{text}\n{END}{rest.split(END)[1]}")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
