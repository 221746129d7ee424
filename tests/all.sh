#!/bin/bash
# Every test: host, the Linux daemon, and firmware under emulation. Installs what it needs or says what it skipped.
#
# The runners' own summary lines come last, each skip by name, and in the last line `N passed, M failed, K skipped`.
# VIEWSHED_PERMITTED_SKIPS names a file of what may be lacking (.ci/skips): skipped for anything else, the run fails.
set -euo pipefail
cd "$(dirname "$0")/.."
. tests/tools.sh

log=$(mktemp)
said=$(mktemp)
trap 'rm -f "$log" "$said"' EXIT

# run COMMAND...: one step; the others go on if it fails
run() {
    say "== $*"
    if ! "$@" 2>&1 | tee "$said"; then
        # what failed before a test could is counted as well
        grep -q '^test result: FAILED' "$said" || echo "failed: $*" | tee -a "$said"
    fi
    cat "$said" >>"$log"
}

. tests/steps.sh
tests/summary.sh "$log" "${VIEWSHED_PERMITTED_SKIPS:-}"
