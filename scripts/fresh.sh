#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
#
# Runs make targets of the last commit on a minimal Debian or Ubuntu, as on a machine that has just been installed.
#
#   scripts/fresh.sh RELEASE [TARGET…]      e.g. scripts/fresh.sh trixie demo test
#
# RELEASE: bookworm, trixie, forky, or noble (Ubuntu 24.04) with MIRROR=URL of a mirror of Ubuntu. The system is made by debootstrap in ${TMPDIR:-/var/tmp}/fresh-RELEASE, entered by chroot, and
# removed when every target succeeds. Mirror, proxy and certificates are those of this machine; MIRROR=URL chooses
# another mirror. Needs root and util-linux. All mounts live in a mount namespace, which ends with this script, however
# that ends.

set -eu
cd -P "$(dirname "$0")/.."

say() { printf 'fresh: %s\n' "$*"; }
die() {
    printf 'fresh: %s\n' "$*" >&2
    exit 1
}

[ $# -ge 1 ] && [ -n "$1" ] || die "Name a release of Debian, for example: make fresh RELEASE=trixie"
[ "$(id -u)" -eq 0 ] || die "debootstrap and chroot need root: sudo make fresh RELEASE=$1"
if [ -z "${FRESH_NAMESPACE:-}" ]; then
    export FRESH_NAMESPACE=yes
    exec unshare --mount --pid --fork --kill-child "$0" "$@"
fi
trap 'exit 130' INT
trap 'exit 143' TERM

release=$1
shift
[ $# -gt 0 ] || set -- demo test
root=${TMPDIR:-/var/tmp}/fresh-$release
commit=$(git rev-parse --short HEAD)

# --- the system ---

mirror() { # prints the mirror of this system's apt sources
    apt-get indextargets --format '$(REPO_URI)' 'Origin: Debian' 'Label: Debian' | head -n 1
}

case $release in # components, and the script of debootstrap for a release that it does not know
    noble)
        [ -n "${MIRROR:-}" ] || die "Ubuntu is made from a mirror of its own: make fresh RELEASE=noble MIRROR=URL"
        components=main,universe script=gutsy
        ;;
    *) components=main script=sid ;;
esac
command -v debootstrap >/dev/null 2>&1 || { apt-get update -q && apt-get install -q -y debootstrap; }
MIRROR=${MIRROR:-$(mirror)}
[ -n "$MIRROR" ] || die "apt knows no mirror of Debian. Run 'apt-get update', or give one: make fresh MIRROR=URL"

say "making a minimal $release in $root"
rm -rf --one-file-system "$root"
[ ! -e "/usr/share/debootstrap/scripts/$release" ] || script=$release
debootstrap --variant=minbase --components="$components" --include=ca-certificates,make,git \
    "$release" "$root" "$MIRROR" "$script" >"$root.log" 2>&1 ||
    { tail -n 5 "$root.log" >&2; die "debootstrap failed; see $root.log"; }

# --- what it takes from this machine: names, certificates, proxies ---

for file in /etc/resolv.conf /etc/hosts /etc/pip.conf /etc/apt/apt.conf; do
    [ ! -e "$file" ] || cp -L "$file" "$root$file"
done
cp -L /etc/ssl/certs/ca-certificates.crt "$root/etc/ssl/certs/"
grep -lsi 'proxy\|cainfo' /etc/apt/apt.conf.d/* | while read -r file; do cp "$file" "$root/etc/apt/apt.conf.d/"; done

mount --bind "$root" "$root" # so that the root is a mount point, as on a machine
mount --rbind /dev "$root/dev"
mount -t proc proc "$root/proc"

git -c safe.directory="$PWD" clone -q --no-local . "$root/root/tree"

inside() { # COMMAND…: in the new system, with no variable of this one but proxies and the index of pip
    certificates=/etc/ssl/certs/ca-certificates.crt
    set -- PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LANG=C.UTF-8 \
        PIP_CERT=$certificates NODE_EXTRA_CA_CERTS=$certificates "$@"
    for name in http_proxy https_proxy no_proxy HTTP_PROXY HTTPS_PROXY NO_PROXY PIP_INDEX_URL PIP_EXTRA_INDEX_URL; do
        eval "value=\${$name:-}"
        [ -z "$value" ] || set -- "$name=$value" "$@"
    done
    env -i "$@"
}

# --- the targets ---

for target; do
    say "make $target of commit $commit on $release"
    start=$(date +%s)
    inside chroot "$root" make -C /root/tree "$target" || die "make $target failed on $release; the system is left in $root"
    say "make $target took $(($(date +%s) - start)) s"
done
inside chroot "$root" sh -c 'python3 --version; ngspice --version | grep -o "ngspice-[0-9.]*" | head -n 1'
umount -R "$root"
rm -rf --one-file-system "$root" "$root.log"
say "$* succeeded on $release at commit $commit"
