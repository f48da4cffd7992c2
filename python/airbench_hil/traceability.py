"""Requirements, the tests that verify them, and verdicts: as Markdown, for sphinx-needs (needs.json) and for StrictDoc (.sdoc).

pytest writes them by the plugin; `python -m airbench_hil.traceability` of Robot Framework's results and of JUnit files.
"""

from __future__ import annotations

import argparse
import json
import sys
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

from airbench_hil.errors import BAD_INPUT, GOOD

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

    def add(self, test: str, requirements: Sequence[str], verdict: str) -> None:
        """A test that is over."""
        for requirement in requirements:
            self.verdicts.setdefault(requirement, {})[test] = verdict

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


def results(path: Path, is_requirement: Callable[[str], bool]) -> Iterator[tuple[str, list[str], str]]:
    """Tests of a JUnit file or of Robot Framework's output.xml: name, requirements, verdict.

    :param is_requirement: whether a tag of Robot Framework is one.
    :raises OSError: it cannot be read.
    :raises ValueError: it is none of both.
    """
    try:
        root = ElementTree.parse(path).getroot()
    except ElementTree.ParseError as error:
        raise ValueError(f"{path}: {error}") from error
    if root.tag == "robot":
        for suite in root.findall("suite"):
            for test, tags, verdict in _of_robot(suite, ""):
                yield test, [tag for tag in tags if is_requirement(tag)], verdict
    elif root.tag in ("testsuites", "testsuite"):
        yield from _of_junit(root)
    else:
        raise ValueError(f"{path}: <{root.tag}> is none of <robot> (Robot Framework's output.xml), <testsuites>, <testsuite> (JUnit)")


def _of_robot(suite: ElementTree.Element, above: str) -> Iterator[tuple[str, list[str], str]]:
    name = f"{above}{suite.get('name', '')}."
    for test in suite.findall("test"):
        status = test.find("status")
        word = status.get("status", "") if status is not None else ""
        verdict = {"PASS": PASSED, "SKIP": SKIPPED}.get(word, FAILED)
        yield f"{name}{test.get('name', '')}", [tag.text or "" for tag in test.iter("tag")], verdict
    for below in suite.findall("suite"):
        yield from _of_robot(below, name)


def _of_junit(root: ElementTree.Element) -> Iterator[tuple[str, list[str], str]]:
    for case in root.iter("testcase"):
        broke = case.find("failure") is not None or case.find("error") is not None
        verdict = FAILED if broke else SKIPPED if case.find("skipped") is not None else PASSED
        named = [each.get("value", "") for each in case.iter("property") if each.get("name") == "requirement"]
        yield ".".join(part for part in (case.get("classname"), case.get("name")) if part), named, verdict


def main(words: Sequence[str] | None = None) -> int:
    """The command line; gives the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m airbench_hil.traceability",
        description="Writes requirements.md, needs.json and requirements.sdoc of tests that have run. In JUnit files a requirement is the "
        "property 'requirement' of a test, in Robot Framework's output.xml a tag.",
        epilog="Exit codes: 0 good; 2 usage, or what cannot be read or written.",
    )
    parser.add_argument("results", nargs="+", type=Path, metavar="FILE", help="output.xml of Robot Framework, or a JUnit file")
    parser.add_argument("--requirements", type=Path, metavar="FILE", help="TOML file of all requirements: REQ-1 = \"its text\"")
    parser.add_argument("--tags", default="REQ-*", metavar="PATTERN", help="tags that are requirements, beside those of --requirements")
    parser.add_argument("--out", type=Path, default=Path(), metavar="DIR", help="where the files go (default: here)")
    asked = parser.parse_args(words)
    collected = Traceability()
    try:
        known = known_requirements(asked.requirements) if asked.requirements else None
        for path in asked.results:
            for test, named, verdict in results(path, lambda tag: fnmatchcase(tag, asked.tags) or tag in (known or ())):
                unknown = [each for each in named if known is not None and each not in known]
                if unknown:
                    raise ValueError(f"{path}: {test}: {', '.join(unknown)} is in no line of {asked.requirements}")
                collected.add(test, named, verdict)
        collected.write(asked.out, known)
    except (OSError, ValueError) as error:
        print(f"airbench_hil.traceability: {error}", file=sys.stderr)
        return BAD_INPUT
    print(asked.out / "requirements.md")
    return GOOD


if __name__ == "__main__":
    sys.exit(main())
