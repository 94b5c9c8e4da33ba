# SPDX-License-Identifier: GPL-3.0-or-later
"""The data sheet of a motor: spectra, a run from rest, steady states of the free rotor, and speed–torque curves."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import get_args

import numpy as np
import xarray
from numpy.typing import ArrayLike
from pydantic import SkipValidation

from pyspice_runner.calibration.record import Record
from pyspice_runner.errors import ParameterError, SimulationError, require
from pyspice_runner.files import write_netcdf
from pyspice_runner.impedance.admittance import Admittance, admittance
from pyspice_runner.impedance.spectrum import Connection, Spectrum, State
from pyspice_runner.motor.drive import Drive
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.refusal import checked
from pyspice_runner.run.simulate import simulate
from pyspice_runner.run.waveforms import Array, Waveforms
from pyspice_runner.steady.settling import Progress
from pyspice_runner.steady.speed_torque import axis, check_distinct, no_load_state, speed_torque
from pyspice_runner.steady.steady import SteadyState
from pyspice_runner.steady.transducer import TransducerState, transducer_state
from pyspice_runner.trackers.track import Tracking
from pyspice_runner.view.datasheet import Report

LEVELS = (0.5, 1.0)
SPEEDS = 11  # of a curve, by default: ten up to no load, and one beyond
OVERSPEED = 1.1  # end of a curve over the speed without load
DURATION = 10e-3  # s of the run from rest, at first
DOUBLINGS = 3  # of this duration at most, while the run has not settled
PATIENCE = 16  # blocks; a point that has not settled by then is marked
_POINTS_PER_BANDWIDTH = 10
_FEWEST_POINTS, _MOST_POINTS = 600, 20_000
_WINDOW = 6.0  # bandwidths on each side of a resonance that keep all points of a spectrum
_RUNS = 3  # two spectra and the run


@checked
def report(
    motor: Motor,
    drive: Drive,
    duration: float | None = None,
    *,
    speeds: SkipValidation[ArrayLike | None] = None,
    levels: Sequence[float] = LEVELS,
    measured: Spectrum | None = None,
    connection: Connection = "A",
    tracking: Tracking | None = None,
    calibration: str | Path | None = None,
    progress: Progress | None = None,
    timeout: float | None = None,
) -> Report:
    """Run the analyses of a motor's data sheet; the data sheet of a transducer has no curves.

    The curves have twice the time step of the run. Their error is four times ``discretisation_error``, that of the run.

    Args:
        motor: the motor.
        drive: the voltages of both groups.
        duration: of the run from rest, s; by default 10 ms, doubled until the run has settled, three times at most.
        speeds: of the speed–torque curves, rad/s; by default from standstill to slightly beyond no load, at each level
            that of its own free rotor.
        levels: shares of the drive's voltage at which a curve is measured.
        measured: a measured spectrum to draw over the computed ones.
        connection: how the groups were connected when it was measured, if it is a one-port.
        tracking: a run of this motor with a resonance tracker, for a section with its loop gain.
        calibration: path of the JSON file of a calibration of this motor.
        progress: called with the number of finished runs and points, and with their total.
        timeout: wall time in s of each run, after which ngspice is stopped.

    Raises:
        ParameterError: for an invalid value.
        SimulationError: if ngspice fails or its result is not valid; ``partial`` maps the file name of each finished
            part to the function that writes it.
    """
    require(levels and all(0.0 < level <= 1.0 for level in levels), "levels", list(levels), "numbers > 0 and ≤ 1")
    if tracking is not None and tracking.settings["motor"] != motor.to_dict():
        raise ParameterError(
            f"tracking is a run of {tracking.settings['motor']['name']} with other parameters than {motor.name} has "
            "here. Give a run of the same motor."
        )
    if speeds is not None:
        speeds = axis("speeds", speeds)
        check_distinct({"speeds": speeds})
    record = None if calibration is None else Record.read(calibration)
    voltages = {name: value for name, value in drive.model_dump().items() if name.startswith("voltage")}
    shares = () if motor.is_transducer else sorted(levels)
    scaled = {level: drive.updated({name: value * level for name, value in voltages.items()}) for level in shares}
    done, total = 0, _RUNS + len(scaled) * (1 + (SPEEDS if speeds is None else np.size(speeds)))
    notify = progress or (lambda *_: None)

    def advance(count: int = 1) -> None:
        nonlocal done
        done += count
        notify(done, total)

    advance(0)
    spectra: dict[State, Admittance] = {}
    curves: dict[float, xarray.Dataset] = {}
    finished: dict[str, Callable[[Path], object]] = {}
    try:
        for state in get_args(State):
            spectra[state] = _spectrum(motor, state, timeout)
            finished[f"admittance_{state}.csv"] = spectra[state].save
            advance()
        run = _run(motor, drive, duration, timeout)
        finished["run.nc"] = run.save
        advance()
        free: SteadyState | TransducerState | None = transducer_state(motor, drive) if motor.is_transducer else None
        step = 2.0 * run.provenance["run"]["step_s"]
        for level, at_level in scaled.items():
            free = idle = no_load_state(motor, at_level, timeout=timeout)
            advance()
            at = _speeds(motor, idle, run) if speeds is None else speeds
            curves[level] = speed_torque(motor, at_level, speeds=at, step=step, patience=PATIENCE, timeout=timeout)
            finished[f"speed_torque_{100.0 * level:g}.nc"] = partial(write_netcdf, dataset=curves[level])
            advance(np.size(at))
    except SimulationError as error:
        if error.partial is not None:  # of a curve
            finished["speed_torque_incomplete.nc"] = partial(write_netcdf, dataset=error.partial)
        error.partial = finished
        raise
    return Report(motor, drive, spectra, run, curves, free, measured, connection, tracking, record)


def _run(motor: Motor, drive: Drive, duration: float | None, timeout: float | None) -> Waveforms:
    """Return the run from rest; by default until it has settled, with :data:`DOUBLINGS` at most."""
    run = simulate(motor, drive, duration=duration or max(DURATION, motor.settled_s), timeout=timeout)
    for _ in range(DOUBLINGS if duration is None else 0):
        if run.settled:
            break
        run = simulate(motor, drive, duration=2.0 * float(run.time_s[-1]), timeout=timeout)
    return run


def _spectrum(motor: Motor, state: State, timeout: float | None) -> Admittance:
    """Return the two-port over all modes, with some points within every bandwidth."""
    frequencies = [mode.frequency_hz for mode in motor.modes]
    pressed = motor.pressed_stator.resonances()
    start, stop = 0.5 * frequencies[0], 1.4 * max(frequencies[-1], float(pressed[-1]))
    bandwidth = min(mode.frequency_hz / mode.quality_factor for mode in motor.modes)
    points = int(np.clip(_POINTS_PER_BANDWIDTH * (stop - start) / bandwidth, _FEWEST_POINTS, _MOST_POINTS))
    result = admittance(motor, start=start, stop=stop, points=points, state=state, timeout=timeout)
    frequency = result.frequency_hz
    kept = np.zeros(points, dtype=bool)
    kept[:: max(points // _FEWEST_POINTS, 1)] = kept[-1] = True
    for item in (item for items in result.resonances.values() for item in items):
        kept |= np.abs(frequency - item.fs) < _WINDOW * item.fs / item.quality_factor
    return replace(result, frequency_hz=frequency[kept], matrix_s=result.matrix_s[kept])


def _speeds(motor: Motor, free: SteadyState | None, run: Waveforms) -> Array:
    """Return speeds from standstill to slightly beyond no load, in the direction in which the motor turns.

    Without a steady state they end at the tip's largest speed along the rotor, which the rotor cannot exceed.
    """
    window = run.window()
    tip = float(np.abs(np.gradient(run.tip_x_m[window], run.time_s[window])).max()) / motor.rotor.radius_m
    if free is None or not free.reached:
        return np.linspace(0.0, np.copysign(max(tip, 1e-3), run.mean_rotor_speed_rad_s), SPEEDS)
    reach = max(OVERSPEED * abs(free.speed_rad_s), 0.01 * tip, 1e-3)
    return np.linspace(0.0, np.copysign(reach, free.speed_rad_s), SPEEDS)
