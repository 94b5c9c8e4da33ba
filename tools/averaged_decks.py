# SPDX-License-Identifier: GPL-3.0-or-later
"""Decks of the averaged motor: seconds of motor time by ``.op``, ``.dc``, ``.ac`` and ``.tran``, without Python.

All include ``netlists/piezomotor_averaged.lib``, the averaged motor of the set :data:`MOTOR`, which is written here
too. ``python -m tools.decks`` writes library and decks; a test compares them with the repository.
"""

from __future__ import annotations

import textwrap
from math import pi

from pyspice_runner.averaged.library import OPTIONS, SUBCIRCUIT, averaged_library
from pyspice_runner.motor.drive import TwoPhaseDrive, default_drive
from pyspice_runner.motor.load import load_motor
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.spice.library import read_library

MOTOR = "bimodal40"
LIBRARY = f"{SUBCIRCUIT}.lib"
_FASTER = 100.0  # by which the heat capacity is divided, so that one second warms as much as 100 s do
_FROM_REST = "* the iteration begins with a rotor at rest: a load torque alone would turn it fast\n.nodeset v(shaft)=0"
_RADIANS = f".param radians={{phase*{pi / 180.0!r}}}"
_AMPLITUDES = f"""* complex amplitudes: group A is the reference, group B is ahead by the phase
{_RADIANS}
Va_re a_re 0 DC {{voltage}} AC 1
Va_im a_im 0 DC 0
Vb_re b_re 0 DC {{voltage*cos(radians)}} AC {{cos(radians)}}
Vb_im b_im 0 DC {{voltage*sin(radians)}} AC {{sin(radians)}}
Vfrequency f 0 DC {{frequency}}"""
_SET = """* the command sets the amplitude of both groups
Ba_re a_re 0 V=V(set)
Va_im a_im 0 DC 0
Bb_re b_re 0 V=V(set)*({cos(radians)})
Bb_im b_im 0 V=V(set)*({sin(radians)})
Vfrequency f 0 DC {frequency}"""
_ANGLE = """* angle of the shaft in rad
Gposition 0 position shaft 0 1
Cposition position 0 1 ic=0
Rposition position 0 1t"""


def averaged_deck_texts() -> dict[str, str]:
    """Return file name → text of every deck of the averaged motor."""
    motor = load_motor(MOTOR)
    return {f"averaged_{name}.cir": write(motor) for name, write in _DECKS.items()}


def averaged_library_text() -> str:
    """Return ``netlists/piezomotor_averaged.lib``."""
    return averaged_library(load_motor(MOTOR), thermal=_thermal(load_motor(MOTOR)))


def _thermal(motor: Motor) -> Thermal:
    found = Thermal.of(motor)
    return found.model_copy(update={"heat_capacity_j_per_k": float(f"{found.heat_capacity_j_per_k:.3g}")})


def _drive(motor: Motor) -> TwoPhaseDrive:
    drive = default_drive(motor)
    assert isinstance(drive, TwoPhaseDrive)
    return drive


def _deck(title: str, what: str, parameters: dict[str, tuple[float | str, str]], body: str) -> str:
    """Return a deck: title, description, parameters, library, body."""
    wrapped = textwrap.wrap(" ".join(what.split()), 108)
    return "\n".join(
        [
            f".title {MOTOR}, averaged: {title}",
            "* SPDX-License-Identifier: MIT",
            "*",
            *(f"* {line}" for line in wrapped),
            "*",
            "* Run: ngspice -b THIS_FILE. Written by python -m tools.decks: edit a copy.",
            f"* {LIBRARY} has pins, units and limits; docs/tracking.md has the derivation. The model is",
            "* accurate where v(xmotor.check) < 0.02 and the contact is closed, v(xmotor.open) = 0.",
            "*",
            "* Parameters",
            *(f".param {name}={value} ; {meaning}" for name, (value, meaning) in parameters.items()),
            f".include {LIBRARY}",
            body.strip(),
            ".end",
            "",
        ]
    )


