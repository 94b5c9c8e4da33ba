# SPDX-License-Identifier: GPL-3.0-or-later
"""Equivalent circuits and motors as files for other programs, by their ending."""

from __future__ import annotations

import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.engine.compiler import compile_library
from pyspice_runner.files import save_by_ending
from pyspice_runner.model.circuit_file import circuit_toml
from pyspice_runner.model.equivalent import EquivalentCircuit
from pyspice_runner.model.motor import Motor
from pyspice_runner.model.refusal import checked
from pyspice_runner.model.thermal import Thermal
from pyspice_runner.netlist.averaged import averaged_library, check_averaged
from pyspice_runner.netlist.contact import ContactLaw
from pyspice_runner.netlist.equivalent import RESONATOR, circuit_library
from pyspice_runner.netlist.fmu import C_FILES, fmu_texts
from pyspice_runner.netlist.library import check_name
from pyspice_runner.netlist.motor import SUBCIRCUIT, THERMAL_SUBCIRCUIT, motor_library
from pyspice_runner.netlist.symbols import (
    MOTOR_PINS,
    RESONATOR_PINS,
    THERMAL_PINS,
    kicad_symbol,
    library_name,
    ltspice_symbol,
)
from pyspice_runner.netlist.veriloga import motor_module
from pyspice_runner.netlist.xyce import Dialect, check_dialect, in_dialect
from pyspice_runner.spectra.touchstone import touchstone

Writer = Callable[[Path], object]

_POINTS = 1601
_NEAR_POINTS = 201  # over ten bandwidths around each resonance


@checked
def export_circuit(
    circuit: EquivalentCircuit,
    path: str | Path,
    *,
    title: str = "",
    name: str = RESONATOR,
    frequency_hz: NDArray[np.float64] | None = None,
) -> Path:
    """Write an equivalent circuit, by the ending of the file.

    ``.lib`` (SPICE, ``.subckt resonator p n``), ``.asy`` (LTspice) and ``.kicad_sym`` (KiCad), which name the ``.lib``
    of the same name beside them, ``.s1p`` (Touchstone) or ``.toml`` (:func:`load_circuit`).

    Args:
        circuit: the circuit.
        path: the file.
        title: what it stands for, one line.
        name: name of the subcircuit in the ``.lib`` and the symbols.
        frequency_hz: frequencies for Touchstone; by default an octave around the resonances, finer near them.

    Raises:
        ParameterError: for another ending or a place that cannot be written.
    """
    return save_by_ending(path, circuit_writers(circuit, title=title, name=name, frequency_hz=frequency_hz))


@checked
def export_motor(
    motor: Motor,
    path: str | Path,
    *,
    contact: ContactLaw | None = "spring-slider",
    name: str = "",
    thermal: Thermal | None = None,
    averaged: bool = False,
    dialect: Dialect = "spice",
) -> Path:
    """Write a motor, by the ending of the file.

    ``.lib`` (SPICE, ``.subckt piezomotor a b com shaft``), ``.va`` (Verilog-A, ``module piezomotor(a, b, com, shaft,
    temperature)``), ``.asy`` (LTspice) and ``.kicad_sym`` (KiCad), which name
    the ``.lib`` of the same name beside them, ``.s2p`` (Touchstone of the stator, tip free) or ``.toml``
    (:func:`load_motor`). ``.fmu`` is the averaged motor for control tools: FMI 2.0 for co-simulation, with C sources
    and a binary for Linux on x86-64, which the system's C compiler builds.

    Args:
        motor: the motor.
        path: the file.
        contact: law of the contact in the ``.lib`` or ``.va``.
        name: name of the subcircuit in the ``.lib``, the ``.va`` and the symbols; by default ``piezomotor``.
        thermal: drift with temperature, for the pins ``temperature`` and ``heat`` (``piezomotor_thermal`` by default).
        averaged: whether to write the averaged motor, ``.subckt piezomotor_averaged``, as a ``.lib``; a ``.fmu``
            always contains it.
        dialect: ``"spice"`` writes the ``.lib`` for ngspice and LTspice, ``"xyce"`` for Xyce.

    Raises:
        ParameterError: for another ending, a place that cannot be written, or a name that is not possible.
        SimulationError: if ngspice fails to compute the two-port, or there is no C compiler for a ``.fmu``.
    """
    check_dialect(dialect, path)
    if averaged or Path(path).suffix == ".fmu":
        check_averaged(contact)
        return save_by_ending(
            path,
            {
                ".lib": _text(lambda _: in_dialect(averaged_library(motor, name=name, thermal=thermal), dialect)),
                ".fmu": lambda file: _write_fmu(fmu_texts(motor, name=name, thermal=thermal), file),
            },
        )
    title = f"standing-wave piezomotor {motor.name}"
    subcircuit = check_name(name) if name else (THERMAL_SUBCIRCUIT if thermal else SUBCIRCUIT)
    pins = MOTOR_PINS + (THERMAL_PINS if thermal else ())

    def library() -> str:
        return motor_library(motor, contact=contact, name=name, thermal=thermal)

    return save_by_ending(
        path,
        {
            ".lib": _text(lambda _: in_dialect(library(), dialect)),
            ".va": _text(lambda _: motor_module(motor, contact=contact, name=name, thermal=thermal)),
            ".asy": _text(lambda file: ltspice_symbol(subcircuit, pins, library_name(file), title)),
            ".kicad_sym": _text(lambda file: kicad_symbol(subcircuit, pins, library_name(file), title)),
            ".s2p": _text(lambda _: _stator(motor)),
            ".toml": _text(lambda _: motor.to_toml(heading=f"The motor {motor.name}, by its modes.")),
        },
    )


