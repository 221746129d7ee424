#!/bin/sh
# Looks for inputs that break a decoder or a receiver: tests/fuzz.sh [SECONDS [TARGET...]]
#
# Every target of tests/fuzz (or those named), 30 s each, two at a time, where cargo-fuzz is there and a compiler it
# works with; else one line says what was skipped. An input that breaks something is printed and kept.
set -u
cd "$(dirname "$0")/.." || exit 1
. tests/tools.sh
need_compilers

skip() {
    echo "skipped: fuzzing: $1; the kept inputs are replayed by cargo test"
    exit 0
}

command -v cargo-fuzz >/dev/null || skip "no cargo-fuzz (cargo install cargo-fuzz)"
command -v c++ >/dev/null || install g++ || skip "no C++ compiler for libFuzzer (apt-get install g++)"
# instrumentation wants a nightly compiler; a stable one does without the address sanitizer
options=
if cargo +nightly --version >/dev/null 2>&1; then
    fuzz() { command=$1; shift; cargo +nightly fuzz "$command" --fuzz-dir tests/fuzz $options "$@"; }
elif rustc --version | grep -q nightly; then
    fuzz() { command=$1; shift; cargo fuzz "$command" --fuzz-dir tests/fuzz $options "$@"; }
else
    options="--sanitizer none"
    fuzz() { command=$1; shift; RUSTC_BOOTSTRAP=1 cargo fuzz "$command" --fuzz-dir tests/fuzz $options "$@"; }
fi

seconds=${1:-30}
[ $# = 0 ] || shift
[ $# -gt 0 ] || set -- $(cd tests/fuzz/corpus && echo *)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
if ! fuzz build >"$work/build" 2>&1; then
    tail -n 5 "$work/build"
    skip "its targets cannot be built here, see above"
fi

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
