# SPDX-License-Identifier: GPL-3.0-or-later
"""Recoil of the modes on the carrier: against its exact elimination, and against the independent integrator."""

from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.circuit.bench import motor_bench
from pyspice_runner.circuit.law import Law
from pyspice_runner.circuit.source import DriveSource
from pyspice_runner.circuit.state import Discretisation
from pyspice_runner.motor.load import changed_motor
from pyspice_runner.run.kernel import transient
from tests.motors import BEAM40
from tests.reference.integrator import integrate
from tests.runs import far, simulated

pytestmark = pytest.mark.xdist_group("reference")  # the integrator is compiled once there

RECOIL, CARRIER = 4e-3, 0.05  # kg
FLAGSHIP = pr.load_motor(BEAM40).updated(
    {"modes.0.mass_kg": 3.32e-3, "modes.0.stiffness_n_per_m": 1.935e8, "modes.0.recoil_kg": RECOIL,
     "modes.1.recoil_kg": 0.0, "mount.mass_kg": CARRIER}
)  # fmt: skip
# a hundred times the mass on the softest springs: they change the stiffness of the mode by k_c (Γ/m_c)²/k = 3e-13
LOOSE = FLAGSHIP.updated(
    {"modes.0.mass_kg": 0.332, "modes.0.stiffness_n_per_m": 1.935e10, "modes.0.recoil_kg": 100.0 * RECOIL,
     "modes.0.damping_n_s_per_m": 230.0, "modes.0.coupling_a_n_per_v": 0.19, "modes.0.coupling_b_n_per_v": 0.19,
     "mount.mass_kg": 100.0 * CARRIER, "mount.stiffness_n_per_m": 1.0, "mount.damping_n_s_per_m": 1e-9}
)  # fmt: skip
# its exact equivalent: the other coordinate is the centre of mass, z + Γ r/m_c
EQUIVALENT = LOOSE.updated({"modes.0.mass_kg": 0.3, "modes.0.tip_y": 1.0 - RECOIL / CARRIER, "modes.0.recoil_kg": 0.0})
# the same along the rotor: a mode that moves the tip along it, and shakes the carrier along it
ALONG = {
    "mass_kg": 0.332, "stiffness_n_per_m": 2.1e10, "recoil_x_kg": 100.0 * RECOIL, "damping_n_s_per_m": 230.0,
    "tip_x": 1.0, "tip_y": 0.0, "coupling_a_n_per_v": 0.19, "coupling_b_n_per_v": -0.19,
}  # fmt: skip
SIDEWAYS = {"mount.tangential_stiffness_n_per_m": 1.0, "mount.tangential_damping_n_s_per_m": 1e-9}
LOOSE_X = FLAGSHIP.updated(
    {f"modes.bending-2.{name}": value for name, value in ALONG.items()}
    | {"modes.bending-1.recoil_kg": 0.0, "mount.mass_kg": 100.0 * CARRIER, **SIDEWAYS}
)
EQUIVALENT_X = LOOSE_X.updated(
    {
        "modes.bending-2.mass_kg": 0.3,
        "modes.bending-2.tip_x": 1.0 - RECOIL / CARRIER,
        "modes.bending-2.recoil_x_kg": 0.0,
    }
)
PAIRS = {"along y": (LOOSE, EQUIVALENT), "along x": (LOOSE_X, EQUIVALENT_X)}
BAND = {"start": 38e3, "stop": 43e3, "points": 101}


def two_phase(voltage: float, frequency: float, phase: float) -> pr.TwoPhaseDrive:
    return pr.TwoPhaseDrive(voltage=voltage, frequency=frequency, phase_deg=phase)


@pytest.mark.parametrize("pair", PAIRS)
@pytest.mark.parametrize("state", ["free", "preloaded"])
def test_the_admittance_with_recoil_is_that_of_the_equivalent_motor(state: Any, pair: str) -> None:
    ours, exact = (pr.admittance(motor, state=state, **BAND) for motor in PAIRS[pair])
    np.testing.assert_allclose(ours.matrix_s, exact.matrix_s, rtol=0.0, atol=1e-9 * np.abs(exact.matrix_s).max())
    driven = "A+B" if pair == "along y" else "A-B"
    for one, other in zip(ours.resonances[driven], exact.resonances[driven], strict=True):
        assert one.fs == pytest.approx(other.fs, rel=1e-9)


