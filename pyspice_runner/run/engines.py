# SPDX-License-Identifier: GPL-3.0-or-later
"""The engines that run a motor: B-sources, which ngspice interprets, or a compiled Verilog-A module.

A compiler can generate wrong code without a message, as OpenVAF did. Therefore the compiled motor is compared with the
B-sources on the user's machine, once for each compiler, ngspice, and text of motor and module, in a short run in which
every term of the equations matters. The verdict is stored beside the compiled modules.
"""

from __future__ import annotations

import hashlib
import json
import platform
import shutil
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from functools import cache
from math import inf
from pathlib import Path

import numpy as np

from pyspice_runner.circuit.bench import DriveSource
from pyspice_runner.circuit.compiled import missing_form, module_of
from pyspice_runner.circuit.law import Law
from pyspice_runner.circuit.state import stems
from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.files import save_by_ending
from pyspice_runner.motor.drive import Load, TwoPhaseDrive
from pyspice_runner.motor.load import load_motor
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.stator import carriers
from pyspice_runner.run.kernel import modules_folder
from pyspice_runner.run.point import Point, Solver
from pyspice_runner.spice import Engine
from pyspice_runner.spice.ngspice import version_of
from pyspice_runner.spice.openvaf import (
    compiler_version,
    find_compiler,
    find_osdi_ngspice,
)
from pyspice_runner.spice.private_cache import is_private, make_private

BEHIND_DRIVER = "The periodic solution behind a driver is found with the B-sources."  # a reason for is_compiled
TOLERANCE = 2e-4  # of a signal, RMS relative to its size; both engines take the same steps and agree to 5e-5
COMPARED = ("current_a_a", "current_b_a", "tip_x_m", "tip_y_m", "friction_force_n", "rotor_speed_rad_s")
_PERIODS = 12  # of the drive: the contact opens, sticks and slips
_DRIVE = TwoPhaseDrive(voltage=150.0, frequency=40.1e3, phase_deg=120.0)
_LOAD = 1e-3  # N·m
_SKEW = 0.1  # of the tip's motion in one direction, in the other
_DRY = {"rotor.bearing_friction_n_m": 2e-3, "rotor.bearing_presliding_rad": 3e-5}
_SIDEWAYS = {"mount.tangential_stiffness_n_per_m": 2e4, "mount.tangential_damping_n_s_per_m": 50.0}
_LOSSES = {
    "contact.preload_n": 2.0,
    "contact.restitution": 0.8,
    "modes.0.softening_per_m2": 1e11,
    "modes.0.damping_growth_per_m2": 1e12,
}
_SOFT = {  # by :func:`.stems`, and of a worn tip
    "worn": {"contact.worn_flat_radius_m": 5e-5},
    "stem": {"contact.series_compliance_m_per_n": 2e-9},
    "stem_x": {"contact.tangential_series_compliance_m_per_n": 1e-8},
}
_FALLING = {"contact.sliding_ratio": 0.8, "contact.stribeck_velocity_m_s": 0.05}  # friction of the spring-slider


def fault_of(differences: Mapping[str, float]) -> str:
    """Return the fault that a comparison shows, as a sentence; empty if the compiled motor moves as the other does."""
    name, difference = max(differences.items(), key=lambda item: item[1])
    if difference <= TOLERANCE:
        return ""
    away = f"move as the B-sources do: {name} of a comparison of {_PERIODS} periods differs by "
    away += f"{100.0 * difference:.3g} %, more than {100.0 * TOLERANCE:g} %"
    what = "run where the B-sources do" if difference == inf else away
    return f"The compiled motor does not {what}. The compiler generates wrong code for the module."


def is_compiled(engine: Engine, motor: Motor, law: Law | None, reason: str = "") -> bool:
    """Return whether a motor is to be run as a compiled module.

    ``reason`` says why the settings of the analysis have no compiled form; it is empty if they have one. For
    ``"compiled"`` raise ParameterError without a compiled form, and SimulationError without compiler or ngspice for it,
    or with a compiler whose motor does not move as the B-sources do.
    """
    if engine == "spice":
        return False
    reason = reason or missing_form(law)
    if reason:
        if engine == "auto":
            return False
        raise ParameterError(f'engine = "compiled" is not valid here: {reason} Take engine = "spice" or "auto".')
    assert law is not None
    try:
        fault = fault_of(verdict(motor, law))
    except SimulationError:
        if engine == "auto":
            return False
        raise
    if fault and engine == "compiled":
        raise SimulationError(f'{fault} Take engine = "spice".')
    return not fault


