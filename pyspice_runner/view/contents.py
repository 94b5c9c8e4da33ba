# SPDX-License-Identifier: GPL-3.0-or-later
"""The contents of a motor's data sheet, and the values derived from them."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import UTC, datetime
from math import sqrt
from typing import TYPE_CHECKING, Any

import numpy as np

from pyspice_runner.datasets import Curves
from pyspice_runner.model.drive import Drive
from pyspice_runner.model.motor import Motor
from pyspice_runner.result import Audit, Result
from pyspice_runner.run.waveforms import Waveforms
from pyspice_runner.spectra.admittance import Admittance
from pyspice_runner.spectra.spectrum import Connection, Spectrum, State
from pyspice_runner.units import engineering

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True, eq=False, repr=False)
class Contents(Result):
    """The contents of a motor's data sheet.

    Attributes:
        motor: the motor.
        drive: the drive of the run and, at several levels, of the curves.
        spectra: state of the tip (``"free"``, ``"preloaded"``) → the stator's two-port.
        run: the motor from rest.
        coarse: the same run at twice the time step, from which the error is estimated.
        curves: share of the drive's voltage → speed–torque curve.
        measured: a measured spectrum to draw over the computed ones.
        connection: how the groups were connected when it was measured, if it is a one-port.
        created: when the report was made, ISO 8601.
    """

    motor: Motor
    drive: Drive
    spectra: dict[State, Admittance]
    run: Waveforms
    coarse: Waveforms
    curves: dict[float, xarray.Dataset]
    measured: Spectrum | None = None
    connection: Connection = "A"
    created: str = field(default_factory=lambda: datetime.now(UTC).isoformat(timespec="seconds"))

    @property
    def discretisation_error(self) -> dict[str, float]:
        """Estimated error of the run from its time step, relative.

        The integration is of second order: at twice the step the error is four times as large, so that a third of the
        difference between the two runs is the error of the finer one. Where the motion is irregular, two runs differ
        at any step, and the estimate is large.

        Returns:
            ``tip_path``: RMS distance between the tip's paths over the last drive periods, over the RMS size of the
            path. ``rotor_speed``: of the mean speed, over the largest speed reached.
        """
        fine, coarse = self.run, self.coarse
        window = coarse.window()
        time = coarse.time_s[window]
        distance, size = 0.0, 0.0
        for name in ("tip_x_m", "tip_y_m"):
            values = np.interp(time, fine.time_s, getattr(fine, name))
            distance += float(np.mean((values - getattr(coarse, name)[window]) ** 2))
            size += float(np.var(values))
        speed = abs(fine.mean_rotor_speed_rad_s - coarse.mean_rotor_speed_rad_s)
        largest = float(np.abs(fine.rotor_speed_rad_s).max())
        return {
            "tip_path": sqrt(distance / size) / 3.0 if size else 0.0,
            "rotor_speed": speed / largest / 3.0 if largest else 0.0,
        }

    @property
    def key_figures(self) -> dict[str, float | None]:
        """The values at the top of a data sheet; ``None`` for a value that the curves do not reach."""
        curve = self.curves[max(self.curves)]
        speed, torque = curve["speed_rad_s"].values, curve["torque_n_m"].values
        forward = np.where(curve["shaft_power_w"].values > 0.0, curve["efficiency"].values, -np.inf)
        best = int(np.argmax(forward))
        crossings = np.flatnonzero(torque[:-1] * torque[1:] < 0.0)
        no_load = None
        if len(crossings):  # by a straight line between the points around the first zero
            x, y = (values[crossings[0] : crossings[0] + 2] for values in (speed, torque))
            no_load = float(x[0] - y[0] * (x[1] - x[0]) / (y[1] - y[0]))
        run = self.run
        return {
            "stall_torque_n_m": float(torque[speed == 0.0][0]) if (speed == 0.0).any() else None,
            "no_load_speed_rad_s": no_load,
            "best_efficiency": float(forward[best]) if np.isfinite(forward[best]) else None,
            "best_efficiency_speed_rad_s": float(speed[best]) if np.isfinite(forward[best]) else None,
            "run_speed_rad_s": run.mean_rotor_speed_rad_s,
            "current_a_rms_a": float(np.sqrt(run.mean(run.current_a_a**2))),
            "current_b_rms_a": float(np.sqrt(run.mean(run.current_b_a**2))),
            "power_a_w": run.mean(run.voltage_a_v * run.current_a_a),
            "power_b_w": run.mean(run.voltage_b_v * run.current_b_a),
        }

    def to_dict(self) -> dict[str, Any]:
        """Return the contents of the report without its curves over time, JSON-ready."""
        return {
            "motor": self.motor.to_dict(),
            "created": self.created,
            "key_figures": self.key_figures,
            "admittance": {state: result.to_dict() for state, result in self.spectra.items()},
            "run": self.run.to_dict(),
            "discretisation_error": self.discretisation_error,
            "speed_torque": [
                {
                    "drive_share": share,
                    "speed_rad_s": curve["speed_rad_s"].values.tolist(),
                    **{
                        name: [value if np.isfinite(value) else None for value in curve[name].values.tolist()]
                        for name in ("torque_n_m", "shaft_power_w", "efficiency", "separated", "stick", "slip")
                    },
                    "settled": curve["settled"].values.tolist(),
                }
                for share, curve in self.curves.items()
            ],
            "measured": None if self.measured is None else {"source": self.measured.source},
        }

    def decks(self) -> dict[str, str]:
        """Return file name → text of the decks that were run: the run from rest, and the spectra."""
        spectra = {f"admittance_{state}.cir": result.deck or "" for state, result in self.spectra.items()}
        return {"run.cir": self.run.deck, **spectra}

    @property
    def audit(self) -> Audit:  # type: ignore[override]
        """The outcome of the physical audit of the run."""
        return self.run.audit

    @property
    def cautions(self) -> tuple[str, ...]:
        """Cautions of the run and of the curves."""
        curves = (caution for curve in self.curves.values() for caution in Curves(curve).cautions)
        return tuple(dict.fromkeys((*self.run.cautions, *curves)))

    def summary(self) -> dict[str, str]:
        """Return motor, drive, key figures and errors."""
        figures = self.key_figures
        best = figures["best_efficiency"]
        return {
            "motor": self.motor.name,
            "modes": self.motor.summary()["modes"],
            "drive": self.drive.label,
            "stall torque": engineering(figures["stall_torque_n_m"], "N·m"),
            "no-load speed": engineering(figures["no_load_speed_rad_s"], "rad/s"),
            "best efficiency": "–" if best is None else f"{100.0 * best:.3g} %",
            "electrical power": engineering((figures["power_a_w"] or 0.0) + (figures["power_b_w"] or 0.0), "W"),
            "error by the step": f"{self.discretisation_error['tip_path']:.1e} of the tip's path",
            "energy residual": f"{self.run.energy_residual:.1e}",
        }
