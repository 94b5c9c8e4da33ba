# SPDX-License-Identifier: GPL-3.0-or-later
"""Datasets with the interface of a result.

``speed_torque``, ``steady_branch``, ``working_points`` and ``sweep`` return an :class:`xarray.Dataset` that also has
``save``, ``plot`` and ``cautions``. ``dataset.piezomotor`` is the dataset as a :class:`.Result`; for a dataset read
from a file, ``import pyspice_runner.datasets`` first.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray
from xarray.plot.accessor import DatasetPlotAccessor

from pyspice_runner.files import write_json, write_netcdf
from pyspice_runner.result import Audit, Result, contact_row, json_ready
from pyspice_runner.units import engineering

if TYPE_CHECKING:
    import pandas

SPEED = "speed_rad_s"
_NOT_QUANTITIES = ("failure", "deck_sha256")  # of a sweep
FLAGS = {"settled": "not settled", "accurate": "not accurate"}  # of a point of a sweep: name and meaning of a 0
_AS_JSON = ("motor", "drive", "run", "audit", "cautions", "best", "limits", "method", "folds")  # attributes


class Plot(DatasetPlotAccessor):
    """The plots of xarray, and as a function that of the result."""

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        """Draw the dataset; see :meth:`pyspice_runner.display.Shown.plot`."""
        return as_result(self._ds).plot(*arguments, **options)


class Dataset(xarray.Dataset):  # type: ignore[no-untyped-call]
    """A dataset of this package: xarray's, with ``save``, ``plot`` and ``cautions`` of a result."""

    __slots__ = ()

    @property
    def plot(self) -> Plot:  # type: ignore[override]
        """Draw the dataset: ``dataset.plot(path, ax, panel=NAME)``; see :meth:`pyspice_runner.display.Shown.plot`."""
        return Plot(self)

    @property
    def cautions(self) -> tuple[str, ...]:
        """Limits of the validity of the dataset, one sentence each."""
        return as_result(self).cautions

    def save(self, path: str | Path) -> Path:
        """Write the dataset as ``.nc``, ``.csv`` or ``.json``; see :meth:`pyspice_runner.result.Result.save`."""
        return as_result(self).save(path)


class DatasetResult(Result):
    """A dataset with the interface of a result.

    Attributes:
        dataset: the dataset.
    """

    def __init__(self, dataset: xarray.Dataset) -> None:
        self.dataset = dataset

    @property
    def linear(self) -> bool:
        """Whether the motor has a slider."""
        return "slider" in self._attribute("motor", {})

    def writers(self) -> dict[str, Callable[[Path], object]]:
        """Return the writers by ending: ``.nc``, ``.csv`` (one row for each point) and ``.json``."""
        return {
            ".nc": lambda file: write_netcdf(file, self.dataset),
            ".csv": lambda file: self.dataset.to_dataframe().to_csv(file),
            ".json": lambda file: write_json(file, self.to_dict()),
        }

    def to_xarray(self) -> xarray.Dataset:
        """Return the dataset itself."""
        return self.dataset

    def to_dataframe(self) -> pandas.DataFrame:
        """Return a pandas table with one row for each point."""
        return self.dataset.to_dataframe()

    @property
    def axes(self) -> list[str]:
        """Names of the axes."""
        return [str(name) for name in self.dataset.sizes]

    def to_dict(self) -> dict[str, Any]:
        """Return axes, quantities and provenance, JSON-ready; ``None`` for an undefined value."""
        data = self.dataset
        return {
            "dimensions": {name: data.sizes[name] for name in self.axes},
            **{str(name): values.values.tolist() for name, values in data.coords.items()},
            **{str(name): json_ready(values.values) for name, values in data.data_vars.items()},
            **self._attributes(),
        }

    def _attribute(self, name: str, default: Any = None) -> Any:
        """Return an attribute of the dataset that holds JSON."""
        return json.loads(self.dataset.attrs[name]) if name in self.dataset.attrs else default

    def _attributes(self) -> dict[str, Any]:
        """Return the attributes of the dataset, those that hold JSON decoded, with all cautions."""
        attributes = {str(name): value for name, value in self.dataset.attrs.items()}
        decoded = {name: self._attribute(name) if name in _AS_JSON else value for name, value in attributes.items()}
        return {**decoded, "cautions": list(self.cautions)}

    def _heading(self, kind: str) -> dict[str, str]:
        """Return the first rows of a summary: the title and the law of the contact."""
        return {kind: str(self.dataset.attrs.get("title", "")), **contact_row(self._attribute("run", {}))}

    def _span(self, name: str, digits: int = 6) -> str:
        """Return the range of an axis in words."""
        values, unit = self.dataset[name].values, self.dataset[name].attrs.get("units", "")
        span = f"{values.min():.{digits}g} to {values.max():.{digits}g}"
        return f"{span} {unit}" if unit else span


