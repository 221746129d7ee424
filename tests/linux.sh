#!/bin/sh
# Builds the daemon of boards/linux and runs it: on logs of CAN buses, on pseudo-terminals, as a service, and
# on a virtual CAN bus where the kernel has one.
#
#   tests/linux.sh                 with --build it is only built, and its tests
#
# Needs Rust and a C compiler, which it installs where it may. The runners' own summary lines come last; what
# was skipped is said in one line.
set -u

cd "$(dirname "$0")/.." || exit 1
. tests/tools.sh
[ "$(uname)" = Linux ] || skip linux "this is $(uname)"
need_compilers
status=0
log=$(mktemp)
trap 'rm -f "$log"' EXIT

run() {
    "$@" >"$log" 2>&1 || { status=1; cat "$log"; }
    grep -E '^(test result:|skipped:)' "$log"
}

target=${CARGO_TARGET_DIR:-$PWD/target}
daemon() {
    command=$1
    shift
    cargo "$command" --release --locked --manifest-path boards/linux/Cargo.toml --target-dir "$target/boards/linux" "$@"
}
if [ "$only" = --build ]; then
    daemon test --no-run && daemon build
    exit
fi
PATH=$PATH:/usr/sbin:/sbin
command -v ip >/dev/null || install iproute2
# VIEWSHED: the command, if it is built already; with what it broadcasts it is tried on virtual buses, where there are some
if [ -n "${VIEWSHED:-}" ] && ip link add dev vsprobe type vcan 2>/dev/null; then
    ip link del vsprobe
    BROADCAST=$target/boards/linux/broadcast.log
    export BROADCAST
    mkdir -p "${BROADCAST%/*}"
    broadcast "$VIEWSHED" "$BROADCAST" || exit 1
fi
echo "== the daemon's own tests"
run daemon test -- --nocapture
daemon build >"$log" 2>&1 || { cat "$log"; exit 1; }
VIEWSHEDD=$target/boards/linux/release/viewshedd
export VIEWSHEDD
"$VIEWSHEDD" --version
echo "== every frame the library's, cables pulled, service and mistakes"
run cargo test --release --locked --workspace --exclude viewshed --test boards -- --ignored linux
exit $status
