"""python-can on the embedded bus: a plugin of one class, for tools that take a python-can bus.

    can.Bus(interface="airbench", channel="/path/of/the/bus")

The embedded bus is a Unix SEQPACKET socket that carries one `struct can_frame` a packet. With `member` the client joins the lockstep
barrier under that name: time waits until it has read what came, so that it loses nothing however slow it is. A member that is silent
for 5 s ends the run, so one that does not read for a second (it starts, or is between two sessions) has what came put by, one cycle a
second. Importing this file makes the interface known to python-can, as an entry point of a package would.
"""

import collections
import select
import socket
import struct
import threading
import time

import can
import can.interfaces

FRAME = struct.Struct("=IB3x8s")
CONTROL = struct.Struct("<4sBBxxI20s")
MAGIC = b"ABLS"
JOIN_AS_MEMBER, DONE, GO = 2, 3, 4
PATIENCE_S = 1.0


class AirbenchBus(can.BusABC):
    """A peer of the embedded bus; `fd` and `bitrate` are taken and mean nothing."""

    def __init__(self, channel, can_filters=None, member=None, **kwargs):
        self.channel_info = f"airbench {channel}"
        self.socket = self._connected(channel)
        self.poll = select.poll()
        self.poll.register(self.socket, select.POLLIN)
        self.wanted = None
        self.closed = False
        self.put_by = collections.deque()
        self.reading, self.last_read = threading.Lock(), time.monotonic()
        if member:
            self.socket.send(CONTROL.pack(MAGIC, JOIN_AS_MEMBER, 0, 0, member.encode()))
            threading.Thread(target=self._keep_alive, daemon=True).start()
        super().__init__(channel=channel, can_filters=can_filters, **kwargs)

    @staticmethod
    def _connected(channel):
        """A host that is only just starting is waited for."""
        until = time.monotonic() + 10
        while True:
            peer = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            try:
                peer.connect(channel)
                return peer
            except (FileNotFoundError, ConnectionRefusedError) as refused:
                peer.close()
                if time.monotonic() > until:
                    raise can.CanInitializationError(f"no host at {channel}: {refused}") from refused
                time.sleep(0.05)

    def _apply_filters(self, filters):
        plain = filters and all(each.get("can_mask") == 0x7FF for each in filters)
        self.wanted = {each["can_id"] for each in filters} if plain else None

    def _recv_internal(self, timeout):
        with self.reading:
            until = None if timeout is None else time.monotonic() + timeout
            # A bus that is never silent must not keep whoever has waited long enough.
            left = timeout
            while not self.closed and (left is None or left >= 0):
                if not self.put_by and not self.poll.poll(None if left is None else left * 1000):
                    break
                frame = self.put_by.popleft() if self.put_by else self._frame()
                if frame and (self.wanted is None or frame[0] in self.wanted):
                    self.last_read = time.monotonic()
                    return self._message(*frame), self.wanted is not None
                left = None if until is None else until - time.monotonic()
            self.last_read = time.monotonic()
        if self.closed and timeout:
            time.sleep(timeout)
        return None, False

    def _frame(self):
        """The next packet, if it is a frame; what else comes is seen to."""
        try:
            packet = self.socket.recv(64)
        except ConnectionResetError:
            packet = b""
        if not packet:
            # The host has gone; whoever asks again gets nothing, as from a bus that is silent.
            self.closed = True
        elif len(packet) != CONTROL.size:
            return FRAME.unpack(packet)
        elif packet[4] == GO:
            self._send(packet[:4] + bytes([DONE, 0, 0, 0]) + packet[8:12] + bytes(20))
        return None

    def _keep_alive(self):
        """Reads up to the end of a cycle whenever nobody has read for a while."""
        while not self.closed:
            time.sleep(PATIENCE_S / 4)
            with self.reading:
                if time.monotonic() - self.last_read < PATIENCE_S:
                    continue
                while not self.closed and self.poll.poll(0):
                    frame = self._frame()
                    if frame is None:
                        break
                    self.put_by.append(frame)
                self.last_read = time.monotonic()

    def _message(self, raw_id, length, data):
        return can.Message(
            timestamp=time.time(),
            arbitration_id=raw_id & 0x1FFFFFFF,
            is_extended_id=bool(raw_id & 0x80000000),
            is_remote_frame=bool(raw_id & 0x40000000),
            is_error_frame=bool(raw_id & 0x20000000),
            dlc=length,
            data=data[:length],
        )

    def send(self, msg, timeout=None):
        flags = msg.is_extended_id << 31 | msg.is_remote_frame << 30
        self._send(FRAME.pack(msg.arbitration_id | flags, msg.dlc, bytes(msg.data).ljust(8, b"\0")))

    def _send(self, packet):
        try:
            self.socket.send(packet)
        except (BrokenPipeError, ConnectionResetError):
            self.closed = True

    def shutdown(self):
        super().shutdown()
        self.closed = True
        with self.reading:
            self.socket.close()

    @property
    def state(self):
        return can.BusState.ACTIVE


can.interfaces.BACKENDS["airbench"] = (__name__, "AirbenchBus")
can.interfaces.VALID_INTERFACES = frozenset(can.interfaces.BACKENDS)
