# SPDX-License-Identifier: GPL-3.0-or-later
"""The live page of a motor or transducer: ngspice as WebAssembly runs its decks in the browser, without a network.

``live_page/`` contains the template and the scripts, which fill the numbers into the decks of
:mod:`pyspice_runner.view.live_circuit` and show the results. The engine is the one of :mod:`pyspice_runner.spice.wasm`.
"""

from __future__ import annotations

import base64
import gzip
import hashlib
import json
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from pyspice_runner.circuit.law import PAPER_LAW
from pyspice_runner.circuit.state import Discretisation, written
from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.files import save_by_ending
from pyspice_runner.motor import contact as contact_law
from pyspice_runner.motor import strength
from pyspice_runner.motor.beam import solve_resonator
from pyspice_runner.motor.drive import TwoToneDrive, default_drive
from pyspice_runner.motor.load import available_motors, load_motor
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.parameters import Mount
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.run.waveforms import Array
from pyspice_runner.spice.ngspice import run_deck
from pyspice_runner.spice.wasm import FACTS, engine_file
from pyspice_runner.steady.steady import steady_state
from pyspice_runner.steady.transducer import heavier, resonance
from pyspice_runner.view import live_circuit as live
from pyspice_runner.view.outlines import axes_of, outlines

Result = TypeVar("Result")

SCRIPTS = ("solve.js", "vibration.js", "driver.js", "spectrum.js", "charts.js", "page.js")
PERIODS = 40  # of the drive, in which the page's deck settles from a steady state at another step
SHAPE_POINTS = 41  # of a mode shape
_HEAVIEST = 20.0  # factor of the damping of a loaded mode, to which the slider of a transducer's load reaches


def live_page(motor: Motor, others: Sequence[Motor] | None = None) -> str:
    """Return the page as HTML, with a motor and others to select: by default the bundled ones, of a transducer none.

    Raise ParameterError for motors together with transducers, SimulationError if the engine is not installed.
    """
    if others is None:
        bundled = () if motor.is_transducer else map(load_motor, available_motors())
        others = [other for other in bundled if not other.contacts]
    motors = [motor, *(other for other in others if other.name != motor.name)]
    if any(other.is_transducer != motor.is_transducer for other in motors):
        raise ParameterError("A page has motors or transducers, not both: write one page for each kind.")
    script = "\n".join((live.ASSETS / name).read_text(encoding="utf-8") for name in SCRIPTS)
    style = (live.ASSETS / "live.css").read_text(encoding="utf-8")
    worker = "\n".join(
        path.read_text(encoding="utf-8") for path in (engine_file("ngspice.js"), live.ASSETS / "worker.js")
    )
    assert "</script" not in script + worker
    return live.rendered(
        "live.html.j2",
        policy=content_policy(script, style),
        style=style,
        script=script,
        worker=worker,
        data=packed(json.dumps(page_data(motors)).encode()),
        wasm=base64.b64encode(engine_file("ngspice.wasm.gz").read_bytes()).decode("ascii"),
        engine=FACTS,
        licence=engine_file("LICENSE").read_text(encoding="utf-8"),
        version=version("piezomotor"),
        transducer=motor.is_transducer,
    )


def content_policy(script: str, style: str) -> str:
    """Return the content security policy: this script, this style, a worker from memory, and no network."""
    hashes = [base64.b64encode(hashlib.sha256(text.encode()).digest()).decode("ascii") for text in (script, style)]
    return (
        f"default-src 'none'; script-src 'sha256-{hashes[0]}' 'wasm-unsafe-eval'; style-src 'sha256-{hashes[1]}'; "
        "worker-src blob:; img-src data:; connect-src 'none'; form-action 'none'; base-uri 'none'"
    )


def page_data(motors: Sequence[Motor]) -> dict[str, Any]:
    """Return the data of the scripts: motors with their decks, presets, and the marks of a driver's lines."""
    data = [_motor(motor) for motor in motors]
    return {
        "motors": data,
        "first": _if_known(first_answer, motors[0], data[0]["decks"], data[0]["defaults"].get("torque", 0.0)),
        "presets": [preset for motor in motors for preset in _presets(motor)],
        "marks": [live.DRIVER, live.END],
    }


