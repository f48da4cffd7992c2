"""airbench for tests in Python: a rig with what controls it, expectations on signals, faults; a python-can interface beside it.

    with airbench_hil.Rig("point-to-point", controller=airbench_hil.Own("position-p")) as rig:
        rig.expect("DriveSensors.position > 0.39", within="20 s")
        run = rig.finish()
    assert run.figures["position_error_dynamic_m"] < 0.004
"""

from airbench_hil.controllers import Elf, Own, Process, Python, Sensors
from airbench_hil.errors import (
    AirbenchError,
    ExpectationFailed,
    NotAnswered,
    NotSeen,
    ProgramFailed,
    ProgramNotFound,
    Refused,
    RigEnded,
    SignalUnknown,
)
from airbench_hil.faults import Fault
from airbench_hil.rig import Rig
from airbench_hil.run import Run

__version__ = "0.1.0"

__all__ = [
    "AirbenchError", "Elf", "ExpectationFailed", "Fault", "NotAnswered", "NotSeen", "Own", "Process", "ProgramFailed",
    "ProgramNotFound", "Python", "Refused", "Rig", "RigEnded", "Run", "Sensors", "SignalUnknown",
]
