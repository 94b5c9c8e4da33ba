# SPDX-License-Identifier: GPL-3.0-or-later
"""A driver and its motor in one run, from power-up, and what is read from the last whole periods of it.

Means are taken by the trapezoidal rule on the simulator's own points. So powers add up as the simulator's do. Harmonics
are the Fourier coefficients of the waveform: with uniform steps by the same rule, which is exact there; with the steps
of a bridge those of the waveform taken as straight between its points.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.analysis.audit import FEWEST_POINTS_PER_PERIOD
from pyspice_runner.analysis.simulate import MOST_POINTS, POINTS_PER_PERIOD
from pyspice_runner.analysis.waveforms import Array
from pyspice_runner.engine.pyspice import BatchSimulator
from pyspice_runner.errors import ParameterError
from pyspice_runner.model import contact as contact_law
from pyspice_runner.model.drive import check_shaft
from pyspice_runner.model.motor import Motor
from pyspice_runner.netlist.benches import transient_options
from pyspice_runner.netlist.contact import ContactLaw, check_law
from pyspice_runner.netlist.drivers import GROUPS, SWITCHED_OPTIONS, Driver, driver_bench
from pyspice_runner.netlist.motor import Discretisation

HARMONICS = 20
AVERAGED_PERIODS = 20
SWITCHED_POINTS_PER_PERIOD = 250  # at least, between the edges; ngspice takes more at them
_FINE = 2000  # points a period on which a slew rate is read


@dataclass(frozen=True)
class DriverBench:
    """Motor, driver and load of a run."""

    motor: Motor
    driver: Driver
    contact: ContactLaw | None
    speed: float | None
    load_torque: float
    duration: float
    timeout: float | None

    def __post_init__(self) -> None:
        check_law(self.contact)
        if not (isfinite(self.duration) and self.duration >= 10.0 * self.driver.period):
            raise ParameterError(
                f"duration = {self.duration:g} s is refused; give at least ten periods of the driver, "
                f"{10.0 * self.driver.period:.3g} s."
            )
        check_shaft(self.motor, self.speed, self.load_torque)

    def run(self, step: float | None) -> tuple[dict[str, Array], float, str, float]:
        """Run from power-up; return vectors, wall time, deck and (largest) step."""
        largest = self._step(step)
        driver = self.driver
        circuit = driver_bench(
            self.motor, driver, contact=self.contact, speed=self.speed, load_torque=self.load_torque,
            discretisation=Discretisation(largest, exact_resonance=not driver.switched),
        )  # fmt: skip
        simulator = BatchSimulator(circuit, timeout=self.timeout)
        simulator.options(**(SWITCHED_OPTIONS if driver.switched else transient_options(self.motor, self.contact)))
        if driver.kind == "ideal" and driver.network == "none":
            # an ideal source must not step onto a capacitance
            plates = {f"xmotor.xgroup_{name}.plate": value.imag for name, value in driver.phasors().items()}
            simulator.initial_condition(**{node: value for node, value in plates.items() if abs(value) > 1e-12})
        simulator.save(*_saved(driver, self.contact is not None))
        arguments = {
            "step_time": largest,
            "end_time": self.duration,
            "max_time": largest,
            "use_initial_condition": True,
        }
        deck = str(simulator.prepare("transient", **arguments))
        simulator.transient(**arguments)
        assert simulator.result is not None
        vectors = {name: np.asarray(values, dtype=float) for name, values in simulator.result.raw.vectors.items()}
        return vectors, simulator.result.seconds, deck, largest

    def _step(self, step: float | None) -> float:
        frequencies = [self.driver.frequency, *(mode.frequency_hz for mode in self.motor.modes)]
        if self.contact:
            motor = self.motor
            frequencies += contact_law.linearised_resonances(motor.contact, motor.modes, motor.rotor).tolist()
        shortest = 1.0 / max(frequencies)
        points = SWITCHED_POINTS_PER_PERIOD if self.driver.switched else POINTS_PER_PERIOD
        if step is None:
            step = shortest / points
        if not 0.0 < step <= shortest / FEWEST_POINTS_PER_PERIOD:
            raise ParameterError(
                f"step = {step:g} s is refused; allowed is a number > 0 s and "
                f"≤ {shortest / FEWEST_POINTS_PER_PERIOD:.3g} s."
            )
        if self.duration / step > MOST_POINTS:
            raise ParameterError(
                f"duration = {self.duration:g} s takes {self.duration / step:.3g} steps of {step:.3g} s; at most "
                f"{MOST_POINTS:.0e} fit in memory, so shorten it."
            )
        return step


class Window:
    """The last whole periods of a run."""

    def __init__(self, time: Array, period: float, *, uniform: bool) -> None:
        self.period = period
        self.uniform = uniform
        self.periods = max(1, min(AVERAGED_PERIODS, int(0.5 * time[-1] / period * (1.0 + 1e-9))))
        self.length = self.periods * period
        self.start = float(time[-1] - self.length)
        first = int(np.searchsorted(time, self.start, side="right"))
        self._first = first
        self._whole = time
        self.time = np.concatenate(([self.start], time[first:]))

    def cut(self, values: Array) -> Array:
        """Return a signal inside the window, with its value at the beginning in front."""
        return np.concatenate(([np.interp(self.start, self._whole, values)], values[self._first :]))

    def mean(self, values: Array) -> float:
        """Return the time average of a signal."""
        return float(np.trapezoid(self.cut(values), self.time) / self.length)

    def rms(self, values: Array) -> float:
        """Return the RMS value of a signal."""
        return sqrt(self.mean(values * values))

    def harmonics(self, values: Array) -> NDArray[np.complex128]:
        """Return the phasors of orders 1 to :data:`HARMONICS`: V_k of Im(V_k e^{jkωt})."""
        cut, time = self.cut(values), self.time
        omega = 2.0 * pi / self.period * np.arange(1, HARMONICS + 1)
        turns = np.exp(-1j * np.outer(omega, time))
        if self.uniform:
            return np.asarray(2j / self.length * np.trapezoid(cut * turns, time, axis=1))
        # by parts: ∫ v e^{-jωt} dt = [v e^{-jωt}] j/ω + Σ slope (e^{-jωt₁} − e^{-jωt₀})/ω²
        slopes = np.diff(cut) / np.diff(time)
        ends = 1j / omega * (cut[-1] * turns[:, -1] - cut[0] * turns[:, 0])
        return np.asarray(2j / self.length * (ends + np.diff(turns, axis=1) @ slopes / omega**2))

    def slew_rate(self, values: Array) -> float:
        """Return the greatest rate of a signal, read over a two-thousandth of a period."""
        grid = np.linspace(self.start, self.time[-1], _FINE * self.periods + 1)
        return float(np.abs(np.diff(np.interp(grid, self.time, self.cut(values)))).max() / (grid[1] - grid[0]))

    def settling(self, values: Array) -> float:
        """Return the relative change of a signal's mean from the first to the second half of the window's periods."""
        cut = self.cut(values)
        middle = self.start + max(1, self.periods // 2) * self.period
        integral = np.concatenate(([0.0], np.cumsum(0.5 * (cut[1:] + cut[:-1]) * np.diff(self.time))))
        first = float(np.interp(middle, self.time, integral))
        before, after = first / (middle - self.start), (integral[-1] - first) / max(self.time[-1] - middle, self.period)
        return float(abs(after - before) / max(abs(before), abs(after), 1e-300)) if self.periods > 1 else 1.0


def voltage_at(samples: dict[str, Array], driver: Driver, place: str, group: str) -> Array:
    """Return the voltage at ``"out_g"``, the output of a stage, or ``"pin_g"``, the pin of a group."""
    if place.startswith("pin"):
        return samples[f"v({group})"]
    if driver.kind == "full-bridge":
        return samples[f"v(line_{group})"] - samples[f"v(return_{group})"]
    return samples[f"v(line_{group})"]


def power_at(samples: dict[str, Array], driver: Driver, place: str, group: str) -> Array:
    """Return the power that passes through a place."""
    return voltage_at(samples, driver, place, group) * samples[f"i(v{place})"]


def _saved(driver: Driver, contact: bool) -> list[str]:
    names = ["v(shaft)", *(["v(xmotor.friction)", "v(xmotor.normal)"] if contact else [])]
    for group in GROUPS:
        names += [f"v({group})", f"i(vpin_{group})", f"v(line_{group})", f"i(vout_{group})"]
        if driver.kind == "full-bridge":
            names.append(f"v(return_{group})")
        if driver.kind != "ideal":
            rails = [rail for rail, volts in zip(("vp", "vn"), driver.rails(group), strict=True) if volts]
            names += [item for rail in rails for item in (f"v({rail}_{group})", f"i(v{rail}_{group})")]
        for part in driver.parts(group):
            names += [f"v(x{part.instance}.loss_{name})" for name, _ in part.library.losses]
            names += [f"v(x{part.instance}.feed_{name})" for name, _ in part.library.feeds]
            names += [f"v(x{part.instance}.store_{name})" for name, _ in part.library.stores]
    return names
