# SPDX-License-Identifier: GPL-3.0-or-later
"""The stator's electrical two-port, from ngspice's AC analysis, and the equivalent circuit of each mode.

:mod:`.spectrum` defines the admittance matrix and the connections of the groups. In the preloaded state the contact is
linearised at its operating point, where the tip sticks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from math import exp, inf, pi, sqrt
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.circuit.bench import Bench
from pyspice_runner.circuit.motor import ALL
from pyspice_runner.errors import ParameterError, SimulationError, require
from pyspice_runner.impedance.spectrum import COUPLING, Connection, State, band_of, columns_of, connect
from pyspice_runner.motor import contact as contact_law
from pyspice_runner.motor.equivalent import EquivalentCircuit, MotionalArm
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.numerics import one_thread_of_scipy
from pyspice_runner.motor.parameters import Mode
from pyspice_runner.motor.refusal import checked
from pyspice_runner.motor.stator import square
from pyspice_runner.result import Audit, Result
from pyspice_runner.run.audit import audit_two_port
from pyspice_runner.run.kernel import Outcome, run_bench
from pyspice_runner.run.two_port import Swept, sweep_two_port, two_port, two_port_bench
from pyspice_runner.units import engineering

_ZOOM_POINTS = 1201  # over the zoom below: 100 points a bandwidth, so that a parabola finds an extremum to 1e-6
_SAME = 0.01  # of a bandwidth, within which two modes cannot be told apart
_ZOOM_BANDWIDTHS = 6.0  # on each side of a resonance
_LOWEST_SHARE, _LARGEST_LOGARITHM = 1e-3, 50.0  # of a frequency to its start, and of a quality factor
_TAILS = 1.0  # of the zoom: modes nearer than that have an arm of their own; the tails of others are a cubic
_MOST_POINTS = 1_000_000

_Sweep = Callable[[float, float, int], Outcome]  # first and last frequency, number of points


@dataclass(frozen=True)
class Resonance:
    """One mode seen through one connection of the groups."""

    mode: str  # name of the mode
    fs: float  # frequency of maximum conductance, Hz
    fp: float  # frequency of maximum resistance, Hz
    fm: float | None  # frequency of maximum |Y|, Hz; ``None`` if the clamped capacitance masks it
    fn: float | None  # frequency of minimum |Y|, Hz; ``None`` likewise
    coupling_factor: float  # k_eff = √(1 − (fs/fp)²)
    quality_factor: float  # Qm = √(L/C)/R of the motional arm
    resistance_ohm: float  # motional resistance R
    inductance_h: float  # motional inductance L
    capacitance_f: float  # motional capacitance C


@dataclass(frozen=True, repr=False)
class Admittance(Result):
    """The two-port over frequency.

    Attributes:
        frequency_hz: frequencies, shape (points,).
        matrix_s: admittance matrix in S, shape (points, 2, 2); [.., 0, 1] is the current into A per volt on B.
        state: ``"free"`` or ``"preloaded"``.
        normal_force_n: normal force at ngspice's operating point; 0 when free.
        resonances: connection → its resonances by rising frequency, without modes that the connection does not drive or
            that neighbours mask.
        ngspice_version: version of ngspice.
        motor: the motor, JSON-ready.
        audit: outcome of the physical audit; it has findings only with ``audit=False``.
        deck: netlist of the sweep.
        unknown: one sentence for each mode whose recoil on the carrier is not known and may shift it, and for a band
            beyond the range of the solid.
    """

    frequency_hz: NDArray[np.float64]
    matrix_s: NDArray[np.complex128]
    state: State
    normal_force_n: float
    resonances: dict[str, tuple[Resonance, ...]]
    ngspice_version: str
    motor: dict[str, Any] = field(repr=False)
    audit: Audit = field(default_factory=Audit)
    deck: str | None = field(default=None, repr=False)
    unknown: tuple[str, ...] = ()

    def _limits(self) -> Iterable[str]:
        """Return what is not known of the motor."""
        return self.unknown

    def driven(self, connection: Connection = "A") -> NDArray[np.complex128]:
        """Return the admittance in S seen when the groups are connected as ``A``, ``B``, ``A+B`` or ``A-B``."""
        return connect(self.matrix_s, connection)

    def to_dict(self) -> dict[str, Any]:
        """Return state, operating point and resonances, JSON-ready."""
        return {
            **self._entries("motor", "state"),
            **band_of(self.frequency_hz),
            "operating_point_normal_force_n": self.normal_force_n,
            **self._entries("resonances", "ngspice_version", "audit", "cautions"),
        }

    def columns(self) -> dict[str, NDArray[np.float64]]:
        """Return the frequency and the real and imaginary parts of the matrix, as in the CSV."""
        return columns_of(self.frequency_hz, self.matrix_s)

    def summary(self) -> dict[str, str]:
        """Return motor, state, band, and the equivalent circuit of each mode for each connection."""
        low, high = (engineering(float(self.frequency_hz[place]), "Hz") for place in (0, -1))
        device = "motor" if "contact" in self.motor else "transducer"
        found = {device: str(self.motor["name"]), "state": self.state, "band": f"{low} to {high}"}
        for connection, resonances in self.resonances.items():
            for item in resonances:
                arm = ((item.resistance_ohm, "Ω"), (item.inductance_h, "H"), (item.capacitance_f, "F"))
                values = [engineering(*value) for value in ((item.fs, "Hz"), (item.fp, "Hz"), *arm)]
                factors = f"k_eff {item.coupling_factor:.3g}, Qm {item.quality_factor:.4g}"
                found[f"{item.mode}, driven as {connection}"] = f"fs, fp, R, L, C {', '.join(values)}, {factors}"
        return found


BAND_HZ = 5e3, 100e3  # of an admittance by default


@checked
@one_thread_of_scipy()
def admittance(
    motor: Motor,
    *,
    start: float | None = None,
    stop: float | None = None,
    points: int = 2000,
    state: State = "free",
    timeout: float | None = None,
    audit: bool = True,
) -> Admittance:
    """Compute the two-port admittance by ngspice's AC analysis, and the equivalent circuit of every mode in range.

    It has the modes of the motor, as runs and exported files do; ``solid.highest_hz`` widens the range of a solid.

    Args:
        motor: the motor.
        start: first frequency in Hz; by default that of the motor's solid, else 5 kHz.
        stop: last frequency in Hz; by default that of the motor's solid, else 100 kHz.
        points: number of frequencies, evenly spaced.
        state: ``"free"`` tip, or ``"preloaded"`` on the rotor; a transducer without its load, or under it.
        timeout: wall-time limit in s of each ngspice run.
        audit: whether an admittance that is not passive is an error. If not, ``audit`` of the result has the findings.

    Raises:
        ParameterError: for an invalid value.
        SimulationError: if ngspice fails, or the operating point is not the preload.
    """
    low, high = (motor.solid.lowest_hz, motor.solid.highest_hz) if motor.solid else BAND_HZ
    start, stop = low if start is None else start, high if stop is None else stop
    if not 0.0 < start < stop <= 1e9:
        raise ParameterError(
            f"start = {start:g} Hz and stop = {stop:g} Hz are not valid: give 0 Hz < start < stop ≤ 1e9 Hz."
        )
    # of two points, ngspice returns only the first
    require(3 <= points <= _MOST_POINTS, "points", points, f"a whole number from 3 to {_MOST_POINTS}")
    preloaded = state == "preloaded"
    bench = two_port_bench(motor, preloaded=preloaded)
    normal_force = _operating_force(motor, bench, timeout) if preloaded and not motor.is_transducer else 0.0
    sweep = partial(sweep_two_port, bench, timeout)
    outcome = sweep(start, stop, points)
    frequency, matrix = two_port(outcome)
    audited = Audit(audit_two_port(frequency, matrix))
    if audit:
        audited.withhold("result")
    near = [
        (mode, _zoom(sweep, mode.frequency_hz, mode))
        for mode in _expected(motor, preloaded)
        if start < mode.frequency_hz < stop
    ]
    resonances = {
        connection: _resonances(sweep, motor, [pair for pair in near if _drives(connection, pair[0])], connection)
        for connection in get_args(Connection)[: 4 if len(motor.groups) == 2 else 1]
    }
    version, deck = outcome.ngspice_version, outcome.deck
    document, unknown = motor.to_dict(), (*motor.cautions, *_beyond_solid(motor, start, stop))
    return Admittance(frequency, matrix, state, normal_force, resonances, version, document, audited, deck, unknown)


def _beyond_solid(motor: Motor, start: float, stop: float) -> tuple[str, ...]:
    """Return a caution where the band reaches beyond the modes that a motor has of its solid."""
    solid = motor.solid
    if solid is None or (solid.lowest_hz <= start and stop <= solid.highest_hz):
        return ()
    low, high = (engineering(limit, "Hz") for limit in (solid.lowest_hz, solid.highest_hz))
    missing = f"The motor has the modes of its solid from {low} to {high}: resonances outside are missing."
    return (f"{missing} Widen solid.lowest_hz and solid.highest_hz to include them.",)


def _drives(connection: Connection, mode: Mode) -> bool:
    """Whether a connection of the groups drives a mode; forces that cancel within round-off do not."""
    shares = np.array(COUPLING[connection]) * mode.couplings  # of one group the second is 0
    return bool(abs(shares.sum()) > 1e-9 * np.abs(shares).sum())


def _operating_force(motor: Motor, bench: Bench, timeout: float | None) -> float:
    """Return the normal force at ngspice's operating point, checked to be the preload."""
    node = f"v(xmotor1.normal{ALL if motor.contacts else ''})"
    found = run_bench(bench, [node], timeout, "operating_point", {}).last()[node]
    preload = motor.contact.preload_n
    if abs(found - preload) > 1e-6 * preload:
        raise SimulationError(
            f"ngspice's operating point has a normal force of {found:.6g} N instead of the preload of {preload:.6g} N; "
            "the contact cannot be linearised there."
        )
    return found


