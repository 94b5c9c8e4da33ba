# SPDX-License-Identifier: GPL-3.0-or-later
r"""An electrical spectrum: admittance over frequency, of one port or of the two groups A and B.

.. math::
    \begin{pmatrix} i_A \\ i_B \end{pmatrix} =
    \begin{pmatrix} Y_{AA} & Y_{AB} \\ Y_{BA} & Y_{BB} \end{pmatrix}
    \begin{pmatrix} U_A \\ U_B \end{pmatrix}

Driven as *A* (B shorted) the admittance is Y_AA; as *A+B* (U on both, currents added) Y_AA + Y_AB + Y_BA + Y_BB; as
*A−B* (U on A, −U on B, currents subtracted) Y_AA − Y_AB − Y_BA + Y_BB. A one-port is the 1 × 1 matrix.

Maximum conductance and half-power width of a resonance follow from the measured points, without a circuit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyspice_runner.errors import SpectrumError
from pyspice_runner.files import write_rows
from pyspice_runner.result import Result
from pyspice_runner.units import engineering

Connection = Literal["A", "B", "A+B", "A-B"]
State = Literal["free", "preloaded"]  # of the tip of a motor
COUPLING: dict[Connection, tuple[float, float]] = {
    "A": (1.0, 0.0),
    "B": (0.0, 1.0),
    "A+B": (1.0, 1.0),
    "A-B": (1.0, -1.0),
}
TWO_PORT = tuple(f"y_{into}{by}_{part}_s" for into, by, part in product("ab", "ab", ("real", "imag")))  # columns
_REACH = 2.0  # bandwidths on each side in which the points are searched
_ROUND = 0.15  # of the width on each side of the peak: there it is a parabola to 1 %
_FEWEST = 5  # points within the half-power width, below which they do not show the peak


def connect(matrix_s: NDArray[np.complex128], connection: Connection) -> NDArray[np.complex128]:
    """Return the admittance of a two-port in S, driven through a connection of its groups."""
    drive = np.array(COUPLING[connection][: matrix_s.shape[-1]])
    result: NDArray[np.complex128] = np.einsum("i,kij,j->k", drive, matrix_s, drive)
    return result


@dataclass(frozen=True, eq=False, repr=False)
class Spectrum(Result):
    """Admittance over frequency, checked: finite, at least two points, frequencies positive and rising.

    Attributes:
        frequency_hz: frequencies in Hz, rising, shape (points,).
        matrix_s: admittance matrix in S, shape (points, ports, ports); [.., 0, 1] is the current into A per volt on B.
        source: name of the file or of the origin.
        format: name of the file format.
        cautions: repairs while reading, one sentence each.
        metadata: description of the measurement from the file: instrument, date, level.
    """

    frequency_hz: NDArray[np.float64]
    matrix_s: NDArray[np.complex128]
    source: str = ""
    format: str = ""
    cautions: tuple[str, ...] = ()
    metadata: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check the arrays and make them read-only; remove characters from the name that no file can hold."""
        object.__setattr__(self, "source", self.source.encode("utf-8", "replace").decode())
        frequency = np.array(self.frequency_hz, dtype=np.float64)
        matrix = np.array(self.matrix_s, dtype=np.complex128)
        points = frequency.size
        if frequency.ndim != 1 or points < 2:
            are = "is" if points == 1 else "are"
            raise SpectrumError(f"A spectrum needs at least 2 frequencies; there {are} {points}.")
        if matrix.shape not in ((points, 1, 1), (points, 2, 2)):
            raise SpectrumError(
                f"A spectrum of {points} frequencies needs an admittance matrix of shape ({points}, 1, 1) "
                f"or ({points}, 2, 2), not {matrix.shape}."
            )
        if not (np.isfinite(frequency).all() and np.isfinite(matrix).all()):
            raise SpectrumError("A spectrum needs finite frequencies and admittances; leave the other points out.")
        if frequency[0] <= 0.0 or (np.diff(frequency) <= 0.0).any():
            raise SpectrumError("The frequencies of a spectrum must be above 0 Hz and rise from point to point.")
        for name, array in (("frequency_hz", frequency), ("matrix_s", matrix)):
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    @classmethod
    def from_admittance(
        cls,
        frequency_hz: ArrayLike,
        admittance_s: ArrayLike,
        *,
        source: str = "",
        format: str = "",  # noqa: A002 - the name of the attribute
        cautions: tuple[str, ...] = (),
        metadata: Mapping[str, str] | None = None,
    ) -> Spectrum:
        """Make a spectrum of an admittance in S: shape (points,) for one port, (points, 2, 2) for two.

        Raises:
            SpectrumError: for values that are no spectrum.
        """
        matrix = np.asarray(admittance_s, dtype=np.complex128)
        matrix = matrix[:, None, None] if matrix.ndim == 1 else matrix
        return cls(np.asarray(frequency_hz, float), matrix, source, format, cautions, dict(metadata or {}))

    @classmethod
    def from_impedance(cls, frequency_hz: ArrayLike, impedance_ohm: ArrayLike, **description: Any) -> Spectrum:
        """Make a spectrum of an impedance in Ω: shape (points,) for one port, (points, 2, 2) for two.

        ``source``, ``format``, ``cautions`` and ``metadata`` are those of :meth:`from_admittance`.

        Raises:
            SpectrumError: for values that are no spectrum, such as an impedance of zero.
        """
        impedance = np.asarray(impedance_ohm, dtype=np.complex128)
        try:
            matrix = np.linalg.inv(impedance[:, None, None] if impedance.ndim == 1 else impedance)
        except np.linalg.LinAlgError:
            raise SpectrumError("An impedance is zero or singular, so that there is no admittance.") from None
        return cls.from_admittance(frequency_hz, matrix, **description)

    def __len__(self) -> int:
        """Return the number of frequencies."""
        return len(self.frequency_hz)

    @property
    def ports(self) -> int:
        """Number of ports, 1 or 2."""
        return int(self.matrix_s.shape[-1])

    @property
    def admittance_s(self) -> NDArray[np.complex128]:
        """Admittance of a one-port in S, shape (points,).

        Raises:
            SpectrumError: for a two-port; :meth:`driven` selects a connection.
        """
        if self.ports != 1:
            raise SpectrumError(f"{self._name} has two ports; choose one of {', '.join(COUPLING)} by driven().")
        return self.matrix_s[:, 0, 0]

    @property
    def impedance_ohm(self) -> NDArray[np.complex128]:
        """Impedance of a one-port in Ω, shape (points,). Raise SpectrumError for a two-port."""
        return 1.0 / self.admittance_s

    def driven(self, connection: Connection) -> Spectrum:
        """Return the one-port of a two-port driven as ``A`` (B shorted), ``B``, ``A+B`` or ``A-B``.

        Raises:
            SpectrumError: for a one-port or an unknown connection.
        """
        if self.ports != 2:
            raise SpectrumError(f"{self._name} has one port; only a two-port can be driven as {connection}.")
        if connection not in COUPLING:
            raise SpectrumError(f"The connection {connection!r} is not valid: it must be one of {', '.join(COUPLING)}.")
        one_port = connect(self.matrix_s, connection)[:, None, None]
        return replace(self, matrix_s=one_port, metadata={**self.metadata, "connection": connection})

    def between(self, start_hz: float = 0.0, stop_hz: float = np.inf) -> Spectrum:
        """Return the part from ``start_hz`` to ``stop_hz`` inclusive.

        Raises:
            SpectrumError: with fewer than two points there.
        """
        inside = (self.frequency_hz >= start_hz) & (self.frequency_hz <= stop_hz)
        if np.count_nonzero(inside) < 2:
            raise SpectrumError(
                f"{self._name} has fewer than 2 points from {start_hz:g} Hz to {stop_hz:g} Hz; "
                f"it covers {self.frequency_hz[0]:g} Hz to {self.frequency_hz[-1]:g} Hz."
            )
        return replace(self, frequency_hz=self.frequency_hz[inside], matrix_s=self.matrix_s[inside])

    def columns(self) -> dict[str, NDArray[np.float64]]:
        """Return the frequency, and the real and imaginary parts of the admittance."""
        return columns_of(self.frequency_hz, self.matrix_s)

    def writers(self) -> dict[str, Callable[[Path], object]]:
        """Return the writers by ending; ``.csv`` has every digit, for ``read_spectrum``."""
        return {**super().writers(), ".csv": self._write_csv}

    def to_dict(self) -> dict[str, Any]:
        """Return source, format, band, cautions and metadata, JSON-ready."""
        return {
            **self._entries("source", "format", "ports"),
            **band_of(self.frequency_hz),
            **self._entries("cautions", "metadata"),
        }

    def summary(self) -> dict[str, str]:
        """Return source, format, number of ports and points, and the band."""
        low, high = (engineering(float(self.frequency_hz[place]), "Hz") for place in (0, -1))
        found = {"source": self.source, "format": self.format, "ports": str(self.ports), "points": str(len(self))}
        return {name: text for name, text in found.items() if text} | {"band": f"{low} to {high}"}

    def _write_csv(self, path: Path) -> None:
        columns = self.columns()
        rows = zip(*(column.tolist() for column in columns.values()), strict=True)
        write_rows(path, [list(columns), *(list(map(repr, row)) for row in rows)])

    @property
    def _name(self) -> str:
        return self.source or "The spectrum"


