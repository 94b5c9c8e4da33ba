# SPDX-License-Identifier: GPL-3.0-or-later
"""Every figure is drawn by its script, and shows what the script computes today."""

import json
import os
import re
import runpy
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl
import matplotlib.image
import numpy as np
import pytest
from PIL import Image

from tests.selection import mostly

FIGURES = Path(__file__).resolve().parents[2] / "figures"
DEMO = ["admittance", "figure_5", "half_bridge", "speed_force", "spin_up"]  # the others are `make figures`
CHEAP = ["bimodal40_modes", "contact_patch", "diagram_motor", "measured"]  # `make soak` draws the others
SCRIPTS = sorted(path for path in FIGURES.glob("*.py") if path.stem not in ("diagram", "style", "demo"))


def run_script(name: str, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """Run a script as a user does, with the package that is under test."""
    return subprocess.run(
        [sys.executable, FIGURES / name, *arguments],
        env=os.environ | {"PYTHONPATH": str(FIGURES.parent)},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


def check(picture: Path) -> None:
    """A picture of good size, neither blank nor a smear, nothing cut off at an edge, in colours."""
    pixels = matplotlib.image.imread(picture)[..., :3]
    assert pixels.shape[0] > 600
    assert pixels.shape[1] > 1000
    drawn = (pixels < 0.99).any(axis=2)
    assert 0.02 < drawn.mean() < 0.55  # a diagram in coloured boxes: 0.51
    assert not drawn[[0, -1]].any()
    assert not drawn[:, [0, -1]].any()
    assert len(np.unique((pixels[drawn] * 7).astype(int) @ (64, 8, 1))) > 10


def test_every_script_has_its_picture_beside_it() -> None:
    assert set(DEMO) <= {path.stem for path in SCRIPTS}
    assert sorted(FIGURES.glob("*.png")) == [path.with_suffix(".png") for path in SCRIPTS]


@pytest.mark.slow
@pytest.mark.soak
def test_the_demo_draws_every_figure_and_says_what_the_motor_did(tmp_path: Path) -> None:
    done = run_script("demo.py", "--draft", "--output", tmp_path / "pictures")
    assert done.returncode == 0, done.stderr
    pictures = sorted((tmp_path / "pictures").glob("*.png"))
    assert [path.stem for path in pictures] == DEMO
    for picture in pictures:
        check(picture)
        assert str(picture) in done.stdout
    for word in ("stick", "slip", "separated", "rings", "rad/s", "energy", "mm/s", "efficiency", "from the supply"):
        assert word in done.stdout
    assert "✓" in done.stderr  # progress does not mix with the story
    assert "✓" not in done.stdout


@pytest.fixture
def in_this_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Run a script here: a process that begins anew takes longer to load than some of them to draw."""

    def run(script: Path, *arguments: str) -> None:
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))  # what it sweeps must not come out of the user's
        monkeypatch.syspath_prepend(FIGURES)
        monkeypatch.delitem(sys.modules, "style", raising=False)  # it sets what the next line takes back
        for name in [name for name in sys.modules if name.split(".")[0] == "docs"]:  # as pytest calls tests/docs too
            monkeypatch.delitem(sys.modules, name)
        monkeypatch.setattr(sys, "argv", [str(script), *arguments])
        with mpl.rc_context():
            runpy.run_path(str(script), run_name="__main__")

    return run


@pytest.mark.slow
@pytest.mark.parametrize(
    "script",
    mostly(pytest.mark.soak, SCRIPTS, [path for path in SCRIPTS if path.stem in CHEAP]),
    ids=lambda path: path.stem,
)
def test_a_committed_picture_shows_what_its_script_computes(
    script: Path, tmp_path: Path, in_this_process: Callable[..., None], capsys: pytest.CaptureFixture[str]
) -> None:
    """Title and caption up to their numbers, and the numbers that are drawn within 0.1 % of the largest of a curve.

    Four digits are recorded; the trajectories of two builds of ngspice differ by less.
    """
    in_this_process(script, "--output", str(tmp_path))
    check(tmp_path / f"{script.stem}.png")
    assert capsys.readouterr().out
    drawn, committed = (Image.open(folder / f"{script.stem}.png").text for folder in (tmp_path, FIGURES))
    for name in ("Title", "Description"):
        assert re.sub(r"[\d.]+", "#", drawn[name]) == re.sub(r"[\d.]+", "#", committed[name])
    ours, theirs = (json.loads(texts["Numbers"]) for texts in (drawn, committed))
    assert list(ours) == list(theirs)
    for name, values in theirs.items():
        np.testing.assert_allclose(ours[name], values, rtol=1e-3, atol=1e-3 * np.abs(values).max(), err_msg=name)
