# SPDX-License-Identifier: GPL-3.0-or-later
"""Dotted paths of the parameters of a run: the one grammar that sweeps, maps, branches, curves and commands share.

``law.*`` are the own parameters of the contact's law. ``contact.*``, ``contact.materials.*``, ``contact.lining.*``,
``rotor.*`` or ``slider.*``, ``mount.*``, ``piezo.*``, ``limits.*``, ``modes.N.*``, ``contacts.N.*`` are those of
:meth:`~pyspice_runner.motor.motor.Motor.updated`. ``drive.*`` are the values of a drive or a driver,
``drive.PART.PARAMETER`` those of a driver's parts. ``load.speed`` and ``load.torque`` are the load of the shaft,
other ``load.*`` that of a transducer; ``run.*`` are the settings of an analysis.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from numbers import Real
from typing import Any

from pyspice_runner.circuit.law import PAPER_LAW, Law, touching_law
from pyspice_runner.errors import ParameterError, did_you_mean
from pyspice_runner.motor.motor import Motor, refuse_source
from pyspice_runner.motor.parameters import Contact, ContactPlace, Mode
from pyspice_runner.motor.refusal import Stated, quoted, unit_of
from pyspice_runner.units import linear_unit, unit_in

#: path of the load → setting of an analysis, unit, description
LOADS = {
    "load.speed": ("speed", "rad/s", "speed at which the shaft is held"),
    "load.torque": ("load_torque", "N·m", "torque that a load draws from the free shaft"),
}
_EARLIER = {
    name: path
    for path, (setting, _, _) in LOADS.items()
    for name in (setting, f"run.{setting}")
} | {"speed_rad_s": "load.speed"}  # fmt: skip
_SETTING_UNITS = {"duration": "s", "step": "s", "timeout": "s"}  # of settings whose name has no unit
_DERIVED = ("frequency_hz", "quality_factor")  # of a mode, from its stiffness and damping


@dataclass(frozen=True)
class Parameter:
    """The parameter that a path names."""

    path: str  # the path
    nominal: float | None  # its value; ``None`` for a setting that is not given
    unit: str  # its unit, ``"1"`` without one
    description: str = ""  # its meaning, empty if it is not known

    @property
    def attributes(self) -> dict[str, str]:
        """Unit and meaning, as attributes of a coordinate."""
        return {"units": self.unit, **({"long_name": self.description} if self.description else {})}


def canonical(path: str) -> str:
    """Return a path in its present form: ``speed`` and ``run.speed`` are earlier names of ``load.speed``."""
    return _EARLIER.get(path, path)


def parameter(path: str, motor: Motor, drive: Stated, run: Mapping[str, Any]) -> Parameter:
    """Return the parameter that a path names; ``run`` has the settings of the analysis, the load among them.

    Raise ParameterError for an unknown path, with the nearest one, or a parameter that is not a number.
    """
    section, _, key = canonical(path).partition(".")
    if section == "law":
        return law_parameter(path, touching_law(run.get("contact", PAPER_LAW), "It has no law.", motor.law))[0]
    if canonical(path) in LOADS:
        setting, unit, meaning = LOADS[canonical(path)]
        unit = linear_unit(unit) if motor.slider else unit
        return Parameter(path, run.get(setting), unit, meaning if path in LOADS else "")
    if section == "run":
        return Parameter(path, run.get(key), unit_of_name(key))
    if section == "drive" and (of_part := drive.of_part(key)):
        return Parameter(path, *of_part)
    refuse_source(path)
    if motor.materials and path.startswith(f"contact.{motor.materials.TABLE}."):
        section, key = "materials", path.rpartition(".")[2]
    lists = {"modes": motor.modes, "contacts": motor.contacts}
    if section in lists:
        kind, key, nominal = _entry(motor, section, key)
    else:
        owner = drive if section == "drive" else getattr(motor, section, None) if key else None
        kind, nominal = type(owner), getattr(owner, key, None)
    fields = getattr(kind, "model_fields", {})
    if key not in fields and not (kind is Mode and key in _DERIVED):
        entries = ((f"{name}.{number}", one) for name, several in lists.items() for number, one in enumerate(several))
        parts = [*motor, *entries, ("drive", drive)]
        table = motor.materials.TABLE if motor.materials else ""
        parts = [(f"contact.{table}" if name == "materials" else name, part) for name, part in parts]
        every = [f"{name}.{key}" for name, part in parts for key in getattr(type(part), "model_fields", ())]
        raise unknown(path, [*every, *LOADS, *(f"run.{name}" for name in run)])
    if not isinstance(nominal, Real):
        raise ParameterError(f"{quoted(path)} is not a number. Name a parameter that is.")
    if key not in fields:
        return Parameter(path, float(nominal), unit_in(key))
    return Parameter(path, float(nominal), unit_of(kind, key), str(fields[key].description))


def _entry(motor: Motor, section: str, path: str) -> tuple[type, str, Any]:
    """Return the class that declares a value of a mode or a contact that a path names, its name there and the value."""
    which, _, key = path.partition(".")
    entries, (table, _, inner) = getattr(motor, section), key.partition(".")
    names = [one.name for one in entries]
    place = names.index(which) if which in names else int(which) if which.isdecimal() else len(names)
    own = entries[place] if place < len(names) else None
    if isinstance(own, ContactPlace):
        if table in ("tip_x", "tip_y") and inner in [mode.name for mode in motor.modes]:
            return Mode, table, getattr(own, table).get(inner, 0.0)
        if table == "contact":
            return Contact, inner, own.contact.get(inner, getattr(motor.contact, inner, None))
        if key == "radius_m" or (key == "share" and not own.share):
            return ContactPlace, key, getattr(motor.touching[place], key)
    return type(own), key, getattr(own, key, None)


def law_parameter(path: str, law: Law) -> tuple[Parameter, float, float]:
    """Return the parameter of a law that a path names, with its minimum and maximum.

    Raise ParameterError for a parameter that is not one of the law's own.
    """
    item = law.parameter(path.removeprefix("law."))
    value = law.parameters.get(item.name, item.default)
    return Parameter(path, value, item.unit, item.meaning), item.least, item.greatest


def changed(
    motor: Motor, drive: Stated, run: Mapping[str, Any], changes: Mapping[str, Any]
) -> tuple[Motor, Stated, dict[str, Any]]:
    """Return motor, drive and settings (``run``, with the load) with changed values: path → value.

    Raise ParameterError for an unknown path or an invalid value.
    """
    parts: dict[str, dict[str, Any]] = {"motor": {}, "drive": {}, "run": {}}
    for path, value in changes.items():
        section, _, key = canonical(path).partition(".")
        if section == "load" and not motor.is_transducer:
            if canonical(path) not in LOADS:
                raise unknown(path, LOADS)
            parts["run"][LOADS[canonical(path)][0]] = value
        elif section in ("drive", "run"):
            parts[section][key] = value
        else:
            parts["motor"][path] = value
    return (
        motor.updated(parts["motor"]) if parts["motor"] else motor,
        drive.updated(parts["drive"]) if parts["drive"] else drive,
        {**run, **parts["run"]},
    )


def unit_of_name(name: str) -> str:
    """Return the unit that a dotted name or one of its parts ends in."""
    settings = {setting: unit for setting, unit, _ in LOADS.values()} | _SETTING_UNITS
    units = (settings.get(part) or unit_in(part) for part in reversed(name.split(".")))
    return next((unit for unit in units if unit != "1"), "1")


def unknown(name: str, known: Iterable[str], what: str = "parameter") -> ParameterError:
    """Return the error for an unknown name, with the nearest known one."""
    return ParameterError(f"There is no {what} {quoted(name)}. {did_you_mean(name, known, 'There are')}")
