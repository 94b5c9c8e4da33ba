# SPDX-License-Identifier: GPL-3.0-or-later
"""Touchstone 1 of one port or two.

The columns, not the file name, give the number of ports. Port 1 is group A, port 2 group B, unless both ports belong to
one device. In series between the ports, S₁₁ + S₂₁ = 1 and Y = S₂₁/(2 Z₀ (1 − S₂₁)); as a shunt from the line to ground,
S₂₁ − S₁₁ = 1 and Z = Z₀ S₂₁/(2 (1 − S₂₁)), by Kirchhoff's laws with both ports terminated in Z₀.
"""

from __future__ import annotations

import re

import numpy as np

from pyspice_runner.impedance.readers.quantities import Complexes
from pyspice_runner.impedance.readers.reading import Reading
from pyspice_runner.impedance.readers.text import Text, described, number, quote

FORMAT = "Touchstone"
_OPTION = re.compile(r"#[ \t]*(?:(?:[kmg]?hz|[syzgh]|ri|ma|db|r[ \t]+[0-9.eE+-]+)[ \t]+)+(?:!.*)?", re.IGNORECASE)
_SIDES = ("s", "y", "z", "g", "h")
_HERTZ = {"hz": 1.0, "khz": 1e3, "mhz": 1e6, "ghz": 1e9}
_GROUP = dict.fromkeys(_HERTZ, "unit") | dict.fromkeys(_SIDES, "side") | dict.fromkeys(("ri", "ma", "db"), "form")
_PORTS = {3: 1, 9: 2}
_ONE_DEVICE = 0.1  # error of the rule of one device as a share of S₂₁, for fixture and calibration
_ASSUMED = {"series": "in series between them", "shunt": "from the line to ground (a shunt)"}
_NOISE = 5  # numbers in a line of noise parameters, which may follow the points of a two-port


def read(text: Text, through: str | None) -> Reading | None:
    """Read the file; ``None`` if it is in another format. ``through`` makes one device of two ports."""
    first = text.find(lambda line: line.strip() and not line.lstrip().startswith("!"), 0, 1000)
    if first is None:
        return None
    line = text.lines[first].strip()
    if line.lower().startswith("[version]"):
        raise text.refusal(first, "Touchstone 2", "version 1, which every analyser and simulator can write")
    if len(line) > 200 or not _OPTION.fullmatch(line + " "):
        return None
    rows, indices = _rows(text, first + 1)
    cautions = text.cut
    ports = _PORTS[len(rows[0])]
    hertz, side, form, reference = _option(text, first, line)
    frequency = np.array([row[0] for row in rows]) * hertz
    if through is not None and (ports == 1 or side != "s"):
        found = "one port" if ports == 1 else f"{side.upper()} parameters"
        raise text.refusal(first, found, "S parameters of two ports, or through left out")
    values = _parameters(form, rows)
    device = through
    if device is None and ports == 2 and side == "s" and (device := _assumed(values)):
        cautions.append(
            f"The two ports are those of one device {_ASSUMED[device]}, and it was read as one port. Specify through = "
            "series or shunt if that is wrong."
        )
    with np.errstate(all="ignore"):
        matrix = _through(values[:, 1, 0], reference, device) if device else _admittance(side, values) / reference
    if side != "s" and reference != 1.0:
        cautions.append(
            f"The {side.upper()} parameters were taken as normalised to {reference:g} Ω, as Touchstone 1 has it."
        )
    metadata = described(entry for entry in text.lines if entry.lstrip().startswith("!"))
    reading = Reading(text, FORMAT, frequency, np.array(indices), metadata=metadata, cautions=cautions)
    if matrix.shape[-1] == 2:
        reading.matrix_s = matrix
    else:
        reading.columns = {"g": matrix[:, 0, 0].real, "b": matrix[:, 0, 0].imag}
    return reading


def _rows(text: Text, start: int) -> tuple[list[list[float]], list[int]]:
    """Return the points without noise parameters, and their lines."""
    rows: list[list[float]] = []
    indices: list[int] = []
    for index in range(start, len(text.lines) - len(text.cut)):
        line = text.lines[index].partition("!")[0]
        cells = line.split()
        if not cells or line.lstrip().startswith("#"):
            continue
        values = [number(cell) for cell in cells]
        if None in values:
            raise text.refusal(index, f"{quote(cells[values.index(None)])} is no number", "numbers")
        if rows and len(rows[0]) == 9 and len(cells) == _NOISE:
            break
        if len(cells) not in _PORTS or (rows and len(cells) != len(rows[0])):
            expected = f"{len(rows[0])}" if rows else "3 (one port) or 9 (two ports)"
            raise text.refusal(index, f"{len(cells)} numbers", expected)
        rows.append([value for value in values if value is not None])
        indices.append(index)
    if len(rows) < 2:
        raise text.refusal(start - 1, f"only {len(rows)} complete points follow", "at least 2")
    return rows, indices


