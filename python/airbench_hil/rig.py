"""The rig and what controls it, for a test: `with Rig(...) as rig`."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import time
import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Literal

import can
from cantools.database.can import Database

from airbench_hil import faults as fault_files
from airbench_hil import peer, programs, tasks
from airbench_hil.controllers import Answering, Controller, Elf, Law, Own, Process, Python, StrPath
from airbench_hil.conditions import seconds
from airbench_hil.errors import BOUND_BROKEN, GOOD, INTERRUPTED, PARTNER_FAILED, AirbenchError, NotAnswered, ProgramFailed, RigEnded
from airbench_hil.expectations import Expectations
from airbench_hil.faults import Fault
from airbench_hil.guests import Readiness
from airbench_hil.links import Ended, Link, Lockstep, RealTime
from airbench_hil.people import People
from airbench_hil.processes import Processes, private_folder
from airbench_hil.run import Run
from airbench_hil.signals import Names, Seen, database

Pace = Literal["lockstep", "real"]
#: A debugger may hold a cycle as long as this, s.
_A_DAY_S = 86400
#: Wall time that programs have to come to the bus, s.
_JOIN_S = 60
#: ... and a program under `bench can` until it waits for frames; then it is taken for ready, s.
_GUEST_S = 10.0
_FAREWELL_S, _LEAVING_S = 10.0, 2.0


class Rig(Expectations, People):
    """The emulated rig on an embedded bus of its own, with what controls it.

    Used as a context manager: programs start on entering, and none is left on leaving, however this process ends. In lockstep time advances
    inside the methods that wait (`run_for`, `run_until`, `expect`, `wait_for`, `never`, `always`, `stable_for`, `finish`, `end`) alone, and two
    runs of a test leave the same bytes; in real time it goes on by itself. Times are the rig's, in s.
    """

    def __init__(
        self,
        experiment: StrPath | Mapping[str, Any] | None = None,
        *,
        pace: Pace = "lockstep",
        controller: Controller | Law | Sequence[Controller | Law] | None = None,
        faults: StrPath | Sequence[Fault | Mapping[str, Any]] = (),
        setup: Mapping[str, Any] | None = None,
        seconds: float | None = None,
        seed: int = 1,
        sealed: StrPath | None = None,
        rig_file: StrPath | None = None,
        out: StrPath | None = None,
        binaries: StrPath | None = None,
        bus_options: str = "",
        emulator_options: Sequence[str] = (),
        answer_s: float = 5.0,
        summarise: bool = True,
    ) -> None:
        """Nothing is started yet.

        :param experiment: name of a shipped one, a file, or its tables; None: the rig alone, for controllers that need none.
        :param pace: "lockstep", simulated time, or "real".
        :param controller: `Own`, `Process`, `Elf`, a function from `Sensors` to an opening, or several; None: nobody.
        :param faults: planned faults, or a script's file.
        :param setup: keys of the experiment's `[rig]` in place of its own, such as {"carriage_position_m": 0.15}.
        :param seconds: end after this much of the rig's time, s.
        :param seed: of the sensors' noise and of faults with chance in them.
        :param sealed: a file of hidden effects.
        :param rig_file: the plant's numbers; None: the shipped rig.toml.
        :param out: the run's folder; None: a new one in ./runs.
        :param binaries: folder of the programs; None: `programs.program` looks for them.
        :param bus_options: of the bus's URL, such as "loss=0.01&seed=3" or "bitrate=1000000".
        :param emulator_options: more options of `emulator run`.
        :param answer_s: wall time that a controller has for a cycle in lockstep, s. The test and a debugger may take a day.
        :param summarise: join, judge and draw the run at its end (`bench summary`).
        :raises ValueError: an argument that cannot be meant.
        """
        if pace not in ("lockstep", "real"):
            raise ValueError(f"pace '{pace}': \"lockstep\" or \"real\"")
        self.pace: Pace = pace
        self._experiment, self._faults, self._setup = experiment, faults, dict(setup or {})
        self.controllers: list[Controller] = _controllers(controller)
        self._seconds, self._seed, self._sealed = seconds, seed, sealed
        self.rig_file = Path(rig_file).resolve() if rig_file else programs.file("rig.toml")
        self._out, self._binaries, self._bus_options = out, binaries, bus_options
        self._emulator_options, self._answer_s, self._summarise = list(emulator_options), answer_s, summarise
        self.names = Names(database())
        self.seen = Seen(self.names)
        self.experiment_file: Path | None = None
        self._processes: Processes | None = None
        self._link: Link | None = None
        self._killed: set[str] = set()
        #: Names of airbench's own controllers, whose exit code 1 says that a stop ended the experiment.
        self._own: set[str] = set()
        self._run: Run | None = None
        self._over = self._quit_asked = False
        self.failures: list[AssertionError] = []
        """Expectations that failed, in their order."""
        self._init_people()

    # What is asked of it while it runs.

    @property
    def time(self) -> float:
        """The rig's time, s: of the cycle whose sensors came last."""
        self._to_newest()
        return self._now_s

    @property
    def cycle(self) -> int:
        """Number of the cycle whose sensors came last; a cycle has 1 ms."""
        self._to_newest()
        return self._link.cycle if self._link else 0

    @property
    def _now_s(self) -> float:
        return self._link.now_s if self._link else 0.0

    def _to_newest(self) -> None:
        if self._link and not self._over:
            try:
                self._link.catch_up()
            except Ended:
                pass  # time stands

    @property
    def database(self) -> Database:
        """rig.dbc as cantools has it."""
        return self.names.dbc

    @property
    def url(self) -> str:
        """The bus, for other programs: unix:///PATH."""
        return f"unix://{self.bus_path}"

    @property
    def telemetry(self) -> Path:
        """The socket of the emulator's telemetry, for `bench watch --telemetry`."""
        return self._telemetry

    def program(self, name: str) -> Path:
        """A program of airbench, where this rig takes it from. Raises ProgramNotFound."""
        return programs.program(name, self._binaries)

    def listen(self, **options: Any) -> can.BusABC:
        """Another node of the bus, as python-can has it; it hears all frames, and no cycle waits for it."""
        return can.Bus(interface="airbench", channel=self.url, **options)

    def kill(self, name: str, number: int = signal.SIGKILL) -> None:
        """Ends a program ("controller", "process", …) with a signal, as a crash would: that it ended is no error then.

        :raises ValueError: no such program runs.
        """
        processes = self._running()
        if not processes.running(name):
            raise ValueError(f"no program '{name}' runs; there is {', '.join(processes.pids)}")
        self._killed.add(name)
        processes.signal(name, number)
        processes.wait([name], _FAREWELL_S)

    # Beginning.

    def __enter__(self) -> Rig:
        self.start()
        return self

    def start(self) -> None:
        """Starts the programs, and waits for the first cycle.

        :raises ProgramFailed: one of them ended, such as with exit code 2 for bad input.
        :raises ProgramNotFound: one of them is nowhere.
        """
        if self._processes:
            raise ValueError("a rig is started once; make another")
        emulator = self.program("emulator")
        self.folder = tasks.folder(self._out, _title(self._experiment))
        output = self.folder / "programs"
        shutil.rmtree(output, ignore_errors=True)
        output.mkdir(parents=True)
        private = private_folder()
        self.bus_path, self._telemetry = private / "bus0", private / "telemetry"
        self._processes = Processes(private, output)
        try:
            self._write_files()
            started = []
            for controller in self.controllers:
                programs_of = controller.programs(self)
                started += programs_of
                self._own |= {each.name for each in programs_of} if isinstance(controller, Own) else set()
            names = ["emulator", *(each.name for each in started)]
            if twice := [name for name in dict.fromkeys(names) if names.count(name) > 1]:
                why = "give each a name of its own, Process(name=…), Own(two=True)"
                raise ValueError(f"several programs are named {', '.join(twice)}: {why}")
            self._processes.start("emulator", [str(emulator), *self._emulator_words()])
            self._wait(self.bus_path.exists, "the emulator's bus")
            for each in started:
                self._processes.start(each.name, each.words, each.env, each.cwd)
            for each in started:
                if each.guest and self.pace == "lockstep":
                    self._wait_for_guest(each.name)
            self._connect()
        except BaseException:
            self._processes.close(0.0)
            raise

    def _write_files(self) -> None:
        tables = self._experiment if isinstance(self._experiment, Mapping) else None
        if self._experiment is not None and tables is None:
            self.experiment_file = programs.experiment(self._experiment)  # type: ignore[arg-type]
        if self._setup or tables is not None:
            if tables is None:
                text = self.experiment_file.read_text(encoding="utf-8") if self.experiment_file else "title = \"rig\"\n"
                tables = tomllib.loads(text)
            whole = {**tables, "rig": {**tables.get("rig", {}), **self._setup}}
            self.experiment_file = self.folder / "experiment.toml"
            self.experiment_file.write_text(fault_files.toml(whole), encoding="utf-8")
        self._fault_file: Path | None = None
        if isinstance(self._faults, (str, os.PathLike)):
            self._fault_file = Path(self._faults)
        elif self._faults:
            self._fault_file = self.folder / "faults.toml"
            self._fault_file.write_text(fault_files.script(self._faults, self._seed), encoding="utf-8")

    def _emulator_words(self) -> list[str]:
        options = f"?{self._bus_options}" if self._bus_options else ""
        words = ["run", "--bus", self.url + options, "--rig", str(self.rig_file), "--out", str(self.folder), "--pace", self.pace]
        words += ["--seed", str(self._seed), "--console", "--telemetry", str(self._telemetry)]
        for option, value in (("--experiment", self.experiment_file), ("--faults", self._fault_file), ("--sealed", self._sealed)):
            words += [option, str(value)] if value else []
        words += ["--seconds", str(self._seconds)] if self._seconds is not None else []
        if self.pace == "lockstep":
            members = 1 + sum(controller.members for controller in self.controllers)
            words += ["--members", str(members), "--lockstep-timeout", str(_A_DAY_S)]
            words += [word for each in self.controllers if each.echo for word in ("--lockstep-echo", each.echo)]
            words += ["--join-timeout", str(self._join_s())]
        return words + self._emulator_options

    def _join_s(self) -> int:
        """Wall time for all to join, s: a debugger at reset may take as long as it likes."""
        return _A_DAY_S if self._has_debugger() else _JOIN_S

    def _has_debugger(self) -> bool:
        return any(getattr(each, "gdb", None) is not None for each in self.controllers)

    def _wait(self, there: Callable[[], bool], what: str) -> None:
        until = time.monotonic() + _JOIN_S
        while not there():
            self._look()
            if time.monotonic() > until:
                raise AirbenchError(f"{what} is not there within {_JOIN_S} s")
            time.sleep(0.002)

    def _wait_for_guest(self, name: str) -> None:
        assert self._processes
        ready = Readiness(self._processes.pids[name])
        until = time.monotonic() + _GUEST_S
        while not ready.look() and time.monotonic() < until:
            self._look()
            time.sleep(0.005)

    def _connect(self) -> None:
        laws = [Answering(each, self.names) for each in self.controllers if isinstance(each, Python)]
        bus = peer.Peer(str(self.bus_path), stamped=False)
        try:
            if self.pace == "lockstep":
                answer_s = _A_DAY_S if self._has_debugger() else self._answer_s
                self._link = Lockstep(bus, self.seen, laws, self._look, answer_s, self._join_s())
            else:
                self._link = RealTime(bus, self.seen, laws, self._look, _JOIN_S)
        except Ended as ended:
            raise self._why_ended(str(ended)) from None

    # While it runs.

    def _running(self) -> Processes:
        if not self._processes:
            raise RigEnded("the rig has not been started: with Rig(...) as rig")
        if self._over:
            raise RigEnded("the run is over")
        return self._processes

    def _look(self) -> None:
        """Raises ProgramFailed when a program has ended that should not have."""
        processes = self._running()
        processes.look()
        for name, code in processes.ended.items():
            # Who is done may end; but nobody before the first cycle, and the emulator that ended shows on the bus.
            if self._link is None or self._is_failure(name, code):
                raise ProgramFailed(name, code, processes.said(name), self.folder)

    def _is_failure(self, name: str, code: int) -> bool:
        over = "emulator" in self._running().ended
        # A foreign program may well end so when the bus does, as an exception in Python makes it; before, it broke.
        bound = code == BOUND_BROKEN and (name == "emulator" or name in self._own or over)
        if code == GOOD or bound or name in self._killed:
            return False
        # "The rig ended before the experiment was done": as it was asked to.
        early = self._quit_asked or self._seconds is not None
        return not (early and code == PARTNER_FAILED and name != "emulator" and self._running().ended.get("emulator") == GOOD)

    def _advance(self) -> None:
        """One cycle further. Raises RigEnded at the end of the run, ProgramFailed when a program has failed."""
        self._running()
        assert self._link
        try:
            self._link.advance()
        except Ended as ended:
            raise self._why_ended(str(ended)) from None
        except NotAnswered as late:
            processes = self._running()
            gone = [f"{name} has ended with exit code {code}:\n{processes.said(name)}" for name, code in processes.ended.items()]
            raise NotAnswered("\n".join([str(late), *gone, f"run folder: {self.folder}"])) from None
        if self._link.cycle % 100 == 0:
            self._look()

    def _catch_up(self) -> None:
        self._running()
        assert self._link
        try:
            self._link.catch_up()
        except Ended as ended:
            raise self._why_ended(str(ended)) from None

    def _send(self, raw_id: int, data: bytes) -> None:
        self._running()
        assert self._link
        try:
            self._link.send(raw_id, data)
        except Ended as ended:
            raise self._why_ended(str(ended)) from None
        self.seen.take(raw_id, data, len(data), self._now_s)

    def _why_ended(self, why: str) -> AirbenchError:
        processes = self._running()
        processes.wait(["emulator"], _FAREWELL_S)
        try:
            self._look()
        except ProgramFailed as failed:
            return failed
        try:
            why = str(Run(self.folder).ended_because) or why
        except (OSError, ValueError):
            pass  # it left no summary; what the bus said is all there is
        return RigEnded(f"the run ended after {self._now_s:.3f} s: {why}")

    # Its end.

    def finish(self, within: str | float = "1000 s") -> Run:
        """Runs to the end of the experiment, or to `seconds`, and gives the run.

        Where nobody says done (a Python function, a `Process` or `Elf` without `says_done`) and `seconds` was not given, that is now.

        :raises ExpectationFailed: it did not end within that time of the rig.
        :raises ProgramFailed: a program failed.
        """
        if self._run:
            return self._run
        if self._seconds is None and not any(each.says_done for each in self.controllers):
            return self.end()
        self._run_out(within)
        return self._close(raising=True)

    def end(self) -> Run:
        """Ends the run now, with everything saved, and gives it. Raises ProgramFailed as `finish` does."""
        if self._run:
            return self._run
        self._look()
        try:
            self._catch_up()  # what a Python controller has raised
        except RigEnded:
            pass
        self._quit()
        return self._close(raising=True)

    def _quit(self) -> None:
        """Ends the run at the console, or by SIGTERM where it stands: both save everything."""
        processes, self._quit_asked = self._running(), True
        if self._link:
            self._link.silence()
        try:
            self.console("quit")
            while True:
                self._advance()
        except (AirbenchError, peer.BusError) as ended:
            if not isinstance(ended, RigEnded) and processes.running("emulator"):
                processes.signal("emulator", signal.SIGTERM)

    def _check_runs(self) -> None:
        self._running()

    def _run_out(self, within: str | float) -> None:
        began_s = self._now_s
        try:
            self._catch_up()
            began_s = self._now_s
            until_s = began_s + seconds(within)
            while self._now_s < until_s:
                self._advance()
        except RigEnded:
            return
        failure = self.failure(f"expected the run to end within {seconds(within):g} s", "it did not", [], began_s)
        self.failures.append(failure)
        raise failure

    def _close(self, raising: bool) -> Run:
        processes = self._running()
        if self._link:
            self._link.close()
        processes.wait(["emulator"], _FAREWELL_S)
        processes.wait(list(processes.pids), _LEAVING_S if raising else 0.3)
        self._exit_codes = dict(processes.ended)
        # A foreign program that knows no end is ended.
        processes.close(_LEAVING_S)
        failed = [(name, code) for name, code in self._exit_codes.items() if self._is_failure(name, code)]
        self._over = True
        if raising and failed:
            name, code = failed[0]
            raise ProgramFailed(name, code, processes.said(name), self.folder)
        if self._summarise and (self.folder / "summary.json").exists():
            self._sum_up(raising)
        self._run = Run(self.folder, self._exit_codes)
        return self._run

    def _sum_up(self, raising: bool) -> None:
        done = subprocess.run(
            [self.program("bench"), "summary", self.folder], capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL
        )
        (self.folder / "programs/summary.txt").write_text(done.stdout + done.stderr)
        if raising and done.returncode not in (GOOD, BOUND_BROKEN, INTERRUPTED):
            raise ProgramFailed("bench summary", done.returncode, done.stderr or done.stdout, self.folder)

    def close(self) -> None:
        """Ends the run if it goes on, and everything that runs. To close twice does nothing."""
        if not self._processes:
            return
        try:
            if not self._over:
                self._quit()
                self._close(raising=False)
        except Exception:  # noqa: BLE001 - what ends the test is what came before
            pass  # the folder has what could be saved
        finally:
            self._over = True
            self._processes.close(_LEAVING_S)

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()


def _controllers(asked: Controller | Law | Sequence[Controller | Law] | None) -> list[Controller]:
    if asked is None:
        return []
    if isinstance(asked, str):
        raise ValueError(f"controller {asked!r}: Own({asked!r}) runs an axis program, Process({asked!r}) a command")
    every: Sequence[Controller | Law] = asked if isinstance(asked, Sequence) else [asked]
    for each in every:
        if not isinstance(each, (Own, Process, Elf, Python)) and not callable(each):
            raise ValueError(f"controller {each!r}: Own, Process, Elf, or a function from Sensors to an opening")
    return [each if isinstance(each, (Own, Process, Elf, Python)) else Python(each) for each in every]


def _title(experiment: StrPath | Mapping[str, Any] | None) -> str:
    if isinstance(experiment, Mapping):
        return str(experiment.get("title", "rig"))
    return "rig" if experiment is None else Path(experiment).stem
