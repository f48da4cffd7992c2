# shellcheck shell=bash
# shellcheck disable=SC2154,SC2034 # names shared with vcan-vm, which sources this
# Gets programs and kernels from Debian's archive; sourced by vcan-vm.
#
# As root a missing program is installed. Otherwise its package and what that depends on are downloaded and unpacked
# below $cache/unpacked and run from there. Kernels are always unpacked, never installed: they are not for this machine.
#
# Expects $cache, $root, $exit_no_boot, $kernel_modules, say and fail.

unpacked=$cache/unpacked
unpacked_libraries=$unpacked/usr/lib/x86_64-linux-gnu:$unpacked/lib/x86_64-linux-gnu
# Images of containers have apt keep no index of the package lists, and each of its calls takes a second of CPU to make one.
apt_index=(-o "Dir::Cache::pkgcache=$cache/packages.bin" -o "Dir::Cache::srcpkgcache=$cache/lists.bin")
apt_options=("${apt_index[@]}")

# Runs a command that may have come unpacked; where nothing was unpacked the folders are not there, which is harmless.
run_unpacked() {
    LD_LIBRARY_PATH=$unpacked_libraries${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH} "$@"
}

# Without root, package lists can be fetched only into a folder of our own, which then stands in for the system's.
use_own_lists() {
    mkdir -p "$cache"/apt/{state/lists/partial,cache/archives/partial}
    apt_options=(-o "Dir::State=$cache/apt/state" -o "Dir::State::lists=$cache/apt/state/lists" -o "Dir::Cache=$cache/apt/cache"
        -o "Dir::State::status=/var/lib/dpkg/status" "${apt_index[@]}")
}

update_lists() {
    say "updating package lists"
    if ((EUID != 0)); then use_own_lists; fi
    apt-get "${apt_options[@]}" -q -o DPkg::Lock::Timeout=300 update >"$cache/apt.log" 2>&1 ||
        fail "$exit_no_boot" "apt-get update failed: $(tail -n 3 "$cache/apt.log")"
}

# from_archive FUNCTION ARGUMENT...: runs a function that downloads, once more with fresh lists if it fails: a fresh
# container has no lists, and old ones name versions that the archive has dropped. FUNCTION chains with &&, as set -e
# does not reach into it.
from_archive() {
    if ((EUID != 0)) && [[ -d $cache/apt ]]; then use_own_lists; fi
    if [[ -z $(apt-cache "${apt_options[@]}" show --no-all-versions linux-image-amd64 2>/dev/null) ]]; then update_lists; fi
    if "$@"; then return; fi
    update_lists
    "$@" || fail "$exit_no_boot" "cannot get $2: $(tail -n 3 "$cache/apt.log")"
}

# download FOLDER PACKAGE...
download() {
    local folder=$1
    shift
    rm -rf "$folder" && mkdir -p "$folder" &&
        (cd "$folder" && apt-get "${apt_options[@]}" -q download "$@") >"$cache/apt.log" 2>&1
}

install_package() {
    say "installing $1"
    DEBIAN_FRONTEND=noninteractive apt-get "${apt_index[@]}" -q -y -o DPkg::Lock::Timeout=300 install \
        --no-install-recommends "$1" >"$cache/apt.log" 2>&1
}

