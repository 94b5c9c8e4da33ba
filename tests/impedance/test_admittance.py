# SPDX-License-Identifier: GPL-3.0-or-later
"""The two-port against closed forms, free and preloaded."""

from itertools import pairwise

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.motor.dielectric import lossy_capacitance
from pyspice_runner.motor.equivalent import MotionalArm

PARAMETER_SETS = [
    {},
    {
        "modes.0.frequency_hz": 21e3,
        "modes.0.coupling_b_n_per_v": 0.05,
        "modes.1.damping_n_s_per_m": 2.0,
        "mount": None,
        "piezo.loss_tangent": 0.0,
        "piezo.capacitance_b_f": 5e-9,
        "contact.preload_n": 12.0,
        "contact.normal_stiffness_n_per_m15": 3e9,
    },
]


@pytest.fixture(params=PARAMETER_SETS, ids=["defaults", "others"])
def motor(request: pytest.FixtureRequest) -> pr.Motor:
    return pr.load_motor("andersen2002").updated(request.param)


def closed_form(motor: pr.Motor, frequency_hz: np.ndarray) -> np.ndarray:
    """Clamped capacitances by their branches, and θ θᵀ jω/(k − m ω² + jω c) of every mode."""
    s = 2j * np.pi * frequency_hz
    y = np.zeros((len(s), 2, 2), dtype=complex)
    for index, capacitance in enumerate((motor.piezo.capacitance_a_f, motor.piezo.capacitance_b_f)):
        for r, c in lossy_capacitance(capacitance, motor.piezo.loss_tangent or 1e-5):
            y[:, index, index] += s * c / (1 + s * r * c)
    for mode in motor.modes:
        coupling = np.array([mode.coupling_a_n_per_v, mode.coupling_b_n_per_v])
        velocity = s / (mode.stiffness_n_per_m + s * mode.damping_n_s_per_m + s**2 * mode.mass_kg)
        y += np.multiply.outer(velocity, np.outer(coupling, coupling))
    return y


def test_free_admittance_is_the_closed_form(motor: pr.Motor) -> None:
    result = pr.admittance(motor, start=5e3, stop=100e3, points=1500)
    exact = closed_form(motor, result.frequency_hz)
    assert np.abs(result.matrix_s / exact - 1).max() < 1e-6


def test_the_loss_tangent_of_the_clamped_capacitance_is_constant_over_three_decades() -> None:
    motor = pr.load_motor("andersen2002")
    for start, stop in ((1e3, 1e4), (1e4, 1e5), (1e5, 1e6)):
        result = pr.admittance(motor, start=start, stop=stop, points=100)
        s = 2j * np.pi * result.frequency_hz
        for group, coupling in (("a", "coupling_a_n_per_v"), ("b", "coupling_b_n_per_v")):
            motional = sum(
                getattr(mode, coupling) ** 2
                * s
                / (mode.stiffness_n_per_m + s * mode.damping_n_s_per_m + s**2 * mode.mass_kg)
                for mode in motor.modes
            )
            port = {"a": 0, "b": 1}[group]
            clamped = result.matrix_s[:, port, port] - motional
            # what the ladder promises from 1 kHz to 10 MHz
            assert clamped.real / clamped.imag == pytest.approx(motor.piezo.loss_tangent, rel=0.05)


def test_connections_are_sums_of_the_matrix(motor: pr.Motor) -> None:
    result = pr.admittance(motor, points=50)
    ((aa, ab), (ba, bb)) = np.moveaxis(result.matrix_s, 0, -1)
    assert result.driven("A") == pytest.approx(aa)
    assert result.driven("A+B") == pytest.approx(aa + ab + ba + bb)
    assert result.driven("A-B") == pytest.approx(aa - ab - ba + bb)


def test_motional_arms_are_those_of_the_modes(motor: pr.Motor) -> None:
    result = pr.admittance(motor)
    found = {item.mode: item for item in result.resonances["A"]}
    for mode in motor.modes:
        theta = mode.coupling_a_n_per_v
        arm = found[mode.name]
        # the other mode's tail is approximated by a cubic over the zoom
        assert arm.resistance_ohm == pytest.approx(mode.damping_n_s_per_m / theta**2, rel=1e-5)
        assert arm.inductance_h == pytest.approx(mode.mass_kg / theta**2, rel=1e-5)
        assert arm.capacitance_f == pytest.approx(theta**2 / mode.stiffness_n_per_m, rel=1e-5)
        assert arm.quality_factor == pytest.approx(mode.quality_factor, rel=1e-5)


