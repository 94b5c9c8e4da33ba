# SPDX-License-Identifier: GPL-3.0-or-later
"""Read a motor from a TOML file.

The file states the modes in one of five ways:

* ``[beam]``, ``[[patches]]``, ``[tip]``, ``[damping]``: computed by Rayleigh–Ritz (:mod:`.beam`);
* ``[solid]``: computed by finite elements (:mod:`.solid.stator`);
* ``[ring]``: those of a travelling-wave ring (:mod:`.ring`), with its contacts;
* ``[[modes]]``: as :class:`~.parameters.Mode`, where ``frequency_hz`` may stand for ``stiffness_n_per_m`` and
  ``quality_factor`` for ``damping_n_s_per_m``;
* ``[[arms]]``: Butterworth–Van Dyke values seen at group A with group B shorted (:class:`Arm`).

``[[contacts]]`` states several contacts (:class:`~.parameters.ContactPlace`), and the modes then no motion of the tip.
``[rotor]``, or ``[slider]`` of a linear stage, states what the tip moves; ``[mount]`` the springs of the stator;
``[limits]`` those of ceramic and contact; ``[drive]`` the recommended drive: its ``kind``, ``two-phase`` or
``two-tone``, and the arguments of its constructor.

A transducer has neither contact nor rotor or slider; ``[load]`` is its load. Of one group it has capacitance_a_f alone,
and modes without coupling of group B. Without mass and motion of the face, arms are known electrically only. The file
that ``piezomotor fit --output`` writes is one.

The contact is given by its constants, by the materials of tip and rotor or slider (:class:`Materials`), or by a lining
(:class:`Lining`). Each number is written plainly, or as ``{ value = …, given | derived | assumed = "why" }``, which
records its origin.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import fields
from math import copysign, inf, sqrt
from pathlib import Path
from typing import Any

import numpy as np

from pyspice_runner.errors import ParameterError, did_you_mean, located, require
from pyspice_runner.motor import beam as beam_model
from pyspice_runner.motor.circuit_file import circuit_of
from pyspice_runner.motor.document import parse_toml, read_document
from pyspice_runner.motor.drive import DRIVES
from pyspice_runner.motor.equivalent import EquivalentCircuit
from pyspice_runner.motor.groups import GROUPS
from pyspice_runner.motor.materials import SOURCES, Source
from pyspice_runner.motor.motor import (
    ALIASES,
    KINDS,
    MOVED,
    OF_FILES,
    SECTIONS,
    Motor,
    Provenance,
    Structure,
    assemble,
    with_constants,
)
from pyspice_runner.motor.parameters import (
    Beam,
    Contact,
    Damping,
    Feedback,
    Mode,
    Parameters,
    Patch,
    Rotor,
    Tip,
    label,
    quantity,
)
from pyspice_runner.motor.refusal import as_table, build, check_keys, checked, limited, quoted
from pyspice_runner.motor.ring import Ring, capacitance_f, ring_contacts, ring_modes
from pyspice_runner.motor.solid.parameters import Solid, solid_from
from pyspice_runner.motor.solid.stator import Stator, stator_of
from pyspice_runner.motor.solid.wave import wave_of

SETS = Path(__file__).parent / "sets"


def _of_mode(name: str) -> Any:
    return Mode.model_fields[name]


class Arm(Parameters):
    """A mode by its electrical values, seen at group A with group B shorted, and one mechanical calibration.

    The arm of a transducer may have none, or the velocity of its face per motional current.
    """

    name: str = label("name of the mode")
    resistance_ohm: float = quantity("motional resistance", "Ω", gt=0.0, le=1e12)
    inductance_h: float = quantity("motional inductance", "H", gt=0.0, le=1e9)
    capacitance_f: float = quantity("motional capacitance", "F", gt=0.0, le=1.0)
    coupling_ratio: float = quantity("coupling of group B over that of group A", "1", ge=-1e3, le=1e3)
    mass_kg: float = quantity("modal mass: the mechanical calibration", "kg", gt=1e-12, le=1e3)
    tip_x: float = _of_mode("tip_x")
    tip_y: float = _of_mode("tip_y")
    recoil_kg: float | None = _of_mode("recoil_kg")
    recoil_x_kg: float | None = _of_mode("recoil_x_kg")

    def to_table(self) -> dict[str, Any]:
        """Return the mechanical arm as a table ``[[modes]]``: θ_A² = m/L, k = θ_A²/C, c = θ_A² R."""
        coupling_squared = self.mass_kg / self.inductance_h
        return {
            "damping_n_s_per_m": coupling_squared * self.resistance_ohm,
            "stiffness_n_per_m": coupling_squared / self.capacitance_f,
            "coupling_a_n_per_v": sqrt(coupling_squared),
            "coupling_b_n_per_v": self.coupling_ratio * sqrt(coupling_squared),
            **self.model_dump(include={"name", "mass_kg", "tip_x", "tip_y", "recoil_kg", "recoil_x_kg"}),
        }


def _of_transducer(plain: Mapping[str, Any], way: str, where: str) -> Any:
    """Return arms or modes of a transducer with what may be left out: the motion of the face, coupling of group B."""
    alone = "capacitance_b_f" not in as_table(plain["piezo"], "piezo", where)
    found = []
    for index, entry in enumerate(plain[way]):
        given = dict(as_table(entry, f"{way}.{index}", where))
        if way == "modes":
            found.append({"tip_x": 0.0, "tip_y": 0.0, **({"coupling_b_n_per_v": 0.0} if alone else {}), **given})
            continue
        per_current, henry = given.pop("velocity_per_current", None), given.get("inductance_h")
        inductance = limited(Arm, "inductance_h", henry, f"arms.{index}.inductance_h", where)
        if per_current is not None:
            valid = isinstance(per_current, int | float) and 1e-6 <= abs(per_current) <= 1e6
            valid = valid and not {"mass_kg", "tip_y"} & given.keys()
            allowed = "of 1e-6 to 1e6 m/s/A, without mass_kg and tip_y"
            require(valid, f"{where}: arms.{index}.velocity_per_current", per_current, allowed)
            given |= {"mass_kg": inductance / per_current**2, "tip_y": copysign(1.0, per_current)}
        # without a calibration, 1 V is 1 N; with one, the modal coordinate is the motion of the face
        beside = {"tip_y": 1.0 if "mass_kg" in given else 0.0, "mass_kg": min(inductance, 1.0)}
        found.append({"name": f"arm{index + 1}", "coupling_ratio": 0.0, "tip_x": 0.0, **beside, **given})
    return found


def _without_tip(plain: Mapping[str, Any], way: str, where: str) -> Any:
    """Return arms or modes of a file with ``[[contacts]]``, which have no motion of their own: it is 0 so far."""
    found = []
    for index, entry in enumerate(plain[way]):
        given = as_table(entry, f"{way}.{index}", where)
        for name in ("tip_x", "tip_y"):
            if name in given:
                raise ParameterError(f"{where}: {way}.{index}.{name} is that of [[contacts]]; leave it out.")
        found.append({**given, "tip_x": 0.0, "tip_y": 0.0})
    return found


def available_motors() -> tuple[str, ...]:
    """Return the names of the parameter sets of the package."""
    return tuple(sorted(path.stem for path in SETS.glob("*.toml")))


def stated_solid(source: str | Path) -> Solid | None:
    """Return the ``[solid]`` of a motor, or None if it has none. Raise ParameterError as :func:`load_motor`."""
    document, path = _read(source)
    table = document.get("solid")
    where = path.name
    return None if table is None else solid_from(_strip(table, "solid", {}, where), where, path.parent)


@checked
def load_motor(source: str | Path) -> Motor:
    """Read a motor.

    Args:
        source: name of a parameter set (:func:`available_motors`) or path of a TOML file.

    Raises:
        ParameterError: for an unknown name, an unreadable file, a misspelt or missing entry, or an invalid value.
    """
    return _from_document(*_read(source))


def changed_motor(source: str | Path, changes: Mapping[str, Any]) -> Motor:
    """Read a motor and change some of its values. Raise ParameterError as :func:`load_motor` and :meth:`Motor.updated`.

    Paths are those of :meth:`Motor.updated`, and those of the structure and the materials in the file:
    ``beam.length_m``, ``patches.0.end_m``, ``contact.materials.tip_poisson``. Values are in SI units.
    """
    document, file = _read(source)
    of_file = {path: value for path, value in changes.items() if path.startswith(OF_FILES) or ".face." in path}
    for path, value in of_file.items():
        _put(document, path, value, file.name)
    motor = _from_document(document, file)
    for path in of_file:
        motor.provenance[path] = Provenance("set", "by the user")
    others = {path: value for path, value in changes.items() if path not in of_file}
    return motor.updated(others) if others else motor


def _put(document: dict[str, Any], path: str, value: Any, where: str) -> None:
    """Put a value into a motor's document; the reader checks the name and the value."""
    *tables, key = path.split(".")
    place: Any = document
    for table in tables:
        if isinstance(place, list) and table.isdecimal() and int(table) < len(place):
            place = place[int(table)]
        else:
            place = place.get(table) if isinstance(place, dict) else None
    if not isinstance(place, dict):
        raise ParameterError(f"{where} has no table {quoted('.'.join(tables))}, so {quoted(path)} cannot be set.")
    place[key] = value


