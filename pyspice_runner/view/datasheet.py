# SPDX-License-Identifier: GPL-3.0-or-later
"""The data sheet of a motor: its analyses, and one HTML page without network access and without other files.

The analyses are spectra, a run from rest, steady states of the free rotor, and speed–torque curves. Text and tables of
the page are plain HTML; Plotly stands at the end of the page and runs after the first paint.
"""

from __future__ import annotations

import base64
import json
import platform
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple, get_args

import numpy as np
import xarray
from numpy.typing import ArrayLike
from pydantic import SkipValidation

from pyspice_runner.calibration.result import Record
from pyspice_runner.datasets import Curves
from pyspice_runner.errors import ParameterError, SimulationError, require
from pyspice_runner.export.motor import export_motor
from pyspice_runner.files import write_netcdf
from pyspice_runner.impedance.admittance import Admittance, Resonance, admittance
from pyspice_runner.impedance.spectrum import Connection, Spectrum, State
from pyspice_runner.motor.drive import Drive
from pyspice_runner.motor.motor import Motor, Provenance
from pyspice_runner.motor.refusal import checked, unit_of
from pyspice_runner.result import Audit, Result, grouped, json_ready
from pyspice_runner.run.simulate import simulate
from pyspice_runner.run.waveforms import Array, Waveforms
from pyspice_runner.steady.settling import Progress
from pyspice_runner.steady.speed_torque import axis, check_distinct, no_load_state, speed_torque
from pyspice_runner.steady.steady import SteadyState
from pyspice_runner.steady.transducer import TransducerState, transducer_state
from pyspice_runner.trackers.track import Tracking
from pyspice_runner.units import engineering
from pyspice_runner.view.live import live_page, packed
from pyspice_runner.view.live_circuit import rendered

HERE = Path(__file__).parent
_TABULATED = ("speed_rad_s", "torque_n_m", "shaft_power_w", "efficiency", "separated", "stick", "slip", "settled")
LEAST_COUPLING = 0.02  # resonance and antiresonance are less than 0.02 % apart below it: the table folds such an arm
_PERIODS = 3  # of the waveforms to download
_OF_STRUCTURE = ("beam", "patches", "tip", "damping")
_SECTIONS = ("modes", "piezo", "contact", "rotor", "slider", "mount", "load", "limits")
LEVELS = (0.5, 1.0)
SPEEDS = 11  # of a curve, by default: ten up to no load, and one beyond
OVERSPEED = 1.1  # end of a curve over the speed without load
DURATION = 10e-3  # s of the run from rest, at first
DOUBLINGS = 3  # of this duration at most, while the run has not settled
PATIENCE = 16  # blocks; a point that has not settled by then is marked
_POINTS_PER_BANDWIDTH = 10
_FEWEST_POINTS, _MOST_POINTS = 600, 20_000
_WINDOW = 6.0  # bandwidths on each side of a resonance that keep all points of a spectrum
_RUNS = 3  # two spectra and the run


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


