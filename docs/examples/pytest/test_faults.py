"""Broken sensors, valves, air, mechanics and frames, and what the drive makes of them."""

import pytest

from airbench_hil import Own

requirement = pytest.mark.requirement


@requirement("FLT-SENSOR-1")
def test_without_sensors_it_shuts_its_valve_and_says_why(moving):
    rig = moving()
    rig.fault("bus-loss", "bus.DriveSensors")
    began = rig.time
    stopped = rig.expect('DriveEmergencyStop.reason == "sensor-loss"', within="70 ms")
    assert stopped - began >= 0.049, "not before the time is over"
    rig.expect("RigStatus.emergency_stop == 1", within="20 ms")


@requirement("FLT-SENSOR-2")
def test_a_short_loss_of_sensors_trips_nothing(moving):
    rig = moving()
    with rig.broken("bus-loss", "bus.DriveSensors"):
        rig.never("RigStatus.emergency_stop == 1", during="30 ms")
    rig.never("RigStatus.emergency_stop == 1", during="0.2 s")
    rig.expect("near(DriveSensors.position, 0.3, 0.001)", within="1.5 s")


@requirement("FLT-SENSOR-3")
def test_noise_on_the_position_is_borne(moving):
    rig = moving()
    rig.wait_for("DriveSensors.position > 0.299")
    rig.fault("position-sensor-noise", "drive", noise_m=0.001)
    rig.never("RigStatus.emergency_stop == 1", during="0.4 s")
    run = rig.end()
    end = run.truth["drive_position_m"].tail(300)
    assert end.max() - end.min() < 0.005


@requirement("FLT-SENSOR-4")
@pytest.mark.parametrize("offset", [-0.01, 0.01])
def test_a_zero_that_is_off_moves_the_carriage_by_as_much(moving, offset):
    rig = moving()
    rig.fault("position-sensor-offset", "drive", offset_m=offset)
    rig.wait_for("near(DriveSensors.position, 0.3, 0.001)", timeout="1.5 s")
    rig.stable_for("DriveSensors.position", "0.2 s", tolerance=0.001, within="1 s")
    run = rig.end()
    assert run.truth["drive_position_m"].iloc[-1] == pytest.approx(0.3 - offset, abs=0.002)


@requirement("FLT-VALVE-1")
def test_a_valve_that_comes_free_again_lets_it_go_on(moving):
    rig = moving()
    with rig.broken("valve-stuck", "drive"):
        rig.run_for("50 ms")
    rig.expect("near(DriveSensors.position, 0.3, 0.001)", within="1.5 s")


@requirement("FLT-VALVE-2")
def test_a_valve_whose_zero_is_off_costs_no_stability(moving):
    rig = moving()
    rig.fault("valve-offset", "drive", offset=0.03)
    rig.expect("near(DriveSensors.position, 0.3, 0.01)", within="1.5 s")
    rig.stable_for("DriveSensors.position", "0.3 s", tolerance=0.002, within="1 s")


@requirement("FLT-SUPPLY-1")
def test_a_lost_supply_holds_the_carriage_and_back_again_it_goes_on(moving):
    rig = moving()
    with rig.broken("supply-loss"):
        rig.expect("RigStatus.check_valves_shut == 1", within="0.3 s")
        rig.run_for("0.1 s")
    rig.expect("RigStatus.check_valves_shut == 0", within="1 s")
    rig.expect("near(DriveSensors.position, 0.3, 0.002)", within="1.5 s")


@requirement("FLT-AIR-1")
def test_a_leaking_chamber_does_not_move_the_carriage_far(moving):
    rig = moving()
    rig.wait_for("DriveSensors.position > 0.299")
    rig.fault("chamber-leak", "drive.a", leakage_nl_per_min=100.0)
    rig.always("near(DriveSensors.position, 0.3, 0.005)", during="0.5 s")


@requirement("FLT-AIR-2")
@pytest.mark.parametrize("chamber", ["drive.a", "drive.b"])
def test_a_burst_hose_does_not_throw_the_carriage(moving, chamber):
    rig = moving()
    rig.fault("hose-burst", chamber)
    rig.run_for("0.5 s")
    run = rig.end()
    assert run.truth["drive_rod_velocity_m_per_s"].abs().max() < 2.0


@requirement("FLT-MECHANICS-1")
def test_more_friction_leaves_it_stable(moving):
    rig = moving()
    rig.fault("friction-rise", "drive", factor=3.0)
    rig.expect("near(DriveSensors.position, 0.3, 0.005)", within="1.5 s")
    rig.stable_for("DriveSensors.position", "0.3 s", tolerance=0.001, within="1 s")


@requirement("FLT-MECHANICS-2")
def test_a_hand_does_not_push_it_far_and_it_comes_back(moving):
    rig = moving()
    rig.wait_for("DriveSensors.position > 0.299")
    rig.hand("carriage", -60.0)
    rig.always("near(DriveSensors.position, 0.3, 0.01)", during="0.3 s")
    rig.let_go()
    rig.expect("near(DriveSensors.position, 0.3, 0.001)", within="1 s")


@requirement("FLT-BUS-1")
def test_corrupted_commands_are_refused(moving):
    rig = moving()
    rig.fault("bus-corruption", "bus.DriveValveCommand", probability=0.3)
    rig.expect("near(DriveSensors.position, 0.3, 0.002)", within="1.5 s")
    run = rig.end()
    assert run.figures["frames_malformed"] > 100


@requirement("FLT-BUS-2")
def test_a_controller_that_falls_silent_has_its_valve_shut(moving):
    rig = moving()
    rig.fault("bus-off", "drive-controller")
    silent = rig.time
    rig.expect("RigStatus.drive_stale == 1", within="35 ms")  # 20 cycles, and up to 10 ms to the next RigStatus
    rig.run_for("50 ms")
    spool = rig.end().truth.set_index("time_s")["drive_spool"].abs()
    assert spool[silent : silent + 0.018].min() > 0.05, "it is open to the last"
    assert spool[silent + 0.030 :].max() < 0.01, "the spool follows within 10 ms"


@requirement("FLT-BUS-3")
def test_delayed_sensors_are_borne(moving):
    rig = moving()
    rig.fault("bus-delay", "bus.DriveSensors", delay_ms=3)
    rig.expect("near(DriveSensors.position, 0.3, 0.002)", within="1.5 s")
    rig.never("RigStatus.emergency_stop == 1", during="0.2 s")
