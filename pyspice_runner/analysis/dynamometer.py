# SPDX-License-Identifier: GPL-3.0-or-later
"""A motor on the dynamometer: means over blocks of whole drive periods, from a motion that goes on from block to block.

A block is one run of ngspice. Integrators in the circuit (``behavioral/piezomotor_dynamometer.lib`` and its like) give
the means, and only the last point is stored: the motion there, from which the next block goes on. So memory does not
grow with the time that is simulated, and a motion that has not settled is carried on, not begun again.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from math import ceil, sqrt

from pyspice_runner.analysis.simulate import POINTS_PER_PERIOD, shortest_period
from pyspice_runner.engine.pyspice import BatchSimulator
from pyspice_runner.model.drive import Drive
from pyspice_runner.model.motor import Motor
from pyspice_runner.netlist.benches import SpeedRamp, dynamometer_bench, start_voltages, transient_options
from pyspice_runner.netlist.contact import SLIDERS, ContactLaw
from pyspice_runner.netlist.motor import Discretisation, Motion

_FEWEST_PERIODS = 10
_GOLDEN = 0.5 * (3.0 - sqrt(5.0))
_MICRO = 1e-6  # the integrals are the voltages of 1 µF

UNITS = {
    "torque_n_m": ("N·m", "mean torque of the contact on the rotor"),
    "torque_ripple_n_m": ("N·m", "RMS of the torque about its mean"),
    "load_torque_n_m": ("N·m", "mean torque taken at the shaft: that of the contact less the bearing's"),
    "normal_force_n": ("N", "mean normal force"),
    "separated": ("1", "share of time in which the tip is off the rotor"),
    "stick": ("1", "share of time in which the contact sticks"),
    "slip": ("1", "share of time in which the contact slips"),
    "power_a_w": ("W", "real power into group A"),
    "power_b_w": ("W", "real power into group B"),
    "apparent_power_a_va": ("VA", "RMS voltage times RMS current of group A"),
    "apparent_power_b_va": ("VA", "RMS voltage times RMS current of group B"),
    "current_a_rms_a": ("A", "RMS current of group A"),
    "current_b_rms_a": ("A", "RMS current of group B"),
    "current_a_peak_a": ("A", "greatest current of group A"),
    "current_b_peak_a": ("A", "greatest current of group B"),
    "shaft_power_w": ("W", "power of the contact on the rotor; negative where the shaft is driven"),
    "efficiency": ("1", "shaft power over electrical power; negative where the shaft is driven"),
    "dielectric_loss_w": ("W", "heat in the dielectric loss of both groups"),
    "damping_loss_w": ("W", "heat in the damping of all modes"),
    "friction_loss_w": ("W", "work of the tip along the rotor less that on the rotor: what slip takes"),
    "normal_loss_w": ("W", "work of the tip towards the rotor: what damping across the contact takes"),
    "stored_power_w": ("W", "rate at which stored energy grows; 0 once settled"),
    "balance_residual": ("1", "power put in that is not accounted for, over the power put in"),
}


@dataclass(frozen=True)
class Bench:
    """A motor and its drive on the dynamometer.

    Attributes:
        motor: the motor.
        drive: the two voltages.
        step: uniform time step in s, see :func:`uniform_step`.
        timeout: wall time in s after which ngspice is ended, a block.
        contact: law of the contact.
        sliders: number of sliders of the brush.
        audit: whether means that fail the physical audit are an error.
    """

    motor: Motor
    drive: Drive
    step: float
    timeout: float | None = None
    contact: ContactLaw = "spring-slider"
    sliders: int = SLIDERS
    audit: bool = True

    @property
    def decay_time(self) -> float:
        """Time in s in which the slowest mode decays by a factor of e."""
        return max(2.0 * mode.mass_kg / mode.damping_n_s_per_m for mode in self.motor.modes)

    @property
    def periods(self) -> int:
        """Drive periods of a block: as many as fit the decay time, but not too few to average over."""
        return max(_FEWEST_PERIODS, ceil(self.decay_time / self.drive.period))

    @property
    def duration(self) -> float:
        """Length of a block in s."""
        return self.periods * self.drive.period

    @property
    def discretisation(self) -> Discretisation:
        """How the motor is adapted to the step."""
        return Discretisation(self.step)

    def rest(self, speed: float) -> Motion:
        """Return preloaded rest on a rotor that already turns, the drive about to come on."""
        preload = self.motor.contact.preload_n
        return Motion(
            tuple(-mode.tip_y * preload / self.discretisation.mode(mode)[1] for mode in self.motor.modes),
            (0.0,) * len(self.motor.modes),
            0.0,
            speed,
            *self.drive.initial_voltages(),
        )

    def run(self, start: Motion, speed: float | SpeedRamp, begun: float, *, meters: bool = True) -> Block:
        """Run one block.

        Args:
            start: motion to go on from.
            speed: at which the shaft is held, rad/s.
            begun: time in s since the drive came on.
            meters: whether powers, losses and states are measured, or only forces and torque.
        """
        circuit = dynamometer_bench(
            self.motor, self.drive, speed=speed, contact=self.contact, sliders=self.sliders, meters=meters,
            step=self.step, discretisation=self.discretisation, start=start, begun=begun,
        )  # fmt: skip
        simulator = BatchSimulator(circuit, timeout=self.timeout)
        simulator.options(**transient_options(self.motor, self.contact))
        simulator.initial_condition(**start_voltages(start))
        simulator.save(*self._vectors(meters))
        times = {"step_time": self.step, "end_time": self.duration, "max_time": self.step}
        times["start_time"] = self.duration - 1e-3 * self.step
        deck = str(simulator.prepare("transient", use_initial_condition=True, **times))
        simulator.transient(use_initial_condition=True, **times)
        assert simulator.result is not None
        last = {name: float(values[-1].real) for name, values in simulator.result.raw.vectors.items()}
        end = Motion(
            tuple(
                last[f"v(xmotor.xmode{index}.elastic)"] / self.discretisation.mode(mode)[1]
                for index, mode in enumerate(self.motor.modes, start=1)
            ),
            tuple(last[f"i(v.xmotor.xmode{index}.vvelocity)"] for index in range(1, len(self.motor.modes) + 1)),
            1e-6 * last["v(xmotor.slider)"],
            last["v(shaft)"],
            last["v(xmotor.xgroup_a.plate)"],
            last["v(xmotor.xgroup_b.plate)"],
            tuple(1e-6 * last[f"v({cell})"] for cell in self._cells),
        )
        means = {
            name.removeprefix("v(").removesuffix(")"): _MICRO * value / self.duration
            for name, value in last.items()
            if ".v_" in name
        }
        peaks = {group: last[f"v(xmeter_{group}.v_peak)"] for group in "ab"} if meters else {}
        hashed = hashlib.sha256(deck.encode()).hexdigest()
        return Block(self, means, peaks, start, end, begun + self.duration, hashed)

    def stored(self, motion: Motion) -> float:
        """Return the energy in J that a motion holds: in the modes and the plates, not in the rotor and the contact."""
        piezo = self.motor.piezo
        energy = 0.5 * (piezo.capacitance_a_f * motion.plate_a_v**2 + piezo.capacitance_b_f * motion.plate_b_v**2)
        for mode, r, v in zip(self.motor.modes, motion.displacements_m, motion.velocities_m_s, strict=True):
            energy += 0.5 * (mode.mass_kg * v**2 + mode.stiffness_n_per_m * r**2)
        return energy

    @property
    def _cells(self) -> list[str]:
        """Nodes of a brush's cells."""
        return [f"xmotor.xcontact.q{n}" for n in range(1, self.sliders + 1)] if self.contact == "brush" else []

    def _vectors(self, meters: bool) -> list[str]:
        integrals: dict[str, tuple[str, ...]] = {"xbrake": ("normal", "friction", "taken")}
        if meters:
            integrals["xcontactmeter"] = ("work", "press", "given", "square", "contact", "slip")
            for group in "ab":
                integrals[f"xmeter_{group}"] = ("energy", "square_i", "square_v", "peak")
            for heat in (*range(1, len(self.motor.modes) + 1), "a", "b"):
                integrals[f"xheat_{heat}"] = ("heat",)
        names = [f"v({instrument}.v_{one})" for instrument, several in integrals.items() for one in several]
        names += ["v(shaft)", "v(xmotor.slider)", "v(xmotor.xgroup_a.plate)", "v(xmotor.xgroup_b.plate)"]
        names += [f"v({cell})" for cell in self._cells]
        for index in range(1, len(self.motor.modes) + 1):
            names += [f"i(v.xmotor.xmode{index}.vvelocity)", f"v(xmotor.xmode{index}.elastic)"]
        return names


