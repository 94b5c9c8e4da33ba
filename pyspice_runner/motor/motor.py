# SPDX-License-Identifier: GPL-3.0-or-later
"""The motor: modes, electrical groups, contact, rotor or slider, and mount."""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, wraps
from math import inf, pi, sqrt
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, Self, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    Field,
    FiniteFloat,
    SerializerFunctionWrapHandler,
    ValidationError,
    model_serializer,
    model_validator,
)

from pyspice_runner.display import Shown
from pyspice_runner.errors import ParameterError
from pyspice_runner.motor import contact as contact_law
from pyspice_runner.motor.beam_limits import beam_cautions
from pyspice_runner.motor.contacts import AtRest, Touching, check_places, motion_rows, resolved, touching_of, uneven
from pyspice_runner.motor.groups import GROUPS
from pyspice_runner.motor.materials import SOURCES, Lining, Materials, Source
from pyspice_runner.motor.parameters import (
    HERTZ,
    MIN_CAPACITANCE,
    MOST_CONTACTS,
    Beam,
    Contact,
    ContactPlace,
    Damping,
    Feedback,
    Limits,
    Mode,
    Mount,
    Parameters,
    Patch,
    Piezo,
    Rotor,
    Slider,
    Tip,
    ToolLoad,
    quantity,
)
from pyspice_runner.motor.refusal import build, checked, limited, quoted, refusal
from pyspice_runner.motor.ring import Ring, ring_cautions
from pyspice_runner.motor.solid.parameters import Solid
from pyspice_runner.motor.stator import MODE_COLUMNS, Stator, carriers, unknown_recoil
from pyspice_runner.units import engineering

Array = NDArray[np.float64]
_Arguments = ParamSpec("_Arguments")
_Found = TypeVar("_Found")
_SETTLED = 7.0  # time constants, after which a power is within 0.2 % of its end
_MOST_KEPT = 256  # facts of one motor


@dataclass(eq=False)
class _Facts:
    """What functions have derived from a motor, by function and arguments."""

    found: dict[Any, Any] = field(default_factory=dict)


def derived(
    function: Callable[Concatenate[Motor, _Arguments], _Found],
) -> Callable[Concatenate[Motor, _Arguments], _Found]:
    """Keep what a function derives from a motor and from further hashable values, while the motor is in use.

    A motor does not change; the caller must not change the result.
    """

    @wraps(function)
    def call(motor: Motor, /, *values: _Arguments.args, **named: _Arguments.kwargs) -> _Found:
        facts, name = motor.facts.found, (function, values, *named.items())
        if name in facts:
            return facts[name]  # type: ignore[no-any-return]
        found = function(motor, *values, **named)
        if len(facts) >= _MOST_KEPT:
            facts.clear()
        facts[name] = found
        return found

    return call


# Relations between the values of a motor.
LOWEST_FREQUENCY, HIGHEST_FREQUENCY = 10.0, 1e7  # Hz, of a mode: from large quasi-static stages to MEMS
LOWEST_QUALITY, HIGHEST_QUALITY = 0.5, 1e6  # below it does not ring; quartz in vacuum, the best there is, has 1e6
MOST_MODES = 20
WIDEST_SPREAD = 1e3  # of the modes' frequencies: a beam's 20th, and there may be no more, is 400 times its first
CLOSEST_COUPLING = 0.9  # k², of the best single crystals (k₃₃ = 0.95)
STIFFEST_CONTACT = 100.0  # fastest motion in contact over that of the stator: the tip has 1e-4 of the stator's mass


OTHER_PRESSURE = (
    "The contact has the exponent {:g}, not Hertz's: pressure and tension, which have limits, are not known."
)
# of a lining, in %; a neo-Hookean lining has (1/λ² − λ)/3ε = 1.27 times the force of the linear law at this strain
# (L. R. G. Treloar, The Physics of Rubber Elasticity, 1975, ch. 5)
LINEAR_STRAIN = 20.0
DEEPEST_SLIDER_M = 1e-3  # a tenth of the radius of a large tip: Hertz's theory holds for a shallow contact


# parameters without a meaning while the effect of another one is off
_COMPANIONS = {
    "restitution_velocity_m_s": "restitution", "stribeck_velocity_m_s": "sliding_ratio",
    "tangential_damping_n_s_per_m": "tangential_stiffness_n_per_m", "bearing_presliding_rad": "bearing_friction_n_m",
    "guide_presliding_m": "guide_friction_n",
}  # fmt: skip


ALIASES = {"frequency_hz": "stiffness_n_per_m", "quality_factor": "damping_n_s_per_m"}  # other ways to state a mode
_OPTIONAL: dict[str, type[Parameters]] = {  # that may be null
    "mount": Mount, "limits": Limits, "load": ToolLoad, "feedback": Feedback,
}  # fmt: skip
MOVED: dict[str, type[Parameters]] = {"rotor": Rotor, "slider": Slider}  # what the tip moves: one of them
SECTIONS: dict[str, type[Parameters]] = {"piezo": Piezo, "contact": Contact, **MOVED, **_OPTIONAL}


class TransducerError(ParameterError):
    """What is asked for needs the contact or the rotor, and a transducer has none."""


def require_one_contact(motor: Motor, what: str, instead: str) -> None:
    """Raise ParameterError for a motor with several contacts; ``what`` begins the sentence, ``instead`` the advice."""
    if motor.contacts:
        raise ParameterError(
            f"{what} for a motor with one contact, and {motor.name} has {len(motor.contacts)}. {instead}."
        )


