# SPDX-License-Identifier: GPL-3.0-or-later
"""The averaged motor against the full one: settled torque, spin-up, currents and power."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.averaged.library import OPTIONS
from pyspice_runner.averaged.run import AveragedRun, ErrorEstimate, short_bursts
from pyspice_runner.averaged.simulate import simulate_averaged
from pyspice_runner.steady.speed_torque import held_point
from tests.circuit.batch import measured
from tests.motors import BEAM40, recommended
from tests.runs import simulated, unestimated
from tests.selection import mostly

FAST = pr.TwoPhaseDrive(voltage=300.0, frequency=54e3, phase_deg=90.0)


@pytest.fixture(scope="module")
def spin_up(motor: pr.Motor) -> AveragedRun:
    return simulate_averaged(motor, FAST, 4e-3)


@pytest.mark.xdist_group("averaged")
def test_spin_up_is_that_of_the_full_motor(motor: pr.Motor, spin_up: AveragedRun) -> None:
    """3 % of the speed reached, RMS; the speed of the full motor is averaged over each period."""
    full = simulated(motor, FAST, duration=4e-3)
    edges = np.arange(0.0, 4e-3, FAST.period)
    angle = np.concatenate(([0.0], np.cumsum(np.diff(full.time_s) * full.rotor_speed_rad_s[1:])))
    mean = np.diff(np.interp(edges, full.time_s, angle)) / FAST.period
    ours = np.interp(0.5 * (edges[1:] + edges[:-1]), spin_up.time_s, spin_up.rotor_speed_rad_s)
    assert np.sqrt(np.mean((ours - mean) ** 2)) <= 0.03 * mean[-1]
    assert spin_up.trusted


@pytest.mark.xdist_group("averaged")
def test_current_and_power_are_those_of_the_full_motor(motor: pr.Motor) -> None:
    """Held at 4 rad/s until all has settled; 0.5 % for the harmonics of the current and the step of the full run."""
    run = simulate_averaged(motor, FAST, 20e-3, speed=4.0)
    point = held_point(motor, FAST, speed=4.0)
    for group in "ab":
        rms = getattr(run, f"current_amplitude_{group}_a")[-1] / np.sqrt(2.0)
        assert rms == pytest.approx(point[f"current_{group}_rms_a"], rel=5e-3)
    limit = motor.contact.friction * motor.contact.preload_n * motor.rotor.radius_m
    assert run.torque_n_m[-1] == pytest.approx(point["torque_n_m"], abs=0.01 * limit)
    assert run.electrical_power_w[-1] == pytest.approx(point["power_a_w"] + point["power_b_w"], rel=0.02)


EQUAL = (
    "rotor_speed_rad_s", "torque_n_m", "normal_force_n", "current_amplitude_a_a", "current_amplitude_b_a", "heat_w",
    "electrical_power_w", "contact_power_w", "tip_x_amplitude_m", "tip_y_amplitude_m", "temperature_k", "check",
)  # fmt: skip


@pytest.mark.parametrize("name", mostly(pytest.mark.soak, [BEAM40, "bimodal40"], ["bimodal40"]))
def test_the_compiled_motor_settles_where_ngspice_does(name: str) -> None:
    """A thousandth of the greatest value; both errors are those of ngspice's steps, which are 2 ms long there.

    The contact of bimodal40 opens, has a compliance in series and damping; its temperature rises.
    """
    turning = pr.load_motor(name)
    drive = pr.default_drive(turning).model_copy(update={"voltage": 80.0})
    thermal = pr.Thermal.of(turning).model_copy(
        update={"heat_capacity_j_per_k": 2e-3, "thermal_resistance_k_per_w": 10.0}
    )
    runs = [
        simulate_averaged(turning, drive, 0.2, load_torque=1e-4, thermal=thermal, engine=engine)
        for engine in ("compiled", "spice")
    ]
    compiled, spice = runs
    assert [run.provenance["run"]["engine"] for run in runs] == ["compiled", "spice"]
    assert compiled.temperature_k[-1] > 1.0
    for quantity in EQUAL:
        values = getattr(spice, quantity)
        end = getattr(compiled, quantity)[-1]
        assert end == pytest.approx(values[-1], abs=1e-3 * np.abs(values).max()), quantity
    assert compiled.energy_residual < 1e-3


@pytest.mark.soak
def test_the_compiled_motor_spins_up_as_ngspice_does_with_short_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """0.1 % of the greatest speed at all times; ngspice with a tenth of its usual tolerances."""
    monkeypatch.setitem(OPTIONS, "trtol", "5")
    monkeypatch.setitem(OPTIONS, "reltol", "1e-4")
    turning = pr.load_motor(BEAM40)
    drive = pr.default_drive(turning).model_copy(update={"voltage": 69.0})
    courses = {"voltage": [(0.0, 69.0), (0.01, 69.0), (0.012, 80.0)], "load_torque": [(0.015, 0.0), (0.0151, 5e-4)]}
    compiled, spice = (
        simulate_averaged(turning, drive, 0.02, courses=courses, engine=engine) for engine in ("compiled", "spice")
    )
    at = np.linspace(0.5e-3, 0.02, 400)
    ours, theirs = (np.interp(at, run.time_s, run.rotor_speed_rad_s) for run in (compiled, spice))
    assert np.abs(ours - theirs).max() <= 1e-3 * theirs.max()


@pytest.mark.parametrize(
    ("name", "voltage", "frequency"),
    mostly(pytest.mark.soak, [(BEAM40, 30.0, 40.1e3), ("andersen2002", 150.0, 54e3)], [(BEAM40, 30.0, 40.1e3)]),
)
def test_ngspice_turns_the_rotor_as_the_compiled_motor_does(
    name: str, voltage: float, frequency: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The angle after 20 ms, within 0.1 % (0.03 % for these steps of ngspice); in the dead band it is 0.2 urad.

    There a slider that did not follow the tip from period to period would turn the rotor by ten times as much.
    """
    monkeypatch.setitem(OPTIONS, "trtol", "20")
    turning = pr.load_motor(name)
    drive = pr.default_drive(turning).model_copy(update={"voltage": voltage, "frequency": frequency})
    compiled, spice = (
        float(simulate_averaged(turning, drive, 0.02, engine=engine).rotor_position_rad[-1])
        for engine in ("compiled", "spice")
    )
    assert spice == pytest.approx(compiled, rel=1e-3)
    assert (abs(compiled) < 0.5e-6) == (name == BEAM40)


