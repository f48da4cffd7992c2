"""Reads an MDF4 file with asammdf, not knowing who wrote it: name, unit, times and values of each channel, as JSON.

    read_mdf4.py FILE
"""

import json
import sys

from asammdf import MDF


def main():
    with MDF(sys.argv[1]) as mdf:
        channels = {}
        for signal in mdf.iter_channels():
            times = signal.timestamps.tolist()
            channels[signal.name] = {"unit": signal.unit, "times": times, "values": signal.samples.tolist()}
        start = mdf.header.start_time.timestamp()
    print(json.dumps({"start": start, "channels": channels}))


if __name__ == "__main__":
    main()
