"""An embedded bus without a rig for each module, hosted by `emulator bus` from AIRBENCH_BIN_DIR or target/release."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
# python-can's own tests, a package by the name of `test`, as its source distribution has them; scripts/tools.sh puts them there.
PYTHON_CAN = Path(os.environ.get("AIRBENCH_PYTHON_CAN", ROOT / "target/tools/python-can"))
sys.path.insert(0, str(PYTHON_CAN))
sys.modules.pop("test", None)


def start_host(path):
    """Starts a host; it is there when this returns."""
    program = Path(os.environ.get("AIRBENCH_BIN_DIR", ROOT / "target/release"), "emulator")
    host = subprocess.Popen([program, "bus", "--bus", f"unix://{path}"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    until = time.monotonic() + 60
    while not Path(path).exists():
        assert host.poll() is None and time.monotonic() < until, f"{program} hosts no bus"
        time.sleep(0.01)
    return host


def end_host(host):
    """Ends it, as Ctrl-C does."""
    host.send_signal(signal.SIGINT)
    host.communicate(timeout=60)


@pytest.fixture(scope="module")
def bus_path(tmp_path_factory):
    """The socket of a bus."""
    path = tmp_path_factory.mktemp("bus") / "bus0"
    host = start_host(path)
    yield str(path)
    end_host(host)
