# SPDX-License-Identifier: GPL-3.0-or-later
r"""The cause of the deviations of a stator from its motor: hypotheses compared by their evidence.

The data d are what belongs to a mode alone, f, Q and θ/√m to each group, with the capacitances and the loss tangent, as
deviations from the motor. A cause changes the motor by some sizes x; the matrices of its stator, free or pressed on the
rotor, give the pattern g(x). With the spreads of the sizes before the measurement, Λ, and the covariance Σ of the data
by the errors of the fits and the tolerances of manufacture, the logarithm of the evidence is

.. math::
    -\tfrac12 \min_x \left[(d - g)^T \Sigma^{-1} (d - g) + x^T \Lambda^{-1} x\right]
    - \tfrac12 \ln |2\pi\Sigma| - \tfrac12 \ln |1 + \Lambda G^T \Sigma^{-1} G|, \qquad G = \partial g/\partial x

by Laplace's approximation (D. J. C. MacKay, *Information Theory, Inference, and Learning Algorithms*, Cambridge 2003,
chapter 28). A size of one sign counts twice with the share of its posterior that has this sign.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import atan, exp, expm1, inf, log, pi
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.impedance.one_port_fit import SpectrumFit
from pyspice_runner.impedance.spectrum import COUPLING, Connection, State
from pyspice_runner.impedance.two_port_fit import TwoPortFit
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.parameters import MIN_CAPACITANCE
from pyspice_runner.motor.stator import CAPACITANCE_AT, Array, square
from pyspice_runner.motor.thermal import Thermal

HEALTHY, UNKNOWN = "none: within the tolerances of manufacture", "no cause of the list explains the pattern"
BODY, PATCH, DEPOLARISED = "added mass on the body, or a crack in it", "cracked or loose patch", "depolarised ceramic"
CONTACT, BONDING, FIXTURE = "preload or contact", "bonding of the ceramic", "fixture or leads"
TEMPERATURE, LEVEL = "another temperature", "drive level too high"
# probabilities before the measurement, assumed: most parts are good; the causes share the rest alike
_BEFORE = {HEALTHY: 0.5, UNKNOWN: 0.02}
# Tolerances of manufacture as relative standard deviations, assumed: a plate is ground to 0.1 % of its length, d31 and
# permittivity scatter by 2 % within a lot (5 to 10 % between lots by data sheets), quality factors by 10 %, a spring by
# 4 %. The first is common to all modes or groups, the second is of each alone.
TOLERANCES = {
    "stiffness": (4e-3, 2e-3), "damping": (0.05, 0.08), "coupling": (0.015, 0.01), "capacitance": (0.02, 0.01),
    "loss": (0.15, 0.0), "preload": (0.04, 0.0),
}  # fmt: skip
# of f, Q, θ, capacitance and loss tangent: what overlapping modes add to the errors of fits, and how far values are off
# that no cause explains, or that a skewed peak shows; assumed
_FITTED, _BROAD = (1e-4, 0.01, 3e-3, 2e-3, 0.02), (0.02, 0.4, 0.3, 0.15, 1.0)
_MISFIT = 0.0, 2.0, 1.0, 0.2, 2.0  # errors of the same over the RMS residual of the fit, assumed; of f in bandwidths, 1
_SKEWED = {False: 0.02, True: 0.7}  # share of spectra that look skewed, by whether their level is too high, assumed
# of the arms of one peak: largest distance in bandwidths of the narrower, smallest ratio and cosine of their couplings
_SPLIT, _STRONG, _ALIGNED = 2.0, 0.3, 0.9
LARGEST_SHIFT = 0.2  # largest relative distance of the frequencies of one mode
_STEP = 1e-4  # of a tolerance of manufacture, relative, for its derivative
_POLE = 0.02  # relative distance of a mode by a fit of the motor's own admittance from its pole, which counts as 1
_OTHER = 2.0  # difference of a mode from one of the motor that makes it another one: a factor e² of θ, or 20 % of f
_CABLE = 0.3, 1.0  # Ω and µH, assumed standard deviations of usual leads: a metre of cable
_LEAST_LOSS = 1e-4  # a smaller loss tangent does not count
_STANDS_OUT, _MOST = 3.0, 6  # standard deviations, and number, of the deviations that are listed
_ADDED = "coupling", "lead_ohm", "lead_h", "stray_f"  # what a size is a multiple of; of others it is a power
_WEAK = 0.3  # of the largest θ/√m of a group: what cancels in a mode with less can grow by a loss as well
_Names = tuple[tuple[str, ...], tuple[str, ...]]  # of each mode, and of all
_OF_ARMS: _Names = ("series_resonance_hz", "quality_factor", "inductance_h"), ("clamped_capacitance_f", "loss_tangent")
_OF_MODES: _Names = (
    ("series_resonance_hz", "quality_factor", "coupling_a_n_per_v_kg05", "coupling_b_n_per_v_kg05"),
    ("capacitance_a_f", "capacitance_b_f", "loss_tangent"),
)
_Part = dict[str, Any]  # arrays of a stator, and what a cause changes beside them


class Observed(NamedTuple):
    """What is seen of a stator through one connection or through both groups."""

    modes: Array  # ln f, ln Q, then θ/√m in N/(V·√kg) through each connection; shape (modes, 2 + connections)
    rest: Array  # ln of the clamped capacitances at 100 kHz and of the loss tangent, shape (connections + 1,)

    @classmethod
    def of(cls, fit: SpectrumFit | TwoPortFit) -> tuple[Observed, Observed]:
        """Return what a fit shows and the standard errors; errors of couplings are relative to |θ|/√m of the mode."""
        arms: Sequence[Any]
        owner: Any
        if isinstance(fit, TwoPortFit):
            arms, (names, of_all), owner, power = fit.modes, _OF_MODES, fit, 1.0
        else:  # θ²/m = 1/L
            arms, (names, of_all), owner, power = fit.resonances, _OF_ARMS, fit.circuit, -0.5
        values = np.array([[getattr(arm, name) for name in names] for arm in arms]).reshape(-1, len(names))
        errors = np.array([[arm.standard_errors[name] for name in names] for arm in arms], dtype=float)
        errors = np.abs(errors.reshape(values.shape) / values)
        theta = values[:, 2:] ** power
        errors[:, 2:] *= abs(power) * np.abs(theta) / np.linalg.norm(theta, axis=1, keepdims=True)
        rest = np.array([getattr(owner, name) for name in of_all])
        spread = np.array([fit.standard_errors[name] for name in of_all], dtype=float) / rest
        rest[-1] = max(rest[-1], _LEAST_LOSS)
        if isinstance(fit, SpectrumFit):
            rest[0] *= _dispersion(rest[-1], fit.circuit.loss_reference_hz)
        seen = cls(np.column_stack([np.log(values[:, :2]), theta]), np.log(rest))
        return seen, cls(np.nan_to_num(errors, nan=1.0), np.nan_to_num(spread, nan=1.0))

    @property
    def size(self) -> Array:
        """|θ|/√m of each mode."""
        return np.asarray(np.linalg.norm(self.modes[:, 2:], axis=1))

    @property
    def row(self) -> Array:
        """All values in a row."""
        return np.concatenate([self.modes.ravel(), self.rest])

    def taken(self, at: list[int]) -> Observed:
        """Return some of the modes."""
        return self._replace(modes=self.modes[at])

    def over(self, other: Observed) -> Array:
        """Return all deviations from another one in a row, of a coupling (θ − θ₀)/|θ₀|; a mode itself has no sign."""
        theta, reference = self.modes[:, 2:], other.modes[:, 2:]
        sign = np.where(np.sum(theta * reference, axis=1, keepdims=True) < 0.0, -1.0, 1.0)
        coupling = (sign * theta - reference) / other.size[:, np.newaxis]
        modes = np.hstack([self.modes[:, :2] - other.modes[:, :2], coupling])
        return Observed(modes, self.rest - other.rest).row

    @property
    def kinds(self) -> NDArray[np.intp]:
        """Number of the quantity of each value in a row: f, Q, θ, capacitance, loss tangent."""
        through = len(self.rest) - 1
        return np.array([*[0, 1, *[2] * through] * len(self.modes), *[3] * through, 4])

    def paired(self, other: Observed, scale: float = 10.0, most: float = inf) -> tuple[list[int], list[int]]:
        """Return the places of modes that both have, by ln f (times a scale), |θ| and its direction."""
        apart = np.abs(np.subtract.outer(self.modes[:, 0], other.modes[:, 0]))
        sizes = np.log(self.size + 1e-12), np.log(other.size + 1e-12)
        alike = np.abs(self.modes[:, 2:] @ other.modes[:, 2:].T) / np.exp(np.add.outer(*sizes))
        cost = np.minimum(scale * apart, 10.0) + np.abs(np.subtract.outer(*sizes)) + 3.0 * (1.0 - alike)
        rows, columns = _assigned(cost)
        near = (apart[rows, columns] < min(LARGEST_SHIFT, 2.0 / scale)) & (cost[rows, columns] < most)
        return rows[near].tolist(), columns[near].tolist()


class _Size(NamedTuple):
    """One size of a cause, and by array what it is the power or the multiple of; of a power it is the logarithm."""

    label: str
    spread: float  # its standard deviation before the measurement
    side: int  # 1 or −1 if only this sign is possible, else 0
    powers: Mapping[str, Any]
    unit: str = "%"
    share: float | None = None  # of a multiple, what it is in the unit

    def shown(self, value: float, error: float) -> str:
        """Return the size in words."""
        if self.share is not None:
            value, error = self.share * value, self.share * error
        elif self.unit == "%":
            value, error = 100.0 * expm1(value), 100.0 * exp(value) * error
        return f"{self.label} {value:+.3g} ± {error:.1g} {self.unit}"


@dataclass(frozen=True)
class Cause:
    """A cause with the sizes that explain the deviations best."""

    name: str
    probability: float  # after the measurement
    sizes: tuple[str, ...]  # in words, with their standard errors

    @property
    def text(self) -> str:
        """The name with the probability."""
        share = f"{100.0 * min(max(self.probability, 1e-3), 0.999):.3g} %"
        return f"{self.name} ({'<' * (self.probability < 1e-3)}{'>' * (self.probability > 0.999)}{share})"


@dataclass(frozen=True)
class Diagnosis:
    """The causes by falling probability, and the deviations that exceed the tolerances of manufacture."""

    causes: tuple[Cause, ...]
    evidence: tuple[str, ...]

    @property
    def text(self) -> str:
        """The most probable cause in words, with its probability and sizes."""
        first = self.causes[0]
        return f"{first.text}{': ' if first.sizes else ''}{', '.join(first.sizes)}"


class Judge:
    """The patterns of the causes for one motor; it judges many parts."""

    def __init__(
        self, motor: Motor, state: State, connection: Connection | None, fit: SpectrumFit | TwoPortFit
    ) -> None:
        """Take a motor in its state, the connection of its groups, or ``None`` for each, and a fit of its admittance.

        Deviations are from that fit: modes outside of the band change it as they change the fits of parts.
        """
        self.weights = np.array([COUPLING[connection]] if connection else np.eye(2))[:, : len(motor.groups)]
        stator = motor.stator
        self.motor, self.pressed, self.names = motor, state == "preloaded", [mode.name for mode in motor.modes]
        self.part: _Part = {name: getattr(stator, name) for name in ("mass", "damping", "stiffness", "coupling")}
        # of free groups, so that a smaller coupling leaves more of it clamped
        self.part["capacitance"] = stator.capacitance + np.diag(self._static(self.part))
        self.part |= dict.fromkeys(_ADDED[1:], 0.0) | {"loss": stator.loss_tangent, "preload": 1.0}
        self.part["kept"] = np.ones(len(motor.groups))  # share of each group's electrodes
        self.middle = 2.0 * pi * exp(np.mean([log(mode.frequency_hz) for mode in motor.modes]))
        seen, shapes = self._poles(self.part)
        self.shapes: NDArray[np.complex128] = np.diag(stator.mass**-0.5 + 0j)
        order = self._order(shapes)
        self.poles, self.shapes = seen.taken(order), shapes[: len(stator.mass), order]
        found = Observed.of(fit)[0]
        arms, modes = found.paired(self.poles, 1.0 / _POLE)
        rows = self.poles.modes.copy()
        # a mode has no sign; its couplings take the sign at its pole
        sign = np.sign(np.sum(found.modes[arms, 2:] * rows[modes, 2:], axis=1, keepdims=True))
        rows[modes] = np.hstack([found.modes[arms, :2], sign * found.modes[arms, 2:]])
        self.reference = Observed(rows, found.rest)
        self.called = {arm: self.names[mode] for arm, mode in zip(arms, modes, strict=True)}  # the arms that are modes

    def _static(self, part: _Part) -> Array:
        return np.asarray(np.sum(part["coupling"] ** 2 / part["stiffness"][:, np.newaxis], axis=0))

    def _order(self, shapes: NDArray[np.complex128]) -> list[int]:
        """Return the pole of each mode of the motor: the one with the shape that is most alike."""
        own = self.shapes.conj().T * self.part["mass"]
        return list(_assigned(-np.abs(own @ shapes[: len(self.part["mass"])]))[1])

    def _poles(self, part: _Part) -> tuple[Observed, NDArray[np.complex128]]:
        """Return what all poles of a part show, and their shapes; the scale makes the residues θθᵀ, as at unit mass."""
        motor = self.motor
        arrays = {name: part[name] for name in ("mass", "damping", "stiffness", "coupling")}
        # with a lost area a change of the coupling is per area: what has none takes no force away
        share = np.where(part["kept"] < 1.0, 1.0 - part["kept"], 1.0)
        arrays["coupling"] = self.part["coupling"] + share * (part["coupling"] - self.part["coupling"])
        clamped = part["capacitance"] - np.diag(self._static(arrays)) + part["stray_f"] * np.eye(len(motor.groups))
        # the lost part of an electrode is open: its force per volt, squared over its capacitance, stiffens the body
        lost = np.diag(clamped) * (1.0 - part["kept"])
        away = (self.part["coupling"] - arrays["coupling"])[:, lost > 0.0]
        arrays["stiffness"] = np.diag(part["stiffness"]) + away / lost[lost > 0.0] @ away.T
        clamped = clamped - np.diag(lost)
        stator = replace(motor.stator, capacitance=clamped, **arrays)
        if self.pressed and motor.is_transducer:
            stator = stator.loaded(np.array(motor.load_motion), motor.tool, motor.load_resistance_n_s_per_m)
        elif self.pressed:
            stator = motor.pressed_by(part["preload"] * motor.contact.preload_n, stator)
        else:
            stator = stator.with_carrier(motor.mount)
        mass, damping, stiffness = map(square, (stator.mass, stator.damping, stator.stiffness))
        # behind leads U − Z i is at the groups, i = jω (C U + Θᵀ r); ωZC is small and taken at the middle of the modes
        lead = part["lead_ohm"] + 1j * self.middle * part["lead_h"]
        passed = np.linalg.inv(np.eye(len(clamped)) + 1j * self.middle * lead * stator.capacitance)
        held = stator.coupling @ (lead * passed) @ stator.coupling.T
        damping, stiffness = damping + held.real, stiffness - self.middle * held.imag
        whole = float(np.mean(np.diag(clamped)))  # a stray capacitance has no losses
        loss = part["loss"] * (1.0 - part["stray_f"] / whole) + self.middle * part["lead_ohm"] * whole
        count = len(mass)
        below = -np.linalg.solve(mass, np.hstack([stiffness, damping]))
        rates, vectors = np.linalg.eig(np.vstack([np.eye(count, 2 * count, count), below]))
        rings = (rates.imag > 0.0) & (rates.real < 0.0)
        rates, shapes = rates[rings], vectors[:count, rings]
        residue = 2.0 * rates * np.sum(shapes * (mass @ shapes), axis=0) + np.sum(shapes * (damping @ shapes), axis=0)
        shapes = shapes * np.sqrt(2j * rates.imag / residue)
        theta = (self.weights @ passed.real.T @ stator.coupling.T @ shapes).real.T
        plates = np.einsum("cg,gh,ch->c", self.weights, stator.capacitance @ passed.real, self.weights)
        plates = plates * _dispersion(loss, stator.capacitance_at)
        modes = np.column_stack([np.log(np.abs(rates) / (2.0 * pi)), np.log(-0.5 * np.abs(rates) / rates.real), theta])
        return Observed(modes, np.log([*np.maximum(plates, MIN_CAPACITANCE), max(loss, _LEAST_LOSS)])), shapes

    def _pattern(self, sizes: Sequence[_Size], values: Sequence[float] | Array, at: list[int]) -> Array:
        """Return the deviations of some modes of a part with sizes of a cause."""
        part = dict(self.part)
        for size, value in zip(sizes, values, strict=True):
            for name, power in size.powers.items():
                part[name] = part[name] + value * power if name in _ADDED else part[name] * np.exp(value * power)
        seen, shapes = self._poles(part)
        order = self._order(shapes)
        return seen.taken([order[mode] for mode in at]).over(self.poles.taken(at))

    def judge(self, fit: SpectrumFit | TwoPortFit, *, skewed: bool) -> Diagnosis:
        """Return the causes of a part by its fit; ``skewed`` is whether a peak of its spectrum is."""
        measured, errors = Observed.of(fit)
        closest = float(np.min(np.diff(np.sort(self.reference.modes[:, 0])), initial=1.0))
        measured, errors, split = _merged(measured, errors, 0.5 * closest)
        at, found = self.reference.paired(measured, most=_OTHER)
        if not at:
            return Diagnosis((Cause(UNKNOWN, 1.0, ()),), ("No mode of the motor is found.",))
        reference, kinds = self.reference.taken(at), self.reference.taken(at).kinds
        data = measured.taken(found).over(reference)
        # what a fit does not follow, its values can be off by; the values of a skewed peak by much
        each = fit.rms_relative_error
        rms = max(each["A"], each["B"]) if isinstance(each, dict) else each
        floor = np.hypot(_FITTED, rms * np.array(_MISFIT))[kinds]
        skewed = skewed or split
        floor[kinds == 0] += (0.5 if skewed else rms) * np.exp(-reference.modes[:, 1])
        broad = np.array(_BROAD)[kinds]
        floor += np.where(skewed & (kinds > 0), broad, 0.0)
        made = np.transpose([one.spread / _STEP * self._pattern([one], [_STEP], at) for one in self._manufacture(at)])
        covariance = np.diag(errors.taken(found).row ** 2 + floor**2) + made @ made.T
        healthy = self._tried((), data, covariance, at)
        ranked = {HEALTHY: [healthy], UNKNOWN: []}
        for off in (*(kinds == quantity for quantity in range(len(_BROAD))), kinds >= 0):  # one quantity, or all
            wide = covariance + np.diag(np.where(off, broad, 0.0) ** 2)
            ranked[UNKNOWN].append((self._tried((), data, wide, at)[0] - log(len(_BROAD) + 1), ()))
        usual = bad = 0.0  # logarithms of the densities of the leads of the fit, whose modes are those behind them
        for cause, weight, sizes in self._hypotheses(at):
            if sizes[0].unit == "Ω" and isinstance(fit, TwoPortFit) and fit.leads:
                usual, bad, words = _ahead(fit, sizes)
                evidence = healthy[0]
            else:
                evidence, words = self._tried(sizes, data, covariance, at)
            ranked.setdefault(cause, []).append((evidence + log(weight), words))
        others = (1.0 - sum(_BEFORE.values())) / (len(ranked) - len(_BEFORE))
        totals = {}
        for name, items in ranked.items():
            share = _SKEWED[name == LEVEL] if skewed else 1.0 - _SKEWED[name == LEVEL]
            totals[name] = np.logaddexp.reduce([item[0] for item in items]) + log(_BEFORE.get(name, others) * share)
            # beside another cause bad leads are a second one
            totals[name] += {HEALTHY: usual, FIXTURE: bad}.get(name, np.logaddexp(usual, bad + log(others)))
        whole = np.logaddexp.reduce(list(totals.values()))
        causes = (Cause(name, float(np.exp(totals[name] - whole)), max(own)[1]) for name, own in ranked.items())
        return Diagnosis(
            tuple(sorted(causes, key=lambda cause: -cause.probability)),
            self._standing_out(data, np.sqrt(np.diag(covariance)), reference, at),
        )

    def _tried(
        self, sizes: Sequence[_Size], data: Array, covariance: Array, at: list[int]
    ) -> tuple[float, tuple[str, ...]]:
        """Return the logarithm of the evidence of a hypothesis, and its sizes in words."""
        from scipy.optimize import least_squares  # takes long to load
        from scipy.special import log_ndtr

        root = np.linalg.inv(np.linalg.cholesky(covariance))
        evidence = float(np.log(np.diag(root)).sum()) - 0.5 * len(data) * log(2.0 * pi)
        if not sizes:
            return evidence - 0.5 * float(np.sum((root @ data) ** 2)), ()
        spread, sides = (np.array([getattr(size, name) for size in sizes]) for name in ("spread", "side"))

        def residual(values: Array) -> Array:
            return np.concatenate([root @ (data - self._pattern(sizes, values * spread, at)), values])

        fit = least_squares(residual, 0.1 * sides, method="lm")
        posterior = np.linalg.inv(fit.jac.T @ fit.jac)
        error = np.sqrt(np.diag(posterior))
        evidence += 0.5 * float(np.linalg.slogdet(posterior)[1]) - float(fit.cost)
        evidence += float(np.sum(np.where(sides != 0, log(2.0) + log_ndtr(sides * fit.x / error), 0.0)))
        found = zip(sizes, fit.x * spread, error * spread, strict=True)
        return evidence, tuple(size.shown(value, deviation) for size, value, deviation in found)

    def _one(self, name: str, *at: Any) -> dict[str, Array]:
        """Return the power 1 of some elements of an array."""
        power = np.zeros(np.shape(self.part[name]))
        power[at] = 1.0
        return {name: power}

    def _theta(self, mode: int, group: int, spread: float, side: int) -> _Size:
        """Return a change of the coupling of one mode to one group, relative to the mode with the largest θ/√m.

        A part of the ceramic has as much force in each mode; in a weak mode it cancels, and its loss has any sign.
        """
        own = self.part["coupling"][:, group] / np.sqrt(self.part["mass"])
        largest, strength = float(np.max(np.abs(own))), max(float(abs(own[mode])), 1e-12)
        power = self._one("coupling", mode, group)["coupling"]
        power *= np.copysign(largest * np.sqrt(self.part["mass"][mode]), own[mode])
        label = f"θ of group {'AB'[group]} in {self.names[mode]}"
        side = side if strength > _WEAK * largest else 0
        return _Size(label, spread, side, {"coupling": power}, share=100.0 * largest / strength)

    def _manufacture(self, at: list[int]) -> Iterator[_Size]:
        """Yield the tolerances of manufacture."""
        groups = range(len(self.motor.groups))
        for name, (common, each) in TOLERANCES.items():
            yield _Size("", common, 0, {name: self.part["coupling"] if name == "coupling" else 1.0})
            if name == "coupling":
                yield from (self._theta(mode, group, each, 0) for mode in at for group in groups)
            elif each:
                places = [(g, g) for g in groups] if name == "capacitance" else [(mode,) for mode in at]
                yield from (_Size("", each, 0, self._one(name, *place)) for place in places)

    def _hypotheses(self, at: list[int]) -> Iterator[tuple[str, float, list[_Size]]]:
        """Yield causes, shares of them and their sizes, whose spreads are assumed as such faults are in practice."""
        part, one = self.part, self._one
        # a place of the body or the ceramic is at a node of some modes: each number of modes is as likely
        subsets = (combinations(at, count) for count in range(1, len(at) + 1))
        sets = [(2.0 / len(at) / len(own), list(modes)) for own in map(list, subsets) for modes in own]
        for array, side in (("mass", 1), ("stiffness", -1)):
            for share, modes in sets:
                named = [(f"modal {array} of {self.names[mode]}", one(array, mode)) for mode in modes]
                yield BODY, 0.25 * share, [_Size(label, 0.06, side, power) for label, power in named]
        groups = np.flatnonzero(np.any(self.weights, axis=0)).tolist()
        for own in [*([group] for group in groups), *([groups] if len(groups) > 1 else [])]:
            who = " and ".join(f"group {'AB'[group]}" for group in own)
            plates, weight = one("capacitance", own, own), 1.0 / (2 * len(groups) - 1)
            for share, modes in sets if len(own) == 1 else ():
                theta = [self._theta(mode, own[0], 0.3, -1) for mode in modes]
                per_area = [size._replace(label=f"{size.label} per area", spread=1.0) for size in theta]
                yield PATCH, share / (8 * len(groups)), theta
                yield PATCH, share / (8 * len(groups)), [*theta, _Size(f"capacitance of {who}", 0.2, -1, plates)]
                yield PATCH, share / (8 * len(groups)), [*per_area, _Size(f"area of {who}", 0.2, -1, one("kept", own))]
            column = one("coupling", slice(None), own)["coupling"] * part["coupling"]
            every = _Size(f"θ of {who} in all modes", 0.3, -1, {"coupling": column}, share=100.0)
            if len(own) == 1:  # a loose patch keeps its permittivity, and all or none of the capacitance by its motion
                moving = float(self._static(part)[own[0]] / part["capacitance"][own[0], own[0]])
                yield PATCH, 1.0 / (4 * len(groups)), [every, _Size(f"capacitance of {who}", moving, 0, plates)]
            yield DEPOLARISED, weight, [every, _Size(f"permittivity of {who}", 0.1, -1, plates)]
            yield BONDING, weight, [every, _Size("damping of all modes", 0.4, 1, {"damping": 1.0})]
        if self.pressed and not self.motor.is_transducer:
            yield CONTACT, 1.0, [_Size("preload", 0.6, 0, {"preload": 1.0})]
        seen = self.reference.taken(at)
        resonant = 2.0 * pi * float(np.min(np.exp(seen.modes[:, 0] - seen.modes[:, 1]) / seen.size**2))  # Ω, of an arm
        series = _Size("series resistance", 0.3 * resonant, 1, {"lead_ohm": 1.0}, "Ω")
        yield FIXTURE, 0.5, [series, _Size("inductance", 5.0, 1, {"lead_h": 1e-6}, "µH")]
        yield FIXTURE, 0.5, [_Size("stray capacitance of each group", 100.0, 1, {"stray_f": 1e-12}, "pF")]
        drift = Thermal.of(self.motor)
        warmed = {
            "stiffness": 2.0 * drift.frequency_drift_per_k, "capacitance": drift.capacitance_drift_per_k,
            "coupling": drift.coupling_drift_per_k * part["coupling"],
        }  # fmt: skip
        yield TEMPERATURE, 1.0, [_Size("temperature", 30.0, 0, warmed, "K")]
        # a mode changes with the square of its amplitude, by the motor's own constants, or else of its charge
        force = np.linalg.norm(part["coupling"] @ self.weights.T, axis=1)
        quality = np.sqrt(part["mass"] * part["stiffness"]) / part["damping"]
        laws = np.array([(mode.softening_per_m2, mode.damping_growth_per_m2) for mode in self.motor.modes]).T
        square_m2 = (force * quality / part["stiffness"]) ** 2
        softening, growth = ((law if law.any() else force**2) * square_m2 for law in laws)
        softer = {"stiffness": -softening / np.max(softening * quality)}
        yield LEVEL, 1.0, [
            _Size("softening of the strongest mode", 1.0, 1, softer, "half-power widths"),
            _Size("damping of the strongest mode", 0.5, 1, {"damping": growth / growth.max()}),
        ]  # fmt: skip

    def _standing_out(self, data: Array, deviation: Array, reference: Observed, at: list[int]) -> tuple[str, ...]:
        """Return the deviations that exceed the tolerances of manufacture, the largest first."""
        names, through = [self.names[mode] for mode in at], ["A", "B"] if len(self.weights) > 1 else [""]
        of_mode = ["frequency", "quality factor", *(f"θ/√m to {own}" if own else "θ/√m" for own in through)]
        labels = [f"{quantity} of {name}" for name in names for quantity in of_mode]
        labels += [f"capacitance {own}".strip() for own in through] + ["loss tangent"]
        # a coupling relative to its own group's, if it has one
        theta = reference.modes[:, 2:] / reference.size[:, np.newaxis]
        theta = np.hstack([np.ones((len(at), 2)), np.where(np.abs(theta) > 0.01, theta, 1.0)])
        shares = Observed(theta, np.ones(len(reference.rest))).row
        relative = np.where(reference.kinds == 2, data / shares, np.expm1(data))
        return tuple(
            f"{labels[place]} {100.0 * relative[place]:+.3g} % ({abs(data[place]) / deviation[place]:.3g} σ)"
            for place in np.argsort(-np.abs(data) / deviation)[:_MOST]
            if abs(data[place]) > _STANDS_OUT * deviation[place]
        )


def _ahead(fit: TwoPortFit, sizes: Sequence[_Size]) -> tuple[float, float, tuple[str, ...]]:
    """Return the log densities of the leads of a fit as usual and as bad leads, and the leads in words."""
    kinds = [int(name.startswith("inductance")) for name in fit.leads]
    to_size = np.array([1.0, 1e6])[kinds]  # Ω and µH
    values, errors = (to_size * list(one.values()) for one in (fit.leads, fit.lead_standard_errors))
    spreads = (np.hypot(errors, one[kinds]) for one in (np.array(_CABLE), np.array([size.spread for size in sizes])))
    usual, bad = (float(np.sum(-0.5 * (values / one) ** 2 - np.log(one))) for one in spreads)
    words = (f"{sizes[k].label} of group {'ABAB'[n]}" for n, k in enumerate(kinds))
    shown = zip(words, kinds, values, errors, strict=True)
    return usual, bad, tuple(sizes[k]._replace(label=one).shown(value, error) for one, k, value, error in shown)


def _merged(measured: Observed, errors: Observed, most: float) -> tuple[Observed, Observed, bool]:
    """Return one mode of two arms by which a linear circuit describes a skewed peak, and whether there was one.

    ``most`` is the largest distance of their frequencies, relative.
    """
    modes, size, kept = measured.modes.copy(), measured.size, list(range(len(measured.modes)))
    for weak in np.argsort(size)[:-1].tolist():
        width = np.minimum(_SPLIT * np.exp(-np.maximum(modes[:, 1], modes[weak, 1])), most)
        aligned = np.abs(modes[:, 2:] @ modes[weak, 2:]) > _ALIGNED * size * size[weak]
        one = aligned & (size > size[weak]) & (size < size[weak] / _STRONG)
        apart = np.where(one, np.abs(modes[:, 0] - modes[weak, 0]) / width, inf)
        strong = int(np.argmin(apart))
        if apart[strong] < 1.0:
            share = size[weak] ** 2 / (size[weak] ** 2 + size[strong] ** 2)
            modes[strong, 0] += share * (modes[weak, 0] - modes[strong, 0])
            modes[strong, 2:] /= np.sqrt(1.0 - share)
            kept.remove(weak)
    return measured._replace(modes=modes).taken(kept), errors.taken(kept), len(kept) < len(modes)


def _assigned(cost: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return rows and columns with the smallest sum of costs."""
    from scipy.optimize import linear_sum_assignment  # takes long to load

    return linear_sum_assignment(cost)  # type: ignore[no-any-return]


def _dispersion(loss: float, hertz: float) -> float:
    """Return a capacitance at 100 kHz over that at a frequency, with a loss tangent that is the same at all."""
    return float((CAPACITANCE_AT / hertz) ** (-2.0 / pi * atan(loss)))
