# SPDX-License-Identifier: GPL-3.0-or-later
"""Transients of the averaged motor over seconds, with settings that change as in a control loop."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from math import isfinite
from time import monotonic
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import SkipValidation

from pyspice_runner.analysis.bursts import short_bursts
from pyspice_runner.analysis.dynamometer import STUCK, stuck
from pyspice_runner.engine import Engine
from pyspice_runner.engine.compiler import find_compiler
from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.model import contact as contact_law
from pyspice_runner.model.drive import Drive, Load, TwoPhaseDrive, check_together, too_fast
from pyspice_runner.model.motor import Motor
from pyspice_runner.model.parameters import Contact
from pyspice_runner.model.refusal import checked
from pyspice_runner.model.shaft import UNCOUPLED, ShaftLoad
from pyspice_runner.model.strength import peak_of_amplitudes, temperature_rise
from pyspice_runner.model.thermal import Thermal
from pyspice_runner.netlist.averaged import (
    HARMONICS,
    PHASES,
    SETTINGS,
    SPECIAL,
    Course,
    averaged_bench,
    check_averaged,
    check_resolution,
    constant_settings,
)
from pyspice_runner.netlist.averaged_driver import AveragedDrive
from pyspice_runner.netlist.contact import PAPER_LAW, ContactLaw
from pyspice_runner.netlist.drivers import Driver
from pyspice_runner.netlist.sources import Bench
from pyspice_runner.result import Audit, Result, contact_row
from pyspice_runner.run.averaged_motor import AveragedMotor
from pyspice_runner.run.ceramic import stated
from pyspice_runner.run.kernel import Outcome, progress_callback, run_bench, simulator, transient_timing
from pyspice_runner.run.waveforms import ROUNDING_RAD_S, SETTLED, SMALL_TORQUE
from pyspice_runner.run.window import averaged_to_come

Array = NDArray[np.float64]
MOST_POINTS_OF_A_COURSE = 10_000
VALUES_OF_A_FUNCTION = 1000  # over the duration of a run
CourseLike = ArrayLike | Callable[[float], float]
FEWEST_PERIODS = 10
ROUNDING_W = 1e-9  # power of a motor without drive
SMALL_RISE_K = 1.0  # added to a temperature rise to which its change is taken
LONGEST_STEPS = {"spice": 50, "compiled": 200}  # least number of steps of a run; linear in between
TRUSTED_CHECK, TRUSTED_OPEN = 0.02, 0.0
MOST_FACTOR = 4.0  # of the normal force by its damping, in piezomotor_averaged_phase.lib
BALANCE_BOUND = 0.05  # of the energy put in; the engine's own steps, summed by the trapezoidal rule
INPUT_OF = {  # setting → input of the averaged motor in C
    "frequency": "frequency", "voltage_a": "amplitude_a", "voltage_b": "amplitude_b", "phase_deg": "phase",
    "load_torque": "load_torque", "preload": "preload", "temperature": "ambient_temperature",
}  # fmt: skip

COLUMNS: dict[str, tuple[str, str]] = {
    "time_s": ("s", "time"),
    "frequency_hz": ("Hz", "drive frequency"),
    "amplitude_a_v": ("V", "amplitude of the voltage of group A"),
    "amplitude_b_v": ("V", "amplitude of the voltage of group B"),
    "phase_deg": ("deg", "phase of group B ahead of group A"),
    "current_amplitude_a_a": ("A", "amplitude of the current into group A"),
    "current_amplitude_b_a": ("A", "amplitude of the current into group B"),
    "electrical_power_w": ("W", "real power into both groups"),
    "heat_w": ("W", "losses of the stator: dielectric and modal damping"),
    "contact_power_w": ("W", "power of the stator into the contact: friction loss and power on the rotor"),
    "tip_x_amplitude_m": ("m", "amplitude of the tip's fundamental, tangential"),
    "tip_y_amplitude_m": ("m", "amplitude of the tip's fundamental, towards the rotor"),
    "normal_force_n": ("N", "mean normal force"),
    "torque_n_m": ("N·m", "mean torque of the contact on the rotor"),
    "load_torque_n_m": ("N·m", "torque that the load draws"),
    "rotor_speed_rad_s": ("rad/s", "rotor speed"),
    "rotor_position_rad": ("rad", "angle of the rotor"),
    "separated": ("1", "share of the period in which the contact is open"),
    "slip": ("1", "share of the period in which the contact slips"),
    "temperature_k": ("K", "temperature of the stator above that at which its parameters hold"),
    "check": ("1", "motion at the harmonics that are left out, relative to static penetration and limit of stick"),
}


@dataclass(frozen=True, repr=False)
class AveragedRun(Result):
    """A run of the averaged motor: means and amplitudes over time.

    The arrays share one time axis, which is not uniform.

    Attributes:
        curves: the arrays by the names of :data:`COLUMNS`; each is an attribute as well.
        energy_residual: energy into the stator that is not found as heat, in the modes, in the plates or in the
            contact, relative to the energy put in.
        solver_seconds: wall time that the engine took.
        ngspice_version: version of ngspice; ``None`` of a run with the compiled motor.
        provenance: motor, drive and run settings, JSON-ready.
        write_deck: returns the netlist of the run, for ngspice.
        audit: the power balance.
    """

    curves: Mapping[str, Array] = field(repr=False)
    energy_residual: float
    solver_seconds: float
    ngspice_version: str | None
    provenance: dict[str, Any] = field(repr=False)
    write_deck: Callable[[], str] = field(repr=False)
    audit: Audit = field(default_factory=Audit)

    units = COLUMNS

    if TYPE_CHECKING:  # the curves are attributes

        def __getattr__(self, name: str) -> Array: ...

    def __post_init__(self) -> None:
        object.__setattr__(self, "curves", self._keyed(self.curves))
        self.__dict__.update(self.curves)

    @cached_property
    def deck(self) -> str:  # type: ignore[override]
        """Netlist of the run, for ngspice."""
        return self.write_deck()

    @property
    def linear(self) -> bool:
        """Whether the motor has a slider."""
        return "slider" in self.provenance["motor"]

    def columns(self) -> Mapping[str, Array]:
        """Return the curves over time."""
        return self.curves

    @property
    def trusted(self) -> bool:
        """Whether the model's own check passes throughout the run, and the rotor keeps its limit of speed.

        The check passes where the harmonics of the model are enough, the contact stays closed, damping multiplies
        the normal force by 4 at most, and the drive has no burst below 60 periods. Where it does not, speed and torque
        may be off by more than 2 % of the friction torque μ F₀ R.
        """
        fastest = float(np.abs(self.curves["rotor_speed_rad_s"]).max())
        return not (self._model_cautions or too_fast(self.provenance["motor"], fastest))

    @property
    def _model_cautions(self) -> tuple[str, ...]:
        check, opened = (float(self.curves[name].max()) for name in ("check", "separated"))
        factor = damping_factor(self.provenance["motor"], self.curves["frequency_hz"], self.curves["tip_y_amplitude_m"])
        amplitude = np.maximum(self.curves["amplitude_a_v"], self.curves["amplitude_b_v"])
        bursts = short_bursts(self.curves["time_s"], amplitude, float(self.curves["frequency_hz"].min()))
        return (*model_cautions(check, opened, factor), *bursts)

    @property
    def cautions(self) -> tuple[str, ...]:
        """Findings of the audit and of the model's own check; whether friction holds a held shaft at the end."""
        end = {name: float(self.curves[name][-1]) for name in ("slip", "separated")}
        held = self.provenance["run"]["speed_rad_s"] is not None
        sticks = (STUCK,) if held and stuck(end) else ()
        return self._told((*self.audit.findings, *self._model_cautions, *sticks, *self.provenance["cautions"]))

    @cached_property
    def to_come(self) -> dict[str, float | None]:
        """By how much values at the end would still change if the run went on, relative; by extrapolation.

        Speed, of a held shaft torque, electrical power, and the temperature of a stator that heats up; torque plus a
        fiftieth of what friction can transmit, temperature rise plus 1 K. ``None``: too short to tell.
        """
        motor = self.provenance["motor"]
        contact, radius = motor["contact"], 1.0 if self.linear else motor["rotor"]["radius_m"]
        free = self.provenance["run"]["speed_rad_s"] is None
        least = {"rotor_speed_rad_s": ROUNDING_RAD_S} if free else {
            "torque_n_m": SMALL_TORQUE * radius * contact["friction"] * contact["preload_n"]
        }  # fmt: skip
        least |= {"electrical_power_w": ROUNDING_W}
        least |= {"temperature_k": SMALL_RISE_K} if self.curves["temperature_k"].any() else {}
        found = {}
        for name, floor in least.items():
            values = getattr(self, name)
            share = averaged_to_come(self.curves["time_s"], values) / (abs(float(values[-1])) + floor)
            found[name] = share if isfinite(share) else None
        return found

    @property
    def settled(self) -> bool:
        """Whether these values stay within 2 % if the run goes on."""
        return not self._moving

    @property
    def _moving(self) -> str:
        """What has not settled, in words."""
        words = {
            "rotor_speed_rad_s": "speed", "torque_n_m": "torque", "electrical_power_w": "electrical power",
            "temperature_k": "temperature",
        }  # fmt: skip
        return ", ".join(words[name] for name, share in self.to_come.items() if share is None or share > SETTLED)

    def summary(self) -> dict[str, str]:
        """Return the most important values at the end of the run."""
        last = {name: float(values[-1]) for name, values in self.curves.items()}
        return self._worded({
            "speed": f"{last['rotor_speed_rad_s']:.4g} rad/s",
            "torque": f"{last['torque_n_m']:.4g} N·m",
            "duration": f"{last['time_s']:.4g} s",
            "settled": f"no: {self._moving}" if self._moving else "yes",
            "check": "passed" if self.trusted else "not passed",
            **contact_row(self.provenance["run"]),
            "electrical power": f"{last['electrical_power_w']:.4g} W",
            "temperature rise": f"{last['temperature_k']:.4g} K",
        })  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """Return the values at the end, JSON-ready, with the keys of ``simulate`` and those of the averaged model."""
        last = {name: float(values[-1]) for name, values in self.curves.items()}
        return self._keyed({
            "mean_rotor_speed_rad_s": last["rotor_speed_rad_s"],
            "mean_torque_n_m": last["torque_n_m"],
            "state_fractions": {
                "separated": last["separated"],
                "stick": max(0.0, 1.0 - last["separated"] - last["slip"]),
                "slip": last["slip"],
            },
            **self._entries("energy_residual", "trusted", "settled", "to_come"),
            "greatest_check": float(self.curves["check"].max()),
            "greatest_separated": float(self.curves["separated"].max()),
            "end": last,
            "points": len(self.curves["time_s"]),
            **self._entries("solver_seconds", "ngspice_version", "audit"),
            **self.provenance,
            **self._entries("cautions"),  # in place of those of the operating point alone
        })  # fmt: skip