def packed(data: bytes) -> str:
    """Return data for a page: compressed by gzip, in base64."""
    return base64.b64encode(gzip.compress(data, 9, mtime=0)).decode("ascii")


def _motor(motor: Motor) -> dict[str, Any]:
    """Return a motor for the page: decks, first settings, and data of the pictures."""
    step, sprung = live.live_step(motor), None if motor.is_transducer else live.mounts(motor)["sprung"].mount
    # the stiffness in the netlist, by which a displacement follows from the force of a mode's spring
    modes = [
        {
            "name": mode.name, "stiffness": written(mode, Discretisation(step))[1], "frequency": mode.frequency_hz,
            "damping": mode.damping_n_s_per_m, "coupling": mode.couplings,
        }
        for mode in motor.modes
    ]  # fmt: skip
    common: dict[str, Any] = {
        "name": motor.name,
        "transducer": motor.is_transducer,
        "label": f"{motor.name}, {default_drive(motor).frequencies[0] / 1e3:.3g} kHz",
        "description": "; ".join(
            f"{mode.name} {mode.frequency_hz / 1e3:.4g} kHz, Q {mode.quality_factor:.3g}" for mode in motor.modes
        ),
        "decks": live.live_decks(motor),
        "modes": modes,
        "groups": motor.groups,
        "step": step,
        "vectors": len(live.live_vectors(motor, driver=False)) + 1,
        "thermalResistance": (motor.limits or Thermal()).thermal_resistance_k_per_w,
        "rated": _rated(motor),
        "defaults": _defaults(motor, sprung),
    }
    if sprung is None:
        if more := _if_known(heavier, motor, int(np.abs(motor.load_motion).argmax()), _HEAVIEST):
            common["defaults"]["load"], common["more"] = motor.load_resistance_n_s_per_m, more
        return common
    return common | {
        "laws": live.laws(motor),
        "linear": motor.slider is not None,
        "radius": motor.rotor.radius_m,
        "inertia": motor.rotor.inertia_kg_m2,
        "bearing": motor.rotor.bearing_damping_n_m_s,
        "dryBearing": motor.rotor.bearing_friction_n_m,
        "driverStep": live.live_step(motor, driver=True),
        "driverPoints": live.DRIVER_POINTS,
        "harmonics": live.HARMONICS,
        "slider": live.SLIDER_AT_START,
        "carrierTime": 1.0 / sprung.frequency_hz,
        "beam": _beam(motor),
        "plate": _plate(motor),
    }


def _rated(motor: Motor) -> dict[str, Any] | None:
    """Return limits in MPa and °C, their cautions, and the stress of the ceramic per modal displacement in MPa/µm."""
    limits = motor.limits
    if limits is None:
        return None
    stress = strength.of_modes(motor)[1]
    return {
        "strength": 1e-6 * limits.dynamic_strength_pa,
        "ambient": limits.ambient_c,
        "most": 0.5 * limits.curie_temperature_c,
        "stress": [[float(f"{1e-12 * value:.5g}") for value in point] for point in stress],
        "stressed": strength.STRESSED,
        "heated": strength.HEATED,
    }


def _defaults(motor: Motor, sprung: Mount | None) -> dict[str, float | str]:
    """Return the first settings of a motor, in SI units; ``sprung`` is its mount, ``None`` of a transducer."""
    drive = default_drive(motor)
    two = isinstance(drive, TwoToneDrive)
    tone, second = drive.tones[0][0], drive.tones[0][-1]
    found = {"voltage": tone.amplitude, "frequency": tone.frequency, "phase": 90.0 if two else drive.phase_deg}
    if sprung is None:
        return {name: value for name, value in found.items() if name != "phase" or len(motor.groups) == 2}
    return found | {
        "voltage_2": second.amplitude,
        "frequency_2": second.frequency if two else 2.0 * tone.frequency,
        "phase_2": drive.phase_deg if two else 0.0,
        "preload": motor.contact.preload_n,
        "friction": motor.contact.friction,
        "torque": half_load(motor),
        "speed": 0.0,
        "stiffness": sprung.stiffness_n_per_m,
        "kind": "two-tone" if two else "two-phase",
        "shaft": "free",
        "mount": "sprung" if motor.mount else "held",
        "law": PAPER_LAW.name,
    }