def _parameters(motor: Motor) -> dict[str, tuple[float | str, str]]:
    drive = _drive(motor)
    return {
        "frequency": (f"{drive.frequency:g}", "Hz"),
        "voltage": (f"{drive.voltage:g}", "V, amplitude"),
        "phase": (f"{drive.phase_deg:g}", "degrees, group B ahead of group A"),
        "preload": (f"{motor.contact.preload_n:g}", "N"),
    }


def _motor(temperature: str = "0") -> str:
    return f"Xmotor a_re a_im b_re b_im f shaft {temperature} heat {SUBCIRCUIT} preload={{preload}}"


def _options(*names: str) -> str:
    return ".options " + " ".join(f"{name}={OPTIONS[name]}" for name in names)


_TOLERANCES = ("method", "reltol", "vntol", "abstol")


def _steady_options() -> str:
    """Return the options of an operating point: by source steps, since gmin at the shaft brakes the rotor."""
    return f"{_options(*_TOLERANCES)} gminsteps=0"


def _operating_point(motor: Motor) -> str:
    return _deck(
        "Operating point",
        """Operating point. .op is the steady state of the running motor under a load torque: speed, the power that it
        takes, the power at its shaft, and the heat of the stator.""",
        _parameters(motor) | {"torque": ("20m", "N.m, load")},
        f"""
{_AMPLITUDES}
Iload shaft 0 DC {{torque}}
{_motor()}
{_steady_options()}
{_FROM_REST}
.control
op
let speed_rad_s = v(shaft)
let electrical_w = -0.5*(v(a_re)*i(va_re)+v(a_im)*i(va_im)+v(b_re)*i(vb_re)+v(b_im)*i(vb_im))
let shaft_w = v(shaft)*@iload[dc]
let heat_w = v(heat)
let check = v(xmotor.check)
print speed_rad_s electrical_w shaft_w heat_w check
quit 0
.endc
""",
    )


def _speed_torque(motor: Motor) -> str:
    return _deck(
        "Speed and torque",
        """Speed and torque. .dc over the load torque gives the speed at which the motor carries it. To plot, inside
        ngspice: v(shaft) over v(torque).""",
        _parameters(motor) | {"greatest": ("50m", "N.m, load"), "increment": ("2.5m", "N.m")},
        f"""
{_AMPLITUDES}
Vtorque torque 0 DC 0
Gload shaft 0 torque 0 1
{_motor()}
{_steady_options()}
.dc Vtorque 0 {{greatest}} {{increment}}
.measure dc free_speed_rad_s FIND v(shaft) AT=0
.measure dc half_load_speed_rad_s FIND v(shaft) AT={{greatest/2}}
.measure dc loaded_speed_rad_s FIND v(shaft) AT={{greatest}}
.measure dc greatest_check MAX v(xmotor.check)
""",
    )


def _frequency_response(motor: Motor) -> str:
    return _deck(
        "Frequency response",
        """Frequency response. .dc over the drive frequency gives the speed of the free shaft at each frequency.
        To plot, inside ngspice: v(shaft), v(xmotor.open), v(xmotor.check).""",
        _parameters(motor)
        | {
            "lowest": ("40.6k", "Hz"), "highest": ("41.5k", "Hz"), "increment": (10, "Hz"),
        },
        f"""
{_AMPLITUDES}
{_motor()}
{_steady_options()}
.dc Vfrequency {{lowest}} {{highest}} {{increment}}
.measure dc speed_at_frequency_rad_s FIND v(shaft) AT={{frequency}}
.measure dc greatest_speed_rad_s MAX v(shaft)
.measure dc greatest_check MAX v(xmotor.check)
""",
    )  # fmt: skip