def damping_factor(motor: Mapping[str, Any], frequency_hz: Array, tip_y_amplitude_m: Array) -> float:
    """Return the greatest factor by which damping multiplies the normal force of a motor, as of ``to_dict``."""
    damping = contact_law.normal_damping(Contact(**motor["contact"]))
    return 1.0 + damping * float(np.max(2.0 * np.pi * frequency_hz * tip_y_amplitude_m))


def model_cautions(check: float, opened: float, factor: float = 1.0) -> tuple[str, ...]:
    """Return the cautions for the largest check value, open share, and factor of the normal force by its damping."""
    found = []
    if check > TRUSTED_CHECK:
        found.append(
            f"The motion that the averaged model leaves out moves the tip by {check:.2g} of its static penetration "
            f"or limit of stick; up to {TRUSTED_CHECK:g} is accurate. Give more harmonics, or use the full motor."
        )
    if opened > TRUSTED_OPEN:
        found.append(
            f"The contact is open for up to {100.0 * opened:.3g} % of the period, where the averaged model is less "
            "accurate. Compare with the full motor, or give more phases and harmonics."
        )
    if factor > MOST_FACTOR:
        found.append(
            f"Damping along the normal multiplies the normal force by up to {factor:.3g}; the averaged model limits "
            f"this factor to {MOST_FACTOR:g}, so that its forces are too small. Use the full motor."
        )
    return tuple(found)