def test_characteristic_frequencies_are_those_of_the_curve(motor: pr.Motor) -> None:
    resonances = pr.admittance(motor).resonances
    for connection in ("A", "A+B", "A-B"):
        for item in resonances[connection]:
            width = item.fs / item.quality_factor
            fine = np.linspace(item.fs - 5 * width, 1.06 * item.fs, 400_001)
            drive = np.array({"A": (1, 0), "A+B": (1, 1), "A-B": (1, -1)}[connection])
            y = np.einsum("i,kij,j->k", drive, closed_form(motor, fine), drive)
            tolerance = 2e-6 * item.fs  # the fine grid resolves 4e-7 of the frequency
            assert item.fs == pytest.approx(fine[np.argmax(y.real)], abs=tolerance)
            assert item.fp == pytest.approx(fine[np.argmax((1 / y).real)], abs=tolerance)
            for found, extremum in ((item.fm, np.argmax), (item.fn, np.argmin)):
                if found is not None:
                    near = np.abs(fine - found) < 0.3 * width
                    assert found == pytest.approx(fine[near][extremum(np.abs(y[near]))], abs=tolerance)
            assert item.coupling_factor == pytest.approx(np.sqrt(1 - (item.fs / item.fp) ** 2))


def test_a_symmetric_motor_is_driven_by_sum_and_difference_each_in_one_mode() -> None:
    resonances = pr.admittance(pr.load_motor("andersen2002")).resonances
    assert [item.mode for item in resonances["A+B"]] == ["bending-1"]
    assert [item.mode for item in resonances["A-B"]] == ["bending-2"]


def test_preload_raises_the_first_resonance_by_the_contact_stiffness(motor: pr.Motor) -> None:
    motor = motor.updated({"mount": None})
    contact, mode = motor.contact, motor.modes[0]
    penetration = (contact.preload_n / contact.normal_stiffness_n_per_m15) ** (2 / 3)
    stiffness = 3 * contact.preload_n / (2 * penetration)
    expected = mode.frequency_hz * np.sqrt(1 + stiffness * mode.tip_y**2 / mode.stiffness_n_per_m)
    result = pr.admittance(motor, state="preloaded")
    assert result.resonances["A+B"][0].fs == pytest.approx(expected, rel=1e-3)  # required; measured 1e-6


def test_the_operating_point_has_the_preload(motor: pr.Motor) -> None:
    result = pr.admittance(motor, state="preloaded", points=10)
    assert result.normal_force_n == pytest.approx(motor.contact.preload_n, rel=1e-6)


def preloaded_closed_form(motor: pr.Motor, frequency_hz: np.ndarray) -> np.ndarray:
    """Modes, rotor and carrier coupled by the normal and the tangential stiffness of the sticking contact."""
    contact, rotor = motor.contact, motor.rotor
    carrier = [motor.mount] if motor.mount else []
    penetration = (contact.preload_n / contact.normal_stiffness_n_per_m15) ** (2 / 3)
    normal = 1.5 * contact.preload_n / penetration
    compliance = contact.tangential_compliance_tip_m_per_n23 + contact.tangential_compliance_rotor_m_per_n23
    tangential = 1.5 * contact.preload_n ** (1 / 3) / compliance
    parts = [*motor.modes, *carrier]
    x = np.array([*(mode.tip_x for mode in motor.modes), *(0.0 for _ in carrier), -1.0])
    y = np.array([*(mode.tip_y for mode in motor.modes), *(1.0 for _ in carrier), 0.0])
    mass = np.diag([*(part.mass_kg for part in parts), rotor.inertia_kg_m2 / rotor.radius_m**2])
    damping = np.diag([*(part.damping_n_s_per_m for part in parts), rotor.bearing_damping_n_m_s / rotor.radius_m**2])
    stiffness = np.diag([*(part.stiffness_n_per_m for part in parts), 0.0])
    stiffness = stiffness + normal * np.outer(y, y) + tangential * np.outer(x, x)
    x[-1] = 0.0  # the preload on the curved rotor pushes a tip that is off its crown further away
    stiffness -= contact.preload_n / rotor.radius_m * np.outer(x, x)
    couplings = np.zeros((2, len(x)))
    couplings[:, : len(motor.modes)] = [
        [getattr(mode, f"coupling_{g}_n_per_v") for mode in motor.modes] for g in ("a", "b")
    ]
    modes = range(len(motor.modes))
    free_of_modes = motor.updated({f"modes.{i}.coupling_{g}_n_per_v": 0.0 for i in modes for g in "ab"})
    exact = closed_form(free_of_modes, frequency_hz)
    for index, s in enumerate(2j * np.pi * frequency_hz):
        exact[index] += s * couplings @ np.linalg.solve(mass * s**2 + damping * s + stiffness, couplings.T)
    return exact