def circuit_writers(
    circuit: EquivalentCircuit,
    *,
    title: str = "",
    name: str = RESONATOR,
    frequency_hz: NDArray[np.float64] | None = None,
) -> dict[str, Writer]:
    """Return the writers of :func:`export_circuit` by ending."""
    frequency = _grid(circuit) if frequency_hz is None else frequency_hz
    check_name(name)
    what = title or "piezoelectric resonator"
    return {
        ".lib": _text(lambda _: circuit_library(circuit, title=title, name=name)),
        ".asy": _text(lambda file: ltspice_symbol(name, RESONATOR_PINS, library_name(file), what)),
        ".kicad_sym": _text(lambda file: kicad_symbol(name, RESONATOR_PINS, library_name(file), what)),
        ".s1p": _text(lambda _: touchstone(frequency, circuit.admittance(frequency)[:, None, None], title=what)),
        ".toml": _text(lambda _: circuit_toml(circuit, title=title)),
    }


def _text(make: Callable[[Path], str]) -> Writer:
    return lambda path: path.write_text(make(path), encoding="utf-8", newline="\n")


def _write_fmu(texts: dict[str, str], path: Path) -> None:
    """Compile the sources of a Functional Mock-up Unit, and write them with the binary into an archive."""
    identifier = ElementTree.fromstring(texts["modelDescription.xml"]).attrib["modelName"]
    with tempfile.TemporaryDirectory(prefix="piezomotor-") as folder:
        for name, text in texts.items():
            (Path(folder) / Path(name).name).write_text(text, encoding="utf-8", newline="\n")
        binary = Path(folder) / f"{identifier}.so"
        compile_library(Path(folder), C_FILES, binary)
        contents = {name: text.encode() for name, text in texts.items()}
        contents[f"binaries/linux64/{identifier}.so"] = binary.read_bytes()
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in contents.items():
            archive.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED)  # without the time of the export


def _grid(circuit: EquivalentCircuit) -> NDArray[np.float64]:
    """Return frequencies that show every resonance."""
    centres = [arm.series_resonance_hz for arm in circuit.arms]
    parts = [np.geomspace(0.5 * centres[0], 2.0 * centres[-1], _POINTS)]
    for arm, centre in zip(circuit.arms, centres, strict=True):
        half = min(5.0 / arm.quality_factor, 0.5)
        parts.append(centre * np.linspace(1.0 - half, 1.0 + half, _NEAR_POINTS))
    return np.unique(np.concatenate(parts))


def _stator(motor: Motor) -> str:
    from pyspice_runner.spectra.admittance import admittance

    frequencies = [mode.frequency_hz for mode in motor.modes]
    result = admittance(motor, start=0.5 * frequencies[0], stop=2.0 * frequencies[-1], points=2000)
    return touchstone(
        result.frequency_hz, result.matrix_s, title=f"stator of {motor.name}, tip free, port 1 group A, port 2 group B"
    )
