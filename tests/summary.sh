#!/bin/sh
# The end of a test run: tests/summary.sh LOG [PERMITTED]
#
# LOG is what the steps said. Of interest are the runners' `test result:` lines, `failed: STEP` of a step that failed before
# or without a test, and `skipped: LACK: WHAT`, where LACK is one word. The last line is `N passed, M failed, K skipped`.
# A test of which a part was skipped counts among the passed as well.
#
# The exit code is 1 if anything failed, or, with PERMITTED, if a LACK that this file does not name was skipped for.
# Its lines are `LACK: why it may be lacking`.
set -eu
log=$1
permitted=${2:-}

echo
echo "== summary"
grep -E '^(test result:|firmware:)' "$log" || true
grep -E '^(test .* \.\.\. FAILED$|failed: )' "$log" || true
# where a runner has one thread, the name of the test comes before what it says
skips=$(sed -nE 's/^(test [^ ]+ \.\.\. )?(skipped: .*)/\2/p' "$log" | awk '!seen[$0]++')
[ -z "$skips" ] || printf '%s\n' "$skips"

passed=$(awk '/^test result:/ { n += $4 } END { print n + 0 }' "$log")
failed=$(awk '/^test result:/ { n += $6 } /^failed: / { n++ } END { print n + 0 }' "$log")
skipped=$(printf '%s' "$skips" | grep -c '' || true)
status=0
[ "$failed" = 0 ] || status=1
if [ -n "$permitted" ]; then
    refused=$(printf '%s\n' "$skips" | awk -F ': ' -v file="$permitted" '
        BEGIN { while ((getline line < file) > 0) if (line !~ /^#/ && split(line, part, ": ") > 1) may[part[1]] = 1 }
        NF && !($2 in may) { print "not permitted by " file ": " $2 }' | sort -u)
    [ -z "$refused" ] || { printf '%s\n' "$refused"; status=1; }
fi
echo "$passed passed, $failed failed, $skipped skipped"
exit $status
