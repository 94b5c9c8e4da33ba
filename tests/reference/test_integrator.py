# SPDX-License-Identifier: GPL-3.0-or-later
"""The yardstick itself, measured against closed forms, conservation laws and a second, cruder integrator."""

# mypy: allow-untyped-defs
from functools import cache
from math import pi, sqrt
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import cumulative_simpson, quad
from scipy.optimize import brentq

from tests.reference.damped import integrate_damped
from tests.reference.integrator import ReferenceRun, Tone, integrate
from tests.selection import mostly

Array = NDArray[np.float64]
HERTZ, FRICTION, PRELOAD, RADIUS = 7e9, 0.3, 5.0, 0.01
COMPLIANCE = 1.0 / (0.82 * HERTZ ** (2.0 / 3.0))  # initial tangential over normal stiffness: 0.82
KAPPA = FRICTION * COMPLIANCE * HERTZ ** (2.0 / 3.0)


def _mode(
    frequency: float, mass: float, coupling_a: float, coupling_b: float, tip_x: float, tip_y: float
) -> dict[str, float]:
    stiffness = mass * (2.0 * pi * frequency) ** 2
    return {
        "frequency_hz": frequency,
        "mass_kg": mass,
        "damping_n_s_per_m": 1.2e3 * mass + 4.1e-8 * stiffness,
        "stiffness_n_per_m": stiffness,
        "coupling_a_n_per_v": coupling_a,
        "coupling_b_n_per_v": coupling_b,
        "tip_x": tip_x,
        "tip_y": tip_y,
    }


def _motor(preload: float = PRELOAD) -> dict[str, Any]:
    return {
        "modes": [
            _mode(13.5e3, 0.011, 0.12, 0.12, 0.0, 1.0),
            _mode(51.7e3, 0.010, 0.35, -0.35, 0.8, 0.0),
        ],
        "contact": {
            "normal_stiffness_n_per_m15": HERTZ,
            "tangential_compliance_tip_m_per_n23": 0.5 * COMPLIANCE,
            "tangential_compliance_rotor_m_per_n23": 0.5 * COMPLIANCE,
            "friction": FRICTION,
            "preload_n": preload,
        },
        "rotor": {"radius_m": RADIUS, "inertia_kg_m2": 2e-6, "bearing_damping_n_m_s": 1e-6},
    }


def _two_phase(voltage: float, frequency: float, phase: float = 0.5 * pi) -> tuple[list[Tone], list[Tone]]:
    return [Tone(voltage, frequency, 0.0)], [Tone(voltage, frequency, phase)]


def _distance(run: ReferenceRun, other: ReferenceRun) -> float:
    """RMS of the difference relative to the RMS of the movement, the worse of x and y."""
    worst = 0.0
    for name in ("tip_x_m", "tip_y_m"):
        ours, theirs = getattr(run, name), getattr(other, name)
        worst = max(worst, float(np.sqrt(np.mean((ours - theirs) ** 2)) / np.std(theirs)))
    return worst


def _contact_rates(run: ReferenceRun, motor: dict[str, Any]) -> tuple[Array, Array, Array]:
    """δ, δ' and v_rel at the samples, in a textbook's way."""
    x_n = np.array([mode["tip_x"] for mode in motor["modes"]])
    y_n = np.array([mode["tip_y"] for mode in motor["modes"]])
    k_n = np.array([mode["stiffness_n_per_m"] for mode in motor["modes"]])
    preload = motor["contact"]["preload_n"]
    bending = preload * np.sum(y_n**2 / k_n)
    h = RADIUS - (preload / HERTZ) ** (2.0 / 3.0) - bending - run.tip_y_m
    d = np.sqrt(run.tip_x_m**2 + h**2)
    vx, vy = x_n @ run.modal_velocity_m_s, y_n @ run.modal_velocity_m_s
    approach = (h * vy - run.tip_x_m * vx) / d
    return RADIUS - d, approach, (vx * h + vy * run.tip_x_m) / d - run.rotor_speed_rad_s * RADIUS


