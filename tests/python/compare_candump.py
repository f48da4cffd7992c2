"""Holds a run's files against what candump recorded on the same interface, with cantools as the decoder.

    compare_candump.py RIG_DBC CANDUMP_LOG RUN_FOLDER

Nothing of airbench takes part: candump.log was written by can-utils and is decoded by cantools after rig.dbc. Compared are

- bus.log with candump.log: the same frames, for each identifier in the same order;
- every DriveSensors and LoadSensors frame with the row of its cycle in measurement.csv, signal by signal;
- every row without a frame with the skipped cycles that ticks and summary.json report;
- the valve columns with the commands of bus.log by their stamps, under the rules of the contract: the last command that
  arrived before cycle k was due acts in it, and one that answers a cycle more than 20 sent cycles back does not. Between the
  kernel's stamp and a socket a frame may be held up, when real-time threads leave the kernel's own no time: candump, which
  stood in the same queue, then shows it behind frames with later stamps, and the rig cannot have had it before;
- the counters of summary.json and controller.json with the number of frames in candump.log, and with the gaps in it.

The values of measurement.csv are counts times a step, and so are cantools': they may differ by the rounding of the two products,
far less than a step. Prints one JSON object with what was compared; the first disagreement ends it with exit code 1.
"""

import csv
import json
import re
import sys
from collections import Counter, defaultdict
from pathlib import Path

import cantools

LINE = re.compile(r"\((\d+\.\d{6})\) (\w+) ([0-9A-F]{3})#((?:[0-9A-F]{2}){0,8})$")
SENSOR_COLUMNS = {"position": "position_m", "force": "force_N", "pressure_a": "pressure_a_Pa", "pressure_b": "pressure_b_Pa"}
AXES = {"DriveSensors": "drive", "LoadSensors": "load"}
COMMANDS = {"DriveValveCommand": "drive", "LoadValveCommand": "load"}
STALE_AFTER_CYCLES = 20
CYCLE_NS = 1_000_000
# The log truncates stamps to 1 us, and summary.json holds cycle 0 as a double of seconds since 1970, 0.24 us apart: a command
# this close to the moment when a cycle was due may have come before or after it.
UNDECIDED_NS = 3000
# How long after that a frame that was held up may have reached the rig.
DELIVERY_NS = 5_000_000
ULPS = 4 * sys.float_info.epsilon


def fail(problem):
    print(f"compare_candump: {problem}", file=sys.stderr)
    sys.exit(1)


def check(holds, problem):
    if not holds:
        fail(problem)


class Frame:
    def __init__(self, database, place, line):
        match = LINE.match(line)
        check(match, f"{place}: not a line of candump -L with a frame of rig.dbc: {line!r}")
        self.place = place
        seconds, fraction = match[1].split(".")
        self.stamp_ns = int(seconds) * 1_000_000_000 + int(fraction) * 1000
        self.id = int(match[3], 16)
        self.hex = match[4]
        # When it must have reached the rig at the latest; later than its stamp for one that was held up.
        self.delivered_ns = self.stamp_ns
        message = database.get_message_by_frame_id(self.id)
        self.name = message.name
        self.sender = message.senders[0]
        self.values = message.decode(bytes.fromhex(self.hex), decode_choices=False)


def read_log(database, path):
    lines = path.read_text(encoding="ascii").splitlines()
    return [Frame(database, f"{path.name}:{number}", line) for number, line in enumerate(lines, start=1)]


def read_rows(path):
    with path.open(encoding="utf-8", newline="") as file:
        lines = [line for line in file if not line.startswith("#")]
    rows = list(csv.DictReader(lines))
    for cycle, row in enumerate(rows):
        check(row["time_s"] == f"{cycle // 1000}.{cycle % 1000:03}", f"{path.name}: row {cycle} has time {row['time_s']}")
    return rows


