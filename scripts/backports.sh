#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
#
# Unpacks programs that are too old in this release of Debian from its backports into .tools/, beside those of the system.
# Mirror, proxy, keys and release are those of apt's own sources. Needs no root and changes nothing outside of .tools/; a
# program that is already there is left alone. A program that is new enough in the release itself comes from there.
#
#   scripts/backports.sh ngspice      .tools/ngspice/bin/ngspice
#   scripts/backports.sh kicad        .tools/kicad/bin/kicad-cli

set -eu
cd -P "$(dirname "$0")/.."

say() { printf 'backports: %s\n' "$*"; }
die() {
    printf 'backports: %s\n' "$*" >&2
    exit 1
}

program=${1:-}
case $program in # the oldest version that the tests work with
    ngspice) oldest=46 ;; # interface OSDI 0.4; ngspice 44 knows the command osdi, with an older interface
    kicad) oldest=9 ;;
    *) die "name a program: ngspice or kicad" ;;
esac
root=$PWD/.tools/$program
[ -e "$root/done" ] && exit 0
command -v apt-get >/dev/null 2>&1 || die "this needs apt-get, so Debian. Elsewhere install $program $oldest or newer"

state=$root/apt
rm -rf "$root"
mkdir -p "$state/lists/partial" "$state/archives/partial" "$state/sources.list.d"

# --- apt's own sources, with the backports of the release beside it ---

eval "$(apt-config shell list Dir::Etc::sourcelist/f parts Dir::Etc::sourceparts/d)"
for file in "$list" "$parts"/*.list "$parts"/*.sources; do # copy: as file: would leave the packages where they are
    [ ! -f "$file" ] || sed 's|\([[:space:]]\)file:|\1copy:|g' "$file" >"$state/sources.list.d/${file##*/}"
done
apt() { # COMMAND…: apt with these sources and lists of its own
    command=$1
    shift
    "$command" -q -o Dir::Etc::SourceList=/dev/null -o Dir::Etc::SourceParts="$state/sources.list.d" \
        -o Dir::State::Lists="$state/lists" -o Dir::Cache::Archives="$state/archives" -o Dir::Cache::pkgcache= \
        -o Dir::Cache::srcpkgcache= -o APT::Sandbox::User= -o Debug::NoLocking=1 "$@"
}
update() { apt apt-get update || say "apt-get update failed; going on with the lists that it has"; }

update
# shellcheck disable=SC2046
set -- $(apt apt-get indextargets --format '$(REPO_URI) $(RELEASE)' 'Created-By: Packages' 'Origin: Debian' \
    'Label: Debian' | awk '$2 !~ /-/ { print; exit }')
[ $# -eq 2 ] || die "apt has no source of a Debian release. Elsewhere install $program $oldest or newer"
mirror=${1%/} release=$2

candidate() { # prints the version that apt would install from a suite, as 44.2
    apt apt-cache policy -t "$1" "$program" | sed -n 's/^ *Candidate: *\([0-9]*:\)\{0,1\}\([0-9.]*\).*/\2/p'
}
suite=$release
version=$(candidate "$suite")
if dpkg --compare-versions "${version:-0}" ge $oldest; then
    say "$program $version of $release is new enough: $oldest or newer is needed"
else
    say "$program ${version:-(none)} of $release is older than $oldest; taking that of $release-backports from $mirror"
    suite=$release-backports
    # a stanza of a .sources file is a paragraph, an entry of a .list file a line
    for file in "$state"/sources.list.d/*; do
        case $file in *.sources) paragraphs= ;; *) paragraphs='\n' ;; esac
        awk -v RS="$paragraphs" -v mirror="$mirror" -v release="$release" '
            { print $0 (RS == "" ? "\n" : "") }
            index($0, mirror) && match($0, "[ \t]" release "([ \t\n]|$)") && !index($0, release "-backports") {
                print substr($0, 1, RSTART) release "-backports" substr($0, RSTART + 1 + length(release)) (RS == "" ? "\n" : "")
            }' "$file" >"$file.new"
        mv "$file.new" "$file"
    done
    update
    version=$(candidate "$suite")
    dpkg --compare-versions "${version:-0}" ge $oldest ||
        die "$mirror has $program ${version:-(none)} for $suite; install $program $oldest or newer"
fi
say "downloading $program $version and the libraries that the system does not have"
apt apt-get install -y --no-install-recommends --download-only --reinstall -t "$suite" "$program"
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