@pytest.mark.soak
def test_without_a_compiler_ngspice_runs_the_motor(motor: pr.Motor, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pyspice_runner.spice.compiler.COMPILERS", ("no-compiler",))
    run = simulate_averaged(motor, FAST, 1e-3)
    assert run.to_dict()["run"]["engine"] == "spice"
    assert run.ngspice_version
    with pytest.raises(pr.SimulationError, match=r"No C compiler was found on the PATH \(no-compiler\)"):
        simulate_averaged(motor, FAST, 1e-3, engine="compiled")


def test_power_balances_and_the_shaft_turns_by_the_integral_of_its_speed(spin_up: AveragedRun) -> None:
    """The steps are the engine's own; the trapezoidal sum over them is right to a part in a hundred."""
    assert spin_up.energy_residual < 0.01
    friction = spin_up.contact_power_w[-1] - spin_up.torque_n_m[-1] * spin_up.rotor_speed_rad_s[-1]
    assert friction > 0.0
    angle = np.trapezoid(spin_up.rotor_speed_rad_s, spin_up.time_s)
    assert spin_up.rotor_position_rad[-1] == pytest.approx(angle, rel=0.01)


def test_a_rotor_that_bursts_is_not_trusted(motor: pr.Motor) -> None:
    run = simulate_averaged(motor, FAST, 2e-3, load_torque=100.0)
    assert run.rotor_speed_rad_s[-1] < -1e5  # 1 km/s at the rim
    assert not run.trusted
    assert any("the limit is 1e+05 rad/s" in caution for caution in run.cautions)
    run = simulate_averaged(motor, FAST, 5e-4, load_torque=100.0)
    assert run.rotor_speed_rad_s[-1] == pytest.approx(-100.0 * 5e-4 / motor.rotor.inertia_kg_m2, rel=0.01)
    assert not any("The rotor turns" in caution for caution in run.cautions)


def test_the_load_torque_is_that_of_the_course_or_of_the_holding_shaft(motor: pr.Motor) -> None:
    run = simulate_averaged(motor, FAST, 2e-3, load_torque=1e-3)
    assert run.load_torque_n_m == pytest.approx(1e-3)
    run = simulate_averaged(motor, FAST, 2e-3, courses={"load_torque": [(5e-4, 0.0), (1e-3, 2e-3)]})
    assert run.load_torque_n_m == pytest.approx(np.interp(run.time_s, [5e-4, 1e-3], [0.0, 2e-3]))
    # J dω/dt = torque − load − damping ω, integrated over all but the first periods, in which a step is a period long
    rotor, late = motor.rotor, run.time_s > 3e-4
    left = run.torque_n_m - run.load_torque_n_m - rotor.bearing_damping_n_m_s * run.rotor_speed_rad_s
    gained = rotor.inertia_kg_m2 * np.ptp(run.rotor_speed_rad_s[late][[0, -1]])
    assert run.rotor_speed_rad_s[-1] < run.rotor_speed_rad_s[late][0]
    assert np.trapezoid(left[late], run.time_s[late]) == pytest.approx(-gained, rel=0.02)  # the engine's own steps
    run = simulate_averaged(motor, FAST, 2e-3, speed=4.0)
    assert run.load_torque_n_m == pytest.approx(run.torque_n_m - 4.0 * rotor.bearing_damping_n_m_s)


def test_heat_raises_the_temperature_by_the_closed_form(motor: pr.Motor) -> None:
    """Constant losses on a shaft that is held: P R (1 − exp(−t/RC)) while the drift is small."""
    thermal = pr.Thermal(
        frequency_drift_per_k=0.0, coupling_drift_per_k=0.0, capacitance_drift_per_k=0.0, heat_capacity_j_per_k=1e-3,
        thermal_resistance_k_per_w=100.0,
    )  # fmt: skip
    run = simulate_averaged(motor, FAST, 0.3, speed=0.0, thermal=thermal)
    expected = run.heat_w[-1] * 100.0 * (1.0 - np.exp(-0.3 / 0.1))
    assert run.temperature_k[-1] == pytest.approx(expected, rel=0.02)  # the modes take 2 ms to swing up


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"contact": "brush"}, "contact = 'brush' has no averaged model"),
        ({"duration": 1e-6}, "duration = 1e-06 s is out of range"),
        ({"phases": 3}, "phases = 3 is out of range"),
        ({"courses": {"colour": [(0.0, 1.0)]}}, "'colour' is not known"),
        ({"courses": {"frequency": [(0.0, -1.0)]}}, "frequency = -1 Hz is out of range"),
        ({"courses": {"voltage": [(1.0, 1.0), (0.0, 2.0)]}}, "rising times"),
        ({"courses": {"voltage": "loud"}}, "rows of time"),
        ({"courses": {"load_torque": [(0.0, 1.0)]}, "speed": 1.0}, "load_torque has no effect"),
    ],
)
def test_malformed_input_is_an_error(motor: pr.Motor, changes: dict[str, object], message: str) -> None:
    arguments = {"duration": 1e-3} | changes
    with pytest.raises(pr.ParameterError, match=message):
        simulate_averaged(motor, FAST, **arguments)  # type: ignore[arg-type]
    tones = pr.TwoToneDrive(voltage_1=50.0, frequency_1=13.5e3, voltage_2=50.0, frequency_2=27e3)
    with pytest.raises(pr.ParameterError, match="use simulate"):
        simulate_averaged(motor, tones, 1e-3)
    with pytest.raises(pr.ParameterError, match="worn_flat_radius_m = 1e-05 has no averaged model"):
        simulate_averaged(motor.updated({"contact.worn_flat_radius_m": 1e-5}), FAST, 1e-3)