@checked
def simulate_averaged(
    motor: Motor,
    drive: Drive | Driver,
    duration: float,
    *,
    contact: ContactLaw | None = "spring-slider",
    speed: float | None = None,
    load_torque: float = 0.0,
    shaft: ShaftLoad | None = None,
    courses: Mapping[str, SkipValidation[CourseLike]] | None = None,
    thermal: Thermal | None = None,
    phases: int = PHASES,
    harmonics: int = HARMONICS,
    engine: Engine = "auto",
    progress: Callable[[float, float], object] | None = None,
    timeout: float | None = None,
) -> AveragedRun:
    """Run the averaged motor from preloaded rest: seconds of motor time in some milliseconds.

    Amplitudes and means replace the waveforms; ``docs/averaged.md`` says what that leaves out. The result says by
    :attr:`AveragedRun.trusted` whether the model's own check passes.

    Args:
        motor: the motor.
        drive: a two-phase drive, whose soft start is a course of both voltages; or a driver, whose network (inductor
            or LLCC) is averaged too, behind the fundamental of its stages. The commanded amplitudes and phase are
            those of the stages, the amplitudes in the result those of the groups.
        duration: simulated time in s.
        contact: law of the contact; only ``"spring-slider"`` has an average.
        speed: if given, the shaft is held at this speed, rad/s.
        load_torque: torque in N·m that a load draws from the free shaft.
        shaft: a mass that is coupled to the free shaft.
        courses: what changes during the run: ``frequency`` (Hz), ``voltage`` (V, both groups), ``voltage_a``,
            ``voltage_b``, ``phase_deg``, ``load_torque`` (N·m), ``preload`` (N, not in ngspice), ``temperature`` (K, of
            the surroundings above that of the parameters; takes ``thermal``) → rows of time (s) and value, linear in
            between; a number; or a function of the time, of which a thousand values in the run are taken.
        thermal: drift with temperature; the losses then heat the stator.
        phases: number of phases of the period at which the contact is evaluated.
        harmonics: number of harmonics of the tip's motion, 1 to 6.
        engine: ``"compiled"``, the averaged motor in C, which takes a C compiler; ``"spice"``, its netlist in ngspice;
            ``"auto"``, the compiled motor where a compiler is installed.
        progress: called some times a second with the part that is done, 0 to 1, and the seconds that are left.
        timeout: wall time in s after which the run is ended.

    Raises:
        ParameterError: for a value out of range, another kind of drive or law.
        SimulationError: if the engine fails or its result cannot be trusted.
    """
    front = AveragedDrive.of(drive)
    drive = front.stage
    check_averaged(contact)
    check_resolution(phases, harmonics)
    check_together(motor, drive)
    load = Load(speed, load_torque)
    load.check(motor)
    if not (isfinite(duration) and duration >= FEWEST_PERIODS * drive.period):
        raise ParameterError(
            f"duration = {duration:g} s is out of range: it must be at least {FEWEST_PERIODS} periods of the drive, "
            f"{FEWEST_PERIODS * drive.period:.3g} s."
        )
    settings = settings_of(motor, drive, load, courses or {}, duration, thermal)
    coupled = coupled_to(shaft, speed)
    used = averaged_engine(engine)
    longest = max(duration / LONGEST_STEPS[used], drive.period)  # the compiled motor damps what is faster
    timing = transient_timing(drive.period, duration, longest)
    vectors = _vectors(motor, harmonics, thermal)

    def bench() -> Bench:
        return averaged_bench(
            motor, settings, load=load, phases=phases, harmonics=harmonics, thermal=thermal, shaft=coupled,
            add_networks=front.add if front.networks else None,
        )  # fmt: skip

    report = progress and progress_callback(progress, duration)
    course = None if speed is not None else settings["load_torque"]
    version, deck_sha256 = None, {}
    if used == "compiled":
        running = AveragedMotor(
            motor, thermal=thermal, shaft=coupled, speed=speed, phases=phases, harmonics=harmonics, longest=longest,
            networks=front.networks,
        )  # fmt: skip
        begun = monotonic()
        inputs = {of_c: settings[name] for name, of_c in INPUT_OF.items() if name in settings}
        columns = compiled_columns(motor, running.record(inputs, duration, timeout=timeout, progress=report), course)
        seconds, stored = monotonic() - begun, columns.pop("stored_energy")
        amplitudes = running.mode_amplitudes()
        write_deck = partial(deck_of, bench, vectors, timing)
    else:
        outcome = run_bench(bench(), vectors, timeout, "transient", timing, progress=report)
        columns, stored = _columns(motor, outcome, harmonics, course)
        seconds, version = outcome.seconds, outcome.ngspice_version
        deck_sha256 = {"deck_sha256": outcome.deck_sha256}
        amplitudes = mode_amplitudes(motor, outcome.vectors(), harmonics)
        write_deck = partial(str, outcome.deck)
    residual = _missing_energy(columns, stored)
    missing = (
        f"The energy balance misses {100.0 * residual:.3g} % of the energy put in; the time steps explain up to "
        f"{100.0 * BALANCE_BOUND:g} %."
    )
    return AveragedRun(
        curves=columns,
        energy_residual=residual,
        audit=Audit(() if residual <= BALANCE_BOUND else (missing,)),
        solver_seconds=seconds,
        ngspice_version=version,
        provenance={
            "motor": motor.to_dict(),
            "drive": front.to_dict(),
            "run": {
                "engine": used,
                "duration_s": duration, **PAPER_LAW.to_dict(), "speed_rad_s": speed, "load_torque_n_m": load_torque,
                "shaft": None if shaft is None else shaft.model_dump(), "phases": phases, "harmonics": harmonics,
                "courses": {name: [*map(list, course)] for name, course in settings.items() if len(course) > 1},
                "thermal": None if thermal is None else thermal.model_dump(),
            },
            **deck_sha256,
            **averaged_ceramic(
                motor, amplitudes, float(columns["normal_force_n"][-1]), float(columns["heat_w"][-1]),
                columns["rotor_speed_rad_s"],
            ),
        },
        write_deck=write_deck,
    )  # fmt: skip


