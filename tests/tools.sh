# What a bare Debian or Ubuntu machine may lack. Sourced by the scripts beside it.

say() { printf '%s\n' "$*" >&2; }

# install PACKAGE...: true where they could be installed
install() {
    command -v apt-get >/dev/null || return 1
    if [ "$(id -u)" = 0 ]; then root=; elif command -v sudo >/dev/null && sudo -n true 2>/dev/null; then root=sudo; else return 1; fi
    say "installing $*"
    # shellcheck disable=SC2086
    DEBIAN_FRONTEND=noninteractive $root apt-get install -y --no-install-recommends "$@" >/dev/null 2>&1 ||
        { $root apt-get update >/dev/null 2>&1 &&
            DEBIAN_FRONTEND=noninteractive $root apt-get install -y --no-install-recommends "$@" >/dev/null 2>&1; }
}

# Rust and a C compiler: nothing can be built without them
need_compilers() {
    [ ! -f "$HOME/.cargo/env" ] || . "$HOME/.cargo/env"
    command -v cargo >/dev/null || { say "cargo is missing: install Rust from https://rustup.rs and run this again"; exit 1; }
    command -v cc >/dev/null || install gcc libc6-dev || { say "a C compiler is missing: apt-get install gcc libc6-dev, and run this again"; exit 1; }
}

# A Chromium for the tests of pages; without one they say that they skipped
need_browser() {
    [ -n "${VIEWSHED_BROWSER:-}" ] || [ -x /usr/lib/chromium/chromium-headless-shell ] ||
        command -v chromium-headless-shell chromium google-chrome chromium-browser >/dev/null ||
        install chromium-headless-shell || install chromium || true
}
