"""The embedded bus: a Unix SEQPACKET socket that carries one `struct can_frame` of 16 bytes a packet.

Packets of 32 bytes belong to the lockstep barrier (protocol/src/bus/control.rs):

    offset  0      4     5        8        12                32
            "ABLS" kind  members  cycle    name, zero-padded
                         + 2 pad  u32 LE
"""

from __future__ import annotations

import os
import select
import socket
import struct
import tempfile
import time
from collections.abc import Iterator
from typing import Any, NamedTuple

EXTENDED, REMOTE, ERROR = 0x80000000, 0x40000000, 0x20000000
LONGEST_NAME = 20

_FRAME = struct.Struct("=IB3x8s")
_CONTROL = struct.Struct("<4sBBxxI20s")
_MAGIC = b"ABLS"
_JOIN_AS_MEMBER, _DONE, _GO, _TIMED_OUT = 2, 3, 4, 5
_ROOM = 64
_TOO_MANY = 10_000  # frames: a wire carries 21 in a cycle of 1 ms
_SO_TIMESTAMPNS = getattr(socket, "SO_TIMESTAMPNS", 35)
_TIMESPEC = struct.Struct("@qq")


class BusError(Exception):
    """The bus is not there, or is gone."""


class LockstepTimeout(Exception):
    """A member of the barrier was not done in time; the text names it."""


class Frame(NamedTuple):
    """A frame as SocketCAN has it: `raw_id` with the flags for extended, remote and error frames, at most eight bytes of data."""

    raw_id: int
    data: bytes
    length: int
    stamp_s: float = 0.0
    """When it arrived: seconds since 1970, or of simulated time for a member of the barrier; 0 at a peer that is not `stamped`."""


class Go(NamedTuple):
    """All frames of a cycle are there: act, and say done."""

    cycle: int
    members: int


def default_path() -> str:
    """Where this user's programs look for the bus (docs/specification/bus.md, Buses)."""
    runtime = os.environ.get("XDG_RUNTIME_DIR", "")
    folder = os.path.join(runtime, "airbench") if os.path.isabs(runtime) else None
    return os.path.join(folder or os.path.join(tempfile.gettempdir(), f"airbench-{os.getuid()}"), "bus0")


def path_of(url: object) -> str:
    """The socket of `unix:///PATH`, of a bare absolute path, or of None for the default bus. Raises ValueError for others."""
    if not url:
        return default_path()
    path, _, options = str(url).removeprefix("unix://").partition("?")
    if not path.startswith("/"):
        raise ValueError(f"bus '{url}': unix:///PATH is expected, or an absolute path")
    if options:
        raise ValueError(f"bus '{url}': '{options}' is for the host of the bus; a peer gives the path alone")
    return path


def check_name(name: str) -> bytes:
    """A member's name as the bus carries it. Raises ValueError unless it has 1 to 20 bytes."""
    encoded = name.encode()
    if not 0 < len(encoded) <= LONGEST_NAME:
        raise ValueError(f"name '{name}': 1 to {LONGEST_NAME} bytes")
    return encoded