def _expected(motor: Motor, preloaded: bool) -> Sequence[Mode]:
    """Return every mode, under preload with the stiffness that gives the resonance expected there."""
    from scipy.optimize import linear_sum_assignment  # takes long to load

    modes = motor.on_carrier().modes
    if motor.is_transducer and preloaded:
        stator = motor.loaded_stator
        names = ("mass_kg", "damping_n_s_per_m", "stiffness_n_per_m")
        loaded = np.transpose([np.diag(square(one)) for one in (stator.mass, stator.damping, stator.stiffness)])
        return [
            mode.model_copy(update=dict(zip(names, values, strict=True)))
            for mode, values in zip(modes, loaded.tolist(), strict=True)
        ]
    if not preloaded:
        return modes
    # the rotor and the carrier on the contact's springs have resonances too, which are not modes of the stator
    frequencies = motor.pressed_stator.resonances()
    springs = [
        stiffness(one.contact) if one.share else 0.0
        for one in motor.touching
        for stiffness in (contact_law.tangential_stiffness_at_preload, contact_law.normal_stiffness_at_preload)
    ]
    moved = motor.on_carrier().stator.contact
    alone = [  # under preload, without the other modes
        sqrt((mode.stiffness_n_per_m + float(springs @ along**2)) / mode.mass_kg) / (2.0 * pi)
        for mode, along in zip(modes, moved.T, strict=True)
    ]
    places = linear_sum_assignment(np.abs(np.subtract.outer(alone, frequencies)))[1]
    return [
        mode.model_copy(update={"stiffness_n_per_m": mode.mass_kg * (2.0 * pi * frequency) ** 2})
        for mode, frequency in zip(modes, frequencies[places].tolist(), strict=True)
    ]


