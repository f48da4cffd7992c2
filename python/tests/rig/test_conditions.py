"""Conditions as text: what they mean, and what is refused."""

import pytest

from airbench_hil.conditions import parse, seconds
from airbench_hil.errors import SignalUnknown
from airbench_hil.signals import Names, Seen, database


class Bus:
    """Frames at times, without a bus."""

    def __init__(self):
        self.names = Names(database())
        self.seen, self.now_s = Seen(self.names), 0.0

    def frame(self, name, **values):
        raw_id, data = self.names.encoded(name, values)
        self.seen.take(raw_id, data, len(data), self.now_s)

    def watch(self, text):
        return parse(text, self.names).watch(self.seen, lambda: self.now_s)


@pytest.fixture
def bus():
    return Bus()


def test_values_are_those_of_cantools_for_every_signal_of_every_message(bus):
    for message in bus.names.dbc.messages:
        for pattern in (0x00, 0xFF, 0xA5, 0x5A, 0x13):
            data = bytes([pattern]) * message.length
            for name, value in message.decode(data, decode_choices=False).items():
                signal = bus.names.signal(f"{message.name}.{name}")
                assert signal.of(int.from_bytes(data, "little")) == pytest.approx(value, rel=1e-12), signal.name


def test_a_checksum_is_the_rigs(bus):
    # The published check value of CRC-8 SAE J1850 is that of "123456789"; identifier and data are these nine bytes.
    from airbench_hil.signals import crc8

    assert crc8(int.from_bytes(b"12", "little"), b"3456789") == 0x4B


def test_numbers_words_and_logic(bus):
    bus.frame("DriveSensors", position=0.4)
    bus.frame("DriveChainStatus", main_chain=5)
    for text, wanted in {
        "DriveSensors.position > 0.39": True,
        "0.39 < DriveSensors.position < 0.395": False,
        "near(DriveSensors.position, 0.401, 0.002)": True,
        'DriveChainStatus.main_chain == "experiment"': True,
        '"done" == DriveChainStatus.main_chain': False,
        'DriveChainStatus.main_chain != "done" and not DriveSensors.position < 0': True,
        "abs(0.1 - DriveSensors.position) > 0.2 or LoadSensors.position > 0": True,
        "max(DriveSensors.position, 0.5) == 0.5": True,
        "1 / DriveChainStatus.repetition > 0": False,
        "count(DriveSensors) == 1 and count(LoadSensors) == 0": True,
    }.items():
        assert bus.watch(text).holds() == wanted, text


def test_what_has_not_come_does_not_hold_and_its_negation_neither(bus):
    edges = [f"not {edge}(LoadSensors.position > 0)" for edge in ("rose", "fell", "changed")]
    for text in ("LoadSensors.position >= 0", "not LoadSensors.position >= 0", *edges):
        assert not bus.watch(text).holds(), text


def test_edges_are_those_between_two_looks(bus):
    bus.frame("RigStatus", linked=1)
    rose, fell, changed = (bus.watch(text) for text in ("rose(RigStatus.linked)", "fell(RigStatus.linked == 1)",
                                                        "changed(RigStatus.linked)"))
    for linked, wanted in [(1, (0, 0, 0)), (0, (0, 1, 1)), (0, (0, 0, 0)), (1, (1, 0, 1)), (1, (0, 0, 0))]:
        bus.frame("RigStatus", linked=linked)
        assert tuple(map(int, (rose.holds(), fell.holds(), changed.holds()))) == wanted


def test_an_edge_of_an_edge_is_one_too(bus):
    bus.frame("RigStatus", linked=0)
    watch, came = bus.watch("rose(changed(RigStatus.linked))"), []
    for linked in (0, 0, 1, 0, 0, 1):
        bus.frame("RigStatus", linked=linked)
        came.append(watch.holds())
    assert came == [False, False, True, False, False, True]


def test_the_age_of_a_message_is_the_rigs_time_since_it(bus):
    watch = bus.watch("age(DriveValveCommand) > 0.05")
    bus.now_s = 1.0
    assert watch.holds(), "none has come since the beginning"
    bus.frame("DriveValveCommand", opening=0.0)
    bus.now_s = 1.049
    assert not watch.holds()
    bus.now_s = 1.06
    assert watch.holds()


@pytest.mark.parametrize("text, words", [
    ("DriveSensors.posision > 1", "DriveSensors.position"),
    ("Drive.position > 1", "DriveSensors"),
    ("position > 1", "Message.signal: DriveSensors.position, LoadSensors.position"),
    ('DriveChainStatus.main_chain == "dine"', "experiment"),
    ('DriveSensors.position == "far"', "no words"),
    ("DriveSensors.position >", "invalid syntax"),
    ("__import__('os')", "no other function"),
    ("[1][0]", "none of what a condition may hold"),
    ("(lambda: 1)()", "no other function"),
    ("DriveSensors.position.real > 1", "Message.signal"),
    ("age(DriveSensor) > 1", "no message"),
    ("near(DriveSensors.position, 0.3)", "near takes 3 arguments"),
    ("min(DriveSensors.position) > 1", "min takes 2 or more arguments"),
    ("abs() > 1", "abs takes 1 argument"),
])
def test_what_cannot_be_meant_is_refused_with_what_can(bus, text, words):
    with pytest.raises(SignalUnknown, match=words):
        parse(text, bus.names)


def test_durations_are_seconds_or_have_their_unit():
    assert [seconds(each) for each in (2, 0.5, "4 s", "250 ms", "2 min", "10ms", "1.5 s")] == [2, 0.5, 4, 0.25, 120, 0.01, 1.5]
    for wrong in ("4", "four s", "4 h", "-1 s", -1, "s"):
        with pytest.raises(ValueError, match="duration"):
            seconds(wrong)


def test_messages_are_encoded_whole_and_what_they_lack_is_named(bus):
    assert bus.names.encoded("ConsoleEmergencyStop", {"reason": "operator"}) == (0x108, b"\x01\x00")
    for values, words in [({"reson": 1}, "no reson; it has reason, release"), ({"reason": 8}, "reason"), ({"reason": "nobody"}, "nobody")]:
        with pytest.raises(ValueError, match=words):
            bus.names.encoded("ConsoleEmergencyStop", values)
