# SPDX-License-Identifier: GPL-3.0-or-later
"""Benches for a controller in the loop: sources that a session alters, and integrals that a sample reads.

The averaged and the full motor have the same command sources and the same sampled nodes, so that one controller runs
with both.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi

from PySpice.Spice.Netlist import Circuit

from pyspice_runner.model.drive import TwoPhaseDrive
from pyspice_runner.model.motor import Motor
from pyspice_runner.model.thermal import Thermal
from pyspice_runner.netlist.averaged import ANGLE, Course, averaged_bench, course_text
from pyspice_runner.netlist.source import Pins, UniformSource
from pyspice_runner.netlist.sources import Bench, motor_bench
from pyspice_runner.netlist.state import Discretisation

COMMANDS = {"frequency": "vset_frequency", "voltage_a": "vset_a", "voltage_b": "vset_b", "phase_deg": "vset_phase"}
SAMPLED = ("v(position)", "v(sum_re)", "v(sum_im)")  # angle in rad; integrals of the current's amplitude, 1 V = 1 uA.s
CHECKED = ("v(xmotor.check)", "v(xmotor.open)")  # of the averaged motor: its own check
_TURNS = f"{2.0 * pi!r}*V(turns)"


@dataclass(frozen=True)
class CommandedSource(UniformSource):
    """Two sines whose frequency, amplitudes and phase are the values of DC sources; the phase is continuous."""

    settings: Mapping[str, Course]  # the commands over time, as of an averaged bench, until one of them is altered
    drive: TwoPhaseDrive  # the values at the start

    @property
    def label(self) -> str:
        """The same as of the drive at the start."""
        return f"{self.drive.label} at the start, then as commanded"

    def add(self, circuit: Circuit, motor: Motor, pins: Pins, *, begun: float) -> None:  # noqa: ARG002
        """Add the commands, the oscillator and the two sources ``Va`` and ``Vb``."""
        for name, source in COMMANDS.items():
            node = source.removeprefix("v")
            circuit.V(node, node, circuit.gnd, course_text(self.settings[name]))
        shift = f"{pi / 180.0!r}*V(set_phase)"
        circuit.raw_spice += (
            "Gturns 0 turns set_frequency 0 1u\nCturns turns 0 1u ic=0\nRturns turns 0 1t\n"
            f"Bdrive_a drive_a 0 V=V(set_a)*sin({_TURNS})\n"
            f"Bdrive_b drive_b 0 V=V(set_b)*sin({_TURNS}+{shift})\n"
            f"Bsum_re 0 sum_re I=-2*I(Va)*sin({_TURNS})\nBsum_im 0 sum_im I=-2*I(Va)*cos({_TURNS})\n"
        )
        # ngspice counts the current of Va from the pin into the source, hence the signs above
        for group, pin in zip("ab", pins, strict=True):
            circuit.V(group, pin, f"drive_{group}", "DC 0")


def controlled_bench(
    motor: Motor,
    drive: TwoPhaseDrive,
    settings: Mapping[str, Course],
    *,
    sample_time: float,
    step: float | None = None,
    thermal: Thermal | None = None,
) -> Bench:
    """Put a motor on a bench whose commands a session can alter and whose samples it can read.

    ``drive`` has the values at the start, and ``settings`` those over time, as in :func:`averaged_bench`.
    ``sample_time`` in s is the time between two samples; a clock makes ngspice take a time point at each. ``step`` is
    the uniform step in s of the full motor, ``None`` the averaged motor. With ``thermal`` the losses heat the motor.
    """
    if step is None:
        bench = averaged_bench(motor, settings, thermal=thermal)
        bench.circuit.raw_spice += "Fsum_re 0 sum_re Va_re 1\nFsum_im 0 sum_im Va_im 1\n"
    else:
        bench = motor_bench(
            motor, CommandedSource(settings, drive), discretisation=Discretisation(step), thermal=thermal
        )
        bench.circuit.I("load", "shaft", bench.circuit.gnd, course_text(settings["load_torque"]))
        bench.circuit.raw_spice += ANGLE
    # a trapezoid with a corner at each sample time, where ngspice takes a time point
    bench.circuit.raw_spice += (
        "Csum_re sum_re 0 1u ic=0\nRsum_re sum_re 0 1t\nCsum_im sum_im 0 1u ic=0\nRsum_im sum_im 0 1t\n"
        f"Vclock clock 0 PULSE(0 1 0 {sample_time!r} {sample_time!r} {sample_time!r} {4.0 * sample_time!r})\n"
    )
    return bench