def _bandwidth(mode: Mode) -> float:
    """Return the bandwidth of a mode in Hz."""
    return mode.damping_n_s_per_m / mode.mass_kg / (2.0 * pi)


def _resonances(
    sweep: _Sweep, motor: Motor, near: Sequence[tuple[Mode, Swept]], connection: Connection
) -> tuple[Resonance, ...]:
    """Return characteristic frequencies and motional arms of the modes that a connection drives; sweep antiresonances.

    A mode that its neighbours mask, so that it has no maximum of its own or no arm of positive resistance fits, is left
    out.
    """
    found, near = [], _distinct(near)
    for item, (frequency, matrix) in near:
        y = connect(matrix, connection)
        fs = _local_peak(frequency, y.real, item.frequency_hz)
        others = [other for other, _ in near if other is not item]
        away = min((abs(fs - other.frequency_hz) for other in others), default=inf) if fs is not None else 0.0
        if fs is None or abs(fs - item.frequency_hz) > away:  # it is the maximum of another mode
            continue
        arm = _motional_arm(frequency, y, fs, _bandwidth(item), others)
        if arm.resistance_ohm > 0.0:
            found.append((item, frequency, y, fs, arm))
    if not found:
        return ()
    found.sort(key=lambda each: each[3])
    weights = np.array(COUPLING[connection][: len(motor.groups)])
    clamped = float(weights @ np.array(motor.piezo.matrix) @ weights)
    circuit = EquivalentCircuit(tuple(each[4] for each in found), clamped, 0.0, found[0][3])
    resonances = []
    for (item, frequency, y, fs, arm), pole in zip(found, circuit.antiresonances(), strict=True):
        expected = abs(pole) / (2.0 * pi)
        frequency_anti, matrix = _zoom(sweep, expected, item)
        y_anti = connect(matrix, connection)
        fp = _local_peak(frequency_anti, (1.0 / y_anti).real, expected)
        if fp is not None and fp > fs:
            resonances.append(
                Resonance(
                    mode=item.name,
                    fs=fs,
                    fp=fp,
                    fm=_local_peak(frequency, np.abs(y), fs),
                    fn=_local_peak(frequency_anti, -np.abs(y_anti), fp),
                    coupling_factor=sqrt(1.0 - (fs / fp) ** 2),
                    quality_factor=arm.quality_factor,
                    **asdict(arm),
                )
            )
    return tuple(resonances)


