# SPDX-License-Identifier: GPL-3.0-or-later
"""Run what the README and docs/getting_started.md show, commands, Python and SPICE, in an empty directory."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import typer

from pyspice_runner.cli import app, run
from tests.circuit.batch import batch, results
from tests.processes import other_cache

pytestmark = pytest.mark.slow  # among the first, since the commands run in order

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
STARTED = (ROOT / "docs" / "getting_started.md").read_text(encoding="utf-8")


def commands(text: str) -> list[str]:
    """Return the commands of a text, each once."""
    return list(dict.fromkeys(re.findall(r"(?:^    |`)(piezomotor [^`\n#]+?)(?= *(?:[`\n]| #))", text, re.M)))


COMMANDS = commands(README + STARTED)


def parse(words: str) -> None:
    """Parse a command without running it."""
    group = typer.main.get_command(app())
    with group.make_context("piezomotor", []) as context:
        name, *arguments = shlex.split(words)[1:]
        group.get_command(context, name).make_context(name, arguments, parent=context).close()


@pytest.mark.parametrize(
    "more", [["--duration", "1ms"], pytest.param([], marks=pytest.mark.soak)], ids=["short", "all"]
)
def test_the_commands_run_in_order(more: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The run of the report is shorter, unless in the soak: until it has settled it takes half of the CPU time."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", other_cache(tmp_path / "cache"))
    for words in COMMANDS:
        arguments = shlex.split(words)[1:]
        assert run(arguments + (more if arguments[0] == "report" else [])) == 0, words
        for option in ("--output", "--plot"):
            if option in arguments:
                assert (tmp_path / arguments[arguments.index(option) + 1]).stat().st_size > 0


def test_the_python_of_the_readme_runs(tmp_path: Path) -> None:
    (snippet,) = re.findall(r"^```python\n(.*?)^```", README, re.M | re.S)
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", snippet],
        cwd=tmp_path,
        env={"PYTHONPATH": str(ROOT), "PATH": "/usr/local/bin:/usr/bin:/bin"},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "stick" in done.stdout


def test_the_spice_of_the_readme_runs(tmp_path: Path) -> None:
    (circuit,) = re.findall(r"^```spice\n(.*?)^```", README, re.M | re.S)
    assert run(["export", "bimodal40", "--output", str(tmp_path / "motor.lib")]) == 0
    assert results(batch(tmp_path / "spin.cir", circuit))["speed"] > 5.0  # rad/s, still speeding up


def test_the_citation_names_the_version_of_the_package() -> None:
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert re.findall(r"^version: (\S+)$", citation, re.M) == re.findall(r'^version = "(\S+)"$', project, re.M)