def test_exported_library_runs_by_its_own_example(motor: pr.Motor, tmp_path: Path) -> None:
    """The settled speed of the example is that of the package's run of the same drive."""
    pr.export_motor(motor, tmp_path / "motor.lib", averaged=True, name="slow")
    text = (tmp_path / "motor.lib").read_text()
    example = re.search(r"^\* USE.*?\n(.*?)^\* END USE", text, re.M | re.S)
    deck = re.sub(r"^\* +", "", example.group(1), flags=re.M)
    (tmp_path / "run").mkdir()
    found = measured(f"example\n{text}\n{deck}.end\n", tmp_path / "run")
    frequency = float(re.search(r"Vf frequency 0 (\S+)", deck)[1])  # type: ignore[index]
    drive = pr.TwoPhaseDrive(voltage=50.0, frequency=frequency, phase_deg=90.0)
    run = simulate_averaged(motor, drive, 0.1)
    assert found["speed_rad_s"] == pytest.approx(run.rotor_speed_rad_s[-1], rel=1e-3)


def test_parameters_of_the_x_line_are_those_of_the_motor(motor: pr.Motor, tmp_path: Path) -> None:
    pr.export_motor(motor, tmp_path / "motor.lib", averaged=True)
    deck = (
        f"preload on the X line\n.include {tmp_path / 'motor.lib'}\nVa a 0 300\nVb b 0 300\nVf f 0 54k\nVs shaft 0 0\n"
        "Xm a 0 0 b f shaft 0 heat piezomotor_averaged preload=7 friction=0.25\n.options method=gear trtol=50\n"
        ".tran 20u 30m 0 1m uic\n.measure tran normal_n FIND v(xm.normal) AT=30m\n"
        ".measure tran friction_n FIND v(xm.friction) AT=30m\n.end\n"
    )
    (tmp_path / "run").mkdir()
    found = measured(deck, tmp_path / "run")
    changed = motor.updated({"contact.preload_n": 7.0, "contact.friction": 0.25})
    run = simulate_averaged(changed, FAST, 30e-3, speed=0.0)
    assert found["normal_n"] == pytest.approx(run.normal_force_n[-1], rel=1e-4)
    torque = found["friction_n"] * motor.rotor.radius_m
    assert torque == pytest.approx(run.torque_n_m[-1], abs=1e-4 * 0.25 * 7.0 * motor.rotor.radius_m)


