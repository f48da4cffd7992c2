"""An interface of python-can for the embedded bus.

    can.Bus(interface="airbench", channel="unix:///path/of/the/bus")

Without a channel it is the default bus of this user. Frames carry the kernel's stamps of their arrival.

With `member` the bus joins the lockstep barrier under that name: simulated time waits until it has read what came, so that it
loses nothing however slow it is; stamps are simulated time from 0, in seconds. A member that is silent for 5 s ends the run, so
one that does not read for a second (it starts, or is between two sessions) has what came put by, one cycle a second.
"""

from __future__ import annotations

import collections
import stat
import threading
import time
from os import stat as status_of
from typing import Any

import can

from airbench_hil import peer

_CYCLE_S = 1e-3
_PATIENCE_S = 1.0


class AirbenchBus(can.BusABC):
    """A node of the embedded bus."""

    def __init__(
        self,
        channel: str | None = None,
        can_filters: can.typechecking.CanFilters | None = None,
        receive_own_messages: bool = False,
        member: str | None = None,
        connect_timeout: float = 10.0,
        **kwargs: Any,
    ) -> None:
        """Connects to the bus at `channel`, a path or unix:///PATH.

        :param can_filters: as of every python-can bus; frames that none lets in are no messages, but are read.
        :param receive_own_messages: what it sends comes back in its place among the others', with `is_rx` False.
        :param member: a name in the lockstep barrier; such a bus has no `fileno`.
        :param connect_timeout: how long a host that is only just starting is waited for, in s.
        :raises CanInitializationError: there is no bus, or an argument cannot be meant; bit rates are the host's and are ignored.
        """
        if kwargs.get("fd"):
            raise can.CanInitializationError("the embedded bus carries classic frames only, no CAN FD")
        kwargs.pop("fd", None)
        try:
            path = peer.path_of(channel)
            self._peer = peer.Peer(path, connect_timeout)
            # Nobody hears what he sends himself; a second connection does.
            self._sender = peer.Peer(path, connect_timeout) if receive_own_messages and not member else self._peer
            if member:
                try:
                    self._peer.join(member)
                except ValueError:
                    self._peer.close()
                    raise
        except (peer.BusError, ValueError) as error:
            raise can.CanInitializationError(str(error)) from error
        self.channel_info = f"airbench {path}"
        # What was sent and has not come back: the host does not say whose a frame is.
        self._own: collections.deque[tuple[int, int, bytes]] | None = collections.deque() if receive_own_messages else None
        self._own_lock, self._sending = threading.Lock(), threading.Lock()
        self._member, self._now_s = member, 0.0
        self._pending: collections.deque[tuple[peer.Frame, bool]] = collections.deque()
        self._let_in: list[tuple[int, int, bool | None]] | None = None
        self._gone: str | None = None
        self._lock = threading.Lock()
        self._last_read = time.monotonic()
        self._can_protocol = can.CanProtocol.CAN_20
        super().__init__(channel=path, can_filters=can_filters, **kwargs)
        if member:
            threading.Thread(target=self._keep_alive, daemon=True).start()

    def fileno(self) -> int:
        """A descriptor that is readable when a frame waits; that of a member would not show frames that were put by."""
        if self._member:
            raise NotImplementedError("a member of the barrier has no descriptor to wait on")
        return self._peer.fileno()

    def _apply_filters(self, filters: can.typechecking.CanFilters | None) -> None:
        self._let_in = None if not filters else [
            (
                each["can_id"] & each["can_mask"],
                each["can_mask"],
                None if "extended" not in each else bool(each["extended"]),
            )
            for each in filters
        ]

    def _wanted(self, raw_id: int) -> bool:
        if self._let_in is None:
            return True
        extended = bool(raw_id & peer.EXTENDED)
        identifier = raw_id & (0x1FFFFFFF if extended else 0x7FF)
        return any(
            identifier & mask == wanted and (of_extended is None or of_extended == extended)
            for wanted, mask, of_extended in self._let_in
        )

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        until = None if timeout is None else time.monotonic() + timeout
        with self._lock:
            # A bus that is never silent must not keep whoever has waited long enough.
            first = True
            while first or until is None or time.monotonic() < until:
                first = False
                left = None if until is None else max(0.0, until - time.monotonic())
                frame, own = self._pending.popleft() if self._pending else self._next(left)
                self._last_read = time.monotonic()
                if frame is not None and self._wanted(frame.raw_id):
                    return self._message(frame, own), True
        return None, True

    def _next(self, timeout_s: float | None) -> tuple[peer.Frame | None, bool]:
        """The next frame and whether it is an own one; None when none comes. A cycle that is over is said to be done."""
        if self._gone:
            raise can.CanOperationError(self._gone)
        try:
            packet = self._peer.receive(timeout_s)
            if isinstance(packet, peer.Go):
                self._now_s = (packet.cycle + 1) * _CYCLE_S
                self._peer.done(packet.cycle)
                return None, False
        except peer.BusError as error:
            self._gone = str(error)
            raise can.CanOperationError(self._gone) from error
        except peer.LockstepTimeout as error:
            self._gone = f"lockstep time-out: {error} was not done"
            raise can.CanOperationError(self._gone) from error
        if packet is None:
            return None, False
        if self._member:
            return packet._replace(stamp_s=self._now_s), False
        if self._sender is not self._peer:
            self._sender.forget()
        return packet, self._is_own(packet)

    def _is_own(self, frame: peer.Frame) -> bool:
        sent = (frame.raw_id, frame.length, frame.data)
        with self._own_lock:
            if not self._own or sent not in self._own:
                return False
            # They come in the order in which they were sent; the host has dropped those before it.
            while self._own.popleft() != sent:
                pass
        return True

    def _keep_alive(self) -> None:
        """Reads up to the end of a cycle whenever nobody has read for a while."""
        while not self._is_shutdown and not self._gone:
            time.sleep(_PATIENCE_S / 4)
            with self._lock:
                if time.monotonic() - self._last_read < _PATIENCE_S:
                    continue
                try:
                    while (came := self._next(0.0))[0] is not None:
                        self._pending.append((came[0], came[1]))
                except can.CanOperationError:
                    return
                self._last_read = time.monotonic()

    def _message(self, frame: peer.Frame, own: bool) -> can.Message:
        remote = bool(frame.raw_id & peer.REMOTE)
        extended = bool(frame.raw_id & peer.EXTENDED)
        return can.Message(
            timestamp=frame.stamp_s,
            arbitration_id=frame.raw_id & (0x1FFFFFFF if extended or frame.raw_id & peer.ERROR else 0x7FF),
            is_extended_id=extended,
            is_remote_frame=remote,
            is_error_frame=bool(frame.raw_id & peer.ERROR),
            is_rx=not own,
            channel=self._peer.path,
            dlc=frame.length,
            data=None if remote else frame.data,
        )

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Sends a message; waits for room in the host's queue for `timeout`, without end if None.

        :raises CanOperationError: the bus is gone, the time is over, or the message is one of CAN FD.
        """
        if msg.is_fd:
            raise can.CanOperationError("the embedded bus carries classic frames only, no CAN FD")
        raw_id = msg.arbitration_id
        raw_id |= msg.is_extended_id * peer.EXTENDED | msg.is_remote_frame * peer.REMOTE | msg.is_error_frame * peer.ERROR
        data = b"" if msg.is_remote_frame else bytes(msg.data)
        own = peer.Frame(raw_id, data.ljust(min(msg.dlc, 8), b"\0"), msg.dlc, self._now_s)
        comes_back = None if self._member else self._own
        with self._sending:
            if comes_back is not None:
                # Before it goes: the one who reads may be faster.
                with self._own_lock:
                    comes_back.append((own.raw_id, own.length, own.data))
            try:
                self._sender.send(raw_id, data, msg.dlc, timeout)
            except (peer.BusError, TimeoutError) as error:
                if comes_back is not None:
                    with self._own_lock:
                        comes_back.pop()
                raise can.CanOperationError(str(error)) from error
            if self._own is not None and self._member:
                # In the barrier a second connection would be a second controller.
                self._pending.append((own, True))

    def shutdown(self) -> None:
        """Leaves the bus; to do so twice does nothing."""
        if self._is_shutdown:
            return
        super().shutdown()
        # Whoever waits for a frame without end has the lock until then.
        self._peer.hang_up()
        with self._lock:
            self._peer.close()
            self._sender.close()

    @property
    def state(self) -> can.BusState:
        """Always active: this bus has no error counters of its own. It cannot be set."""
        return can.BusState.ACTIVE

    @state.setter
    def state(self, new_state: can.BusState) -> None:
        raise NotImplementedError("the embedded bus has no states")

    @staticmethod
    def _detect_available_configs() -> list[can.typechecking.AutoDetectedConfig]:
        path = peer.default_path()
        try:
            there = stat.S_ISSOCK(status_of(path).st_mode)
        except OSError:
            there = False
        return [{"interface": "airbench", "channel": path}] if there else []
