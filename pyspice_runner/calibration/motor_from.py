# SPDX-License-Identifier: GPL-3.0-or-later
r"""A motor from spectra of its groups and numbers of its data sheet, or from a data sheet alone.

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
with a deviation of 20 %. All other values of contact and rotor are those of the base motor. Current and power at a
rated point are further measurements of the same values.

Without spectra the motor is a member of the class of the base motor (:mod:`.motor_class`): stall and no-load speed
give the factors of force and speed, and current and power at a rated point decide on quality factors, capacitances and
friction, which count as measurements with the width of the class.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, linear_sum_assignment

from pyspice_runner.calibration import motor_class
from pyspice_runner.calibration import provenance as origins
from pyspice_runner.calibration.data_sheet import DataSheet
from pyspice_runner.calibration.provenance import Origin
from pyspice_runner.calibration.similar import as_stage
from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.impedance.one_port_fit import fit_one_port
from pyspice_runner.impedance.spectrum import Connection, Spectrum
from pyspice_runner.impedance.two_port_fit import TwoPortFit, fit_groups
from pyspice_runner.motor.drive import TwoPhaseDrive
from pyspice_runner.motor.load import load_motor
from pyspice_runner.motor.motor import Motor, Provenance
from pyspice_runner.motor.refusal import checked
from pyspice_runner.result import Result
from pyspice_runner.steady.harmonic_balance import Balance

_STEPS = 10  # searches, each followed by steady states of ngspice
_CLOSE = 0.1  # of a standard deviation: the difference between ngspice and harmonic balance no longer changes
_STIFFNESS_ERROR = 0.2  # relative, of the contact of the base motor
_DIFFERENCE = 0.002  # of a logarithm, for the derivatives: harmonic balance is smooth
_REACH = 0.5  # scale of a step, of a logarithm
_CAPACITANCES = (1.0, 0.25, 0.5, 2.0, 4.0)  # factors to start from
_END, _MOST = 1e-4, 60  # relative gain of a step at the end of a search, and most steps
_LINEAR = 2e-4  # relative shift of a resonance by losses, which the linear contact does not have
_FAR = 3.0  # standard deviations of a measured number from that of the motor: one in 400 is beyond by chance

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
        origins: path of each value → its origin.
        fit: the two-port fit of the spectra; ``None`` without spectra.
        cautions: limits of the validity of the motor, one sentence each.
    """

    motor: Motor
    standard_errors: dict[str, float]
    measured: dict[str, float]
    computed: dict[str, float]
    origins: dict[str, Origin]
    fit: TwoPortFit | None
    cautions: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return the motor, the errors and the comparison, JSON-ready."""
        return {
            **self._entries("motor", "standard_errors", "measured", "computed"),
            "provenance": {path: [origin.kind, origin.note] for path, origin in self.motor.provenance.items()},
            "origins": {path: {"origin": one.kind, "width": one.width} for path, one in self.origins.items()},
            **self._entries("fit", "cautions"),
        }

    def writers(self) -> dict[str, Callable[[Path], object]]:
        """Return the writers by ending: ``.toml`` (the motor) and ``.json``."""
        source = f"the spectra {self.fit.source} and " if self.fit else ""
        text = self.motor.to_toml(heading=f"A motor from {source}its data sheet.")
        return {**super().writers(), ".toml": lambda file: file.write_text(text, encoding="utf-8")}

    def summary(self) -> dict[str, str]:
        """Return measurements with the motor's values, and every value with its origin."""
        found = {
            name: f"{value:.5g} measured, {self.computed[name]:.5g} computed" for name, value in self.measured.items()
        }
        document = self.motor.to_dict() | {"drive": self.motor.drive}
        for path, origin in self.origins.items():
            value: Any = document
            for key in path.split("."):
                value = value[int(key)] if isinstance(value, list) else value.get(key)
            if value is not None:
                found[path] = f"{value:.5g} ({origin})"
        return found


