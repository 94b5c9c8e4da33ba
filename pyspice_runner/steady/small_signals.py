# SPDX-License-Identifier: GPL-3.0-or-later
"""Small signals about a running motor: periodic small-signal analysis from the map over one drive period.

A small input e^{jωt} times a periodic function makes every quantity deviate by e^{jωt} times a periodic function. The
deviation x of the state therefore satisfies x(t + T) = e^{jωT} x(t). Over one period it is the sum of what the
deviation at its beginning makes of it, which is the derivative of the map, and of what the input adds. Both follow from
the equations along the steady state (:mod:`.monodromy`), of a contact whose equations are not known from copies.
R. Telichevesky, K. Kundert, J. White, "Efficient AC and noise analysis of two-tone RF circuits", DAC 1996. As in the
steady state, the mean over points whose steps lie between each other's removes most of the effect of late events; the
difference between two halves of them gives the error, with the change by smaller deviations of copies.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import log, pi, radians
from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray
from pydantic import SkipValidation

from pyspice_runner.circuit.motor import dielectric_matrix
from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.motor import groups
from pyspice_runner.motor.drive import Drive, Tone, TwoPhaseDrive, two_phasors
from pyspice_runner.motor.groups import GROUPS
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.refusal import checked
from pyspice_runner.result import Result, contact_row, json_ready
from pyspice_runner.run.point import Point, Settings
from pyspice_runner.steady.copies import Copy, Plant, Probe
from pyspice_runner.steady.monodromy import Linearised, differentiable
from pyspice_runner.steady.period_map import PeriodMap, Trace, current, modal, speed
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
# Both are those of copies, large enough that a change of contact moves over whole steps.
SWING = 3e-3  # of the scale of a state
PROBE = 0.1  # of the drive's amplitude, and of the friction torque; within one period it moves the state by about 1e-3
SMALLER = 0.5  # of both: the change by it is one part of the error
FINER = 2  # steps in one of the steady state
OFFSETS, OFFSETS_OF_COPIES = 64, 4  # points whose steps lie between each other's; their difference is the other part
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
        settings: load, contact and solver, as in :class:`.Settings`. Where two effects almost cancel, transfer
            functions need a finer step; ``cautions`` names those that are not accurate.

    Raises:
        ParameterError: for an invalid value.
        SimulationError: if there is no stable steady state, or ngspice fails.
    """
    return linearised(Point.of(motor, drive, **settings), frequencies)


def linearised(point: Point, frequencies: Sequence[float] | Array, offsets: int = OFFSETS) -> SmallSignals:
    """Return the small signals about an operating point, as :func:`small_signals`, from so many points by equations."""
    drive = point.drive
    if not isinstance(drive, TwoPhaseDrive):
        raise ParameterError("Small signals are those about a drive with one frequency: give a TwoPhaseDrive.")
    modulation = np.unique(axis("frequencies", frequencies))
    highest = HIGHEST * drive.frequency
    if modulation[0] <= 0.0 or modulation[-1] > highest:
        worst = modulation[0] if modulation[0] <= 0.0 else modulation[-1]
        raise ParameterError(f"frequencies has {worst:g} Hz: the modulation must be > 0 and ≤ {highest:.4g} Hz.")
    if not drive.voltage:
        raise ParameterError("drive.voltage = 0 V is not valid here: there is no running motor. Give a voltage > 0 V.")
    point.touching("The two-port of a free tip does not depend on the drive: take admittance.")
    state = settled(point)
    if not state.stable or state.solution is None:
        raise SimulationError("There is no stable steady state about which small signals would be defined.")
    step = state.step_s / FINER
    period_map = PeriodMap(drive.period, round(drive.period / step), point.solver.timeout)
    count = offsets if differentiable(state.solution.plant) else OFFSETS_OF_COPIES
    points = [state.solution.moved(number / count * step, step) for number in range(count)]
    Shooting(points, period_map).solve()
    if not all(one.done and one.trace for one in points):
        raise SimulationError("The steady state is not found at the step of the result. Give another step.")

    def found_by(share: float) -> dict[Any, Complex]:
        every = [_Linear(one, period_map, drive, share).transfers(modulation) for one in points]
        return {name: np.array([one[name] for one in every]) for name in every[0]}

    copies = found_by(1.0)
    errors = {name: 0.5 * np.abs(np.mean(values[::2] - values[1::2], axis=0)) for name, values in copies.items()}
    if not differentiable(state.solution.plant):
        for name, smaller in found_by(SMALLER).items():
            errors[name] = np.hypot(errors[name], np.abs(np.mean(copies[name] - smaller, axis=0)))
    found = {name: values.mean(axis=0) for name, values in copies.items()}
    probed = np.concatenate([drive.frequency - modulation[::-1], drive.frequency + modulation])
    cold = np.array([cold_admittance(point.motor, at) for at in probed.tolist()])
    hot, image, hot_error = found.pop("hot"), found.pop("image"), errors.pop("hot")
    del errors["image"]
    return SmallSignals(state, modulation, found, probed, hot, cold, image, errors, hot_error)


