"""Model files and their reports from Python: held against their schemas, closed, and what goes wrong."""

import json
import math

import pytest
from airbench_hil import BadModel, ModelFile, ModelReport, ProgramFailed, Report, close_model
from conftest import ROOT

SHIPPED = sorted((ROOT / "discrepancy/models").glob("*.toml"))
DRAG_PER_S = 0.4
DECAY = """
[parameters]
g = { unit = "m/s^2", value = 9.81, fixed = true }
[states.speed]
unit = "m/s"
start = 0
derivative = "-g"
[outputs.v]
unit = "m/s"
value = "speed"
[[suspects]]
name = "drag"
place = "speed"
add = "-k*speed"
parameters.k = { unit = "1/s", value = 0.1, range = [0, 10] }
[[suspects]]
use = "sensor/offset"
place = "v"
"""


def fall(seconds):
    """Times, and the speed of a body that falls from rest with linear drag, with a deterministic wobble for noise."""
    times = [0.02 * sample for sample in range(round(seconds / 0.02))]
    wobble = [0.01 * math.sin(12.9898 * (sample + 1) ** 2) for sample in range(len(times))]
    return times, [9.81 / DRAG_PER_S * (math.exp(-DRAG_PER_S * t) - 1) + w for t, w in zip(times, wobble, strict=True)]


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    pandas = pytest.importorskip("pandas")
    folder = tmp_path_factory.mktemp("models")
    (folder / "fall.toml").write_text(DECAY)
    train, test = (pandas.DataFrame(dict(zip(("t_s", "v"), fall(seconds), strict=True))).set_index("t_s") for seconds in (3, 5))
    return close_model(folder / "fall.toml", train, test, out=folder / "out")


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_a_shipped_model_file_fits_the_schema(path):
    model = ModelFile(path)
    assert len(model.suspects()) == len(model.data["suspects"]) > 0 and all(model.suspects())


@pytest.mark.xdist_group("models")
def test_a_model_is_closed_and_its_report_is_an_object(report):
    assert (report.verdict, report.confirmed) == ("named", True)
    [missing] = report.named
    assert (missing.suspect, missing.place) == ("drag", "equation of speed")
    number = report["drag.k"]
    assert number == report["k"] and number.unit == "1/s" and number.value == pytest.approx(DRAG_PER_S, rel=0.05)
    assert next(iter(report.probabilities)) == "drag" and report.page.is_file()
    extended = ModelFile(report.model_file)
    assert [term["name"] for term in extended.data["terms"]] == ["drag"]
    with pytest.raises(KeyError, match=r"has no mass; it has drag\.k"):
        report["mass"]


@pytest.mark.xdist_group("models")
def test_a_name_that_is_taken_back_is_in_no_model_file(report, tmp_path):
    """The held-out body falls without drag."""
    frames = [dict(zip(("t_s", "v"), fall(3), strict=True)), {"t_s": fall(3)[0], "v": [-9.81 * t for t in fall(3)[0]]}]
    files = [tmp_path / "drag.csv", tmp_path / "free.csv"]
    for file, frame in zip(files, frames, strict=True):
        file.write_text("t_s,v\n" + "".join(f"{t},{v}\n" for t, v in zip(frame["t_s"], frame["v"], strict=True)))
    (tmp_path / "fall.toml").write_text(DECAY)
    back = close_model(tmp_path / "fall.toml", files[0], files[1], out=tmp_path / "out", threads=1)
    assert back.taken_back and back.confirmed is False and [one.suspect for one in back.named] == ["drag"]
    assert back.headline.startswith("drag is taken back: on free.csv v gets worse, ")
    assert back.model_file is None and not (tmp_path / "out/fall.toml").exists()
    [left] = back.held_out
    assert (left.record, left.output) == ("free.csv", "v") and left.rms_after > left.rms_before
    assert "What was named, and is taken back" in back.page.read_text()
    assert not report.taken_back and report.located is not None and report.notes == report.data["notes"]


@pytest.mark.xdist_group("models")
def test_a_search_writes_its_term_into_the_model_file(tmp_path):
    (tmp_path / "fall.toml").write_text(DECAY.partition("[[suspects]]")[0])
    (tmp_path / "drag.csv").write_text("t_s,v\n" + "".join(f"{t},{v}\n" for t, v in zip(*fall(3), strict=True)))
    found = close_model(tmp_path / "fall.toml", tmp_path / "drag.csv", discover=True, out=tmp_path / "out")
    assert found.verdict == "outside-catalogue" and found.discovered and not found.named
    assert found[f"{found.discovered[0].name}.k_found"].value != 0 and found.discovered[0].place == "equation of speed"
    assert ModelFile(found.model_file).data["terms"]


@pytest.mark.xdist_group("models")
def test_a_report_that_does_not_fit_says_where(report, tmp_path):
    damaged = json.loads((report.folder / "report.json").read_text())
    damaged["suspects"][1]["probability"] = 2
    del damaged["parameters"][0]["unit"]
    (tmp_path / "report.json").write_text(json.dumps(damaged))
    with pytest.raises(BadModel) as bad:
        ModelReport(tmp_path)
    name = damaged["suspects"][1]["suspect"]
    assert bad.value.errors == [
        "parameters[0] (k): unit is missing", f"suspects[1] ({name}).probability: 2 is greater than the maximum of 1",
    ]
    with pytest.raises(ValueError, match="read it with ModelReport"):
        Report(report.folder)
    (tmp_path / "report.json").write_text('{"summary": "of a rig file"}')
    with pytest.raises(BadModel, match=r"report\.json: the report of a rig file: read it with airbench_hil\.Report"):
        ModelReport(tmp_path)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("start = 0", "begin = 0", ["states.speed: unknown key 'begin'; there are derivative, guess, range,", "states.speed: start is missing"]),
        ("range = [0, 10]", "range = [0]", ["suspects[0] (drag).parameters.k.range: [0] is too short"]),
        ('add = "-k*speed"', "", ["suspects[0] (drag): one of add, multiply, replace is asked"]),
        ('use = "sensor/offset"', 'use = "offset"', ["suspects[1].use: 'offset' does not match"]),
        ("start = 0", "start = true", ["states.speed.start: True is none of number, string"]),
        ('[outputs.v]\nunit = "m/s"\nvalue = "speed"', "", ["outputs is missing"]),
        ("[parameters]", "[parameters", ["Expected ']' at the end of a table declaration (at line 2, column 12)"]),
    ],
)
def test_a_wrong_file_says_each_place(old, new, said, tmp_path):
    file = tmp_path / "wrong.toml"
    file.write_text(DECAY.replace(old, new))
    with pytest.raises(BadModel) as bad:
        ModelFile(file)
    assert len(bad.value.errors) == len(said), bad.value.errors
    assert all(error.startswith(start) for error, start in zip(bad.value.errors, said, strict=True)), bad.value.errors
    assert str(bad.value).startswith(f"{file}: ")


def test_an_expression_that_the_schema_cannot_judge_is_judged_by_the_program(tmp_path):
    file = tmp_path / "wrong.toml"
    file.write_text(DECAY.replace('"-g"', '"-h"'))
    with pytest.raises(ProgramFailed, match=r"wrong\.toml:7:\d+") as failed:
        ModelFile(file).explain()
    assert failed.value.exit_code == 2
    file.write_text(DECAY)
    assert "drag" in ModelFile(file).explain()
