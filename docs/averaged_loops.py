# SPDX-License-Identifier: GPL-3.0-or-later
"""Loops with the averaged and the full motor, tables of ``docs/accuracy.md``: ``python -m docs.averaged_loops``.

What is measured is kept in ``averaged_loops.json``, row by row, so that an interrupted run can be resumed; a row that
is taken out of it is measured anew. All rows take 6 minutes of CPU time, nearly all of it for the full motor.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Mapping
from math import copysign
from pathlib import Path
from runpy import run_path
from typing import Any

import numpy as np

import pyspice_runner as pr
from pyspice_runner.control.loop import ControlLoop, LoopController
from pyspice_runner.control.run import ControlledRun

PAGE = Path(__file__).with_name("accuracy.md")
RECORD = Path(__file__).with_suffix(".json")
CONTROLLERS = PAGE.parents[1] / "examples" / "controllers"
MOTOR = pr.load_motor("bimodal40")
DRIVE = pr.default_drive(MOTOR).model_copy(update={"voltage": 60.0})

# --- samples of both motors in the same loop ---

HIGHEST, PHASE = 110.0, 90.0  # V, deg
LOAD = 10e-3  # N·m, of the load step
EVENT = 15e-3  # s, of load step and reversal
ALLOWED = 0.03  # RMS of the difference, of the range
COMPARED = ("speed_rad_s", "position_rad", "voltage_a_v")


class SpeedLoop:
    """A PI controller of the speed; the sign of its output is that of the phase.

    Args:
        wanted: time in s → set point, rad/s.
        proportional: gain in V s/rad.
        integral: gain in V s/rad for each sample.
        dead_band: in V, which is added to the magnitude of the output.
    """

    def __init__(
        self, wanted: Callable[[float], float], proportional: float, integral: float, dead_band: float
    ) -> None:
        self.wanted, self.proportional, self.rate, self.dead_band = wanted, proportional, integral, dead_band
        self.sum = 0.0

    def __call__(self, sample: pr.Sample) -> dict[str, float]:
        """Return amplitude and phase until the next sample."""
        error, span = self.wanted(sample.time_s) - sample.speed_rad_s, HIGHEST - self.dead_band
        if abs(self.proportional * error + self.sum) < span:  # no windup
            self.sum += self.rate * error
        output = self.proportional * error + self.sum
        return {"voltage": self.dead_band + min(abs(output), span), "phase_deg": copysign(PHASE, output)}


def _slow(speed: float, proportional: float, integral: float, dead_band: float) -> Callable[[bool], ControlledRun]:
    def run(averaged: bool) -> ControlledRun:
        loop = SpeedLoop(lambda _: speed, proportional, integral, dead_band)
        return pr.simulate_controlled(MOTOR, DRIVE, loop, 30e-3, sample_time=0.5e-3, averaged=averaged)

    return run


def _load_step(averaged: bool) -> ControlledRun:
    steps = {"load_torque": [(0.0, 0.0), (EVENT, 0.0), (EVENT + 1e-6, LOAD)]}
    loop = SpeedLoop(lambda _: 8.0, 1.0, 0.15, 37.0)
    return pr.simulate_controlled(MOTOR, DRIVE, loop, 30e-3, sample_time=0.25e-3, averaged=averaged, courses=steps)


def _reversal(averaged: bool) -> ControlledRun:
    loop = SpeedLoop(lambda time: 8.0 if time < EVENT else -8.0, 1.0, 0.15, 37.0)
    return pr.simulate_controlled(MOTOR, DRIVE, loop, 35e-3, sample_time=0.25e-3, averaged=averaged)


def _position(averaged: bool) -> ControlledRun:
    found: ControlledRun = run_path(str(CONTROLLERS / "position.py"))["run"](30e-3, averaged=averaged)
    return found


LOOPS: dict[str, Callable[[bool], ControlledRun]] = {
    "8 rad/s, load step of 10 mN·m at 15 ms, 30 ms in all, 4 kHz": _load_step,
    "reversal from 8 to −8 rad/s at 15 ms, 35 ms in all, 4 kHz": _reversal,
    "position with a burst at the end, 30 ms, 4 kHz": _position,
    "3 rad/s from rest, dead band compensated, 30 ms, 2 kHz": _slow(3.0, 1.0, 0.15, 33.0),
    "limit cycle about 0.2 rad/s, 30 ms, 2 kHz": _slow(0.2, 1.0, 0.15, 25.0),
}


def compared(name: str) -> dict[str, float | bool]:
    """Return the RMS error of each quantity over its range, mean and ripple of the speed, and whether it is trusted."""
    averaged, full = (LOOPS[name](averaged) for averaged in (True, False))
    found: dict[str, float | bool] = {"trusted": averaged.trusted}
    for quantity in COMPARED:
        ours, theirs = averaged.samples[quantity], full.samples[quantity]
        found[quantity] = float(np.sqrt(np.mean((ours - theirs) ** 2)) / np.ptp(theirs))
    late = slice(len(full.time_s) // 3, None)
    for which, run in (("averaged", averaged), ("full", full)):
        speed = run.speed_rad_s[late]
        found |= {f"mean_{which}": float(speed.mean()), f"ripple_{which}": float(speed.std())}
    return found


# --- loop gains by injection ---

DESIGNS: dict[str, dict[str, Any]] = {
    "slow speed": {"quantity": "speed", "crossover": 40.0, "margin": 60.0, "sample_time": 0.5e-3},
    "fast speed": {"quantity": "speed", "crossover": 100.0, "margin": 45.0, "sample_time": 0.25e-3},
    "loaded speed": {
        "quantity": "speed", "crossover": 125.0, "margin": 55.0, "sample_time": 0.2e-3, "load_torque": 5e-3
    },
    "position": {"quantity": "position", "crossover": 20.0, "margin": 90.0, "sample_time": 0.5e-3},
    # twice the drive's frequency is 1.6 kHz from a multiple of 4.2 kHz; the mean phase of the full motor beats with it
    "phase": {"quantity": "phase", "crossover": 150.0, "margin": 90.0, "sample_time": 1.0 / 4200.0},
}  # fmt: skip
SETTLES = {"position": 0.1}  # s, from rest to the modulation; of the other loops less
QUICKLY = 0.06
MODULATION = {"speed": 0.5, "position": 0.5, "phase": 3.0}  # V, V and Hz: a per cent of the operating point
CYCLES = (2, 3)  # of the modulation, before the measurement and in it
SETTLING = 20  # samples in which a loop of the phase, closed at the steady speed, settles


def injected(
    loop: ControlLoop, motor: pr.Motor, drive: pr.TwoPhaseDrive, *, settles: float, size: float = 1.0,
    cycles: tuple[int, int] = CYCLES, **how: Any,
) -> complex:  # fmt: skip
    """Return the loop gain at the designed crossover, by a sine that is added to the controller's output.

    The ratio of returned to injected signal is minus the loop gain (R. D. Middlebrook, Int. J. Electronics 38, 1975).
    ``settles`` in s is the time before the sine, ``size`` that of the sine relative to the usual one; ``cycles`` of the
    sine pass before the measurement and in it; ``how`` goes to ``simulate_controlled``.
    """
    wanted = loop.provenance["run"]
    step, point = wanted["sample_time_s"], wanted["operating_point"]
    cycle = round(1.0 / wanted["crossover_hz"] / step)
    speed, phase = point["speed"], point["current_phase_a"]
    controller = LoopController(
        loop, lambda time: {"speed": speed, "position": speed * time, "phase": phase}[loop.quantity]
    )
    signals: list[tuple[float, float]] = []
    begins = round(settles / step)

    def modulated(sample: pr.Sample) -> Mapping[str, float]:
        number = len(signals)
        if loop.quantity == "phase" and number < begins - SETTLING:  # far from the point it would find another one
            signals.append((0.0, 1.0))
            return {}
        commands = dict(controller(sample))
        sine = size * MODULATION[loop.quantity] * np.sin(2.0 * np.pi * number / cycle) if number >= begins else 0.0
        name = "frequency" if loop.quantity == "phase" else "voltage_a"
        before = commands[name]
        signals.append((before, before + sine))
        if loop.quantity == "phase":
            return {"frequency": before + sine}
        turned = {"phase_deg": commands["phase_deg"]} if "phase_deg" in commands else {}
        return {"voltage": before + sine} | turned

    first, measured = begins + cycles[0] * cycle, cycles[1] * cycle
    pr.simulate_controlled(
        motor, drive, modulated, duration=(first + measured + 0.5) * step, sample_time=step,
        load_torque=wanted["load_torque_n_m"], **how,
    )  # fmt: skip
    wave = np.exp(-2j * np.pi * np.arange(measured) / cycle)
    returned, added = wave @ np.array(signals[first : first + measured])
    return complex(-returned / added)


def difference(loop: ControlLoop, measured: complex) -> tuple[float, float]:
    """Return the relative error of the crossover, by the slope of the loop gain there, and that of the margin, deg."""
    wanted = loop.provenance["run"]
    place = np.log(loop.frequency_hz)
    cycle = round(1.0 / wanted["crossover_hz"] / wanted["sample_time_s"])  # samples of the sine, which is near it
    at = -np.log(cycle * wanted["sample_time_s"])
    level = np.log(np.abs(loop.loop_gain))
    slope = (np.interp(at + 0.1, place, level) - np.interp(at - 0.1, place, level)) / 0.2
    phase = np.unwrap(np.angle(loop.loop_gain))
    turning = (np.interp(at + 0.1, place, phase) - np.interp(at - 0.1, place, phase)) / 0.2
    crossover = (np.interp(at, place, level) - np.log(abs(measured))) / slope
    margin = np.angle(measured * np.exp(-1j * np.interp(at, place, phase))) + turning * crossover
    return float(crossover), float(np.degrees(margin))


def margins(name: str) -> dict[str, float]:
    """Return crossover in Hz and margin in degrees of a design, measured in the full motor."""
    loop = pr.control_loop(MOTOR, DRIVE, **DESIGNS[name])
    gain = injected(loop, MOTOR, DRIVE, settles=SETTLES.get(name, QUICKLY), averaged=False)
    crossover, margin = difference(loop, gain)
    wanted = DESIGNS[name]
    return {"crossover_hz": wanted["crossover"] * (1.0 + crossover), "margin_deg": wanted["margin"] + margin}


# --- record and page ---

Row = Mapping[str, Any]
TABLES: dict[str, tuple[Callable[[str], Row], tuple[str, ...]]] = {
    "samples": (compared, tuple(LOOPS)),
    "margins": (margins, tuple(DESIGNS)),
}


def read() -> dict[str, dict[str, dict[str, Any]]]:
    """Return the measured values: table → row → values."""
    known = json.loads(RECORD.read_text(encoding="utf-8")) if RECORD.exists() else {}
    return {table: known.get(table, {}) for table in TABLES}


def _samples_row(name: str, row: Row) -> str:
    errors = (f"{100.0 * row[quantity]:.2g} %" for quantity in COMPARED)
    return f"|{name}|{'|'.join(errors)}|{'yes' if row['trusted'] else 'no'}|"


def _margins_row(name: str, row: Row) -> str:
    wanted = DESIGNS[name]
    load = f" under {1e3 * wanted['load_torque']:g} mN·m" if "load_torque" in wanted else ""
    return (
        f"|{wanted['quantity']}{load}, sampled at {1e-3 / wanted['sample_time']:g} kHz|{wanted['crossover']:g} Hz, "
        f"{wanted['margin']:g}°|{row['crossover_hz']:.4g} Hz, {row['margin_deg']:.1f}°|"
    )


def tables() -> dict[str, str]:
    """Return the tables of the page, of what was measured."""
    known = read()
    heads = {
        "samples": "|loop|error, RMS of the range: speed|position|amplitude|trusted|\n|---|---|---|---|---|",
        "margins": "|loop|designed|measured in the full motor|\n|---|---|---|",
    }
    rows = {"samples": _samples_row, "margins": _margins_row}
    found = {}
    for table, head in heads.items():
        names = [name for name in TABLES[table][1] if name in known[table]]
        found[table] = "\n".join([head, *(rows[table](name, known[table][name]) for name in names)])
    return found


def marks(table: str) -> tuple[str, str]:
    """Return the lines of the page that enclose a table."""
    return f"<!-- {table} by python -m docs.averaged_loops -->", f"<!-- end of the {table} -->"


def main() -> None:
    """Measure what is not in the record, and write the tables."""
    known = read()
    for table, (measure, names) in TABLES.items():
        for name in names:
            if name not in known[table]:
                known[table][name] = dict(measure(name))
                sys.stdout.write(f"{name}: {known[table][name]}\n")
                sys.stdout.flush()
                RECORD.write_text(json.dumps(known, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    page = PAGE.read_text(encoding="utf-8")
    for table, text in tables().items():
        begin, end = marks(table)
        page = re.sub(f"{begin}.*?{end}", lambda _, new=f"{begin}\n{text}\n{end}": new, page, flags=re.S)
    PAGE.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
