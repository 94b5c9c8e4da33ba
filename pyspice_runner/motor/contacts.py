# SPDX-License-Identifier: GPL-3.0-or-later
"""Several contacts between one stator and one rotor.

Each has its own motion, a share of the preload and possibly values of its own; all act on the modes, on one carrier
and on one shaft. Equal points that do the same, such as those of the waves of a ring, are one contact: in parallel they
have the sum of the forces at the same displacements, which is the law of a single one with other constants
(:func:`gathered`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.errors import ParameterError
from pyspice_runner.motor.contact import limit_ratio, static_penetration
from pyspice_runner.motor.parameters import Contact, ContactPlace, Mode
from pyspice_runner.motor.refusal import build

Array = NDArray[np.float64]
_SHARES = 1e-6  # by which given shares may miss 1


@dataclass(frozen=True)
class Touching:
    """One contact of a motor."""

    name: str
    suffix: str  # of its nodes and instances in a circuit: empty for the first, then 2, 3 and so on
    contact: Contact  # all its equal points together
    point: Contact  # one of them
    radius_m: float  # of the rotor there
    share: float  # of the preload
    multiplicity: int = 1  # number of equal points
    direction: int = 1  # -1 if the x of the stator points backward there
    height_m: float = 0.0
    law: Mapping[str, str | float] = field(default_factory=dict, hash=False)  # its own: name and own parameters


@dataclass(frozen=True, eq=False)
class AtRest:
    """The contacts of a motor under its preload: arrays with an element for each."""

    preload_n: Array
    friction: Array  # coefficient
    radius_m: Array  # of the rotor there
    depth_m: Array  # static penetration
    limit_m: Array  # limit of stick

    @classmethod
    def of(cls, touching: Sequence[Touching]) -> AtRest:
        """Return the values of contacts."""
        rows = []
        for one in touching:
            depth = static_penetration(one.contact)
            limit = limit_ratio(one.contact) * depth
            rows.append((one.contact.preload_n, one.contact.friction, one.radius_m, depth, limit))
        return cls(*np.array(rows).T)


def gathered(contact: Contact, multiplicity: int, preload_n: float) -> Contact:
    """Return the contact that stands for several equal ones in parallel under a common preload in N."""
    if multiplicity == 1:
        return contact if preload_n == contact.preload_n else contact.model_copy(update={"preload_n": preload_n})
    changed = {"preload_n": preload_n}
    changed["normal_stiffness_n_per_m15"] = multiplicity * contact.normal_stiffness_n_per_m15
    for side in ("tip", "rotor"):
        name = f"tangential_compliance_{side}_m_per_n23"
        changed[name] = getattr(contact, name) / multiplicity ** (1.0 / contact.exponent)
    for name in ("series_compliance_m_per_n", "tangential_series_compliance_m_per_n"):
        changed[name] = getattr(contact, name) / multiplicity
    if contact.effective_radius_m is not None:  # the area of all, for the pressure; worn flats penetrate as each alone
        changed["effective_radius_m"] = multiplicity * contact.effective_radius_m
        changed["worn_flat_radius_m"] = multiplicity**0.5 * contact.worn_flat_radius_m
    return contact.model_copy(update=changed)


def touching_of(contact: Contact, places: Sequence[ContactPlace], radius_m: float) -> tuple[Touching, ...]:
    """Return the contacts of a motor; without places it is one."""
    if not places:
        return (Touching("contact", "", contact, contact, radius_m, 1.0),)
    found = []
    for number, (place, share) in enumerate(zip(places, shares_of(places), strict=True), start=1):
        preload = share * contact.preload_n
        own = contact.model_copy(update={**place.contact, "preload_n": preload / place.multiplicity})
        found.append(
            Touching(
                place.name, "" if number == 1 else str(number), gathered(own, place.multiplicity, preload), own,
                place.radius_m or radius_m, share, place.multiplicity, place.direction, place.height_m, place.law,
            )
        )  # fmt: skip
    return tuple(found)


def shares_of(places: Sequence[ContactPlace]) -> list[float]:
    """Return the shares of the preload. Raise ValueError if they are given in part, or their sum is not 1."""
    given = [place.share for place in places if place.share is not None]
    if not given:
        total = sum(place.multiplicity for place in places)
        return [place.multiplicity / total for place in places]
    without = ", ".join(place.name for place in places if place.share is None)
    if without or abs(sum(given) - 1.0) > _SHARES:
        said = f"the shares of [[contacts]] sum to {sum(given):g}{f', without one for {without}' if without else ''}"
        raise ValueError(f"{said}: give all of them, with a sum of 1, or none")
    return [share / sum(given) for share in given]


def motion_rows(places: Sequence[ContactPlace], modes: Sequence[Mode]) -> Array:
    """Return what the modes move the contacts, rows x₁, y₁, x₂, y₂ and so on, each x forward."""
    rows = []
    for place in places:
        rows.append([place.direction * place.tip_x.get(mode.name, 0.0) for mode in modes])
        rows.append([place.tip_y.get(mode.name, 0.0) for mode in modes])
    return np.array(rows, dtype=float)


def check_places(contact: Contact, places: Sequence[ContactPlace], modes: Sequence[Mode]) -> None:
    """Raise ValueError for contacts that do not go together with the modes or with the values of all."""
    names, known = [place.name for place in places], {mode.name for mode in modes}
    if len(set(names)) != len(names):
        raise ValueError(f"two contacts share a name in {names}; give each its own")
    shares_of(places)
    if places[0].direction != 1:
        raise ValueError(
            f"contacts.{names[0]}.direction = {places[0].direction} is not valid: the first contact defines forward, "
            "with direction = 1; specify the others relative to it"
        )
    for place in places:
        for axis in ("tip_x", "tip_y"):
            if unknown := [*getattr(place, axis).keys() - known]:
                raise ValueError(
                    f"contacts.{place.name}.{axis} has {unknown[0]!r}, which is no mode: they are "
                    f"{', '.join(mode.name for mode in modes)}"
                )
        if not any(place.tip_y.values()):
            raise ValueError(f"no mode moves the contact {place.name} towards the rotor: give its tip_y")
        if "preload_n" in place.contact:
            raise ValueError(
                f"contacts.{place.name}.contact.preload_n is not valid: contact.preload_n is that of all "
                "contacts, so specify share"
            )
        try:
            build(Contact, {**contact.model_dump(), **place.contact}, f"contacts.{place.name}.contact", "")
        except ParameterError as error:
            raise ValueError(str(error).removeprefix(": ")) from error


def resolved(parts: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Return the tables of a motor whose modes have the motion of the first contact; a single one leaves no list.

    Raise ParameterError for an invalid list.
    """
    found, entries = dict(parts), parts.get("contacts")
    if not entries:
        return {name: value for name, value in found.items() if name != "contacts"}
    if not isinstance(entries, list | tuple):
        raise ParameterError(f"{where}: contacts must be one or more tables [[contacts]].")
    places = []
    for number, entry in enumerate(entries):
        named = {"name": f"contact{number + 1}", **entry} if isinstance(entry, Mapping) else entry
        if isinstance(named, dict) and isinstance(named.get("law"), str):
            named["law"] = {"name": named["law"]}
        label = entry.get("name", number) if isinstance(entry, Mapping) else number
        places.append(build(ContactPlace, named, f"contacts.{label}", where))
    first = places[0]
    found["modes"] = [
        {
            **mode,
            "tip_x": first.direction * first.tip_x.get(mode["name"], 0.0),
            "tip_y": first.tip_y.get(mode["name"], 0.0),
        }
        for mode in parts["modes"]
    ]
    if len(places) > 1:
        return {**found, "contacts": tuple(places)}
    if first.radius_m is not None or first.height_m or first.share is not None or first.law:
        raise ParameterError(
            f"{where}: radius_m, share, height_m, law are for several [[contacts]], and there is one; leave them out."
        )
    modes = [build(Mode, mode, f"modes.{index}", where) for index, mode in enumerate(found["modes"])]
    given = build(Contact, parts["contact"], "contact", where)
    try:
        check_places(given, places, modes)
    except ValueError as error:
        raise ParameterError(f"{where}: {error}.") from error
    own = given.model_copy(update=first.contact)
    found["contact"] = gathered(own, first.multiplicity, own.preload_n).model_dump()
    del found["contacts"]
    return found
