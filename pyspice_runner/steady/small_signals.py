# SPDX-License-Identifier: GPL-3.0-or-later
"""Small signals about a running motor: periodic small-signal analysis from the map over one drive period.

A small input e^{jωt} times a periodic function makes every quantity deviate by e^{jωt} times a periodic function. The
deviation x of the state therefore satisfies x(t + T) = e^{jωT} x(t). Over one period it is the sum of what the
deviation at the start of the run makes of it, which is the derivative of the map, and of what the input adds. The
latter is found in the same way, with copies that have a small sine in addition to the drive; no transient is needed.
R. Telichevesky, K. Kundert, J. White, "Efficient AC and noise analysis of two-tone RF circuits", DAC 1996. As in the
steady state, the mean over copies whose steps lie between each other's removes most of the effect of late events; the
difference between two halves of them, and the change by smaller deviations, give the error.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import pi, radians, sqrt
from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray
from pydantic import SkipValidation

from pyspice_runner.circuit.law import touching_law
from pyspice_runner.circuit.motor import dielectric_matrix
from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.motor import groups
from pyspice_runner.motor.drive import Drive, Tone, TwoPhaseDrive, two_phasors
from pyspice_runner.motor.groups import GROUPS
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.refusal import checked
from pyspice_runner.result import Result, contact_row, json_ready
from pyspice_runner.run.point import DEFAULT, Point, Settings
from pyspice_runner.steady.copies import Copy, Plant, Probe
from pyspice_runner.steady.period_map import PeriodMap, Trace, current, speed
from pyspice_runner.steady.shooting import Orbit, Shooting
from pyspice_runner.steady.speed_torque import axis
from pyspice_runner.steady.steady import SteadyState, settled
from pyspice_runner.units import linear_unit

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

INPUTS = {"amplitude": "V", "phase_deg": "deg", "frequency": "Hz", "load_torque": "N·m"}
OUTPUTS = {
    "speed": "rad/s", "torque": "N·m", "current_amplitude_a": "A", "current_amplitude_b": "A",
    "current_phase_a_deg": "deg", "current_phase_b_deg": "deg", "motional_phase_a_deg": "deg",
    "motional_phase_b_deg": "deg",
}  # fmt: skip
# Both are large enough that a change of contact moves over whole steps, and are taken with both signs, so that the
# curvature drops out. On a motor that slips, the transfer functions are then within 2 % of those of finite modulation.
# A finer step than that of simulate makes both smaller, by the root of its ratio: in proportion, rounding would count.
SWING = 3e-3  # of the scale of a state
PROBE = 0.1  # of the drive's amplitude, and of the friction torque; within one period it moves the state by about 1e-3
FINER = 2  # steps in one of the steady state
OFFSETS = 4  # copies whose steps lie between each other's; their difference is one part of the error
SMALLER = 0.5  # of the deviations: the change by it is the other part
ACCURATE = 0.05  # error of a transfer function, relative to its magnitude, above which there is a caution
HIGHEST = 0.45  # of the drive's frequency
_SIGNALS = ("speed", "friction", "current_a", "current_b", "motional_a", "motional_b")
_CURRENTS = slice(2, 4)  # of the signals


@dataclass(frozen=True, repr=False)
class SmallSignals(Result):
    """Transfer functions of a running motor, and the admittance that its groups have for a small additional voltage.

    The phases of currents are those against the voltage of the same group; phases of motional currents, which the
    clamped capacitance does not take, likewise.

    Attributes:
        state: the steady state.
        modulation_hz: frequencies of the modulation, Hz.
        transfers: (output, input) → complex transfer function, in the units of :data:`OUTPUTS` and :data:`INPUTS`.
            Inputs are ``amplitude`` (of group A; that of B in proportion), ``phase_deg`` (of group B), ``frequency``
            and, of a free shaft, ``load_torque``. Phases of a current that is zero are left out.
        probe_hz: frequencies of an additional small voltage, the drive's less and plus those of the modulation.
        hot_admittance_s: admittance matrix of the running motor for it, shape (frequencies, 2, 2).
        cold_admittance_s: that of the stator at rest and free, beside it.
        image_admittance_s: current at twice the drive's frequency less that of the voltage, over the conjugate voltage.
        errors: (output, input) → estimated error of the transfer function by the time step and by the size of the
            deviations from the steady state, in its unit.
        hot_admittance_error_s: estimated error of each entry of the hot admittance by the same, S.
    """

    state: SteadyState
    modulation_hz: Array
    transfers: dict[tuple[str, str], Complex]
    probe_hz: Array
    hot_admittance_s: Complex
    cold_admittance_s: Complex
    image_admittance_s: Complex = field(repr=False)
    errors: dict[tuple[str, str], Array] = field(repr=False)
    hot_admittance_error_s: Array = field(repr=False)

    def transfer(self, output: str, of: str) -> Complex:
        """Return the transfer function from an input to an output, over :attr:`modulation_hz`.

        Raises:
            ParameterError: for a name that is not known, the load torque of a held shaft, or the phase of no current.
        """
        if (output, of) not in self.transfers:
            raise ParameterError(
                f"There is no transfer from {of} to {output}: inputs are {', '.join(INPUTS)} (the last of a free "
                f"shaft), outputs are {', '.join(OUTPUTS)} (the phases only where there is a current)."
            )
        return self.transfers[output, of]

    def columns(self) -> Mapping[str, Array]:
        """Return real and imaginary part of each transfer function and its error over the modulation frequency."""
        found = {"modulation_frequency_hz": self.modulation_hz}
        for (output, of), values in self.transfers.items():
            name = f"{output}_per_{of}"
            found |= {f"{name}_re": values.real, f"{name}_im": values.imag, f"{name}_error": self.errors[output, of]}
        return found

    @property
    def linear(self) -> bool:
        """Whether the motor has a slider."""
        return self.state.linear

    def unit(self, output: str, of: str) -> str:
        """Return the unit of a transfer function."""
        above, below = (linear_unit(one) if self.linear else one for one in (OUTPUTS[output], INPUTS[of]))
        return f"{above}/({below})" if "·" in below else f"{above}/{below}"

    @property
    def units(self) -> dict[str, tuple[str, str]]:  # type: ignore[override]
        """Unit and meaning of each column."""
        found = {"modulation_frequency_hz": ("Hz", "frequency of the modulation")}
        for output, of in self.transfers:
            for part, words in (("re", "real part"), ("im", "imaginary part"), ("error", "estimated error")):
                found[f"{output}_per_{of}_{part}"] = (self.unit(output, of), f"{output} per {of}, {words}")
        return found

    def to_dict(self) -> dict[str, Any]:
        """Return frequencies, transfer functions, admittances and the steady state, JSON-ready."""
        return {
            "modulation_frequency_hz": self.modulation_hz.tolist(),
            "transfers": {f"{output}_per_{of}": json_ready(values) for (output, of), values in self.transfers.items()},
            "errors": {f"{output}_per_{of}": values.tolist() for (output, of), values in self.errors.items()},
            "units": {f"{output}_per_{of}": self.unit(output, of) for output, of in self.transfers},
            "probe_frequency_hz": self.probe_hz.tolist(),
            **self._entries("hot_admittance_s", "hot_admittance_error_s", "cold_admittance_s"),
            "steady_state": self.state.to_dict(),
            **self._entries("cautions"),
        }

    def _limits(self) -> Iterator[str]:
        """Yield the cautions of the steady state, and the transfer functions that are not accurate."""
        yield from self.state.cautions
        every = [
            (f"{output} per {of}", self.modulation_hz, self.errors[output, of], values)
            for (output, of), values in self.transfers.items()
        ]
        for at, group in enumerate("AB"):
            error, values = self.hot_admittance_error_s[:, at, at], self.hot_admittance_s[:, at, at]
            every.append((f"hot admittance of {group}", self.probe_hz, error, values))
        inaccurate = []
        for name, frequencies, errors, values in every:
            share = errors / np.maximum(np.abs(values), np.finfo(float).tiny)
            worst = int(np.argmax(share))
            if share[worst] > ACCURATE:
                inaccurate.append(f"{name} ({100.0 * share[worst]:.2g} % at {frequencies[worst]:.4g} Hz)")
        if inaccurate:
            yield (
                f"The estimated error of transfer functions exceeds {100.0 * ACCURATE:g} %: {', '.join(inaccurate)}. "
                f"Give a step < {self.state.step_s:.2g} s."
            )

    def summary(self) -> dict[str, str]:
        """Return the transfer functions at the lowest frequency, and the admittances next to the drive's."""
        found = {"modulation": f"{self.modulation_hz[0]:.4g} to {self.modulation_hz[-1]:.4g} Hz"}
        found |= contact_row(self.state.provenance["run"])
        for (output, of), values in self.transfers.items():
            error = f"{self.errors[output, of][0]:.1g} {self.unit(output, of)}"
            found[f"{output} per {of}"] = f"{abs(values[0]):.4g} ± {error}"
        near = int(np.argmin(np.abs(self.probe_hz - self.state.drive.frequencies[0])))
        for words, matrix in (("hot", self.hot_admittance_s), ("cold", self.cold_admittance_s)):
            for place, group in enumerate("AB"):
                value = 1e3 * complex(matrix[near, place, place])
                error = f" ± {1e3 * self.hot_admittance_error_s[near, place, place]:.1g}" if words == "hot" else ""
                found[f"{words} admittance of {group}"] = f"{value.real:.4g} {value.imag:+.4g}j{error} mS"
        return self._localised(found)


