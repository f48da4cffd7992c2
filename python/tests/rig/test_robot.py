"""The library for Robot Framework: the example suite, what a failure shows and leaves, and the page of keywords."""

import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

from airbench_hil import programs, traceability

sys.path.insert(0, str(Path(__file__).parents[3] / "docs/book"))
import robot_keywords  # noqa: E402

EXAMPLES = robot_keywords.PAGE.parent / "examples/robot"


def robot(folder, suite, *options):
    """Robot's exit code (failed tests), what it said, and its results."""
    words = [sys.executable, "-m", "robot", "--outputdir", folder, "--consolecolors", "off", *options, suite]
    done = subprocess.run(words, capture_output=True, text=True, cwd=programs.PACKAGE.parent)
    return done.returncode, done.stdout + done.stderr, ElementTree.parse(folder / "output.xml")


def suite(folder, text):
    """A suite's file, with the library."""
    path = folder / "mine.robot"
    path.write_text(f"*** Settings ***\nLibrary    airbench_hil.robot.Airbench\n{text}")
    return path


def messages(results, test):
    """What the keywords of a test logged."""
    [found] = [each for each in results.iter("test") if each.get("name") == test]
    return [each.text or "" for each in found.iter("msg")]


def running(folder):
    """Processes with that folder among their words."""
    found = []
    for file in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            found += [file.parent.name] if str(folder).encode() in file.read_bytes() else []
        except OSError:
            pass  # it has ended meanwhile
    return found


def test_the_example_suite_passes_and_leaves_nothing_running(tmp_path):
    code, said, results = robot(tmp_path, EXAMPLES)
    assert code == 0 and "7 tests, 7 passed, 0 failed" in said, said
    tags = {each.text for each in results.iter("tag")}
    assert {"REQ-POS-1", "REQ-FLT-1", "REQ-STP-2"} <= tags
    assert "<svg" in "".join(messages(results, "The Drive Reaches Its Place In Time"))
    assert len(list((tmp_path / "runs").iterdir())) == 8  # one test has two
    assert running(tmp_path) == []
    assert traceability.main([str(tmp_path / "output.xml"), "--out", str(tmp_path / "trace")]) == 0
    table = (tmp_path / "trace/requirements.md").read_text()
    assert "| REQ-POS-1 |  | passed | `Robot.Positioning.The Drive Reaches Its Place In Time` passed |" in table
    assert table.count(" | passed | ") == 7 and "7 requirements: 7 passed" in table


def test_a_failure_shows_its_signals_and_ends_the_rig_with_the_test(tmp_path):
    path = suite(tmp_path, """
*** Test Cases ***
It Stands Still
    Start Rig    controllers=${NONE}    carriage_position_m=0.2
    Expect    DriveSensors.position > 0.39    within=0.1 s

Nobody Has A Rig Any More
    Run Keyword And Expect Error    *no rig was started: Start Rig    Rig Time
    Run Keyword And Expect Error    *no rig was started: Start Rig    Run Folder

Its Name Twice
    Start Rig    carriage_position_m=0.2
    Run Keyword And Expect Error    *the run is not over: Finish Run or End Run    Figure    cycles
    Run Keyword And Expect Error    *fault 'no-such-fault' is unknown*    Fault    no-such-fault    drive
    End Run
    Run Keyword And Expect Error    *has no figure 'cycle'; it has*cycles*    Figure    cycle
    Run Keyword And Expect Error    cycles is *, at least 100 is required; run folder: *    Figure Should Be At Least    cycles    100
    Start Rig    carriage_position_m=0.2
    ${folder} =    Run Folder
    Should End With    ${folder}    Its-Name-Twice-2
""")
    code, said, results = robot(tmp_path, path)
    assert code == 1 and "3 tests, 2 passed, 1 failed" in said, said
    assert "\nexpected within 0.1 s: DriveSensors.position > 0.39\nit did not hold" in said and "run folder: " in said
    assert "<svg" in "".join(messages(results, "It Stands Still"))
    assert running(tmp_path) == []