@dataclass(frozen=True)
class Block:
    """What a block of periods gave.

    Attributes:
        bench: where it ran.
        means: mean by node of its integral, in SI units.
        peaks: greatest current of each group, A, if it was measured.
        start: motion at its start.
        end: motion at its end.
        ended: time in s since the drive came on.
        deck_sha256: hash of its deck.
    """

    bench: Bench
    means: dict[str, float]
    peaks: dict[str, float]
    start: Motion
    end: Motion
    ended: float
    deck_sha256: str

    @property
    def torque(self) -> float:
        """Mean torque of the contact on the rotor, N·m."""
        return self.bench.motor.rotor.radius_m * self.means["xbrake.v_friction"]

    @property
    def normal_force(self) -> float:
        """Mean normal force, N."""
        return self.means["xbrake.v_normal"]

    @property
    def metered(self) -> bool:
        """Whether powers, losses and states were measured."""
        return bool(self.peaks)


def uniform_step(motor: Motor, drive: Drive, coarsest: float | None = None) -> float:
    """Return the step in s to take: the coarsest that is allowed, made incommensurate with the drive's period.

    A change of state is seen at the end of its step. With a whole number of steps a period it would always be late by
    the same, and the small mean of a large alternating force be wrong by some 2 %; so the steps move through the
    period by the golden section, and their rounding averages out (measured: 0.1 %).

    Args:
        motor: the motor.
        drive: the drive.
        coarsest: step in s not to exceed; by default the one of ``simulate``.
    """
    coarsest = coarsest or shortest_period(motor, drive, contact=True) / POINTS_PER_PERIOD
    return drive.period / (ceil(drive.period / coarsest - _GOLDEN) + _GOLDEN)


