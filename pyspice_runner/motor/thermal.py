# SPDX-License-Identifier: GPL-3.0-or-later
"""Thermal drift of a stator: coefficients with their origin, and the heat capacity of the structure."""

from __future__ import annotations

import numpy as np

from pyspice_runner.motor.motor import Motor, Structure
from pyspice_runner.motor.parameters import quantity
from pyspice_runner.motor.refusal import Stated
from pyspice_runner.motor.solid.materials import materials
from pyspice_runner.motor.solid.parameters import Solid


class Thermal(Stated):
    """Thermal drift of a stator, and its heat balance as one body. The defaults are for andersen2002.

    Raises:
        ParameterError: by the constructor, for an invalid value.
    """

    # derived: half the drift of Young's modulus of carbon steel, 203.4 GPa at 21 °C to 198.6 GPa at 93 °C (Roark's
    # Formulas for Stress and Strain), and half its expansion of 12 ppm/K; the ceramic is taken to drift alike
    frequency_drift_per_k: float = quantity(
        "relative drift of all resonance frequencies", "1/K", default=-1.6e-4, ge=-0.01, le=0.01
    )
    # assumed: d31 and permittivity of PZT-5A rise with temperature (Hooker, NASA CR-1998-208708, shows how); rounded
    coupling_drift_per_k: float = quantity("relative drift of all couplings", "1/K", default=1e-3, ge=-0.01, le=0.01)
    capacitance_drift_per_k: float = quantity(
        "relative drift of the clamped capacitances", "1/K", default=4e-3, ge=-0.02, le=0.02
    )
    # derived: masses of beam, plates and tip of andersen2002 with the specific heats of steel and PZT-5A
    heat_capacity_j_per_k: float = quantity("heat capacity of the stator", "J/K", default=2.1, ge=1e-9, le=1e6)
    # assumed: 5 cm² of surface in still air and two supports
    thermal_resistance_k_per_w: float = quantity(
        "thermal resistance to the surroundings", "K/W", default=100.0, ge=1e-3, le=1e6
    )
    ambient_k: float = quantity(
        "temperature of the surroundings above that of the motor's parameters", "K", default=0.0, ge=-200.0, le=500.0
    )

    @classmethod
    def of(cls, motor: Motor) -> Thermal:
        """Return the defaults, with the motor's own thermal resistance and heat capacity if known."""
        own = {}
        if motor.limits is not None:
            own["thermal_resistance_k_per_w"] = motor.limits.thermal_resistance_k_per_w
        if motor.structure is not None:
            own["heat_capacity_j_per_k"] = heat_capacity(motor.structure)
        elif motor.solid is not None and all(box.region is None for box in motor.solid.boxes):
            own["heat_capacity_j_per_k"] = heat_capacity_of_boxes(motor.solid)
        elif motor.ring is not None:
            own["heat_capacity_j_per_k"] = motor.ring.heat_capacity_j_per_k
        return cls(**own)

    @property
    def time_constant(self) -> float:
        """Time constant of the warming in s."""
        return self.heat_capacity_j_per_k * self.thermal_resistance_k_per_w

    def warmed(self, motor: Motor, rise_k: float) -> Motor:
        """Return a motor at a temperature in K above that of its parameters."""
        changes = {
            f"piezo.{name}": getattr(motor.piezo, name) * (1.0 + self.capacitance_drift_per_k * rise_k)
            for name in ("capacitance_a_f", "capacitance_b_f", "capacitance_ab_f")[: 1 if len(motor.groups) == 1 else 3]
        }
        for number, mode in enumerate(motor.modes):
            changes[f"modes.{number}.frequency_hz"] = mode.frequency_hz * self.frequency_factor(rise_k)
            for name in ("coupling_a_n_per_v", "coupling_b_n_per_v"):
                coupling = getattr(mode, name)
                changes[f"modes.{number}.{name}"] = coupling * (1.0 + self.coupling_drift_per_k * rise_k)
        return motor.updated(changes)

    def frequency_factor(self, rise_k: float) -> float:
        """Return the resonance frequencies at a temperature in K above that of the parameters, over those there."""
        return 1.0 + self.frequency_drift_per_k * rise_k


def heat_capacity(structure: Structure) -> float:
    """Return the heat capacity in J/K of beam, plates and tip; the tip as steel."""
    beam = structure.beam
    steel = beam.length_m * beam.width_m * beam.thickness_m * beam.density_kg_m3 + structure.tip.mass_kg
    ceramic = sum(
        (patch.end_m - patch.start_m)
        * patch.width_m
        * patch.thickness_m
        * (2.0 if patch.faces == "both" else 1.0)
        * patch.density_kg_m3
        for patch in structure.patches
    )
    heats = materials()
    return heats["steel"].specific_heat_j_per_kg_k * steel + heats["PZT-5A"].specific_heat_j_per_kg_k * ceramic


def heat_capacity_of_boxes(solid: Solid) -> float:
    """Return the heat capacity in J/K of a solid of boxes; where two overlap, the later one counts."""
    corners = np.array([box.corners for box in solid.boxes])
    planes = [np.unique(corners[:, :, axis]) for axis in range(3)]
    per_volume = np.zeros([len(each) - 1 for each in planes])
    for box, ends in zip(solid.boxes, corners, strict=True):
        card = solid.material(box)
        inside = tuple(slice(*np.searchsorted(each, ends[:, axis])) for axis, each in enumerate(planes))
        per_volume[inside] = card.density_kg_m3 * card.specific_heat_j_per_kg_k
    return float(np.einsum("xyz,x,y,z->", per_volume, *map(np.diff, planes)))
