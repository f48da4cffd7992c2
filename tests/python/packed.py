"""Packs a Python that runs where there is none: packed.py FOLDER PACKAGE...

FOLDER gets the interpreter of this script, its library without what is for building and testing, the packages, the shared libraries
of all, and a program `python3` that starts it wherever FOLDER is.
"""

import compileall
import py_compile
import re
import shutil
import subprocess
import sys
import sysconfig
from importlib.util import find_spec
from pathlib import Path

LEFT_OUT = ["test", "tests", "idlelib", "*tkinter*", "turtle*", "lib2to3", "ensurepip", "distutils", "pydoc_data", "*curses*"]
LEFT_OUT += ["config-*", "*-packages", "__pycache__"]
# What every dynamic program of the machine it is for has anyway.
SYSTEMS = re.compile(r"ld-linux|libc\.so|linux-vdso")
START = """#!/bin/sh
here=$(cd "$(dirname "$0")" && pwd)
export PYTHONHOME="$here/python" LD_LIBRARY_PATH="$here/python/libraries:${LD_LIBRARY_PATH-}"
exec "$here/python/python" "$@"
"""


def copy(source, target):
    if source.is_dir():
        shutil.copytree(source, target, ignore=shutil.ignore_patterns(*LEFT_OUT))
    else:
        shutil.copy(source, target)


def main():
    folder, packages = Path(sys.argv[1]), sys.argv[2:]
    home = folder / "python"
    shutil.rmtree(home, ignore_errors=True)
    home.mkdir(parents=True)
    interpreter = Path(sys._base_executable).resolve()
    shutil.copy(interpreter, home / "python")
    library = home / f"lib/python{sys.version_info.major}.{sys.version_info.minor}"
    copy(Path(sysconfig.get_path("stdlib")), library)
    for package in packages:
        origin = Path(find_spec(package).origin)
        origin = origin.parent if origin.name == "__init__.py" else origin
        copy(origin, library / origin.name)
    sys.pycache_prefix = None  # compiled files go with what they are of, wherever this interpreter's own are kept
    compileall.compile_dir(library, quiet=1, invalidation_mode=py_compile.PycInvalidationMode.UNCHECKED_HASH)
    (home / "libraries").mkdir()
    for binary in [interpreter, *library.rglob("*.so")]:
        listed = subprocess.run(["ldd", binary], capture_output=True, text=True, check=False).stdout
        for path in re.findall(r"=> (/\S+)", listed):
            if not SYSTEMS.search(path):
                shutil.copy(path, home / "libraries")
    # Of some interpreters two thirds are for debuggers.
    subprocess.run(["strip", "--strip-unneeded", home / "python", *home.rglob("*.so*")], check=True)
    start = folder / "python3"
    start.write_text(START)
    start.chmod(0o755)


main()