class Curves(DatasetResult):
    """The result of ``speed_torque``: torque and powers over the speed, and over further axes."""

    @property
    def audit(self) -> Audit:  # type: ignore[override]
        """The outcome of the physical audit of all points."""
        return Audit(tuple(self._attribute("audit", {"findings": ()})["findings"]))

    @property
    def others(self) -> list[str]:
        """Names of the axes beside the speed."""
        return [str(name) for name in self.dataset["torque_n_m"].dims if name != SPEED]

    @property
    def unsettled(self) -> int:
        """Number of finished points that did not settle."""
        return int((~self.dataset["settled"] & self.dataset["torque_n_m"].notnull()).sum())

    def _limits(self) -> Iterator[str]:
        """Yield the numbers of unsettled and of missing points, and the cautions of the motor."""
        if self.unsettled:
            yield (
                f"{self.unsettled} of {self.dataset['settled'].size} points did not settle. Their values are "
                "means over an irregular motion."
            )
        if "incomplete" in self.dataset.attrs:
            yield self.dataset.attrs["incomplete"]
        yield from self._attribute("cautions", [])

    def summary(self) -> dict[str, str]:
        """Return the range of the axes, the maximum torque, speed and efficiency, and how many points settled."""
        data = self.dataset
        found = self._heading("curve")
        for name in (*self.others, "speed_m_s" if self.linear else SPEED):
            found[name] = f"{self._span(name, 4)}, {data[name].size} values"
        if bool(data["torque_n_m"].notnull().any()):
            found["maximum torque"] = engineering(float(data["torque_n_m"].max()), "N·m")
            found["maximum shaft power"] = engineering(float(data["shaft_power_w"].max()), "W")
            found["best efficiency"] = _percent(float(data["efficiency"].where(data["shaft_power_w"] > 0.0).max()))
        counted = {"settled": data["settled"]}
        if "largest_multiplier" in data:
            counted["time averages"] = data["largest_multiplier"] >= 1.0
        for words, points in counted.items():
            found[words] = f"{int(points.sum())} of {points.size} points"
        return self._localised(found)


class Branch(DatasetResult):
    """The result of ``steady_branch``: steady states along a branch, stable or not."""

    @property
    def along(self) -> str:
        """Name of the parameter that is followed."""
        return str(self.dataset.attrs["follow"])

    @property
    def folds(self) -> list[float]:
        """Values of the parameter at which the branch turns back."""
        return [float(value) for value in self._attribute("folds")]

    def _limits(self) -> Iterator[str]:
        """Yield the reason why the branch ended before its last value."""
        if (ended := str(self.dataset.attrs["ended"])) != "It reaches stop.":
            yield f"The branch does not reach its end: {ended}"

    def to_dict(self) -> dict[str, Any]:
        """Return the points in their order, folds and provenance, JSON-ready; ``None`` for an undefined value."""
        document = super().to_dict()
        return {"points": document.pop("dimensions")["point"], **document}

    def summary(self) -> dict[str, str]:
        """Return the range of the parameter, the folds, and the share of stable points."""
        values, unit = self.dataset[self.along].values, self.dataset[self.along].attrs["units"]
        return {
            **self._heading("branch"),
            self.along: f"{self._span(self.along)}, {values.size} points",
            "folds": ", ".join(f"{value:.6g} {unit}" for value in self.folds) or "none",
            "stable": f"{int(self.dataset['stable'].sum())} of {values.size} points",
            "end": str(self.dataset.attrs["ended"]),
        }


