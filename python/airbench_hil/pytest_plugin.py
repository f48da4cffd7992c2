"""pytest on the rig: fixtures, options, what a failed test leaves, requirements, and real time that nothing runs beside.

Loaded by its entry point (`pytest11`), with pytest-xdist or without; `docs/pytest.md` is its reference.
"""

from __future__ import annotations

import base64
import fcntl
import os
import re
import shutil
import sys
import tempfile
import time
import zlib
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import can
import pytest

from airbench_hil import programs
from airbench_hil.errors import AirbenchError
from airbench_hil.processes import Processes, private_folder
from airbench_hil.rig import Pace, Rig
from airbench_hil.traceability import Traceability, known_requirements

if TYPE_CHECKING:
    import pluggy

REQUIREMENT, REAL_TIME = "requirement", "airbench_realtime"
#: The property of a test that holds a requirement's identifier, in JUnit files too.
PROPERTY = "requirement"
_RIGS = pytest.StashKey[list[Rig]]()
_KNOWN = pytest.StashKey["dict[str, str] | None"]()
_TRACE = pytest.StashKey[Traceability]()
_LOCK_VARIABLE = "AIRBENCH_PYTEST_LOCK"

RigFactory = Callable[..., Rig]


def pytest_addoption(parser: pytest.Parser) -> None:
    """The options, and the same as keys of pytest.ini, pyproject.toml or tox.ini."""
    group = parser.getgroup("airbench", "airbench: the rig")
    group.addoption("--airbench-pace", choices=("lockstep", "real"), help="of rigs that give no pace (default: lockstep)")
    group.addoption("--airbench-bus", metavar="OPTIONS", help="options of the bus's URL, such as loss=0.01&seed=3, of rigs that give none")
    group.addoption("--airbench-bin", metavar="DIR", help="folder of airbench's programs (default: see docs/pytest.md)")
    group.addoption("--airbench-runs", metavar="DIR", help="where run folders go (default: a temporary folder of the session)")
    group.addoption(
        "--airbench-keep", choices=("failed", "all"), help="which run folders are kept (default: all)"
    )
    group.addoption("--airbench-traceability", metavar="DIR", help="write requirements.md, needs.json and requirements.sdoc into DIR")
    for key, text in {
        "pace": "as --airbench-pace", "bus": "as --airbench-bus", "bin": "as --airbench-bin", "runs": "as --airbench-runs",
        "keep": "as --airbench-keep", "traceability": "as --airbench-traceability",
        "requirements": "TOML file of the requirements that there are: REQ-1 = \"its text\"; a marker that names another is an error",
    }.items():
        parser.addini(f"airbench_{key}", text, default="")


def setting(config: pytest.Config, key: str) -> str:
    """An option, or else the ini file's key; empty where neither says anything."""
    return str(config.getoption(f"airbench_{key}", None) or config.getini(f"airbench_{key}") or "")


def pytest_configure(config: pytest.Config) -> None:
    """Registers the markers, and reads the requirements that there are."""
    config.addinivalue_line("markers", f"{REQUIREMENT}(id, …): the test verifies these requirements")
    config.addinivalue_line("markers", f"{REAL_TIME}: the test runs in real time; no other test with this plugin runs beside it")
    file = config.getini("airbench_requirements")
    try:
        config.stash[_KNOWN] = known_requirements(config.rootpath / str(file)) if file else None
    except (OSError, ValueError) as error:
        raise pytest.UsageError(f"airbench_requirements: {error}") from error
    config.stash[_TRACE] = Traceability()
    for name, module in list(sys.modules.items()):
        if name.startswith("airbench_hil."):
            vars(module)["__tracebackhide__"] = _is_explained


def _is_explained(error: pytest.ExceptionInfo[BaseException]) -> bool:
    """The message says it all, or what broke is a controller: a traceback then has the lines of the test alone (not with --full-trace)."""
    ours = Path(error.traceback[-1].path).parent == programs.PACKAGE
    return not ours or error.errisinstance((AirbenchError, AssertionError, ImportError, ValueError))


