"""`discrepancy close` from Python: what the simulation lacks, as an object (discrepancy/docs/report.md, docs/missing-effects.md)."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from airbench_hil import programs, records, tasks
from airbench_hil.controllers import StrPath
from airbench_hil.errors import BAD_INPUT, BOUND_BROKEN, GOOD, BadRecords, ProgramFailed
from airbench_hil.records import Record
from airbench_hil.rig import Rig
from airbench_hil.run import unit_of

if TYPE_CHECKING:
    import pandas

Verdict = Literal["nothing-missing", "parameters-only", "named", "ambiguous", "outside-catalogue", "bad-data"]
_WIDTH, _ROW, _LEFT = 560, 34, 190


def number_in_words(name: str, value: float, standard_error: float | None, unit: str) -> str:
    """A number of a report with two standard errors, where it has one."""
    error = f" ± {2 * standard_error:.2g}" if standard_error is not None else ""
    return f"{name} {value:.4g}{error} {unit}".rstrip()


@dataclass(frozen=True)
class Number:
    """A number that was fitted."""

    name: str
    """Key of the rig file's effect, such as "leakage_nl_per_min", or "parameter:…"."""
    value: float
    """In `unit`."""
    unit: str
    """That of the rig file; empty for a plain number or a factor."""
    standard_error: float | None
    """One, in `unit`; None where the records do not bound the number."""
    before: float | None
    """The value in the rig file, where it has one."""

    @property
    def band(self) -> tuple[float, float] | None:
        """Two standard errors below and above, in `unit`: the calibrated interval of 95.4 %."""
        if self.standard_error is None:
            return None
        return self.value - 2 * self.standard_error, self.value + 2 * self.standard_error

    def __str__(self) -> str:
        return number_in_words(self.name, self.value, self.standard_error, self.unit)


@dataclass(frozen=True)
class Effect:
    """An effect of the catalogue, at its place, with its numbers."""

    name: str
    """Such as "piston-leakage"."""
    place: str
    """Such as "load", "drive.a" or "supply"."""
    numbers: tuple[Number, ...]
    """In the order of its sheet; the first is its amplitude."""
    share_explained: float
    """Share of the training records' excess over their noise that it removes, at most 1."""
    alternatives: tuple[Effect, ...]
    """Effects that explain these records as well, the best first."""

    def __getitem__(self, name: str) -> Number:
        """The number of that name. Raises KeyError."""
        for number in self.numbers:
            if number.name == name:
                return number
        raise KeyError(f"{self.name} has no {name}; it has {', '.join(each.name for each in self.numbers)}")

    def __str__(self) -> str:
        return f"{self.name} at {self.place} ({', '.join(map(str, self.numbers))})"


@dataclass(frozen=True)
class Gap:
    """Root mean square over windows of the held-out record, in `unit`."""

    before: float
    """Measured minus rig file."""
    after: float
    """Measured minus extended model."""
    floor: float
    """Noise of the sensor alone."""
    closed: float | None
    """Removed share of the excess power, at most 1; None where the excess was too small."""
    unit: str


