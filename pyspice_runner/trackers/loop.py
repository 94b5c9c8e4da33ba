# SPDX-License-Identifier: GPL-3.0-or-later
"""The phase-locked loop averaged over a period: loop gain and phase margin from an ``.ac`` run.

The circuit holds the tracker's own filter; stator, detector and oscillator are ``behavioral/tracker_average.lib``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from math import pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.circuit.bench import Bench
from pyspice_runner.circuit.fixtures import AC_OPTIONS
from pyspice_runner.errors import SimulationError
from pyspice_runner.result import json_ready
from pyspice_runner.run.kernel import ac
from pyspice_runner.run.waveforms import Array
from pyspice_runner.trackers.loop_filter import LoopFilter, StatorLag
from pyspice_runner.trackers.tracker import Tracker, averaged_bench

POINTS_PER_DECADE = 100
SWEPT_DECADES = 2  # swept to either side of the bandwidth


@dataclass(frozen=True)
class LoopDesign:
    """Loop gain and stability margin of a tracker."""

    loop_filter: LoopFilter  # the filter
    crossover_hz: float  # frequency at which the loop gain is 1
    phase_margin_deg: float  # phase of the loop gain there, above −180°
    frequency_hz: Array = field(repr=False)  # frequencies
    gain: NDArray[np.complex128] = field(repr=False)  # loop gain at them
    margin_error_deg: float | None = None  # estimated error of the margin; of a running motor
    sensed_phase_deg: float | None = None  # of the sensed motional current ahead of the force; of a running motor

    def to_dict(self) -> dict[str, Any]:
        """Return filter, crossover and margin, JSON-ready."""
        return {
            "filter": asdict(self.loop_filter),
            "crossover_hz": self.crossover_hz,
            "phase_margin_deg": self.phase_margin_deg,
            "margin_error_deg": self.margin_error_deg,
            "sensed_phase_deg": self.sensed_phase_deg,
            "frequency_hz": self.frequency_hz.tolist(),
            "gain": json_ready(self.gain),
        }


def phase_shown_deg(
    frequency_hz: Array, gain: NDArray[np.complex128], crossover_hz: float, phase_margin_deg: float
) -> Array:
    """Return the continuous phase of a loop gain over frequency, which is the margin − 180° at the crossover."""
    phase = np.degrees(np.unwrap(np.angle(gain)))
    off = np.interp(crossover_hz, frequency_hz, phase) - (phase_margin_deg - 180.0)
    return np.asarray(phase - 360.0 * np.round(off / 360.0))


def loop_design(tracker: Tracker, lag: StatorLag, loop_filter: LoopFilter) -> LoopDesign:
    """Return the loop gain of a phase-locked loop in front of a resonator alone, for which a filter is designed.

    Args:
        tracker: the tracker.
        lag: of the stator.
        loop_filter: the filter.

    Raises:
        SimulationError: if ngspice fails, or the loop gain does not cross 1 near the bandwidth.
    """
    bench = Bench(averaged_bench(tracker, lag, loop_filter, closed=False), AC_OPTIONS)
    frequency, returned = _swept(tracker, bench, "v(control)")
    return crossing(tracker, loop_filter, frequency, -returned)


def averaged_loop(tracker: Tracker, loop_filter: LoopFilter, bench: Bench, guess: Mapping[str, float]) -> LoopDesign:
    """Return the loop gain with an averaged motor, from ``.ac`` of a bench with the loop open.

    ``guess`` has voltages of nodes near the operating point. Raise SimulationError as of :func:`loop_design`.
    """
    pump = tracker.polarity * tracker.pump_current_a / (2.0 * pi)
    frequency, phase = _swept(tracker, bench, "v(phase)", guess)
    impedance = np.vectorize(loop_filter.impedance)(2j * pi * frequency)
    return crossing(tracker, loop_filter, frequency, -pump * impedance * phase)


def _swept(
    tracker: Tracker, bench: Bench, vector: str, guess: Mapping[str, float] | None = None
) -> tuple[Array, NDArray[np.complex128]]:
    """Return frequencies in Hz about the bandwidth, and the response of a bench there."""
    vectors = ac(
        bench, [vector], guess=guess, variation="dec", number_of_points=POINTS_PER_DECADE,
        start_frequency=tracker.bandwidth_hz / 10**SWEPT_DECADES,
        stop_frequency=tracker.bandwidth_hz * 10**SWEPT_DECADES,
    ).phasors()  # fmt: skip
    return vectors["frequency"].real, vectors[vector]


def crossing(
    tracker: Tracker, loop_filter: LoopFilter, frequency: Array, gain: NDArray[np.complex128], **more: float
) -> LoopDesign:
    """Return the design of a loop by its gain over frequency in Hz; ``more`` are further fields.

    Raise SimulationError if the gain does not cross 1 once.
    """
    level = np.log(np.abs(gain))
    below = np.flatnonzero((level[:-1] > 0.0) & (level[1:] <= 0.0))
    if below.size != 1:
        raise SimulationError(f"The loop gain crosses 1 {below.size} times near {tracker.bandwidth_hz:g} Hz.")
    near = slice(int(below[0]), int(below[0]) + 2)
    crossover = float(np.exp(np.interp(0.0, level[near][::-1], np.log(frequency[near])[::-1])))
    phase = np.unwrap(np.angle(gain))
    margin = 180.0 + float(np.degrees(np.interp(np.log(crossover), np.log(frequency), phase)))
    return LoopDesign(loop_filter, crossover, (margin + 180.0) % 360.0 - 180.0, frequency, gain, **more)
