# SPDX-License-Identifier: GPL-3.0-or-later
"""The data sheet of a motor as one HTML page, without network access and without other files.

Text and tables are plain HTML; Plotly stands at the end of the page and runs after the first paint.
"""

from __future__ import annotations

import base64
import json
import platform
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray

from pyspice_runner.calibration.record import Record
from pyspice_runner.datasets import Curves
from pyspice_runner.errors import ParameterError
from pyspice_runner.export.motor import export_motor
from pyspice_runner.impedance.admittance import Admittance, Resonance
from pyspice_runner.impedance.spectrum import Connection, Spectrum, State
from pyspice_runner.motor.drive import Drive
from pyspice_runner.motor.motor import Motor, Provenance
from pyspice_runner.motor.refusal import unit_of
from pyspice_runner.result import Audit, Result, grouped, json_ready
from pyspice_runner.run.waveforms import Waveforms
from pyspice_runner.steady.steady import SteadyState
from pyspice_runner.steady.transducer import TransducerState
from pyspice_runner.trackers.track import Tracking
from pyspice_runner.units import engineering
from pyspice_runner.view.live import live_page, packed, rendered

HERE = Path(__file__).parent
INK, GRID = {"light": "#1b1f24", "dark": "#e6e8eb"}, {"light": "#d5d9de", "dark": "#3a4048"}
_TABULATED = ("speed_rad_s", "torque_n_m", "shaft_power_w", "efficiency", "separated", "stick", "slip", "settled")
LEAST_COUPLING = 0.02  # resonance and antiresonance are less than 0.02 % apart below it: the table folds such an arm
_PERIODS = 3  # of the waveforms to download
_OF_STRUCTURE = ("beam", "patches", "tip", "damping")
_SECTIONS = ("modes", "piezo", "contact", "rotor", "slider", "mount", "load", "limits")


Arm = tuple[State, str, Resonance]  # of the equivalent circuit of the groups that a name connects


class Row(NamedTuple):
    """A row of the table of parameters: dotted path, value, unit, meaning, kind and note of its origin."""

    path: str
    value: str
    unit: str
    meaning: str
    kind: str
    note: str


