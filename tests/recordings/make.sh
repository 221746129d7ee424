#!/bin/sh
# Makes the shipped recording anew, or checks that it is what the twin makes.
#
#   tests/recordings/make.sh            writes tests/recordings/motorway.mcap
#   tests/recordings/make.sh --check    compares it bit for bit, changes nothing
set -eu
cd "$(dirname "$0")/../.."
. tests/tools.sh
need_compilers
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# VIEWSHED: one that is built already
viewshed=${VIEWSHED:-cargo run --quiet --release --locked -p viewshed-harness --bin viewshed --}
$viewshed simulate tests/recordings/motorway.toml --duration 30 --out "$work/motorway.mcap"
if [ "${1:-}" = --check ]; then
    cmp "$work/motorway.mcap" tests/recordings/motorway.mcap
    echo "tests/recordings/motorway.mcap is what the twin makes, bit for bit"
else
    mv "$work/motorway.mcap" tests/recordings/motorway.mcap
fi