def _small_signal(motor: Motor) -> str:
    return _deck(
        "Small signals",
        """Small signals. .ac modulates the amplitude of both groups about the operating point: v(shaft) is the speed
        in rad/s for 1 V of amplitude. For a modulation of the frequency, give Vfrequency AC 1 and the others AC 0; for
        the load torque, Iload AC 1. Valid to about a fortieth of the drive frequency. Prints magnitude and phase in
        rad.""",
        _parameters(motor)
        | {
            "torque": ("20m", "N.m, load"), "lowest": (1, "Hz"), "highest": ("1k", "Hz"),
            "points": (5, "points per decade"),
        },
        f"""
{_AMPLITUDES}
Iload shaft 0 DC {{torque}}
{_motor()}
{_steady_options()}
{_FROM_REST}
.ac dec {{points}} {{lowest}} {{highest}}
.print ac vm(shaft) vp(shaft)
.measure ac slow_speed_in_phase FIND v(shaft) AT={{lowest}}
""",
    )  # fmt: skip


def _warm_up(motor: Motor) -> str:
    thermal = _thermal(motor)
    return _deck(
        "Warm-up",
        f"""Warm-up. The rotor spins up from rest; a load torque comes on; the losses heat the stator, whose
        frequencies, couplings and capacitances drift, so that the speed changes. The heat capacity is that of the
        stator over {_FASTER:g}: one second warms as much as {_FASTER:g} s do. To plot, inside ngspice: v(shaft),
        v(temperature).""",
        _parameters(motor)
        | {
            "torque": ("20m", "N.m, load"), "loaded": (0.1, "s, when the load comes on"),
            "capacity": (f"{thermal.heat_capacity_j_per_k / _FASTER:.3g}", "J/K, heat capacity"),
            "resistance": (f"{thermal.thermal_resistance_k_per_w:g}", "K/W, to the surroundings"),
            "stop": (1, "s, end of the run"), "step": ("100u", "s, spacing of printed points"),
             "longest_step": ("2m", "s, longest time step"),
        },
        f"""
{read_library("piezomotor_cooling").subcircuit}
{_AMPLITUDES}
Iload shaft 0 PWL(0 0 {{loaded}} 0 {{loaded+1m}} {{torque}})
{_motor("temperature")}
Xcooling heat temperature piezomotor_cooling capacity={{capacity}} resistance={{resistance}}
{_options("method", "trtol", "reltol", "vntol", "abstol")}
.ic v(a_re)={{voltage}} v(b_re)={{voltage*cos(radians)}} v(b_im)={{voltage*sin(radians)}}
.tran {{step}} {{stop}} 0 {{longest_step}} uic
.measure tran free_speed_rad_s FIND v(shaft) AT={{loaded}}
.measure tran loaded_speed_rad_s FIND v(shaft) AT={{loaded+50m}}
.measure tran warm_speed_rad_s FIND v(shaft) AT={{stop-1m}}
.measure tran temperature_k FIND v(temperature) AT={{stop-1m}}
.measure tran heat_w FIND v(heat) AT={{stop-1m}}
.measure tran greatest_check MAX v(xmotor.check) FROM={{loaded}} TO={{stop}}
""",
    )  # fmt: skip


