# shellcheck shell=bash
# Sourced, with `root` set: tables that are shown or put between the two marks of a page.

# tables EXAMPLE PAGE [--write]: what an example of `package` prints, of the system tests unless set.
# shellcheck disable=SC2154 # root is the sourcing script's
tables() {
    local text
    text=$(mktemp)
    # shellcheck disable=SC2064 # expanded now: local is gone at the end
    trap "rm -f '$text'" EXIT
    cargo run --quiet --release --manifest-path "$root/Cargo.toml" -p "${package:-system-tests}" --example "$1" >"$text"
    if [ "${3:-}" != --write ]; then
        cat "$text"
        return
    fi
    put_table "$1" "$text" "$2"
}

# put_table NAME FILE PAGE: the file's text between the two marks of that name. A page that lacks them is left as it is, and told.
put_table() {
    local page=$root/$3
    if [ "$(grep -c -x -e "<!-- $1: begin -->" -e "<!-- $1: end -->" "$page")" != 2 ]; then
        echo "$page: not written, the marks '<!-- $1: begin -->' and '<!-- $1: end -->' do not stand there once each" >&2
        return 2
    fi
    awk -v tables="$2" -v name="$1" '
        $0 == "<!-- " name ": begin -->" { print; while ((getline line < tables) > 0) print line; inside = 1 }
        $0 == "<!-- " name ": end -->" { print ""; inside = 0 }
        !inside { print }' "$page" >"$page.new" && mv "$page.new" "$page"
}