def averaged_engine(engine: Engine) -> Literal["spice", "compiled"]:
    """Return the engine that runs an averaged motor; raise SimulationError for ``"compiled"`` without a C compiler."""
    if engine == "spice":
        return "spice"
    try:
        find_compiler()
    except SimulationError:
        if engine == "compiled":
            raise
        return "spice"
    return "compiled"


def deck_of(bench: Callable[[], Bench], vectors: Sequence[str], timing: Mapping[str, Any]) -> str:
    """Return the netlist of a transient of a bench."""
    return str(simulator(bench(), vectors).prepare("transient", **timing))


def mode_amplitudes(motor: Motor, samples: Mapping[str, Array], harmonics: int) -> list[float]:
    """Return the greatest displacement of each mode's coordinate at the end of a run of ngspice, m."""
    found = []
    for index in range(1, len(motor.modes) + 1):
        moves = [
            np.hypot(*(samples[f"v(xmotor.xmode{index}_{order}.r_{part})"][-1] for part in ("re", "im")))
            for order in range(1, harmonics + 1)
        ]
        found.append(1e-6 * float(sum(moves)))
    return found


def averaged_ceramic(
    motor: Motor, amplitudes: Sequence[float], normal_force: float, heat: float, speed: Array
) -> dict[str, Any]:
    """Return upper bounds of strain and stress at the end (all amplitudes in phase), and the temperature rise.

    ``amplitudes`` of the modes in m, ``normal_force`` in N and ``heat`` in W are those at the end; ``speed`` in rad/s
    is over time.
    """
    bent = [abs(mode.tip_y) * normal_force / mode.stiffness_n_per_m for mode in motor.modes]
    total = [static + moved for static, moved in zip(bent, amplitudes, strict=True)]
    rise = temperature_rise(motor, heat)
    return stated(motor, {**peak_of_amplitudes(motor, total), "temperature_rise_k": rise}, speed)


