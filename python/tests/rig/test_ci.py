"""The job of docs/ci.md as it is called by GitHub's and GitLab's files, and the reports that docs/requirements.md prints."""

import os
import re
import shutil
import subprocess
import sys

import pytest
from conftest import ROOT

JOB = ROOT / "docs/examples/ci"
PAGE = ROOT / "docs/requirements.md"


def job(folder, tests):
    """The job's exit code, what it said, and its reports."""
    environment = {**os.environ, "PYTHON": sys.executable, "PYTHONDONTWRITEBYTECODE": "1"}
    words = [JOB / "job.sh", ROOT, tests, folder / "reports"]
    done = subprocess.run(words, capture_output=True, text=True, cwd=folder, env=environment)
    return done.returncode, done.stdout + done.stderr, folder / "reports"


def block(name):
    """A part of the page between its markers."""
    return re.search(rf"<!-- {name}: begin -->\n\n(.*?)\n<!-- {name}: end -->", PAGE.read_text(), re.DOTALL)[1]


def test_the_job_passes_and_its_reports_are_those_of_the_page(tmp_path):
    code, said, reports = job(tmp_path, JOB / "tests")
    assert code == 0 and "3 passed" in said, said
    assert (reports / "requirements/requirements.md").read_text() == block("passing")
    shown = re.search(r"```\n(\[REQUIREMENT\].*?)```", PAGE.read_text(), re.DOTALL)[1]
    assert shown in (reports / "requirements/requirements.sdoc").read_text()
    assert (reports / "requirements/needs.json").is_file() and list((reports / "runs").iterdir()) == []


def test_a_job_that_fails_says_so_and_keeps_the_run(tmp_path):
    tests = shutil.copytree(JOB / "tests", tmp_path / "tests", ignore=shutil.ignore_patterns("__pycache__"))
    controller = tests / "controller.py"
    controller.write_text(controller.read_text().replace("20.0", "8.0"))
    code, said, reports = job(tmp_path, tests)
    assert code == 1 and "1 failed, 2 passed" in said, said
    assert (reports / "requirements/requirements.md").read_text() == block("failing")
    [folder] = (reports / "runs").iterdir()
    assert folder.name == "test_controller.py-test_a_hand_does_not_move_it_for_good" and (folder / "bus.log").is_file()
    assert re.search(r"```xml\n(.*?)\n```", PAGE.read_text())[1] in (reports / "junit.xml").read_text()
    # A mark that names no requirement, as the page shows it.
    file = tests / "test_controller.py"
    file.write_text(file.read_text().replace('"HOLD-1")', '"HOLD-7")'))
    done = subprocess.run([sys.executable, "-m", "pytest", "-p", "no:cacheprovider", tests], capture_output=True, text=True)
    shown = re.search(r"```\n(ERROR: .*?)\n```", PAGE.read_text())[1]
    assert done.returncode == 4 and shown in done.stderr, done.stderr


def test_the_page_shows_the_files_of_the_example():
    page = PAGE.read_text()
    assert re.search(r"```toml\n(.*?)```", page, re.DOTALL)[1] == (JOB / "tests/requirements.toml").read_text()
    assert re.search(r"```python\n(.*?)```", page, re.DOTALL)[1] in (JOB / "tests/test_controller.py").read_text()


@pytest.mark.parametrize("schema, files, right, wrong", [
    (
        "vendor.github-workflows",
        [JOB / "github.yml", ROOT / "docs/examples/python-can/workflow.yml", *sorted((ROOT / ".github/workflows").glob("*.yml"))],
        "runs-on:", "run-on:",
    ),
    ("vendor.gitlab-ci", [JOB / "gitlab-ci.yml"], "timeout: 20 minutes", "timeout: [20]"),
], ids=["github", "gitlab"])
def test_files_of_ci_keep_the_schemas_of_their_services(schema, files, right, wrong, tmp_path):
    words = [sys.executable, "-m", "check_jsonschema", "--builtin-schema", schema]
    done = subprocess.run([*words, *files], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    for number, file in enumerate(files):
        (tmp_path / f"{number}.yml").write_text(file.read_text().replace(right, wrong))
    done = subprocess.run([*words, *tmp_path.iterdir()], capture_output=True, text=True)
    assert done.returncode == 1 and all(f"/{number}.yml::" in done.stdout for number in range(len(files))), done.stdout


def test_both_services_call_the_job_with_what_they_keep():
    github, gitlab = ((JOB / name).read_text() for name in ("github.yml", "gitlab-ci.yml"))
    call = "airbench/docs/examples/ci/job.sh airbench tests reports\n"
    assert f"        run: {call}" in github and f"    - {call}" in gitlab
    assert "path: reports\n" in github and "      junit: reports/junit.xml\n" in gitlab
    for text, name in ((github, "requirements/requirements.md"), (gitlab, "junit.xml")):
        assert f"reports/{name}" in text
