"""Puts the rig's files into the package, and the programs of the folder $AIRBENCH_WHEEL_BIN (scripts/wheel); without it the wheel is pure."""

import os
import platform
import re
from pathlib import Path

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

FILES = {
    "plant/rig.toml": "data/rig.toml",
    "protocol/rig.dbc": "data/rig.dbc",
    "controller/experiments": "data/experiments",
    "controller/programs": "data/programs",
    "discrepancy/experiments/held-out.toml": "data/held-out.toml",
    "latency/bounds.toml": "data/latency-bounds.toml",
    "latency/bounds-spin.toml": "data/latency-bounds-spin.toml",
    "campaign/campaigns": "data/campaigns",
    "docs/model-file.schema.json": "data/model-file.schema.json",
    "docs/model-report.schema.json": "data/model-report.schema.json",
}


def glibc_of(programs):
    """The newest version of the C library that any of them asks for, as (2, minor): manylinux_2_MINOR (PEP 600)."""
    versions = [int(found) for path in programs for found in re.findall(rb"GLIBC_2\.(\d+)\0", path.read_bytes())]
    return 2, max(versions)


class Hook(BuildHookInterface):
    """The build hook of hatchling."""

    def initialize(self, version, build_data):
        """Adds the files, and says for which machines the wheel is. An editable package finds them in the checkout."""
        root = Path(self.root).parent
        if version == "editable" or not (root / "protocol/rig.dbc").is_file():
            return
        for source, target in FILES.items():
            build_data["force_include"][str(root / source)] = f"airbench_hil/{target}"
        folder = os.environ.get("AIRBENCH_WHEEL_BIN")
        if folder and self.target_name == "wheel":
            programs = sorted(Path(folder).iterdir())
            for program in programs:
                build_data["force_include"][str(program)] = f"airbench_hil/bin/{program.name}"
            build_data["pure_python"] = False
            build_data["tag"] = "py3-none-manylinux_{}_{}_{}".format(*glibc_of(programs), platform.machine())