@checked
def motor_from(
    spectra: Spectrum | Mapping[Connection, Spectrum] | None = None,
    *,
    preloaded: Spectrum | None = None,
    no_load_speed: float | None = None,
    stall_torque: float | None = None,
    stall_force: float | None = None,
    rated_speed: float | None = None,
    rated_load: float | None = None,
    rated_current: float | None = None,
    rated_power: float | None = None,
    voltage: float | None = None,
    frequency: float | None = None,
    phase_deg: float | None = None,
    mass_kg: float | Sequence[float] | None = None,
    speed_error: float = 0.02,
    torque_error: float = 0.02,
    current_error: float = 0.05,
    modes: int | None = None,
    connection: Connection = "A",
    tips: Pairs | None = None,
    base: Motor | str | Path | None = None,
    name: str = "measured",
    progress: Callable[[int, int], object] | None = None,
) -> MotorFrom:
    """Make a motor from spectra and numbers of its data sheet, or from a data sheet alone.

    A motor with a ``stall_force``, or one whose ``base`` has a slider, is a linear stage: speeds are then in m/s and
    loads in N. The rotor of another ``base`` becomes a slider that moves as its rim.

    Args:
        spectra: of the free stator: a two-port, or one-ports by connection, see :func:`.fit_spectrum`; ``None`` for a
            motor of the class of ``base``, which takes a stall load and a no-load speed.
        preloaded: spectrum of the stator pressed on its rotor, of a two-port that through ``connection``.
        no_load_speed: rad/s, or m/s, at ``voltage`` and ``frequency``.
        stall_torque: N·m at the same.
        stall_force: N, in place of the torque.
        rated_speed: rad/s, or m/s, of a point at the same voltage and frequency.
        rated_load: N·m, or N, at that speed.
        rated_current: RMS current of a group at the rated point, A; where the groups differ, the root mean square.
        rated_power: electrical power of both groups at the rated point, W.
        voltage: amplitude on each group, V.
        frequency: drive frequency, Hz.
        phase_deg: phase of group B, degrees; by default 90, without spectra that of ``base``.
        mass_kg: modal mass, one or one for each mode; by default it follows from the no-load speed.
        speed_error: relative standard deviation of the speeds.
        torque_error: relative standard deviation of the loads.
        current_error: relative standard deviation of current and power.
        modes: number of modes; by default determined by the fit.
        connection: of the groups in a preloaded two-port.
        tips: (tip_x, tip_y) of every mode, see :meth:`TwoPortFit.to_motor`. By default, if the mass is not known, those
            of the other motor for one modal mass, where its groups drive the same modes alike or opposed.
        base: motor whose contact and rotor are the start, ``andersen2002`` by default; what is not fitted keeps its
            value. Without spectra the motor that represents the class, by default ``bimodal40``.
        name: name of the new motor.
        progress: called with the number of the step and the greatest.

    Raises:
        ParameterError: for invalid values, numbers that contradict each other, or if nothing determines the modal mass.
        SpectrumError: if the spectra cannot be fitted.
        SimulationError: if no motor of this kind has the data sheet's numbers.
    """
    if base is None:
        base = "bimodal40" if spectra is None else "andersen2002"
    foundation = base if isinstance(base, Motor) else load_motor(base)
    if stall_torque is not None and (stall_force is not None or foundation.slider is not None):
        reason = "stall_force is given too" if stall_force is not None else f"{foundation.name} has a slider"
        raise ParameterError(
            f"stall_torque is that of a rotary motor, but {reason}. Give one of the two, and its base."
        )
    if stall_force is not None:
        foundation = as_stage(foundation)
    sheet = DataSheet(
        foundation.slider is not None, no_load_speed, stall_torque if stall_force is None else stall_force, rated_speed,
        rated_load, rated_current, rated_power, speed_error, torque_error, current_error,
    )  # fmt: skip
    at = {"voltage": voltage, "frequency": frequency, "phase_deg": phase_deg}
    if spectra is None:
        for word, value in {"preloaded": preloaded, "mass_kg": mass_kg, "modes": modes, "tips": tips}.items():
            if value is not None:
                raise ParameterError(f"{word} goes with spectra of the free stator; give these too, or leave it out.")
        task = _of_class(sheet, foundation, at, name)
    else:
        task = _of_spectra(spectra, sheet, foundation, at, preloaded, connection, mass_kg, modes, tips, name)
    values, relative = _fitted(task, progress)
    motor, standard_errors, found = task.annotated(values, relative)
    if task.drive is not None:
        table = {"kind": "two-phase", "voltage": voltage, "frequency": frequency, "phase_deg": task.drive.phase_deg}
        motor = motor.model_copy(update={"drive": {**(foundation.drive or {}), **table}})
        given = Origin("data sheet")
        found |= {"drive.voltage": given, "drive.frequency": given}
    computed = task.computed(values, list(task.measured))
    return MotorFrom(
        motor, standard_errors, task.measured, computed, found, task.fit,
        ((*task.fit.cautions,) if task.fit else ()) + _missed(task, computed),
    )  # fmt: skip


