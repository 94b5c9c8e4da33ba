# SPDX-License-Identifier: GPL-3.0-or-later
# The public names and their modules: read by type checkers, and by lazy_loader when the package is imported.

from .averaged.simulate import simulate_averaged as simulate_averaged
from .calibration.estimate import calibrate as calibrate
from .calibration.motor_from import motor_from as motor_from
from .circuit.law import Law as Law
from .circuit.source import Waveform as Waveform
from .control.electronics import Electronics as Electronics
from .control.simulate import Sample as Sample
from .control.simulate import simulate_controlled as simulate_controlled
from .control.state_space import state_space as state_space
from .designs import control_loop as control_loop
from .designs import design as design
from .drivers.design import DriverSpec as DriverSpec
from .drivers.driver import Driver as Driver
from .drivers.report import drive_report as drive_report
from .errors import ParameterError as ParameterError
from .errors import SimulationError as SimulationError
from .errors import SpectrumError as SpectrumError
from .export.motor import export_motor as export_motor
from .impedance.admittance import admittance as admittance
from .impedance.compare import compare as compare
from .impedance.fit import fit_spectrum as fit_spectrum
from .impedance.readers import read_spectrum as read_spectrum
from .impedance.spectrum import Spectrum as Spectrum
from .motor.circuit_file import load_circuit as load_circuit
from .motor.drive import Load as Load
from .motor.drive import ShaftLoad as ShaftLoad
from .motor.drive import TwoPhaseDrive as TwoPhaseDrive
from .motor.drive import TwoToneDrive as TwoToneDrive
from .motor.drive import default_drive as default_drive
from .motor.load import available_motors as available_motors
from .motor.load import load_motor as load_motor
from .motor.motor import Motor as Motor
from .motor.thermal import Thermal as Thermal
from .operating_point import OperatingPoint as OperatingPoint
from .run.simulate import simulate as simulate
from .steady.branch import steady_branch as steady_branch
from .steady.small_signals import small_signals as small_signals
from .steady.speed_torque import speed_torque as speed_torque
from .steady.steady import steady_state as steady_state
from .steady.working_points import working_points as working_points
from .sweeps.plan import Tolerance as Tolerance
from .sweeps.sweep import sweep as sweep
from .trackers.track import track as track
from .trackers.tracker import Tracker as Tracker
from .view.datasheet import report as report

__version__: str