def _option(text: Text, index: int, line: str) -> tuple[float, str, str, float]:
    """Return factor to Hz, kind of parameter, number format and reference resistance in Ω of an option line."""
    tokens = line[1:].partition("!")[0].lower().split()
    named = {_GROUP[token]: token for token in reversed(tokens) if token in _GROUP}
    if len(named) < sum(token in _GROUP for token in tokens):
        raise text.refusal(index, f"{quote(line)} names something twice", "an option line such as “# Hz S RI R 50”")
    reference = number(tokens[tokens.index("r") + 1]) if "r" in tokens else 50.0
    if reference is None or not reference > 0.0:
        raise text.refusal(index, "the reference resistance is not above 0 Ω", "one such as R 50")
    side = named.get("side", "s")
    if side in "gh":
        raise text.refusal(index, f"{side.upper()} parameters", "S, Y or Z parameters")
    return _HERTZ[named.get("unit", "ghz")], side, named.get("form", "ma"), reference


def _parameters(form: str, rows: list[list[float]]) -> Complexes:
    """Return the matrices of the points; those of a two-port stand column by column: 11, 21, 12, 22."""
    first, second = np.array(rows)[:, 1:].reshape(len(rows), -1, 2).transpose(2, 0, 1)
    size = 10.0 ** (first / 20.0) if form == "db" else first
    values: Complexes = np.asarray(first + 1j * second if form == "ri" else size * np.exp(1j * np.deg2rad(second)))
    ports = 2 if values.shape[1] == 4 else 1
    return np.asarray(values.reshape(-1, ports, ports).transpose(0, 2, 1), dtype=np.complex128)


def _admittance(side: str, values: Complexes) -> Complexes:
    """Return the admittance matrices over that of the reference; not finite at a short circuit."""
    if side == "y":
        return values
    if side == "z":
        return _inverse(values)
    identity = np.eye(values.shape[-1])
    return np.asarray((identity - values) @ _inverse(identity + values), dtype=np.complex128)


def _inverse(matrix: Complexes) -> Complexes:
    """Return the inverse of matrices of order 1 or 2, not finite for a singular one."""
    if matrix.shape[-1] == 1:
        return 1.0 / matrix
    (a, b), (c, d) = matrix.transpose(1, 2, 0)
    return np.asarray((np.array([[d, -b], [-c, a]]) / (a * d - b * c)).transpose(2, 0, 1), dtype=np.complex128)


def _through(s21: Complexes, reference: float, device: str) -> Complexes:
    """Return the admittance in S of one device in series between the ports, or as a shunt to ground."""
    ratio = s21 / (2.0 * (1.0 - s21))
    y = ratio / reference if device == "series" else 1.0 / (ratio * reference)
    return np.asarray(y, dtype=np.complex128)[:, None, None]


def _assumed(s: Complexes) -> str | None:
    """Return ``series`` or ``shunt`` if the S-parameters are those of one device between the ports.

    A series device has one current, 1 − S₁₁ = S₂₁; both ports of a shunt have one voltage, 1 + S₁₁ = S₂₁. A direct
    connection satisfies both; the smaller error decides. Two groups satisfy neither, except at the resonance of a
    shared mode. An analyser that transmits from port 1 alone, as the NanoVNA, leaves S₁₂ = S₂₂ = 0.
    """
    reflected, passed = s[:, 0, 0], s[:, 1, 0]
    if not reflected.any():
        return None
    error = {"series": np.abs(1.0 - reflected - passed), "shunt": np.abs(1.0 + reflected - passed)}
    device = min(error, key=lambda name: float(np.nanmedian(error[name])))
    one_way = not s[:, :, 1].any()
    worst = error[device] if one_way else np.maximum(error[device], np.abs(s[:, 0, 1] - passed))
    return device if np.mean(worst < _ONE_DEVICE * np.abs(passed)) > 0.5 else None
