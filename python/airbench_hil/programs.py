"""Where the programs and the rig's files are: of the environment, of the installed package, of a checkout, of PATH."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path
from typing import NoReturn

from airbench_hil.errors import ProgramNotFound

PACKAGE = Path(__file__).resolve().parent
#: The variable that names a folder of programs; the second is what the scripts of a checkout use.
VARIABLES = ("AIRBENCH_BIN", "AIRBENCH_BIN_DIR")

#: Files of the rig: where a wheel has them, below the package, and where a checkout does.
_FILES = {
    "rig.toml": ("data/rig.toml", "plant/rig.toml"),
    "rig.dbc": ("data/rig.dbc", "protocol/rig.dbc"),
    "experiments": ("data/experiments", "controller/experiments"),
    "programs": ("data/programs", "controller/programs"),
    "campaigns": ("data/campaigns", "campaign/campaigns"),
    "model-file.schema.json": ("data/model-file.schema.json", "docs/model-file.schema.json"),
    "model-report.schema.json": ("data/model-report.schema.json", "docs/model-report.schema.json"),
}


def checkout() -> Path | None:
    """The clone of airbench that this package lies in; None for an installed one."""
    for folder in PACKAGE.parents:
        if (folder / "protocol/rig.dbc").is_file() and (folder / "Cargo.toml").is_file():
            return folder
    return None


def program(name: str, folder: str | os.PathLike[str] | None = None, *, on_path: bool = True) -> Path:
    """The program of that name: in `folder` if given, else in $AIRBENCH_BIN, the package's bin/, a checkout's target/release, PATH.

    `on_path=False` leaves PATH out.

    :raises ProgramNotFound: it is in none of them, or not in the folder that was asked for.
    """
    asked = [str(folder)] if folder else [os.environ[key] for key in VARIABLES if os.environ.get(key)][:1]
    if asked:
        places = [Path(asked[0])]
    else:
        places = [PACKAGE / "bin"]
        if root := checkout():
            target = Path(os.environ.get("CARGO_TARGET_DIR") or root / "target")
            places.append(target / "release")
    for place in places:
        if os.access(place / name, os.X_OK):
            return (place / name).resolve()
    on_path = on_path and not asked
    if on_path and (found := shutil.which(name)):
        return Path(found).resolve()
    looked = ", ".join(map(str, places)) + (", PATH" if on_path else "")
    raise ProgramNotFound(
        f"the program '{name}' of airbench is not in {looked}. Install a wheel of airbench-hil that holds the programs, build a "
        "checkout (cargo build --release), or name their folder: AIRBENCH_BIN=/path/to/folder"
    )


def front() -> NoReturn:
    """The command `airbench` of a wheel: becomes the program of that name, whose `airbench test` takes this interpreter."""
    try:
        own = program("airbench", on_path=False)  # where this very command is
    except ProgramNotFound as error:
        print(f"airbench: {error}", file=sys.stderr)
        sys.exit(2)
    os.environ.setdefault("AIRBENCH_PYTHON", sys.executable)
    os.execv(own, [str(own), *sys.argv[1:]])


def file(name: str) -> Path:
    """A file or folder of the rig, such as "rig.toml", "rig.dbc", "experiments", "programs" or "campaigns".

    :raises ProgramNotFound: neither the package nor a checkout has it.
    """
    packed, in_checkout = _FILES[name]
    if (PACKAGE / packed).exists():
        return PACKAGE / packed
    root = checkout()
    if root:
        return root / in_checkout
    raise ProgramNotFound(f"{name} is not in {PACKAGE / 'data'}: this airbench-hil was installed without the rig's files")


def experiment(name: str | os.PathLike[str]) -> Path:
    """The file of an experiment, by the name of a shipped one or by its path.

    :raises ValueError: there is none.
    """
    return _shipped("experiment", name, file("experiments"))


def axis_program(name: str | os.PathLike[str]) -> Path:
    """The file of an axis program, by the name of a shipped one or by its path.

    :raises ValueError: there is none.
    """
    return _shipped("program", name, file("programs"))


def campaign(name: str | os.PathLike[str]) -> Path:
    """The file of a campaign, by the name of a shipped one or by its path.

    :raises ValueError: there is none.
    """
    return _shipped("campaign", name, file("campaigns"))


def _shipped(kind: str, name: str | os.PathLike[str], folder: Path) -> Path:
    if Path(name).suffix == ".toml" and Path(name).is_file():
        return Path(name).resolve()
    if (folder / f"{name}.toml").is_file():
        return folder / f"{name}.toml"
    raise ValueError(f"{kind} '{name}': no such file, and none of {', '.join(sorted(p.stem for p in folder.glob('*.toml')))}")
