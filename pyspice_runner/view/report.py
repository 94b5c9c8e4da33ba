# SPDX-License-Identifier: GPL-3.0-or-later
"""The data sheet of a motor: spectra, a run from rest, and speed–torque curves."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, get_args

import numpy as np
from numpy.typing import ArrayLike
from pydantic import SkipValidation

from pyspice_runner.analysis.settling import Progress
from pyspice_runner.analysis.simulate import simulate
from pyspice_runner.analysis.speed_torque import axis, speed_torque
from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.files import write_netcdf
from pyspice_runner.model import contact as contact_law
from pyspice_runner.model.drive import Drive
from pyspice_runner.model.motor import Motor
from pyspice_runner.model.refusal import checked
from pyspice_runner.run.waveforms import Array, Waveforms
from pyspice_runner.spectra.admittance import Admittance, admittance
from pyspice_runner.spectra.spectrum import Connection, Spectrum, State
from pyspice_runner.view.datasheet import Report

if TYPE_CHECKING:
    import xarray

LEVELS = (0.5, 1.0)
SPEEDS = 4  # of a curve, by default
PATIENCE = 16  # blocks; a point that has not settled by then is marked
_POINTS_PER_BANDWIDTH = 10
_FEWEST_POINTS, _MOST_POINTS = 600, 20_000
_NEAR = 6.0  # bandwidths on each side of a resonance that keep all points of a spectrum
_RUNS = 4  # two spectra, the run, and the run at twice the step


@checked
def report(
    motor: Motor,
    drive: Drive,
    duration: float = 10e-3,
    *,
    speeds: SkipValidation[ArrayLike | None] = None,
    levels: Sequence[float] = LEVELS,
    measured: Spectrum | None = None,
    connection: Connection = "A",
    progress: Progress | None = None,
    timeout: float | None = None,
) -> Report:
    """Run the analyses of a motor's data sheet.

    The curves have twice the time step of the run. Their error is four times ``discretisation_error``, that of the run.

    Args:
        motor: the motor.
        drive: the voltages of both groups.
        duration: of the run from rest, s.
        speeds: of the speed–torque curves, rad/s; by default from standstill to slightly beyond no load.
        levels: shares of the drive's voltage at which a curve is measured.
        measured: a measured spectrum to draw over the computed ones.
        connection: how the groups were connected when it was measured, if it is a one-port.
        progress: called with the number of finished runs and points, and with their total.
        timeout: wall time in s of each run, after which ngspice is stopped.

    Raises:
        ParameterError: for an invalid value.
        SimulationError: if ngspice fails or its result is not valid; ``partial`` maps the file name of each finished
            part to the function that writes it.
    """
    if not levels or not all(0.0 < level <= 1.0 for level in levels):
        raise ParameterError(f"levels = {list(levels)} is not valid: it must be numbers > 0 and ≤ 1.")
    speeds = None if speeds is None else axis("speeds", speeds)
    voltages = {name: value for name, value in drive.model_dump().items() if name.startswith("voltage")}
    scaled = {
        level: drive.updated({name: value * level for name, value in voltages.items()}) for level in sorted(levels)
    }
    done, total = 0, _RUNS + len(scaled) * (SPEEDS if speeds is None else np.size(speeds)) + (speeds is None)
    tell = progress or (lambda *_: None)

    def advance(count: int = 1) -> None:
        nonlocal done
        done += count
        tell(done, total)

    advance(0)
    spectra: dict[State, Admittance] = {}
    curves: dict[float, xarray.Dataset] = {}
    finished: dict[str, Callable[[Path], object]] = {}
    try:
        for state in get_args(State):
            spectra[state] = _spectrum(motor, state, timeout)
            finished[f"admittance_{state}.csv"] = spectra[state].save
            advance()
        run = simulate(motor, drive, duration=duration, timeout=timeout)
        finished["run.nc"] = run.save
        advance()
        step = run.provenance["run"]["step_s"]
        # only for the estimate of the error: the audit of the finer run counts
        coarse = simulate(motor, drive, duration=duration, step=2.0 * step, timeout=timeout, audit=False)
        advance()
        if speeds is None:
            speeds = _speeds(motor, drive, run, 2.0 * step, timeout)
            advance()
        for level, at_level in scaled.items():
            curves[level] = speed_torque(
                motor, at_level, speeds=speeds, step=2.0 * step, patience=PATIENCE, timeout=timeout
            )
            finished[f"speed_torque_{100.0 * level:g}.nc"] = partial(write_netcdf, dataset=curves[level])
            advance(np.size(speeds))
    except SimulationError as error:
        if error.partial is not None:  # of a curve
            finished["speed_torque_incomplete.nc"] = partial(write_netcdf, dataset=error.partial)
        error.partial = finished
        raise
    return Report(motor, drive, spectra, run, coarse, curves, measured, connection)


def _spectrum(motor: Motor, state: State, timeout: float | None) -> Admittance:
    """Return the two-port over all modes, with some points within every bandwidth."""
    frequencies = [mode.frequency_hz for mode in motor.modes]
    pressed = contact_law.linearised_resonances(motor.contact, motor.modes, motor.rotor, motor.mount)
    start, stop = 0.5 * frequencies[0], 1.4 * max(frequencies[-1], float(pressed[-1]))
    bandwidth = min(mode.frequency_hz / mode.quality_factor for mode in motor.modes)
    points = int(np.clip(_POINTS_PER_BANDWIDTH * (stop - start) / bandwidth, _FEWEST_POINTS, _MOST_POINTS))
    result = admittance(motor, start=start, stop=stop, points=points, state=state, timeout=timeout)
    frequency = result.frequency_hz
    kept = np.zeros(points, dtype=bool)
    kept[:: max(points // _FEWEST_POINTS, 1)] = kept[-1] = True
    for item in (item for items in result.resonances.values() for item in items):
        kept |= np.abs(frequency - item.fs) < _NEAR * item.fs / item.quality_factor
    return replace(result, frequency_hz=frequency[kept], matrix_s=result.matrix_s[kept])


def _speeds(motor: Motor, drive: Drive, run: Waveforms, step: float, timeout: float | None) -> Array:
    """Return speeds from standstill to slightly beyond no load, in the direction in which the motor turns.

    The rotor cannot overtake the tip: the no-load speed is below the tip's largest speed along the rotor.
    """
    window = run.window()
    fastest = float(np.abs(np.gradient(run.tip_x_m[window], run.time_s[window])).max()) / motor.rotor.radius_m
    fastest = max(fastest, 1e-3)
    direction = 1.0 if run.mean_rotor_speed_rad_s >= 0.0 else -1.0
    probe = 0.5 * fastest * direction

    def torques(speeds: list[float]) -> list[float]:
        curve = speed_torque(motor, drive, speeds=speeds, step=step, patience=PATIENCE, timeout=timeout)
        return list(curve["torque_n_m"].values.tolist())

    stall, torque = torques([0.0, probe])
    if stall * direction <= 0.0:
        return direction * np.linspace(0.0, abs(probe), SPEEDS)
    probe = _no_load(stall, torque, probe, fastest)
    # the curve bends: a second straight line from standstill to where the first one ended
    (torque,) = torques([probe])
    reach = min(1.2 * abs(_no_load(stall, torque, probe, fastest)), fastest)
    return direction * np.linspace(0.0, reach, SPEEDS)


def _no_load(stall: float, torque: float, speed: float, fastest: float) -> float:
    """Return where a straight line through the torques at standstill and at a speed is zero, at most ``fastest``."""
    drop = (stall - torque) / stall
    return float(np.copysign(min(abs(speed) / drop, fastest) if drop > 0.0 else fastest, speed))
