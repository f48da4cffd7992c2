"""Counts what the firmware's answers cost on a real Cortex-M3, instruction by instruction.

    cortex_m3_cycles.py COUNT_ELF [ARM_PREFIX]

COUNT_ELF is firmware-count.elf, whose CAN controller lies in the RAM: this script plays it. An emulator executes each
instruction (labwired counts one clock for any), the Cortex-M3 Technical Reference Manual (ARM DDI 0337I, table 3-1) says what it
takes. Where that gives a range, its upper end is taken: 3 clocks to fill the pipeline after a branch, 12 for a division, 5 and 7
for 64-bit products; no load is taken for pipelined. The flash has no wait states up to 24 MHz (PM0075). Of each kind of
millisecond the result says the instructions and the clocks of a real one; accesses to the CAN controller on its slower bus are
not in it, some 4 clocks for each of about 20. The result is a JSON object.
"""

import json
import os
import re
import struct
import subprocess
import sys
import tempfile

import labwired

from airbench_hil import core

CAN, TSR, MSR, RF0R = 0x20004800, 0x08, 0x04, 0x0C
RECEIVED = 0x1B0
ALL_EMPTY, RELEASE, INITIALISED = 0x1C000000, 1 << 5, 1
FILL = 3
SENSORS, TICK, STATUS = 0x120, 0x130, 0x140
CONDITION = "(eq|ne|cs|hs|cc|lo|mi|pl|vs|vc|hi|ls|ge|lt|gt|le)?"


def clocks(name, operands, taken):
    """Clocks of an instruction by the manual; `taken` says whether the next one is not the one that follows it."""
    name = name.split(".")[0]
    if re.fullmatch(f"b{CONDITION}|cbn?z", name):
        return 1 + FILL if taken else 1
    if re.fullmatch(f"(bl|bx|blx){CONDITION}", name):
        return 1 + FILL if taken else 1
    if name in ("tbb", "tbh"):
        return 2 + FILL
    registers = re.search(r"\{(.*)\}", operands)
    if registers and re.match("push|pop|ldm|stm", name):
        return 1 + _count(registers[1]) + (FILL if taken else 0)
    for pattern, cost in (("ldrd|strd", 3), ("ldr", 2 + FILL * taken), ("str", 2), ("umull|smull", 5), ("umlal|smlal", 7)):
        if re.match(pattern, name):
            return cost
    for pattern, cost in (("ml[as]", 2), ("[us]div", 12)):
        if re.match(pattern, name):
            return cost
    return 1 + FILL * taken


def _count(registers):
    ends = [each.strip().split("-") for each in registers.split(",")]
    return sum(1 if len(each) == 1 else int(each[1][1:]) - int(each[0][1:]) + 1 for each in ends)


class Board:
    """The count ELF, stepped by instructions."""

    def __init__(self, elf, prefix):
        disassemble = [f"{prefix}objdump", "-d", "--no-show-raw-insn", elf]
        listing = subprocess.run(disassemble, check=True, capture_output=True, text=True)
        self.code, function = {}, None
        for line in listing.stdout.splitlines():
            if head := re.match(r"[0-9a-f]+ <(.*)>:", line):
                function = head[1]
            elif found := re.match(r"\s*([0-9a-f]+):\s+(\S+)\s*(.*)", line):
                self.code[int(found[1], 16)] = (found[2], found[3], function)
        order = sorted(self.code)
        self.following = dict(zip(order, order[1:]))
        with tempfile.TemporaryDirectory() as folder:
            self.machine = labwired.Machine(elf, str(core.system_file("stm32f103", folder)))
        self.write(TSR, ALL_EMPTY)
        self.write(MSR, INITIALISED)
        while self.function() != "port_wait":
            self.machine.step(1000)
            # Initialisation is asked for, then no longer: the controller follows.
            self.write(MSR, self.machine.read_memory(CAN, 1)[0] & INITIALISED)

    def write(self, register, word):
        self.machine.write_memory(CAN + register, list(struct.pack("<I", word)))

    def function(self):
        return self.code[self.machine.get_pc() & ~1][2]

    def take(self, identifier, data):
        """Follows a frame until the firmware waits again: instructions, clocks, and calls of functions."""
        words = struct.pack("<II8s", identifier << 21, len(data), data.ljust(8, b"\0"))
        self.machine.write_memory(CAN + RECEIVED, list(words))
        self.write(RF0R, 1)
        while self.function() == "port_wait":
            self.machine.step(1)
        passed = []
        while self.function() != "port_wait":
            passed.append(self.machine.get_pc() & ~1)
            self.machine.step(1)
            if self.machine.read_memory(CAN + RF0R, 1)[0] & RELEASE:
                self.write(RF0R, 0)
        spent, calls = 0, {}
        for at, after in zip(passed, [*passed[1:], None]):
            name, operands, function = self.code[at]
            taken = after != self.following.get(at)
            spent += clocks(name, operands, taken)
            if taken and name.startswith("b") and after and self.code[after][2] != function and not name.startswith("bx"):
                calls[self.code[after][2]] = calls.get(self.code[after][2], 0) + 1
        return len(passed), spent, calls


def sensors(cycle, position):
    word = position | 0x2000 << 16 | 0x2000 << 32 | 0x2000 << 46 | (cycle & 15) << 60
    return SENSORS, struct.pack("<Q", word)


def operations(calls):
    """Calls of the float32 routines of libgcc, by operation."""
    names = {"add": ("__aeabi_fadd", "__aeabi_fsub", "__addsf3", "__subsf3")}
    names |= {"multiply": ("__aeabi_fmul",), "divide": ("__aeabi_fdiv",)}
    names["compare"] = ("__aeabi_fcmplt", "__aeabi_fcmpgt", "__aeabi_fcmple", "__aeabi_fcmpge", "__aeabi_fcmpeq")
    names["convert"] = ("__aeabi_i2f", "__aeabi_ui2f", "__aeabi_f2iz", "__aeabi_f2uiz", "__aeabi_f2ulz", "__aeabi_ul2f")
    return {what: sum(calls.get(name, 0) for name in routines) for what, routines in names.items()}


def main(elf, prefix="arm-none-eabi-"):
    board = Board(elf, prefix)
    board.take(TICK, struct.pack("<IHBB", 0, 0, 0, 0))
    worst = {}
    # A second of every phase: the approach, settling, a move out, a rest, a move back; positions off by what a run has, and more.
    for start in (0, 1100, 3100, 6200, 7200):
        for cycle in range(start, start + 1000, 17):
            tick = board.take(TICK, struct.pack("<IHBB", cycle, 0, 0, 0))
            answer = board.take(*sensors(cycle, 0x3400 + 29 * (cycle % 400)))
            status = board.take(STATUS, bytes(8))
            kind = "with status" if answer[2].get("send_status") else "without"
            spent = answer[1] + (tick[1] + status[1] if kind == "with status" else 0)
            if spent > worst.get(kind, {"clocks": 0})["clocks"]:
                instructions = answer[0] + (tick[0] + status[0] if kind == "with status" else 0)
                worst[kind] = {
                    "cycle": cycle, "instructions": instructions, "clocks": spent, "answer_clocks": answer[1],
                    "float32": operations(answer[2]),
                }
    json.dump(worst, sys.stdout, indent=2)
    print()


if __name__ == "__main__":
    main(*sys.argv[1:])