class Peer:
    """A node of the bus. What it sends, it does not hear; all others do."""

    def __init__(self, path: str, patience_s: float = 10.0, *, stamped: bool = True) -> None:
        """Connects, waiting `patience_s` for a host that is only just starting; without stamps, frames are read faster. Raises BusError."""
        self.path = path
        self.socket = self._connected(path, patience_s)
        self._stamped = stamped
        if stamped:
            self.socket.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
        self._poll = select.poll()
        self._poll.register(self.socket, select.POLLIN)
        self._writable = select.poll()
        self._writable.register(self.socket, select.POLLOUT)

    @staticmethod
    def _connected(path: str, patience_s: float) -> socket.socket:
        until = time.monotonic() + patience_s
        while True:
            peer = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            try:
                peer.connect(path)
                return peer
            except (FileNotFoundError, ConnectionRefusedError) as refused:
                peer.close()
                if time.monotonic() >= until:
                    raise BusError(f"no host at {path}: {refused.strerror}") from refused
                time.sleep(0.02)
            except OSError as error:
                peer.close()
                raise BusError(f"no bus at {path}: {error}") from error

    def fileno(self) -> int:
        """The descriptor, readable when a packet waits or the host is gone."""
        return self.socket.fileno()

    def hang_up(self) -> None:
        """Ends the connection: whoever waits in `receive`, in another thread too, gets BusError."""
        try:
            self.socket.shutdown(socket.SHUT_RDWR)
        except OSError:
            pass  # it has ended already

    def close(self) -> None:
        """Leaves the bus."""
        self.socket.close()

    def forget(self) -> None:
        """Drops what waits, for a connection that only sends: the host would count it as lost."""
        try:
            while self.socket.recv(_ROOM, socket.MSG_DONTWAIT):
                pass
        except OSError:
            pass  # nothing waits; whether the host is gone the next to send or receive learns

    def send(self, raw_id: int, data: bytes, length: int | None = None, timeout_s: float | None = None) -> None:
        """Sends a frame; waits for room in the host's queue for `timeout_s`, None: without end. Raises BusError, TimeoutError."""
        self._send(_FRAME.pack(raw_id, len(data) if length is None else length, bytes(data)), timeout_s)

    def join(self, name: str) -> None:
        """Joins the lockstep barrier as a controller of that name. Raises ValueError as `check_name` does."""
        self._send(_CONTROL.pack(_MAGIC, _JOIN_AS_MEMBER, 0, 0, check_name(name)))

    def done(self, cycle: int) -> None:
        """Says that all frames of the cycle are sent."""
        self._send(_CONTROL.pack(_MAGIC, _DONE, 0, cycle, b""))

    def _send(self, packet: bytes, timeout_s: float | None = None) -> None:
        try:
            if timeout_s is not None and not self._writable.poll(max(0.0, timeout_s) * 1000):
                raise TimeoutError("the bus takes no frames")
            self.socket.send(packet)
        except (BrokenPipeError, ConnectionResetError, OSError) as error:
            if isinstance(error, TimeoutError):
                raise
            raise BusError(f"the bus at {self.path} is gone: {error}") from error

    def receive(self, timeout_s: float | None = None) -> Frame | Go | None:
        """The next Frame or Go; None when none comes in `timeout_s`. Raises BusError when the host is gone, LockstepTimeout."""
        until = None
        while True:
            try:
                # Packets come in groups: most of them wait already.
                packet = self._packet()
            except BlockingIOError:
                if timeout_s is None:
                    self._poll.poll()
                    continue
                if until is None:
                    until = time.monotonic() + timeout_s
                if not self._poll.poll(max(0.0, until - time.monotonic()) * 1000):
                    return None
                continue
            if packet is not None:
                return packet

    def _packet(self) -> Frame | Go | None:
        ancillary: list[tuple[int, int, Any]] = []
        try:
            if self._stamped:
                bytes_, ancillary, _, _ = self.socket.recvmsg(_ROOM, 64, socket.MSG_DONTWAIT)
            else:
                bytes_ = self.socket.recv(_ROOM, socket.MSG_DONTWAIT)
        except BlockingIOError:
            raise
        except OSError as error:
            raise BusError(f"the bus at {self.path} is gone: {error}") from error
        if not bytes_:
            raise BusError(f"the bus at {self.path} is closed")
        if len(bytes_) == _FRAME.size:
            raw_id, length, data = _FRAME.unpack(bytes_)
            return Frame(raw_id, data if length >= 8 else data[:length], length, _stamp_s(ancillary) if self._stamped else 0.0)
        if len(bytes_) != _CONTROL.size or bytes_[:4] != _MAGIC:
            return None
        _, kind, members, cycle, name = _CONTROL.unpack(bytes_)
        if kind == _TIMED_OUT:
            raise LockstepTimeout(name.rstrip(b"\0").decode(errors="replace"))
        return Go(cycle, members) if kind == _GO else None


def _stamp_s(ancillary: list[tuple[int, int, Any]]) -> float:
    for level, kind, value in ancillary:
        if level == socket.SOL_SOCKET and kind == _SO_TIMESTAMPNS:
            seconds, nanoseconds = _TIMESPEC.unpack(value[: _TIMESPEC.size])
            return float(seconds + nanoseconds * 1e-9)
    return time.time()


def cycles(peer: Peer) -> Iterator[tuple[int, list[Frame]]]:
    """Takes part in the barrier: yields (cycle, frames) and says done when asked for the next. Ends when the host is gone.

    A peer that has joined and is not done within the time of --lockstep-timeout ends the run of all. Raises LockstepTimeout,
    and BusError for a bus without a barrier, where frames come and no cycle ends.
    """
    frames: list[Frame] = []
    while True:
        if len(frames) > _TOO_MANY:
            raise BusError(f"{len(frames)} frames and no end of a cycle: the bus at {peer.path} has no lockstep barrier")
        try:
            packet = peer.receive()
            if isinstance(packet, Frame):
                frames.append(packet)
                continue
            if packet is None:
                continue
            yield packet.cycle, frames
            frames = []
            peer.done(packet.cycle)
        except BusError:
            return
