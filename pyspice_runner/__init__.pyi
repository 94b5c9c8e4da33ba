# SPDX-License-Identifier: GPL-3.0-or-later
# The public names and their modules: read by type checkers, and by lazy_loader when the package is imported.

from .analysis.averaged import simulate_averaged as simulate_averaged
from .analysis.branch import steady_branch as steady_branch
from .analysis.burst import fast_burst as fast_burst
from .analysis.control_loop import control_loop as control_loop
from .analysis.controlled import Sample as Sample
from .analysis.controlled import simulate_controlled as simulate_controlled
from .analysis.drive import drive_report as drive_report
from .analysis.impact import Throw as Throw
from .analysis.impact import impact as impact
from .analysis.loop import loop_design as loop_design
from .analysis.matching import propose_matching as propose_matching
from .analysis.motor_from import motor_from as motor_from
from .analysis.simulate import simulate as simulate
from .analysis.small_signals import small_signals as small_signals
from .analysis.speed_torque import operating_point as operating_point
from .analysis.speed_torque import speed_torque as speed_torque
from .analysis.state_space import state_space as state_space
from .analysis.steady import steady_state as steady_state
from .analysis.track import (
    measured_loop_gain as measured_loop_gain,
)
from .analysis.track import (
    running_resonance as running_resonance,
)
from .analysis.track import (
    track as track,
)
from .analysis.working_points import working_points as working_points
from .errors import ParameterError as ParameterError
from .errors import SimulationError as SimulationError
from .errors import SpectrumError as SpectrumError
from .export.motor import export_motor as export_motor
from .model.beam import resonator_modes as resonator_modes
from .model.circuit_file import load_circuit as load_circuit
from .model.drive import TwoPhaseDrive as TwoPhaseDrive
from .model.drive import TwoToneDrive as TwoToneDrive
from .model.drive import default_drive as default_drive
from .model.electronics import Electronics as Electronics
from .model.load import available_motors as available_motors
from .model.load import load_motor as load_motor
from .model.motor import Motor as Motor
from .model.shaft import ShaftLoad as ShaftLoad
from .model.thermal import Thermal as Thermal
from .model.tracking import propose_filter as propose_filter
from .netlist.contact import Law as Law
from .netlist.drivers import Driver as Driver
from .netlist.trackers import Tracker as Tracker
from .netlist.waveforms import Burst as Burst
from .netlist.waveforms import Waveform as Waveform
from .spectra.admittance import admittance as admittance
from .spectra.compare import compare as compare
from .spectra.fit import fit_spectrum as fit_spectrum
from .spectra.readers import read_spectrum as read_spectrum
from .spectra.scope import read_recording as read_recording
from .spectra.spectrum import Spectrum as Spectrum
from .spectra.together import fit_together as fit_together
from .spectra.twoport import fit_two_port as fit_two_port
from .study.calibration.elliptec import read_current_scan as read_current_scan
from .study.calibration.estimate import calibrate as calibrate
from .study.plan import Tolerance as Tolerance
from .study.sweep import sweep as sweep
from .view.report import report as report

__version__: str
