"""The clocks of QEMU's Cortex-R5F against the bus: python qemu_clock.py BUS_LOG

Reads the answers of firmware-qemu-r5f-clock.elf to the rig's ticks from a bus.log, and prints as JSON the rate of each counter in
the bus's time (least squares over all answers) and how it differs from its nominal rate, ppm.
"""

import json
import sys

CLOCK, TICK = "7A0", "130"
# Counts a second that the port takes them for: the core's clock by 64, TTC 0 by 1024, milliseconds. QEMU 7.2: target/arm/helper.c
# (ARM_CPU_FREQ) and hw/timer/cadence_ttc.c.
NOMINAL = {"core": 1e9 / 64, "ttc": 133e6 / 1024, "milliseconds": 1e3}
PLACES = {"core": (0, 4), "ttc": (4, 6), "milliseconds": (6, 8)}
# Before it answers the newest tick, it answers those that came while it started.
STARTING_S = 1.0


def ticks(path):
    """Seconds of the bus at which the rig sent its ticks."""
    with open(path, encoding="ascii") as file:
        return [float(line.split()[0][1:-1]) for line in file if line.split()[2].startswith(f"{TICK}#")]


def unwrapped(count, bits, estimate):
    """The number nearest to an estimate whose low bits are the count."""
    return count + round((estimate - count) / (1 << bits)) * (1 << bits)


def answers(path):
    """Seconds of the bus and the three counters, without their overflows. The short ones, of 0.5 s and 65 s, may overflow several
    times between two answers; the core's, of 275 s, tells how often."""
    before = None
    with open(path, encoding="ascii") as file:
        for line in file:
            stamp, _, frame = line.split()
            identifier, data = frame.split("#")
            if identifier != CLOCK:
                continue
            data = bytes.fromhex(data)
            counts = {name: int.from_bytes(data[begin:end], "little") for name, (begin, end) in PLACES.items()}
            if before is not None:
                passed_s = (counts["core"] - before["core"]) % (1 << 32) / NOMINAL["core"]
                for name, (begin, end) in PLACES.items():
                    estimate = before[name] + passed_s * NOMINAL[name]
                    counts[name] = unwrapped(counts[name], 8 * (end - begin), estimate)
            before = counts
            yield float(stamp[1:-1]), counts


def line(points):
    """Slope and offsets from the line."""
    count = len(points)
    mean = [sum(axis) / count for axis in zip(*points)]
    square = sum((x - mean[0]) ** 2 for x, _ in points)
    slope = sum((x - mean[0]) * (y - mean[1]) for x, y in points) / square
    return slope, [y - mean[1] - slope * (x - mean[0]) for x, y in points]


def main():
    every = list(answers(sys.argv[1]))
    began = every[0][0]
    settled = [(stamp - began, counts) for stamp, counts in every if stamp - began > STARTING_S]
    asked = sum(stamp - began > STARTING_S for stamp in ticks(sys.argv[1]))
    report = {"ticks": asked, "answers": len(settled), "seconds": round(settled[-1][0] - settled[0][0], 3)}
    for name, nominal in NOMINAL.items():
        slope, offsets = line([(stamp, counts[name]) for stamp, counts in settled])
        offsets_us = sorted(abs(offset) / nominal * 1e6 for offset in offsets)
        report[name] = {
            "counts_per_s": round(slope, 3),
            "nominal_per_s": nominal,
            "drift_ppm": round((slope / nominal - 1) * 1e6, 2),
            "offset_us_p50": round(offsets_us[len(offsets_us) // 2]),
            "offset_us_max": round(offsets_us[-1]),
        }
    print(json.dumps(report, indent=2))


if __name__ == "__main__":
    main()
