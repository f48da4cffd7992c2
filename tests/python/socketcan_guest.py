"""python-can's `socketcan` interface, unmodified, on vcan or under `bench can`: prints a line for each thing that was seen.

Arguments: the interface, and whether another peer on its bus echoes frames of 0x3A0 as 0x3A1 ("echo").
"""

import asyncio
import errno
import socket
import sys
import threading
import time

import can

PATIENCE_S = 60


def check(what, holds):
    """A thing that must hold."""
    if not holds:
        raise SystemExit(f"not so: {what}")
    print(what)


def text_of(got):
    """All of a message but its time."""
    if got is None:
        return "nothing"
    marks = {"extended": got.is_extended_id, "remote": got.is_remote_frame, "error": got.is_error_frame, "fd": got.is_fd, "rx": got.is_rx}
    words = [f"{got.arbitration_id:X}", f"[{got.dlc}]", got.data.hex(), str(got.channel), *(word for word, holds in marks.items() if holds)]
    return " ".join(word for word in words if word)


def message(identifier, *data, **more):
    more.setdefault("is_extended_id", False)
    return can.Message(arbitration_id=identifier, data=data, **more)


def open_bus(channel, **more):
    return can.Bus(interface="socketcan", channel=channel, **more)


def send_and_receive(channel):
    with open_bus(channel) as one, open_bus(channel) as other:
        print(one.channel_info, one.protocol.name, one.state.name)
        one.send(message(0x123, 1, 2, 3))
        got = other.recv(PATIENCE_S)
        print("a frame arrives:", text_of(got))
        check("it has a time stamp of now", abs(got.timestamp - time.time()) < 60)
        check("it is of this machine", not got.is_rx)
        check("the sender does not hear itself", one.recv(0.05) is None)
        one.send(message(0x12345678, is_extended_id=True, is_remote_frame=True, dlc=4))
        print("a remote request keeps its length:", text_of(other.recv(PATIENCE_S)))
        one.send(message(0x040, 0, 0, 0, 0, 0, 0, 0, 0, is_error_frame=True))
        print("an error frame:", text_of(other.recv(PATIENCE_S)))
        print("none without waiting:", text_of(other.recv(0)))
    with open_bus(channel, receive_own_messages=True) as own:
        own.send(message(0x124))
        print("own messages on request:", text_of(own.recv(PATIENCE_S)))
    with open_bus(channel, local_loopback=False) as mute, open_bus(channel) as other:
        mute.send(message(0x124))
        print("without loopback:", text_of(other.recv(0.1)))
    with open_bus(channel, ignore_rx_error_frames=True) as deaf, open_bus(channel) as one:
        one.send(message(0x040, 0, 0, 0, 0, 0, 0, 0, 0, is_error_frame=True))
        print("error frames left out:", text_of(deaf.recv(0.1)))


def filters(channel):
    with open_bus(channel) as one, open_bus(channel) as other:
        other.set_filters([{"can_id": 0x200, "can_mask": 0x7F0, "extended": False}])
        for identifier in (0x123, 0x201, 0x300, 0x20F):
            one.send(message(identifier))
        print("filters:", [text_of(other.recv(PATIENCE_S)) for _ in range(2)], text_of(other.recv(0.05)))
        other.set_filters([{"can_id": 0x1F0, "can_mask": 0x1FFFFFF0, "extended": True}, {"can_id": 0x300, "can_mask": 0x7FF}])
        for identifier, extended in ((0x1F2, False), (0x1F3, True), (0x300, False), (0x201, True)):
            one.send(message(identifier, is_extended_id=extended))
        print("two filters:", [text_of(other.recv(PATIENCE_S)) for _ in range(2)], text_of(other.recv(0.05)))
        other.set_filters(None)
        one.send(message(0x123))
        print("filters taken away:", text_of(other.recv(PATIENCE_S)))