class Report:
    """What `discrepancy close` found, from its folder."""

    def __init__(self, folder: StrPath) -> None:
        """Opens the folder of any report.

        :raises FileNotFoundError: there is no report.json in it.
        :raises ValueError: it is the report of a model file.
        """
        self.folder = Path(folder)
        self.data: dict[str, Any] = json.loads((self.folder / "report.json").read_text(encoding="utf-8"))
        """All of report.json."""
        if "headline" in self.data and "summary" not in self.data:
            raise ValueError(f"{self.folder}: the report of a model file: read it with ModelReport, and close it with close_model")
        self.verdict: Verdict = self.data["verdict"]
        self.summary: str = self.data["summary"]
        """The verdict in a sentence or two."""
        self.named = _effects(self.data["named"])
        """Missing effects, the best first; also when they are ambiguous."""
        self.small = _effects(self.data["small"])
        """Effects that are too small to be named; the extended rig file has them."""
        self.parameters = _numbers(self.data["parameters"])
        """Numbers of the rig file that were off."""
        self.adequate: bool | None = self.data["adequate"]
        """Whether the reported model leaves no more on the training records than their noise."""
        self.gap: dict[str, Gap] = {
            signal: Gap(each["before"], each["after"], each["floor"], each["closed"], unit_of(signal))
            for signal, each in self.data["gap"].items()
        }
        """By signal, of the held-out record; empty without one."""

    @property
    def confirmed(self) -> bool | None:
        """Whether the held-out record is met better by more than three standard errors, and no signal worse; None without one."""
        verification = self.data["verification"]
        return None if verification is None else bool(verification["confirmed"])

    @property
    def figures(self) -> dict[str, float]:
        """Numbers of the held-out record: `chi2_before`, `chi2_after`, and `SIGNAL.before`, `.after`, `.floor` in its unit, `.closed`."""
        verification: Mapping[str, Any] = self.data["verification"] or {}
        numbers = {key: float(verification[key]) for key in ("chi2_before", "chi2_after") if key in verification}
        for signal, gap in self.gap.items():
            numbers |= {f"{signal}.before": gap.before, f"{signal}.after": gap.after, f"{signal}.floor": gap.floor}
            numbers |= {f"{signal}.closed": gap.closed} if gap.closed is not None else {}
        return numbers

    @property
    def page(self) -> Path:
        """The page for people, report.html."""
        return self.folder / "report.html"

    @property
    def rig_file(self) -> Path | None:
        """The extended rig file, for `Rig(rig_file=…)`; None where nothing could be extended."""
        return _there(self.folder / "rig.toml")

    @property
    def next_experiment(self) -> Path | None:
        """The proposed experiment's file, for `Rig(experiment=…)`; None when no question is open, or none on this rig would answer it."""
        name = (self.data["next"] or {}).get("experiment")
        return _there(self.folder / name) if name else None

    @property
    def next_reason(self) -> str | None:
        """Why it is proposed, or which measurement would separate the explanations."""
        proposed = self.data["next"]
        return None if proposed is None else str(proposed["reason"])

    def candidates(self) -> pandas.DataFrame:
        """All candidates, the best first: effect, place, score, share_explained, amplitude, unit, fate.

        :raises ImportError: pandas is not installed: pip install 'airbench-hil[pandas]'
        """
        from airbench_hil.run import import_pandas

        keys = ("score", "share_explained", "amplitude", "unit", "fate")
        every = self.data["candidates"]
        rows = [{"effect": each["effect"], "place": _place(each["where"]), **{key: each[key] for key in keys}} for each in every]
        return import_pandas().DataFrame(rows)

    def __repr__(self) -> str:
        return f"<Report {self.folder}: {self.verdict}: {', '.join(map(str, self.named)) or self.summary}>"

    def _repr_html_(self) -> str:
        found = [("missing", each) for each in self.named] + [("too small to be named", each) for each in self.small]
        rows = [(kind, f"{each.name} at {each.place}", number) for kind, each in found for number in each.numbers]
        rows += [("off in the rig file", "", number) for number in self.parameters]
        table = "".join(
            f"<tr><td>{escape(kind)}</td><td>{escape(what)}</td><td>{escape(number.name)}</td>"
            f"<td>{number.value:.4g} {escape(number.unit)}</td><td>{_band(number)}</td></tr>"
            for kind, what, number in rows
        )
        head = "<tr><th></th><th>effect</th><th>number</th><th>value</th><th>95 % band</th></tr>"
        table = f"<table>{head}{table}</table>" if rows else ""
        link = f'<p><a href="{escape(self.page.as_uri())}">{escape(str(self.page))}</a></p>' if self.page.is_absolute() else ""
        return f"<p><b>{escape(self.verdict)}</b>: {escape(self.summary)}</p>{table}{self._repr_svg_() or ''}{link}"

    def _repr_svg_(self) -> str | None:
        """Difference from the held-out record over the sensors' noise, before and after; None without such a record."""
        signals = [(signal, gap) for signal, gap in self.gap.items() if gap.floor > 0]
        if not signals:
            return None
        most = max(max(gap.before, gap.after) / gap.floor for _, gap in signals)
        scale = (_WIDTH - _LEFT - 70) / max(math.log10(most), 1.0)
        height = 24 + _ROW * len(signals)
        parts = [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {height}" width="{_WIDTH}"',
            ' font-family="sans-serif" font-size="11">',
            f'<rect width="{_WIDTH}" height="{height}" fill="white"/>',
            '<text x="6" y="14">difference from the held-out record over the noise of the sensor, on a logarithmic scale</text>',
        ]
        for row, (signal, gap) in enumerate(signals):
            top = 24 + row * _ROW
            parts.append(f'<text x="{_LEFT - 6}" y="{top + 16}" text-anchor="end">{escape(signal)}</text>')
            for line, (word, value, colour) in enumerate((("before", gap.before, "#c50"), ("after", gap.after, "#06c"))):
                times = value / gap.floor
                width = max(math.log10(max(times, 1.0)) * scale, 1.0)
                parts.append(f'<rect x="{_LEFT}" y="{top + 2 + 14 * line}" width="{width:.1f}" height="12" fill="{colour}"/>')
                parts.append(f'<text x="{_LEFT + width + 4:.1f}" y="{top + 12 + 14 * line}">{times:.3g} {word}</text>')
        return "\n".join([*parts, "</svg>"])


