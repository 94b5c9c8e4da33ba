# SPDX-License-Identifier: GPL-3.0-or-later
"""One transient run of a motor: from a drive and a load to verified waveforms with their energy balance."""

from __future__ import annotations

import hashlib
from math import isfinite, pi
from typing import Any

import numpy as np

from pyspice_runner.analysis.audit import FEWEST_POINTS_PER_PERIOD, audit_run
from pyspice_runner.analysis.waveforms import Array, EnergyBalance, Waveforms
from pyspice_runner.engine.ngspice import ngspice_version
from pyspice_runner.engine.pyspice import BatchSimulator
from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.model import contact as contact_law
from pyspice_runner.model.drive import Drive
from pyspice_runner.model.motor import Motor
from pyspice_runner.netlist.benches import TRANSIENT_OPTIONS, plate_voltages, transient_bench
from pyspice_runner.netlist.contact import SLIDERS, ContactLaw, check_law, contact_library
from pyspice_runner.netlist.motor import Discretisation

# The error of the trapezoidal rule with modes exact at resonance falls with the square of the step; with this many
# points a period of the fastest motion it is below 0.1 % of the tip's motion at all reference points of the tests.
POINTS_PER_PERIOD = 128
MOST_POINTS = 20_000_000  # 4 GB of vectors


def simulate(
    motor: Motor,
    drive: Drive,
    *,
    duration: float,
    contact: ContactLaw | None = "spring-slider",
    sliders: int = SLIDERS,
    speed: float | None = None,
    load_torque: float = 0.0,
    step: float | None = None,
    exact_resonance: bool = True,
    timeout: float | None = None,
    audit: bool = True,
) -> Waveforms:
    """Run a motor from its preloaded operating point, at rest, the drive coming on at t = 0.

    Args:
        motor: the motor.
        drive: the voltages of both groups.
        duration: simulated time in s.
        contact: law of the contact: ``"spring-slider"``, the paper's; ``"brush"``, which slips from the edge inwards;
            ``"coulomb"``, without a spring along the tangent; ``None`` for a free tip, which starts from r = 0.
        sliders: number of sliders of the brush.
        speed: if given, the shaft is held at this speed, rad/s.
        load_torque: torque in N·m that a load draws from the free shaft, whatever its speed; against the positive
            direction when positive.
        step: uniform time step in s; by default the shortest period present over :data:`POINTS_PER_PERIOD`.
        exact_resonance: write the modes so that the trapezoidal rule resonates where they do
            (:class:`~pyspice_runner.netlist.motor.Discretisation`).
        timeout: wall time in s after which the run is ended.
        audit: whether a run that fails the physical audit (:mod:`.audit`) is an error. If not, ``provenance["audit"]``
            has what was found.

    Raises:
        ParameterError: for a value that is refused.
        SimulationError: if ngspice fails or its result cannot be trusted.
    """
    check_law(contact)
    if contact:
        contact_library(contact, sliders)
    shortest = shortest_period(motor, drive, contact=contact is not None)
    step = shortest / POINTS_PER_PERIOD if step is None else step
    _check_run(duration, speed, load_torque, step, shortest)
    discretisation = Discretisation(step, exact_resonance)
    simulator = transient_simulator(
        motor, drive, contact=contact, sliders=sliders, speed=speed, load_torque=load_torque,
        discretisation=discretisation, timeout=timeout,
    )  # fmt: skip
    deck = str(simulator.prepare("transient", **_transient_arguments(step, duration)))
    simulator.transient(**_transient_arguments(step, duration))
    assert simulator.result is not None
    samples = {name: _real(values) for name, values in simulator.result.raw.vectors.items()}
    waves = _columns(motor, drive, samples, contact is not None, speed, discretisation)
    energy = _energy(
        motor,
        waves,
        _penetration(motor, samples, contact is not None),
        _modal(motor, samples, discretisation, contact is not None),
        speed,
        load_torque,
    )
    from_load, touching = max(-energy.load, 0.0), contact is not None
    findings = audit_run(motor, waves, missing_j=energy.missing, from_load_j=from_load, step=step, contact=touching)
    if findings and audit:
        raise SimulationError(f"{' '.join(findings)} The run is withheld; audit = False gives it, marked.")
    provenance: dict[str, Any] = {
        "motor": motor.to_dict(),
        "drive": {"kind": type(drive).__name__, "label": drive.label, **drive.model_dump()},
        "run": {
            "duration_s": duration,
            "contact": contact,
            **({"sliders": sliders} if contact == "brush" else {}),
            "speed_rad_s": speed,
            "load_torque_n_m": load_torque,
            "step_s": step,
            "exact_resonance": exact_resonance,
        },
        "deck_sha256": hashlib.sha256(deck.encode()).hexdigest(),
        "audit": {"passed": not findings, "findings": list(findings)},
    }
    return Waveforms(
        **waves,
        energy=energy,
        drive_period_s=drive.period,
        rotor_radius_m=motor.rotor.radius_m,
        solver_seconds=simulator.result.seconds,
        ngspice_version=ngspice_version(),
        provenance=provenance,
        deck=deck,
    )


