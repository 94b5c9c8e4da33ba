# SPDX-License-Identifier: GPL-3.0-or-later
"""A motor from spectra of its groups and numbers of its data sheet, or from a data sheet alone.

The spectra give frequencies, quality factors, capacitances and, for every coupling, θ/√m
(:mod:`~pyspice_runner.impedance.two_port_fit`). The remaining values are fitted to the numbers of the data sheet, which
are measured points with relative errors, as in :func:`~pyspice_runner.calibrate`:

==================================  ==============================================
measured                            fitted
==================================  ==============================================
stall torque                        ``contact.friction``
no-load speed                       the modal masses, in the ratio of the base, unless given
no-load speed at a lower voltage    ``contact.preload_n``
resonances under preload            ``contact.normal_stiffness_n_per_m15``, and the
                                    tangential compliances of tip and rotor together
==================================  ==============================================

A preloaded resonance gives the ratio of stiffness and mass; speed and torque separate the two poorly. Therefore the
contact stiffnesses of the base motor, which follow from its materials, have a prior width of 20 %. All other values of
contact and rotor are those of the base motor. Current and power at a rated point are further measurements of the same
values. Without spectra the motor is similar to the base motor of its class (:mod:`.similar`), and further numbers give
its friction and factors of quality, capacitance and normal motion.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import count
from math import copysign, inf, log
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from pyspice_runner.calibration import provenance
from pyspice_runner.calibration.data_sheet import DataSheet
from pyspice_runner.calibration.points import Curve
from pyspice_runner.calibration.prediction import Predictor
from pyspice_runner.calibration.provenance import CAPACITANCE, FRICTION, NORMAL, PRIORS, QUALITY, Origin
from pyspice_runner.calibration.search import Search, Tolerances
from pyspice_runner.calibration.similar import Factors, as_stage, scaled
from pyspice_runner.calibration.spectra import matched
from pyspice_runner.calibration.statistics import Judgement
from pyspice_runner.calibration.unknowns import Unknown
from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.impedance.one_port_fit import fit_one_port
from pyspice_runner.impedance.spectrum import Connection, Spectrum
from pyspice_runner.impedance.two_port_fit import TwoPortFit, fit_groups
from pyspice_runner.motor.drive import TwoPhaseDrive, default_drive
from pyspice_runner.motor.load import load_motor
from pyspice_runner.motor.motor import Motor, Provenance
from pyspice_runner.motor.refusal import checked
from pyspice_runner.result import Result
from pyspice_runner.run.point import Point
from pyspice_runner.run.waveforms import Array
from pyspice_runner.steady.harmonic_balance import balanced_states
from pyspice_runner.steady.steady import STANDS

_CAPACITANCES = (1.0, 0.25, 0.5, 2.0, 4.0)  # factors to start from
_LINEAR = 2e-4  # relative shift of a resonance by losses, which the linear contact does not have
_MISSED = 3.0  # standard deviations of a measured number from that of the motor: one in 400 is beyond by chance
# a further step of the fit gains 0.01, and of the difference to ngspice 0.1 standard errors
_ENDS = Tolerances(gain=1e-4, settled=1e-2, refinements=10)
_PRELOAD, _STIFFNESS = "contact.preload_n", "contact.normal_stiffness_n_per_m15"
_COMPLIANCES = "contact.tangential_compliance_tip_m_per_n23", "contact.tangential_compliance_rotor_m_per_n23"
_LOWER = 0.35, 0.5, 0.7, 0.85  # of the voltage of the data sheet, at which the direction is checked
_MASS, _FORCE, _SPEED = "mass_kg", "force", "speed"

Pairs = Sequence[tuple[float, float]]


@dataclass(frozen=True, eq=False, repr=False)
class MotorFrom(Result):
    """A motor fitted to measurements.

    Attributes:
        motor: the motor; its provenance has the origin and the standard error of each value.
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
        values = {path: provenance.value_of(document, path) for path in self.origins}
        return found | {
            path: f"{value:.5g} ({self.origins[path]})" for path, value in values.items() if value is not None
        }