def _speed_loop(motor: Motor) -> str:
    return _deck(
        "Speed loop",
        """Speed loop. A PI controller sets the amplitude of both groups so that the shaft follows a target speed; a
        load torque comes on later. Diodes stop the integrator at the limits of the amplitude. To plot, inside ngspice:
        v(shaft), v(target), v(set).""",
        _parameters(motor)
        | {
            "first": (20, "rad/s, target speed at the start"), "second": (30, "rad/s, target speed after the step"),
            "stepped": (0.2, "s, when the target changes"), "torque": ("10m", "N.m, load"),
            "loaded": (0.35, "s, when the load comes on"),
            "proportional": (1.5, "V.s/rad, gain"), "integral": (150, "V/rad, gain"),
            "stop": (0.5, "s, end of the run"), "step": ("100u", "s, spacing of printed points"),
             "longest_step": ("1m", "s, longest time step"),
        },
        f"""
Vtarget target 0 PWL(0 0 1m {{first}} {{stepped}} {{first}} {{stepped+1m}} {{second}})
Iload shaft 0 PWL(0 0 {{loaded}} 0 {{loaded+1m}} {{torque}})
* PI controller
Berror error 0 V=V(target)-V(shaft)
Gintegral 0 sum error 0 {{integral}}
Csum sum 0 1 ic=0
Dmost sum most limit
Vmost most 0 DC {{voltage}}
Dleast 0 sum limit
.model limit d(n=0.01)
Bset set 0 V=min(max(({{proportional}})*V(error)+V(sum),0),({{voltage}}))
{_RADIANS}
{_SET}
{_motor()}
{_options("method", "trtol", "reltol", "vntol", "abstol")}
.tran {{step}} {{stop}} 0 {{longest_step}} uic
.measure tran first_speed_rad_s FIND v(shaft) AT={{stepped}}
.measure tran second_speed_rad_s FIND v(shaft) AT={{loaded}}
.measure tran lowest_loaded_rad_s MIN v(shaft) FROM={{loaded}} TO={{stop}}
.measure tran last_speed_rad_s FIND v(shaft) AT={{stop-1m}}
.measure tran greatest_speed_rad_s MAX v(shaft) FROM=0 TO={{stepped}}
.measure tran greatest_check MAX v(xmotor.check) FROM=1m TO={{stop}}
""",
    )  # fmt: skip


def _position_loop(motor: Motor) -> str:
    return _deck(
        "Position loop",
        """Position loop. The command is proportional to the error, less a part of the speed. Its size sets the
        amplitude above that of the dead band, its sign the sign of the phase, and so the direction. The dead band
        of the motor leaves an error of some 10 mrad. To plot, inside ngspice: v(position), v(target), v(set),
        v(shaft).""",
        _parameters(motor)
        | {
            "angle": (0.5, "rad, target"), "returned": (0.2, "s, when the target returns to 0"),
            "gain": (40, "1/rad, of the position"), "damping": (0.2, "s/rad, of the speed"),
            "dead": (37, "V, amplitude at which the motor hardly turns"),
            "stop": (0.4, "s, end of the run"), "step": ("100u", "s, spacing of printed points"),
             "longest_step": ("0.5m", "s, longest time step"),
        },
        f"""
Vtarget target 0 PWL(0 0 1m {{angle}} {{returned}} {{angle}} {{returned+1m}} 0)
{_ANGLE}
Bcommand command 0 V=min(max(({{gain}})*(V(target)-V(position))-({{damping}})*V(shaft),-1),1)
* the amplitude rises to the dead band within a fifth of the command's range: a jump there would not converge
Bset set 0 V=(({{dead}})+({{voltage-dead}})*abs(V(command)))*tanh(abs(V(command))/0.2)
{_RADIANS}
{_SET.replace("({sin(radians)})", "({sin(radians)})*tanh(V(command)/0.2)")}
{_motor()}
{_options("method", "trtol", "reltol", "vntol", "abstol")}
.tran {{step}} {{stop}} 0 {{longest_step}} uic
.measure tran reached_rad FIND v(position) AT={{returned}}
.measure tran greatest_rad MAX v(position)
.measure tran returned_rad FIND v(position) AT={{stop-1m}}
.measure tran greatest_check MAX v(xmotor.check) FROM=1m TO={{stop}}
""",
    )  # fmt: skip


_DECKS = {
    "operating_point": _operating_point,
    "speed_torque": _speed_torque,
    "frequency_response": _frequency_response,
    "small_signal": _small_signal,
    "warm_up": _warm_up,
    "speed_loop": _speed_loop,
    "position_loop": _position_loop,
}