def coupled_to(shaft: ShaftLoad | None, speed: float | None = None) -> ShaftLoad:
    """Return the load that is coupled to a shaft. Raise ParameterError for one at a shaft that is held at a speed."""
    if shaft is not None and speed is not None:
        raise ParameterError("shaft has no effect on a shaft that is held at a speed. Leave one out.")
    return shaft or UNCOUPLED


def settings_of(
    motor: Motor, drive: TwoPhaseDrive, load: Load, courses: Mapping[str, CourseLike], duration: float,
    thermal: Thermal | None,
) -> dict[str, Course]:  # fmt: skip
    """Return the courses of all settings, constant unless the user gives one, over a duration in s.

    Preload and temperature are in it only if the user gives them. Raise ParameterError for an invalid course.
    """
    given = dict(courses)
    if "voltage" in given:
        if {"voltage_a", "voltage_b"} & given.keys():
            raise ParameterError("courses: voltage and voltage_a or voltage_b exclude each other. Give one or the two.")
        given["voltage_a"] = given["voltage_b"] = given.pop("voltage")
    settings = constant_settings(drive, load)
    if drive.soft_start > 0.0:
        settings["voltage_a"] = [(0.0, 0.0), (drive.soft_start, drive.voltage)]
        settings["voltage_b"] = [(0.0, 0.0), (drive.soft_start, drive.voltage_b)]
    for name, rows in given.items():
        if name == "reference":
            raise ParameterError("courses: reference has an effect on a controller only. Leave it out.")
        settings[name] = course_of(name, rows, duration)
    for name, value in (("preload", motor.contact.preload_n), ("temperature", thermal.ambient_k if thermal else 0.0)):
        if name in given and settings[name][0][1] != value:
            raise ParameterError(
                f"courses: {name} begins at {settings[name][0][1]:g} {SPECIAL[name]}: it must begin at that of the "
                f"motor, {value:g} {SPECIAL[name]}."
            )
    if "temperature" in given and thermal is None:
        raise ParameterError("courses: temperature takes thermal, which has the coefficients of the drift. Give it.")
    if load.speed is not None and "load_torque" in given:
        raise ParameterError("courses: load_torque has no effect on a shaft that is held at a speed. Leave one out.")
    return settings


