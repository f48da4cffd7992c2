"""Nothing is left of a rig when the interpreter that asked for it is killed, at whatever moment."""

import json
import os
import random
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

from airbench_hil import programs
from airbench_hil.guests import Readiness

# What a killed test might have been doing, again and again; its processes carry MARK in their environment.
_VICTIM = """
import signal, sys, tempfile
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell may have had it ignored for what it started beside itself
sys.path.insert(0, "PATH")
import airbench_hil
from airbench_hil import Own, Process, Rig
shell = Process(["sh", "-c", "sleep 1000 & sleep 1000"], joins=True, name="shell")
number = 0
while True:
    number += 1
    with Rig("step", pace="PACE", controller=Own(), emulator_options=["--no-realtime"], out=f"OUT/{number}") as rig:
        rig.run_for("0.2 s")
        rig.fault("valve-stuck", "drive")
        rig.run_for("0.1 s")
        rig.end()
    print(number, flush=True)
"""


def processes_with(mark):
    """Process ids whose environment holds the mark."""
    found = []
    for entry in filter(str.isdigit, os.listdir("/proc")):
        try:
            if mark.encode() in Path(f"/proc/{entry}/environ").read_bytes() and int(entry) != os.getpid():
                found.append(int(entry))
        except OSError:
            continue
    return found


def of_process(pid, file):
    """A file of a process in /proc; empty where the process has ended."""
    try:
        return Path(f"/proc/{pid}/{file}").read_bytes()
    except OSError:
        return b""


def gone(mark, private, timeout_s=60.0):
    """Waits until there is no process and no private folder; whether that came to pass."""
    until = time.monotonic() + timeout_s
    while processes_with(mark) or list(private.iterdir()):
        if time.monotonic() > until:
            return False
        time.sleep(0.02)
    private.rmdir()
    return True


def start(tmp_path, pace, number, shell=False):
    """A victim, its mark, and the folder of its sockets."""
    # Of a path that is short enough for sockets.
    mark, private = f"AIRBENCH_TEST_MARK={tmp_path}-{number}", Path(tempfile.mkdtemp(prefix="ab-"))
    text = _VICTIM.replace("PATH", str(programs.PACKAGE.parent)).replace("PACE", pace).replace("OUT", str(tmp_path / f"out-{number}"))
    if shell:
        # Of a real rig with a program that leaves a grandchild behind.
        text = text.replace("controller=Own()", "controller=[Own(), shell]").replace("joins=True", "axis='load'")
    environment = {**os.environ, "TMPDIR": str(private), "XDG_RUNTIME_DIR": "", **dict([mark.split("=", 1)])}
    victim = subprocess.Popen([sys.executable, "-c", text], env=environment, stdout=subprocess.PIPE, start_new_session=True)
    return victim, mark, private


@pytest.mark.parametrize("pace", ["lockstep", pytest.param("real", marks=pytest.mark.airbench_realtime)])
def test_a_kill_at_random_moments_leaves_no_process_no_socket_no_lock_and_readable_folders(tmp_path, pace):
    chance = random.Random(34)
    runs = 0
    for number in range(10):
        victim, mark, private = start(tmp_path, pace, number)
        # From before the first rig is up to some runs later; the first line tells that one was.
        if number % 2:
            victim.stdout.readline()
        time.sleep(chance.uniform(0.0, 0.6))
        victim.send_signal(signal.SIGKILL)
        victim.wait()
        assert gone(mark, private), (number, processes_with(mark), list(private.iterdir()))
        for log in (tmp_path / f"out-{number}").rglob("bus.log"):
            runs += 1
            assert all(line.startswith("(") and "#" in line for line in log.read_text().splitlines()), log
    assert runs >= 5, "some rigs ran when it was killed"


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGKILL], ids=lambda number: number.name)
def test_grandchildren_of_a_foreign_program_end_too(tmp_path, number):
    victim, mark, private = start(tmp_path, "real", 0, shell=True)
    until = time.monotonic() + 60
    while not any(of_process(pid, "comm") == b"sleep\n" for pid in processes_with(mark)):
        assert time.monotonic() < until and victim.poll() is None, "it starts"
        time.sleep(0.01)
    victim.send_signal(number)
    victim.wait(60)
    assert gone(mark, private), (processes_with(mark), list(private.iterdir()))


def test_a_guard_that_is_killed_takes_its_programs_along(tmp_path):
    victim, mark, private = start(tmp_path, "lockstep", 0)
    victim.stdout.readline()
    until = time.monotonic() + 60
    while True:
        guards = [pid for pid in processes_with(mark) if b"guard.py" in of_process(pid, "cmdline")]
        if guards and len(processes_with(mark)) >= 4:
            break
        assert time.monotonic() < until
    os.kill(guards[0], signal.SIGKILL)
    while set(processes_with(mark)) - {victim.pid} and victim.poll() is None:
        assert time.monotonic() < until
        # The victim sees an exception and ends, or starts no other rig.
        time.sleep(0.02)
    victim.kill()
    victim.wait()
    left = time.monotonic() + 60
    while processes_with(mark):
        assert time.monotonic() < left, processes_with(mark)
        time.sleep(0.02)
    # Who would have removed the bus's folder is gone.
    shutil.rmtree(private)


def test_a_guard_whose_kernel_has_no_pidfd_open_learns_the_end_from_its_socket(tmp_path):
    ours, theirs = socket.socketpair()
    code = f"import os, runpy; del os.pidfd_open; runpy.run_path({str(programs.PACKAGE / 'guard.py')!r}, run_name='__main__')"
    words = [sys.executable, "-I", "-S", "-c", code, str(theirs.fileno()), str(os.getpid()), str(tmp_path / "private")]
    guard = subprocess.Popen(words, pass_fds=[theirs.fileno()])
    theirs.close()
    files = {"out": "/dev/null", "err": "/dev/null"}
    asked = {"do": "start", "name": "one", "words": ["sleep", "1000"], "env": None, "cwd": None, **files}
    assert json.loads(ours.recv(1000)) == {"ready": True} and (tmp_path / "private").is_dir()
    ours.sendall(json.dumps(asked).encode() + b"\n")
    pid = json.loads(ours.recv(1000))["pid"]
    ours.close()
    assert guard.wait(60) == 0
    assert not Path(f"/proc/{pid}").exists() and not (tmp_path / "private").exists()


def test_a_guest_that_waits_for_input_in_another_thread_is_ready():
    code = "import os, threading, time; threading.Thread(target=os.read, args=(0, 1), daemon=True).start(); time.sleep(1000)"
    starts = "import subprocess, sys; subprocess.run([sys.executable, '-c', sys.argv[1]])"
    bench = subprocess.Popen([sys.executable, "-c", starts, code], stdin=subprocess.PIPE, start_new_session=True)
    try:
        ready, until = Readiness(bench.pid), time.monotonic() + 60
        while not ready.look():
            assert time.monotonic() < until
            time.sleep(0.005)
    finally:
        os.killpg(bench.pid, signal.SIGKILL)
        bench.communicate()
