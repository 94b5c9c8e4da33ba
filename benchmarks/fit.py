# SPDX-License-Identifier: GPL-3.0-or-later
"""Equivalent circuits: fit_spectrum, scikit-rf's vector fitting and impedance.py's circuit fit, at equal order.

Error is the root mean square of |Y/Y_measured − 1|. Vector fitting has N pole pairs and the real pole of the clamped
capacitance in S (the domain recommended by its manual), or N pairs with constant and proportional term in Y; the better
result is used. Where it is not passive, the best passive one of the two and of scikit-rf's passivity_enforce (S) stands
beside it. Its residues are complex: it has more degrees of freedom than N arms of R, L, C > 0, and does not give a
circuit of such arms. impedance.py needs initial values: first neutral ones (the scale of the data, arms evenly over the
band), then ones at every resonance, as set by a user. Its units are such that the data are of order one.

The limit for passive circuits is the least error of any causal and passive admittance: the transform of a conductance
that is never negative and piecewise linear between the points, by non-negative least squares. It needs points that are
close against every bandwidth, as those of the polymer are.
"""

from __future__ import annotations

import signal
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import inf, pi, sqrt
from operator import attrgetter
from pathlib import Path
from statistics import median

import numpy as np
import skrf
from scipy.optimize import nnls
from skrf.vectorFitting import VectorFitting

import pyspice_runner as pr
from pyspice_runner.impedance.one_port_fit import SpectrumFit
from pyspice_runner.motor.equivalent import EquivalentCircuit, MotionalArm

try:
    from impedance.models.circuits import CustomCircuit
except ImportError:
    CustomCircuit = None

ERROR = attrgetter("error")
REPEATS = 5
STEPS, SECONDS = 300, 10  # limits after which impedance.py counts as not converged
MEASURED = next(
    (above / "shared" / "measured" for above in Path(__file__).resolve().parents if (above / "shared").is_dir()),
    Path("measured"),
)
WORTH = 1.1  # errors up to this multiple of the best count as converged


@dataclass(frozen=True)
class Case:
    """A spectrum and the number of arms to fit."""

    name: str
    frequency_hz: np.ndarray
    admittance_s: np.ndarray
    arms: int


@dataclass(frozen=True)
class Outcome:
    """The result of one tool."""

    error: float
    seconds: float
    passive: bool


def synthetic(arms: int, points: int = 401) -> Case:
    """Arms of Q 30 to 2000, with 0.3 % noise."""
    frequencies = [20e3, 26e3, 33e3, 41e3, 44e3][:arms]
    qualities = [200.0, 80.0, 2000.0, 400.0, 30.0][:arms]
    circuit = EquivalentCircuit(
        tuple(
            MotionalArm(1.0 / (2 * pi * f * c * q), 1.0 / ((2 * pi * f) ** 2 * c), c)
            for f, q, c in zip(frequencies, qualities, [30e-12, 20e-12, 10e-12, 15e-12, 40e-12], strict=False)
        ),
        1e-9, 0.01, 27e3,
    )  # fmt: skip
    frequency = np.linspace(15e3, 50e3, points)
    noise = np.random.default_rng(arms).standard_normal((2, len(frequency))) * 0.003 / sqrt(2.0)
    y = circuit.admittance(frequency) * (1.0 + noise[0] + 1j * noise[1])
    return Case(f"{arms} mode{'s' if arms > 1 else ''}, {points} points", frequency, y, arms)


def measured(name: str, path: str, arms: int) -> Case:
    """A spectrum of a real instrument."""
    spectrum = pr.read_spectrum(MEASURED / path)
    return Case(name, spectrum.frequency_hz, spectrum.admittance_s, arms)


def cases() -> list[Case]:
    """Return the synthetic spectra, and the measured ones if they are available."""
    found = [*(synthetic(arms) for arms in (1, 2, 3, 5)), synthetic(2, 1601)]
    if MEASURED.is_dir():
        found += [
            measured("E4990A, thickness mode", "e4990a_thickness_mode/MODULOFASEMODOTHICKNES.CSV", 7),
            measured("E4990A, 8 arms", "e4990a_thickness_mode/MODULOFASEMODOTHICKNES.CSV", 8),
            *(measured(f"4294A, {arms} arms", "hp4294a_admittance/sampleadmittance.txt", arms) for arms in range(2, 8)),
            *(measured(f"NanoVNA, {arms} arms", "nanovna_polymer/T61.csv", arms) for arms in (1, 2, 3)),
        ]
    return found


def error_of(case: Case, y: np.ndarray) -> float:
    """Return the root mean square of the relative error."""
    return float(np.sqrt(np.mean(np.abs(y / case.admittance_s - 1.0) ** 2)))


def is_passive(case: Case, admittance: Callable[[np.ndarray], np.ndarray]) -> bool:
    """Return whether the conductance is never negative, from a hundredth to a hundred times the band."""
    wide = np.geomspace(0.01 * case.frequency_hz[0], 100.0 * case.frequency_hz[-1], 20_001)
    y = admittance(np.concatenate([wide, np.linspace(*case.frequency_hz[[0, -1]], 20_001)]))
    return bool(np.all(y.real >= -1e-12 * np.abs(y)))


