"""A rig in a test: in lockstep and in real time, with each kind of controller, and what is said when something fails."""

import filecmp
import json
import random
import re
import socket
import sys
import threading
import time

import can
import pytest

import airbench_hil
from airbench_hil import ExpectationFailed, Fault, NotAnswered, NotSeen, Own, Process, ProgramFailed, Refused, Rig, RigEnded, programs
from airbench_hil.expectations import _Band
from airbench_hil.run import unit_of

AT = {"carriage_position_m": 0.15}


def to_300_mm(sensors):
    """Proportional control."""
    return max(-1.0, min(1.0, 8.0 * (0.3 - sensors.position)))


def test_ten_lines_position_the_drive_within_the_papers_bounds(tmp_path):
    with Rig(experiment="point-to-point", pace="lockstep", controller=Own("position-p"), out=tmp_path) as rig:
        rig.expect("DriveSensors.position > 0.39", within="4 s")
        run = rig.finish()
    assert run.passed and run.figures["position_error_dynamic_m"] < 0.004
    assert run.ended_because == "the controllers are done" and run.exit_codes == {"emulator": 0, "controller": 0}
    position = run.measurement["drive_position_m"]
    assert len(position) == run.figures["cycles"] and 0.39 < position.max() < 0.41
    assert run.measurement.attrs["units"]["drive_position_m"] == "m"
    assert run.measurement.attrs["units"]["drive_pressure_a_Pa"] == "Pa"
    assert run.picture and "<svg" in run._repr_html_()


def _with_everything(folder):
    with Rig(controller=to_300_mm, setup=AT, out=folder, faults=[Fault("valve-slow", "drive", from_s=0.1, for_s=0.05)]) as rig:
        rig.expect("near(DriveSensors.position, 0.3, 0.002)", within="3 s")
        rig.fault("position-sensor-offset", "drive", offset_m=0.02)
        assert rig.expect("abs(DriveSensors.position - 0.3) > 0.015", within="5 ms") == pytest.approx(rig.time)
        rig.mend("all")
        rig.hand("carriage", 60.0)
        rig.run_for("50 ms")
        rig.let_go()
        rig.weights(2.0)
        rig.emergency_stop()
        rig.expect("rose(RigStatus.emergency_stop)", within="20 ms")
        rig.release()
        rig.expect("fell(RigStatus.emergency_stop)", within="20 ms")
        rig.emergency_stop(by="rig")
        rig.expect('RigEmergencyStop.reason == "operator" and RigStatus.emergency_stop', within="20 ms")
        return rig.end()


def test_two_runs_of_a_test_leave_the_same_bytes_whatever_it_does(tmp_path):
    one, other = _with_everything(tmp_path / "one"), _with_everything(tmp_path / "other")
    for name in ("bus.log", "measurement.csv", "truth.csv", "faults.csv"):
        assert filecmp.cmp(one.folder / name, other.folder / name, shallow=False), name
    assert one.ended_because == "ended at the console"
    assert len(one.messages()) > 3 * one.figures["cycles"]
    kinds = [next(iter(each["kind"])) if isinstance(each["kind"], dict) else each["kind"] for each in one.events]
    assert kinds.count("fault") == 4 and kinds.count("emergency-stop") == 2 and "weights" in kinds, kinds


def test_time_stands_while_the_test_does_anything_else(tmp_path):
    with Rig(controller=to_300_mm, setup=AT, out=tmp_path) as rig:
        rig.run_for("100 ms")
        before = rig.message("DriveSensors")
        time.sleep(1.2)
        assert rig.time == pytest.approx(0.1) and rig.message("DriveSensors").data == before.data
        rig.run_for("1 ms")
        assert rig.cycle == 101


def test_a_failed_expectation_shows_the_last_seconds_and_names_the_folder(tmp_path):
    with Rig("point-to-point", controller=Own(), out=tmp_path) as rig:
        with pytest.raises(ExpectationFailed) as failed:
            rig.expect('DriveSensors.position > 0.45 and DriveChainStatus.main_chain == "experiment"', within="2 s")
        text = str(failed.value)
        assert re.search(r"^expected within 2 s: DriveSensors.position > 0.45", text)
        assert f"run folder: {tmp_path}" in text and "from 0.000 s to 2.000 s" in text
        rows = [line.split() for line in text.splitlines() if re.match(r" +\d+\.\d{3} ", line)]
        assert len(rows) == 21 and rows[-1][0] == "2.000" and rows[-1][2] == "experiment"
        assert float(rows[-1][1]) == pytest.approx(rig.read("DriveSensors.position"), rel=1e-5)
        drawing = failed.value.picture.read_text()
        assert drawing.count("<polyline") == 2 and "DriveSensors.position / m" in drawing
        assert rig.failures == [failed.value]


