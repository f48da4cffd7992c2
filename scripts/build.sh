# shellcheck shell=bash
# Sourced, with `root` set: how the programs are built, for all scripts alike.

# What ships. All of it is chosen whichever part is built, so that what it is made of has the same features every time, and is made
# once.
shipped=(-p emulator -p controller -p bench -p discrepancy -p campaign -p plant-fmu -p front)

# build_programs PROGRAM… [-- OPTION…]: the programs as they ship.
build_programs() {
    local chosen=()
    while [ $# -gt 0 ] && [ "$1" != -- ]; do
        chosen+=(--bin "$1")
        shift
    done
    # shellcheck disable=SC2154 # root is the sourcing script's
    (cd "$root" && cargo build --release --locked --quiet "${shipped[@]}" "${chosen[@]}" "${@:2}")
}

# portably COMMAND…: what cargo builds in it runs with the oldest C library that packages are for; after install_zig of tools.sh.
# Cargo does not link anew what was linked otherwise, so a target folder has one or the other.
portably() {
    # shellcheck disable=SC2154 # tools is the sourcing script's
    local -x "CARGO_TARGET_$(uname -m | tr '[:lower:]' '[:upper:]')_UNKNOWN_LINUX_GNU_LINKER=$tools/zig/link"
    "$@"
}

# build_portable PROGRAM… [-- OPTION…]: build_programs so, into $portable.
build_portable() {
    portable="${CARGO_TARGET_DIR:-$root/target}/portable"
    install_zig && CARGO_TARGET_DIR="$portable" portably build_programs "$@" && portable="$portable/release"
}
