# SPDX-License-Identifier: GPL-3.0-or-later
"""The decks that the live page runs: complete circuits whose ``.param`` lines the page fills in.

``averaged`` gives speed, torque and powers by the averaged motor, ``curve`` and ``response`` its torque over speed and
its speed over frequency. ``cycles`` gives the waveforms of the full motor, which starts from the amplitudes of the
averaged one, ``driver`` the same behind a user's lines, and ``admittance`` the small-signal two-port. Each deck runs as
it is written, with the values of the motor's parameter set, by ``ngspice -b``. A page changes the numbers on the
``.param`` lines and the lines between the marks :data:`DRIVER` and :data:`END`; it contains no physics. The decks are
made of the templates ``live_page/*.cir.j2`` and of the subcircuits of the motor.
"""

from __future__ import annotations

import re
from contextlib import suppress
from functools import cache, partial
from math import pi, sqrt
from pathlib import Path
from typing import Any

from pyspice_runner.averaged.library import OPTIONS as AVERAGED_OPTIONS
from pyspice_runner.averaged.library import AveragedSubCircuit, require_averaged
from pyspice_runner.circuit.bench import AC_OPTIONS, motor_bench
from pyspice_runner.circuit.law import LAWS, PAPER_LAW, Law
from pyspice_runner.circuit.motor import Assembly, MotorSubCircuit
from pyspice_runner.circuit.source import DriveSource, transient_options
from pyspice_runner.circuit.state import Discretisation, State, motor_states, plates_of
from pyspice_runner.errors import ParameterError
from pyspice_runner.motor import contact as contact_law
from pyspice_runner.motor.drive import TwoPhaseDrive, default_drive
from pyspice_runner.motor.load import load_motor
from pyspice_runner.motor.motor import Motor
from pyspice_runner.spice.library import slider_words
from pyspice_runner.steady.shooting import Orbit
from pyspice_runner.units import engineering

# of the averaged motor: with fewer phases speeds of andersen2002 at 52 to 53 kHz are off by a third; with 48 by 4 %
PHASES, CURVE_PHASES, HARMONICS = 48, 64, 2
RAMP = 0.6  # s, of the curve: bimodal40 lags by 4 % of the friction torque in one of 0.3 s, by 2.6 % in this one
POINTS, DRIVER_POINTS = 100, 160  # steps in the shortest period; a driver's deck has no modes adapted to the step
# the slider where the voltage of group A, a sine, is zero and rises: a quarter of a period before its peak
SLIDER_AT_START = f"xmotor.xcontact.slider{3 * PHASES // 4}"
DRIVER, END = "* driver: lines between source_a, source_b and the pins a, b", "* end of the driver"
_SPRUNG = "bimodal40"  # whose mount the page offers to a motor that has none

ASSETS = Path(__file__).parent / "live_page"


def laws(motor: Motor) -> list[str]:
    """Return the built-in contact laws that a motor can have."""
    found = []
    for law in LAWS:
        with suppress(ParameterError):
            MotorSubCircuit(motor, law=Law(law))
            found.append(law)
    return found


def fastest(motor: Motor) -> float:
    """Return the highest frequency in Hz of the modes, free and under preload."""
    resonances = motor.pressed_stator.resonances()
    return max(*(mode.frequency_hz for mode in motor.modes), *map(float, resonances))


def mounts(motor: Motor) -> dict[str, Motor]:
    """Return the motor with its stator held and on springs; a motor without springs gets those of ``bimodal40``."""
    mount = motor.mount or load_motor(_SPRUNG).mount
    assert mount is not None
    return {"held": motor.updated({"mount": None}), "sprung": motor.updated({"mount": mount.model_dump()})}


def live_decks(motor: Motor) -> dict[str, str]:
    """Return name → text of every deck of a motor.

    The names are ``averaged MOUNT``, ``curve MOUNT``, ``response MOUNT``, ``cycles MOUNT LAW``, ``driver MOUNT LAW``
    and ``admittance``, with a mount from :func:`mounts` and a law from :func:`laws`. A motor with a loss that the
    averaged motor leaves out has only the last three. A transducer has ``admittance``, its ``steady`` state by small
    signals, and ``cycles``, a run that starts from it.
    """
    decks = {"admittance": _admittance(motor)}
    if motor.is_transducer:
        return decks | {name: _vibration(motor, steady=name == "steady") for name in ("steady", "cycles")}
    for mount, moved in mounts(motor).items():
        with suppress(ParameterError):  # a motor with a loss that the averaged one leaves out
            require_averaged(motor)
            decks[f"averaged {mount}"] = _averaged(moved, "run")
            decks[f"curve {mount}"] = _averaged(moved, "curve")
            decks[f"response {mount}"] = _averaged(moved, "response")
        for law in laws(motor):
            decks[f"cycles {mount} {law}"] = _cycles(moved, law, driver=False)
            decks[f"driver {mount} {law}"] = _cycles(moved, law, driver=True)
    if motor.slider:  # comments on lines of their own, and behind a value
        words = partial(re.sub, r"(?m)^\* .*|; .*$", lambda found: slider_words(found[0]))
        decks = {name: words(text) for name, text in decks.items()}
    return decks