def close(
    rig: StrPath | Rig | None,
    train: Record | Sequence[Record],
    test: Record | Sequence[Record] = (),
    *,
    out: StrPath | None = None,
    mapping: StrPath | None = None,
    without: Sequence[str] = (),
    strict: bool = False,
    threads: int | None = None,
    binaries: StrPath | None = None,
) -> Report:
    """Finds which effect the model lacks against measured records, and writes the extended model: `discrepancy close`.

    :param rig: the model: a rig file or a `Rig` (its file); None: the shipped rig.toml. A model file is closed by `close_model`.
    :param train: records to fit: files, `Run` objects, frames of pandas, or MDF objects of asammdf.
    :param test: a record that is used only to judge the model.
    :param out: folder of the results; None: a new one in ./runs.
    :param mapping: what columns of foreign records mean (discrepancy/docs/records.md).
    :param without: effects that are no candidates.
    :param strict: refuse columns that the measurement file does not know.
    :param threads: results do not depend on them; None: all cores.
    :param binaries: folder of the programs; None: `programs.program` looks for them.
    :raises BadRecords: a record cannot be used; its `report` says why.
    :raises ProgramFailed: other bad input, with the program's message and exit code.
    """
    where = tasks.folder(out, "close")
    model = programs.file("rig.toml") if rig is None else rig.rig_file if isinstance(rig, Rig) else rig
    words = [str(programs.program("discrepancy", binaries)), "close", "--rig", str(model), "--out", str(where)]
    for option, asked in (("train", train), ("test", test)):
        files = [records.file(each, where / "records" / f"{option}-{number}") for number, each in enumerate(records.several(asked), 1)]
        words += [f"--{option}", *map(str, files)] if files else []
    words += ["--mapping", str(mapping)] if mapping else []
    words += [word for effect in without for word in ("--without", effect)]
    words += ["--strict"] if strict else []
    words += ["--threads", str(threads)] if threads is not None else []
    # Of an earlier call: it would pass for this one's.
    (where / "report.json").unlink(missing_ok=True)
    try:
        # 1: with --strict, nothing was confirmed; the report says so.
        tasks.done("discrepancy", words, where, good=(GOOD, BOUND_BROKEN))
    except ProgramFailed as failed:
        if failed.exit_code == BAD_INPUT and (where / "report.json").is_file():
            raise BadRecords(failed, Report(where)) from None
        raise
    return Report(where)


def _there(path: Path) -> Path | None:
    return path if path.is_file() else None


def _place(where: Mapping[str, Any]) -> str:
    return str(where["axis"]) + (f".{where['element']}" if where["element"] else "")


def _numbers(given: Sequence[Mapping[str, Any]]) -> list[Number]:
    return [Number(each["name"], each["value"], each["unit"], each["standard_error"], each["before"]) for each in given]


def _effects(given: Sequence[Mapping[str, Any]]) -> list[Effect]:
    return [
        Effect(
            each["effect"], _place(each["where"]), tuple(_numbers(each["parameters"])), each["share_explained"],
            tuple(_effects(each["alternatives"])),
        )
        for each in given
    ]


def _band(number: Number) -> str:
    return "not bounded" if number.band is None else f"{number.band[0]:.4g} to {number.band[1]:.4g}"
