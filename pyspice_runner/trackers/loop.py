# SPDX-License-Identifier: GPL-3.0-or-later
r"""Loop gain of a phase-locked loop: in front of a resonator alone, and of the running motor with driver and network.

A small modulation of the oscillator frequency gives the stage voltages side bands above and below the drive frequency.
Network and motor answer to these. The motor is the full one about its steady state: a voltage at one side band draws a
current at both, by the hot admittance and its image (:mod:`.small_signals`). The tracker subtracts the current of its
copies of the clamped capacitances at both side bands. The phase of the difference against the force changes by

.. math::
    \\delta\\varphi = \\frac{m_+}{M} + \\frac{m_-}{M^*} - \\frac{f_+}{F} - \\frac{f_-}{F^*}

with the phasors M and F of both, and the coefficients m, f of :math:`e^{j(\\omega\\pm\\Omega)t}` that the modulation
:math:`e^{j\\omega t}` adds to the current and to the force. On a feedback electrode the current is the
rate of the charge there.

The detector compares rising edges. Behind a bridge the force has harmonics, which move its edge and change its slope
there, less by the low-pass filters in front of the detector. They follow the oscillator: a phase shift ψ of the
oscillator shifts the harmonic k by kψ. The response of the network to the fundamental has no effect on that.
"""

from __future__ import annotations

from cmath import phase
from collections.abc import Mapping
from dataclasses import asdict, astuple, dataclass, field
from math import degrees, pi
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from pyspice_runner.circuit.source import GROUPS
from pyspice_runner.drivers.design import network_of
from pyspice_runner.errors import ParameterError
from pyspice_runner.motor import groups
from pyspice_runner.motor.drive import TwoPhaseDrive, two_phasors
from pyspice_runner.motor.motor import Motor
from pyspice_runner.result import Result, json_ready
from pyspice_runner.run.point import Point
from pyspice_runner.run.waveforms import Array
from pyspice_runner.steady.small_signals import HIGHEST, cold_admittance, linearised, loop_margins
from pyspice_runner.trackers import tracker as parts
from pyspice_runner.trackers.tracker import LoopFilter, TrackedSource, Tracker
from pyspice_runner.units import engineering

POINTS_PER_DECADE = 100
SWEPT_DECADES = 2  # swept to either side of the bandwidth


@dataclass(frozen=True)
class LoopDesign(Result):
    """Loop gain and stability margin of a tracker: crossover and margin are the worst of several."""

    loop_filter: LoopFilter  # the filter
    crossover_hz: float  # frequency at which the loop gain is 1
    phase_margin_deg: float  # phase of the loop gain there, above −180°
    frequency_hz: Array = field(repr=False)  # frequencies
    gain: NDArray[np.complex128] = field(repr=False)  # loop gain at them
    margin_error_deg: float | None = None  # estimated error of the margin; of a running motor
    sensed_phase_deg: float | None = None  # of the sensed motional current ahead of the force; of a running motor

    def to_dict(self) -> dict[str, Any]:
        """Return filter, crossover and margin, JSON-ready."""
        found: dict[str, Any] = json_ready(asdict(self))
        return {"filter": found.pop("loop_filter"), **found}

    def columns(self) -> dict[str, Array]:
        """Return the loop gain over frequency."""
        return {"frequency_hz": self.frequency_hz, "loop_gain_re": self.gain.real, "loop_gain_im": self.gain.imag}

    def summary(self) -> dict[str, str]:
        """Return filter, crossover and margin."""
        margins = {"crossover": f"{self.crossover_hz:.4g} Hz", "phase margin": f"{self.phase_margin_deg:.1f}°"}
        return {"loop filter": ", ".join(map(engineering, astuple(self.loop_filter), ("Ω", "F", "F")))} | margins


def phase_shown_deg(
    frequency_hz: Array, gain: NDArray[np.complex128], crossover_hz: float, phase_margin_deg: float
) -> Array:
    """Return the continuous phase of a loop gain over frequency, which is the margin − 180° at the crossover."""
    phase = np.degrees(np.unwrap(np.angle(gain)))
    off = np.interp(crossover_hz, frequency_hz, phase) - (phase_margin_deg - 180.0)
    return np.asarray(phase - 360.0 * np.round(off / 360.0))


