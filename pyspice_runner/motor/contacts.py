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

from pyspice_runner.errors import ParameterError, require
from pyspice_runner.motor.contact import elastic_force, limit_ratio, static_penetration, stiffnesses_at_preload
from pyspice_runner.motor.parameters import Contact, ContactPlace, Mode
from pyspice_runner.motor.refusal import build
from pyspice_runner.units import engineering

Array = NDArray[np.float64]
_SHARES = 1e-6  # by which given shares may miss 1
_STEPS = 200  # each leaves 1 - 1/p of a depth or less: 1 mm becomes 1 nm in 41 for p = 3.5
_LEAST_N = 1e-6  # N, the minimum of contact.preload_n; a contact with a smaller force does not touch
_SETTLED = 1e-12  # of the largest depth or gap: last step of Newton's method, which is quadratic


@dataclass(frozen=True)
class Touching:
    """One contact of a motor."""

    name: str
    suffix: str  # of its nodes and instances in a circuit: empty for the first, then 2, 3 and so on
    contact: Contact  # all its equal points together, under their preload at rest, or at ``height_m`` 0
    point: Contact  # one of them
    radius_m: float  # of the rotor there
    share: float  # of the preload at rest, 0 if it does not touch then
    multiplicity: int = 1  # number of equal points
    direction: int = 1  # -1 if the x of the stator points backward there
    gap_m: float = 0.0  # from the rotor at rest
    law: Mapping[str, str | float] = field(default_factory=dict, hash=False)  # its own: name and own parameters
    preload_n: float = field(init=False)  # normal force at rest
    # 0 if it touches at rest; otherwise minus the gap and the static penetration of ``contact``
    height_m: float = field(init=False)

    def __post_init__(self) -> None:
        touches = bool(self.share)
        object.__setattr__(self, "preload_n", self.contact.preload_n if touches else 0.0)
        object.__setattr__(self, "height_m", 0.0 if touches else -self.gap_m - static_penetration(self.contact))


@dataclass(frozen=True, eq=False)
class AtRest:
    """The contacts of a motor under its preload: arrays with an element for each."""

    preload_n: Array
    friction: Array  # coefficient
    radius_m: Array  # of the rotor there
    depth_m: Array  # static penetration, of one that does not touch that at height 0
    limit_m: Array  # limit of stick

    @classmethod
    def of(cls, touching: Sequence[Touching]) -> AtRest:
        """Return the values of contacts."""
        rows = []
        for one in touching:
            depth = static_penetration(one.contact)
            limit = limit_ratio(one.contact) * depth
            rows.append((one.preload_n, one.contact.friction, one.radius_m, depth, limit))
        return cls(*np.array(rows).T)


def gathered(contact: Contact, multiplicity: float, preload_n: float) -> Contact:
    """Return the contact that stands for several equal ones, or a part of one, in parallel under a preload in N."""
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


def touching_of(
    contact: Contact, places: Sequence[ContactPlace], radius_m: float, modes: Sequence[Mode]
) -> tuple[Touching, ...]:
    """Return the contacts of a motor as they rest; without places it is one."""
    if not places:
        return (Touching("contact", "", contact, contact, radius_m, 1.0),)
    stated, found, height = shares_of(places), list[Touching](), np.array([place.height_m for place in places])
    shares, gaps = stated, [0.0] * len(places)
    if height.any():
        even = touching_of(contact, [one.model_copy(update={"height_m": 0.0}) for one in places], radius_m, modes)
        towards = motion_rows(places, modes)[1::2]
        flexibility = (towards / np.array([mode.stiffness_n_per_m for mode in modes])) @ towards.T
        shares, gaps = resting(even, height, flexibility)
    for number, (place, share, gap) in enumerate(zip(places, shares, gaps, strict=True), start=1):
        preload = (share or stated[number - 1]) * contact.preload_n
        own = gathered(contact.model_copy(update=place.contact), place.part, preload / place.multiplicity)
        found.append(
            Touching(
                place.name, "" if number == 1 else str(number), gathered(own, place.multiplicity, preload), own,
                place.radius_m or radius_m, share, place.multiplicity, place.direction, gap, place.law,
            )
        )  # fmt: skip
    return tuple(found)


