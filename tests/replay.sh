#!/bin/sh
# The main job: replays the shipped recording, prints the table of metrics, writes pictures to out/.
# Arguments go to `viewshed replay`: tests/replay.sh FILE.mcap --out DIR, or --help.
set -eu
here=$(CDPATH='' cd -- "$(dirname "$0")" && pwd)
. "$here/tools.sh"
need_compilers
[ $# -gt 0 ] || set -- --far-road --out out
# as tests/all.sh builds it, so that the second command finds this done
export CARGO_PROFILE_RELEASE_LTO=off CARGO_INCREMENTAL=0
exec cargo run --release --locked --manifest-path "$here/../Cargo.toml" --package viewshed-harness -- replay "$@"