# Unpacks PACKAGE with every dependency that this machine lacks; apt's own simulation knows which. The mark is set
# last, so an interrupted call starts over.
unpack_package() {
    local wanted=() archive
    mapfile -t wanted < <(apt-get "${apt_options[@]}" install -s --no-install-recommends "$1" 2>/dev/null | awk '$1 == "Inst" { print $2 }')
    if ((${#wanted[@]} == 0)); then wanted=("$1"); fi
    say "fetching $1 (packages: ${#wanted[@]}), unpacked into ${unpacked#"$root"/}"
    download "$cache/archives" "${wanted[@]}" && mkdir -p "$unpacked/complete" || return 1
    for archive in "$cache"/archives/*.deb; do
        dpkg -x "$archive" "$unpacked" || return 1
    done
    rm -rf "$cache/archives"
    touch "$unpacked/complete/$1"
}

# Both set $found_program to the path of PROGRAM of PACKAGE, getting the package if need be; the first always unpacks.
find_unpacked() {
    [[ -f $unpacked/complete/$1 ]] || from_archive unpack_package "$1"
    found_program=$(PATH=$unpacked/usr/bin:$unpacked/usr/sbin:$unpacked/bin:$unpacked/sbin type -P "$2") ||
        fail "$exit_no_boot" "package $1 was fetched, but has no $2"
}

find_program() {
    local attempt
    for attempt in before after; do
        if found_program=$(PATH=$PATH:/usr/sbin:/sbin type -P "$2"); then return; fi
        ((EUID == 0)) || break
        [[ $attempt == after ]] || from_archive install_package "$1"
    done
    find_unpacked "$1" "$2"
}

# fetch_kernel NAME: leaves $cache/kernel-NAME with vmlinux, version, package and the modules of $kernel_modules with
# all they need; the other 300 MB are thrown away. Sets $kernel_version. "complete" is written last and names what is there, so that
# a longer list fetches anew.
fetch_kernel() {
    local folder=$cache/kernel-$1 meta=linux-image-amd64 there="vmlinux ${kernel_modules[*]}"
    if [[ $1 == rt ]]; then meta=linux-image-rt-amd64; fi
    if [[ ! -f $folder/complete || $(<"$folder/complete") != "$there" ]]; then
        rm -rf "$folder"
        from_archive unpack_kernel "$meta"
        prune_kernel "$cache/kernel-work/root" "$folder"
        rm -rf "$cache/kernel-work"
        printf '%s\n' "$there" >"$folder/complete"
    fi
    kernel_version=$(<"$folder/version")
}

# Unpacks the versioned package behind META into $cache/kernel-work/root: the kernel, and of its 4000 modules those of the folders in
# which $kernel_modules and what they need lie.
unpack_kernel() {
    local package
    package=$(apt-cache "${apt_options[@]}" depends "$1" | awk '/Depends: linux-image-/ { print $2; exit }')
    [[ -n $package ]] || return 1
    say "fetching $package"
    download "$cache/kernel-work" "$package" && mkdir "$cache/kernel-work/root" &&
        dpkg-deb --fsys-tarfile "$cache"/kernel-work/*.deb | tar -x -C "$cache/kernel-work/root" --wildcards './boot/vmlinuz-*' \
            './lib/modules/*/modules.*' './lib/modules/*/kernel/net/can' './lib/modules/*/kernel/drivers/'{block,net/can,virtio}
}

# prune_kernel TREE FOLDER: copies the kernel and the wanted modules, decompressed, and indexes them for modprobe.
prune_kernel() {
    local tree=$1 folder=$2 version depmod module from to modules=()
    # kmod is depmod when called so; its package's own link is absolute and dangles where it is only unpacked.
    find_program kmod kmod
    depmod=$(dirname "$tree")/depmod
    ln -s "$found_program" "$depmod"
    version=$(basename "$(echo "$tree"/lib/modules/*)")
    from=$tree/lib/modules/$version
    to=$folder/lib/modules/$version
    mkdir -p "$to"
    # Uncompressed, or the guest would unpack it at each boot: 4 s of a processor here.
    kernel_of "$tree/boot/vmlinuz-$version" "$tree/payload" >"$folder/vmlinux"
    [[ $(head -c 4 "$folder/vmlinux") == $'\x7fELF' ]] || fail "$exit_no_boot" "no ELF file in vmlinuz-$version"
    run_unpacked "$depmod" -b "$tree" "$version"
    mapfile -t modules < <(modules_with_dependencies "$from/modules.dep")
    for module in "${modules[@]}"; do
        mkdir -p "$to/$(dirname "$module")"
        decompress "$from/$module" >"$to/${module%.[xz]*}"
    done
    cp "$from"/modules.{order,builtin} "$to/"
    run_unpacked "$depmod" -b "$folder" "$version" 2>>"$cache/apt.log"
    printf '%s\n' "$version" >"$folder/version"
}

# kernel_of BZIMAGE BASE: the kernel in it on standard output. Its header (Documentation/arch/x86/boot.rst) has setup_sects,
# payload_offset and payload_length; the payload ends with four bytes of its length unpacked. BASE names a file to be written.
kernel_of() {
    local sectors place packed
    sectors=$(od -An -t u1 -j $((0x1f1)) -N 1 "$1")
    read -r -a place < <(od -An -t u4 -j $((0x248)) -N 8 "$1")
    packed=$2.xz
    [[ $(od -An -t x1 -j $(((sectors + 1) * 512 + place[0])) -N 4 "$1") != ' 28 b5 2f fd' ]] || packed=$2.zst
    tail -c +$(((sectors + 1) * 512 + place[0] + 1)) "$1" | head -c $((place[1] - 4)) >"$packed" || true # tail's pipe is closed
    decompress "$packed"
}

# Newer Debian compresses modules, which the guest's busybox may not read.
decompress() {
    case $1 in
        *.xz) find_program xz-utils xz && run_unpacked "$found_program" -dc "$1" ;;
        *.zst) find_program zstd zstd && run_unpacked "$found_program" -qdc "$1" ;;
        *) cat "$1" ;;
    esac
}

# Paths of $kernel_modules and of what modules.dep says they need. One that is missing may be built in: init finds out.
modules_with_dependencies() {
    awk -v wanted="${kernel_modules[*]}" '
        BEGIN { count = split(wanted, names, " "); for (i = 1; i <= count; i++) want[names[i]] = 1 }
        {
            path = $1; sub(/:$/, "", path)
            name = path; sub(/.*\//, "", name); sub(/\.ko.*/, "", name); gsub(/-/, "_", name)
            if (name in want) { print path; for (i = 2; i <= NF; i++) print $i }
        }' "$1" | sort -u
}