def resting(touching: Sequence[Touching], height_m: Array, flexibility: Array) -> tuple[list[float], list[float]]:
    """Return share of the preload and gap at rest of contacts at heights h; given are they at height 0, with δ⁰ and F⁰.

    δ = δ⁰ + h + a − C (F(δ) − F⁰), with the flexibility C of the stator, in m/N, and of what is in series, and the
    motion a of the carrier or the support that lets the forces sum to the preload. Newton's method begins where all
    touch. F is convex, so that the forces of each step sum to the preload or more.
    """
    contacts, rest = [one.contact for one in touching], AtRest.of(touching)
    softness = flexibility + np.diag([one.series_compliance_m_per_n for one in contacts])
    depth, common = rest.depth_m + height_m - height_m.min(), 0.0
    for number in range(_STEPS):
        forces = np.array([elastic_force(one, deep) for one, deep in zip(contacts, depth, strict=True)])
        under = (one.model_copy(update={"preload_n": load}) for one, load in zip(contacts, forces, strict=True))
        slopes = np.array([one.preload_n and stiffnesses_at_preload(one)[1] for one in under])
        left = rest.depth_m + height_m + common - softness @ (forces - rest.preload_n) - depth
        sides = np.column_stack([left, np.ones(len(depth))])
        moved, along = np.linalg.solve(np.eye(len(depth)) + softness * slopes, sides).T
        further = (rest.preload_n.sum() - forces.sum() - slopes @ moved) / (slopes @ along)
        part = 1.0 if number < 0.25 * _STEPS else 0.5  # where linings open and close in turn
        step = part * (moved + further * along)
        depth, common = depth + step, common + part * further
        if np.abs(step).max() <= _SETTLED * np.abs(depth).max():
            forces *= forces >= _LEAST_N
            return (forces / forces.sum()).tolist(), np.maximum(-depth, 0.0).tolist()
    raise ValueError("the heights of [[contacts]] have no equilibrium that Newton's method finds: make them smaller")


def uneven(touching: Sequence[Touching], places: Sequence[ContactPlace]) -> tuple[str, ...]:
    """Return a sentence if heights leave contacts without their stated shares, or away from the rotor."""
    if not any(one.gap_m for one in touching) and not any(place.height_m and place.share for place in places):
        return ()
    away = (f", {engineering(one.gap_m, 'm')} from the rotor" if one.gap_m else "" for one in touching)
    borne = ", ".join(f"{one.name} {100.0 * one.share:.3g} %{far}" for one, far in zip(touching, away, strict=True))
    return (f"By their heights, the contacts bear of the preload at rest: {borne}. A share holds where heights are 0.",)


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
    if entries is None:
        return {name: value for name, value in found.items() if name != "contacts"}
    if not entries or not isinstance(entries, list | tuple):
        raise ParameterError(f"{where}: contacts must be one or more tables [[contacts]].")
    places = [_place(entry, number, where) for number, entry in enumerate(entries)]
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
    found["contact"] = gathered(own, first.part * first.multiplicity, own.preload_n).model_dump()
    del found["contacts"]
    return found


def _place(entry: Any, number: int, where: str) -> ContactPlace:
    """Return one of the contacts; without a name it has its number."""
    if not isinstance(entry, Mapping):
        return build(ContactPlace, entry, f"contacts.{number}", where)
    given = {"name": f"contact{number + 1}", **entry}
    path = f"contacts.{entry.get('name', number)}"
    if "law" in given:
        law = {"name": given["law"]} if isinstance(given["law"], str) else given["law"]
        valid = isinstance(law, dict) and all((key == "name") == isinstance(one, str) for key, one in law.items())
        require(valid, f"{where}: {path}.law", given["law"], "a name, or a table of name and numbers")
        given["law"] = law
    if given.get("direction") is True:  # pydantic takes it for 1
        given["direction"] = "true"
    return build(ContactPlace, given, path, where)
