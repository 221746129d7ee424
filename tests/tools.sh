# What a bare Debian or Ubuntu machine may lack. Sourced by the scripts beside it.

# the script's first argument, if that is one of these: then it only makes ready what it needs, or only builds
case ${1:-} in --install | --build) only=$1 ;; *) only= ;; esac

say() { printf '%s\n' "$*" >&2; }

# skip LACK WHAT: ends the script with the line that tests/summary.sh counts; LACK is one word. Nothing has failed, but with
# --install that is exit code 1.
skip() {
    echo "skipped: $1: $2"
    [ "$only" != --install ] || exit 1
    exit 0
}

# may_install: whether packages can be installed here at all, by $root
may_install() {
    command -v apt-get >/dev/null || return 1
    if [ "$(id -u)" = 0 ]; then root=; elif command -v sudo >/dev/null && sudo -n true 2>/dev/null; then root=sudo; else return 1; fi
}

# apt_get ARGUMENTS: what it says is in $apt_said. Waits while another one is at work: the option waits for dpkg's lock only,
# not for that of the lists of packages.
apt_get() {
    for pause in 15 15 15 15 15 15 15 15 0; do
        # shellcheck disable=SC2086
        apt_said=$($root env LC_ALL=C DEBIAN_FRONTEND=noninteractive apt-get -o DPkg::Lock::Timeout=600 -o Acquire::Retries=3 "$@" 2>&1) && return
        case $apt_said in *"Could not get lock"* | *"Unable to lock"*) sleep $pause ;; *) return 1 ;; esac
    done
    return 1
}

# install PACKAGE...: true where they could be installed; else what apt-get said against it
install() {
    may_install || return 1
    say "installing $*"
    # lists of packages are absent on a bare machine; old ones, of an image say, have compilers that are too old
    [ -n "$(find /var/lib/apt/lists -maxdepth 0 -mtime -1 2>/dev/null)" ] || apt_get update || true
    apt_get install -y --no-install-recommends "$@" && return
    apt_get update && apt_get install -y --no-install-recommends "$@" && return
    say "cannot install $*: $(printf '%s\n' "$apt_said" | grep -m 1 '^E:' || printf '%s\n' "$apt_said" | tail -n 1)"
    return 1
}

# Rust and a C compiler: nothing can be built without them
need_compilers() {
    [ ! -f "$HOME/.cargo/env" ] || . "$HOME/.cargo/env"
    command -v cargo >/dev/null || { say "cargo is missing: install Rust from https://rustup.rs and run this again"; exit 1; }
    command -v cc >/dev/null || install gcc libc6-dev || { say "a C compiler is missing: apt-get install gcc libc6-dev, and run this again"; exit 1; }
}

# broadcast PROGRAM LOG: six seconds of maps as a unit sends them that has been on for long
broadcast() {
    "$1" bus tests/recordings/motorway.mcap --to 6 --config tests/recordings/settled.toml --log "$2" --force >/dev/null
}

# A Chromium for the tests of pages: true where there is one
need_browser() {
    [ -n "${VIEWSHED_BROWSER:-}" ] || [ -x /usr/lib/chromium/chromium-headless-shell ] ||
        command -v chromium-headless-shell chromium google-chrome chromium-browser >/dev/null ||
        install chromium-headless-shell || install chromium
}
