#!/bin/sh
# Runs a receiver, any program with its arguments, over the logs beside this and says what it shows differently.
# Exit status: 0 nothing, 1 something, 2 the receiver cannot be run. See README.md.
set -u
here=$(CDPATH='' cd -- "$(dirname "$0")" && pwd)
only=
without_probability=
while :; do
    case ${1-} in
    --only) only=${2-} && shift 2 || exit 2 ;;
    --without-probability) without_probability=1 && shift ;;
    *) break ;;
    esac
done
if [ $# -eq 0 ]; then
    echo "usage: tests/conformance/run.sh [--only NAME] [--without-probability] RECEIVER [ARGUMENT]..." >&2
    exit 2
fi
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

# the library's receiver, for the cells that are expected: as named, as built, or built now
reference() {
    built=${VIEWSHED_REFERENCE-${CARGO_TARGET_DIR-$here/../../target}/release/viewshed-conformance}
    if [ -x "$built" ]; then
        "$built" receive
    elif command -v cargo >/dev/null; then
        cargo run --quiet --release --locked --manifest-path "$here/../../Cargo.toml" --package viewshed-conformance -- receive
    else
        return 1
    fi
}

# the first line that differs
first_of() {
    awk 'NR == FNR { expected[FNR] = $0; lines = FNR; next } { got[FNR] = $0; if (FNR > lines) lines = FNR }
        END { for (i = 1; i <= lines; i++) if (expected[i] != got[i]) { if (!first) first = i; count++ } print first, count, lines }' "$1" "$2"
}

logs=0
differ=0
for log in "$here/logs/$only"*.in.gz; do
    name=$(basename "$log" .in.gz)
    [ -e "$log" ] || { echo "no log begins with $only" >&2; exit 2; }
    gzip -dc "$log" >"$scratch/in" && gzip -dc "$here/logs/$name.out.gz" >"$scratch/expected" || exit 2
    if [ "$without_probability" ]; then
        grep -v '^probability ' "$scratch/in" >"$scratch/less" && mv "$scratch/less" "$scratch/in"
        grep -v '^[0-9]* p ' "$scratch/expected" >"$scratch/less" && mv "$scratch/less" "$scratch/expected"
    fi
    "$@" <"$scratch/in" >"$scratch/got"
    status=$?
    [ $status -eq 0 ] || { echo "$name: the receiver ended with status $status" >&2; exit 2; }
    logs=$((logs + 1))
    cmp -s "$scratch/expected" "$scratch/got" && continue
    differ=$((differ + 1))
    # shellcheck disable=SC2046
    set_first() { first=$1 count=$2 lines=$3; }
    set_first $(first_of "$scratch/expected" "$scratch/got")
    question=$(grep -E '^(look|probability) ' "$scratch/in" | sed -n "${first}p")
    sensor=$(awk -v n="$first" '/^start/ { sensor = $3 } /^(look|probability)/ && ++looks == n { exit } END { print sensor }' "$scratch/in")
    echo "$name: $count of $lines answers differ, first to \`$question\`, sensor $sensor"
    fields="time, visible, not visible, hash"
    case $question in probability*) fields="time, p, cells, sum, hash" ;; esac
    echo "  ($fields) expected: $(sed -n "${first}p" "$scratch/expected")"
    echo "  ($fields) got:      $(sed -n "${first}p" "$scratch/got")"
    case $question in probability*) continue ;; esac
    # the same question again, cell by cell
    awk -v n="$first" '/^(look|probability)/ && ++looks == n { sub(/^look/, "cells"); print; exit } { print }' "$scratch/in" >"$scratch/asked"
    "$@" <"$scratch/asked" 2>/dev/null | tail -n 1 >"$scratch/cells"
    if reference <"$scratch/asked" 2>/dev/null | tail -n 1 >"$scratch/expected-cells" && [ -s "$scratch/expected-cells" ]; then
        awk 'NR == 1 { rows = NF - 1; for (i = 1; i <= rows; i++) expected[i] = $(i + 1); next }
            {
                if (rows == 0 || NF == 1) { print "  cells: " (rows ? "shown are expected, none are" : "none are expected, some are shown"); exit }
                for (i = 1; i <= rows || i < NF; i++) for (c = 1; c <= length(expected[i]) || c <= length($(i + 1)); c++)
                    if (substr(expected[i], c, 1) != substr($(i + 1), c, 1)) {
                        printf "  cell: azimuth %d, range %d: expected `%s`, got `%s`\n", i - 1, c - 1, substr(expected[i], c, 1), substr($(i + 1), c, 1)
                        exit
                    }
            }' "$scratch/expected-cells" "$scratch/cells"
    fi
done
echo "$((logs - differ)) of $logs logs are answered as expected"
[ "$differ" -eq 0 ]