@pytest.mark.parametrize(("cycles", "trusted"), mostly(pytest.mark.soak, [(20, False), (80, True)], [(20, False)]))
def test_a_burst_of_few_periods_is_not_trusted(cycles: int, trusted: bool) -> None:
    """At 70 V the averaged motor turns by 36 % too far in 20 periods, by 0.8 % in 80."""
    motor = pr.load_motor(BEAM40)
    drive = pr.default_drive(motor).model_copy(update={"voltage": 70.0})
    length = cycles / drive.frequency
    end = length + 1.4e-3  # s, until the rotor stands
    time = np.linspace(0.0, length, 200 * cycles + 1)
    volts = [np.where(time < length, tone.amplitude * np.sin(2.0 * np.pi * drive.frequency * time + tone.phase), 0.0)
             for tone in (*drive.tones_a, *drive.tones_b)]  # fmt: skip
    shape = pr.Waveform(time, volts[0], volts[1], frequency=drive.frequency)
    full = pr.simulate(motor, shape, duration=end, signals=["rotor_speed_rad_s"])
    turned = float(np.trapezoid(full.rotor_speed_rad_s, full.time_s))
    course = {"voltage": [(0.0, 70.0), (length, 70.0), (length + 1e-7, 0.0)]}
    run = unestimated(simulate_averaged(motor, drive, end, courses=course))
    assert (abs(run.rotor_position_rad[-1] / turned - 1.0) < 0.02) == trusted
    assert trusted or not run.trusted
    assert any(f"on for {cycles} periods only" in caution for caution in run.cautions) != trusted


