# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs a deck as an engineer does, ``ngspice -b FILE``, and reads what its ``.measure`` lines print."""

import re
import subprocess
from pathlib import Path

from pyspice_runner.spice.ngspice import find_ngspice


def measured(deck: str, folder: Path) -> dict[str, float]:
    """Run a deck in a folder that holds nothing else; name → value of every ``.measure`` in it."""
    (folder / "deck.cir").write_text(deck)
    assert [path.name for path in folder.iterdir()] == ["deck.cir"]
    done = subprocess.run(
        [find_ngspice(), "-b", "-n", "deck.cir"], cwd=folder, capture_output=True, text=True, timeout=60,
        stdin=subprocess.DEVNULL, check=False,
    )  # fmt: skip
    log = done.stdout + done.stderr
    assert done.returncode == 0, log
    assert not re.search("error|warning|failed", log, re.IGNORECASE), log
    found = dict(re.findall(r"^(\w+) *= +(\S+)", log, re.MULTILINE))
    wanted = re.findall(r"^\.measure \w+ (\w+)", deck, re.MULTILINE)
    assert wanted
    return {name: float(found[name]) for name in wanted}