def test_a_rig_of_the_suites_set_up_goes_on_from_test_to_test(tmp_path):
    path = suite(tmp_path, """
Suite Setup    Start Rig    controllers=${NONE}

*** Test Cases ***
First
    Run For    0.1 s

Second
    Run For    0.1 s
    ${time_s} =    Rig Time
    Should Be True    0.19 < ${time_s} < 0.21
    Send Frame    ConsoleEmergencyStop    reason=operator    release=0
    Expect    RigStatus.emergency_stop == 1    within=20 ms
    Console    help
""")
    code, said, _ = robot(tmp_path, path)
    assert code == 0 and "2 tests, 2 passed" in said, said
    assert running(tmp_path) == []


def test_bad_input_is_named(tmp_path):
    path = suite(tmp_path, """
*** Test Cases ***
Experiment
    Start Rig    no-such-experiment

Set Up
    Start Rig    carriage_position_m=7

Axis
    Process Controller    ./firmware    axis=carriage
""")
    code, said, _ = robot(tmp_path, path)
    assert code == 3 and "3 tests, 0 passed, 3 failed" in said, said
    assert "experiment 'no-such-experiment': no such file, and none of by-hand" in said
    assert "emulator ended with exit code 2:" in said and "carriage_position_m" in said
    assert "'carriage' that cannot be converted to 'drive' or 'load'" in said


ROBOT = """<robot><suite name="Rig"><suite name="Stop">
<test name="It stops"><kw><status status="PASS"/></kw><tag>REQ-1</tag><tag>slow</tag><status status="FAIL">late</status></test>
<test name="It may wait"><tag>STOP-2</tag><status status="SKIP"/></test></suite></suite></robot>"""
JUNIT = """<testsuites><testsuite><testcase classname="test_stop" name="test_fast"><properties>
<property name="requirement" value="STOP-2"/><property name="airbench_run" value="x"/></properties></testcase>
<testcase classname="test_stop" name="test_error"><properties><property name="requirement" value="REQ-3"/></properties><error/></testcase>
</testsuite></testsuites>"""


def test_results_of_robot_and_of_junit_become_one_table_of_requirements(tmp_path, capsys):
    output, junit, known, odd = (tmp_path / name for name in ("output.xml", "junit.xml", "requirements.toml", "odd.xml"))
    output.write_text(ROBOT)
    junit.write_text(JUNIT)
    known.write_text('REQ-1 = "It stops"\nSTOP-2 = "It waits"\nREQ-3 = "No errors"\nREQ-4 = "Nobody tests it"\n')
    asked = [str(output), str(junit), "--out", str(tmp_path / "trace"), "--requirements", str(known)]
    assert traceability.main(asked) == 0
    assert (tmp_path / "trace/requirements.md").read_text().splitlines()[2:] == [
        "| REQ-1 | It stops | failed | `Rig.Stop.It stops` failed |",
        "| STOP-2 | It waits | passed | `Rig.Stop.It may wait` skipped<br>`test_stop.test_fast` passed |",
        "| REQ-3 | No errors | failed | `test_stop.test_error` failed |",
        "| REQ-4 | Nobody tests it | untested | none |",
        "", "4 requirements: 1 passed, 2 failed, 1 untested",
    ]
    known.write_text('STOP-2 = "It waits"\n')
    odd.write_text("<page/>")
    for files, words in [
        ([output], "Rig.Stop.It stops: REQ-1 is in no line of"), ([odd], "<page> is none of <robot>"), ([known], "syntax error"),
        ([tmp_path / "none.xml"], "No such file"),
    ]:
        assert traceability.main([*map(str, files), "--requirements", str(known), "--out", str(tmp_path / "bad")]) == 2
        assert words in capsys.readouterr().err
    assert not (tmp_path / "bad").exists()


def test_the_page_has_the_keywords_as_libdoc_has_them_and_its_example_is_in_the_suite():
    page = robot_keywords.PAGE.read_text()
    assert page == robot_keywords.page(), "docs/book/robot_keywords.py --write"
    example = page.partition("```robotframework\n")[2].partition("```")[0].partition("*** Test Cases ***\n")[2]
    assert example.strip() in (EXAMPLES / "positioning.robot").read_text()
