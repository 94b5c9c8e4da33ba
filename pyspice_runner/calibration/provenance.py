# SPDX-License-Identifier: GPL-3.0-or-later
"""The origin of each value of a motor that was made of measurements: which are measured, which are a class average.

Of the values that no measurement shows it is known how far the motors of a class differ, :data:`WIDTHS`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import exp, hypot, inf, log, sqrt
from typing import Any

from pyspice_runner.impedance.two_port_fit import TwoPortFit
from pyspice_runner.motor import groups
from pyspice_runner.motor.groups import GROUPS
from pyspice_runner.motor.motor import Motor, Provenance

FRICTION, QUALITY, CAPACITANCE, NORMAL = "contact.friction", "quality factor", "capacitance", "normal motion"
STIFFNESS_ERROR = 0.2  # relative, of the contact of the base motor of spectra
_IMPROVED = 0.9  # of the prior width, below which the measurements count as having added something

# Standard deviation of the logarithm of a value within a class, after scaling. Friction: handbooks give 0.2 to
# 0.5 for dry ceramics, taken as four standard deviations. The others: over andersen2002-unintended-mode, a beam with
# two modes at 40 kHz and bimodal40 as linear stages, at their drives and in the modes within 15 % of these; of a group
# the maximum. Three motors do not make a statistic: the widths are orders of magnitude.
WIDTHS = {
    "friction": 0.23, "preload_n": 0.3, "damping_n_s_per_m": 1.1, "mass_kg": 2.0, "stiffness_n_per_m": 2.0,
    "coupling_a_n_per_v": 1.1, "coupling_b_n_per_v": 1.1, "capacitance_a_f": 1.6, "capacitance_b_f": 1.6,
    "loss_tangent": 0.4, "normal_stiffness_n_per_m15": 1.6, "tangential_compliance_tip_m_per_n23": 1.3,
    "tangential_compliance_rotor_m_per_n23": 1.3, "restitution": 0.1, "inertia_kg_m2": 1.3,
    "bearing_damping_n_m_s": 0.9, "guide_damping_n_s_per_m": 0.9,
    "slider.mass_kg": 1.3,
}  # fmt: skip
_MOUNT = 1.7  # of each of its values
_TOWARDS = 0.5  # of the motion towards the rotor over that along it: the ellipse of the tip is a choice of the design
PRIORS = {
    FRICTION: WIDTHS["friction"], QUALITY: WIDTHS["damping_n_s_per_m"], CAPACITANCE: WIDTHS["capacitance_a_f"],
    NORMAL: _TOWARDS,
}  # fmt: skip


def width(path: str) -> float | None:
    """Return the standard deviation of the logarithm of a value within the class; ``None`` where it is not known."""
    if path.startswith("mount."):
        return _MOUNT
    return WIDTHS.get(path, WIDTHS.get(path.rpartition(".")[2]))


def spread(logarithmic: float) -> str:
    """Return a standard deviation of a logarithm in words: in per cent, a large one as a factor, up to 1e6."""
    if logarithmic < 0.35:
        return f"± {100.0 * logarithmic:.2g} %"
    return f"×/÷ {exp(logarithmic):.2g}" if logarithmic < log(1e6) else "not determined"


@dataclass(frozen=True)
class Origin:
    """Where a value of the motor comes from.

    Attributes:
        kind: ``spectrum``, ``data sheet``, ``stated`` (by the user), ``derived`` (fitted to numbers of the sheet), or
            ``class average``.
        width: relative standard error, or of a class average the standard deviation of the logarithm within the class;
            ``None`` where it is not known.
    """

    kind: str
    width: float | None = None

    def __str__(self) -> str:
        return self.kind if self.width is None else f"{self.kind}, {spread(self.width)}"


_Annotated = tuple[Motor, dict[str, float], dict[str, Origin]]  # standard error in its unit and origin by path


def words_of(measured: Sequence[str]) -> str:
    """Return names of measurements without their units, in words."""
    return "the " + ", ".join(key.rpartition("_")[0].replace("_", " ") for key in measured)


def value_of(document: Any, path: str) -> float | None:
    """Return a value of a motor's document by its path; ``None`` for one that is not known."""
    for key in path.split("."):
        document = document[int(key)] if isinstance(document, list | tuple) else document.get(key)
    return None if document is None else float(document)


