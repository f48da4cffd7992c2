"""Measured records, as programs take them: files, runs, and frames of pandas or MDF files of asammdf, which are written as CSV."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Union

from airbench_hil.controllers import StrPath
from airbench_hil.run import Run

if TYPE_CHECKING:
    import pandas
    from asammdf import MDF

#: A file (measurement.csv, bus.log, any CSV with a mapping), a run, a frame with a column or an index `time_s`, or an MDF of asammdf.
Record = Union[StrPath, Run, "pandas.DataFrame", "MDF"]


def several(records: Record | Sequence[Record]) -> list[Record]:
    """One record or several as a list."""
    given: Any = records
    return list(given) if isinstance(given, (list, tuple)) else [given]


def file(record: Record, place: Path, time: str = "time_s") -> Path:
    """The file of a record; `place` without its ending is where one is written that is none yet, with that column of the time.

    Every stamp of every channel of an MDF makes a row; what was not sampled at it stays empty, and nothing is interpolated.

    :raises ValueError: it is no record.
    """
    if isinstance(record, Run):
        return record.folder / "measurement.csv"
    if isinstance(record, (str, os.PathLike)):
        return Path(record)
    given: Any = record
    comments: Sequence[str] = ()
    if hasattr(given, "to_dataframe"):
        frame = given.to_dataframe(time_from_zero=True, use_interpolation=False)
        frame.index.name = time
        # As `Run.mdf` puts it there.
        comments = re.findall(r"^(?:<TX>)?(# \w+=.*?)(?:</TX>)?$", given.header.comment, re.MULTILINE)
    elif hasattr(given, "to_csv") and hasattr(given, "columns"):
        frame, comments = given, given.attrs.get("comments", ())
    else:
        raise ValueError(f"record {given!r}: a file, a Run, a frame of pandas or an MDF of asammdf")
    has_time = time in frame.columns
    if not has_time and frame.index.name != time:
        raise ValueError(f"the frame has neither a column nor an index {time}; it has {', '.join(map(str, frame.columns))}")
    path = place.with_suffix(".csv")
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", encoding="utf-8", newline="") as out:
        out.writelines(f"{line}\n" for line in comments)
        frame.to_csv(out, index=not has_time)
    return path
