"""The wheel in a new environment without a compiler, and the page "Your first test in ten minutes" as a reader follows it there."""

import os
import re
import subprocess
import sys
from pathlib import Path

from conftest import ROOT, emulator

PAGE = ROOT / "docs/first-test.md"
TOOLS = Path(sys.prefix).parent


def uv(*words):
    """uv without the network: what it installs, scripts/tools.sh has fetched."""
    environment = {**os.environ, "UV_CACHE_DIR": str(TOOLS / "uv/cache"), "UV_OFFLINE": "1"}
    done = subprocess.run([TOOLS / "uv/bin/uv", *words], capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr


def environment(folder):
    """Puts the wheel's environment into the folder's `venv`, and the files of the page."""
    built = subprocess.run(
        [ROOT / "scripts/wheel", "--bin", emulator().parent, "--out", folder], capture_output=True, text=True,
        env={**os.environ, "tools": str(TOOLS), "UV_OFFLINE": "1"},
    )
    assert built.returncode == 0, built.stderr
    [wheel] = folder.glob("*.whl")
    assert re.fullmatch(r"airbench_hil-[\d.]+-py3-none-manylinux_2_\d+_\w+\.whl", wheel.name)
    uv("venv", "--quiet", "--python", sys.executable, folder / "venv")
    uv("pip", "install", "--quiet", "--python", folder / "venv/bin/python", "--constraint", ROOT / "python/requirements.txt",
       f"{wheel}[pandas]", "pytest")
    for name, text in re.findall(r"`(test_\w+\.py)`:\n\n```python\n(.*?)```", PAGE.read_text(), re.DOTALL):
        (folder / name).write_text(text)


def run(folder, *words):
    """pytest there, with nothing of ours or of the system's in the environment."""
    environment = {"PATH": str(folder / "venv/bin"), "HOME": str(folder), "AIRBENCH_PYTEST_LOCK": str(folder / "lock")}
    done = subprocess.run([folder / "venv/bin/python", "-m", "pytest", *words], cwd=folder, env=environment, capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr


def expect_front_command(folder):
    """`airbench` of the wheel: a run, the tests with the interpreter whose command it is, and an FMU."""
    environment = {"PATH": "/usr/bin:/bin", "HOME": str(folder), "AIRBENCH_PYTEST_LOCK": str(folder / "lock")}
    [rig] = folder.glob("venv/lib/python3*/site-packages/airbench_hil/data/rig.toml")
    for words, printed in {
        ("run", "--lockstep", "--out", "run"): "passed                                        yes",
        ("test", "-q", "test_first.py"): "passed",
        ("bench", "export-fmu", "--rig", rig, "--out", "plant.fmu"): "plant.fmu: FMI 2.0 co-simulation",
    }.items():
        command = [folder / "venv/bin/airbench", *words]
        done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
        assert done.returncode == 0 and printed in done.stdout, done.stdout + done.stderr


def test_from_the_wheel_without_a_compiler_the_page_goes_as_it_says(tmp_path):
    environment(tmp_path)
    code, said = run(tmp_path, "test_mine.py")
    assert code == 1, said
    shown = re.search(r"```\n(E .*?)\n        …", PAGE.read_text(), re.DOTALL)[1]
    assert shown in said, said
    mine = tmp_path / "test_mine.py"
    text = mine.read_text()
    gain = re.search(r"With `(GAIN = [\d.]+)` the test passes", PAGE.read_text())[1]
    mine.write_text(text.replace("GAIN = 2.0", gain))
    # With the ten lines of test_first.py.
    code, said = run(tmp_path, "--junitxml=junit.xml", "--airbench-traceability=report")
    assert code == 0 and "3 passed" in said, said
    assert '<property name="requirement" value="REQ-1"' in (tmp_path / "junit.xml").read_text()
    assert "| REQ-1 |  | passed |" in (tmp_path / "report/requirements.md").read_text()
    expect_front_command(tmp_path)