def loop_design(motor: Motor, tracker: Tracker, *, mode: int | None = None, contact: bool = True) -> LoopDesign:
    """Return the loop gain of a phase-locked loop in front of a resonator alone, for which its filter is designed.

    The arguments are those of :func:`.control_loop`. Raise ParameterError for a tracker that is no phase-locked loop,
    SimulationError if the loop gain does not cross 1 near the bandwidth.
    """
    if tracker.kind != "pll":
        raise ParameterError(f"The tracker {tracker.kind!r} has no loop gain; take a pll.")
    lag = parts.running_resonance(motor, tracker, mode=mode, contact=contact)
    loop_filter = parts.propose_filter(tracker, lag)
    frequency = swept_hz(tracker)
    gain = tracker.polarity * parts.loop_gain(tracker, lag, loop_filter, frequency)
    return LoopDesign(loop_filter, *loop_margins(frequency, gain)[:2], frequency, gain)


def swept_hz(tracker: Tracker) -> Array:
    """Return the frequencies in Hz to either side of the bandwidth."""
    steps = 2 * SWEPT_DECADES * POINTS_PER_DECADE + 1
    return np.asarray(tracker.bandwidth_hz * np.logspace(-SWEPT_DECADES, SWEPT_DECADES, steps))


Complex = NDArray[np.complex128]
Answers = tuple[Complex, Complex, Array]  # as of :func:`_running`, for currents and electrode

POINTS = 33  # modulations; a crossover is within 0.1 % of that by 81
OFFSETS = 16  # of the points about which the motor is linearised
REACH = 4.0  # from the bandwidth to the lowest and to the highest frequency
EDGE_STEPS = 20  # of Newton's method


def running_loop(known: Motor, source: TrackedSource, point: Point, force: Complex | None = None) -> LoopDesign:
    """Return the loop gain of a phase-locked loop at a running motor.

    Args:
        known: the motor as the tracker knows it.
        source: the tracker.
        point: the steady state at which it keeps the motor: at its temperature and preload, with the fundamentals at
            the pins, at the speed of a held shaft or of one that still accelerates, or under the load of a settled one.
        force: phasors of the harmonics of the sensed force from the first on, V; by default the pins have none.

    Raises:
        SimulationError: if there is no stable steady state, or the loop gain does not cross 1 near the bandwidth.
    """
    tracker, drive = source.tracker, point.drive
    lowest, highest = tracker.bandwidth_hz / REACH, min(REACH * tracker.bandwidth_hz, HIGHEST * drive.frequency)
    frequency = np.geomspace(lowest, highest, round(POINTS_PER_DECADE * np.log10(highest / lowest)) + 1)
    answers = (_running if point.law else _free)(point, frequency)
    turns, errors, sensed = _turns(known, source, drive, force, frequency, answers)
    pump = tracker.polarity * tracker.pump_current_a / (2.0 * pi)
    gain = -pump * source.loop_filter.impedance(2j * pi * frequency) * tracker.gain_hz_per_v * turns
    # within the dead time the current sets when a bridge turns; edges of voltage and current may move by its angle
    dead_deg = 2.0 * 360.0 * drive.frequency * source.driver.dead_time("a") if source.driver else 0.0
    return LoopDesign(
        source.loop_filter, *loop_margins(frequency, gain)[:2], frequency, gain,
        margin_error_deg=degrees(float(np.max(errors / np.abs(turns)))) + dead_deg, sensed_phase_deg=sensed,
    )  # fmt: skip


