# SPDX-License-Identifier: GPL-3.0-or-later
"""A motor on the dynamometer: means over blocks of whole drive periods; each block continues the motion of the last.

A block is one run of ngspice. Integrators in the circuit (``behavioral/piezomotor_dynamometer.lib`` and others) give
the means. Only the motion at the end is stored, from which the next block starts, so that memory does not grow with
the simulated time.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from math import ceil, nan, pi, sqrt
from typing import Any

import numpy as np

from pyspice_runner.circuit.bench import dynamometer_bench
from pyspice_runner.circuit.motor import dielectric_branches, require_linear
from pyspice_runner.circuit.state import CHARGED, Motion, held_piezo, motor_states, plate_nodes
from pyspice_runner.motor import groups, strength
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.stator import carriers, square
from pyspice_runner.run.kernel import Outcome, transient
from pyspice_runner.run.point import Point

FEWEST_PERIODS = 10
GOLDEN = 0.5 * (3.0 - sqrt(5.0))
_MICRO = 1e-6  # the integrals are the voltages of 1 µF


def measured(unit: str, meaning: str) -> Any:
    """Declare a quantity of an operating point; NaN where it is not known."""
    return field(default=float("nan"), metadata={"unit": unit, "meaning": meaning})


@dataclass(frozen=True)
class Quantities:
    """The quantities of an operating point: means over whole drive periods, SI units."""

    torque_n_m: float = measured("N·m", "mean torque of the contact on the rotor")
    torque_ripple_n_m: float = measured("N·m", "RMS of the torque about its mean")
    torque_min_n_m: float = measured(
        "N·m", "minimum of the torques that friction holds at least; the torque where it slips, NaN if not known"
    )
    torque_max_n_m: float = measured("N·m", "maximum of these torques")
    load_torque_n_m: float = measured("N·m", "mean torque taken at the shaft: that of the contact less the bearing's")
    normal_force_n: float = measured("N", "mean normal force")
    separated: float = measured("1", "share of time in which the tip is off the rotor")
    stick: float = measured("1", "share of time in which the contact sticks")
    slip: float = measured("1", "share of time in which the contact slips")
    power_a_w: float = measured("W", "real power into group A")
    power_b_w: float = measured("W", "real power into group B")
    apparent_power_a_va: float = measured("VA", "RMS voltage times RMS current of group A")
    apparent_power_b_va: float = measured("VA", "RMS voltage times RMS current of group B")
    current_a_rms_a: float = measured("A", "RMS current of group A")
    current_b_rms_a: float = measured("A", "RMS current of group B")
    current_a_peak_a: float = measured("A", "maximum current of group A")
    current_b_peak_a: float = measured("A", "maximum current of group B")
    shaft_power_w: float = measured("W", "power of the contact on the rotor; negative where the shaft is driven")
    efficiency: float = measured(
        "1", "power at the shaft, after the bearing, over electrical power; NaN if it is driven"
    )
    dielectric_loss_w: float = measured("W", "heat in the dielectric loss of both groups")
    damping_loss_w: float = measured("W", "heat in the damping of all modes and of the mount")
    friction_loss_w: float = measured("W", "work of the tip along the rotor less that on the rotor: what slip takes")
    normal_loss_w: float = measured("W", "work of the tip towards the rotor: what damping across the contact takes")
    stored_power_w: float = measured("W", "rate at which stored energy grows; 0 once settled")
    ceramic_strain: float = measured("1", "maximum strain of the ceramic; not known without the beam")
    ceramic_stress_pa: float = measured("Pa", "maximum stress of the ceramic by that strain")
    temperature_rise_k: float = measured("K", "steady temperature of the stator above its surroundings, by its losses")
    peak_pressure_pa: float = measured("Pa", "maximum pressure in the contact; not known without its radius")
    tensile_stress_pa: float = measured("Pa", "tension at the trailing edge of the contact at its maximum force")
    wear_volume_m3_per_s: float = measured("m³/s", "volume that the tip loses by slip")
    balance_residual: float = measured("1", "power put in that is not accounted for, over the power put in")

    @property
    def quantities(self) -> dict[str, float]:
        """The quantities by name."""
        return {name: getattr(self, name) for name in UNITS}


STUCK = (
    "The contact sticks throughout the period. Friction holds a shaft that stands or hardly turns at any torque "
    "up to its limit: torque, normal force and powers depend on its history."
)


GRAZING = 1.0 / 64.0  # share of time of one step, or phase, at the limit of stick: at the ends of what friction holds
ROUNDED = 1e-6  # share of time below which it is the rounding of ngspice's integral


def stuck(outcome: Mapping[str, Any], grazing: float = 0.0) -> bool:
    """Whether a contact does not open, and slips for a share ``grazing`` of the time at most, by quantities."""
    return bool(abs(outcome["slip"]) < grazing + ROUNDED and abs(outcome["separated"]) < ROUNDED)


UNITS = {item.name: (str(item.metadata["unit"]), str(item.metadata["meaning"])) for item in fields(Quantities)}


@dataclass(frozen=True)
class Dynamometer:
    """A motor and its source on the dynamometer, which replaces the load."""

    setup: Point  # motor, source, contact and solver
    length: float | None = None  # of a block, s, if it is another one

    @property
    def speed(self) -> float:
        """Speed in rad/s of its operating point."""
        return self.setup.load.speed or 0.0

    @property
    def duration(self) -> float:
        """Length of a block in s: ten drive periods, or more until the slowest mode or the carrier decays by e."""
        period = self.setup.source.period
        return self.length or max(FEWEST_PERIODS, ceil(self.setup.motor.decay_s / period)) * period

    def rest(self) -> Motion:
        """Return preloaded rest on a turning rotor, before the source is switched on."""
        setup = self.setup
        rest = {state.name: state.at_rest(setup.discretisation) for state in motor_states(setup.motor, setup.law)}
        for group, voltage in zip(groups.GROUPS, setup.source.initial_voltages(), strict=True):
            rest |= dict.fromkeys(plate_nodes(group), voltage)
        return rest | {"speed": self.speed}

    def run(self, start: Motion, begun: float, *, meters: bool = True) -> Block:
        """Run one block at the speed of the operating point. The source was switched on ``begun`` seconds ago.

        Without ``meters`` only forces and torque are measured.
        """
        outcome = self._run(start, self.duration, begun, meters=meters, end_only=True)
        last = outcome.last()
        peaks = {group: last[f"v(xmeter_{group}.v_peak)"] for group in "ab"} if meters else {}
        end = self.setup.motion(last)
        return Block(self, self.means(last), peaks, start, end, begun + self.duration, outcome.deck_sha256)

    def run_from_rest(self, blocks: int) -> list[Block]:
        """Run successive blocks at once, for a source whose state cannot be continued: a driver circuit."""
        start = self.rest()
        outcome = self._run(start, blocks * self.duration, 0.0, meters=True, end_only=False)
        vectors = outcome.vectors()
        time = vectors["time"]
        found: list[Block] = []
        before = dict.fromkeys(vectors, 0.0)
        for number in range(blocks):
            begun, ended = number * self.duration, (number + 1) * self.duration
            edge = {name: float(np.interp(ended, time, values)) for name, values in vectors.items()}
            within = slice(*np.searchsorted(time, [begun, ended]).tolist())
            peaks = {group: float(np.abs(vectors[ammeter(group)][within]).max()) for group in "ab"}
            means = self.means({name: edge[name] - before[name] for name in edge})
            end = self.setup.motion(edge)
            found.append(Block(self, means, peaks, start, end, ended, outcome.deck_sha256))
            before, start = edge, end
        return found

    def _run(self, start: Motion, duration: float, begun: float, *, meters: bool, end_only: bool) -> Outcome:
        setup = self.setup
        assert setup.law is not None
        require_linear(setup.motor, "A point that settles on the dynamometer")
        bench = dynamometer_bench(
            setup.motor, setup.source, speed=self.speed, law=setup.law, meters=meters,
            discretisation=setup.discretisation, start=start, begun=begun,
        )  # fmt: skip
        vectors = [*self.integrals(meters), *setup.state_vectors()]
        return transient(
            bench, vectors if end_only else [*vectors, *map(ammeter, "ab")], step=setup.step, duration=duration,
            record_from=duration - 1e-3 * setup.step if end_only else 0.0, timeout=setup.solver.timeout,
            uniform=setup.source.uniform,
        )  # fmt: skip

    def means(self, integrals: Mapping[str, float]) -> dict[str, float]:
        """Return the means of a block from its integrals."""
        return {
            name.removeprefix("v(").removesuffix(")"): _MICRO * value / self.duration
            for name, value in integrals.items()
            if ".v_" in name
        }

    def stored(self, motion: Motion) -> float:
        """Return the energy in J in modes, plates and mount, without rotor and contact."""
        motor, law = self.setup.motor, self.setup.law
        modes = [motion[state.name] for state in motor_states(motor, law, ("mode",))]
        mount = [motion[state.name] for state in motor_states(motor, law, ("mount",))]
        half = len(motor.modes)
        energy = stored_energy(motor, modes[:half], modes[half:], mount[::2], mount[1::2])
        piezo = held_piezo(motor, law)
        share = piezo.capacitance_ab_f / piezo.capacitance_a_f
        branches = zip(*(dielectric_branches(motor, group, law) for group in "ab"), strict=True)
        plates = ([motion[node] for node in plate_nodes(group)] for group in "ab")
        for (a, b), u, v in zip(branches, *plates, strict=True):
            energy += 0.5 * (a.capacitance_f * u * (u - 2.0 * share * v) + b.capacitance_f * v**2)
        return energy

    @property
    def dampers(self) -> list[str]:
        """Names of the dampers: the modes, and the mount and the feedback electrode if there are any."""
        modes = [str(index) for index in range(1, len(self.setup.motor.modes) + 1)]
        sensed = [CHARGED] if self.setup.motor.feedback else []
        return [*modes, *("mount", "mount_x")[: len(carriers(self.setup.motor.mount))], *sensed]

    @property
    def dielectrics(self) -> list[str]:
        """Names of the capacitances: the groups, and that between them if there is one."""
        return ["a", "b", *(["ab"] if self.setup.motor.piezo.capacitance_ab_f else [])]

    def integrals(self, meters: bool) -> list[str]:
        """Return the vectors of the integrals of the instruments."""
        integrals: dict[str, tuple[str, ...]] = {"xbrake": ("normal", "friction", "taken")}
        if meters:
            for one in self.setup.motor.touching:
                integrals[f"xcontactmeter{one.suffix}"] = ("work", "press", "given", "square", "contact", "slip")
            for group in "ab":
                integrals[groups.named("xmeter", group)] = ("energy", "square_i", "square_v", "peak")
            for heat in (*self.dampers, *self.dielectrics):
                integrals[f"xheat_{heat}"] = ("heat",)
        return [f"v({instrument}.v_{one})" for instrument, several in integrals.items() for one in several]


def ammeter(group: str) -> str:
    """Return the vector of the current into a group."""
    return f"i(v.xmeter_{group}.vcurrent)"


@dataclass(frozen=True)
class Block:
    """The result of a block of periods."""

    bench: Dynamometer  # the dynamometer
    means: dict[str, float]  # mean by node of its integral, in SI units
    peaks: dict[str, float]  # largest current of each group, A, if it was measured
    start: Motion  # motion at its start
    end: Motion  # motion at its end
    ended: float  # time in s since the source was switched on
    deck_sha256: str  # hash of its deck

    @property
    def torque(self) -> float:
        """Mean torque of the contact on the rotor, N·m."""
        return self.bench.setup.motor.rotor.radius_m * self.means["xbrake.v_friction"]

    @property
    def normal_force(self) -> float:
        """Mean normal force, N."""
        return self.means["xbrake.v_normal"]

    @property
    def metered(self) -> bool:
        """Whether powers, losses and states were measured."""
        return bool(self.peaks)


def off_beat(setup: Point) -> Point:
    """Return a setup with its step made incommensurate with the period, if its steps are uniform.

    A change of state is seen at the end of its step. With a whole number of steps a period it would always be late by
    the same, and the small mean of a large alternating force be wrong by about 2 %; so the steps move through the
    period by the golden section, and their rounding averages out (measured: 0.1 %).
    """
    if not setup.source.uniform:
        return setup
    period = setup.source.period
    return setup.with_step(period / (ceil(period / setup.step - GOLDEN) + GOLDEN))


def stored_energy(
    motor: Motor,
    displacements_m: Iterable[float],
    velocities_m_s: Iterable[float],
    lifts_m: Sequence[float],
    rises_m_s: Sequence[float],
) -> float:
    """Return the energy in J in the modes and the mount, whose carrier has displacements along y and x."""
    stator = motor.stator.with_carrier(motor.mount if lifts_m else None)
    moved, velocity = np.array([*displacements_m, *lifts_m]), np.array([*velocities_m_s, *rises_m_s])
    energy = 0.5 * (velocity @ square(stator.mass) @ velocity + moved @ square(stator.stiffness) @ moved)
    energy -= 0.25 * (motor.stator.stiffness * motor.stator.softening) @ moved[: len(motor.modes)] ** 4
    if motor.mount and lifts_m:
        energy -= motor.contact.preload_n * lifts_m[0]
    return float(energy)


def quantities(blocks: list[Block]) -> dict[str, float]:
    """Return the quantities of :data:`UNITS` over successive blocks, all of them metered."""
    return quantities_of(blocks[0].bench.setup.motor, metered(blocks))


def metered(blocks: list[Block]) -> dict[str, float]:
    """Return the means of :func:`quantities_of` over successive blocks, all of them metered."""
    bench = blocks[0].bench
    mean = {name: sum(block.means[name] for block in blocks) / len(blocks) for name in blocks[0].means}
    touching = bench.setup.motor.touching
    contact = {  # sums of powers, and means of shares; only one contact has the square of its force as that of all
        name: sum(mean[f"xcontactmeter{one.suffix}.v_{name}"] * (one.share if weighted else 1.0) for one in touching)
        for name, weighted in (("contact", 1), ("slip", 1), ("work", 0), ("press", 0), ("given", 0))
    }
    omega = 2.0 * pi * min(bench.setup.source.frequencies)
    amplitudes = [  # a bound: the static bending and, by the heat of the damping, the vibration
        abs(mode.tip_y * blocks[-1].normal_force / mode.stiffness_n_per_m)
        + strength.amplitude(mean[f"xheat_{index}.v_heat"] / mode.damping_n_s_per_m, omega)
        for index, mode in enumerate(bench.setup.motor.modes, start=1)
    ]
    found = {
        "friction": mean["xbrake.v_friction"],
        "normal": mean["xbrake.v_normal"],
        "load_torque": mean["xbrake.v_taken"],
        "speed": bench.speed,
        "friction_square": mean["xcontactmeter.v_square"] if len(touching) == 1 else nan,
        "touching": contact.pop("contact"),
        **contact,
        "dielectric_loss": sum(mean[f"xheat_{group}.v_heat"] for group in bench.dielectrics),
        "damping_loss": sum(mean[f"xheat_{damper}.v_heat"] for damper in bench.dampers),
        "stored": (bench.stored(blocks[-1].end) - bench.stored(blocks[0].start)) / (len(blocks) * bench.duration),
        **strength.peak_of_amplitudes(bench.setup.motor, amplitudes),
    }
    for group in "ab":
        meter = f"xmeter_{group}.v_"
        found |= {
            groups.named("power", group): mean[f"{meter}energy"],
            groups.named("voltage_square", group): mean[f"{meter}square_v"],
            groups.named("current_square", group): mean[f"{meter}square_i"],
            groups.named("peak", group): max(block.peaks[group] for block in blocks),
        }
    return found


def quantities_of(motor: Motor, mean: Mapping[str, float]) -> dict[str, float]:
    """Return the quantities of :data:`UNITS`.

    The means are over whole periods, in SI units: ``friction``, ``friction_square`` and ``normal`` of the forces;
    ``touching`` and ``slip``, shares of time; ``work`` and ``press``, powers of the tip along the rotor and towards it;
    ``given``, power on the rotor; ``speed`` of the rotor, rad/s; ``load_torque``, ``dielectric_loss``,
    ``damping_loss``, ``stored``; of each group ``power_a``, ``voltage_square_a``, ``current_square_a`` and the largest
    current ``peak_a``; ``ceramic_strain`` and ``ceramic_stress_pa``; if known, ``greatest`` of the normal force and
    ``rubbing``, normal force times slip velocity.
    """
    radius, friction, shaft = motor.rotor.radius_m, mean["friction"], mean["given"]
    electrical = mean["power_a"] + mean["power_b"]
    taken = mean["load_torque"] * mean["speed"]
    losses = {
        "dielectric_loss_w": mean["dielectric_loss"],
        "damping_loss_w": mean["damping_loss"],
        "friction_loss_w": mean["work"] - shaft,
        "normal_loss_w": mean["press"],
        "stored_power_w": mean["stored"],
    }
    put_in = max(electrical, 0.0) + max(-shaft, 0.0)
    result = {
        "torque_n_m": radius * friction,
        "torque_ripple_n_m": radius * sqrt(max(mean["friction_square"] - friction**2, 0.0)),
        "torque_min_n_m": radius * (friction + np.minimum(mean.get("held_min", nan), 0.0)),
        "torque_max_n_m": radius * (friction + np.maximum(mean.get("held_max", nan), 0.0)),
        "load_torque_n_m": mean["load_torque"],
        "normal_force_n": mean["normal"],
        "separated": 1.0 - mean["touching"],
        "stick": mean["touching"] - mean["slip"],
        "slip": mean["slip"],
        "shaft_power_w": shaft,
        "efficiency": taken / electrical if electrical > 0.0 and taken >= 0.0 else float("nan"),
        **losses,
        "ceramic_strain": mean["ceramic_strain"],
        "ceramic_stress_pa": mean["ceramic_stress_pa"],
        "temperature_rise_k": strength.temperature_rise(motor, mean["dielectric_loss"] + mean["damping_loss"]),
        **strength.of_contact(motor.contact, mean.get("greatest", nan), mean.get("rubbing", nan)),
        "balance_residual": (electrical - shaft - sum(losses.values())) / put_in if put_in > 0.0 else 0.0,
    }
    for group in "ab":
        volts, amperes = (
            sqrt(max(mean[groups.named(f"{what}_square", group)], 0.0)) for what in ("voltage", "current")
        )
        result |= {
            groups.column("power", group, "w"): mean[groups.named("power", group)],
            groups.column("apparent_power", group, "va"): volts * amperes,
            groups.column("current", group, "rms_a"): amperes,
            groups.column("current", group, "peak_a"): mean[groups.named("peak", group)],
        }
    return {name: result[name] for name in UNITS}