def course_of(name: str, rows: CourseLike, duration: float) -> Course:
    """Return the course of a quantity over a duration in s, of which a function gives a thousand values.

    Raise ParameterError for an unknown name, or rows that are not valid.
    """
    known = SETTINGS | SPECIAL | {"reference": "the controller's unit"}
    if name not in known:
        raise ParameterError(f"courses: {name!r} is not known: it must be voltage or one of {', '.join(known)}.")
    try:
        if callable(rows):
            times = np.linspace(0.0, duration, VALUES_OF_A_FUNCTION + 1)
            table = np.array([[time, float(rows(float(time)))] for time in times])
        else:
            table = np.asarray(rows, dtype=float)
            table = np.array([[0.0, float(table)]]) if table.ndim == 0 else table
    except (TypeError, ValueError):
        table = np.empty(0)
    if table.ndim != 2 or table.shape[1] != 2 or not 1 <= len(table) <= MOST_POINTS_OF_A_COURSE:
        raise ParameterError(
            f"courses: {name} must be 1 to {MOST_POINTS_OF_A_COURSE} rows of time (s) and value ({known[name]}), a "
            "number, or a function of the time."
        )
    if not np.isfinite(table).all() or (np.diff(table[:, 0]) <= 0.0).any() or table[0, 0] < 0.0:
        raise ParameterError(f"courses: {name} must have finite values and rising times from 0 s on.")
    if name in ("frequency", "preload") and (table[:, 1] <= 0.0).any():
        unit = known[name]
        raise ParameterError(f"courses: {name} = {table[:, 1].min():g} {unit} is out of range: it must be > 0 {unit}.")
    return [(float(time), float(value)) for time, value in table]