def compare_logs(recorded, own):
    """candump.log and bus.log hold the same frames. What the controllers said after the emulator had left is only in the
    first."""
    newest_ns = 0
    for frame in recorded:
        newest_ns = max(newest_ns, frame.stamp_ns)
        if newest_ns > frame.stamp_ns:
            frame.delivered_ns = newest_ns + DELIVERY_NS
    by_id = [defaultdict(list), defaultdict(list)]
    for table, log in zip(by_id, (recorded, own)):
        for frame in log:
            table[frame.id].append(frame)
    end = next(i for i, frame in enumerate(recorded) if frame.name == "Tick" and frame.values["ending"])
    after_end = {frame.place for frame in recorded[end:]}
    unheard = 0
    for identifier in sorted(set(by_id[0]) | set(by_id[1])):
        heard, logged = by_id[0][identifier], by_id[1][identifier]
        for ours, theirs in zip(logged, heard):
            check(ours.hex == theirs.hex, f"{ours.place} has {ours.id:03X}#{ours.hex}, {theirs.place} has {theirs.hex}")
            ours.delivered_ns = ours.stamp_ns + theirs.delivered_ns - theirs.stamp_ns
        check(len(logged) <= len(heard), f"bus.log has {len(logged)} frames {identifier:03X}, candump.log {len(heard)}")
        for frame in heard[len(logged) :]:
            check(frame.sender != "Rig", f"{frame.place}: a frame of the rig that is not in bus.log")
            check(frame.place in after_end, f"{frame.place}: not in bus.log, though the emulator was still there")
            unheard += 1
    return unheard


def cycles_of(log):
    """Yields (cycle, frame) for each sensor frame and each tick; the cycle by counting, by the tick where cycles were
    skipped, and by the alive counter in every frame."""
    following = {name: 0 for name in AXES}
    for frame in log:
        if frame.name == "Tick":
            cycle = frame.values["cycle"]
            if frame.values["catch_up"]:
                check(all(cycle > next_cycle for next_cycle in following.values()), f"{frame.place}: catch-up to an old cycle")
                following = {name: cycle for name in AXES}
            elif not frame.values["ending"]:
                check(
                    all(cycle + 1 == next_cycle for next_cycle in following.values()),
                    f"{frame.place}: tick of cycle {cycle}, sensors say {following}",
                )
            yield cycle, frame
        elif frame.name in AXES:
            cycle = following[frame.name]
            check(frame.values["alive"] == cycle % 16, f"{frame.place}: alive {frame.values['alive']} in cycle {cycle}")
            following[frame.name] = cycle + 1
            yield cycle, frame


def compare_sensors(database, recorded, rows):
    """Every sensor frame shows its row; returns the cycles that were sent and the number of values compared."""
    steps = {
        (message, signal.name): signal.scale
        for message in AXES
        for signal in database.get_message_by_name(message).signals
    }
    sent = {name: set() for name in AXES}
    values = frames = largest_skipped = 0
    for cycle, frame in cycles_of(recorded):
        if frame.name == "Tick":
            # The counter of skipped cycles has 16 bits.
            missing = cycle - len(sent["DriveSensors"]) - (0 if frame.values["catch_up"] or frame.values["ending"] else -1)
            check(frame.values["skipped"] == missing % 65536, f"{frame.place}: {frame.values}, but {missing} were not sent")
            largest_skipped = missing
            continue
        check(cycle < len(rows), f"{frame.place}: cycle {cycle} has no row in measurement.csv")
        sent[frame.name].add(cycle)
        frames += 1
        for signal, column in SENSOR_COLUMNS.items():
            name = f"{AXES[frame.name]}_{column}"
            ours, theirs = float(rows[cycle][name]), float(frame.values[signal])
            close = abs(ours - theirs) <= ULPS * abs(theirs) and abs(ours - theirs) < steps[frame.name, signal] / 2
            check(close, f"{frame.place}: cycle {cycle}, {name}: measurement.csv {ours!r}, cantools {theirs!r}")
            values += 1
    check(sent["DriveSensors"] == sent["LoadSensors"], "drive and load sensors were sent in different cycles")
    return sent["DriveSensors"], frames, values, largest_skipped


