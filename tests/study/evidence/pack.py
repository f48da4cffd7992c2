#!/usr/bin/env python3
"""Packs what a program said in a study, without the series that its pages draw: pack.py STUDY LABEL OUT.tar.xz

The archive is a study's folder again: `tar -C DIR -xJf OUT.tar.xz`; then the same campaign goes on, and `score` reads it.
"""

import io
import json
import sys
import tarfile
from pathlib import Path


def without_series(report: bytes) -> bytes:
    """The report without what only pictures and long tables need; one that is no JSON as it is."""
    try:
        own = json.loads(report)
    except ValueError:
        return report
    own["location"] = {"dependence": (own.get("location") or {}).get("dependence")}
    own["candidates"] = own.get("candidates", [])[:5]
    own["detection_limits"] = []
    if own.get("outside"):
        own["outside"]["curve"] = None
        own["outside"]["surface"] = None
    return json.dumps(own, separators=(",", ":")).encode()


def add(archive: tarfile.TarFile, name: str, content: bytes) -> None:
    entry = tarfile.TarInfo(name)
    entry.size = len(content)
    archive.addfile(entry, io.BytesIO(content))


def main() -> int:
    if len(sys.argv) != 4:
        print(__doc__, file=sys.stderr)
        return 2
    study, label, out = Path(sys.argv[1]), sys.argv[2], Path(sys.argv[3])
    draws = 0
    with tarfile.open(out, "w:xz", preset=9) as archive:
        add(archive, "draws.json", (study / "draws.json").read_bytes())
        for result in sorted((study / "runs" / label).glob("*/result.json")):
            draws += 1
            name = f"runs/{label}/{result.parent.name}"
            add(archive, f"{name}/result.json", result.read_bytes())
            report = result.with_name("report.json")
            if report.exists():
                add(archive, f"{name}/report.json", without_series(report.read_bytes()))
        for own in sorted((study / "classes").glob("*.json")):
            add(archive, f"classes/{own.name}", own.read_bytes())
    print(f"{out}: {draws} draws")
    return 0


if __name__ == "__main__":
    sys.exit(main())
