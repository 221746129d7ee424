#!/bin/sh
# Builds the boards' firmware and runs it on emulated controllers.
#
#   tests/firmware.sh              with --install what it needs is only made ready, and exit code 1 says that something is
#                                  lacking; with --build only the images are built
#
# Installs what it needs where it may (root on Debian or Ubuntu), and says in one line what it skipped
# and why. The last line is `firmware: N passed, M skipped`; the exit code is 0 unless something failed.
set -u

cd "$(dirname "$0")/.." || exit 1
. tests/tools.sh
need_compilers
passed=0
skipped=0
failed=0

# compiler TARGET: whether there will be one; else why not is in $lacking
compiler() {
    boards/toolchain.sh "$1" >/dev/null 2>&1 && return
    install rustc-web cargo-web rust-web-src lld gcc
    lacking=$(boards/toolchain.sh "$1" 2>&1 >/dev/null) && return
    lacking=$(printf '%s\n' "$lacking" | tail -n 1)
    return 1
}

emulator() {
    lacking="no $1 (apt-get install qemu-system-arm)"
    command -v "$1" >/dev/null || { install qemu-system-arm && command -v "$1" >/dev/null; }
}

# images BOARD PROGRAMS [cargo options]: those that the tests ask for, together, as one is linked on one core. With other
# options than in tests/harness/src/boards/firmware.rs they are not those, and the tests build their own.
images() {
    boards/build.sh "$@" >/dev/null || echo "$1 is not built ahead"
}

if [ "$only" = --build ]; then
    small="--features small --config profile.release.opt-level=2"
    images mps2-an386 "batch live camera" --features learning
    # shellcheck disable=SC2086
    images mps2-an386 "batch live" $small
    images zcu102-r5 "batch live camera" --features learning
    # shellcheck disable=SC2086
    images zcu102-r5 batch $small
    images nucleo-h743zi live
    images nucleo-g474re live
    exit 0
fi

if [ "$only" = --install ]; then
    status=0
    for program in qemu-system-arm qemu-system-aarch64; do emulator $program || { status=1; say "$lacking"; }; done
    for target in thumbv7em-none-eabihf armv7r-none-eabihf; do compiler $target || { status=1; say "$lacking"; }; done
    exit $status
fi

# board NAME EMULATOR TARGET FILTER WHAT: the ignored tests whose names contain FILTER
board() {
    if { [ "$2" != none ] && ! emulator "$2"; } || ! compiler "$3"; then
        # the others have their turn
        echo "skipped: $1: $lacking"
        skipped=$((skipped + 1))
        return
    fi
    echo "== $1: $5"
    log=$(mktemp)
    if cargo test --release --locked --workspace --exclude viewshed --test boards --test view -- --ignored "$4" >"$log" 2>&1; then
        ran=$(awk '/^test result: ok/ { n += $4 } END { print n + 0 }' "$log")
        [ "$ran" -gt 0 ] || { echo "no test is named $4"; failed=$((failed + 1)); }
        passed=$((passed + ran))
        # what a test skipped is one of this summary's as well
        skipped=$((skipped + $(grep -c '^skipped:' "$log")))
        grep -E '^(test result:|skipped:)' "$log"
    else
        cat "$log"
        failed=$((failed + 1))
    fi
    rm -f "$log"
}

board mps2-an386 qemu-system-arm thumbv7em-none-eabihf mps2 "every map the same, budgets, contents of the image, seen live"
board zcu102-r5 qemu-system-aarch64 armv7r-none-eabihf zcu102 "every map the same, contents of the image"
board nucleo none thumbv7em-none-eabihf nucleo "h743zi and g474re built and looked at, not run"

echo "firmware: $passed passed, $skipped skipped"
[ "$failed" = 0 ]