class Latch:
    """What acts on one axis, by the rules of the contract."""

    def __init__(self):
        self.acting = None

    def take(self, command, sent_before):
        """`sent_before` maps the low 12 bits of each cycle sent to how many cycles had been sent by then."""
        age = self.age(command, sent_before)
        if age is not None and age <= STALE_AFTER_CYCLES:
            self.acting = command

    @staticmethod
    def age(command, sent_before):
        count = sent_before.get(command["echo"])
        return None if count is None else sent_before["count"] - count

    def opening(self, sent_before):
        if self.acting is not None and (self.age(self.acting, sent_before) or 0) > STALE_AFTER_CYCLES:
            self.acting = None
        if self.acting is None or not self.acting["enable"]:
            return 0.0
        return float(self.acting["opening"])


def compare_valves(own, rows, cycle_zero_ns):
    """The valve columns are the commands of bus.log: the last one that came before cycle k was due acts in row k."""
    sent = sorted({cycle for cycle, frame in cycles_of(own) if frame.name == "DriveSensors"})
    counts = [0, 0]
    for name, axis in COMMANDS.items():
        commands = [frame for frame in own if frame.name == name]
        for index, ours in enumerate(counts_of_axis(commands, axis, sent, rows, cycle_zero_ns)):
            counts[index] += ours
    return counts


def counts_of_axis(commands, axis, sent, rows, cycle_zero_ns):
    latch, sent_before, taken, moving = Latch(), {"count": 0}, 0, 0
    compared = sent[0] if sent else len(rows)
    for cycle in range(compared):
        check(float(rows[cycle][f"{axis}_valve"]) == 0, f"cycle {cycle}: {axis}_valve is open before the first sensors")
    for place, cycle in enumerate(sent):
        after_last = sent[place - 1] + 1 if place else max(0, cycle - 4096)
        for skipped in range(after_last, cycle):
            sent_before.pop(skipped % 4096, None)
        sent_before["count"] += 1
        sent_before[cycle % 4096] = sent_before["count"]
        due_ns = cycle_zero_ns + cycle * CYCLE_NS
        while taken < len(commands) and commands[taken].delivered_ns < due_ns - UNDECIDED_NS:
            latch.take(commands[taken].values, sent_before)
            taken += 1
        # What acts in this cycle is held over the skipped ones that follow.
        until = sent[place + 1] if place + 1 < len(sent) else len(rows)
        ours = float(rows[cycle][f"{axis}_valve"])
        while abs(ours - latch.opening(sent_before)) > ULPS:
            undecided = taken < len(commands) and commands[taken].stamp_ns < due_ns + UNDECIDED_NS
            check(undecided, f"cycle {cycle}: {axis}_valve is {ours!r} in measurement.csv, the command says {latch.opening(sent_before)!r}")
            latch.take(commands[taken].values, sent_before)
            taken += 1
        for held in range(cycle, until):
            same = abs(float(rows[held][f"{axis}_valve"]) - ours) <= ULPS
            check(same, f"cycle {held}: {axis}_valve changed in a skipped cycle")
            compared += 1
            moving += ours != 0.0
    return compared, moving


def gaps_of(log, name):
    """Commands that the sender counted and that are not in the log."""
    counters = [frame.values["alive"] for frame in log if frame.name == name]
    return sum((after - before - 1) % 16 for before, after in zip(counters, counters[1:]))


def unheard_by_controllers(log):
    """Frames of the rig before the first command, and after the first farewell."""
    first = next((index for index, frame in enumerate(log) if frame.name in COMMANDS), len(log))
    farewell = next((i for i, frame in enumerate(log) if frame.name == "Tick" and frame.values["ending"]), len(log))
    unheard = log[:first] + log[farewell + 1 :]
    return sum(frame.sender == "Rig" for frame in unheard)


