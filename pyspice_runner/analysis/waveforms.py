# SPDX-License-Identifier: GPL-3.0-or-later
"""The waveforms of one run, and what is read from them: means, state fractions, energy balance, files."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.errors import ParameterError
from pyspice_runner.files import save_by_ending, write_csv, write_json, write_netcdf

if TYPE_CHECKING:
    import xarray

Array = NDArray[np.float64]
AVERAGED_PERIODS = 20  # whole drive periods at the end of a run over which means are taken, or as many as there are

COLUMNS: dict[str, tuple[str, str]] = {
    "time_s": ("s", "time"),
    "voltage_a_v": ("V", "voltage of group A"),
    "voltage_b_v": ("V", "voltage of group B"),
    "current_a_a": ("A", "current into group A"),
    "current_b_a": ("A", "current into group B"),
    "tip_x_m": ("m", "tip displacement, tangential"),
    "tip_y_m": ("m", "tip displacement towards the rotor"),
    "normal_force_n": ("N", "normal contact force, positive when pressed"),
    "friction_force_n": ("N", "friction force, positive where it drives the rotor forward"),
    "contact_displacement_m": ("m", "displacement of the tangential spring"),
    "contact_state": ("1", "0 separated, 1 stick, 2 slip; between them the part of a brush that slips"),
    "rotor_speed_rad_s": ("rad/s", "rotor speed"),
}


@dataclass(frozen=True)
class EnergyBalance:
    """Where the energy of a run went, all in J: supplied = sum of the others + residual.

    Attributes:
        electrical: delivered by the two sources.
        dielectric: stored in the clamped capacitances (change) and lost in their loss resistance.
        kinetic: change of the modes' kinetic energy.
        elastic: change of the modes' elastic energy.
        damping: lost in the modes' damping.
        contact_elastic: change of the Hertz contact's elastic energy.
        contact_damping: lost along the normal, where the coefficient of restitution is below 1.
        friction: taken up by the tangential contact: slip loss, and what its spring holds.
        rotor: change of the rotor's kinetic energy.
        bearing: lost in the bearing.
        load: work done on the load or on whatever holds the shaft.
    """

    electrical: float
    dielectric: float
    kinetic: float
    elastic: float
    damping: float
    contact_elastic: float
    contact_damping: float
    friction: float
    rotor: float
    bearing: float
    load: float

    @property
    def missing(self) -> float:
        """Energy supplied less energy found, J."""
        found: float = sum(getattr(self, item.name) for item in fields(self) if item.name != "electrical")
        return self.electrical - found

    @property
    def residual(self) -> float:
        """Supplied minus found, relative to the energy put in (by the sources, and by a shaft that is driven)."""
        put_in = max(self.electrical, 0.0) + max(-self.load, 0.0)
        if put_in <= 0.0:
            return 0.0 if self.missing == 0.0 else float("inf")
        return abs(self.missing) / put_in


class NotRecordedError(AttributeError, ParameterError):
    """A column that the run was asked to leave out."""


@dataclass(frozen=True)
class Waveforms:
    """One verified run. The arrays share one time axis, uniform but for the first few steps and the last, shorter ones.

    What was not recorded is not there: to ask for it raises :class:`NotRecordedError`.

    Attributes:
        energy: the energy balance of the run, from the first point that is recorded; there if all signals are, at
            every step.
        drive_period_s: period of the drive, over which means are taken.
        rotor_radius_m: radius at the contact, which turns friction force into torque.
        solver_seconds: wall time that ngspice took.
        ngspice_version: version of ngspice.
        provenance: motor, drive, run settings and hash of the deck, JSON-ready.
        deck: the netlist that was run.
        error_estimate: estimated error of the tip's trajectory, RMS relative to its motion, if an accuracy was asked
            for.
        complete: whether the run reached its end; one that was interrupted did not.
    """

    time_s: Array
    voltage_a_v: Array
    voltage_b_v: Array
    current_a_a: Array
    current_b_a: Array
    tip_x_m: Array
    tip_y_m: Array
    normal_force_n: Array
    friction_force_n: Array
    contact_displacement_m: Array
    contact_state: Array
    rotor_speed_rad_s: Array
    energy: EnergyBalance
    drive_period_s: float
    rotor_radius_m: float
    solver_seconds: float
    ngspice_version: str
    provenance: dict[str, Any] = field(repr=False)
    deck: str = field(repr=False)
    error_estimate: float | None = None
    complete: bool = True

    def __post_init__(self) -> None:
        for name in (*COLUMNS, "energy"):
            if getattr(self, name) is None:
                object.__delattr__(self, name)

    if not TYPE_CHECKING:  # so that a misspelt name is found

        def __getattr__(self, name: str) -> Any:
            if name in COLUMNS:
                raise NotRecordedError(f"{name} was not recorded in this run; name it among the signals of simulate.")
            if name == "energy":
                raise NotRecordedError("An energy balance takes all signals at every step, as simulate records them.")
            derived = getattr(type(self), name, None)
            if isinstance(derived, property):  # it failed for want of a column: let it say which
                return derived.fget(self)
            raise AttributeError(f"Waveforms have no {name!r}.")

    @property
    def recorded(self) -> list[str]:
        """Names of the columns that are there."""
        return [name for name in COLUMNS if hasattr(self, name)]

    @property
    def points(self) -> int:
        """Number of time points."""
        return len(self.time_s)

    @property
    def energy_residual(self) -> float:
        """Relative residual of the energy balance, see :attr:`EnergyBalance.residual`."""
        return self.energy.residual

    @property
    def mean_rotor_speed_rad_s(self) -> float:
        """Rotor speed averaged over the last whole drive periods, rad/s."""
        return self.mean(self.rotor_speed_rad_s)

    @property
    def mean_torque_n_m(self) -> float:
        """Torque of the contact on the rotor, R·F_T, averaged over the last whole drive periods, N·m."""
        return self.rotor_radius_m * self.mean(self.friction_force_n)

    @property
    def state_fractions(self) -> dict[str, float]:
        """Fractions of time separated, stick and slip over the last whole drive periods; they add up to 1.

        A brush counts as slip where more than half of its width slips.
        """
        window = self.window()
        steps = np.diff(self.time_s[window])
        states = np.rint(self.contact_state[window])
        before, after = states[:-1], states[1:]
        # A change happens in mid-step on average. The end of a slip, though, shows half a step late: the slider's
        # excess over its limit, by which slip is told, follows the relative velocity in the middle of the step.
        late = (before == 2) & (after == 1)
        held_before = steps * np.where(late, 0.0, 0.5)
        held_after = steps - held_before
        return {
            name: float((held_before[before == code].sum() + held_after[after == code].sum()) / steps.sum())
            for code, name in enumerate(("separated", "stick", "slip"))
        }

    def window(self) -> slice:
        """Return the points of the last whole drive periods, at most :data:`AVERAGED_PERIODS` of them."""
        return slice(max(int(np.searchsorted(self.time_s, self._averaged_from)) - 1, 0), None)

    def mean(self, signal: Array) -> float:
        """Return the time average of a signal over the last whole drive periods."""
        window = self.window()
        time, values = self.time_s[window].copy(), signal[window].copy()
        # a step more or less of a large alternating signal would hide a small mean
        values[0], time[0] = np.interp(self._averaged_from, time[:2], values[:2]), self._averaged_from
        return float(np.trapezoid(values, time) / (time[-1] - time[0]))

    @property
    def _averaged_from(self) -> float:
        """Time in s at which the last whole drive periods begin."""
        duration = float(self.time_s[-1])
        recorded = duration - float(self.time_s[0])
        periods = min(AVERAGED_PERIODS, int(recorded / self.drive_period_s * (1.0 + 1e-9)))
        return duration - periods * self.drive_period_s if periods else float(self.time_s[0])

    def to_dict(self) -> dict[str, Any]:
        """Return the summary of the run, JSON-ready; ``None`` stands for what was not recorded."""

        def known(column: str, quantity: str) -> Any:
            return getattr(self, quantity) if hasattr(self, column) else None

        return {
            "mean_rotor_speed_rad_s": known("rotor_speed_rad_s", "mean_rotor_speed_rad_s"),
            "mean_torque_n_m": known("friction_force_n", "mean_torque_n_m"),
            "state_fractions": known("contact_state", "state_fractions"),
            "energy_residual": known("energy", "energy_residual"),
            "energy_j": asdict(self.energy) if hasattr(self, "energy") else None,
            "error_estimate": self.error_estimate,
            "complete": self.complete,
            "points": self.points,
            "solver_seconds": self.solver_seconds,
            "ngspice_version": self.ngspice_version,
            **self.provenance,
        }

    def to_xarray(self) -> xarray.Dataset:
        """Return the waveforms as a labelled dataset over ``time_s``, with units and provenance as attributes."""
        import xarray

        variables = {
            name: ("time_s", getattr(self, name), {"units": unit, "long_name": meaning})
            for name, (unit, meaning) in COLUMNS.items()
            if name in self.recorded
        }
        time = variables.pop("time_s")
        return xarray.Dataset(variables, coords={"time_s": time}, attrs={"summary": json.dumps(self.to_dict())})

    def save(self, path: str | Path) -> Path:
        """Write the run to a file, by its ending: ``.csv``, ``.nc`` (waveforms), ``.json`` (summary), ``.cir`` (deck).

        Raises:
            ParameterError: for another ending or a place that cannot be written.
        """
        return save_by_ending(
            path,
            {
                ".csv": lambda file: write_csv(file, {name: getattr(self, name) for name in self.recorded}),
                ".nc": lambda file: write_netcdf(file, self.to_xarray()),
                ".json": lambda file: write_json(file, self.to_dict()),
                ".cir": lambda file: file.write_text(self.deck, encoding="utf-8"),
            },
        )

    def plot(self, path: str | Path) -> Path:
        """Draw the run: rotor speed, path of the tip coloured by contact state, forces, currents."""
        from pyspice_runner.plots import plot_waveforms

        return plot_waveforms(self, path)
