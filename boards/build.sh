#!/bin/sh
# Builds one program of a board, or several, as release images and prints each image's path on stdout.
#
#   boards/build.sh BOARD PROGRAM [cargo options]
#   boards/build.sh mps2-an386 batch --features small
#   boards/build.sh mps2-an386 "batch live"
set -eu

[ $# -ge 2 ] || { echo "usage: build.sh BOARD PROGRAM [cargo options]" >&2; exit 2; }
here=$(cd "$(dirname "$0")" && pwd)
board=$1
programs=$2
shift 2
cd "$here/$board"
target=$(sed -n 's/^target = "\(.*\)"/\1/p' .cargo/config.toml)
# an image is built as the board's Cargo.toml says, whatever the environment says of other programs
for setting in $(env | sed -n 's/^\(CARGO_PROFILE_RELEASE_[A-Z_]*\)=.*/\1/p'); do unset "$setting"; done
settings=$("$here/toolchain.sh" "$target")
eval "$settings"
# features share a file name, so each set has a folder; what boards and sets have in common, macros most of all, is built
# once (cargo 1.91; older ones do not know of that and build it for each)
all=${CARGO_TARGET_DIR:-$here/../target}/boards
folder=$all/$board/$(echo "plain $*" | tr -c 'a-z0-9\n' '-')
export CARGO_BUILD_BUILD_DIR="$all/common"
for program in $programs; do set -- --bin "$program" "$@"; done
cargo build --quiet --release --target-dir "$folder" "$@" >&2
for program in $programs; do echo "$folder/$target/release/$program"; done