@dataclass(frozen=True, eq=False, repr=False)
class Report(Result):
    """The contents of a motor's data sheet, with the page made of them.

    Attributes:
        motor: the motor.
        drive: the drive of the run and, at several levels, of the curves.
        spectra: state of the tip (``"free"``, ``"preloaded"``) → the stator's two-port.
        run: the motor from rest.
        curves: share of the drive's voltage → speed–torque curve.
        free: the steady state of the rotor without load, at the highest of these shares; ``None`` where dry friction of
            the bearing stops it. Of a transducer the steady state under its load.
        measured, connection, tracking, calibration: the arguments of :func:`report`.
        created: when the report was made, ISO 8601.
    """

    motor: Motor
    drive: Drive
    spectra: dict[State, Admittance]
    run: Waveforms
    curves: dict[float, xarray.Dataset]
    free: SteadyState | TransducerState | None
    measured: Spectrum | None = None
    connection: Connection = "A"
    tracking: Tracking | None = None
    calibration: Record | None = None
    created: str = field(default_factory=lambda: datetime.now(UTC).isoformat(timespec="seconds"))

    @property
    def linear(self) -> bool:
        """Whether the motor has a slider."""
        return self.motor.slider is not None

    @property
    def discretisation_error(self) -> dict[str, float | None]:
        """Estimated error of the run from its time step, relative; ``None`` where it is not known.

        Returns:
            ``tip_path``: RMS over the motion of the tip. ``rotor_speed``: of the mean speed, over the largest speed
            reached. Of a transducer ``motional_current``.
        """
        if self.motor.is_transducer:
            return {"motional_current": self.run.error_estimate}
        speed, largest = self.run.speed_error_rad_s, float(np.abs(self.run.rotor_speed_rad_s).max())
        share = speed / largest if speed and largest else speed
        return {"tip_path": self.run.error_estimate, "rotor_speed": share}

    @property
    def key_figures(self) -> dict[str, float | None]:
        """The values at the top of a data sheet, at the highest drive; ``None`` for a value that is not settled.

        Speed, currents and powers without load are from the free rotor's steady state; stall torque and best
        efficiency are from settled points of the curve. The values of a transducer are from its steady state.
        """
        if isinstance(self.free, TransducerState):
            return self.free.quantities
        curve = self.curves[max(self.curves)]
        speed, settled = curve["speed_rad_s"].values, curve["settled"].values
        forward = np.where(settled & (curve["efficiency"].values > 0.0), curve["efficiency"].values, -np.inf)
        best = int(np.argmax(forward))
        stall = curve["torque_n_m"].values[settled & (speed == 0.0)]
        free = self.free if self.free is not None and self.free.reached else None
        return self._localised({
            "stall_torque_n_m": float(stall[0]) if len(stall) else None,
            "no_load_speed_rad_s": free.speed_rad_s if free else None,
            "best_efficiency": float(forward[best]) if np.isfinite(forward[best]) else None,
            "best_efficiency_speed_rad_s": float(speed[best]) if np.isfinite(forward[best]) else None,
            **{
                name: getattr(free, name) if free else None
                for name in ("current_a_rms_a", "current_b_rms_a", "power_a_w", "power_b_w")
            },
            "electrical_power_w": free.power_a_w + free.power_b_w if free else None,
        })  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """Return the contents of the report without its curves over time, JSON-ready."""
        return {
            **self._entries("motor", "created", "key_figures"),
            "admittance": json_ready(self.spectra),
            **self._entries("run", "discretisation_error"),
            "speed_torque": [
                self._localised({"drive_share": share, **{name: json_ready(curve[name].values) for name in _TABULATED}})
                for share, curve in self.curves.items()
            ],
            "measured": None if self.measured is None else {"source": self.measured.source},
            "tracking": None if self.tracking is None else self.tracking.to_dict(),
        }

    def writers(self) -> dict[str, Callable[[Path], object]]:
        """Return the writers by ending: ``.html``, one self-contained page, and ``.json``.

        The page needs Plotly and Jinja2; without them, writing it raises :class:`ParameterError`.
        """
        page = {".html": lambda file: file.write_text(datasheet(self), encoding="utf-8", newline="\n")}
        return {**page, **super().writers()}

    @property
    def audit(self) -> Audit:  # type: ignore[override]
        """The outcome of the physical audit of the run."""
        return self.run.audit

    def _limits(self) -> Iterator[str]:
        """Yield each caution once: of a calibration of another motor, of the run, of the free rotor, of the curves."""
        if self.calibration and (others := self.calibration.differing(self.motor, self.drive)):
            yield f"The calibration is of a motor with other values of {', '.join(others)}."
        if self.free is None:
            yield "Dry friction of the bearing stops the rotor."
        states: dict[str, Sequence[str]] = {"Run from rest": self.run.cautions}
        states |= {} if self.free is None else {"No load": self.free.cautions}
        states |= {f"Curve at {100.0 * level:g} %": Curves(curve).cautions for level, curve in self.curves.items()}
        yield from grouped(list(states.values()), list(states))

    def summary(self) -> dict[str, str]:
        """Return motor, drive, key figures and errors."""
        figures = self.key_figures
        best, error = figures.get("best_efficiency"), self.run.error_estimate
        tracked = self.tracking.summary() if self.tracking else {}
        tracked = {name: tracked[name] for name in ("frequency reached", "phase margin") if name in tracked}
        rows = {"modes": self.motor.summary()["modes"], "drive": self.drive.label}
        if isinstance(self.free, TransducerState):
            return {"transducer": self.motor.name, **rows, **self.free.summary(), **tracked}
        return self._localised({
            "motor": self.motor.name,
            **rows,
            "stall torque": engineering(figures["stall_torque_n_m"], "N·m"),
            "no-load speed": engineering(figures["no_load_speed_rad_s"], "rad/s"),
            "best efficiency": "–" if best is None else f"{100.0 * best:.3g} %",
            "electrical power, no load": engineering(figures["electrical_power_w"], "W"),
            **tracked,
            "error by the step": "–" if error is None else f"{error:.1e} of the tip's path",
            "energy residual": f"{self.run.energy_residual:.1e}",
        })  # fmt: skip


def datasheet(report: Report) -> str:
    """Return the page. Raise ParameterError if Plotly or Jinja2 is not installed."""
    try:
        from plotly.offline import get_plotlyjs, get_plotlyjs_version

        from pyspice_runner.view import charts
    except ImportError as error:
        raise ParameterError(f"A report needs {error.name}. Install it: `pip install 'piezomotor[report]'`.") from None
    over, circle = charts.admittance(report.motor, report.spectra, report.measured, report.connection)
    figures = {
        "admittance": over,
        "circle": circle,
        "electrical": charts.electrical(report.run),
        "loop": charts.loop_gain(report.tracking.loop) if report.tracking and report.tracking.loop else None,
        "residuals": charts.calibration(report.calibration.points) if report.calibration else None,
        **{f"residuals-{number}": charts.calibration_curve(curve)
           for number, curve in enumerate(report.calibration.curves if report.calibration else ())},
    }  # fmt: skip
    if not report.motor.is_transducer:
        figures |= {
            "modes": charts.mode_shapes(report.motor),
            "tip": charts.tip_path(report.run),
            "curve": charts.speed_torque(report.curves),
            "spin-up": charts.spin_up(report.run),
        }
    script, style = ((HERE / f"datasheet.{ending}").read_text(encoding="utf-8") for ending in ("js", "css"))
    return rendered(
        "datasheet.html.j2",
        report=report,
        motor=report.motor,
        figures=report.key_figures,
        torque="force" if report.linear else "torque",
        torque_unit="N" if report.linear else "N·m",
        speed_unit="m/s" if report.linear else "rad/s",
        charts={name: figure for name, figure in figures.items() if figure is not None},
        themes={name: charts.theme(INK[name], GRID[name]).to_plotly_json() for name in INK},
        connections=list(report.spectra["free"].resonances),
        states=charts.STATES_OF[report.motor.is_transducer],
        parameters=list(parameter_rows(report.motor)),
        circuits=_circuits(report.spectra),
        least_coupling=LEAST_COUPLING,
        downloads=downloads(report),
        error=report.discretisation_error,
        settled=all(bool(curve["settled"].all()) for curve in report.curves.values()),
        versions={
            "piezomotor": version("piezomotor"),
            "ngspice": report.run.ngspice_version,
            "Python": platform.python_version(),
            "PySpice": version("PySpice"),
            "plotly.js": get_plotlyjs_version(),
        },
        plotly=packed(get_plotlyjs().encode()),
        live="" if report.motor.is_transducer else packed(live_page(report.motor, []).encode()),
        script=script,
        style=style,
    )


