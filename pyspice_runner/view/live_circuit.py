# SPDX-License-Identifier: GPL-3.0-or-later
"""The decks that the live page runs: complete circuits whose ``.param`` lines the page fills in.

``averaged`` gives speed, torque and powers by the averaged motor, ``curve`` and ``response`` its torque over speed and
its speed over frequency. ``cycles`` gives the waveforms of the full motor, which starts from the amplitudes of the
averaged one, ``driver`` the same behind a user's lines, and ``admittance`` the small-signal two-port. Each deck runs as
it is written, with the values of the motor's parameter set, by ``ngspice -b``. A page changes the numbers on the
``.param`` lines and the lines between the marks :data:`DRIVER` and :data:`END`; it contains no physics.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from functools import partial
from math import pi, sqrt

from pyspice_runner.averaged.library import OPTIONS as AVERAGED_OPTIONS
from pyspice_runner.averaged.library import AveragedSubCircuit, require_averaged
from pyspice_runner.circuit.bench import AC_OPTIONS, motor_bench
from pyspice_runner.circuit.law import LAWS, PAPER_LAW, Law
from pyspice_runner.circuit.motor import Assembly, MotorSubCircuit, TransducerSubCircuit
from pyspice_runner.circuit.source import DriveSource, transient_options
from pyspice_runner.circuit.state import Discretisation, State, motor_states, plates_of
from pyspice_runner.errors import ParameterError
from pyspice_runner.motor import contact as contact_law
from pyspice_runner.motor import groups
from pyspice_runner.motor.drive import TwoPhaseDrive, default_drive
from pyspice_runner.motor.load import load_motor
from pyspice_runner.motor.motor import Motor
from pyspice_runner.spice.library import slider_words
from pyspice_runner.steady.shooting import Orbit

# of the averaged motor: with fewer phases speeds of andersen2002 at 52 to 53 kHz are off by a third; with 48 by 4 %
PHASES, CURVE_PHASES, HARMONICS = 48, 64, 2
RAMP = 0.6  # s, of the curve: bimodal40 lags by 4 % of the friction torque in one of 0.3 s, by 2.6 % in this one
POINTS, DRIVER_POINTS = 100, 160  # steps in the shortest period; a driver's deck has no modes adapted to the step
# the slider where the voltage of group A, a sine, is zero and rises: a quarter of a period before its peak
SLIDER_AT_START = f"xmotor.xcontact.slider{3 * PHASES // 4}"
DRIVER, END = "* driver: lines between source_a, source_b and the pins a, b", "* end of the driver"
_RADIANS = pi / 180.0
_SPRUNG = "bimodal40"  # whose mount the page offers to a motor that has none

LOAD = "Iload shaft 0 DC {torque}\nVheld held 0 DC {held}\nGheld shaft 0 shaft held {grip}"

Values = dict[str, tuple[float | str, str]]  # name → number or expression, and its unit and meaning


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


def _deck(title: str, what: Iterable[str], values: Values, body: Iterable[str]) -> str:
    head = [f".title {title}", *(f"* {line}" for line in what), "* Run: ngspice -b THIS_FILE", "*"]
    lines = [f".param {name}={value} ; {meaning}" for name, (value, meaning) in values.items()]
    return "\n".join([*head, *lines, *body, ".end"]) + "\n"


def _number(value: float) -> str:
    return f"{value:.10g}"


def _options(options: Mapping[str, str]) -> str:
    return ".options " + " ".join(f"{name}={value}" for name, value in options.items())


def _settings(motor: Motor) -> Values:
    """Return the parameters of every deck; a drive of two tones has its first tone here."""
    drive = default_drive(motor)
    tone = drive.tones[0][0]
    values: Values = {
        "voltage": (_number(tone.amplitude), "V, amplitude"),
        "frequency": (_number(tone.frequency), "Hz"),
        "phase": (
            _number(drive.phase_deg if isinstance(drive, TwoPhaseDrive) else 0.0),
            "degrees, group B ahead of group A",
        ),
    }
    if motor.is_transducer:
        values["load"] = (_number(motor.load_resistance_n_s_per_m), "N.s/m, resistance of the load")
        return {name: value for name, value in values.items() if name != "phase" or len(motor.groups) == 2}
    values |= {
        "preload": (_number(motor.contact.preload_n), "N"),
        "friction": (_number(motor.contact.friction), "1, coefficient of friction"),
        "torque": ("0", "N.m, load"),
        "grip": ("0", "N.m.s, of a brake that holds the shaft at a speed; 0 leaves it free"),
        "held": ("0", "rad/s, speed of the brake"),
        "inertia": (_number(motor.rotor.inertia_kg_m2), "kg.m2, of the rotor"),
    }
    if motor.mount:
        values["mount_stiffness"] = (_number(motor.mount.stiffness_n_per_m), "N/m, springs that carry the stator")
    return values


def _opened(circuit: Assembly, motor: Motor) -> Assembly:
    """Return a motor's subcircuit with the stiffness of its mount as a parameter of the X line."""
    if motor.mount:
        circuit.parameters["mount_stiffness"] = _number(motor.mount.stiffness_n_per_m)
        circuit["Xmount"].parameters["stiffness"] = "{mount_stiffness}"
    return circuit