class Ringing(Parameters):
    """A mode by its ringing, from which stiffness and damping follow."""

    frequency_hz: float = quantity("natural frequency", "Hz", ge=LOWEST_FREQUENCY, le=HIGHEST_FREQUENCY)
    quality_factor: float = quantity("mechanical quality factor", "1", gt=LOWEST_QUALITY, le=HIGHEST_QUALITY)


OF_FILES = ("beam.", "ceramic.", "patches.", "tip.", "damping.", "arms.", "solid.", "ring.")  # read on loading
OF_GROUP_B = ("coupling_b_n_per_v", "capacitance_b_f", "motion_x_b_m_per_v", "motion_y_b_m_per_v")  # of one group: 0
_OF_MOTOR = ("contact", "rotor")  # what a transducer has not
KINDS = ("given", "derived", "assumed")  # of the origin of a value in a file


@dataclass(frozen=True)
class Provenance:
    """Where a value comes from: given (in the paper), derived, assumed, default, set (by the user) or just stated."""

    kind: str
    note: str

    def __post_init__(self) -> None:
        """Replace unpaired UTF-16 surrogates in the note, which no file can hold."""
        object.__setattr__(self, "note", self.note.encode("utf-8", "replace").decode())


class Structure(Parameters):
    """The stator from which the modes are computed; used for plots of the mode shapes."""

    beam: Beam
    patches: tuple[Patch, ...]
    tip: Tip
    damping: Damping


def absent() -> Any:
    """Declare a part that a transducer does not have."""
    return Field(default=None)