# --- parts of a deck ---


@cache
def _templates() -> Any:
    """Return the templates of pages and decks. Raise ParameterError if Jinja2 is not installed."""
    try:
        from jinja2 import Environment, FileSystemLoader, StrictUndefined, select_autoescape
    except ImportError:
        raise ParameterError("The page needs jinja2. Install it: `pip install jinja2`.") from None
    found = Environment(
        loader=FileSystemLoader([ASSETS, ASSETS.parent]), autoescape=select_autoescape(["html.j2"]),
        undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    found.filters |= {"si": engineering, "percent": lambda share: f"{100.0 * share:.3g} %", "number": _number}
    found.filters["text"] = lambda circuit: f"{circuit.parts}\n{str(circuit).strip()}"
    found.filters["options"] = lambda options: " ".join(f"{name}={value}" for name, value in options.items())
    return found


def rendered(template: str, **values: Any) -> str:
    """Return a page or a deck made of a template. Raise ParameterError if Jinja2 is not installed."""
    return str(_templates().get_template(template).render(values))


def _deck(template: str, motor: Motor, **values: Any) -> str:
    """Return a deck with the values of a motor and its drive; of a drive of two tones it has the first tone."""
    drive = default_drive(motor)
    phase = drive.phase_deg if isinstance(drive, TwoPhaseDrive) else 0.0
    tone, frequencies = drive.tones[0][0], drive.frequencies
    known = {"motor": motor, "tone": tone, "frequencies": frequencies, "phase": phase, "radians": pi / 180.0}
    return rendered(template, **known, **values) + "\n"


def _number(value: float) -> str:
    return f"{value:.10g}"


def _opened(circuit: Assembly, motor: Motor) -> Assembly:
    """Return a motor's subcircuit with the stiffness of its mount as a parameter of the X line."""
    if motor.mount:
        circuit.parameters["mount_stiffness"] = _number(motor.mount.stiffness_n_per_m)
        circuit["Xmount"].parameters["stiffness"] = "{mount_stiffness}"
    return circuit


def _starts(
    motor: Motor, law: Law | None, discretisation: Discretisation
) -> tuple[dict[str, str], list[tuple[str, float, State]]]:
    """Return the parameters of the X line for the motion with which a run starts, and the deck's in their expressions.

    The page gives the displacement of a mode, which the parameter of the X line counts from rest under the preload.
    """
    passed: dict[str, str] = {}
    found = []
    for state in motor_states(motor, law):
        if not state.part:
            continue
        name = _start_name(state)
        rest = state.at_rest(discretisation) / state.unit
        bending = f"+{_number(-rest / motor.contact.preload_n)}*preload" if rest else ""
        passed[state.parameter] = f"{{{name}{bending}}}"
        found.append((name, rest or 0.0, state))  # not -0
    return passed, found


def _start_name(state: State) -> str:
    return state.name.replace("displacement_", "start_").replace("share", "bearing_share")


def starts_of(orbit: Orbit) -> dict[str, float]:
    """Return the parameters of the full motor's deck for a start from a steady state."""
    states = zip(orbit.plant.states, orbit.state.tolist(), strict=True)
    return {_start_name(state): value / state.unit for state, value in states if state.part}


def _quick_damping(motor: Motor) -> float:
    """Return a damping of the carrier in N·s/m with which it settles on the contact within some periods.

    0.7 of the critical damping of its mass on the contact's stiffness, p F₀/δ₀. It changes no mean value.
    """
    assert motor.mount is not None
    stiffness = motor.contact.exponent * motor.contact.preload_n / contact_law.static_penetration(motor.contact)
    return max(motor.mount.damping_n_s_per_m, 1.4 * sqrt(stiffness * motor.mount.mass_kg))


# --- averaged motor ---


def _averaged(motor: Motor, kind: str) -> str:
    """Return a deck of the averaged motor: a spin-up, the curve over speed, or the response over frequency."""
    phases = PHASES if kind == "run" else CURVE_PHASES
    circuit = _opened(AveragedSubCircuit(motor, phases=phases, harmonics=HARMONICS), motor)
    steps, longest = {"run": (2000, 20), "curve": (1000, 60), "response": (1000, 240)}[kind]  # to print, and of the run
    return _deck(
        "averaged.cir.j2", motor, kind=kind, circuit=circuit, options=AVERAGED_OPTIONS, harmonics=HARMONICS,
        slider=SLIDER_AT_START, ramp=RAMP, steps=steps, longest=longest,
    )  # fmt: skip


# --- full motor ---


def live_step(motor: Motor, *, driver: bool = False) -> float:
    """Return the time step in s of the decks with waveforms."""
    return float(f"{1.0 / (fastest(motor) * (DRIVER_POINTS if driver else POINTS)):.4g}")


def _cycles(motor: Motor, law: str, *, driver: bool) -> str:
    """Return the deck of the full motor, two sources and a load torque; with ``driver`` a user's lines between them."""
    step = live_step(motor, driver=driver)
    discretisation = Discretisation(step, exact_resonance=not driver)
    circuit = _opened(MotorSubCircuit(motor, law=Law(law), discretisation=discretisation, startable=True), motor)
    passed, starts = _starts(motor, Law(law), discretisation)
    damping = _quick_damping(motor) if motor.mount else 0.0
    if motor.mount:
        circuit.parameters["damping"] = _number(damping)
        circuit["Xmount"].parameters["damping"] = "{damping}"
    of_driver = {"method": "trap", "reltol": "1e-4", "abstol": "1e-9", "vntol": "1e-6"}
    return _deck(
        "cycles.cir.j2", motor, law=law, driver=driver, circuit=circuit, step=step, starts=starts, passed=passed,
        damping=damping, options=of_driver if driver else transient_options(motor, Law(law)), marks=(DRIVER, END),
        plates={} if driver else _plates(motor), vectors=live_vectors(motor, driver=driver),
    )  # fmt: skip


def _plates(motor: Motor) -> dict[str, str]:
    """Return the initial voltages of the plates, by their nodes: those of the sources at t = 0."""
    drive = TwoPhaseDrive(voltage=1.0, frequency=motor.modes[-1].frequency_hz, phase_deg=45.0)
    start = {"a": "{voltage_2*sin(radians_2)}", "b": "{voltage*sin(radians)-voltage_2*sin(radians_2)}"}
    nodes = motor_bench(motor, DriveSource(drive)).start
    found = dict.fromkeys(nodes, start["b"])
    return found | {node.replace("xgroup_b", "xgroup_a"): start["a"] for node in nodes}


def live_vectors(motor: Motor, *, driver: bool) -> list[str]:
    """Return the vectors of the decks with waveforms, and of the steady state of a transducer."""
    if motor.is_transducer:
        pins = [f"{quantity}{group})" for group in motor.groups for quantity in ("v(", "i(v")]
        return [*pins, "v(xmotor.y)", *(state.within("xmotor") for state in motor_states(motor, None, ("mode",)))]
    names = ["v(a)", "v(b)", *(("i(vpin_a)", "i(vpin_b)") if driver else ("i(va)", "i(vb)")), "v(shaft)"]
    names += [f"v(xmotor.{node})" for node in ("x", "y", "normal", "friction", "slider", "state")]
    names += [state.within("xmotor") for state in motor_states(motor, PAPER_LAW, ("mode", "mount", "bearing"))]
    return names


# --- transducer ---


def _vibration(motor: Motor, *, steady: bool) -> str:
    """Return the deck of a transducer: its steady state by small signals, or a run from the motion of that state."""
    step = live_step(motor)
    circuit = MotorSubCircuit(motor, discretisation=None if steady else Discretisation(step), startable=not steady)
    passed, starts = ({}, []) if steady else _starts(motor, None, Discretisation(step))
    plates: dict[str, str] = {}
    if not steady:
        nodes = plates_of(motor, "b") if "b" in motor.groups else ()
        plates = {f"xmotor.{node}": f"{{voltage*sin(phase*{pi / 180.0!r})}}" for node in nodes}
        if motor.tool.mass_kg:  # it moves with what it is attached to
            parts = [f"({_number(along)})*velocity_{index}" for index, along in enumerate(motor.load_motion, start=1)]
            plates |= {f"xmotor.{node}": f"{{{'+'.join(parts)}}}" for node in ("heavy", "mass")}
    return _deck(
        "vibration.cir.j2", motor, steady=steady, driver=False, circuit=circuit, step=step, starts=starts,
        passed=passed, plates=plates, options=AC_OPTIONS if steady else transient_options(motor, None),
        vectors=live_vectors(motor, driver=False),
    )  # fmt: skip


# --- small signals ---


def _admittance(motor: Motor) -> str:
    """Return the deck of the electrical ports: free, and pressed against a rotor at rest; or idle, and under load."""
    low, high = 0.7 * min(mode.frequency_hz for mode in motor.modes), 1.2 * fastest(motor)
    if motor.is_transducer:  # whose resonances are narrow: about the drive
        low, high = (share * default_drive(motor).frequencies[0] for share in (0.9, 1.1))
    pressed = MotorSubCircuit(motor)
    free = MotorSubCircuit(motor.model_copy(update={"load": None}), law=None, name=f"{pressed.name}_free")
    copies = [f"{state}_{driven}" for state in ("free", "pressed") for driven in motor.groups]
    return _deck(
        "admittance.cir.j2", motor, lowest=low, highest=high, pressed=pressed, free=free, options=AC_OPTIONS,
        vectors=[f"i(v{group}_{copy})" for copy in copies for group in motor.groups],
    )  # fmt: skip
