# SPDX-License-Identifier: GPL-3.0-or-later
r"""A motor from spectra of its groups and numbers of its data sheet.

The spectra give frequencies, quality factors, capacitances and, for every coupling, θ/√m (:mod:`..spectra.twoport`).
The remaining values are fitted to the mechanical measurements by least squares, in the logarithms of both:

==================================  ==============================================
measured                            fitted
==================================  ==============================================
stall torque                        ``contact.friction``
no-load speed                       the modal mass, one for all modes, unless stated
resonances under preload            ``contact.normal_stiffness_n_per_m15``, and the
                                    tangential compliances of tip and rotor together
==================================  ==============================================

With the Jacobian J of the measured logarithms, each over its relative deviation, the fitted ones have the covariance
:math:`(J^T J)^{-1}`. A preloaded resonance gives the ratio of stiffness and mass; speed and torque separate the two
poorly. Therefore the contact stiffnesses of the base motor, which follow from its materials, count as measurements
with a deviation of 20 %. All other values of contact and rotor are those of the base motor.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, linear_sum_assignment

from pyspice_runner.analysis.steady import steady_state
from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.model.contact import linearised_resonances
from pyspice_runner.model.drive import TwoPhaseDrive
from pyspice_runner.model.load import load_motor
from pyspice_runner.model.motor import Motor, Provenance
from pyspice_runner.model.refusal import checked
from pyspice_runner.result import Result
from pyspice_runner.spectra.fit import fit_spectrum
from pyspice_runner.spectra.spectrum import Connection, Spectrum
from pyspice_runner.spectra.twoport import TwoPortFit, fit_two_port

_STEPS = 10  # of Gauss and Newton's method
_CLOSE = 0.1  # of a standard deviation: the iteration ends when a step gains less
_STIFFNESS_ERROR = 0.2  # relative, of the contact of the base motor
_DIFFERENCE = 0.05  # of a logarithm, for the derivatives: above the accuracy of a steady state
_REACH = 0.5  # greatest step, of a logarithm
_LINEAR = 2e-4  # relative shift of a resonance by losses, which the linear contact does not have

Pairs = Sequence[tuple[float, float]]
Vector = NDArray[np.float64]
_STIFFNESS = "contact.normal_stiffness_n_per_m15"
_COMPLIANCES = "contact.tangential_compliance_tip_m_per_n23", "contact.tangential_compliance_rotor_m_per_n23"


@dataclass(frozen=True, eq=False, repr=False)
class MotorFrom(Result):
    """A motor fitted to measurements.

    Attributes:
        motor: the motor; its provenance states the origin and the standard error of each value.
        standard_errors: path of a value → its standard error, in the value's unit.
        measured: name of each mechanical measurement → value.
        computed: the same quantities of the motor.
        fit: the two-port fit of the spectra.
        cautions: limits of the validity of the motor, one sentence each.
    """

    motor: Motor
    standard_errors: dict[str, float]
    measured: dict[str, float]
    computed: dict[str, float]
    fit: TwoPortFit
    cautions: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return the motor, the errors and the comparison, JSON-ready."""
        return {
            **self._entries("motor", "standard_errors", "measured", "computed"),
            "provenance": {path: [origin.kind, origin.note] for path, origin in self.motor.provenance.items()},
            **self._entries("fit", "cautions"),
        }

    def writers(self) -> dict[str, Callable[[Path], object]]:
        """Return the writers by ending: ``.toml`` (the motor) and ``.json``."""
        heading = f"A motor from the spectra {self.fit.source} and its data sheet."
        text = self.motor.to_toml(heading=heading)
        return {**super().writers(), ".toml": lambda file: file.write_text(text, encoding="utf-8")}

    def summary(self) -> dict[str, str]:
        """Return measurements with the motor's values, and the fitted values with their errors."""
        found = {
            name: f"{value:.5g} measured, {self.computed[name]:.5g} computed" for name, value in self.measured.items()
        }
        document = self.motor.to_dict()
        for path, error in self.standard_errors.items():
            value: Any = document
            for key in path.split("."):
                value = value[int(key)] if isinstance(value, list) else value[key]
            found[path] = f"{value:.5g} ± {error:.2g}"
        return found