def shortest_period(motor: Motor, drive: Drive, *, contact: bool) -> float:
    """Return the period in s of the fastest motion present: modes, free and under preload, or the drive."""
    frequencies = [*drive.frequencies, *(mode.frequency_hz for mode in motor.modes)]
    if contact:
        frequencies += contact_law.linearised_resonances(motor.contact, motor.modes, motor.rotor).tolist()
    return 1.0 / max(frequencies)


def transient_simulator(
    motor: Motor,
    drive: Drive,
    *,
    contact: ContactLaw | None = "spring-slider",
    sliders: int = SLIDERS,
    speed: float | None = None,
    load_torque: float = 0.0,
    discretisation: Discretisation | None = None,
    timeout: float | None = None,
    title: str = "",
) -> BatchSimulator:
    """Return the PySpice simulator of a run, ready for ``.transient()``: bench, options, start and saved vectors."""
    circuit = transient_bench(
        motor,
        drive,
        contact=contact,
        sliders=sliders,
        speed=speed,
        load_torque=load_torque,
        discretisation=discretisation,
        title=title,
    )
    simulator = BatchSimulator(circuit, timeout=timeout)
    simulator.options(**TRANSIENT_OPTIONS)
    simulator.initial_condition(**{node: value for node, value in plate_voltages(drive).items() if value})
    simulator.save("v(a)", "v(b)", "i(va)", "i(vb)", "v(xmotor.x)", "v(xmotor.y)", "v(shaft)")
    if contact:
        simulator.save(*(f"v(xmotor.{name})" for name in ("normal", "friction", "slider", "state", "xcontact.delta")))
    for index in range(1, len(motor.modes) + 1):
        simulator.save(f"i(v.xmotor.xmode{index}.vvelocity)", f"v(xmotor.xmode{index}.elastic)")
    return simulator


def _transient_arguments(step: float, duration: float) -> dict[str, Any]:
    return {"step_time": step, "end_time": duration, "max_time": step, "use_initial_condition": True}


def _check_run(
    duration: float,
    speed: float | None,
    load_torque: float,
    step: float,
    shortest: float,
) -> None:
    for name, value, unit in (("duration", duration, "s"), ("step", step, "s")):
        if not (isfinite(value) and value > 0.0):
            raise ParameterError(f"{name} = {value:g} {unit} is refused; allowed is a number > 0 {unit}.")
    coarsest = shortest / FEWEST_POINTS_PER_PERIOD
    if step > coarsest:
        raise ParameterError(
            f"step = {step:g} s is too coarse for a motion of {1.0 / shortest:.4g} Hz; allowed is ≤ {coarsest:.3g} s."
        )
    if duration < 10.0 * step:
        raise ParameterError(
            f"duration = {duration:g} s is shorter than ten steps of {step:g} s; give at least {10 * step:.3g} s."
        )
    if duration / step > MOST_POINTS:
        raise ParameterError(
            f"duration = {duration:g} s takes {duration / step:.3g} steps of {step:.3g} s; at most "
            f"{MOST_POINTS:.0e} fit in memory, so shorten it."
        )
    if speed is not None and not abs(speed) <= 1e6:
        raise ParameterError(f"speed = {speed:g} rad/s is refused; allowed is a number from -1e6 to 1e6 rad/s.")
    if not abs(load_torque) <= 1e6:
        raise ParameterError(f"load_torque = {load_torque:g} N·m is refused; allowed is a number from -1e6 to 1e6 N·m.")
    if speed is not None and load_torque:
        raise ParameterError(
            "speed and load_torque exclude each other: a shaft held at a speed takes any torque. Give one."
        )


def _real(values: np.ndarray[Any, Any]) -> Array:
    return np.asarray(values, dtype=float)


def _columns(
    motor: Motor,
    drive: Drive,
    samples: dict[str, Array],
    contact: bool,
    speed: float | None,
    discretisation: Discretisation,
) -> dict[str, Array]:
    """Return the columns in SI units, the known state at t = 0 put in front (ngspice writes none with ``uic``)."""
    preload = motor.contact.preload_n if contact else 0.0
    deflection = sum(preload * mode.tip_y**2 / discretisation.mode(mode)[1] for mode in motor.modes)
    voltage_a, voltage_b = drive.initial_voltages()
    zero = np.zeros_like(samples["time"])
    normal = samples.get("v(xmotor.normal)", zero)
    # while it slips, the slider's node stands above its limit by the slip velocity times half a step
    limit = contact_law.limit_ratio(motor.contact) * _penetration(motor, samples, contact)[1:]

    def after(start: float, values: Array) -> Array:
        return np.concatenate(([start], values))

    return {
        "time_s": after(0.0, samples["time"]),
        "voltage_a_v": after(voltage_a, samples["v(a)"]),
        "voltage_b_v": after(voltage_b, samples["v(b)"]),
        "current_a_a": after(-samples["i(va)"][0], -samples["i(va)"]),
        "current_b_a": after(-samples["i(vb)"][0], -samples["i(vb)"]),
        "tip_x_m": after(0.0, 1e-6 * samples["v(xmotor.x)"]),
        "tip_y_m": after(-deflection, 1e-6 * samples["v(xmotor.y)"]),
        "normal_force_n": after(preload, normal),
        "friction_force_n": after(0.0, samples.get("v(xmotor.friction)", zero)),
        "contact_displacement_m": after(0.0, np.clip(1e-6 * samples.get("v(xmotor.slider)", zero), -limit, limit)),
        "contact_state": after(1.0 if contact else 0.0, samples.get("v(xmotor.state)", zero)),
        "rotor_speed_rad_s": after(speed or 0.0, samples["v(shaft)"]),
    }