def _vectors(motor: Motor, harmonics: int, thermal: Thermal | None) -> list[str]:
    names = ["v(set_frequency)", "v(set_a)", "v(set_b)", "v(set_phase)", "v(shaft)", "v(position)"]
    names += [f"v({pin})" for pin in ("a_re", "a_im", "b_re", "b_im")]
    names += [f"i(v{pin})" for pin in ("a_re", "a_im", "b_re", "b_im")]
    names += [f"v(xmotor.{node})" for node in ("normal", "friction", "open", "slip", "check", "x_0", "y_0")]
    names.append("v(heat)")
    names += ["v(temperature)"] if thermal else []
    for order in range(1, harmonics + 1):
        names += [f"v(xmotor.{axis}_{part}{order})" for axis in ("x", "y", "fx", "fy") for part in ("re", "im")]
        for index in range(1, len(motor.modes) + 1):
            mode = f"xmotor.xmode{index}_{order}"
            names += [f"v({mode}.{node}_{part})" for node in ("r", "v") for part in ("re", "im")]
    return names


def _columns(
    motor: Motor, outcome: Outcome, harmonics: int, load_torque: Course | None
) -> tuple[dict[str, Array], Array]:
    """Return the columns in SI units of a run of ngspice, and the energy in modes and clamped capacitances, J.

    ``load_torque`` is its course, or ``None`` for a held shaft, which draws the torque that the bearing leaves.
    """
    samples = outcome.vectors()
    time = samples["time"]

    def amplitude(name: str) -> NDArray[np.complex128]:
        return np.asarray(samples[name.format("re")] + 1j * samples[name.format("im")])

    voltages = {group: amplitude(f"v({group}_{{}})") for group in "ab"}
    currents = {group: amplitude(f"i(v{group}_{{}})") for group in "ab"}
    electrical, contact, stored = (np.zeros(len(time)) for _ in range(3))
    for group, capacitance in (("a", motor.piezo.capacitance_a_f), ("b", motor.piezo.capacitance_b_f)):
        electrical += 0.5 * np.real(voltages[group] * currents[group].conjugate())
        stored += 0.25 * capacitance * np.abs(voltages[group]) ** 2
    stored -= 0.5 * motor.piezo.capacitance_ab_f * np.real(voltages["a"] * voltages["b"].conjugate())
    for order in range(1, harmonics + 1):
        forces = {axis: amplitude(f"v(xmotor.f{axis}_{{}}{order})") for axis in "xy"}
        for index, mode in enumerate(motor.modes, start=1):
            place = f"xmotor.xmode{index}_{order}"
            velocity = amplitude(f"v({place}.v_{{}})")
            displacement = 1e-6 * amplitude(f"v({place}.r_{{}})")
            force = mode.tip_x * forces["x"] + mode.tip_y * forces["y"]
            contact -= 0.5 * np.real(force * velocity.conjugate())
            stored += 0.25 * (mode.mass_kg * np.abs(velocity) ** 2 + mode.stiffness_n_per_m * np.abs(displacement) ** 2)
    heat = samples["v(heat)"]
    torque = motor.rotor.radius_m * samples["v(xmotor.friction)"]
    columns = {
        "time_s": time,
        "frequency_hz": samples["v(set_frequency)"],
        "amplitude_a_v": np.abs(voltages["a"]),
        "amplitude_b_v": np.abs(voltages["b"]),
        "phase_deg": samples["v(set_phase)"],
        "current_amplitude_a_a": np.abs(currents["a"]),
        "current_amplitude_b_a": np.abs(currents["b"]),
        "electrical_power_w": electrical,
        "heat_w": heat,
        "contact_power_w": contact,
        "tip_x_amplitude_m": 1e-6 * np.abs(amplitude("v(xmotor.x_{}1)")),
        "tip_y_amplitude_m": 1e-6 * np.abs(amplitude("v(xmotor.y_{}1)")),
        "normal_force_n": samples["v(xmotor.normal)"],
        "torque_n_m": torque,
        "load_torque_n_m": _drawn(motor, time, torque, samples["v(shaft)"], load_torque),
        "rotor_speed_rad_s": samples["v(shaft)"],
        "rotor_position_rad": samples["v(position)"],
        "separated": np.clip(samples["v(xmotor.open)"], 0.0, 1.0),
        "slip": np.clip(samples["v(xmotor.slip)"], 0.0, 1.0),
        "temperature_k": samples.get("v(temperature)", np.zeros(len(time))),
        "check": samples["v(xmotor.check)"],
    }
    return {name: columns[name] for name in COLUMNS}, stored


