# SPDX-License-Identifier: GPL-3.0-or-later
"""A SPICE model of a standing-wave piezomotor, run on ngspice.

    import pyspice_runner as pr

    motor = pr.load_motor("andersen2002")
    run = pr.simulate(motor, pr.TwoPhaseDrive(voltage=50.0, frequency=51.7e3, phase_deg=90.0), duration=5e-3)
    print(run.mean_rotor_speed_rad_s, run.state_fractions)

Results and datasets have ``save``, ``plot``, ``to_dataframe`` and ``cautions``
(:class:`pyspice_runner.result.Result`). A name loads its module on first use, so the import is light.
"""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from pyspice_runner.display import draw_with

if TYPE_CHECKING:
    __version__: str

    from pyspice_runner.analysis.averaged import simulate_averaged as simulate_averaged
    from pyspice_runner.analysis.branch import steady_branch as steady_branch
    from pyspice_runner.analysis.controlled import Sample as Sample
    from pyspice_runner.analysis.controlled import simulate_controlled as simulate_controlled
    from pyspice_runner.analysis.drive import drive_report as drive_report
    from pyspice_runner.analysis.impact import Throw as Throw
    from pyspice_runner.analysis.impact import impact as impact
    from pyspice_runner.analysis.loop import loop_design as loop_design
    from pyspice_runner.analysis.matching import propose_matching as propose_matching
    from pyspice_runner.analysis.motor_from import motor_from as motor_from
    from pyspice_runner.analysis.simulate import simulate as simulate
    from pyspice_runner.analysis.small_signals import small_signals as small_signals
    from pyspice_runner.analysis.speed_torque import operating_point as operating_point
    from pyspice_runner.analysis.speed_torque import speed_torque as speed_torque
    from pyspice_runner.analysis.steady import steady_state as steady_state
    from pyspice_runner.analysis.track import measured_loop_gain as measured_loop_gain
    from pyspice_runner.analysis.track import running_resonance as running_resonance
    from pyspice_runner.analysis.track import track as track
    from pyspice_runner.analysis.working_points import working_points as working_points
    from pyspice_runner.errors import ParameterError as ParameterError
    from pyspice_runner.errors import SimulationError as SimulationError
    from pyspice_runner.errors import SpectrumError as SpectrumError
    from pyspice_runner.export.motor import export_motor as export_motor
    from pyspice_runner.model.beam import resonator_modes as resonator_modes
    from pyspice_runner.model.circuit_file import load_circuit as load_circuit
    from pyspice_runner.model.drive import TwoPhaseDrive as TwoPhaseDrive
    from pyspice_runner.model.drive import TwoToneDrive as TwoToneDrive
    from pyspice_runner.model.drive import default_drive as default_drive
    from pyspice_runner.model.load import available_motors as available_motors
    from pyspice_runner.model.load import load_motor as load_motor
    from pyspice_runner.model.motor import Motor as Motor
    from pyspice_runner.model.thermal import Thermal as Thermal
    from pyspice_runner.model.tracking import propose_filter as propose_filter
    from pyspice_runner.netlist.contact import Law as Law
    from pyspice_runner.netlist.drivers import Driver as Driver
    from pyspice_runner.netlist.trackers import Tracker as Tracker
    from pyspice_runner.netlist.waveforms import Burst as Burst
    from pyspice_runner.netlist.waveforms import Waveform as Waveform
    from pyspice_runner.spectra.admittance import admittance as admittance
    from pyspice_runner.spectra.compare import compare as compare
    from pyspice_runner.spectra.fit import fit_spectrum as fit_spectrum
    from pyspice_runner.spectra.readers import read_spectrum as read_spectrum
    from pyspice_runner.spectra.spectrum import Spectrum as Spectrum
    from pyspice_runner.spectra.together import fit_together as fit_together
    from pyspice_runner.spectra.twoport import fit_two_port as fit_two_port
    from pyspice_runner.study.plan import Tolerance as Tolerance
    from pyspice_runner.study.sweep import sweep as sweep
    from pyspice_runner.view.report import report as report

_HOMES = {
    "Burst": "netlist.waveforms",
    "Driver": "netlist.drivers",
    "Law": "netlist.contact",
    "Motor": "model.motor",
    "ParameterError": "errors",
    "Sample": "analysis.controlled",
    "SimulationError": "errors",
    "Spectrum": "spectra.spectrum",
    "SpectrumError": "errors",
    "Thermal": "model.thermal",
    "Throw": "analysis.impact",
    "Tolerance": "study.plan",
    "Tracker": "netlist.trackers",
    "TwoPhaseDrive": "model.drive",
    "TwoToneDrive": "model.drive",
    "Waveform": "netlist.waveforms",
    "admittance": "spectra.admittance",
    "available_motors": "model.load",
    "compare": "spectra.compare",
    "default_drive": "model.drive",
    "drive_report": "analysis.drive",
    "export_motor": "export.motor",
    "fit_spectrum": "spectra.fit",
    "fit_together": "spectra.together",
    "fit_two_port": "spectra.twoport",
    "impact": "analysis.impact",
    "load_circuit": "model.circuit_file",
    "load_motor": "model.load",
    "loop_design": "analysis.loop",
    "measured_loop_gain": "analysis.track",
    "motor_from": "analysis.motor_from",
    "operating_point": "analysis.speed_torque",
    "propose_filter": "model.tracking",
    "propose_matching": "analysis.matching",
    "read_spectrum": "spectra.readers",
    "report": "view.report",
    "resonator_modes": "model.beam",
    "running_resonance": "analysis.track",
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

__all__ = list(_HOMES)

draw_with(lambda: import_module("pyspice_runner.view.plots"))


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return version("pyspice-runner")
    if name not in _HOMES:
        raise AttributeError(f"module 'pyspice_runner' has no attribute {name!r}")
    return getattr(import_module(f"pyspice_runner.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
