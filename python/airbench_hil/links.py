"""How a test and its Python controllers take part in the run: as a member of the lockstep barrier, or in real time.

Both advance by cycles of 1 ms. What a cycle holds is the same in both: its sensors, and the commands that answered the one before.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import NamedTuple

from airbench_hil import peer
from airbench_hil.controllers import Answering
from airbench_hil.errors import NotAnswered
from airbench_hil.signals import Seen

CYCLE_S = 1e-3
_TICK, _TICK_BITS = 0x130, 0xFFFFFFFF
_ALIVE_SHIFT, _ALIVE_MASK = 60, 0xF
#: How often whoever waits for a cycle looks whether all programs still run, s of wall time.
_LOOK_S = 0.2


class Ended(Exception):
    """The bus has ended, and the run with it."""


class _Raised(NamedTuple):
    """What a Python controller raised."""

    error: BaseException


class Link:
    """A connection to the rig whose time advances by `advance` alone."""

    _bus: peer.Peer
    cycle: int = 0
    now_s: float = 0.0
    """The rig's time, s."""

    def advance(self) -> None:
        """One cycle further. Raises Ended."""
        raise NotImplementedError

    def catch_up(self) -> None:
        """To the newest cycle, where time goes on by itself. Raises Ended."""

    def silence(self) -> None:
        """Python controllers answer no more."""

    def send(self, raw_id: int, data: bytes) -> None:
        """Sends a frame, which acts in the next cycle. Raises Ended."""
        try:
            self._bus.send(raw_id, data)
        except peer.BusError as error:
            raise Ended(str(error)) from error

    def close(self) -> None:
        """Leaves the bus."""
        raise NotImplementedError


def _sampled(word: int, cycle: int) -> int:
    """The cycle in which sensors were sampled that came in `cycle`: their alive counter is its last four bits.

    Frames that are older than 15 cycles, as when the rig skips cycles while a fault delays them, count as a multiple of 16 too new.
    """
    return cycle - (cycle - (word >> _ALIVE_SHIFT) & _ALIVE_MASK)


class Lockstep(Link):
    """A member of the barrier, which holds the cycle until `advance`."""

    def __init__(
        self, bus: peer.Peer, seen: Seen, laws: Sequence[Answering], look: Callable[[], None], answer_s: float, join_s: float
    ) -> None:
        """Joins, and waits for the first cycle.

        :param look: raises when a program has ended that should not have.
        :param answer_s: wall time that the others have for a cycle, s.
        :param join_s: wall time that they have to join, s.
        """
        self._bus, self._seen, self._laws, self._look, self._answer_s = bus, seen, list(laws), look, answer_s
        self._began = False
        bus.join("test")
        self._until_go(join_s)

    def advance(self) -> None:
        latest = self._seen.latest
        for law in self._laws:
            sample = latest.get(law.sensors_id)
            # Only sensors that came in this cycle are answered: lost ones are not.
            if sample is not None and sample[0] == self.now_s:
                answer = law.answer(sample[1], _sampled(sample[1], self.cycle))
                if answer is not None:
                    self.send(*answer)
                    self._seen.take(answer[0], answer[1], len(answer[1]), self.now_s)
        try:
            self._bus.done(self.cycle)
        except peer.BusError as error:
            raise Ended(str(error)) from error
        self._until_go(self._answer_s)

    def _until_go(self, patience_s: float) -> None:
        seen, rigs, receive = self._seen, self._seen.names.rigs, self._bus.receive
        waited_s = 0.0
        # Frames of controllers were posted in the cycle that is over; before the first there is none.
        posted_s, next_s = self.now_s, (self.cycle + 1) * CYCLE_S if self._began else 0.0
        while True:
            try:
                packet = receive(_LOOK_S)
            except peer.BusError as error:
                raise Ended(str(error)) from error
            except peer.LockstepTimeout as late:
                raise NotAnswered(f"{late} was not done with cycle {self.cycle}") from late
            if isinstance(packet, peer.Frame):
                seen.take(packet.raw_id, packet.data, packet.length, next_s if packet.raw_id in rigs else posted_s)
            elif packet is not None:
                self.cycle, self.now_s, self._began = packet.cycle, packet.cycle * CYCLE_S, True
                return
            else:
                self._look()
                waited_s += _LOOK_S
                if waited_s >= patience_s:
                    raise NotAnswered(f"a controller has not answered cycle {self.cycle} within {patience_s:g} s of wall time")

    def silence(self) -> None:
        self._laws.clear()

    def close(self) -> None:
        self._bus.close()


