#!/bin/sh
# Makes `cargo build --target TARGET` possible for bare-metal targets, whatever compiler there is.
#
#   eval "$(boards/toolchain.sh TARGET...)"
#
# First choice: the installed compiler already has the target's core library, or rustup can add it.
# Nothing is printed then. Second choice: Debian's compiler and library sources (rustc-web, cargo-web,
# rust-web-src) build it once, without the network, into a directory of their own; the settings that
# make cargo use it are printed. Once it is built, rustup is not asked any more. VIEWSHED_TOOLCHAIN=debian
# goes straight to the second choice.
# Exit code 1 and one line on stderr if neither works.
set -eu

[ $# -gt 0 ] || { echo "usage: toolchain.sh TARGET..." >&2; exit 2; }

# has_core COMPILER TARGET
has_core() {
    dir=$("$1" --print target-libdir --target "$2" 2>/dev/null) && ls "$dir"/libcore-*.rlib >/dev/null 2>&1
}

missing() {
    for target in $targets; do has_core "$compiler" "$target" || printf '%s ' "$target"; done
}

targets=$*
compiler=${RUSTC:-rustc}
debian=/usr/bin/rustc
library=/usr/lib/rustlib/src/rust/library
root=
# a compiler that is too old is none
minor() { sed -n 's/^[a-z-]*[:=" ]*1\.\([0-9]*\).*/\1/p'; }
least=$(grep '^rust-version' "$(dirname "$0")/../Cargo.toml" | minor)
if [ -x "$debian" ] && [ -x /usr/bin/cargo ] && [ -d "$library/core" ] && [ -d "$library/vendor" ] &&
    [ "$("$debian" -vV | grep '^release' | minor)" -ge "${least:-0}" ]; then
    version=$("$debian" -vV | sed -n 's/^commit-hash: //p')
    # a directory a compiler version: libraries of another one do not fit
    root=${VIEWSHED_SYSROOT:-${XDG_CACHE_HOME:-$HOME/.cache}/viewshed-sysroot}/$version
fi

# whether the second choice was taken before, for every target
built() {
    [ -n "$root" ] || return 1
    for target in $targets; do [ -e "$root/lib/rustlib/$target/complete" ] || return 1; done
}

if [ "${VIEWSHED_TOOLCHAIN:-any}" != debian ] && command -v "$compiler" >/dev/null; then
    absent=$(missing)
    if [ -n "$absent" ] && ! built && command -v rustup >/dev/null; then
        for target in $absent; do timeout 120 rustup target add "$target" >/dev/null 2>&1 || true; done
        absent=$(missing)
    fi
    [ -n "$absent" ] || exit 0
fi

if [ -z "$root" ]; then
    echo "no core library for $targets: \`rustup target add $targets\`, or on Debian" \
        "\`apt-get install rustc-web cargo-web rust-web-src lld\`" >&2
    exit 1
fi
host=$("$debian" -vV | sed -n 's/^host: //p')
mkdir -p "$root/bin" "$root/lib/rustlib"
[ -e "$root/lib/rustlib/$host" ] || ln -sfn "/usr/lib/rustlib/$host" "$root/lib/rustlib/$host"
# in one move: another build may be running it
wrapper=$(mktemp "$root/bin/new.XXXXXX")
printf '#!/bin/sh\nexec %s --sysroot "%s" "$@"\n' "$debian" "$root" >"$wrapper"
chmod 755 "$wrapper"
cmp -s "$wrapper" "$root/bin/rustc" && rm "$wrapper" || mv -f "$wrapper" "$root/bin/rustc"

# build_core TARGET: core and alloc with bitcode, which link-time optimisation asks for
build_core() {
    work=$(mktemp -d)
    mkdir "$work/src"
    echo '#![no_std]' >"$work/src/lib.rs"
    cat >"$work/Cargo.toml" <<END
[package]
name = "sysroot"
version = "0.0.0"
edition = "2021"
[profile.release]
panic = "abort"
[workspace]
END
    (
        cd "$work"
        unset CARGO_ENCODED_RUSTFLAGS CARGO_BUILD_RUSTFLAGS CARGO_BUILD_TARGET RUSTC_WRAPPER
        CARGO_HOME=$work/home CARGO_TARGET_DIR=$work/target RUSTC=$debian RUSTC_BOOTSTRAP=1 \
            RUSTFLAGS=-Cembed-bitcode=yes /usr/bin/cargo build --quiet --offline --release --target "$1" \
            -Zbuild-std=core,alloc -Zbuild-std-features=compiler-builtins-mem \
            --config 'source.crates-io.replace-with="vendored"' \
            --config "source.vendored.directory=\"$library/vendor\""
    ) >&2
    mkdir -p "$root/lib/rustlib/$1/lib"
    for crate in core alloc compiler_builtins; do
        cp "$work/target/$1/release/deps/lib$crate"-*.rlib "$root/lib/rustlib/$1/lib/"
    done
    rm -rf "$work"
    touch "$root/lib/rustlib/$1/complete"
}

# one at a time: tests that run side by side ask for the same target
if ! built; then
    exec 9>"$root/lock"
    flock 9
    for target in $targets; do
        [ -e "$root/lib/rustlib/$target/complete" ] || build_core "$target"
    done
    exec 9>&-
fi

echo "export RUSTC='$root/bin/rustc' PATH=\"/usr/bin:\$PATH\""
# bare-metal targets ask for rust-lld, which Debian's compiler does not bring
for name in rust-lld ld.lld ld.lld-19 ld.lld-14; do
    linker=$(command -v "$name") && break
done
[ -n "${linker:-}" ] || { echo "no linker: \`apt-get install lld\`" >&2; exit 1; }
[ "${linker##*/}" = rust-lld ] && exit 0
for target in $targets; do
    echo "export CARGO_TARGET_$(echo "$target" | tr 'a-z-' 'A-Z_')_LINKER='$linker'"
done