def test_free_tip_settles_to_the_phasor_solution() -> None:
    motor = _motor()
    motor["modes"][1]["tip_y"] = 0.3  # both modes in y
    a = [Tone(30.0, 14e3, 0.2), Tone(20.0, 50e3, -0.4)]
    b = [Tone(30.0, 14e3, 1.9), Tone(20.0, 50e3, 2.2)]
    run = integrate(motor, a, b, duration=27e-3, output_step=1e-6, step=5e-8, contact=False)
    late = run.time_s > 25e-3
    time = run.time_s[late]
    exact = np.zeros((2, time.size))
    for i, mode in enumerate(motor["modes"]):
        for tone_a, tone_b in zip(a, b, strict=True):
            w = 2.0 * pi * tone_a.frequency_hz
            force = mode["coupling_a_n_per_v"] * tone_a.amplitude_v * np.exp(1j * tone_a.phase_rad)
            force += mode["coupling_b_n_per_v"] * tone_b.amplitude_v * np.exp(1j * tone_b.phase_rad)
            impedance = mode["damping_n_s_per_m"] + 1j * w * mode["mass_kg"] + mode["stiffness_n_per_m"] / (1j * w)
            exact[i] += np.imag(force / (1j * w * impedance) * np.exp(1j * w * time))
    for ours, truth in zip(run.modal_displacement_m[:, late], exact, strict=True):
        assert np.max(np.abs(ours - truth)) < 1e-6 * np.max(np.abs(truth))
    both = exact[0] + 0.3 * exact[1]
    np.testing.assert_allclose(run.tip_y_m[late], both, atol=1e-6 * np.max(np.abs(both)))
    assert run.state_fractions == {"separated": pytest.approx(1.0), "stick": 0.0, "slip": 0.0}
    assert run.events == 0
    assert not run.contact_state.any()
    assert not run.normal_force_n.any()
    assert not run.friction_force_n.any()
    np.testing.assert_allclose(
        run.voltage_a_v,
        30.0 * np.sin(2 * pi * 14e3 * run.time_s + 0.2) + 20.0 * np.sin(2 * pi * 50e3 * run.time_s - 0.4),
        atol=1e-9,
    )


