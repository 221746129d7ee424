#!/bin/sh
# Builds the boards' firmware and runs it on emulated controllers.
#
#   tests/firmware.sh              with --install what it needs is only made ready, with --build only the images are
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

skip() {
    echo "skipped: $1: $2"
    skipped=$((skipped + 1))
}

# compiler TARGET: whether there will be one
compiler() {
    boards/toolchain.sh "$1" >/dev/null 2>&1 && return
    install rustc-web cargo-web rust-web-src lld gcc && boards/toolchain.sh "$1" >/dev/null
}

# cargo_tests FILTER WHAT: the ignored tests of that name
cargo_tests() {
    echo "== $2"
    log=$(mktemp)
    if cargo test --quiet --release --locked --workspace --exclude viewshed --test boards --test view -- --ignored "$1" >"$log" 2>&1; then
        # the line ends with the times that differ from run to run
        passed=$((passed + $(awk '/^test result: ok/ { n += $4 } END { print n + 0 }' "$log")))
        sed -n 's/^test result: \(.*\); finished.*/\1/p' "$log"
    else
        cat "$log"
        failed=$((failed + 1))
    fi
    rm -f "$log"
}

# images BOARD PROGRAMS [cargo options]: those that the tests ask for, together, as one is linked on one core. With other
# options than in tests/harness/src/boards/firmware.rs they are not those, and the tests build their own.
images() {
    boards/build.sh "$@" >/dev/null || echo "$1 is not built ahead"
}

if [ "${1:-}" = --build ]; then
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

command -v qemu-system-arm >/dev/null || install qemu-system-arm
if [ "${1:-}" = --install ]; then
    for target in thumbv7em-none-eabihf armv7r-none-eabihf; do compiler "$target"; done
    exit 0
fi

if ! command -v qemu-system-arm >/dev/null; then
    skip "emulated boards" "no qemu-system-arm (apt-get install qemu-system-arm)"
elif ! compiler thumbv7em-none-eabihf; then
    skip "mps2-an386" "no compiler for thumbv7em-none-eabihf (rustup target add thumbv7em-none-eabihf)"
else
    cargo_tests mps2 "mps2-an386: every map the same, budgets, contents of the image, seen live"
fi

if ! command -v qemu-system-aarch64 >/dev/null && ! install qemu-system-arm; then
    skip "zcu102-r5" "no qemu-system-aarch64 (apt-get install qemu-system-arm)"
elif ! compiler armv7r-none-eabihf; then
    skip "zcu102-r5" "no compiler for armv7r-none-eabihf (rustup target add armv7r-none-eabihf)"
else
    cargo_tests zcu102 "zcu102-r5: every map the same, contents of the image"
fi

if ! compiler thumbv7em-none-eabihf; then
    skip "nucleo-h743zi, nucleo-g474re" "no compiler for thumbv7em-none-eabihf (rustup target add thumbv7em-none-eabihf)"
else
    cargo_tests nucleo "nucleo-h743zi, nucleo-g474re: built and looked at, not run"
fi

echo "firmware: $passed passed, $skipped skipped"
[ "$failed" = 0 ]