def _starts(motor: Motor, law: Law | None, discretisation: Discretisation) -> tuple[dict[str, str], Values]:
    """Return the parameters of the X line for the motion with which a run starts, and the deck's in their expressions.

    The page gives the displacement of a mode, which the parameter of the X line counts from rest under the preload.
    """
    passed: dict[str, str] = {}
    values: Values = {}
    for state in motor_states(motor, law):
        if not state.part:
            continue
        name = _start_name(state)
        rest = state.at_rest(discretisation) / state.unit
        bending = f"+{_number(-rest / motor.contact.preload_n)}*preload" if rest else ""
        passed[state.parameter] = f"{{{name}{bending}}}"
        values[name] = (_number(rest) if rest else "0", f"{state.kind} at the start, in the unit of {state.parameter}")
    return passed, values


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


def _text(circuit: Assembly) -> str:
    return f"{circuit.parts}\n{str(circuit).strip()}"


def _instance(circuit: Assembly, nodes: str, values: Values) -> str:
    passed = [f"{name}={{{name}}}" for name in values if name in circuit.parameters]
    return f"Xmotor {nodes} {circuit.name} {' '.join(passed)}"


# --- averaged motor ---


def _averaged(motor: Motor, kind: str) -> str:
    """Return a deck of the averaged motor: a spin-up, the curve over speed, or the response over frequency."""
    phases = PHASES if kind == "run" else CURVE_PHASES
    circuit = _opened(AveragedSubCircuit(motor, phases=phases, harmonics=HARMONICS), motor)
    values = _settings(motor)
    what, steps, longest = {  # number of values to print, and of the longest steps, in a run
        "run": ("spin-up of the averaged motor to its steady state", 2000, 20),
        "curve": ("torque over speed, averaged motor", 1000, 60),
        "response": ("speed and currents over frequency, averaged motor", 1000, 240),
    }[kind]
    drive, load = "DC {frequency}", LOAD
    sources = [
        f".param radians={{phase*{_RADIANS!r}}}",
        "Va_re a_re 0 DC {voltage}",
        "Va_im a_im 0 DC 0",
        "Vb_re b_re 0 DC {voltage*cos(radians)}",
        "Vb_im b_im 0 DC {voltage*sin(radians)}",
    ]
    start = ".ic v(a_re)={voltage} v(b_re)={voltage*cos(radians)} v(b_im)={voltage*sin(radians)}"
    measures: list[str] = []
    if kind == "run":
        extra = {"stop": ("0.05", "s, end of the run")}
        means = {"speed_rad_s": "v(shaft)", "friction_n": "v(xmotor.friction)", "heat_w": "v(heat)"}
        measures = [f".measure tran {name} FIND {vector} AT={{stop}}" for name, vector in means.items()]
    elif kind == "curve":
        extra = {"slowest": ("-5", "rad/s, first speed"), "fastest": ("50", "rad/s, last speed"),
                 "stop": (_number(RAMP), "s, end of the ramp")}  # fmt: skip
        load = "Vshaft shaft 0 PWL(0 {slowest} {0.2*stop} {slowest} {stop} {fastest})"
        start += " v(shaft)={slowest}"
    else:
        frequency = default_drive(motor).frequencies[-1]
        extra = {
            "first_frequency": (_number(1.04 * frequency), "Hz, at which the ramp begins"),
            "last_frequency": (_number(0.97 * frequency), "Hz, at which it ends"),
            "stop": ("1", "s, end of the ramp"),
        }
        drive = "PWL(0 {first_frequency} {0.1*stop} {first_frequency} {stop} {last_frequency})"
    vectors = [
        *(f"v({node})" for node in ("a_re", "a_im", "b_re", "b_im", "f", "shaft", "heat")),
        *(f"i(v{node})" for node in ("a_re", "a_im", "b_re", "b_im")),
        *(["i(vshaft)"] if kind == "curve" else []),
        *(f"v(xmotor.{node})" for node in ("normal", "friction", "open", "slip", "check")),
    ]
    if kind == "run":
        numbers = range(1, len(motor.modes) + 1)
        vectors += [f"v(xmotor.xbending{index}.r)" for index in numbers]
        vectors += [
            f"v(xmotor.xmode{index}_{order}.{node}_{part})"
            for index in numbers for order in range(1, HARMONICS + 1) for node in "rv" for part in ("re", "im")
        ]  # fmt: skip
        vectors += [f"v({SLIDER_AT_START})", *(f"v(xmotor.{axis}_{part}1)" for axis in "xy" for part in ("re", "im"))]
        vectors += ["v(xmotor.xmount.elastic)"] if motor.mount else []
    return _deck(
        f"{motor.name}: {what}",
        ["Complex amplitudes instead of waveforms; v(shaft) is the speed in rad/s."],
        values | extra,
        [
            *sources, f"Vfrequency f 0 {drive}", load, _text(circuit),
            _instance(circuit, "a_re a_im b_re b_im f shaft 0 heat", values),
            _options(AVERAGED_OPTIONS), start, f".save {' '.join(vectors)}",
            *measures, f".tran {{stop/{steps}}} {{stop}} 0 {{stop/{longest}}} uic",
        ],
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
    starts, start_values = _starts(motor, Law(law), discretisation)
    frequencies = default_drive(motor).frequencies
    second = frequencies[-1] if len(frequencies) > 1 else 2.0 * frequencies[0]  # of the drive, or its octave
    values = _settings(motor) | {
        "voltage_2": ("0", "V, amplitude of a second tone, which drives the groups against each other"),
        "frequency_2": (_number(second), "Hz, of the second tone"),
        "phase_2": ("0", "degrees, of the second tone"),
    }
    values |= _times(motor, step, "s, time step; the modes are written for it" if not driver else "s, time step")
    values |= start_values
    if motor.mount:
        circuit.parameters["damping"] = _number(_quick_damping(motor))
        circuit["Xmount"].parameters["damping"] = "{damping}"
        values["damping"] = (circuit.parameters["damping"], "N.s/m, of the carrier, so that it settles within the run")
    pins = ("source_a", "source_b") if driver else ("a", "b")
    body = [f".param radians={{phase*{_RADIANS!r}}}", f".param radians_2={{phase_2*{_RADIANS!r}}}"]
    for group, pin, sign, phase in (("a", pins[0], "", "0"), ("b", pins[1], "-", "{phase}")):
        body += [
            f"V{group} {pin} {groups.named('tone', group)} SIN(0 {{voltage}} {{frequency}} 0 0 {phase})",
            f"V{group}2 {groups.named('tone', group)} 0 SIN(0 {{{sign}voltage_2}} {{frequency_2}} 0 0 {{phase_2}})",
        ]
    if driver:
        body += [DRIVER, "Rwire_a source_a a 1m", "Rwire_b source_b b 1m", END]
    body += [LOAD, _text(circuit)]
    nodes = "pin_a pin_b 0 shaft" if driver else "a b 0 shaft"
    if driver:
        body += ["Vpin_a a pin_a 0", "Vpin_b b pin_b 0"]
    body.append(" ".join([_instance(circuit, nodes, values), *(f"{name}={value}" for name, value in starts.items())]))
    of_driver = {"method": "trap", "reltol": "1e-4", "abstol": "1e-9", "vntol": "1e-6"}
    options = of_driver if driver else transient_options(motor, Law(law))
    means = {
        "speed_rad_s": "AVG v(shaft)", "friction_n": "AVG v(xmotor.friction)", "normal_n": "AVG v(xmotor.normal)",
        "current_a_rms_a": "RMS i(va)", "current_b_rms_a": "RMS i(vb)",
    }  # fmt: skip
    body += [_options(options), *([] if driver else _plates(motor))]
    body += [f".save {' '.join(live_vectors(motor, driver=driver))}"]
    body += [f".measure tran {name} {how} FROM={{stop-window}} TO={{stop}}" for name, how in means.items()]
    return _deck(
        f"{motor.name}: {law}, cycle by cycle",
        [
            "The full motor. x, y, slider in um, forces in N, state 0 separated 1 stick 2 slip, v(shaft) in rad/s.",
            "The run starts from a motion near the steady state; from rest, with a smaller inertia.",
        ],
        values,
        [*body, ".tran {step} {stop} 0 {step} uic"],
    )


def _times(motor: Motor, step: float, meaning: str) -> Values:
    frequency = default_drive(motor).frequencies[-1]
    return {
        "stop": (_number(60.0 / frequency), "s, end of the run"),
        "window": (_number(20.0 / frequency), "s, at the end of the run, for the means"),
        "step": (_number(step), meaning),
    }


def _plates(motor: Motor) -> list[str]:
    """Return the initial voltages of the plates: those of the sources at t = 0."""
    drive = TwoPhaseDrive(voltage=1.0, frequency=motor.modes[-1].frequency_hz, phase_deg=45.0)
    start = {"a": "{voltage_2*sin(radians_2)}", "b": "{voltage*sin(radians)-voltage_2*sin(radians_2)}"}
    nodes = motor_bench(motor, DriveSource(drive)).start
    found = dict.fromkeys(nodes, start["b"])
    found |= {node.replace("xgroup_b", "xgroup_a"): start["a"] for node in nodes}
    return [".ic " + " ".join(f"v({node})={value}" for node, value in found.items())]


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
    step, values, discretisation = live_step(motor), _settings(motor), Discretisation(live_step(motor))
    circuit = TransducerSubCircuit(motor, discretisation=None if steady else discretisation, startable=not steady)
    what, options, run = "steady state, amplitudes", AC_OPTIONS, ".ac lin 1 {frequency} {frequency}"
    lines: list[str] = []
    wave = "AC {voltage} %s" if steady else "SIN(0 {voltage} {frequency} 0 0 %s)"
    body = [f"V{pin} {pin} 0 {wave % at}" for pin, at in zip(motor.groups, ("0", "{phase}"), strict=False)]
    instance = _instance(circuit, f"{' '.join(motor.groups)} 0", values)
    if not steady:
        what, options, run = "cycle by cycle", transient_options(motor, None), ".tran {step} {stop} 0 {step} uic"
        starts, motion = _starts(motor, None, discretisation)
        instance += "".join(f" {name}={value}" for name, value in starts.items())
        values |= _times(motor, step, "s, time step; the modes are written for it") | motion
        plates = plates_of(motor, "b") if "b" in motor.groups else ()
        lines = [f".ic v(xmotor.{node})={{voltage*sin(phase*{_RADIANS!r})}}" for node in plates]
        if motor.tool.mass_kg:  # it moves with what it is attached to
            parts = [f"({_number(along)})*velocity_{index}" for index, along in enumerate(motor.load_motion, start=1)]
            lines += [f".ic v(xmotor.{node})={{{'+'.join(parts)}}}" for node in ("heavy", "mass")]
        lines += [f".measure tran current_{pin}_rms_a RMS i(v{pin}) FROM={{stop-window}}" for pin in motor.groups]
    body += [_text(circuit), instance, _options(options), f".save {' '.join(live_vectors(motor, driver=False))}"]
    return _deck(f"{motor.name}: {what}", ["A transducer; y of its face in um."], values, [*body, *lines, run])


# --- small signals ---


def _admittance(motor: Motor) -> str:
    """Return the deck of the electrical ports: free, and pressed against a rotor at rest; or idle, and under load."""
    low, high, kind = 0.7 * min(mode.frequency_hz for mode in motor.modes), 1.2 * fastest(motor), MotorSubCircuit
    if motor.is_transducer:  # whose resonances are narrow: about the drive
        low, high = (share * default_drive(motor).frequencies[0] for share in (0.9, 1.1))
        kind = TransducerSubCircuit
    values = {name: value for name, value in _settings(motor).items() if name in ("preload", "friction", "load")}
    passed = " ".join(f"{name}={{{name}}}" for name in values)
    pressed = kind(motor)
    free = kind(motor.model_copy(update={"load": None}), law=None, name=f"{pressed.name}_free")
    values |= {
        "lowest": (_number(low), "Hz, first frequency"),
        "highest": (_number(high), "Hz, last frequency"),
        "points": ("2000", "number of frequencies"),
    }
    body = [_text(pressed), _text(free)]
    vectors = []
    for state, circuit in (("free", free), ("pressed", pressed)):
        for driven in motor.groups:
            copy = f"{state}_{driven}"
            body += [f"V{group}_{copy} {group}_{copy} 0 DC 0 AC {int(group == driven)}" for group in motor.groups]
            vectors += [f"i(v{group}_{copy})" for group in motor.groups]
            pins = [*(f"{group}_{copy}" for group in motor.groups), "0"]
            pins += [] if motor.is_transducer else [f"shaft_{copy}"]
            body.append(f"X{copy} {' '.join(pins)} {circuit.name} {passed if state == 'pressed' else ''}")
    return _deck(
        f"{motor.name}: admittance, free and under load",
        ["Currents of the sources are minus the admittances in S: free or pressed, with group a or b driven."],
        values,
        [*body, _options(AC_OPTIONS), f".save {' '.join(vectors)}", ".ac lin {points} {lowest} {highest}"],
    )
