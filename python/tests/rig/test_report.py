"""`discrepancy close` from Python: its report as an object, records from files, runs, pandas and asammdf, and what goes wrong."""

import re
import subprocess
import sys
import time
import tomllib
from pathlib import Path
from xml.etree import ElementTree

import airbench_hil
import pytest
from airbench_hil import BadRecords, Own, ProgramFailed, Rig, close, programs, records

ASYMMETRY_PERCENT = 20.0
# One measurement and one report for all.
pytestmark = pytest.mark.xdist_group("report")


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Two measured runs of a rig with friction that its model does not have: one to fit, one held out."""
    folder = tmp_path_factory.mktemp("measured")
    hidden = folder / "hidden.toml"
    hidden.write_text(f"[effects.friction-asymmetry.drive]\nasymmetry_percent = {ASYMMETRY_PERCENT}\n")
    once = tomllib.loads(programs.experiment("point-to-point").read_text())
    once["run"]["repetitions"] = 1

    def measured(name, seed):
        with Rig(once, controller=Own(), sealed=hidden, seed=seed, out=folder / name, summarise=False) as rig:
            return rig.finish()

    return measured("fitted", 11), measured("held-out", 12)


@pytest.fixture(scope="module")
def report(runs, tmp_path_factory):
    fitted, held_out = runs
    return close(None, fitted, held_out, out=tmp_path_factory.mktemp("report"))


def test_the_missing_effect_is_named_with_its_number_and_its_band(report):
    assert report.verdict == "named" and report.adequate and report.confirmed
    [effect] = report.named
    assert (effect.name, effect.place) == ("friction-asymmetry", "drive")
    number = effect["asymmetry_percent"]
    low, high = number.band
    assert low < ASYMMETRY_PERCENT < high and high - low == pytest.approx(4 * number.standard_error)
    with pytest.raises(KeyError, match="has no mass_kg; it has asymmetry_percent"):
        effect["mass_kg"]


def test_the_gap_is_in_units_and_the_files_are_where_it_says(report):
    gap = report.gap["drive_position_m"]
    assert gap.unit == "m" and gap.after < gap.before and gap.closed > 0.9
    assert report.figures["drive_position_m.before"] == gap.before
    assert report.figures["chi2_before"] > report.figures["chi2_after"]
    assert report.page.is_file() and "friction-asymmetry" in report.rig_file.read_text()
    best = report.candidates().iloc[0]
    assert (best["effect"], best["place"], best["fate"]) == ("friction-asymmetry", "drive", "named")
    assert airbench_hil.Report(report.folder).named == report.named
    assert "friction-asymmetry at drive (asymmetry_percent " in repr(report)


def test_a_notebook_shows_verdict_numbers_and_picture(report):
    page = report._repr_html_()
    for text in ("<b>named</b>", "friction-asymmetry at drive", "asymmetry_percent", report.page.as_uri()):
        assert text in page
    drawing = ElementTree.fromstring(re.search(r"<svg.*</svg>", page, re.DOTALL)[0])
    words = [each.text for each in drawing.iter("{http://www.w3.org/2000/svg}text")]
    assert "drive_position_m" in words and any(word.endswith(" before") for word in words)


def test_the_extended_model_runs_as_a_rig(report, tmp_path):
    with Rig("step", controller=Own(), rig_file=report.rig_file, seconds=0.1, out=tmp_path, summarise=False) as rig:
        assert rig.finish().figures["cycles"] == 100


@pytest.mark.usefixtures("asammdf")
def test_a_run_a_frame_and_an_mdf_are_the_same_record(runs, tmp_path):
    pandas = pytest.importorskip("pandas")
    run, _ = runs
    frame = run.measurement
    assert records.file(run, tmp_path / "run") == run.folder / "measurement.csv"
    written = records.file(frame, tmp_path / "frame")
    assert written.read_text().startswith("# linked=false added_mass_kg=0\ntime_s,drive_valve,")
    pandas.testing.assert_frame_equal(pandas.read_csv(written, comment="#"), frame, rtol=0, atol=0)
    by_index = records.file(frame.set_index("time_s"), tmp_path / "index")
    assert by_index.read_text().split("\n")[1:] == written.read_text().split("\n")[1:]
    written_mdf = records.file(run.mdf().filter(list(frame.columns[1:])), tmp_path / "mdf")
    assert written_mdf.read_text().startswith("# linked=false added_mass_kg=0\ntime_s,")
    read = pandas.read_csv(written_mdf, comment="#")[list(frame.columns)]
    pandas.testing.assert_frame_equal(read, frame, rtol=0, atol=0, check_dtype=False)
    with pytest.raises(ValueError, match="neither a column nor an index time_s; it has drive_valve"):
        records.file(frame[["drive_valve"]], tmp_path / "no-time")
    with pytest.raises(ValueError, match="record 3: a file, a Run"):
        records.file(3, tmp_path / "number")


def test_records_that_cannot_be_used_say_which_line_and_their_report_is_there(runs, tmp_path):
    run, _ = runs
    swapped = run.measurement.rename(columns={"drive_pressure_a_Pa": "drive_pressure_b_Pa", "drive_pressure_b_Pa": "drive_pressure_a_Pa"})
    with pytest.raises(BadRecords, match=r"exit code 2:\n.*train-1\.csv:\d+: drive_pressure_a_Pa: pressures a and b are swapped") as bad:
        close(None, swapped, out=tmp_path)
    assert bad.value.exit_code == 2 and bad.value.report.verdict == "bad-data"
    assert bad.value.report.rig_file is None and bad.value.report.gap == {} and bad.value.report.confirmed is None
    assert "<svg" not in bad.value.report._repr_html_()
    # A later call that ends before there is a report does not take the earlier one for its own.
    with pytest.raises(ProgramFailed, match="nowhere.csv") as failed:
        close(None, "nowhere.csv", out=tmp_path)
    assert failed.type is ProgramFailed and failed.value.exit_code == 2


def test_a_killed_interpreter_leaves_no_workflow_running(runs, tmp_path):
    run, _ = runs
    script = "import sys, airbench_hil; airbench_hil.close(None, [sys.argv[1]], out=sys.argv[2])"
    words = [sys.executable, "-c", script, str(run.folder / "measurement.csv"), str(tmp_path)]
    parent = subprocess.Popen(words, cwd=programs.PACKAGE.parent)
    said = tmp_path / "programs/discrepancy.err"
    until = time.monotonic() + 300
    while not (said.exists() and "screening" in said.read_text()):
        assert parent.poll() is None and time.monotonic() < until
        time.sleep(0.005)
    parent.kill()
    parent.wait()

    def left():
        mine = str(tmp_path).encode()
        return [file.parent.name for file in Path("/proc").glob("[0-9]*/cmdline") if mine in _read(file)]

    while left():
        assert time.monotonic() < until, left()
        time.sleep(0.01)
    assert not (tmp_path / "report.json").exists()


def _read(file):
    try:
        return file.read_bytes()
    except OSError:
        return b""  # it has ended meanwhile
