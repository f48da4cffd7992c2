"""Requirements, the tests that verify them, and verdicts: as Markdown, for sphinx-needs (needs.json) and for StrictDoc (.sdoc)."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pytest

PASSED, FAILED, SKIPPED, UNTESTED = "passed", "failed", "skipped", "untested"


def known_requirements(path: Path) -> dict[str, str]:
    """Requirements that there are, identifiers with their texts, from a TOML file of such pairs.

    :raises OSError: it cannot be read.
    :raises ValueError: it is none.
    """
    known = tomllib.loads(path.read_text(encoding="utf-8"))
    for key, text in known.items():
        if not isinstance(text, str):
            raise ValueError(f"{path}: {key}: a text is expected, as in {key} = \"what is required\"")
    return known


class Traceability:
    """Verdicts of tests by the requirements that they verify."""

    def __init__(self) -> None:
        #: Requirement to test to verdict.
        self.verdicts: dict[str, dict[str, str]] = {}
        self._named: dict[str, list[str]] = {}

    def take(self, report: pytest.TestReport) -> None:
        """A report of a phase of a test: one that failed anywhere has failed."""
        named = [str(value) for key, value in report.user_properties if key == "requirement"]
        # The report of a worker that crashed has no properties; that of the test's setup had them.
        for requirement in self._named.setdefault(report.nodeid, named) if named else self._named.get(report.nodeid, []):
            tests = self.verdicts.setdefault(requirement, {})
            before = tests.get(report.nodeid)
            if report.failed:
                tests[report.nodeid] = FAILED
            elif report.skipped and before is None:
                tests[report.nodeid] = SKIPPED
            elif report.when == "call" and before is None:
                tests[report.nodeid] = PASSED

    def verdict(self, requirement: str) -> str:
        """Failed if one test has, passed if all that ran have and one did, skipped or untested else."""
        verdicts = self.verdicts.get(requirement, {}).values()
        if not verdicts:
            return UNTESTED
        return FAILED if FAILED in verdicts else PASSED if PASSED in verdicts else SKIPPED

    def write(self, folder: Path, known: Mapping[str, str] | None) -> None:
        """Writes requirements.md, needs.json and requirements.sdoc."""
        folder.mkdir(parents=True, exist_ok=True)
        # The order in which workers of pytest-xdist are done is chance.
        self.verdicts = {requirement: dict(sorted(tests.items())) for requirement, tests in sorted(self.verdicts.items())}
        every = dict(known) if known is not None else dict.fromkeys(sorted(self.verdicts), "")
        (folder / "requirements.md").write_text(self._markdown(every), encoding="utf-8")
        (folder / "needs.json").write_text(json.dumps(self._needs(every), indent=2) + "\n", encoding="utf-8")
        (folder / "requirements.sdoc").write_text(self._strictdoc(every), encoding="utf-8")

    def _markdown(self, every: Mapping[str, str]) -> str:
        lines = ["| requirement | text | verdict | tests |", "|---|---|---|---|"]
        for requirement, text in every.items():
            tests = self.verdicts.get(requirement, {})
            cell = "<br>".join(f"`{_cell(test)}` {verdict}" for test, verdict in tests.items()) or "none"
            lines.append(f"| {requirement} | {_cell(text)} | {self.verdict(requirement)} | {cell} |")
        counts = {verdict: sum(self.verdict(each) == verdict for each in every) for verdict in (PASSED, FAILED, SKIPPED, UNTESTED)}
        total = ", ".join(f"{count} {verdict}" for verdict, count in counts.items() if count)
        return "\n".join([*lines, "", f"{len(every)} requirements: {total}", ""])

    def _needs(self, every: Mapping[str, str]) -> dict[str, object]:
        """What sphinx-needs imports by `needimport`: a requirement links its tests."""
        needs: dict[str, dict[str, object]] = {}
        ids = _test_ids(self.verdicts)
        for requirement, text in every.items():
            tests = [ids[test] for test in self.verdicts.get(requirement, {})]
            needs[requirement] = {
                "id": requirement, "type": "req", "title": text or requirement, "content": text, "status": self.verdict(requirement),
                "links": tests, "tags": [],
            }
        for tests_of in self.verdicts.values():
            for test, verdict in tests_of.items():
                needs[ids[test]] = {
                    "id": ids[test], "type": "test", "title": test, "content": "", "status": verdict, "links": [], "tags": [],
                }
        return {"current_version": "1.0", "project": "airbench", "versions": {"1.0": {"needs": needs, "needs_amount": len(needs)}}}

    def _strictdoc(self, every: Mapping[str, str]) -> str:
        blocks = ["[DOCUMENT]\nTITLE: Requirements and their tests\n"]
        for requirement, text in every.items():
            tests = self.verdicts.get(requirement, {})
            comment = "\n".join(f"{test}: {verdict}" for test, verdict in tests.items()) or "no test"
            blocks.append(
                f"[REQUIREMENT]\nUID: {requirement}\nSTATUS: {self.verdict(requirement)}\nTITLE: {requirement}\n"
                f"STATEMENT: >>>\n{text or requirement}\n<<<\nCOMMENT: >>>\n{comment}\n<<<\n"
            )
        return "\n".join(blocks)


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def _test_ids(verdicts: Mapping[str, Mapping[str, str]]) -> dict[str, str]:
    """Names of tests as identifiers of sphinx-needs, which takes letters, digits and underscores; a number keeps equal ones apart."""
    ids: dict[str, str] = {}
    used: set[str] = set()
    for test in sorted({test for tests in verdicts.values() for test in tests}):
        base = "TEST_" + "".join(letter if letter.isalnum() else "_" for letter in test).upper()
        name, number = base, 2
        while name in used:
            name, number = f"{base}_{number}", number + 1
        used.add(name)
        ids[test] = name
    return ids
