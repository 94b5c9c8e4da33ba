# SPDX-License-Identifier: GPL-3.0-or-later
r"""The averaged motor about a steady state as a linear system: A, B, C and D with names and units.

.. math::
    \dot x = A x + B u, \qquad y = C x + D u

All signals are deviations from the steady state. The states are those of the averaged motor in C that move.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from math import copysign, degrees
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.averaged.core import INPUTS, AveragedMotor, LinearMotor
from pyspice_runner.averaged.errors import DECAYS, estimate
from pyspice_runner.averaged.library import PHASES
from pyspice_runner.averaged.point import AveragedPoint
from pyspice_runner.averaged.run import ErrorEstimate, Estimated
from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.motor.drive import TwoPhaseDrive, too_fast
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.refusal import checked
from pyspice_runner.result import Result
from pyspice_runner.run.dynamometer import stuck
from pyspice_runner.run.point import Point
from pyspice_runner.units import linear_unit

Array = NDArray[np.float64]

# names and units
OF_INPUTS = {"amplitude": "V", "phase": "deg", "frequency": "Hz", "load_torque": "N·m"}
OF_OUTPUTS = {"speed": "rad/s", "position": "rad", "current_amplitude_a": "A", "current_phase_a": "deg"}
SHOWN = (  # of the steady state
    "speed", "torque", "current_amplitude_a", "current_phase_a", "check", "separated", "slip", "tip_y_amplitude",
)  # fmt: skip
OF_STATES = {
    "speed": "rad/s", "position": "rad", "load_speed": "rad/s", "load_position": "rad", "temperature": "K",
    "carrier_velocity": "m/s", "carrier_x_velocity": "m/s", "bearing": "1",
}  # fmt: skip
ROUNDING = 1e-15  # of the largest entry of a row of A, below which an entry is none
LENGTH = "m"  # unit of the other states
RAISED, MOST_RAISED = 1.25, 4.0  # factors of the amplitude in the search for a speed
AT_SPEED = 1e-3  # of the speed: where no amplitude comes closer, the speed jumps


@dataclass(frozen=True, repr=False)
class StateSpace(Estimated, Result):
    """The averaged motor about a steady state.

    Attributes:
        a: rates of the states by the states.
        b: rates of the states by the inputs.
        c: outputs by the states.
        d: outputs by the inputs.
        states: names of the states and their units.
        inputs: names of the inputs and their units: ``amplitude`` of group A, that of B in proportion; ``phase`` of
            group B; ``frequency``; ``load_torque``.
        outputs: names of the outputs and their units.
        point: the steady state: outputs, torque, and the check of the averaged model.
        provenance: motor, drive and load, JSON-ready.
        find_error: returns the estimate of the errors at the steady state, at its speed.
    """

    a: Array = field(repr=False)
    b: Array = field(repr=False)
    c: Array = field(repr=False)
    d: Array = field(repr=False)
    states: Mapping[str, str]
    inputs: Mapping[str, str]
    outputs: Mapping[str, str]
    point: Mapping[str, float]
    provenance: dict[str, Any] = field(repr=False)
    find_error: Callable[[], ErrorEstimate] = field(repr=False)

    def _limits(self) -> Iterator[str]:
        """Yield why the averaged motor is not trusted at the steady state, a speed beyond its limit, and stick."""
        yield from self._doubts()
        yield from too_fast(self.provenance["motor"], self.point["speed"])
        if stuck(self.point):
            yield (
                "Friction holds the shaft, which stands still: the system is that of a contact that sticks, whose "
                "shaft no input turns. Raise the voltage."
            )

    def transfer(self, output: str, of: str, frequency: Array) -> NDArray[np.complex128]:
        """Return a transfer function over frequency in Hz.

        Raises:
            ParameterError: for a name that is not known.
        """
        if output not in self.outputs or of not in self.inputs:
            raise ParameterError(
                f"There is no transfer from {of} to {output}: inputs are {', '.join(self.inputs)}, outputs are "
                f"{', '.join(self.outputs)}."
            )
        row, column = list(self.outputs).index(output), list(self.inputs).index(of)
        s = 2j * np.pi * np.atleast_1d(frequency)[:, np.newaxis, np.newaxis]
        moved = np.linalg.solve(s * np.eye(len(self.a)) - self.a, self.b[:, [column]])[..., 0]
        return np.asarray(moved @ self.c[row] + self.d[row, column])

    def to_control(self) -> Any:
        """Return the system as a ``control.StateSpace`` of python-control, with the names of its signals.

        Raises:
            ParameterError: if python-control is not installed.
        """
        try:
            import control
        except ImportError:
            raise ParameterError("python-control is not installed: pip install 'piezomotor[control]'.") from None
        names = {"states": list(self.states), "inputs": list(self.inputs), "outputs": list(self.outputs)}
        return control.ss(self.a, self.b, self.c, self.d, name=self.provenance["motor"]["name"], **names)

    def writers(self) -> dict[str, Callable[[Path], object]]:
        """Return the endings: ``.json``, and ``.mat`` with A, B, C, D, names and units."""
        return super().writers() | {".mat": self._write_mat}

    def _write_mat(self, file: Path) -> None:
        from scipy.io import savemat

        values: dict[str, Any] = {"A": self.a, "B": self.b, "C": self.c, "D": self.d}
        for name in ("states", "inputs", "outputs"):
            known = getattr(self, name)
            values[name] = np.array(list(known), dtype=object)
            values[f"{name[:-1]}_units"] = np.array(list(known.values()), dtype=object)
        with file.open("wb") as stream:
            savemat(stream, values | {"point": dict(self.point)})

    def summary(self) -> dict[str, str]:
        """Return the steady state, the number of states and the slowest poles."""
        poles = np.linalg.eigvals(self.a)
        moving = poles[np.abs(poles) > 1e-6 * np.abs(poles).max() / len(poles)]
        slowest = moving[np.argsort(np.abs(moving.real))][:3]
        return self._localised({
            "speed": f"{self.point['speed']:.4g} rad/s",
            "torque": f"{self.point['torque']:.4g} N·m",
            "states": str(len(self.states)),
            "inputs": ", ".join(f"{name} in {unit}" for name, unit in self.inputs.items()),
            "outputs": ", ".join(f"{name} in {unit}" for name, unit in self.outputs.items()),
            "slowest poles": ", ".join(f"{pole:.4g} 1/s" for pole in slowest),
        })  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """Return matrices, names, units and the steady state, JSON-ready."""
        return {**self._entries("a", "b", "c", "d", "states", "inputs", "outputs", "point"), **self.provenance,
                **self._entries("trusted", "error_estimate", "cautions")}  # fmt: skip


def settled(motor: Motor, drive: TwoPhaseDrive, load_torque: float, phases: int = PHASES) -> AveragedMotor:
    """Return an averaged motor in its steady state at a drive, under a load torque in N·m.

    Raise ParameterError for a load that is out of range or a drive that does not suit the motor.
    """
    point = Point.of(motor, drive.model_copy(update={"soft_start": 0.0}), load_torque=load_torque)
    running = AveragedPoint.of(point, 0.0, phases=phases).compiled()
    running.settle()
    return running


def small_signals_at(
    motor: Motor, drive: TwoPhaseDrive, load_torque: float, phases: int = PHASES
) -> tuple[dict[str, float], LinearMotor]:
    """Return values of the steady state at a drive, under a load torque in N·m, and the small signals about it.

    Averages over a period do not describe a free vibration that is not slow against it, such as that of a mode far from
    the drive. Its pole may lie on the wrong side; the integration damps it, and here it is put to the other side.
    """
    from scipy.linalg import eig, matrix_balance  # takes long to load

    running = settled(motor, drive, load_torque, phases)
    found = running.linearised()
    balanced, (scale, _) = matrix_balance(found.by_state, permute=False, separate=True)
    poles, left, right = eig(balanced, left=True)
    wrong = np.flatnonzero((poles.real > 0.0) & (np.abs(poles.imag) > np.pi * drive.frequency))
    for place in wrong.tolist():
        row, column = left[:, place].conj(), right[:, place]
        # the sum over a pole and its conjugate is real
        balanced = balanced - np.real(2.0 * poles[place].real * np.outer(column, row) / (row @ column))
    by_state = balanced * scale[:, np.newaxis] / scale if wrong.size else found.by_state
    return {name: running.get(name) for name in SHOWN}, replace(found, by_state=by_state)


def by_input(small: LinearMotor, drive: TwoPhaseDrive, name: str) -> Array:
    """Return the rates of the states by an input of :data:`OF_INPUTS`."""
    parts = {"amplitude_a": 1.0, "amplitude_b": drive.ratio_b} if name == "amplitude" else {name: 1.0}
    return np.asarray(sum(weight * small.by_input[:, INPUTS.index(of_c)] for of_c, weight in parts.items()))


def at_speed(motor: Motor, drive: TwoPhaseDrive, load_torque: float, speed: float) -> TwoPhaseDrive:
    """Return a drive with the amplitude that brings a motor under a load to a speed in rad/s, group B in proportion.

    Raise SimulationError if no amplitude up to :data:`MOST_RAISED` times that of the drive does.
    """
    from scipy.optimize import brentq  # takes long to load

    def with_voltage(voltage: float) -> TwoPhaseDrive:
        return drive.model_copy(update={"voltage": voltage})

    def beyond(voltage: float) -> float:
        return copysign(1.0, speed) * (settled(motor, with_voltage(voltage), load_torque).get("speed") - speed)

    low = high = drive.voltage
    while beyond(low) > 0.0 and low > drive.voltage / MOST_RAISED**2:
        low, high = low / RAISED, low
    while beyond(high) < 0.0:
        low, high = high, high * RAISED
        if high > MOST_RAISED * drive.voltage:
            raise SimulationError(
                f"No amplitude up to {low:.4g} V brings the motor to {speed:g} rad/s. Change the speed."
            )
    found = float(brentq(beyond, low, high, rtol=1e-6)) if high > low else low
    if abs(beyond(found)) > AT_SPEED * abs(speed):
        raise SimulationError(
            f"No amplitude brings the motor to {speed:g} rad/s: at {found:.4g} V its speed jumps. Change the speed."
        )
    return with_voltage(found)


def _moving(by_state: NDArray[np.bool_], by_input: Array, outputs: Array) -> list[int]:
    """Return the states that something moves and that move something: what a motor does not have is left out."""
    kept, count = list(range(len(by_state))), 0
    while count != len(kept):
        count = len(kept)
        kept = [place for place in kept if by_state[place, kept].any() or by_input[place].any()]
        others = {place: [other for other in kept if other != place] for place in kept}
        kept = [place for place in kept if by_state[others[place], place].any() or outputs[:, place].any()]
    return kept


@checked
def state_space(motor: Motor, drive: TwoPhaseDrive, *, load_torque: float = 0.0) -> StateSpace:
    """Return the averaged motor about its steady state as a linear system.

    Args:
        motor: the motor; its shaft is free, and its temperature is constant.
        drive: amplitudes, phase and frequency of the steady state.
        load_torque: torque in N·m that a load draws from the shaft.

    Raises:
        ParameterError: for a value out of range, or a motor without an averaged model.
        SimulationError: if there is no C compiler or no steady state.
    """
    point, small = small_signals_at(motor, drive, load_torque)
    if not point["current_amplitude_a"]:
        raise SimulationError("No current flows into group A: its phase is not known. Give group A a voltage.")
    names = list(small.place)
    driven = np.array([by_input(small, drive, name) for name in OF_INPUTS]).T
    turned = np.exp(-1j * np.radians(point["current_phase_a"]))
    charge = [small.place[f"charge_{part}"] for part in (1, 2)]
    rates = np.hstack([small.by_state, driven])
    current = turned * (rates[charge[0]] + 1j * rates[charge[1]])
    degree = degrees(1.0) / point["current_amplitude_a"]
    unit = np.eye(*rates.shape)
    rows = np.array([unit[small.place["speed"]], unit[small.place["position"]], current.real, degree * current.imag])
    by_state, through = np.hsplit(rows, [len(names)])
    moves = np.abs(small.by_state) > ROUNDING * np.abs(small.by_state).max(axis=1, keepdims=True)
    kept = _moving(moves, driven, by_state)
    units = {names[place]: OF_STATES.get(names[place], LENGTH) for place in kept}
    described: list[dict[str, str]] = [units, OF_INPUTS, OF_OUTPUTS]
    if motor.slider:
        described = [{name: linear_unit(unit) for name, unit in known.items()} for known in described]
    states, inputs, outputs = described
    return StateSpace(
        small.by_state[np.ix_(kept, kept)], driven[kept], by_state[:, kept], through,
        states, inputs, outputs, point,
        {"motor": motor.to_dict(), "drive": drive.model_dump(), "run": {"load_torque_n_m": load_torque}},
        partial(_error_at, motor, drive, point["speed"]),
    )  # fmt: skip


def _error_at(motor: Motor, drive: TwoPhaseDrive, speed: float) -> ErrorEstimate:
    """Estimate the errors at a steady state, at its speed in rad/s."""
    duration = DECAYS * motor.decay_s
    try:
        held = AveragedPoint.of(Point.of(motor, drive, speed=speed), duration)
    except ParameterError as error:
        return ErrorEstimate({}, {}, str(error))
    return estimate(held, duration, steady=True)
