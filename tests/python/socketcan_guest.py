"""python-can's `socketcan` interface, unmodified, under `bench can`: prints a line for each thing that was seen.

Arguments: the interface, and whether another peer on its bus echoes frames of 0x3A0 as 0x3A1 ("echo").
"""

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


def message(identifier, *data, **more):
    more.setdefault("is_extended_id", False)
    return can.Message(arbitration_id=identifier, data=data, **more)


def open_bus(channel, **more):
    return can.Bus(interface="socketcan", channel=channel, **more)


def send_and_receive(channel):
    with open_bus(channel) as one, open_bus(channel) as other:
        one.send(message(0x123, 1, 2, 3))
        got = other.recv(PATIENCE_S)
        check("a frame arrives", (got.arbitration_id, bytes(got.data), got.channel) == (0x123, bytes([1, 2, 3]), channel))
        check("it has a time stamp of now", abs(got.timestamp - time.time()) < 60)
        check("it is of this machine", not got.is_rx)
        check("the sender does not hear itself", one.recv(0.05) is None)
        one.send(message(0x12345678, is_extended_id=True, is_remote_frame=True, dlc=4))
        got = other.recv(PATIENCE_S)
        check("a remote request keeps its length", got.is_extended_id and got.is_remote_frame and got.dlc == 4)
    with open_bus(channel, receive_own_messages=True) as own:
        own.send(message(0x124))
        check("own messages on request", own.recv(PATIENCE_S).arbitration_id == 0x124)


def filters(channel):
    with open_bus(channel) as one, open_bus(channel) as other:
        other.set_filters([{"can_id": 0x200, "can_mask": 0x7F0, "extended": False}])
        for identifier in (0x123, 0x201, 0x300, 0x20F):
            one.send(message(identifier))
        check("filters", [other.recv(PATIENCE_S).arbitration_id for _ in range(2)] == [0x201, 0x20F])
        other.set_filters(None)
        one.send(message(0x123))
        check("filters taken away", other.recv(PATIENCE_S).arbitration_id == 0x123)


def any_channel(channel):
    with open_bus("") as everywhere, open_bus(channel) as one:
        one.send(message(0x125, 7))
        got = everywhere.recv(PATIENCE_S)
        check("a socket of any interface names it", got.channel == channel)
        everywhere.send(message(0x126, channel=channel))
        check("and sends where it is told", one.recv(PATIENCE_S).arbitration_id == 0x126)


def periodic(channel):
    with open_bus(channel) as one, open_bus(channel) as other:
        task = one.send_periodic(message(0x210, 1), 0.01)
        check("a periodic task of the broadcast manager", type(task).__name__ == "CyclicSendTask")
        stamps = [other.recv(PATIENCE_S).timestamp for _ in range(10)]
        check("its frames follow each other", stamps == sorted(stamps) and stamps[-1] > stamps[0])
        task.modify_data(message(0x210, 2))
        while other.recv(PATIENCE_S).data[0] != 2:
            pass
        check("its data change", True)
        task.stop()
        while other.recv(0.3) is not None:
            pass
        check("it stops", True)
        task.start()
        check("it starts again", other.recv(PATIENCE_S).data[0] == 2)
        task.stop()
        limited = one.send_periodic(message(0x211, 1), 0.01, duration=0.05)
        while other.recv(PATIENCE_S).arbitration_id != 0x211:
            pass
        rest = []
        while (got := other.recv(0.3)) is not None:
            rest.append(got)
        check("a limited task ends", len(rest) == 4)
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


def refusals(channel):
    try:
        open_bus("none0")
    except OSError as refused:
        check("no such interface", refused.errno == errno.ENODEV)
    with open_bus(channel, fd=True) as flexible:
        try:
            flexible.send(message(0x127, *range(12), is_fd=True))
        except can.CanOperationError as refused:
            check("no CAN FD", refused.error_code == errno.EINVAL)


def lists(channel):
    names = [name for _, name in socket.if_nameindex()]
    check("the system's list of interfaces", channel in names and "lo" in names)
    check("the configurations that python-can detects", {"interface": "socketcan", "channel": channel} in can.detect_available_configs("socketcan"))


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
    if sys.argv[2:] == ["echo"]:
        another_peer(channel)


main()
