# SPDX-License-Identifier: GPL-3.0-or-later
"""The electrical two-port of a stator, by ngspice's AC analysis."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.circuit.bench import AC_OPTIONS, Bench, admittance_bench
from pyspice_runner.motor.motor import Motor
from pyspice_runner.result import Audit
from pyspice_runner.run.audit import audit_two_port
from pyspice_runner.run.kernel import Outcome, run_bench

Swept = tuple[NDArray[np.float64], NDArray[np.complex128]]  # frequencies in Hz, matrices in S


def two_port_bench(motor: Motor, *, preloaded: bool) -> Bench:
    """Return the bench of a two-port."""
    return Bench(admittance_bench(motor, preloaded=preloaded), AC_OPTIONS)


def sweep_two_port(bench: Bench, timeout: float | None, start: float, stop: float, points: int) -> Outcome:
    """Run the AC analysis of a two-port at evenly spaced frequencies in Hz."""
    sweep = {"variation": "lin", "number_of_points": points, "start_frequency": start, "stop_frequency": stop}
    places = [f"{group}{copy}" for group in "ab" for copy in "12"]  # of a group (row) while one is driven (column)
    currents = [f"i(v{place})" for place in places if f"V{place}" in bench.circuit.element_names]
    return run_bench(bench, currents, timeout, "ac", sweep)


def two_port(outcome: Outcome) -> Swept:
    """Return the frequencies and the admittance matrices of an AC analysis."""
    phasors = outcome.phasors()
    names = sorted(name for name in phasors if name.startswith("i(v"))  # the groups, and of each the driven ones
    ports = round(len(names) ** 0.5)
    matrix = -np.stack([phasors[name] for name in names], axis=-1).reshape(-1, ports, ports)
    return np.ascontiguousarray(phasors["frequency"].real), matrix


def stator_two_port(motor: Motor, start: float, stop: float, points: int) -> Swept:
    """Return the two-port of a stator with a free tip. Raise SimulationError if ngspice fails, or it is not passive."""
    swept = two_port(sweep_two_port(two_port_bench(motor, preloaded=False), None, start, stop, points))
    Audit(audit_two_port(*swept)).withhold("result")
    return swept
