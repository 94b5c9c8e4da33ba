# SPDX-License-Identifier: GPL-3.0-or-later
"""The origin of each value of a motor that was made of measurements: which are measured, which are a class average."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import hypot, inf, sqrt
from typing import Any

from pyspice_runner.calibration import motor_class
from pyspice_runner.impedance.two_port_fit import TwoPortFit
from pyspice_runner.motor import groups
from pyspice_runner.motor.groups import GROUPS
from pyspice_runner.motor.motor import Motor, Provenance

_IMPROVED = 0.9  # of the prior width, below which the measurements count as having added something


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
        return self.kind if self.width is None else f"{self.kind}, {motor_class.spread(self.width)}"


@dataclass(frozen=True)
class Annotated:
    """A motor with provenance, the standard error of each value in its unit, and the origin of each value."""

    motor: Motor
    errors: dict[str, float]
    origins: dict[str, Origin]


def words_of(measured: Sequence[str]) -> str:
    """Return names of measurements without their units, in words."""
    return "the " + ", ".join(key.rpartition("_")[0].replace("_", " ") for key in measured)


def value_of(document: Any, path: str) -> float | None:
    """Return a value of a motor's document by its path; ``None`` for one that is not known."""
    for key in path.split("."):
        document = document[int(key)] if isinstance(document, list | tuple) else document.get(key)
    return None if document is None else float(document)


def of_spectra(
    motor: Motor, fit: TwoPortFit, relative: Mapping[str, float], targets: Sequence[str], known: float
) -> Annotated:
    """Return a motor with the stator of its spectra.

    Args:
        motor: the motor.
        fit: of the spectra.
        relative: fitted value → its relative standard error.
        targets: names of the measurements to which they were fitted.
        known: prior relative standard deviation of the contact's stiffnesses.
    """
    contact = {path: share for path, share in relative.items() if path != "mass_kg"}
    document = motor.model_dump()
    errors = _errors_of_modes(motor, fit, relative.get("mass_kg", 0.0))
    errors |= {f"piezo.{key}": error for key, error in fit.standard_errors.items()}
    errors |= {path: share * (value_of(document, path) or 0.0) for path, share in contact.items()}
    provenance = dict(motor.provenance)
    note = f"fitted to {words_of(targets)} by steady_state"
    # where the measurements improve on the base motor
    provenance |= {path: Provenance("derived", note) for path, share in contact.items() if share < _IMPROVED * known}
    for path, error in errors.items():
        if path.endswith("mass_kg"):
            provenance[path] = Provenance("derived", f"{note}, one for all modes")
        origin = provenance.get(path, Provenance("derived", f"fitted to {fit.source}"))
        provenance[path] = Provenance(origin.kind, f"{origin.note}; standard error {error:.2g}")
    origins = {}
    for path, own in provenance.items():
        if path.startswith("drive."):
            continue
        value = abs(value_of(document, path) or 0.0)
        width = errors[path] / value if path in errors and value else None
        of_sheet = path.startswith("contact.") or path.endswith("mass_kg")
        if own.kind == "assumed":
            origins[path] = Origin("class average", width or motor_class.width(path))
        elif of_sheet:
            origins[path] = Origin("derived" if width else "stated", width)
        else:
            origins[path] = Origin("spectrum" if own.kind == "derived" else "stated", width)
    return Annotated(motor.model_copy(update={"provenance": provenance}), errors, origins)


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


def of_class(motor: Motor, base: Motor, relative: Mapping[str, float], measured: Sequence[str]) -> Annotated:
    """Return a motor of a class.

    Args:
        motor: the motor.
        base: that represents the class.
        relative: fitted value → its relative standard error.
        measured: names of the numbers of the data sheet.
    """
    factors = {
        "contact.friction": motor_class.FRICTION,
        **{f"modes.{number}.damping_n_s_per_m": motor_class.QUALITY for number in range(len(motor.modes))},
        **{f"modes.{number}.tip_y": motor_class.NORMAL for number in range(len(motor.modes))},
        **{groups.column("piezo.capacitance", group, "f"): motor_class.CAPACITANCE for group in ("a", "b", "ab")},
    }
    document = motor.model_dump()
    paths = [f"modes.{number}.{key}" for number, mode in enumerate(document["modes"]) for key in mode if key != "name"]
    paths += [f"{section}.{key}" for section in ("piezo", "contact", motor.moved, "mount")
              for key in document[section] or {}]  # fmt: skip
    origins, errors, provenance = dict[str, Origin](), dict[str, float](), dict[str, Provenance]()
    words = words_of(measured)
    for path in paths:
        value, factor = value_of(document, path), factors.get(path, "")
        if not value:  # an effect that is off
            continue
        share = relative.get(factor, inf)
        if share < _IMPROVED * motor_class.PRIORS.get(factor, 0.0):
            errors[path] = share * abs(value)
            origins[path] = Origin("derived", share)
            provenance[path] = Provenance("derived", f"fitted to {words}; standard error {errors[path]:.2g}")
        else:
            width = motor_class.width(path)
            origins[path] = Origin("class average", width)
            note = f"class average: that of {base.name}, scaled to {words}"
            provenance[path] = Provenance("assumed", note + (f"; {motor_class.spread(width)}" if width else ""))
    return Annotated(motor.model_copy(update={"provenance": provenance}), errors, origins)
