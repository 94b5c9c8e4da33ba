# SPDX-License-Identifier: GPL-3.0-or-later
"""Fast start and stop of a burst: a higher voltage at first, a resistor across each group at the end.

A mode with its groups is a transducer: the motional arm Rs, Ls, Cs beside the clamped capacitance C₀. Behind a voltage
source its amplitude rises as 1 − exp(−t/τ) with τ = 2 Ls/Rs. A voltage B times as high reaches the same amplitude after
τ ln(B/(B − 1)). After the stop a short circuit leaves τ. A resistor R across C₀ takes power from the arm: its real part
R/(1 + (ω R C₀)²) adds to Rs, and is largest at R = 1/(ω C₀), if C₀ is large against Cs (N. W. Hagood, A. von Flotow, J.
Sound Vib. 146, 1991). In general the decay is that of the complex roots of

    (Ls s² + Rs s + 1/Cs) (1/R + s C₀) + s = 0.

Contact and rotor change this: the times of the running motor are those of two runs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import log, log10, sqrt
from typing import Any

import numpy as np

from pyspice_runner.circuit.law import ContactLaw
from pyspice_runner.circuit.source import GROUPS
from pyspice_runner.drivers.burst_source import BurstSource
from pyspice_runner.errors import ParameterError
from pyspice_runner.motor.drive import TwoPhaseDrive
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.refusal import checked
from pyspice_runner.result import Result, contact_row
from pyspice_runner.run.point import Point
from pyspice_runner.run.window import Array
from pyspice_runner.units import engineering

RISEN, FALLEN = 0.9, 0.1  # of the amplitude at the end of the plain burst
# decay times for which a burst lasts, and for which it is followed afterwards: exp(−6) is 0.25 %, and 2 % of the rise
_ON, _OFF = 6.0, 3.0
_LAST = 5  # periods at the end of a burst, whose mean is its amplitude
_LONGEST = 0.05  # s, of a run
_DECADES = 3.0  # around 1/(ω C₀), in which the best resistor is sought


@dataclass(frozen=True)
class Transducer:
    """A motional arm with the clamped capacitance beside it."""

    resistance_ohm: float
    inductance_h: float
    capacitance_f: float
    clamped_capacitance_f: float

    @property
    def omega(self) -> float:
        """Angular frequency of the series resonance, rad/s."""
        return 1.0 / sqrt(self.inductance_h * self.capacitance_f)

    @property
    def decay_s(self) -> float:
        """Decay time of the amplitude with the pins at a voltage source or shorted, s."""
        return 2.0 * self.inductance_h / self.resistance_ohm

    def decay_with(self, resistor_ohm: float) -> float:
        """Return the decay time of the oscillation in s with a resistor across the pins."""
        arm = [self.inductance_h, self.resistance_ohm, 1.0 / self.capacitance_f]
        polynomial = np.polyadd(np.polymul(arm, [self.clamped_capacitance_f, 1.0 / resistor_ohm]), [1.0, 0.0])
        roots = np.roots(polynomial)
        return float(-1.0 / roots[np.abs(roots.imag) > 0.0].real.max())  # the real root is the charge of C₀

    def best_resistor(self) -> float:
        """Return the resistor in Ω with the shortest decay."""
        from scipy.optimize import minimize_scalar

        middle = log10(1.0 / (self.omega * self.clamped_capacitance_f))
        found = minimize_scalar(
            lambda decades: self.decay_with(10.0**decades), bounds=(middle - _DECADES, middle + _DECADES),
            method="bounded", options={"xatol": 1e-6},
        )  # fmt: skip
        return float(10.0**found.x)


def boost_time(decay_s: float, boost: float) -> float:
    """Return the time in s after which a voltage higher by a factor has reached the amplitude of the plain one."""
    return decay_s * log(boost / (boost - 1.0))


def transducer_of(motor: Motor, drive: TwoPhaseDrive) -> Transducer:
    """Return the transducer of the mode nearest to the frequency, by both groups in parallel.

    The clamped capacitance is that of one group, weighted by the coupling: each group has a resistor of its own.
    """
    mode = min(motor.modes, key=lambda mode: abs(mode.frequency_hz - drive.frequency))
    squares = {group: getattr(mode, f"coupling_{group}_n_per_v") ** 2 for group in GROUPS}
    total = sum(squares.values())
    if not total:
        raise ParameterError(f"Mode {mode.name} has no coupling, and cannot be started or stopped by the groups.")
    clamped = sum(squares[group] * getattr(motor.piezo, f"capacitance_{group}_f") for group in GROUPS) / total
    return Transducer(mode.damping_n_s_per_m / total, mode.mass_kg / total, total / mode.stiffness_n_per_m, clamped)


@dataclass(frozen=True, repr=False)
class BurstReport(Result):
    """A plain burst, and one with a boost at the start and a resistor at the stop, of the running motor.

    Attributes:
        motor: the motor, JSON-ready.
        run: settings of the runs, JSON-ready.
        transducer: Rs, Ls, Cs and C₀ of the mode nearest to the drive, with ``decay_s``, the best resistor, the decay
            with it, and the time of the boost, in closed form for the free stator.
        boost: factor of the voltages at the start.
        boost_s: how long the boost lasts: by the decay time that the plain burst of the running motor shows.
        resistors_ohm: across groups A and B after the stop.
        plain: ``rise_s`` to 90 %, ``fall_s`` to 10 % and ``greatest`` amplitude over that at the end of the burst.
        fast: the same with boost and resistors.
        curves: time and amplitudes of the tip, means over periods.
        deck: netlist of the fast burst.
    """

    motor: dict[str, Any]
    run: dict[str, Any]
    transducer: dict[str, float]
    boost: float
    boost_s: float
    resistors_ohm: tuple[float, float]
    plain: dict[str, float | None]
    fast: dict[str, float | None]
    curves: dict[str, Array] = field(repr=False)
    deck: str = field(repr=False)

    @property
    def linear(self) -> bool:
        """Whether the motor has a slider."""
        return "slider" in self.motor

    @property
    def cautions(self) -> tuple[str, ...]:
        """Bursts that did not rise or fall within their run."""
        missing = [
            f"{name}: {what.removesuffix('_s')}"
            for name, times in (("plain burst", self.plain), ("fast burst", self.fast))
            for what, value in times.items()
            if value is None
        ]
        return self._told([f"Not reached within the run: {', '.join(missing)}."] if missing else [])

    def to_dict(self) -> dict[str, Any]:
        """Return the report without its curves, JSON-ready."""
        names = ("motor", "run", "transducer", "boost", "boost_s", "resistors_ohm", "plain", "fast", "cautions")
        return self._keyed(self._entries(*names))

    def columns(self) -> Mapping[str, Array]:
        """Return the amplitudes of the tip over time."""
        return self.curves

    def summary(self) -> dict[str, str]:
        """Return the times before and after, and the switch times in closed form."""
        free = self.transducer
        found = {
            "motor": str(self.motor["name"]),
            **contact_row(self.run),
            "free stator, decay time": engineering(free["decay_s"], "s"),
            "free stator, best resistor": engineering(free["best_resistor_ohm"], "Ω"),
            "free stator, decay with it": engineering(free["decay_with_resistor_s"], "s"),
            "free stator, time of the boost": engineering(free["boost_s"], "s"),
            "boost": f"{self.boost:g} times the voltage for {engineering(self.boost_s, 's')}",
        }
        for what, name in (("rise", "rise_s"), ("fall", "fall_s")):
            times = [self.plain[name], self.fast[name]]
            told = [engineering(value, "s") if value is not None else "not reached" for value in times]
            found[f"{what}, running motor"] = f"{told[0]} before, {told[1]} after"
        found["greatest amplitude"] = f"{100.0 * (self.fast['greatest'] or 0.0):.3g} % of that of the plain burst"
        return self._worded(found)


@checked
def fast_burst(
    motor: Motor,
    drive: TwoPhaseDrive,
    *,
    boost: float = 2.0,
    speed: float | None = 0.0,
    contact: ContactLaw | None = "spring-slider",
    timeout: float | None = None,
) -> BurstReport:
    """Compare a plain burst of a running motor with one that starts and stops fast.

    The plain burst starts at full voltage and ends in a short circuit. Its rise tells the decay time of the running
    motor, from which the time of the boost follows; the resistors are the best ones of the free stator.

    Args:
        motor: the motor.
        drive: the two phases of the burst.
        boost: factor of the voltages at the start, from 1.05 to 10; the drive and the ceramic must bear it.
        speed: at which the shaft is held, rad/s; ``None`` leaves it free.
        contact: law of the contact; ``None`` for a free tip.
        timeout: wall time in s after which a run is ended.

    Raises:
        ParameterError: for an invalid value.
        SimulationError: if ngspice fails or its result cannot be trusted.
    """
    if not 1.05 <= boost <= 10.0:
        raise ParameterError(f"boost = {boost:g} is not valid: it must be from 1.05 to 10.")
    free = transducer_of(motor, drive)
    resistor = free.best_resistor()
    stops = _ON * free.decay_s
    lasts = stops + _OFF * free.decay_s
    if lasts > _LONGEST:
        raise ParameterError(
            f"A burst of {motor.name} would take {lasts:.3g} s, since its mode decays in {free.decay_s:.3g} s; at most "
            f"{_LONGEST:g} s are simulated."
        )
    scaled = [
        resistor * free.clamped_capacitance_f / getattr(motor.piezo, f"capacitance_{group}_f") for group in GROUPS
    ]
    setup = Point.of(motor, drive, speed=speed, contact=contact, timeout=timeout)

    def run(source: BurstSource) -> tuple[Array, Array, str]:
        point = Point.of(motor, source, speed=speed, contact=contact, timeout=timeout)
        outcome = point.run(lasts, ["v(xmotor.x)", "v(xmotor.y)"])
        return *_amplitudes(outcome.vectors(), source.period), outcome.deck

    time, plain, _ = run(BurstSource(drive, stops))
    before = _times(time, plain, stops, _plateau(time, plain, stops, drive.period))
    risen = before["rise_s"] or stops
    lasts_boost = min(boost_time(risen / log(1.0 / (1.0 - RISEN)), boost), stops)
    resistors = (scaled[0], scaled[1])
    _, fast, deck = run(BurstSource(drive, stops, boost, lasts_boost, resistors))
    after = _times(time, fast, stops, _plateau(time, plain, stops, drive.period))
    arm = {
        "resistance_ohm": free.resistance_ohm, "inductance_h": free.inductance_h, "capacitance_f": free.capacitance_f,
        "clamped_capacitance_f": free.clamped_capacitance_f, "decay_s": free.decay_s, "best_resistor_ohm": resistor,
        "decay_with_resistor_s": free.decay_with(resistor), "boost_s": boost_time(free.decay_s, boost),
    }  # fmt: skip
    curves = {"time_s": time, "plain_amplitude_m": plain, "fast_amplitude_m": fast}
    settings = {**setup.to_dict(), "drive": drive.label, "stops_s": stops, "duration_s": lasts}
    return BurstReport(motor.to_dict(), settings, arm, boost, lasts_boost, resistors, before, after, curves, deck)


def _amplitudes(samples: Mapping[str, Array], period: float) -> tuple[Array, Array]:
    """Return times in s and amplitudes in m of the tip's motion, √2 of its RMS value in each period of the drive."""
    time = samples["time"]
    edges = np.arange(0.0, time[-1] - period, period)
    squares = np.zeros(len(edges))
    for name in ("v(xmotor.x)", "v(xmotor.y)"):
        values = 1e-6 * samples[name]
        for power, sign in ((2, 1.0), (1, -1.0)):
            steps = 0.5 * (values[1:] ** power + values[:-1] ** power) * np.diff(time)
            integral = np.concatenate([[0.0], np.cumsum(steps)])
            means = (np.interp(edges + period, time, integral) - np.interp(edges, time, integral)) / period
            squares += sign * means ** (3 - power)
    return edges + 0.5 * period, np.sqrt(2.0 * np.maximum(squares, 0.0))


def _plateau(time: Array, amplitudes: Array, stops: float, period: float) -> float:
    """Return the amplitude in m at the end of a burst."""
    within = (time < stops - period) & (time > stops - (_LAST + 1.0) * period)
    return float(amplitudes[within].mean())


def _times(time: Array, amplitudes: Array, stops: float, plateau: float) -> dict[str, float | None]:
    """Return the times of rise and fall, ``None`` where they are not reached, and the greatest amplitude."""
    share = amplitudes / plateau
    during = time < stops
    risen = np.flatnonzero((share >= RISEN) & during)
    above = np.flatnonzero(share > FALLEN)
    last = int(above[-1]) + 1 if above.size else len(time)
    return {
        "rise_s": _crossing(time, share, int(risen[0]), RISEN) if risen.size else None,
        "fall_s": _crossing(time, share, last, FALLEN) - stops if last < len(time) else None,
        "greatest": float(share[during].max()),
    }


def _crossing(time: Array, share: Array, after: int, level: float) -> float:
    """Return the time in s at which a share passes a level before a point."""
    if after == 0:
        return float(time[0])
    before, here = share[after - 1], share[after]
    return float(time[after - 1] + (level - before) / (here - before) * (time[after] - time[after - 1]))
