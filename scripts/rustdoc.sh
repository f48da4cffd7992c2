#!/usr/bin/env bash
# RUSTDOC of scripts/test: the doc tests of a crate as cargo asks for them, then its pages by the same arguments, where a warning
# fails. `cargo doc` would check every crate, and all that it depends on, for these pages alone.
set -euo pipefail

[[ " $* " = *" --test "* ]] || exec rustdoc "$@"

# has_tests FOLDER: whether a block of code in its comments may be Rust. To find none, rustdoc would read the whole crate.
has_tests() {
    ! find "$1" -name '*.rs' -exec cat {} + 2>/dev/null | awk '
        /^ *\/\/[\/!] ```/ { if (!inside && $2 !~ /^```(text|toml)$/) exit 1; inside = !inside }'
}
for argument in "$@"; do
    if [[ $argument = *.rs ]] && has_tests "$(dirname "$argument")"; then rustdoc "$@"; fi
done
page=()
while [ $# -gt 0 ]; do
    case $1 in
        --test) ;;
        --test-*) shift ;;
        *) page+=("$1") ;;
    esac
    shift
done
# Links to what is private are for those who read the source.
exec rustdoc "${page[@]}" -D warnings -A rustdoc::private_intra_doc_links --out-dir target/doc
