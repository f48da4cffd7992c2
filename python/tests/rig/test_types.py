"""The package is typed: both checkers find nothing, in their strictest form and in their own."""

import shutil
import subprocess
import sys

from airbench_hil import programs


def check(*words, cwd):
    done = subprocess.run([sys.executable, "-m", *words], capture_output=True, text=True, cwd=cwd)
    assert done.returncode == 0, done.stdout + done.stderr




def test_pyright_finds_nothing():
    check("pyright", "--pythonpath", sys.executable, "airbench_hil", cwd=programs.PACKAGE.parent)


def test_mypy_finds_nothing_and_holds_a_users_file_against_our_types(tmp_path):
    check("mypy", "--strict", "--cache-dir", tmp_path / "cache", "airbench_hil", cwd=programs.PACKAGE.parent)
    shutil.copy(programs.PACKAGE.parent / "pyproject.toml", tmp_path)
    (tmp_path / "user.py").write_text(
        "from airbench_hil import Own, Rig, Sensors\n"
        "def law(sensors: Sensors) -> float:\n    return 8.0 * (0.3 - sensors.position)\n"
        "with Rig('step', controller=[law]) as rig:\n    reveal_type(rig.read('DriveSensors.position'))\n"
        "Rig('step', controller=Own(two='yes'))\n"
    )
    words = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", tmp_path / "cache", tmp_path / "user.py"]
    said = subprocess.run(words, capture_output=True, text=True).stdout
    assert 'Revealed type is "float"' in said.replace("builtins.", "") and said.count("error:") == 1, said
    assert 'Argument "two" to "Own" has incompatible type "str"; expected "bool"' in said, said