def test_a_run_that_starts_in_motion_and_stops_has_no_short_burst() -> None:
    time = 1e-3 * np.arange(1.0, 7.0)
    volts = np.array([69.0, 0.0, 0.0, 69.0, 0.0, 0.0])
    assert "on for 40 periods only, from 0.004 s on" in short_bursts(time, volts, 40e3, running=True)[0]
    assert short_bursts(time[:3], volts[:3], 40e3, running=True) == ()
    assert short_bursts(time[:4], volts[:4], 40e3, running=True) == ()  # the last one has not ended


LOW_SPEED: dict[str, dict[str, float]] = {
    "dry bearing": {"rotor.bearing_friction_n_m": 1e-3},
    "falling friction": {"contact.sliding_ratio": 0.7, "contact.stribeck_velocity_m_s": 0.05},
}


@pytest.mark.soak
@pytest.mark.parametrize("name", LOW_SPEED)
def test_friction_of_the_bearing_and_friction_that_falls_are_those_of_the_full_motor(name: str) -> None:
    """At 69 V the contact stays closed; both change the speed by far more than the error of the averaged motor."""
    plain = pr.load_motor(BEAM40)
    drive = pr.default_drive(plain).model_copy(update={"voltage": 69.0})
    lossy = plain.updated(LOW_SPEED[name])
    full = pr.simulate(lossy, drive, duration=6e-3, signals=["rotor_speed_rad_s"])
    reference = full.rotor_speed_rad_s[-1]
    for engine in ("compiled", "spice"):
        run = simulate_averaged(lossy, drive, 6e-3, engine=engine)
        assert run.rotor_speed_rad_s[-1] == pytest.approx(reference, rel=0.02)  # 1 % as without these losses
    without = simulate_averaged(plain, drive, 6e-3)
    assert abs(without.rotor_speed_rad_s[-1] / reference - 1.0) > 0.1


def test_a_preload_that_presses_the_tip_too_deep_is_an_error() -> None:
    """A phase of the averaged contact stops at 1 mm, where the normal force would be that of a smaller preload."""
    motor = pr.load_motor(BEAM40)
    softer = (motor.contact.normal_stiffness_n_per_m15 / 4e5) ** (2.0 / 3.0)
    names = [f"tangential_compliance_{body}_m_per_n23" for body in ("tip", "rotor")]
    compliances = {f"contact.{name}": softer * getattr(motor.contact, name) for name in names}
    soft = motor.updated({"contact.normal_stiffness_n_per_m15": 4e5, **compliances})
    with pytest.raises(pr.ParameterError, match=r"presses the tip 0\.642 mm into the rotor; .* takes up to 0\.5 mm"):
        pr.simulate_averaged(soft, pr.default_drive(soft), 1e-3)


UNINTENDED, SERIES = "andersen2002-unintended-mode", "contact.series_compliance_m_per_n"
SOFT = {SERIES: 1e-8, "contact.restitution": 0.6}
PLATE = str(Path(__file__).parents[2] / "examples" / "plate40.toml")


