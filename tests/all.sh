#!/bin/bash
# Every test: host, the Linux daemon, and firmware under emulation. Installs what it needs or says what it skipped.
# The runners' own summary lines come last.
set -euo pipefail
cd "$(dirname "$0")/.."
. tests/tools.sh
need_compilers

log=$(mktemp)
fetched=$(mktemp)
trap 'rm -f "$log" "$fetched"' EXIT
status=0
run() {
    say "== $*"
    "$@" 2>&1 | tee -a "$log" || status=1
}

# what has to be fetched is, while the harness is built
fetch() {
    need_browser
    local failed=0
    for needs in mcap_ros2 detector cantools linux_kernel firmware; do tests/$needs.sh --install || failed=1; done
    return $failed
}
fetch >"$fetched" 2>&1 &
fetching=$!
# without optimising across parts of a crate, a quarter less to build; the tests take a tenth longer; images of boards do not heed it
export CARGO_PROFILE_RELEASE_LTO=off
# nothing is built twice
export CARGO_INCREMENTAL=0
# the library's own tests run once, below: they take longer to optimise than to run with overflow checks
run cargo test --release --locked --workspace --exclude viewshed --no-run
wait $fetching || status=1
tee -a "$log" <"$fetched"
python=${CARGO_TARGET_DIR:-$PWD/target}/mcap_ros2/bin/python
[ ! -x "$python" ] || export VIEWSHED_PYTHON=$python
export VIEWSHED_DETECTOR=${CARGO_TARGET_DIR:-$PWD/target}/detector
# what later steps build is built beside these tests, which leave a core idle now and then and are not to wait for it; what
# fails here, those steps build again, and say so
nice sh -c 'cargo test --locked --package viewshed --features secoc,serde --no-run
    tests/linux.sh --build
    tests/firmware.sh --build' >/dev/null 2>&1 &
run cargo test --release --locked --workspace --exclude viewshed --no-fail-fast
# made by it: another selection of packages would build the harness again, with other features of what both use
export VIEWSHED=${CARGO_TARGET_DIR:-$PWD/target}/release/viewshed
run tests/cantools.sh
run tests/your_data.sh
# overflow checks and debug assertions are on in these
run cargo test --locked --package viewshed --features secoc,serde --no-fail-fast
run tests/recordings/make.sh --check
run tests/linux.sh
run tests/linux_kernel.sh
run tests/firmware.sh
run tests/fuzz.sh
# nothing goes on after the summary
wait

echo
echo "== summary"
grep -E '^(test result:|skipped:|firmware:)' "$log" || true
passed=$(awk '/^test result:/ { n += $4 } END { print n + 0 }' "$log")
failed=$(awk '/^test result:/ { n += $6 } END { print n + 0 }' "$log")
echo "in all: $passed passed, $failed failed"
exit $status
