# shellcheck shell=bash
# Sourced, with `root` set: how the programs are built, for all scripts alike.

# build_programs PROGRAM… [-- OPTION…]: the programs as they ship. All packages are chosen whichever are built, so that what they
# are made of has the same features every time, and is made once.
build_programs() {
    local chosen=()
    while [ $# -gt 0 ] && [ "$1" != -- ]; do
        chosen+=(--bin "$1")
        shift
    done
    # shellcheck disable=SC2154 # root is the sourcing script's
    (cd "$root" && cargo build --release --locked --quiet -p emulator -p controller -p bench -p discrepancy -p campaign \
        -p plant-fmu -p front \
        "${chosen[@]}" "${@:2}")
}
