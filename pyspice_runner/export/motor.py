# SPDX-License-Identifier: GPL-3.0-or-later
"""Motors as files for other programs.

:data:`FORMATS` is the table of formats, by the ending of the file; :func:`export_motor` and the command ``export`` read
it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from pyspice_runner.averaged.library import averaged_library, check_averaged
from pyspice_runner.circuit.law import PAPER_LAW, ContactLaw
from pyspice_runner.circuit.motor import SUBCIRCUIT, THERMAL_SUBCIRCUIT, TRANSDUCER, editable_parameters, motor_library
from pyspice_runner.circuit.state import FEEDBACK
from pyspice_runner.circuit.veriloga import motor_module
from pyspice_runner.errors import ParameterError
from pyspice_runner.export.circuit import touchstone
from pyspice_runner.export.fmu import Version, fmu_archive, fmu_texts
from pyspice_runner.export.symbols import MOTOR_PINS, THERMAL_PINS, kicad_symbol, library_name, ltspice_symbol
from pyspice_runner.export.xyce import Dialect, xyce_library
from pyspice_runner.files import save_by_ending
from pyspice_runner.motor.motor import Motor, require_one_contact
from pyspice_runner.motor.refusal import checked
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.run.two_port import stator_two_port
from pyspice_runner.spice.library import check_name

_TWO_PORT_POINTS = 2000
# option → its default, and the only ending on which another value has an effect
_OF_ONE_FORMAT = {"dialect": ("spice", ".lib"), "rotational": (False, ".va"), "fmi": (2, ".fmu")}


@dataclass(frozen=True)
class MotorExport:
    """A motor and the options of its export, as :func:`export_motor` has them."""

    motor: Motor
    contact: ContactLaw | None = PAPER_LAW
    name: str = ""
    thermal: Thermal | None = None
    averaged: bool = False
    dialect: Dialect = "spice"
    rotational: bool = False
    fmi: Version = 2

    def save(self, path: str | Path) -> Path:
        """Write the file, in the format of its ending, and return its path."""
        self.check(path)
        return save_by_ending(path, dict.fromkeys(endings(self.averaged), self._write))

    def check(self, path: str | Path | None) -> None:
        """Raise ParameterError for an option without effect on a file, or with ``None`` on the ``.lib``."""
        ending = ".lib" if path is None else Path(path).suffix
        for name, (default, only) in _OF_ONE_FORMAT.items():
            value = getattr(self, name)
            if value != default and ending != only:
                raise ParameterError(
                    f"{name} = {value!r} has no effect on a {ending}: give a file name that ends in {only}."
                )

    def _write(self, path: Path) -> None:
        kind = FORMATS[path.suffix]
        content = kind.content(self, path) if kind.content else kind.text(self)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())


@dataclass(frozen=True)
class Format:
    """A format of files."""

    text: Callable[[MotorExport], str]  # the netlist; of an ``.fmu`` its model description, of others the ``.lib``
    # function that returns the content of the file at a path, where it is not just this text.
    content: Callable[[MotorExport, Path], str | bytes] | None = None
    averaged: bool = False  # whether it can contain the averaged motor
    idle: tuple[str, ...] = ()  # options of the command that have no effect on it


def endings(averaged: bool) -> tuple[str, ...]:
    """Return the endings that the export of a motor, or of an averaged motor, can have."""
    return tuple(ending for ending, kind in FORMATS.items() if kind.averaged or not averaged)


@checked
def export_motor(
    motor: Motor,
    path: str | Path,
    *,
    contact: ContactLaw | None = PAPER_LAW,
    name: str = "",
    thermal: Thermal | None = None,
    averaged: bool = False,
    dialect: Dialect = "spice",
    rotational: bool = False,
    fmi: Version = 2,
) -> Path:
    """Write a motor, by the ending of the file.

    ``.lib`` (SPICE, ``.subckt piezomotor a b com shaft``), ``.va`` (Verilog-A, ``module piezomotor(a, b, com, shaft,
    temperature)``), ``.asy`` (LTspice) and ``.kicad_sym`` (KiCad), which name
    the ``.lib`` of the same name beside them, ``.s2p`` (Touchstone of the stator, tip free) or ``.toml``
    (:func:`load_motor`). ``.fmu`` is the averaged motor for control tools: FMI for co-simulation and model exchange,
    with C sources, a binary for Linux on x86-64, which the system's C compiler builds, and one for Windows, if
    mingw-w64 is installed.

    Args:
        motor: the motor.
        path: the file.
        contact: law of the contact in the ``.lib`` or ``.va``.
        name: name of the subcircuit in the ``.lib``, the ``.va`` and the symbols; by default ``piezomotor``.
        thermal: drift with temperature, for the pins ``temperature`` and ``heat`` (``piezomotor_thermal`` by default).
        averaged: whether to write the averaged motor, ``.subckt piezomotor_averaged``, as a ``.lib``; a ``.fmu``
            always contains it.
        dialect: ``"spice"`` writes the ``.lib`` for ngspice and LTspice, ``"xyce"`` for Xyce.
        rotational: whether the shaft of the ``.va`` is a pin of the discipline ``rotational_omega`` (rad/s, N·m)
            instead of an electrical one; not for a slider.
        fmi: version of FMI of the ``.fmu``, 2 or 3.

    Raises:
        ParameterError: for another ending, a place that cannot be written, or a name that is not possible.
        SimulationError: if ngspice fails to compute the two-port, or there is no C compiler for a ``.fmu``.
    """
    return MotorExport(motor, contact, name, thermal, averaged, dialect, rotational, fmi).save(path)


# --- formats ---


def _library(export: MotorExport) -> str:
    if export.averaged:
        check_averaged(export.contact)
        text = averaged_library(export.motor, name=export.name, thermal=export.thermal)
    else:
        text = motor_library(export.motor, contact=export.contact, name=export.name, thermal=export.thermal)
    return xyce_library(text) if export.dialect == "xyce" else text


def _module(export: MotorExport) -> str:
    require_one_contact(export.motor, "A Verilog-A module is")
    return motor_module(
        export.motor, contact=export.contact, name=export.name, thermal=export.thermal, rotational=export.rotational
    )


def _unit(export: MotorExport) -> dict[str, str]:
    check_averaged(export.contact)
    return fmu_texts(export.motor, name=export.name, thermal=export.thermal, version=export.fmi)


def _symbol(symbol: Callable[..., str], export: MotorExport, path: Path) -> str:
    motor, name = export.motor, THERMAL_SUBCIRCUIT if export.thermal else SUBCIRCUIT
    pins, title = {**MOTOR_PINS, **(THERMAL_PINS if export.thermal else {})}, f"standing-wave piezomotor {motor.name}"
    if motor.feedback:
        pins = {**MOTOR_PINS, FEEDBACK: "right", **pins}
    if motor.is_transducer:
        name, title = TRANSDUCER, f"transducer {motor.name}"
        pins = {pin: pins[pin] for pin in (*motor.groups, "com")}
    if export.name:
        name = check_name(export.name)
    return symbol(name, pins, library_name(path), title, editable_parameters(motor))


def _stator(export: MotorExport, _: Path) -> str:
    motor = export.motor
    if len(motor.groups) == 1:
        raise ParameterError(f"{motor.name} has one port: write what its spectrum was fitted to as .s1p.")
    low, high = 0.5 * motor.modes[0].frequency_hz, 2.0 * motor.modes[-1].frequency_hz
    frequency, matrix = stator_two_port(motor, low, high, _TWO_PORT_POINTS)
    return touchstone(frequency, matrix, title=f"stator of {motor.name}, tip free, port 1 group A, port 2 group B")


_CONTACT, _NETLIST = ("contact", "sliders"), ("contact", "sliders", "name", "thermal")
FORMATS = {
    ".lib": Format(_library, averaged=True),
    ".va": Format(_module),
    ".fmu": Format(
        lambda export: _unit(export)["modelDescription.xml"],
        lambda export, _: fmu_archive(_unit(export)),
        averaged=True,
    ),
    ".asy": Format(_library, partial(_symbol, ltspice_symbol), idle=_CONTACT),
    ".kicad_sym": Format(_library, partial(_symbol, kicad_symbol), idle=_CONTACT),
    ".s2p": Format(_library, _stator, idle=_NETLIST),
    ".toml": Format(
        _library,
        lambda export, _: export.motor.to_toml(heading=f"{export.motor.name}, by its modes."),
        idle=_NETLIST,
    ),
}
