# SPDX-License-Identifier: GPL-3.0-or-later
"""One transient run of a motor: from a drive and a load to verified waveforms with their energy balance."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, sqrt
from time import monotonic
from typing import Any

import numpy as np

from pyspice_runner.analysis.audit import FEWEST_POINTS_PER_PERIOD, audit_run, withhold
from pyspice_runner.analysis.waveforms import COLUMNS, Array, EnergyBalance, Waveforms
from pyspice_runner.engine.ngspice import Result, ngspice_version
from pyspice_runner.engine.pyspice import BatchSimulator
from pyspice_runner.errors import Interrupted, ParameterError, SimulationError
from pyspice_runner.model import contact as contact_law
from pyspice_runner.model.drive import Drive, check_shaft
from pyspice_runner.model.motor import Motor
from pyspice_runner.model.parameters import Mode
from pyspice_runner.model.refusal import checked
from pyspice_runner.netlist.benches import plate_voltages, transient_bench, transient_options
from pyspice_runner.netlist.contact import SLIDERS, ContactLaw, check_law, contact_library
from pyspice_runner.netlist.motor import Discretisation, dielectric_resistance

# The error of the trapezoidal rule with modes exact at resonance falls with the square of the step; with this many
# points a period of the fastest motion it is below 0.1 % of the tip's motion at all reference points of the tests.
POINTS_PER_PERIOD = 128
MOST_POINTS = 20_000_000  # to record; 4 GB of vectors, or 160 MB a signal
LEAST_ACCURACY, MOST_ACCURACY = 1e-4, 0.05  # finer, Newton's iteration counts; coarser, the order is lost
_USUAL_ERROR = 5e-4  # at POINTS_PER_PERIOD; more than at nearly all reference points of the tests
_DECAYS, _FEWEST_PERIODS = 3.0, 20  # of the slowest mode, of the drive: over which the error is estimated
_MOST_TRIALS = 5
_FEWEST_KEPT = 10  # points of an interrupted run; fewer show nothing
VECTORS: dict[str, tuple[str, ...]] = {
    "time_s": (),
    "voltage_a_v": ("v(a)",),
    "voltage_b_v": ("v(b)",),
    "current_a_a": ("i(va)",),
    "current_b_a": ("i(vb)",),
    "tip_x_m": ("v(xmotor.x)",),
    "tip_y_m": ("v(xmotor.y)",),
    "normal_force_n": ("v(xmotor.normal)",),
    "friction_force_n": ("v(xmotor.friction)",),
    "contact_displacement_m": ("v(xmotor.slider)", "v(xmotor.xcontact.delta)"),
    "contact_state": ("v(xmotor.state)",),
    "rotor_speed_rad_s": ("v(shaft)",),
}


_OF_CONTACT = ("xmotor.normal", "xmotor.friction", "xmotor.slider", "xmotor.state", "xmotor.xcontact.delta")


@checked
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
    accuracy: float | None = None,
    exact_resonance: bool = True,
    signals: Sequence[str] | None = None,
    record_from: float = 0.0,
    record_every: int = 1,
    progress: Callable[[float, float], object] | None = None,
    timeout: float | None = None,
    audit: bool = True,
) -> Waveforms:
    """Run a motor from its preloaded operating point, at rest, the drive coming on at t = 0.

    Memory grows with what is recorded, not with the duration: ``signals``, ``record_from`` and ``record_every`` say
    what. All signals at every step are needed for the energy balance and the audit, and are the default.

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
        step: uniform time step in s; by default the shortest period present over :data:`POINTS_PER_PERIOD`, or what the
            accuracy asks for.
        accuracy: error allowed of the tip's trajectory, RMS relative to its motion, such as 0.005. The step is chosen
            so that :attr:`Waveforms.error_estimate` stays below it; a given step that is too coarse for it is refused.
        exact_resonance: write the modes so that the trapezoidal rule resonates where they do
            (:class:`~pyspice_runner.netlist.motor.Discretisation`).
        signals: columns to record beside the time; by default all.
        record_from: time in s from which on points are recorded: for a look at the end of a long run.
        record_every: number of steps from one recorded point to the next.
        progress: called some times a second with the part that is done, 0 to 1, and the seconds that are left.
        timeout: wall time in s after which the run is ended.
        audit: whether a run that fails the physical audit (:mod:`.audit`) is an error. If not, ``provenance["audit"]``
            has what was found.

    Raises:
        ParameterError: for a value that is refused.
        SimulationError: if ngspice fails or its result cannot be trusted.
        Interrupted: when interrupted; ``partial`` has what was done, marked as not complete.
    """
    check_law(contact)
    if contact:
        contact_library(contact, sliders)
    shortest = shortest_period(motor, drive, contact=contact is not None)
    given = step
    if step is None:
        step = shortest / (POINTS_PER_PERIOD if accuracy is None else points_per_period(accuracy))
    _check_run(motor, duration, speed, load_torque, step, shortest)
    _check_recording(signals, record_from, record_every, duration, step)
    settings: dict[str, Any] = {
        "contact": contact, "sliders": sliders, "speed": speed, "load_torque": load_torque,
        "exact_resonance": exact_resonance, "timeout": timeout,
    }  # fmt: skip
    estimate = None
    if accuracy is not None:
        step, estimate = _step_for(motor, drive, accuracy, step, duration, shortest, given is not None, settings)
        _check_run(motor, duration, speed, load_torque, step, shortest)
    discretisation = Discretisation(step, exact_resonance)
    simulator = transient_simulator(
        motor, drive, contact=contact, sliders=sliders, speed=speed, load_torque=load_torque,
        discretisation=discretisation, timeout=timeout, signals=signals,
    )  # fmt: skip
    timing = {
        "step_time": step, "end_time": duration, "start_time": record_from, "max_time": step,
        "use_initial_condition": True,
    }  # fmt: skip
    deck = str(simulator.prepare("transient", **timing))
    recording = Recording(motor, drive, contact is not None, speed, load_torque, discretisation, record_from == 0.0)
    balanced = signals is None and record_every == 1

    def waveforms(result: Result, *, complete: bool) -> Waveforms:
        vectors = result.raw.vectors if record_every == 1 else result.raw.thinned(record_every)
        samples = {name: _real(values) for name, values in vectors.items()}
        waves = recording.columns(samples, COLUMNS if signals is None else signals)
        energy: EnergyBalance | None = None
        findings: tuple[str, ...] = ()
        if balanced:
            energy = recording.energy(waves, samples)
            findings = audit_run(
                motor, waves, missing_j=energy.missing, from_load_j=max(-energy.load, 0.0), step=step,
                contact=contact is not None,
            )  # fmt: skip
            if audit and complete:
                withhold(findings, "run")
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
                "accuracy": accuracy,
                "record_from_s": record_from,
                "record_every": record_every,
            },
            "deck_sha256": hashlib.sha256(deck.encode()).hexdigest(),
            "audit": {"passed": not findings if balanced else None, "findings": list(findings)},
        }
        arrays: dict[str, Any] = {name: waves.get(name) for name in COLUMNS}
        return Waveforms(
            **arrays,
            energy=energy,  # type: ignore[arg-type]
            drive_period_s=drive.period,
            rotor_radius_m=motor.rotor.radius_m,
            solver_seconds=result.seconds,
            ngspice_version=ngspice_version(),
            provenance=provenance,
            deck=deck,
            error_estimate=estimate,
            complete=complete,
        )

    try:
        result = simulator.verified(
            "transient", progress=_telling(progress, duration) if progress else None, keep_partial=True, **timing
        )
    except Interrupted as interrupt:
        if interrupt.partial.raw.points < _FEWEST_KEPT:
            raise KeyboardInterrupt from None
        partial = waveforms(interrupt.partial, complete=False)
        reached = f"The run was interrupted at {partial.time_s[-1]:.4g} of {duration:g} s."
        raise Interrupted(reached, partial) from None
    return waveforms(result, complete=True)


def points_per_period(accuracy: float) -> float:
    """Return the points a period of the fastest motion to begin with for an accuracy.

    The error falls with their square.

    Raises:
        ParameterError: for an accuracy that is refused.
    """
    if not LEAST_ACCURACY <= accuracy <= MOST_ACCURACY:
        raise ParameterError(
            f"accuracy = {accuracy:g} is refused; allowed is a relative error from {LEAST_ACCURACY:g} to "
            f"{MOST_ACCURACY:g} of the tip's motion."
        )
    return max(POINTS_PER_PERIOD * sqrt(_USUAL_ERROR / accuracy), 2.0 * FEWEST_POINTS_PER_PERIOD)


def _step_for(
    motor: Motor,
    drive: Drive,
    accuracy: float,
    step: float,
    duration: float,
    shortest: float,
    given: bool,
    settings: dict[str, Any],
) -> tuple[float, float]:
    """Return a step whose estimated error is below the accuracy, and the estimate.

    The trajectory is compared with that of twice the step over a window in which the motion settles. The error is of
    second order, so that a third of their distance is the error of the finer one.
    """
    settling = _DECAYS * max(2.0 * mode.mass_kg / mode.damping_n_s_per_m for mode in motor.modes)
    window = min(duration, max(settling, _FEWEST_PERIODS * drive.period))

    def tip(h: float) -> Waveforms:
        run = {**settings, "step": h, "signals": ("tip_x_m", "tip_y_m")}
        return simulate(motor, drive, duration=max(window, 10.0 * h), **run)

    coarsest = shortest / FEWEST_POINTS_PER_PERIOD
    for _ in range(_MOST_TRIALS):
        if 2.0 * step > coarsest:
            step = 0.5 * coarsest
        estimate = _distance(tip(step), tip(2.0 * step)) / 3.0
        if estimate <= accuracy:
            return step, estimate
        finer = step * max(0.9 * sqrt(accuracy / estimate), 0.25)
        if given:
            raise ParameterError(
                f"step = {step:g} s is too coarse for accuracy = {accuracy:g}: its error is some {estimate:.2g}. "
                f"Allowed is about {finer:.2g} s; leave the step out, and it is chosen."
            )
        step = finer
    raise SimulationError(
        f"No step down to {step / 0.9:.2g} s reached accuracy = {accuracy:g}; the last error was some {estimate:.2g}. "
        "The motion is likely chaotic: then only averages can be accurate. Run it with a step of your own."
    )


def _distance(fine: Waveforms, coarse: Waveforms) -> float:
    """Return the RMS distance of two tips over the RMS of the motion."""
    from scipy.interpolate import CubicSpline

    time = fine.time_s[fine.time_s <= coarse.time_s[-1]]
    away, motion = 0.0, 0.0
    for name in ("tip_x_m", "tip_y_m"):
        ours = getattr(fine, name)[: len(time)]
        away += float(np.mean((ours - CubicSpline(coarse.time_s, getattr(coarse, name))(time)) ** 2))
        motion += float(np.var(ours))
    return sqrt(away / motion) if motion > 0.0 else 0.0


def _telling(progress: Callable[[float, float], object], duration: float) -> Callable[[float], None]:
    """Return what turns the time that a run has reached into the part that is done, and the seconds left."""
    began = monotonic()

    def tell(reached: float) -> None:
        done = min(reached / duration, 1.0)
        if done > 0.0:
            progress(done, (monotonic() - began) * (1.0 - done) / done)

    return tell


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
    signals: Sequence[str] | None = None,
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
    simulator.options(**transient_options(motor, contact))
    simulator.initial_condition(**{node: value for node, value in plate_voltages(drive).items() if value})
    vectors = [vector for name in (COLUMNS if signals is None else signals) for vector in VECTORS[name]]
    if signals is None:
        for index in range(1, len(motor.modes) + 1):
            vectors += [f"i(v.xmotor.xmode{index}.vvelocity)", f"v(xmotor.xmode{index}.elastic)"]
    simulator.save(*(vector for vector in vectors if contact or vector[2:-1] not in _OF_CONTACT))
    return simulator


def _check_run(
    motor: Motor,
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
    check_shaft(motor, speed, load_torque)


def _check_recording(
    signals: Sequence[str] | None, record_from: float, record_every: int, duration: float, step: float
) -> None:
    for name in signals or ():
        if name not in COLUMNS:
            raise ParameterError(f"signals: {name!r} is refused; allowed are {', '.join(COLUMNS)}.")
    last = duration - 10.0 * step * record_every
    if record_every < 1 or last < 0.0:
        raise ParameterError(
            f"record_every = {record_every} is refused; allowed is a whole number of steps from 1 to "
            f"{int(duration / (10.0 * step))}."
        )
    if not 0.0 <= record_from <= last:
        raise ParameterError(
            f"record_from = {record_from:g} s is refused; allowed is from 0 to ten points before the end, {last:.6g} s."
        )
    points = (duration - record_from) / (step * record_every)
    if points > MOST_POINTS:
        raise ParameterError(
            f"duration = {duration:g} s records {points:.3g} points; at most {MOST_POINTS:.0e} fit in memory. Shorten "
            "it, or record less: record_from for its end, record_every for fewer points."
        )


def _real(values: np.ndarray[Any, Any]) -> Array:
    return np.asarray(values, dtype=float)


@dataclass(frozen=True)
class Recording:
    """What a run's vectors mean.

    Attributes:
        motor: the motor.
        drive: the two voltages.
        contact: whether the tip touches a rotor.
        speed: at which the shaft is held, rad/s.
        load_torque: drawn from the shaft, N·m.
        discretisation: of the modes.
        started: whether it begins with the start, of which ngspice writes no point; the known state is put in front.
    """

    motor: Motor
    drive: Drive
    contact: bool
    speed: float | None
    load_torque: float
    discretisation: Discretisation
    started: bool

    def columns(self, samples: Mapping[str, Array], names: Iterable[str]) -> dict[str, Array]:
        """Return time and columns in SI units; each is the one copy that is made of the raw file's vector."""
        voltage_a, voltage_b = self.drive.initial_voltages()
        deflection = sum(self._preload * mode.tip_y**2 / self._stiffness(mode) for mode in self.motor.modes)
        first = {
            "voltage_a_v": voltage_a,
            "voltage_b_v": voltage_b,
            "tip_x_m": self._sway,
            "tip_y_m": -deflection,
            "normal_force_n": self._preload,
            "contact_state": 1.0 if self.contact else 0.0,
            "rotor_speed_rad_s": self.speed or 0.0,
        }
        scale = {"current_a_a": -1.0, "current_b_a": -1.0} | dict.fromkeys(
            ("tip_x_m", "tip_y_m", "contact_displacement_m"), 1e-6
        )
        columns = {"time_s": self._after(0.0, samples["time"])}
        for name in names:
            if name == "time_s":
                continue
            vector = samples.get(VECTORS[name][0])
            if vector is None:  # of a contact, and there is none
                columns[name] = np.zeros(len(columns["time_s"]))
                continue
            start = first.get(name, -vector[0] if name.startswith("current") else 0.0)
            columns[name] = self._after(start, vector, scale.get(name, 1.0))
            if name == "contact_displacement_m":
                # while it slips, the slider's node stands above its limit by the slip velocity times half a step
                limit = contact_law.limit_ratio(self.motor.contact) * self._penetration(samples)
                np.clip(columns[name], -limit, limit, out=columns[name])
        return columns

    def energy(self, waves: Mapping[str, Array], samples: Mapping[str, Array]) -> EnergyBalance:
        """Balance the run by the physical parameters, not by those that the step asked for in the netlist."""
        modal = self._modal(samples)
        return _energy(self.motor, waves, self._penetration(samples), modal, self._sway, self.speed, self.load_torque)

    @property
    def _sway(self) -> float:
        """Sideways displacement in m of the tip under the preload, where the rotor's crown stands."""
        softened = [mode.model_copy(update={"stiffness_n_per_m": self._stiffness(mode)}) for mode in self.motor.modes]
        return contact_law.static_sway(self.motor.contact, tuple(softened)) if self.contact else 0.0

    @property
    def _preload(self) -> float:
        return self.motor.contact.preload_n if self.contact else 0.0

    def _stiffness(self, mode: Mode) -> float:
        return self.discretisation.mode(mode)[1]

    def _after(self, start: float, values: Array, scale: float = 1.0) -> Array:
        """Return a vector, scaled, behind its value at the start if that is recorded."""
        column = np.empty(len(values) + self.started)
        column[:1] = start
        np.multiply(values, scale, out=column[int(self.started) :])
        return column

    def _penetration(self, samples: Mapping[str, Array]) -> Array:
        """Return the penetration in m, 0 where the contact is open."""
        if not self.contact:
            return np.zeros(len(samples["time"]) + self.started)
        start = contact_law.static_penetration(self.motor.contact)
        depth = self._after(start, samples["v(xmotor.xcontact.delta)"], 1e-6)
        return np.maximum(depth, 0.0, out=depth)

    def _modal(self, samples: Mapping[str, Array]) -> tuple[Array, Array]:
        """Return displacement (m) and velocity (m/s) of every mode, shape (modes, points)."""
        displacement, velocity = [], []
        for index, mode in enumerate(self.motor.modes, start=1):
            stiffness = self._stiffness(mode)
            elastic = samples[f"v(xmotor.xmode{index}.elastic)"]
            displacement.append(self._after(-mode.tip_y * self._preload / stiffness, elastic, 1.0 / stiffness))
            velocity.append(self._after(0.0, samples[f"i(v.xmotor.xmode{index}.vvelocity)"]))
        return np.array(displacement), np.array(velocity)


def _energy(
    motor: Motor,
    waves: Mapping[str, Array],
    penetration: Array,
    modal: tuple[Array, Array],
    sway: float,
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
        resistance = dielectric_resistance(motor, group)
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
    sine = (waves["tip_x_m"] - sway) / (radius - penetration)
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
        # a held speed does not change but for the rounding of its digits
        rotor=change(0.5 * motor.rotor.inertia_kg_m2 * rotor_speed**2) if speed is None else 0.0,
        bearing=work(bearing * rotor_speed),
        load=work((torque - bearing) * rotor_speed) if speed is not None else work(load_torque * rotor_speed),
    )
