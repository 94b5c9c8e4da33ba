# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs a deck as an engineer does, ``ngspice -b FILE``, and reads what its ``.measure`` lines print."""

import re
import subprocess
from pathlib import Path

from pyspice_runner.spice.ngspice import find_ngspice


def batch(path: Path, text: str | None = None, *options: str) -> str:
    """Run a deck in its folder, into which its text may be written first; return all that ngspice prints."""
    if text is not None:
        path.write_text(text, encoding="utf-8")
    done = subprocess.run(
        [find_ngspice(), "-b", *options, path.name], cwd=path.parent, capture_output=True, text=True, timeout=120,
        stdin=subprocess.DEVNULL, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


def results(log: str) -> dict[str, float]:
    """Return the numbers that ngspice prints as NAME = VALUE."""
    return {name: float(value) for name, value in re.findall(r"^(\w+) *= *([-+]?\d[-+.\de]*)", log, re.MULTILINE)}


def writes_a_raw_file(path: Path) -> None:
    """Run a deck for a raw file, and check that this has points."""
    batch(path, None, "-r", "out.raw")
    assert (path.parent / "out.raw").stat().st_size > 10_000


def measured(deck: str, folder: Path) -> dict[str, float]:
    """Run a deck in a folder that holds nothing else; name → value of every ``.measure`` in it."""
    assert {path.name for path in folder.iterdir()} <= {"deck.cir"}
    log = batch(folder / "deck.cir", deck, "-n")
    assert not re.search("error|warning|failed", log, re.IGNORECASE), log
    found = results(log)
    wanted = re.findall(r"^\.measure \w+ (\w+)", deck, re.MULTILINE)
    assert wanted
    return {name: found[name] for name in wanted}
