# SPDX-License-Identifier: GPL-3.0-or-later
"""The motor with the modes of its solid that lie outside ``lowest_hz`` to ``highest_hz``."""

from __future__ import annotations

import numpy as np

from pyspice_runner.motor.motor import MOST_MODES, Motor, assemble
from pyspice_runner.motor.solid.stator import UNSEEN, Modes
from pyspice_runner.motor.solid.store import stator_of


def with_outside_modes(motor: Motor) -> Motor:
    """Return the motor of a solid with the modes computed outside its range; another motor is returned as it is.

    They are those whose current counts (:data:`~.stator.UNSEEN`), by rising frequency up to :data:`~.motor.MOST_MODES`
    in all. Capacitances and series compliances lose what these modes contributed. They do not shake the carrier, as
    before.
    """
    if motor.solid is None:
        return motor
    stator = stator_of(motor.solid)
    outside, room = stator.outside, MOST_MODES - len(motor.modes)
    capacitance = np.array([[motor.piezo.capacitance_a_f], [motor.piezo.capacitance_b_f]])
    current = motor.solid.quality_factor * outside.couplings_n_per_v**2 / outside.stiffnesses_n_per_m
    chosen = np.flatnonzero((current > UNSEEN * capacitance).any(axis=0))[:room]
    modes = Modes(*(column[..., chosen] for column in vars(outside).values()))
    effective = modes.stiffnesses_n_per_m - modes.masses_kg * stator.static_from(modes.frequencies_hz)
    charges = (modes.couplings_n_per_v / effective) @ modes.couplings_n_per_v.T
    held = {"recoil_kg": 0.0, "recoil_x_kg": 0.0}
    outer = [table | held for table in modes.tables("outside", motor.solid.quality_factor)]
    document = motor.model_dump() | {"drive": motor.drive}
    document["modes"] = [*(mode.model_dump() for mode in motor.modes), *outer]
    document["piezo"]["capacitance_a_f"] -= float(charges[0, 0])
    document["piezo"]["capacitance_b_f"] -= float(charges[1, 1])
    document["piezo"]["capacitance_ab_f"] += float(charges[0, 1])
    for name, moved in (
        ("series_compliance_m_per_n", modes.tip_y),
        ("tangential_series_compliance_m_per_n", modes.tip_x),
    ):
        document["contact"][name] = max(document["contact"][name] - float(np.sum(moved**2 / effective)), 0.0)
    return assemble(document, motor.solid, dict(motor.provenance), where=f"motor {motor.name}")
