# SPDX-License-Identifier: GPL-3.0-or-later
"""A SPICE model of a standing-wave piezomotor, run on ngspice.

    import pyspice_runner as pr

    motor = pr.load_motor("andersen2002")
    run = pr.simulate(motor, pr.TwoPhaseDrive(voltage=50.0, frequency=51.7e3, phase_deg=90.0), duration=5e-3)
    print(run.mean_rotor_speed_rad_s, run.state_fractions)

Results and datasets have ``save``, ``plot``, ``to_dataframe`` and ``cautions``
(:class:`pyspice_runner.result.Result`). ``__init__.pyi`` lists the public names; a name loads its module on first
use, so the import is light.
"""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import version
from typing import Any

import lazy_loader

from pyspice_runner.display import draw_with

_load, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

draw_with(lambda: import_module("pyspice_runner.view.plots"))


def __getattr__(name: str) -> Any:
    return version("piezomotor") if name == "__version__" else _load(name)
