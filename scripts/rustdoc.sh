#!/usr/bin/env bash
# RUSTDOC of scripts/test: the doc tests of a crate as cargo asks for them, then its pages by the same arguments, where a warning
# fails. `cargo doc` would check every crate, and all that it depends on, for these pages alone.
set -euo pipefail

rustdoc "$@"
[[ " $* " = *" --test "* ]] || exit 0
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
