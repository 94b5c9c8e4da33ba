# SPDX-License-Identifier: GPL-3.0-or-later
"""Small signals about a running motor: periodic small-signal analysis from the map over one drive period.

A small input e^{jωt} times a periodic function makes every quantity deviate by e^{jωt} times a periodic function. The
deviation x of the state therefore satisfies x(t + T) = e^{jωT} x(t). Over one period it is the sum of what the
deviation at its beginning makes of it, which is the derivative of the map, and of what the input adds. Both follow from
the equations along the steady state (:mod:`.monodromy`). R. Telichevesky, K. Kundert, J. White, "Efficient AC and noise
analysis of two-tone RF circuits", DAC 1996. As in the steady state, the mean over points whose steps lie between each
other's removes most of the effect of late events. Where an event passes from one step to the next the derivatives have
narrow peaks; points are added there. Between two points the values are taken as linear; their change gives the error.
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
from pyspice_runner.circuit.state import pushes
from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.motor import groups
from pyspice_runner.motor.drive import Drive, TwoPhaseDrive, two_phasors
from pyspice_runner.motor.groups import GROUPS
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.refusal import checked
from pyspice_runner.result import Result, contact_row, json_ready
from pyspice_runner.run.point import Point, Settings
from pyspice_runner.steady.copies import Plant
from pyspice_runner.steady.monodromy import Linearised, differentiable
from pyspice_runner.steady.period_map import PeriodMap, Trace, current, forces_on_rotor, modal, speed
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
FINER = 2  # steps in one of the steady state
FEWEST, OFFSETS = 16, 96  # points whose steps lie between each other's, evenly and at most
UNEVEN, JUMP, NARROWEST = 5e-3, 0.1, 1e-3  # shares of a mean by an interval of steps and by its ends; of a step
ACCURATE = 0.05  # error of a transfer function, relative to its magnitude, above which there is a caution
HIGHEST = 0.45  # of the drive's frequency
_SIGNALS = ("speed", "friction", "current_a", "current_b", "motional_a", "motional_b", "electrode")
_CURRENTS = [_SIGNALS.index(groups.named("current", group)) for group in GROUPS]
_SENSED = [*_CURRENTS, _SIGNALS.index("electrode")]


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
        electrode: voltage that the charge of a feedback electrode has beside the drive, over that of each group; its
            image; and the error of the first, shape (3, frequencies, 2).
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
    electrode: Complex = field(repr=False)

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
        found = {
            "modulation": f"{self.modulation_hz[0]:.4g} to {self.modulation_hz[-1]:.4g} Hz; transfers at the lowest"
        }
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
    if not differentiable(plant := Plant.of(point)):
        laws = {law.name: one.name for one, law in zip(point.motor.touching, plant.laws, strict=True)}
        given = " beside ".join(f"{law!r}{f' of {name}' if len(laws) > 1 else ''}" for law, name in laws.items())
        raise ParameterError(
            f"The derivatives of the law {given} are not known. For small signals it may have the elements B, C to "
            "node 0, E, G, R, V (DC) and X, with **, abs, exp, max, min, sqrt, tanh, u and uramp, at all contacts."
        )
    state = settled(point, averages=False)  # about an unstable one there are none
    if not state.stable or state.solution is None:
        raise SimulationError("There is no stable steady state about which small signals would be defined.")
    step = state.step_s / FINER
    period_map = PeriodMap(drive.period, round(drive.period / step), point.solver.timeout)
    known: dict[float, dict[Any, Complex]] = {}
    wanted = (np.arange(min(FEWEST, offsets)) / min(FEWEST, offsets)).tolist()
    while wanted:
        points = [state.solution.moved(at * step, step) for at in wanted]
        Shooting(points, period_map).solve()
        if not all(one.done and one.trace for one in points):
            if known:  # the error shows what is missing
                break
            raise SimulationError("The steady state is not found at the step of the result. Give another step.")
        linear = [_Linear(one, period_map, drive).transfers(modulation) for one in points]
        known = dict(sorted({**known, **dict(zip(wanted, linear, strict=True))}.items()))
        places = np.array([*known])
        gaps = np.diff(places, append=places[0] + 1.0)
        every = {name: np.array([one[name] for one in known.values()]) for name in linear[0]}
        changes = {name: np.abs(np.roll(values, -1, axis=0) - values) for name, values in every.items()}
        found = {name: np.tensordot(0.5 * (gaps + np.roll(gaps, 1)), values, axes=1) for name, values in every.items()}
        wanted = _between(places, gaps, changes, found)[: offsets - len(known)]
    errors = {name: 0.5 * np.sqrt(np.tensordot(gaps**2, change**2, axes=1)) for name, change in changes.items()}
    probed = np.concatenate([drive.frequency - modulation[::-1], drive.frequency + modulation])
    cold = np.array([cold_admittance(point.motor, at) for at in probed.tolist()])
    hot, image = found.pop("hot"), found.pop("image")
    hot_error, _ = errors.pop("hot"), errors.pop("image")
    electrode = np.array([hot[:, 2], image[:, 2], hot_error[:, 2]])
    return SmallSignals(
        state, modulation, found, probed, hot[:, :2], cold, image[:, :2], errors, hot_error[:, :2], electrode
    )


def _between(places: Array, gaps: Array, changes: Mapping[Any, Array], means: Mapping[Any, Complex]) -> list[float]:
    """Return the middles of those intervals that the means over a step depend on, the most uneven first."""
    jumps = np.zeros(len(places))
    for name in means.keys() - {"hot", "image"}:
        share = changes[name] / np.maximum(np.abs(means[name]), np.finfo(float).tiny)
        jumps = np.maximum(jumps, share.max(axis=1))
    wanted = (gaps * jumps > UNEVEN) | ((jumps > JUMP) & (gaps > NARROWEST))
    return [float(places[at] + 0.5 * gaps[at]) for at in np.argsort(-gaps * jumps) if wanted[at]]


@dataclass(frozen=True)
class _Linear:
    """Small signals about a point."""

    point: Orbit  # the point, solved on the map
    period_map: PeriodMap  # the map
    drive: TwoPhaseDrive  # of the point

    def transfers(self, modulation: Array) -> dict[Any, Complex]:
        """Return the transfer functions by output and input, and ``hot`` admittances and their ``image``."""
        plant, trace, drive = self.point.plant, self.point.trace, self.drive
        assert trace is not None
        sides = [("a", 1), ("a", -1), ("b", 1), ("b", -1), ("time", 0), ("shaft", 0)][: 5 + plant.turns]
        probes = [(place, shift * drive.frequency + at) for at in modulation.tolist() for place, shift in sides]
        every = np.array(self._responses(probes, modulation.repeat(len(sides))))
        every = every.reshape(-1, len(sides), len(_SIGNALS), 3)
        wave = np.exp(-2j * pi * drive.frequency * trace.time[1:])
        # phasors of currents and motional currents: the real part of phasor · e^{jΩt} is the current
        base = zip(_SIGNALS, _signals(plant, trace)[:, 1:], strict=True)
        carriers = {name: complex(2.0 * np.mean(signal * wave)) for name, signal in base}
        found: dict[Any, list[complex]] = {}
        for one in every:
            for of, response in _modulated(drive, one).items():
                for output, value in _outputs(response, carriers, of, plant).items():
                    found.setdefault((output, of), []).append(value)
        above, below = (every[:, first:4:2, _SENSED].swapaxes(1, 2) for first in (0, 1))
        hot = np.concatenate([below[::-1, ..., -1].conj(), above[..., 1]])
        image = np.concatenate([below[::-1, ..., 1], above[..., -1].conj()])
        return {name: np.array(values) for name, values in found.items()} | {"hot": hot, "image": image}

    def _responses(self, probes: Sequence[tuple[str, float]], modulation: Array) -> list[Complex]:
        """Return the response to e^{jωt} at each place, where ω may be negative.

        A response has the components of each signal at the modulation plus 0, 1 and −1 times the drive's frequency. At
        ``time`` it is that to a frequency, in addition to the motion with the phase that this adds.
        """
        plant, trace, turns = self.point.plant, self.point.trace, np.exp(2j * pi * modulation * self.period_map.period)
        assert trace
        assert trace.course
        deviations = Linearised([trace.course], self.period_map.discretisation).responses(probes, turns)
        deviations = plant.widened(deviations, trace.course.plant, 1)
        found, base = [], _signals(plant, trace)
        for (place, frequency), at, rows in zip(probes, modulation.tolist(), deviations, strict=True):
            states, normal, friction = np.split(rows, [plant.order, plant.order + len(trace.normal)])
            moved: Any = {"states": trace.states + states, "normal": trace.normal + normal}
            signals = _signals(plant, replace(trace, friction=trace.friction + friction, **moved)) - base
            signals[_CURRENTS] += self._by_source(place, frequency, trace)
            waves = np.exp(-2j * pi * np.outer(trace.time, at + self.drive.frequency * np.array([0, 1, -1])))
            found.append(np.asarray(signals[:, 1:] @ waves[1:] / len(waves[1:]), dtype=complex))
        return found

    def _by_source(self, place: str, frequency: float, trace: Trace) -> Any:
        """Return the currents of both groups that do not follow from the deviation of the motion."""
        motor, carrier, wave = self.point.plant.motor, self.drive.frequency, np.exp(2j * pi * frequency * trace.time)
        if place in "ab":  # the clamped capacitance takes its current from the source alone
            return np.outer(dielectric_matrix(motor, frequency)[:, "ab".index(place)], wave)
        if place == "shaft":
            return 0.0
        volts = np.array(list(two_phasors(self.drive).values()))
        change = dielectric_matrix(motor, carrier + frequency) - dielectric_matrix(motor, carrier)
        other = dielectric_matrix(motor, frequency - carrier) - dielectric_matrix(motor, -carrier)
        turn = np.exp(2j * pi * carrier * trace.time)
        found = (np.outer(change @ volts, turn) + np.outer(other @ volts.conj(), turn.conj())) / (2j * frequency)
        moved, forces = motor.stator.residual_per_volt[:2], np.array([trace.friction[0], trace.normal[0]])
        moved = moved * [[name in pushes(motor, self.point.plant.law)] for name in ("stem_x", "stem")]
        found -= moved.T @ np.gradient(forces, trace.time, axis=1, edge_order=2) / carrier
        return found * wave


def _modulated(drive: TwoPhaseDrive, response: Complex) -> dict[str, Complex]:
    """Return the responses to modulations e^{jωt}, made of side bands.

    With u = Im(U e^{jΩt}), modulating U by a factor 1 + m e^{jωt} adds m e^{jωt}(U e^{jΩt} − U* e^{−jΩt})/2j, and
    modulating its phase by ψ e^{jωt} adds ψ e^{jωt}(U e^{jΩt} + U* e^{−jΩt})/2.
    """
    volts = np.array(list(two_phasors(drive).values()))[:, np.newaxis, np.newaxis]
    above, below = response[0:4:2] * volts, response[1:4:2] * volts.conj()
    turned, grown = 0.5 * radians(1.0) * (above + below)[1], -0.5j * (above - below).sum(axis=0) / drive.voltage
    found = {"amplitude": grown, "phase_deg": turned, "frequency": response[4]}
    return found | ({"load_torque": -response[5]} if len(response) > 5 else {})


def _outputs(response: Complex, carriers: Mapping[str, complex], of: str, plant: Plant) -> dict[str, complex]:
    """Return the outputs of a response to an input."""
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
            own = radians(group == "b") if of == "phase_deg" else 0.0
            turned = -1j * above / carrier + 1j * below / carrier.conjugate() - own
            found[groups.column(f"{kind}_phase", group, "deg")] = turned / radians(1.0)
    return {name: found[name] for name in OUTPUTS if name in found}


def _signals(plant: Plant, trace: Trace) -> Array:
    """Return speed, friction force, currents, motional currents and charge of the electrode in V over a period."""
    currents = [current(plant, group, trace) for group in GROUPS]
    motional = plant.motor.stator.coupling.T @ modal(plant, trace)[1]
    electrode = trace.states[plant.places["feedback"]] if plant.motor.feedback else [0.0 * trace.time]
    return np.array([speed(plant, trace), forces_on_rotor(plant, trace)[1], *currents, *motional, *electrode])


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
