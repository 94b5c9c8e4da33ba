# SPDX-License-Identifier: GPL-3.0-or-later
"""The stators that are bundled: the modes of each parameter set with a ``[solid]``, computed once.

``python -m tools.stators`` writes them and removes what no set needs; a test computes them anew. It takes the extra
``solid``.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path

from pyspice_runner.motor.load import SETS, stated_solid
from pyspice_runner.motor.solid.parameters import Solid
from pyspice_runner.motor.solid.stator import BUNDLED, bundled_name, solve_stator, write_stator


def solids(sets: Iterable[Path]) -> dict[str, Solid]:
    """Return the ``[solid]`` of each of these motors that has one, by the name of its file."""
    found = (stated_solid(path) for path in sets)
    return {bundled_name(solid): solid for solid in found if solid is not None}


def write_stators(sets: Iterable[Path], folder: Path) -> list[Path]:
    """Write the stators of these motors, remove all others from the folder, and return the paths."""
    wanted = solids(sets)
    for stale in folder.glob("*"):
        if stale.name not in wanted:
            stale.unlink()
    if wanted:
        folder.mkdir(exist_ok=True)
    for name, solid in wanted.items():
        write_stator(folder / name, solve_stator(solid))
    return [folder / name for name in wanted]


if __name__ == "__main__":
    for written in write_stators(sorted(SETS.glob("*.toml")), BUNDLED):
        sys.stdout.write(f"{written}\n")