def test_never_always_and_stable_for_look_at_every_cycle(tmp_path):
    with Rig(controller=to_300_mm, setup=AT, out=tmp_path) as rig:
        rig.never("RigStatus.emergency_stop == 1", during="0.1 s")
        assert rig.time == pytest.approx(0.1)
        with pytest.raises(ExpectationFailed, match="expected never for 2 s"):
            rig.never("DriveSensors.position > 0.25", during="2 s")
        assert 0.25 < rig.read("DriveSensors.position") < 0.252, "it stopped in the cycle in which it held"
        since = rig.stable_for("DriveSensors.position", "0.3 s", tolerance=0.001, within="3 s")
        assert rig.time - since == pytest.approx(0.3) and rig.read("DriveSensors.position") == pytest.approx(0.3, abs=0.01)
        rig.always("near(DriveSensors.position, 0.3, 0.01)", during="0.1 s")
        with pytest.raises(ExpectationFailed, match="it did not stay so"):
            rig.stable_for("DriveSensors.position > 0.4", "10 ms", within="20 ms")
        with pytest.raises(ExpectationFailed, match="<lambda>"):
            rig.expect(lambda rig: rig.cycle < 0)


def test_what_has_not_come_is_not_read(tmp_path):
    with Rig(controller=to_300_mm, setup=AT, out=tmp_path) as rig:
        for asked in (lambda: rig.read("LoadChainValues.control_error"), lambda: rig.message("LoadChainValues")):
            with pytest.raises(NotSeen, match="LoadChainValues"):
                asked()


def test_python_can_goes_in_and_out(tmp_path):
    with Rig(controller=to_300_mm, setup=AT, out=tmp_path) as rig, rig.listen() as listener:
        rig.send(can.Message(arbitration_id=0x123, data=b"\x01\x02", is_extended_id=False))
        rig.run_for("2 ms")
        identifiers = {listener.recv(10).arbitration_id for _ in range(6)}
        assert 0x123 in identifiers and 0x120 in identifiers
        sensors = rig.database.decode_message("DriveSensors", rig.message("DriveSensors").data)
        assert sensors["position"] == pytest.approx(rig.read("DriveSensors.position"))


def test_a_test_that_ends_or_fails_early_leaves_a_whole_folder_and_the_run_is_over(tmp_path):
    with pytest.raises(ZeroDivisionError), Rig("point-to-point", controller=Own(), out=tmp_path) as rig:
        rig.run_for("0.5 s")
        1 / 0
    run = airbench_hil.Run(tmp_path)
    assert run.ended_because == "ended at the console" and run.figures["cycles"] == pytest.approx(501, abs=2)
    for asked in (lambda: rig.run_for(1), lambda: rig.read("DriveSensors.position"), lambda: rig.fault("bus-loss")):
        with pytest.raises(RigEnded, match="over"):
            asked()


def test_an_end_of_the_run_fails_what_waits_for_it_and_says_why_it_ended(tmp_path):
    with Rig(controller=to_300_mm, setup=AT, seconds=0.2, out=tmp_path) as rig:
        with pytest.raises(ExpectationFailed, match="the run ended after 0.199 s"):
            rig.expect("DriveSensors.position > 0.49", within="10 s")


