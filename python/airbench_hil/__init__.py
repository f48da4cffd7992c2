"""airbench for tests in Python: a rig with what controls it, expectations on signals, faults; a python-can interface beside it.

    with airbench_hil.Rig("point-to-point", controller=airbench_hil.Own("position-p")) as rig:
        rig.expect("DriveSensors.position > 0.39", within="20 s")
        run = rig.finish()
    assert run.figures["position_error_dynamic_m"] < 0.004
"""

from airbench_hil.campaigns import Campaign, campaign
from airbench_hil.controllers import Elf, Own, Process, Python, Sensors
from airbench_hil.errors import (
    AirbenchError,
    BadModel,
    BadRecords,
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
from airbench_hil.models import Missing, ModelFile, ModelNumber, ModelReport, close_model
from airbench_hil.report import Effect, Gap, Number, Report, close
from airbench_hil.rig import Rig
from airbench_hil.run import Run

__version__ = "0.1.0"

__all__ = [
    "AirbenchError", "BadModel", "BadRecords", "Campaign", "Effect", "Elf", "ExpectationFailed", "Fault", "Gap", "Missing", "ModelFile",
    "ModelNumber", "ModelReport", "NotAnswered", "NotSeen", "Number", "Own", "Process", "ProgramFailed", "ProgramNotFound", "Python",
    "Refused", "Report", "Rig", "RigEnded", "Run", "Sensors", "SignalUnknown", "campaign", "close", "close_model",
]
