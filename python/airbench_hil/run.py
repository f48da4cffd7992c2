"""A run that is over: its figures, its tables and its frames, from its folder (docs/run-folder.md)."""

from __future__ import annotations

import importlib
import json
from collections.abc import Mapping
from functools import cached_property
from html import escape
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import can

if TYPE_CHECKING:
    import pandas
    from asammdf import MDF

#: Endings of names in tables, and their units; the longest that fits counts.
_UNITS = {
    "_m_per_s2": "m/s^2", "_m_per_s": "m/s", "_m3_per_s": "m^3/s", "_N_per_s": "N/s", "_per_s": "1/s", "_kg_per_s": "kg/s",
    "_m": "m", "_N": "N", "_Pa": "Pa", "_s": "s", "_kg": "kg", "_K": "K",
    "_m3": "m^3", "_W": "W", "_J": "J", "_ns": "ns", "_us": "us", "_ms": "ms", "_n": "N", "_pa": "Pa", "_ratio": "1",
}


def unit_of(name: str) -> str:
    """The unit that the ending of a name says, such as "m" of drive_position_m; "1" for numbers without."""
    fitting = [ending for ending in _UNITS if name.endswith(ending)]
    return _UNITS[max(fitting, key=len)] if fitting else "1"


class Run:
    """What a run left in its folder."""

    def __init__(self, folder: str | Path, exit_codes: Mapping[str, int] | None = None) -> None:
        """Opens the folder of any run.

        :raises FileNotFoundError: there is no summary.json in it.
        """
        self.folder = Path(folder)
        self.exit_codes: dict[str, int] = dict(exit_codes or {})
        """As each program ended; negative: the signal. A controller ends with 1 when a stop ended its experiment."""
        self.summary: dict[str, Any] = json.loads((self.folder / "summary.json").read_text(encoding="utf-8"))
        """All of summary.json."""

    @cached_property
    def figures(self) -> dict[str, float]:
        """Figures by their names in `bench figures` and other numbers of summary.json, in SI; the unit is in the name."""
        numbers = {key: value for key, value in self.summary.items() if _is_number(value)}
        return numbers | {key: value for key, value in (self.summary.get("figures") or {}).items() if _is_number(value)}

    @property
    def passed(self) -> bool | None:
        """Whether all bounds of the experiment were kept; None in a run that was not summed up."""
        passed: bool | None = self.summary.get("passed")
        return passed

    @property
    def ended_because(self) -> str:
        """Why the rig ended, in words."""
        return str(self.summary.get("ended_because") or "")

    @property
    def events(self) -> list[dict[str, Any]]:
        """Events of the run: `cycle`, `kind` and what belongs to it."""
        return list(self.summary.get("events") or [])

    @cached_property
    def measurement(self) -> pandas.DataFrame:
        """Sensors and valves, a row each millisecond; `attrs["units"]` has the unit of each column."""
        return self.table("measurement.csv")

    @cached_property
    def truth(self) -> pandas.DataFrame:
        """What only a simulation knows; units as in `measurement`."""
        return self.table("truth.csv")

    def table(self, name: str) -> pandas.DataFrame:
        """Any table of the folder as a frame with units.

        :raises ImportError: pandas is not installed: pip install 'airbench-hil[pandas]'
        """
        return read_table(self.folder / name)

    def messages(self) -> list[can.Message]:
        """Every frame of bus.log, as python-can reads it; stamps in s, of simulated time from 0 in lockstep."""
        with can.LogReader(self.folder / "bus.log") as reader:
            return list(reader)

    def mdf(self) -> MDF:
        """The run as an MDF of asammdf, times in s from cycle 0, in memory: `mdf().save("run.mf4")` writes it.

        Frames of the bus are `DriveSensors.position_m`, a group for each message; columns of measurement.csv keep their names, those of other
        tables are `truth.drive_position_m`. Every channel has its unit.

        :raises ImportError: asammdf is not installed: pip install 'airbench-hil[mdf]'
        :raises ProgramFailed: `bench export` failed.
        """
        from airbench_hil import mdf

        return mdf.of(self.folder)

    @property
    def picture(self) -> Path | None:
        """The run's picture, SVG, if it was summed up."""
        path = self.folder / "picture.svg"
        return path if path.exists() else None

    def __repr__(self) -> str:
        return f"<Run {self.folder}: {self.ended_because or 'no end'}>"

    def _repr_html_(self) -> str:
        rows = "".join(f"<tr><td>{escape(key)}</td><td>{value:.6g}</td></tr>" for key, value in self.figures.items())
        drawing = self.picture.read_text(encoding="utf-8") if self.picture else ""
        return f"<p>{escape(str(self.folder))}: {escape(self.ended_because)}</p>{drawing}<table>{rows}</table>"


def read_table(path: Path) -> pandas.DataFrame:
    """A CSV file as a frame; `attrs["units"]` has the unit of each column, `attrs["comments"]` the lines before the head."""
    module = import_pandas()
    with path.open(encoding="utf-8") as file:
        comments = [line.rstrip("\n") for line in takewhile(lambda line: line.startswith("#"), file)]
    frame: pandas.DataFrame = module.read_csv(path, comment="#")
    frame.attrs["units"] = {column: unit_of(str(column)) for column in frame.columns}
    frame.attrs["comments"] = comments
    return frame


def import_pandas() -> Any:
    """The module. Raises ImportError, which says how to install it."""
    return imported("pandas", "pandas")


def imported(module: str, extra: str) -> Any:
    """A module that airbench-hil[extra] brings.

    :raises ImportError: it is not installed; the text says how to.
    """
    try:
        return importlib.import_module(module)
    except ImportError as missing:
        raise ImportError(f"{missing}: pip install 'airbench-hil[{extra}]'") from missing


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)
