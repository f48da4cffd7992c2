#!/usr/bin/env bash
# RUSTC_WORKSPACE_WRAPPER of scripts/test: Clippy's compiler, which is the compiler and warns. With CHECK_PROGRAMS=yes a program is
# checked, and neither compiled nor linked: what no test starts needs none of it. Cargo accepts that its file is missing.
set -euo pipefail

if [ "${CHECK_PROGRAMS:-}" = yes ] && [[ " $* " == *" --emit=dep-info,link "* && " $* " != *" build_script_"* && " $* " != *" proc-macro "* ]]; then
    set -- "${@/#--emit=dep-info,link/--emit=dep-info,metadata}"
fi
exec "$CLIPPY_DRIVER" "$@"