def band_of(frequency_hz: NDArray[np.float64]) -> dict[str, float]:
    """Return number, first and last of the frequencies, as results state them."""
    return {"points": len(frequency_hz), "start_hz": float(frequency_hz[0]), "stop_hz": float(frequency_hz[-1])}


def columns_of(frequency_hz: NDArray[np.float64], matrix_s: NDArray[np.complex128]) -> dict[str, NDArray[np.float64]]:
    """Return the columns of the plain CSV: name with unit → values."""
    columns = {"frequency_hz": frequency_hz}
    if matrix_s.shape[-1] == 1:
        return columns | {"conductance_s": matrix_s[:, 0, 0].real, "susceptance_s": matrix_s[:, 0, 0].imag}
    parts = [part for entry in matrix_s.reshape(-1, 4).T for part in (entry.real, entry.imag)]
    return columns | dict(zip(TWO_PORT, parts, strict=True))


@dataclass(frozen=True)
class HalfPower:
    """A peak of the measured conductance, behind the leads of the fit.

    Keysight E4990A Help, ``CALC:EPAR:S4?``: R1 = 1/G_max, Q = fs/(f₂ − f₁) of the frequencies with half of G_max. The
    conductance of the dielectric and of neighbours is in these values.
    """

    resonance_hz: float  # fs, by the parabola through the highest points
    resistance_ohm: float  # 1/G_max
    lower_hz: float  # f₁, by straight lines between the points, as f₂
    upper_hz: float  # f₂
    width_hz: float  # f₂ − f₁
    quality_factor: float  # fs/(f₂ − f₁)


