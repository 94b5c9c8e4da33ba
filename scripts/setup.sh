#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
#
# Installs what is missing and nothing else: ngspice, Python's venv module, this package (editable) in .venv, and for
# the tests Chromium, a C compiler and ngspice as WebAssembly. The last, which needs no root, is also what `make demo`
# takes where ngspice cannot be installed.
#
#   scripts/setup.sh            what `make demo` needs
#   scripts/setup.sh docs       what `make docs` needs
#   scripts/setup.sh test dev   the package with these extras of pyproject.toml
#   scripts/setup.sh target …   the same, with a compiler for a microcontroller, and qemu
#   scripts/setup.sh windows …  the same, with a compiler for Windows, and wine
#
# PYTHON=/path/to/python3 chooses the interpreter that .venv is made with. When nothing is missing, this
# returns at once, without pip or network.

set -eu
cd -P "$(dirname "$0")/.."

venv=.venv
python=$venv/bin/python

say() { printf 'setup: %s\n' "$*"; }
die() { # LINE…
    printf 'setup: %s\n' "$1" >&2
    shift
    [ $# -eq 0 ] || printf '%s\n' "$@" >&2
    exit 1
}
have() { command -v "$1" >/dev/null 2>&1; }

# --- system packages ---

lists_are_fresh=no

apt_install() { # PACKAGE…: by apt-get, as root or through sudo
    if [ "$(id -u)" -eq 0 ]; then
        as_root=
    elif have sudo; then
        as_root=sudo
    else
        die "$* is missing, and there is neither root nor sudo here. As root, run this, then try again:" \
            "  apt-get update && apt-get install -y $*"
    fi
    say "installing $* with apt-get"
    if [ $lists_are_fresh = no ]; then
        # one broken third-party list must not stop this; if the lists are unusable, the install says so
        $as_root apt-get update -q || say "apt-get update failed; going on with the package lists at hand"
        lists_are_fresh=yes
    fi
    $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends "$@" ||
        die "apt-get could not install $*; see its message above." \
            "  On Ubuntu it may help to switch 'universe' on: sudo add-apt-repository universe"
}

ngspice_command() { # prints how ngspice is installed on a system that has no apt-get
    case $(uname -s) in
        MINGW* | MSYS*) echo "pacman -S mingw-w64-ucrt-x86_64-ngspice" ;;
        Darwin) echo "brew install ngspice" ;;
        *)
            if have dnf; then
                echo "sudo dnf install ngspice"
            elif have pacman; then
                echo "sudo pacman -S ngspice"
            elif have zypper; then
                echo "sudo zypper install ngspice"
            elif have apk; then
                echo "sudo apk add ngspice"
            elif have brew; then
                echo "brew install ngspice"
            fi
            ;;
    esac
}

engine= # or the extra of the package that has one

need_ngspice() { # EXTRA…
    if ! have ngspice; then
        command=$(ngspice_command)
        case " $* " in *" test "*) tests=yes ;; *) tests=no ;; esac
        if have apt-get && { [ $tests = yes ] || [ "$(id -u)" -eq 0 ] || have sudo; }; then
            apt_install ngspice
        elif [ $tests = yes ]; then
            [ -n "$command" ] ||
                die "ngspice is missing. Install it, then try again: https://ngspice.sourceforge.io"
            die "ngspice is missing. Run this, then try again:" "  $command"
        else
            say "ngspice is missing; as WebAssembly it needs no root${command:+. A faster one: $command}"
            engine=engine
            return
        fi
    fi
    ngspice --version </dev/null >/dev/null 2>&1 || die "ngspice is installed, but 'ngspice --version' fails."
}

need_browser() { # for the tests, which open the report in it
    for browser in chromium chromium-browser google-chrome; do
        if have $browser; then
            return
        fi
    done
    have apt-get || die "The tests need Chromium. Install it, then try again."
    # Ubuntu's package of the other name brings the snap
    if grep -qi '^ID=ubuntu' /etc/os-release; then apt_install chromium-browser; else apt_install chromium; fi
}

need_compiler() { # for the tests, which build a .fmu
    for compiler in cc gcc clang; do
        if have $compiler; then
            return
        fi
    done
    have apt-get || die "The tests need a C compiler. Install gcc, then try again."
    apt_install gcc libc6-dev
}

need_target() { # for the firmware: a compiler for a microcontroller, and a processor to run it
    if have arm-none-eabi-gcc && have qemu-system-arm; then
        return
    fi
    have apt-get || die "Install gcc and newlib for arm-none-eabi, and qemu-system-arm, then try again."
    apt_install gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm
}

need_windows() { # for the binary of a .fmu: a compiler for Windows, and wine to run it
    if have x86_64-w64-mingw32-gcc && have wine; then
        return
    fi
    have apt-get || die "Install mingw-w64 and wine, then try again."
    apt_install gcc-mingw-w64-x86-64 wine wine64
}

# --- Python ---

new_enough() { "$1" -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1; }
version_of() { "$1" -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null; }