def test_bounces_conserve_energy_and_last_as_long_as_hertz_says() -> None:
    """A nearly free mass under a nearly constant force: flights, and impacts on the Hertz spring."""
    mass, stiffness, pull, fall = 0.011, 10.0, 1.0, 2e-6
    motor = _motor(preload=pull)
    heavy = _mode(1.0, mass, 0.0, 0.0, 0.0, 1.0) | {"stiffness_n_per_m": stiffness, "damping_n_s_per_m": 0.0}
    motor["modes"] = [heavy]
    rest = (pull / HERTZ) ** (2.0 / 3.0)

    def force(depth: float) -> Any:  # of spring and preload, towards the rotor
        return pull + stiffness * (rest - depth)

    def square_of_speed(depth: float) -> Any:
        work = (pull + stiffness * rest) * (depth + fall) - 0.5 * stiffness * (depth**2 - fall**2)
        return 2.0 / mass * (work - 0.4 * HERTZ * max(depth, 0.0) ** 2.5)

    deepest = brentq(square_of_speed, 0.0, 1e-3, xtol=1e-20, rtol=1e-15)
    assert HERTZ * deepest**1.5 > 5.0 * force(deepest)

    # depth = deepest·sin²φ takes the root out of the integrand
    def slowness(angle: float) -> Any:
        return deepest * np.sin(2.0 * angle) / sqrt(square_of_speed(deepest * np.sin(angle) ** 2))

    touching = 2.0 * quad(slowness, 0.0, 0.5 * pi, epsrel=1e-10)[0]
    falling = quad(lambda q: 2.0 * q / sqrt(square_of_speed(q * q - fall)), 0.0, sqrt(fall), epsrel=1e-10)[0]
    period = touching + 2.0 * falling
    run = integrate(
        motor, [], [], duration=3 * period, output_step=period / 500, step=2e-7, perturbation_m=-fall - rest
    )
    assert run.events == 6
    assert run.state_fractions["stick"] == pytest.approx(touching / period, rel=1e-7)
    assert run.state_fractions["slip"] == 0.0
    delta, _, _ = _contact_rates(run, motor)
    energy = 0.5 * mass * run.modal_velocity_m_s[0] ** 2 + 0.5 * stiffness * run.modal_displacement_m[0] ** 2
    energy += 0.4 * HERTZ * np.maximum(delta, 0.0) ** 2.5
    scale = np.ptp(0.5 * mass * run.modal_velocity_m_s[0] ** 2)
    assert np.ptp(energy) < 1e-8 * scale
    assert run.tip_y_m[-1] - run.tip_y_m[0] == pytest.approx(0.0, abs=1e-7 * fall)
    hertz = HERTZ * np.maximum(delta, 0.0) ** 1.5
    np.testing.assert_allclose(run.normal_force_n, hertz, rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize("direction", ["normal", "tangential"])
def test_small_movements_see_the_stiffness_of_the_contact(direction: str) -> None:
    motor = _motor()
    mode = motor["modes"][0 if direction == "normal" else 1]
    mode["damping_n_s_per_m"] = 0.0
    # a second mode carries the preload and is too stiff to take part
    wall = _mode(1e5, 1e3, 0.0, 0.0, 0.0, 1.0)
    motor["modes"] = [mode, wall]
    stiffness = 1.5 * HERTZ ** (2.0 / 3.0) * PRELOAD ** (1.0 / 3.0)
    if direction == "tangential":
        distance = RADIUS - (PRELOAD / HERTZ) ** (2.0 / 3.0)
        # F_N e_x pushes the tip off the crown
        stiffness = 0.8**2 * (1.5 * PRELOAD ** (1.0 / 3.0) / COMPLIANCE - PRELOAD / distance)
    w = sqrt((mode["stiffness_n_per_m"] + stiffness) / mode["mass_kg"])
    start, period = 1e-13, 2.0 * pi / w
    run = integrate(motor, [], [], duration=50 * period, output_step=period / 40, speed=0.0, perturbation_m=start)
    moved = run.modal_displacement_m[0] - (run.modal_displacement_m[0, 0] - start)
    phase = w * run.time_s
    last = phase > phase[-1] - 2 * pi * 1.01
    basis = np.column_stack([np.cos(phase[last]), np.sin(phase[last])])
    c, s = np.linalg.lstsq(basis, moved[last], rcond=None)[0]
    assert np.hypot(c, s) == pytest.approx(start, rel=1e-4)
    assert abs(np.arctan2(s, c)) < 1e-6 * phase[-1]  # the frequency, relative
    assert run.state_fractions["stick"] == pytest.approx(1.0)


def test_preloaded_rest_stays_at_rest() -> None:
    motor = _motor()
    run = integrate(motor, [], [], duration=1e-3, output_step=1e-5)
    np.testing.assert_allclose(run.normal_force_n, PRELOAD, rtol=1e-9)
    np.testing.assert_allclose(run.tip_y_m, -PRELOAD / motor["modes"][0]["stiffness_n_per_m"], rtol=1e-9)
    assert not run.tip_x_m.any()
    assert not run.friction_force_n.any()
    assert not run.rotor_speed_rad_s.any()
    assert (run.contact_state == 1).all()
    # with a mode that moves both ways the start is the design's r_n = −Y_n F_0/k_n, off the crown by x
    motor["modes"][1]["tip_y"] = 0.2
    run = integrate(motor, [], [], duration=1e-6, output_step=1e-6)
    k = [mode["stiffness_n_per_m"] for mode in motor["modes"]]
    bent = [-PRELOAD / k[0], -0.2 * PRELOAD / k[1]]
    np.testing.assert_allclose(run.modal_displacement_m[:, 0], bent, rtol=1e-14)
    assert run.normal_force_n[0] == pytest.approx(PRELOAD, rel=1e-6)


OPERATING_POINTS: dict[str, dict[str, Any]] = {
    "all stick": {"tones": _two_phase(10.0, 51.7e3)},
    "mostly stick": {"tones": _two_phase(300.0, 60e3)},
    "mostly slip": {"tones": _two_phase(300.0, 51.7e3)},
    "opening": {"tones": _two_phase(300.0, 14.5e3)},
    "opening, shaft held": {"tones": _two_phase(300.0, 14e3), "speed": 2.0},
    "opening, loaded": {"tones": _two_phase(100.0, 13.5e3, 1.0), "load_torque": 2e-3},
    "two tones": {
        "tones": (
            [Tone(200.0, 17.2333e3, 0.0), Tone(100.0, 51.7e3, 1.0)],
            [Tone(200.0, 17.2333e3, 0.0), Tone(100.0, 51.7e3, 1.0 + pi)],
        )
    },
}


@cache
def _operate(name: str, *, duration: float = 2e-3, output_step: float = 4e-7, **more: Any) -> ReferenceRun:
    point = dict(OPERATING_POINTS[name])
    tones_a, tones_b = point.pop("tones")
    return integrate(_motor(), tones_a, tones_b, duration=duration, output_step=output_step, **point, **more)


@pytest.mark.parametrize(
    "name", mostly(pytest.mark.soak, OPERATING_POINTS, ["mostly slip", "opening, loaded", "two tones"])
)
def test_halving_the_step_changes_nothing(name: str) -> None:
    fine = _operate(name, step=1e-8)
    usual = _operate(name)
    coarse = _operate(name, step=4e-8)
    shares = usual.state_fractions
    if name == "all stick":
        assert shares["stick"] == pytest.approx(1.0)
    elif name == "mostly stick":
        assert shares["stick"] > 0.7
        assert shares["slip"] > 0.1
    elif name == "mostly slip":
        assert shares["slip"] > 0.8
    else:
        assert shares["separated"] > 0.2
        assert shares["slip"] > 0.0
    assert _distance(usual, fine) < 1e-7  # asked for: 1e-4
    assert _distance(coarse, fine) < 1e-6
    for state, share in fine.state_fractions.items():
        assert shares[state] == pytest.approx(share, abs=1e-5)
    assert usual.rotor_speed_rad_s[-1] == pytest.approx(fine.rotor_speed_rad_s[-1], abs=1e-5)
    moved = _operate(name, perturbation_m=1e-12)  # no chaos: what is put in dies away
    late = slice(-100, None)
    assert np.max(np.abs(moved.tip_y_m - usual.tip_y_m)[late]) < 1e-12
    assert np.max(np.abs(moved.tip_x_m - usual.tip_x_m)[late]) < 1e-12


@pytest.mark.parametrize("name", OPERATING_POINTS)
def test_energy_balances(name: str) -> None:
    run = _operate(name)
    e = run.energies_j
    spent = e["kinetic"] + e["elastic"] + e["damping"] + e["contact_elastic"] + e["tangential"] + e["shaft"]
    assert run.input_mechanical_energy_j == e["input"] > 0.0
    assert spent == pytest.approx(e["input"], rel=1e-9)
    assert run.slip_energy_j == e["slip"] >= 0.0
    if "speed" not in OPERATING_POINTS[name]:
        assert e["rotor_kinetic"] + e["bearing"] + e["load"] == pytest.approx(e["shaft"], rel=1e-7, abs=1e-15)
    # the integrals, against those of the samples
    motor = _motor()
    velocity = run.modal_velocity_m_s
    power = sum(
        (m["coupling_a_n_per_v"] * run.voltage_a_v + m["coupling_b_n_per_v"] * run.voltage_b_v) * v
        for m, v in zip(motor["modes"], velocity, strict=True)
    )
    assert np.trapezoid(power, run.time_s) == pytest.approx(e["input"], rel=1e-3)
    _, _, vrel = _contact_rates(run, motor)
    work = float(np.trapezoid(run.friction_force_n * vrel, run.time_s))
    assert work == pytest.approx(e["tangential"], abs=1e-3 * e["input"])


@pytest.mark.parametrize("name", OPERATING_POINTS)
def test_samples_obey_the_law(name: str) -> None:
    run = _operate(name)
    delta, ddelta, vrel = _contact_rates(run, _motor())
    limit = KAPPA * np.maximum(delta, 0.0)
    u, f_n, f_t = run.contact_displacement_m, run.normal_force_n, run.friction_force_n
    apart, stuck, sliding = (run.contact_state == i for i in range(3))
    assert (delta[apart] <= 1e-15).all()
    assert (delta[~apart] >= -1e-15).all()
    assert not np.any([u[apart], f_n[apart], f_t[apart]])
    assert (np.abs(u) <= limit + 1e-15).all()
    np.testing.assert_allclose(np.abs(u[sliding]), limit[sliding], rtol=1e-6, atol=1e-15)
    np.testing.assert_allclose(f_t[sliding], np.sign(u[sliding]) * FRICTION * f_n[sliding], rtol=1e-12)
    assert (np.sign(u[sliding]) * vrel[sliding] > KAPPA * ddelta[sliding] - 1e-9).all()
    rest = 1.0 - np.abs(u[stuck]) / limit[stuck]
    cattaneo = np.sign(u[stuck]) * FRICTION * f_n[stuck] * (1.0 - np.maximum(rest, 0.0) ** 1.5)
    np.testing.assert_allclose(f_t[stuck], cattaneo, atol=1e-5 * np.max(f_n))
    counted = dict(zip(("separated", "stick", "slip"), (apart, stuck, sliding), strict=True))
    for state, here in counted.items():
        assert run.state_fractions[state] == pytest.approx(np.mean(here), abs=0.01)
    assert sum(run.state_fractions.values()) == pytest.approx(1.0, abs=1e-12)


def test_sticking_contact_follows_the_surfaces() -> None:
    run = _operate("all stick", duration=1e-3, output_step=1e-7)
    _, _, vrel = _contact_rates(run, _motor())
    path = cumulative_simpson(vrel, x=run.time_s, initial=0.0)
    np.testing.assert_allclose(run.contact_displacement_m, path, atol=1e-6 * np.max(np.abs(path)))
    assert run.slip_energy_j == 0.0
    assert run.events == 0


@pytest.mark.parametrize("speed", [2.0, -2.0])
def test_held_shaft_drags_the_tip_with_the_friction_of_coulomb(speed: float) -> None:
    motor = _motor()
    run = integrate(motor, [], [], duration=30e-3, output_step=1e-5, step=1e-7, speed=speed, statistics_from=10e-3)
    late = run.time_s > 28e-3
    coulomb = -np.sign(speed) * FRICTION * run.normal_force_n[late]
    assert run.state_fractions["slip"] == pytest.approx(1.0)
    np.testing.assert_allclose(run.friction_force_n[late], coulomb, rtol=1e-14)
    np.testing.assert_allclose(run.normal_force_n[late], PRELOAD, rtol=1e-3)
    # the tip rests where the forces balance
    x, y, f_n, f_t = (v[-1] for v in (run.tip_x_m, run.tip_y_m, run.normal_force_n, run.friction_force_n))
    k_y, k_x = (mode["stiffness_n_per_m"] for mode in motor["modes"])
    e_x = x / RADIUS
    assert 0.8**2 * (f_n * e_x - f_t) / k_x == pytest.approx(x, rel=1e-6)
    assert (-f_n - f_t * e_x) / k_y == pytest.approx(y, rel=1e-6)
    # heat: μ F_N v for nearly all of the time
    assert run.slip_energy_j == pytest.approx(FRICTION * PRELOAD * RADIUS * 2.0 * 30e-3, rel=0.01)


@pytest.mark.parametrize("name", ["mostly slip", pytest.param("opening", marks=pytest.mark.soak)])
@pytest.mark.soak
def test_a_cut_off_instead_of_events_comes_to_the_same(name: str) -> None:
    run = _operate(name, duration=1e-3, output_step=1e-6)
    tones = OPERATING_POINTS[name]["tones"]
    errors = []
    for step in (4e-9, 1e-9):
        crude = integrate_damped(_motor(), *tones, duration=1e-3, output_step=1e-6, step=step)
        names = ("tip_x_m", "tip_y_m", "rotor_speed_rad_s")
        errors.append([np.std(getattr(crude, one) - getattr(run, one)) / np.std(getattr(run, one)) for one in names])
    assert max(errors[1][:2]) < 1e-5  # the tip
    assert max(errors[1]) < 2e-4
    # 1e-9: y of the tip is at 7e-11 and 8e-11, which is rounding
    assert all(fine < max(0.5 * coarse, 1e-9) for coarse, fine in zip(*errors, strict=True))


def test_a_flight_shorter_than_a_step_is_found() -> None:
    motor = _motor()
    del motor["modes"][1]
    grazing = Tone(19.305, 13.5e3, 0.0)
    runs = [integrate(motor, [grazing], [grazing], duration=1e-3, output_step=2e-6, step=h) for h in (2e-8, 1e-6)]
    flights = [run.state_fractions["separated"] * 1e-3 for run in runs]
    assert [run.events for run in runs] == [2, 2]
    assert 1e-8 < flights[0] < 1e-6
    assert flights[1] == pytest.approx(flights[0], rel=0.1)


MOUNTS = {
    "soft": {"stiffness_n_per_m": 1e4, "mass_kg": 0.05, "damping_n_s_per_m": 60.0},
    "middling": {"stiffness_n_per_m": 1e7, "mass_kg": 0.02, "damping_n_s_per_m": 20.0},
    "stiff": {"stiffness_n_per_m": 1e9, "mass_kg": 0.05, "damping_n_s_per_m": 100.0},
}


def _everything(mount: str) -> dict[str, Any]:
    motor = _motor()
    motor["mount"] = MOUNTS[mount]
    motor["contact"] |= {"sliding_ratio": 0.7, "stribeck_velocity_m_s": 0.05}
    motor["rotor"] |= {"bearing_friction_n_m": 5e-4, "bearing_presliding_rad": 1e-3}
    return motor


@pytest.mark.parametrize("mount", MOUNTS)
@pytest.mark.parametrize("name", ["mostly slip", "opening", "opening, shaft held", "opening, loaded"])
def test_energy_balances_on_a_mount_with_stribeck_friction_and_a_dry_bearing(name: str, mount: str) -> None:
    point = dict(OPERATING_POINTS[name])
    tones_a, tones_b = point.pop("tones")
    run = integrate(_everything(mount), tones_a, tones_b, duration=2e-3, output_step=4e-7, **point)
    e = run.energies_j
    spent = e["kinetic"] + e["elastic"] + e["damping"] + e["contact_elastic"] + e["tangential"] + e["shaft"]
    assert spent + e["mount"] + e["mount_damping"] == pytest.approx(e["input"], rel=1e-9)
    assert e["mount_damping"] > 0.0
    assert e["slip"] > 0.0
    if "speed" not in point:
        assert e["rotor_kinetic"] + e["bearing"] + e["load"] == pytest.approx(e["shaft"], rel=1e-6, abs=1e-14)


def test_the_carrier_swings_on_the_stiffness_of_its_springs_and_the_contact() -> None:
    motor = _motor()
    carrier, stiffness = 0.05, 2e6
    # so heavy and slow that it stays where it starts
    motor["modes"] = [_mode(1.0, 1e10, 0.0, 0.0, 0.0, 1.0) | {"damping_n_s_per_m": 0.0}]
    motor["mount"] = {"stiffness_n_per_m": stiffness, "mass_kg": carrier, "damping_n_s_per_m": 0.0}
    contact = 1.5 * HERTZ ** (2.0 / 3.0) * PRELOAD ** (1.0 / 3.0)
    period = 2.0 * pi * sqrt(carrier / (contact + stiffness))
    start = 1e-12
    run = integrate(motor, [], [], duration=10 * period, output_step=period / 40, perturbation_m=start)
    swing = start * contact / (contact + stiffness)
    expected = -swing * (1.0 - np.cos(2.0 * pi * run.time_s / period))
    # the mode comes back by some 1e-4 of its start, and rounding is 1e-19 m
    np.testing.assert_allclose(run.carrier_displacement_m, expected, rtol=0.0, atol=1e-3 * swing)


def test_the_carrier_obeys_the_law_of_momentum() -> None:
    """m Δz' + d Δz + k ∫z dt = ∫(F_0 − F_y) dt, by Simpson's rule over the samples."""
    tones_a, tones_b = OPERATING_POINTS["opening"]["tones"]
    motor = _motor()
    motor["mount"] = MOUNTS["soft"]
    run = integrate(motor, tones_a, tones_b, duration=2e-3, output_step=5e-8)
    z = run.carrier_displacement_m
    x, y = run.tip_x_m, run.tip_y_m + z
    bending = PRELOAD / motor["modes"][0]["stiffness_n_per_m"]
    h = RADIUS - (PRELOAD / HERTZ) ** (2.0 / 3.0) - bending - y
    d = np.hypot(x, h)
    pressed = run.normal_force_n * h / d + run.friction_force_n * x / d
    impulse = cumulative_simpson(PRELOAD - pressed, x=run.time_s, initial=0.0)[-1]
    velocity = np.gradient(z, run.time_s, edge_order=2)[-1]
    mount = MOUNTS["soft"]
    springs = mount["stiffness_n_per_m"] * cumulative_simpson(z, x=run.time_s, initial=0.0)[-1]
    momentum = mount["mass_kg"] * velocity + mount["damping_n_s_per_m"] * z[-1] + springs
    assert momentum == pytest.approx(impulse, rel=1e-4)


@pytest.mark.parametrize("speed", [1.0, 4.0, 30.0])
def test_fast_sliding_has_the_friction_of_stribeck(speed: float) -> None:
    motor = _motor()
    motor["contact"] |= {"sliding_ratio": 0.6, "stribeck_velocity_m_s": 0.05}
    run = integrate(motor, [], [], duration=30e-3, output_step=1e-5, step=1e-7, speed=speed)
    late = run.time_s > 28e-3
    friction = FRICTION * (0.6 + 0.4 * np.exp(-((RADIUS * speed / 0.05) ** 2)))
    np.testing.assert_allclose(-run.friction_force_n[late], friction * run.normal_force_n[late], rtol=1e-6)


def test_a_dry_bearing_brakes_with_its_torque_and_then_holds() -> None:
    motor = _motor()
    dry, angle, inertia = 2e-3, 1e-4, motor["rotor"]["inertia_kg_m2"]
    motor["rotor"] |= {"bearing_friction_n_m": dry, "bearing_presliding_rad": angle, "bearing_damping_n_m_s": 0.0}
    # half of the dry torque turns the rotor by the little that presliding takes, T = dry (1 − exp(−φ/angle)); it is
    # fastest where T is the load, at φ = angle ln 2
    load = -0.5 * dry
    run = integrate(motor, [], [], duration=40e-3, output_step=1e-5, step=5e-7, contact=False, load_torque=load)
    fastest = sqrt((1.0 - np.log(2.0)) * dry * angle / inertia)
    assert np.max(run.rotor_speed_rad_s) == pytest.approx(fastest, rel=1e-4)  # between samples
    # more accelerates it with what is left
    run = integrate(motor, [], [], duration=20e-3, output_step=1e-5, step=5e-7, contact=False, load_torque=-2 * dry)
    late = run.time_s > 10e-3
    slope = np.polyfit(run.time_s[late], run.rotor_speed_rad_s[late], 1)[0]
    assert slope == pytest.approx(dry / inertia, rel=1e-6)
    # held at a speed it takes its torque times the angle, but for the presliding
    turned = 1.0 * 5e-3
    run = integrate(motor, [], [], duration=5e-3, output_step=1e-5, step=5e-7, contact=False, speed=1.0)
    taken = dry * (turned - angle * (1.0 - np.exp(-turned / angle)))
    assert run.energies_j["bearing"] == pytest.approx(taken, rel=1e-6)
