# SPDX-License-Identifier: GPL-3.0-or-later
"""The matrices of the stator against closed forms and the circuit; with three groups and two contacts as well."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from numpy.typing import NDArray

import pyspice_runner as pr
from pyspice_runner.motor.parameters import Mount
from pyspice_runner.motor.stator import Stator, discretised, square
from validation import calibration as study

OMEGA = 2.0 * pi * np.array([10e3, 39e3, 41e3, 200e3])


def stator(modes: int, groups: int, contacts: int, *, seed: int = 5) -> Stator:
    """Return a stator of random modes from 20 kHz upwards."""
    draw = np.random.default_rng(seed)
    mass = draw.uniform(2e-3, 6e-3, modes)
    stiffness = mass * (2.0 * pi * np.linspace(20e3, 90e3, modes)) ** 2
    return Stator(
        mass=mass, damping=np.sqrt(mass * stiffness) / 300.0, stiffness=stiffness,
        coupling=draw.uniform(-0.2, 0.2, (modes, groups)), contact=draw.uniform(-1.0, 1.0, (2 * contacts, modes)),
        capacitance=np.diag(draw.uniform(5e-10, 1e-9, groups)), recoil=draw.uniform(-5e-4, 5e-4, (modes, 2)),
        residual=np.zeros((2 * contacts, 2 * contacts)), residual_per_volt=np.zeros((2 * contacts, groups)),
    )  # fmt: skip


MOUNT = Mount(
    stiffness_n_per_m=2e4, mass_kg=0.05, damping_n_s_per_m=0.5, tangential_stiffness_n_per_m=5e4,
    tangential_damping_n_s_per_m=0.8,
)  # fmt: skip
HELD = Mount(stiffness_n_per_m=2e4, mass_kg=0.05, damping_n_s_per_m=0.5)  # along the rotor
SHAPES = pytest.mark.parametrize(("groups", "contacts"), [(2, 1), (3, 2)])


@SHAPES
def test_the_admittance_of_free_modes_is_the_sum_of_their_arms(groups: int, contacts: int) -> None:
    free = stator(4, groups, contacts)
    arms: NDArray[np.complex128] = 1j * OMEGA[:, np.newaxis, np.newaxis] * free.capacitance
    for m, c, k, theta in zip(free.mass, free.damping, free.stiffness, free.coupling, strict=True):
        impedance = c + 1j * (OMEGA * m - k / OMEGA)
        arms = arms + np.outer(theta, theta) / impedance[:, np.newaxis, np.newaxis]
    np.testing.assert_allclose(free.admittance(OMEGA), arms, rtol=1e-10)
    np.testing.assert_allclose(free.resonances(), np.linspace(20e3, 90e3, 4), rtol=1e-12)


@SHAPES
def test_modes_without_mass_are_residuals_of_the_pressed_stator(groups: int, contacts: int) -> None:
    """A mode far above the frequency acts by its compliance, its motion per volt and its capacitance alone."""
    whole = stator(6, groups, contacts)
    stiff, shape = whole.stiffness[3:], whole.contact[:, 3:]
    quasi_static = replace(
        whole, mass=np.where(np.arange(6) < 3, whole.mass, 0.0), damping=np.where(np.arange(6) < 3, whole.damping, 0.0)
    )
    reduced = replace(
        whole, mass=whole.mass[:3], damping=whole.damping[:3], stiffness=whole.stiffness[:3],
        coupling=whole.coupling[:3], contact=whole.contact[:, :3], recoil=whole.recoil[:3],
        residual=(shape / stiff) @ shape.T, residual_per_volt=(shape / stiff) @ whole.coupling[3:],
        capacitance=whole.capacitance + (whole.coupling[3:].T / stiff) @ whole.coupling[3:],
    )  # fmt: skip
    contact = np.array([1.1e7, 1.6e7] * contacts), np.zeros(2 * contacts)
    exact, found = (one.pressed(*contact, 0.02, 0.1).admittance(OMEGA) for one in (quasi_static, reduced))
    np.testing.assert_allclose(found, exact, rtol=1e-8)
    free, alone = (one.admittance(OMEGA) for one in (quasi_static, reduced))
    np.testing.assert_allclose(alone, free, rtol=1e-8)


@SHAPES
@pytest.mark.parametrize("mount", [MOUNT, HELD])
def test_a_free_stator_on_its_carrier_keeps_its_momentum(groups: int, contacts: int, mount: Mount) -> None:
    """Without springs of the mount the motion of the centre of mass, m_c z + Σ Γ r, is 0 at any drive."""
    free = stator(4, groups, contacts)
    carried = free.with_carrier(mount)
    own = np.pad(np.ones((4, 4)), (0, carried.carriers))  # without the springs
    carried = replace(carried, stiffness=own * carried.stiffness, damping=own * carried.damping)
    motion = np.linalg.solve(carried.dynamic_stiffness(OMEGA[1]), carried.coupling)
    momentum = free.recoil.T[: carried.carriers] @ motion[:4] + mount.mass_kg * motion[4:]
    np.testing.assert_allclose(momentum, 0.0, atol=1e-9 * np.abs(mount.mass_kg * motion[4:]).max())


def test_the_carrier_moves_every_contact_along_its_directions() -> None:
    carried = stator(3, 3, 2).with_carrier(MOUNT)
    np.testing.assert_array_equal(carried.contact[:, 3:], [[0, 1], [1, 0], [0, 1], [1, 0]])
    assert carried.coupling.shape == (5, 3)
    assert carried.with_carrier(None) is carried


def test_modes_on_a_carrier_resonate_as_the_stator_with_it() -> None:
    free = stator(3, 3, 2)
    modes, whole = free.on_carrier(MOUNT), free.with_carrier(MOUNT)
    np.testing.assert_allclose(np.sort(modes.resonances()), whole.resonances()[2:], rtol=1e-9)
    light = replace(whole, damping=1e-9 * whole.damping).admittance(OMEGA)  # damping couples the modes
    ours = replace(modes, damping=1e-9 * modes.damping).admittance(OMEGA)
    np.testing.assert_allclose(ours, light, rtol=1e-4)  # but for the rigid motions of the carrier


def test_two_contacts_on_a_rotor_are_springs_in_parallel() -> None:
    """One heavy mode that carries both contacts alike, pressed on a surface: k₁ + k₂ against two masses."""
    subject = replace(
        stator(1, 3, 2), mass=np.array([0.01]), stiffness=np.array([1e3]), contact=np.array([[1.0], [0.0]] * 2)
    )
    pressed = subject.pressed([3e6, 1e7, 4e6, 1e7], np.zeros(4), 0.03, 0.0)
    relative = np.sqrt(7e6 * (1.0 / 0.01 + 1.0 / 0.03)) / (2.0 * pi)
    assert pressed.resonances()[-1] == pytest.approx(relative, rel=1e-4)


@pytest.mark.parametrize("mount", [None, MOUNT])
def test_the_adapted_stator_resonates_exactly_by_the_trapezoidal_rule(mount: Mount | None) -> None:
    """The rule sees a resonance at (2/h) atan(ω h/2); of a mode on a carrier, with soft springs and alone."""
    step = 4e-7
    subject = replace(stator(1, 3, 2), recoil=np.array([[4e-4, -3e-4]])).with_carrier(mount)
    found, exact = subject.adapted(step).resonances()[-1], subject.resonances()[-1]
    seen = 2.0 / step * np.arctan(pi * found * step) / (2.0 * pi)
    assert seen == pytest.approx(exact, rel=1e-7)
    mass, stiffness = discretised(0.004, 2e8, step)
    assert np.diag(square(subject.mass))[0] != mass
    assert stiffness / mass == pytest.approx((2.0 / step * np.tan(0.5 * step * np.sqrt(2e8 / 0.004))) ** 2)


def test_flexibility_of_symmetric_modes_is_free_of_rounding() -> None:
    subject = replace(stator(2, 2, 1), contact=np.array([[1.0, 1.0], [1.0, -1.0]]), stiffness=np.array([3e8, 3e8]))
    np.testing.assert_array_equal(subject.flexibility, np.diag([2.0 / 3e8] * 2))


@pytest.mark.parametrize("state", ["free", "preloaded"])
@pytest.mark.parametrize("name", ["base", "bimodal40"])
def test_the_admittance_in_closed_form_is_that_of_the_circuit(name: str, state: str) -> None:
    """The base has losses of impacts and a capacitance between its groups; bimodal40 recoil and springs in series."""
    base = study.base().updated({"piezo.capacitance_ab_f": 3e-10})
    motor, low, high = (base, 20e3, 70e3) if name == "base" else (pr.load_motor(name), 30e3, 50e3)
    found = pr.admittance(motor, start=low, stop=high, points=401, state=state)  # type: ignore[arg-type]
    of = motor.pressed_stator if state == "preloaded" else motor.stator.with_carrier(motor.mount)
    size = np.abs(found.matrix_s).max(axis=(1, 2), keepdims=True)
    # The ladder of the circuit holds the loss angle of 0.02 within a tenth: 2e-3 of the capacitance's admittance. The
    # damping of impacts is of first order in the closed form: with ω d/k = 0.27 and c k = 0.09 the rest is 0.6 % of k.
    limit = 0.02 if (name, state) == ("bimodal40", "preloaded") else 3e-3
    assert np.all(np.abs(of.admittance(2.0 * pi * found.frequency_hz) - found.matrix_s) < limit * size)


def test_the_damping_of_a_contact_acts_on_its_own_spring_only() -> None:
    """One mass on a contact k + jωd in series with a compliance, against the exact impedance."""
    stiffness, damping, compliance = 1.4e7, 3.0, 1e-7
    subject = replace(
        stator(1, 2, 1), contact=np.array([[0.0], [1.0]]), residual=np.diag([0.0, compliance]),
        residual_per_volt=np.zeros((2, 2)),
    )  # fmt: skip
    pressed, omega = subject.pressed([1.0, stiffness], [0.0, damping], 0.02, 0.1), OMEGA[1]
    added = pressed.dynamic_stiffness(omega)[0, 0] - subject.dynamic_stiffness(omega)[0, 0]
    assert added == pytest.approx(1.0 / (compliance + 1.0 / (stiffness + 1j * omega * damping)), rel=2e-3)