def timed(work: Callable[[], object]) -> tuple[object, float]:
    """Return the result and the median wall time of several runs."""
    seconds = []
    while len(seconds) < REPEATS and sum(seconds) < 2.0:
        began = time.perf_counter()
        result = work()
        seconds.append(time.perf_counter() - began)
    return result, median(seconds)


@contextmanager
def limit(seconds: int) -> Iterator[None]:
    """Raise TimeoutError if the block takes longer."""

    def stop(*_: object) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def ours(case: Case) -> tuple[Outcome, SpectrumFit]:
    """Fit by this project."""
    spectrum = pr.Spectrum.from_admittance(case.frequency_hz, case.admittance_s)
    fit, seconds = timed(lambda: pr.fit_spectrum(spectrum, case.arms))
    assert isinstance(fit, SpectrumFit)
    return Outcome(error_of(case, fit.admittance(case.frequency_hz)), seconds, is_passive(case, fit.admittance)), fit


def vector_fit(case: Case) -> tuple[Outcome, Outcome | None]:
    """Fit by scikit-rf, in S and in Y; return the best, and the best that is passive."""
    z0 = 1.0 / float(np.median(np.abs(case.admittance_s)))
    network = skrf.Network(
        frequency=skrf.Frequency.from_f(case.frequency_hz, unit="hz"),
        s=((1 - z0 * case.admittance_s) / (1 + z0 * case.admittance_s))[:, None, None],
        z0=z0,
    )

    def work(kind: str) -> VectorFitting:
        fitting = VectorFitting(network)
        fitting.vector_fit(
            n_poles_real=int(kind == "s"), n_poles_cmplx=case.arms, parameter_type=kind, fit_constant=True,
            fit_proportional=kind == "y", enforce_dc=False,
        )  # fmt: skip
        return fitting

    found = []
    for kind in ("s", "y"):
        fitting, seconds = timed(lambda kind=kind: work(kind))  # type: ignore[misc]

        def admittance(frequency: np.ndarray, kind: str = kind, fitting: VectorFitting = fitting) -> np.ndarray:
            response = fitting.get_model_response(0, 0, frequency)
            return (1 - response) / (1 + response) / z0 if kind == "s" else response

        found.append(Outcome(error_of(case, admittance(case.frequency_hz)), seconds, is_passive(case, admittance)))
        if kind == "s" and not found[-1].passive:
            fitting.passivity_enforce(n_samples=2000)
            error = error_of(case, admittance(case.frequency_hz))
            found.append(Outcome(error, seconds, is_passive(case, admittance)))
    passive = [outcome for outcome in found if outcome.passive]
    return min(found, key=ERROR), min(passive, key=ERROR, default=None)


def passive_limit(case: Case) -> float:
    """Return the least error of all causal and passive admittances with no feature narrower than two points."""
    w = case.frequency_hz[::2] / sqrt(case.frequency_hz[0] * case.frequency_hz[-1])
    y = case.admittance_s[::2] / float(np.median(np.abs(case.admittance_s)))
    below, above = (np.geomspace(*ends, 80) for ends in ((1e-4 * w[0], w[0]), (w[-1], 1e4 * w[-1])))
    between = np.interp(np.linspace(0, len(w) - 1, len(w) + 1), np.arange(len(w)), w)
    nodes = np.concatenate([below[:-1], between, above[1:]])
    # B(w) = 2w/pi PV integral of G(v)/(v^2 - w^2), with the integrals of 1 and v over each piece in closed form
    lower, upper = np.log(np.abs(nodes - w[:, None]) + 1e-15), np.log(nodes + w[:, None])
    of_one = np.diff(lower - upper, axis=1) / (2.0 * w[:, None])
    of_v = np.diff(lower + upper, axis=1) / 2.0
    rising, falling = of_v - nodes[:-1] * of_one, nodes[1:] * of_one - of_v
    susceptance = np.zeros((len(w), len(nodes)))
    susceptance[:, 1:] += rising / np.diff(nodes)
    susceptance[:, :-1] += falling / np.diff(nodes)
    conductance = np.array([np.interp(w, nodes, unit) for unit in np.eye(len(nodes))]).T
    parts = [conductance + 2j / pi * w[:, None] * susceptance, 1j * w[:, None], 1.0 / (1j * w[:, None])]
    system = np.hstack(parts) / y[:, None]
    stacked = np.vstack([system.real, system.imag])
    scale = np.linalg.norm(stacked, axis=0)
    _, distance = nnls(stacked / scale, np.append(np.ones(len(w)), np.zeros(len(w))), maxiter=20_000)
    return float(distance) / sqrt(len(w))