def on_engine(point: Point, engine: Engine, reason: str = "") -> Point:
    """Return an operating point that the engine runs; the arguments and errors are those of :func:`is_compiled`."""
    return replace(point, solver=replace(point.solver, compiled=is_compiled(engine, point.motor, point.law, reason)))


def verdict(motor: Motor, law: Law) -> Mapping[str, float]:
    """Return how far a motor with a law moves from the B-sources as a module, on this machine.

    Each signal of :data:`COMPARED` has its RMS difference over its RMS, infinite if the compiled motor failed. Raise
    SimulationError if compiler or ngspice are missing or fail.
    """
    dry, soft = motor.rotor.bearing_friction_n_m > 0.0, tuple(stems(motor, law))
    soft += ("worn",) if motor.contact.worn_flat_radius_m else ()
    shape = (len(motor.modes), len(carriers(motor.mount)), dry, soft)
    return _verdict(shape, law, tools(), modules_folder())


def tools() -> str:
    """Return which compiler and which ngspice run compiled modules here. Raise SimulationError if one is missing."""
    executable, compiler = find_osdi_ngspice(), find_compiler()
    return f"{compiler_version(compiler)}, ngspice {version_of(executable)} {executable}, {platform.machine()}"


@cache
def _verdict(shape: tuple[int, int, bool, tuple[str, ...]], law: Law, used: str, folder: Path) -> Mapping[str, float]:
    motor = _similar(*shape, law)
    spice = Point(motor, DriveSource(_DRIVE), Load(None, _LOAD), law)
    setups = [replace(spice, solver=Solver(compiled=compiled)) for compiled in (False, True)]
    texts = [f"{bench.circuit} {bench.start}" for bench in (setup.bench() for setup in setups)]
    told = "\n".join((used, module_of(motor, law).source, *texts))
    path = folder / "verdicts" / f"{hashlib.sha256(told.encode()).hexdigest()[:32]}.json"
    with suppress(OSError, ValueError, TypeError, KeyError):
        known = json.loads(path.read_text(encoding="utf-8")) if is_private(path) else {}
        return {name: float(known[name]) for name in COMPARED}
    found = _compared(*setups)
    with suppress(OSError, ParameterError):  # a verdict that cannot be stored is measured again
        make_private(path.parent)
        save_by_ending(path, {".json": lambda file: file.write_text(json.dumps(found), encoding="utf-8")})
        path.chmod(0o600)
    return found


def _similar(modes: int, moving: int, dry: bool, soft: tuple[str, ...], law: Law) -> Motor:
    """Return the motor that represents all motors with the same module.

    It is ``beam40`` with losses, its modes repeated at other frequencies. Every mode moves the tip
    both ways and shakes the carrier.
    """
    base = load_motor("beam40").updated(
        {
            **_LOSSES,
            **(_FALLING if law.name == "spring-slider" and "stem_x" not in soft else {}),
            **(_DRY if dry else {}),
            **{path: value for stem in soft for path, value in _SOFT[stem].items()},
            **({} if moving else {"mount": None}),
            **(_SIDEWAYS if moving > 1 else {}),
        }
    )
    several = []
    for number in range(modes):
        mode = base.modes[number % 2]
        changed = {
            "name": f"mode{number + 1}",
            "stiffness_n_per_m": mode.stiffness_n_per_m * (1 + number // 2),
            "tip_x": mode.tip_x + _SKEW * mode.tip_y,
            "tip_y": mode.tip_y + _SKEW * mode.tip_x,
            "recoil_kg": _SKEW * mode.mass_kg,
            "recoil_x_kg": _SKEW * mode.mass_kg,
        }
        several.append(mode.model_copy(update=changed))
    return base.model_copy(update={"modes": tuple(several)})


def _compared(spice: Point, compiled: Point) -> dict[str, float]:
    """Run both and return the differences of their signals."""
    columns = []
    for setup in (spice, compiled):
        recording = setup.recording()
        vectors = [*recording.vectors(COMPARED), *setup.source.vectors]
        try:
            samples = setup.run(_PERIODS / _DRIVE.frequency, vectors).vectors()
        except SimulationError as error:
            if not setup.solver.compiled or error.deck is None:
                raise
            shutil.rmtree(error.deck.parent, ignore_errors=True)
            return dict.fromkeys(COMPARED, inf)
        columns.append(recording.columns(samples, COMPARED))
    times = [waves["time_s"] for waves in columns]
    inside = times[0] < times[1][-3]  # ngspice 46 divides the last step
    differences = {}
    for name in COMPARED:
        expected = columns[0][name][inside]
        away = np.interp(times[0][inside], times[1], columns[1][name]) - expected
        size = float(np.sqrt(np.mean(expected**2)))
        differences[name] = float(np.sqrt(np.mean(away**2))) / size
    return differences
