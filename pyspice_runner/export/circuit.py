# SPDX-License-Identifier: GPL-3.0-or-later
"""Equivalent circuits as files for other programs: ``.subckt NAME p n``, symbols, Touchstone, TOML.

:data:`CIRCUIT_FORMATS` has the writer of each ending.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import pi
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.export.symbols import RESONATOR_PINS, ascii_line, kicad_symbol, library_name, ltspice_symbol
from pyspice_runner.files import save_by_ending
from pyspice_runner.motor.circuit_file import circuit_toml
from pyspice_runner.motor.equivalent import EquivalentCircuit
from pyspice_runner.motor.refusal import checked
from pyspice_runner.motor.stator import STEP_WORDS, longest_step
from pyspice_runner.spice.library import check_name, definition_texts, part_name, read_library

RESONATOR = "resonator"
REFERENCE_OHM = 50.0  # of a Touchstone file
_LEAST = 1e-9
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


# --- Touchstone ---


def touchstone(frequency_hz: NDArray[np.float64], matrix_s: NDArray[np.complex128], *, title: str = "") -> str:
    """Return an admittance in S, shape (points, ports, ports), as the text of a Touchstone 1.1 file, to sixteen digits.

    S = (1 + Z₀Y)⁻¹ (1 − Z₀Y) at Z₀ = 50 Ω.
    """
    ports = matrix_s.shape[-1]
    one = np.eye(ports)
    normalised = REFERENCE_OHM * matrix_s
    scattering = np.linalg.solve(one + normalised, one - normalised)
    # a two-port's columns are S11 S21 S12 S22, by the standard
    cells = scattering.transpose(0, 2, 1).reshape(len(frequency_hz), -1)
    lines = [
        f"! {ascii_line(title) or 'piezoelectric resonator'}",
        f'! USE: import skrf; y = skrf.Network("THIS.s{ports}p").y, or `piezomotor fit THIS.s{ports}p`',
        f"# Hz S RI R {REFERENCE_OHM:g}",
    ]
    for frequency, row in zip(frequency_hz.tolist(), cells, strict=True):
        lines.append(" ".join([repr(frequency), *(f"{part:.16e}" for cell in row for part in (cell.real, cell.imag))]))
    return "\n".join(lines) + "\n"


# --- the library ---


@checked
def circuit_library(circuit: EquivalentCircuit, *, name: str = RESONATOR, title: str = "") -> str:
    """Return a library of one equivalent circuit: header, usage and ``.subckt NAME p n``.

    The digits of the values are sufficient to read them back exactly. Leads below 1e-9 of the device's impedance at its
    resonances are omitted, and so is such a loss tangent: they would reduce the precision of the simulator.

    Raises:
        ParameterError: for an invalid name.
    """
    check_name(name)
    first, last = circuit.arms[0].series_resonance_hz, circuit.arms[-1].series_resonance_hz
    main = max(circuit.arms, key=lambda arm: arm.capacitance_f)
    resonances = np.array([arm.series_resonance_hz for arm in circuit.arms])
    greatest = float(np.max(np.abs(circuit.device_admittance(resonances))))
    step = longest_step(resonances, [arm.quality_factor for arm in circuit.arms])
    check = part_name("piezomotor_check", name)
    elements = [f"Xcheck pin p pin check {check} step={step!r}"]  # with its ammeter between p and pin
    node = "pin"
    for kind, value, impedance in (
        ("R", circuit.lead_resistance_ohm, circuit.lead_resistance_ohm),
        ("L", circuit.lead_inductance_h, 2.0 * pi * last * circuit.lead_inductance_h),
    ):
        if impedance * greatest > _LEAST:
            elements.append(f"{kind}lead {node} lead{kind.lower()} {value!r}")
            node = f"lead{kind.lower()}"
    elements += _branch(circuit, 0, node, [])
    for index, (arm, own) in enumerate(zip(circuit.arms, circuit.own_resistance_ohm, strict=True), start=1):
        least = _LEAST * arm.resistance_ohm
        series = [("L", arm.inductance_h), *([("R", own)] if own > least else []), ("C", arm.capacitance_f)]
        elements += _branch(circuit, index, node, series)
    for row in range(1, len(circuit.shared_losses) + 1):
        elements.append(f"Rshared{row} shared{row} n 1")
    lines = [
        f"* {name}: piezoelectric resonator, motional arms: {len(circuit.arms)}",
        *([f"* {ascii_line(title)}"] if title else []),
        "* Between p and n, behind the leads: the clamped capacitance with its loss, and motional arms of R, L and C.",
        *(
            [
                "* The arms share losses: currents of Vk times gains of Fr_k add up in Rsharedr = 1 Ohm, whose",
                "* voltage acts back on each arm through Ek_r with the same gain. That is passive for all values.",
            ]
            if circuit.shared_losses
            else []
        ),
        "*",
        "* PIN  p  inout  V  electrical pin",
        "* PIN  n  inout  V  electrical pin",
        "*",
        f"* CLAMPED {circuit.clamped_capacitance_f:.6g} F",
        f"* LOSS TANGENT {circuit.loss_tangent:.4g} at {circuit.loss_reference_hz:.6g} Hz",
        f"*   of it {circuit.loss_tangent_falling:.4g} falls, {circuit.loss_tangent_rising:.4g} rises with frequency",
        *(
            [f"*   {circuit.loss_tangent_flat:.4g} had a capacitance without dispersion, which no network has"]
            if circuit.loss_tangent_flat
            else []
        ),
        *(
            f"* ARM {index}: {arm.series_resonance_hz:.7g} Hz, Q {arm.quality_factor:.5g}"
            for index, arm in enumerate(circuit.arms, start=1)
        ),
        "*",
        "* SOURCE equivalent circuit after Butterworth and Van Dyke, IEEE 176-1987",
        "* OMITS  a constant loss tangent beyond 100 times its frequency to both sides, nonlinearity",
        "* REVISION 3",
        "* CHECK  the node check is 0, or 1 for a step longer than STEP and, after 550 of them, without an alternating",
        "*        current; if the drive begins later, measure check from then on",
        f"* STEP   at most {step:.2g} s; {STEP_WORDS}",
        "* TESTED WITH ngspice 39 and 46",
        "*",
        "* USE    the first line of a deck is its title; then:",
        "*   * driven by minus one volt: the source's current is then the admittance, here its largest real part",
        "*   Vdrive a 0 DC 0 AC -1",
        f"*   Xpiezo a 0 {name}",
        f"*   .ac lin 1001 {main.series_resonance_hz * (1.0 - 5.0 / main.quality_factor):.9g} "
        f"{main.series_resonance_hz * (1.0 + 5.0 / main.quality_factor):.9g}"
        if main.quality_factor > 5.0
        else f"*   .ac dec 1001 {0.5 * first:.9g} {2.0 * last:.9g}",
        "*   .measure ac conductance_s MAX i(Vdrive)",
        "* END USE",
        "*",
        *definition_texts(read_library("piezomotor_check"), prefix=name).values(),
        f".subckt {name} p n",
        *elements,
        f".ends {name}",
    ]
    return "\n".join(lines) + "\n"


def _branch(circuit: EquivalentCircuit, index: int, node: str, series: list[tuple[str, float]]) -> list[str]:
    """Return the elements of an arm, or with index 0 of the clamped capacitance, from a node to n."""
    elements, count = [], 0

    def next_node() -> str:
        nonlocal node, count
        before, count = node, count + 1
        node = f"b{index}_{count}"
        return f"{before} {node}"

    weights = [row[index] for row in circuit.shared_losses]
    if any(weights):
        elements.append(f"V{index} {next_node()} 0")
    for row, weight in enumerate(weights, start=1):
        if weight:
            elements.append(f"F{row}_{index} n shared{row} V{index} {weight!r}")
            elements.append(f"E{index}_{row} {next_node()} shared{row} n {weight!r}")
    if index == 0:
        if circuit.loss_tangent_rising > _LEAST:
            elements.append(f"Rloss {next_node()} {circuit.loss_resistance_ohm!r}")
        elements += _dielectric(circuit, node)
    for number, (kind, value) in enumerate(series, start=1):
        elements.append(f"{kind}{index} {next_node() if number < len(series) else f'{node} n'} {value!r}")
    return elements


def _dielectric(circuit: EquivalentCircuit, node: str) -> list[str]:
    """Return the elements of the clamped capacitance from a node to n, without its series loss."""
    elements = []
    if circuit.loss_tangent_falling > _LEAST:
        elements.append(f"Rleak {node} n {1.0 / circuit.loss_conductance_s!r}")
    branches = circuit.dielectric(flat=True)
    if len(branches) == 1:  # without resistance
        return [*elements, f"Cclamped {node} n {branches[0].capacitance_f!r}"]
    for number, (resistance, capacitance) in enumerate(branches, start=1):
        elements.append(f"Rdie{number} {node} d{number} {resistance!r}")
        elements.append(f"Cdie{number} d{number} n {capacitance!r}")
    return elements
