# SPDX-License-Identifier: GPL-3.0-or-later
"""The wheel holds all that a user needs: installed in an empty environment, it runs in an empty directory."""

import json
import os
import re
import subprocess
import sys
import tarfile
import venv
import zipfile
from importlib import metadata
from importlib.util import cache_from_source
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]

# one group, so that parallel workers do not build and install it twice
pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("wheel")]


def run(*command: str | Path, cwd: Path) -> str:
    """Run a command with nothing of this test's Python in its environment; its standard output."""
    env = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON") and k != "VIRTUAL_ENV"}
    done = subprocess.run(
        [str(part) for part in command],
        cwd=cwd,
        env=env,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    if done.returncode:
        pytest.fail(f"{command} exited {done.returncode}\n{done.stdout}\n{done.stderr}", pytrace=False)
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the wheel out of the sdist, as a packager does, so that the sdist is shown to be complete too."""
    dist = tmp_path_factory.mktemp("dist")
    run(sys.executable, "-m", "build", "--no-isolation", "--outdir", dist, ROOT, cwd=dist)
    (built,) = dist.glob("*.whl")
    return built


def required(name: str) -> set[str]:
    """The distributions that a requirement of the wheel brings along, by what those installed here declare."""
    found, waiting = set[str](), [Requirement(name)]
    while waiting:
        asked = waiting.pop()
        if canonicalize_name(asked.name) not in found:
            found.add(canonicalize_name(asked.name))
            needs = map(Requirement, metadata.requires(asked.name) or ())
            extras = ("", *asked.extras)
            waiting += [
                need for need in needs if not need.marker or any(need.marker.evaluate({"extra": e}) for e in extras)
            ]
    return found


@pytest.fixture(scope="module")
def bin_dir(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The commands of a new environment that holds the wheel and its dependencies, and nothing else.

    The dependencies are links to the files of this environment, in which pip has installed them, instead of 200 MB of
    copies; pip checks their versions.
    """
    place = tmp_path_factory.mktemp("installed")
    venv.create(place, with_pip=False, symlinks=True)
    pip = (sys.executable, "-m", "pip", "--python", place / "bin" / "python", "--disable-pip-version-check")
    run(*pip, "install", "--quiet", "--no-compile", "--no-deps", wheel, cwd=place)
    (packages,) = place.glob("lib/python*/site-packages")
    (declared,) = metadata.distributions(name="piezomotor", path=[str(packages)])
    for requirement in map(Requirement, declared.requires or ()):
        if requirement.marker is None:  # no extra
            for name in required(str(requirement)):
                link(metadata.distribution(name), packages)
    run(*pip, "check", cwd=place)
    return place / "bin"


def link(distribution: metadata.Distribution, packages: Path) -> None:
    """Link the files of a distribution into another folder of packages."""
    for file in distribution.files or ():
        sides = (str(file.locate()), str(packages / file))
        compiled = [map(cache_from_source, sides)] if file.suffix == ".py" else []  # set-up installs without these
        for here, there in (map(Path, pair) for pair in (sides, *compiled)):
            if ".." not in file.parts and here.exists() and not there.exists():
                there.parent.mkdir(parents=True, exist_ok=True)
                there.symlink_to(here)


def test_the_wheel_has_the_libraries_the_decks_and_the_licence(wheel: Path) -> None:
    names = set(zipfile.ZipFile(wheel).namelist())
    wanted = {
        f"pyspice_runner/_data/{file.relative_to(ROOT).as_posix()}"
        for pattern in ("behavioral/**/*.lib", "netlists/**/*.*")
        for file in ROOT.glob(pattern)
    }
    assert {Path(name).suffix for name in wanted} == {".lib", ".cir"}
    assert wanted <= names
    sets = {file for file in (ROOT / "pyspice_runner" / "motor" / "sets").rglob("*") if file.is_file()}
    assert ROOT / "pyspice_runner" / "motor" / "sets" / "bimodal40.toml" in sets
    assert {file.relative_to(ROOT).as_posix() for file in sets} <= names
    for licence in ("LICENSE", "LICENSE-MIT"):
        assert any(name.endswith(f".dist-info/licenses/{licence}") for name in names)


def test_the_sdist_has_the_tools_that_write_the_decks(wheel: Path) -> None:
    (sdist,) = wheel.parent.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert {f"tools/{file.name}" for file in (ROOT / "tools").glob("*.py")} <= names


def test_the_wheel_has_nothing_but_the_package(wheel: Path) -> None:
    names = zipfile.ZipFile(wheel).namelist()
    assert not [name for name in names if not re.match(r"(pyspice_runner|piezomotor-[^/]*\.dist-info)/", name)]


def test_command_runs_in_an_empty_directory(bin_dir: Path, tmp_path: Path) -> None:
    motor = json.loads(run(bin_dir / "piezomotor", "show", "andersen2002", "--json", cwd=tmp_path))
    assert motor["name"] == "andersen2002"
    assert motor["modes"]


def test_deck_runs_in_an_empty_directory(bin_dir: Path, tmp_path: Path) -> None:
    ask = "from pyspice_runner.spice.library import data_path; print(data_path('netlists'))"
    netlists = Path(run(bin_dir / "python", "-c", ask, cwd=tmp_path).strip())
    assert netlists.is_relative_to(bin_dir.parent), f"{netlists} is not in the installed package"
    deck = min(netlists.rglob("*.cir"))
    log = run("ngspice", "-b", deck, cwd=tmp_path)
    assert not re.search(r"^\s*(error|fatal|warning)\b", log, re.IGNORECASE | re.MULTILINE), log
