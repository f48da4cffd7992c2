"""Tests of CAN software as a user has them: python-can on the bus of a rig that runs, no hardware and no mock."""

import os

import can
import pytest

DRIVE_SENSORS, RIG_STATUS, CONSOLE_EMERGENCY_STOP = 0x120, 0x140, 0x108


@pytest.fixture
def bus():
    with can.Bus(interface="airbench", channel=os.environ["BUS"]) as connected:
        yield connected


def next_of(bus, identifier):
    while (message := bus.recv(60)) is not None:
        if message.arbitration_id == identifier:
            return message
    raise AssertionError(f"{identifier:#x} never came")


def stopped(rig_status):
    """Bit 15 (protocol/rig.dbc)."""
    return bool(rig_status.data[1] & 0x80)


def test_the_sensors_count_their_cycles(bus):
    bus.set_filters([{"can_id": DRIVE_SENSORS, "can_mask": 0x7FF, "extended": False}])
    counters = [bus.recv(60).data[7] >> 4 for _ in range(100)]
    steps = [(after - before) % 16 for before, after in zip(counters, counters[1:])]
    # A machine that stands still skips cycles, and the counter with them.
    assert steps.count(1) > 50, counters


def test_an_emergency_stop_on_the_bus_stops_the_rig(bus):
    assert not stopped(next_of(bus, RIG_STATUS))
    bus.send(can.Message(arbitration_id=CONSOLE_EMERGENCY_STOP, data=[1, 0], is_extended_id=False))
    while not stopped(next_of(bus, RIG_STATUS)):
        pass
    bus.send(can.Message(arbitration_id=CONSOLE_EMERGENCY_STOP, data=[0, 1], is_extended_id=False))
    while stopped(next_of(bus, RIG_STATUS)):
        pass