def main():
    dbc, recorded_path, folder = (Path(argument) for argument in sys.argv[1:])
    database = cantools.database.load_file(dbc, strict=True)
    recorded = read_log(database, recorded_path)
    own = read_log(database, folder / "bus.log")
    rows = read_rows(folder / "measurement.csv")
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    controller = json.loads((folder / "controller.json").read_text(encoding="utf-8"))

    check(summary["records_dropped"] == 0, f"{summary['records_dropped']} records are not in the run's files")
    unheard = compare_logs(recorded, own)
    sent, frames, values, skipped_by_tick = compare_sensors(database, recorded, rows)
    check(len(rows) == summary["cycles"], f"{len(rows)} rows, {summary['cycles']} cycles")
    skipped = set(range(len(rows))) - sent
    counted = (len(skipped), skipped_by_tick)
    check(counted == (summary["skipped"],) * 2, f"skipped: rows without frames and ticks say {counted}, summary {summary['skipped']}")
    in_events = sum(event["kind"]["skipped"]["cycles"] for event in summary["events"] if "skipped" in event["kind"])
    # Only the first thousand events are kept.
    all_kept = len(summary["events"]) == summary["event_count"]
    check(
        in_events == len(skipped) if all_kept else in_events < len(skipped),
        f"the events tell of {in_events} skipped cycles, {len(skipped)} have no frame (all events kept: {all_kept})",
    )
    check(
        all(summary[f"{axis}_commands"]["two_sources"] == 0 for axis in COMMANDS.values()),
        "two sources: this script does not model that fault",
    )
    valves, moving = compare_valves(own, rows, round(summary["bus_log_cycle_zero_s"] * 1e9))

    # A sender counts its commands, sent or not: a gap is a command that never came onto the bus, and its sender says so.
    gaps = sum(gaps_of(recorded, name) for name in COMMANDS)
    unsent = controller["bus"]["dropped_on_send"]
    check(gaps <= unsent, f"{gaps} commands are missing in candump.log, the controllers tell of {unsent} frames not sent")
    missed = summary["bus"]["dropped_on_receive"]
    lost = summary["frames_lost_at_rig"]
    check(lost <= gaps + missed, f"the rig tells of {lost} lost commands; {gaps} are missing in candump.log, {missed} overflowed")

    by_sender = Counter(frame.sender for frame in recorded)
    from_rig = by_sender["Rig"]
    from_others = len(recorded) - from_rig
    for what, ours, theirs in [
        ("sent by the rig", summary["frames_sent"], from_rig),
        (
            "heard or lost by the rig",
            summary["frames_received"] + summary["bus"]["dropped_on_receive"] + unheard,
            from_others,
        ),
        ("sent by the controllers", controller["bus"]["sent"], from_others),
    ]:
        check(ours == theirs, f"frames {what}: {ours} counted, {theirs} in candump.log")
    # The controllers may connect after the rig's first frames, and leave with its first farewell.
    heard = controller["bus"]["received"] + controller["bus"]["dropped_on_receive"]
    missed = unheard_by_controllers(recorded)
    check(
        from_rig - missed <= heard <= from_rig,
        f"frames heard or lost by the controllers: {heard} counted, {from_rig} in candump.log, {missed} of them excused",
    )
    states = [frame.values["main_chain"] for frame in recorded if frame.name == "DriveChainStatus"]
    names = database.get_message_by_name("DriveChainStatus").get_signal_by_name("main_chain").choices
    print(
        json.dumps(
            {
                "frames": len(recorded),
                "sensor_frames": frames,
                "sensor_values": values,
                "valve_values": valves,
                "valve_values_not_zero": moving,
                "skipped_cycles": len(skipped),
                "frames_after_the_end": unheard,
                "commands_not_sent": gaps,
                "last_main_chain": str(names[states[-1]]) if states else None,
            }
        )
    )


main()
