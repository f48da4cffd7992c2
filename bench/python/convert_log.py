"""Turns a candump log on standard input into ASC or BLF with python-can, reads it back and compares.

    convert_log.py asc|blf OUT < LOG

Prints `equal N` when what was written reads back as it was, else `different N FIRST`: N frames, the first of them FIRST. Times count
from the first frame; ASC keeps them to 1 us, BLF to 1 ns. The content of an error frame is not in an ASC.
"""

import sys

try:
    import can
except ImportError:
    sys.exit(77)

SHORTEST_S = 1.5e-6


def main():
    kind, out = sys.argv[1], sys.argv[2]
    frames = list(can.CanutilsLogReader(sys.stdin))
    with (can.ASCWriter if kind == "asc" else can.BLFWriter)(out) as writer:
        for frame in frames:
            # can0, can1 …: numbers from 0 in python-can, from 1 in the file.
            frame.channel = int(frame.channel.removeprefix("can"))
            writer.on_message_received(frame)
    read = list((can.ASCReader if kind == "asc" else can.BLFReader)(out))
    for place, (one, other) in enumerate(zip(frames, read)):
        if not equal(one, frames[0], other, read[0]):
            print(f"different {sum(not equal(a, frames[0], b, read[0]) for a, b in zip(frames, read))} {place + 1}")
            return
    print(f"equal {len(read)}" if len(read) == len(frames) else f"different {len(frames) - len(read)} {len(read) + 1}")


def equal(one, first, other, other_first):
    times = abs((one.timestamp - first.timestamp) - (other.timestamp - other_first.timestamp)) < SHORTEST_S
    return times and key(one) == key(other)


def key(frame):
    kind = (frame.is_extended_id, frame.is_remote_frame, frame.is_error_frame, frame.channel)
    return kind + ((None,) if frame.is_error_frame else (frame.arbitration_id, frame.dlc, bytes(frame.data)))


if __name__ == "__main__":
    main()