def test_bad_input_is_the_programs_own_message_and_exit_code(tmp_path):
    for number, (arguments, program, words) in enumerate([
        ({"setup": {"carriage_position_m": 7}}, "emulator", "rig.carriage_position_m = 7 m; allowed is 0 to 0.5 m"),
        ({"faults": [Fault("valve-offset", "drive")]}, "emulator", "valve-offset needs offset; allowed: -1 to 1"),
        ({"experiment": "step", "controller": Own(set={"drive.algorithm.nothing": 1.0})}, "controller", "no such variable"),
    ]):
        with pytest.raises(ProgramFailed, match=re.escape(words)) as failed:
            Rig(out=tmp_path / str(number), **arguments).start()
        assert (failed.value.program, failed.value.exit_code) == (program, 2)
    for arguments, words in [
        ({"experiment": "steps"}, "none of by-hand, damper-load"),
        ({"controller": Own("position-q"), "experiment": "step"}, "position-cascade"),
        ({"controller": Own()}, "runs an experiment"),
        ({"controller": [Own(), Own()], "experiment": "step"}, "named controller"),
        ({"controller": "position-p", "experiment": "step"}, r"Own\('position-p'\) runs an axis program"),
        ({"pace": "fast"}, "lockstep"),
        ({"controller": airbench_hil.Elf("x.elf"), "pace": "real"}, "lockstep only"),
    ]:
        with pytest.raises(ValueError, match=words):
            Rig(out=tmp_path / "bad", **arguments).start()


def test_the_console_refuses_with_what_is_allowed(tmp_path):
    with Rig(controller=to_300_mm, setup=AT, out=tmp_path) as rig:
        for asked, words in [
            (lambda: rig.fault("valve-stuck"), "one of drive, load"),
            (lambda: rig.fault("valve-offset", "drive", offset=2.0), "allowed: -1 to 1"),
            (lambda: rig.console("dance"), "is none of stop"),
        ]:
            with pytest.raises(Refused, match=words):
                asked()
        with pytest.raises(ValueError, match="added_mass"):
            rig.weights(21.0)
        with pytest.raises(ValueError, match="carriage"):
            rig.hand("elbow", 1.0)


def test_a_python_controllers_own_exception_reaches_the_test_and_so_does_a_bad_opening(tmp_path):
    def raising(sensors):
        if sensors.cycle == 50:
            raise KeyError("mine")
        return 0.0

    with Rig(controller=raising, out=tmp_path / "raising") as rig, pytest.raises(KeyError, match="mine"):
        rig.run_for("1 s")
    for opening in (1.5, float("nan"), "0.5", [0.5, 0.5]):
        with Rig(controller=lambda _: opening, out=tmp_path / "bad") as rig:  # noqa: B023
            with pytest.raises(ValueError, match="cycle 0.*-1 to 1 are allowed"):
                rig.run_for("1 s")


@pytest.mark.airbench_realtime
@pytest.mark.parametrize("asked", [lambda rig: rig.run_for("60 s"), lambda rig: (time.sleep(0.5), rig.end())], ids=["run", "end"])
def test_in_real_time_a_controllers_exception_reaches_the_test_and_the_run_is_saved(tmp_path, asked):
    def raising(sensors):
        if sensors.cycle > 50:
            raise KeyError("mine")
        return 0.0

    with Rig(pace="real", controller=raising, emulator_options=["--no-realtime"], out=tmp_path) as rig:
        with pytest.raises(KeyError, match="mine"):
            asked(rig)
    assert airbench_hil.Run(tmp_path).ended_because == "ended at the console"


def test_an_elf_runs_in_lockstep_with_the_test(elf, tmp_path):
    with Rig(controller=airbench_hil.Elf(elf), out=tmp_path / "run") as rig:
        rig.run_for("20 ms")
        run = rig.end()
    # 10 ms before the first cycle, and one for each; the last turn is everybody's.
    assert json.loads((tmp_path / "run/mcu.json").read_text())["core_clocks"] == 8000 * (10 + run.figures["cycles"])


def test_a_debugger_may_hold_an_elf_longer_than_a_controller_may_think(elf, tmp_path):
    resumed, said = threading.Event(), tmp_path / "run/programs/mcu.err"

    def debugger():
        until = time.monotonic() + 60
        while not (said.exists() and (port := re.search(r"target remote :(\d+)", said.read_text()))):
            assert time.monotonic() < until
            time.sleep(0.01)
        with socket.create_connection(("127.0.0.1", int(port[1]))) as gdb:
            gdb.sendall(b"$c#63")
            time.sleep(0.3)
            gdb.sendall(b"\x03")
            while b"#" not in gdb.recv(100):
                pass
            time.sleep(1.0)
            gdb.sendall(b"+$c#63")
            resumed.set()
            gdb.recv(100)

    thread = threading.Thread(target=debugger)
    thread.start()
    with Rig(controller=airbench_hil.Elf(elf, gdb=0), answer_s=0.4, out=tmp_path / "run") as rig:
        while not resumed.is_set() and thread.is_alive():
            rig.run_for("1 ms")
        rig.run_for("1 ms")
        assert resumed.is_set()
        rig.end()
    thread.join()


