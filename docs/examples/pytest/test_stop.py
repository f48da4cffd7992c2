"""The emergency stop, the way back, and the loss of the partner."""

import pytest

from airbench_hil import Own

requirement = pytest.mark.requirement


@requirement("STOP-1")
@pytest.mark.parametrize("by", ["console", "rig"])
def test_the_stop_empties_the_supply_and_the_carriage_stands(moving, by):
    rig = moving()
    rig.emergency_stop(by)
    rig.expect("RigStatus.emergency_stop == 1", within="20 ms")
    rig.expect("RigStatus.supply_pressure < 2e5", within="0.2 s")
    rig.expect("DriveValveCommand.opening == 0", within="20 ms")
    rig.stable_for("DriveSensors.position", "0.2 s", tolerance=0.0005, within="1.5 s")


@requirement("STOP-2")
def test_after_the_release_the_repetition_begins_anew(moving):
    rig = moving()
    rig.emergency_stop()
    rig.run_for("0.5 s")
    rig.release()
    rig.expect("fell(RigStatus.emergency_stop)", within="20 ms")
    rig.expect("RigStatus.check_valves_shut == 0", within="1 s")
    run = rig.finish(within="10 s")
    assert run.ended_because == "the controllers are done"
    assert run.measurement["drive_position_m"].iloc[-1] == pytest.approx(0.3, abs=0.001)


@requirement("STOP-3")
def test_with_on_start_nothing_moves_before_the_start(moving):
    rig = moving(Own(after_emergency_stop="on-start"))
    rig.emergency_stop()
    rig.run_for("0.5 s")
    rig.release()
    rig.expect('DriveChainStatus.emergency_stop_chain == "waiting-for-start"', within="2 s")
    place = rig.read("DriveSensors.position")
    rig.always(f"near(DriveSensors.position, {place}, 0.0005)", during="0.5 s")
    rig.start_experiment()
    rig.expect('DriveChainStatus.main_chain == "experiment"', within="3 s")
    rig.expect("near(DriveSensors.position, 0.3, 0.001)", within="3 s")


@requirement("STOP-4")
def test_while_the_cause_lasts_a_release_is_not_accepted(moving):
    rig = moving()
    rig.fault("bus-loss", "bus.DriveSensors")
    rig.expect('DriveEmergencyStop.reason == "sensor-loss"', within="70 ms")
    rig.release()
    rig.always("DriveEmergencyStop.release == 0", during="0.3 s")
    rig.mend("all")
    rig.run_for("50 ms")
    rig.release()
    rig.expect("DriveEmergencyStop.release == 1", within="1.1 s")  # not before the axis stands still, or 1 s after the trip
    rig.expect("RigStatus.emergency_stop == 0", within="20 ms")


@requirement("STOP-5")
def test_an_abort_shuts_the_valve_without_a_stop(moving):
    rig = moving()
    rig.abort()
    rig.expect('DriveChainStatus.main_chain == "aborted"', within="20 ms")
    rig.expect("DriveValveCommand.opening == 0", within="20 ms")
    assert rig.read("RigStatus.emergency_stop") == 0


@requirement("PART-1")
@pytest.mark.parametrize("dies, lives", [("load", "Drive"), ("drive", "Load")])
def test_a_controller_whose_partner_dies_trips_the_stop(airbench_rig, dies, lives):
    rig = airbench_rig("load-step", controller=Own(two=True))
    rig.wait_for(f'{lives}ChainStatus.main_chain == "experiment"')
    rig.kill(f"controller-{dies}")
    rig.expect(f'{lives}EmergencyStop.reason == "partner-lost"', within="150 ms")
    rig.expect("RigStatus.emergency_stop == 1", within="20 ms")