def _read(source: str | Path) -> tuple[dict[str, Any], Path]:
    """Return the document of a motor and its file."""
    path = Path(source)
    if isinstance(source, str) and path.suffix != ".toml" and len(path.parts) == 1:
        path = SETS / f"{source}.toml"
        if source not in available_motors():
            hint = did_you_mean(source, available_motors(), "Give the path of a TOML file or one of")
            raise ParameterError(f"There is no parameter set {quoted(source)}. {hint}")
    try:
        found = path.is_file()
    except OSError:  # such as a name that is too long
        found = False
    if not found:
        raise ParameterError(
            f"There is no file {quoted(str(source))}. Give the path of a TOML file or the name of a set."
        )
    return parse_toml(read_document(path, "a readable TOML file"), path.name), path


_NO_MOTION = 1e-5  # of the largest: a motion per volt that symmetry forbids
_OF_CIRCUIT = tuple(item.name for item in fields(EquivalentCircuit) if item.name != "arms")
_TABLES = ("name", "description", "ceramic", "patches", "tip", "damping", "law", "drive", "contacts", *SECTIONS)
_WAYS = ("beam", "solid", "ring", "modes", "arms")
_SERIES = ("series_compliance_m_per_n", "tangential_series_compliance_m_per_n")  # along the normal, the tangent
_FROM = {"beam": "[[patches]]", "solid": "[solid]", "ring": "[ring]"}