class Motor(Shown, Parameters):
    """A standing-wave piezomotor: modes, electrical groups, contact, and rotor or slider; or a transducer.

    A transducer has modes and one group or two, neither contact nor rotor, and may have a ``load``. An analysis that
    needs one of what is not there raises a :class:`TransducerError`.

    A motor with a ``slider`` has a ``rotor`` as well, that of radius 1 m which moves in the same way
    (:attr:`.Slider.as_rotor`). Its speeds in rad/s and torques in N·m are m/s and N.

    ``drive`` is the table of the recommended drive, for ``default_drive``. ``structure`` (a beam), ``solid``, ``ring``
    and ``provenance`` state the origin of the values; ``materials`` are those of the contact or its lining, from which,
    and from the radius of the rotor, its constants follow.
    """

    name: str = Field(
        description="name of the motor",
        min_length=1,
        max_length=60,
        pattern=r"^[A-Za-z0-9][A-Za-z0-9_. -]*$",
        json_schema_extra={"made_of": "letters, digits, spaces, dots, - and _, the first a letter or digit"},
    )
    modes: tuple[Mode, ...] = Field(
        description="the bending modes, by rising frequency", min_length=1, max_length=MOST_MODES
    )
    piezo: Piezo
    contact: Contact = absent()  # not there of a transducer
    rotor: Rotor = absent()
    slider: Slider | None = Field(default=None, description="slider of a linear stage; null: the motor turns a rotor")
    mount: Mount | None = Field(default=None, description="plate springs of the stator; null: held at a fixed distance")
    limits: Limits | None = Field(default=None, description="limits of ceramic and contact; null: not known")
    load: ToolLoad | None = Field(default=None, description="load of a transducer; null: it runs idle")
    feedback: Feedback | None = Field(default=None, description="feedback electrode; null: there is none")
    law: dict[str, FiniteFloat] = Field(
        default_factory=dict, description="values of parameters of the contact's law; others have its defaults"
    )
    contacts: tuple[ContactPlace, ...] = Field(
        default=(),
        description="several contacts of the stator; none: one, as the modes move it",
        max_length=MOST_CONTACTS,
    )
    materials: Source | None = Field(default=None, exclude=True)
    drive: dict[str, Any] | None = Field(default=None, exclude=True)
    structure: Structure | None = Field(default=None, exclude=True)
    solid: Solid | None = Field(default=None, exclude=True)
    ring: Ring | None = Field(default=None, exclude=True)
    provenance: dict[str, Provenance] = Field(default_factory=dict, exclude=True)
    left_out: tuple[str, ...] = Field(default=(), exclude=True)  # of a fitted circuit, one sentence each

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            if name in _OF_MOTOR and "name" in self.__dict__:
                raise TransducerError(
                    f"{self.name} is a transducer: it has no {name}, which this needs. Its analyses are admittance, "
                    "simulate, steady, map, sweep, drive, track, loop (--quantity phase), report, live and export; a "
                    "motor's file has [contact] and [rotor]."
                )
            return super().__getattr__(name)

    def __init__(self, *values: Any, **named: Any) -> None:
        if values:
            raise ParameterError("Motor: name every parameter, or use load_motor(NAME or FILE) and its method updated.")
        super().__init__(**named)

    @model_validator(mode="before")
    @classmethod
    def _with_rotor(cls, values: Any) -> Any:
        """Give a motor with a slider the rotor that moves in the same way."""
        if not isinstance(values, Mapping) or values.get("slider") is None:
            return values
        if "rotor" in values:
            raise ValueError("a motor has a rotor or a slider, not both: specify one of them")
        slider = Slider.model_validate(values["slider"])
        return {**values, "slider": slider, "rotor": slider.as_rotor}

    @model_serializer(mode="wrap")
    def _without_other(self, write: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Return the document with the rotor or the slider, as the motor was specified."""
        document: dict[str, Any] = write(self)
        document.pop("rotor" if self.slider else "slider", None)
        if not self.is_transducer:
            del document["load"]
        elif len(self.groups) == 1:
            document["modes"] = [{k: v for k, v in mode.items() if k not in OF_GROUP_B} for mode in document["modes"]]
            document["piezo"] = {k: v for k, v in document["piezo"].items() if k not in OF_GROUP_B}
        if self.contacts:
            document["contacts"] = [place.model_dump(exclude_defaults=True) for place in self.contacts]
        for name in ("law", "feedback", "contacts"):
            if not document[name]:
                del document[name]
        return document

    @model_validator(mode="after")
    def _check(self) -> Self:
        missing = [name for name in _OF_MOTOR if self.__dict__.get(name) is None]
        if len(missing) == 1:
            raise ValueError(f"it has no {missing[0]}: a motor needs contact, and rotor or slider, a transducer none")
        for name in missing:
            self.__dict__.pop(name, None)
        self._check_relations()
        if missing:
            self.__dict__["load"] = self.tool
            self._check_transducer()
        else:
            self._check_contact()
        return self

    @cached_property
    def facts(self) -> _Facts:
        """What :func:`derived` keeps."""
        return _Facts()

    @cached_property
    def is_transducer(self) -> bool:
        """Whether it has neither contact nor rotor."""
        return "rotor" not in self.__dict__

    @cached_property
    def groups(self) -> tuple[str, ...]:
        """Names of its electrical groups."""
        return GROUPS[:1] if self.piezo.capacitance_b_f is None else GROUPS

    @property
    def main_mode(self) -> int:
        """Index of the mode that is driven and tracked by default: the last, of a transducer the best conducting."""
        conductances = [mode.coupling_a_n_per_v**2 / mode.damping_n_s_per_m for mode in self.modes]
        return conductances.index(max(conductances)) if self.is_transducer else len(self.modes) - 1

    @property
    def tool(self) -> ToolLoad:
        """The load of a transducer."""
        return self.load or ToolLoad()

    @property
    def load_motion(self) -> tuple[float, ...]:
        """Velocity that the load of a transducer opposes, per velocity of each mode."""
        if self.loads_face:
            return tuple(mode.tip_y for mode in self.modes)
        return tuple(float(mode.name == self.tool.mode or len(self.modes) == 1) for mode in self.modes)

    @property
    def loads_face(self) -> bool:
        """Whether the load of a transducer opposes the velocity of the face, and not that of a mode."""
        return self.tool.mode is None and not self.tool.resistance_ohm and any(mode.tip_y for mode in self.modes)

    @property
    def load_resistance_n_s_per_m(self) -> float:
        """Resistance of the load of a transducer, with that of its arm as group A sees it."""
        squares = (share * mode.coupling_a_n_per_v**2 for share, mode in zip(self.load_motion, self.modes, strict=True))
        return self.tool.resistance_n_s_per_m + self.tool.resistance_ohm * sum(squares)

    @derived
    def _check_relations(self) -> None:
        names = [mode.name for mode in self.modes]
        if len(set(names)) != len(names):
            raise ValueError(f"two modes share a name in {names}; give each its own")
        if self.slider and isinstance(self.materials, Materials) and self.materials.on_face:
            raise ValueError("contact.materials.on_face is for a rotor, and a slider is flat anyway: leave it out")
        for mode in self.modes:
            _check_mode(mode)
        if self.contacts and not self.is_transducer:
            check_places(self.contact, self.contacts, self.modes)
        lowest, highest = (bound(mode.frequency_hz for mode in self.modes) for bound in (min, max))
        if highest > WIDEST_SPREAD * lowest:
            raise ValueError(
                f"the modes reach from {lowest:.4g} to {highest:.4g} Hz; a stator's are at most a factor "
                f"{WIDEST_SPREAD:g} apart, so leave out those that do not take part"
            )
        for name in set(self.feedback.couplings_n_per_v if self.feedback else ()) - set(names):
            raise ValueError(f"feedback.couplings_n_per_v has {name!r}, which is no mode: they are {', '.join(names)}")
        stator = self.stator
        sensed = float(np.sum(stator.sensed**2 / stator.stiffness)) if self.feedback else 0.0
        if self.feedback and not sensed / (sensed + self.feedback.capacitance_f) <= CLOSEST_COUPLING:
            raise ValueError(
                "feedback.couplings_n_per_v and feedback.capacitance_f give a coupling k_eff² above "
                f"{CLOSEST_COUPLING:g}, which no ceramic exceeds: correct one of them"
            )
        clamped, motional = np.diag(stator.capacitance), np.sum(stator.coupling.T**2 / stator.stiffness, axis=1)
        for group, coupling in zip(self.groups, motional / (clamped + motional), strict=True):
            if coupling > CLOSEST_COUPLING:
                raise ValueError(
                    f"the modes give group {group.upper()} a coupling k_eff² = {coupling:.3g}, the share of Σ θ²/k in "
                    f"it and piezo.capacitance_{group}_f; no ceramic exceeds {CLOSEST_COUPLING:g}, so correct "
                    f"coupling_{group}_n_per_v or the capacitance"
                )

    @derived
    def _check_contact(self) -> None:
        stator, highest = self.stator, max(mode.frequency_hz for mode in self.modes)
        if self.piezo.capacitance_b_f is None:
            raise ValueError("piezo.capacitance_b_f is missing: a motor has two groups")
        if self.load is not None or self.piezo.reference_hz is not None:
            raise ValueError("[load] and piezo.reference_hz belong to a transducer, without contact and rotor")
        if not stator.contact.any():
            raise ValueError("no mode moves the tip: give tip_x or tip_y to one of them")
        self._check_motion()
        if self.lining_strain >= 1.0:
            raise ValueError(
                f"contact.preload_n = {self.contact.preload_n:g} N compresses the lining by {self.lining_strain:.3g} "
                "times contact.lining.thickness_m; it must be less than once, so lower it or enlarge the area"
            )
        shaking = stator.recoil[:, : len(carriers(self.mount))] / np.sqrt(stator.mass[:, np.newaxis])
        shaken = float(np.linalg.norm(shaking, 2)) ** 2 if self.mount else 0.0  # along the direction that moves most
        if self.mount and shaken >= self.mount.mass_kg:
            raise ValueError(
                f"the modes' recoil_kg shakes {shaken:.3g} kg, the sum of recoil_kg²/mass_kg, and mount.mass_kg = "
                f"{self.mount.mass_kg:g} kg, which contains the stator, must exceed it: correct one of them"
            )
        compressed = np.diag(stator.residual)[1::2] * self.at_rest.preload_n  # what is in series
        seat = float(np.max(self.at_rest.depth_m + compressed + self.deflections_m))
        deepest = DEEPEST_SLIDER_M if self.slider else 0.1 * self.rotor.radius_m
        if seat > deepest:
            most = "" if self.slider else f"a tenth of rotor.radius_m = {self.rotor.radius_m:g} m"
            raise ValueError(
                f"contact.preload_n = {self.contact.preload_n:g} N presses the tip {seat:.3g} m into the "
                f"{self.moved}; at most {most or f'{deepest:g} m'} is allowed, so lower the preload"
            )
        fastest = float(self.pressed_stator.resonances()[-1])
        if fastest > STIFFEST_CONTACT * highest:
            raise ValueError(
                f"pressed on the {self.moved} the tip swings at {fastest:.4g} Hz, more than {STIFFEST_CONTACT:g} times "
                f"the highest mode's {highest:.4g} Hz: the tip, the "
                f"{'slider' if self.slider else 'rotor at its rim'} or the carrier has too little mass; change tip_x "
                "and tip_y, contact.normal_stiffness_n_per_m15, "
                f"{'slider.mass_kg' if self.slider else 'rotor.inertia_kg_m2'} or mount.mass_kg"
            )

    def _check_transducer(self) -> None:
        names, load = [mode.name for mode in self.modes], self.tool
        if self.mount or self.materials or self.law or self.feedback or self.contacts:
            words = "mount, materials, law, feedback and contacts belong to a motor: leave them out of a transducer"
            raise ValueError(words)
        if load.mode not in (None, *names) or (load.resistance_ohm and load.mode is None and len(names) > 1):
            what = f"mode = {load.mode!r}" if load.mode else "resistance_ohm is of one arm: mode"
            raise ValueError(f"load.{what} is not valid: it must be one of {', '.join(names)}")
        if not any(self.load_motion) and load != ToolLoad():
            raise ValueError(
                "[load] acts on the face, whose motion is not known: give the arms mass_kg or velocity_per_current, "
                f"the modes tip_y, or specify load.mode, one of {', '.join(names)}"
            )

    def _check_motion(self) -> None:
        if self.contacts:
            if any(value for axis in self.piezo.motion for value in axis):
                raise ValueError(
                    "piezo.motion_x_a_m_per_v and other motions per volt are for one contact: set them to 0"
                )
            return
        stator, held = self.stator, self.stator.capacitance.copy()  # while these springs are held
        for axis, moved, softness in zip(("x", "y"), stator.residual_per_volt, np.diag(stator.residual), strict=True):
            if not moved.any():
                continue
            held -= np.outer(moved, moved) / softness
            if np.linalg.eigvalsh(held)[0] < MIN_CAPACITANCE:
                name = "series_compliance_m_per_n"
                raise ValueError(
                    f"piezo.motion_{axis}_a_m_per_v and motion_{axis}_b_m_per_v move the spring of contact."
                    f"{'tangential_' if axis == 'x' else ''}{name} = {softness:g} m/N, which is too stiff for them and "
                    "the capacitances: make it softer, or set both to 0"
                )

    @cached_property
    def stator(self) -> Stator:
        """The matrices of the free stator, without its carrier."""
        if self.is_transducer:
            return Stator.of_modes(self.modes, self.piezo, ())
        motion = motion_rows(self.contacts, self.modes) if self.contacts else None
        return Stator.of_modes(self.modes, self.piezo, self.touching, self.feedback, motion, self.rotor.radius_m)

    @cached_property
    def touching(self) -> tuple[Touching, ...]:
        """The contacts of a motor, one or several."""
        return touching_of(self.contact, self.contacts, self.rotor.radius_m, self.modes)

    @cached_property
    def at_rest(self) -> AtRest:
        """The contacts under the preload."""
        return AtRest.of(self.touching)

    @cached_property
    def loaded_stator(self) -> Stator:
        """The matrices of a transducer under its load."""
        return self.stator.loaded(np.array(self.load_motion), self.tool, self.load_resistance_n_s_per_m)

    @cached_property
    def carried_stator(self) -> Stator:
        """The matrices of the stator on its carrier."""
        return self.stator.with_carrier(self.mount)

    @cached_property
    def pressed_stator(self) -> Stator:
        """The matrices of stator, carrier and rotor, which the contact couples at its operating point, where it sticks.

        The last coordinate is the surface of the rotor. Along the normal the contact has the damping of impacts. Those
        of a transducer are under its load.
        """
        return self.loaded_stator if self.is_transducer else self.pressed_by(self.contact.preload_n)

    def pressed_by(self, force_n: float, stator: Stator | None = None) -> Stator:
        """Return :attr:`pressed_stator` under another normal force in N, of :attr:`stator` or of another free one."""
        rotor, stiffness, damping = self.rotor, list[float](), list[float]()
        for one in self.touching:
            contact = one.contact.model_copy(update={"preload_n": one.share * force_n})
            stiffness += contact_law.stiffnesses_at_preload(contact) if one.share else (0.0, 0.0)
            damping += (0.0, contact_law.normal_damping(contact) * contact.preload_n)
        carried = self.carried_stator if stator is None else stator.with_carrier(self.mount)
        return carried.pressed(
            stiffness,
            damping,
            rotor.inertia_kg_m2 / rotor.radius_m**2,
            rotor.bearing_damping_n_m_s / rotor.radius_m**2,
        )

    @property
    def lining_strain(self) -> float:
        """Static compression of a lining over its thickness; 0 if that is not known."""
        thickness = getattr(self.materials, "thickness_m", None)
        return float(max(self.at_rest.depth_m * (self.at_rest.preload_n > 0.0)) / thickness) if thickness else 0.0

    @property
    def deflection_m(self) -> float:
        """Bending Δ_C = F₀ Σ Y_n²/k_n of the stator under the preload, at the tip, in m."""
        return float(self.deflections_m[0])

    @property
    def deflections_m(self) -> Array:
        """Bending of the stator under the preload at each contact, in m."""
        return np.asarray(self.contact.preload_n * (self.stator.flexibility[1::2, 1::2] @ self.stator.share))

    @property
    def sway_m(self) -> float:
        """Sideways displacement x = −F₀ Σ X_n Y_n/k_n of the tip under the preload, in m; 0 for a symmetric stator.

        The crown of the rotor is above the tip at rest. Of several contacts it is the largest.
        """
        sways = -self.contact.preload_n * (self.stator.flexibility[::2, 1::2] @ self.stator.share)
        return float(sways[np.abs(sways).argmax()])

    def approach_m(self, preload_n: float) -> float:
        """Return the motion in m of the stator's support towards the rotor that changes the preload to another, N.

        Of a stator on a mount, the fixed end of the springs moves; otherwise the stator itself.
        """
        if self.mount:
            return (preload_n - self.contact.preload_n) / self.mount.stiffness_n_per_m
        deeper = contact_law.penetration(self.contact, preload_n) - contact_law.static_penetration(self.contact)
        return deeper + self.deflection_m * (preload_n / self.contact.preload_n - 1.0)

    def with_one_law(self) -> Motor:
        """Return the motor whose contacts have no law of their own."""
        places = tuple(place.model_copy(update={"law": {}}) for place in self.contacts)
        return self if places == self.contacts else self.model_copy(update={"contacts": places})

    def on_carrier(self) -> Motor:
        """Return the motor with the modes that its stator has on its carrier, which then shake it no more."""
        return self._of_stator(self.stator.on_carrier(self.mount))

    @cached_property
    def with_open_electrode(self) -> Motor:
        """The motor without its feedback electrode, with the modes that it has while that is open."""
        return self._of_stator(self.stator.with_open_electrode())

    def _of_stator(self, stator: Stator) -> Motor:
        """Return the motor with the modes of a stator."""
        if stator is self.stator:
            return self
        modes = tuple(
            mode.model_copy(update=dict(zip(MODE_COLUMNS, map(float, row), strict=True)))
            for mode, row in zip(self.modes, stator.mode_rows, strict=True)
        )
        names, rows = [mode.name for mode in modes], stator.contact.reshape(-1, 2, len(modes))
        contacts = tuple(
            place.model_copy(update={
                "tip_x": dict(zip(names, (place.direction * x).tolist(), strict=True)),
                "tip_y": dict(zip(names, y.tolist(), strict=True)),
            })
            for place, (x, y) in zip(self.contacts, rows if self.contacts else (), strict=True)
        )  # fmt: skip
        return self.model_copy(update={"modes": modes, "contacts": contacts, "feedback": stator.feedback})

    @property
    def moved(self) -> str:
        """What the tip moves: ``"rotor"`` or ``"slider"``."""
        return "slider" if self.slider else "rotor"

    @property
    def dry_friction(self) -> tuple[str, float, str]:
        """Path, value and unit of the dry friction of the bearing or the guide."""
        if self.slider:
            return "slider.guide_friction_n", self.slider.guide_friction_n, "N"
        return "rotor.bearing_friction_n_m", self.rotor.bearing_friction_n_m, "N·m"

    @property
    def decay_s(self) -> float:
        """Time in s in which the slowest free mode, or the carrier on its mount, decays by e."""
        return self.carried_stator.decay_s

    @property
    def settled_s(self) -> float:
        """Time in s from rest until the power of a transducer is within 0.2 % of its end; 0 for a motor."""
        return _SETTLED * self.loaded_stator.decay_s if self.is_transducer else 0.0

    @cached_property
    def cautions(self) -> tuple[str, ...]:
        """What is not known of the motor, and where the theory of its beam or ring ends; every result repeats it.

        A theory, or modes without recoil, that the source of the motor gives are no caution; ``show`` has the limits.
        """
        given = {path for path, origin in self.provenance.items() if origin.kind == "given"}
        of_theory = () if "beam.theory" in given else self.limits_of_theory
        unknown = () if "beam.recoil" in given else unknown_recoil(self.modes, self.mount, self.stator.contact)
        limits = None if self.is_transducer or self.contact.exponent == HERTZ else self.limits
        if limits and (limits.contact_pressure_pa or limits.contact_tension_pa):
            of_theory = (*of_theory, OTHER_PRESSURE.format(self.contact.exponent))
        if not self.is_transducer and (strain := 100.0 * self.lining_strain) >= LINEAR_STRAIN:
            words = f"{strain:.2g} % of its thickness: from {LINEAR_STRAIN:g} % on it is stiffer than the linear law."
            of_theory = (*of_theory, f"The preload compresses the lining by {words}")
        if self.contacts:
            of_theory = (*of_theory, *uneven(self.touching, self.contacts))
        return (*unknown, *of_theory, *self.left_out)

    @property
    def limits_of_theory(self) -> tuple[str, ...]:
        """Where the theory of the beam or ring ends, with estimated errors; ``show`` prints it in any case."""
        if (structure := self.structure) is not None:
            return beam_cautions(structure.beam, structure.patches, structure.tip, len(self.modes))
        return ring_cautions(self.ring) if self.ring is not None else ()

    def summary(self) -> dict[str, str]:
        """Return name, modes, contact, mount, and rotor or slider, ready to print."""
        modes = ", ".join(
            f"{engineering(mode.frequency_hz, 'Hz')} (Q {mode.quality_factor:.3g})" for mode in self.modes
        )
        capacitances = (engineering(value, "F") for value in self.piezo.capacitances)
        if self.is_transducer:
            load = ", ".join(f"{name} {value}" for name, value in self.tool.model_dump().items() if value) or "none"
            return {"name": self.name, "modes": modes, "clamped capacitances": " and ".join(capacitances), "load": load}
        rotor = self.rotor
        return {
            "name": self.name,
            "modes": modes,
            "preload": engineering(self.contact.preload_n, "N"),
            "mount": "fixed distance" if self.mount is None else f"{self.mount.stiffness_n_per_m:.4g} N/m",
            "friction": f"{self.contact.friction:g}",
            "clamped capacitances": " and ".join(capacitances),
            self.moved: f"mass {rotor.inertia_kg_m2:.4g} kg, guide damping {rotor.bearing_damping_n_m_s:.4g} N·s/m"
            if self.slider
            else f"radius {engineering(rotor.radius_m, 'm')}, inertia {rotor.inertia_kg_m2:.4g} kg·m²",
        }

    __str__ = Shown.__repr__

    def to_toml(self, *, heading: str = "") -> str:
        """Return the motor as TOML for :func:`~pyspice_runner.load_motor`: values as set, with their origin.

        Args:
            heading: words for the first lines, as a comment.
        """
        document = self.model_dump() | ({"drive": self.drive} if self.drive else {})
        if self.materials is not None:
            constants = self.materials.constants(inf if self.slider else self.rotor.radius_m)
            if all(getattr(self.contact, name) == value for name, value in constants.items()):
                document["contact"] = {k: v for k, v in document["contact"].items() if k not in constants}
                document[f"contact.{self.materials.TABLE}"] = self.materials.model_dump()
        return _toml(document, self.provenance, heading)

    def to_dict(self) -> dict[str, Any]:
        """Return the motor as JSON-ready SI values (the shape of ``piezomotor show --json``).

        An effect that is off, such as a coefficient of restitution of 1, is left out. A mode has its recoil also where
        it is 0, and ``None`` where it is not known.
        """
        document = self.model_dump()
        for section in ("piezo", "contact", "mount", "rotor", "slider", "load"):
            table: dict[str, Any] = document.get(section) or {}
            fields = SECTIONS[section].model_fields
            for name in list(table):
                effect = _COMPANIONS.get(name, name)
                if not fields[name].is_required() and getattr(getattr(self, section), effect) == fields[effect].default:
                    del table[name]
        document["modes"] = []
        for mode in self.modes:
            off = {
                name
                for name, field in Mode.model_fields.items()
                if not (field.is_required() or getattr(mode, name) or name.startswith("recoil"))
            } | ({*OF_GROUP_B} if len(self.groups) == 1 else set())
            ahead = {"name": mode.name, "frequency_hz": mode.frequency_hz}
            document["modes"].append(ahead | mode.model_dump(exclude=off))
        return document

    @checked
    def updated(self, changes: Mapping[str, Any]) -> Motor:
        """Return a motor with some values changed.

        Args:
            changes: dotted path → value, SI, as in :meth:`to_dict`. A mode is named or numbered from 0:
                ``modes.0.frequency_hz``. A new ``frequency_hz`` changes the stiffness at the same mass and damping; a
                new ``quality_factor`` changes the damping.
                ``mount`` is ``None`` for a stator held at a fixed distance, or a table of all its values. The constants
                of a contact that ``contact.materials`` specifies follow these and ``rotor.radius_m``, except those
                that have been given values of their own; so do those of ``contact.lining``, of which a table of all
                its values replaces others. ``load.*`` are those of a transducer.

        Raises:
            ParameterError: for a path that does not exist, an invalid value, or a value that follows from others.
        """
        document = self.model_dump()
        document["modes"] = [mode.model_dump() for mode in self.modes]
        if self.materials is not None:
            document["contact"][self.materials.TABLE] = self.materials.model_dump()
        where = f"motor {self.name}"
        provenance = dict(self.provenance)
        changed: set[str] = set()
        for given, value in changes.items():
            path = _set_path(document, str(given), value)
            if path in changed:
                raise ParameterError(f"{where}: {path} is changed twice; give one value.")
            changed.add(path)
            provenance[path] = Provenance("set", "by the user")
        for index, mode in enumerate(document["modes"]):
            for alias, constant in ALIASES.items():
                if alias in mode and f"modes.{index}.{constant}" in changed:
                    other = constant.partition("_")[0]
                    raise ParameterError(
                        f"{where}: modes.{index}.{alias} and the {other} are both changed; give one of them."
                    )
            document["modes"][index] = with_constants(mode, f"modes.{index}", where)
        for kind in SOURCES:
            if kind.TABLE in (document.get("contact") or {}):
                self._follow_materials(kind, document, changed, where)
        changed_modes = any(re.match(r"modes\.(?!\d+\.recoil_)", path) for path in changed)
        document["drive"] = self.drive
        document["left_out"] = self.left_out
        return assemble(
            document, None if changed_modes else self.structure or self.solid or self.ring, provenance, where=where
        )

    def _follow_materials(self, kind: type[Source], document: dict[str, Any], changed: set[str], where: str) -> None:
        """Put the constants that follow from changed materials, lining or radius of the rotor into a document."""
        place = f"contact.{kind.TABLE}"
        for name, source in kind.ONLY.items():
            if f"contact.{name}" in changed:
                raise ParameterError(
                    f"{where}: contact.{name} follows from [{place}]. Change {place}.{source}"
                    f"{' or rotor.radius_m' if name == 'effective_radius_m' and not self.slider else ''} instead."
                )
        document["materials"] = materials = build(kind, document["contact"].pop(kind.TABLE), place, where)
        radius = (
            inf if self.slider else limited(Rotor, "radius_m", document["rotor"]["radius_m"], "rotor.radius_m", where)
        )
        before: dict[str, float] = {}
        if isinstance(self.materials, kind):
            before = self.materials.constants(inf if self.slider else self.rotor.radius_m)
        for name, value in materials.constants(radius).items():
            own = getattr(self.contact, name)
            if f"contact.{name}" not in changed and own == before.get(name, own):
                document["contact"][name] = value


def _toml(document: Mapping[str, Any], provenance: Mapping[str, Provenance], heading: str) -> str:
    """Return a motor as TOML: every value as set, with its origin if known."""

    def entries(path: str, table: Mapping[str, Any]) -> list[str]:
        found = []
        for key, value in table.items():
            text, origin = _written(value), provenance.get(f"{path}.{key}")
            if origin is not None and origin.kind in KINDS:
                text = f"{{ value = {text}, {origin.kind} = {_written(origin.note)} }}"
            found += [] if value is None else [f"{key} = {text}"]
        return found

    lines = [*(f"# {line}".rstrip() for line in heading.splitlines()), "# USE: piezomotor simulate THIS.toml"]
    lines += ["", f"name = {_written(document['name'])}"]
    for index, mode in enumerate(document["modes"]):
        own = {key: value for key, value in mode.items() if "contacts" not in document or key not in ("tip_x", "tip_y")}
        lines += ["", "[[modes]]", *entries(f"modes.{index}", own)]
    for index, place in enumerate(document.get("contacts", ())):
        lines += ["", "[[contacts]]", *entries(f"contacts.{index}", place)]
    for section, table in document.items():
        if isinstance(table, Mapping):
            lines += ["", f"[{section}]", *entries(section, table)]
    return "\n".join(lines) + "\n"


def _written(value: object) -> str:
    """Return a number, a text or a table of them as TOML; a text has the syntax of JSON, except for DEL."""
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{_written(key)} = {_written(one)}' for key, one in value.items())} }}"
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _check_mode(mode: Mode) -> None:
    for what, value, low, high, unit in (
        ("natural frequency", mode.frequency_hz, LOWEST_FREQUENCY, HIGHEST_FREQUENCY, " Hz"),
        ("quality factor", mode.quality_factor, LOWEST_QUALITY, HIGHEST_QUALITY, ""),
    ):
        if not low <= value <= high:
            raise ValueError(
                f"mode {mode.name} has the {what} {value:.4g}{unit} by its mass, stiffness and damping; it must be "
                f"from {low:g} to {high:g}{unit}, so correct one of them"
            )


def assemble(
    parts: Mapping[str, Any], stator: Structure | Solid | Ring | None, provenance: dict[str, Provenance], *, where: str
) -> Motor:
    """Build a motor from plain tables, its modes sorted by frequency; ``where`` names their origin in messages."""
    if isinstance(stator, Ring) and (parts.get("rotor") or {}).get("radius_m") != stator.contact_radius_m:
        raise ParameterError(
            f"{where}: a [ring] turns a [rotor] whose radius_m is ring.contact_radius_m = {stator.contact_radius_m:g} "
            "m. Specify [contact] and that rotor."
        )
    parts = resolved(parts, where)
    modes = tuple(build(Mode, mode, f"modes.{index}", where) for index, mode in enumerate(parts["modes"]))
    order = sorted(range(len(modes)), key=lambda index: modes[index].frequency_hz)
    moved = {str(old): str(new) for new, old in enumerate(order)}
    try:
        return Motor(
            name=parts["name"],
            modes=tuple(modes[index] for index in order),
            **{
                section: build(kind, parts[section], section, where)
                for section, kind in SECTIONS.items()
                if parts.get(section) is not None
            },
            law=parts.get("law") or {},
            contacts=parts.get("contacts", ()),
            left_out=parts.get("left_out", ()),
            materials=parts.get("materials"),
            drive=parts.get("drive"),
            structure=stator if isinstance(stator, Structure) else None,
            solid=stator if isinstance(stator, Solid) else None,
            ring=stator if isinstance(stator, Ring) else None,
            provenance={
                "".join(moved.get(part, part) for part in re.split(r"(?<=^modes\.)(\d+)(?=\.)", path)): origin
                for path, origin in provenance.items()
            },
        )
    except ValidationError as error:
        raise refusal(error, Motor, "", where) from error


def with_constants(mode: Mapping[str, Any], path: str, where: str, damping: Damping | None = None) -> dict[str, Any]:
    """Return a mode with stiffness and damping in place of its frequency and quality factor, if it has these.

    A mode without damping has that of ``damping``.
    """
    found = dict(mode)

    def value(kind: type[Parameters], name: str) -> float:
        return limited(kind, name, found[name], f"{path}.{name}", where)

    if "frequency_hz" in found:
        omega = 2.0 * pi * value(Ringing, "frequency_hz")
        found["stiffness_n_per_m"] = value(Mode, "mass_kg") * omega**2
        del found["frequency_hz"]
    if "quality_factor" in found:
        root = sqrt(value(Mode, "stiffness_n_per_m") * value(Mode, "mass_kg"))
        found["damping_n_s_per_m"] = root / value(Ringing, "quality_factor")
        del found["quality_factor"]
    elif damping is not None and "damping_n_s_per_m" not in found:
        found["damping_n_s_per_m"] = damping.modal(value(Mode, "mass_kg"), value(Mode, "stiffness_n_per_m"))
    return found


def refuse_source(path: str) -> None:
    """Raise ParameterError for a value of the stator in a file, from which the modes are computed on loading."""
    if path.startswith(OF_FILES):
        raise ParameterError(
            f"{path} is a value from which the modes are computed when the file is read. Change it in the file or by "
            "--set, or change the modes themselves: paths such as modes.0.frequency_hz."
        )


def _places(document: dict[str, Any]) -> dict[str, tuple[str, ...]]:
    """Return the names of the values of a motor's document by the paths of their tables."""
    names = tuple(mode["name"] for mode in document["modes"])
    places = {f"modes.{index}": (*Mode.model_fields, *ALIASES) for index in range(len(names))}
    places |= {section: tuple(kind.model_fields) for section, kind in SECTIONS.items() if section in document}
    for index, entry in enumerate(document.get("contacts", ())):
        inside = {"contact": tuple(Contact.model_fields), "tip_x": names, "tip_y": names}
        places[f"contacts.{index}"] = tuple(ContactPlace.model_fields.keys() - inside.keys())
        for table, keys in inside.items():
            entry.setdefault(table, {})
            places[f"contacts.{index}.{table}"] = keys
    stated = document.get("contact") or {}
    return places | {f"contact.{kind.TABLE}": tuple(kind.model_fields) for kind in SOURCES if kind.TABLE in stated}


def _set_path(document: dict[str, Any], given: str, value: Any) -> str:
    """Put a value into a motor's document and return its path, with the number of the mode instead of its name."""
    section, _, rest = given.partition(".")
    which, _, last = rest.partition(".")
    names = [mode["name"] for mode in document["modes"]]
    lists = {"modes": names, "contacts": [place["name"] for place in document.get("contacts", ())]}
    path = given
    if which in lists.get(section, ()):
        path = f"{section}.{lists[section].index(which)}.{last}"
    if "contacts" in document and section == "modes" and last in ("tip_x", "tip_y"):
        raise ParameterError(f"{given} follows from contacts.0, the first of [[contacts]]. Change that.")
    if path in _OPTIONAL:
        document[path] = dict(value) if isinstance(value, Mapping) else value
        return path
    owners = {f"contacts.{index}.": place for index, place in enumerate(document.get("contacts", ()))} | {"": document}
    owner, of_law, key = path.rpartition("law.")
    if of_law and owner in owners and re.fullmatch(r"[a-z]\w*", key):
        stated = owners[owner].get("law", {})
        owners[owner]["law"] = {**({"name": stated} if isinstance(stated, str) else stated), key: value}
        return path
    if path == f"contact.{Lining.TABLE}" and isinstance(value, Mapping) and "contact" in document:
        document["contact"] = {k: v for k, v in document["contact"].items() if k != Materials.TABLE}
        document["contact"] |= {Lining.TABLE: dict(value), **dict.fromkeys(Materials.ONLY)}
        return path
    places = _places(document)
    known = ["name", *(f"{place}.{key}" for place, keys in places.items() for key in keys)]
    refuse_source(given)
    if path not in known:
        near = difflib.get_close_matches(path, known, n=1)
        close = near or [name for name in known if path in re.split(r"[._]", name)]
        paths = "Paths are those of `piezomotor show --json`, such as contact.preload_n."
        if section == "contacts" and lists[section] and path.rpartition(".")[0] not in places:
            close, paths = [], f"The contacts of {document['name']} are {', '.join(lists[section])}."
        raise ParameterError(
            f"There is no parameter {quoted(given)}. {f'Did you mean {close[0]!r}?' if close else paths}"
        )
    place, _, key = path.rpartition(".")
    table: Any = document
    for name in place.split(".") if place else ():
        if isinstance(table, dict) and table[name] is None:
            table[name] = {}
        table = table[int(name) if isinstance(table, list) else name]
    table[key] = value
    return path
