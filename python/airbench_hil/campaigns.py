"""Campaigns from Python, by the same files (campaign/docs/campaigns.md): thousands of simulated runs, as one table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from airbench_hil import faults, programs, tasks
from airbench_hil.controllers import StrPath
from airbench_hil.errors import BOUND_BROKEN, GOOD
from airbench_hil.run import Run, read_table

if TYPE_CHECKING:
    import pandas

_SHOWN_ROWS = 20


class Campaign:
    """A campaign, or the parts of it that were made, in its folder."""

    def __init__(self, file: StrPath, folder: StrPath, exit_code: int = GOOD, binaries: StrPath | None = None) -> None:
        """Opens the folder of any campaign; `file` is the campaign's."""
        self.file, self.folder, self.exit_code, self._binaries = Path(file), Path(folder), exit_code, binaries

    @property
    def complete(self) -> bool:
        """Whether all runs are there; with `shard` those of the other shards may be missing."""
        return (self.folder / "runs.csv").is_file()

    @property
    def passed(self) -> bool:
        """With `expect_passed`: whether every run came to its end and kept its experiment's bounds."""
        return self.exit_code == GOOD

    @cached_property
    def runs(self) -> pandas.DataFrame:
        """A row for each run: number, draw, seed, varied values, how it ended, figures (SI); `attrs["units"]` has the units.

        :raises FileNotFoundError: the campaign is not complete.
        :raises ImportError: pandas is not installed: pip install 'airbench-hil[pandas]'
        """
        return read_table(self.folder / "runs.csv")

    @property
    def page(self) -> Path:
        """The page for people, report.html."""
        return self.folder / "report.html"

    def repeat(self, run: int, out: StrPath | None = None) -> Run:
        """Makes one of the runs again, in lockstep, with all files of a run; in `out`, or in repeated/NUMBER of the campaign's folder.

        :raises ProgramFailed: such as for a number that there is not.
        """
        where = tasks.folder(self.folder / "repeated" / str(run) if out is None else out, "")
        words = _words("repeat", self._binaries) + ["--out", str(where), str(self.file), str(run)]
        tasks.done("campaign", words, where, good=(GOOD,))
        return Run(where)

    def __repr__(self) -> str:
        return f"<Campaign {self.file} in {self.folder}: {'complete' if self.complete else 'not complete'}>"

    def _repr_html_(self) -> str:
        if not self.complete:
            return f"<p>{escape(repr(self))}</p>"
        link = f'<p><a href="{escape(self.page.as_uri())}">{escape(str(self.page))}</a></p>' if self.page.is_absolute() else ""
        varied = self.runs.dropna(axis="columns", how="all").head(_SHOWN_ROWS)
        return f"<p>{escape(str(self.file))}: {len(self.runs)} runs, of which {len(varied)} are shown</p>{varied.to_html(index=False)}{link}"


def campaign(
    file: StrPath | Mapping[str, Any],
    *,
    out: StrPath | None = None,
    jobs: int | None = None,
    shard: tuple[int, int] | None = None,
    expect_passed: bool = False,
    binaries: StrPath | None = None,
) -> Campaign:
    """Makes the missing runs of a campaign: `campaign run`.

    :param file: the campaign's file, the name of a shipped one, or its tables, in which paths count from the working directory.
    :param out: its folder: runs that are there are not made again; None: a new one in ./runs.
    :param jobs: runs at once; None: as many as there are cores.
    :param shard: make this share alone, (index from 0, count).
    :param expect_passed: judge by `Campaign.passed` whether every run came to its end and kept its experiment's bounds.
    :param binaries: folder of the programs; None: `programs.program` looks for them.
    :raises ProgramFailed: bad input, with the program's message, file and line.
    """
    title = "campaign" if isinstance(file, Mapping) else Path(file).stem
    where = tasks.folder(out, title)
    if isinstance(file, Mapping):
        path = where / "campaign.toml"
        path.write_text(faults.toml(_with_paths(file)), encoding="utf-8")
    else:
        path = programs.campaign(file)
    words = _words("run", binaries) + ["--out", str(where)]
    words += ["--jobs", str(jobs)] if jobs is not None else []
    words += ["--shard", "{}/{}".format(*shard)] if shard else []
    words += ["--expect-passed"] if expect_passed else []
    code = tasks.done("campaign", [*words, str(path)], where, good=(GOOD, BOUND_BROKEN) if expect_passed else (GOOD,))
    return Campaign(path, where, code, binaries)


def _words(command: str, binaries: StrPath | None) -> list[str]:
    program = programs.program("campaign", binaries)
    return [str(program), command, "--shipped", str(programs.file("experiments").parent), "--programs", str(program.parent)]


def _with_paths(tables: Mapping[str, Any]) -> dict[str, Any]:
    """The tables with paths that do not depend on where the file lies."""

    def whole(key: str, value: Any) -> Any:
        if isinstance(value, Mapping):
            return {inner: whole(inner, each) for inner, each in value.items()}
        if isinstance(value, Sequence) and not isinstance(value, str):
            return [whole(key, each) for each in value]
        return str(Path(value).resolve()) if isinstance(value, str) and value.endswith(".toml") else value

    return {key: whole(key, value) for key, value in tables.items()}
