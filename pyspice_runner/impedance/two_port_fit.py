# SPDX-License-Identifier: GPL-3.0-or-later
r"""The coupling of every mode to each group, and a motor, from the spectra of both groups.

.. math::
    Y_{ij} = \frac{1}{R_{ij} + 1/(sC_{ij})} + \sum_n \frac{\theta_{in} \theta_{jn}}{m_n}
             \frac{s}{s^2 + s\,\omega_n/Q_n + \omega_n^2}

C_ii is the capacitance of a group with the other shorted, C_AB that between them, which counts negative. A spectrum
driven through the weights w (A: 1, 0; A−B: 1, −1) is Σ w_i w_j Y_ij. It contains θ²/m, not θ: the force
needs one mechanical measurement, a modal mass or the velocity of the tip per motional current. All connections (of a
two-port Y_AA, Y_BB and Y_AB) are fitted together by least squares weighted with their estimated errors. The start is
the fit of Y_AA + Y_BB, which shows every mode. Modes beside the band are added where they improve the fit, and leads in
series with the groups, Y = (Y⁻¹ + Z)⁻¹ with Z = diag(R_A + sL_A, R_B + sL_B), where Schwarz's criterion asks for them.

Losses that couple modes, such as contact losses, make the residue of a pole complex: θ + (s/ω_n + 1/2Q_n) ψ replaces θ,
to first order in ψ. A series resistance R has the same effect, with ψ = −ω_n C R θ. The errors therefore contain the
resistances that have the effect of the fitted ψ.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from copy import copy
from dataclasses import dataclass
from math import hypot, inf, log, pi, sqrt
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from pyspice_runner.errors import ParameterError, SpectrumError, require
from pyspice_runner.files import save_by_ending
from pyspice_runner.impedance.identify import descent
from pyspice_runner.impedance.identify.descent import FINEST, Complexes, Vector, independent_points, rms
from pyspice_runner.impedance.identify.errors import RESONANT_QUALITY, UNDETERMINED
from pyspice_runner.impedance.identify.problem import PLAUSIBLE_LEADS
from pyspice_runner.impedance.identify.selection import Progress
from pyspice_runner.impedance.noise import noise_of
from pyspice_runner.impedance.one_port_fit import Fit, fit_one_port, misfit
from pyspice_runner.impedance.spectrum import COUPLING, Connection, Spectrum
from pyspice_runner.motor.dielectric import LARGEST_LOSS_TANGENT, lossy_capacitance
from pyspice_runner.motor.load import load_motor
from pyspice_runner.motor.motor import Motor, Provenance, assemble
from pyspice_runner.motor.numerics import one_thread_of_scipy
from pyspice_runner.units import engineering, unit_in

_TRANSFER = "AB"  # current into A per volt on B
_GLOBALS = 8  # ln C_A, ln C_B, tan δ, C_AB, R and L of the leads of both groups
_RESISTANCES, _INDUCTANCES, _LEADS = [4, 5], [6, 7], [4, 5, 6, 7]
_PER_MODE = 6  # ln f, ln Q, couplings θ to A and B, and ψ to both
_VALUES = ("series_resonance_hz", "quality_factor", "coupling_a_n_per_v_kg05", "coupling_b_n_per_v_kg05")
_PIEZO = ("capacitance_a_f", "capacitance_b_f", "loss_tangent", "capacitance_ab_f")
_LEAD_NAMES = "resistance_a_ohm", "resistance_b_ohm", "inductance_a_h", "inductance_b_h"
_LOSSES = None, 15, 0  # branches of a motor; three a decade, with a ripple of 1e-5; no dispersion
_OUTSIDE = 0.98, 0.9, 0.7  # frequencies below the band over its end, and their inverses above, to start a mode from
_FARTHEST = 2.0  # of an end of the band over the frequency of such a mode; farther, it is a capacitance
_QUALITY_OUTSIDE = 50.0  # of its start
_TIE = 20.0  # difference of Schwarz's criterion by which leads must be better, as in the fit of one port
_FIRST_LEAD, _MOST_RESISTANCE = 0.01, 1.0  # of leads, to start from and the largest, in units of the median impedance
# Of 1/Q of the broadest strong mode: a contact, whose losses couple modes, resembles leads that turn the modes by up to
# 0.2 of it in spectra of the pressed bimodal40, plate40 and andersen2002.
_LEAST_TURN = 0.3
_STRONG = 0.5  # of the largest coupling, assumed: a weaker mode may be one that stands for losses
_AT_LIMIT = 1e-6  # relative distance from the end of the band, below which such a mode is at its limit
# standard errors; a capacitance between the groups below is chance in 399 of 400 spectra, and so is a lead
_SIGNIFICANT = 3.0


@dataclass(frozen=True)
class TwoPortMode:
    """One mode with its coupling to both groups."""

    series_resonance_hz: float  # f with both groups shorted
    quality_factor: float  # Qm
    coupling_a_n_per_v_kg05: float  # θ_A/√m in N/(V·√kg), never negative
    coupling_b_n_per_v_kg05: float  # θ_B/√m in N/(V·√kg), with its sign against group A
    standard_errors: dict[str, float]  # of the four values above

    @property
    def couplings(self) -> Vector:
        """θ/√m to group A and to group B, N/(V·√kg)."""
        return np.array([self.coupling_a_n_per_v_kg05, self.coupling_b_n_per_v_kg05])


@dataclass(frozen=True, eq=False, repr=False)
class TwoPortFit(Fit):
    """Modes and clamped capacitances fitted to the spectra of several connections.

    Attributes:
        source: name of the spectra.
        modes: by rising frequency.
        capacitance_a_f: clamped capacitance of group A.
        capacitance_b_f: clamped capacitance of group B.
        loss_tangent: of both, constant over frequency; the capacitances hold at 100 kHz.
        loss_dispersion: whether the data show the dispersion that such a loss has by causality.
        capacitance_ab_f: between the groups, a part of both others; 0 if it is not significant.
        standard_errors: of the four values above.
        leads: in series with the groups, ``resistance_a_ohm``, ``resistance_b_ohm``, ``inductance_a_h`` and
            ``inductance_b_h``; empty without leads. The values above are those behind them.
        lead_standard_errors: of these.
        rms_relative_error: connection → root mean square of the relative residual.
        noise: connection → error model, kind → σ, see :class:`SpectrumFit`.
        cautions: limits of the values.
    """

    source: str
    modes: tuple[TwoPortMode, ...]
    capacitance_a_f: float
    capacitance_b_f: float
    loss_tangent: float
    loss_dispersion: bool
    capacitance_ab_f: float
    standard_errors: dict[str, float]
    rms_relative_error: dict[str, float]
    noise: dict[str, dict[str, float]]
    leads: dict[str, float]
    lead_standard_errors: dict[str, float]
    cautions: tuple[str, ...] = ()

    def to_motor(
        self,
        *,
        mass_kg: float | Sequence[float] | None = None,
        velocity_per_current: float | Sequence[float] | None = None,
        connection: Connection = "A",
        tips: Sequence[tuple[float, float]] | None = None,
        base: Motor | str | Path = "andersen2002",
        name: str = "measured",
    ) -> Motor:
        """Return a complete motor: the fitted stator, calibrated, with contact and rotor or slider of another motor.

        ``tips`` defines the modal coordinate r: with (0, 1), r is the displacement of the tip towards the rotor.

        Args:
            mass_kg: modal masses in kg; a single number applies to every mode, as for a uniform beam.
            velocity_per_current: instead, tip velocity per motional current in m/s/A for each mode; a single number is
                that of the first mode, and every mode gets the resulting modal mass.
            connection: connection of that current.
            tips: (tip_x, tip_y) of every mode; by default (0, 1), towards the rotor, for a mode that both groups drive
                in phase, and (1, 0), along it, for a mode that they drive in opposition.
            base: motor, or its name, to take contact and rotor from.
            name: name of the new motor.

        Raises:
            ParameterError: without exactly one calibration, or for values that make no motor.
        """
        if tips is None:
            tips = [(0.0, 1.0) if np.prod(mode.couplings) >= 0.0 else (1.0, 0.0) for mode in self.modes]
            origin = Provenance("assumed", "from the sign of the couplings: alike towards the rotor, opposed along it")
        else:
            origin = Provenance("given", "given with the calibration")
        if len(tips) != len(self.modes):
            raise ParameterError(f"tips has {len(tips)} entries for {len(self.modes)} modes; give one for each.")
        masses, calibration = self._masses(mass_kg, velocity_per_current, connection, tips)
        base = base if isinstance(base, Motor) else load_motor(base)
        modes, provenance = [], dict[str, Provenance]()
        fitted = Provenance("derived", f"fitted to {self.source} with the modal mass")
        origins = {"mass_kg": calibration, "tip_x": origin, "tip_y": origin}
        for index, (mode, mass, (tip_x, tip_y)) in enumerate(zip(self.modes, masses, tips, strict=True)):
            omega = 2.0 * pi * mode.series_resonance_hz
            values = {
                "name": f"mode-{index + 1}",
                "mass_kg": mass,
                "damping_n_s_per_m": mass * omega / mode.quality_factor,
                "stiffness_n_per_m": mass * omega**2,
                "coupling_a_n_per_v": mode.coupling_a_n_per_v_kg05 * sqrt(mass),
                "coupling_b_n_per_v": mode.coupling_b_n_per_v_kg05 * sqrt(mass),
                "tip_x": float(tip_x),
                "tip_y": float(tip_y),
            }
            modes.append(values)
            provenance |= {f"modes.{index}.{key}": origins.get(key, fitted) for key in values if key != "name"}
        measured = Provenance("derived", f"fitted to {self.source}")
        piezo = {name: getattr(self, name) for name in _PIEZO}
        provenance |= {f"piezo.{key}": measured for key in piezo}
        borrowed = Provenance("assumed", f"that of {base.name}; state your own")
        document = base.model_dump()
        rest = {part: document[part] for part in ("contact", base.moved, "mount") if document[part] is not None}
        provenance |= {f"{section}.{key}": borrowed for section, table in rest.items() for key in table}
        parts = {"name": name, "modes": modes, "piezo": piezo, **rest}
        return assemble(parts, None, provenance, where=self.source)

    def writers(self, **calibration: Any) -> dict[str, Callable[[Path], object]]:
        """Return the writers by ending, see :meth:`save`."""
        heading = f"A motor by the two-port spectra {self.source}."

        def write_motor(file: Path) -> None:
            file.write_text(self.to_motor(**calibration).to_toml(heading=heading), encoding="utf-8")

        return {**super().writers(), ".toml": write_motor}

    def save(self, path: str | Path, **calibration: Any) -> Path:
        """Write the fit as ``.json``, or as a motor ``.toml`` with the arguments of :meth:`to_motor`.

        Raises:
            ParameterError: for another ending, a place that cannot be written, or as by :meth:`to_motor`.
        """
        return save_by_ending(path, self.writers(**calibration))

    def summary(self) -> dict[str, str]:
        """Return source, errors, clamped capacitances, and frequency, Qm and couplings of each mode."""
        errors = (f"{name.replace('-', '−')} {100.0 * value:.3g} %" for name, value in self.rms_relative_error.items())
        found = {
            "source": self.source or "spectra",
            "RMS error": ", ".join(errors),
            "clamped capacitance of A": engineering(self.capacitance_a_f, "F"),
            "clamped capacitance of B": engineering(self.capacitance_b_f, "F"),
            "capacitance between A and B": engineering(self.capacitance_ab_f, "F"),
            "loss tangent": f"{self.loss_tangent:.3g}, constant{'' if self.loss_dispersion else ' without dispersion'}",
        }
        for name, value in self.leads.items():
            kind, group, unit = *name.split("_")[:2], unit_in(name)
            error = engineering(self.lead_standard_errors[name], unit)
            found[f"lead {kind} of {group.upper()}"] = f"{engineering(value, unit)} ± {error}"
        for number, mode in enumerate(self.modes, start=1):
            couplings = (f"{getattr(mode, name):.4g} ±{mode.standard_errors[name]:.2g}" for name in _VALUES[2:])
            found[f"mode {number}"] = (
                f"{engineering(mode.series_resonance_hz, 'Hz')}, Qm {mode.quality_factor:.4g}, "
                f"couplings {', '.join(couplings)} N/(V·√kg)"
            )
        return found

    def _masses(
        self,
        mass_kg: float | Sequence[float] | None,
        velocity_per_current: float | Sequence[float] | None,
        connection: Connection,
        tips: Sequence[tuple[float, float]],
    ) -> tuple[list[float], Provenance]:
        if (mass_kg is None) == (velocity_per_current is None):
            raise ParameterError(
                "A motor needs one mechanical calibration: give either mass_kg or velocity_per_current, not both."
            )
        require(connection in COUPLING, "connection", connection, f"one of {', '.join(COUPLING)}")
        what = "velocity_per_current" if mass_kg is None else "mass_kg"
        given = velocity_per_current if mass_kg is None else mass_kg
        values = np.ravel(np.asarray(given, float)).tolist()
        valid = len(values) in (1, len(self.modes)) and all(0.0 < value < 1e18 for value in values)
        require(valid, what, given, f"a number > 0, or one for each of {len(self.modes)} modes")
        if mass_kg is None:  # θ = |tip| i/v, and θ/√m is known
            for index, (velocity, mode, tip) in enumerate(zip(values, self.modes, tips, strict=False)):
                coupling = abs(float(mode.couplings @ COUPLING[connection]))
                if coupling < 1e-6 * hypot(*mode.couplings):
                    raise ParameterError(
                        f"Mode {index + 1} takes no current through {connection}; measure its velocity another way."
                    )
                values[index] = (hypot(*tip) / velocity / coupling) ** 2
        if len(values) < len(self.modes):
            return values * len(self.modes), Provenance("derived", f"{what} of one mode; taken to be that of all")
        return values, Provenance("given" if mass_kg is not None else "derived", f"calibration by {what}")


@one_thread_of_scipy()
def fit_groups(
    spectra: Spectrum | Mapping[Connection, Spectrum],
    modes: int | None = None,
    *,
    leads: bool = True,
    noise: Mapping[str, float] | None = None,
    timeout: float | None = None,
    progress: Progress | None = None,
) -> TwoPortFit:
    """Fit modes with their couplings to both groups; see :func:`~.fit.fit_spectrum`.

    Without a number of modes, a mode that is not significant is rejected, like an arm of one port.
    """
    cautions: list[str] = []
    if isinstance(spectra, Spectrum):
        if spectra.ports != 2:
            raise SpectrumError(
                f"{spectra.source or 'The spectrum'} has one port; "
                "give a two-port, or the spectra of A, B and A+B or A-B."
            )
        forward, backward = spectra.matrix_s[:, 0, 1], spectra.matrix_s[:, 1, 0]  # equal, of a passive stator
        if (differ := 2.0 * rms(forward - backward) / rms(forward + backward)) >= 0.05:
            cautions.append(
                f"Y_AB and Y_BA differ by {100.0 * differ:.2g} % (RMS); check the wiring and the calibration."
            )
        shown = {connection: spectra.driven(connection) for connection in get_args(Connection)}
        transfer = 0.5 * (forward + backward)
        # the four connections of a two-port hold three independent spectra
        ports: dict[str, Spectrum] = {
            "A": shown["A"], "B": shown["B"], _TRANSFER: Spectrum.from_admittance(spectra.frequency_hz, transfer),
        }  # fmt: skip
        source = spectra.source
    else:
        shown = dict(spectra)
        ports = {str(name): spectrum for name, spectrum in spectra.items()}
        if not {"A", "B"} <= ports.keys() <= COUPLING.keys() or len(ports) < 3:
            raise SpectrumError(
                f"The couplings do not follow from the connections {', '.join(ports) or 'none'}; give A, B, and A+B or "
                "A-B."
            )
        source = ", ".join(spectrum.source for spectrum in ports.values())
    problem = _Problem(ports, noise, modes, timeout, progress)
    problem, parameters = problem.explained(problem.solved(), leads)
    if modes is None and len(parameters) == _GLOBALS + _PER_MODE and problem.doubtful(parameters) is not None:
        raise SpectrumError(f"{source or 'The spectra'} show no mode that is significant under their error.")
    return _report(problem, parameters, shown, source or "spectra", cautions)


def clamped(loss_tangent: float, frequency_hz: Vector, branches: int | None = None) -> tuple[Complexes, Complexes]:
    """Return the admittance of 1 F with a constant loss tangent, and its derivative by the tangent.

    By default it has the branches of a motor, whose ripple is 5 % of the loss; 0 ``branches`` have no dispersion.
    """
    s = 2j * pi * frequency_hz
    if branches == 0:
        return np.asarray(s * (1.0 - 1j * loss_tangent)), np.asarray(-1j * s)

    def admittance(loss: float) -> Complexes:
        return np.asarray(sum(s * c / (1.0 + s * r * c) for r, c in lossy_capacitance(1.0, loss, branches=branches)))

    step = 1e-6 * max(loss_tangent, 1e-3)
    below, above = max(loss_tangent - step, 1e-12), min(loss_tangent + step, LARGEST_LOSS_TANGENT)
    return admittance(loss_tangent), (admittance(above) - admittance(below)) / (above - below)


class _Problem:
    """The joint least-squares problem of several connections, in units of its own."""

    def __init__(
        self,
        ports: Mapping[str, Spectrum],
        noise: Mapping[str, float] | None,
        modes: int | None = None,
        timeout: float | None = None,
        progress: Progress | None = None,
    ) -> None:
        self.ports, self.modes, self.timeout, self.progress = ports, modes, timeout, progress  # as of one port
        self.branches: int | None = None  # of the loss, one of _LOSSES
        first, second = ports["A"], ports["B"]
        self.low = max(first.frequency_hz[0], second.frequency_hz[0])
        self.high = min(first.frequency_hz[-1], second.frequency_hz[-1])
        self.reference_hz = sqrt(self.low * self.high)
        self.unit_s = float(np.median(np.abs(first.admittance_s)))
        self.unit_henry = 1.0 / (2.0 * pi * self.reference_hz * self.unit_s)
        self.leads = np.zeros(len(_LEADS))  # to start from
        self.with_leads = self.coupled = False  # whether leads are fitted; whether losses couple the modes in the band
        self.count = sum(len(spectrum) for spectrum in ports.values())
        self.noise = {name: noise_of(noise, spectrum.admittance_s) for name, spectrum in ports.items()}
        self.deviation = {name: self._deviation(name, spectrum.admittance_s) for name, spectrum in ports.items()}

    def _deviation(self, name: str, smooth_s: Complexes) -> Vector:
        """Return the deviation of an admittance at all points, in the unit of this problem."""
        return np.maximum(self.noise[name].deviation(smooth_s), FINEST * np.abs(smooth_s)) / self.unit_s

    def reweighted(self, parameters: Vector) -> Vector:
        """Descend with deviations at the fitted admittances and errors of measurement from the residuals."""
        self.noise, self.deviation = dict(self.noise), dict(self.deviation)  # copies of the problem share them
        for name, spectrum in self.ports.items():
            measured = spectrum.admittance_s
            fitted = self.model(parameters, name, spectrum.frequency_hz)[0] * self.unit_s
            residuals = measured - fitted
            white = independent_points(residuals / fitted) > 0.5 * len(measured)
            self.noise[name] = self.noise[name].refined(fitted, residuals, white, fitted)
            self.deviation[name] = self._deviation(name, fitted)
        return self.descend(parameters)

    def descend(self, start: Vector) -> Vector:
        """Descend from start values to the nearest minimum."""
        return descent.descend(self.normal_equations, start, self.bounds(start), self.reach)[0]

    def solved(self) -> Vector:
        """Return the solution with the significant modes in the band and beside it."""
        parameters = self.lossy(self.start())
        fewest = _GLOBALS + _PER_MODE  # leads may hide the last mode
        while self.modes is None and len(parameters) > fewest and (doubtful := self.doubtful(parameters)) is not None:
            parameters = self.descend(np.delete(parameters, np.s_[doubtful : doubtful + _PER_MODE]))
        for above in (False, True):
            parameters = self.with_neighbour(parameters, above=above)
        # modes beside the band have distorted the choice of the loss
        return self.lossy(parameters) if np.any(self.sides(parameters) != 1) else parameters

    def lossy(self, start: Vector) -> Vector:
        """Return the solution with the description of the loss that fits best, which is kept."""
        found = []
        for self.branches in _LOSSES:
            parameters = self.descend(start)
            found.append((self.normal_equations(parameters)[0], parameters, self.branches))
        _, parameters, self.branches = min(found, key=lambda one: one[0])
        return self.reweighted(parameters)

    def independent(self, parameters: Vector) -> float:
        """Return the number of independent points of all connections."""
        return sum(independent_points(self.linearised(parameters, name)[0]) for name in self.ports)

    def covariance(self, parameters: Vector) -> Vector:
        """Return the covariance of the parameters."""
        cost, _, hessian = self.normal_equations(parameters)
        stated, free = self.noise["A"].stated, np.flatnonzero(np.diff(self.bounds(parameters), axis=0)[0])
        variance = descent.variance(cost, self.count, len(free), self.independent(parameters), stated)
        covariance = np.zeros_like(hessian)
        covariance[np.ix_(free, free)] = descent.inverse(hessian[np.ix_(free, free)]) * variance
        if self.with_leads:
            covariance = self.within_bounds(covariance, parameters)
        others, moved = np.setdiff1d(free, _RESISTANCES), np.eye(len(parameters))[:, _RESISTANCES]
        # a resistance in place of coupled losses would move all values
        moved[others] = -descent.inverse(hessian[np.ix_(others, others)]) @ hessian[others][:, _RESISTANCES]
        moved = moved * self.resembled(parameters)
        return covariance + moved @ moved.T

    def within_bounds(self, covariance: Vector, parameters: Vector) -> Vector:
        """Return the covariance of all parameters where the normal distribution of leads is cut off at their bounds.

        Second moments about the fitted values: N. L. Johnson, S. Kotz, N. Balakrishnan, Continuous Univariate
        Distributions, volume 1, 2nd edition, Wiley 1994, chapter 13, section 10.1.
        """
        of_leads = covariance[np.ix_(_LEADS, _LEADS)]
        error = np.sqrt(np.diag(of_leads))
        low, high = ((bound - parameters)[_LEADS] / error for bound in self.bounds(parameters))
        at_low, at_high = (end * np.exp(-0.5 * end**2) / sqrt(2.0 * pi) for end in (low, high))
        square = np.maximum(1.0 + (at_low - at_high) / (ndtr(high) - ndtr(low)), 0.0)
        slope = covariance[:, _LEADS] @ descent.inverse(of_leads)
        return np.asarray(covariance - slope @ (of_leads * (1.0 - np.sqrt(np.outer(square, square)))) @ slope.T)

    def resembled(self, parameters: Vector) -> Vector:
        """Return the series resistances of both groups with the effect of coupled losses on the modes in the band."""
        _, log_quality, *couplings = parameters[_GLOBALS:].reshape(-1, _PER_MODE)[self.sides(parameters) == 1].T
        theta, turned = (np.linalg.norm(np.exp(0.5 * log_quality) * part) for part in (couplings[:2], couplings[2:]))
        return np.asarray(turned / theta * np.exp(-parameters[:2]))

    def doubtful(self, parameters: Vector) -> int | None:
        """Return the place of the least certain mode, if it is not significant."""
        covariance = self.covariance(parameters)
        doubts = []
        for at in range(_GLOBALS, len(parameters), _PER_MODE):
            couplings = parameters[at + 2 : at + 4]
            slope = 2.0 * couplings / float(couplings @ couplings)  # of the logarithm of their squares' sum
            error = sqrt(max(float(slope @ covariance[at + 2 : at + 4, at + 2 : at + 4] @ slope), 0.0))
            broad = np.exp(parameters[at + 1]) < RESONANT_QUALITY
            doubts.append((inf if broad or not np.isfinite(error) else error, at))
        worst, place = max(doubts)
        return place if worst > UNDETERMINED else None

    def start(self) -> Vector:
        """Fit Y_AA + Y_BB, which shows every mode, and divide each arm between the groups by the other connections."""
        first = self.ports["A"].between(self.low, self.high)
        frequency = first.frequency_hz
        second = np.interp(frequency, self.ports["B"].frequency_hz, self.ports["B"].admittance_s)
        # each behind its own resistance, as far as the other group's does not matter
        pairs = zip(self.leads[:2], (first.admittance_s, second), strict=True)
        a, b = (y / (1.0 - r * y / self.unit_s) for r, y in pairs)
        trace = Spectrum.from_admittance(frequency, a + b, source="The sum of A and B")
        fit = fit_one_port(trace, self.modes, leads=False, timeout=self.timeout, progress=self.progress)
        start = np.zeros(_GLOBALS)
        share_a = float(np.median(first.admittance_s.imag / trace.admittance_s.imag))
        capacitance = fit.circuit.clamped_capacitance_f * 2.0 * pi * self.reference_hz / self.unit_s
        split = min(max(share_a, 0.05), 0.95)
        start[:3] = log(capacitance * split), log(capacitance * (1.0 - split)), fit.circuit.loss_tangent
        start[_LEADS] = self.leads
        arms = [(arm.series_resonance_hz / self.reference_hz, arm.quality_factor) for arm in fit.arms if arm.in_band]
        return np.append(start, self._divided(arms))

    def with_neighbour(self, parameters: Vector, *, above: bool) -> Vector:
        """Return the solution with a mode below or above the band if Schwarz's criterion asks for it."""
        cost = self.normal_equations(parameters)[0]
        if cost < FINEST**2 * self.count:
            return parameters
        arms = np.exp(parameters[_GLOBALS:].reshape(-1, _PER_MODE)[:, :2]).tolist()
        places = [(self.high / share if above else self.low * share) / self.reference_hz for share in _OUTSIDE]
        neighbours = [self._divided([*arms, (place, _QUALITY_OUTSIDE)])[-_PER_MODE:] for place in places]
        found = [self.descend(np.append(parameters, one)) for one in neighbours]
        more = min(found, key=lambda one: self.normal_equations(one)[0])
        outside = self.gain(more, self, parameters) >= 0.0 and self.sides(more)[-1] != 1
        return self.reweighted(more) if outside else parameters

    def explained(self, parameters: Vector, leads: bool) -> tuple[_Problem, Vector]:
        """Return the problem with leads, coupled losses or both, if the data ask for them, and its solution."""
        plain = self, parameters
        behind = self.behind_leads(parameters) if leads else plain
        best = behind if behind[0].has_leads(behind[1], *plain) else plain
        coupled = best[0].with_coupled_losses(best[1])
        if coupled[0].gain(coupled[1], *best) <= _TIE:
            return best
        plain, behind = (problem.with_coupled_losses(found) for problem, found in (plain, behind))
        return behind if behind[0].has_leads(behind[1], *plain) else plain

    def behind_leads(self, parameters: Vector) -> tuple[_Problem, Vector]:
        """Return the problem with leads, and its solution from one without."""
        other, start = copy(self), parameters.copy()
        other.with_leads, start[_RESISTANCES] = True, _FIRST_LEAD
        found = other.descend(start)
        better = other.gain(found, self, parameters) > _TIE
        if better or not self.white(parameters):
            # leads may have hidden a mode, divided one, or led nowhere from a fit that follows nothing
            other.leads = (found if better else start)[_LEADS]
            with suppress(SpectrumError):
                found = other.solved()
            found = other.pruned(found)
        return other, found

    def with_coupled_losses(self, parameters: Vector) -> tuple[_Problem, Vector]:
        """Return the problem with losses that couple the modes, and its solution from one without."""
        other = copy(self)
        other.coupled = True
        return other, other.reweighted(other.pruned(other.descend(parameters)))

    def pruned(self, parameters: Vector) -> Vector:
        """Return the solution without the modes for which Schwarz's criterion does not ask, if their number is free."""
        for at in () if self.modes is not None else reversed(range(_GLOBALS, len(parameters), _PER_MODE)):
            fewer = self.descend(np.delete(parameters, np.s_[at : at + _PER_MODE]))
            parameters = fewer if self.gain(fewer, self, parameters) > 0.0 else parameters
        return parameters

    def has_leads(self, parameters: Vector, rival: _Problem, others: Vector) -> bool:
        """Whether leads of a solution that resembles noise are needed and significant, and turn the modes by enough."""
        _, log_quality, *couplings = parameters[_GLOBALS:].reshape(-1, _PER_MODE).T
        strong = np.hypot(*couplings[:2]) > _STRONG * np.hypot(*couplings[:2]).max(initial=0.0)
        # leads turn the modes by 2ωRC, and losses that couple modes by a share of 1/Q
        turned = 2.0 * parameters[_LEADS] * np.exp(np.tile(parameters[:2], 2))
        inside = parameters[_RESISTANCES] < self.bounds(parameters)[1][_RESISTANCES]
        large = np.max(turned) * np.exp(log_quality[strong].min(initial=inf)) > _LEAST_TURN
        if not (large and np.all(inside) and self.white(parameters) and self.gain(parameters, rival, others) > _TIE):
            return False
        error = np.sqrt(np.diag(self.covariance(parameters))[_RESISTANCES])
        return bool(np.any(parameters[_RESISTANCES] > _SIGNIFICANT * error))

    def white(self, parameters: Vector) -> bool:
        """Whether the residuals resemble noise: most of the points are independent."""
        return self.independent(parameters) >= 0.5 * self.count

    def gain(self, parameters: Vector, rival: _Problem, others: Vector) -> float:
        """Return the advantage of a solution versus one of a rival problem by Schwarz's criterion."""
        points, exact = self.independent(parameters), FINEST**2 * self.count
        rival = copy(rival)
        rival.deviation = self.deviation
        ratio = rival.normal_equations(others)[0] / max(self.normal_equations(parameters)[0], exact)
        more = np.count_nonzero(np.diff(self.bounds(parameters), axis=0))
        more -= np.count_nonzero(np.diff(rival.bounds(others), axis=0))
        return 2.0 * points * log(ratio) - more * log(2.0 * points)

    def sides(self, parameters: Vector) -> NDArray[np.intp]:
        """Return 0, 1 or 2 for each mode below, in or above the band; one that ends at its limit is in it."""
        ends = np.log(np.array([(1.0 - _AT_LIMIT) * self.low, (1.0 + _AT_LIMIT) * self.high]) / self.reference_hz)
        return np.searchsorted(ends, parameters[_GLOBALS::_PER_MODE])

    def _divided(self, arms: Sequence[tuple[float, float]]) -> Vector:
        """Return ln f, ln Q and couplings to both groups of modes with relative frequencies and quality factors."""
        size = {connection: self._amplitudes(connection, arms) for connection in self.ports}
        found = []
        for index, (frequency, quality) in enumerate(arms):
            a, b = (sqrt(max(size[group][index], 1e-12)) for group in "AB")
            total = a * a + b * b
            if _TRANSFER in size:
                alike = size[_TRANSFER][index]
            else:
                alike = size["A+B"][index] - total if "A+B" in size else total - size["A-B"][index]
            found += [log(frequency), log(quality), a, b if alike >= 0.0 else -b, 0.0, 0.0]
        return np.array(found)

    def _amplitudes(self, connection: str, arms: Sequence[tuple[float, float]]) -> Vector:
        """Return (w·θ)²/m/ω of every mode by linear least squares, in the unit of this problem."""
        spectrum = self.ports[connection]
        w = spectrum.frequency_hz / self.reference_hz
        y = spectrum.admittance_s / self.unit_s
        columns = [1j * w, w**2 + 0j]
        for frequency, quality in arms:
            columns.append(1.0 / (1.0 / quality + 1j * (w / frequency - frequency / w)))
        system = (np.array(columns) / np.abs(y)).view(float).T
        found = np.linalg.lstsq(system, np.ascontiguousarray(y / np.abs(y)).view(float), rcond=None)[0]
        return np.asarray(found[2:])

    def bounds(self, start: Vector) -> tuple[Vector, Vector]:
        """Return the minimum and maximum of every parameter."""
        ends = np.log(np.array([self.low / _FARTHEST, self.low, self.high, _FARTHEST * self.high]) / self.reference_hz)
        most = self.with_leads * np.repeat([_MOST_RESISTANCE, PLAUSIBLE_LEADS[1] / self.unit_henry], 2)
        lower = [-25.0, -25.0, 1e-9, -inf, 0.0, 0.0, 0.0, 0.0]
        upper = [25.0, 25.0, LARGEST_LOSS_TANGENT, inf, *most]
        for side in self.sides(start):
            turn = inf if self.coupled and side == 1 else 0.0
            lower += [ends[side], log(0.6), -inf, -inf, -turn, -turn]
            upper += [ends[side + 1], log(1e6), inf, inf, turn, turn]
        return np.array(lower), np.array(upper)

    def reach(self, parameters: Vector) -> Vector:
        """Return the largest step: of a mode its bandwidth."""
        reach = np.full(len(parameters), np.inf)
        reach[_GLOBALS::_PER_MODE] = 2.0 * np.exp(-parameters[_GLOBALS + 1 :: _PER_MODE])
        reach[_GLOBALS + 1 :: _PER_MODE] = 2.0
        return reach

    def model(self, parameters: Vector, connection: str, frequency_hz: Vector) -> tuple[Complexes, Complexes]:
        """Return the admittance of a connection in the unit of this problem, and its derivatives.

        Behind leads Z it is uᵀ Y (1 + ZY)⁻¹ v, with the derivative aᵀ dY b − (Ya)ᵀ dZ (Yb), where a = (1 + ZY)⁻¹ u and
        b = (1 + ZY)⁻¹ v.
        """
        w = frequency_hz / self.reference_hz
        pair = ((1.0, 0.0), (0.0, 1.0)) if connection == _TRANSFER else 2 * (COUPLING[connection],)  # type: ignore[index]
        into, driven = (np.array(weights)[:, None] for weights in pair)
        shape_of_loss, slope_of_loss = clamped(float(parameters[2]), frequency_hz, self.branches)
        unit = 1.0 / (2.0 * pi * self.reference_hz)
        plates = unit * (np.diag(np.exp(parameters[:2])) + parameters[3] * (np.eye(2) - 1.0))
        log_frequency, log_quality, *theta = parameters[_GLOBALS:].reshape(-1, _PER_MODE).T[:, :, None]
        frequency, quality = np.exp(log_frequency), np.exp(log_quality)
        turn = 1j * w / frequency + 0.5 / quality
        theta = [theta[group] + turn * theta[group + 2] for group in (0, 1)]
        shape = 1.0 / (1.0 / quality + 1j * (w / frequency - frequency / w))
        ahead = parameters[_RESISTANCES, None] + 1j * w * parameters[_INDUCTANCES, None]
        device = plates[:, :, None] * shape_of_loss + np.einsum("imf,jmf,mf->ijf", theta, theta, shape)
        a, b = into + 0j, driven + 0j
        if ahead.any():
            behind = np.linalg.inv(np.eye(2) + np.moveaxis(ahead[:, None] * device, -1, 0))
            a, b = (np.moveaxis(behind @ weights, 0, -1)[:, 0] for weights in (into, driven))
        currents = [np.einsum("ijf,jf->if", device, np.broadcast_to(one, (2, len(w)))) for one in (a, b)]
        first, second = (np.einsum("imf,if->mf", theta, np.broadcast_to(one, (2, len(w)))) for one in (a, b))
        product = first * second
        jacobian = np.empty((len(parameters), len(w)), dtype=complex)
        jacobian[:2] = np.diag(plates)[:, None] * shape_of_loss * a * b
        jacobian[2] = np.einsum("if,ij,jf->f", a, plates, b) * slope_of_loss
        jacobian[3] = -unit * (a[0] * b[1] + a[1] * b[0]) * shape_of_loss
        jacobian[_RESISTANCES] = -currents[0] * currents[1]
        jacobian[_INDUCTANCES] = 1j * w * jacobian[_RESISTANCES]
        jacobian[_GLOBALS::_PER_MODE] = 1j * product * shape**2 * (w / frequency + frequency / w)
        jacobian[_GLOBALS + 1 :: _PER_MODE] = product * shape**2 / quality
        for group in (0, 1):
            jacobian[_GLOBALS + 2 + group :: _PER_MODE] = (a[group] * second + b[group] * first) * shape
            jacobian[_GLOBALS + 4 + group :: _PER_MODE] = turn * jacobian[_GLOBALS + 2 + group :: _PER_MODE]
        return np.asarray(np.sum(into * currents[1], axis=0)), jacobian

    def linearised(self, parameters: Vector, connection: str) -> tuple[Complexes, Complexes]:
        """Return the residual Y_model − Y of one connection over its deviation, and its derivatives."""
        spectrum, deviation = self.ports[connection], self.deviation[connection]
        y, jacobian = self.model(parameters, connection, spectrum.frequency_hz)
        return np.asarray((y - spectrum.admittance_s / self.unit_s) / deviation), jacobian / deviation

    def normal_equations(self, parameters: Vector) -> descent.NormalEquations:
        """Return the normal equations of all connections together."""
        parts = [descent.squares(*self.linearised(parameters, connection)) for connection in self.ports]
        return sum(part[0] for part in parts), np.sum([p[1] for p in parts], 0), np.sum([p[2] for p in parts], 0)


