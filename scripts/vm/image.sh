# shellcheck shell=bash
# shellcheck disable=SC2154,SC2034 # names shared with vcan-vm, which sources this
# Builds the guest's initramfs; sourced by vcan-vm.
#
# Two cpio archives one after the other, which the kernel unpacks in turn: the base (busybox, dash, ip, can-utils,
# cyclictest, modules, init) is cached on the sum of its contents; the payload (the job and /airbench) is made afresh for each call.
#
# Expects $cache, $root, $scripts, $out, the options, say, fail and packages.sh.

# First line: what init loads; second: with --cards; third: there for a job to modprobe.
kernel_modules=(
    virtio_pci virtio_blk can can_raw can_dev vcan
    sja1000 kvaser_pci
    vxcan can_isotp can_bcm can_gw slcan
)

# pack FOLDER: a cpio archive of it on standard output, as root's files, whoever packs them.
pack() {
    find_program cpio cpio
    (cd "$1" && find . -mindepth 1 -print0 | run_unpacked "$found_program" --quiet -0 -o -H newc -R +0:+0)
}

# add_program TREE FILE NAME: a program and its shared libraries, loader included, as ldd finds them here.
add_program() {
    local library listing libraries=()
    install -D "$2" "$1/usr/bin/$3"
    listing=$(run_unpacked ldd "$2" 2>&1) || return 0 # static
    if [[ $listing == *'not found'* ]]; then fail "$exit_no_boot" "$2 lacks libraries: $listing"; fi
    mapfile -t libraries < <(grep -o '/[^ ]*' <<<"$listing")
    for library in "${libraries[@]}"; do
        case $library in
            *ld-linux*) install -D "$library" "$1/lib64/${library##*/}" ;;
            *) install -D "$library" "$1/usr/lib/${library##*/}" ;;
        esac
    done
}

# gather_base TREE: everything the guest has before the payload is added.
gather_base() {
    local tree=$1 program
    mkdir -p "$tree"/{bin,dev,proc,sys,tmp,lib,lib64,usr/bin,usr/lib,results}
    # Always unpacked: installing busybox-static would remove the package busybox.
    find_unpacked busybox-static busybox
    install "$found_program" "$tree/bin/busybox"
    # Not busybox's shell: that one runs its own ip, which knows no `type vcan`, whatever PATH says.
    # (So do its commands that start others, such as timeout and xargs: give those /usr/bin/ip.)
    find_program dash dash
    add_program "$tree" "$found_program" dash
    ln -s ../usr/bin/dash "$tree/bin/sh"
    find_program iproute2 ip
    add_program "$tree" "$found_program" ip
    for program in candump cansend cangen canplayer cansniffer canbusload isotpsend isotprecv; do
        find_program can-utils "$program"
        add_program "$tree" "$found_program" "$program"
    done
    # The reference beside our own figures.
    find_program rt-tests cyclictest
    add_program "$tree" "$found_program" cyclictest
    cp -r "$cache/kernel-$kernel/lib/modules" "$tree/lib/"
    install "$scripts/vm/init" "$tree/init"
}

# Sets $base_image.
build_base_image() {
    local sum
    staging=$(mktemp -d -p "$cache")
    gather_base "$staging"
    sum=$(cd "$staging" && find . -type f -print0 | LC_ALL=C sort -z | xargs -0 sha256sum | sha256sum | cut -c 1-16)
    base_image=$cache/base-$kernel-$sum.cpio
    if [[ ! -f $base_image ]]; then
        say "building the initramfs ($(du -sh "$staging" | cut -f 1))"
        rm -f "$cache/base-$kernel-"*.cpio
        pack "$staging" >"$cache/base.new"
        mv "$cache/base.new" "$base_image"
    fi
    rm -rf "$staging"
    staging=''
}

# the_only NAME OPTION: sets $found_file to the one file NAME of the checkout; people must say which if there are more.
the_only() {
    local found=()
    mapfile -t found < <(find "$root" \( -name target -o -name runs -o -name '.git*' \) -prune -o -type f -name "$1" -print)
    ((${#found[@]} == 1)) || fail "$exit_usage" "found ${#found[@]} files named $1 in the checkout, not one: give $2"
    found_file=${found[0]}
}

# add_binaries TREE: the programs as they ship, from where AIRBENCH_BIN_DIR says or built, with their libraries.
add_binaries() {
    local folder=${AIRBENCH_BIN_DIR:-} program programs=(airbench emulator controller bench)
    if [[ -z $folder ]]; then
        type -P cargo >/dev/null || fail "$exit_usage" "no cargo to build the programs with"
        say "building ${programs[*]}"
        folder=${CARGO_TARGET_DIR:-$root/target}/release
        build_programs "${programs[@]}" 8>&- || fail "$exit_usage" "one of ${programs[*]} cannot be built"
    fi
    shipped_bench=$folder/bench
    for program in "${programs[@]}"; do
        add_program "$1" "$folder/$program" "$program"
    done
}

# Makes $out/vm/initramfs.cpio of the base and what belongs to this call.
add_payload() {
    local tree=$out/vm/payload
    mkdir -p "$tree/airbench"
    if [[ $binaries == yes ]]; then
        if [[ -z $rig ]]; then the_only rig.toml --rig && rig=$found_file; fi
        if [[ -z $experiment ]]; then the_only point-to-point.toml --experiment && experiment=$found_file; fi
        [[ -f $rig && -f $experiment ]] || fail "$exit_usage" "no such file: $rig or $experiment"
        cp "$rig" "$tree/airbench/rig.toml"
        cp "$experiment" "$tree/airbench/point-to-point.toml"
        cp -r "$root/controller/experiments" "$tree/airbench/experiments"
        # An experiment names its programs by their names, which stand in the folder beside its own.
        mkdir -p "$tree/programs" "$tree/airbench/programs"
        local programs
        programs=$(dirname "$experiment")/../programs
        if [[ -d $programs ]]; then cp "$programs"/*.toml "$tree/programs/"; fi
        cp "$root"/controller/programs/*.toml "$tree/airbench/programs/"
        add_binaries "$tree"
    fi
    cp "$scripts"/vm/job* "$tree/airbench/"
    if [[ -n $payload ]]; then cp -rL "$payload/." "$tree/airbench/"; fi
    printf '%s\n' "$job_command" >"$tree/job"
    cp "$base_image" "$out/vm/initramfs.cpio"
    pack "$tree" >>"$out/vm/initramfs.cpio"
}
