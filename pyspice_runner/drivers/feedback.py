# SPDX-License-Identifier: GPL-3.0-or-later
"""Stability of the amplifier with feedback (``driver_feedback``) into its network, cable and group.

The loop gain is T = A/gain · Zx/(Zo + Zx), as in the header of the library: Zo is the output impedance in the loop, Zx
all that is behind the feedback, with the stator whose tip is free and whose other group is held by its own amplifier.
A passive Zx and A without poles on the right leave T none either, so that the loop is stable if 1 + T does not encircle
0 (Nyquist).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import pi

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.circuit.source import GROUPS
from pyspice_runner.drivers.driver import Driver
from pyspice_runner.drivers.loads import EventfulDriver, Events
from pyspice_runner.errors import ParameterError
from pyspice_runner.motor import groups
from pyspice_runner.motor.motor import Motor
from pyspice_runner.run.point import Point
from pyspice_runner.run.window import Array
from pyspice_runner.units import engineering

Complex = NDArray[np.complex128]
LEAST_MARGIN = 30.0  # ° of phase margin: with less a step overshoots by a third or more
_A_DECADE = 2000  # points of the loop gain
_NEAR = 0.05 * np.linspace(-1.0, 1.0, 4001)  # around each resonance: 100 points in the bandwidth of a Q of 400
_STEPS, _AFTER = 100.0, 30.0  # steps in a period of the crossover, and periods that follow the step


@dataclass(frozen=True)
class Loop:
    """The loop of the amplifier of a group."""

    stable: bool
    crossover_hz: float | None  # where the loop gain falls through 1 with the least margin; ``None`` if it never does
    phase_margin_deg: float | None  # there
    step_overshoot: float | None = None  # of the stage's output by ngspice, over the step; ``None`` if not computed

    def words(self) -> str:
        """Return stability, margin and overshoot for a summary."""
        margin = f", phase margin {self.phase_margin_deg:.3g}°" if self.phase_margin_deg is not None else ""
        over = f", step overshoot {100.0 * self.step_overshoot:.3g} %" if self.step_overshoot is not None else ""
        return f"{'stable' if self.stable else 'unstable'}{margin}{self.at}{over}"

    @property
    def at(self) -> str:
        """The crossover in words."""
        return f" at {engineering(self.crossover_hz, 'Hz')}" if self.crossover_hz else ""


def load_impedance(motor: Motor, driver: Driver, group: str, frequency_hz: Array) -> Complex:
    """Return the impedance in Ω behind the output of a stage: transformer, network, cable and group."""
    omega, index = 2.0 * pi * frequency_hz, GROUPS.index(group)
    stator = motor.loaded_stator if motor.is_transducer else motor.stator
    volts, amperes = np.ones_like(omega, dtype=complex), stator.admittance(omega)[:, index, index]
    for _, before in driver.passed(group, volts, amperes, omega):
        volts, amperes = before.volts, before.amperes
    load = np.asarray(volts / amperes)
    if values := driver.values(group, "transformer"):
        load = values["secondary_resistance"] + load
        load = load / (1.0 + 1j * omega * values["winding_capacitance"] * load)
        coil = 1j * omega * values["magnetizing"]
        mutual = coil * values["ratio"] * values["coupling"]
        load = values["primary_resistance"] + coil - mutual**2 / (coil * values["ratio"] ** 2 + load)
    return load


def loop_gain(motor: Motor, driver: Driver, group: str, frequency_hz: Array) -> Complex:
    """Return the loop gain of the amplifier of a group at frequencies in Hz.

    Raises:
        ParameterError: for a stage without feedback.
    """
    values = driver.values(group, "amplifier")
    if "gain_bandwidth" not in values:
        raise ParameterError(f"A {driver.name} has no feedback, and so no loop gain. Choose the stage feedback.")
    s = 2j * pi * frequency_hz
    first = 2.0 * pi * values["gain_bandwidth"] / values["open_loop_gain"]
    own = values["open_loop_gain"] / ((1.0 + s / first) * (1.0 + s / (2.0 * pi * values["second_pole"])))
    coil = 1.0 / (1.0 / values["damping"] + 1.0 / (s * values["output_inductance"]))
    behind = values["isolation_resistance"] + load_impedance(motor, driver, group, frequency_hz)
    found = own / values["gain"] * behind / (values["output_resistance"] + coil + behind)
    return np.asarray(found)


def margins(motor: Motor, driver: Driver, group: str) -> Loop:
    """Return stability, crossover and phase margin of a loop. Raise ParameterError as :func:`loop_gain`."""
    values = driver.values(group, "amplifier")
    last = 100.0 * max(values.get("gain_bandwidth", 1e6), values.get("second_pole", 1e6))
    near = [resonance * (1.0 + _NEAR) for resonance in motor.stator.resonances()]
    grid = np.unique(np.concatenate([np.geomspace(1.0, last, int(_A_DECADE * np.log10(last))), *near]))
    gain = loop_gain(motor, driver, group, grid)
    turned = float(np.sum(np.angle((1.0 + gain[1:]) / (1.0 + gain[:-1]))))  # 0, or two turns for a pair on the right
    size = np.log(np.abs(gain))
    falls = np.flatnonzero((size[:-1] >= 0.0) & (size[1:] < 0.0))
    if not len(falls):
        return Loop(abs(turned) < pi, None, None)
    share = size[falls] / (size[falls] - size[falls + 1])
    crossed = grid[falls] * (grid[falls + 1] / grid[falls]) ** share
    phases = np.angle(-loop_gain(motor, driver, group, crossed))  # from -180°
    worst = int(np.argmin(phases))
    return Loop(abs(turned) < pi, float(crossed[worst]), float(np.degrees(phases[worst])))


def step_response(motor: Motor, driver: Driver, group: str, loop: Loop) -> tuple[Array, Array]:
    """Return times in s from a step on, and the output of a group's stage over the voltage that the step is worth.

    The step is a tenth of what would bring the slew rate, the tip is free. Raise SimulationError if ngspice fails.
    """
    values, line = driver.values(group, "amplifier"), groups.voltage("line", group)
    slewed = values["slew_rate"] / (2.0 * pi * values["gain_bandwidth"])
    height = 0.1 * min(slewed, driver.rails(group)[0] / values["gain"])
    period = 1.0 / (loop.crossover_hz or values["gain_bandwidth"] / values["gain"])
    at = max(period, 2e-6)  # s: the supply, which rises in 1 µs, is on
    stepped = EventfulDriver(driver.updated({"supply_rise_s": 1e-6}), Events(control_at=at, controls={group: height}))
    setup = Point.of(motor, stepped, contact=None, step=period / _STEPS, audit=False)
    samples = setup.run(at + _AFTER * period, [line]).vectors()
    after = samples["time"] >= at
    return samples["time"][after] - at, samples[line][after] / (height * values["gain"])


def stability(motor: Motor, driver: Driver) -> tuple[dict[str, Loop], dict[str, tuple[Array, Array]]]:
    """Return group → its loop, and group → the step of :func:`step_response`; empty for a stage without feedback."""
    loops, steps = {}, {}
    for group in driver.groups if driver.kind == "feedback" else ():
        loop = margins(motor, driver, group)
        steps[group] = step_response(motor, driver, group, loop)
        loops[group] = replace(loop, step_overshoot=max(float(steps[group][1].max()) - 1.0, 0.0))
    return loops, steps


def stability_notes(loops: Mapping[str, Loop]) -> list[str]:
    """Return one sentence for each loop that is unstable, or whose phase margin is below :data:`LEAST_MARGIN`."""
    notes, remedy = [], "Raise amplifier.isolation_resistance, or take a shorter cable or a slower amplifier."
    for group, loop in loops.items():
        of = f"The loop of the amplifier of group {group.upper()}"
        if not loop.stable:
            notes.append(f"{of} is unstable into this load: it oscillates near its crossover{loop.at}. {remedy}")
        elif loop.phase_margin_deg is not None and loop.phase_margin_deg < LEAST_MARGIN:
            margin = f"{loop.phase_margin_deg:.3g}°{loop.at}; the limit is {LEAST_MARGIN:g}°"
            notes.append(f"{of} has a phase margin of {margin}. {remedy}")
    return notes
