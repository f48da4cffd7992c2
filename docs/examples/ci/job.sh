#!/usr/bin/env bash
# What the CI job does, and what a person does to repeat it: tests at the rig, in lockstep, with reports.
#
#   job.sh AIRBENCH TESTS REPORTS    a clone of airbench; a folder of tests; where JUnit, traceability and failed runs go
#
# AIRBENCH_WHEEL: a wheel of airbench-hil; without, it is built from the clone, which needs Rust.
# PYTHON: a python that has airbench-hil, pytest and pytest-xdist; without, a virtual environment is made in ./venv.
# The exit code is pytest's: 0 when all passed, 1 when a test failed.
set -euo pipefail
[ $# -eq 3 ] || { sed -n 's/^# \{0,1\}//p' "$0" | sed 1d >&2; exit 2; }
airbench=$1 tests=$2
mkdir -p "$3"
reports=$(cd "$3" && pwd)

if [ -z "${PYTHON:-}" ]; then
    wheel=${AIRBENCH_WHEEL:-$("$airbench/scripts/wheel" --out "$reports/wheel" | tail -n 1)}
    python3 -m venv venv
    venv/bin/pip install --quiet "$wheel[pandas]" pytest pytest-xdist
    PYTHON=venv/bin/python
fi

# Two workers, each rig with a bus of its own; run folders of failures are kept for the artefacts.
"$PYTHON" -m pytest "$tests" -n 2 --junitxml="$reports/junit.xml" --airbench-traceability="$reports/requirements" \
    --airbench-runs="$reports/runs" --airbench-keep=failed
