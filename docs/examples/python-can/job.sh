#!/usr/bin/env bash
# What the job does, and what a person does to repeat it: the rig in real time on a bus of its own, and tests of CAN software
# at it. No root, no CAN in the kernel.
#
#   job.sh AIRBENCH     a clone of airbench; its programs are built, unless AIRBENCH_BIN_DIR names a folder with them.
#                       PYTHON: a python that has airbench-hil and pytest; without, a virtual environment is made in ./venv
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
airbench=$(cd "${1:?usage: job.sh AIRBENCH}" && pwd)

if [ -z "${AIRBENCH_BIN_DIR:-}" ]; then
    (cd "$airbench" && cargo build --release --locked --quiet -p emulator)
    AIRBENCH_BIN_DIR="$airbench/target/release"
fi
if [ -z "${PYTHON:-}" ]; then
    python3 -m venv venv
    venv/bin/pip install --quiet "$airbench/python" pytest
    PYTHON=venv/bin/python
fi

folder=$(mktemp -d)
trap 'kill %1 2>/dev/null || true; wait; rm -rf "$folder"' EXIT
"$AIRBENCH_BIN_DIR/emulator" run --bus "unix://$folder/bus0" --rig "$airbench/plant/rig.toml" \
    --experiment "$airbench/controller/experiments/point-to-point.toml" --seconds 120 --out "$folder/run" &

BUS="unix://$folder/bus0" "$PYTHON" -m pytest -p no:cacheprovider "$here"
