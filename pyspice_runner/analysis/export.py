# SPDX-License-Identifier: GPL-3.0-or-later
"""Equivalent circuits and motors as files for other programs, by their ending."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.analysis.touchstone import touchstone
from pyspice_runner.files import save_by_ending
from pyspice_runner.model.circuit_file import circuit_toml
from pyspice_runner.model.equivalent import EquivalentCircuit
from pyspice_runner.model.motor import Motor
from pyspice_runner.model.refusal import checked
from pyspice_runner.model.save import motor_toml
from pyspice_runner.netlist.contact import SLIDERS, ContactLaw
from pyspice_runner.netlist.equivalent import RESONATOR, circuit_library
from pyspice_runner.netlist.motor import SUBCIRCUIT, motor_library
from pyspice_runner.netlist.symbols import MOTOR_PINS, RESONATOR_PINS, kicad_symbol, library_name, ltspice_symbol

Writer = Callable[[Path], object]

_POINTS = 1601
_NEAR_POINTS = 201  # over ten bandwidths around each resonance


@checked
def export_circuit(
    circuit: EquivalentCircuit,
    path: str | Path,
    *,
    title: str = "",
    frequency_hz: NDArray[np.float64] | None = None,
) -> Path:
    """Write an equivalent circuit, by the ending of the file.

    ``.lib`` (SPICE, ``.subckt resonator p n``), ``.asy`` (LTspice) and ``.kicad_sym`` (KiCad), which name the ``.lib``
    of the same name beside them, ``.s1p`` (Touchstone) or ``.toml`` (:func:`load_circuit`).

    Args:
        circuit: the circuit.
        path: the file.
        title: what it stands for, one line.
        frequency_hz: frequencies for Touchstone; by default an octave around the resonances, finer near them.

    Raises:
        ParameterError: for another ending or a place that cannot be written.
    """
    return save_by_ending(path, circuit_writers(circuit, title=title, frequency_hz=frequency_hz))


@checked
def export_motor(
    motor: Motor, path: str | Path, *, contact: ContactLaw = "spring-slider", sliders: int = SLIDERS
) -> Path:
    """Write a motor, by the ending of the file.

    ``.lib`` (SPICE, ``.subckt piezomotor a b com shaft``), ``.asy`` (LTspice) and ``.kicad_sym`` (KiCad), which name
    the ``.lib`` of the same name beside them, ``.s2p`` (Touchstone of the stator, tip free) or ``.toml``
    (:func:`load_motor`).

    Args:
        motor: the motor.
        path: the file.
        contact: law of the contact in the ``.lib``.
        sliders: number of sliders of the brush in it.

    Raises:
        ParameterError: for another ending or a place that cannot be written.
        SimulationError: if ngspice fails to compute the two-port.
    """
    title = f"standing-wave piezomotor {motor.name}"
    return save_by_ending(
        path,
        {
            ".lib": _text(lambda _: motor_library(motor, contact=contact, sliders=sliders)),
            ".asy": _text(lambda file: ltspice_symbol(SUBCIRCUIT, MOTOR_PINS, library_name(file), title)),
            ".kicad_sym": _text(lambda file: kicad_symbol(SUBCIRCUIT, MOTOR_PINS, library_name(file), title)),
            ".s2p": _text(lambda _: _stator(motor)),
            ".toml": _text(lambda _: motor_toml(motor, heading=f"The motor {motor.name}, by its modes.")),
        },
    )


def circuit_writers(
    circuit: EquivalentCircuit, *, title: str = "", frequency_hz: NDArray[np.float64] | None = None
) -> dict[str, Writer]:
    """Return the writers of :func:`export_circuit` by ending."""
    frequency = _grid(circuit) if frequency_hz is None else frequency_hz
    what = title or "piezoelectric resonator"
    return {
        ".lib": _text(lambda _: circuit_library(circuit, title=title)),
        ".asy": _text(lambda file: ltspice_symbol(RESONATOR, RESONATOR_PINS, library_name(file), what)),
        ".kicad_sym": _text(lambda file: kicad_symbol(RESONATOR, RESONATOR_PINS, library_name(file), what)),
        ".s1p": _text(lambda _: touchstone(frequency, circuit.admittance(frequency)[:, None, None], title=what)),
        ".toml": _text(lambda _: circuit_toml(circuit, title=title)),
    }


def _text(make: Callable[[Path], str]) -> Writer:
    return lambda path: path.write_text(make(path), encoding="utf-8", newline="\n")


def _grid(circuit: EquivalentCircuit) -> NDArray[np.float64]:
    """Return frequencies that show every resonance."""
    centres = [arm.series_resonance_hz for arm in circuit.arms]
    parts = [np.geomspace(0.5 * centres[0], 2.0 * centres[-1], _POINTS)]
    for arm, centre in zip(circuit.arms, centres, strict=True):
        half = min(5.0 / arm.quality_factor, 0.5)
        parts.append(centre * np.linspace(1.0 - half, 1.0 + half, _NEAR_POINTS))
    return np.unique(np.concatenate(parts))


def _stator(motor: Motor) -> str:
    from pyspice_runner.analysis.admittance import admittance

    frequencies = [mode.frequency_hz for mode in motor.modes]
    result = admittance(motor, start=0.5 * frequencies[0], stop=2.0 * frequencies[-1], points=2000)
    return touchstone(
        result.frequency_hz, result.matrix_s, title=f"stator of {motor.name}, tip free, port 1 group A, port 2 group B"
    )
