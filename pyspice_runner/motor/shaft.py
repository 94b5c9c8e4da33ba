# SPDX-License-Identifier: GPL-3.0-or-later
"""What is coupled to the shaft of a motor: a second mass, by a rigid or an elastic coupling with play."""

from __future__ import annotations

from pyspice_runner.errors import ParameterError
from pyspice_runner.motor.parameters import quantity
from pyspice_runner.motor.refusal import Stated


class ShaftLoad(Stated):
    """A mass that the shaft moves. Of a slider, 1 rad stands for 1 m, 1 N·m for 1 N and 1 kg·m² for 1 kg.

    Raises:
        ParameterError: by the constructor, for an invalid value, or values without an effect.
    """

    inertia_kg_m2: float = quantity("moment of inertia of the load", "kg·m²", default=0.0, ge=0.0, le=1e3)
    damping_n_m_s: float = quantity("viscous friction of the load", "N·m·s", default=0.0, ge=0.0, le=1e3)
    spring_n_m_per_rad: float = quantity(
        "stiffness of a spring that pulls the load to the angle 0, where a run starts", "N·m/rad", default=0.0, ge=0.0,
        le=1e6,
    )  # fmt: skip
    gravity_n_m: float = quantity(
        "maximum torque of the load's weight: mass, 9.81 m/s² and distance of its centre from the axis", "N·m",
        default=0.0, ge=0.0, le=1e3,
    )  # fmt: skip
    gravity_angle_deg: float = quantity(
        "angle at the start between the centre of mass and its lowest place", "°", default=0.0, ge=-360.0, le=360.0
    )
    coupling_stiffness_n_m_per_rad: float = quantity(
        "stiffness of the shaft between rotor and load; 0: rigid", "N·m/rad", default=0.0, ge=0.0, le=1e6
    )
    coupling_damping_n_m_s: float = quantity("damping of this shaft", "N·m·s", default=0.0, ge=0.0, le=1e3)
    backlash_rad: float = quantity(
        "play of the coupling from end to end; a run starts in its middle", "rad", default=0.0, ge=0.0, le=1.0
    )

    def __init__(self, *values: float, **named: float) -> None:
        super().__init__(*values, **named)
        if not self.inertia_kg_m2 and any(self.model_dump().values()):
            raise ParameterError("ShaftLoad: inertia_kg_m2 = 0 is not valid with other values: the load needs a mass.")
        if not self.coupling_stiffness_n_m_per_rad and (self.coupling_damping_n_m_s or self.backlash_rad):
            raise ParameterError(
                "ShaftLoad: coupling_damping_n_m_s and backlash_rad have no effect on a rigid coupling. Give "
                "coupling_stiffness_n_m_per_rad, or leave them out."
            )


UNCOUPLED = ShaftLoad()