def test_a_foreign_program_takes_part_by_its_echo(tmp_path):
    program = tmp_path / "foreign.py"
    program.write_text(_FOREIGN)
    with Rig(controller=Process(["{python}", program, "{path}"]), setup=AT, out=tmp_path / "run") as rig:
        rig.expect("near(DriveSensors.position, 0.3, 0.005)", within="3 s")
        run = rig.finish()
    assert run.figures["stale_commands"] == 0
    assert (tmp_path / "run/programs/process.txt").read_text() == "there\n"


def test_a_controller_that_hangs_is_named_and_one_that_crashes_too(tmp_path):
    program = tmp_path / "foreign.py"
    program.write_text(_FOREIGN.replace("# from cycle 100 on", "if cycle == 100: " + "time.sleep(1000)"))
    with Rig(controller=Process(["{python}", program, "{path}"]), answer_s=3.0, out=tmp_path / "hangs") as rig:
        with pytest.raises(NotAnswered, match="not answered cycle 100 within 3 s"):
            rig.run_for("1 s")
    program.write_text(_FOREIGN.replace("# from cycle 100 on", "if cycle == 100: " + "sys.exit('I broke')"))
    with Rig(controller=Process(["{python}", program, "{path}"]), out=tmp_path / "crashes") as rig:
        # Exit code 1 is that of a broken bound only for airbench's own controller.
        with pytest.raises(ProgramFailed, match="process ended with exit code 1:\nI broke"):
            rig.run_for("1 s")
    program.write_text(_FOREIGN.replace("# from cycle 100 on", "if cycle == 100: " + "os.write(2, b'I left'); sys.exit()"))
    # The rig's own patience: on a loaded machine an interpreter takes more than a second to leave.
    with Rig(controller=Process(["{python}", program, "{path}"]), out=tmp_path / "leaves") as rig:
        with pytest.raises(NotAnswered, match="process has ended with exit code 0:\nI left"):
            rig.run_for("1 s")
    program.write_text(_FOREIGN.replace("# from cycle 100 on", "if cycle == 100: " + "os.abort()"))
    with Rig(controller=Process(["{python}", program, "{path}"]), out=tmp_path / "aborts") as rig:
        with pytest.raises(ProgramFailed, match="ended by signal 6") as failed:
            rig.run_for("1 s")
        assert failed.value.exit_code == -6


@pytest.mark.airbench_realtime
def test_a_foreign_program_that_dies_in_real_time_fails_the_test_and_one_that_ends_with_the_bus_does_not(tmp_path):
    program = tmp_path / "foreign.py"
    real = {"pace": "real", "emulator_options": ["--no-realtime"]}
    program.write_text(_FOREIGN.replace("# from cycle 100 on", "if cycle == 100: " + "raise ValueError('I broke')"))
    with Rig(controller=Process(["{python}", program, "{path}"]), out=tmp_path / "dies", **real) as rig:
        with pytest.raises(ProgramFailed, match="ValueError: I broke"):
            rig.never("RigStatus.emergency_stop == 1", during="60 s")
    program.write_text(_FOREIGN + "raise ConnectionError('no bus any more')\n")
    with Rig(controller=Process(["{python}", program, "{path}"]), out=tmp_path / "ends", **real) as rig:
        rig.wait_for("count(DriveValveCommand) > 0")
        assert rig.end().exit_codes == {"emulator": 0, "process": 1}


_FOREIGN = """
import os, socket, struct, sys, time
sys.path.insert(0, "PATH")
from airbench_hil.controllers import Answering, Python
from airbench_hil.signals import Names, database
bus = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
bus.connect(sys.argv[1])
print("there", flush=True)
law = Answering(Python(lambda sensors: max(-1.0, min(1.0, 8.0 * (0.3 - sensors.position)))), Names(database()))
cycle = -1
while packet := bus.recv(64):
    raw_id, length, data = struct.unpack("=IB3x8s", packet)
    if raw_id == 0x120:
        cycle += 1
        # from cycle 100 on
        frame, answer = law.answer(int.from_bytes(data, "little"), cycle)
        bus.send(struct.pack("=IB3x8s", frame, len(answer), answer))
""".replace("PATH", str(programs.PACKAGE.parent))


