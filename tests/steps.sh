# shellcheck shell=bash
# The steps of tests/all.sh, which sources this: `run COMMAND...` for each.
need_compilers
# before targets are: rustup does one thing at a time
tests/gate.sh --install >/dev/null || true

# what has to be fetched is, while the harness is built; each is a script that takes --install
to_fetch="browser mcap_ros2 detector cantools linux_kernel firmware fuzz"
fetch() {
    case $1 in
        browser) need_browser ;;
        *) nice tests/"$1".sh --install ;;
    esac
}
absent=$(mktemp)
(for needs in $to_fetch; do fetch "$needs" || echo "$needs" >>"$absent"; done) >/dev/null 2>&1 &
fetching=$!
# without optimising across parts of a crate, a quarter less to build; the tests take a tenth longer; images of boards do not heed it
export CARGO_PROFILE_RELEASE_LTO=off
# nothing is built twice
export CARGO_INCREMENTAL=0
run tests/gate.sh
# the library's own tests run once, below: they take longer to optimise than to run with overflow checks
run cargo test --release --locked --workspace --exclude viewshed --no-run
wait $fetching || true
# what could not be fetched beside other work is tried again by itself; what then is lacking, the steps say that they skip
for needs in $(cat "$absent"); do
    say "== $needs, again"
    fetch "$needs" || true
done
rm -f "$absent"
target=${CARGO_TARGET_DIR:-$PWD/target}
python=$target/mcap_ros2/bin/python
[ ! -x "$python" ] || export VIEWSHED_PYTHON=$python
export VIEWSHED_DETECTOR=$target/detector
# what later steps build is built beside these tests, which leave a core idle now and then and are not to wait for it; what
# fails here, those steps build again, and say so
nice sh -c 'cargo test --locked --package viewshed --features secoc,serde --no-run
    tests/linux.sh --build
    tests/firmware.sh --build
    tests/fuzz.sh --build' >/dev/null 2>&1 &
run cargo test --release --locked --workspace --exclude viewshed --no-fail-fast
# made by it: another selection of packages would build the harness again, with other features of what both use
export VIEWSHED=$target/release/viewshed
run tests/cantools.sh
run tests/your_data.sh
# overflow checks and debug assertions are on in these
run cargo test --locked --package viewshed --features secoc,serde --no-fail-fast
run tests/recordings/make.sh --check
run tests/linux.sh
run tests/linux_kernel.sh
run tests/firmware.sh
# each target for 5 s, two at a time
run tests/fuzz.sh 5
# nothing goes on after the summary
wait
