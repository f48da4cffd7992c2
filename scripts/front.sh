# shellcheck shell=bash
# Sourced: how a script becomes a command of `airbench`, the program of this checkout.

# front COMMAND PROGRAM… -- ARGUMENT…: builds airbench and the programs that the command starts, unless AIRBENCH_BIN_DIR has them,
# and becomes the command, which calls itself scripts/COMMAND. Who asks for help or a list does not wait for the programs.
front() {
    local command=$1 programs=(airbench) bin target
    shift
    while [ "$1" != -- ]; do
        case " ${*#-- } " in *" --help "* | *" -h "* | *" --list "*) ;; *) programs+=("$1") ;; esac
        shift
    done
    shift
    # shellcheck disable=SC2154 # root is the sourcing script's
    target=${CARGO_TARGET_DIR:-$root/target}
    [ "${target#/}" != "$target" ] || target="$PWD/$target"
    bin=${AIRBENCH_BIN_DIR:-$target/release}
    if [ -z "${AIRBENCH_BIN_DIR:-}" ]; then
        [ ${#programs[@]} -eq 1 ] || echo "building …"
        trap 'exit 130' INT TERM
        # shellcheck source=scripts/build.sh
        . "$root/scripts/build.sh"
        CARGO_TARGET_DIR="$target" build_programs "${programs[@]}" ||
            { echo "scripts/$command: the build failed" >&2 && exit 2; }
        trap - INT TERM
    fi
    [ -x "$bin/airbench" ] ||
        { echo "scripts/$command: $bin/airbench is missing; build it, or unset AIRBENCH_BIN_DIR" >&2 && exit 2; }
    AIRBENCH_BIN="$bin" AIRBENCH_SHARE="$root" exec -a "scripts/$command" "$bin/airbench" "$command" "$@"
}