def _from_document(document: dict[str, Any], file: Path) -> Motor:
    where = file.name
    document, left_out = _of_circuit(document, file)
    check_keys(document, (*_TABLES, *_WAYS), where, "")
    way = _only(document, _WAYS, "its modes", where)
    transducer = not {"contact", *MOVED} & document.keys()
    for key in ("name", "piezo") if transducer else ("name", "contact", "piezo"):
        if key not in document:
            raise ParameterError(
                f"{where} has no entry {key!r}; a motor needs name, piezo, contact, rotor or slider, and its modes."
            )
    moved = "" if transducer else _only(document, tuple(MOVED), "what the tip moves", where)
    provenance: dict[str, Provenance] = {}
    plain = {key: _strip(value, key, provenance, where) for key, value in document.items() if key != "description"}

    rotor = build(MOVED[moved], plain[moved], moved, where) if moved else None
    if way in ("arms", "modes") and isinstance(plain[way], list) and (transducer or "contacts" in plain):
        plain[way] = (_of_transducer if transducer else _without_tip)(plain, way, where)
    structure, modes, capacitances = _resolve_modes(plain, way, file)
    piezo = dict(as_table(plain["piezo"], "piezo", where))
    if capacitances is not None:
        if given := [key for key in capacitances if key in piezo]:
            raise ParameterError(
                f"{where}: piezo.{given[0]} follows from {_FROM[way]}; leave it out or specify the modes directly."
            )
        piezo.update(capacitances)
    radius = rotor.radius_m if isinstance(rotor, Rotor) else inf
    contact, materials = _resolve_contact(plain["contact"], radius, where) if moved else ({}, None)
    contact |= _softening(contact, structure, provenance, where) if moved else {}
    resolved = {"piezo": piezo, "contact": contact}
    kinds: dict[str, type[Parameters]] = {**SECTIONS, "beam": Beam, "tip": Tip}
    for section, kind in kinds.items():
        if section not in plain and section != "limits":
            continue
        for name, field in kind.model_fields.items():
            if not field.is_required() and name not in resolved.get(section, ()):
                provenance.setdefault(f"{section}.{name}", Provenance("default", "not stated"))
    _check_drive(plain.get("drive"), where)
    parts = {**plain, "modes": modes, "piezo": piezo, "contact": contact or None, "materials": materials}
    parts["left_out"] = left_out
    return assemble(parts, structure, provenance, where=where)