def _circuits(spectra: Mapping[State, Admittance]) -> dict[bool, list[Arm]]:
    """Return the equivalent circuits by whether their coupling reaches LEAST_COUPLING, the largest coupling first.

    Groups that give the same circuit, as A and B of a symmetric stator, have one row.
    """
    rows: dict[tuple[Any, ...], Arm] = {}
    for state, spectrum in spectra.items():
        for connection, items in spectrum.resonances.items():
            for item in items:
                key = (state, item.mode, f"{item.fs:.5g} {item.coupling_factor:.2g} {item.resistance_ohm:.3g}")
                rows.setdefault(key, (state, connection, item))
    ranked = sorted(rows.values(), key=lambda row: -row[2].coupling_factor)
    return {
        coupled: [row for row in ranked if (row[2].coupling_factor >= LEAST_COUPLING) is coupled]
        for coupled in (True, False)
    }


def downloads(report: Report) -> dict[str, str]:
    """Return file name → data URL of each file that the page contains for other programs."""
    motor, run = report.motor, report.run
    last = run.time_s >= run.time_s[-1] - _PERIODS * run.drive_period_s
    files = {"run.cir": run.deck or ""}
    if report.tracking is not None:
        files["track.cir"] = report.tracking.deck or ""
    files |= {f"admittance_{state}.cir": result.deck or "" for state, result in report.spectra.items()}
    files |= {
        "report.json": json.dumps(report.to_dict(), indent=2, allow_nan=False) + "\n",
        "last_periods.csv": run.to_dataframe()[last].to_csv(float_format="%.9g", lineterminator="\n"),
    }
    if report.curves:
        files["speed_torque.csv"] = "".join(
            curve.assign_coords(drive_share=share).to_dataframe().to_csv(header=not number)
            for number, (share, curve) in enumerate(report.curves.items())
        )
    with tempfile.TemporaryDirectory() as folder:
        for ending in (".lib", ".toml", ".asy", ".kicad_sym"):
            file = export_motor(motor, Path(folder, f"motor{ending}"))
            files[file.name] = file.read_text(encoding="utf-8")
        for state, result in report.spectra.items():
            file = result.save(Path(folder, f"admittance_{state}.csv"))
            files[file.name] = file.read_text(encoding="utf-8")
    encoded = {name: base64.b64encode(text.encode()).decode("ascii") for name, text in sorted(files.items())}
    return {name: f"data:text/plain;charset=utf-8;base64,{text}" for name, text in encoded.items()}


_OF_SOLID = ("contact", "boxes", "electrodes", "supports")  # tables within [solid]


def parameter_rows(motor: Motor) -> Iterator[Row]:
    """Yield every parameter of a motor, those of its structure first, with unit, meaning and provenance."""
    structure = motor.structure
    tables: dict[str, Any] = {name: getattr(structure, name) for name in _OF_STRUCTURE} if structure else {}
    missing = {"contact", "rotor"} if motor.is_transducer else {"rotor"} if motor.slider else set()
    stated = [name for name in _SECTIONS if name not in missing]
    tables |= {name: getattr(motor, name) for name in stated if getattr(motor, name) is not None}
    if motor.solid is not None:
        tables = {"solid": motor.solid} | {f"solid.{name}": getattr(motor.solid, name) for name in _OF_SOLID} | tables
    tables = ({"ring": motor.ring} if motor.ring else {}) | tables
    for section, table in tables.items():
        many = isinstance(table, tuple)
        for number, entry in enumerate(table if many else (table,)):
            for name, known in type(entry).model_fields.items():
                if section == "solid" and name in _OF_SOLID:
                    continue
                path = f"{section}.{number}.{name}" if many else f"{section}.{name}"
                shared = f"ceramic.{name}" if section == "patches" else ""  # by all patches
                origin = motor.provenance.get(path) or motor.provenance.get(shared) or Provenance("derived", "")
                value, unit = getattr(entry, name), unit_of(type(entry), name)
                shown = "–" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)
                unit = "" if unit == "1" else unit
                yield Row(path, shown, unit, known.description or "", origin.kind, origin.note)
