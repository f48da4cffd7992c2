"""A run as an MDF of asammdf: the bus as `bench export` writes it, and the tables of the run's folder beside it."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from airbench_hil import programs, tasks
from airbench_hil.errors import GOOD
from airbench_hil.run import imported, read_table

if TYPE_CHECKING:
    from asammdf import MDF

#: Its columns keep their names, which `discrepancy` knows.
_PLAIN = "measurement"
_TABLES = (_PLAIN, "truth", "controller-drive", "controller-load")


def of(folder: Path) -> MDF:
    """The MDF of a run's folder, in memory. Its comment holds the set-up, as the first line of measurement.csv does."""
    asammdf = imported("asammdf", "mdf")
    with tempfile.TemporaryDirectory() as private:
        exported = Path(private) / "bus.mf4"
        words = [str(programs.program("bench")), "export", "--to", "mdf4", "--out", str(exported), str(folder)]
        tasks.done("bench", words, Path(private), good=(GOOD,))
        # Read whole: the file goes with its folder.
        with asammdf.MDF(exported) as bus:
            made: MDF = asammdf.MDF.concatenate([bus], version="4.10")
    for name in _TABLES:
        path = folder / f"{name}.csv"
        if path.is_file():
            frame = read_table(path)
            made.append([_channel(asammdf, frame, name, column) for column in frame.columns[1:]], acq_name=name)
            if name == _PLAIN:
                made.header.comment = "\n".join(frame.attrs["comments"])
    return made


def _channel(asammdf: Any, frame: Any, table: str, column: str) -> Any:
    values = frame[column].to_numpy()
    words = {"encoding": "utf-8"} if values.dtype.kind not in "biuf" else {}
    samples = values if not words else frame[column].fillna("").astype(str).str.encode("utf-8").to_numpy().astype("S")
    name = column if table == _PLAIN else f"{table}.{column}"
    times = frame[frame.columns[0]].to_numpy()
    return asammdf.Signal(samples=samples, timestamps=times, name=name, unit=frame.attrs["units"][column], **words)
