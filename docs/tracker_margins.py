# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure the margins of four trackers and write a table of ``docs/accuracy.md``: ``python -m docs.tracker_margins``.

The printed margin is that of ``track``. The measured one is the ratio of returned to injected voltage of a small sine
in front of the oscillator, in a run of its own. It takes some minutes of one core.
"""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import pyspice_runner as pr
from pyspice_runner.circuit.law import PAPER_LAW, ContactLaw, law_of
from pyspice_runner.run.point import Point, Solver
from pyspice_runner.trackers.tracker import TrackedSource, propose_filter, running_resonance

PAGE = Path(__file__).with_name("accuracy.md")
BEGIN, END = "<!-- trackers by python -m docs.tracker_margins -->", "<!-- end of the trackers -->"
HEAD = """\
|loop|printed|measured|
|---|---|---|"""
SWING_HZ = 0.15  # amplitude of the injected sine, over the half bandwidth of the mode
# ratio of the usual step to the step of the measurement, at the end of which an edge is seen. With a feedback electrode
# 2, 3, 4 and 8 give 83.5, 79.7, 79.0 and 79.9°
FINER = 4.0
CYCLES = 6


@dataclass(frozen=True)
class Case:
    """One loop."""

    motor: str
    tracker: dict[str, Any]
    duration: float  # s, after which the speed has settled
    driver: dict[str, Any] = field(default_factory=dict)
    changes: dict[str, Any] = field(default_factory=dict)  # of the motor

    def parts(self) -> tuple[pr.Motor, pr.Tracker, pr.Driver | None]:
        """Return motor, tracker in the middle of its range, and driver."""
        light = {"andersen2002": 1e-7, "bimodal40": 1e-6}[self.motor]  # kg m²
        motor = pr.load_motor(self.motor).updated({"rotor.inertia_kg_m2": light, **self.changes})
        start = {"frequency": motor.modes[-1].frequency_hz, **self.tracker}
        tracker = pr.Tracker(kind="pll", **start)
        tracker = tracker.model_copy(update={"frequency": running_resonance(motor, tracker).resonance_hz})
        same = {name: getattr(tracker, name) for name in ("voltage", "ratio_b", "phase_deg", "frequency")}
        return motor, tracker, pr.Driver(**{**same, **self.driver}) if self.driver else None


ELECTRODE = {"capacitance_f": 3e-10, "couplings_n_per_v": {"mode-4": 0.02}, "share_a": 0.1, "share_b": 0.12}
COIL = {"kind": "half-bridge", "network": "inductor"}
CASES = {
    "`bimodal40`, 60 V, −30°": Case("bimodal40", {"voltage": 60.0, "phase_deg": 90.0, "target_deg": -30.0}, 20e-3),
    "`bimodal40`, 60 V, −30°, feedback electrode with 5 % of the shares of the voltages": Case(
        "bimodal40",
        {"voltage": 60.0, "phase_deg": 90.0, "target_deg": -30.0, "sense": "feedback", "capacitance_error": 0.05},
        20e-3, changes={"feedback": ELECTRODE},
    ),
    "`andersen2002`, 50 V and 100 V, 1 kHz": Case(
        "andersen2002", {"voltage": 50.0, "ratio_b": 2.0, "bandwidth_hz": 1000.0, "ripple_ratio": 2.0}, 8e-3
    ),
    "`andersen2002`, 25 V and 50 V, half bridge with 1.5 mH": Case(
        "andersen2002", {"voltage": 25.0, "ratio_b": 2.0}, 8e-3,
        {**COIL, "settings": {"inductor.inductance": 1.5e-3, "inductor.resistance": 15.0}},
    ),
    "`andersen2002`, 25 V and 50 V, amplifier with 1.5 mH": Case(
        "andersen2002", {"voltage": 25.0, "ratio_b": 2.0}, 8e-3,
        {**COIL, "kind": "linear", "settings": {"inductor.inductance": 1.5e-3, "inductor.resistance": 15.0}},
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Margins:
    """Crossover in Hz and phase margin in degrees of one loop."""

    printed: tuple[float, float]
    measured: tuple[float, float]


def measured_loop_gain(
    motor: pr.Motor,
    tracker: pr.Tracker,
    frequency_hz: float,
    *,
    begin: float,
    contact: ContactLaw | None = PAPER_LAW,
    amplitude_hz: float = 150.0,
    cycles: int = 5,
    step: float | None = None,
    driver: pr.Driver | None = None,
) -> complex:
    """Measure the gain of a running loop over some cycles from a time on, by a small sine in front of its oscillator.

    At an unloaded voltage node of the loop, the ratio of returned to injected voltage is minus the loop gain
    (R. D. Middlebrook, Int. J. Electronics 38 (1975) 485). The amplitude, as a frequency of the oscillator, is large
    enough that the phase swings by several time steps, the resolution of the detector's edges.
    """
    mode = len(motor.modes) - 1
    lag = running_resonance(motor, tracker, contact=contact is not None)
    window = cycles / frequency_hz
    inject = f"SIN(0 {amplitude_hz / tracker.gain_hz_per_v!r} {frequency_hz!r})"
    source = TrackedSource(tracker, mode, propose_filter(tracker, lag), driver, inject=inject)
    setup = Point(motor, source, law=law_of(contact, motor.law), solver=Solver(step))
    vectors = setup.run(begin + window, ["v(control)", "v(tuning)", "v(tuned)"]).vectors()
    time = vectors["time"]
    grid = np.linspace(time[-1] - window, time[-1], 4096 * cycles + 1)
    turns = np.exp(-2j * np.pi * frequency_hz * grid)
    after, before = (
        np.trapezoid((values - values.mean()) * turns, grid)
        for values in (np.interp(grid, time, vectors[name]) for name in ("v(control)", "v(tuning)"))
    )
    return complex(-after / before)


def measured(case: Case) -> Margins:
    """Print and measure a loop."""
    motor, tracker, driver = case.parts()
    found = pr.track(motor, tracker, case.duration, driver=driver)
    loop = found.loop
    if loop is None:
        raise pr.SimulationError(found.no_loop or "The tracker is not locked.")
    half_width = 0.5 * found.lag.resonance_hz / found.lag.quality
    step = found.settings["run"]["step_s"] / FINER
    gain = measured_loop_gain(
        motor, tracker, loop.crossover_hz, amplitude_hz=SWING_HZ * half_width, cycles=CYCLES, step=step, driver=driver,
        begin=case.duration,
    )  # fmt: skip
    levels, places = np.log(np.abs(loop.gain)), np.log(loop.frequency_hz)
    near = np.abs(places - np.log(loop.crossover_hz)) < 0.2
    slope = np.polyfit(places[near], levels[near], 1)[0]
    turning = np.polyfit(places[near], np.degrees(np.unwrap(np.angle(loop.gain[near]))), 1)[0]
    shift = -np.log(abs(gain)) / slope
    crossover = loop.crossover_hz * float(np.exp(shift))
    margin = 180.0 + float(np.degrees(np.angle(gain)) + turning * shift)
    return Margins((loop.crossover_hz, loop.phase_margin_deg), (crossover, margin))


def row(name: str, found: Margins) -> str:
    """Return a line of the table."""
    shown = [f"{margin:.1f}° at {crossover:.0f} Hz" for crossover, margin in (found.printed, found.measured)]
    return f"|{name}|{'|'.join(shown)}|"


def main() -> None:
    """Write the table, and print it as it grows."""
    lines = [HEAD]
    for name, case in CASES.items():
        lines.append(row(name, measured(case)))
        sys.stdout.write(lines[-1] + "\n")
        sys.stdout.flush()
    page = PAGE.read_text(encoding="utf-8")
    new = f"{BEGIN}\n" + "\n".join(lines) + f"\n{END}"
    PAGE.write_text(re.sub(f"{BEGIN}.*?{END}", lambda _: new, page, flags=re.S), encoding="utf-8")


if __name__ == "__main__":
    main()
