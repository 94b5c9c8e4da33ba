# SPDX-License-Identifier: GPL-3.0-or-later
"""A sampled control loop designed from the small signals of the averaged motor, and tested on its large ones.

The small signals about the steady state, held inputs and a sampled output are a discrete system without approximation:
x(k+1) = e^(A T) x(k) + B(T) u(k). Its transfer function at z = e^(jωT) contains the delay of sampling. The controller
has two gains, which the wanted crossover and phase margin determine.

Below some amplitude, the dead band, the path of the tip fits into the pre-sliding of the contact, and the rotor stands.
A controller whose output passes through this band waits there, or jumps from one edge to the other in a limit cycle.

Source: K. J. Åström, B. Wittenmark, Computer-Controlled Systems, 3rd ed., 1997, chapters 2 and 8.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from itertools import product, takewhile
from math import atan2, copysign, cos, degrees, pi, radians, sin, tan
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.averaged.core import AveragedMotor
from pyspice_runner.control.run import CONTROLLED, ControlledRun
from pyspice_runner.control.simulate import Sample, check_sample_time, simulate_controlled
from pyspice_runner.control.state_space import at_speed, by_input, settled, small_signals_at
from pyspice_runner.errors import ParameterError, SimulationError, require
from pyspice_runner.motor.drive import Load, TwoPhaseDrive
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.result import Result
from pyspice_runner.steady.small_signals import loop_margins
from pyspice_runner.steady.steady import STANDS
from pyspice_runner.units import engineering, linear_words

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Quantity = Literal["speed", "position", "phase"]

POINTS = 600  # of the loop gain over frequency
LOWEST = 1e-3  # of the crossover, at which the loop gain begins
NYQUIST = 0.8  # largest crossover, of half of the sampling rate
LEAST_MARGIN, MOST_MARGIN = 5.0, 120.0  # deg
SAMPLE_TIME = 0.5e-3  # s
# of a loop by default; Åström and Murray, Feedback Systems, 2008, section 9.3: 30 to 60°, and a factor of 2 to 5
MARGINS = (60.0, 65.0, 70.0, 75.0, 80.0, 85.0, 90.0, 45.0)  # deg; an integrator alone and a plant without lag: 90°
LEAST_GAIN_MARGIN = 6.0  # dB
INTEGRAL_PART = 30.0  # deg, smallest lag of a PI controller at the crossover; a PD controller leads by at most 60°
TRIED, SLOWEST, STEP_DEG = 90, 2e-4, 5.0  # crossovers that are tried, the lowest of the highest; step of the margins
ROUNDING = 1.0 + 1e-6  # of a step of the encoder, in the comparison with an error that is a multiple of it
# Phases of a period at which the contact of the plant is evaluated. Where the contact opens, the slope of torque versus
# amplitude exceeds the slope in the full motor by 11 % with 64 phases, as in a run, and by 1 % with 256.
PHASES_OF_PLANT = 256
STEPPED = 5  # samples before the step
CYCLES, FEWEST, MOST = 12.0, 60, 50_000  # of the crossover that a step response lasts; bounds of its samples
SMALL = 0.02  # of the speed: a step of the set point; that of the position passes in a radian of the crossover
SMALL_DEG = 0.2  # step of the phase
_RUN = 50e-3  # s from rest, after which the friction has stopped the rotor, or it turns
_PARTS, _HALVINGS = 8, 5  # of the interval from 0 V to the drive, then of one part, in the search of the dead band
_FALL = 0.01  # of the maximum speed: a fall by less is the settling of a run
_OF_POINT = ("load.", "temperature", "speed")  # of the paths of a spread, those that are not of the motor
# quantity → names and units of the gains
GAINS: dict[str, dict[str, str]] = {
    "speed": {"proportional": "V·s/rad", "integral": "V/rad"},
    "position": {"proportional": "V/rad", "derivative": "V·s/rad"},
    "phase": {"proportional": "Hz/deg", "integral": "Hz/(deg·s)"},
}


@dataclass(frozen=True)
class SpreadPoint:
    """The loop at another operating point: with the gains of the design, and what gains the point itself needs."""

    at: Mapping[str, float]  # path → value that differs from the design
    speed: float | None = None  # of the steady state there, rad/s; ``None`` where there is none
    voltage: float | None = None  # amplitude of group A there, V; ``None`` where none gives the wanted speed
    # with the gains of the design; ``None`` where the loop is not stable or does not cross over
    crossover_hz: float | None = None
    phase_margin_deg: float | None = None  # the same
    gains: Mapping[str, float] | None = None  # that give the wanted crossover and margin there; ``None`` where none do
    reason: str = ""  # why something is ``None``


@dataclass(frozen=True, repr=False)
class ControlLoop(Result):
    """A designed loop.

    Attributes:
        quantity: the controlled quantity.
        gains: the gains of the controller, SI units and degrees: ``proportional`` and ``integral`` of the error, or for
            a position ``derivative``, which acts on the measured speed.
        crossover_hz: frequency at which the loop gain is 1.
        phase_margin_deg: phase of the loop gain there, above −180°.
        gain_margin_db: factor by which the loop gain may grow until the loop oscillates; ``None`` without bound.
        overshoot: of a small step of the set point, relative to the step, by the small signals.
        overshoot_simulated: the same of the averaged motor.
        frequency_hz: frequencies up to half of the sampling rate.
        plant: from the controller's output (V, or Hz for a phase) to the measured quantity.
        loop_gain: of controller and plant.
        time_s: sample times of the step response.
        step_predicted: the response by the small signals over the step.
        step_simulated: that of the averaged motor.
        model_cautions: cautions about the signs of the gains.
        provenance: motor, drive, operating point and settings, JSON-ready.
        spread: the loop at other operating points, which is a schedule of the gains as well.
        dead_band_v: amplitude of group A below which the motor stands at this load; ``None`` for a phase.
        simulated: the run of the averaged motor with the step.
    """

    quantity: Quantity
    gains: Mapping[str, float]
    crossover_hz: float
    phase_margin_deg: float
    gain_margin_db: float | None
    overshoot: float
    overshoot_simulated: float
    frequency_hz: Array = field(repr=False)
    plant: Complex = field(repr=False)
    loop_gain: Complex = field(repr=False)
    time_s: Array = field(repr=False)
    step_predicted: Array = field(repr=False)
    step_simulated: Array = field(repr=False)
    model_cautions: tuple[str, ...] = field(repr=False)
    provenance: dict[str, Any] = field(repr=False)
    spread: tuple[SpreadPoint, ...] = ()
    dead_band_v: float | None = None
    simulated: ControlledRun | None = field(default=None, repr=False)

    @property
    def trusted(self) -> bool:
        """Whether the simulated step is trusted, by the estimate of its errors; it takes about 1 s."""
        return self.simulated is not None and self.simulated.trusted

    @property
    def gain_units(self) -> dict[str, str]:
        """Units of the gains."""
        units = GAINS[self.quantity]
        return {name: linear_words(unit) if self.linear else unit for name, unit in units.items()}

    def _limits(self) -> Iterator[str]:
        """Yield the cautions of the simulated step, and operating points at which the loop is not stable."""
        yield from (*self.model_cautions, *(self.simulated.cautions if self.simulated else ()))
        if lost := [one for one in self.spread if one.phase_margin_deg is None]:
            yield f"At {len(lost)} of {len(self.spread)} operating points the loop has no margin: {lost[0].reason}"

    def columns(self) -> Mapping[str, Array]:
        """Return plant and loop gain over frequency."""
        return {
            "frequency_hz": self.frequency_hz, "plant_re": self.plant.real, "plant_im": self.plant.imag,
            "loop_gain_re": self.loop_gain.real, "loop_gain_im": self.loop_gain.imag,
        }  # fmt: skip

    def summary(self) -> dict[str, str]:
        """Return gains, margins and overshoot."""
        shown = {f"{name} gain": f"{value:.4g} {self.gain_units[name]}" for name, value in self.gains.items()}
        bound = "none" if self.gain_margin_db is None else f"{self.gain_margin_db:.3g} dB"
        by_design, of_motor = (round(100.0 * share, 2) for share in (self.overshoot, self.overshoot_simulated))
        shown |= {
            "crossover": f"{self.crossover_hz:.4g} Hz",
            "phase margin": f"{self.phase_margin_deg:.3g}°",
            "gain margin": bound,
            "overshoot": f"{by_design:.3g} %, averaged motor {of_motor:.3g} %",
        }
        if margins := [one.phase_margin_deg for one in self.spread if one.phase_margin_deg is not None]:
            places = [one.crossover_hz for one in self.spread if one.crossover_hz is not None]
            shown["over the spread"] = (
                f"{min(margins):.3g} to {max(margins):.3g}° at {min(places):.4g} to {max(places):.4g} Hz, "
                f"{len(margins)} of {len(self.spread)} points"
            )
        at = self.provenance["run"]["operating_point"]
        shown["operating point"] = f"{at['speed']:.4g} rad/s, phase of the current {at['current_phase_a']:.4g}°"
        shown["sample time"] = engineering(self.provenance["run"]["sample_time_s"], "s")
        if self.dead_band_v is not None:
            shown["dead band"] = f"{self.dead_band_v:.3g} V"
        return self._localised(shown)

    def to_dict(self) -> dict[str, Any]:
        """Return gains, margins, overshoot, step responses and settings, JSON-ready."""
        names = (
            "gains", "gain_units", "crossover_hz", "phase_margin_deg", "gain_margin_db", "overshoot",
            "overshoot_simulated", "trusted", "dead_band_v",
        )  # fmt: skip
        step = self._entries("time_s", "step_predicted", "step_simulated")
        spread = {"spread": [asdict(one) for one in self.spread]} if self.spread else {}
        return {
            "quantity": self.quantity, **spread, **self._entries(*names), "step": step, **self.provenance,
            **self._entries("cautions"),
        }  # fmt: skip


class LoopController:
    """A designed controller: PI of a speed or a phase about its operating point, PD of a position.

    That of a position adds the dead band to the magnitude of its output, whose sign is that of the phase. It switches
    the drive off within its dead zone about the set point.

    Args:
        loop: the design.
        set_point: time in s → wanted value of the quantity: rad/s, rad or deg.
        dead_zone: of a position, rad or m; by default a step of the encoder of the run.
    """

    def __init__(
        self, loop: ControlLoop, set_point: Callable[[float], float], dead_zone: float | None = None
    ) -> None:  # fmt: skip
        run, self._drive = loop.provenance["run"], loop.provenance["drive"]
        self.quantity, self.set_point = loop.quantity, set_point
        self._proportional, self._other = loop.gains.values()
        self._step, self._sum, self._dead_band = run["sample_time_s"], 0.0, loop.dead_band_v or 0.0
        self._reverses = self._drive["ratio_b"] * abs(sin(radians(self._drive["phase_deg"]))) > 1e-6
        self._dead_zone, self._encoder_step = dead_zone, 0.0

    def take_encoder_step(self, step: float) -> None:
        """Take the step of the encoder in rad, or m, from ``simulate_controlled``; 0 for an ideal one."""
        self._encoder_step = step

    def __call__(self, sample: Sample) -> Mapping[str, float]:
        """Return the amplitudes, or of a phase the frequency, until the next sample."""
        wanted = self.set_point(sample.time_s)
        if self.quantity == "phase":
            error = (wanted - sample.current_phase_deg + 180.0) % 360.0 - 180.0
            return {"frequency": self._drive["frequency"] + self._regulated(error)}
        if self.quantity == "speed":
            voltage = self._drive["voltage"] + self._regulated(wanted - sample.speed_rad_s)
            return {"voltage_a": voltage, "voltage_b": self._drive["ratio_b"] * voltage}
        error, zone = wanted - sample.position_rad, self._dead_zone
        zone = self._encoder_step if zone is None else zone
        output = self._proportional * error - self._other * sample.speed_rad_s
        rests = abs(error) <= zone * ROUNDING or (not self._reverses and output < 0.0)
        most = 2.0 * self._drive["voltage"] - self._dead_band  # the gains are those about the voltage of the design
        voltage = 0.0 if rests else min(self._dead_band + abs(output), most)
        phase = copysign(self._drive["phase_deg"], output * self._drive["phase_deg"])
        return {"voltage_a": voltage, "voltage_b": self._drive["ratio_b"] * voltage, "phase_deg": phase}

    def _regulated(self, error: float) -> float:
        """Return the output of the PI controller."""
        self._sum += self._step * error
        return float(self._proportional * error + self._other * self._sum)


def over_amplitudes(motor: Motor, drive: TwoPhaseDrive, load_torque: float) -> tuple[float, dict[float, float]]:
    """Return the dead band of group A in V, and amplitudes from one that does not turn the motor on, with the speed.

    Each run begins at rest; group B has its ratio. Raise SimulationError if the equations have no solution.
    """
    running = AveragedMotor(motor)

    def speed(voltage: float) -> float:
        running.begin(
            amplitude_a=voltage, amplitude_b=voltage * drive.ratio_b, phase=drive.phase_deg, frequency=drive.frequency,
            load_torque=load_torque,
        )  # fmt: skip
        running.advance(0.0, 0.5 * _RUN)
        half = running.get("position")
        running.advance(0.5 * _RUN, _RUN)
        return (running.get("position") - half) / (0.5 * _RUN)

    speeds = dict[float, float]()
    for voltage in (drive.voltage * np.arange(_PARTS, 0, -1) / _PARTS).tolist():
        speeds[voltage] = speed(voltage)
        if abs(speeds[voltage]) <= STANDS:
            break
    direction = copysign(1.0, speeds[drive.voltage])  # of all amplitudes above the dead band
    high = min(takewhile(lambda one: direction * speeds[one] > STANDS, speeds), default=drive.voltage)
    low = high - drive.voltage / _PARTS
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if direction * speed(middle) > STANDS else (middle, high)
    return 0.5 * (low + high), dict(reversed(speeds.items()))


def _wrong_signs(gain: float, speed: float, drive: TwoPhaseDrive, speeds: Mapping[float, float]) -> Iterator[str]:
    """Yield a caution for a motor that turns against its phase, and one for amplitudes that need the opposite gain."""
    if speed * sin(radians(drive.phase_deg)) < 0.0:
        yield (
            f"The motor turns at {speed:.3g} rad/s, against the sign of the phase of {drive.phase_deg:g}°: the gains "
            f"are {'negative' if gain < 0.0 else 'positive'}. A motor that turns the other way runs away with them: "
            "check the direction at this drive. If it differs, exchange groups A and B."
        )
    rises = gain * np.diff([0.0, *speeds.values()])
    if (rises < -_FALL * max(map(abs, speeds.values()))).any():
        found = ", ".join(f"{one:.3g} rad/s at {voltage:.3g} V" for voltage, one in speeds.items() if abs(one) > STANDS)
        yield (
            f"The effect of the amplitude changes its sign below the drive: {found}. Where it is opposite, the loop "
            "runs away. Choose a frequency and a phase at which the speed rises with the amplitude."
        )


@dataclass(frozen=True)
class _Plant:
    """Averaged motor and sampling about the steady state, as a discrete system."""

    quantity: Quantity
    sample_time: float  # s
    transition: Array  # states after a sample time, by those before it
    held: Array  # the same, by the held input
    row: Array  # states → angle, or phase integrated over time in deg·s
    point: Mapping[str, float]  # the steady state of a run

    def sign(self, crossover: float) -> float:
        """Return the sign of the effect of the input, far below a crossover in Hz."""
        slow = complex(self.response(np.array([LOWEST * crossover]))[0])
        return -1.0 if (slow * (1j if self.quantity == "position" else 1.0)).real < 0.0 else 1.0

    def response(self, frequency: Array) -> Complex:
        """Return the transfer function from the input to a sample: a mean since the last one, or the present angle."""
        z = np.exp(2j * pi * frequency * self.sample_time)
        shifted = z[:, np.newaxis, np.newaxis] * np.eye(len(self.transition)) - self.transition
        found = np.linalg.solve(shifted, self.held[:, np.newaxis])[..., 0] @ self.row
        return np.asarray(found if self.quantity == "position" else found * (1.0 - 1.0 / z) / self.sample_time)


def sampled_loop(
    motor: Motor, drive: TwoPhaseDrive, quantity: Quantity, crossover: float | None, margin: float | None,
    sample_time: float, load_torque: float, over: Mapping[str, Sequence[float]] | None,
) -> ControlLoop:  # fmt: skip
    """Design a sampled controller about the steady state at a drive; the arguments are those of :func:`.control_loop`.

    The controller of the ``speed`` is u = V₀ + k (e + (T/T_i) Σ e), which sets the amplitude of both groups in
    proportion; e is the error of the mean speed since the last sample, T the sample time. That of the ``position`` is
    u = V_d + |k (e − T_d ω)| with the dead band V_d and the mean speed ω; the set point of the design moves at the
    speed of the steady state. That of the ``phase`` sets the frequency by the phase of the mean current into group A,
    like that of the speed.
    """
    check_sample_time(sample_time, drive)
    highest = 0.5 * NYQUIST / sample_time
    allowed = f"from {SLOWEST * highest:.3g} to {highest:.4g} Hz, {NYQUIST:g} times half of the sampling rate"
    require(crossover is None or SLOWEST * highest <= crossover <= highest, "crossover", crossover, allowed, unit="Hz")
    allowed = f"from {LEAST_MARGIN:g} to {MOST_MARGIN:g}°"
    require(margin is None or LEAST_MARGIN <= margin <= MOST_MARGIN, "margin", margin, allowed, unit="°")
    plant = _plant(motor, drive, load_torque, quantity, sample_time)
    band, cautions = None, list[str]()
    if quantity != "phase":
        band, speeds = over_amplitudes(motor, drive, load_torque)
        cautions = list(_wrong_signs(plant.sign(highest), plant.point["speed"], drive, speeds))
    try:
        crossover, margin = _chosen(plant, crossover, margin)
    except (ParameterError, SimulationError) as error:
        raise type(error)(" ".join((str(error), *cautions))) from None
    gain, ratio = _gains(plant, crossover, margin)
    frequency = np.geomspace(LOWEST * crossover, 0.5 / sample_time, POINTS)
    responses = plant.response(frequency)
    loop = _controller(plant, gain, ratio, frequency) * responses
    found, phase_margin, gain_margin = loop_margins(frequency, loop)
    count = min(max(FEWEST, int(CYCLES / crossover / sample_time)), MOST)
    predicted = _predicted(plant, gain, ratio, count)
    designed = ControlLoop(
        quantity=quantity,
        gains=_named(quantity, gain, ratio, sample_time),
        crossover_hz=found, phase_margin_deg=phase_margin, gain_margin_db=gain_margin,
        overshoot=max(0.0, float(predicted.max()) - 1.0), overshoot_simulated=0.0,
        frequency_hz=frequency, plant=responses, loop_gain=loop,
        time_s=np.linspace(0.0, sample_time * (count - 1), count), step_predicted=predicted, step_simulated=np.zeros(0),
        model_cautions=tuple(cautions), dead_band_v=band,
        provenance={
            "motor": motor.to_dict(),
            "drive": drive.model_dump(),
            "run": {
                "crossover_hz": crossover, "margin_deg": margin, "sample_time_s": sample_time,
                "load_torque_n_m": load_torque, "operating_point": dict(plant.point),
            },
        },
    )  # fmt: skip
    if over:
        designed = replace(designed, spread=_spread(designed, motor, drive, (gain, ratio), over))
    return _simulated(designed, motor, drive)


def _spread(
    loop: ControlLoop,
    motor: Motor,
    drive: TwoPhaseDrive,
    fixed: tuple[float, float],
    over: Mapping[str, Sequence[float]],
) -> tuple[SpreadPoint, ...]:
    """Return the loop with its gain and ratio at the points of a grid."""
    if "speed" in over and {"drive.voltage", "drive.voltage_b"} & over.keys():
        raise ParameterError("over: the amplitude sets the speed. Give speed or drive.voltage, not both.")
    run, found = loop.provenance["run"], []
    for values in product(*over.values()):
        at = dict(zip(over, map(float, values), strict=True))
        of_motor = {path: value for path, value in at.items() if not path.startswith(("drive.", *_OF_POINT))}
        of_drive = {path.removeprefix("drive."): value for path, value in at.items() if path.startswith("drive.")}
        changed = motor.updated(of_motor)
        if "temperature" in at:
            changed = Thermal.of(motor).warmed(changed, at["temperature"])
        load_torque = at.get("load.torque", run["load_torque_n_m"])
        Load(None, load_torque).check(changed)
        point = SpreadPoint(at)
        try:
            there = drive.updated(of_drive)
            if "speed" in at:
                there = at_speed(changed, there, load_torque, at["speed"])
            plant = _plant(changed, there, load_torque, loop.quantity, run["sample_time_s"])
            point = replace(point, speed=plant.point["speed"], voltage=there.voltage)
            if plant.sign(run["crossover_hz"]) * fixed[0] < 0.0:
                raise SimulationError("The gain of the motor has the opposite sign there: the loop runs away.")
            _predicted(plant, *fixed, 1)  # which raises for a loop that is not stable
            responses = _controller(plant, *fixed, loop.frequency_hz) * plant.response(loop.frequency_hz)
            crossover, margin, _ = loop_margins(loop.frequency_hz, responses)
            point = replace(point, crossover_hz=crossover, phase_margin_deg=margin)
        except SimulationError as error:
            point = replace(point, reason=str(error))
        if point.speed is not None:
            try:
                gains = _gains(plant, run["crossover_hz"], run["margin_deg"])
                _predicted(plant, *gains, 1)
                point = replace(point, gains=_named(loop.quantity, *gains, run["sample_time_s"]))
            except (ParameterError, SimulationError) as error:
                point = replace(point, reason=point.reason or str(error))
        found.append(point)
    return tuple(found)


def _named(quantity: Quantity, gain: float, ratio: float, sample_time: float) -> dict[str, float]:
    """Return the gains of a controller in its units."""
    first, second = GAINS[quantity]
    return {first: gain, second: gain * (ratio * sample_time if quantity == "position" else ratio / sample_time)}


def _plant(motor: Motor, drive: TwoPhaseDrive, load_torque: float, quantity: Quantity, sample_time: float) -> _Plant:
    point, small = small_signals_at(motor, drive, load_torque, PHASES_OF_PLANT)
    if quantity != "phase" and abs(point["speed"]) < STANDS:
        raise SimulationError(
            f"The motor stands still at {drive.label}: there the amplitude has no small effect. Raise the voltage."
        )
    driven = by_input(small, drive, "frequency" if quantity == "phase" else "amplitude")
    states = len(small.by_state)
    block = np.zeros((states + 1, states + 1))
    block[:states, :states], block[:states, states] = small.by_state, driven
    from scipy.linalg import expm, matrix_balance  # takes long to load

    balanced, scale = matrix_balance(sample_time * block, permute=False)  # the units of the states differ by decades
    held = scale @ expm(balanced) @ np.linalg.inv(scale)
    row = np.zeros(states)
    if quantity == "phase":
        turned = np.exp(-1j * radians(point["current_phase_a"])) / point["current_amplitude_a"]
        row[small.place["charge_1"]] = degrees(turned.imag)
        row[small.place["charge_2"]] = degrees(turned.real)
    else:
        row[small.place["position"]] = 1.0
    running = settled(motor, drive, load_torque)
    point = {name: running.get(name) for name in point}
    return _Plant(quantity, sample_time, held[:states, :states], held[:states, states], row, point)


def _gains(plant: _Plant, crossover: float, margin: float) -> tuple[float, float]:
    """Return gain k and ratio: T/T_i of a PI controller, T_d/T of one of the position."""
    at = np.array([crossover])
    value = complex(plant.response(at)[0])
    half = pi * crossover * plant.sample_time  # ω T/2
    sign = plant.sign(crossover)  # of a plant with a negative gain the controller has one too
    phase = atan2((sign * value).imag, (sign * value).real)
    phase -= 2.0 * pi if phase > 0.5 * pi else 0.0
    turned = radians(margin - 180.0) - phase  # phase of the controller
    alone, reach = degrees(phase) + 180.0, degrees(0.5 * pi - half)  # margin without its phase, and its largest phase
    if plant.quantity == "position":
        # 1 + r (1 − e^{−jωT}) has the phase atan(r sin ωT / (1 + r (1 − cos ωT)))
        kind, least, most = "PD", alone, alone + reach
        opposite = sin(2.0 * half) - tan(turned) * (1.0 - cos(2.0 * half))
    else:
        # 1 + r/(1 − e^{−jωT}) = 1 + r/2 − j (r/2) cot(ωT/2)
        kind, least, most = "PI", alone - reach, alone
        turned = -turned
        opposite = 0.5 * (1.0 / tan(half) - tan(turned))
    if not (0.0 <= turned < 0.5 * pi and opposite > 0.0):
        raise ParameterError(
            f"crossover = {crossover:g} Hz with margin = {margin:g}° is not possible: a {kind} controller gives "
            f"{least:.3g} to {most:.3g}° there. Change one of them."
        )
    ratio = tan(turned) / opposite
    return sign / abs(value * complex(_controller(plant, 1.0, ratio, at)[0])), ratio


def _chosen(plant: _Plant, crossover: float | None, margin: float | None) -> tuple[float, float]:
    """Return crossover in Hz and margin in degrees: what is given, and the rest as :func:`sampled_loop` describes.

    Raise ParameterError for what is given and not possible, SimulationError if no loop is.
    """
    highest = 0.5 * NYQUIST / plant.sample_time
    all_places = [float(f"{at:.2g}") for at in np.geomspace(highest, SLOWEST * highest, TRIED)]
    all_margins = np.arange(LEAST_MARGIN, MOST_MARGIN + 1.0, STEP_DEG).tolist()
    places = all_places if crossover is None else [crossover]
    margins = sorted(all_margins, key=lambda one: abs(one - MARGINS[0])) if margin is None else [margin]
    tried = [*product(MARGINS if crossover is margin is None else margins, places)]
    for works in (_robust, _stable) if crossover is None else (_stable,):
        for one, at in tried:
            if works(plant, at, one):
                return at, one
    if crossover is margin is None:
        raise SimulationError("No loop is stable by the small signals here. Change the drive or the sample time.")
    possible = []
    if there := [one for one in all_margins if any(_stable(plant, at, one) for at in places)]:
        kind = "PD" if plant.quantity == "position" else "PI"
        possible.append(f"a {kind} controller gives {min(there):g} to {max(there):g}°{' there' if crossover else ''}")
    if where := [at for at in all_places if any(_stable(plant, at, one) for one in margins)]:
        possible.append(f"crossovers from {min(where):g} to {max(where):g} Hz are possible")
    given = [f"crossover = {crossover:g} Hz"] if crossover is not None else []
    given += [f"margin = {margin:g}°"] if margin is not None else []
    reason = "; ".join(possible) or "no such loop is stable"
    raise ParameterError(f"{' with '.join(given)} is not possible: {reason}.")


def _stable(plant: _Plant, crossover: float, margin: float) -> bool:
    """Whether a controller gives crossover and margin, in a loop that is stable."""
    with suppress(ParameterError, SimulationError):
        _predicted(plant, *_gains(plant, crossover, margin), 1)
        return True
    return False


def _robust(plant: _Plant, crossover: float, margin: float) -> bool:
    """Whether such a loop has the margins of one by default at every crossing, and enough integral action."""
    if not _stable(plant, crossover, margin):
        return False
    gain, ratio = _gains(plant, crossover, margin)
    frequency = np.geomspace(LOWEST * crossover, 0.5 / plant.sample_time, POINTS)
    _, worst, bound = loop_margins(frequency, _controller(plant, gain, ratio, frequency) * plant.response(frequency))
    turned = abs(degrees(np.angle(_controller(plant, 1.0, ratio, np.array([crossover]))[0])))
    integral = 90.0 - turned if plant.quantity == "position" else turned
    return integral >= INTEGRAL_PART and worst >= margin - 1.0 and (bound is None or bound >= LEAST_GAIN_MARGIN)


def _controller(plant: _Plant, gain: float, ratio: float, frequency: Array) -> Complex:
    back = np.exp(-2j * pi * frequency * plant.sample_time)
    part = 1.0 - back if plant.quantity == "position" else 1.0 / (1.0 - back)
    return np.asarray(gain * (1.0 + ratio * part))


def _predicted(plant: _Plant, gain: float, ratio: float, count: int) -> Array:
    """Return the samples after a unit step of the set point, by the small signals.

    Raise SimulationError for a loop that is not stable.
    """
    states, position = len(plant.transition), plant.quantity == "position"
    last, memory = np.eye(states + 2)[states:]  # the row before, and the sum of the errors or the angle before
    now = np.append(plant.row, [0.0, 0.0])
    sample = now if position else (now - last) / plant.sample_time
    kept = now if position else memory - sample
    output = -gain * (now + ratio * (now - memory)) if position else gain * (ratio * kept - sample)
    moved = np.hstack([plant.transition, np.zeros((states, 2))]) + np.outer(plant.held, output)
    after = np.vstack([moved, now, kept])
    # the angle itself, and the charge, are integrals that a loop of their mean does not hold
    if np.abs(np.linalg.eigvals(after)).max() > 1.0 + 1e-6:
        raise SimulationError("The loop is not stable by the small signals: lower the crossover or raise the margin.")
    by_reference = np.append(plant.held * gain * (1.0 if position else 1.0 + ratio), [0.0, 0.0 if position else 1.0])
    whole, samples = np.zeros(states + 2), []
    for _ in range(count):
        samples.append(float(sample @ whole))
        whole = after @ whole + by_reference
    return np.array(samples)


def _simulated(loop: ControlLoop, motor: Motor, drive: TwoPhaseDrive) -> ControlLoop:
    """Return a loop with the response of the averaged motor to a step, relative to the step."""
    run = loop.provenance["run"]
    period, count = run["sample_time_s"], len(loop.time_s)
    speed, phase = (run["operating_point"][name] for name in ("speed", "current_phase_a"))
    step = {
        "speed": SMALL * speed, "position": SMALL * speed / (2.0 * pi * run["crossover_hz"]), "phase": SMALL_DEG,
    }[loop.quantity]  # fmt: skip
    rate, start = {"speed": (0.0, speed), "position": (speed, 0.0), "phase": (0.0, phase)}[loop.quantity]
    lead = 0.0  # of the set point of a moving position
    if loop.quantity == "position":
        proportional, derivative = loop.gains.values()
        lead = (drive.voltage - (loop.dead_band_v or 0.0) + derivative * speed) / proportional

    def set_point(time: float) -> float:
        return float(start + lead + rate * time + step * (time > (STEPPED + 0.5) * period))

    result = simulate_controlled(
        motor, drive, LoopController(loop, set_point), duration=(STEPPED + count + 0.5) * period, sample_time=period,
        load_torque=run["load_torque_n_m"], start="steady",
    )  # fmt: skip
    deviation = result.samples[CONTROLLED[loop.quantity]] - start - rate * result.time_s
    if loop.quantity == "phase":
        deviation = (deviation + 180.0) % 360.0 - 180.0
    response = np.asarray(deviation[STEPPED:] / step)
    return replace(
        loop, step_simulated=response, overshoot_simulated=max(0.0, float(response.max()) - 1.0),
        simulated=result,
    )  # fmt: skip
