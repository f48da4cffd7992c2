#!/usr/bin/env bash
# Builds what the scripts beside it start into FOLDER, so that it runs in the guest of scripts/vcan-vm too: payload.sh FOLDER.
# PYTHON is one with cantools and python-can; default: that of target/tools/venv, which scripts/test makes. What is there and has
# not changed stays.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$(cd "$here/../../.." && pwd)
python=${PYTHON:-$root/target/tools/venv/bin/python}
export PATH="$root/target/tools/bin:$PATH"
mkdir -p "$1"
folder=$(cd "$1" && pwd)
work=$folder.work
# Two who fill it at once do so one after the other.
exec 9>"$folder.lock"
flock 9

# put FILE...: into the folder, beside a process that may still run the one before.
put() { cp --remove-destination "$@" "$folder"; }

make -s -C "$here" BUILD="$work" "$work/socketcan-answers"
make -s -C "$root/tests/firmware" BUILD="$work" PYTHON="$python" STATIC=-static "$work/firmware-socketcan"
(cd "$root" && cargo rustc --release --quiet --locked -p static-guest -- -C target-feature=+crt-static)
GO111MODULE=off CGO_ENABLED=0 GOCACHE="$work/go" go build -o "$work/listen-and-answer" "$root/tests/go/listen_and_answer.go"
put "$work"/{socketcan-answers,firmware-socketcan,listen-and-answer} "${CARGO_TARGET_DIR:-$root/target}/release/static-guest"
packages=(can wrapt packaging typing_extensions)
packed=$("$python" -c 'import can, importlib.metadata as all, sys; print(sys.version, can.__file__, all.version("python-can"))')
if [ "$(cat "$work/packed" 2>/dev/null)" != "$packed" ]; then
    "$python" "$root/tests/python/packed.py" "$folder" "${packages[@]}"
    echo "$packed" >"$work/packed"
fi
put "$here"/{can-utils,isotp,programs,own-programs}.sh "$root/tests/python/socketcan_guest.py"
