# SPDX-License-Identifier: GPL-3.0-or-later
"""The stator of bimodal40: materials, electrodes and the modes of the motor."""

from __future__ import annotations

from pathlib import Path

from style import main

import pyspice_runner as pr


def draw(folder: Path) -> list[str]:
    path = folder / "bimodal40_modes.png"
    pr.load_motor("bimodal40").plot(path)
    return [str(path)]


if __name__ == "__main__":
    main(draw, __doc__)
