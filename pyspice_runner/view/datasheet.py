# SPDX-License-Identifier: GPL-3.0-or-later
"""The data sheet of a motor as one HTML page, without network access and without other files.

Text and tables are plain HTML; Plotly stands at the end of the page and runs after the first paint.
"""

from __future__ import annotations

import base64
import csv
import io
import json
import platform
import tempfile
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pyspice_runner.errors import ParameterError
from pyspice_runner.export.motor import export_motor
from pyspice_runner.model.motor import Motor, Provenance
from pyspice_runner.model.refusal import unit_of
from pyspice_runner.run.waveforms import Waveforms
from pyspice_runner.spectra.spectrum import COUPLING
from pyspice_runner.units import engineering
from pyspice_runner.view.contents import Contents
from pyspice_runner.view.live import live_page, packed

HERE = Path(__file__).parent
INK, GRID = {"light": "#1b1f24", "dark": "#e6e8eb"}, {"light": "#d5d9de", "dark": "#3a4048"}
_PERIODS = 3  # of the waveforms to download
_SECTIONS = ("beam", "patches", "tip", "damping", "modes", "piezo", "contact", "rotor", "mount", "limits")


class Chart(NamedTuple):
    """A chart of the page: its id, its description for screen readers, and the figure."""

    name: str
    label: str
    figure: Any


class Row(NamedTuple):
    """A row of the table of parameters: dotted path, value, unit, meaning, kind and note of its origin."""

    path: str
    value: str
    unit: str
    meaning: str
    kind: str
    note: str


def datasheet(report: Contents) -> str:
    """Return the page. Raise ParameterError if Plotly or Jinja2 is not installed."""
    try:
        from jinja2 import Environment, FileSystemLoader, StrictUndefined
        from plotly.offline import get_plotlyjs, get_plotlyjs_version

        from pyspice_runner.view import charts
    except ImportError as error:
        raise ParameterError(
            f"A report needs {error.name}. Install it: `pip install 'pyspice-runner[report]'`."
        ) from None
    environment = Environment(
        loader=FileSystemLoader(HERE), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["si"] = engineering
    environment.filters["percent"] = lambda share: f"{100.0 * share:.3g} %"
    over, circle = charts.admittance(report)
    drawn = [
        Chart("modes", "Mode shapes of the beam with its patches and its tip, moving.",
              charts.mode_shapes(report.motor)),
        Chart("tip", "Path of the tip over one drive period by contact state, and the contact forces.",
              charts.tip_path(report.run)),
        Chart("admittance", "Magnitude and phase of the admittance over frequency.", over),
        Chart("circle", "Susceptance over conductance.", circle),
        Chart("curve", "Torque, shaft power and efficiency over speed.", charts.speed_torque(report)),
        Chart("spin-up", "Speed of the rotor from rest.", charts.spin_up(report.run)),
        Chart("electrical", "Voltages and currents of both groups over the last drive periods.",
              charts.electrical(report.run)),
    ]  # fmt: skip
    script, style = ((HERE / f"datasheet.{ending}").read_text(encoding="utf-8") for ending in ("js", "css"))
    return environment.get_template("datasheet.html.j2").render(
        report=report,
        motor=report.motor,
        figures=report.key_figures,
        charts={chart.name: chart for chart in drawn if chart.figure is not None},
        figure_json={chart.name: _embedded(chart.figure.to_json()) for chart in drawn if chart.figure is not None},
        themes={name: _embedded(charts.theme(INK[name], GRID[name]).to_plotly_json()) for name in INK},
        connections=list(COUPLING),
        resonances=[
            {"state": state, "connection": connection, "item": item}
            for state, result in report.spectra.items()
            for connection, items in result.resonances.items()
            for item in items
        ],
        parameters=list(parameter_rows(report.motor)),
        downloads=downloads(report),
        error=report.discretisation_error,
        settled=all(bool(curve["settled"].all()) for curve in report.curves.values()),
        versions={
            "pyspice-runner": version("pyspice-runner"),
            "ngspice": report.run.ngspice_version,
            "Python": platform.python_version(),
            "PySpice": version("PySpice"),
            "plotly.js": get_plotlyjs_version(),
        },
        plotly=packed(get_plotlyjs().encode()),
        live=packed(live_page(report.motor, []).encode()),
        script=script,
        style=style,
    )


def downloads(report: Contents) -> dict[str, str]:
    """Return file name → data URL of each file that the page contains for other programs."""
    motor = report.motor
    files = report.decks() | {
        "report.json": json.dumps(report.to_dict(), indent=2, allow_nan=False) + "\n",
        "last_periods.csv": _last_periods(report.run),
        "speed_torque.csv": "".join(
            curve.assign_coords(drive_share=share).to_dataframe().to_csv(header=not number)
            for number, (share, curve) in enumerate(report.curves.items())
        ),
    }
    with tempfile.TemporaryDirectory() as folder:
        for ending in (".lib", ".toml", ".asy", ".kicad_sym"):
            file = export_motor(motor, Path(folder, f"motor{ending}"))
            files[file.name] = file.read_text(encoding="utf-8")
        for state, result in report.spectra.items():
            file = result.save(Path(folder, f"admittance_{state}.csv"))
            files[file.name] = file.read_text(encoding="utf-8")
    order = {".lib": 0, ".cir": 1, ".toml": 2, ".asy": 3, ".kicad_sym": 4, ".csv": 5}
    names = sorted(files, key=lambda name: (order.get(Path(name).suffix, 9), name))
    encoded = {name: base64.b64encode(files[name].encode()).decode("ascii") for name in names}
    return {name: f"data:text/plain;charset=utf-8;base64,{text}" for name, text in encoded.items()}


def _last_periods(run: Waveforms) -> str:
    """Return the waveforms of the last drive periods as CSV, with the columns of ``piezomotor simulate``."""
    inside = run.time_s >= run.time_s[-1] - _PERIODS * run.drive_period_s
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(run.recorded)
    columns = np.column_stack([values[inside] for values in run.columns().values()])
    writer.writerows([f"{value:.9g}" for value in row] for row in columns)
    return file.getvalue()


def parameter_rows(motor: Motor) -> Iterator[Row]:
    """Yield every parameter of a motor, those of its structure first, with unit, meaning and provenance."""
    structure = motor.structure
    tables: dict[str, Any] = {name: getattr(structure, name) for name in _SECTIONS[:4]} if structure else {}
    tables |= {name: getattr(motor, name) for name in _SECTIONS[4:] if getattr(motor, name) is not None}
    for section, table in tables.items():
        many = isinstance(table, tuple)
        for number, entry in enumerate(table if many else (table,)):
            for name, field in type(entry).model_fields.items():
                path = f"{section}.{number}.{name}" if many else f"{section}.{name}"
                shared = f"ceramic.{name}" if section == "patches" else ""  # by all patches
                origin = motor.provenance.get(path) or motor.provenance.get(shared) or Provenance("derived", "")
                value, unit = getattr(entry, name), unit_of(type(entry), name)
                shown = f"{value:.6g}" if isinstance(value, float) else str(value)
                unit = "" if unit == "1" else unit
                yield Row(path, shown, unit, field.description or "", origin.kind, origin.note)


def _embedded(document: Any) -> str:
    """Return JSON that is safe inside a script element."""
    text = document if isinstance(document, str) else json.dumps(document)
    return text.replace("<", "\\u003c")