@checked
def motor_from(
    spectra: Spectrum | Mapping[Connection, Spectrum] | None = None,
    *,
    preloaded: Spectrum | None = None,
    no_load_speed: float | None = None,
    stall_torque: float | None = None,
    stall_force: float | None = None,
    low_speed: float | None = None,
    low_voltage: float | None = None,
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
        spectra: of the free stator: a two-port, or one-ports by connection, see :func:`fit_spectrum`; ``None`` for a
            motor of the class of ``base``, which takes a stall load and a no-load speed.
        preloaded: spectrum of the stator pressed on its rotor, of a two-port that through ``connection``.
        no_load_speed: rad/s, or m/s, at ``voltage`` and ``frequency``.
        stall_torque: N·m at the same.
        stall_force: N, in place of the torque.
        low_speed: rad/s, or m/s, without load at a lower voltage; with spectra it determines the preload.
        low_voltage: amplitude on each group there, V, about half of ``voltage``.
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
            of ``base``, with its ratio of masses, where its groups drive the same modes alike or opposed.
        base: motor whose contact and rotor are the start, ``andersen2002`` by default; what is not fitted keeps its
            value. Without spectra the motor that represents the class, by default ``bimodal40``.
        name: name of the new motor.
        progress: called with the number of the step and the maximum.

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
        low_speed, low_voltage,
    )  # fmt: skip
    at = {"voltage": voltage, "frequency": frequency, "phase_deg": phase_deg}
    if spectra is None:
        for word, value in {"preloaded": preloaded, "mass_kg": mass_kg, "modes": modes, "tips": tips}.items():
            if value is not None:
                raise ParameterError(f"{word} goes with spectra of the free stator; give these too, or leave it out.")
        family = _of_class(sheet, foundation, at, name)
    else:
        pressed = _resonances(preloaded, connection)
        family = _of_spectra(spectra, sheet, foundation, at, pressed, mass_kg, modes, tips, name)
    x, relative = _fitted(family, progress)
    computed = family.computed(x)
    motor, targets = family.motor(family.predictor.values(x)), list(family.measured(family.fitted))
    if family.fit is None:
        motor, errors, origins = provenance.of_class(motor, foundation, relative, targets)
    else:
        motor, errors, origins = provenance.of_spectra(motor, family.fit, relative, targets)
    if family.drive is not None:
        table = {"kind": "two-phase", "voltage": voltage, "frequency": frequency, "phase_deg": family.drive.phase_deg}
        motor = motor.model_copy(update={"drive": {**(foundation.drive or {}), **table}})
        origins |= dict.fromkeys(("drive.voltage", "drive.frequency"), Origin("data sheet"))
    cautions = (*(family.fit.cautions if family.fit else ()), *family.missed(computed), *family.turned(motor))
    return MotorFrom(motor, errors, family.measured(sheet), computed, origins, family.fit, cautions)


class _Resonances(Curve):
    """Measured resonances of a stator under preload, in logarithms."""

    def predicted(self, point: Point, *, fine: bool) -> Array:  # noqa: ARG002 # one model is both
        """Return the resonances of a motor with a linear contact, each the closest to a measured one."""
        found = np.log(np.maximum(point.motor.pressed_stator.resonances(), 1e-9))
        return np.asarray(found[linear_sum_assignment(np.abs(self.measured[:, None] - found))[1]])


