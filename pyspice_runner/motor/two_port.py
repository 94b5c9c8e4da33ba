# SPDX-License-Identifier: GPL-3.0-or-later
r"""The electrical two-port of a stator in closed form, free or pressed on its rotor.

.. math::
    Y = j\omega\,(1 - j\tan\delta)\,(f/f_0)^{-2\delta/\pi}\,C
      + j\omega\,\Theta^T\,(K - \omega^2 M + j\omega D)^{-1}\,\Theta

of all modes, carriers and, under preload, the rotor. The contact sticks: it is a spring along each direction, with the
damping of impacts along the normal. The factor of C is that of a loss tangent that is the same at all frequencies;
f₀ is the frequency of the stated capacitance.
"""

from __future__ import annotations

from math import atan, pi

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.motor import contact as contact_law
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.parameters import Mode, Mount
from pyspice_runner.motor.recoil import carriers, mass_matrix

CAPACITANCE_AT = 100e3  # Hz, of :class:`~.parameters.Piezo`


def closed_two_port(motor: Motor, frequency_hz: NDArray[np.float64], *, preloaded: bool) -> NDArray[np.complex128]:
    """Return the admittance matrices in S, of shape (frequencies, 2, 2)."""
    contact, rotor, moving = motor.contact, motor.rotor, carriers(motor.mount)
    springs: list[Mode | Mount] = [*motor.modes, *moving]
    damping = np.diag([spring.damping_n_s_per_m for spring in springs])
    if preloaded:
        mass, stiffness = contact_law.linearised(contact, motor.modes, rotor, motor.mount)
        damping = np.pad(damping, (0, 1))
        damping[-1, -1] = rotor.bearing_damping_n_m_s / rotor.radius_m**2
        normal = np.array([*(mode.tip_y for mode in motor.modes), *(1.0, 0.0)[: len(moving)], 0.0])
        damping += contact_law.normal_damping(contact) * contact.preload_n * np.outer(normal, normal)
    else:
        mass, stiffness = mass_matrix(motor.modes, motor.mount), np.diag([one.stiffness_n_per_m for one in springs])
    coupling = np.zeros((len(mass), 2))
    coupling[: len(motor.modes)] = [[mode.coupling_a_n_per_v, mode.coupling_b_n_per_v] for mode in motor.modes]
    piezo = motor.piezo
    capacitance = np.diag([piezo.capacitance_a_f, piezo.capacitance_b_f]) - piezo.capacitance_ab_f * (1.0 - np.eye(2))
    angle = 2.0 / pi * atan(piezo.loss_tangent)
    dispersed = (frequency_hz / CAPACITANCE_AT)[:, np.newaxis, np.newaxis] ** -angle * capacitance
    rate = 2j * pi * frequency_hz[:, np.newaxis, np.newaxis]
    motion = np.linalg.solve(
        stiffness + rate * damping + rate**2 * mass, np.broadcast_to(coupling, (len(rate), *coupling.shape))
    )
    return np.asarray(rate * ((1.0 - 1j * piezo.loss_tangent) * dispersed + coupling.T @ motion))
