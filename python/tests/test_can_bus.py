"""What python-can's own tests leave open: stamps, filters, own frames, descriptors, and a bus that is not or no longer there."""

import asyncio
import select
import threading
import time

import can
import pytest
from conftest import end_host, start_host

from airbench_hil import peer


@pytest.fixture
def pair(bus_path):
    with can.Bus(interface="airbench", channel=f"unix://{bus_path}") as one:
        with can.Bus(interface="airbench", channel=bus_path) as other:
            yield one, other


def message(identifier, data=b"\x01", extended=False):
    return can.Message(arbitration_id=identifier, data=data, is_extended_id=extended)


def test_a_stamp_is_that_of_the_arrival_and_not_of_the_reading(pair):
    one, other = pair
    before = time.time()
    one.send(message(0x123))
    assert select.select([other.fileno()], [], [], 60)[0], "it arrives"
    after = time.time()
    time.sleep(0.05)
    got = other.recv(0)
    # The clock of stamps is the same; a microsecond is lost in the float.
    assert before - 1e-6 <= got.timestamp <= after + 1e-6
    assert got.is_rx and got.channel == other._peer.path


def test_filters_let_in_what_their_masks_say_and_can_be_changed(pair):
    one, other = pair
    other.set_filters([
        {"can_id": 0x120, "can_mask": 0x7FE, "extended": False},
        {"can_id": 0x1ABCDEF0, "can_mask": 0x1FFFFFFF, "extended": True},
    ])
    for identifier, extended in [(0x120, False), (0x121, False), (0x122, False), (0x120, True), (0x1ABCDEF0, True)]:
        one.send(message(identifier, extended=extended))
    assert [other.recv(60).arbitration_id for _ in range(3)] == [0x120, 0x121, 0x1ABCDEF0]
    other.set_filters(None)
    one.send(message(0x7FF))
    assert other.recv(60).arbitration_id == 0x7FF


def test_own_frames_come_back_in_their_place_and_are_marked(bus_path, pair):
    one, other = pair
    with can.Bus(interface="airbench", channel=bus_path, receive_own_messages=True) as own:
        for n in range(100):
            own.send(message(0x200, bytes([n])))
        one.send(message(0x200, b"\x00"))
        got = [own.recv(60) for _ in range(101)]
        assert [(each.data[0], each.is_rx) for each in got] == [(n, False) for n in range(100)] + [(0, True)]
        assert len([other.recv(60) for _ in range(101)]) == 101
    # And who did not ask does not hear himself: the others' frames, and no more.
    assert [one.recv(60).data[0] for _ in range(100)] == list(range(100))
    assert one.recv(0.05) is None


def test_own_frames_are_distinguished_though_filters_or_the_host_keep_some_of_them_back(bus_path, pair):
    one, _ = pair
    filters = [{"can_id": 0x200, "can_mask": 0x7FF, "extended": False}]
    with can.Bus(interface="airbench", channel=bus_path, receive_own_messages=True, can_filters=filters) as own:
        for identifier in (0x201, 0x200, 0x201):
            own.send(message(identifier))
        assert not own.recv(60).is_rx
        # More than the host keeps for one peer, then one that is kept again.
        own.set_filters(None)
        for n in range(10_000):
            own.send(message(0x202, n.to_bytes(4, "big")))
        while (got := own.recv(1)) is not None:
            assert not got.is_rx
        own.send(message(0x203))
        assert not own.recv(60).is_rx
        one.send(message(0x203))
        assert own.recv(60).is_rx


def test_a_shutdown_does_not_wait_for_one_who_waits_without_end(bus_path):
    bus = can.Bus(interface="airbench", channel=bus_path)
    ended = []

    def wait():
        with pytest.raises(can.CanOperationError, match="closed|gone"):
            bus.recv()
        ended.append(True)

    reader = threading.Thread(target=wait, daemon=True)
    reader.start()
    time.sleep(0.1)
    closer = threading.Thread(target=bus.shutdown, daemon=True)
    closer.start()
    closer.join(60)
    reader.join(60)
    assert not closer.is_alive() and ended


def test_all_kinds_of_frames_survive(pair):
    one, other = pair
    kinds = [
        message(0x7FF, bytes(range(8))),
        message(0x1FFFFFFF, b"", extended=True),
        can.Message(arbitration_id=5, is_remote_frame=True, dlc=8, is_extended_id=False),
        can.Message(arbitration_id=0x40, is_error_frame=True, data=bytes(8), is_extended_id=False),
    ]
    for kind in kinds:
        one.send(kind)
        assert other.recv(60).equals(kind, timestamp_delta=None, check_channel=False, check_direction=False)


def test_a_notifier_in_an_event_loop_waits_on_the_descriptor(pair):
    one, other = pair

    async def some():
        reader = can.AsyncBufferedReader()
        notifier = can.Notifier(other, [reader], loop=asyncio.get_running_loop())
        one.send(message(0x321))
        got = await asyncio.wait_for(reader.get_message(), 60)
        notifier.stop()
        return got

    assert asyncio.run(some()).arbitration_id == 0x321


def test_a_bus_that_is_not_there_says_so_and_one_that_goes_too(tmp_path):
    path = tmp_path / "bus0"
    with pytest.raises(can.CanInitializationError, match="no host at"):
        can.Bus(interface="airbench", channel=str(path), connect_timeout=0.0)
    host = start_host(path)
    with can.Bus(interface="airbench", channel=str(path)) as bus:
        end_host(host)
        with pytest.raises(can.CanOperationError, match="closed|gone"):
            bus.recv(60)
        with pytest.raises(can.CanOperationError, match="gone"):
            bus.send(message(1))


def test_arguments_that_cannot_be_meant_are_refused(bus_path):
    for arguments, words in [
        ({"channel": "can0"}, "unix:///PATH"),
        ({"channel": f"unix://{bus_path}?loss=0.1"}, "for the host"),
        ({"channel": bus_path, "fd": True}, "no CAN FD"),
        ({"channel": bus_path, "member": "a name of more than twenty bytes"}, "1 to 20 bytes"),
    ]:
        with pytest.raises(can.CanInitializationError, match=words):
            can.Bus(interface="airbench", **arguments)


def test_the_default_bus_is_found_when_it_is_there(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    assert can.detect_available_configs("airbench") == []
    (tmp_path / "airbench").mkdir()
    host = start_host(tmp_path / "airbench/bus0")
    try:
        [found] = can.detect_available_configs("airbench")
        assert found == {"interface": "airbench", "channel": peer.default_path()}
        with can.Bus(**found), can.Bus(interface="airbench"):
            pass
    finally:
        end_host(host)


def test_what_is_sent_at_full_speed_arrives_in_order(pair):
    one, other = pair
    sent = 5000
    for n in range(sent):
        one.send(message(0x300, n.to_bytes(4, "big")))
        if n % 500 == 499:
            # The host keeps half a second of a full bus for each peer; what exceeds it is dropped and counted there.
            got = [int.from_bytes(other.recv(60).data, "big") for _ in range(500)]
            assert got == list(range(n - 499, n + 1))
