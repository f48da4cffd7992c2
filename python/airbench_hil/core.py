"""A microcontroller in the emulator labwired: its CAN controller at a wire of 1 Mbit/s, its time in the caller's hands."""

from __future__ import annotations

import tempfile
from importlib import resources
from pathlib import Path
from typing import TypedDict

import labwired

from airbench_hil import peer

CYCLE_NS = 1_000_000
_BITRATE = 1_000_000
_NS_A_BIT = 1_000_000_000 // _BITRATE
_STACK_PATTERN = 0xA5A5A5A5
_RF0R, _FIFO_MASK, _FIFO_DEPTH = 0x0C, 3, 3

# What the core's exceptions are called (DDI 0337, table 5-1). Number 1, reset, is the firmware's word for the end of main.
_EXCEPTIONS = {2: "NMI", 3: "HardFault", 4: "MemManage", 5: "BusFault", 6: "UsageFault", 11: "SVCall", 14: "PendSV", 15: "SysTick"}


class Chip(TypedDict):
    """What is known of a microcontroller beside its chip file."""

    bus: str
    can_base: int
    hz: int


CHIPS: dict[str, Chip] = {"stm32f103": {"bus": "bxcan1", "can_base": 0x40006400, "hz": 8_000_000}}


class CoreStopped(Exception):
    """The emulator cannot go on: an instruction or an access that the chip does not have; or the firmware says that it stopped."""


def wire_ns(raw_id: int, length: int) -> int:
    """Time of a frame on the wire up to the next one, ns, without stuff bits: data and 47 bits, 67 with 29-bit identifiers."""
    data = 0 if raw_id & peer.REMOTE else 8 * min(length, 8)
    return ((67 if raw_id & peer.EXTENDED else 47) + data) * _NS_A_BIT


def system_file(chip: str, folder: str) -> Path:
    """Writes what labwired wants to know of a chip into the folder, and gives the path of the file that it reads first."""
    text = resources.files("airbench_hil").joinpath(f"chips/{chip}.yaml").read_text()
    Path(folder, "chip.yaml").write_text(text)
    system = Path(folder, "system.yaml")
    system.write_text("name: airbench\nchip: chip.yaml\nexternal_devices: []\nboard_io: []\n")
    return system


class Core:
    """One ELF on one chip, from reset on."""

    def __init__(self, elf: str, chip: str) -> None:
        """Raises ValueError for an unknown chip, OSError or ValueError for an ELF that cannot be loaded."""
        if chip not in CHIPS:
            raise ValueError(f"chip '{chip}' is unknown; there is: {', '.join(sorted(CHIPS))}")
        self.chip, self.bus, self._can = chip, CHIPS[chip]["bus"], CHIPS[chip]["can_base"]
        with tempfile.TemporaryDirectory(prefix="airbench-mcu-") as folder:
            self.sim = labwired.Sim(str(elf), system=str(system_file(chip, folder)))
        self.not_taken = self.lost_at_fifo = self.refused = 0
        self.why_refused = ""
        self._record = self._symbol("fault_record")

    def close(self) -> None:
        """Nothing runs that had to be ended."""

    @property
    def cycles(self) -> int:
        """Clocks since reset."""
        return int(self.sim.cycles)

    def run_ns(self, duration_ns: int) -> None:
        """Runs for that time of its own. Raises CoreStopped."""
        if duration_ns == 0:
            return
        stop = self.sim.run_for(f"{duration_ns}ns")
        if stop.kind != "reached":
            raise CoreStopped(f"{stop.kind} at {self.sim.cycles} clocks, pc {stop.pc}")

    def hear(self, frame: peer.Frame) -> None:
        """A frame that comes to its end on the wire. What the chip does not take is counted."""
        if frame.raw_id & peer.ERROR:
            return
        if self.sim.read_u32(self._can + _RF0R) & _FIFO_MASK == _FIFO_DEPTH:
            # The real one overwrites the newest, or drops the frame, and sets FOVR: one frame is lost either way.
            self.lost_at_fifo += 1
            return
        try:
            self.sim.inject_can(
                self.bus,
                frame.raw_id & (0x1FFFFFFF if frame.raw_id & peer.EXTENDED else 0x7FF),
                frame.data,
                extended=bool(frame.raw_id & peer.EXTENDED),
                remote=bool(frame.raw_id & peer.REMOTE),
            )
        except ValueError as refused:
            if "filter" in str(refused):
                self.not_taken += 1
            else:
                self.refused += 1
                self.why_refused = str(refused)

    def said(self) -> list[tuple[int, list[int], int]]:
        """Frames that it has sent since the last call, in its order: (raw_id, data, clocks since reset)."""
        flags = {"extended": peer.EXTENDED, "remote": peer.REMOTE}
        return [
            (payload["id"] | sum(payload[name] * flag for name, flag in flags.items()), payload["data"], each["cycle"])
            for each in self.sim.frames()
            if (payload := each["payload"])["direction"] == "tx"
        ]

    def millisecond(self, frames: list[peer.Frame]) -> list[tuple[int, list[int], int]]:
        """Runs 1 ms in which these frames come, one after the other as on a wire; gives what it sent.

        Raises CoreStopped.
        """
        now_ns = ends_ns = 0
        for frame in frames:
            # What exceeds the millisecond of a wire comes at its end, and is the firmware's affair in the next one.
            ends_ns = min(ends_ns + wire_ns(frame.raw_id, frame.length), CYCLE_NS)
            self.run_ns(ends_ns - now_ns)
            now_ns = ends_ns
            self.hear(frame)
        self.run_ns(CYCLE_NS - now_ns)
        self.check()
        return self.said()

    def check(self) -> None:
        """Raises CoreStopped when the ELF has a `fault_record`, two words, and the first is not 0: an exception's number, its pc."""
        exception = self.word(self._record) if self._record else 0
        if exception == 1:
            raise CoreStopped("its main has returned")
        if exception:
            name = _EXCEPTIONS.get(exception, f"interrupt {exception - 16}" if exception > 15 else f"exception {exception}")
            raise CoreStopped(f"{name}, pc {self.word((self._record or 0) + 4):#010x}")

    def stack(self) -> tuple[int, int] | None:
        """Bytes of the stack that were used, and its size; None when the ELF has none between `stack_begin` and `stack_end`."""
        begin, end = self._symbol("stack_begin"), self._symbol("stack_end")
        if begin is None or end is None:
            return None
        free = 0
        while begin + free < end and self.word(begin + free) == _STACK_PATTERN:
            free += 4
        return end - begin - free, end - begin

    def _symbol(self, name: str) -> int | None:
        """Its address; None when the ELF has none of that name."""
        try:
            found: int | None = self.sim.symbol(name)
            return found
        except (KeyError, ValueError):
            return None

    def word(self, address: int) -> int:
        """Four bytes of its memory."""
        return int(self.sim.read_u32(address))
