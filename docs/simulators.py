# SPDX-License-Identifier: GPL-3.0-or-later
"""Write ``docs/simulators.md``, the motor in four simulators: ``python -m docs.simulators``. It takes the compiler."""

from __future__ import annotations

import os
import textwrap
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from PySpice.Spice.Netlist import Circuit

import pyspice_runner as pr
from pyspice_runner.circuit.bench import Bench
from pyspice_runner.circuit.compiled import loading, module_of, module_subcircuit
from pyspice_runner.circuit.fixtures import AC_OPTIONS
from pyspice_runner.circuit.law import Law
from pyspice_runner.run.kernel import ac
from pyspice_runner.run.waveforms import Waveforms
from pyspice_runner.spice.ngspice import ngspice_version
from pyspice_runner.spice.openvaf import compiler_version, find_compiler, find_osdi_ngspice
from tests.impedance.test_admittance import preloaded_closed_form
from tests.run.test_reference import DURATION, POINTS, speed_error, trajectory_error
from tests.tools import second_simulator

PAGE = Path(__file__).with_name("simulators.md")
MOTORS = ("andersen2002", "andersen2002-unintended-mode", "beam40")
FREQUENCIES = (10e3, 70e3, 601)  # Hz, Hz, points
INTRODUCTION = """
The same runs in four simulators, each against the independent, event-driven integrator of `tests/reference`, which is
converged to 1e-8 and shares no code with the package. The operating points, and what the errors mean, are those of
[accuracy](accuracy.md): 4 ms from rest under preload, the default step. Each cell has the error of the tip's trajectory
and that of the mean speed, both in per cent. B-sources: the SPICE subcircuits. Compiled: the Verilog-A module
([compiled engine](compiled.md)). VACASK shares no code with ngspice: it has its own reader, equation solver and
integration. It runs the same compiled module.
"""
AGREEMENT = """
The errors of the trajectory are the same to 0.002 % of the motion. They are those of the time step, which the four
share: all integrate by the trapezoidal rule, with the same step and the same adapted modes. Mean speeds differ by up to
0.25 % of the peak speed, because each simulator sees a change between stick and slip at the end of a step, and VACASK's
steps lie between those of ngspice.
"""
SMALL_SIGNALS = """
The admittance matrix of the preloaded stator from 10 kHz to 70 kHz, 601 points, against the closed form of modes, mount
and rotor that are coupled by the linearised contact: largest deviation over the largest admittance. The contact has no
damping here (`contact.restitution` = 1).
"""


def wrap(text: str) -> list[str]:
    """Return a paragraph's lines."""
    return textwrap.wrap(" ".join(text.split()), 110)


@contextmanager
def newer_ngspice() -> Iterator[None]:
    """Let the ngspice that runs compiled modules run everything."""
    path = os.environ["PATH"]
    os.environ["PATH"] = f"{Path(find_osdi_ngspice()).parent}{os.pathsep}{path}"
    try:
        yield
    finally:
        os.environ["PATH"] = path


def spice(name: str) -> Waveforms:
    """Return the run of a point with the B-sources, in the ngspice that is first on the PATH."""
    point = POINTS[name]
    return pr.simulate(point.motor, point.drive, duration=DURATION, **point.load)


def newer(name: str) -> Waveforms:
    """Return the same in the ngspice that runs compiled modules."""
    with newer_ngspice():
        return spice(name)


def compiled(name: str) -> Waveforms:
    """Return the run of a point with the compiled module."""
    point = POINTS[name]
    return pr.simulate(point.motor, point.drive, duration=DURATION, engine="compiled", **point.load)


def vacask(name: str) -> Waveforms:
    """Return the run of a point in VACASK."""
    point = POINTS[name]
    return second_simulator.simulate(point.motor, point.drive, duration=DURATION, **point.load)


def runs() -> dict[str, Callable[[str], Waveforms]]:
    """Return the simulators by their headings, each with what runs a point in it."""
    with newer_ngspice():
        version = ngspice_version()
    return {
        f"ngspice {ngspice_version()}, B-sources": spice,
        f"ngspice {version}, B-sources": newer,
        f"ngspice {version}, compiled": compiled,
        "VACASK, compiled": vacask,
    }


def errors(name: str, run: Waveforms) -> tuple[float, float]:
    """Return the errors of trajectory and speed in per cent."""
    return 100.0 * trajectory_error(name, run), 100.0 * speed_error(name, run)


def compiled_admittance(motor: pr.Motor, sweep: dict[str, Any]) -> np.ndarray:
    """Return the admittance matrix of the compiled motor in ngspice, shape (points, 2, 2)."""
    module = module_of(motor, Law())
    columns = []
    for driven in "ab":
        circuit = Circuit(f"{motor.name}: admittance")
        text = [loading(module), module_subcircuit(motor, Law(), None, "piezomotor"), "Xmotor a b 0 shaft piezomotor"]
        text += [f"V{group} {group} 0 DC 0 AC {int(group == driven)}" for group in "ab"]
        circuit.raw_spice += "\n".join(text) + "\n"
        vectors = ac(Bench(circuit, AC_OPTIONS, modules=(module,)), ["i(va)", "i(vb)"], **sweep).phasors()
        columns.append([-vectors[f"i(v{group})"] for group in "ab"])
    return np.array(columns).transpose(2, 1, 0)


def deviations(name: str) -> list[float]:
    """Return the largest deviation of the admittance from the closed form, in the order of :func:`runs`."""
    motor = pr.load_motor(name).updated({"contact.restitution": 1.0})
    start, stop, points = FREQUENCIES
    settings: dict[str, Any] = {"start": start, "stop": stop, "points": points, "state": "preloaded"}
    first = pr.admittance(motor, **settings)
    with newer_ngspice():
        second = pr.admittance(motor, **settings)
    frequency = first.frequency_hz
    exact = preloaded_closed_form(motor, frequency)
    sweep = {
        "variation": "lin", "number_of_points": points, "start_frequency": start, "stop_frequency": stop,
    }  # fmt: skip
    found = (
        (frequency, first.matrix_s),
        (second.frequency_hz, second.matrix_s),
        (np.linspace(start, stop, points), compiled_admittance(motor, sweep)),
        (frequency, second_simulator.admittance(motor, frequency)),
    )
    scale = np.abs(exact).max()
    return [float(np.abs(y - preloaded_closed_form(motor, f)).max() / scale) for f, y in found]


def page() -> str:
    """Return the page, freshly measured."""
    simulators = runs()
    heading = [f"| operating point | {' | '.join(simulators)} |", f"|---|{'---|' * len(simulators)}"]
    lines = [
        "<!-- Written by `python -m docs.simulators`; `make verilog-a` measures a part of it again. -->",
        "# Comparison of simulators",
        "",
        *wrap(INTRODUCTION),
        "",
        f"Compiler: {compiler_version(find_compiler())}.",
        "",
        *heading,
    ]
    for name in POINTS:
        cells = (errors(name, run(name)) for run in simulators.values())
        lines.append(f"| {name} | {' | '.join(f'{path:.3f} / {speed:.3f}' for path, speed in cells)} |")
    lines += ["", *wrap(AGREEMENT), "", "## Small signals", "", *wrap(SMALL_SIGNALS), ""]
    lines += [heading[0].replace("operating point", "motor"), heading[1]]
    lines += [f"| {name} | {' | '.join(f'{value:.1e}' for value in deviations(name))} |" for name in MOTORS]
    return "\n".join([*lines, ""])


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8", newline="\n")
