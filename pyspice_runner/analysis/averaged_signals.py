# SPDX-License-Identifier: GPL-3.0-or-later
"""Small signals of the averaged motor: ``.ac`` about the operating point that a transient has reached."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from math import ceil, log10, pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.analysis.averaged import doubts
from pyspice_runner.analysis.small_signals import OUTPUTS, Transfers, unit
from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.model.drive import Load, TwoPhaseDrive, check_together
from pyspice_runner.model.motor import Motor
from pyspice_runner.model.refusal import checked
from pyspice_runner.netlist.averaged import HARMONICS, MOST_PHASES, Course, averaged_bench, check_resolution
from pyspice_runner.run.kernel import ac, transient

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
HIGHEST = 0.1  # of the drive's frequency
SIGNAL_PHASES = 128  # as many as 3 % of the small transfer functions need
SETTLED = 0.5  # s, of the transient
# s of wall time, five times that of a large run which converges; where it does not, ngspice's last means may never end
LONGEST = 15.0
MOST_POINTS = 1000  # in a decade
LONGEST_STEPS = 50


@dataclass(frozen=True, repr=False)
class AveragedSignals(Transfers):
    """Transfer functions of the averaged motor; inputs, outputs and units are those of :func:`small_signals`.

    Attributes:
        modulation_hz: frequencies of the modulation, Hz.
        transfers: (output, input) → complex transfer function.
        speed_rad_s: speed at the operating point.
        doubts: what the check of the averaged model says.
        provenance: motor, drive and settings, JSON-ready.
        deck: the netlist of the last input.
    """

    modulation_hz: Array
    transfers: dict[tuple[str, str], Complex]
    speed_rad_s: float
    doubts: tuple[str, ...]
    provenance: dict[str, Any] = field(repr=False)
    deck: str = field(repr=False)

    @property
    def cautions(self) -> tuple[str, ...]:
        """What the check of the averaged model says."""
        return self.doubts

    def summary(self) -> dict[str, str]:
        """Return the transfer functions at the lowest frequency."""
        found = {"speed": f"{self.speed_rad_s:.4g} rad/s"}
        for (output, of), values in self.transfers.items():
            found[f"{output} per {of}"] = f"{abs(values[0]):.4g} {unit(output, of)}"
        return found

    def to_dict(self) -> dict[str, Any]:
        """Return frequencies and transfer functions, JSON-ready."""
        return {
            "speed_rad_s": self.speed_rad_s,
            "cautions": list(self.cautions),
            **{name: values.tolist() for name, values in self.columns().items()},
            **self.provenance,
        }


@checked
def averaged_signals(
    motor: Motor,
    drive: TwoPhaseDrive,
    *,
    start: float,
    stop: float,
    points: int = 10,
    speed: float | None = None,
    load_torque: float = 0.0,
    phases: int = SIGNAL_PHASES,
    timeout: float | None = None,
) -> AveragedSignals:
    """Return the transfer functions of the averaged motor from amplitude, phase, frequency and load.

    A transient of half a second settles the motor; from there ngspice finds the operating point. ``.ac`` has a form
    of contact and modes that follows modulations up to a tenth of the drive's frequency (docs/averaged.md).

    Args:
        motor: the motor.
        drive: the drive.
        start: lowest frequency of the modulation, Hz.
        stop: highest; up to a tenth of the drive's.
        points: number in a decade.
        speed: at which the shaft is held, rad/s; ``None`` leaves it free.
        load_torque: torque in N·m that a load draws from the free shaft.
        phases: number of phases at which the contact is evaluated; more are better where two effects almost cancel. If
            ngspice finds no operating point, half as many again are taken, twice at most.
        timeout: wall time in s after which a run of ngspice is ended.

    Raises:
        ParameterError: for an invalid value.
        SimulationError: if ngspice fails.
    """
    check_together(motor, drive)
    load = Load(speed, load_torque)
    load.check(motor)
    if not 0.0 < start < stop <= HIGHEST * drive.frequency:
        raise ParameterError(
            f"start = {start:g} Hz, stop = {stop:g} Hz are not valid: they must rise from > 0 to "
            f"{HIGHEST * drive.frequency:.4g} Hz, a tenth of the drive's frequency."
        )
    if not 1 <= points <= MOST_POINTS:
        raise ParameterError(f"points = {points} is out of range: it must be from 1 to {MOST_POINTS} in a decade.")
    settings = {
        "frequency": [(0.0, drive.frequency)], "voltage_a": [(0.0, drive.voltage)],
        "voltage_b": [(0.0, drive.voltage_b)], "phase_deg": [(0.0, drive.phase_deg)],
        "load_torque": [(0.0, load_torque)],
    }  # fmt: skip
    # ngspice never ends a sweep by decades that has less than one step
    sweep = {
        "variation": "dec", "number_of_points": max(points, ceil(1.0 / log10(stop / start))),
        "start_frequency": start, "stop_frequency": stop,
    }  # fmt: skip
    check_resolution(phases, HARMONICS)
    numbers = [number for number in (phases, phases * 3 // 2, phases * 2) if number <= MOST_PHASES]
    for number in numbers[:-1]:
        with suppress(NoOperatingPoint):
            return _signals(motor, drive, settings, load, number, sweep, timeout)
    return _signals(motor, drive, settings, load, numbers[-1], sweep, timeout)


class NoOperatingPoint(SimulationError):
    """ngspice found no operating point of the averaged motor."""


def _signals(
    motor: Motor,
    drive: TwoPhaseDrive,
    settings: Mapping[str, Course],
    load: Load,
    phases: int,
    sweep: Mapping[str, Any],
    timeout: float | None,
) -> AveragedSignals:
    """Settle the motor and run ``.ac`` for each input."""
    settled = transient(
        averaged_bench(motor, settings, load=load, phases=phases), ["all"], step=drive.period, duration=SETTLED,
        longest=SETTLED / LONGEST_STEPS, record_from=SETTLED * (1.0 - 1.0 / LONGEST_STEPS), timeout=timeout,
    ).last()  # fmt: skip
    guess = _guess(settled, phases)
    if load.speed is None:
        guess["shaft"] = settled["v(shaft)"]
    sizes: dict[str, dict[str, float]] = {
        "amplitude": {"voltage_a": 1.0, "voltage_b": drive.ratio_b}, "phase": {"phase_deg": 180.0 / pi},
        "frequency": {"frequency": 1.0}, **({"load_torque": {"load_torque": 1.0}} if load.speed is None else {}),
    }  # fmt: skip
    parts = ("re", "im")
    vectors = ["v(shaft)", "v(xmotor.friction)", *(f"i(v{group}_{part})" for group in "ab" for part in parts)]
    vectors += [f"v(xmotor.xmode{index}_1.v_{part})" for index in range(1, len(motor.modes) + 1) for part in parts]
    transfers: dict[tuple[str, str], Complex] = {}
    for of, modulated in sizes.items():
        bench = averaged_bench(motor, settings, load=load, modulated=modulated, phases=phases, side_bands=True)
        limit = LONGEST if timeout is None else min(timeout, LONGEST)
        try:
            outcome = ac(bench, vectors, guess=guess, timeout=limit, **sweep)
        except SimulationError as error:
            ended = "did not finish" in str(error) and limit != timeout
            if "gmin" not in str(error) and not ended:
                raise
            raise NoOperatingPoint(
                f"ngspice finds no operating point of the averaged motor at {phases} phases. Give another number of "
                "phases, or use small_signals, which needs none.", deck=error.deck, log=error.log,
            ) from error  # fmt: skip
        for output, values in _outputs(motor, outcome.phasors(), settled, of).items():
            transfers[output, of] = values
    return AveragedSignals(
        outcome.phasors()["frequency"].real, transfers, settled["v(shaft)"],
        doubts(settled["v(xmotor.check)"], settled["v(xmotor.open)"]),
        {"motor": motor.to_dict(), "drive": drive.model_dump(), "held_speed_rad_s": load.speed,
         "load_torque_n_m": load.torque, "phases": phases},
        outcome.deck,
    )  # fmt: skip


_STATES = ("r", "r_re", "r_im", "v_re", "v_im")  # of modes and bending, in both forms


def _guess(settled: Mapping[str, float], phases: int) -> dict[str, float]:
    """Return voltages from which ngspice finds the operating point.

    They are those of the motor's own nodes, of the states of its modes, and of the anchors of the phases. ngspice takes
    a time for a given voltage that grows with the circuit; so the other nodes of the contact have none.
    """
    guess = {}
    for vector, value in settled.items():
        node = vector[2:-1]
        place, _, name = node.rpartition(".")
        if place == "xmotor" or (place.startswith(("xmotor.xmode", "xmotor.xbending")) and name in _STATES):
            guess[node] = value
    for number in range(phases):
        slider, x = (settled[f"v(xmotor.xcontact.{name}{number})"] for name in ("slider", "x"))
        guess[f"xmotor.xcontact.anchor{number}"] = slider - x
    return guess


def _outputs(motor: Motor, found: Mapping[str, Complex], settled: Mapping[str, float], of: str) -> dict[str, Complex]:
    """Return the outputs of a modulation; amplitudes and phases are those of a complex amplitude's deviation."""
    torque = motor.rotor.radius_m * found["v(xmotor.friction)"]
    outputs = {"speed": found["v(shaft)"], "torque": torque}
    for group in "ab":
        own = float(group == "b" and of == "phase")  # the voltage of the group turns too
        real, imaginary = (f"i(v{group}_{part})" for part in ("re", "im"))
        current = complex(settled[real], settled[imaginary])
        along, across = _deviations(current, found[real], found[imaginary])
        outputs[f"current_amplitude_{group}"] = along
        outputs[f"current_phase_{group}"] = across / abs(current) - own
        motional = 0.0 + 0.0j
        parts = [np.zeros_like(torque), np.zeros_like(torque)]
        for index, mode in enumerate(motor.modes, start=1):
            coupling = getattr(mode, f"coupling_{group}_n_per_v")
            names = [f"v(xmotor.xmode{index}_1.v_{part})" for part in ("re", "im")]
            motional += coupling * complex(*(settled[name] for name in names))
            parts = [part + coupling * found[name] for part, name in zip(parts, names, strict=True)]
        outputs[f"motional_phase_{group}"] = _deviations(motional, *parts)[1] / abs(motional) - own
    return {name: outputs[name] for name in OUTPUTS}


def _deviations(carrier: complex, real: Complex, imaginary: Complex) -> tuple[Complex, Complex]:
    """Return the parts of a deviation along and across a complex amplitude."""
    unit_re, unit_im = carrier.real / abs(carrier), carrier.imag / abs(carrier)
    return unit_re * real + unit_im * imaginary, unit_re * imaginary - unit_im * real
