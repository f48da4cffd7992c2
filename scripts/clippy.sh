#!/usr/bin/env bash
# RUSTC_WRAPPER of scripts/test. Cargo leaves it out of what it compares, so libraries and programs are compiled once, as they ship,
# and the tests stand on them. A warning in a crate of the workspace fails.
#
#   a library   is compiled; Clippy reads its source in the executable of its own tests
#   a program   is checked by Clippy and compiled; with CHECK_PROGRAMS=yes only checked, for what no test starts: cargo accepts that its
#               file is missing
#   a test      is compiled by Clippy's compiler, which is the compiler and warns, with checks of overflow and debug assertions
set -euo pipefail

compiler=$1
shift
arguments=" $* "
if [[ ${CARGO_MANIFEST_DIR:-} != "$PWD"/* || $arguments == *" build_script_"* || $arguments == *" proc-macro "* ]]; then
    exec "$compiler" "$@"
fi

if [[ $arguments == *" --test "* ]]; then
    # The others' own tests take less time than their optimisation.
    case $CARGO_PKG_NAME in
        independent-solver | plant | record-maker) level=2 ;;
        discrepancy) level=1 ;;
        *) level=0 ;;
    esac
    exec "$CLIPPY_DRIVER" "$compiler" "$@" -C "opt-level=$level" -C codegen-units=1 -C overflow-checks -C debug-assertions
fi

if [[ $arguments == *" --crate-type bin "* ]]; then
    checked=("${@/#--emit=dep-info,link/--emit=dep-info,metadata}")
    [ "${CHECK_PROGRAMS:-}" != yes ] || exec "$CLIPPY_DRIVER" "$compiler" "${checked[@]}"
    "$CLIPPY_DRIVER" "$compiler" "${checked[@]}"
fi
exec "$compiler" "$@" -D warnings
