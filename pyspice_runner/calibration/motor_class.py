# SPDX-License-Identifier: GPL-3.0-or-later
"""What a class of motors has in common, and how far its members differ: values that no measurement of a motor shows.

A motor of a class is similar to another one (:mod:`~pyspice_runner.calibration.similar`): its force, speed, frequency
and voltage are those of a data sheet, and the rest follows with the same dimensionless numbers.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import exp, log

from pyspice_runner.calibration.similar import Factors, scaled
from pyspice_runner.errors import ParameterError
from pyspice_runner.motor.drive import TwoPhaseDrive, default_drive
from pyspice_runner.motor.motor import Motor

FRICTION, QUALITY, CAPACITANCE, NORMAL = "contact.friction", "quality factor", "capacitance", "normal motion"
FORCE, SPEED = "force", "speed"

# Standard deviation of the logarithm of a value over those of a class, after scaling. Friction: handbooks give 0.2 to
# 0.5 for dry ceramics, taken as four standard deviations. The others: over andersen2002-unintended-mode, a beam with
# two modes at 40 kHz and bimodal40 as linear stages, at their drives and in the modes within 15 % of these; of a group
# the maximum. Three motors do not make a statistic: the widths are orders of magnitude.
WIDTHS = {
    "friction": 0.23, "preload_n": 0.3, "damping_n_s_per_m": 1.1, "mass_kg": 2.0, "stiffness_n_per_m": 2.0,
    "coupling_a_n_per_v": 1.1, "coupling_b_n_per_v": 1.1, "capacitance_a_f": 1.6, "capacitance_b_f": 1.6,
    "loss_tangent": 0.4, "normal_stiffness_n_per_m15": 1.6, "tangential_compliance_tip_m_per_n23": 1.3,
    "tangential_compliance_rotor_m_per_n23": 1.3, "restitution": 0.1, "inertia_kg_m2": 1.3,
    "bearing_damping_n_m_s": 0.9, "guide_damping_n_s_per_m": 0.9,
}  # fmt: skip
_SLIDER_MASS, _MOUNT = 1.3, 1.7
_NORMAL = 0.5  # of the motion towards the rotor over that along it: the ellipse of the tip is a choice of the design
PRIORS = {
    FRICTION: WIDTHS["friction"], QUALITY: WIDTHS["damping_n_s_per_m"], CAPACITANCE: WIDTHS["capacitance_a_f"],
    NORMAL: _NORMAL,
}  # fmt: skip


def width(path: str) -> float | None:
    """Return the standard deviation of the logarithm of a value within the class; ``None`` where it is not known."""
    section, _, key = path.partition(".")
    if section == "mount":
        return _MOUNT
    if path == "slider.mass_kg":
        return _SLIDER_MASS
    return WIDTHS.get(key.rpartition(".")[2])


def spread(logarithmic: float) -> str:
    """Return a standard deviation of a logarithm in words: in per cent, a large one as a factor, up to 1e6."""
    if logarithmic < 0.35:
        return f"± {100.0 * logarithmic:.2g} %"
    return f"×/÷ {exp(logarithmic):.2g}" if logarithmic < log(1e6) else "not determined"


def class_drive(motor: Motor, phase_deg: float | None) -> TwoPhaseDrive:
    """Return the drive at which a motor represents its class. Raise ParameterError for another than two-phase."""
    drive = default_drive(motor)
    if not isinstance(drive, TwoPhaseDrive):
        raise ParameterError(
            f"{motor.name} has no two-phase drive, so no data sheet compares with it: take another base."
        )
    return drive if phase_deg is None else drive.updated({"phase_deg": phase_deg})


def member(motor: Motor, values: Mapping[str, float], frequency: float, voltage: float, name: str) -> Motor:
    """Return a motor of the class: with its own friction, and factors of force, speed, quality factors, capacitances.

    Args:
        motor: that represents the class.
        values: :data:`FORCE`, :data:`SPEED` and, if they differ from those of ``motor``, what :data:`PRIORS` has.
        frequency: factor of the drive's.
        voltage: factor of the drive's.
        name: of the new motor.
    """
    changes = {FRICTION: values[FRICTION]} if FRICTION in values else {}
    if QUALITY in values:
        changes |= {
            f"modes.{number}.damping_n_s_per_m": mode.damping_n_s_per_m / values[QUALITY]
            for number, mode in enumerate(motor.modes)
        }
    if NORMAL in values:
        changes |= {f"modes.{number}.tip_y": mode.tip_y * values[NORMAL] for number, mode in enumerate(motor.modes)}
    like = motor.updated(changes) if changes else motor
    if CAPACITANCE in values:
        like = like.updated({
            f"piezo.{key}": values[CAPACITANCE] * value
            for key, value in like.piezo.model_dump().items() if key.startswith("capacitance") and value
        })  # fmt: skip
    return scaled(like, Factors(values[FORCE], values[SPEED], frequency, voltage), name, {})
