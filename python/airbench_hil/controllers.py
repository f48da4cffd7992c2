"""What controls the rig in a test: airbench's own controller, a foreign program, an ELF, or a Python function."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple, Union

from airbench_hil import programs
from airbench_hil.signals import Names

if TYPE_CHECKING:
    from airbench_hil.rig import Rig

Axis = Literal["drive", "load"]
StrPath = Union[str, "os.PathLike[str]"]


class Sensors(NamedTuple):
    """The sensors of one axis in one cycle."""

    cycle: int
    """Number of the cycle; a cycle has 1 ms."""
    position: float
    """m, in rig coordinates for both axes."""
    force: float
    """N, between rod and carriage, compression positive."""
    pressure_a: float
    """Pa absolute, chamber on the cap side."""
    pressure_b: float
    """Pa absolute, chamber on the rod side."""

    @property
    def time(self) -> float:
        """The rig's time at which they were sampled, s."""
        return self.cycle * 1e-3


#: From sensors to the valve's opening, -1 to 1, positive extends the rod; None: no command in this cycle.
Law = Callable[[Sensors], Union[float, None]]


class Started(NamedTuple):
    """A program that is to be started."""

    name: str
    words: list[str]
    env: dict[str, str] | None = None
    cwd: Path | None = None
    guest: bool = False
    """It runs under `bench can`."""


@dataclass(frozen=True)
class Own:
    """airbench's own controller, `controller run`."""

    program: StrPath | None = None
    """Axis program of the drive, by its name ("position-p") or file; None: the experiment's."""
    load: StrPath | None = None
    """Axis program of the load axis; None: the experiment's."""
    axis: Literal["drive", "load", "both"] = "both"
    two: bool = False
    """A process for each axis, "controller-drive" and "controller-load", in place of one, "controller"."""
    set: Mapping[str, float] = field(default_factory=dict)
    """Variables in place of the programs', such as {"drive.algorithm.gain_per_s": 30}."""
    after_emergency_stop: Literal["end", "restart", "on-start"] | None = None
    """In place of the experiment's."""
    repeat: bool = False
    """Repeat the experiment until the rig ends; never done."""
    options: Sequence[str] = ()
    """More options of `controller run`."""

    members = property(lambda self: 2 if self.two else 1)
    echo: None = field(default=None, init=False)
    says_done = property(lambda self: not self.repeat)

    def programs(self, rig: Rig) -> list[Started]:
        """What is started. Raises ValueError without an experiment, or for a program that is not there."""
        if rig.experiment_file is None:
            raise ValueError("Own runs an experiment: Rig(experiment=\"point-to-point\", …)")
        words = [str(rig.program("controller")), "run", "--rig", str(rig.rig_file), "--experiment", str(rig.experiment_file)]
        words += ["--programs", str(programs.file("programs")), "--out", str(rig.folder), "--bus", rig.url, "--pace", rig.pace]
        if self.program is not None:
            words += ["--drive-program", str(programs.axis_program(self.program))]
        if self.load is not None:
            words += ["--load-program", str(programs.axis_program(self.load))]
        for variable, value in self.set.items():
            words += ["--set", f"{variable}={value}"]
        if self.after_emergency_stop:
            words += ["--after-emergency-stop", self.after_emergency_stop]
        if self.repeat:
            words.append("--repeat")
        if rig.pace == "lockstep":
            # A test may stand in a debugger, and time with it.
            words += ["--bus-grace", "86400"]
        words += self.options
        if not self.two:
            return [Started("controller", [*words, "--axis", self.axis])]
        return [Started(f"controller-{axis}", [*words, "--axis", axis]) for axis in ("drive", "load")]


