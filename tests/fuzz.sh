#!/bin/sh
# Looks for inputs that break a decoder or a receiver: tests/fuzz.sh [SECONDS [TARGET...]]
#
# Every target of tests/fuzz (or those named), 30 s each, two at a time. cargo-fuzz is installed where it can be, into the
# target folder; else one line says what was skipped. An input that breaks something is printed and kept.
# With --install what it needs is only made ready; with --build the targets are only built.
set -u
cd "$(dirname "$0")/.." || exit 1
. tests/tools.sh
need_compilers
[ -z "$only" ] || shift
target=${CARGO_TARGET_DIR:-$PWD/target}
# cargo looks for its commands there
PATH=$target/fuzz-tools/bin:$PATH

lacking() { skip fuzzing "$1; the kept inputs are replayed by cargo test"; }

command -v cargo-fuzz >/dev/null || {
    say "installing cargo-fuzz"
    said=$(CARGO_TARGET_DIR=$target/fuzz-tools/build cargo install --quiet --locked cargo-fuzz@0.13.1 --root "$target/fuzz-tools" 2>&1) ||
        lacking "cargo-fuzz cannot be installed: $(printf '%s\n' "$said" | grep -m 1 '^error' || echo 'cargo install cargo-fuzz')"
    rm -rf "$target/fuzz-tools/build"
}
command -v c++ >/dev/null || install g++ || lacking "no C++ compiler for libFuzzer (apt-get install g++)"
said=$(cargo fetch --quiet --manifest-path tests/fuzz/Cargo.toml 2>&1) ||
    lacking "libfuzzer-sys cannot be fetched: $(printf '%s\n' "$said" | grep -m 1 '^error' || echo 'cargo fetch')"
[ "$only" != --install ] || exit 0

# the stable compiler, which lets libFuzzer's instrumentation pass when it is told that it is a nightly one; without the
# address sanitizer, which it has not, and which looks for errors of unsafe code: the library has none
fuzz() {
    command=$1
    shift
    RUSTC_BOOTSTRAP=1 cargo fuzz "$command" --fuzz-dir tests/fuzz --target-dir "$target/fuzz" --sanitizer none "$@"
}

seconds=${1:-30}
[ $# = 0 ] || shift
[ $# -gt 0 ] || set -- $(cd tests/fuzz/corpus && echo *)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
if ! fuzz build >"$work/build" 2>&1; then
    cat "$work/build"
    echo "fuzzing: the targets do not build"
    exit 1
fi
[ "$only" != --build ] || exit 0

# one TARGET: new inputs go to a folder of its own, so that the kept ones stay few
one() {
    mkdir -p "$work/$1"
    if fuzz run "$1" "$work/$1" "tests/fuzz/corpus/$1" -- -max_total_time="$seconds" -artifact_prefix="$work/$1-" \
        >"$work/$1.log" 2>&1; then
        echo "$1: $(sed -n 's/^Done \([0-9]*\) runs.*/\1/p' "$work/$1.log") inputs, none broke it"
    else
        grep -E 'panicked|ERROR|assertion|^ *(left|right):' -A1 "$work/$1.log" | head -n 20
        for input in "$work/$1"-*; do
            [ ! -f "$input" ] || { kept=tests/fuzz/corpus/$1/found-$(basename "$input" | tail -c 9); cp "$input" "$kept"; echo "$1: broken by $kept"; }
        done
        echo "$1" >>"$work/broken"
    fi
}

while [ $# -gt 0 ]; do
    one "$1" &
    shift
    [ $# = 0 ] || { one "$1" & shift; }
    wait
done
[ ! -f "$work/broken" ] || { echo "fuzzing: broken: $(tr '\n' ' ' <"$work/broken")"; exit 1; }
