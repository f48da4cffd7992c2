# shellcheck shell=bash
# Sourced, with `root` set: tables that are shown or put between the two marks of a page.

# tables EXAMPLE PAGE [--write]: what an example of the system tests prints.
# shellcheck disable=SC2154 # root is the sourcing script's
tables() {
    local text
    text=$(mktemp)
    # shellcheck disable=SC2064 # expanded now: local is gone at the end
    trap "rm -f '$text'" EXIT
    cargo run --quiet --release --manifest-path "$root/Cargo.toml" -p system-tests --example "$1" >"$text"
    if [ "${3:-}" != --write ]; then
        cat "$text"
        return
    fi
    put_table "$1" "$text" "$2"
}

# put_table NAME FILE PAGE: the file's text between the two marks of that name.
put_table() {
    awk -v tables="$2" -v name="$1" '
        $0 == "<!-- " name ": begin -->" { print; while ((getline line < tables) > 0) print line; inside = 1 }
        $0 == "<!-- " name ": end -->" { print ""; inside = 0 }
        !inside { print }' "$root/$3" >"$root/$3.new" && mv "$root/$3.new" "$root/$3"
}
