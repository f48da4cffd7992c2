"""The pytest plugin, in sessions of pytest's own: fixtures, reports of failures, requirements, xdist, real time alone."""

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as xml
from pathlib import Path

import pytest
from conftest import emulator
from test_guard import gone, processes_with

pytest_plugins = ["pytester"]

SUITE = '''
import pytest
from airbench_hil import Own

def to_300_mm(sensors):
    return max(-1.0, min(1.0, 8.0 * (0.3 - sensors.position)))

@pytest.mark.requirement("REQ-1", "REQ-2")
def test_reaches(airbench_rig):
    rig = airbench_rig(controller=to_300_mm)
    rig.expect("near(DriveSensors.position, 0.3, 0.005)", within="3 s")

@pytest.mark.requirement("REQ-2")
def test_fails(airbench_rig):
    rig = airbench_rig(controller=to_300_mm)
    rig.expect("DriveSensors.position > 0.4", within="0.5 s")

@pytest.mark.requirement("REQ-3")
def test_skipped(airbench_rig):
    pytest.skip("no board")

def test_bus(airbench_bus):
    import can
    with airbench_bus.connect() as one, airbench_bus.connect() as other:
        one.send(can.Message(arbitration_id=0x123, is_extended_id=False))
        assert other.recv(10).arbitration_id == 0x123
'''
REQUIREMENTS = 'REQ-1 = "It reaches its place"\nREQ-2 = "It stays within | bounds"\nREQ-3 = "On a board"\nREQ-4 = "Nobody tests it"\n'


@pytest.fixture
def suite(pytester, monkeypatch):
    """A folder with the suite and its requirements; the lock is not that of the session around it."""
    pytester.makepyfile(test_suite=SUITE)
    Path(pytester.path, "requirements.toml").write_text(REQUIREMENTS)
    pytester.makeini("[pytest]\nairbench_requirements = requirements.toml\nairbench_runs = runs\n")
    monkeypatch.setenv("AIRBENCH_PYTEST_LOCK", str(pytester.path / "lock"))
    monkeypatch.setenv("AIRBENCH_BIN", str(emulator().parent))
    return pytester


def run(suite, *options):
    return suite.runpytest_subprocess("-p", "no:cacheprovider", *options, timeout=120)


def properties(path):
    """Test name to a list of its properties, of a JUnit file."""
    return {
        case.get("name"): [(each.get("name"), each.get("value")) for each in case.iter("property")]
        for case in xml.parse(path).iter("testcase")
    }


@pytest.mark.parametrize("workers", [(), ("-n", "2")], ids=["alone", "xdist"])
def test_a_failure_is_reported_with_its_folder_and_requirements_reach_junit_and_the_tables(suite, workers):
    result = run(suite, *workers, "--junitxml=junit.xml", "--airbench-traceability=trace", "--html=report.html", "--self-contained-html")
    result.assert_outcomes(passed=2, failed=1, skipped=1)
    result.stdout.fnmatch_lines(["*expected within 0.5 s: DriveSensors.position > 0.4", "*run folder: *runs/test_suite.py-test_fails"])
    found = properties(suite.path / "junit.xml")
    assert found["test_reaches"] == [("requirement", "REQ-1"), ("requirement", "REQ-2")]
    failed = dict(found["test_fails"])
    folder = suite.path / "runs/test_suite.py-test_fails"
    assert failed["requirement"] == "REQ-2" and failed["airbench_run"] == str(folder)
    for key in ("bus_log", "picture", "failure_picture", "summary"):
        assert Path(failed[f"airbench_{key}"]).stat().st_size > 0, key
    assert "airbench_run" not in dict(found["test_reaches"])
    assert "data:image/svg+xml;base64" in (suite.path / "report.html").read_text()

    table = (suite.path / "trace/requirements.md").read_text()
    rows = [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in table.splitlines() if line.startswith("| REQ")]
    assert [(row[0], row[2]) for row in rows] == [
        ("REQ-1", "passed"), ("REQ-2", "failed"), ("REQ-3", "skipped"), ("REQ-4", "untested"),
    ]
    assert "`test_suite.py::test_fails` failed" in rows[1][3] and "`test_suite.py::test_reaches` passed" in rows[1][3]
    assert "4 requirements: 1 passed, 1 failed, 1 skipped, 1 untested" in table
    needs = json.loads((suite.path / "trace/needs.json").read_text())
    kept = needs["versions"][needs["current_version"]]["needs"]
    assert kept["REQ-2"]["status"] == "failed" and {kept[each]["title"] for each in kept["REQ-2"]["links"]} == {
        "test_suite.py::test_fails", "test_suite.py::test_reaches",
    }
    assert "UID: REQ-4\nSTATUS: untested" in (suite.path / "trace/requirements.sdoc").read_text()


