# SPDX-License-Identifier: GPL-3.0-or-later
"""The script that unpacks newer programs, with a local mirror of small packages in the place of Debian's."""

import hashlib
import os
import shutil
import subprocess
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[1] / "scripts" / "backports.sh"
RELEASES = {
    "trixie": {"ngspice": "44.2+ds-1", "kicad": "9.0.2+dfsg-1"},
    "trixie-backports": {"ngspice": "46+ds-1~bpo13+1"},
}
SOURCES = {
    "a.list": "deb [trusted=yes] {} trixie main\n",
    "a.sources": "Types: deb\nURIs: {}\nSuites: trixie\nComponents: main\nTrusted: yes\n",
}


def add_package(mirror: Path, name: str, version: str, work: Path) -> str:
    """Put a package into the mirror, whose program prints its version; return its entry in the index."""
    tree = work / f"{name}_{version}"
    program = tree / "usr" / "bin" / {"kicad": "kicad-cli"}.get(name, name)
    spinit = tree / "usr" / "share" / "ngspice" / "scripts" / "spinit"
    for file, text in ((program, f"#!/bin/sh\necho {version}\n"), (spinit, "codemodel /usr/lib/x\n")):
        file.parent.mkdir(parents=True)
        file.write_text(text, encoding="ascii")
    program.chmod(0o755)
    control = f"Package: {name}\nVersion: {version}\nArchitecture: all\nMaintainer: Test <a@b.c>\nDescription: test\n"
    (tree / "DEBIAN").mkdir()
    (tree / "DEBIAN" / "control").write_text(control, encoding="ascii")
    package = mirror / "pool" / f"{name}_{version}_all.deb"
    package.parent.mkdir(parents=True, exist_ok=True)
    subprocess.run(["dpkg-deb", "--root-owner-group", "-b", tree, package], check=True, capture_output=True)
    content = package.read_bytes()
    digest = hashlib.sha256(content).hexdigest()
    return f"{control}Filename: pool/{package.name}\nSize: {len(content)}\nSHA256: {digest}\n"


@pytest.fixture
def mirror(tmp_path: Path) -> Path:
    place = tmp_path / "mirror"
    for release, packages in RELEASES.items():
        folder = place / "dists" / release
        index = "\n".join(add_package(place, *package, tmp_path / release) for package in packages.items()).encode()
        lines = []
        for architecture in ("amd64", "arm64"):
            name = f"main/binary-{architecture}/Packages"
            (folder / name).parent.mkdir(parents=True)
            (folder / name).write_bytes(index)
            lines.append(f" {hashlib.sha256(index).hexdigest()} {len(index)} {name}\n")
        label = "Debian Backports" if "-" in release else "Debian"
        (folder / "Release").write_text(
            f"Origin: Debian\nLabel: {label}\nSuite: {release}\nCodename: {release}\nArchitectures: amd64 arm64\n"
            f"Components: main\nDate: Sat, 09 Aug 2025 10:00:00 UTC\nSHA256:\n{''.join(lines)}",
            encoding="ascii",
        )
    return place


@pytest.mark.parametrize("file", SOURCES)
@pytest.mark.parametrize(
    ("program", "says", "version"),
    [
        ("kicad", "kicad 9.0.2 of trixie is new enough: 9 or newer is needed", "9.0.2+dfsg-1"),
        ("ngspice", "ngspice 44.2 of trixie is older than 46; taking that of trixie-backports", "46+ds-1~bpo13+1"),
    ],
)
def test_mirror_and_release_are_those_of_apts_own_sources(
    program: str, says: str, version: str, file: str, mirror: Path, tmp_path: Path
) -> None:
    tree, parts = tmp_path / "tree", tmp_path / "parts"
    (tree / "scripts").mkdir(parents=True)
    shutil.copy(SCRIPT, tree / "scripts")
    parts.mkdir()
    (parts / file).write_text(SOURCES[file].format(f"file:{mirror}"), encoding="ascii")
    (tmp_path / "apt.conf").write_text(
        f'Dir::Etc::SourceList "/dev/null";\nDir::Etc::SourceParts "{parts}";\n', encoding="ascii"
    )
    done = subprocess.run(
        ["sh", tree / "scripts" / "backports.sh", program], env=os.environ | {"APT_CONFIG": str(tmp_path / "apt.conf")},
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert says in done.stdout
    unpacked = tree / ".tools" / program / "bin" / {"kicad": "kicad-cli"}.get(program, program)
    ran = subprocess.run([unpacked], capture_output=True, text=True, check=True)
    assert ran.stdout.strip() == version


def test_another_program_is_an_error() -> None:
    done = subprocess.run(["sh", SCRIPT, "vim"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (1, "backports: name a program: ngspice or kicad\n")