def requirements_of(item: pytest.Item) -> list[str]:
    """Identifiers in the order of the markers, the nearest first, each once."""
    named = (str(each) for marker in item.iter_markers(REQUIREMENT) for each in marker.args)
    return list(dict.fromkeys(named))


# Debian 12 has pluggy 1.0, which knows no `wrapper=True`.
@pytest.hookimpl(hookwrapper=True, tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> Generator[None]:
    """Writes requirements to the tests' properties, and puts tests in real time last, all of one xdist group.

    The group is given before pytest-xdist looks for it, the order after all others have theirs.
    """
    known = config.stash[_KNOWN]
    for item in items:
        named = requirements_of(item)
        unknown = [each for each in named if known is not None and each not in known]
        if unknown:
            raise pytest.UsageError(f"{item.nodeid}: {', '.join(unknown)} is in no line of {config.getini('airbench_requirements')}")
        item.user_properties.extend((PROPERTY, each) for each in named)
        if item.get_closest_marker(REAL_TIME):
            item.add_marker(pytest.mark.xdist_group("airbench-realtime"))
    yield
    items.sort(key=lambda item: item.get_closest_marker(REAL_TIME) is not None)


def _lock_path() -> Path:
    folder = Path(tempfile.gettempdir(), f"airbench-{os.getuid()}")
    folder.mkdir(mode=0o700, exist_ok=True)
    return Path(os.environ.get(_LOCK_VARIABLE) or folder / "pytest.lock")


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None]:
    """A test in real time is alone among those of this user's sessions and their workers; all others share."""
    alone = item.get_closest_marker(REAL_TIME) is not None
    rigs = {"airbench_rig", "airbench_bus"} & set(getattr(item, "fixturenames", ()))
    if not alone and not rigs:
        yield
        return
    # The kernel frees it however this process ends.
    with _lock_path().open("a") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX if alone else fcntl.LOCK_SH)
        yield