@dataclass(frozen=True)
class Process:
    """A foreign program on the bus.

    In lockstep it takes part by its echo, as docs/firmware.md says, unless it joins the barrier by itself.
    """

    command: str | Sequence[str]
    """Its words; `{url}`, `{path}`, `{python}` and `{folder}` stand for the bus (unix:///PATH, PATH), this Python, the run's folder."""
    can: bool = False
    """Run it under `bench can`: any SocketCAN program, which sees the bus as vcan0."""
    axis: Axis = "drive"
    """Whose commands it sends; in lockstep its echo in them says that a cycle is answered."""
    joins: bool = False
    """It joins the barrier by itself, as scripts/mcu or can.Bus(member=…) do."""
    name: str = "process"
    env: Mapping[str, str] | None = None
    cwd: StrPath | None = None
    says_done: bool = False
    """It sends ChainStatus with `done` when its experiment is over, which ends the run."""

    members = property(lambda self: 1 if self.joins else 0)
    echo = property(lambda self: None if self.joins else self.axis)

    def programs(self, rig: Rig) -> list[Started]:
        """What is started."""
        words = shlex.split(self.command) if isinstance(self.command, str) else [str(word) for word in self.command]
        stands_for = {"{url}": rig.url, "{path}": str(rig.bus_path), "{python}": sys.executable, "{folder}": str(rig.folder)}
        for key, value in stands_for.items():
            words = [word.replace(key, value) for word in words]
        if self.can:
            words = [str(rig.program("bench")), "can", "--bus", rig.url, "--", *words]
        env = {**os.environ, **self.env} if self.env else None
        return [Started(self.name, words, env, Path(self.cwd) if self.cwd else None, self.can)]


@dataclass(frozen=True)
class Elf:
    """The ELF of a microcontroller in an emulator of the chip, in lockstep (docs/elf.md); needs airbench-hil[mcu]."""

    path: StrPath
    chip: str = "stm32f103"
    gdb: int | None = None
    """Wait for GDB on this port of 127.0.0.1 at reset; the port is in NAME.err of the run's folder."""
    says_done: bool = False
    """As of Process."""
    name: str = "mcu"

    members: int = field(default=1, init=False)
    echo: None = field(default=None, init=False)

    def programs(self, rig: Rig) -> list[Started]:
        """What is started. Raises ValueError in real time, which it does not have."""
        if rig.pace != "lockstep":
            raise ValueError("an ELF runs in lockstep only: Rig(pace=\"lockstep\", …)")
        words = [sys.executable, "-m", "airbench_hil.mcu", "--elf", str(self.path), "--chip", self.chip, "--bus", rig.url]
        words += ["--name", self.name, "--report", str(rig.folder / f"{self.name}.json")]
        if self.gdb is not None:
            words += ["--gdb", str(self.gdb)]
        path = os.pathsep.join([str(programs.PACKAGE.parent), os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)
        return [Started(self.name, words, {**os.environ, "PYTHONPATH": path})]


@dataclass(frozen=True)
class Python:
    """A function from sensors to opening. In lockstep it is called in the test's own thread, in real time in another."""

    law: Law
    axis: Axis = "drive"

    members: int = field(default=0, init=False)
    echo: None = field(default=None, init=False)
    says_done: bool = field(default=False, init=False)

    def programs(self, _: Rig) -> list[Started]:
        """Nothing is started."""
        return []


Controller = Union[Own, Process, Elf, Python]


class Answering:
    """A `Python` controller on its bus: sensors in, command out."""

    def __init__(self, controller: Python, names: Names) -> None:
        prefix = controller.axis.capitalize()
        self._law, self._names, self._command = controller.law, names, f"{prefix}ValveCommand"
        self._parts = [names.signal(f"{prefix}Sensors.{part}") for part in ("position", "force", "pressure_a", "pressure_b")]
        self.sensors_id = self._parts[0].frame_id
        self._alive = 0

    def answer(self, word: int, cycle: int) -> tuple[int, bytes] | None:
        """The command to the sensors in `word`, a frame's data.

        :raises ValueError: the opening is no number from -1 to 1.
        """
        opening = self._law(Sensors(cycle, *(part.of(word) for part in self._parts)))
        if opening is None:
            return None
        try:
            allowed = bool(-1.0 <= opening <= 1.0)  # a NaN lies in no range
        except (TypeError, ValueError):  # a text; an array of several numbers
            allowed = False
        if not allowed:
            raise ValueError(f"cycle {cycle}: the controller gave an opening of {opening!r}; numbers from -1 to 1 are allowed, or None")
        self._alive = (self._alive + 1) % 16
        values = {"opening": float(opening), "alive": self._alive, "echo": cycle % 4096, "enable": 1}
        return self._names.encoded(self._command, values)
