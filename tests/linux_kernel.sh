#!/bin/sh
# Runs the daemon, and `viewshed listen`, `view` and `doctor`, on virtual CAN buses under Debian's kernel in QEMU: for
# machines whose own kernel has no CAN. Downloads 80 MB, once, into the target folder; takes about a minute then.
#
#   tests/linux_kernel.sh              with --install what it needs is only made ready
set -eu

cd "$(dirname "$0")/.."
. tests/tools.sh
lacking() { skip kernel "virtual CAN buses under QEMU: $1"; }

[ "$(uname -m)" = x86_64 ] || lacking "written for x86-64"
need_compilers
for program in qemu-system-x86_64:qemu-system-x86 busybox:busybox-static ip:iproute2; do
    PATH=$PATH:/usr/sbin:/sbin command -v "${program%:*}" >/dev/null || install "${program#*:}" || lacking "no ${program%:*}"
done
harness=${CARGO_TARGET_DIR:-$PWD/target}
target=$harness/boards/linux
kernel=$target/kernel
if [ ! -e "$kernel/done" ]; then
    rm -rf "$kernel"
    mkdir -p "$kernel/files"
    download() {
        package=$(apt-cache depends linux-image-amd64 2>/dev/null | sed -n 's/^ *Depends: //p' | head -n 1)
        [ -n "$package" ] && (cd "$kernel" && apt-get download "$package" >/dev/null 2>&1 && dpkg -x ./*.deb files)
    }
    # the second time with lists of packages that are not absent or old
    download || { may_install && apt_get update && download; } || lacking "cannot download linux-image-amd64"
    touch "$kernel/done"
fi
[ "$only" != --install ] || exit 0

# the test's program, and what the kernel is to run
cargo build --quiet --release --locked --manifest-path boards/linux/Cargo.toml --target-dir "$target"
tests=$(cargo test --release --locked --no-run --test vcan --manifest-path boards/linux/Cargo.toml --target-dir "$target" 2>&1 |
    sed -n 's/.*Executable.*(\(.*\))$/\1/p')
# VIEWSHED: one that is built already
viewshed=${VIEWSHED:-$harness/release/viewshed}
[ -n "${VIEWSHED:-}" ] || cargo build --quiet --release --locked --package viewshed-harness
disk=$kernel/disk
rm -rf "$disk"
mkdir -p "$disk/bin" "$disk/modules" "$disk/proc" "$disk/sys" "$disk/dev" "$disk/tmp"
cp "$(command -v busybox)" "$disk/bin/busybox"
cp "$target/release/viewshedd" "$disk/bin/viewshedd"
cp "$tests" "$disk/bin/vcan"
cp "$viewshed" "$disk/bin/viewshed"
broadcast "$viewshed" "$disk/broadcast.log"
cp "$(PATH=$PATH:/usr/sbin:/sbin command -v ip)" "$disk/bin/ip"
for program in "$disk"/bin/*; do ldd "$program" 2>/dev/null | grep -o '/[^ ]*' || true; done | sort -u |
    while read -r library; do
        mkdir -p "$disk$(dirname "$library")"
        cp -L "$library" "$disk$library"
    done
for module in net/can/can net/can/can-raw drivers/net/can/dev/can-dev drivers/net/can/vcan; do
    cp "$kernel"/files/lib/modules/*/kernel/$module.ko "$disk/modules/"
done
cat >"$disk/init" <<'END'
#!/bin/busybox sh
for kind in proc sys; do /bin/busybox mount -t ${kind}fs $kind /$kind 2>/dev/null || /bin/busybox mount -t $kind $kind /$kind; done
/bin/busybox mount -t devtmpfs dev /dev
for module in can can-raw can-dev vcan; do /bin/busybox insmod /modules/$module.ko; done
/bin/ip link set lo up
export PATH=/bin VIEWSHEDD=/bin/viewshedd VIEWSHED=/bin/viewshed BROADCAST=/broadcast.log
echo "kernel $(/bin/busybox uname -r)"
/bin/vcan --nocapture --test-threads=1
/bin/busybox poweroff -f
END
chmod +x "$disk/init"
(cd "$disk" && find . | busybox cpio -o -H newc 2>/dev/null) | gzip -1 >"$kernel/disk.gz"

log=$kernel/log
timeout -k 5 300 qemu-system-x86_64 -m 512 -nographic -no-reboot -net none -kernel "$kernel"/files/boot/vmlinuz-* \
    -initrd "$kernel/disk.gz" -append "console=ttyS0 quiet panic=1" </dev/null 2>&1 | tr -d '\r' >"$log" || true
grep -E '^kernel |frames, Counters|^listen --can|^view --can' "$log" || true
# nothing is lacking in there
if grep -q 'skipped: ' "$log" || ! grep '^test result: ok' "$log"; then
    cat "$log"
    exit 1
fi