class RealTime(Link):
    """A peer that keeps up with the rig in a thread, which answers for Python controllers as well."""

    def __init__(self, bus: peer.Peer, seen: Seen, laws: Sequence[Answering], look: Callable[[], None], join_s: float) -> None:
        """Waits for the rig's first tick for that time, s."""
        self._bus, self._seen, self._laws, self._look = bus, seen, {law.sensors_id: law for law in laws}, look
        self._came: deque[tuple[int, peer.Frame] | _Raised | BaseException] = deque()
        self._some = threading.Condition()
        self._known = self._silent = False
        self._newest_wall_s = time.monotonic()
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()
        until = time.monotonic() + join_s
        while not self._known:
            if time.monotonic() > until:
                raise NotAnswered(f"the rig has sent no tick within {join_s:g} s")
            self._wait(_LOOK_S)
            self._look()
            if self._came and isinstance(self._came[0], BaseException):
                raise Ended(str(self._came[0]))
        # What a controller has raised already is for the test's first call.
        while self._came and isinstance(self._came[0], tuple) and not isinstance(self._came[0], _Raised):
            self._take()

    def _read(self) -> None:
        cycle = 0
        try:
            while True:
                packet = self._bus.receive()
                if not isinstance(packet, peer.Frame):
                    continue
                word = int.from_bytes(packet.data, "little")
                if packet.raw_id == _TICK:
                    cycle, self._known = word & _TICK_BITS, True
                elif packet.raw_id in (0x120, 0x121):
                    ahead = (word >> _ALIVE_SHIFT) - cycle & _ALIVE_MASK
                    cycle += ahead if ahead < 8 else 0  # else they were delayed
                law = self._laws.get(packet.raw_id)
                answer, raised = None, None
                try:
                    answer = law.answer(word, _sampled(word, cycle)) if law and self._known else None
                except BaseException as error:  # noqa: BLE001 - it is the test's, and the rig goes on
                    raised, self._laws = _Raised(error), {}
                if answer is not None:
                    self._bus.send(*answer)
                with self._some:
                    self._came.append((cycle, packet))
                    if raised is not None:
                        self._came.append(raised)
                    if answer is not None:
                        self._came.append((cycle, peer.Frame(answer[0], answer[1], len(answer[1]))))
                    self._some.notify()
        except BaseException as error:  # noqa: BLE001 - it is the test's, an end of the bus above all
            with self._some:
                self._came.append(error)
                self._some.notify()

    def _wait(self, timeout_s: float) -> bool:
        with self._some:
            return bool(self._came) or self._some.wait(timeout_s)

    def _take(self) -> bool:
        """Takes one frame; whether a new cycle began with it."""
        came = self._came[0]
        if isinstance(came, BaseException):
            if isinstance(came, peer.BusError):
                raise Ended(str(came)) from came
            raise came
        self._came.popleft()
        if isinstance(came, _Raised):
            if self._silent:
                return False
            raise came.error
        cycle, frame = came
        new = cycle > self.cycle
        self.cycle = max(cycle, self.cycle)
        self.now_s = max(self.now_s, self.cycle * CYCLE_S)
        self._newest_wall_s = time.monotonic()
        self._seen.take(frame.raw_id, frame.data, frame.length, cycle * CYCLE_S)
        return new

    def advance(self) -> None:
        # The rest of this cycle, and the first frame of the next.
        while True:
            if not self._wait(0.02):
                # A rig that is silent has its time all the same.
                self._look()
                self.now_s = max(self.now_s, self.cycle * CYCLE_S + time.monotonic() - self._newest_wall_s)
                return
            if self._take():
                return

    def catch_up(self) -> None:
        # A controller that asks for the rig's time is in the reader's thread.
        while self._came and threading.current_thread() is not self._thread:
            self._take()

    def silence(self) -> None:
        self._laws, self._silent = {}, True

    def close(self) -> None:
        self._bus.hang_up()
        self._thread.join(5.0)
        self._bus.close()