@checked
def report(
    motor: Motor,
    drive: Drive,
    duration: float | None = None,
    *,
    speeds: SkipValidation[ArrayLike | None] = None,
    levels: Sequence[float] = LEVELS,
    measured: Spectrum | None = None,
    connection: Connection = "A",
    tracking: Tracking | None = None,
    calibration: str | Path | None = None,
    progress: Progress | None = None,
    timeout: float | None = None,
) -> Report:
    """Run the analyses of a motor's data sheet; the data sheet of a transducer has no curves.

    The curves have twice the time step of the run. Their error is four times ``discretisation_error``, that of the run.

    Args:
        motor: the motor.
        drive: the voltages of both groups.
        duration: of the run from rest, s; by default 10 ms, doubled until the run has settled, three times at most.
        speeds: of the speed–torque curves, rad/s; by default from standstill to slightly beyond no load, at each level
            that of its own free rotor.
        levels: shares of the drive's voltage at which a curve is measured.
        measured: a measured spectrum to draw over the computed ones.
        connection: how the groups were connected when it was measured, if it is a one-port.
        tracking: a run of this motor with a resonance tracker, for a section with its loop gain.
        calibration: path of the JSON file of a calibration of this motor.
        progress: called with the number of finished runs and points, and with their total.
        timeout: wall time in s of each run, after which ngspice is stopped.

    Raises:
        ParameterError: for an invalid value.
        SimulationError: if ngspice fails or its result is not valid; ``partial`` maps the file name of each finished
            part to the function that writes it.
    """
    require(levels and all(0.0 < level <= 1.0 for level in levels), "levels", list(levels), "numbers > 0 and ≤ 1")
    if tracking is not None and tracking.settings["motor"] != motor.to_dict():
        raise ParameterError(
            f"tracking is a run of {tracking.settings['motor']['name']} with other parameters than {motor.name} has "
            "here. Give a run of the same motor."
        )
    if speeds is not None:
        speeds = axis("speeds", speeds)
        check_distinct({"speeds": speeds})
    record = None if calibration is None else Record.read(calibration)
    voltages = {name: value for name, value in drive.model_dump().items() if name.startswith("voltage")}
    shares = () if motor.is_transducer else sorted(levels)
    scaled = {level: drive.updated({name: value * level for name, value in voltages.items()}) for level in shares}
    done, total = 0, _RUNS + len(scaled) * (1 + (SPEEDS if speeds is None else np.size(speeds)))
    notify = progress or (lambda *_: None)

    def advance(count: int = 1) -> None:
        nonlocal done
        done += count
        notify(done, total)

    advance(0)
    spectra: dict[State, Admittance] = {}
    curves: dict[float, xarray.Dataset] = {}
    finished: dict[str, Callable[[Path], object]] = {}
    try:
        for state in get_args(State):
            spectra[state] = _spectrum(motor, state, timeout)
            finished[f"admittance_{state}.csv"] = spectra[state].save
            advance()
        run = _run(motor, drive, duration, timeout)
        finished["run.nc"] = run.save
        advance()
        free: SteadyState | TransducerState | None = transducer_state(motor, drive) if motor.is_transducer else None
        step = 2.0 * run.provenance["run"]["step_s"]
        for level, at_level in scaled.items():
            free = idle = no_load_state(motor, at_level, timeout=timeout)
            advance()
            at = _speeds(motor, idle, run) if speeds is None else speeds
            curves[level] = speed_torque(motor, at_level, speeds=at, step=step, patience=PATIENCE, timeout=timeout)
            finished[f"speed_torque_{100.0 * level:g}.nc"] = partial(write_netcdf, dataset=curves[level])
            advance(np.size(at))
    except SimulationError as error:
        if error.partial is not None:  # of a curve
            finished["speed_torque_incomplete.nc"] = partial(write_netcdf, dataset=error.partial)
        error.partial = finished
        raise
    return Report(motor, drive, spectra, run, curves, free, measured, connection, tracking, record)


def _run(motor: Motor, drive: Drive, duration: float | None, timeout: float | None) -> Waveforms:
    """Return the run from rest; by default until it has settled, with :data:`DOUBLINGS` at most."""
    run = simulate(motor, drive, duration=duration or max(DURATION, motor.settled_s), timeout=timeout)
    for _ in range(DOUBLINGS if duration is None else 0):
        if run.settled:
            break
        run = simulate(motor, drive, duration=2.0 * float(run.time_s[-1]), timeout=timeout)
    return run


def _spectrum(motor: Motor, state: State, timeout: float | None) -> Admittance:
    """Return the two-port over all modes, with some points within every bandwidth."""
    frequencies = [mode.frequency_hz for mode in motor.modes]
    pressed = motor.pressed_stator.resonances()
    start, stop = 0.5 * frequencies[0], 1.4 * max(frequencies[-1], float(pressed[-1]))
    bandwidth = min(mode.frequency_hz / mode.quality_factor for mode in motor.modes)
    points = int(np.clip(_POINTS_PER_BANDWIDTH * (stop - start) / bandwidth, _FEWEST_POINTS, _MOST_POINTS))
    result = admittance(motor, start=start, stop=stop, points=points, state=state, timeout=timeout)
    frequency = result.frequency_hz
    kept = np.zeros(points, dtype=bool)
    kept[:: max(points // _FEWEST_POINTS, 1)] = kept[-1] = True
    for item in (item for items in result.resonances.values() for item in items):
        kept |= np.abs(frequency - item.fs) < _WINDOW * item.fs / item.quality_factor
    return replace(result, frequency_hz=frequency[kept], matrix_s=result.matrix_s[kept])


def _speeds(motor: Motor, free: SteadyState | None, run: Waveforms) -> Array:
    """Return speeds from standstill to slightly beyond no load, in the direction in which the motor turns.

    Without a steady state they end at the tip's largest speed along the rotor, which the rotor cannot exceed.
    """
    window = run.window()
    tip = float(np.abs(np.gradient(run.tip_x_m[window], run.time_s[window])).max()) / motor.rotor.radius_m
    if free is None or not free.reached:
        return np.linspace(0.0, np.copysign(max(tip, 1e-3), run.mean_rotor_speed_rad_s), SPEEDS)
    reach = max(OVERSPEED * abs(free.speed_rad_s), 0.01 * tip, 1e-3)
    return np.linspace(0.0, np.copysign(reach, free.speed_rad_s), SPEEDS)


# --- the page ---


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
        live=packed(live_page(report.motor, []).encode()),
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