def _report(
    problem: _Problem, parameters: Vector, shown: Mapping[Connection, Spectrum], source: str, cautions: list[str]
) -> TwoPortFit:
    """Return the solution with units and standard errors."""
    errors = {}
    for name, spectrum in shown.items():
        fitted = problem.model(parameters, name, spectrum.frequency_hz)[0] * problem.unit_s
        errors[str(name)] = rms(fitted / spectrum.admittance_s - 1.0)
    deviation = np.sqrt(np.maximum(np.diag(problem.covariance(parameters)), 0.0))
    rows = zip(*(values[_GLOBALS:].reshape(-1, _PER_MODE) for values in (parameters, deviation)), strict=True)
    modes = []
    for ((log_frequency, log_quality, a, b, *_), error), side in zip(rows, problem.sides(parameters), strict=True):
        if side != 1:
            continue
        frequency, quality = float(np.exp(log_frequency)) * problem.reference_hz, float(np.exp(log_quality))
        scale = sqrt(problem.unit_s * 2.0 * pi * frequency)  # θ²/m is ω over the reactance
        signed = -scale if a < 0.0 else scale
        standard_errors = dict(zip(_VALUES, (error[:4] * [frequency, quality, scale, scale]).tolist(), strict=True))
        modes.append(TwoPortMode(frequency, quality, float(a) * signed, float(b) * signed, standard_errors))
    unit = problem.unit_s / (2.0 * pi * problem.reference_hz)
    if problem.branches == 0:  # from the band to 100 kHz, by the dispersion of a motor
        flat, falling = (
            clamped(float(parameters[2]), np.array([problem.reference_hz]), branches)[0].imag.item()
            for branches in (0, None)
        )
        unit *= flat / falling
    capacitances = np.exp(parameters[:2]) * unit
    to_si, names = np.repeat([1.0 / problem.unit_s, problem.unit_henry], 2), _LEAD_NAMES if problem.with_leads else ()
    leads, spread = (dict(zip(names, (to_si * row[_LEADS]).tolist(), strict=False)) for row in (parameters, deviation))
    most = max([*leads.values()][:2], default=0.0)  # resistance
    if most > PLAUSIBLE_LEADS[0]:
        ohm, limit = (engineering(value, "Ω") for value in (most, PLAUSIBLE_LEADS[0]))
        caution = f"A group has {ohm} in series, more than the {limit} of a fixture: check its joints."
        cautions = [*cautions, f"{caution} The modes are those behind it."]
    if problem.coupled:
        ohm = engineering(float(np.max(problem.resembled(parameters))) / problem.unit_s, "Ω")
        caution = "The losses couple the modes, as contact losses do. Series resistances have the same effect"
        cautions = [*cautions, f"{caution}: the errors contain {ohm}. Measure the free stator to separate the two."]
    worst = max(errors.values())
    if worst > FINEST and not problem.white(parameters):
        cautions = [*cautions, misfit("The modes do not follow the spectra", worst, "up to ")]
    return TwoPortFit(
        source=source,
        modes=tuple(sorted(modes, key=lambda mode: mode.series_resonance_hz)),
        capacitance_a_f=float(capacitances[0]),
        capacitance_b_f=float(capacitances[1]),
        loss_tangent=float(parameters[2]),
        loss_dispersion=problem.branches != 0,
        capacitance_ab_f=float(unit * parameters[3]) if abs(parameters[3]) > _SIGNIFICANT * deviation[3] else 0.0,
        standard_errors=dict(
            zip(_PIEZO, (deviation[: len(_PIEZO)] * [*capacitances, 1.0, unit]).tolist(), strict=True)
        ),
        rms_relative_error=errors,
        noise={name: dict(model.sigma) for name, model in problem.noise.items()},
        leads=leads,
        lead_standard_errors=spread,
        cautions=tuple(cautions),
    )