def circuit_fit(case: Case, by_hand: SpectrumFit | None) -> Outcome:
    """Fit by impedance.py: from neutral initial values, or from ones set by hand."""
    arms = [f"R{k}-L{k}-C{k}" for k in range(2, case.arms + 2)]
    omega = 2 * pi * sqrt(case.frequency_hz[0] * case.frequency_hz[-1])
    ohm = 1.0 / float(np.median(np.abs(case.admittance_s)))
    units = {"R": ohm, "L": ohm / omega, "C": 1.0 / (ohm * omega)}
    names = ["R0", "L0", "R1", "C1", *"-".join(arms).split("-")]
    guess = neutral(case) if by_hand is None else near(by_hand.circuit)
    guess = [value / units[name[0]] for name, value in zip(names, guess, strict=True)]
    circuit = CustomCircuit(f"R0-L0-p(R1-C1,{','.join(arms)})", initial_guess=guess)
    frequency, z = case.frequency_hz / omega, 1.0 / (case.admittance_s * ohm)
    try:
        with limit(SECONDS):
            fitted, seconds = timed(lambda: circuit.fit(frequency, z, weight_by_modulus=True, maxfev=STEPS))
    except (RuntimeError, ValueError, TimeoutError):  # impedance.py raises the first two
        return Outcome(inf, inf, True)
    assert isinstance(fitted, CustomCircuit)
    # element values are bounded by zero: passive by construction
    return Outcome(error_of(case, 1.0 / (ohm * fitted.predict(frequency))), seconds, True)


def neutral(case: Case) -> list[float]:
    """Return initial values from the scale of the data only."""
    omega = 2 * pi * sqrt(case.frequency_hz[0] * case.frequency_hz[-1])
    z = 1.0 / float(np.median(np.abs(case.admittance_s)))
    values = [0.01 * z, 0.001 * z / omega, 0.01 * z, 1.0 / (omega * z)]
    for f in np.geomspace(*case.frequency_hz[[0, -1]], case.arms + 2)[1:-1]:
        capacitance = 0.02 * values[3]
        values += [1.0 / (2 * pi * f * capacitance * 50.0), 1.0 / ((2 * pi * f) ** 2 * capacitance), capacitance]
    return values


def near(circuit: EquivalentCircuit) -> list[float]:
    """Return initial values as read from the curve: exact frequencies, all other values 20 % off."""
    omega = 2 * pi * circuit.loss_reference_hz
    clamped = 0.8 * circuit.clamped_capacitance_f
    values = [
        1.2 * circuit.lead_resistance_ohm + 1e-3,
        1.2 * circuit.lead_inductance_h + 1e-9,
        0.01 / (omega * clamped),
    ]
    values.append(clamped)
    for arm in circuit.arms:
        values += [1.2 * arm.resistance_ohm, 1.2 * arm.inductance_h, arm.capacitance_f / 1.2]
    return values


def shown(outcome: Outcome | None) -> str:
    """Return error, time and passivity as a cell."""
    if outcome is None:
        return f"{'not installed':>30}"
    if outcome.error == inf:
        return f"{'did not converge' if outcome.seconds == inf else 'none':>30}"
    passive = "passive" if outcome.passive else "ACTIVE"
    return f"{100 * outcome.error:8.3g} %  {1e3 * outcome.seconds:7.1f} ms  {passive:>7}"


def main() -> None:
    """Fit every spectrum with every tool, and print a line for each."""
    heads = ("fit_spectrum", "scikit-rf vector fitting", "the same, passive", "impedance.py, neutral start")
    heads = (*heads, "impedance.py, set by hand")
    print(f"{'':24}{'arms':>5}" + "".join(f"{head:>31}" for head in heads))
    worse, active, slower = [], [], []
    for case in cases():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # both others warn of overflows during the fit
            mine, fit = ours(case)
            by_vectors, passive = vector_fit(case)
            others = [by_vectors]
            if CustomCircuit is not None:
                others += [circuit_fit(case, None), circuit_fit(case, fit)]
        best_passive = passive or Outcome(inf, 0.0, True)
        cells = [mine, by_vectors, best_passive, *others[1:], *[None] * (3 - len(others))]
        print(f"{case.name:24}{case.arms:5}" + " ".join(["", *map(shown, cells)]), flush=True)
        automatic = [outcome for outcome in others[:2] if outcome.error < WORTH * min(o.error for o in (mine, *others))]
        if mine.error > 1.001 * min(outcome.error for outcome in (best_passive, *others) if outcome.passive):
            worse.append(case.name)
        if not mine.passive:
            active.append(case.name)
        if automatic and mine.seconds > 2.0 * min(outcome.seconds for outcome in automatic):
            slower.append(case.name)
    for case in cases()[-1:] if MEASURED.is_dir() else ():
        print(f"least error of any passive admittance, the polymer: {100.0 * passive_limit(case):.3g} %")
    print("error above that of another passive fit:", ", ".join(worse) or "nowhere")
    print("not passive:", ", ".join(active) or "nowhere")
    print(
        "more than twice as slow as the faster of those that converged by themselves:", ", ".join(slower) or "nowhere"
    )


if __name__ == "__main__":
    main()
