"""Reads a log of frames with python-can's own reader for its ending: one line a frame, as candump -L writes it.

    read_frames.py FILE

Times count from the first frame, in microseconds.
"""

import sys

import can


def main():
    frames = list(can.LogReader(sys.argv[1]))
    for frame in frames:
        microseconds = round((frame.timestamp - frames[0].timestamp) * 1e6)
        identifier = f"{frame.arbitration_id:0{8 if frame.is_extended_id else 3}X}"
        data = f"R{frame.dlc or ''}" if frame.is_remote_frame else frame.data.hex().upper()
        print(f"{microseconds} {identifier}#{data}")


if __name__ == "__main__":
    main()
