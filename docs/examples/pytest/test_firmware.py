"""The same requirements for the firmware in C (tests/firmware), as a customer would hold his own against them."""

import pytest

from airbench_hil import Process

requirement = pytest.mark.requirement


def experiment_of(rig):
    """Waits for it; from 0.1 m to 0.4 m in 3 s."""
    rig.wait_for('DriveChainStatus.main_chain == "experiment"', timeout="5 s")
    rig.wait_for("DriveSensors.position > 0.2", timeout="3 s")


def jump(rig, signal, least):
    """When the signal first changed by so much from one cycle to the next, in the last 30 ms, s."""
    course = rig.course(signal, "30 ms")
    return next(time for (_, before), (time, now) in zip(course, course[1:], strict=False) if abs(now - before) > least)


@requirement("POS-1", "POS-4", "TIM-1")
def test_it_positions_within_the_bounds(firmware_rig):
    rig = firmware_rig()
    began = rig.wait_for('DriveChainStatus.main_chain == "experiment"', timeout="5 s")
    # The set-point comes every 10 ms; what the sensors show then is independent of what the firmware believes.
    error = "DriveSensors.position - DriveChainValues.position_set_point"
    rig.always(f"not changed(DriveChainValues.position_set_point) or abs({error}) < 0.004", during="3 s")
    assert len({place for _, place in rig.course("DriveChainValues.position_set_point", "3 s")}) > 200, "so many were looked at"
    run = rig.finish()
    position = run.measurement.set_index("time_s")["drive_position_m"]
    for end, place in ((4.0, 0.4), (8.0, 0.1)):
        assert abs((position[began + end - 0.2 : began + end] - place).mean()) < 0.0004
    assert run.ended_because == "the controllers are done"
    commands = run.summary["drive_commands"]
    assert commands["accepted"] == run.figures["cycles"]
    assert all(commands[what] == 0 for what in ("lost", "late", "duplicate", "breaks", "refused_stale")), commands


@requirement("TIM-3")
def test_a_command_answers_the_position_of_its_own_cycle(firmware_rig):
    rig = firmware_rig()
    experiment_of(rig)
    rig.fault("position-sensor-offset", "drive", offset_m=0.01)
    rig.run_for("20 ms")
    shown, answered = jump(rig, "DriveSensors.position", 0.005), jump(rig, "DriveValveCommand.opening", 0.1)
    assert answered == shown, "the sensors jump in this cycle, s"


@requirement("STOP-1")
def test_the_stop_shuts_its_valve(firmware_rig):
    rig = firmware_rig()
    experiment_of(rig)
    rig.emergency_stop()
    rig.expect("DriveValveCommand.opening == 0 and DriveValveCommand.enable == 0", within="3 ms")
    rig.stable_for("DriveSensors.position", "0.2 s", tolerance=0.0005, within="1.5 s")


@requirement("STOP-3")
def test_after_the_release_it_waits_for_the_start(firmware_rig):
    rig = firmware_rig()
    experiment_of(rig)
    rig.emergency_stop()
    rig.run_for("0.2 s")
    rig.release()
    rig.expect("RigStatus.emergency_stop == 0", within="20 ms")
    rig.always("DriveValveCommand.enable == 0", during="1.5 s")
    rig.start_experiment()
    rig.expect('DriveChainStatus.main_chain == "initial-positioning"', within="50 ms")
    rig.expect("near(DriveSensors.position, 0.1, 0.001)", within="2 s")


@requirement("FLT-SENSOR-1", "STOP-4")
def test_without_sensors_it_trips_the_stop_and_accepts_no_release(firmware_rig):
    rig = firmware_rig()
    experiment_of(rig)
    rig.fault("bus-loss", "bus.DriveSensors")
    rig.expect('DriveEmergencyStop.reason == "sensor-loss"', within="70 ms")
    rig.expect('DriveChainStatus.main_chain == "fault"', within="10 ms")
    rig.release()
    rig.always("DriveEmergencyStop.release == 0", during="0.3 s")
    rig.mend("all")
    rig.run_for("50 ms")
    rig.release()
    rig.expect("DriveEmergencyStop.release == 1", within="50 ms")


@requirement("FLT-SENSOR-2")
def test_a_short_loss_of_sensors_trips_nothing(firmware_rig):
    rig = firmware_rig()
    experiment_of(rig)
    with rig.broken("bus-loss", "bus.DriveSensors"):
        rig.run_for("30 ms")
    rig.never("RigStatus.emergency_stop == 1", during="0.3 s")
    rig.always("abs(DriveChainValues.control_error) < 0.01", during="0.5 s")


@requirement("FLT-MECHANICS-2")
def test_a_hand_does_not_push_it_far(firmware_rig):
    rig = firmware_rig()
    rig.wait_for('DriveChainStatus.main_chain == "settling"', timeout="5 s")
    rig.wait_for("near(DriveSensors.position, 0.1, 0.0005)", timeout="1 s")
    rig.hand("carriage", 60.0)
    rig.always("near(DriveSensors.position, 0.1, 0.01)", during="0.3 s")
    rig.let_go()
    rig.expect("near(DriveSensors.position, 0.1, 0.001)", within="1 s")


@requirement("STOP-5")
def test_an_abort_shuts_the_valve_without_a_stop(firmware_rig):
    rig = firmware_rig()
    experiment_of(rig)
    rig.abort()
    rig.expect('DriveChainStatus.main_chain == "aborted"', within="20 ms")
    rig.expect("DriveValveCommand.enable == 0", within="5 ms")
    assert rig.read("RigStatus.emergency_stop") == 0


@requirement("TIM-1")
def test_the_same_code_on_socketcan_answers_every_cycle(airbench_rig, firmware_folder):
    foreign = Process([firmware_folder / "firmware-socketcan", "vcan0"], can=True, name="firmware")
    rig = airbench_rig(controller=foreign, setup={"carriage_position_m": 0.15})
    rig.run_for("2 s")
    run = rig.end()
    assert run.summary["drive_commands"]["accepted"] == pytest.approx(run.figures["cycles"], abs=2)
    assert run.figures["stale_commands"] == 0