def half_power(
    frequency_hz: NDArray[np.float64], device_s: NDArray[np.complex128], resonance_hz: float, quality_factor: float
) -> HalfPower | None:
    """Return the peak of the conductance about a resonance; ``None`` if the points do not show it.

    ``device_s`` is the measured admittance in S without leads, over rising frequencies. Resonance and quality factor
    set the range that is searched.
    """
    reach = _REACH * resonance_hz / quality_factor
    near = np.flatnonzero(np.abs(frequency_hz - resonance_hz) < reach)
    if len(near) < _FEWEST:
        return None
    conductance = device_s.real
    top = int(near[np.argmax(conductance[near])])
    half = conductance < 0.5 * conductance[top]
    below, above = np.flatnonzero(half[:top]), half[top:]
    if not below.size or not above.any():
        return None
    low, high = int(below[-1]), top + int(np.argmax(above))
    if high - low - 1 < _FEWEST:
        return None
    # several points average the noise
    width = frequency_hz[high] - frequency_hz[low]
    about = max(_ROUND * width, float(np.diff(frequency_hz[low:high]).max()))
    inner = np.flatnonzero(np.abs(frequency_hz - frequency_hz[top]) <= about)
    x = (frequency_hz[inner] - frequency_hz[top]) / width
    bend, slope, height = np.polyfit(x, conductance[inner], 2)
    if bend >= 0.0:
        return None
    fs, peak = frequency_hz[top] - 0.5 * slope / bend * width, height - 0.25 * slope**2 / bend

    def crossing(inside: int, outside: int) -> float:
        share = (conductance[inside] - 0.5 * peak) / (conductance[inside] - conductance[outside])
        return float(frequency_hz[inside] + share * (frequency_hz[outside] - frequency_hz[inside]))

    f1, f2 = crossing(low + 1, low), crossing(high - 1, high)
    if not (peak > 0.0 and f2 > f1):
        return None
    return HalfPower(float(fs), float(1.0 / peak), f1, f2, f2 - f1, float(fs / (f2 - f1)))
