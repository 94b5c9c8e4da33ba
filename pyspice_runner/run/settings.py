# SPDX-License-Identifier: GPL-3.0-or-later
"""How a run is solved and what is kept of it. What is run is a :class:`~pyspice_runner.netlist.sources.Bench`."""

from __future__ import annotations

from dataclasses import dataclass

from pyspice_runner.errors import ParameterError

LEAST_ACCURACY, MOST_ACCURACY = 1e-4, 0.05  # finer, Newton's iteration counts; coarser, the order is lost


@dataclass(frozen=True)
class Solver:
    """How a run is solved.

    Attributes:
        step: time step in s; the largest where steps are not uniform. By default from the fastest motion.
        accuracy: error allowed of the tip's trajectory, RMS relative to its motion; it chooses the step.
        exact_resonance: whether modes are written so that the trapezoidal rule resonates where they do
            (:class:`~pyspice_runner.netlist.motor.Discretisation`); only with uniform steps.
        timeout: wall time in s after which ngspice is ended.
        audit: whether a result that fails the physical audit (:mod:`.audit`) is an error.
        compiled: whether the motor is a compiled module instead of B-sources (:mod:`.engines`).

    Raises:
        ParameterError: by the constructor, for an accuracy out of range.
    """

    step: float | None = None
    accuracy: float | None = None
    exact_resonance: bool = True
    timeout: float | None = None
    audit: bool = True
    compiled: bool = False

    def __post_init__(self) -> None:
        if self.accuracy is not None and not LEAST_ACCURACY <= self.accuracy <= MOST_ACCURACY:
            raise ParameterError(
                f"accuracy = {self.accuracy:g} is not valid: it must be a relative error from {LEAST_ACCURACY:g} to "
                f"{MOST_ACCURACY:g} of the tip's motion."
            )


DEFAULT = Solver()