@dataclass(frozen=True)
class _Linear:
    """Small signals about a point."""

    point: Orbit  # the point, solved on the map
    period_map: PeriodMap  # the map
    drive: TwoPhaseDrive  # of the point
    share: float  # of the usual deviations of copies

    def transfers(self, modulation: Array) -> dict[Any, Complex]:
        """Return the transfer functions by output and input, and ``hot`` admittances and their ``image``."""
        plant, trace, drive = self.point.plant, self.point.trace, self.drive
        assert trace is not None
        sides = [("a", 1), ("a", -1), ("b", 1), ("b", -1), ("shaft", 0)][: 4 + plant.turns]
        turning = np.concatenate([[0.0], modulation])
        probes = [(place, shift * drive.frequency + at) for at in turning.tolist() for place, shift in sides]
        every = np.array(self._responses(probes, turning.repeat(len(sides)))).reshape(-1, len(sides), len(_SIGNALS), 3)
        wave = np.exp(-2j * pi * drive.frequency * trace.time[1:])
        # phasors of currents and motional currents: the real part of phasor · e^{jΩt} is the current
        base = zip(_SIGNALS[2:], _signals(plant, trace)[2:, 1:], strict=True)
        carriers = {name: complex(2.0 * np.mean(signal * wave)) for name, signal in base}
        # A constant phase of both groups changes no output. What it seems to change is an error of the derivatives,
        # which the integral from frequency to phase would amplify.
        resting = _outputs(_modulated(drive, every[0])["frequency"], carriers, "frequency", plant)
        found: dict[Any, list[complex]] = {}
        for at, one in zip(modulation.tolist(), every[1:], strict=True):
            for of, response in _modulated(drive, one).items():
                for output, value in _outputs(response, carriers, of, plant).items():
                    turned = (value - resting[output]) / (1j * at)  # phase = 2π ∫ frequency
                    found.setdefault((output, of), []).append(turned if of == "frequency" else value)
        above, below = (every[1:, first:4:2, _CURRENTS].swapaxes(1, 2) for first in (0, 1))
        hot = np.concatenate([below[::-1, ..., -1].conj(), above[..., 1]])
        image = np.concatenate([below[::-1, ..., 1], above[..., -1].conj()])
        return {name: np.array(values) for name, values in found.items()} | {"hot": hot, "image": image}

    def _responses(self, probes: Sequence[tuple[str, float]], modulation: Array) -> list[Complex]:
        """Return the response to e^{jωt} at each place, where ω may be negative.

        A response has the components of each signal at the modulation plus 0, 1 and −1 times the drive's frequency.
        """
        plant, trace, turns = self.point.plant, self.point.trace, np.exp(2j * pi * modulation * self.period_map.period)
        assert trace is not None
        if trace.course:
            deviations = Linearised([trace.course], self.period_map.discretisation).responses(probes, turns)
            deviations = plant.widened(deviations, trace.course.plant, 1)
        else:
            deviations = self._by_copies(probes, turns)
        found, base = [], _signals(plant, trace)
        for (place, frequency), at, rows in zip(probes, modulation.tolist(), deviations, strict=True):
            moved: Any = {"states": trace.states + rows[:-2], "normal": trace.normal + rows[-2]}
            signals = _signals(plant, replace(trace, friction=trace.friction + rows[-1], **moved)) - base
            if place in "ab":  # the clamped capacitance takes its current from the source alone
                wave = np.exp(2j * pi * frequency * trace.time)
                taken = dielectric_matrix(plant.motor, frequency)[:, "ab".index(place)]
                signals[_CURRENTS] += np.outer(taken, wave)
            waves = np.exp(-2j * pi * np.outer(trace.time, at + self.drive.frequency * np.array([0, 1, -1])))
            found.append(np.asarray(signals[:, 1:] @ waves[1:] / len(waves[1:]), dtype=complex))
        return found

    def _by_copies(self, probes: Sequence[tuple[str, float]], turns: Complex) -> Complex:
        """Return what :meth:`.Linearised.responses` does, of a contact whose equations are not known here.

        A copy whose state or input has the opposite sign removes the curvature.
        """
        plant, point, drive = self.point.plant, self.point, self.drive
        sizes = dict.fromkeys("ab", self.share * PROBE * max(drive.voltage, drive.voltage_b))
        sizes["shaft"] = self.share * PROBE * plant.friction_n * plant.motor.rotor.radius_m
        copies = [
            Copy(plant, point.state + sign * self.share * SWING * row, point.begun)
            for row in np.diag(point.scale) for sign in (1.0, -1.0)
        ]  # fmt: skip
        for place, frequency in probes:  # cosine and sine, where sin(−|ω|t) = sin(|ω|t + π)
            for phase in (0.5 * pi, 0.0 if frequency >= 0.0 else pi):
                for sign in (1.0, -1.0):
                    probe = Probe(place, Tone(sign * sizes[place], abs(frequency), phase))
                    copies.append(Copy(plant, point.state, point.begun, (probe,)))
        traces = self.period_map.traces(copies)
        rows = np.array([[*trace.states, trace.normal, trace.friction] for trace in traces if trace])
        if len(rows) < len(copies):
            raise SimulationError("ngspice does not find the period of a motor with a small additional sine.")
        halves, order = 0.5 * (rows[::2] - rows[1::2]), plant.order
        slopes, inputs = halves[:order] / (self.share * SWING), halves[order:]
        added: Complex = (inputs[::2] + 1j * inputs[1::2]) / np.array([sizes[place] for place, _ in probes])[
            :, None, None
        ]
        free = point.slip.influential  # not a slider that slips, and the lags of the stem, which forget their start
        sloped, moved = ((one[:, :order, [0, -1]] / point.scale[:, np.newaxis])[:, free] for one in (slopes, added))
        for turn, (start, end), response in zip(turns.tolist(), np.moveaxis(moved, 2, 1), added, strict=True):
            matrix = (sloped[free, :, 1] - turn * sloped[free, :, 0]).T
            response += np.tensordot(np.linalg.lstsq(matrix, turn * start - end, rcond=1e-10)[0], slopes[free], axes=1)
        return added