def _distinct(near: Sequence[tuple[Mode, Swept]]) -> list[tuple[Mode, Swept]]:
    """Return the modes with one in place of those at the same frequency, such as the two of a ring: they have one peak.

    Its name is those of all.
    """
    found: list[tuple[Mode, Swept]] = []
    for mode, swept in near:
        if found and abs(found[-1][0].frequency_hz - mode.frequency_hz) < _SAME * _bandwidth(mode):
            before = found[-1][0]
            found[-1] = before.model_copy(update={"name": f"{before.name} and {mode.name}"}), found[-1][1]
        else:
            found.append((mode, swept))
    return found


def _zoom(sweep: _Sweep, centre: float, mode: Mode) -> Swept:
    """Return frequencies (Hz) within some bandwidths of a mode about a centre, and the admittance matrices there."""
    reach = _ZOOM_BANDWIDTHS * _bandwidth(mode)
    return two_port(sweep(max(centre - reach, 0.5 * centre), centre + reach, _ZOOM_POINTS))


def _local_peak(frequency: NDArray[np.float64], values: NDArray[np.float64], expected: float) -> float | None:
    """Return the local maximum nearest to a frequency, refined by a parabola; ``None`` without a maximum."""
    inner = slice(1, -1)
    peaks = np.flatnonzero((values[inner] > values[:-2]) & (values[inner] >= values[2:])) + 1
    if not len(peaks):
        return None
    index = int(peaks[np.argmin(np.abs(frequency[peaks] - expected))])
    left, middle, right = values[index - 1 : index + 2]
    shift = 0.5 * (left - right) / (left - 2.0 * middle + right)
    return float(frequency[index] + shift * (frequency[index] - frequency[index - 1]))


def _motional_arm(
    frequency: NDArray[np.float64],
    y: NDArray[np.complex128],
    fs: float,
    bandwidth: float,
    others: Sequence[Mode],
) -> MotionalArm:
    """Fit one arm, those of its neighbours, and a smooth background, which enters linearly."""
    from scipy.optimize import least_squares  # takes long to load

    near = np.exp(-0.5 * ((frequency - fs) / (2.0 * bandwidth)) ** 2)
    # the background has complex coefficients; the part outside the span of its columns is the residual
    background, _ = np.linalg.qr(np.vander(frequency / fs - 1.0, 4) * near[:, None])
    reach = _TAILS * (frequency[-1] - frequency[0])
    seen = [other for other in others if abs(other.frequency_hz - fs) < reach]
    centres = np.array([fs, *(other.frequency_hz for other in seen)])
    widths = np.array([bandwidth, *map(_bandwidth, seen)])

    def outside(values: NDArray[np.complex128]) -> NDArray[np.complex128]:
        return values - background @ (background.T @ values)

    def parts(values: NDArray[np.complex128]) -> NDArray[np.float64]:
        return np.concatenate([values.real, values.imag])

    target = parts(outside(y * near))

    def split(parameters: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        shifts, logarithms = parameters.reshape(2, -1)
        # only a fit that diverges reaches these limits
        ratio = frequency[:, None] / (centres * np.maximum(1.0 + shifts, _LOWEST_SHARE))
        sharpness = np.exp(np.clip(logarithms, -_LARGEST_LOGARITHM, _LARGEST_LOGARITHM))
        columns = near[:, None] / (1.0 + 1j * sharpness * (ratio - 1.0 / ratio))
        arms = parts(outside(columns))
        conductances = np.asarray(np.linalg.lstsq(arms, target, rcond=None)[0], dtype=np.float64)
        return conductances, target - arms @ conductances

    def residual(parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        return split(parameters)[1] / float(np.abs(y).max())

    start = np.concatenate([np.zeros(len(centres)), np.log(centres / widths)])
    scale = np.concatenate([widths / centres, np.ones(len(centres))])
    found = least_squares(residual, start, x_scale=scale, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    shift, logarithm = found.x.reshape(2, -1)[:, 0].tolist()
    omega, quality = 2.0 * pi * fs * (1.0 + shift), exp(logarithm)
    resistance = 1.0 / float(split(found.x)[0][0])
    return MotionalArm(resistance, quality * resistance / omega, 1.0 / (omega * quality * resistance))