def _of_circuit(document: dict[str, Any], file: Path) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return the file of a fit as that of a transducer, and what of the circuit is left out; others as they are."""
    if "clamped_capacitance_f" not in document:
        return document, ()
    circuit = circuit_of(document, file.name)
    stem = re.sub(r"[^A-Za-z0-9_. -]", "-", file.stem)[:50]
    piezo = {
        "capacitance_a_f": circuit.clamped_capacitance_f, "loss_tangent": circuit.loss_tangent,
        "reference_hz": circuit.loss_reference_hz,
    }  # fmt: skip
    left_out = [
        f"{what} of the fitted circuit {text}"
        for there, what, text in (
            (circuit.lead_resistance_ohm or circuit.lead_inductance_h, "The leads",
             "are not part of the device. Give a driver a cable (--part cable.inductance)."),
            (circuit.loss_tangent_falling or circuit.loss_tangent_rising, "The losses that fall or rise with frequency",
             f"count in full as a constant loss tangent, exact at {circuit.loss_reference_hz:.6g} Hz."),
            (circuit.shared_losses, "The shared losses", "count as losses of each arm alone."),
        )
        if there
    ]  # fmt: skip
    others = {key: value for key, value in document.items() if key not in _OF_CIRCUIT}
    return {"name": stem if stem[:1].isalnum() else f"fit-{stem}", "piezo": piezo, **others}, tuple(left_out)


def _only(document: Mapping[str, Any], tables: tuple[str, ...], what: str, where: str) -> str:
    """Return which one of some tables a document has."""
    found = [name for name in tables if name in document]
    if len(found) != 1:
        raise ParameterError(
            f"{where} must state {what} by exactly one of the tables {', '.join(tables)}; it has "
            f"{' and '.join(found) or 'none of them'}."
        )
    return found[0]


def _resolve_modes(
    plain: dict[str, Any], way: str, file: Path
) -> tuple[Structure | Solid | Ring | None, list[dict[str, Any]], dict[str, float] | None]:
    where = file.name
    if not isinstance(plain.get("contacts", []), list):
        raise ParameterError(f"{where}: contacts must be one or more tables [[contacts]].")
    if way == "beam":
        return _from_beam(plain, where)
    stated = _FROM.get(way, f"[[{way}]]")
    for key in ("ceramic", "patches", "tip", *(["damping"] if way in _FROM else [])):
        if key in plain:
            raise ParameterError(f"{where}: [{key}] belongs to a [beam]; with {stated} leave it out.")
    if way == "solid":
        return _from_solid(plain, where, file.parent)
    if way == "ring":
        return _from_ring(plain, where)
    entries = plain[way]
    if not isinstance(entries, list) or not entries:
        raise ParameterError(f"{where}: {way} must be one or more tables [[{way}]].")
    damping = build(Damping, plain["damping"], "damping", where) if "damping" in plain else None
    modes = []
    for index, entry in enumerate(entries):
        if way == "arms":
            arm = build(Arm, entry, f"arms.{index}", where)
            modes.append(build(Mode, arm.to_table(), f"the mode of arms.{index}", where).model_dump())
        else:
            modes.append(_complete_mode(as_table(entry, f"modes.{index}", where), damping, f"modes.{index}", where))
    return None, modes, None


def _from_beam(plain: dict[str, Any], where: str) -> tuple[Structure, list[dict[str, Any]], dict[str, float]]:
    for key in ("patches", "tip", "damping"):
        if key not in plain:
            raise ParameterError(f"{where} has a [beam] but no {key!r}; a beam needs patches, tip and damping.")
    ceramic = as_table(plain.get("ceramic", {}), "ceramic", where)
    if not isinstance(plain["patches"], list):
        raise ParameterError(f"{where}: patches must be one or more tables [[patches]].")
    structure = Structure(
        beam=build(Beam, plain["beam"], "beam", where),
        patches=tuple(
            build(Patch, {**ceramic, **as_table(patch, f"patches.{index}", where)}, f"patches.{index}", where)
            for index, patch in enumerate(plain["patches"])
        ),
        tip=build(Tip, plain["tip"], "tip", where),
        damping=build(Damping, plain["damping"], "damping", where),
    )
    with located(where):
        modes = beam_model.resonator_modes(structure.beam, structure.patches, structure.tip, structure.damping)
    capacitance_a, capacitance_b = beam_model.clamped_capacitances(structure.beam, structure.patches)
    capacitances = {"capacitance_a_f": capacitance_a, "capacitance_b_f": capacitance_b}
    return structure, [mode.model_dump() for mode in modes], capacitances


def _from_solid(
    plain: dict[str, Any], where: str, folder: Path
) -> tuple[Solid, list[dict[str, Any]], dict[str, float]]:
    entries = [as_table(one, f"contacts.{index}", where) for index, one in enumerate(plain.get("contacts", ()))]
    solid = solid_from(plain["solid"], where, folder, [entry.pop("face", None) for entry in entries])
    try:
        stator = stator_of(solid)
    except ParameterError as error:
        raise ParameterError(f"{where}: {str(error).replace('solid.contacts.', 'contacts.')}") from error
    modes = stator.tables(solid.quality_factor)
    _place(entries, solid, stator, as_table(plain.get("contact", {}), "contact", where), where)
    for mode in modes:
        for name in ("recoil_kg", "recoil_x_kg"):
            if abs(mode[name]) <= 1e-6 * stator.mass_kg:
                mode[name] = 0.0  # but for rounding
    capacitance = stator.clamped_f + stator.residual_f
    if "feedback" in solid.groups:
        capacitance = _with_feedback(plain, capacitance, modes, stator.couplings_n_per_v[2].tolist(), where)
    between = -float(capacitance[0, 1])
    motion = np.where(np.diag(stator.residual_m_per_n)[:, np.newaxis] > 0.0, stator.residual_m_per_v[:, :2], 0.0)
    motion = np.where(np.abs(motion) > _NO_MOTION * np.abs(motion).max(), motion, 0.0)  # 0 but for rounding
    piezo = {
        "capacitance_a_f": float(capacitance[0, 0]),
        "capacitance_b_f": float(capacitance[1, 1]),
        "capacitance_ab_f": between if abs(between) > 1e-6 * capacitance[0, 0] else 0.0,  # 0 but for rounding
    }
    for axis, row in zip("yx", motion.tolist(), strict=True) if len(entries) < 2 else ():
        piezo |= {f"motion_{axis}_{group}_m_per_v": per_volt for group, per_volt in zip(GROUPS, row, strict=True)}
    return solid, modes, piezo


def _place(entries: list[dict[str, Any]], solid: Solid, stator: Stator, contact: dict[str, Any], where: str) -> None:
    """Complete ``[[contacts]]`` of a solid: the motion at their faces, of those without face and tip at its own.

    The compliance left out at a face replaces that at the solid's own; its part between two faces is neglected, like
    the motion per volt.
    """
    names = [mode["name"] for mode in stator.tables(solid.quality_factor)]
    found = iter(stator.faces.reshape(-1, 2, len(names) + 1).tolist())
    for index, (entry, face) in enumerate(zip(entries, solid.faces, strict=True)):
        tips = {"tip_x", "tip_y"} & entry.keys()
        if face and (tips or len(entries) == 1):
            raise ParameterError(
                f"{where}: contacts.{index}.face is for one of several contacts, without tip_x and tip_y: leave it out."
            )
        y, x = next(found) if face else (stator.tip_y.tolist(), stator.tip_x.tolist())
        if not tips:
            entry |= {axis: dict(zip(names, motion, strict=False)) for axis, motion in (("tip_x", x), ("tip_y", y))}
        if face:
            given = as_table(entry.get("contact", {}), f"contacts.{index}.contact", where)
            for name, more in zip(_SERIES, (y[-1], x[-1]), strict=True):
                own = limited(Contact, name, contact.get(name, 0.0), f"contact.{name}", where)
                entry["contact"] = given = {name: own + max(more, 0.0), **given}


def _from_ring(plain: dict[str, Any], where: str) -> tuple[Ring, list[dict[str, Any]], dict[str, float]]:
    """Return a ring, its modes and its capacitances, and put its contacts into the file."""
    ring = build(Ring, plain["ring"], "ring", where)
    if "contacts" in plain:
        raise ParameterError(f"{where}: the contacts of a [ring] follow from ring.points; leave out [[contacts]].")
    with located(where):
        wave = wave_of(ring)
    modes, couplings = ring_modes(ring, wave)
    plain["contacts"] = ring_contacts(ring, wave)
    covered = ring.waves_a, ring.waves_b, ring.waves_feedback
    capacitance = np.diag([capacitance_f(ring, waves) for waves in covered])
    if ring.waves_feedback:
        capacitance = _with_feedback(plain, capacitance, modes, couplings, where, "[ring]")
    elif "feedback" in plain:
        raise ParameterError(f"{where}: [feedback] belongs to ring.waves_feedback > 0: specify both, or neither.")
    return ring, modes, {"capacitance_a_f": float(capacitance[0, 0]), "capacitance_b_f": float(capacitance[1, 1])}


def _with_feedback(
    plain: dict[str, Any], capacitance: Any, modes: list[dict[str, Any]], couplings: Sequence[float], where: str,
    source: str = "[solid]",
) -> Any:  # fmt: skip
    """Complete ``[feedback]``, which has the capacitance of cable and amplifier only, by the electrode of a stator.

    The modes get the force factors of groups A and B with the electrode open; return the capacitances with it open.
    """
    table = dict(as_table(plain.get("feedback", {}), "feedback", where))
    if given := [name for name in ("couplings_n_per_v", "share_a", "share_b") if name in table]:
        raise ParameterError(f"{where}: feedback.{given[0]} follows from {source}; leave it out.")
    if "capacitance_f" not in table:
        words = "Specify the capacitance of cable and amplifier, in F."
        raise ParameterError(f"{where}: feedback.capacitance_f is missing. {words}")
    total = float(capacitance[2, 2])
    total += limited(Feedback, "capacitance_f", table.get("capacitance_f"), "feedback.capacitance_f", where)
    shares = 0.0 - capacitance[:2, 2] / total
    table |= {"capacitance_f": total, "share_a": float(shares[0]), "share_b": float(shares[1])}
    for mode, force in zip(modes, couplings, strict=True):
        table.setdefault("couplings_n_per_v", {})[mode["name"]] = force
        mode["coupling_a_n_per_v"] += table["share_a"] * force
        mode["coupling_b_n_per_v"] += table["share_b"] * force
    plain["feedback"] = table
    return capacitance[:2, :2] - total * np.outer(shares, shares)


def _softening(
    contact: Mapping[str, Any],
    structure: Structure | Solid | Ring | None,
    provenance: dict[str, Provenance],
    where: str,
) -> dict[str, float]:
    """Return the compliances in series with the contact to which left-out modes of a solid, or of a stem, add."""
    if isinstance(structure, Solid):
        left_out = np.diag(stator_of(structure).residual_m_per_n)
    elif isinstance(structure, Structure) and structure.tip.stem_youngs_modulus_pa is not None:
        # a force on the head bends and stretches the stem, and the two modes contain little of that
        left_out = beam_model.solve_resonator(structure.beam, structure.patches, structure.tip).residual_m_per_n
    else:
        return {}
    found: dict[str, float] = {}
    for name, more in zip(_SERIES, left_out, strict=True):
        if more > 0.0:
            given = limited(Contact, name, contact.get(name, 0.0), f"contact.{name}", where)
            note = f"the modes that are left out add {more:.3g} m/N"
            provenance[f"contact.{name}"] = Provenance("derived", note)
            found[name] = given + float(more)
    return found


def _complete_mode(entry: dict[str, Any], damping: Damping | None, path: str, where: str) -> dict[str, Any]:
    """Return a mode with stiffness and damping; ``build`` checks the remaining entries."""
    check_keys(entry, (*Mode.model_fields, *ALIASES), where, path)
    for alias, field in ALIASES.items():
        if alias in entry and field in entry:
            raise ParameterError(f"{where}: {path} specifies both {alias} and {field}; specify one.")
    if "mass_kg" not in entry:
        raise ParameterError(f"{where}: {path}.mass_kg is missing (modal mass m, in kg). Specify it.")
    if "frequency_hz" not in entry and "stiffness_n_per_m" not in entry:
        raise ParameterError(f"{where}: {path} has no frequency. Specify frequency_hz or stiffness_n_per_m.")
    entry = with_constants(entry, path, where, damping)
    if "damping_n_s_per_m" not in entry:
        raise ParameterError(
            f"{where}: {path} has no damping. Specify quality_factor or damping_n_s_per_m, or [damping] for all."
        )
    return entry


def _resolve_contact(entry: Any, rotor_radius_m: float, where: str) -> tuple[dict[str, Any], Source | None]:
    contact = dict(as_table(entry, "contact", where))
    source: Source | None = None
    for kind in SOURCES:
        if kind.TABLE not in contact:
            continue
        place = f"contact.{kind.TABLE}"
        source = build(kind, contact.pop(kind.TABLE), place, where)
        constants = source.constants(rotor_radius_m)
        if both := [key for key in constants if key in contact]:
            raise ParameterError(f"{where}: contact.{both[0]} follows from [{place}]; leave out one of them.")
        contact.update(constants)
    return contact, source


def _check_drive(entry: Any, where: str) -> None:
    """Check the table of the recommended drive, if there is one."""
    if entry is None:
        return
    table = as_table(entry, "drive", where)
    kind = table.get("kind", "two-phase")
    require(kind in list(DRIVES), f"{where}: drive.kind", kind, f"one of {', '.join(DRIVES)}")
    with located(f"{where}: [drive]"):
        DRIVES[kind](**{name: value for name, value in table.items() if name != "kind"})


def _strip(value: Any, path: str, provenance: dict[str, Provenance], where: str) -> Any:
    """Separate the provenance from a value, a table or an array of tables."""
    if isinstance(value, list):
        return [_strip(item, f"{path}.{index}", provenance, where) for index, item in enumerate(value)]
    if not isinstance(value, dict):
        provenance[path] = Provenance("stated", "")
        return value
    if "value" not in value and not any(kind in value for kind in KINDS):
        return {key: _strip(item, f"{path}.{key}", provenance, where) for key, item in value.items()}
    kinds = [kind for kind in KINDS if kind in value]
    if "value" not in value or len(kinds) != 1 or len(value) != 2 or not isinstance(value[kinds[0]], str):
        shown = path if path.isascii() and re.fullmatch(r"[\w.-]+", path) else quoted(path)
        raise ParameterError(
            f'{where}: {shown} must read {{ value = …, given | derived | assumed = "why" }}, one of the three.'
        )
    provenance[path] = Provenance(kinds[0], value[kinds[0]])
    return value["value"]