def _modulated(drive: TwoPhaseDrive, response: Complex) -> dict[str, Complex]:
    """Return the responses to modulations e^{jωt}, made of side bands; ``frequency`` is that to the phase of both.

    With u = Im(U e^{jΩt}), modulating U by a factor 1 + m e^{jωt} adds m e^{jωt}(U e^{jΩt} − U* e^{−jΩt})/2j, and
    modulating its phase by ψ e^{jωt} adds ψ e^{jωt}(U e^{jΩt} + U* e^{−jΩt})/2.
    """
    volts = np.array(list(two_phasors(drive).values()))[:, np.newaxis, np.newaxis]
    above, below = response[0:4:2] * volts, response[1:4:2] * volts.conj()
    turned, grown = 0.5 * (above + below), -0.5j * (above - below).sum(axis=0) / drive.voltage
    found = {"amplitude": grown, "phase_deg": radians(1.0) * turned[1], "frequency": turned.sum(axis=0)}
    return found | ({"load_torque": -response[4]} if len(response) > 4 else {})


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
    currents = [current(plant, group, trace) for group in GROUPS]
    motional = plant.motor.stator.coupling.T @ modal(plant, trace)[1]
    return np.array([speed(plant, trace), trace.friction, *currents, *motional])


def cold_admittance(motor: Motor, frequency: float) -> Complex:
    """Return the admittance matrix in S of the free stator at rest at a frequency in Hz; of a transducer under load."""
    omega = 2.0 * pi * frequency
    stator = motor.loaded_stator if motor.is_transducer else motor.stator.on_carrier(motor.mount)
    motion = np.linalg.solve(stator.dynamic_stiffness(omega), stator.coupling)
    return np.asarray(dielectric_matrix(motor, frequency) + 1j * omega * stator.coupling.T @ motion)


def loop_margins(frequency: Array, loop: Complex) -> tuple[float, float, float | None]:
    """Return crossover in Hz, phase margin in degrees and gain margin in dB of a loop gain, each the worst of several.

    The gain margin is ``None`` without bound. Raise SimulationError if the gain does not cross 1.
    """
    level, phase, place = np.log(np.abs(loop)), np.unwrap(np.angle(loop)), np.log(frequency)
    index = np.arange(len(loop))

    def crossings(values: Array) -> Array:
        """Return the indices, with the share of a step, at which values are 0; a point may be there."""
        found = np.flatnonzero((values[:-1] > 0.0) != (values[1:] > 0.0))
        return np.asarray(found + values[found] / (values[found] - values[found + 1]))

    ones = crossings(level)
    if not ones.size:
        raise SimulationError(f"The loop gain does not cross 1 from {frequency[0]:.3g} to {frequency[-1]:.3g} Hz.")
    margins = (np.degrees(np.interp(ones, index, phase)) + 360.0) % 360.0 - 180.0
    worst = int(margins.argmin())
    turns = np.concatenate([crossings(phase - pi * odd) for odd in range(-9, 10, 2)])
    levels = np.interp(turns, index, level)
    above = levels[levels < 0.0]
    crossover = float(np.exp(np.interp(ones[worst], index, place)))
    return crossover, float(margins[worst]), -20.0 * float(above.max()) / log(10.0) if above.size else None
