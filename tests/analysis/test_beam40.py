# SPDX-License-Identifier: GPL-3.0-or-later
"""The motor that was designed with this package does what it was designed for, at its recommended drive."""

from __future__ import annotations

from math import hypot, radians, sqrt

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.model.beam import solve_resonator
from pyspice_runner.model.contact import linearised_resonances
from tests.reference.integrator import Tone, integrate
from tests.runs import simulated

pytestmark = pytest.mark.xdist_group("reference")  # the integrator is compiled once there

MOTOR = pr.load_motor("beam40")
DRIVE = pr.default_drive(MOTOR)
DYNAMIC_STRENGTH_PA = 24e6  # rated dynamic tensile strength of PZT-4: 3,500 psi (Berlincourt, Krueger, Near, TP-226)


@pytest.mark.slow
def test_it_has_the_force_speed_and_efficiency_that_it_was_designed_for() -> None:
    radius = MOTOR.rotor.radius_m
    curve = pr.speed_torque(MOTOR, DRIVE, speeds=[0.0, 0.15 / radius, 0.2 / radius])
    assert bool(curve["settled"].all())
    force = curve["torque_n_m"].to_numpy() / radius
    assert force[0] >= 1.0  # stall, N at the rim
    assert force[-1] > 0.0  # it still pushes at 200 mm/s
    assert float(curve["efficiency"].max()) >= 0.2
    np.testing.assert_allclose(curve["normal_force_n"], MOTOR.contact.preload_n, rtol=5e-3)


def test_its_two_modes_meet_under_preload() -> None:
    towards, along = MOTOR.modes
    assert (towards.tip_x, along.tip_y) == (0.0, 0.0)
    loaded = linearised_resonances(MOTOR.contact, MOTOR.modes, MOTOR.rotor, MOTOR.mount)
    stiffened = loaded[np.argmin(np.abs(loaded - DRIVE.frequencies[0]))]
    # along the rotor the contact slips or is open for half of the time: there the free resonance counts
    assert stiffened == pytest.approx(along.frequency_hz, rel=0.01)
    assert DRIVE.frequencies[0] == pytest.approx(along.frequency_hz, rel=0.01)


def test_its_field_and_the_stress_of_its_ceramic_stay_within_their_limits() -> None:
    structure = MOTOR.structure
    assert structure is not None
    plate = structure.patches[0]
    assert isinstance(DRIVE, pr.TwoPhaseDrive)
    assert DRIVE.voltage / sqrt(2.0) / plate.thickness_m < 80e3  # V/m
    resonator = solve_resonator(structure.beam, structure.patches, structure.tip)
    run = simulated(MOTOR, DRIVE, duration=10e-3, speed=0.2 / MOTOR.rotor.radius_m)
    late = run.window()
    # both modes at once: tip over tip motion is the modal coordinate
    reach = [
        np.abs(run.tip_y_m[late]).max() / abs(MOTOR.modes[0].tip_y),
        np.abs(run.tip_x_m[late]).max() / abs(MOTOR.modes[1].tip_x),
    ]
    x = np.linspace(plate.start_m, plate.end_m, 101)
    step = 1e-5
    curvature = (
        resonator.deflection(x + step) - 2.0 * resonator.deflection(x) + resonator.deflection(x - step)
    ) / step**2
    outer = 0.5 * structure.beam.thickness_m + plate.thickness_m
    stress = plate.youngs_modulus_pa * outer * np.abs(curvature) @ np.array(reach)
    assert np.max(stress) < DYNAMIC_STRENGTH_PA


@pytest.mark.soak
@pytest.mark.parametrize("speed", [0.0, 13.0])
def test_it_agrees_with_the_reference_integrator(speed: float) -> None:
    assert isinstance(DRIVE, pr.TwoPhaseDrive)
    motor = MOTOR.updated({"contact.restitution": 1.0})  # which the reference has none of
    duration = 2e-3
    run = simulated(motor, DRIVE, duration=duration, speed=speed)
    exact = integrate(
        motor.to_dict(),
        [Tone(DRIVE.voltage, DRIVE.frequency)],
        [Tone(DRIVE.voltage, DRIVE.frequency, radians(DRIVE.phase_deg))],
        duration=duration,
        output_step=2e-7,
        speed=speed,
    )
    ours = [np.interp(exact.time_s, run.time_s, signal) for signal in (run.tip_x_m, run.tip_y_m)]
    away = hypot(*(float(np.std(a - b)) for a, b in zip(ours, (exact.tip_x_m, exact.tip_y_m), strict=True)))
    motion = hypot(float(np.std(exact.tip_x_m)), float(np.std(exact.tip_y_m)))
    assert away / motion < 0.005  # required of all reference points
    assert run.energy_residual < 1e-3
