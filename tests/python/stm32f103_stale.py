"""What the STM32F103's port sends when the bus comes back: stm32f103_stale.py COUNT_ELF [ARM_PREFIX]

Plays the CAN controller of firmware-count.elf, as cortex_m3_cycles.py does: the frames of some cycles find all mailboxes full, the
first with an older frame in it (`held`); then one after the other leaves. Prints as JSON whether the firmware asked the
controller to give that one up, and what it then sends.
"""

import json
import struct
import sys

from cortex_m3_cycles import CAN, TICK, TSR, Board, sensors

COMMAND, HELD_UP = 0x110, 25
MAILBOX, ABORT_FIRST, FIRST_EMPTY = 0x180, 1 << 7, 1 << 26


def mailbox(board):
    """Identifier and data in the first one."""
    words = bytes(board.machine.read_memory(CAN + MAILBOX, 16))
    word, length, data = struct.unpack("<II8s", words)
    return word >> 21, data[: length & 15]


def next_frame(board):
    """What the firmware puts into the first mailbox when that is empty; None when nothing waits."""
    board.machine.write_memory(CAN + MAILBOX, [0] * 16)
    board.write(TSR, FIRST_EMPTY)
    # By single steps: the mailbox is full as soon as its identifier is written.
    for _ in range(2000):
        board.machine.step(1)
        if mailbox(board)[0]:
            break
    board.write(TSR, 0)
    return mailbox(board) if mailbox(board)[0] else None


def main(elf, prefix="arm-none-eabi-"):
    board = Board(elf, prefix)
    board.take(TICK, struct.pack("<IHBB", 0, 0, 0, 0))
    board.take(*sensors(1, 0x3400))
    held, _ = mailbox(board)
    board.write(TSR, 0)
    given_up = False
    for cycle in range(2, 2 + HELD_UP):
        board.take(*sensors(cycle, 0x3400))
        given_up |= struct.unpack("<I", bytes(board.machine.read_memory(CAN + TSR, 4)))[0] == ABORT_FIRST
        board.write(TSR, 0)
    sent = []
    while frame := next_frame(board):
        sent.append(frame)
    # The echo: 12 bits of the cycle, from bit 16 on (rig.dbc).
    cycles = [int.from_bytes(data, "little") >> 16 & 0xFFF for identifier, data in sent if identifier == COMMAND]
    report = {
        "held": held,
        "given_up": given_up,
        "sent": [identifier for identifier, _ in sent],
        "command_cycles": cycles,
        "newest_cycle": 1 + HELD_UP,
    }
    print(json.dumps(report))


if __name__ == "__main__":
    main(*sys.argv[1:])
