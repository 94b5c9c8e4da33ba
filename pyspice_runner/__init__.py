# SPDX-License-Identifier: GPL-3.0-or-later
"""A SPICE model of a standing-wave piezomotor, run on ngspice.

    import pyspice_runner as pr

    motor = pr.load_motor("andersen2002")
    run = pr.simulate(motor, pr.TwoPhaseDrive(voltage=50.0, frequency=51.7e3, phase_deg=90.0), duration=5e-3)
    print(run.mean_rotor_speed_rad_s, run.state_fractions)

Names load on first use, so that the import itself is light.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pyspice_runner.analysis.admittance import Admittance, admittance
    from pyspice_runner.analysis.compare import Comparison, Trend, compare
    from pyspice_runner.analysis.drive import DriveReport, drive_report
    from pyspice_runner.analysis.export import export_circuit, export_motor
    from pyspice_runner.analysis.fit import FittedArm, SpectrumFit, fit_spectrum
    from pyspice_runner.analysis.hysteresis import Hysteresis, hysteresis
    from pyspice_runner.analysis.impact import Impact, impact
    from pyspice_runner.analysis.loop import LoopDesign, averaged_step, loop_design
    from pyspice_runner.analysis.matching import Matching, propose_matching
    from pyspice_runner.analysis.readers import read_spectrum
    from pyspice_runner.analysis.report import Report, report
    from pyspice_runner.analysis.simulate import simulate
    from pyspice_runner.analysis.spectrum import Spectrum
    from pyspice_runner.analysis.speed_torque import operating_point, speed_torque
    from pyspice_runner.analysis.sweep import Tolerance, sweep
    from pyspice_runner.analysis.track import Tracking, measured_loop_gain, running_resonance, track
    from pyspice_runner.analysis.twoport import TwoPortFit, fit_two_port
    from pyspice_runner.analysis.waveforms import Waveforms
    from pyspice_runner.errors import Interrupted, ParameterError, SimulationError, SpectrumError
    from pyspice_runner.files import save_by_ending, write_netcdf
    from pyspice_runner.model.beam import resonator_modes
    from pyspice_runner.model.circuit_file import circuit_toml, is_circuit_file, load_circuit
    from pyspice_runner.model.drive import TwoPhaseDrive, TwoToneDrive
    from pyspice_runner.model.equivalent import EquivalentCircuit, MotionalArm
    from pyspice_runner.model.impact import Throw
    from pyspice_runner.model.load import available_motors, load_motor
    from pyspice_runner.model.motor import Motor
    from pyspice_runner.model.save import motor_toml
    from pyspice_runner.model.thermal import Thermal
    from pyspice_runner.model.tracking import LoopFilter, StatorLag, propose_filter
    from pyspice_runner.model.traction import HertzPatch, microslip_loss, virgin_force
    from pyspice_runner.netlist.drivers import Driver
    from pyspice_runner.netlist.equivalent import circuit_library
    from pyspice_runner.netlist.motor import motor_library
    from pyspice_runner.netlist.trackers import Tracker
    from pyspice_runner.plots import (
        plot_drive,
        plot_mode_shapes,
        plot_motors,
        plot_speed_torque,
        plot_sweep,
        plot_tracking,
    )

__version__ = "0.1.0"

_HOMES = {
    "Admittance": "analysis.admittance",
    "Comparison": "analysis.compare",
    "DriveReport": "analysis.drive",
    "Driver": "netlist.drivers",
    "EquivalentCircuit": "model.equivalent",
    "FittedArm": "analysis.fit",
    "HertzPatch": "model.traction",
    "Hysteresis": "analysis.hysteresis",
    "Impact": "analysis.impact",
    "LoopDesign": "analysis.loop",
    "LoopFilter": "model.tracking",
    "Interrupted": "errors",
    "Matching": "analysis.matching",
    "MotionalArm": "model.equivalent",
    "Motor": "model.motor",
    "ParameterError": "errors",
    "Report": "analysis.report",
    "SimulationError": "errors",
    "Spectrum": "analysis.spectrum",
    "SpectrumError": "errors",
    "SpectrumFit": "analysis.fit",
    "StatorLag": "model.tracking",
    "Thermal": "model.thermal",
    "Throw": "model.impact",
    "Tolerance": "analysis.sweep",
    "Tracker": "netlist.trackers",
    "Tracking": "analysis.track",
    "Trend": "analysis.compare",
    "TwoPhaseDrive": "model.drive",
    "TwoPortFit": "analysis.twoport",
    "TwoToneDrive": "model.drive",
    "Waveforms": "analysis.waveforms",
    "admittance": "analysis.admittance",
    "available_motors": "model.load",
    "averaged_step": "analysis.loop",
    "circuit_library": "netlist.equivalent",
    "circuit_toml": "model.circuit_file",
    "compare": "analysis.compare",
    "drive_report": "analysis.drive",
    "export_circuit": "analysis.export",
    "export_motor": "analysis.export",
    "fit_spectrum": "analysis.fit",
    "fit_two_port": "analysis.twoport",
    "hysteresis": "analysis.hysteresis",
    "impact": "analysis.impact",
    "is_circuit_file": "model.circuit_file",
    "load_circuit": "model.circuit_file",
    "load_motor": "model.load",
    "loop_design": "analysis.loop",
    "measured_loop_gain": "analysis.track",
    "microslip_loss": "model.traction",
    "motor_library": "netlist.motor",
    "motor_toml": "model.save",
    "operating_point": "analysis.speed_torque",
    "plot_drive": "plots",
    "plot_mode_shapes": "plots",
    "plot_motors": "plots",
    "plot_speed_torque": "plots",
    "plot_sweep": "plots",
    "plot_tracking": "plots",
    "propose_filter": "model.tracking",
    "propose_matching": "analysis.matching",
    "read_spectrum": "analysis.readers",
    "report": "analysis.report",
    "resonator_modes": "model.beam",
    "running_resonance": "analysis.track",
    "save_by_ending": "files",
    "simulate": "analysis.simulate",
    "speed_torque": "analysis.speed_torque",
    "sweep": "analysis.sweep",
    "track": "analysis.track",
    "virgin_force": "model.traction",
    "write_netcdf": "files",
}

__all__ = [
    "Admittance",
    "Comparison",
    "DriveReport",
    "Driver",
    "EquivalentCircuit",
    "FittedArm",
    "HertzPatch",
    "Hysteresis",
    "Impact",
    "Interrupted",
    "LoopDesign",
    "LoopFilter",
    "Matching",
    "MotionalArm",
    "Motor",
    "ParameterError",
    "Report",
    "SimulationError",
    "Spectrum",
    "SpectrumError",
    "SpectrumFit",
    "StatorLag",
    "Thermal",
    "Throw",
    "Tolerance",
    "Tracker",
    "Tracking",
    "Trend",
    "TwoPhaseDrive",
    "TwoPortFit",
    "TwoToneDrive",
    "Waveforms",
    "admittance",
    "available_motors",
    "averaged_step",
    "circuit_library",
    "circuit_toml",
    "compare",
    "drive_report",
    "export_circuit",
    "export_motor",
    "fit_spectrum",
    "fit_two_port",
    "hysteresis",
    "impact",
    "is_circuit_file",
    "load_circuit",
    "load_motor",
    "loop_design",
    "measured_loop_gain",
    "microslip_loss",
    "motor_library",
    "motor_toml",
    "operating_point",
    "plot_drive",
    "plot_mode_shapes",
    "plot_motors",
    "plot_speed_torque",
    "plot_sweep",
    "plot_tracking",
    "propose_filter",
    "propose_matching",
    "read_spectrum",
    "report",
    "resonator_modes",
    "running_resonance",
    "save_by_ending",
    "simulate",
    "speed_torque",
    "sweep",
    "track",
    "virgin_force",
    "write_netcdf",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'pyspice_runner' has no attribute {name!r}")
    return getattr(import_module(f"pyspice_runner.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