@dataclass(frozen=True)
class _Family:
    """The motors that fit the data, and the measurements that one of them must have."""

    motor: Callable[[Mapping[str, float]], Motor]  # of the fitted values
    base: Motor
    sheet: DataSheet
    fitted: DataSheet  # its numbers to which the values are fitted; the others only check the motor
    drive: TwoPhaseDrive | None
    values: dict[str, float]  # the most likely ones before the measurements
    priors: dict[str, float]  # relative standard deviations of those that are known
    fit: TwoPortFit | None = None
    resonances: _Resonances | None = None
    start: Array | None = None  # coordinates, if not those of the values

    def measured(self, sheet: DataSheet) -> dict[str, float]:
        """Return the numbers of a data sheet and the measured resonances by name."""
        own = np.exp(self.resonances.measured).tolist() if self.resonances else []
        return sheet.measured | {f"preloaded_resonance_{number}_hz": value for number, value in enumerate(own, start=1)}

    @cached_property
    def predictor(self) -> Predictor:
        """The measurements to fit as a function of the coordinates of the fitted values."""
        return Predictor(
            Point.of(self.base, self.drive or default_drive(self.base), audit=False),
            tuple(Unknown(name, value, 1e-9 * value, 1e9 * value, "", self.priors.get(name), wide=inf)
                  for name, value in self.values.items()),
            self.fitted.points(), (self.resonances,) if self.resonances else (),
            motor_of=lambda base, values: replace(base, motor=self.motor(values)),
        )  # fmt: skip

    def computed(self, x: Array) -> dict[str, float]:
        """Compute all measured quantities by ngspice. Raise SimulationError if one is not known or has another sign."""
        every, count = self.measured(self.sheet), len(self.sheet.measured)
        if not every:
            return {}
        (found,) = replace(self.predictor, points=self.sheet.points(logarithmic=False)).at([x], fine=True)
        values = np.append(found.values[:count], np.exp(found.values[count:]))
        computed = dict(zip(every, values.tolist(), strict=True))
        for key in (key for key, value in computed.items() if np.isnan(value)):
            load = {"no": "no load", "low": "no load at low_voltage"}.get(name := key.partition("_")[0], name)
            raise SimulationError(
                f"The motor has no steady state at this drive, {load}. Check frequency and phase_deg, or start from "
                "another base."
            )
        if not all(value * every[key] > 0.0 for key, value in computed.items()):
            numbers = ", ".join(f"{key} = {value:.3g}, measured {every[key]:.3g}" for key, value in computed.items())
            raise SimulationError(
                f"The motor does not run in the measured direction at this drive: {numbers}. Check the signs of the "
                "numbers and of phase_deg (of group B ahead of A), whether A and B are exchanged, and frequency and "
                "tips, or start from a base that is closer."
            )
        return computed

    def turned(self, motor: Motor) -> list[str]:
        """Return a sentence for the lower voltages at which a motor turns against its number at the sheet's voltage."""
        if self.drive is None:
            return []
        voltages = [share * self.drive.voltage for share in _LOWER]
        setups = [Point.of(motor, self.drive.updated({"voltage": one}), audit=False) for one in voltages]
        states = zip(voltages, balanced_states(setups, [None] * len(setups)), strict=True)
        speeds = {one: state.values["speed_rad_s"] for one, state in states if state}
        against = {one: speed for one, speed in speeds.items() if self.sheet.sign * speed < -STANDS}
        found = ", ".join(f"{speed:.3g} {self.sheet.unit('speed')} at {one:.4g} V" for one, speed in against.items())
        caution = (
            f"The motor turns against its measured direction at lower voltages: {found}. A control loop for such a "
            "motor may run away. Start from a base that is closer."
        )
        return [caution] if found else []

    def missed(self, computed: Mapping[str, float]) -> list[str]:
        """Return a sentence for each number to which the values were fitted and that the motor does not have."""
        errors = [error for one in (self.predictor.points, self.resonances) if one for error in one.errors.tolist()]
        pairs = zip(self.measured(self.fitted).items(), errors, strict=True)
        return [
            f"The motor does not have the measured {key} = {value:.4g}: it has {computed[key]:.4g}, "
            f"{abs(log(computed[key] / value)) / error:.2g} standard deviations away. The numbers do not go together "
            "with a motor of this kind."
            for (key, value), error in pairs
            if abs(log(computed[key] / value)) > _MISSED * error
        ]


