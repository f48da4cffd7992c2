"""Programs that do one task and end, such as `discrepancy close`: under a guard too, so that none is left whatever ends this process."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from airbench_hil.controllers import StrPath
from airbench_hil.errors import ProgramFailed
from airbench_hil.processes import Processes, private_folder

#: An interrupted program has this long to save what it has, s.
_FAREWELL_S = 10.0


def folder(out: StrPath | None, title: str) -> Path:
    """The folder of results: `out`, made if missing, or a new one in ./runs, named by time and title."""
    if out is not None:
        asked = Path(out).resolve()
        asked.mkdir(parents=True, exist_ok=True)
        return asked
    runs = Path("runs").resolve()
    runs.mkdir(exist_ok=True)
    return Path(tempfile.mkdtemp(prefix=time.strftime(f"%Y%m%d-%H%M%S-{title}-"), dir=runs))


def done(name: str, words: Sequence[str], where: Path, good: Sequence[int]) -> int:
    """Runs a program to its end and gives its exit code; what it printed is in programs/NAME.txt and NAME.err of that folder.

    :raises ProgramFailed: its exit code is none of the good ones.
    """
    output = where / "programs"
    output.mkdir(exist_ok=True)
    said = [output / f"{name}{ending}" for ending in (".txt", ".err")]
    for file in said:
        file.unlink(missing_ok=True)
    processes = Processes(private_folder(), output)
    grace_s = _FAREWELL_S
    try:
        processes.start(name, list(words))
        while not processes.wait([name], 3600.0):
            pass  # it takes as long as it takes
        grace_s = 0.0
    finally:
        processes.close(grace_s)
    code = processes.ended[name]
    if code not in good:
        # Some say on standard output what the matter is, and how far they came on the other.
        raise ProgramFailed(name, code, "\n".join(filter(None, (file.read_text(errors="replace").strip() for file in said))), where)
    return code