@pytest.mark.parametrize(
    ("name", "changes", "drive", "speeds"),
    [
        (PLATE, {}, (40.0, 41.5e3, -90.0), (-0.03,)),
        pytest.param(PLATE, {}, (40.0, 41.5e3, -90.0), (0.0,), marks=pytest.mark.soak),
        pytest.param(PLATE, {}, (20.0, 41.5e3, 70.0), (0.02, 0.005), marks=pytest.mark.soak),
        pytest.param(UNINTENDED, {SERIES: 2e-8}, (50.0, 48e3, 180.0), (0.0, 2.0, 5.0), marks=pytest.mark.soak),
        pytest.param(BEAM40, SOFT, (60.0, 40.1e3, 120.0), (10.0, 20.0), marks=pytest.mark.soak),
    ],
)
def test_a_compliance_in_series_has_the_torque_of_the_full_motor(
    name: str, changes: dict[str, float], drive: tuple[float, float, float], speeds: tuple[float, ...]
) -> None:
    """2 % of the friction torque, the error below which a run is trusted. The plate's light carrier moves at 40 kHz."""
    motor = pr.load_motor(name).updated(changes)
    assert motor.contact.series_compliance_m_per_n > 0.0
    voltage, frequency, phase = drive
    both = pr.TwoPhaseDrive(voltage=voltage, frequency=frequency, phase_deg=phase)
    limit = motor.contact.friction * motor.contact.preload_n * motor.rotor.radius_m
    for speed in speeds:
        run = simulate_averaged(motor, both, 0.06, speed=speed)
        full = pr.steady_state(motor, both, speed=speed)
        assert run.trusted
        assert run.torque_n_m[-1] == pytest.approx(full.torque_n_m, abs=0.02 * limit)


def test_a_compression_that_remembers_the_force_for_many_periods_begins_at_that_of_rest() -> None:
    """With a soft part in series and much damping the factor of the force decays slowly, here over 100 periods.

    It began at a force of 0, so that the motor had no torque.
    """
    motor = pr.load_motor(UNINTENDED).updated({SERIES: 5e-6, "contact.restitution": 0.15, "mount": None})
    drive = pr.TwoPhaseDrive(voltage=20.0, frequency=48e3, phase_deg=180.0)
    run, full = simulate_averaged(motor, drive, 0.03, speed=2.0), pr.steady_state(motor, drive, speed=2.0)
    limit = motor.contact.friction * motor.contact.preload_n * motor.rotor.radius_m
    assert run.trusted
    assert run.torque_n_m[-1] == pytest.approx(full.torque_n_m, abs=0.02 * limit)
    assert run.normal_force_n[-1] == pytest.approx(motor.contact.preload_n, rel=1e-3)


def test_the_error_against_the_full_motor_is_not_a_matter_of_an_open_contact() -> None:
    """Both contacts open; after a reversal the speed of the plate is 2 % of its maximum off, the flagship's 0.1 %."""
    for name, voltage, close in (("bimodal40", 150.0, True), (PLATE, 100.0, False)):
        motor = pr.load_motor(name)
        drive = pr.default_drive(motor).model_copy(update={"voltage": voltage})
        turned = [(0.0, drive.phase_deg), (10e-3, drive.phase_deg), (10.001e-3, drive.phase_deg - 180.0)]
        run = simulate_averaged(motor, drive, 20e-3, courses={"phase_deg": turned})
        assert run.separated.max() > 0.1
        assert run.trusted == close
        assert not run.error_estimate.unknown
        force, speed = ("torque_n_m", "rotor_speed_rad_s") if close else ("force_n", "speed_m_s")
        assert {force, speed} < set(run.error_estimate.shares)
        assert run.to_dict()["error_estimate"]["shares"][speed] == run.error_estimate.shares[speed]
        assert run.summary()["trusted"] == ("yes" if close else "no")
        assert any("above 2 %: force" in caution for caution in run.cautions) != close


def test_the_error_of_a_motor_that_swings_on_its_contact_is_unknown() -> None:
    """At 10 V the contact of the flagship sticks."""
    motor = pr.load_motor("bimodal40")
    run = simulate_averaged(motor, pr.TwoPhaseDrive(voltage=10.0, frequency=40.7e3, phase_deg=90.0), 20e-3)
    assert run.error_estimate.unknown == "Friction holds the shaft, which swings on the contact in the full motor."
    assert not run.error_estimate.shares
    assert not run.trusted


def test_the_error_of_a_shaft_that_swings_to_and_fro_is_unknown() -> None:
    """The full motor excites such swings at another frequency: after two of them it is 5 % of the speed off."""
    run = simulate_averaged(
        pr.load_motor(PLATE), pr.TwoPhaseDrive(voltage=50.0, frequency=41e3, phase_deg=70.0), duration=20e-3
    )
    assert run.speed_m_s.min() < -0.02 < 0.02 < run.speed_m_s.max()
    assert "swing to and fro" in run.error_estimate.unknown


