# SPDX-License-Identifier: GPL-3.0-or-later
"""Equivalent circuits as files for other programs. :data:`CIRCUIT_FORMATS` has the writer of each ending."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.export.equivalent import RESONATOR, circuit_library
from pyspice_runner.export.symbols import RESONATOR_PINS, kicad_symbol, library_name, ltspice_symbol
from pyspice_runner.export.touchstone import touchstone
from pyspice_runner.files import save_by_ending
from pyspice_runner.motor.circuit_file import circuit_toml
from pyspice_runner.motor.equivalent import EquivalentCircuit
from pyspice_runner.spice.library import check_name

_POINTS = 1601
_NEAR_POINTS = 201  # over ten bandwidths around each resonance


@dataclass(frozen=True)
class CircuitExport:
    """An equivalent circuit, to be written as a file.

    Raises:
        ParameterError: by the constructor, for an invalid name.
    """

    circuit: EquivalentCircuit  # the circuit
    title: str = ""  # what the circuit represents, one line
    name: str = RESONATOR  # name of the subcircuit in the ``.lib`` and the symbols
    # frequencies for Touchstone; by default an octave around the resonances, finer near them.
    frequency_hz: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        check_name(self.name)

    def text(self) -> str:
        """Return the ``.lib``."""
        return circuit_library(self.circuit, title=self.title, name=self.name)

    def save(self, path: str | Path) -> Path:
        """Write the file, in the format of its ending, and return its path.

        ``.lib`` (SPICE, ``.subckt resonator p n``), ``.asy`` (LTspice) and ``.kicad_sym`` (KiCad), which name the
        ``.lib`` of the same name beside them, ``.s1p`` (Touchstone) or ``.toml`` (:func:`load_circuit`).

        Raises:
            ParameterError: for another ending or a place that cannot be written.
        """
        return save_by_ending(path, self.writers())

    def writers(self) -> dict[str, Callable[[Path], object]]:
        """Return the writers by ending."""
        return dict.fromkeys(CIRCUIT_FORMATS, self._write)

    def _write(self, path: Path) -> None:
        path.write_text(CIRCUIT_FORMATS[path.suffix](self, path), encoding="utf-8", newline="\n")


def _symbol(symbol: Callable[..., str], export: CircuitExport, path: Path) -> str:
    return symbol(export.name, RESONATOR_PINS, library_name(path), export.title or "piezoelectric resonator")


def _touchstone(export: CircuitExport, _: Path) -> str:
    frequency = _grid(export.circuit) if export.frequency_hz is None else export.frequency_hz
    return touchstone(frequency, export.circuit.admittance(frequency)[:, None, None], title=export.title)


def _grid(circuit: EquivalentCircuit) -> NDArray[np.float64]:
    """Return frequencies that show every resonance."""
    centres = [arm.series_resonance_hz for arm in circuit.arms]
    parts = [np.geomspace(0.5 * centres[0], 2.0 * centres[-1], _POINTS)]
    for arm, centre in zip(circuit.arms, centres, strict=True):
        half = min(5.0 / arm.quality_factor, 0.5)
        parts.append(centre * np.linspace(1.0 - half, 1.0 + half, _NEAR_POINTS))
    return np.unique(np.concatenate(parts))


CIRCUIT_FORMATS: dict[str, Callable[[CircuitExport, Path], str]] = {
    ".lib": lambda export, _: export.text(),
    ".asy": partial(_symbol, ltspice_symbol),
    ".kicad_sym": partial(_symbol, kicad_symbol),
    ".s1p": _touchstone,
    ".toml": lambda export, _: circuit_toml(export.circuit, title=export.title),
}