def compiled_columns(motor: Motor, rows: Mapping[str, Array], load_torque: Course | None) -> dict[str, Array]:
    """Return the columns of a run of the compiled motor, and ``stored_energy`` in J; arguments as of ngspice's."""
    names = {
        "time_s": "time", "frequency_hz": "frequency", "phase_deg": "phase", "electrical_power_w": "electrical_power",
        "current_amplitude_a_a": "current_amplitude_a", "current_amplitude_b_a": "current_amplitude_b",
        "heat_w": "heat", "contact_power_w": "contact_power", "tip_x_amplitude_m": "tip_x_amplitude",
        "tip_y_amplitude_m": "tip_y_amplitude", "normal_force_n": "normal_force", "torque_n_m": "torque",
        "rotor_speed_rad_s": "speed", "rotor_position_rad": "position", "separated": "separated", "slip": "slip",
        "temperature_k": "temperature", "check": "check",
    }  # fmt: skip
    columns = {name: rows[of_c] for name, of_c in names.items()}
    pins = "pin_" if "pin_amplitude_a" in rows else ""
    columns |= {f"amplitude_{group}_v": np.abs(rows[f"{pins}amplitude_{group}"]) for group in "ab"}
    drawn = _drawn(motor, rows["time"], rows["torque"], rows["speed"], load_torque)
    columns["load_torque_n_m"] = drawn
    return {name: columns[name] for name in COLUMNS} | {"stored_energy": rows["stored_energy"]}


def _drawn(motor: Motor, time: Array, torque: Array, speed: Array, load_torque: Course | None) -> Array:
    """Return the torque that the load draws."""
    if load_torque is None:
        return np.asarray(torque - motor.rotor.bearing_damping_n_m_s * speed)
    return np.asarray(np.interp(time, *np.transpose(load_torque)))


def _missing_energy(columns: Mapping[str, Array], stored: Array) -> float:
    """Return the energy into the stator that is not found as heat, stored or in the contact, over that put in."""
    time, electrical, contact = (columns[name] for name in ("time_s", "electrical_power_w", "contact_power_w"))
    put_in = float(np.trapezoid(np.maximum(electrical, 0.0) + np.maximum(-contact, 0.0), time))
    missing = float(np.trapezoid(electrical - columns["heat_w"] - contact, time) - (stored[-1] - stored[0]))
    return abs(missing) / put_in if put_in > 0.0 else abs(missing)