@pytest.mark.parametrize("pair", PAIRS)
def test_a_run_with_recoil_is_that_of_the_equivalent_motor(pair: str) -> None:
    # the rule of integration is linear, so that it commutes with the change of coordinates; Newton closes to 1e-10
    step, drive = 2e-7, DriveSource(two_phase(60.0, 40.1e3, 90.0))
    names = ["v(xmotor.contact_y)", "v(xmotor.normal)", "v(xmotor.friction)"]
    ours, exact = (
        transient(
            motor_bench(motor, drive, law=Law(), discretisation=Discretisation(step, exact_resonance=False)),
            names, step=step, duration=2e-4,
        ).vectors()
        for motor in PAIRS[pair]
    )  # fmt: skip
    for name in names:  # about rest, where the two stators bend differently
        moved, expected = (vectors[name] - vectors[name][0] for vectors in (ours, exact))
        np.testing.assert_allclose(moved, expected, rtol=0.0, atol=1e-9 * np.ptp(expected), err_msg=name)


def test_the_modes_on_the_carrier_are_those_of_the_equivalent_motor() -> None:
    for pair, equivalent in PAIRS.values():
        ours, exact = pair.on_carrier().modes, {mode.name: mode for mode in equivalent.modes}
        for mode in ours:
            left_out = {"name", "recoil_x_kg"} if exact[mode.name].recoil_x_kg is None else {"name"}
            expected = exact[mode.name].model_dump(exclude=left_out)
            assert mode.model_dump(exclude=left_out) == pytest.approx(expected, rel=1e-9, abs=1e-9)
    held = FLAGSHIP.updated({"mount": None})
    assert held.on_carrier() is held


POINTS: dict[str, tuple[pr.TwoPhaseDrive, dict[str, float], dict[str, float]]] = {
    "drive of the set": (two_phase(60.0, 40.1e3, 120.0), {}, {}),
    "at the raised mode": (two_phase(40.0, 41.9e3, 90.0), {}, {}),
    "shaft held": (two_phase(110.0, 40.1e3, 120.0), {}, {"speed": 15.0}),
    "light carrier": (two_phase(110.0, 41.0e3, 120.0), {"mount.mass_kg": 0.02, "mount.stiffness_n_per_m": 1e6}, {}),
    "both modes shake": (two_phase(60.0, 41.5e3, 90.0), {"modes.1.recoil_kg": 5e-3}, {}),
    "along the rotor, too": (
        two_phase(60.0, 40.1e3, 120.0),
        {
            "modes.bending-2.recoil_x_kg": 0.02,
            "mount.tangential_stiffness_n_per_m": 1e5,
            "mount.tangential_damping_n_s_per_m": 50.0,
        },
        {},
    ),
    "every mode along both": (
        two_phase(60.0, 41.0e3, 90.0),
        {
            "modes.bending-1.recoil_x_kg": -2e-3,
            "modes.bending-2.recoil_x_kg": 0.015,
            "modes.bending-2.recoil_kg": 5e-3,
            "mount.mass_kg": 0.03,
            "mount.tangential_stiffness_n_per_m": 1e6,
            "mount.tangential_damping_n_s_per_m": 100.0,
        },
        {"speed": 10.0},
    ),
    "against the modal coordinate": (
        two_phase(60.0, 39.0e3, 60.0),
        {"modes.0.recoil_kg": -2e-3},
        {"load_torque": 1e-3},
    ),
}


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.soak) if name == "along the rotor, too" else name for name in POINTS],
)
def test_a_run_with_recoil_follows_the_independent_integrator(name: str) -> None:
    drive, changes, load = POINTS[name]
    motor = FLAGSHIP.updated({"contact.restitution": 1.0, **changes})
    exact = integrate(motor.to_dict(), drive.tones_a, drive.tones_b, duration=1.5e-3, output_step=2e-7, **load)
    balance = exact.energies_j
    terms = ("kinetic", "elastic", "damping", "contact_elastic", "tangential", "mount", "mount_damping")
    assert sum(balance[term] for term in terms) + balance["shaft"] == pytest.approx(balance["input"], rel=1e-6)
    run = simulated(motor, drive, duration=1.5e-3, **load)
    assert run.energy_residual < 1e-3
    # without recoil the default step gives 0.4 % of the tip's motion
    assert far(run, exact, "tip_x_m", "tip_y_m", "normal_force_n") < 5e-3


