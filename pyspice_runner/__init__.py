# SPDX-License-Identifier: GPL-3.0-or-later
"""A SPICE model of a standing-wave piezomotor, run on ngspice.

    import pyspice_runner as pr

    motor = pr.load_motor("andersen2002")
    run = pr.simulate(motor, pr.TwoPhaseDrive(voltage=50.0, frequency=51.7e3, phase_deg=90.0), duration=5e-3)
    print(run.mean_rotor_speed_rad_s, run.state_fractions)

A result has ``to_dict``, ``save``, ``plot`` and ``to_dataframe`` (:class:`pyspice_runner.result.Result`); a dataset has
them as ``dataset.piezomotor``. Names load on first use, so that the import itself is light.
"""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from pyspice_runner.display import draw_with

if TYPE_CHECKING:
    __version__: str

    from pyspice_runner.analysis.averaged import simulate_averaged
    from pyspice_runner.analysis.branch import steady_branch
    from pyspice_runner.analysis.controlled import simulate_controlled
    from pyspice_runner.analysis.drive import drive_report
    from pyspice_runner.analysis.motor_from import motor_from
    from pyspice_runner.analysis.simulate import simulate
    from pyspice_runner.analysis.small_signals import small_signals
    from pyspice_runner.analysis.speed_torque import speed_torque
    from pyspice_runner.analysis.steady import steady_state
    from pyspice_runner.analysis.track import track
    from pyspice_runner.analysis.working_points import working_points
    from pyspice_runner.errors import ParameterError, SimulationError, SpectrumError
    from pyspice_runner.export.motor import export_motor
    from pyspice_runner.model.drive import TwoPhaseDrive, TwoToneDrive, default_drive
    from pyspice_runner.model.load import available_motors, load_motor
    from pyspice_runner.model.motor import Motor
    from pyspice_runner.model.thermal import Thermal
    from pyspice_runner.netlist.contact import Law
    from pyspice_runner.netlist.drivers import Driver
    from pyspice_runner.netlist.trackers import Tracker
    from pyspice_runner.spectra.admittance import admittance
    from pyspice_runner.spectra.compare import compare
    from pyspice_runner.spectra.fit import fit_spectrum
    from pyspice_runner.spectra.readers import read_spectrum
    from pyspice_runner.spectra.spectrum import Spectrum
    from pyspice_runner.spectra.together import fit_together
    from pyspice_runner.spectra.twoport import fit_two_port
    from pyspice_runner.study.plan import Tolerance
    from pyspice_runner.study.sweep import sweep
    from pyspice_runner.view.report import report

_HOMES = {
    "Driver": "netlist.drivers",
    "Law": "netlist.contact",
    "Motor": "model.motor",
    "ParameterError": "errors",
    "SimulationError": "errors",
    "Spectrum": "spectra.spectrum",
    "SpectrumError": "errors",
    "Thermal": "model.thermal",
    "Tolerance": "study.plan",
    "Tracker": "netlist.trackers",
    "TwoPhaseDrive": "model.drive",
    "TwoToneDrive": "model.drive",
    "admittance": "spectra.admittance",
    "available_motors": "model.load",
    "compare": "spectra.compare",
    "default_drive": "model.drive",
    "drive_report": "analysis.drive",
    "export_motor": "export.motor",
    "fit_spectrum": "spectra.fit",
    "fit_together": "spectra.together",
    "fit_two_port": "spectra.twoport",
    "load_motor": "model.load",
    "motor_from": "analysis.motor_from",
    "read_spectrum": "spectra.readers",
    "report": "view.report",
    "simulate": "analysis.simulate",
    "simulate_averaged": "analysis.averaged",
    "simulate_controlled": "analysis.controlled",
    "small_signals": "analysis.small_signals",
    "speed_torque": "analysis.speed_torque",
    "steady_branch": "analysis.branch",
    "steady_state": "analysis.steady",
    "sweep": "study.sweep",
    "track": "analysis.track",
    "working_points": "analysis.working_points",
}

__all__ = [
    "Driver",
    "Law",
    "Motor",
    "ParameterError",
    "SimulationError",
    "Spectrum",
    "SpectrumError",
    "Thermal",
    "Tolerance",
    "Tracker",
    "TwoPhaseDrive",
    "TwoToneDrive",
    "admittance",
    "available_motors",
    "compare",
    "default_drive",
    "drive_report",
    "export_motor",
    "fit_spectrum",
    "fit_together",
    "fit_two_port",
    "load_motor",
    "motor_from",
    "read_spectrum",
    "report",
    "simulate",
    "simulate_averaged",
    "simulate_controlled",
    "small_signals",
    "speed_torque",
    "steady_branch",
    "steady_state",
    "sweep",
    "track",
    "working_points",
]


draw_with(lambda: import_module("pyspice_runner.view.plots"))


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return version("pyspice-runner")
    if name not in _HOMES:
        raise AttributeError(f"module 'pyspice_runner' has no attribute {name!r}")
    return getattr(import_module(f"pyspice_runner.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
