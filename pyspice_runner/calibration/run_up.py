# SPDX-License-Identifier: GPL-3.0-or-later
r"""Measured run-ups: the speed of a free shaft over time from rest, at constant drive and load.

A table has ``time_s`` since the drive came on, ``speed_rad_s`` (of a slider ``speed_m_s``) with ``…_error``, and the
conditions of measured points (:mod:`.points`): ``voltage``, ``load_torque_n_m``, a path with a dot; constant ones.
The time constant of the mechanics, inertia over the slope of the torque, decides inertia and bearing, which a shaft
held at a speed cannot.

The fast prediction :math:`\omega_a(t)` is that of the averaged motor (:func:`~pyspice_runner.simulate_averaged`). Where
the contact opens its torque :math:`T_a` is some percent off that of steady states, :math:`T`, and the bearing takes no
more than that. Its dynamics are right, since the shaft is slower than the modes. So the prediction is
:math:`\omega_a + \delta`, with the torques at held speeds and the damping b of the bearing,

.. math::
    J\,\dot\delta = T(\omega_a + \delta) - T_a(\omega_a) - b\,\delta, \qquad \delta(0) = 0 .
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pyspice_runner.averaged.driver import AveragedDrive
from pyspice_runner.averaged.library import check_averaged, require_averaged
from pyspice_runner.averaged.run import AveragedRun
from pyspice_runner.averaged.simulate import FEWEST_PERIODS, simulate_averaged
from pyspice_runner.calibration.points import ERROR, MEASURED, SPEED, Curve, conditions_of_row, read_columns
from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.motor.refusal import quoted
from pyspice_runner.run.point import Point
from pyspice_runner.run.waveforms import Array
from pyspice_runner.steady.steady import check_runs, steady_states

TIME = "time_s"
FEWEST = 3  # points: two are a line, which any time constant explains
MOST = 100_000  # rows of a table
COMPARED = 200  # points of a run-up that are compared, as of a spectrum
RUN_UP_ERROR = 0.01  # of the maximum speed: an encoder over a short window; above the error of the model
HELD = 9  # speeds at which the torque of steady states is computed, from rest to beyond the largest by a share of it:
BEYOND = 0.1  # the full motor may be faster than the averaged one, and the slope of the torque limits by how much
HELD_DECAYS = 10.0  # decay times after which the averaged motor at a held speed is settled


@dataclass(frozen=True)
class RunUp(Curve):
    """A measured run-up: what is compared of it, speeds in rad/s at times in s."""

    along: ClassVar[str] = "time_s"
    quantities: ClassVar[tuple[str, ...]] = (SPEED,)
    smooth: ClassVar[bool] = False  # its integration selects its steps

    @classmethod
    def read(cls, data: Any, number: int, linear: bool = False) -> RunUp:
        """Return the run-up of a table: a CSV file, a dictionary of columns or a pandas table.

        Raises:
            ParameterError: for a table without time or speed, with fewer than :data:`FEWEST` points, times that do not
                rise or are before 0, a condition that changes, or an error that is not above zero.
        """
        source, columns = read_columns(data, linear, name=f"run-up {number}", further=(TIME,), most=MOST)
        wanted = "speed_m_s" if linear else SPEED
        for column, own in ((TIME, TIME), (SPEED, wanted)):
            if column not in columns:
                raise ParameterError(f"{source} has no column {own}: a run-up needs {TIME} and {wanted}.")
        other = {key: values for key, values in columns.items() if key not in (TIME, SPEED, SPEED + ERROR)}
        for key, values in other.items():
            if key in MEASURED or key.endswith(ERROR):
                raise ParameterError(f"{source}: {key} is not a condition of a run-up. Leave it out.")
            if len(set(values)) > 1 or np.isnan(values[0]):
                raise ParameterError(
                    f"{source}: {key} is not the same number in all rows. A run-up has a constant drive and load: give "
                    "it one value, and another run-up for another value."
                )
        time, speed = np.array(columns[TIME]), np.array(columns[SPEED])
        there = np.isfinite(speed)
        if there.sum() < FEWEST:
            raise ParameterError(f"{source} has {there.sum()} points of speed: a run-up needs at least {FEWEST}.")
        late = np.flatnonzero(~(np.diff(time) > 0.0))
        if len(late) or not time[0] >= 0.0:
            row = int(late[0]) + 1 if len(late) else 0
            raise ParameterError(
                f"{source}: {TIME} of point {row + 1} is {time[row]:g}; the times must rise from 0, when the drive "
                "comes on. Sort the rows, and subtract the time at which it comes on."
            )
        maximum = float(np.abs(speed[there]).max())
        errors = np.array(columns.get(SPEED + ERROR, np.full(len(time), RUN_UP_ERROR * maximum)))
        if not np.all(errors[there] > 0.0):
            row = int(np.flatnonzero(there & ~(errors > 0.0))[0])
            raise ParameterError(
                f"{source}: {wanted}{ERROR} of point {row + 1} is {quoted(float(errors[row]))}; it must be a number "
                "> 0."
                if SPEED + ERROR in columns
                else f"{source}: the speed is 0 at every point. Give a run-up of a shaft that moves."
            )
        rows = np.flatnonzero(there)
        rows = rows[np.unique(np.linspace(0, len(rows) - 1, COMPARED).round().astype(int))]
        given = conditions_of_row({key: values[0] for key, values in other.items()})
        return cls(source, given, time[rows], speed[rows], errors[rows])

    def check(self, base: Point) -> None:
        """Raise ParameterError for a law, motor or drive without an averaged model, or a short time.

        ``base`` and the motors of the other methods are at the conditions of this run-up.
        """
        check_averaged(base.law)
        require_averaged(base.motor)
        stage = AveragedDrive.of(base.drive).stage
        shortest = FEWEST_PERIODS * stage.period
        if self.at[-1] < shortest:
            raise ParameterError(
                f"{self.source} ends at {self.at[-1]:g} s: it must last at least {FEWEST_PERIODS} periods of the "
                f"drive, {shortest:.3g} s. Times are in s."
            )

    def predicted(self, motor: Point, *, fine: bool = False) -> Array:
        """Return the speed of a motor at the measured times: the averaged one, or with the torque of steady states.

        Raise SimulationError where the averaged motor fails.
        """
        run = self._run(motor)
        time, speed = run.curves["time_s"], run.curves["rotor_speed_rad_s"]
        torques = _torques(motor, speed) if fine else None
        if torques is not None:
            speed = speed + _correction(motor, time, speed, torques)
        return np.interp(self.at, time, speed)

    def cautions(self, motor: Point) -> list[str]:
        """Return why the averaged motor is not trusted, if steady states do not help."""
        try:
            run = self._run(motor)
        except (ParameterError, SimulationError):
            return []  # its values count as left out
        caution = run.error_estimate.caution
        if not caution or _torques(motor, run.curves["rotor_speed_rad_s"]) is not None:
            return []
        return [f"{self.source}: {caution} The intervals leave this error out."]

    def _run(self, motor: Point) -> AveragedRun:
        load, timeout = motor.load.torque, motor.solver.timeout
        return simulate_averaged(motor.motor, motor.drive, float(self.at[-1]), load_torque=load, timeout=timeout)


def _torques(motor: Point, speed: Array) -> Array | None:
    """Return speeds in rad/s, and the torques in N·m of steady states and of the averaged motor there, as rows.

    ``None`` if less than two of the speeds have both.
    """
    beyond = BEYOND * float(np.abs(speed).max())
    low, high = min(speed.min(), 0.0), max(speed.max(), 0.0)
    every = np.linspace(low - (beyond if low < 0.0 else 0.0), high + (beyond if high > 0.0 else 0.0), HELD)
    held = [motor.updated({"load.speed": one, "load.torque": 0.0}) for one in every.tolist()]
    duration = max(HELD_DECAYS * motor.motor.decay_s, FEWEST_PERIODS / min(motor.source.frequencies))
    states, found = steady_states(held), []
    check_runs(states)
    for one, state in zip(held, states, strict=True):
        if not state.determined:
            continue
        try:
            averaged = simulate_averaged(
                one.motor, one.drive, duration, speed=one.load.speed, timeout=one.solver.timeout
            )
        except SimulationError:
            continue
        found.append((one.load.speed, state.torque_n_m, averaged.curves["torque_n_m"][-1]))
    return np.array(found, dtype=float).T if len(found) >= FEWEST - 1 else None


def _correction(motor: Point, time: Array, speed: Array, torques: Array) -> Array:
    """Return the speed difference between the full and the averaged motor; ``torques`` as of :func:`_torques`."""
    from scipy.integrate import solve_ivp  # takes long to load

    rotor, (speeds, full, own) = motor.motor.rotor, torques

    def rate(now: float, deviation: Array) -> Array:
        there = np.interp(now, time, speed)
        torque = np.interp(there + deviation, speeds, full) - np.interp(there, speeds, own)
        return np.asarray((torque - rotor.bearing_damping_n_m_s * deviation) / rotor.inertia_kg_m2)

    longest = (time[-1] - time[0]) / COMPARED  # so that no part of the run-up is stepped over
    return np.asarray(solve_ivp(rate, (time[0], time[-1]), [0.0], t_eval=time, max_step=longest).y[0])