def any_channel(channel):
    with open_bus("") as everywhere, open_bus(channel) as one:
        one.send(message(0x125, 7))
        got = everywhere.recv(PATIENCE_S)
        print("a socket of any interface names it:", text_of(got))
        everywhere.send(message(0x126, channel=channel))
        print("and sends where it is told:", text_of(one.recv(PATIENCE_S)))


def periodic(channel):
    with open_bus(channel) as one, open_bus(channel) as other:
        task = one.send_periodic(message(0x210, 1), 0.01)
        print("a periodic task of the broadcast manager:", type(task).__name__, text_of(other.recv(PATIENCE_S)))
        stamps = [other.recv(PATIENCE_S).timestamp for _ in range(10)]
        check("its frames follow each other", stamps == sorted(stamps) and stamps[-1] > stamps[0])
        task.modify_data(message(0x210, 2))
        while (got := other.recv(PATIENCE_S)).data[0] != 2:
            pass
        print("its data change:", text_of(got))
        task.stop()
        while other.recv(0.3) is not None:
            pass
        print("it stops")
        task.start()
        print("it starts again:", text_of(other.recv(PATIENCE_S)))
        task.stop()
        limited = one.send_periodic(message(0x211, 1), 0.01, duration=0.05)
        while other.recv(PATIENCE_S).arbitration_id != 0x211:
            pass
        rest = []
        while (got := other.recv(0.3)) is not None:
            rest.append(got)
        print("a limited task ends after", 1 + len(rest))
        limited.stop()
        several = one.send_periodic([message(0x212, 1), message(0x212, 2)], 0.01)
        data = [other.recv(PATIENCE_S).data[0] for _ in range(4)]
        check("a list of messages takes turns", data in ([1, 2, 1, 2], [2, 1, 2, 1]))
        several.stop()


def notifier(channel):
    seen, complete = [], threading.Event()

    def hear(got):
        seen.append(got.arbitration_id)
        if len(seen) == 50:
            complete.set()

    with open_bus(channel) as one, can.ThreadSafeBus(interface="socketcan", channel=channel) as other:
        listening = can.Notifier(other, [hear])
        for number in range(50):
            one.send(message(0x400 + number))
        check("a notifier hears all", complete.wait(PATIENCE_S) and seen == [0x400 + number for number in range(50)])
        listening.stop()


async def hear_asynchronously(channel):
    with open_bus(channel) as one, open_bus(channel) as other:
        reader = can.AsyncBufferedReader()
        listening = can.Notifier(other, [reader], loop=asyncio.get_running_loop())
        for number in range(3):
            one.send(message(0x500 + number))
        print("a notifier in an event loop:", [text_of(await asyncio.wait_for(reader.get_message(), PATIENCE_S)) for _ in range(3)])
        listening.stop()


def refusals(channel):
    try:
        open_bus("none0")
    except OSError as refused:
        print("no such interface:", refused)
    with open_bus(channel, fd=True) as flexible:
        try:
            flexible.send(message(0x127, *range(12), is_fd=True))
        except can.CanOperationError as refused:
            print("no CAN FD:", refused, errno.errorcode[refused.error_code])


def lists(channel):
    names = [name for _, name in socket.if_nameindex()]
    check("the system's list of interfaces", channel in names and "lo" in names)
    detected = can.detect_available_configs("socketcan")
    print("the configurations that python-can detects:", [found for found in detected if found["channel"] == channel])


def another_peer(channel):
    with open_bus(channel) as one:
        for number in range(100):
            one.send(message(0x3A0, number))
            got = one.recv(PATIENCE_S)
            if (got.arbitration_id, got.data[0], got.is_rx) != (0x3A1, number, True):
                raise SystemExit(f"frame {number} was answered by {got}")
    print("a hundred frames were answered by another peer of the bus")


def main():
    channel = sys.argv[1]
    for part in (send_and_receive, filters, any_channel, periodic, notifier, refusals, lists):
        part(channel)
    asyncio.run(hear_asynchronously(channel))
    if sys.argv[2:] == ["echo"]:
        another_peer(channel)


main()