def test_a_traceback_has_the_lines_of_the_test_and_of_its_controller_alone_unless_the_package_broke(suite):
    suite.makepyfile(test_suite="""
        from airbench_hil import conditions

        def broken(sensors):
            return 1 / (sensors.cycle - 5)

        def test_controller(airbench_rig):
            airbench_rig(controller=broken).run_for("1 s")

        def test_signal(airbench_rig):
            airbench_rig().expect("position > 0.3")

        def test_package():
            conditions.parse(None, None)
    """)
    result = run(suite, "--tb=short", "-k", "not package")
    result.assert_outcomes(failed=2)
    result.stdout.fnmatch_lines([
        "*return 1 / (sensors.cycle - 5)", "*ZeroDivisionError*", "*Message.signal: DriveSensors.position, LoadSensors.position*",
    ])
    result.stdout.no_re_match_line(r".*airbench_hil/\w+\.py:\d+|.*/ast\.py:\d+")
    run(suite, "--tb=short", "-k", "package").stdout.re_match_lines([r".*airbench_hil/conditions\.py:\d+: in parse"])


def test_last_failed_runs_it_alone_and_only_folders_of_failures_are_kept_if_asked(suite):
    suite.runpytest_subprocess("--airbench-keep=failed", timeout=120).assert_outcomes(passed=2, failed=1, skipped=1)
    assert [path.name for path in (suite.path / "runs").iterdir()] == ["test_suite.py-test_fails"]
    suite.runpytest_subprocess("--lf", timeout=120).assert_outcomes(failed=1)


def test_a_test_that_fails_before_it_begins_keeps_its_folder_and_a_skipped_one_does_not(suite):
    suite.makepyfile(test_setup="""
import pytest

@pytest.fixture
def reached(airbench_rig):
    airbench_rig(controller=lambda _: 0.0).expect("DriveSensors.position > 9", within="2 ms")

def test_it(reached):
    pass

def test_no_board(airbench_rig):
    airbench_rig(controller=lambda _: 0.0)
    pytest.skip("no board")
""")
    result = run(suite, "--airbench-keep=failed", "test_setup.py")
    result.assert_outcomes(errors=1, skipped=1)
    result.stdout.fnmatch_lines(["run: *runs/test_setup.py-test_it"])
    folder = suite.path / "runs/test_setup.py-test_it"
    assert [path.name for path in (suite.path / "runs").iterdir()] == [folder.name] and (folder / "picture.svg").exists()


def test_each_test_has_a_folder_of_its_own(suite):
    text = """
import pytest

@pytest.mark.parametrize("what", ["a/b", "c/b", "a b", "a?b", "x" * 200 + "1", "x" * 200 + "2"])
def test_it(airbench_rig, what):
    airbench_rig(controller=lambda _: 0.0).run_for("1 ms")
"""
    for folder in ("one", "two"):
        suite.mkpydir(folder).joinpath("test_same.py").write_text(text)
    run(suite, "one", "two").assert_outcomes(passed=12)
    assert len(list((suite.path / "runs").iterdir())) == 12


def test_a_requirement_whose_test_crashed_its_worker_has_failed(suite):
    suite.makepyfile(test_crash="""
import os, pytest

@pytest.mark.requirement("REQ-1")
def test_good():
    pass

@pytest.mark.requirement("REQ-1")
@pytest.mark.parametrize("a", ["b|c"])
def test_crash(a):
    os._exit(1)
""")
    run(suite, "--collect-only", "--airbench-traceability=trace", "test_crash.py")
    assert not (suite.path / "trace").exists()
    run(suite, "-n", "1", "--airbench-traceability=trace", "test_crash.py").assert_outcomes(passed=1, failed=1)
    table = (suite.path / "trace/requirements.md").read_text()
    [row] = [line for line in table.splitlines() if line.startswith("| REQ-1")]
    cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", row)[1:-1]]
    assert cells[2] == "failed" and r"test_crash[b\|c]` failed" in cells[3], row