def test_an_own_controller_that_is_killed_is_what_its_partner_misses(tmp_path):
    with Rig("load-step", controller=Own(two=True), out=tmp_path) as rig:
        rig.wait_for('DriveChainStatus.main_chain == "experiment"', timeout="30 s")
        rig.kill("controller-load")
        rig.expect('DriveEmergencyStop.reason == "partner-lost"', within="200 ms")
        rig.expect("RigStatus.emergency_stop == 1", within="20 ms")
        assert rig.end().exit_codes["controller-load"] == -9
        with pytest.raises(RigEnded):
            rig.kill("controller-drive")


def passes(rig, seconds):
    """Waits until the rig's time has gone on by itself; a machine that is held up takes longer."""
    before, deadline = rig.time, time.monotonic() + 60
    while rig.time - before < seconds:
        assert time.monotonic() < deadline, f"{rig.time - before} s passed"
        time.sleep(0.05)


@pytest.mark.airbench_realtime
def test_real_time_passes_by_itself_and_a_function_answers_in_it(tmp_path):
    with Rig(pace="real", controller=to_300_mm, setup=AT, emulator_options=["--no-realtime"], out=tmp_path) as rig:
        rig.expect("near(DriveSensors.position, 0.3, 0.01)", within="30 s")
        before = rig.time
        passes(rig, 0.3)
        run = rig.end()
    assert run.figures["cycles"] >= 1000 * before


@pytest.mark.airbench_realtime
def test_in_real_time_expectations_begin_at_the_newest_cycle(tmp_path):
    with Rig(pace="real", controller=lambda _: 0.0, emulator_options=["--no-realtime"], out=tmp_path) as rig:
        passes(rig, 0.3)

        def ends_after_a_rest():
            before = rig.time
            time.sleep(0.5)
            return rig.stable_for("DriveSensors.position", "0.2 s", tolerance=1.0, within="0.3 s") - before

        # Begun at the oldest cycle that nobody has read, it would end 0.2 s after that one each time. A machine that is held up
        # has no newer cycle now and then.
        assert any(ends_after_a_rest() > 0.3 for _ in range(20))
        rig.end()


def test_the_longest_steady_course_is_found_whatever_came_before():
    chance, band, course = random.Random(5), _Band(1.0), []
    for time_s in range(500):
        course.append(chance.gauss(0.0, 0.4))
        steady = [at for at in range(time_s + 1) if max(course[at:]) - min(course[at:]) <= 1.0]
        assert band.take(time_s, course[-1]) == steady[0]
    assert band.take(500, None) is None


def test_a_python_controller_answers_delayed_sensors_as_what_they_are(tmp_path):
    sampled = []

    def law(sensors):
        sampled.append(sensors.cycle)
        return 0.0

    delayed = [Fault("bus-delay", "bus.DriveSensors", from_s=0.05, numbers={"delay_ms": 3})]
    with Rig(controller=law, faults=delayed, out=tmp_path) as rig:
        rig.run_for("0.3 s")
        run = rig.end()
    # Cycle 49 comes in time, cycle 50 three cycles later; nobody answers twice.
    assert sampled == sorted(set(sampled)) and sampled[-1] < run.figures["cycles"] - 2
    commands = [each.data for each in run.messages() if each.arbitration_id == 0x110]
    echoes = [rig.database.decode_message("DriveValveCommand", data)["echo"] for data in commands]
    assert echoes == sampled[: len(echoes)] and len(echoes) > 200


