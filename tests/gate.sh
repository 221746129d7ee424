#!/bin/sh
# What is asked of the sources before any test runs: form, lints of every workspace and set of features, documentation, the
# size of the package, messages of commits.
#
#   tests/gate.sh                  with --install clippy and rustfmt are only made ready
#
# Every check that fails says what to do. The last line is that of a test runner, which tests/summary.sh counts.
set -u
cd "$(dirname "$0")/.." || exit 1
. tests/tools.sh
need_compilers

# component NAME COMMAND: whether cargo has the command, or rustup can add it. Debian's are of another compiler than rustup's.
component() {
    cargo "$2" --version >/dev/null 2>&1 && return
    command -v rustup >/dev/null && timeout 120 rustup component add "$1" >/dev/null 2>&1 && cargo "$2" --version >/dev/null 2>&1
}
form=yes
component rustfmt fmt || { form=; (skip rustfmt "sources are not looked at: rustup component add rustfmt"); }
lints=yes
component clippy clippy || { lints=; (skip clippy "nothing is linted: rustup component add clippy"); }
if [ "$only" = --install ]; then
    [ "$form$lints" = yesyes ]
    exit
fi

target=${CARGO_TARGET_DIR:-$PWD/target}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# as tests/steps.sh has it, so that macros and build scripts are built once for both
export CARGO_PROFILE_RELEASE_LTO=off CARGO_INCREMENTAL=0 CARGO_TERM_COLOR=never

# check NAME WHAT_TO_DO COMMAND...: what the command says is shown if it fails
check() {
    name=$1
    advice=$2
    shift 2
    said=$work/said-$name
    if "$@" >"$said" 2>&1; then
        echo "test gate::$name ... ok"
        echo ok >>"$work/results"
    else
        cat "$said"
        echo "test gate::$name ... FAILED"
        echo "gate::$name: $advice"
        echo FAILED >>"$work/results"
    fi
}

formatted() {
    status=0
    for manifest in Cargo.toml tests/*/Cargo.toml tests/harness/*/Cargo.toml boards/*/Cargo.toml; do
        cargo fmt --manifest-path "$manifest" --check || { echo "in $manifest"; status=1; }
    done
    return $status
}

# of the newest commits: a subject that `git log --oneline` shows whole, and a body
messages() {
    status=0
    for commit in $(git log --no-merges -n 20 --format=%h); do
        subject=$(git log -n 1 --format=%s "$commit")
        [ ${#subject} -le 72 ] || { echo "$commit: ${#subject} characters: $subject"; status=1; }
        [ -n "$(git log -n 1 --format=%b "$commit")" ] || { echo "$commit: no body: $subject"; status=1; }
    done
    return $status
}

# what a user of the library downloads
packaged() {
    cargo package --quiet --locked --no-verify --allow-dirty --package viewshed --target-dir "$target/gate" || return
    size=$(cat "$target"/gate/package/viewshed-*.crate | wc -c)
    echo "$size bytes"
    [ "$size" -le 1000000 ]
}

lint() { cargo clippy --quiet --locked "$@" -- -D warnings; }

# in a folder of its own, beside the workspace
library() {
    features=$(sed -n '/^\[features\]/,/^\[dep/s/^\([a-z_0-9]*\) = .*/\1/p' Cargo.toml)
    for set in --no-default-features --all-features $features; do
        case $set in --*) ;; *) set="--no-default-features --features $set" ;; esac
        # shellcheck disable=SC2086
        lint --package viewshed --lib --no-deps --target-dir "$target/gate" $set || { echo "with $set"; return 1; }
    done
}

# board FOLDER: as boards/build.sh builds it, so that macros are built once for both. What boards share is no member of their
# workspaces, so clippy passes it over.
board() (
    cd "$1" || exit
    unset CARGO_PROFILE_RELEASE_LTO
    export CARGO_BUILD_BUILD_DIR="$target/boards/common"
    lint --release --target-dir "$target/boards/lint"
)

# has_core TARGET: whether this compiler can build for it; where boards are built with another one, that has no clippy
has_core() { ls "$(rustc --print target-libdir --target "$1" 2>/dev/null)"/libcore-*.rlib >/dev/null 2>&1; }

boards() {
    status=0
    for config in boards/*/.cargo/config.toml; do
        of=$(sed -n 's/^target = "\(.*\)"/\1/p' "$config")
        folder=${config%%/.cargo/*}
        has_core "$of" || continue
        board "$folder" || { echo "in $folder"; status=1; }
    done
    return $status
}

daemon() { lint --release --all-targets --manifest-path boards/linux/Cargo.toml --target-dir "$target/boards/linux"; }
# has no lock file; tests/fuzz.sh says it where its crates cannot be fetched
fuzzing() {
    cargo fetch --quiet --manifest-path tests/fuzz/Cargo.toml || return 0
    cargo clippy --quiet --manifest-path tests/fuzz/Cargo.toml --target-dir "$target/gate" -- -D warnings
}

document() { RUSTDOCFLAGS="-D warnings" cargo doc --quiet --locked --no-deps --target-dir "$target/gate" "$@"; }
library_pages() {
    for set in "" "--features board" --all-features; do
        # shellcheck disable=SC2086
        document --package viewshed --lib $set || { echo "with $set"; return 1; }
    done
}
harness_pages() { RUSTDOCFLAGS="-D warnings" cargo doc --release --quiet --locked --no-deps --workspace --exclude viewshed --lib; }

fix="mend it; what is right as it is takes #[allow(...)] with a reason beside it"
with="kept clean with clippy 1.95, this is $(cargo clippy --version 2>/dev/null)"
[ -z "$form" ] || check format "run \`cargo fmt --all\`, in boards/* and tests/fuzz as well" formatted
[ ! -e .git ] || ! git rev-parse HEAD >/dev/null 2>&1 ||
    check messages "\`git commit --amend\` or \`git rebase -i\`: src/EXTENDING.md says how" messages
check package "keep \`include\` in Cargo.toml to what a user of the library builds and reads" packaged
{
    [ -z "$lints" ] || check library "$fix; $with" library
    check library_pages "links to what is private are \`names\` without brackets" library_pages
    [ -z "$lints" ] || check fuzzing "$fix; $with" fuzzing
    [ -z "$lints" ] || [ "$(uname)" != Linux ] || check daemon "$fix; $with" daemon
    [ -z "$lints" ] || check boards "$fix; $with" boards
} >"$work/beside" 2>&1 &
[ -z "$lints" ] || check workspace "$fix; $with" lint --release --workspace --all-targets
check harness_pages "links to what is private are \`names\` without brackets" harness_pages
wait
cat "$work/beside"
passed=$(grep -c '^ok' "$work/results")
failed=$(grep -c '^FAILED' "$work/results")
ended=ok
[ "$failed" = 0 ] || ended=FAILED
echo "test result: $ended. $passed passed; $failed failed; 0 ignored; 0 measured; 0 filtered out"
[ "$failed" = 0 ]
