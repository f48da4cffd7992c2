"""An embedded bus without a rig for each module, hosted by `emulator bus` from AIRBENCH_BIN_DIR or target/release; an ELF."""

import os
import signal
import struct
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


@pytest.fixture(scope="session", autouse=True)
def light_children():
    """Interpreters that a test starts have no asammdf, as where airbench-hil is installed without extras; the test itself has."""
    before = os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [str(Path(__file__).parent / "light"), before]))
    yield
    os.environ["PYTHONPATH"] = before or ""


@pytest.fixture
def asammdf():
    """The package, also in a session from which `light` keeps it."""
    if "asammdf" in sys.modules and sys.modules["asammdf"] is None:
        del sys.modules["asammdf"]
    return pytest.importorskip("asammdf")


def emulator():
    """The program."""
    return Path(os.environ.get("AIRBENCH_BIN_DIR", ROOT / "target/release"), "emulator")


def start_host(path):
    """Starts a host; it is there when this returns."""
    program = emulator()
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


@pytest.fixture
def elf(tmp_path):
    """A program for the chip: two vectors, 64 times `nop`, and a branch back to the first. It never touches CAN."""
    flash, stack, first = 0x08000000, 0x20005000, 0x08000008
    code = struct.pack("<II", stack, first | 1) + b"\x00\xbf" * 64 + struct.pack("<H", 0xE000 | -66 & 0x7FF)
    header = struct.pack("<16s2H5I6H", b"\x7fELF\x01\x01\x01", 2, 40, 1, first | 1, 52, 0, 0x05000000, 52, 32, 1, 40, 0, 0)
    segment = struct.pack("<8I", 1, 84, flash, flash, len(code), len(code), 5, 4)
    (tmp_path / "nops.elf").write_bytes(header + segment + code)
    return tmp_path / "nops.elf"
