# SPDX-License-Identifier: GPL-3.0-or-later
"""The circuit diagrams name nodes and parameters as the subcircuits of ``behavioral/`` do."""

import re
import runpy
import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pytest

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = sorted((ROOT / "figures").glob("diagram_*.py"))
# of the six branches of a clamped capacitance, which is drawn between the pins of the motor, one has its name
NOT_DRAWN = {
    "piezomotor_group": {"p", "n", "slow1", "slow2", "slow3", "slow4", "slow5"},
    "piezomotor_averaged": {"shaft"},  # that of its rotor
    "piezomotor_mode": {"force", "damped", "velocity"},  # inside the loop, between the mode and its tip
    "piezomotor_tip": {"force", "velocity", "elastic"},
}


def names_of(script: Path) -> list[Any]:
    """The labels of a diagram that are names."""
    with pytest.MonkeyPatch.context() as patch, mpl.rc_context():
        patch.syspath_prepend(script.parent)
        for module in ("style", "diagram"):
            patch.delitem(sys.modules, module, raising=False)
        drawn = runpy.run_path(str(script))["sheet"]()
    assert drawn.names
    return list(drawn.names)


def text_of(library: str) -> str:
    """The file of a subcircuit: that of the averaged motor is generated."""
    folder = "netlists" if library == "piezomotor_averaged" else "behavioral"
    return (ROOT / folder / f"{library}.lib").read_text(encoding="utf-8")


def header_of(library: str, entry: str) -> set[str]:
    """Names of the ``PIN`` or ``PAR`` lines in the header of a subcircuit."""
    return set(re.findall(rf"^\* {entry} +(\w+)", text_of(library), re.M))


def words_of(label: str) -> list[str]:
    return re.findall(r"[a-z_]\w*", label)


def nodes_of(library: str) -> set[str]:
    """Pins and inner nodes of a subcircuit."""
    text = text_of(library)
    ends = re.findall(r"^[RLCVEFGHB]\w* (\w+) (\w+)", text, re.M)
    return header_of(library, "PIN") | {node for pair in ends for node in pair}


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_every_name_in_a_diagram_is_one_of_its_subcircuit(script: Path) -> None:
    unknown = []
    for name in names_of(script):
        known = nodes_of(name.library) if name.node else header_of(name.library, "PAR")
        unknown += [(name.library, word) for word in words_of(name.words) if word not in known]
    assert unknown == []


def test_the_diagrams_have_every_pin_of_the_subcircuits_that_they_draw() -> None:
    drawn: dict[str, set[str]] = {}
    for name in (name for script in SCRIPTS for name in names_of(script) if name.node):
        drawn.setdefault(name.library, set()).update(words_of(name.words))
    missing = {
        library: header_of(library, "PIN") - words - NOT_DRAWN.get(library, set()) for library, words in drawn.items()
    }
    assert {library: pins for library, pins in missing.items() if pins} == {}