@checked
def motor_from(
    spectra: Spectrum | Mapping[Connection, Spectrum],
    *,
    preloaded: Spectrum | None = None,
    no_load_speed: float | None = None,
    stall_torque: float | None = None,
    voltage: float | None = None,
    frequency: float | None = None,
    phase_deg: float = 90.0,
    mass_kg: float | Sequence[float] | None = None,
    speed_error: float = 0.02,
    torque_error: float = 0.02,
    modes: int | None = None,
    connection: Connection = "A",
    tips: Pairs | None = None,
    base: Motor | str | Path = "andersen2002",
    name: str = "measured",
    progress: Callable[[int, int], object] | None = None,
) -> MotorFrom:
    """Make a motor from spectra and numbers of its data sheet.

    Args:
        spectra: of the free stator: a two-port, or one-ports by connection, see :func:`fit_two_port`.
        preloaded: spectrum of the stator pressed on its rotor, of a two-port that through ``connection``.
        no_load_speed: rad/s at ``voltage`` and ``frequency``.
        stall_torque: N·m at the same.
        voltage: amplitude on each group, V.
        frequency: drive frequency, Hz.
        phase_deg: phase of group B, degrees.
        mass_kg: modal mass, one or one for each mode; by default it follows from the no-load speed.
        speed_error: relative standard deviation of the no-load speed.
        torque_error: relative standard deviation of the stall torque.
        modes: number of modes; by default determined by the fit.
        connection: of the groups in a preloaded two-port.
        tips: (tip_x, tip_y) of every mode, see :meth:`TwoPortFit.to_motor`. By default, if the mass is not known, those
            of the other motor for one modal mass, where its groups drive the same modes alike or opposed.
        base: motor whose contact and rotor are the start; what is not fitted keeps its value.
        name: name of the new motor.
        progress: called with the number of the step and the greatest.

    Raises:
        ParameterError: for invalid values, or if nothing determines the modal mass.
        SpectrumError: if the spectra cannot be fitted.
        SimulationError: if no motor of this kind has the data sheet's numbers.
    """
    stated = {"no_load_speed_rad_s": no_load_speed, "stall_torque_n_m": stall_torque}
    measured = {key: float(value) for key, value in stated.items() if value is not None}
    errors = {"no_load_speed_rad_s": speed_error, "stall_torque_n_m": torque_error}
    drive = _drive(measured, errors, voltage, frequency, phase_deg)
    if mass_kg is None and no_load_speed is None:
        raise ParameterError("Spectra do not determine the modal mass. Give the no-load speed, or mass_kg.")
    foundation = base if isinstance(base, Motor) else load_motor(base)
    fit = fit_two_port(spectra, modes)
    shift = None
    if preloaded is not None:
        shift = _Shift(preloaded.driven(connection) if preloaded.ports == 2 else preloaded)
        measured, errors = measured | shift.measured, errors | shift.errors
    borrowed = _tips(fit, foundation) if tips is None and mass_kg is None else None
    calibration = {"mass_kg": mass_kg, "tips": tips or borrowed, "name": name}
    task = _Task(fit, foundation, drive, measured, errors, shift, calibration)
    values, relative = _fitted(task, progress)
    motor, standard_errors = _annotated(task.motor(values), fit, relative, task.targets)
    origin = Provenance("assumed", f"those of {foundation.name}; state your own by tips")
    places = {f"modes.{index}.{key}": origin for index in range(len(borrowed or ())) for key in ("tip_x", "tip_y")}
    motor = motor.model_copy(update={"provenance": {**motor.provenance, **places}})
    if drive is not None:
        table = {"kind": "two-phase", "voltage": voltage, "frequency": frequency, "phase_deg": phase_deg}
        motor = motor.model_copy(update={"drive": {**(foundation.drive or {}), **table}})
    return MotorFrom(motor, standard_errors, measured, task.computed(values, list(measured)), fit, fit.cautions)


