# SPDX-License-Identifier: GPL-3.0-or-later
"""The averaged motor as a Verilog-A module: ``behavioral/piezomotor_averaged.va`` with the values of a motor.

The file in ``behavioral/`` is written by hand and is the module of the set ``bimodal40``, as :mod:`.veriloga` has it.
"""

from __future__ import annotations

from pyspice_runner.model.motor import Motor
from pyspice_runner.model.thermal import Thermal
from pyspice_runner.netlist.averaged import SUBCIRCUIT, require_averaged
from pyspice_runner.netlist.library import data_path
from pyspice_runner.netlist.veriloga import module_values, named, with_modes

# parameters of the motor, and beginnings of those of a mode, that the averaged motor does not have
_LEFT_OUT = (
    "law", "series_compliance", "sliding", "stribeck", "slider_time", "bearing_torque", "bearing_angle", "softening_",
    "growth_",
)  # fmt: skip


def averaged_module(motor: Motor, *, name: str = "", thermal: Thermal | None = None) -> str:
    """Return the averaged motor as a Verilog-A module with the pins of ``.subckt piezomotor_averaged``.

    Args:
        motor: the motor.
        name: name of the module; by default ``piezomotor_averaged``.
        thermal: drift per kelvin at the pin ``temperature``; without it nothing drifts.

    Raises:
        ParameterError: for a motor that has no averaged model, or an invalid name.
    """
    require_averaged(motor)
    values = module_values(motor, "spring-slider", thermal=thermal)
    kept = {key: value for key, value in values.items() if not key.startswith(_LEFT_OUT)}
    text = with_modes((data_path("behavioral") / f"{SUBCIRCUIT}.va").read_text(encoding="utf-8"), len(motor.modes))
    return named(text, SUBCIRCUIT, motor, name, kept | {"loss": motor.piezo.loss_tangent})