def test_preloaded_admittance_is_the_linearised_closed_form(motor: pr.Motor) -> None:
    result = pr.admittance(motor, state="preloaded", start=3e3, stop=90e3, points=400)
    exact = preloaded_closed_form(motor, result.frequency_hz)
    # second order in seat/R and in round-off; measured 1e-6
    assert np.abs(result.matrix_s - exact).max() < 1e-4 * np.abs(exact).max()


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"start": 2e3, "stop": 1e3}, "start < stop"),
        ({"start": 0.0}, "start = 0 Hz"),
        ({"stop": float("nan")}, "stop = nan Hz"),
        ({"points": 1}, "points = 1 is not valid"),
        ({"state": "pressed"}, "state = 'pressed' is not valid"),
    ],
)
def test_errors_say_what_is_allowed(settings: dict[str, object], says: str) -> None:
    with pytest.raises(pr.ParameterError) as refusal:
        pr.admittance(pr.load_motor("andersen2002"), **settings)  # type: ignore[arg-type]
    assert says in str(refusal.value)


def test_a_mode_that_its_neighbours_bury_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where no arm of positive resistance fits there is no motional arm to tell of, and no error."""
    motor = pr.load_motor("andersen2002")
    found = pr.admittance(motor, start=10e3, stop=60e3, points=51)
    assert [item.mode for item in found.resonances["A"]] == [mode.name for mode in motor.modes]
    monkeypatch.setattr("pyspice_runner.impedance.admittance._motional_arm", lambda *_: MotionalArm(-1.0, 1.0, 1.0))
    assert pr.admittance(motor, start=10e3, stop=60e3, points=51).resonances == dict.fromkeys(found.resonances, ())


def test_modes_a_hundredth_apart_are_distinguished() -> None:
    """Each has the arm of its mode, and its antiresonance lies below the next resonance (Foster's theorem)."""
    spread = {"modes.3.coupling_b_n_per_v": -0.02, "modes.1.coupling_a_n_per_v": 0.02}
    for motor in (pr.load_motor("bimodal40"), pr.load_motor("bimodal40").updated(spread)):
        for connection, weights in {"A": (1, 0), "A-B": (1, -1)}.items():
            found = pr.admittance(motor, start=30e3, stop=50e3, points=50).resonances[connection]  # type: ignore[index]
            assert len(found) > 1
            for item in found:
                mode = next(mode for mode in motor.modes if mode.name == item.mode)
                theta = np.dot(weights, (mode.coupling_a_n_per_v, mode.coupling_b_n_per_v))
                # the tails of modes beyond twelve bandwidths are approximated by a cubic
                assert item.inductance_h == pytest.approx(mode.mass_kg / theta**2, rel=1e-4)
                assert item.resistance_ohm == pytest.approx(mode.damping_n_s_per_m / theta**2, rel=1e-4)
                # neighbours shift the greatest conductance by a part of a bandwidth, 1/400 of the frequency
                assert item.fs == pytest.approx(mode.frequency_hz, rel=2e-4)
            for item, following in pairwise(found):
                assert item.fs < item.fp < following.fs