def _fitted(family: _Family, progress: Callable[[int, int], object] | None) -> tuple[Array, dict[str, float]]:
    """Return the coordinates of the fitted values, and their relative standard errors, by the search of a calibration.

    Raise SimulationError for a start that does not run.
    """
    x = np.zeros(len(family.predictor.unknowns)) if family.start is None else family.start
    # the low speed depends on the preload, which is not fitted yet
    replace(family, sheet=replace(family.sheet, low_speed=None, low_voltage=None)).computed(x)
    if not len(x):
        return x, {}
    steps = count(1)
    search = Search(family.predictor, x, lambda _: progress and progress(next(steps), _ENDS.refinements), _ENDS)
    x = search.solved()
    deviations = np.sqrt(np.diag(Judgement(search, x).covariance))
    return x, dict(zip(family.values, deviations.tolist(), strict=True))


def _of_class(sheet: DataSheet, base: Motor, at: Mapping[str, float | None], name: str) -> _Family:
    """Return the motors of the class of another one.

    They are similar to it (:mod:`.similar`), with force, speed, frequency and voltage from the data sheet. Beside
    that they have a friction of their own, and factors of quality factors, capacitances and normal motion.
    """
    if sheet.no_load_speed is None or sheet.stall is None:
        raise ParameterError(
            "A motor from a data sheet alone takes its no-load speed and its stall torque or stall force. Give both, "
            "or spectra of the stator."
        )
    own = default_drive(base)
    if not isinstance(own, TwoPhaseDrive):
        raise ParameterError(
            f"{base.name} has no two-phase drive, so no data sheet compares with it: take another base."
        )
    drive = sheet.drive(at, own.phase_deg)
    assert drive is not None
    own = own.updated({"phase_deg": drive.phase_deg})
    limits = DataSheet(sheet.linear, sheet.no_load_speed, sheet.stall)
    speed, stall = _Family(lambda _: base, base, limits, limits, own, {}, {}).computed(np.zeros(0)).values()
    values = {_FORCE: sheet.stall / stall, _SPEED: sheet.no_load_speed / speed}
    usual = dict.fromkeys(PRIORS, 1.0) | {FRICTION: base.contact.friction}
    if len(sheet.measured) > len(values):
        values |= usual

    def motor(values: Mapping[str, float]) -> Motor:
        values = {**usual, **values}
        changes = {FRICTION: values[FRICTION]}
        for number, mode in enumerate(base.modes):
            changes[f"modes.{number}.damping_n_s_per_m"] = mode.damping_n_s_per_m / values[QUALITY]
            changes[f"modes.{number}.tip_y"] = mode.tip_y * values[NORMAL]
        for key, value in base.piezo.model_dump().items():
            if key.startswith("capacitance") and value:
                changes[f"piezo.{key}"] = values[CAPACITANCE] * value
        factors = values[_FORCE], values[_SPEED], drive.frequency / own.frequency, drive.voltage / own.voltage
        return scaled(base.updated(changes), Factors(*factors), name)

    family = _Family(motor, base, sheet, sheet, drive.updated({"ratio_b": own.ratio_b}), values, PRIORS)
    if sheet.rated_current is None:
        return family
    # Where the motion is inductive, the current falls and rises with the capacitance: start on the right side.
    place, current = list(values).index(CAPACITANCE), list(sheet.measured).index("rated_current_rms_a")
    starts = [log(factor) * np.eye(len(values))[place] for factor in _CAPACITANCES]
    currents = np.array([one.values[current] for one in family.predictor.at(starts)])
    distances = np.abs(currents - log(sheet.rated_current))
    return replace(family, start=starts[int(np.argmin(np.where(np.isnan(distances), inf, distances)))])


