# SPDX-License-Identifier: GPL-3.0-or-later
"""The base class of the results: files, tables and the audit; plots are in :mod:`pyspice_runner.display`."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, is_dataclass
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.display import Shown
from pyspice_runner.errors import SimulationError, did_you_mean
from pyspice_runner.files import save_by_ending, write_csv, write_json, write_netcdf
from pyspice_runner.units import linear_words, unit_in, with_linear

if TYPE_CHECKING:
    import pandas
    import xarray

_NUMBER = re.compile(r"(?<!\w)([+-]?\d+\.?\d*(?:e[+-]?\d+)?)(\s[fpnµmkMG](?=(?:Pa|Hz|rad|[smNWVA])\b))?")
_PREFIX = dict(zip("fpnµmkMG", (1e-15, 1e-12, 1e-9, 1e-6, 1e-3, 1e3, 1e6, 1e9), strict=True))


@dataclass(frozen=True)
class Audit:
    """The outcome of the physical audit of a result (:mod:`pyspice_runner.run.audit`)."""

    findings: tuple[str, ...] = ()  # physical impossibilities in the result, one sentence each
    done: bool = True  # whether there was enough data for an audit

    @property
    def passed(self) -> bool | None:
        """Whether nothing was found; ``None`` without an audit."""
        return not self.findings if self.done else None

    def to_dict(self) -> dict[str, Any]:
        """Return the outcome, JSON-ready."""
        return {"passed": self.passed, "findings": list(self.findings)}

    def withhold(self, what: str) -> None:
        """Raise the findings as an error; the message names the kind of the result.

        Raises:
            SimulationError: if anything was found.
        """
        if self.findings:
            raise SimulationError(
                f"{' '.join(self.findings)} The {what} is not returned. With audit = False it is, and carries this "
                "finding."
            )


def json_ready(value: Any) -> Any:
    """Return a value as JSON has it: arrays as lists, complex numbers as pairs, ``None`` for what is not finite."""
    if hasattr(value, "to_dict"):
        return value.to_dict()
    if is_dataclass(value) and not isinstance(value, type):
        value = asdict(value)
    if isinstance(value, Mapping):
        return {name: json_ready(item) for name, item in value.items()}
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, complex):
        value = value.real, value.imag
    if isinstance(value, list | tuple):
        return [json_ready(item) for item in value]
    return None if isinstance(value, float) and not isfinite(value) else value


def leaves(document: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield dotted path and value of every leaf of tables and lists."""
    items = document.items() if isinstance(document, Mapping) else enumerate(document)
    for key, value in items:
        if isinstance(value, Mapping | list | tuple):
            yield from leaves(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def wording(sentence: str) -> str:
    """Return a sentence without the values of its numbers, which is the same for each occurrence of a fault."""
    return _NUMBER.sub(lambda found: "#" + (found[2] or "")[:1], sentence)


def grouped(points: Sequence[Iterable[str]], names: Sequence[str] = ()) -> list[str]:
    """Return the cautions of several points once each, with the number of points and the worst of their values.

    The worst value is the largest, or the shortest time after which something happens. With the names of the points,
    those that have a caution stand before it instead of their number.
    """
    kinds: dict[str, dict[str, list[float]]] = {}
    counts: dict[str, list[int]] = {}
    for number, point in enumerate(points):
        for sentence in dict.fromkeys(point):
            values = [float(number) * _PREFIX.get(prefix.strip(), 1.0) for number, prefix in _NUMBER.findall(sentence)]
            kinds.setdefault(wording(sentence), {})[sentence] = values
            counts.setdefault(wording(sentence), []).append(number)
    found = []
    for kind, several in kinds.items():
        worst = (min if "after #" in kind else max)(several, key=lambda sentence: several[sentence])
        having = counts[kind]
        place = ", ".join(names[number] for number in having if names) or f"{len(having)} of {len(points)} points"
        found.append(worst if len(having) == len(points) else f"{place}: {worst}")
    return found


def contact_row(run: Mapping[str, Any]) -> dict[str, str]:
    """Return the row of a summary that names the law of the contact, by the settings of a run; none of a free tip."""
    if run.get("contact") is None:
        return {}
    sliders = run.get("sliders")
    own = (f", {name}: {law['contact']}" for name, law in run.get("contacts", {}).items())
    return {"contact law": f"{run['contact']}{f', {sliders} sliders' if sliders else ''}{''.join(own)}"}


class Result(Shown):
    """Base of the results.

    A subclass defines ``to_dict`` and ``summary``. With ``columns`` it can be written as ``.csv`` and ``.nc`` and read
    as a table; with an attribute ``deck`` it can be written as ``.cir``. Its plot is in
    :mod:`pyspice_runner.view.plots`.
    """

    deck: str | None = None
    audit: Audit = Audit()
    units: ClassVar[Mapping[str, tuple[str, str]]] = {}  # column → unit and meaning, where the name does not say them

    if not TYPE_CHECKING:  # type checkers report a misspelt name

        def __getattr__(self, name: str) -> Any:
            known = getattr(type(self), name, None)
            if isinstance(known, property):  # it raised an AttributeError: raise that again
                return known.fget(self)
            public = [] if name.startswith("_") else [other for other in dir(self) if not other.startswith("_")]
            hint = f" {did_you_mean(name, public)}" if public else ""
            raise AttributeError(f"{type(self).__name__} has no attribute {name!r}.{hint}")

    @property
    def linear(self) -> bool:
        """Whether the motor has a slider: its speeds are m/s, and its torques are forces in N."""
        return "slider" in getattr(self, "provenance", {}).get("motor", {})

    def to_dict(self) -> dict[str, Any]:
        """Return the result without its curves, JSON-ready, SI units."""
        raise NotImplementedError

    def _entries(self, *names: str) -> dict[str, Any]:
        """Return attributes by their names, for ``to_dict``."""
        return {name: json_ready(getattr(self, name)) for name in names}

    def _localised(self, found: Mapping[str, Any]) -> dict[str, Any]:
        """Return a document, columns or a summary as they are of a slider, if the motor has one.

        A summary, which has texts only, is in its words and units; the others have ``force_n``, ``speed_m_s``, … beside
        the rotary keys.
        """
        if not self.linear:
            return dict(found)
        if all(isinstance(value, str) for value in found.values()):
            return {linear_words(name): linear_words(text) for name, text in found.items()}
        return with_linear(found)

    def columns(self) -> Mapping[str, NDArray[np.float64]]:
        """Return the curves by name, all of one length; the first is the axis of the others."""
        return {}

    @property
    def cautions(self) -> tuple[str, ...]:
        """Limits of the validity of the result, one sentence each, those by the audit first."""
        found = dict.fromkeys((*self.audit.findings, *self._limits()))
        return tuple(map(linear_words, found) if self.linear else found)

    def _limits(self) -> Iterable[str]:
        """Return the limits of the validity beside the findings of the audit."""
        return ()

    # --- files and tables ---

    def writers(self) -> dict[str, Callable[[Path], object]]:
        """Return the endings that :meth:`save` accepts, each with the function that writes such a file."""
        found: dict[str, Callable[[Path], object]] = {".json": lambda file: write_json(file, self.to_dict())}
        if self.columns():
            found[".csv"] = lambda file: write_csv(file, self.columns())
            found[".nc"] = lambda file: write_netcdf(file, self.to_xarray())
        if self.deck is not None:
            found[".cir"] = lambda file: file.write_text(self.deck or "", encoding="utf-8")
        return found

    def save(self, path: str | Path) -> Path:
        """Write the result in the format of the file's ending, and return the path.

        ``.json`` contains :meth:`to_dict`, ``.csv`` and ``.nc`` (NetCDF) :meth:`columns`, and ``.cir`` the deck, as far
        as the result has them. Some results have further endings.

        Raises:
            ParameterError: for another ending, or a place that cannot be written.
        """
        return save_by_ending(path, self.writers())

    def to_dataframe(self) -> pandas.DataFrame:
        """Return :meth:`columns` as a pandas table, the first as its index."""
        import pandas

        columns = dict(self.columns())
        return pandas.DataFrame(columns).set_index(next(iter(columns), None))

    def to_xarray(self) -> xarray.Dataset:
        """Return :meth:`columns` as a dataset over the first of them, with units; :meth:`to_dict` is an attribute."""
        import xarray

        columns = dict(self.columns())
        along = next(iter(columns))
        variables = {}
        for name, values in columns.items():
            unit, meaning = self.units.get(name, (unit_in(name), ""))
            variables[name] = (along, values, {"units": unit, **({"long_name": meaning} if meaning else {})})
        coordinate = variables.pop(along)
        return xarray.Dataset(variables, {along: coordinate}, {"summary": json.dumps(self.to_dict())})