def _drive(sheet: DataSheet, at: Mapping[str, float | None], phase_deg: float) -> TwoPhaseDrive | None:
    """Return the drive of the data sheet, checked against its numbers."""
    if not sheet.measured:
        return None
    if at["voltage"] is None or at["frequency"] is None:
        raise ParameterError("A speed or a torque is measured at one drive; give its voltage and its frequency too.")
    phase = phase_deg if at["phase_deg"] is None else at["phase_deg"]
    drive = TwoPhaseDrive(voltage=at["voltage"], frequency=at["frequency"], phase_deg=phase)
    sheet.check_power(drive)
    return drive


def _missed(task: _Task, computed: Mapping[str, float]) -> tuple[str, ...]:
    """Return a sentence for each number that the motor does not have."""
    return tuple(
        f"The motor does not have the measured {key} = {value:.4g}: it has {computed[key]:.4g}, "
        f"{abs(np.log(computed[key] / value)) / task.errors[key]:.2g} standard deviations away. The numbers do not go "
        "together with a motor of this kind."
        for key, value in task.measured.items()
        if key in task.targets and abs(np.log(computed[key] / value)) > _FAR * task.errors[key]
    )


def _of_class(sheet: DataSheet, base: Motor, at: Mapping[str, float | None], name: str) -> _Task:
    """Return the motor of the class of another one as a function of what a data sheet decides."""
    if sheet.no_load_speed is None or sheet.stall is None:
        raise ParameterError(
            "A motor from a data sheet alone takes its no-load speed and its stall torque or stall force. Give both, "
            "or spectra of the stator."
        )
    own = motor_class.class_drive(base, at["phase_deg"])
    drive = _drive(sheet, at, own.phase_deg)
    assert drive is not None
    speed, stall = (key for key in sheet.measured if not key.startswith("rated"))
    there = sheet.computed(base, own, [speed, stall])
    _check_forward(there)
    start = {motor_class.FORCE: sheet.stall / there[stall], motor_class.SPEED: sheet.no_load_speed / there[speed]}
    if len(sheet.measured) > len(start):
        start |= dict.fromkeys(motor_class.PRIORS, 1.0) | {motor_class.FRICTION: base.contact.friction}
    factors = drive.frequency / own.frequency, drive.voltage / own.voltage
    priors = {key: (start[key], width) for key, width in motor_class.PRIORS.items() if key in start}

    def motor(values: Mapping[str, float]) -> Motor:
        return motor_class.member(base, values, *factors, name)

    task = _Task(motor, sheet, drive.updated({"ratio_b": own.ratio_b}), start, priors, base)
    if (measured := sheet.rated_current) is None:
        return task

    # Where the motion is inductive, the current falls and rises with the capacitance: start on the right side.
    def missed(capacitance: float) -> float:
        (current,) = task.balanced(start | {motor_class.CAPACITANCE: capacitance}, ["rated_current_rms_a"], {})
        distance = abs(float(current) - np.log(measured)) / sheet.current_error
        return distance if np.isfinite(distance) else np.inf

    best = min(_CAPACITANCES, key=missed)
    return replace(task, start=start | {motor_class.CAPACITANCE: best})


