# SPDX-License-Identifier: GPL-3.0-or-later
"""Running motors that a sampled controller can read and command: in ngspice, or as compiled code.

On a bench of ngspice, sources that a session alters are the commands, and integrals are what a sample reads. The
averaged and the full motor have the same, so that one controller runs with both.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import hypot, pi

from PySpice.Spice.Netlist import Circuit

from pyspice_runner.averaged.library import Schedule, add_angle, add_surroundings, schedule_text
from pyspice_runner.averaged.point import COMMANDS, INPUT_OF, AveragedPoint, add_commands
from pyspice_runner.circuit.bench import Bench, motor_bench
from pyspice_runner.circuit.source import Pins, UniformSource
from pyspice_runner.circuit.state import Discretisation
from pyspice_runner.drivers.driver import Driver, add_channels
from pyspice_runner.motor import groups
from pyspice_runner.motor.drive import TwoPhaseDrive
from pyspice_runner.motor.groups import GROUPS
from pyspice_runner.motor.motor import Motor
from pyspice_runner.spice.library import definitions
from pyspice_runner.spice.process import Session

_PARTS = ("re", "im")
# angle in rad; integrals of the amplitudes of currents, 1 V = 1 uA.s, and of voltages, 1 V = 1 mV.s; 1 V = 1 mJ
SAMPLED = (
    "v(position)", *(f"v({total}_{group}_{part})" for total in ("sum", "flux") for group in "ab" for part in _PARTS),
    "v(energy)",
)  # fmt: skip
# of the averaged motor: its own check, its heat, and the fundamental of the tip towards the rotor in um
CHECKED = ("v(xmotor.check)", "v(xmotor.open)", "v(heat)", "v(xmotor.y_re1)", "v(xmotor.y_im1)")
_TURNS = f"{2.0 * pi!r}*V(turns)"


@dataclass(frozen=True)
class CommandedSource(UniformSource):
    """Two sines whose frequency, amplitudes and phase are the values of DC sources; the phase is continuous."""

    settings: Mapping[str, Schedule]  # the commands over time, as of an averaged bench, until one of them is altered
    drive: TwoPhaseDrive  # the values at the start
    network: Driver | None = None  # ideal sources with a network, which is between the commands and the groups

    @property
    def label(self) -> str:
        """The same as of the drive at the start."""
        return f"{self.drive.label} at the start, then as commanded"

    def initial_voltages(self) -> tuple[float, ...]:
        """Return U_A and U_B at t = 0 in V: behind a network 0."""
        return (0.0, 0.0) if self.network else super().initial_voltages()

    def add(self, circuit: Circuit, motor: Motor, pins: Pins, *, begun: float) -> None:  # noqa: ARG002
        """Add the commands, the oscillator and the two sources ``Va`` and ``Vb``."""
        add_commands(circuit, self.settings)
        shift, line = f"{pi / 180.0!r}*V(set_phase)", "control" if self.network else "drive"
        circuit.raw_spice += (
            "Gturns 0 turns set_frequency 0 1u\nCturns turns 0 1u ic=0\nRturns turns 0 1t\n"
            f"Bdrive_a {line}_a 0 V=V(set_a)*sin({_TURNS})\n"
            f"Bdrive_b {line}_b 0 V=V(set_b)*sin({_TURNS}+{shift})\n"
        )
        if self.network:
            circuit.raw_spice += definitions(*self.network.libraries()) + "\n"
            add_channels(circuit, self.network, {group: groups.named("drive", group) for group in "ab"})
        for group in GROUPS:
            for part, wave in zip(_PARTS, ("sin", "cos"), strict=True):
                channel, drive = f"{group}_{part}", groups.named("drive", group)
                circuit.raw_spice += (
                    f"Bsum_{channel} 0 sum_{channel} I=-2*I(V{group})*{wave}({_TURNS})\n"
                    f"Bflux_{channel} 0 flux_{channel} I=2*V({drive})*{wave}({_TURNS})\n"
                )
        power = "+".join(f"V({groups.named('drive', group)})*I(V{group})" for group in GROUPS)
        circuit.raw_spice += f"Benergy 0 energy I=-({power})\n"
        # ngspice counts the current of a source from the pin into it, hence the signs above
        for group, pin in zip("ab", pins, strict=True):
            circuit.V(group, pin, groups.named("drive", group), "DC 0")


def controlled_bench(
    run: AveragedPoint, *, sample_time: float, stops: tuple[int, float] = (1, 0.0), step: float | None = None
) -> Bench:
    """Put a motor on a bench whose commands a session can alter and whose samples it can read.

    ``sample_time`` in s is the time between two samples, ``stops`` the number of parts into which records divide it,
    and the time in s from a sample to its commands; clocks make ngspice take a time point at each. ``step`` is the
    uniform step in s of the full motor, ``None`` the averaged motor. Raise ParameterError for a course that the motor
    cannot follow.
    """
    motor, settings, thermal = run.point.motor, run.settings, run.point.thermal
    if step is None:
        bench = run.bench()
        for group in "ab":
            for part in _PARTS:
                channel = f"{group}_{part}"
                bench.circuit.raw_spice += f"Fsum_{channel} 0 sum_{channel} V{channel} 1\n"
                bench.circuit.raw_spice += f"Gflux_{channel} 0 flux_{channel} {channel} 0 1\n"
        power = "+".join(f"V({group}_{part})*I(V{group}_{part})" for group in "ab" for part in _PARTS)
        bench.circuit.raw_spice += f"Benergy 0 energy I=0.5*({power})\n"
    else:
        source = CommandedSource(settings, run.front.stage, run.front.driver)
        moved = [(time, 1e6 * motor.approach_m(preload)) for time, preload in settings.get("preload", ())]
        approach = schedule_text(moved) if moved else ""  # the stator moves so that its preload follows the course
        bench = motor_bench(motor, source, discretisation=Discretisation(step), thermal=thermal, approach=approach)
        bench.circuit.I("load", "shaft", bench.circuit.gnd, schedule_text(settings["load_torque"]))
        add_angle(bench.circuit, run.shaft)
        if thermal:
            add_surroundings(bench.circuit, settings, thermal)
    for name in SAMPLED[1:]:
        node = name[2:-1]
        capacitance = "1u" if node.startswith("sum") else "1m"
        bench.circuit.raw_spice += f"C{node} {node} 0 {capacitance} ic=0\nR{node} {node} 0 1t\n"
    parts, delay = stops
    for number, begin in enumerate((0.0, delay) if delay else (0.0,)):
        # a trapezoid with a corner at each stop, where ngspice takes a time point
        time = repr(sample_time if number else sample_time / parts)
        bench.circuit.raw_spice += (
            f"Vclock{number} clock{number} 0 PULSE(0 1 {begin!r} {time} {time} {time} {4.0 * float(time)!r})\n"
        )
    return bench


# --- running motors ---


@dataclass(frozen=True)
class State:
    """What a sample and the check are made of."""

    time: float  # s
    position: float = 0.0  # rad
    # integrals of the amplitudes of the currents into the groups, A·s, and of their voltages, V·s; both relative to the
    # voltage of group A
    charges: Sequence[complex] = (0.0, 0.0)
    fluxes: Sequence[complex] = (0.0, 0.0)
    load_position: float = 0.0  # rad, of what is coupled to the shaft
    temperature: float = 0.0  # K
    check: float = 0.0
    separated: float = 0.0
    tip_y_amplitude: float = 0.0  # m, fundamental of the tip towards the rotor
    heat: float = 0.0  # W
    energy: float = 0.0  # J, electrical, into both groups since the start


class Spice:
    """A motor in ngspice."""

    def __init__(self, session: Session) -> None:
        self._session = session

    def advance(self, until: float) -> State:
        """Run to a time in s."""
        now = self._session.advance(until)

        def phasors(integral: str, unit: float) -> list[complex]:
            return [unit * complex(*(now[f"v({integral}_{group}_{part})"] for part in _PARTS)) for group in "ab"]

        check, separated, heat, *tip = (now.get(name, 0.0) for name in CHECKED)
        return State(
            now["time"], now["v(position)"], phasors("sum", 1e-6), phasors("flux", 1e-3),
            now.get("v(load_position)", now["v(position)"]), now.get("v(temperature)", 0.0), check, separated,
            1e-6 * hypot(*tip), heat, 1e-3 * now["v(energy)"],
        )  # fmt: skip

    def alter(self, name: str, value: float) -> None:
        """Set a command from now on."""
        self._session.alter(f"v{COMMANDS[name]}", value)


class Compiled:
    """The compiled averaged motor."""

    def __init__(self, run: AveragedPoint, *, steady: bool) -> None:
        self._motor, self._time = run.compiled(), 0.0
        self._courses = {name: course for name, course in run.inputs.items() if len(course) > 1}
        if steady:
            self._motor.settle()

    def advance(self, until: float) -> State:
        """Run to a time in s."""
        self._motor.advance(self._time, until, self._courses)
        self._time = until
        names = ("load_position", "temperature", "check", "separated", "tip_y_amplitude", "heat")
        numbers = {name: self._motor.get(name) for name in names}
        charges, fluxes, energy = self._motor.sums
        return State(until, self._motor.get("position"), charges, fluxes, energy=energy, **numbers)

    def alter(self, name: str, value: float) -> None:
        """Set a command from now on."""
        self._motor.set(**{INPUT_OF[name]: value})