def _of_spectra(
    spectra: Spectrum | Mapping[Connection, Spectrum],
    sheet: DataSheet,
    base: Motor,
    at: Mapping[str, float | None],
    resonances: _Resonances | None,
    mass_kg: float | Sequence[float] | None,
    modes: int | None,
    tips: Pairs | None,
    name: str,
) -> _Family:
    """Return the motors with the stator of the spectra."""
    drive = sheet.drive(at, 90.0)
    if mass_kg is None and sheet.no_load_speed is None:
        raise ParameterError("Spectra do not determine the modal mass. Give the no-load speed, or mass_kg.")
    fit = fit_groups(spectra, modes)
    borrowed = _tips(fit, base) if tips is None and mass_kg is None else None
    if borrowed is None and tips is None and mass_kg is None:
        caution = (
            f"{base.name} has no modes like those of the spectra: all modes have one mass, and the signs of the "
            "couplings give the motion of the tip. Give tips and mass_kg, or a closer base."
        )
        fit = replace(fit, cautions=(*fit.cautions, caution))
    if mass_kg is None and sheet.low_speed is None:
        caution = f"Preload and dead band are those of {base.name}. For a control loop give low_speed too."
        fit = replace(fit, cautions=(*fit.cautions, caution))
    shapes, ratios = borrowed or (tips, [])
    contact, values = base.contact, dict[str, float]()
    if sheet.stall is not None:
        values[FRICTION] = contact.friction
    if sheet.low_speed is not None:  # the dead band is that of the preload
        values[_PRELOAD] = contact.preload_n
    if mass_kg is None:
        values[_MASS] = base.modes[0].mass_kg
    if values or resonances:  # the contact decides on both
        values[_STIFFNESS] = contact.normal_stiffness_n_per_m15
        values[_COMPLIANCES[0]] = contact.tangential_compliance_tip_m_per_n23
    ratio = contact.tangential_compliance_rotor_m_per_n23 / contact.tangential_compliance_tip_m_per_n23
    origin = Provenance("assumed", f"those of {base.name}; state your own by tips")
    origins = {f"modes.{index}.{key}": origin for index in range(len(ratios)) for key in ("tip_x", "tip_y")}

    def motor(values: Mapping[str, float]) -> Motor:
        changes = {path: value for path, value in values.items() if path != _MASS}
        if _COMPLIANCES[0] in changes:  # the compliances of tip and rotor keep their ratio
            changes[_COMPLIANCES[1]] = ratio * changes[_COMPLIANCES[0]]
        masses = [values[_MASS] * share for share in ratios] or values.get(_MASS) or mass_kg
        found = fit.to_motor(mass_kg=masses, tips=shapes, base=base.updated(changes), name=name)
        return found.model_copy(update={"provenance": {**found.provenance, **origins}})

    priors = dict.fromkeys((_STIFFNESS, _COMPLIANCES[0]), provenance.STIFFNESS_ERROR)
    priors[_PRELOAD] = provenance.WIDTHS["preload_n"]
    fitted = sheet if mass_kg is None else replace(sheet, no_load_speed=None)
    return _Family(motor, base, sheet, fitted, drive, values, priors, fit, resonances)


def _tips(fit: TwoPortFit, base: Motor) -> tuple[Pairs, list[float]] | None:
    """Return tips and ratios of masses of the equivalent modes of another motor; ``None`` if it lacks one.

    The fitted coupling to group A is positive; where the other motor's is negative, its tip is reversed.
    """
    found = [(one.series_resonance_hz, one.coupling_a_n_per_v_kg05, one.coupling_b_n_per_v_kg05) for one in fit.modes]
    modes = [base.modes[place] for _, place in matched(found, base)]
    signs = [copysign(1.0, mode.coupling_a_n_per_v) for mode in modes]
    tips = [(sign * mode.tip_x, sign * mode.tip_y) for sign, mode in zip(signs, modes, strict=True)]
    return (tips, [mode.mass_kg / base.modes[0].mass_kg for mode in modes]) if len(modes) == len(found) else None


def _resonances(preloaded: Spectrum | None, connection: Connection) -> _Resonances | None:
    """Return the resonances of a spectrum of the stator pressed on its rotor."""
    if preloaded is None:
        return None
    found = fit_one_port(preloaded.driven(connection) if preloaded.ports == 2 else preloaded, leads=False).resonances
    if not found:
        raise ParameterError(f"{preloaded.source or 'The preloaded spectrum'} shows no resonance in its band.")
    errors = [(arm.standard_errors["series_resonance_hz"] or 0.0) / arm.series_resonance_hz for arm in found]
    measured = np.log([arm.series_resonance_hz for arm in found])
    return _Resonances(preloaded.source, {}, np.arange(1.0, len(found) + 1.0), measured, np.maximum(errors, _LINEAR))
