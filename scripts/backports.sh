#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
#
# Unpacks programs from Debian's backports into .tools/, beside those of the system. Needs no root and changes nothing
# outside of .tools/; a program that is already there is left alone.
#
#   scripts/backports.sh ngspice      .tools/ngspice/bin/ngspice
#   scripts/backports.sh kicad        .tools/kicad/bin/kicad-cli

set -eu
cd -P "$(dirname "$0")/.."

program=$1
root=$PWD/.tools/$program
[ -e "$root/done" ] && exit 0
command -v apt-get >/dev/null 2>&1 || { echo "backports: this needs apt-get, so Debian or Ubuntu" >&2; exit 1; }

state=$root/apt
rm -rf "$root"
mkdir -p "$state/lists/partial" "$state/archives/partial" "$root"
cat >"$state/sources.list" <<EOF
deb [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] http://deb.debian.org/debian bookworm main
deb [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] http://deb.debian.org/debian bookworm-backports main
EOF
apt() {
    apt-get -q -o Dir::Etc::SourceList="$state/sources.list" -o Dir::Etc::SourceParts=- \
        -o Dir::State::Lists="$state/lists" -o Dir::Cache::Archives="$state/archives" -o Dir::Cache::pkgcache= \
        -o Dir::Cache::srcpkgcache= -o APT::Sandbox::User= -o Debug::NoLocking=1 "$@"
}
echo "backports: downloading $program and the libraries that the system does not have"
apt update
apt install -y --no-install-recommends --download-only -t bookworm-backports "$program"
for package in "$state"/archives/*.deb; do
    dpkg-deb -x "$package" "$root"
done
rm -rf "$state"

# starters that find the files of this version, not those of the system
mkdir -p "$root/bin"
if [ "$program" = ngspice ]; then
    sed -i "s|/usr/lib/|$root/usr/lib/|" "$root/usr/share/ngspice/scripts/spinit"
    cat >"$root/bin/ngspice" <<EOF
#!/bin/sh
SPICE_LIB_DIR='$root/usr/share/ngspice' exec '$root/usr/bin/ngspice' "\$@"
EOF
else
    cat >"$root/bin/kicad-cli" <<EOF
#!/bin/sh
export LD_LIBRARY_PATH='$root/usr/lib/x86_64-linux-gnu'
exec '$root/usr/bin/kicad-cli' "\$@"
EOF
fi
chmod +x "$root"/bin/*
touch "$root/done"
