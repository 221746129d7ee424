#!/bin/sh
# An ARS408's log decoded by viewshed and by cantools: tests/cantools.sh [LOG [SENSOR_ID]]. Without a log, the
# shipped one, both of its sensors. With --install only cantools is made ready.
set -eu
cd "$(dirname "$0")/.."
. tests/tools.sh
need_compilers
venv=${CARGO_TARGET_DIR:-target}/cantools
python=$venv/bin/python
if ! "$python" -c 'import cantools' 2>/dev/null; then
    { python3 -m venv "$venv" || { install python3-venv && python3 -m venv "$venv"; }; } >/dev/null 2>&1 &&
        "$venv/bin/pip" install -q 'cantools>=41' >/dev/null 2>&1 ||
        skip cantools "an ARS408's log, as neither it nor python3-venv can be installed here"
fi
[ "$only" != --install ] || exit 0
# VIEWSHED: one that is built already
viewshed=${VIEWSHED:-${CARGO_TARGET_DIR:-target}/release/viewshed}
[ -n "${VIEWSHED:-}" ] || cargo build --release --locked --package viewshed-harness
csv=$(mktemp)
trap 'rm -f "$csv"' EXIT
compare() {
    "$viewshed" doctor "$1" --sensor-id "$2" --detections "$csv" --force >/dev/null || [ $? = 1 ]
    "$python" tests/ars408_with_cantools.py check "$1" "$csv" "$2"
}
if [ $# -gt 0 ]; then
    compare "$1" "${2:-0}"
else
    compare tests/recordings/ars408-made-up.log 0
    compare tests/recordings/ars408-made-up.log 3
fi