def _drive(
    measured: Mapping[str, float],
    errors: Mapping[str, float],
    voltage: float | None,
    frequency: float | None,
    phase_deg: float,
) -> TwoPhaseDrive | None:
    """Check the numbers of the data sheet, and return their drive."""
    for key, value in {**measured, **{f"error of {key}": error for key, error in errors.items()}}.items():
        if not 0.0 < value < 1e9:
            raise ParameterError(f"{key} = {value:g} is not valid: it must be a number > 0.")
    if not measured:
        return None
    if voltage is None or frequency is None:
        raise ParameterError("A speed or a torque is measured at one drive; give its voltage and its frequency too.")
    return TwoPhaseDrive(voltage=voltage, frequency=frequency, phase_deg=phase_deg)


def _tips(fit: TwoPortFit, base: Motor) -> list[tuple[float, float]] | None:
    """Return the tips of another motor's modes, scaled to one modal mass; ``None`` if its groups drive other modes."""
    here = [mode.coupling_a_n_per_v_kg05 * mode.coupling_b_n_per_v_kg05 >= 0.0 for mode in fit.modes]
    there = [mode.coupling_a_n_per_v * mode.coupling_b_n_per_v >= 0.0 for mode in base.modes]
    if here != there:
        return None
    scales = [sqrt(base.modes[0].mass_kg / mode.mass_kg) for mode in base.modes]
    return [(scale * mode.tip_x, scale * mode.tip_y) for scale, mode in zip(scales, base.modes, strict=True)]


