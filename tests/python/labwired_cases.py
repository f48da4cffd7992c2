"""Minimal cases in which labwired's STM32F103 is not the chip, and the port goes round: each by the reference manual's paragraph.

    labwired_cases.py ELF

The ELF is the firmware's, which has started clock, filters and CAN; from then on the registers are poked from outside. The
result is a JSON object: for each case what the chip would show, and what labwired shows.
"""

import json
import sys

from airbench_hil.core import Core

CAN = 0x40006400
MCR, TSR, RF0R, RF1R, IER, BTR, FMR, FFA1R, MAILBOX = 0x00, 0x08, 0x0C, 0x10, 0x14, 0x1C, 0x200, 0x214, 0x180
LOOP_BACK = 1 << 30
NVIC_ENABLE, NVIC_PENDING, CPUID = 0xE000E100, 0xE000E200, 0xE000ED00
RX0 = 1 << 20
SENSORS = 0x120


class Case:
    """A core that has started."""

    def __init__(self, elf):
        self.core = Core(elf, "stm32f103")
        for _ in range(10):
            self.core.run_ns(1_000_000)
        self.core.said()

    def read(self, register):
        return self.core.sim.read_u32(CAN + register)

    def write(self, register, word):
        self.core.sim.write_u32(CAN + register, word)

    def request(self, mailbox):
        self.write(MAILBOX + 16 * mailbox + 4, 8)
        self.write(MAILBOX + 16 * mailbox, 0x7FF << 21 | 1)


def cases(elf):
    """Name: (on the chip, here)."""
    seen = {}

    case = Case(elf)
    case.write(MCR, case.read(MCR) | 1)
    case.core.run_ns(1_000_000)
    case.write(BTR, (1 - 1) << 20 | (6 - 1) << 16)
    case.write(MCR, case.read(MCR) & ~1)
    case.core.run_ns(1_000_000)
    case.request(0)
    case.core.run_ns(1_000_000)
    seen["a segment of one quantum after the sample point sends (RM0008 24.7.7, TS2 = 0)"] = (1, len(case.core.said()))

    case = Case(elf)
    case.write(IER, 1 << 1)
    case.core.sim.write_u32(NVIC_ENABLE, RX0)
    case.core.sim.inject_can("bxcan1", SENSORS, bytes(8))
    pending = case.core.sim.read_u32(NVIC_PENDING) & RX0
    case.core.run_ns(5_000_000)
    # The vector of that interrupt is `stopped`, where nobody empties the FIFO.
    emptied = case.read(RF0R) & 3 == 0
    seen["the interrupt of FIFO 0 comes (RM0008 24.8, FMPIE0)"] = (True, bool(pending) or not emptied)

    case = Case(elf)
    case.write(FMR, case.read(FMR) | 1)
    case.write(FFA1R, 0xFFFF)
    case.write(FMR, case.read(FMR) & ~1)
    try:
        case.core.sim.inject_can("bxcan1", SENSORS, bytes(8))
    except ValueError:
        pass
    seen["a filter for FIFO 1 fills it (RM0008 24.7.4, FFA1R)"] = (1, case.read(RF1R) & 3)

    case = Case(elf)
    for mailbox in range(3):
        case.request(mailbox)
    seen["three frames of 111 us are under way (RM0008 24.7.1): mailboxes empty"] = (0, bin(case.read(TSR) >> 26 & 7).count("1"))

    case = Case(elf)
    case.request(0)
    case.core.run_ns(1_000_000)
    case.write(TSR, 1 << 0)
    seen["a cleared RQCP0 clears TXOK0 (RM0008 24.9.2)"] = (0, case.read(TSR) >> 1 & 1)

    case = Case(elf)
    case.write(BTR, case.read(BTR) | LOOP_BACK)
    loops_back = case.read(BTR) & LOOP_BACK != 0
    seen["bit timing and loop-back change outside initialisation (RM0008 24.9.2, CAN_BTR)"] = (False, loops_back)

    case = Case(elf)
    part = hex(case.core.sim.read_u32(CPUID) >> 4 & 0xFFF)
    seen["the part number of CPUID is that of a Cortex-M3 (DDI 0337)"] = ("0xc23", part)
    return seen


if __name__ == "__main__":
    print(json.dumps({name: {"chip": chip, "labwired": here} for name, (chip, here) in cases(sys.argv[1]).items()}, indent=2))
