# shellcheck shell=bash
# Sourced: reads JSON without another program than awk.

# json_lines FILE: a line for each scalar of the file, its path and its value: `named[0].where.axis drive`. Strings are as
# written, without their quotes; empty lists and objects have no line.
json_lines() {
    tr '\n\t' '  ' <"$1" | awk '
        function path(    level, text) {
            for (level = 1; level <= depth; level++)
                text = text (list[level] ? "[" at[level] "]" : (text == "" ? "" : ".") key[level])
            return text
        }
        function value(text) {
            if (expects_key) { key[depth] = text; return }
            print path() " " text
        }
        {
            depth = 0; word = ""; inside = 0; length_ = length($0)
            for (i = 1; i <= length_; i++) {
                c = substr($0, i, 1)
                if (inside) {
                    if (c == "\\") { word = word c substr($0, ++i, 1) }
                    else if (c == "\"") { inside = 0; value(word); word = "" }
                    else word = word c
                    continue
                }
                if (c == "\"") { inside = 1; continue }
                if (c !~ /[][{}:, ]/) { word = word c; continue }
                if (word != "") { value(word); word = "" }
                if (c == "{") { depth++; list[depth] = 0; key[depth] = ""; expects_key = 1 }
                else if (c == "[") { depth++; list[depth] = 1; at[depth] = 0; expects_key = 0 }
                else if (c == "}" || c == "]") { depth--; expects_key = 0 }
                else if (c == ":") expects_key = 0
                else if (c == ",") { if (list[depth]) at[depth]++; expects_key = !list[depth] }
            }
        }'
}

# json_value LINES PATH: the value at a path of what json_lines told; nothing when it is not there or null.
json_value() {
    awk -v wanted="$2" '$1 == wanted { sub(/^[^ ]+ /, ""); if ($0 != "null") print; exit }' "$1"
}