@checked
def small_signals(
    motor: Motor, drive: Drive, *, frequencies: SkipValidation[Sequence[float] | Array], **settings: Unpack[Settings]
) -> SmallSignals:
    """Return the transfer functions of a running motor from modulations of its drive and load, and its hot admittance.

    Args:
        motor: the motor.
        drive: the voltages of both groups, with one frequency.
        frequencies: of the modulation, Hz; below 0.45 times the drive's.
        settings: load, contact and solver, as in :class:`.Settings`. A finer step also makes the additional voltages,
            torques and deviations smaller. Where two effects almost cancel, transfer functions need a finer step;
            ``cautions`` names those that are not accurate.

    Raises:
        ParameterError: for an invalid value.
        SimulationError: if there is no stable steady state, or ngspice fails.
    """
    return linearised(Point.of(motor, drive, **settings), frequencies)


def linearised(point: Point, frequencies: Sequence[float] | Array, *, transfers: bool = True) -> SmallSignals:
    """Return the small signals about an operating point; the arguments are those of :func:`small_signals`.

    Without ``transfers`` they have the admittances only, from fewer copies.
    """
    motor, drive, step, timeout = point.motor, point.drive, point.solver.step, point.solver.timeout
    if not isinstance(drive, TwoPhaseDrive):
        raise ParameterError("Small signals are those about a drive with one frequency: give a TwoPhaseDrive.")
    modulation = np.unique(axis("frequencies", frequencies))
    highest = HIGHEST * drive.frequency
    if modulation[0] <= 0.0 or modulation[-1] > highest:
        worst = modulation[0] if modulation[0] <= 0.0 else modulation[-1]
        raise ParameterError(f"frequencies has {worst:g} Hz: the modulation must be > 0 and ≤ {highest:.4g} Hz.")
    if not drive.voltage:
        raise ParameterError("drive.voltage = 0 V is not valid here: there is no running motor. Give a voltage > 0 V.")
    touching_law(point.law, "The two-port of a free tip does not depend on the drive: take admittance.")
    state = settled(point)
    if not state.stable or state.solution is None:
        raise SimulationError("There is no stable steady state about which small signals would be defined.")
    usual = replace(point, solver=DEFAULT).step
    fineness = sqrt(min(1.0, step / usual)) if step is not None else 1.0
    map_step = state.step_s / FINER
    starts = [state.solution.moved(number / OFFSETS * map_step, map_step) for number in range(OFFSETS)]
    every = [_Linear.about(start, map_step, fineness, timeout).responses(modulation, transfers) for start in starts]
    smaller = [
        _Linear.about(start, map_step, SMALLER * fineness, timeout).responses(modulation, transfers) for start in starts
    ]
    found, hot, image = map(_stacked, zip(*every, strict=True))
    found_smaller, hot_smaller, _ = map(_stacked, zip(*smaller, strict=True))
    probed = np.array(sorted(hot))
    return SmallSignals(
        state, modulation, {pair: copies.mean(axis=0) for pair, copies in found.items()}, probed,
        np.array([hot[at].mean(axis=0) for at in probed.tolist()]),
        np.array([cold_admittance(motor, at) for at in probed.tolist()]),
        np.array([image[at].mean(axis=0) for at in probed.tolist()]),
        {pair: _error(copies, found_smaller[pair]) for pair, copies in found.items()},
        np.array([_error(hot[at], hot_smaller[at]) for at in probed.tolist()]),
    )  # fmt: skip


