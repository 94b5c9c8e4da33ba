# SPDX-License-Identifier: GPL-3.0-or-later
"""One point of a sweep, as a worker runs it, and the content by which the store knows it."""

from __future__ import annotations

import hashlib
import inspect
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from importlib.metadata import version
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np

from pyspice_runner.circuit.law import Law, contact_library, is_own
from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.refusal import Stated, quoted
from pyspice_runner.result import leaves
from pyspice_runner.spice.library import data_path
from pyspice_runner.spice.ngspice import ngspice_version
from pyspice_runner.sweeps.store import fingerprint

Analysis = Callable[..., Any]


def law_document(name: object) -> dict[str, Any]:
    """Return the hash of a user's own contact law by its path, which may change while its name stays; others: {}."""
    return {"contact_sha256": _sha256(contact_library(Law(str(name))).subcircuit)} if is_own(name) else {}


def motor_document(motor: Motor) -> dict[str, Any]:
    """Return a motor with the structure or solid of its stator, on which stress and strain depend."""
    stator = [part and part.model_dump(mode="json") for part in (motor.structure, motor.solid, motor.ring)]
    own = [law_document(place.law["name"]) for place in motor.contacts if is_own(place.law.get("name"))]
    return {"motor": motor.to_dict(), "stator": stator, **({"own_laws": own} if own else {})}


@dataclass(frozen=True)
class Task:
    """One point: what to do, and with what. It is called by a worker."""

    analysis: Analysis
    motor: Motor
    drive: Stated
    run: dict[str, Any]
    functions: dict[str, Callable[[Any], float]]
    versions: dict[str, str]

    @cached_property
    def content(self) -> dict[str, Any]:
        """Everything on which the result depends. Timeout excluded."""
        settings = plain(self.run)
        beside = law_document(settings.get("contact"))
        return {
            "analysis": identity(self.analysis),
            "functions": {name: identity(function) for name, function in self.functions.items()},
            **motor_document(self.motor),
            "drive": drive_document(self.drive),
            "run": {name: value for name, value in settings.items() if name != "timeout"} | beside,
            "versions": self.versions,
        }

    @cached_property
    def address(self) -> str:
        """The hash of the content."""
        return fingerprint(self.content)

    def __call__(self) -> dict[str, Any]:
        """Run the point and return its answer."""
        here = versions_here()
        if here != self.versions:
            raise SimulationError(
                f"The worker has other versions ({_listed(here)}) than the sweep ({_listed(self.versions)}). "
                "Install the same on both sides."
            )
        try:
            result = self.analysis(self.motor, self.drive, **self.run)
        except SimulationError as error:
            if error.deck is None:
                raise
            shutil.rmtree(error.deck.parent, ignore_errors=True)  # a sweep may fail a thousand times
            reason = str(error).replace(f" The netlist is kept as {error.deck}.", "")
            raise SimulationError(reason, log=error.log) from None
        return self.answer(result)

    def answer(self, result: Any) -> dict[str, Any]:
        """Return the stored part of a result."""
        document = result if isinstance(result, Mapping) else result.to_dict()
        numbers = {name: float(value) for name, value in leaves(document) if isinstance(value, Real | np.bool_)}
        numbers |= {name: float(of(result)) for name, of in self.functions.items()}
        numbers.pop("solver_seconds", None)  # of the machine, not of the motor
        settings = document.get("run") or {}
        deck = document.get("deck_sha256") or settings.get("deck_sha256", "")
        cautions = getattr(result, "cautions", None) or document.get("cautions") or ()
        return {"numbers": numbers, "deck_sha256": str(deck), "cautions": list(cautions)}


def drive_document(drive: Stated) -> dict[str, Any]:
    """Return a drive as a JSON object, with the hash of a user's own file."""
    own = {"own_sha256": _sha256(drive.own_text)} if drive.own_text else {}
    return {"kind": type(drive).__name__, **drive.model_dump(), **own}


def plain(run: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings of a run with the law of the contact as text and number."""
    contact = run.get("contact")
    return {**run, **(contact.to_dict() if isinstance(contact, Law) else {})}


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


@cache
def identity(function: Callable[..., Any]) -> dict[str, str]:
    """Return by what a function is known: place and text. Raise ParameterError for what a worker cannot import."""
    try:
        text = inspect.getsource(function) if "<" not in function.__qualname__ else ""
    except (TypeError, AttributeError, OSError):  # no function, or one that stands in no file
        text = ""
    if not text:
        raise ParameterError(f"{quoted(function)} is not valid: workers need a function with a name in a module.")
    return {"function": f"{function.__module__}.{function.__qualname__}", "sha256": _sha256(text)}


def versions_here() -> dict[str, str]:
    """Return the versions of the package, of its code, and of ngspice."""
    return {
        "pyspice_runner_version": version("piezomotor"),
        "code_sha256": _code_sha256(),
        "ngspice_version": ngspice_version(),
    }


@cache
def _code_sha256() -> str:
    """Return a hash of the package's code and libraries, so that edited code never uses what older code stored."""
    package = Path(__file__).resolve().parents[1]
    sources = sorted([*package.rglob("*.py"), *data_path("behavioral").glob("*.lib")])
    return fingerprint({"/".join(path.parts[-2:]): path.read_text(encoding="utf-8") for path in sources})


def _listed(versions: Mapping[str, str]) -> str:
    return ", ".join(f"{name.removesuffix('_version')} {value[:12]}" for name, value in versions.items())
