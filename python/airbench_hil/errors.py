"""What goes wrong, as exceptions; each says what the program said, and has its exit code where there is one."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from airbench_hil.report import Report

#: Exit codes of all programs (protocol/src/exit.rs).
GOOD, BOUND_BROKEN, BAD_INPUT, PARTNER_FAILED, LOCKSTEP_TIMEOUT, INTERRUPTED = 0, 1, 2, 3, 4, 130


class AirbenchError(Exception):
    """Anything that this package raises, but for a failed expectation and for arguments that cannot be meant (ValueError)."""


class ProgramNotFound(AirbenchError):
    """A program or a file of the rig is nowhere to be found; the text lists where it was looked for."""


class ProgramFailed(AirbenchError):
    """A program ended with an error.

    :ivar program: its name in the rig, such as "emulator" or "controller".
    :ivar exit_code: as it ended; negative: the signal that ended it.
    :ivar said: the last lines of its standard error.
    """

    def __init__(self, program: str, exit_code: int, said: str, folder: Path | None = None) -> None:
        how = f"was ended by signal {-exit_code}" if exit_code < 0 else f"ended with exit code {exit_code}"
        where = f"\nrun folder: {folder}" if folder else ""
        super().__init__(f"{program} {how}:\n{said or '(it said nothing)'}{where}")
        self.program, self.exit_code, self.said, self.folder = program, exit_code, said, folder


class BadRecords(ProgramFailed):
    """`discrepancy close` cannot use a record; the text says which, where, and what to change.

    :ivar report: the `Report`, whose verdict is "bad-data".
    """

    def __init__(self, failed: ProgramFailed, report: Report) -> None:
        super().__init__(failed.program, failed.exit_code, failed.said, failed.folder)
        self.report = report


class BadModel(AirbenchError):
    """A model file or its report does not fit its schema; the text has the file, and a line for each place that is wrong.

    :ivar file: what was read.
    :ivar errors: those lines.
    """

    def __init__(self, file: Path, errors: list[str]) -> None:
        super().__init__("\n".join(f"{file}: {error}" for error in errors))
        self.file, self.errors = file, errors


class RigEnded(AirbenchError):
    """The run is over, and something was asked that needs it to go on."""


class NotAnswered(AirbenchError):
    """A controller did not answer within the wall time that it has for a cycle; simulated time stands."""


class Refused(AirbenchError):
    """The rig's console refused a command, such as a fault; the text says what is allowed."""


class SignalUnknown(AirbenchError, ValueError):
    """No signal of that name in rig.dbc, or an expression that cannot be meant."""


class NotSeen(AirbenchError):
    """A signal whose frame has not come yet."""


class ExpectationFailed(AssertionError):
    """An expectation was not met. The text shows the last seconds of the signals concerned and names the run's folder.

    :ivar folder: the run's folder.
    :ivar picture: an SVG of these seconds; None where nothing could be drawn.
    """

    #: Robot Framework shows the text alone.
    ROBOT_SUPPRESS_NAME = True

    def __init__(self, text: str, folder: Path, picture: Path | None) -> None:
        super().__init__(text)
        self.folder, self.picture = folder, picture
