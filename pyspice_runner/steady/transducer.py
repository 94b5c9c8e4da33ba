# SPDX-License-Identifier: GPL-3.0-or-later
"""The steady state of a transducer under its load, in closed form: it is linear."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field
from math import pi, sqrt
from typing import Any, Unpack

import numpy as np

from pyspice_runner.circuit.motor import dielectric_matrix
from pyspice_runner.errors import ParameterError, require
from pyspice_runner.motor.drive import Drive
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.refusal import checked
from pyspice_runner.motor.stator import square
from pyspice_runner.motor.strength import exceeded, peak_of_amplitudes, temperature_rise
from pyspice_runner.result import Result
from pyspice_runner.run.point import Point, Settings
from pyspice_runner.run.waveforms import described


@dataclass(frozen=True, repr=False)
class TransducerState(Result):
    """A steady state of a transducer.

    The quantities are those of :meth:`.Waveforms.electrical`, power of the load, losses, and strain, stress and
    temperature rise of the ceramic; ``None`` where not known. With two tones amplitudes are bounds: the sums of both.
    """

    motor: Motor = field(repr=False)
    drive: Drive
    quantities: dict[str, float | None]

    def to_dict(self) -> dict[str, Any]:
        """Return the quantities, the transducer and the drive, JSON-ready."""
        drive = {"kind": type(self.drive).__name__, "label": self.drive.label, **self.drive.model_dump()}
        return {**self.quantities, "motor": self.motor.to_dict(), "drive": drive, "cautions": list(self.cautions)}

    def _limits(self) -> tuple[str, ...]:
        """Return the limits of the ceramic that are exceeded."""
        return exceeded(self.motor, {name: value for name, value in self.quantities.items() if value is not None})

    def summary(self) -> dict[str, str]:
        """Return powers, currents and amplitudes."""
        return described({name: value for name, value in self.quantities.items() if value is not None})


@checked
def transducer_state(motor: Motor, drive: Drive, **settings: Unpack[Settings]) -> TransducerState:
    """Return the steady state of a transducer under ideal voltages; of the settings none has an effect.

    Raises:
        ParameterError: for a motor with a rotor, or a drive that does not suit.
    """
    if not motor.is_transducer:
        raise ParameterError(f"{motor.name} has a rotor, so its steady state is not linear: take steady_state.")
    point = Point.of(motor, drive, **settings)
    point.source.check(motor)
    stator, found, moves = motor.loaded_stator, defaultdict[str, float](float), np.zeros(len(motor.modes))
    mean_square = np.zeros((len(motor.modes), len(motor.modes)))
    pins = np.zeros((2, len(motor.groups)))  # mean squares of voltage and current
    for tones in zip(*drive.tones, strict=True):
        omega = 2.0 * pi * tones[0].frequency
        volts = np.array([tone.amplitude * np.exp(1j * tone.phase) for tone in tones])
        moved = np.linalg.solve(stator.dynamic_stiffness(omega), stator.coupling @ volts)
        flows, own = 1j * omega * moved, dielectric_matrix(motor, tones[0].frequency) @ volts
        currents = own + stator.coupling.T @ flows
        pins += 0.5 * np.abs([volts, currents]) ** 2
        for at, group in enumerate(motor.groups):
            found[f"power_{group}_w"] += 0.5 * float((volts[at] * currents[at].conjugate()).real)
            found[f"motional_current_amplitude_{group}_a"] += float(abs(stator.coupling.T[at] @ flows))
        found["dielectric_loss_w"] += 0.5 * float((volts.conjugate() @ own).real)
        found["amplitude_m"] += float(abs(motor.stator.contact[1] @ moved))
        moves += np.abs(moved)
        mean_square += 0.5 * np.outer(flows, flows.conjugate()).real
    for at, group in enumerate(motor.groups):
        found[f"voltage_{group}_rms_v"], found[f"current_{group}_rms_a"] = map(sqrt, pins[:, at].tolist())
    found["power_w"] = sum(found[f"power_{group}_w"] for group in motor.groups)
    apparent = float(np.sqrt(pins).prod(axis=0).sum())
    along = np.array(motor.load_motion)
    found["load_power_w"] = motor.load_resistance_n_s_per_m * float(along @ mean_square @ along)
    found["damping_loss_w"] = float(motor.stator.damping @ np.diag(mean_square))
    heat = found["damping_loss_w"] + found["dielectric_loss_w"]
    known = {**found, **peak_of_amplitudes(motor, moves.tolist()), "temperature_rise_k": temperature_rise(motor, heat)}
    known["power_factor"] = found["power_w"] / apparent if apparent else float("nan")
    if not motor.stator.contact[1].any():
        del known["amplitude_m"]
    return TransducerState(motor, drive, {name: value if np.isfinite(value) else None for name, value in known.items()})


def resonance(motor: Motor, at: str) -> float:
    """Return the ``"series"`` or ``"parallel"`` resonance in Hz of the main mode under its load, or their mean.

    The pins are shorted at one and open at the other; ``"between"`` is the geometric mean. Losses are left out.
    """
    stator = motor.loaded_stator
    shorted, mass = square(stator.stiffness), square(stator.mass)
    opened = shorted + stator.coupling @ np.linalg.solve(stator.capacitance, stator.coupling.T)
    both = {"series": (shorted,), "parallel": (opened,)}.get(at, (shorted, opened))
    unit = np.linalg.inv(np.linalg.cholesky(mass))  # scipy's eigh of two matrices takes 0.4 s to load
    squares = [float(np.linalg.eigvalsh(unit @ stiffness @ unit.T)[motor.main_mode]) for stiffness in both]
    return sqrt(np.prod(squares) ** (1.0 / len(squares))) / (2.0 * pi)


def heavier(motor: Motor, mode: int, factor: float) -> float:
    """Return the resistance in N·s/m of a load by which the damping of a mode is multiplied.

    Raises:
        ParameterError: for a factor that is not valid, or a load that does not act on the mode.
    """
    along = motor.load_motion[mode] ** 2
    require(0.1 <= factor <= 1e3, "load_factor", factor, "from 0.1 to 1000")
    if not along:
        raise ParameterError(
            f"The load does not act on mode {motor.modes[mode].name}: specify load.mode, or the motion of the face."
        )
    return float((factor - 1.0) * square(motor.loaded_stator.damping)[mode, mode] / along)


def under_load(motor: Motor, factor: float) -> Motor:
    """Return a transducer whose load multiplies the damping of its main mode."""
    if factor == 1.0:
        return motor
    ohms = motor.tool.resistance_n_s_per_m + heavier(motor, motor.main_mode, factor)
    return motor.updated({"load.resistance_n_s_per_m": ohms})


# of a driver, by the quantity of the steady state
TARGETS = {"power": "load_power_w", "current": "motional_current_amplitude_a_a", "amplitude": "amplitude_m"}


def target_name(motor: Motor, target: str) -> str:
    """Return the name of the quantity of a target: of the power that into the load, and without one into the arms."""
    return "damping_loss_w" if target == "power" and not motor.load_resistance_n_s_per_m else TARGETS[target]