def _round(value: float, digits: int = 1) -> float:
    return float(f"{value:.{digits}g}")


def _presets(motor: Motor) -> list[dict[str, Any]]:
    """Return the presets of a motor: name, motor, and the settings that differ from its defaults."""
    found: list[tuple[str, dict[str, Any]]] = [("recommended drive", {})]
    if motor.is_transducer:
        found += [(f"{at} resonance", {"frequency": resonance(motor, at)}) for at in ("series", "parallel")]
    else:
        torque = motor.contact.friction * motor.contact.preload_n * motor.rotor.radius_m
        found += [
            ("stall: the shaft is held", {"shaft": "held", "speed": 0.0}),
            ("over-run: the load drives the shaft", {"torque": _round(-0.3 * torque, 2)}),
        ]
    if motor.name == "andersen2002":
        pressed = contact_law.resonance_under_preload(motor.contact, motor.modes[0])
        found += [
            ("the paper's figure 5: ellipse", {"voltage": 50.0, "frequency": 51.7e3, "phase": 90.0}),
            ("the paper's eq. (2): figure eight", {
                "kind": "two-tone", "voltage": 50.0, "frequency": 25e3, "voltage_2": 50.0, "frequency_2": 50e3}),
            ("first resonance: the tip hammers", {"voltage": 30.0, "frequency": _round(pressed, 4), "phase": 0.0}),
        ]  # fmt: skip
    if motor.name == "andersen2002-unintended-mode":
        found.append(("the paper's figure 6: 46 kHz", {"frequency": 46e3}))
    return [{"name": f"{motor.name}: {name}", "motor": motor.name, "values": values} for name, values in found]


def _beam(motor: Motor) -> dict[str, Any] | None:
    """Return shapes of the modes and places of the parts along the beam, as shares of its length."""
    structure = motor.structure
    if structure is None:
        return None
    length = structure.beam.length_m
    resonator = solve_resonator(structure.beam, structure.patches, structure.tip, count=len(motor.modes))
    shapes = resonator.deflection(np.linspace(0.0, length, SHAPE_POINTS)).T
    return {
        "foot": structure.tip.position_m / length,
        "shapes": np.round(shapes, 5).tolist(),
        "patches": [
            {"group": patch.group, "start": patch.start_m / length, "end": patch.end_m / length}
            for patch in structure.patches
        ],
    }


def _plate(motor: Motor) -> list[dict[str, Any]] | None:
    """Return the outlines of a solid in mm, along and towards the rotor from the contact, and their modes.

    A mode is a displacement per modal displacement.
    """
    solid = motor.solid
    if solid is None:
        return None
    signs = {"xyz".index(sense[1]): float(f"{sense[0]}1") for sense in (solid.contact.tangent, solid.contact.normal)}
    plane = axes_of(solid)
    turn = [plane.index(axis) for axis in signs]
    sign = np.array(list(signs.values()))[:, None]
    contact = 0.5 * (np.array(solid.contact.from_m) + np.array(solid.contact.to_m))[plane]
    found = []
    for part in outlines(solid):
        line = 1e3 * sign * (part.line_m - contact[:, None])[turn]
        shapes = np.moveaxis(sign[..., None] * part.shapes[turn], 2, 0)
        found.append(
            {"name": part.name, "colour": part.colour, "line": _rows(line, 3), "shapes": [_rows(s, 4) for s in shapes]}
        )
    return found


