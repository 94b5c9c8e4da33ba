# SPDX-License-Identifier: GPL-3.0-or-later
r"""Material constants of a piezoelectric ceramic from the spectrum of a resonator of known size.

=====  ==================================  =============================================================
shape  sizes, the first along the wave     constants, besides ``qm`` and ``tan_delta``
=====  ==================================  =============================================================
bar    length, width, thickness            k31, s11e, s11d, d31, p33t
disc   diameter, thickness                 kp, k31, Poisson's ratio, s11e, s12e, d31, p33t: radial modes
rod    length, diameter (width, thickness) k33, s33e, s33d, d33, p33t
plate  thickness, diameter (length, width) kt, c33d, c33e, e33, p33s: the mode through the thickness
=====  ==================================  =============================================================

The field is along the thickness, of a rod along the length. Of bar and disc Y = jωC (1 + k² m), of rod and plate, with
a field along the wave, jωC/(1 − k² m), where (IEEE Std 176-1987, 6.4; IRE Standards on Piezoelectric Crystals, Proc.
IRE 49 (1961) 1161; A. H. Meitzler, H. M. O'Bryan, H. F. Tiersten, IEEE Trans. SU-20 (1973) 233)

    bar    m = (1 − (2σ + σ²) q) tan(x)/x − 1 + (1 + σ)² q
    disc   m = (2 − J)/(J + σ − 1), J = x J₀(x)/J₁(x)
    rod    m = (1 − (4σ(σ + κ) − 2σ²) q) tan(x)/x + 2(σ + κ)² q, κ = d₃₁/d₃₃, σ at constant charge
    plate  m = tan(x)/x

and x = (π/2) f/f₀, f₀ = c/2l, with the speed of sound c and the size l along the wave. Elasticity, C and k² are complex
(R. Holland, IEEE Trans. SU-14 (1967) 18), so that the constants hold at any loss. The motion across the wave, with
Poisson's ratios σ, lowers the speed: c² → c² − h²ω², h² = Σ σᵢ²wᵢ²/12 with widths wᵢ (A. E. H. Love, Mathematical
Theory of Elasticity, §278). Its stress, a parabola across the width w, adds a charge: q = w²x²/3l².
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import cos, exp, log, pi, prod, sin, sqrt
from pathlib import Path
from typing import Any, Literal

import numpy as np

from pyspice_runner.errors import ParameterError, SpectrumError, require
from pyspice_runner.impedance.identify import descent
from pyspice_runner.impedance.identify.descent import Complexes, Vector, rms
from pyspice_runner.impedance.noise import noise_of
from pyspice_runner.impedance.one_port_fit import Fit, misfit
from pyspice_runner.impedance.spectrum import Spectrum
from pyspice_runner.motor.document import read_bytes
from pyspice_runner.motor.numerics import one_thread_of_scipy
from pyspice_runner.motor.refusal import checked
from pyspice_runner.motor.solid.materials import VACUUM, cards, material_of
from pyspice_runner.units import engineering

Shape = Literal["bar", "disc", "rod", "plate"]
_BOX = ("length", "width", "thickness")
_ALONG = {"bar": "length", "disc": "diameter", "rod": "length", "plate": "thickness"}  # the wave
_SLENDER = {"bar": 3.0, "disc": 10.0, "rod": 2.5, "plate": 10.0}  # minimum ratio of sizes
_UNITS = {"s": " m²/N", "c": " Pa", "d": " C/N", "e": " C/m²"}  # by the first letter of a constant
_SPEEDS = 1e3, 12e3  # m/s, of sound: polymers have 1,400, aluminium nitride has 11,000
_BAND = 0.7, 1.4  # lowest point over the resonance and highest over the antiresonance; harmonics are beyond
_OVERTONE = 2.4, 2.9  # over a disc's resonance: its second radial mode with the antiresonance
_FEWEST = 10  # points
_POISSON_ERROR, _ACROSS_ERROR = 0.03, 0.15  # of σ, and of h² and q by ratio: the spread of ceramics of the library
_F0, _LOSS, _C, _TAN, _K, _ANGLE, _SIGMA = range(7)  # ln f₀, ln elastic loss, ln C, tan δ, k, angle of k², σ
_LOW = np.array([-np.inf, log(1e-6), -np.inf, 0.0, 1e-3, -0.5, 0.01])
_HIGH = np.array([np.inf, 0.0, np.inf, 0.5, 0.999, 0.5, 0.49])


@dataclass(frozen=True, eq=False, repr=False)
class MaterialConstants(Fit):
    """Material constants by one mode of a resonator, with standard errors.

    ``values`` has them by their symbols, SI: ``s11e`` is s₁₁ at constant field, ``p33t`` and ``p33s`` are ε₃₃ at
    constant stress and strain over ε₀; ``qm`` is the quality factor of the series resonance. The standard errors
    combine the fit, the tolerances and the ratios of the base card.
    """

    source: str
    shape: Shape
    sizes_m: dict[str, float]
    density_kg_m3: float
    values: dict[str, float]
    standard_errors: dict[str, float]
    rms_relative_error: float
    base: str
    base_card: dict[str, Any]
    cautions: tuple[str, ...] = ()

    def columns(self) -> dict[str, Any]:
        """Return a table of one row: the density, and the constants, each with its standard error."""
        errors = {f"{name}_error": error for name, error in self.standard_errors.items()}
        row = {"density_kg_m3": self.density_kg_m3, **self.values, **errors}
        return {name: np.array([value]) for name, value in row.items()}

    def writers(self) -> dict[str, Callable[[Path], object]]:
        """Return the writers by ending: also ``.toml``, see :meth:`card`."""
        return {**super().writers(), ".toml": lambda file: file.write_text(self.card(file.stem), encoding="utf-8")}

    def card(self, name: str = "measured") -> str:
        """Return the TOML of a card for the library of ``[solid]``; its first line lists what was measured.

        All other values come from the base card. Of a plate, s33, d33 and the permittivity are chosen such that
        c33D, kt and ε₃₃ at constant strain are those measured.

        Raises:
            ParameterError: if the values together are no stable material.
        """
        base, found = self.base_card, self.values
        s, d = base["compliance"], base["charge"]
        own = {key[:3]: 1e12 * value for key, value in found.items() if key in ("s11e", "s12e", "s33e", "d31", "d33")}
        if "p33s" in found:  # in the units of the card, stiffness in 1e12 Pa
            stiff, planar, e33 = 1e-12 * found["c33e"], s["s11"] + s["s12"], found["e33"]
            own["s33"] = 1.0 / stiff + 2.0 * s["s13"] ** 2 / planar
            own["d33"] = e33 / stiff + 2.0 * d["d31"] * s["s13"] / planar
            e31 = (d["d31"] - s["s13"] * e33) / planar
            own["k33"] = found["p33s"] + 1e-12 * (2.0 * d["d31"] * e31 + own["d33"] * e33) / VACUUM
        else:
            own["k33"] = found["p33t"]
        card = {**base, "density_kg_m3": self.density_kg_m3, "source": f"{Path(self.source).name}, {self.shape}"}
        for table in ("compliance", "charge", "permittivity"):
            card[table] = {key: own.get(key, value) for key, value in base[table].items()}
        made = material_of(name, card)
        if min(np.linalg.eigvalsh(matrix).min() for matrix in (made.stiffness_pa, made.permittivity_f_m)) <= 0.0:
            listed = f"{', '.join(own)} with the other constants of {self.base}"
            raise ParameterError(f"{listed} are no stable material. Choose another base card.")
        lines = [f"# Measured: density, {', '.join(own)}. All other values: {self.base}.", f'["{name}"]']
        for key, value in card.items():
            inside = ", ".join(f"{one} = {each:.6g}" for one, each in value.items()) if isinstance(value, dict) else ""
            lines.append(f"{key} = {{ {inside} }}" if inside else f"{key} = {value!r}")
        return "\n".join([*lines, ""])

    def summary(self) -> dict[str, str]:
        """Return shape, sizes, and the constants ± one standard error."""
        sizes = ", ".join(f"{name} {engineering(value, 'm')}" for name, value in self.sizes_m.items())
        found = {"source": self.source, self.shape: f"{sizes}, {self.density_kg_m3:.5g} kg/m³"}
        for name, value in self.values.items():
            found[name] = f"{value:.4g} ±{self.standard_errors[name]:.2g}{_UNITS.get(name[0], '')}"
        return found | {"RMS error": f"{100.0 * self.rms_relative_error:.3g} %", "other constants": self.base}


@checked
@one_thread_of_scipy()
def material_constants(
    spectrum: Spectrum,
    shape: Shape,
    sizes_m: Mapping[str, float],
    density_kg_m3: float,
    *,
    tolerances: Mapping[str, float] | None = None,
    base: str | Path = "PZT-4",
) -> MaterialConstants:
    """Determine the material constants that a mode of a bar, disc, rod or plate depends on (see :mod:`.constants`).

    Electrodes cover whole faces. Poisson's ratio of a disc needs the second radial mode in the spectrum; otherwise it
    comes from the base card.

    Args:
        spectrum: of one port, with the resonance and the antiresonance.
        shape: ``"bar"``, ``"disc"``, ``"rod"`` or ``"plate"``.
        sizes_m: sizes by their names, m.
        density_kg_m3: density in kg/m³.
        tolerances: relative standard errors of sizes and ``density``, such as ``{"length": 1e-3}``.
        base: card with the other constants: name in the library of ``[solid]``, or path of a ``.toml``.

    Raises:
        ParameterError: for sizes that are missing or do not belong to the shape, or values out of range.
        SpectrumError: for a spectrum without resonance and antiresonance of such a body.
    """
    given = {**sizes_m, "density": density_kg_m3}
    spread = dict.fromkeys(given, 0.0) | dict(tolerances or {})
    require(spread.keys() == given.keys(), "tolerances", ", ".join(spread), f"of {', '.join(given)}")
    for name, value in given.items():
        require(0.0 < value < 1e6 and 0.0 <= spread[name] < 1.0, name, value, "> 0, its tolerance a ratio from 0 to 1")
    name, card = _card(base)
    sigma = -card["compliance"]["s12"] / card["compliance"]["s11"]
    body = _Body(shape, given, card)
    low, high = body.extremes(spectrum)
    overtone = np.abs(spectrum.frequency_hz / low - np.mean(_OVERTONE)) < 0.5 * np.ptp(_OVERTONE)
    free = shape == "disc" and int(np.count_nonzero(overtone)) >= _FEWEST
    spectrum = spectrum.between(_BAND[0] * low, _OVERTONE[1] * low if free else _BAND[1] * high)
    parameters, covariance, error, correlated = body.solve(spectrum, body.start(low, high, sigma), free)
    cautions = [*spectrum.cautions]
    if (ratio := body.slenderness) < _SLENDER[shape]:
        cautions.append(
            f"The ratio of sizes of this {shape} is {ratio:.3g}, below {_SLENDER[shape]:g}: other modes are near, and "
            "the constants may be off by more than their errors."
        )
    if assumed := shape == "disc" and not free:
        cautions.append(
            f"Poisson's ratio of {sigma:.3g} ± {_POISSON_ERROR:g} is taken from {name}. Measure the second mode too."
        )
    if correlated and error > 1e-3:
        cautions.append(misfit(f"The closed form of a {shape} does not follow the spectrum", error))
    for wider, other in ((1.0 + _ACROSS_ERROR, sigma), (1.0, sigma + _POISSON_ERROR * assumed)):
        varied = _Body(shape, given, card, wider)
        moved = varied.solve(spectrum, varied.start(low, high, other), free)[0] - parameters
        covariance = covariance + np.outer(moved, moved)

    def values(logarithms: Vector) -> Vector:
        own = dict(zip(given, np.exp(logarithms[7:]).tolist(), strict=True))
        return np.array([*_Body(shape, own, card).values(logarithms[:7]).values()])

    slopes = descent.derivatives(values, np.array([*parameters, *map(log, given.values())]))
    total = np.diag([*np.zeros(7), *(spread[each] ** 2 for each in given)])
    total[:7, :7] = covariance
    deviation = np.sqrt(np.maximum(np.diag(slopes @ total @ slopes.T), 0.0)).tolist()
    found = body.values(parameters)
    errors = dict(zip(found, deviation, strict=True))
    source, sizes = spectrum.source or "spectrum", dict(sizes_m)
    return MaterialConstants(source, shape, sizes, density_kg_m3, found, errors, error, name, card, tuple(cautions))


class _Body:
    """A resonator: the closed form of its admittance, and its constants."""

    def __init__(self, shape: Shape, given: Mapping[str, float], card: Mapping[str, Any], wider: float = 1.0) -> None:
        sizes = {name: value for name, value in given.items() if name != "density"}
        wanted = {_ALONG[shape], *(("diameter", "thickness") if shape == "disc" else _BOX)}
        if shape in ("rod", "plate") and "diameter" in sizes:
            wanted = {_ALONG[shape], "diameter"}
        if sizes.keys() != wanted:
            listed = " and ".join(sorted(wanted))
            raise ParameterError(f"A {shape} has {listed}, not {', '.join(sizes) or 'nothing'}. Correct its sizes.")
        self.shape, self.along, self.density = shape, given[_ALONG[shape]], given["density"]
        self.stiffened = shape in ("rod", "plate")  # by a field along the wave
        self.gap = self.along if self.stiffened else given["thickness"]
        self.area = 0.25 * pi * given["diameter"] ** 2 if "diameter" in given else prod(sizes.values()) / self.gap
        others = [sizes[name] for name in (*_BOX, "diameter") if name in sizes and name != _ALONG[shape]]
        self.slenderness = min(others) / self.along if shape == "plate" else self.along / max(others)
        s11, s12, s13, s33 = (card["compliance"][name] for name in ("s11", "s12", "s13", "s33"))
        square, moved, self.less, self.more = 0.0, 0.0, 0.0, 0.0  # w² and Σ σ²w² in m², and the factors of q
        if shape == "bar":
            square, sigma = others[0] ** 2, -s12 / s11
            moved = sigma**2 * square + (s13 / s11 * others[1]) ** 2
            self.less, self.more = 2.0 * sigma + sigma**2, (1.0 + sigma) ** 2
        elif shape == "disc":
            moved = (s13 / (s11 + s12) * others[0]) ** 2
        elif shape == "rod":  # the mean square of a side is w²/12, of a diameter D²/16
            d31, d33, free = card["charge"]["d31"], card["charge"]["d33"], 1e12 * VACUUM * card["permittivity"]["k33"]
            sigma, ratio = (d31 * d33 / free - s13) / (s33 - d33**2 / free), d31 / d33
            square = float(np.mean(np.square(others))) * (0.75 if "diameter" in given else 1.0)
            moved = 2.0 * sigma**2 * square
            self.less, self.more = 4.0 * sigma * (sigma + ratio) - 2.0 * sigma**2, 2.0 * (sigma + ratio) ** 2
        self.slowing = wider * moved / 12.0 * (pi / self.along) ** 2  # (πh/l)²
        self.wide = wider * square / (3.0 * self.along**2)  # q/x²

    def motion(self, x: Any, sigma: float) -> Any:
        """Return m of the closed form, real or complex."""
        from scipy.special import jv  # takes long to load

        if self.shape == "disc":
            j = x * jv(0, x) / jv(1, x)
            return (2.0 - j) / (j + sigma - 1.0)
        q = self.wide * x**2
        return (1.0 - self.less * q) * np.tan(x) / x + self.more * q - (self.shape == "bar")

    def admittance(self, parameters: Vector, frequency_hz: Vector) -> Complexes:
        """Return the admittance in S."""
        ratio = frequency_hz * exp(-parameters[_F0])
        loss = 1j * exp(parameters[_LOSS])
        softer = 1.0 / (1.0 + loss) if self.shape == "plate" else 1.0 - loss  # stiffness, or compliance
        x = 0.5 * pi * ratio * np.sqrt(softer / (1.0 - self.slowing * ratio**2))
        motion = parameters[_K] ** 2 * (1.0 + 1j * parameters[_ANGLE]) * self.motion(x, parameters[_SIGMA])
        plates = 2j * pi * frequency_hz * exp(parameters[_C]) * (1.0 - 1j * parameters[_TAN])
        return np.asarray(plates / (1.0 - motion) if self.stiffened else plates * (1.0 + motion))

    def extremes(self, spectrum: Spectrum) -> tuple[float, float]:
        """Return the frequencies of maximum conductance and resistance of the mode."""
        f, y = spectrum.frequency_hz, spectrum.admittance_s
        low, high = (0.5 * speed / self.along for speed in _SPEEDS)
        # of modes with the same coupling the lowest
        first = int(np.argmax(np.where((f > low) & (f < high), y.real / f**2, -np.inf)))
        last = int(np.argmax(np.where((f > f[first]) & (f < 1.6 * f[first]), (1.0 / y).real, -np.inf)))
        if len(f) < _FEWEST or not 0 < first < last < len(f) - 1 or not low < f[first] < high:
            raise SpectrumError(
                f"{spectrum.source or 'The spectrum'} shows no resonance with an antiresonance from {low:.4g} Hz to "
                f"{high:.4g} Hz, where such a {self.shape} resonates. Measure this band, or check the sizes in m."
            )
        return float(f[first]), float(f[last])

    def start(self, low: float, high: float, sigma: float) -> Vector:
        """Return parameters to start from, C apart, by the series and the parallel resonance in Hz."""
        own, other = (high, low) if self.stiffened else (low, high)
        x = 1.84 + 0.69 * sigma if self.shape == "disc" else 0.5 * pi  # of J = 1 − σ, within 0.2 %
        k = 1.0 / sqrt(abs(float(self.motion(x * other / own, sigma))))
        return np.array([log(0.5 * pi * own / x), log(1e-2), 0.0, 0.01, min(k, 0.99), 0.0, sigma])

    def solve(self, measured: Spectrum, start: Vector, free_sigma: bool) -> tuple[Vector, Vector, float, bool]:
        """Return parameters, their covariance, the RMS of the relative residuals, and whether they are correlated."""
        from scipy.optimize import least_squares  # takes long to load

        f, y = measured.frequency_hz, measured.admittance_s
        start[_C] += log(abs(np.mean(y / self.admittance(start, f))))
        free = np.arange(7 if free_sigma else 6)
        weights = np.abs(y) / noise_of(None, y).deviation(y)

        def residual(part: Vector) -> Vector:
            return (weights * np.log(self.admittance(np.append(part, start[len(part) :]), f) / y)).view(float)

        bounds, covariance = (_LOW[free], _HIGH[free]), np.zeros((7, 7))
        found = least_squares(residual, np.clip(start[free], *bounds), bounds=bounds, x_scale="jac")
        parameters = np.append(found.x, start[len(free) :])
        relative = self.admittance(parameters, f) / y - 1.0
        independent = descent.independent_points(relative)
        scatter = descent.variance(2.0 * found.cost, len(y), len(free), independent)
        covariance[np.ix_(free, free)] = scatter * np.linalg.pinv(found.jac.T @ found.jac)
        return parameters, covariance, rms(relative), independent < 0.5 * len(y)

    def values(self, parameters: Vector) -> dict[str, float]:
        """Return the constants by the parameters of the closed form."""
        from scipy.optimize import brentq  # takes long to load

        tan, k, angle, sigma = parameters[[_TAN, _K, _ANGLE, _SIGMA]].tolist()
        modulus = self.density * (2.0 * self.along * exp(parameters[_F0])) ** 2  # ρc²
        permittivity, rest, elastic = exp(parameters[_C]) * self.gap / self.area, 1.0 - k**2, exp(parameters[_LOSS])
        if self.stiffened:  # at constant charge; Q belongs to the series resonance, tan(x)/x = 1/k²
            x = float(brentq(lambda x: x * cos(x) - k**2 * sin(x), 1e-3, 0.5 * pi))
            elastic -= 2.0 * angle / (2.0 * x / sin(2.0 * x) - 1.0)
        if self.shape == "bar":
            s = 1.0 / modulus
            found = {"k31": k, "s11e": s, "s11d": s * rest, "d31": -k * sqrt(s * permittivity)}
        elif self.shape == "disc":
            s, k31 = 1.0 / (modulus * (1.0 - sigma**2)), k * sqrt(0.5 * (1.0 - sigma))
            found = {"kp": k, "k31": k31, "poisson": sigma, "s11e": s, "s12e": -sigma * s}
            found["d31"] = -k31 * sqrt(s * permittivity)
        elif self.shape == "rod":
            s, permittivity = 1.0 / (modulus * rest), permittivity / rest
            found = {"k33": k, "s33e": s, "s33d": 1.0 / modulus, "d33": k * sqrt(s * permittivity)}
        else:
            found = {"kt": k, "c33d": modulus, "c33e": modulus * rest, "e33": k * sqrt(modulus * permittivity)}
        found["p33s" if self.shape == "plate" else "p33t"] = permittivity / VACUUM
        return found | {"qm": 1.0 / elastic, "tan_delta": tan}


def _card(base: str | Path) -> tuple[str, dict[str, Any]]:
    """Return name and values of a ceramic's card, of the library or in a file."""
    found, name = {key: card for key, card in cards().items() if "charge" in card}, str(base)
    if name.endswith(".toml"):
        try:
            ((name, card),) = tomllib.loads(read_bytes(name, "base", 2**20, "the path of a card").decode()).items()
            found = {name: card | {"charge": dict(card["charge"])}}
            material_of(name, card)
        except (KeyError, TypeError, UnicodeError, tomllib.TOMLDecodeError) as error:
            raise ParameterError(
                f"{base} is no card of a ceramic ({error}). `constants --output` writes one."
            ) from None
    require(name in found, "base", name, f"one of {', '.join(found)}, or a .toml file")
    return name, found[name]