def _of_spectra(
    spectra: Spectrum | Mapping[Connection, Spectrum],
    sheet: DataSheet,
    base: Motor,
    at: Mapping[str, float | None],
    preloaded: Spectrum | None,
    connection: Connection,
    mass_kg: float | Sequence[float] | None,
    modes: int | None,
    tips: Pairs | None,
    name: str,
) -> _Task:
    """Return the motor with the stator of the spectra as a function of what a data sheet decides."""
    drive = _drive(sheet, at, 90.0)
    if mass_kg is None and sheet.no_load_speed is None:
        raise ParameterError("Spectra do not determine the modal mass. Give the no-load speed, or mass_kg.")
    fit = fit_groups(spectra, modes)
    shift = None
    if preloaded is not None:
        shift = _Shift(preloaded.driven(connection) if preloaded.ports == 2 else preloaded)
    borrowed = _tips(fit, base) if tips is None and mass_kg is None else None
    contact, start = base.contact, dict[str, float]()
    if sheet.stall is not None:
        start["contact.friction"] = contact.friction
    if mass_kg is None:
        start["mass_kg"] = base.modes[0].mass_kg
    if start or shift is not None:  # the contact decides on both
        start[_STIFFNESS] = contact.normal_stiffness_n_per_m15
        start[_COMPLIANCES[0]] = contact.tangential_compliance_tip_m_per_n23
    ratio = contact.tangential_compliance_rotor_m_per_n23 / contact.tangential_compliance_tip_m_per_n23

    def motor(values: Mapping[str, float]) -> Motor:
        changes = {path: value for path, value in values.items() if path != "mass_kg"}
        if _COMPLIANCES[0] in changes:  # the compliances of tip and rotor keep their ratio
            changes[_COMPLIANCES[1]] = ratio * changes[_COMPLIANCES[0]]
        mass = values.get("mass_kg", mass_kg)
        return fit.to_motor(mass_kg=mass, tips=tips or borrowed, base=base.updated(changes), name=name)

    priors = {key: (start[key], _STIFFNESS_ERROR) for key in (_STIFFNESS, _COMPLIANCES[0]) if key in start}
    checks = () if mass_kg is None else tuple(key for key in sheet.measured if key.startswith("no_load"))
    return _Task(motor, sheet, drive, start, priors, base, fit, shift, checks, len(borrowed or ()))


def _check_forward(found: Mapping[str, float]) -> None:
    if not all(value > 0.0 for value in found.values()):
        said = ", ".join(f"{key} = {value:.3g}" for key, value in found.items())
        raise SimulationError(
            f"The motor does not run in the positive direction at this drive: {said}. "
            "Check frequency, phase_deg and the tips of the modes, or start from a base that is closer."
        )


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

    motor: Callable[[Mapping[str, float]], Motor]
    sheet: DataSheet
    drive: TwoPhaseDrive | None
    start: dict[str, float]  # of the fitted values
    priors: dict[str, tuple[float, float]]  # value and relative deviation of those that are known beforehand
    base: Motor
    fit: TwoPortFit | None = None
    shift: _Shift | None = None
    checks: tuple[str, ...] = ()  # measurements that only check the motor
    borrowed: int = 0  # number of modes whose tips are those of the base

    @property
    def measured(self) -> dict[str, float]:
        """All measurements."""
        return self.sheet.measured | (self.shift.measured if self.shift else {})

    @property
    def errors(self) -> dict[str, float]:
        """Their relative standard deviations."""
        return self.sheet.errors | (self.shift.errors if self.shift else {})

    @property
    def targets(self) -> list[str]:
        """Measurements to fit."""
        return [key for key in self.measured if key not in self.checks]

    def computed(self, values: Mapping[str, float], keys: Sequence[str]) -> dict[str, float]:
        """Compute the measured quantities for these values; all are above zero."""
        motor = self.motor(values)
        found = {} if self.shift is None else self.shift.computed(motor)
        if self.drive is not None:
            found |= self.sheet.computed(motor, self.drive, [key for key in keys if key not in found])
        found = {key: found[key] for key in keys}
        _check_forward(found)
        return found

    def balanced(self, values: Mapping[str, float], keys: Sequence[str], near: dict[str, Balance]) -> Vector:
        """Compute their logarithms by harmonic balance, NaN where there is no motion (:meth:`.DataSheet.balanced`)."""
        try:
            motor = self.motor(values)
        except ParameterError:  # there is no such motor
            return np.full(len(keys), np.nan)
        found = {} if self.shift is None else self.shift.computed(motor)
        if self.drive is not None:
            found |= self.sheet.balanced(motor, self.drive, [key for key in keys if key not in found], near)
        every = np.array([found[key] for key in keys])
        return np.asarray(np.log(np.where(every > 0.0, every, np.nan)), dtype=float)

    def annotated(
        self, values: Mapping[str, float], relative: Mapping[str, float]
    ) -> tuple[Motor, dict[str, float], dict[str, Origin]]:
        """Return the motor with provenance, the standard error of each value, and the origins."""
        motor = self.motor(values)
        if self.fit is None:
            return origins.of_class(motor, self.base, relative, list(self.measured))
        origin = Provenance("assumed", f"those of {self.base.name}; state your own by tips")
        places = {f"modes.{index}.{key}": origin for index in range(self.borrowed) for key in ("tip_x", "tip_y")}
        motor = motor.model_copy(update={"provenance": {**motor.provenance, **places}})
        return origins.of_spectra(motor, self.fit, relative, self.targets, _STIFFNESS_ERROR)


