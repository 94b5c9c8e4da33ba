# SPDX-License-Identifier: GPL-3.0-or-later
"""What a driver and its motor must bear when the load steps, the control stops, or the frequency sweeps.

Each event begins in a run from power-up. A bridge that stops opens all of its transistors: the energy of the network
and of the motor goes through their diodes into the supply, or stays. A frequency that sweeps passes the resonances of
the network with the group.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np

from pyspice_runner.circuit.source import GROUPS
from pyspice_runner.drivers.driver import Driver
from pyspice_runner.drivers.event_source import EventfulDriver
from pyspice_runner.drivers.maxima import maxima
from pyspice_runner.motor.drive import Load
from pyspice_runner.motor.strength import depolarised
from pyspice_runner.run.point import Point
from pyspice_runner.run.window import Array

LOAD_STEP, STOP, SWEEP = "load step", "stop", "frequency sweep"
SWEPT = 0.05  # of the frequency to both sides, that a sweep covers: about that in which a tracker searches
_BEGIN, _LASTS, _SWEEPS = 1e-3, 0.5e-3, 2e-3  # s: power-up, each event, a sweep


def driver_events(setup: Point, vectors: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Return the maxima of a run, as :func:`.maxima`, for each event.

    Args:
        setup: motor, driver and load; the load steps from nothing to its torque, or to that of friction under the
            preload, which stalls the motor. A shaft that is held has no step.
        vectors: those that :func:`.maxima` takes.

    Raises:
        SimulationError: if ngspice fails or its result cannot be trusted.
    """
    motor, driver = setup.motor, setup.source
    assert isinstance(driver, Driver)
    steps = setup.load.speed is None
    torque = setup.load.torque or motor.contact.friction * motor.contact.preload_n * motor.rotor.radius_m
    stops = _BEGIN + (_LASTS if steps else 0.0)
    stopped = EventfulDriver(driver, _BEGIN if steps else None, torque, stops)
    first = (1.0 - SWEPT) * driver.frequency
    swept = EventfulDriver(driver, first=first, rate=2.0 * SWEPT * driver.frequency / _SWEEPS)
    load = Load() if steps else setup.load
    runs = [(replace(setup, source=stopped, load=load), stops + _LASTS), (replace(setup, source=swept), _SWEEPS)]
    with ThreadPoolExecutor() as pool:
        one, other = pool.map(lambda run: run[0].run(run[1], vectors).vectors(), runs)
    windows = [(LOAD_STEP, one, _BEGIN, stops)] if steps else []
    windows += [(STOP, one, stops, np.inf), (SWEEP, other, 0.0, np.inf)]
    return {name: maxima(motor, driver, _cut(samples, begin, end)) for name, samples, begin, end in windows}


def _cut(samples: Mapping[str, Array], begin: float, end: float) -> dict[str, Array]:
    """Return the samples from one time in s to another."""
    within = (samples["time"] >= begin) & (samples["time"] <= end)
    return {name: values[within] for name, values in samples.items()}


def event_cautions(setup: Point, events: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return a sentence for each limit of a part or of the ceramic that an event exceeds."""
    told = []
    for name, found in events.items():
        peaks = {group: float(found[f"voltage_{group}_v"]) for group in GROUPS}
        told += [f"At a {name}: {fault}" for fault in (*found["exceeded"], *depolarised(setup.motor, peaks))]
    return told