def _free(point: Point, modulation: Array) -> Answers:
    """Return what :func:`_running` does, of a stator without a rotor."""
    frequency, motor = point.drive.frequency, point.motor
    missing = len(GROUPS) - len(motor.groups)
    stator = motor.loaded_stator if motor.is_transducer else motor.stator.on_carrier(motor.mount)

    def answer(at: float) -> Complex:
        charged, omega = 0.0 * stator.coupling[0], 2.0 * pi * at
        if stator.feedback:
            displaced = np.linalg.solve(stator.dynamic_stiffness(omega), stator.coupling)
            charged = -stator.feedback_gain(omega) * (stator.sensed @ displaced)
        return np.vstack([np.pad(one, (0, missing)) for one in (cold_admittance(motor, at), charged)])

    above, below = (np.array([answer(frequency + side * at) for at in modulation]) for side in (1.0, -1.0))
    none = np.zeros_like(above)
    return answer(frequency) @ volts(point.drive), np.block([[above, none], [none, below.conj()]]), np.zeros((2, 1))


def _running(point: Point, modulation: Array) -> Answers:
    """Return what the full motor answers to small voltages beside its drive, at modulations in Hz.

    They are the phasors of both currents, A, and of the electrode's charge, V, at the drive; those at the side band
    above and the conjugate ones below over such voltages there, shape (modulations, 6, 4); and errors in S and V/V.
    """
    places = np.log(modulation / modulation[0]) / np.log(modulation[-1] / modulation[0]) * 2.0 - 1.0
    nodes = chebyshev.chebpts1(POINTS)
    between = chebyshev.chebvander(places, POINTS - 1) @ np.linalg.inv(chebyshev.chebvander(nodes, POINTS - 1))
    found = linearised(point, np.exp(np.interp(nodes, places, np.log(modulation))), OFFSETS)
    waves, frequency = found.state.waveforms, point.drive.frequency
    assert waves is not None
    wave = np.exp(-2j * pi * frequency * waves.time_s)
    columns = [getattr(waves, groups.column("current", group, "a")) for group in GROUPS]
    columns.append(0.0 * wave)
    if electrode := point.motor.feedback:
        columns[-1] = waves.feedback_v - electrode.shares @ np.array([waves.voltage_a_v, waves.voltage_b_v])
    currents = np.array([2j * frequency * np.trapezoid(column * wave, waves.time_s) for column in columns])
    above, below = slice(POINTS, None), slice(POINTS - 1, None, -1)  # of the frequencies of the side bands
    of_groups = (found.hot_admittance_s, found.image_admittance_s, found.hot_admittance_error_s)
    hot, image, error = (np.hstack([one, at[:, None]]) for one, at in zip(of_groups, found.electrode, strict=True))
    inner = np.block([[hot[above], image[below]], [image[above].conj(), hot[below].conj()]])
    errors = np.array([error[:, :2].max(axis=(1, 2)), error[:, 2].max(axis=1)]).real
    errors = np.array([np.interp(places, nodes, one[above] + one[below]) for one in errors])
    return currents, np.tensordot(between, inner, axes=1), errors


