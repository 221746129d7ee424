#!/bin/sh
# The shipped recording read by Python's mcap-ros2-support, which knows nothing of this project.
# With --install only that is made ready, for tests run with VIEWSHED_PYTHON=target/mcap_ros2/bin/python.
set -eu
cd "$(dirname "$0")/.."
. tests/tools.sh
need_compilers
target=${CARGO_TARGET_DIR:-$PWD/target}
venv=$target/mcap_ros2
python=$venv/bin/python
if ! "$python" -c 'import mcap_ros2.decoder' 2>/dev/null; then
    { python3 -m venv "$venv" || { install python3-venv && python3 -m venv "$venv"; }; } >/dev/null 2>&1 &&
        "$venv/bin/pip" install -q 'mcap-ros2-support>=0.5' >/dev/null 2>&1 ||
        skip mcap-ros2-support "the shipped recording, as neither it nor python3-venv can be installed here"
fi
[ "$only" != --install ] || exit 0
VIEWSHED_PYTHON=$python exec cargo test --release --locked --package viewshed-harness --test command python