def test_tests_in_real_time_are_one_group_of_xdist(suite):
    suite.makepyfile(test_group="""
import os, pytest

@pytest.mark.airbench_realtime
@pytest.mark.parametrize("n", range(6))
def test_it(n):
    open(f"worker-{os.environ['PYTEST_XDIST_WORKER']}", "w").close()
""")
    run(suite, "-n", "2", "--dist", "loadgroup", "test_group.py").assert_outcomes(passed=6)
    assert len(list(suite.path.glob("worker-*"))) == 1


def test_a_requirement_that_there_is_not_and_an_unmarked_test_in_real_time_are_errors(suite):
    suite.makepyfile(test_wrong='import pytest\n@pytest.mark.requirement("REQ-9")\ndef test_it(): pass\n')
    result = run(suite, "test_wrong.py")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["*REQ-9 is in no line of requirements.toml*"])
    suite.makepyfile(test_wrong='def test_it(airbench_rig): airbench_rig(pace="real")\n')
    run(suite, "test_wrong.py").stdout.fnmatch_lines(["*mark it @pytest.mark.airbench_realtime*"])


@pytest.mark.airbench_realtime  # those of the suite within
def test_a_test_in_real_time_has_the_machine_alone(suite):
    suite.makepyfile(test_times='''
import os, time, pytest

def note(what):
    with open("times.txt", "a") as file:
        file.write(f"{what} {time.monotonic()}\\n")

@pytest.mark.parametrize("n", range(3))
def test_beside(n, airbench_rig):
    note(f"begin beside{n}")
    airbench_rig(controller=lambda _: 0.0).run_for("0.2 s")
    note(f"end beside{n}")

@pytest.mark.airbench_realtime
@pytest.mark.parametrize("n", range(2))
def test_alone(n, airbench_rig):
    note(f"begin alone{n}")
    airbench_rig(pace="real", controller=lambda _: 0.0, emulator_options=["--no-realtime"]).run_for("0.2 s")
    note(f"end alone{n}")
''')
    run(suite, "-n", "2", "test_times.py").assert_outcomes(passed=5)
    spans = {}
    for line in (suite.path / "times.txt").read_text().splitlines():
        edge, name, at = line.split()
        spans.setdefault(name, {})[edge] = float(at)
    for name, span in spans.items():
        if name.startswith("alone"):
            for other in spans.keys() - {name}:
                assert spans[other]["end"] < span["begin"] or spans[other]["begin"] > span["end"], (name, other, spans)


def test_a_worker_that_is_killed_leaves_nothing(suite, tmp_path):
    suite.makepyfile(test_long='def test_long(airbench_rig):\n    airbench_rig(controller=lambda _: 0.0).run_for("1000 s")\n')
    private, mark = Path(tempfile.mkdtemp(prefix="ab-")), f"AIRBENCH_TEST_MARK={tmp_path}"
    environment = {**os.environ, "TMPDIR": str(private), "XDG_RUNTIME_DIR": "", **dict([mark.split("=", 1)])}
    words = [sys.executable, "-m", "pytest", "-n", "1", "--basetemp", str(tmp_path / "base"), "test_long.py"]
    with subprocess.Popen(words, cwd=suite.path, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as session:
        until = time.monotonic() + 60
        while not (emulators := [pid for pid in processes_with(mark) if _word(pid) == "emulator"]):
            assert time.monotonic() < until
            time.sleep(0.02)
        [worker] = {_parent(_parent(pid)) for pid in emulators}
        os.kill(worker, signal.SIGKILL)
        said = session.communicate(timeout=60)[0].decode()
    assert "crashed while running 'test_long.py::test_long'" in said, said
    for folder in private.glob("airbench-[0-9]*"):
        for file in folder.iterdir():
            file.unlink()
        folder.rmdir()
    assert gone(mark, private), (processes_with(mark), list(private.iterdir()))


def _word(pid):
    try:
        return Path(f"/proc/{pid}/comm").read_text().strip()
    except OSError:
        return ""


def _parent(pid):
    return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])