find_python() { # sets $base
    if [ -n "${PYTHON:-}" ]; then
        set -- "$PYTHON"
    else
        set -- python3 python3.14 python3.13 python3.12 python3.11
    fi
    for candidate; do
        if new_enough "$candidate"; then
            base=$candidate
            return
        fi
    done
    return 1
}

need_python() { # sets $base: Python 3.11 or newer that can make a virtual environment
    if ! have python3 && [ -z "${PYTHON:-}" ] && ! find_python && have apt-get; then
        apt_install python3 python3-venv
    fi
    find_python || no_python
    if ! "$base" -c 'import ensurepip, venv' >/dev/null 2>&1; then
        package=python$(version_of "$base")-venv
        have apt-get || die "$base lacks the modules ensurepip and venv. Install them, then try again."
        apt_install "$package"
        "$base" -c 'import ensurepip, venv' >/dev/null 2>&1 ||
            die "$base still lacks ensurepip or venv. Choose another Python with PYTHON=/path/to/python3."
    fi
}

no_python() {
    found=$(version_of "${PYTHON:-python3}") || found=none
    # shellcheck source=/dev/null
    release=$(. /etc/os-release 2>/dev/null && echo "${ID:-} ${VERSION_ID:-}") || release=
    case $release in
        "ubuntu 20.04" | "ubuntu 22.04")
            die "Python 3.11 or newer is needed; found: $found. Run this, then try again:" \
                "  sudo apt-get install -y software-properties-common &&" \
                "  sudo add-apt-repository -y ppa:deadsnakes/ppa &&" \
                "  sudo apt-get install -y python3.11 python3.11-venv"
            ;;
        *)
            die "Python 3.11 or newer is needed; found: $found. Install one, then try again." \
                "  PYTHON=/path/to/python3.11 chooses one that is not on PATH."
            ;;
    esac
}

# --- the package ---

# What the stamp holds: when any of it changes (dependencies, place of the tree), pip runs again.
fingerprint() { printf '%s\n%s\n' "$(cksum <pyproject.toml)" "$PWD"; }

need_package() { # EXTRA…
    extras=$(echo "$*" | tr ' ' ',')
    stamp=$venv/.stamp-${extras:-run}
    wanted=$(fingerprint)
    if new_enough $python; then
        full=$venv/.stamp-test,dev # serves every purpose but those of the heavy extras
        case " $* " in *" bench "* | *" compiled "* | *" docs "*) full=$stamp ;; esac
        for done in "$stamp" "$full"; do
            if [ -f "$done" ] && [ "$(cat "$done")" = "$wanted" ]; then
                return
            fi
        done
    fi
    need_python
    if ! new_enough $python || ! $python -m pip --version >/dev/null 2>&1 || moved; then
        say "making $venv with Python $(version_of "$base")"
        "$base" -m venv --clear $venv
    fi
    rm -f "$stamp"
    say "installing the package and its dependencies in $venv (a minute or two, once)"
    # one package of a few kB first, without retries: without a network pip would go on for minutes
    probe=$(mktemp -d)
    PIP_RETRIES=0 PIP_DEFAULT_TIMEOUT=10 $python -m pip download -q --disable-pip-version-check --no-deps -d "$probe" \
        hatchling || unreachable
    rm -rf "$probe"
    # Python compiles the modules that are imported, a fifth of the 20 s that all would take; PySpice beforehand and
    # without the warnings about its strings, which would come before the words of the first command
    $python -m pip install -q --disable-pip-version-check --no-compile -e ".${extras:+[$extras]}" || unreachable
    $python -W ignore -m compileall -q $venv/lib/python*/site-packages/PySpice
    printf '%s\n' "$wanted" >"$stamp"
}

need_engine() { # ngspice as WebAssembly, in the user's cache
    $python -m pyspice_runner engine install >/dev/null ||
        die "ngspice as WebAssembly could not be installed; see the message above."
}

unreachable() {
    die "pip could not install the package with the dependencies that pyproject.toml lists; see its message above." \
        "  It needs a network with a package index; PIP_INDEX_URL, PIP_PROXY or PIP_FIND_LINKS (a folder of wheels" \
        "  with PIP_NO_INDEX=1) name another source. What is installed already is kept."
}

moved() { # was the tree moved since .venv was made? Its scripts would point to the old place
    [ ! -f $venv/bin/activate ] || ! grep -qF "$PWD/$venv" $venv/bin/activate
}

# --- one set-up at a time ---

alone() { # waits for another set-up of this tree, which would make .venv at the same time
    have flock && [ -w . ] || return 0 # macOS has no flock, and in a read-only tree there is nothing to install
    exec 9>.setup.lock
    flock -n 9 && return 0
    say "another set-up is at work here; waiting for it"
    flock 9
}

alone
case "${1:-}" in
    target) shift && need_target ;;
    windows) shift && need_windows ;;
esac
need_ngspice "$@"
case " $* " in *" test "*) need_browser; need_compiler ;; esac
need_package "$@" $engine
case " $* $engine " in *" test "* | *" engine "*) need_engine ;; esac
