"""What people do at the rig, by name: frames of the console and the bench, and the rig's own console."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

import can

from airbench_hil import console, faults
from airbench_hil.controllers import Axis
from airbench_hil.signals import Names


class People:
    """The part of `Rig` that acts. What is done in a cycle acts in the next one, in lockstep in a definite one."""

    names: Names
    _telemetry: Path

    def _init_people(self) -> None:
        self._hands = {"carriage": 0.0, "load_eye": 0.0}

    def _check_runs(self) -> None:
        raise NotImplementedError

    def _send(self, raw_id: int, data: bytes) -> None:
        raise NotImplementedError

    def send(self, what: can.Message | str, **signals: float | str | bool) -> None:
        """Sends a frame: a message of python-can, or a name of rig.dbc with its signals in their units; others are 0, `crc` is computed.

        :raises ValueError: a signal that the message does not have, or a value out of its range.
        """
        if isinstance(what, can.Message):
            if what.is_fd:
                raise ValueError("the embedded bus carries classic frames only, no CAN FD")
            flags = what.is_extended_id * 0x80000000 | what.is_remote_frame * 0x40000000 | what.is_error_frame * 0x20000000
            self._send(what.arbitration_id | flags, bytes(what.data))
        else:
            self._send(*self.names.encoded(what, dict(signals)))

    def console(self, line: str) -> str:
        """Gives the rig's console a line (`help` lists them), and what it answers; it acts in the next cycle, one line a cycle.

        :raises Refused: it does not obey.
        """
        self._check_runs()
        return console.command(self._telemetry, line)

    def emergency_stop(self, by: Literal["console", "rig"] = "console") -> None:
        """Trips the emergency stop: the operator's console on the bus, or the rig's own button."""
        if by == "rig":
            self.console("stop")
        else:
            self.send("ConsoleEmergencyStop", reason="operator")

    def release(self, by: Literal["console", "rig"] = "console") -> None:
        """Withdraws the stop of that sender; the rig recovers when every sender has. A controller whose cause lasts does not."""
        if by == "rig":
            self.console("release")
        else:
            self.send("ConsoleEmergencyStop", reason="none", release=1)

    def start_experiment(self, number: int = 0) -> None:
        """Asks the controllers to start, RunControl: after an emergency stop with `after_emergency_stop="on-start"`."""
        self.send("RunControl", command="start", experiment=number)

    def abort(self) -> None:
        """Asks the controllers to end the run without an emergency stop, RunControl."""
        self.send("RunControl", command="abort")

    def hand(self, on: Literal["carriage", "load_eye"], force: float) -> None:
        """A hand pushes in +x with that force, N, until it is told otherwise; 0 lets go.

        :raises ValueError: no such part, or a force beyond ±2000 N.
        """
        if on not in self._hands:
            raise ValueError(f"hand on '{on}': carriage or load_eye")
        self.send("HandForce", **(self._hands | {on: force}))
        self._hands[on] = force

    def let_go(self) -> None:
        """Both hands."""
        self._hands = dict.fromkeys(self._hands, 0.0)
        self.send("HandForce")

    def hand_set_point(self, axis: Axis, position: float = 0.0, force: float = 0.0) -> None:
        """Where an axis shall go, m, or how hard it shall press, N, by hand: in experiments that allow it (by-hand)."""
        self.send("HandSetPoint", axis=axis, position=position, force=force)

    def link(self) -> None:
        """Links the load's eye and the carriage; refused by the rig outside the gap, which RigStatus.linked shows."""
        self.send("Link", request="link")

    def unlink(self) -> None:
        """Parts them."""
        self.send("Link", request="unlink")

    def weights(self, mass: float) -> None:
        """Puts weights on the carriage, kg in all.

        :raises ValueError: not from 0 to 20 kg.
        """
        self.send("Weights", added_mass=mass)

    def fault(self, name: str, at: str | None = None, **numbers: float) -> None:
        """Breaks something from the next cycle on, as `emulator faults` lists it: fault("position-sensor-offset", "drive", offset_m=0.01).

        :raises Refused: no such fault, place or number; the text says what is allowed.
        """
        words = [name, *([at] if at else []), *(f"{key}={faults.number(value)}" for key, value in numbers.items())]
        self.console("fault " + " ".join(words))

    def mend(self, name: str, at: str | None = None) -> None:
        """Mends it, whatever its numbers; "all" mends everything. Raises Refused."""
        self.console(" ".join(["mend", name, *([at] if at else [])]))

    @contextmanager
    def broken(self, name: str, at: str | None = None, **numbers: float) -> Iterator[None]:
        """As `fault`, and mended at the end of the block."""
        self.fault(name, at, **numbers)
        yield
        self.mend(name, at)
