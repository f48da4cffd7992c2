"""Runs the ELF of a microcontroller as a member of the lockstep barrier: in cycle k it gets the frames of k, runs 1 ms, and what
it sends in that time acts in k + 1. Its time is the bus's time.
"""

from __future__ import annotations

import argparse
import json
import signal
import sys
import time
from typing import TYPE_CHECKING, Any

from airbench_hil import peer

if TYPE_CHECKING:
    from airbench_hil.core import Core

# Exit codes: protocol/src/exit.rs.
BAD_INPUT, BUS_FAILED, LOCKSTEP_TIMEOUT, INTERRUPTED = 2, 3, 4, 130


def _arguments(words: list[str] | None, prog: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog=prog,
        description="Runs the ELF of a microcontroller in labwired as a controller in lockstep with the rig: 1 ms of the core "
        "for each cycle of the bus. The emulator gets --pace lockstep --members 1. Ends with the bus.",
        epilog="Exit codes: 0 the bus has ended; 2 usage or bad input; 3 no bus or no cycle on it, or the core stopped, by a fault "
        "or since its main returned; 4 lockstep time-out; 130 interrupted.",
    )
    parser.add_argument("--elf", required=True, metavar="FILE", help="the program, as it would be flashed")
    parser.add_argument("--chip", default="stm32f103", help="the microcontroller (default: %(default)s)")
    parser.add_argument("--bus", metavar="URL", help="unix:///PATH (default: the embedded bus of this user)")
    parser.add_argument("--name", default="mcu", help="in the barrier, and in its messages (default: %(default)s)")
    parser.add_argument(
        "--boot-ms", type=int, default=10, metavar="N", help="how long it has been on when the rig begins (default: %(default)s)"
    )
    parser.add_argument(
        "--gdb", type=int, metavar="PORT", help="wait for GDB on 127.0.0.1:PORT, at reset; 0 takes any port and prints it"
    )
    parser.add_argument("--report", metavar="FILE", help="write what is printed at the end as JSON")
    return parser.parse_args(words)


def _fail(code: int, text: object) -> int:
    print(f"mcu: {text}", file=sys.stderr)
    return code


def _report(core: Core, sums: dict[str, int], began: float) -> dict[str, Any]:
    stack = core.stack()
    return {
        "cycles": sums["cycles"],
        "core_clocks": core.cycles,
        "frames_to_core": sums["heard"] - core.not_taken - core.lost_at_fifo - core.refused,
        "frames_filtered": core.not_taken,
        "frames_lost_at_fifo": core.lost_at_fifo,
        "frames_refused": core.refused,
        "frames_from_core": sums["said"],
        "latest_frame_us": sums["latest_us"],
        "stack_used_bytes": stack[0] if stack else None,
        "stack_bytes": stack[1] if stack else None,
        "wall_s": round(time.monotonic() - began, 2),
    }


def _lockstep(core: Core, bus: peer.Peer, boot_ms: int, sums: dict[str, int]) -> None:
    """The run, until the bus ends."""
    clocks_a_ms = core.cycles // boot_ms
    for cycle, frames in peer.cycles(bus):
        before = core.cycles
        heard = [frame for frame in frames if not frame.raw_id & peer.ERROR]
        for raw_id, data, clock in core.millisecond(heard):
            try:
                bus.send(raw_id, bytes(data))
            except peer.BusError:
                return  # the bus ended while the core ran
            sums["said"] += 1
            sums["latest_us"] = max(sums["latest_us"], round((clock - before) * 1000 / clocks_a_ms))
        sums["heard"] += len(heard)
        sums["cycles"] = cycle + 1
        if core.cycles != (boot_ms + cycle + 1) * clocks_a_ms:
            raise RuntimeError(f"cycle {cycle}: the core is at {core.cycles} clocks: its time is not the bus's")


def main(words: list[str] | None = None, prog: str = "scripts/mcu") -> int:
    """The program; gives its exit code."""
    asked = _arguments(words, prog)
    try:
        from airbench_hil.core import CHIPS, Core, CoreStopped
    except ImportError as missing:
        return _fail(BAD_INPUT, f"{missing}: pip install 'airbench-hil[mcu]'")
    if asked.boot_ms < 1:
        return _fail(BAD_INPUT, "--boot-ms: at least 1, since a CAN controller has to be started")
    try:
        path = peer.path_of(asked.bus)
        peer.check_name(asked.name)
        if asked.chip not in CHIPS:
            raise ValueError(f"--chip {asked.chip}: there is {', '.join(sorted(CHIPS))}")
        if asked.gdb is None:
            core = Core(asked.elf, asked.chip)
        else:
            from airbench_hil.debug import DebugCore

            core = DebugCore(asked.elf, asked.chip, asked.gdb)
    except (OSError, ValueError, RuntimeError) as wrong:
        return _fail(BAD_INPUT, f"{asked.elf}: {wrong}" if isinstance(wrong, OSError) else wrong)
    except KeyboardInterrupt:
        return INTERRUPTED
    began, sums = time.monotonic(), {"cycles": 0, "heard": 0, "said": 0, "latest_us": 0}
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    code, joined = 0, False
    try:
        for _ in range(asked.boot_ms):
            core.run_ns(1_000_000)
        core.check()
        core.said()
        bus = peer.Peer(path, stamped=False)
        bus.join(asked.name)
        joined = True
        _lockstep(core, bus, asked.boot_ms, sums)
        if sums["cycles"] == 0:
            code = _fail(BUS_FAILED, f"{path} ended before its first cycle; is it --pace lockstep, and the name taken?")
    except KeyboardInterrupt:
        code = INTERRUPTED
    except peer.BusError as gone:
        code = _fail(BUS_FAILED, gone)
    except (CoreStopped, RuntimeError) as stopped:  # labwired raises the second where an access leads nowhere
        code = _fail(BUS_FAILED, f"the core stopped: {stopped}")
    except peer.LockstepTimeout as late:
        code = _fail(LOCKSTEP_TIMEOUT, f"lockstep time-out: {late} was not done")
    finally:
        core.close()
    if not joined:
        return code
    report = _report(core, sums, began)
    print("\n".join(f"  {key:<22} {value}" for key, value in report.items()))
    if core.refused:
        print(f"mcu: the CAN controller refused {core.refused} frames, the last: {core.why_refused}", file=sys.stderr)
    if asked.report:
        try:
            with open(asked.report, "w", encoding="utf-8") as file:
                json.dump(report, file, indent=2)
                file.write("\n")
        except OSError as error:
            return _fail(BAD_INPUT, f"{asked.report}: {error}")
    return code


def entry() -> None:
    """The program as it is installed."""
    sys.exit(main(prog="airbench-mcu"))


if __name__ == "__main__":
    sys.exit(main())
