"""The rig for Robot Framework: keywords thinly on `airbench_hil.Rig` (docs/robot.md).

    *** Settings ***
    Library    airbench_hil.robot.Airbench
"""

from __future__ import annotations

import runpy
from collections.abc import Callable, Mapping
from html import escape
from pathlib import Path
from typing import Any, Literal, TypeVar

from airbench_hil.controllers import Elf, Own, Process, Python
from airbench_hil.errors import AirbenchError, ExpectationFailed
from airbench_hil.faults import Fault
from airbench_hil.rig import Pace, Rig
from airbench_hil.run import Run

try:
    from robot.api import logger
    from robot.api.deco import keyword, library
    from robot.libraries.BuiltIn import BuiltIn, RobotNotRunningError
except ImportError as missing:
    raise ImportError(f"{missing}: pip install 'airbench-hil[robot]'") from missing

Axis = Literal["drive", "load"]
_Answer = TypeVar("_Answer")


@library(scope="SUITE", listener="SELF", doc_format="ROBOT", version="0.1.0")  # type: ignore[untyped-decorator, unused-ignore]
class Airbench:
    """The emulated servo-pneumatic rig of airbench, with what controls it, in a test.

    A test makes a controller, starts a rig with it, expects, breaks things, and finishes the run:

    | ${own} =    `Own Controller`    position-p
    | `Start Rig`    point-to-point    ${own}
    | `Expect`    DriveSensors.position > 0.39    within=4 s
    | `Finish Run`
    | `Figure Should Be At Most`    position_error_dynamic_m    0.004

    Time is the rig's. In lockstep, the default, it advances inside `Expect`, `Wait For`, `Never`, `Always`, `Stable For`, `Run For`,
    `Run Until`, `Finish Run` and `End Run` alone, and two runs of a test leave the same bytes. A duration is text such as ``4 s``, ``250 ms``
    or ``2 min``, or seconds.

    Signals are ``Message.signal`` of rig.dbc in its SI units; conditions are expressions of them, as in
    ``0.1 < LoadSensors.position < 0.2 and DriveChainStatus.main_chain == "experiment"``.

    A rig that a test has started ends with the test, one of a suite set-up with the suite, whatever happens. A failed expectation shows the
    last seconds of its signals as text and picture, and names the run's folder.
    """

    def __init__(self, pace: Literal["lockstep", "real"] = "lockstep", runs: str | None = None, binaries: str | None = None) -> None:
        """`pace` of rigs that give none: ``lockstep`` or ``real``. `runs`: where run folders go, in place of ``runs`` in Robot's output
        folder. `binaries`: folder of airbench's programs.
        """
        self._pace: Pace = pace
        self._runs, self._binaries = runs, binaries
        self._rig: Rig | None = None
        self._run: Run | None = None
        self._place, self._of_test = "suite", False

    # Controllers.

    @keyword
    def own_controller(
        self, program: str | None = None, load: str | None = None, two: bool = False, repeat: bool = False,
        after_emergency_stop: Literal["end", "restart", "on-start"] | None = None, **variables: float,
    ) -> Own:
        """airbench's own controller, with the axis program `program` of the drive and `load` of the load axis, else the experiment's.

        `two`: a process for each axis. `repeat`: the experiment again until the rig ends. Free arguments are variables in place of the
        programs', such as ``drive.algorithm.gain_per_s=30``.
        """
        return Own(program, load, two=two, repeat=repeat, after_emergency_stop=after_emergency_stop, set=variables)

    @keyword
    def process_controller(
        self, command: str, axis: Axis = "drive", can: bool = False, joins: bool = False, name: str = "process", says_done: bool = False
    ) -> Process:
        """A foreign program on the bus, such as ``./firmware {path}``; ``{path}``, ``{url}``, ``{python}``, ``{folder}`` are replaced.

        `can`: under ``bench can``, as any SocketCAN program. `axis`: whose commands it sends; in lockstep their echo says that a cycle is answered.
        `joins`: it joins the barrier by itself. `says_done`: it ends the run by a chain status.
        """
        return Process(command, can=can, axis=axis, joins=joins, name=name, says_done=says_done)

    @keyword
    def elf_controller(self, path: str, chip: str = "stm32f103", says_done: bool = False) -> Elf:
        """The ELF of a microcontroller in an emulator of its chip, in lockstep; needs airbench-hil[mcu]."""
        return Elf(path, chip, says_done=says_done)

    @keyword
    def python_controller(self, file: str, function: str = "controller", axis: Axis = "drive") -> Python:
        """A function of a Python file: from the sensors of an axis to the opening of its valve, -1 to 1."""
        return Python(runpy.run_path(file)[function], axis)

    # Beginning and end.

    @keyword
    def planned_fault(
        self, name: str, at: str | None = None, from_s: float | None = None, to_s: float | None = None, for_s: float | None = None,
        when: str | None = None, above: float | None = None, below: float | None = None, **numbers: float,
    ) -> Fault:
        """A fault for `Start Rig`, by time (s) or by a true value of the rig; free arguments are its numbers, such as ``offset_m=0.01``."""
        return Fault(name, at, from_s, to_s, for_s, when, above, below, numbers)

    @keyword
    def start_rig(
        self, experiment: str | None = None, controllers: Any = None, faults: Any = (), seconds: float | None = None,
        seed: int = 1, pace: Pace | None = None, rig_file: str | None = None, bus_options: str = "", **setup: float | str,
    ) -> Rig:
        """Starts a rig, which controllers drive, and waits for its first cycle; a rig before it is ended.

        `experiment`: name or file; none: the rig alone. `controllers`: one, or a list. `faults`: one of `Planned Fault`, a list, or a script's
        file. `seconds`: end after that time. `seed`: of the noise. Free arguments replace keys of the experiment's ``[rig]``, as in
        ``carriage_position_m=0.15``.
        """
        self._end()
        planned = [faults] if isinstance(faults, Fault) else faults
        asked: Pace = pace or self._pace
        rig = Rig(
            experiment, pace=asked, controller=controllers, faults=planned, setup=_values(setup), seconds=seconds, seed=seed,
            rig_file=rig_file, bus_options=bus_options, out=self._folder(), binaries=self._binaries,
        )
        self._rig, self._run, self._of_test = rig, None, self._place != "suite"
        rig.start()
        return rig

    @keyword
    def finish_run(self, within: str = "1000 s") -> Run:
        """Runs to the end of the experiment, or to `seconds` of `Start Rig`, and gives the run; see `Figure`."""
        return self._over(self._present().finish(within))

    @keyword
    def end_run(self) -> Run:
        """Ends the run now, with everything saved, and gives it; see `Figure`."""
        return self._over(self._present().end())

    # What is expected.

    @keyword
    def expect(self, condition: str, within: str = "0 s") -> float:
        """Waits until the condition holds, and gives the rig's time then, s; without `within` it has to hold now."""
        return self._asked(lambda rig: rig.expect(condition, within=within))

    @keyword
    def wait_for(self, condition: str, timeout: str = "60 s") -> float:
        """As `Expect`, for what a test only needs to go on."""
        return self._asked(lambda rig: rig.wait_for(condition, timeout=timeout))

    @keyword
    def never(self, condition: str, during: str) -> None:
        """Lets the rig run for that time, in which the condition must not hold."""
        self._asked(lambda rig: rig.never(condition, during=during))

    @keyword
    def always(self, condition: str, during: str) -> None:
        """Lets the rig run for that time, in which the condition has to hold all the time."""
        self._asked(lambda rig: rig.always(condition, during=during))

    @keyword
    def stable_for(self, what: str, duration: str, tolerance: float | None = None, within: str = "60 s") -> float:
        """Waits until a condition has held, or a signal has stayed within `tolerance` (its unit) peak to peak, for `duration`.

        Gives the rig's time at which that part began, s.
        """
        return self._asked(lambda rig: rig.stable_for(what, duration, tolerance=tolerance, within=within))

    @keyword
    def run_for(self, duration: str) -> None:
        """Lets the rig run for that time."""
        self._present().run_for(duration)

    @keyword
    def run_until(self, time: str) -> None:
        """Lets the rig run until that time of its own."""
        self._present().run_until(time)

    @keyword
    def rig_time(self) -> float:
        """The rig's time, s."""
        return self._present().time

    @keyword
    def read_signal(self, signal: str) -> float:
        """The newest value of ``Message.signal``, in its unit of rig.dbc."""
        return self._present().read(signal)

    @keyword
    def read_state(self, signal: str) -> str:
        """The newest value of a signal with a value table, as its word."""
        return self._present().state(signal)

    # What is done to the rig: it acts from the next cycle on.

    @keyword
    def fault(self, name: str, at: str | None = None, **numbers: float) -> None:
        """Breaks something, as ``emulator faults`` lists it: ``position-sensor-offset`` at ``drive`` with ``offset_m=0.01``."""
        self._present().fault(name, at, **numbers)

    @keyword
    def mend(self, name: str, at: str | None = None) -> None:
        """Mends it; ``all`` mends everything."""
        self._present().mend(name, at)

    @keyword
    def emergency_stop(self, by: Literal["console", "rig"] = "console") -> None:
        """Trips the emergency stop: the operator's console on the bus, or the rig's own button."""
        self._present().emergency_stop(by)

    @keyword
    def release_emergency_stop(self, by: Literal["console", "rig"] = "console") -> None:
        """Withdraws the stop of that sender; the rig recovers when every sender has."""
        self._present().release(by)

    @keyword
    def start_experiment(self, number: int = 0) -> None:
        """Asks the controllers to start, as after an emergency stop with ``after_emergency_stop=on-start``."""
        self._present().start_experiment(number)

    @keyword
    def abort_experiment(self) -> None:
        """Asks the controllers to end the run without an emergency stop."""
        self._present().abort()

    @keyword
    def push_by_hand(self, on: Literal["carriage", "load_eye"], force: float) -> None:
        """A hand pushes in +x with that force, N; 0 lets go."""
        self._present().hand(on, force)

    @keyword
    def link_rods(self) -> None:
        """Links the load's eye and the carriage; the rig refuses outside the gap, which RigStatus.linked shows."""
        self._present().link()

    @keyword
    def unlink_rods(self) -> None:
        """Parts them."""
        self._present().unlink()

    @keyword
    def put_weights(self, mass: float) -> None:
        """Puts weights on the carriage, kg in all, 0 to 20."""
        self._present().weights(mass)

    @keyword
    def set_point_by_hand(self, axis: Axis, position: float = 0.0, force: float = 0.0) -> None:
        """Where an axis shall go, m, or how hard it shall press, N, in experiments that allow it (by-hand)."""
        self._present().hand_set_point(axis, position, force)

    @keyword
    def send_frame(self, message: str, **signals: float | str) -> None:
        """Sends a message of rig.dbc with its signals in their units; others are 0, the checksum is computed."""
        self._present().send(message, **_values(signals))

    @keyword
    def console(self, line: str) -> str:
        """Gives the rig's console a line, and gives what it answers; ``help`` lists them."""
        return self._present().console(line)

    @keyword
    def kill_program(self, name: str) -> None:
        """Ends a program (``controller``, ``process``, …) as a crash would: that it ended is no error then."""
        self._present().kill(name)

    # The run.

    @keyword
    def figure(self, name: str) -> float:
        """A figure of the finished run, SI, as ``bench figures`` explains them; the unit is in the name."""
        figures = self._finished().figures
        if name not in figures:
            raise AirbenchError(f"the run has no figure '{name}'; it has {', '.join(sorted(figures))}")
        return figures[name]

    @keyword
    def figure_should_be_at_most(self, name: str, most: float) -> None:
        """Fails if the figure of the finished run is larger."""
        if not (value := self.figure(name)) <= most:
            raise AssertionError(f"{name} is {value:.6g}, at most {most:.6g} is allowed; run folder: {self._finished().folder}")

    @keyword
    def figure_should_be_at_least(self, name: str, least: float) -> None:
        """Fails if the figure of the finished run is smaller."""
        if not (value := self.figure(name)) >= least:
            raise AssertionError(f"{name} is {value:.6g}, at least {least:.6g} is required; run folder: {self._finished().folder}")

    @keyword
    def run_should_have_passed(self) -> None:
        """Fails unless the finished run has kept all bounds of its experiment."""
        run = self._finished()
        if run.passed is not True:
            raise AssertionError(f"{run.ended_because or 'the run'}: bounds were broken, see {run.folder / 'summary.json'}")

    @keyword
    def run_folder(self) -> str:
        """The folder of the rig's run."""
        if self._rig is None:
            raise AirbenchError("no rig was started: Start Rig")
        return str(self._rig.folder)

    # Robot's listener.

    def _start_test(self, data: Any, _: Any) -> None:
        self._place = str(data.full_name)

    def _end_test(self, *_: Any) -> None:
        self._place = "suite"
        if self._of_test:
            self._end()

    def _end_suite(self, *_: Any) -> None:
        self._end()

    def _close(self) -> None:
        self._end()

    # Within.

    def _end(self) -> None:
        if self._rig:
            self._rig.close()
        self._rig, self._run, self._of_test = None, None, False

    def _present(self) -> Rig:
        if self._rig is None:
            raise AirbenchError("no rig was started: Start Rig")
        return self._rig

    def _finished(self) -> Run:
        if self._run is None:
            raise AirbenchError("the run is not over: Finish Run or End Run")
        return self._run

    def _over(self, run: Run) -> Run:
        self._run = run
        if run.picture:
            logger.info(f"{escape(repr(run))}<br>{run.picture.read_text(encoding='utf-8')}", html=True)
        return run

    def _asked(self, ask: Callable[[Rig], _Answer]) -> _Answer:
        try:
            return ask(self._present())
        except ExpectationFailed as failed:
            if failed.picture:
                logger.info(failed.picture.read_text(encoding="utf-8"), html=True)
            raise

    def _folder(self) -> Path | None:
        try:
            output = BuiltIn().get_variable_value("${OUTPUT DIR}")
        except RobotNotRunningError:
            output = None
        if self._runs is None and output is None:
            return None
        runs = Path(self._runs) if self._runs else Path(str(output)) / "runs"
        name = "".join(letter if letter.isalnum() or letter in "-_." else "-" for letter in self._place)[:100]
        number, folder = 1, runs / name
        while folder.exists():
            number += 1
            folder = runs / f"{name}-{number}"
        return folder


def _values(texts: Mapping[str, float | str]) -> dict[str, float | str]:
    """Numbers and truth values that Robot hands over as text."""
    return {key: _value(value) for key, value in texts.items()}


def _value(given: float | str) -> float | str:
    if not isinstance(given, str):
        return given
    if given.lower() in ("true", "false"):
        return given.lower() == "true"
    try:
        return int(given) if given.lstrip("+-").isdigit() else float(given)
    except ValueError:
        return given