def test_frames_go_in_and_out_as_python_can_and_cantools_have_them(tmp_path):
    with Rig(controller=to_300_mm, setup=AT, out=tmp_path) as rig:
        rig.run_for("0.1 s")
        stop = rig.database.get_message_by_name("ConsoleEmergencyStop")
        data = stop.encode({each.name: {"reason": "operator"}.get(each.name, 0) for each in stop.signals})
        rig.send(can.Message(arbitration_id=stop.frame_id, data=data, is_extended_id=False))
        rig.expect("RigStatus.emergency_stop == 1", within="20 ms")
        sensors = rig.messages("DriveSensors", last="20 ms")
        assert [round(each.timestamp * 1000) for each in sensors] == list(range(rig.cycle - 20, rig.cycle + 1))
        decoded = rig.database.decode_message(sensors[-1].arbitration_id, sensors[-1].data)
        assert decoded["position"] == pytest.approx(rig.read("DriveSensors.position"))
        every = rig.messages(last="20 s")
        assert [each.timestamp for each in every] == sorted(each.timestamp for each in every)
        rig.send(can.Message(arbitration_id=0x1ABCDEF, data=b"mine"))
        [foreign] = [each for each in rig.messages() if each.is_extended_id]
        assert (foreign.arbitration_id, bytes(foreign.data), foreign.dlc) == (0x1ABCDEF, b"mine", 4)
        run = rig.end()
    # What the test saw of the rig is what the log has, in the same order of each identifier.
    log = [bytes(each.data) for each in run.messages() if each.arbitration_id == 0x120]
    mine = [bytes(each.data) for each in every if each.arbitration_id == 0x120]
    assert len(mine) > 100 and mine == log[: len(mine)]


def test_a_run_is_an_mdf_of_asammdf_with_units(asammdf, tmp_path):
    with Rig(controller=to_300_mm, setup=AT, seconds=0.2, out=tmp_path / "run") as rig:
        run = rig.finish()
    mdf = run.mdf()
    position = mdf.get("drive_position_m")
    assert position.unit == "m" and list(position.samples) == list(run.measurement["drive_position_m"])
    assert list(mdf.get("truth.drive_position_m").samples) == list(run.truth["drive_position_m"])
    on_the_bus = mdf.get("DriveSensors.position_m")
    assert on_the_bus.unit == "m" and on_the_bus.samples == pytest.approx(position.samples, abs=1e-9)
    mdf.save(tmp_path / "run.mf4")
    with asammdf.MDF(tmp_path / "run.mf4") as saved:
        assert "drive_pressure_a_Pa" in saved.channels_db and "linked=false" in saved.header.comment


def test_what_is_not_installed_says_how_to_install_it(tmp_path, monkeypatch):
    with Rig(controller=to_300_mm, seconds=0.01, out=tmp_path) as rig:
        run = rig.finish()
    for module, ask, extra in (("pandas", lambda: run.truth, "pandas"), ("asammdf", run.mdf, "mdf")):
        monkeypatch.setitem(sys.modules, module, None)
        with pytest.raises(ImportError, match=rf"{module}.*: pip install 'airbench-hil\[{extra}\]'"):
            ask()


def test_units_are_those_of_the_names_endings():
    units = {
        "a_m_per_s2": "m/s^2", "flow_m3_per_s": "m^3/s", "a_m_per_s": "m/s", "gain_per_s": "1/s", "delay_ms": "ms", "time_s": "s",
        "drive_valve": "1",
    }
    assert {name: unit_of(name) for name in units} == units


def test_numbers_of_numpy_are_numbers(tmp_path):
    numpy = pytest.importorskip("numpy")
    planned = Fault("bus-delay", "bus.DriveSensors", from_s=numpy.float64(0.01), numbers={"delay_ms": numpy.int64(1)})
    setup = {"carriage_position_m": numpy.float32(0.25)}
    with Rig(controller=to_300_mm, setup=setup, faults=[planned], out=tmp_path) as rig:
        rig.fault("position-sensor-offset", "drive", offset_m=numpy.float64(0.01))
        rig.fault("bus-delay", "bus.DriveValveCommand", delay_ms=numpy.int64(2))
        rig.run_for("20 ms")
        rig.end()


def test_without_a_program_the_message_says_where_it_was_looked_for_and_what_to_do(tmp_path, monkeypatch):
    monkeypatch.setenv("AIRBENCH_BIN", str(tmp_path))
    with pytest.raises(airbench_hil.ProgramNotFound, match=f"{tmp_path}.*AIRBENCH_BIN="):
        Rig(controller=to_300_mm, out=tmp_path / "run").start()