def _penetration(motor: Motor, samples: dict[str, Array], contact: bool) -> Array:
    """Return the penetration in m, 0 where the contact is open, with the start in front."""
    if not contact:
        return np.zeros(len(samples["time"]) + 1)
    depth = np.maximum(1e-6 * samples["v(xmotor.xcontact.delta)"], 0.0)
    return np.concatenate(([contact_law.static_penetration(motor.contact)], depth))


def _modal(
    motor: Motor, samples: dict[str, Array], discretisation: Discretisation, contact: bool
) -> tuple[Array, Array]:
    """Return displacement (m) and velocity (m/s) of every mode, shape (modes, points), with the start in front."""
    preload = motor.contact.preload_n if contact else 0.0
    displacement, velocity = [], []
    for index, mode in enumerate(motor.modes, start=1):
        stiffness = discretisation.mode(mode)[1]
        elastic = samples[f"v(xmotor.xmode{index}.elastic)"] / stiffness
        displacement.append(np.concatenate(([-mode.tip_y * preload / stiffness], elastic)))
        velocity.append(np.concatenate(([0.0], samples[f"i(v.xmotor.xmode{index}.vvelocity)"])))
    return np.array(displacement), np.array(velocity)


def _energy(
    motor: Motor,
    waves: dict[str, Array],
    penetration: Array,
    modal: tuple[Array, Array],
    speed: float | None,
    load_torque: float,
) -> EnergyBalance:
    """Balance the run by the physical parameters, not by those that the step asked for in the netlist."""
    time = waves["time_s"]
    displacement, velocity = modal
    tip_vx = sum(mode.tip_x * v for mode, v in zip(motor.modes, velocity, strict=True))
    tip_vy = sum(mode.tip_y * v for mode, v in zip(motor.modes, velocity, strict=True))

    def work(power: Array) -> float:
        return float(np.trapezoid(power, time))

    def change(stored: Array) -> float:
        return float(stored[-1] - stored[0])

    dielectric = 0.0
    for group, capacitance in (("a", motor.piezo.capacitance_a_f), ("b", motor.piezo.capacitance_b_f)):
        resistance = motor.piezo.loss_tangent / (2.0 * pi * motor.piezo.loss_reference_hz * capacitance)
        motional = sum(
            getattr(mode, f"coupling_{group}_n_per_v") * v for mode, v in zip(motor.modes, velocity, strict=True)
        )
        charging = waves[f"current_{group}_a"] - motional
        plate = waves[f"voltage_{group}_v"] - resistance * charging
        dielectric += change(0.5 * capacitance * plate**2) + work(resistance * charging**2)

    masses = np.array([mode.mass_kg for mode in motor.modes])
    stiffnesses = np.array([mode.stiffness_n_per_m for mode in motor.modes])
    dampings = np.array([mode.damping_n_s_per_m for mode in motor.modes])
    normal, friction, rotor_speed = (
        waves["normal_force_n"],
        waves["friction_force_n"],
        waves["rotor_speed_rad_s"],
    )
    hertz = motor.contact.normal_stiffness_n_per_m15 * penetration**1.5
    radius = motor.rotor.radius_m
    sine = waves["tip_x_m"] / (radius - penetration)
    tangential = tip_vx * np.sqrt(1.0 - sine**2) + tip_vy * sine
    torque = radius * friction
    bearing = motor.rotor.bearing_damping_n_m_s * rotor_speed
    return EnergyBalance(
        electrical=work(waves["voltage_a_v"] * waves["current_a_a"] + waves["voltage_b_v"] * waves["current_b_a"]),
        dielectric=dielectric,
        kinetic=change(0.5 * masses @ velocity**2),
        elastic=change(0.5 * stiffnesses @ displacement**2),
        damping=work(dampings @ velocity**2),
        contact_elastic=change(0.4 * hertz * penetration),
        contact_damping=float(np.trapezoid(normal - hertz, penetration)),
        friction=work(friction * (tangential - radius * rotor_speed)),
        rotor=change(0.5 * motor.rotor.inertia_kg_m2 * rotor_speed**2),
        bearing=work(bearing * rotor_speed),
        load=work((torque - bearing) * rotor_speed) if speed is not None else work(load_torque * rotor_speed),
    )