def of_spectra(motor: Motor, fit: TwoPortFit, relative: Mapping[str, float], targets: Sequence[str]) -> _Annotated:
    """Return a motor with the stator of its spectra with provenance, errors and origins of its values.

    ``relative`` has the relative standard errors of the values that were fitted to the measurements ``targets``.
    """
    document, provenance = motor.model_dump(), dict(motor.provenance)
    errors = _errors_of_modes(motor, fit, relative.get("mass_kg", 0.0))
    errors |= {f"piezo.{key}": error for key, error in fit.standard_errors.items() if getattr(fit, key)}
    note = f"fitted to {words_of(targets)} by steady_state"
    for path, deviation in relative.items():
        if path == "mass_kg":
            continue
        errors[path] = deviation * (value_of(document, path) or 0.0)
        if deviation < _IMPROVED * STIFFNESS_ERROR:  # the measurements improve on the base motor
            provenance[path] = Provenance("derived", note)
    for path, error in errors.items():
        if path.endswith("mass_kg"):
            provenance[path] = Provenance("derived", f"{note}, one factor for all modes")
        origin = provenance[path]
        provenance[path] = Provenance(origin.kind, f"{origin.note}; standard error {error:.2g}")
    origins = {}
    for path, own in provenance.items():
        value = abs(value_of(document, path) or 0.0)
        share = errors[path] / value if path in errors and value else None
        if own.kind == "assumed":
            origins[path] = Origin("class average", share or width(path))
        elif path.startswith("contact.") or path.endswith("mass_kg"):  # of the data sheet
            origins[path] = Origin("derived" if share else "stated", share)
        else:
            origins[path] = Origin("spectrum" if own.kind == "derived" else "stated", share)
    return motor.model_copy(update={"provenance": provenance}), errors, origins


def _errors_of_modes(motor: Motor, fit: TwoPortFit, mass_error: float) -> dict[str, float]:
    """Return the standard errors of the modes: path → error. The stiffness has that of the mass and the resonance."""
    errors: dict[str, float] = {}
    for index, (mode, found) in enumerate(zip(motor.modes, fit.modes, strict=True)):
        quality = found.standard_errors["quality_factor"] / found.quality_factor
        place = found.standard_errors["series_resonance_hz"] / found.series_resonance_hz
        shares = {
            "mass_kg": mass_error,
            "stiffness_n_per_m": hypot(mass_error, 2.0 * place),
            "damping_n_s_per_m": hypot(mass_error, quality, place),
        }
        errors |= {f"modes.{index}.{key}": share * getattr(mode, key) for key, share in shares.items() if share}
        for group, coupling in zip(GROUPS, mode.couplings, strict=True):
            name = groups.column("coupling", group, "n_per_v")
            own = found.standard_errors[f"{name}_kg05"] * sqrt(mode.mass_kg)
            errors[f"modes.{index}.{name}"] = hypot(own, 0.5 * mass_error * coupling)
    return errors


def of_class(motor: Motor, base: Motor, relative: Mapping[str, float], measured: Sequence[str]) -> _Annotated:
    """Return a motor of the class of ``base`` with provenance, errors and origins of its values.

    ``relative`` has the relative standard errors of the fitted values, ``measured`` the names of the numbers of the
    data sheet.
    """
    factors = {
        "contact.friction": FRICTION, "modes.damping_n_s_per_m": QUALITY, "modes.tip_y": NORMAL,
        **{groups.column("piezo.capacitance", group, "f"): CAPACITANCE for group in ("a", "b", "ab")},
    }  # fmt: skip
    document = motor.model_dump()
    tables = {f"modes.{number}": mode for number, mode in enumerate(document["modes"])}
    tables |= {section: document[section] or {} for section in ("piezo", "contact", motor.moved, "mount")}
    origins, errors, provenance = dict[str, Origin](), dict[str, float](), dict[str, Provenance]()
    words = words_of(measured)
    values = {
        f"{table}.{key}": value for table, every in tables.items() for key, value in every.items() if key != "name"
    }
    for path, value in values.items():
        if not value:  # an effect that is off
            continue
        factor = factors.get(".".join(part for part in path.split(".") if not part.isdigit()), "")
        share = relative.get(factor, inf)
        if share < _IMPROVED * PRIORS.get(factor, 0.0):
            errors[path] = share * abs(value)
            origins[path] = Origin("derived", share)
            provenance[path] = Provenance("derived", f"fitted to {words}; standard error {errors[path]:.2g}")
        else:
            spreading = width(path)
            origins[path] = Origin("class average", spreading)
            note = f"class average: that of {base.name}, scaled to {words}"
            provenance[path] = Provenance("assumed", note + (f"; {spread(spreading)}" if spreading else ""))
    return motor.model_copy(update={"provenance": provenance}), errors, origins
