"""Campaigns from Python: the same files and the same bytes as by the program, as a frame."""

import subprocess

import pytest
from airbench_hil import Campaign, ProgramFailed, campaign, programs

GAINS = {
    "title": "Gains", "experiment": "step", "seconds": 3.0, "draws": 2,
    "collect": {"figures": ["position_overshoot_ratio", "position_rise_s"]},
    "vary": [
        {"set": "drive.algorithm.gain_per_s", "list": [15, 25]},
        {"rig": "friction.viscous_n_per_mm_per_s", "range": [0.5, 2.0], "log": True},
    ],
}


def test_tables_make_a_campaign_whose_runs_are_a_frame_with_units(tmp_path):
    made = campaign(GAINS, out=tmp_path / "gains")
    assert made.complete and made.passed and made.page.is_file()
    runs = made.runs
    assert list(runs["drive.algorithm.gain_per_s"]) == [15, 15, 25, 25] and runs.attrs["units"]["position_rise_s"] == "s"
    # Each combination of lists meets the same draws, and a higher gain rises faster in each.
    rise = runs.pivot(index="draw", columns="drive.algorithm.gain_per_s", values="position_rise_s")
    assert (rise[25] < rise[15]).all()
    page = made._repr_html_()
    assert "4 runs, of which 4 are shown" in page and "position_rise_s" in page and made.page.as_uri() in page
    # The program alone makes the same bytes of the same file.
    words = [programs.program("campaign"), "run", made.file, "--out", tmp_path / "by-hand", "--shipped", programs.file("experiments").parent]
    subprocess.run(words, check=True, capture_output=True)
    assert (tmp_path / "by-hand/runs.csv").read_bytes() == (made.folder / "runs.csv").read_bytes()


def test_one_of_its_runs_again_has_its_figures_and_its_files(tmp_path):
    made = campaign(GAINS | {"seconds": 600.0, "draws": 1}, out=tmp_path)
    run = made.repeat(1)
    assert run.figures["position_rise_s"] == pytest.approx(made.runs["position_rise_s"][1], rel=1e-12)
    assert run.folder == tmp_path / "repeated/1" and len(run.measurement) == run.figures["cycles"]
    with pytest.raises(ProgramFailed, match="exit code 2:"):
        made.repeat(99)


def test_shards_fill_one_folder_and_the_last_one_completes_it(tmp_path):
    tables = GAINS | {"runs_per_part": 1}
    first = campaign(tables, out=tmp_path, shard=(0, 2))
    assert not first.complete and "not complete" in first._repr_html_()
    with pytest.raises(FileNotFoundError):
        first.runs
    second = campaign(tables, out=tmp_path, shard=(1, 2))
    # A shard merges nothing; the whole finds all parts there.
    whole = campaign(tables, out=tmp_path, jobs=1)
    assert whole.complete and len(whole.runs) == 4 and len(Campaign(second.file, tmp_path).runs) == 4


def test_bounds_are_judged_and_bad_input_is_the_programs_message(tmp_path):
    # In 3 s no experiment comes to its end.
    assert campaign(GAINS, out=tmp_path / "late", expect_passed=True).passed is False
    with pytest.raises(ProgramFailed, match="(?s)exit code 2:\n.*run 0: --set drive.algorithm.gain_per_sec: no such variable") as failed:
        campaign(GAINS | {"vary": [{"set": "drive.algorithm.gain_per_sec", "list": [1]}]}, out=tmp_path / "wrong")
    assert failed.value.exit_code == 2
    with pytest.raises(ValueError, match="campaign 'gain': no such file, and none of faults, gains"):
        campaign("gain")
