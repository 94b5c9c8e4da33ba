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

_NAMES = {
    "analysis.averaged": ("simulate_averaged",),
    "analysis.branch": ("steady_branch",),
    "analysis.controlled": ("Sample", "simulate_controlled"),
    "analysis.drive": ("drive_report",),
    "analysis.impact": ("Throw", "impact"),
    "analysis.loop": ("loop_design",),
    "analysis.matching": ("propose_matching",),
    "analysis.motor_from": ("motor_from",),
    "analysis.simulate": ("simulate",),
    "analysis.small_signals": ("small_signals",),
    "analysis.speed_torque": ("operating_point", "speed_torque"),
    "analysis.steady": ("steady_state",),
    "analysis.track": ("measured_loop_gain", "running_resonance", "track"),
    "analysis.working_points": ("working_points",),
    "errors": ("ParameterError", "SimulationError", "SpectrumError"),
    "export.motor": ("export_motor",),
    "model.beam": ("resonator_modes",),
    "model.circuit_file": ("load_circuit",),
    "model.drive": ("TwoPhaseDrive", "TwoToneDrive", "default_drive"),
    "model.load": ("available_motors", "load_motor"),
    "model.motor": ("Motor",),
    "model.thermal": ("Thermal",),
    "model.tracking": ("propose_filter",),
    "netlist.contact": ("Law",),
    "netlist.drivers": ("Driver",),
    "netlist.trackers": ("Tracker",),
    "netlist.waveforms": ("Burst", "Waveform"),
    "spectra.admittance": ("admittance",),
    "spectra.compare": ("compare",),
    "spectra.fit": ("fit_spectrum",),
    "spectra.readers": ("read_spectrum",),
    "spectra.spectrum": ("Spectrum",),
    "spectra.together": ("fit_together",),
    "spectra.twoport": ("fit_two_port",),
    "study.plan": ("Tolerance",),
    "study.sweep": ("sweep",),
    "view.report": ("report",),
}
_HOMES = {name: home for home, names in _NAMES.items() for name in names}

__all__ = sorted(_HOMES)

draw_with(lambda: import_module("pyspice_runner.view.plots"))


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return version("pyspice-runner")
    if name not in _HOMES:
        raise AttributeError(f"module 'pyspice_runner' has no attribute {name!r}")
    return getattr(import_module(f"pyspice_runner.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