def test_the_steady_state_and_the_averaged_motor_brake_where_the_recoil_detunes_the_mode() -> None:
    # the beam's own recoil raises mode 1 by fifteen half bandwidths; a separate circuit model gave -12 mN·m
    motor = changed_motor(BEAM40, {"beam.recoil": True})
    assert [mode.recoil_kg for mode in motor.modes] == pytest.approx([3.889e-3, 0.0], rel=1e-3)
    drive = pr.default_drive(motor)
    state = pr.steady_state(motor, drive, speed=15.0)
    assert state.stable
    assert state.torque_n_m == pytest.approx(-12.1e-3, rel=0.01)
    assert not any("recoil" in caution for caution in state.cautions)
    averaged = pr.simulate_averaged(motor, drive, 30e-3, speed=15.0)
    assert averaged.trusted
    assert averaged.torque_n_m[-1] == pytest.approx(state.torque_n_m, abs=0.02 * 0.3 * 6.5 * 0.015)


@pytest.mark.soak
def test_steady_state_and_averaged_motor_agree_on_a_carrier_that_moves_along_the_rotor() -> None:
    motor = FLAGSHIP.updated(
        {"modes.bending-1.recoil_kg": 0.0, "modes.bending-2.recoil_x_kg": 0.02,
         "mount.tangential_stiffness_n_per_m": 2e4, "mount.tangential_damping_n_s_per_m": 50.0}
    )  # fmt: skip
    drive = two_phase(110.0, 40.5e3, 120.0)
    state = pr.steady_state(motor, drive, speed=15.0)
    assert abs(state.balance_residual) < 1e-5
    averaged = pr.simulate_averaged(motor, drive, 30e-3, speed=15.0)
    greatest = 0.3 * 6.5 * 0.015
    assert averaged.trusted
    assert averaged.torque_n_m[-1] == pytest.approx(state.torque_n_m, abs=0.02 * greatest)
    without = pr.simulate_averaged(motor.updated({"modes.bending-2.recoil_x_kg": 0.0}), drive, 30e-3, speed=15.0)
    assert abs(without.torque_n_m[-1] - state.torque_n_m) > 0.2 * greatest  # the recoil detunes the mode


def test_an_unknown_recoil_that_may_detune_a_mode_is_a_caution() -> None:
    unknown = pr.load_motor(BEAM40)
    said = pr.steady_state(unknown, pr.default_drive(unknown), speed=15.0).cautions
    assert any("The recoil of mode bending-1 on the carrier is not known: one of 3.3 g" in one for one in said)
    assert pr.admittance(unknown, **BAND).cautions == unknown.cautions == said[: len(unknown.cautions)]
    assert not any("recoil" in one for one in pr.admittance(FLAGSHIP, **BAND).cautions)


@pytest.mark.parametrize("motion", [5e-324, 1e-160, 1e-9])
def test_no_recoil_is_estimated_for_a_tip_at_a_node(motion: float) -> None:
    unknown = pr.load_motor(BEAM40).updated({"modes.0.tip_x": 0.0, "modes.0.tip_y": motion})
    assert not any("recoil of mode bending-1 on" in one for one in unknown.cautions)


def test_modes_that_shake_more_than_the_carrier_are_refused() -> None:
    with pytest.raises(pr.ParameterError, match=r"shakes 0.271 kg, .* mount.mass_kg = 0.05 kg"):
        pr.load_motor(BEAM40).updated({"modes.0.recoil_kg": 0.03})
    with pytest.raises(pr.ParameterError, match=r"needs tangential_stiffness_n_per_m and tangential_damping"):
        FLAGSHIP.updated({"mount.tangential_stiffness_n_per_m": 1e4})
    with pytest.raises(pr.ParameterError, match=r"beam.recoil = 3 is not valid: it must be true or false"):
        changed_motor(BEAM40, {"beam.recoil": 3})