def _stacked(several: Sequence[Mapping[Any, Any]]) -> dict[Any, Complex]:
    """Return the values by name, with those of the several copies along the first axis."""
    return {name: np.array([one[name] for one in several]) for name in several[0]}


def _error(copies: Complex, smaller: Complex) -> Array:
    """Return the error of the mean of copies: by what halves of them and copies with smaller deviations differ."""
    halves = np.abs(np.mean(copies[::2] - copies[1::2], axis=0)) / 2
    return np.asarray(np.hypot(halves, np.abs(np.mean(copies - smaller, axis=0))))


Matrices = dict[float, Complex]  # by frequency


@dataclass(frozen=True)
class _Linear:
    """A solved point with the derivatives of its signals with respect to the state at the start of the run."""

    point: Orbit  # the point, solved on the map
    period_map: PeriodMap  # the map
    base: Array  # signals of the undisturbed period, shape (signals, points)
    slopes: Array  # their derivatives with respect to the scaled states, shape (states, signals, points)
    # derivative of the scaled state at the beginning of the period with respect to that of the run's start.
    at_start: Array
    at_end: Array  # the same at the end of the period
    fineness: float  # size of deviations and probes over that at the usual step

    @classmethod
    def about(cls, point: Orbit, step: float, fineness: float, timeout: float | None) -> _Linear:
        """Solve a point at a time step in s, and measure the derivatives there."""
        period = point.plant.drive.period
        period_map = PeriodMap(period, round(period / step), timeout)
        shooting = Shooting([point], period_map)
        shooting.solve()
        if not point.done or point.trace is None:
            raise SimulationError("The steady state is not found at the step of the result. Give another step.")
        swing = SWING * fineness
        states = [point.state + sign * swing * row for sign in (1.0, -1.0) for row in np.diag(point.scale)]
        traces = _found(period_map.traces([Copy(point.plant, state, point.begun) for state in states]))
        pairs = list(zip(traces[: len(traces) // 2], traces[len(traces) // 2 :], strict=True))
        slopes = [_signals(point.plant, up) - _signals(point.plant, down) for up, down in pairs]
        at_start, at_end = (
            np.array([(up.states[:, at] - down.states[:, at]) / point.scale for up, down in pairs]).T for at in (0, -1)
        )
        size = 2.0 * swing
        base = _signals(point.plant, point.trace)
        return cls(point, period_map, base, np.array(slopes) / size, at_start / size, at_end / size, fineness)

    def responses(self, modulation: Array, whole: bool) -> tuple[dict[tuple[str, str], Complex], Matrices, Matrices]:
        """Return the transfer functions (none if not ``whole``), the hot admittance and its image."""
        plant = self.point.plant
        drive = plant.drive
        assert isinstance(drive, TwoPhaseDrive)
        frequency = drive.frequency
        sides = (("a", 1), ("a", -1), ("b", 1), ("b", -1), *((("shaft", 0),) if whole and plant.turns else ()))
        turning = np.concatenate([[0.0] if whole else [], modulation])
        probes = [(place, shift * frequency + at) for at in turning.tolist() for place, shift in sides]
        responses = dict(zip(probes, self._responses(probes, turning.repeat(len(sides))), strict=True))
        assert self.point.trace is not None
        wave = np.exp(-2j * pi * frequency * self.point.trace.time[1:])
        # phasors of currents and motional currents: the real part of phasor · e^{jΩt} is the current
        carriers = {
            name: complex(2.0 * np.mean(signal[1:] * wave))
            for name, signal in zip(_SIGNALS[2:], self.base[2:], strict=True)
        }
        transfers: dict[tuple[str, str], list[complex]] = {}
        hot = {}
        image = {}
        # A constant phase of both groups changes no output. What it seems to change is an error of the derivatives,
        # which the integral from frequency to phase would amplify.
        if whole:
            up, down = ({group: responses[group, side * frequency] for group in "ab"} for side in (1, -1))
            resting = _outputs(self._modulated(drive, up, down, None)["frequency"], carriers, "frequency", plant)
        for at in modulation.tolist():
            up = {group: responses[group, frequency + at] for group in "ab"}
            down = {group: responses[group, at - frequency] for group in "ab"}
            modulated = self._modulated(drive, up, down, responses.get(("shaft", at))) if whole else {}
            for of, response in modulated.items():
                for output, value in _outputs(response, carriers, of, plant).items():
                    # phase = 2π ∫ frequency
                    found = (value - resting[output]) / (1j * at) if of == "frequency" else value
                    transfers.setdefault((output, of), []).append(found)
            above, below = (np.stack([side[into][_CURRENTS] for into in "ab"], axis=1) for side in (up, down))
            hot[frequency + at], image[frequency - at] = above[..., 1], below[..., 1]
            hot[frequency - at], image[frequency + at] = below[..., -1].conj(), above[..., -1].conj()
        return {pair: np.array(values) for pair, values in transfers.items()}, hot, image

    def _responses(self, probes: Sequence[tuple[str, float]], modulation: Array) -> list[Complex]:
        """Return the response to e^{jωt} at each place, where ω may be negative, from copies with cosine and sine.

        A response has the components of each signal at the modulation plus 0, 1 and −1 times the drive's frequency.
        """
        plant, point = self.point.plant, self.point
        assert isinstance(plant.drive, TwoPhaseDrive)
        contact, radius = plant.motor.contact, plant.motor.rotor.radius_m
        share = PROBE * self.fineness
        sizes = dict.fromkeys("ab", share * max(plant.drive.voltage, plant.drive.voltage_b))
        sizes["shaft"] = share * contact.friction * contact.preload_n * radius
        copies = []
        for place, frequency in probes:
            for phase in (0.5 * pi, 0.0):
                turned = phase if frequency >= 0.0 or phase else pi  # sin(−|ω|t) = sin(|ω|t + π)
                for sign in (1.0, -1.0):
                    probe = Probe(place, Tone(sign * sizes[place], abs(frequency), turned))
                    copies.append(Copy(point.plant, point.state, point.begun, (probe,)))
        traces = _found(self.period_map.traces(copies))
        assert point.trace is not None
        time = point.trace.time
        found = []
        for number, ((place, frequency), at) in enumerate(zip(probes, modulation.tolist(), strict=True)):
            cosine, minus_cosine, sine, minus_sine = traces[4 * number : 4 * number + 4]
            start, end = (
                (cosine.states[:, where] - minus_cosine.states[:, where])
                + 1j * (sine.states[:, where] - minus_sine.states[:, where])
                for where in (0, -1)
            )
            added = _signals(plant, cosine) - _signals(plant, minus_cosine)
            added = added + 1j * (_signals(plant, sine) - _signals(plant, minus_sine))
            turn = np.exp(2j * pi * at * self.period_map.period)
            missing, matrix = (turn * start - end) / point.scale, self.at_end - turn * self.at_start
            stem = plant.places["stem"]  # the period does not depend on where its lags start
            missing[stem], matrix[stem] = 0.0, np.eye(len(matrix))[stem]
            deviation = np.linalg.lstsq(matrix, missing, rcond=1e-10)[0]
            signals = added + np.tensordot(deviation, self.slopes, axes=1)
            signals = np.asarray(signals / (2.0 * sizes[place]), dtype=complex)
            if place in "ab":  # the clamped capacitance takes its current from the source alone
                wave = np.exp(2j * pi * frequency * time)
                taken = dielectric_matrix(plant.motor, frequency)[:, "ab".index(place)]
                signals[_CURRENTS] += np.outer(taken, wave)
            waves = np.exp(-2j * pi * np.outer(time, at + plant.drive.frequency * np.array([0, 1, -1])))
            found.append(np.asarray(signals[:, 1:] @ waves[1:] / len(waves[1:]), dtype=complex))
        return found

    @staticmethod
    def _modulated(
        drive: TwoPhaseDrive, up: Mapping[str, Complex], down: Mapping[str, Complex], shaft: Complex | None
    ) -> dict[str, Complex]:
        """Return the responses to modulations e^{jωt}, made of side bands; ``frequency`` is that to the phase of both.

        With u = Im(U e^{jΩt}), modulating U by a factor 1 + m e^{jωt} adds m e^{jωt}(U e^{jΩt} − U* e^{−jΩt})/2j, and
        modulating its phase by ψ e^{jωt} adds ψ e^{jωt}(U e^{jΩt} + U* e^{−jΩt})/2.
        """
        volts = two_phasors(drive)
        above = {group: up[group] * volts[group] for group in "ab"}
        below = {group: down[group] * volts[group].conjugate() for group in "ab"}
        turned = {group: 0.5 * (above[group] + below[group]) for group in "ab"}
        grown = (above["a"] - below["a"] + above["b"] - below["b"]) * (-0.5j / drive.voltage)
        found = {"amplitude": grown, "phase_deg": radians(1.0) * turned["b"], "frequency": turned["a"] + turned["b"]}
        return found if shaft is None else found | {"load_torque": -shaft}


def _outputs(response: Complex, carriers: Mapping[str, complex], of: str, plant: Plant) -> dict[str, complex]:
    """Return the outputs of a response to an input; ``frequency`` stands for the phase of both groups."""
    at = dict(zip(_SIGNALS, response.tolist(), strict=True))
    found = {"speed": at["speed"][0], "torque": plant.motor.rotor.radius_m * at["friction"][0]}
    for kind in ("current", "motional"):
        for group in "ab":
            carrier = carriers[groups.named(kind, group)]
            if not carrier:  # such as the motional current of a group that moves no mode
                continue
            _, above, below = at[groups.named(kind, group)]
            if kind == "current":
                found[groups.named("current_amplitude", group)] = (above * carrier.conjugate() + below * carrier) / abs(
                    carrier
                )
            own = {"phase_deg": radians(group == "b"), "frequency": 1.0}.get(of, 0.0)
            turned = -1j * above / carrier + 1j * below / carrier.conjugate() - own
            found[groups.column(f"{kind}_phase", group, "deg")] = turned / radians(1.0)
    return {name: found[name] for name in OUTPUTS if name in found}


def _signals(plant: Plant, trace: Trace) -> Array:
    """Return speed, friction force, currents and motional currents over a period."""
    velocity = trace.states[plant.modes : 2 * plant.modes]
    currents = [current(plant, group, trace) for group in GROUPS]
    motional = plant.motor.stator.coupling.T @ velocity
    return np.array([speed(plant, trace), trace.friction, *currents, *motional])


def cold_admittance(motor: Motor, frequency: float) -> Complex:
    """Return the admittance matrix in S of the free stator at rest at a frequency in Hz."""
    omega = 2.0 * pi * frequency
    stator = motor.stator.on_carrier(motor.mount)
    motion = np.linalg.solve(stator.dynamic_stiffness(omega), stator.coupling)
    return np.asarray(dielectric_matrix(motor, frequency) + 1j * omega * stator.coupling.T @ motion)


def _found(traces: Sequence[Trace | None]) -> list[Trace]:
    if any(trace is None for trace in traces):
        raise SimulationError("ngspice does not find the period of a motor with a small additional sine.")
    return [trace for trace in traces if trace is not None]
