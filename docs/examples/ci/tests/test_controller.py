"""Each test names the requirements that it verifies; requirements.toml has their texts."""

import pytest
from controller import controller

requirement = pytest.mark.requirement


@pytest.fixture
def rig(airbench_rig):
    """A rig whose carriage stands at 150 mm, with the controller."""
    return airbench_rig(controller=controller, setup={"carriage_position_m": 0.15})


@requirement("HOLD-1")
def test_it_holds_300_mm(rig):
    rig.stable_for("near(DriveSensors.position, 0.3, 0.002)", "0.5 s", within="3 s")


@requirement("HOLD-1", "HOLD-2")
def test_a_hand_does_not_move_it_for_good(rig):
    rig.stable_for("near(DriveSensors.position, 0.3, 0.002)", "0.5 s", within="3 s")
    rig.hand("carriage", 60.0)
    rig.always("near(DriveSensors.position, 0.3, 0.02)", during="0.5 s")
    rig.let_go()
    rig.stable_for("near(DriveSensors.position, 0.3, 0.002)", "0.5 s", within="2 s")


@requirement("SENSOR-1")
def test_without_sensors_there_is_no_command(rig):
    rig.run_for("0.5 s")
    rig.fault("bus-loss", "bus.DriveSensors")
    rig.expect("age(DriveValveCommand) > 0.02", within="40 ms")
