# SPDX-License-Identifier: GPL-3.0-or-later
"""The physical audit of a result: whether it can be true, whatever the simulator says of it.

A clean log and finite numbers are not enough: a step that is too coarse for the contact, or a simulator that lost its
way, gives curves that look right. What no motor can do is looked for here, and named with its likely cause.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.model.contact import linearised_resonances, static_deflection
from pyspice_runner.model.motor import Motor

Array = NDArray[np.float64]

FEWEST_POINTS_PER_PERIOD = 16  # of the fastest motion; coarser, its shape is lost
# At 16 points a period the balance of a smooth motion closes to 0.3 %, at the default step to 0.01 %; what is worse
# than this is no longer the error of the step that was asked for.
ENERGY_BOUND = 0.01
_SLACK = 1e-3  # of a force; Newton's iteration is closed to 1e-6, the points of a slip lie up to half a step beside it
_NEWTON = 1e-6  # to which the iteration is closed, of the energy that pressing tip and rotor together stores
_PASSIVE = 1e-9  # of the greatest |Y|: rounding


def audit_run(
    motor: Motor, waves: Mapping[str, Array], *, missing_j: float, from_load_j: float, step: float, contact: bool
) -> tuple[str, ...]:
    """Return what cannot be true about a run, a sentence each; none if it passes.

    Args:
        motor: the motor.
        waves: the columns of :class:`~pyspice_runner.analysis.waveforms.Waveforms`.
        missing_j: energy supplied less energy found, J.
        from_load_j: energy that a driven shaft put in, J.
        step: time step in s.
        contact: whether the tip is in contact with a rotor.
    """
    findings = []
    power = waves["voltage_a_v"] * waves["current_a_a"] + waves["voltage_b_v"] * waves["current_b_a"]
    # the most that the sources had put in at any time: at the end of a short run some of it may be back with them
    put_in = np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(waves["time_s"]))
    scale_j = max(float(put_in.max()), 0.0) + from_load_j
    greatest = float(waves["normal_force_n"].max()) if contact else 0.0
    bending = static_deflection(motor.contact.model_copy(update={"preload_n": greatest}), motor.modes)
    indentation = (greatest / motor.contact.normal_stiffness_n_per_m15) ** (2.0 / 3.0)
    pressed_j = greatest * (0.5 * bending + 0.4 * indentation)
    if abs(missing_j) > ENERGY_BOUND * scale_j + _NEWTON * pressed_j:
        findings.append(
            f"The energy balance misses {abs(missing_j):.3g} of {scale_j:.3g} J; allowed is {100 * ENERGY_BOUND:g} %. "
            f"The step of {step:.3g} s is likely too coarse for the contact: halve it."
        )
    if not contact:
        return tuple(findings)
    normal, friction = waves["normal_force_n"], np.abs(waves["friction_force_n"])
    if normal.min() < -_SLACK * greatest:
        findings.append(
            f"The contact pulls with {-normal.min():.3g} N, which no contact does. Its law was taken beyond its range: "
            "halve the step, or lower the drive."
        )
    excess = float(np.max(friction - motor.contact.friction * np.maximum(normal, 0.0)))
    if excess > _SLACK * motor.contact.friction * greatest:
        findings.append(
            f"Friction exceeds mu F_N by {excess:.3g} N, which no dry contact does. The slider was not held to its "
            "limit: halve the step."
        )
    loaded = motor.contact.model_copy(update={"preload_n": max(greatest, motor.contact.preload_n)})
    fastest = float(linearised_resonances(loaded, motor.modes, motor.rotor)[-1])
    if step * fastest * FEWEST_POINTS_PER_PERIOD > 1.0 + 1e-9:
        allowed = 0.995 / (FEWEST_POINTS_PER_PERIOD * fastest)  # so that three digits of it will do
        findings.append(
            f"Under the greatest force, {greatest:.3g} N, the motor swings at {fastest:.4g} Hz, of which the step of "
            f"{step:.3g} s sees fewer than {FEWEST_POINTS_PER_PERIOD} points a period. Give step <= {allowed:.3g} s."
        )
    return tuple(findings)


def audit_two_port(frequency_hz: Array, y: NDArray[np.complex128]) -> tuple[str, ...]:
    """Return what cannot be true about a two-port's admittance, a sentence each; none if it passes.

    Args:
        frequency_hz: frequencies, shape (points,).
        y: admittance matrices in S, shape (points, 2, 2).
    """
    dissipative = 0.5 * (y + np.conj(np.swapaxes(y, 1, 2)))
    least = np.linalg.eigvalsh(dissipative)[:, 0]
    worst = int(np.argmin(least))
    if least[worst] < -_PASSIVE * float(np.abs(y).max()):
        where = (
            f"At {frequency_hz[worst]:.6g} Hz the stator gives power, {least[worst]:.3g} S, which no passive one does."
        )
        return (f"{where} A loss was lost in rounding: look at the damping and the loss tangent.",)
    return ()
