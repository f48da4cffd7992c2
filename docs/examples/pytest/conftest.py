"""What the tests of this folder share: experiments, and the firmware in C, which is built once if no folder of it is given."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from airbench_hil import Own, Process

HERE = Path(__file__).resolve().parent
FIRMWARE = HERE.parents[2] / "tests/firmware"


@pytest.fixture
def move():
    """One move of 0.2 m in 1 s out, a rest of 1 s: some 2.5 s of the rig's time in all."""
    return {
        "title": "move", "number": 99,
        "rig": {"carriage_position_m": 0.1, "linked": False},
        "run": {"repetitions": 1, "after_emergency_stop": "restart"},
        "drive": {
            "program": "position-cascade", "start_m": 0.1,
            "set-point": [
                {"law": "bestehorn", "to_m": 0.3, "duration_s": 1.0},
                {"law": "rest", "duration_s": 1.0},
            ],
        },
    }


@pytest.fixture
def moving(airbench_rig, move):
    """A rig with airbench's own controller in the middle of that move."""
    def start(controller=None, **more):
        rig = airbench_rig(move, controller=controller or Own(), **more)
        rig.wait_for("DriveSensors.position > 0.2")
        return rig

    return start


@pytest.fixture(scope="session")
def firmware_folder(tmp_path_factory):
    """The firmware's programs: of $AIRBENCH_FIRMWARE, or built with gcc and make."""
    if folder := os.environ.get("AIRBENCH_FIRMWARE"):
        return Path(folder)
    if not FIRMWARE.is_dir() or not (shutil.which("gcc") and shutil.which("make")):
        pytest.skip("the firmware is not there and cannot be built: AIRBENCH_FIRMWARE=FOLDER, or a checkout, gcc and make")
    folder = tmp_path_factory.mktemp("firmware")
    subprocess.run(["make", "-s", "-C", FIRMWARE, f"BUILD={folder}", f"PYTHON={sys.executable}"], check=True)
    return folder


@pytest.fixture
def firmware(firmware_folder):
    """The firmware as a program of the embedded bus; it takes part in lockstep by its echo."""
    return Process([firmware_folder / "firmware-embedded", "{path}"], says_done=True, name="firmware")


@pytest.fixture
def firmware_rig(airbench_rig, firmware):
    """A rig with the firmware, its carriage at 0.15 m."""
    def start(**more):
        return airbench_rig(controller=firmware, setup={"carriage_position_m": 0.15}, **more)

    return start