@pytest.fixture
def airbench_rig(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[RigFactory]:
    """Makes rigs: airbench_rig("point-to-point", controller=Own()), arguments as of `Rig`. Each is started, and closed after the test."""
    config, rigs = request.config, request.node.stash.setdefault(_RIGS, [])

    def make(*args: Any, **kwargs: Any) -> Rig:
        pace: Pace = kwargs.setdefault("pace", setting(config, "pace") or "lockstep")
        if pace == "real" and request.node.get_closest_marker(REAL_TIME) is None:
            raise pytest.UsageError(f"{request.node.nodeid} runs in real time: mark it @pytest.mark.{REAL_TIME}")
        kwargs.setdefault("bus_options", setting(config, "bus"))
        kwargs.setdefault("binaries", setting(config, "bin") or None)
        kwargs.setdefault("out", _run_folder(request, tmp_path_factory, len(rigs)))
        rig = Rig(*args, **kwargs)
        rigs.append(rig)
        rig.start()
        return rig

    yield make
    for rig in rigs:
        rig.close()


class Bus:
    """A bus without a rig, hosted by `emulator bus`."""

    def __init__(self, output: Path, emulator: Path) -> None:
        """Starts the host; what it says goes to `output`. Raises AirbenchError."""
        private = private_folder()
        self.path = private / "bus0"
        self._open: list[can.BusABC] = []
        self._processes = Processes(private, output)
        self._processes.start("bus", [str(emulator), "bus", "--bus", self.url])
        until = time.monotonic() + 30.0
        while not self.path.exists():
            if not self._processes.running("bus") or time.monotonic() > until:
                self.close()
                raise AirbenchError(f"emulator bus: {self._processes.said('bus')}")
            time.sleep(0.002)

    @property
    def url(self) -> str:
        """unix:///PATH, for programs."""
        return f"unix://{self.path}"

    def connect(self, **options: Any) -> can.BusABC:
        """A node of it as python-can has it, closed after the test."""
        self._open.append(can.Bus(interface="airbench", channel=self.url, **options))
        return self._open[-1]

    def close(self) -> None:
        """Closes the nodes and ends the host."""
        for node in self._open:
            node.shutdown()
        self._processes.close(3.0)


@pytest.fixture
def airbench_bus(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bus]:
    """An embedded bus without a rig: `airbench_bus.connect()` is a can.Bus, `airbench_bus.url` for programs."""
    bus = Bus(tmp_path_factory.mktemp("bus"), programs.program("emulator", setting(request.config, "bin") or None))
    yield bus
    bus.close()


def _run_folder(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory, number: int) -> Path:
    # A name of its own for each test: what does not show in it, or is cut off, is told apart by a checksum.
    whole = request.node.nodeid.replace("::", "-")
    name = re.sub(r"[^\w.-]+", "-", whole).strip("-")[:120]
    name = name if name == whole else f"{name}-{zlib.crc32(request.node.nodeid.encode()):08x}"
    name = f"{name}-{number + 1}" if number else name
    where = setting(request.config, "runs")
    if not where:
        return tmp_path_factory.mktemp(name[:40], numbered=True)  # the number keeps them apart
    folder = request.config.rootpath / where / name
    # Of an earlier session: pictures of failures that are none any more.
    shutil.rmtree(folder, ignore_errors=True)
    return folder


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Generator[None, pluggy.Result[pytest.TestReport]]:
    """What a failed test leaves becomes part of its report: properties for JUnit, a section, extras for pytest-html."""
    rigs = item.stash.get(_RIGS, [])
    broke = call.excinfo is not None and call.when != "teardown" and not call.excinfo.errisinstance(pytest.skip.Exception)
    if broke:
        for rig in rigs:
            rig.close()
            for key, path in _left(rig):
                item.user_properties.append((f"airbench_{key}", str(path)))
    report = (yield).get_result()
    if report.failed and broke:
        for rig in rigs:
            report.sections.append(("airbench", "\n".join(f"{key}: {path}" for key, path in _left(rig))))
            _attach(item.config, report, rig)
    if call.when == "teardown" and setting(item.config, "keep") == "failed" and not report.failed:
        if not any(key == "airbench_run" for key, _ in item.user_properties):
            for rig in rigs:
                shutil.rmtree(rig.folder, ignore_errors=True)


def _left(rig: Rig) -> Iterator[tuple[str, Path]]:
    if not hasattr(rig, "folder"):
        return
    yield "run", rig.folder
    names = (("bus_log", "bus.log"), ("summary", "summary.json"), ("picture", "picture.svg"))
    yield from ((key, rig.folder / name) for key, name in names if (rig.folder / name).exists())
    yield from (("failure_picture", path) for path in sorted(rig.folder.glob("expectation-*.svg")))


def _attach(config: pytest.Config, report: pytest.TestReport, rig: Rig) -> None:
    if not config.pluginmanager.hasplugin("html"):
        return
    from pytest_html import extras

    attached = getattr(report, "extras", [])
    for key, path in _left(rig):
        if path.suffix == ".svg":
            attached.append(extras.svg(base64.b64encode(path.read_bytes()).decode(), name=key))
        else:
            attached.append(extras.url(path.as_uri(), name=key))
    report.extras = attached  # type: ignore[attr-defined]


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Collects verdicts; under xdist in the process that hands the tests out."""
    if _collector is not None:
        _collector.take(report)


_collector: Traceability | None = None


def pytest_sessionstart(session: pytest.Session) -> None:
    """Verdicts are collected where reports of all workers come together."""
    global _collector
    _collector = None if hasattr(session.config, "workerinput") else session.config.stash[_TRACE]


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Writes the traceability files."""
    config = session.config
    where = setting(config, "traceability")
    if where and not hasattr(config, "workerinput") and not config.option.collectonly:
        config.stash[_TRACE].write(config.rootpath / where, config.stash[_KNOWN])


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Names the traceability files."""
    if (where := setting(config, "traceability")) and not config.option.collectonly:
        terminalreporter.write_line(f"airbench: requirements in {config.rootpath / where / 'requirements.md'}")
