"""What airbench-mcu says when no run comes of it."""

import subprocess
import sys
import threading

from conftest import ROOT, emulator

from airbench_hil import peer


def mcu(*arguments):
    words = [sys.executable, "-m", "airbench_hil.mcu", *map(str, arguments)]
    return subprocess.run(words, cwd=ROOT / "python", capture_output=True, text=True, timeout=120)


def test_a_bus_without_a_barrier_is_named(elf, bus_path):
    ended = threading.Event()

    def talk():
        node = peer.Peer(bus_path)
        # In bursts that the host can keep for a peer.
        while not ended.wait(0.02):
            for _ in range(400):
                node.send(0x123, b"")
        node.close()

    talker = threading.Thread(target=talk)
    talker.start()
    done = mcu("--elf", elf, "--bus", f"unix://{bus_path}")
    ended.set()
    talker.join()
    assert done.returncode == 3 and "has no lockstep barrier" in done.stderr, done


def test_a_name_is_looked_at_before_the_core_starts(elf):
    done = mcu("--elf", elf, "--bus", "unix:///nowhere/bus0", "--name", 21 * "n", "--gdb", "0")
    assert done.returncode == 2 and "1 to 20 bytes" in done.stderr and "halted" not in done.stderr, done


def test_frames_that_the_can_controller_refuses_are_counted_and_the_reason_is_said(elf, tmp_path):
    url = f"unix://{tmp_path / 'bus0'}"
    words = [emulator(), "run", "--bus", url, "--rig", ROOT / "plant/rig.toml", "--out", tmp_path / "run"]
    words += ["--pace", "lockstep", "--members", "1", "--seconds", "0.02"]
    with subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as rig:
        done = mcu("--elf", elf, "--bus", url)
        assert rig.wait(60) == 0
    assert done.returncode == 0 and "clock is not enabled" in done.stderr, done
    [refused] = [line.split()[1] for line in done.stdout.splitlines() if "frames_refused" in line]
    assert int(refused) >= 40, done