class WorkingPoints(DatasetResult):
    """The result of ``working_points``: steady states over parameters, and the best of them."""

    @property
    def best(self) -> dict[str, Any] | None:
        """Coordinates and quantities of the best point; ``None`` where no point is within the limits."""
        found: dict[str, Any] | None = self._attribute("best")
        return found

    @property
    def limits(self) -> dict[str, float]:
        """Largest absolute value allowed, by the name of the quantity."""
        found: dict[str, float] = self._attribute("limits")
        return found

    def _limits(self) -> Iterator[str]:
        """Yield the numbers of points without a stable steady state; whether no point is within the limits."""
        data, total = self.dataset, self.dataset["stable"].size
        if "incomplete" in data.attrs:
            yield data.attrs["incomplete"]
        if lost := int((~data["converged"]).sum()) - self._attribute("method", []).count(""):
            yield f"{lost} of {total} points have no steady state."
        if unstable := int((data["converged"] & ~data["stable"]).sum()):
            yield f"{unstable} of {total} points have an unstable periodic motion: their values are time averages."
        if not self.best:
            yield (
                "No point is stable and within the limits given and those of the motor. A given limit replaces the one "
                "of the motor with the same name: tensile_stress_pa=2e9."
            )
        yield from self._attribute("cautions", [])

    def summary(self) -> dict[str, str]:
        """Return the axes and the best point."""
        data = self.dataset
        found = self._heading("map")
        for name in self.axes:
            found[name] = f"{self._span(name)}, {data[name].size} values"
        found["stable"] = f"{int(data['stable'].sum())} of {data['stable'].size} points"
        best = self.best
        if best is None:
            return self._localised(found | {"best point": "none within the limits"})
        for name in self.axes:
            found[f"best {name}"] = f"{best[name]:.6g} {data[name].attrs['units']}"
        for words, name in (("torque", "torque_n_m"), ("speed", "speed_rad_s"), ("shaft power", "shaft_power_w"),
                            ("current", "current_a"), ("stress of the ceramic", "ceramic_stress_pa"),
                            ("temperature", "temperature_c")):  # fmt: skip
            if best.get(name) is not None:
                found[words] = engineering(best[name], data[name].attrs["units"] if name in data else "")
        efficiency = best["efficiency"]
        return self._localised(found | {"efficiency": "–" if efficiency is None else _percent(efficiency)})


class Sweep(DatasetResult):
    """The result of ``sweep``: quantities over axes and samples."""

    @property
    def quantities(self) -> list[str]:
        """Names of the quantities."""
        return [str(name) for name in self.dataset.data_vars if name not in _NOT_QUANTITIES]

    @cached_property
    def failures(self) -> list[dict[str, Any]]:
        """The points that failed: where each is, and the reason."""
        if "failure" not in self.dataset:
            return []
        failure = self.dataset["failure"]
        points = [failure[tuple(index)] for index in np.argwhere(failure.values != "")]
        return [
            {"at": {str(name): value.item() for name, value in point.coords.items()}, "reason": point.item()}
            for point in points
        ]

    @property
    def flagged(self) -> dict[str, xarray.DataArray]:
        """The finished points whose means are not settled or not accurate, by those words."""
        found = {words: self.dataset[name] == 0 for name, words in FLAGS.items() if name in self.dataset}
        return {words: points for words, points in found.items() if bool(points.any())}

    def _limits(self) -> Iterator[str]:
        """Yield the numbers of the points that are not settled, not accurate, or failed."""
        names, total = {words: name for name, words in FLAGS.items()}, int(np.prod(list(self.dataset.sizes.values())))
        for words, points in self.flagged.items():
            count = int(points.sum())
            yield f"{count} of {total} points {'is' if count == 1 else 'are'} {words}; see '{names[words]}'."
        if self.failures:
            yield f"{len(self.failures)} of {total} points failed; the first: {self.failures[0]['reason']}"
        yield from self._attribute("cautions", [])

    def to_dict(self) -> dict[str, Any]:
        """Return axes, quantities, failures and provenance, JSON-ready; ``None`` where a point failed."""
        data = self.dataset
        return {
            "points": int(np.prod(list(data.sizes.values()))),
            "dimensions": {str(name): size for name, size in data.sizes.items()},
            "coordinates": {str(name): values.values.tolist() for name, values in data.coords.items()},
            "quantities": {name: json_ready(data[name].values) for name in self.quantities},
            "failures": self.failures,
            "provenance": self._attributes(),
        }

    def summary(self) -> dict[str, str]:
        """Return the axes, and the lowest and highest value of each quantity."""
        data = self.dataset
        found = {"sweep": str(data.attrs.get("title", ""))}
        found |= {str(name): f"{size} values" for name, size in data.sizes.items()}
        for name in self.quantities:
            values = data[name].values[np.isfinite(data[name].values)]
            unit = data[name].attrs["units"]
            if values.size:
                ends = (float(values.min()), float(values.max()))
                found[name] = " to ".join(engineering(value, "" if unit == "1" else unit) for value in ends)
        return found


def as_result(dataset: xarray.Dataset) -> DatasetResult:
    """Return a dataset of ``speed_torque``, ``steady_branch``, ``working_points`` or ``sweep`` as a result."""
    if "folds" in dataset.attrs:
        return Branch(dataset)
    if "objective" in dataset.attrs:
        return WorkingPoints(dataset)
    return Curves(dataset) if {SPEED, "torque_n_m", "settled"} <= set(dataset.variables) else Sweep(dataset)


xarray.register_dataset_accessor("piezomotor")(as_result)  # type: ignore[no-untyped-call]


def _percent(share: float) -> str:
    return f"{100.0 * share:.3g} %" if np.isfinite(share) else "–"