class _Shift:
    """Resonances of a stator under preload."""

    def __init__(self, preloaded: Spectrum) -> None:
        found = fit_one_port(preloaded, leads=False).resonances
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
        found = motor.pressed_stator.resonances()
        distances = np.abs(np.log(np.array(list(self.measured.values()))[:, None] / np.maximum(found, 1e-9)))
        rows, columns = linear_sum_assignment(distances)
        names = list(self.measured)
        return {names[row]: float(found[column]) for row, column in zip(rows, columns, strict=True)}


def _fitted(task: _Task, progress: Callable[[int, int], object] | None) -> tuple[dict[str, float], dict[str, float]]:
    """Return the fitted values, and their relative standard errors.

    The search runs with harmonic balance, whose values contain the difference to ngspice where the last search ended.
    It is repeated until this difference stays the same, so that the result is that of ngspice.
    """
    start, keys = task.start, task.targets
    if not start:
        return {}, {}
    names, near = list(start), dict[str, Balance]()
    prior = np.array([task.priors.get(name, (1.0, np.inf)) for name in names])
    measured = np.log([task.measured[key] for key in keys])
    errors = np.array([task.errors[key] for key in keys])

    def plain(logarithms: Vector) -> dict[str, float]:
        return dict(zip(names, np.exp(logarithms).tolist(), strict=True))

    def residuals(logarithms: Vector) -> Vector:
        missed = (task.balanced(plain(logarithms), keys, near) + shift - measured) / errors
        return np.append(missed, (logarithms - np.log(prior[:, 0])) / prior[:, 1])

    def slope(logarithms: Vector) -> Vector:
        here = residuals(logarithms)
        columns = [residuals(logarithms + step) - here for step in _DIFFERENCE * np.eye(len(names))]
        return np.asarray(np.nan_to_num(np.array(columns).T / _DIFFERENCE), dtype=float)

    point, shift = np.log(list(start.values())), np.full(len(keys), np.inf)
    for number in range(1, _STEPS + 1):
        if progress is not None:
            progress(number, _STEPS)
        there = np.log(list(task.computed(plain(point), keys).values()))
        before, shift = shift, there - task.balanced(plain(point), keys, near)
        if not np.all(np.isfinite(shift)):
            raise SimulationError(
                "Harmonic balance does not find the motion of this motor. Check the drive, or start from another base."
            )
        if np.all(np.abs(shift - before) < _CLOSE * errors):
            jacobian = slope(point)
            relative = np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
            return plain(point), dict(zip(names, relative.tolist(), strict=True))
        point = least_squares(residuals, point, slope, x_scale=_REACH, xtol=_END, ftol=_END, max_nfev=_MOST).x
    worst = float(np.abs(residuals(point)).max())
    raise SimulationError(
        f"No motor was found with the measured numbers in {_STEPS} steps; they are off by {worst:.3g} standard "
        "deviations. Check the drive, or start from another base."
    )