@dataclass(frozen=True)
class _Task:
    """A motor as a function of the fitted values, and the measurements that it must reproduce."""

    fit: TwoPortFit
    foundation: Motor
    drive: TwoPhaseDrive | None
    measured: dict[str, float]
    errors: dict[str, float]
    shift: _Shift | None
    calibration: dict[str, Any]

    @property
    def targets(self) -> list[str]:
        """Measurements to fit: with the mass stated, the speed only checks the motor."""
        stated = self.calibration["mass_kg"] is not None
        return [key for key in self.measured if not (stated and key == "no_load_speed_rad_s")]

    @property
    def start(self) -> dict[str, float]:
        """Values to fit, at the start."""
        contact, found = self.foundation.contact, {}
        if "stall_torque_n_m" in self.measured:
            found["contact.friction"] = contact.friction
        if self.calibration["mass_kg"] is None:
            found["mass_kg"] = self.foundation.modes[0].mass_kg
        if found or self.shift is not None:  # the contact decides on both
            found[_STIFFNESS] = contact.normal_stiffness_n_per_m15
            found[_COMPLIANCES[0]] = contact.tangential_compliance_tip_m_per_n23
        return found

    def deviations(self, values: Mapping[str, float], keys: Sequence[str]) -> Vector:
        """Return the deviations from the measurements, over their errors."""
        found = self.computed(values, keys)
        return np.array([np.log(found[key] / self.measured[key]) / self.errors[key] for key in keys])

    def motor(self, values: Mapping[str, float]) -> Motor:
        """Return the motor with these values."""
        changed = self.foundation.updated(self.contact(values))
        calibration = {**self.calibration, "mass_kg": values.get("mass_kg", self.calibration["mass_kg"])}
        return self.fit.to_motor(**calibration, base=changed)

    def contact(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the values of the contact; the compliances of tip and rotor keep their ratio."""
        found = {path: value for path, value in values.items() if path != "mass_kg"}
        if _COMPLIANCES[0] in found:
            contact = self.foundation.contact
            ratio = contact.tangential_compliance_rotor_m_per_n23 / contact.tangential_compliance_tip_m_per_n23
            found[_COMPLIANCES[1]] = ratio * found[_COMPLIANCES[0]]
        return found

    def computed(self, values: Mapping[str, float], keys: Sequence[str]) -> dict[str, float]:
        """Compute the measured quantities for these values; all are above zero."""
        motor, drive = self.motor(values), self.drive
        found = {}
        resonances = {} if self.shift is None else self.shift.computed(motor)
        for key in keys:
            if key in resonances:
                found[key] = resonances[key]
            elif key == "stall_torque_n_m" and drive is not None:
                found[key] = steady_state(motor, drive, speed=0.0).torque_n_m
            elif drive is not None:
                found[key] = steady_state(motor, drive, load_torque=0.0).speed_rad_s
        if not all(value > 0.0 for value in found.values()):
            said = ", ".join(f"{key} = {value:.3g}" for key, value in found.items())
            raise SimulationError(
                f"The motor does not run in the positive direction at this drive: {said}. "
                "Check frequency, phase_deg and the tips of the modes, or start from a base that is closer."
            )
        return found


class _Shift:
    """Resonances of a stator under preload."""

    def __init__(self, preloaded: Spectrum) -> None:
        found = fit_spectrum(preloaded, leads=False).resonances
        if not found:
            raise ParameterError(f"{preloaded.source or 'The preloaded spectrum'} shows no resonance in its band.")
        names = [f"preloaded_resonance_{number}_hz" for number in range(1, len(found) + 1)]
        self.measured = {name: arm.series_resonance_hz for name, arm in zip(names, found, strict=True)}
        self.errors = {
            name: max((arm.standard_errors["series_resonance_hz"] or 0.0) / arm.series_resonance_hz, _LINEAR)
            for name, arm in zip(names, found, strict=True)
        }

    def computed(self, motor: Motor) -> dict[str, float]:
        """Return the resonances in Hz of a preloaded motor with a linear contact, each closest to a measured one."""
        found = linearised_resonances(motor.contact, motor.modes, motor.rotor, motor.mount)
        distances = np.abs(np.log(np.array(list(self.measured.values()))[:, None] / np.maximum(found, 1e-9)))
        rows, columns = linear_sum_assignment(distances)
        names = list(self.measured)
        return {names[row]: float(found[column]) for row, column in zip(rows, columns, strict=True)}


def _fitted(task: _Task, progress: Callable[[int, int], object] | None) -> tuple[dict[str, float], dict[str, float]]:
    """Return the fitted values, and their relative standard errors."""
    start = task.start
    if not start:
        return {}, {}
    names, point = list(start), np.log(list(start.values()))
    known = np.array([key in (_STIFFNESS, *_COMPLIANCES) for key in names], dtype=bool)
    resonances = list(task.shift.measured) if task.shift else []

    def plain(logarithms: Vector) -> dict[str, float]:
        return dict(zip(names, np.exp(logarithms).tolist(), strict=True))

    def slow(logarithms: Vector) -> Vector:
        return task.deviations(plain(logarithms), [key for key in task.targets if key not in resonances])

    def quick(logarithms: Vector) -> Vector:
        prior = (logarithms - point)[known] / _STIFFNESS_ERROR
        return np.append(task.deviations(plain(logarithms), resonances), prior)

    solution, covariance = _least_squares(slow, quick, point, progress)
    relative = dict(zip(names, np.sqrt(np.diag(covariance)).tolist(), strict=True))
    relative[_COMPLIANCES[1]] = relative[_COMPLIANCES[0]]
    return plain(solution), relative


def _least_squares(
    slow: Callable[[Vector], Vector],
    quick: Callable[[Vector], Vector],
    point: Vector,
    progress: Callable[[int, int], object] | None,
) -> tuple[Vector, Vector]:
    """Return the solution and its covariance.

    Every step solves the problem with linearised slow residuals, whose Jacobian Broyden's rule updates, and with exact
    quick ones: on the curve of constant resonances, mass and stiffness change together.
    """
    here = slow(point)
    differences = [slow(point + step) - here for step in _DIFFERENCE * np.eye(len(point))]
    jacobian = np.array(differences).T / _DIFFERENCE
    for number in range(1, _STEPS + 1):
        if progress is not None:
            progress(number, _STEPS)
        start, before, slope = point, here, jacobian

        def local(step: Vector, start: Vector = start, before: Vector = before, slope: Vector = slope) -> Vector:
            return np.concatenate([before + slope @ step, quick(start + step)])

        found = least_squares(local, np.zeros(len(point)), bounds=(-_REACH, _REACH))
        step = found.x
        if np.linalg.norm(local(step) - local(np.zeros(len(point)))) < _CLOSE:
            return point, np.asarray(np.linalg.inv(found.jac.T @ found.jac), dtype=float)
        for last in (False, False, True):
            try:
                there = slow(point + step)
                break
            except SimulationError:  # the motor does not run there
                if last:
                    raise
                step = step / 4.0
        jacobian = jacobian + np.outer(there - here - jacobian @ step, step) / float(step @ step)
        point, here = point + step, there
    worst = float(np.abs(np.append(here, quick(point))).max())
    raise SimulationError(
        f"No motor was found with the measured numbers in {_STEPS} steps; they are off by {worst:.3g} standard "
        "deviations. Check the drive, or start from another base."
    )


def _annotated(
    motor: Motor, fit: TwoPortFit, relative: Mapping[str, float], targets: Sequence[str]
) -> tuple[Motor, dict[str, float]]:
    """Return the motor with provenance, and the standard error of each value."""
    errors: dict[str, float] = {}
    mass_error = relative.get("mass_kg", 0.0)
    for index, (mode, found) in enumerate(zip(motor.modes, fit.modes, strict=True)):
        quality = found.standard_errors["quality_factor"] / found.quality_factor
        place = found.standard_errors["series_resonance_hz"] / found.series_resonance_hz
        shares = {
            "mass_kg": mass_error,
            "stiffness_n_per_m": sqrt(mass_error**2 + (2.0 * place) ** 2),
            "damping_n_s_per_m": sqrt(mass_error**2 + quality**2 + place**2),
        }
        errors |= {f"modes.{index}.{key}": share * getattr(mode, key) for key, share in shares.items() if share}
        for group in "ab":
            own = found.standard_errors[f"coupling_{group}_n_per_v_kg05"] * sqrt(mode.mass_kg)
            coupling = getattr(mode, f"coupling_{group}_n_per_v")
            errors[f"modes.{index}.coupling_{group}_n_per_v"] = sqrt(own**2 + (0.5 * mass_error * coupling) ** 2)
    errors |= {f"piezo.{key}": error for key, error in fit.standard_errors.items()}
    contact = {path: share for path, share in relative.items() if path != "mass_kg"}
    errors |= {path: share * getattr(motor.contact, path.partition(".")[2]) for path, share in contact.items()}
    provenance = dict(motor.provenance)
    source = "the " + ", ".join(key.rpartition("_")[0].replace("_", " ") for key in targets)
    for path, share in contact.items():
        if share < 0.9 * _STIFFNESS_ERROR:  # the measurements improve on the base motor
            provenance[path] = Provenance("derived", f"fitted to {source} by steady_state")
    for path, error in errors.items():
        if path.endswith("mass_kg"):
            provenance[path] = Provenance("derived", f"fitted to {source} by steady_state, one for all modes")
        origin = provenance.get(path, Provenance("derived", f"fitted to {fit.source}"))
        provenance[path] = Provenance(origin.kind, f"{origin.note}; standard error {error:.2g}")
    return motor.model_copy(update={"provenance": provenance}), errors
