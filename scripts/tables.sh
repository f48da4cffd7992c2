# shellcheck shell=bash
# Sourced, with `root` set: tables that an example of the system tests prints, shown or put between the two marks of a page.

# tables EXAMPLE PAGE [--write]
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
    awk -v tables="$text" -v name="$1" '
        $0 == "<!-- " name ": begin -->" { print; while ((getline line < tables) > 0) print line; inside = 1 }
        $0 == "<!-- " name ": end -->" { print ""; inside = 0 }
        !inside { print }' "$root/$2" >"$root/$2.new" && mv "$root/$2.new" "$root/$2"
}
