#!/usr/bin/env python3
"""Packs what a program said in a study, as far as a score reads it: pack.py STUDY LABEL OUT.tar.xz

The archive is a study's folder again but for draws.json, which `scripts/study draws` writes from the seed:
`tar -C DIR -xJf OUT.tar.xz`; then the same campaign goes on, and `score` and `worlds` read it.
"""

import io
import json
import sys
import tarfile
from pathlib import Path


# What no score reads.
UNREAD = ["checks", "carried", "remaining", "misfit", "small", "insignificant", "inputs"]
DIGITS = 6


def rounded(value: object) -> object:
    """Numbers to some significant digits."""
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}")
    if isinstance(value, dict):
        return {key: rounded(inner) for key, inner in value.items()}
    return [rounded(inner) for inner in value] if isinstance(value, list) else value


def scored(report: bytes) -> bytes:
    """What a score reads of a report; one that is no JSON as it is."""
    try:
        own = json.loads(report)
    except ValueError:
        return report
    for key in UNREAD:
        own.pop(key, None)
    dependence = (own.get("location") or {}).get("dependence")
    if dependence:
        dependence["variables"] = [{"variable": one["variable"]} for one in dependence["variables"]]
    own["location"] = {"dependence": dependence}
    own["candidates"] = []
    own["detection_limits"] = []
    if own.get("outside"):
        own["outside"]["curve"] = None
        own["outside"]["surface"] = None
    return json.dumps(rounded(own), separators=(",", ":")).encode()


def add(archive: tarfile.TarFile, name: str, content: bytes) -> None:
    entry = tarfile.TarInfo(name)
    entry.size = len(content)
    archive.addfile(entry, io.BytesIO(content))


def main() -> int:
    if len(sys.argv) != 4:
        print(__doc__, file=sys.stderr)
        return 2
    study, label, out = Path(sys.argv[1]), sys.argv[2], Path(sys.argv[3])
    with tarfile.open(out, "w:xz", preset=9) as archive:
        results = sorted((study / "runs" / label).glob("*/result.json"))
        draws = len(results)
        # What came of proposed experiments stands beside.
        results += sorted((study / "runs" / f"{label}-resolve").glob("*/resolution.json"))
        for result in results:
            name = f"runs/{result.parent.parent.name}/{result.parent.name}"
            add(archive, f"{name}/{result.name}", result.read_bytes())
            report = result.with_name("report.json")
            if report.exists():
                add(archive, f"{name}/report.json", scored(report.read_bytes()))
        for own in sorted((study / "classes").glob("*.json")):
            add(archive, f"classes/{own.name}", own.read_bytes())
    print(f"{out}: {draws} draws")
    return 0


if __name__ == "__main__":
    sys.exit(main())