def quantities(blocks: list[Block]) -> dict[str, float]:
    """Return the quantities of :data:`UNITS` over successive blocks, all of them metered."""
    bench, motor = blocks[0].bench, blocks[0].bench.motor
    mean = {name: sum(block.means[name] for block in blocks) / len(blocks) for name in blocks[0].means}
    radius = motor.rotor.radius_m
    contact = "xcontactmeter.v_"
    friction, slip, touching = mean["xbrake.v_friction"], mean[f"{contact}slip"], mean[f"{contact}contact"]
    electrical, shaft = mean["xmeter_a.v_energy"] + mean["xmeter_b.v_energy"], mean[f"{contact}given"]
    duration = len(blocks) * bench.duration
    losses = {
        "dielectric_loss_w": mean["xheat_a.v_heat"] + mean["xheat_b.v_heat"],
        "damping_loss_w": sum(mean[f"xheat_{index}.v_heat"] for index in range(1, len(motor.modes) + 1)),
        "friction_loss_w": mean[f"{contact}work"] - shaft,
        "normal_loss_w": mean[f"{contact}press"],
        "stored_power_w": (bench.stored(blocks[-1].end) - bench.stored(blocks[0].start)) / duration,
    }
    put_in = max(electrical, 0.0) + max(-shaft, 0.0)
    missing = electrical - shaft - sum(losses.values())
    result = {
        "torque_n_m": radius * friction,
        "torque_ripple_n_m": radius * sqrt(max(mean[f"{contact}square"] - friction**2, 0.0)),
        "load_torque_n_m": mean["xbrake.v_taken"],
        "normal_force_n": mean["xbrake.v_normal"],
        "separated": 1.0 - touching,
        "stick": touching - slip,
        "slip": slip,
    }
    for group in "ab":
        meter = f"xmeter_{group}.v_"
        current, voltage = (sqrt(max(mean[f"{meter}square_{what}"], 0.0)) for what in "iv")
        result |= {
            f"power_{group}_w": mean[f"{meter}energy"],
            f"apparent_power_{group}_va": voltage * current,
            f"current_{group}_rms_a": current,
            f"current_{group}_peak_a": max(block.peaks[group] for block in blocks),
        }
    result |= {"shaft_power_w": shaft, "efficiency": shaft / electrical if electrical > 0.0 else float("nan")}
    result |= losses
    result["balance_residual"] = missing / put_in if put_in > 0.0 else 0.0
    return {name: result[name] for name in UNITS}