def test_a_motor_without_drive_has_no_errors_of_rounding() -> None:
    motor = pr.load_motor("bimodal40")
    run = simulate_averaged(motor, pr.TwoPhaseDrive(voltage=0.0, frequency=40.7e3, phase_deg=90.0), 5e-3)
    assert run.error_estimate.unknown.startswith("There is no drive")
    assert run.cautions == (f"The error against the full motor is not known: {run.error_estimate.unknown}",)


def test_the_errors_are_estimated_once_and_only_when_asked_for() -> None:
    motor = pr.load_motor("bimodal40")
    run = simulate_averaged(motor, pr.TwoPhaseDrive(voltage=60.0, frequency=40.7e3, phase_deg=90.0), 5e-3)
    asked = []
    counted = replace(run, find_error=lambda: asked.append(1) or ErrorEstimate())
    assert counted.settled in (True, False)
    assert len(counted.columns()["time_s"]) == len(run.time_s)
    assert not asked
    assert counted.trusted
    assert counted.cautions == ()
    assert counted.to_dict()["trusted"]
    assert asked == [1]


@pytest.mark.parametrize(
    ("name", "restitution", "velocity", "trusted"),
    [("andersen2002", 0.9, 1.0, True), ("andersen2002", 0.2, 1e-3, False)],
)
def test_an_averaged_motor_whose_damping_exceeds_its_limit_is_not_trusted(
    name: str, restitution: float, velocity: float, trusted: bool
) -> None:
    """The averaged motor limits the factor of the normal force by its damping to 4."""
    changes = {"contact.restitution": restitution, "contact.restitution_velocity_m_s": velocity}
    motor = pr.load_motor(name).updated(changes)
    drive = pr.TwoPhaseDrive(voltage=300.0, frequency=52.5e3, phase_deg=90.0)
    run = pr.simulate_averaged(motor, drive, 20e-3, speed=4.0)
    assert run.trusted == trusted
    controlled = pr.simulate_controlled(motor, drive, lambda _: {}, 4e-3, sample_time=0.25e-3)
    constant = pr.Tracker(kind="none", voltage=300.0, frequency=52.5e3, phase_deg=90.0)
    tracked = pr.track(motor, constant, 4e-3, averaged=True)
    for found in (controlled, tracked):
        assert any("against the full motor" in caution for caution in found.cautions) != trusted


@pytest.mark.parametrize(("name", "duration", "settled"), [(BEAM40, 0.1, False), (BEAM40, 0.3, True)])
def test_a_run_says_what_has_not_settled_as_a_longer_run_shows(name: str, duration: float, settled: bool) -> None:
    motor, drive = recommended(name)
    run, longer = (pr.simulate_averaged(motor, drive, duration=time) for time in (duration, 10.0 * duration))
    unestimated(run)
    change = {key: abs(float(getattr(longer, key)[-1] / getattr(run, key)[-1]) - 1.0) for key in run.to_come}
    assert (max(change.values()) < 0.02) is settled is run.settled is run.to_dict()["settled"]
    names = {"rotor_speed_rad_s": "speed", "electrical_power_w": "electrical power"}
    moving = [names[key] for key, share in change.items() if share > 0.02]
    assert run.summary()["settled"] == (f"no: {', '.join(moving)}" if moving else "yes")


@pytest.mark.soak
def test_a_negative_amplitude_turns_the_phase_in_the_estimate_of_errors() -> None:
    motor = pr.load_motor("bimodal40")
    drive, half = pr.default_drive(motor), 0.5 * pr.default_drive(motor).voltage
    signed, turned = (
        pr.simulate_averaged(motor, drive, 20e-3, courses=courses).error_estimate.shares
        for courses in ({"voltage_b": -half}, {"voltage_b": half, "phase_deg": drive.phase_deg - 180.0})
    )
    assert signed == pytest.approx(turned, rel=0.01)
