# SPDX-License-Identifier: GPL-3.0-or-later
"""Physical audit of a result, independent of the simulator's own messages; load on ceramic and contact.

A clean log and finite numbers are not sufficient: a step that is too coarse for the contact gives plausible curves.
The audit reports each violation of a physical law with its likely cause.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import zip_longest
from math import nan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.circuit.law import Law, laws_of
from pyspice_runner.circuit.source import FEWEST_POINTS_PER_PERIOD, Source
from pyspice_runner.circuit.state import Discretisation, recorded_states, state_vectors
from pyspice_runner.motor.contact import elastic_energy, penetration
from pyspice_runner.motor.contacts import Touching
from pyspice_runner.motor.drive import too_fast
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.strength import exceeded, peak_of_motion, slip_velocity, temperature_rise, worst_contact
from pyspice_runner.run.waveforms import ENERGY_BOUND, EnergyBalance, force_columns
from pyspice_runner.run.window import Array, Window

# The wattmeters integrate over the simulator's own steps: settled points balance to 1e-4. The change of the energy
# stored in the contact from block to block is not metered.
POWER_BOUND = 0.01
# Powers are integrated by the trapezoidal rule over the nonuniform steps of a bridge. Over all drivers and corners of
# their parameters (docs/drive_grid.py) the balance closes to better than 1 %.
DRIVER_BOUND = 0.02
_WATTMETER = 1e-4  # of the apparent power: error of a purely reactive power
SLACK = 1e-3  # of a force; Newton's iteration closes to 1e-6, a change of state is up to half a step late
NEWTON = 1e-6  # tolerance of the iteration, relative to the energy stored by the preload
_PASSIVE = 1e-9  # of the largest |Y|: rounding
_OUT_OF_RANGE = "which is not possible. The contact law is out of its range: halve the step, or lower the drive."
_BEYOND_LIMIT = "which is not possible. The slider exceeds its limit: halve the step."
_TOO_COARSE = "is likely too coarse for the contact: halve it."


def audit_run(
    motor: Motor, waves: Mapping[str, Array], energy: EnergyBalance, *, step: float, contact: bool
) -> tuple[str, ...]:
    """Return the physical violations in a run, one sentence each."""
    findings = []
    if energy.residual > ENERGY_BOUND:
        findings.append(
            f"The energy balance misses {abs(energy.missing):.3g} J; the limit is {100 * ENERGY_BOUND:g} % of the "
            f"{energy.passed:.3g} J that passed, plus {energy.rounding:.2g} J for rounding. The step of {step:.3g} s "
            f"{_TOO_COARSE}"
        )
    if contact:
        for one in motor.touching:
            normal, friction = force_columns(motor, one)
            findings += audit_contact(one.contact.friction, waves[normal], waves[friction])
        findings += _step_finding(motor, float(np.abs(waves["normal_force_n"]).max()), "maximum", step)
    return tuple(findings)


def audit_contact(friction: float, normal_n: Array, friction_n: Array) -> tuple[str, ...]:
    """Return the physical violations in the forces of a contact, one sentence each."""
    findings = []
    greatest = float(np.abs(normal_n).max())
    if normal_n.min() < -SLACK * greatest:
        findings.append(f"The contact pulls with {-normal_n.min():.3g} N, {_OUT_OF_RANGE}")
    excess = float(np.max(np.abs(friction_n) - friction * np.maximum(normal_n, 0.0)))
    if excess > SLACK * friction * greatest:
        findings.append(f"Friction exceeds mu F_N by {excess:.3g} N, {_BEYOND_LIMIT}")
    return tuple(findings)


def audit_point(motor: Motor, point: Mapping[str, float], step: float) -> tuple[str, ...]:
    """Return the physical violations in the means of a point on the dynamometer, one sentence each."""
    findings = []
    electrical, shaft = point["power_a_w"] + point["power_b_w"], point["shaft_power_w"]
    losses = point["dielectric_loss_w"] + point["damping_loss_w"] + point["friction_loss_w"] + point["normal_loss_w"]
    found = shaft + losses + point["stored_power_w"]
    scale = max(electrical, 0.0) + max(-shaft, 0.0) + abs(point["stored_power_w"])
    reactive = point["apparent_power_a_va"] + point["apparent_power_b_va"]
    # at rest all powers are zero except for the tolerance of the iteration in a period of the slowest mode
    closed = NEWTON * pressed_j(motor, motor.contact.preload_n) * motor.modes[0].frequency_hz
    if abs(electrical - found) > POWER_BOUND * scale + _WATTMETER * reactive + closed:
        findings.append(
            f"The powers miss {abs(electrical - found):.3g} of {scale:.3g} W; the limit is {100 * POWER_BOUND:g} %. "
            f"The step of {step:.3g} s {_TOO_COARSE}"
        )
    normal = point["normal_force_n"]
    if normal < -SLACK * motor.contact.preload_n:
        findings.append(f"On average the contact pulls with {-normal:.3g} N, {_OUT_OF_RANGE}")
    greatest = float((motor.at_rest.friction * motor.at_rest.radius_m).max())
    limit, preloaded = greatest * max(normal, 0.0), greatest * motor.contact.preload_n
    if abs(point["torque_n_m"]) > limit + SLACK * max(limit, preloaded):
        findings.append(
            f"The mean torque of {point['torque_n_m']:.3g} N.m exceeds the limit of {limit:.3g} N.m at the mean "
            f"normal force, {_BEYOND_LIMIT}"
        )
    findings += _step_finding(motor, normal, "mean", step)
    return tuple(findings)


def audit_power(put_in_w: float, found_w: float, reactive_va: float) -> tuple[str, ...]:
    """Return the physical violations in the powers of a driver and its motor, one sentence each.

    ``found_w`` is the sum of losses, stored power and power of the motor.
    """
    missing = abs(put_in_w - found_w)
    if missing <= DRIVER_BOUND * abs(put_in_w) + _WATTMETER * reactive_va:
        return ()
    finding = (
        f"The powers miss {missing:.3g} of {put_in_w:.3g} W; the limit is {100 * DRIVER_BOUND:g} %. The step is likely "
        "too coarse for the driver's edges: halve it."
    )
    return (finding,)


def pressed_j(motor: Motor, force_n: float) -> float:
    """Return the energy in J that a normal force stores in the contact and in the bending of the stator."""
    shares = motor.stator.share
    found = 0.5 * force_n**2 * float(shares @ motor.stator.flexibility[1::2, 1::2] @ shares)
    for one in motor.touching:
        own, depth = one.share * force_n, np.array([penetration(one.contact, one.share * force_n)])
        found += 0.5 * one.contact.series_compliance_m_per_n * own**2 + elastic_energy(one.contact, depth)[0]
    return float(found)


def _step_finding(motor: Motor, force: float, which: str, step: float) -> tuple[str, ...]:
    fastest = float(motor.pressed_by(max(force, motor.contact.preload_n)).resonances()[-1])
    if step * fastest * FEWEST_POINTS_PER_PERIOD <= 1.0 + 1e-9:
        return ()
    allowed = 0.995 / (FEWEST_POINTS_PER_PERIOD * fastest)  # rounded down to three digits
    finding = (
        f"Under the {which} force, {force:.3g} N, the motor oscillates at {fastest:.4g} Hz, and the step of "
        f"{step:.3g} s gives fewer than {FEWEST_POINTS_PER_PERIOD} points per period. Use a step <= {allowed:.3g} s."
    )
    return (finding,)


def audit_two_port(frequency_hz: Array, y: NDArray[np.complex128]) -> tuple[str, ...]:
    """Return the physical violations in admittance matrices in S, shape (points, 2, 2), one sentence each."""
    dissipative = 0.5 * (y + np.conj(np.swapaxes(y, 1, 2)))
    least = np.linalg.eigvalsh(dissipative)[:, 0]
    worst = int(np.argmin(least))
    if least[worst] < -_PASSIVE * float(np.abs(y).max()):
        where = (
            f"At {frequency_hz[worst]:.6g} Hz the stator delivers power, {least[worst]:.3g} S, although it is passive."
        )
        return (f"{where} Rounding removed a loss: check the damping and the loss tangent.",)
    return ()


def modal_vectors(motor: Motor) -> list[str]:
    """Return the vectors of velocity and elastic force of every mode."""
    return state_vectors(motor, None, kinds=("mode",))


def ceramic(
    motor: Motor,
    law: Law | None,
    discretisation: Discretisation,
    samples: Mapping[str, Array],
    source: Source,
    window: Window,
) -> dict[str, Any]:
    """Return the load on ceramic and contact over the last periods of a run, and ``cautions``; None if not known.

    They are strain, stress and temperature rise of the ceramic, pressure, tension and wear of the contact. The vectors
    of the run include those of :func:`modal_vectors`, and the voltages and currents of the pins; for the contact its
    forces, for the wear also the slider of the law ``spring-slider``.
    """
    states = recorded_states(samples, motor, None, discretisation, "mode")
    moved, velocities = np.split(np.array([scale * values for _, scale, values in states]), 2)
    displacement = moved[:, window.points]
    heat = 0.0
    for group in motor.groups:
        name, sign = source.current(group)
        heat += window.mean(sign * samples[name] * samples[f"v({group})"])
    stator, volts = motor.stator, np.array([samples[f"v({group})"] for group in motor.groups])
    for damping, coupling, velocity in zip(stator.damping, stator.coupling, velocities, strict=True):
        heat += window.mean((damping * velocity - coupling @ volts) * velocity)
    if motor.is_transducer:
        found = {**peak_of_motion(motor, displacement), "temperature_rise_k": temperature_rise(motor, heat)}
        return stated(motor, found, np.zeros(1))
    for name, moved in zip(("friction", "normal"), stator.residual_per_volt @ volts, strict=False):
        if moved.any() and f"v(xmotor.{name})" in samples:  # power that the groups pass to the contact
            heat += window.mean(moved * np.gradient(samples[f"v(xmotor.{name})"], samples["time"]))
    pairs = zip_longest(motor.touching, laws_of(motor, law))
    found = {
        **peak_of_motion(motor, displacement),
        "temperature_rise_k": temperature_rise(motor, heat),
        **worst_contact(motor, [_contact_load(one, own, discretisation, samples, window) for one, own in pairs]),
    }
    return stated(motor, found, samples["v(shaft)"])


def _contact_load(
    one: Touching, law: Law | None, discretisation: Discretisation, samples: Mapping[str, Array], window: Window
) -> tuple[float, float]:
    """Return the largest normal force in N and the mean of normal force times slip velocity in W at each point."""
    nodes = (f"{node}{one.suffix}" for node in ("normal", "slider", "xcontact"))
    normal, slider, depth = (samples.get(f"v(xmotor.{node}{'.delta' * (node[0] == 'x')})") for node in nodes)
    greatest = nan if normal is None else float(normal[window.points].max())
    rubbing = nan
    if law and "averaged" in law.forms and normal is not None and slider is not None and depth is not None:
        velocity = slip_velocity(one.contact, 1e-6 * slider, 1e-6 * depth, normal, discretisation.slider_time)
        rubbing = window.mean(normal * velocity)
    return greatest / one.multiplicity, rubbing / one.multiplicity


def stated(motor: Motor, found: Mapping[str, float], speed_rad_s: Array) -> dict[str, Any]:
    """Return quantities JSON-ready, with ``cautions``, also of the course of the speed."""
    known = {name: value if np.isfinite(value) else None for name, value in found.items()}
    limits = exceeded(motor, found)
    fastest = float(speed_rad_s[np.abs(speed_rad_s).argmax()])
    return {**known, "cautions": [*limits, *(() if motor.is_transducer else too_fast(motor.to_dict(), fastest))]}


GAIN = 1e-3  # share of the power put in: a loss below minus this is reported
_GAINS = {
    "friction_loss_w": "Friction delivers {:.2g} % of the power put in: the spring of the contact stiffens while it is "
    "strained. Compare with a row of sliders, the contact brush.",
    "normal_loss_w": "The normal contact delivers {:.2g} % of the power put in: the step is too coarse. Halve it.",
    "damping_loss_w": "The damping delivers {:.2g} % of the power put in: the step is too coarse. Halve it.",
    "dielectric_loss_w": "The dielectric delivers {:.2g} % of the power put in: the step is too coarse. Halve it.",
}


def delivering(outcomes: Iterable[Mapping[str, float]]) -> tuple[str, ...]:
    """Return a sentence for each loss that is negative at one of several points, with its largest share."""
    largest = dict.fromkeys(_GAINS, GAIN)
    for outcome in outcomes:
        put_in = max(outcome["power_a_w"] + outcome["power_b_w"], 0.0) + max(-outcome["shaft_power_w"], 0.0)
        for name in _GAINS:
            if -outcome[name] > largest[name] * put_in > 0.0:
                largest[name] = -outcome[name] / put_in
    return tuple(_GAINS[name].format(100.0 * share) for name, share in largest.items() if share > GAIN)