def _rows(values: Array, digits: int) -> list[list[float | None]]:
    """Return an array for JSON, with ``null`` for NaN."""
    return [[None if np.isnan(value) else round(float(value), digits) for value in row] for row in values]


def half_load(motor: Motor) -> float:
    """Return half of the stall torque in N·m at the recommended drive; 0 without a stable steady state."""
    stalled = _if_known(steady_state, motor, default_drive(motor), speed=0.0, audit=False)
    return _round(0.5 * stalled.torque_n_m, 2) if stalled and stalled.stable else 0.0


def _if_known(compute: Callable[..., Result | None], *arguments: Any, **settings: Any) -> Result | None:
    """Return the result of a function, or ``None`` if it raises an error of the package.

    The page needs neither a steady state nor ngspice on this computer: its own engine computes every answer again. A
    failure of ngspice is a warning.
    """
    try:
        return compute(*arguments, **settings)
    except ParameterError:
        return None
    except SimulationError as error:
        warnings.warn(f"The page has no first picture: {error}", stacklevel=2)
        return None


def first_answer(motor: Motor, decks: Mapping[str, str], torque: float) -> dict[str, Any] | None:
    """Return the answer to the first setting of the page, computed by its own decks under a load in N·m.

    It contains the deck of the full motor, its vectors in the last period, and the vectors of the torque curve of the
    averaged motor. ``None`` without a stable steady state, and for a motor that the averaged motor does not describe.

    Raises:
        ParameterError: for a motor whose steady state is not computed.
        SimulationError: if ngspice fails.
    """
    mount = "sprung" if motor.mount else "held"
    state = steady_state(motor, default_drive(motor), load_torque=torque, audit=False)
    if not state.stable or state.solution is None or f"curve {mount}" not in decks:
        return None
    period, speed = 1.0 / default_drive(motor).frequencies[0], state.speed_rad_s
    stop = PERIODS * period
    settings = {"torque": torque, "stop": stop, **live.starts_of(state.solution)}
    cycles = _with(decks[f"cycles {mount} {PAPER_LAW.name}"], settings)
    curve = _with(decks[f"curve {mount}"], {"slowest": -0.15 * speed, "fastest": 1.5 * speed})
    names = live.live_vectors(motor, driver=False)
    run = _vectors(cycles, names, stop)
    time = run["time"]
    kept = slice(int(np.searchsorted(time, time[-1] - 1.001 * period)) - 1, None)  # the page interpolates to its start
    followed = ["v(shaft)", "v(xmotor.friction)"]
    ramp = _vectors(curve, followed, live.RAMP)
    return {
        "motor": motor.name,
        "deck": cycles,
        "cycles": {"time": _short(time[kept] - time[kept][0]), **{name: _short(run[name][kept]) for name in names}},
        "curve": {name: _short(ramp[name]) for name in ("time", *followed)},
    }


def _with(deck: str, values: Mapping[str, float]) -> str:
    """Return a deck with other numbers on its ``.param`` lines."""
    for name, value in values.items():
        head, mark, rest = deck.partition(f"\n.param {name}=")
        deck = f"{head}{mark}{value:.12g} {rest.partition(' ')[2]}"
    return deck


def _vectors(deck: str, names: Sequence[str], stop_time: float) -> dict[str, Array]:
    """Run a deck without its measurements, for which ngspice must write no raw file."""
    lines = (line for line in deck.splitlines(keepends=True) if not line.startswith(".measure "))
    run = run_deck("".join(lines), vectors=names, stop_time=stop_time)
    return {name: np.asarray(run.raw.vectors[name], dtype=float) for name in ("time", *names)}


def _short(values: Iterable[float]) -> list[float]:
    return [float(f"{value:.7g}") for value in values]


def save_live_page(motor: Motor, path: str | Path) -> Path:
    """Write the page into a file that ends in .html, and return its path; see :func:`.save_by_ending`."""
    text = live_page(motor)
    return save_by_ending(path, {".html": lambda place: place.write_text(text, encoding="utf-8", newline="\n")})
