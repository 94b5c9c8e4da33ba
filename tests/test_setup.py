# SPDX-License-Identifier: GPL-3.0-or-later
"""The set-up script in a small tree, with stand-ins for Python, pip and ngspice."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[1] / "scripts" / "setup.sh"
PYTHON = """#!/bin/sh
case "$*" in
    "-m venv"*)
        rm -rf .venv; mkdir -p .venv/bin; cp "$0" .venv/bin/python; sleep 0.3
        echo "VIRTUAL_ENV='$PWD/.venv'" >.venv/bin/activate ;;
    "-m pip install"*)
        mkdir installing || exit 1
        sleep 0.5; echo "$*" >>installed; rmdir installing ;;
esac
"""


def test_without_a_network_it_says_at_once_what_is_needed(tree: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PIP_DEFAULT_TIMEOUT", "60")
    program = tree.parent / "bin" / "python3"
    failing = '"-m pip download"*) echo retries $PIP_RETRIES, $PIP_DEFAULT_TIMEOUT s; exit 1 ;;\n    "-m venv"*'
    program.write_text(PYTHON.replace('"-m venv"*', failing), encoding="utf-8")
    ended = subprocess.run(["sh", "scripts/setup.sh"], cwd=tree, capture_output=True, text=True, check=False)
    assert ended.returncode == 1
    assert "retries 0, 10 s" in ended.stdout
    assert not (tree / "installed").exists()
    assert "needs a network with a package index; PIP_INDEX_URL" in ended.stderr


@pytest.fixture(params=["plain", "with $HOME and $undefined"])
def tree(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    place = tmp_path / request.param
    (place / "scripts").mkdir(parents=True)
    shutil.copy(SCRIPT, place / "scripts")
    (place / "pyproject.toml").touch()
    (tmp_path / "bin").mkdir()
    for name, text in (("python3", PYTHON), ("ngspice", "#!/bin/sh\n")):
        (tmp_path / "bin" / name).write_text(text, encoding="utf-8")
        (tmp_path / "bin" / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.delenv("PYTHON", raising=False)
    return place


def begin(tree: Path) -> subprocess.Popen[bytes]:
    return subprocess.Popen(["sh", tree / "scripts/setup.sh"])


def test_two_at_once_install_one_after_the_other(tree: Path) -> None:
    both = [begin(tree), begin(tree)]
    assert [one.wait(timeout=60) for one in both] == [0, 0]
    assert (tree / "installed").read_text(encoding="utf-8").count("\n") == 1  # the second found everything in place


def test_a_second_run_installs_nothing(tree: Path) -> None:
    for _ in range(2):
        assert begin(tree).wait(timeout=60) == 0
    assert (tree / "installed").read_text(encoding="utf-8").endswith(" -e .\n")  # no extra


def test_the_demo_says_how_long_it_takes_before_anything_else() -> None:
    done = subprocess.run(["make", "-n", "demo"], cwd=SCRIPT.parents[1], capture_output=True, text=True, check=True)
    first, setup, work = done.stdout.splitlines()
    assert "about two minutes" in first
    assert "a minute or two" in first
    assert setup == "sh scripts/setup.sh"  # no extra: the page of the command report is not part of the demo
    assert work == ".venv/bin/python figures/demo.py --output demo"


def test_without_ngspice_and_root_the_demo_gets_webassembly(tree: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tools = tree.parent / "tools"
    tools.mkdir()
    for name in re.findall(r"\w+", "sh dirname uname id grep cksum mktemp rm mkdir rmdir cp cat tr sleep flock"):
        (tools / name).symlink_to(str(shutil.which(name)))
    (tree.parent / "bin" / "ngspice").unlink()
    monkeypatch.setenv("PATH", f"{tree.parent / 'bin'}{os.pathsep}{tools}")
    ended = subprocess.run(["sh", "scripts/setup.sh"], cwd=tree, capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert "as WebAssembly it needs no root" in ended.stdout
    assert (tree / "installed").read_text(encoding="utf-8").endswith(" -e .[engine]\n")
