# SPDX-License-Identifier: GPL-3.0-or-later
"""The decks in ngspice 46, beside the system's ngspice: the same results. ``make ngspice46``."""

import os
import re
import resource
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
NEWER = ROOT / ".tools" / "ngspice" / "bin" / "ngspice"
DECKS = sorted((ROOT / "netlists").glob("*.cir"))


def measured(executable: str | Path, deck: Path, folder: Path) -> dict[str, float]:
    done = subprocess.run(
        [executable, "-b", str(deck)], cwd=folder, capture_output=True, text=True, timeout=600, check=False
    )
    log = done.stdout + done.stderr
    assert done.returncode == 0, log
    assert not re.search(r"\b(error|warning)\b", log, re.I), log
    return {name: float(value) for name, value in re.findall(r"^(\w+) *= +([-+.\de]+)", done.stdout, re.M)}


def system_ngspice() -> str:
    folders = [folder for folder in os.environ["PATH"].split(":") if ".tools" not in folder]
    return next(str(Path(folder, "ngspice")) for folder in folders if Path(folder, "ngspice").is_file())


@pytest.mark.parametrize("deck", DECKS, ids=lambda deck: deck.stem)
def test_a_deck_gives_the_same_in_both_versions(deck: Path, tmp_path: Path) -> None:
    old, new = (measured(executable, deck, tmp_path) for executable in (system_ngspice(), NEWER))
    assert old.keys() == new.keys()
    assert old
    # switching edges and digital events are met by steps of ngspice's own choice, which differ between the versions
    tolerance = 0.02 if re.match("drive_|tracker_", deck.stem) else 1e-4
    scale = max(map(abs, old.values()))
    for name, value in old.items():
        assert new[name] == pytest.approx(value, rel=tolerance, abs=1e-9 * scale), name


def test_its_threads_do_not_slow_a_deck_down(tmp_path: Path) -> None:
    """Its start file sets num_threads=8. Only compact transistor models and OSDI use them; no deck has either."""
    text = (ROOT / "netlists" / "impact.cir").read_text(encoding="ascii")
    one = tmp_path / "one.cir"
    one.write_text(text.replace(".end\n", ".control\nset num_threads=1\n.endc\n.end\n"), encoding="ascii")

    def seconds(deck: Path) -> float:
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        for _ in range(5):
            subprocess.run([NEWER, "-b", deck], cwd=tmp_path, capture_output=True, check=True, timeout=120)
        return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before

    # five runs each of 0.1 s: a machine under load measures them to some 30 %; the fault to find is a factor of 50
    assert seconds(ROOT / "netlists" / "impact.cir") < 3.0 * seconds(one)
