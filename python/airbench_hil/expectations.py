"""What a test says of signals over the rig's time: read, wait_for, expect, never, always, stable_for, run_for."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn, Union

import can

from airbench_hil import picture
from airbench_hil.conditions import Condition, Watch, parse, seconds
from airbench_hil.errors import ExpectationFailed, RigEnded
from airbench_hil.signals import Names, Seen, Signal

if TYPE_CHECKING:
    from airbench_hil.rig import Rig

#: Text of conditions.py, or a function of the rig, asked once a cycle.
Test = Union[str, Callable[["Rig"], bool]]
Duration = Union[str, float]
#: The seconds that a failed expectation shows.
_SHOWN_S = 2.0
#: Half a cycle: the end of a window is compared with times that are multiples of 1 ms.
_HALF_S = 0.5e-3


class _Band:
    """The longest course of a signal up to now that stays within a tolerance peak to peak."""

    def __init__(self, tolerance: float) -> None:
        self._tolerance = tolerance
        self._times: deque[float] = deque()
        # Times and values, the first of them the least and the most of the course; each is followed by those that replace it.
        self._least: deque[tuple[float, float]] = deque()
        self._most: deque[tuple[float, float]] = deque()

    def take(self, time_s: float, value: float | None) -> float | None:
        """Since when the course goes, s; None without a value."""
        if value is None:
            return None
        self._times.append(time_s)
        while self._least and self._least[-1][1] >= value:
            self._least.pop()
        while self._most and self._most[-1][1] <= value:
            self._most.pop()
        self._least.append((time_s, value))
        self._most.append((time_s, value))
        while self._most[0][1] - self._least[0][1] > self._tolerance:
            begun_s = self._times.popleft()
            for extremes in (self._least, self._most):
                if extremes[0][0] <= begun_s:
                    extremes.popleft()
        return self._times[0]


class Expectations:
    """The part of `Rig` that looks at signals. Durations are seconds or text such as "4 s", "250 ms"; all are the rig's time."""

    names: Names
    seen: Seen
    folder: Path
    failures: list[AssertionError]

    @property
    def _now_s(self) -> float:
        """The rig's time in the cycle that is looked at, s; `time` goes on to the newest one."""
        raise NotImplementedError

    def _advance(self) -> None:
        raise NotImplementedError

    def _catch_up(self) -> None:
        raise NotImplementedError

    def read(self, signal: str) -> float:
        """The newest value of `Message.signal` in its unit of rig.dbc.

        :raises NotSeen: its frame has not come yet.
        """
        self._catch_up()
        return self.seen.read(self.names.signal(signal))

    def state(self, signal: str) -> str:
        """The newest value of a signal with a value table, as its word: state("DriveChainStatus.main_chain") == "experiment".

        :raises NotSeen: its frame has not come yet.
        """
        self._catch_up()
        found = self.names.signal(signal)
        return found.shown(self.seen.read(found))

    def message(self, name: str) -> can.Message:
        """The newest frame of that name, as python-can has it; stamped with the rig's time, s.

        :raises NotSeen: none has come yet.
        """
        self._catch_up()
        return self.seen.message(name)

    def messages(self, name: str | None = None, last: Duration = "2 s") -> list[can.Message]:
        """Frames of that name, or all, of the last seconds, 20 at most, as python-can has them; stamped with the rig's time, s."""
        self._catch_up()
        return self.seen.messages(name, self._now_s - seconds(last), self._now_s)

    def course(self, signal: str, last: Duration = "2 s") -> list[tuple[float, float]]:
        """Times, s, and values of a signal over the last seconds, 20 at most."""
        self._catch_up()
        return self.seen.course(self.names.signal(signal), self._now_s - seconds(last), self._now_s)

    def run_for(self, duration: Duration) -> None:
        """Lets the rig run for that time. Raises RigEnded when the run ends before."""
        self._catch_up()
        until_s = self._now_s + seconds(duration) - _HALF_S
        while self._now_s < until_s:
            self._advance()

    def run_until(self, time_s: Duration) -> None:
        """Lets the rig run until that time of its own."""
        self._catch_up()
        self.run_for(max(0.0, seconds(time_s) - self._now_s))

    def expect(self, test: Test, within: Duration = 0.0) -> float:
        """Waits until the condition holds, and gives the rig's time then, s; without `within` it has to hold now.

        :raises ExpectationFailed: it did not hold within that time.
        """
        watch, began_s = self._watch(test), self._now_s
        until_s = began_s + seconds(within) - _HALF_S
        try:
            while not watch():
                if self._now_s >= until_s:
                    self._fail(f"expected within {seconds(within):g} s: {_text(test)}", test, began_s, "it did not hold")
                self._advance()
        except RigEnded as ended:
            self._fail(f"expected within {seconds(within):g} s: {_text(test)}", test, began_s, f"it did not hold; {ended}")
        return self._now_s

    def wait_for(self, test: Test, timeout: Duration = "60 s") -> float:
        """As `expect`, for what a test only needs to go on: a state of the rig, a phase of the experiment."""
        return self.expect(test, within=timeout)

    def never(self, test: Test, during: Duration) -> None:
        """Lets the rig run for that time, in which the condition must not hold, now included.

        :raises ExpectationFailed: it did, or the run ended before.
        """
        self._hold(test, seconds(during), wanted=False, what="never")

    def always(self, test: Test, during: Duration) -> None:
        """Lets the rig run for that time, in which the condition has to hold all the time, now included.

        :raises ExpectationFailed: it did not, or the run ended before.
        """
        self._hold(test, seconds(during), wanted=True, what="always")

    def _hold(self, test: Test, during_s: float, wanted: bool, what: str) -> None:
        watch, began_s = self._watch(test), self._now_s
        until_s = began_s + during_s - _HALF_S
        title = f"expected {what} for {during_s:g} s: {_text(test)}"
        try:
            while True:
                if watch() != wanted:
                    self._fail(title, test, began_s, "it did not hold" if wanted else "it held")
                if self._now_s >= until_s:
                    return
                self._advance()
        except RigEnded as ended:
            self._fail(title, test, began_s, str(ended))

    def stable_for(
        self, what: Test, duration: Duration, *, tolerance: float | None = None, within: Duration = "60 s"
    ) -> float:
        """Waits until a condition has held, or a signal has stayed within `tolerance` peak to peak, for `duration` without a break.

        :param what: a condition; or the name of a signal, with `tolerance` in its unit.
        :param within: time for all of it.
        :returns: the rig's time at which the stable part began, s.
        :raises ExpectationFailed: there was no such part.
        """
        wanted_s, since = seconds(duration), self._steady(what, tolerance)
        began_s = self._now_s
        until_s = began_s + seconds(within) - _HALF_S
        title = f"expected within {seconds(within):g} s, stable for {wanted_s:g} s: {_text(what)}"
        title += f" within {tolerance:g} peak to peak" if tolerance is not None else ""
        try:
            while True:
                since_s = since()
                if since_s is not None and self._now_s - since_s >= wanted_s - _HALF_S:
                    return since_s
                if self._now_s >= until_s:
                    self._fail(title, what, began_s, "it did not stay so")
                self._advance()
        except RigEnded as ended:
            self._fail(title, what, began_s, str(ended))

    def _steady(self, what: Test, tolerance: float | None) -> Callable[[], float | None]:
        """Since when it has been so without a break, s; None: it is not now. To be asked once a cycle."""
        if tolerance is None:
            watch, began = self._watch(what), deque[float](maxlen=1)

            def held() -> float | None:
                if not watch():
                    began.clear()
                elif not began:
                    began.append(self._now_s)
                return began[0] if began else None

            return held
        if not isinstance(what, str) or not tolerance >= 0:
            raise ValueError("a tolerance is for a signal by its name, 0 or more in its unit")
        signal, band = self.names.signal(what), _Band(tolerance)
        self._catch_up()
        return lambda: band.take(self._now_s, self.seen.value(signal))

    def _watch(self, test: Test) -> Callable[[], bool]:
        self._catch_up()
        if callable(test):
            return lambda: bool(test(self))  # type: ignore[arg-type]
        watch: Watch = self._condition(test).watch(self.seen, lambda: self._now_s)
        return watch.holds

    def _condition(self, text: str) -> Condition:
        return parse(text, self.names)

    def _fail(self, title: str, test: Test, began_s: float, why: str) -> NoReturn:
        signals: list[Signal] = []
        if isinstance(test, str):
            signals = [self.names.signal(test)] if test in self.names.signals else self._condition(test).signals
        failure = self.failure(title, why, signals, began_s)
        self.failures.append(failure)
        raise failure

    def failure(self, title: str, why: str, signals: Sequence[Signal], began_s: float) -> ExpectationFailed:
        """An exception as a failed expectation raises it: the text, the last seconds of the signals, a picture, the folder."""
        to_s = self._now_s
        from_s = max(0.0, to_s - _SHOWN_S)
        ranges = []
        for signal in signals:
            values = [value for _, value in self.seen.course(signal, began_s, to_s)]
            if values and signal.choices:
                words = dict.fromkeys(signal.shown(value) for value in values)
                ranges.append(f"{signal.title}: {', '.join(words)} in that time")
            elif values:
                ranges.append(f"{signal.title}: from {signal.shown(min(values))} to {signal.shown(max(values))} in that time")
            else:
                ranges.append(f"{signal.title}: no such frame came in that time")
        drawing = picture.svg(self.seen, signals, max(0.0, min(began_s, to_s - _SHOWN_S)), to_s, title)
        path = picture.write(self.folder, drawing)
        parts = [
            title, f"{why}; looked at from {began_s:.3f} s to {to_s:.3f} s of the rig's time", *ranges,
            picture.table(self.seen, signals, from_s, to_s), f"run folder: {self.folder}", f"picture: {path}" if path else "",
        ]
        return ExpectationFailed("\n".join(part for part in parts if part), self.folder, path)


def _text(test: Test) -> str:
    return test if isinstance(test, str) else getattr(test, "__name__", repr(test))