def _turns(
    known: Motor, source: TrackedSource, drive: TwoPhaseDrive, force: Complex | None, at: Array, answers: Answers
) -> tuple[Complex, Array, float]:
    """Return the change of the sensed phase with the frequency in rad/Hz, its error, and the phase.

    The sensed phase in degrees is that of the motional current ahead of the edges of the force. ``at`` are modulations
    in Hz, with the currents of :func:`_running`.
    """
    drawn, inner, of_kinds = answers
    frequency, tracker, weights = drive.frequency, source.tracker, parts.sensing(known, source.tracker, source.mode)
    currents, forces = (by_group(weights, kind) for kind in ("current", "force"))
    pins, electrode = volts(drive), known.feedback if tracker.sense == "feedback" else None
    target = tracker.target_deg + degrees(phase(parts.sensed_velocity(known, tracker, source.mode)))

    def sensed(at: Any, answer: Any, held: Any) -> Complex:
        """Return the sensed current at frequencies in Hz, for what the motor answers and the voltages of the groups."""
        if electrode:
            left = np.array(electrode.shares) * (1.0 - tracker.copies * (1.0 + tracker.capacitance_error))
            return np.asarray(-2j * pi * electrode.capacitance_f * at * (answer[..., 2] + held @ left))
        taken = (copies(weights, at) @ held[..., np.newaxis])[..., 0]
        return np.asarray((np.asarray(tracker.sensed_share(at))[..., np.newaxis] * answer[..., :2] - taken) @ currents)

    motional = complex(source.low_pass(frequency) * sensed(frequency, drawn, pins))
    harmonics = np.array([forces @ pins]) if force is None else force
    orders = np.arange(1, len(harmonics) + 1)
    wanted = harmonics * _reference(source, target, orders * frequency)
    edge = _edge(wanted)
    slopes = orders * wanted * np.exp(1j * orders * edge)
    slope, follows = float(slopes.real.sum()), float(slopes.real[1:].sum())
    series, across = _network(source, frequency)
    stage = pins + series * (drawn[:2] + across * pins)
    emf = 0.5 * np.concatenate([stage, stage.conj()])
    bands = np.stack([frequency + at, at - frequency], axis=1)
    networks = np.array([_network(source, band) for band in bands.ravel().tolist()])
    series, across = networks.swapaxes(0, 1).reshape(2, -1, 4, 1)
    # [v+; v-] = emf − series ([i+; i-] + across [v+; v-]), with the stage turned by e^{jωt}
    by_groups = inner[:, [0, 1, 3, 4]]
    moved = np.linalg.solve(np.eye(4) + series * (by_groups + across * np.eye(4)), emf[:, np.newaxis])
    held = moved.reshape(-1, 2, 2)
    current = source.low_pass(bands) * sensed(bands, (inner @ moved).reshape(-1, 2, 3), held)
    turned = held @ forces * _reference(source, target, bands)
    ahead = current @ np.array([1.0 / motional, 1.0 / motional.conjugate()])
    ahead -= (turned @ np.exp([1j * edge, -1j * edge]) + follows) / slope
    error = np.abs(currents).sum() * of_kinds[0]
    error = 2.0 * pi * frequency * electrode.capacitance_f * of_kinds[1] if electrode else error
    errors = error * np.abs(moved).max(axis=(1, 2)) / abs(motional) / at
    of_mode = degrees(phase(motional)) + degrees(edge) + tracker.target_deg
    return ahead / (1j * at), errors, (of_mode + 180.0) % 360.0 - 180.0


def _reference(source: TrackedSource, target_deg: float, frequency: Any) -> Complex:
    """Return the factors from the force to the signal with which the detector compares the current."""
    target, ahead = np.radians(target_deg), 1j * frequency / source.tracker.frequency
    return np.asarray(source.low_pass(frequency) * (np.cos(target) + ahead * np.sin(target)))


def _edge(harmonics: Complex) -> float:
    """Return the phase at which a sum of sines, Im Σ S_k e^{jkθ}, rises through zero, near that of its fundamental."""
    orders, edge = np.arange(1, len(harmonics) + 1), -float(np.angle(harmonics[0]))
    for _ in range(EDGE_STEPS):
        terms = harmonics * np.exp(1j * orders * edge)
        edge -= float(terms.imag.sum() / (orders * terms).real.sum())
    return edge


def volts(drive: TwoPhaseDrive) -> Complex:
    """Return the phasors of both groups, V."""
    return np.array(list(two_phasors(drive).values()))


def copies(weights: Mapping[str, float], frequency: Any) -> Complex:
    """Return the admittances of the copies of the clamped capacitances, S."""
    angular = 2j * pi * np.asarray(frequency)[..., np.newaxis]
    impedances = by_group(weights, "resistance") + 1.0 / (angular * by_group(weights, "capacitance"))
    return np.asarray(np.eye(len(GROUPS)) / impedances[..., np.newaxis])


def by_group(values: Mapping[str, float], name: str) -> Array:
    """Return the values of both groups."""
    return np.array([values[groups.named(name, group)] for group in GROUPS])


def _network(source: TrackedSource, frequency: float) -> Complex:
    """Return the series impedances of both groups, and the admittances across their pins.

    The voltage of a resistor that senses the current counts where there is no driver.
    """
    driver, tracker = source.driver, source.tracker
    driven = driver.groups if driver else ()
    line = complex(tracker.sense_ohm * tracker.sensed_share(frequency)), 0j
    return np.array([network_of(driver, one, frequency) if driver and one in driven else line for one in GROUPS]).T
