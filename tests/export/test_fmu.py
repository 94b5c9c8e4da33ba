# SPDX-License-Identifier: GPL-3.0-or-later
"""The exported Functional Mock-up Unit in FMPy, against ``simulate_averaged`` and against itself."""

import ctypes
import json
import re
import subprocess
import threading
import zipfile
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import numpy as np
import pytest
from fmpy import extract, read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave
from fmpy.validation import validate_fmu

import pyspice_runner as pr
from pyspice_runner.averaged.c_code import CORE, variables
from pyspice_runner.averaged.run import AveragedRun
from pyspice_runner.averaged.simulate import simulate_averaged
from pyspice_runner.cli import run
from pyspice_runner.export.fmu import Version, fmu_texts, state_count
from pyspice_runner.spice.compiler import compile_library
from tests.motors import BEAM40
from tests.selection import mostly

pytestmark = pytest.mark.xdist_group("fmu")
SAMPLE = 1e-3  # s
# of a quantity, over its greatest magnitude; ngspice's own error is a few tenths of a per cent
WITHIN = 0.01


class Unit:
    """An instance in FMPy, its variables by their names."""

    def __init__(self, file: Path, **start: float) -> None:
        description = read_model_description(str(file))
        self.places = {item.name: item.valueReference for item in description.modelVariables}
        folder = file.parent / "unzipped"
        if not folder.exists():  # a binary that is loaded must not be written again
            extract(str(file), str(folder))
        self.fmu = FMU2Slave(
            guid=description.guid, unzipDirectory=str(folder),
            modelIdentifier=description.coSimulation.modelIdentifier, instanceName="motor",
        )  # fmt: skip
        self.fmu.instantiate()
        self.begin(**start)

    def begin(self, **start: float) -> None:
        self.time = 0.0
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.set(**start)
        self.fmu.exitInitializationMode()

    def set(self, **values: float) -> None:
        self.fmu.setReal([self.places[name] for name in values], list(values.values()))

    def get(self, *names: str) -> list[float]:
        return list(self.fmu.getReal([self.places[name] for name in names]))

    def advance(self, step: float = SAMPLE) -> None:
        self.fmu.doStep(currentCommunicationPoint=self.time, communicationStepSize=step)
        self.time += step


@pytest.fixture(scope="module")
def motor() -> pr.Motor:
    return pr.load_motor(BEAM40)


@pytest.fixture(scope="module")
def file(motor: pr.Motor, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return pr.export_motor(motor, tmp_path_factory.mktemp("fmu") / "motor.fmu")


@pytest.fixture
def unit(file: Path) -> Iterator[Unit]:
    one = Unit(file)
    yield one
    one.fmu.freeInstance()


def speed_loop(unit: Unit, duration: float) -> tuple[list[tuple[float, float]], np.ndarray]:
    """Control the speed at 1 kHz; return the course of the amplitude, as stairs, and the speed at each sample."""
    integral, stairs, speeds = 0.0, [], []
    for number in range(round(duration / SAMPLE)):
        (speed,) = unit.get("speed")
        error = 20.0 - speed
        voltage = min(max(45.0 + 3.0 * error + integral, 0.0), 110.0)
        integral += 0.1 * error
        unit.set(amplitude_a=voltage, amplitude_b=voltage)
        unit.advance()
        stairs += [(number * SAMPLE, voltage), ((number + 1) * SAMPLE - 1e-6, voltage)]
        speeds.append(unit.get("speed")[0])
    return stairs, np.array(speeds)


# --- the description ---


def test_the_checker_of_fmpy_finds_nothing_in_what_the_command_writes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "motor.fmu"
    words = "export andersen2002-unintended-mode --averaged --thermal --name stage --set mount=none"
    assert run([*words.split(), "--output", str(target), "--json"]) == 0
    assert "<fmiModelDescription" in json.loads(capsys.readouterr().out)["library"]
    assert validate_fmu(str(target)) == []
    with zipfile.ZipFile(target) as archive:
        assert {
            "binaries/linux64/stage.so", "sources/piezomotor_averaged.c", "sources/piezomotor_fmi2.c",
            "sources/piezomotor_averaged.h", "sources/piezomotor_phase.h", "sources/piezomotor_start.h",
            "sources/piezomotor_fmi.h", "modelDescription.xml",
        } == set(archive.namelist()) - {"binaries/win64/stage.dll"}  # fmt: skip


def test_every_variable_has_a_description_a_unit_and_a_range(file: Path, motor: pr.Motor) -> None:
    description = read_model_description(str(file))
    # the carrier does not move along the rotor, and its three values there are not shown
    assert len(description.modelVariables) == len(variables(motor)) - 3 + 2 * state_count(motor)
    dimensionless = {"check", "separated", "slip", "friction", "loss", "tip_x", "tip_y", "sliding_ratio"}
    for item in description.modelVariables:
        assert item.description
        if "state" in item.name:
            continue
        bare = item.name.rpartition(".")[2]
        assert (item.unit is None) == (bare in dimensionless), item
        assert (item.min is None) == (item.causality == "output")


def test_the_start_values_are_those_of_the_motor(motor: pr.Motor) -> None:
    changed = motor.updated({"contact.preload_n": 5.5, "rotor.inertia_kg_m2": 2e-6})
    start = {item.name: item.start for item in variables(changed)}
    assert (start["preload"], start["inertia"], start["frequency"]) == (5.5, 2e-6, 40.1e3)
    assert start["mode[2].stiffness"] == pytest.approx(motor.modes[1].stiffness_n_per_m, rel=1e-9)


def test_a_motor_that_has_no_average_is_an_error(motor: pr.Motor, tmp_path: Path) -> None:
    with pytest.raises(pr.ParameterError, match="has no averaged model: it must be 'spring-slider'"):
        pr.export_motor(motor, tmp_path / "motor.fmu", contact="coulomb")
    with pytest.raises(pr.ParameterError, match="The averaged motor takes linear modes only: set both to 0"):
        fmu_texts(motor.updated({"modes.0.softening_per_m2": 1e9}))
    with pytest.raises(pr.ParameterError, match=r"worn_flat_radius_m = 1e-05 has no averaged model: it must be 0\."):
        fmu_texts(motor.updated({"contact.worn_flat_radius_m": 1e-5}))


def test_without_a_compiler_the_export_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert run(["export", BEAM40, "--output", str(tmp_path / "motor.fmu")]) == 3
    assert "No C compiler was found on the PATH (cc, gcc, clang)" in capfd.readouterr().err
    assert not (tmp_path / "motor.fmu").exists()


# --- runs ---


@pytest.mark.parametrize("duration", [0.01, pytest.param(1.0, marks=pytest.mark.soak)])
@pytest.mark.soak
def test_spin_up_with_a_speed_controller_is_that_of_simulate_averaged(
    unit: Unit, motor: pr.Motor, duration: float
) -> None:
    stairs, speeds = speed_loop(unit, duration)
    expected = simulate_averaged(motor, pr.default_drive(motor), duration, courses={"voltage": stairs}, engine="spice")
    time = SAMPLE * np.arange(1, len(speeds) + 1)
    error = np.interp(time, expected.time_s, expected.rotor_speed_rad_s) - speeds
    assert np.abs(error).max() < WITHIN * speeds.max()


COLUMNS = {
    "speed": "rotor_speed_rad_s", "position": "rotor_position_rad", "torque": "torque_n_m", "heat": "heat_w",
    "current_amplitude_a": "current_amplitude_a_a", "current_amplitude_b": "current_amplitude_b_a",
    "electrical_power": "electrical_power_w", "normal_force": "normal_force_n", "temperature": "temperature_k",
    "tip_x_amplitude": "tip_x_amplitude_m", "tip_y_amplitude": "tip_y_amplitude_m", "check": "check",
    "slip": "slip", "separated": "separated",
}  # fmt: skip


@pytest.mark.parametrize(
    "name", mostly(pytest.mark.soak, ["andersen2002", "andersen2002-unintended-mode"], ["andersen2002"])
)
def test_all_outputs_under_load_warmth_and_detuning_are_those_of_simulate_averaged(name: str, tmp_path: Path) -> None:
    held = name == "andersen2002"
    thermal = pr.Thermal(heat_capacity_j_per_k=1e-3, ambient_k=10.0)  # so small that 20 ms warm it by some kelvin
    soft = {
        "contact.series_compliance_m_per_n": 1e-8, "contact.restitution": 0.8,
        "contact.tangential_series_compliance_m_per_n": 2e-8,
    }  # fmt: skip
    motor = pr.load_motor(name).updated({"mount": None} if held else soft)
    drive = pr.default_drive(motor)
    unit = Unit(pr.export_motor(motor, tmp_path / "motor.fmu", thermal=thermal))
    unit.set(load_torque=2e-4)
    for number in range(20):
        if number == 10:
            unit.set(frequency=1.001 * drive.frequency)
        unit.advance()
    detuned = {"frequency": [(0.01, drive.frequency), (0.01 + 1e-6, 1.001 * drive.frequency)]}
    expected = simulate_averaged(motor, drive, 0.02, load_torque=2e-4, thermal=thermal, courses=detuned, engine="spice")
    assert expected.temperature_k[-1] > 12.0
    ends_as(unit, expected, COLUMNS)


def ends_as(unit: Unit, expected: AveragedRun, columns: Iterable[str]) -> None:
    for ours in columns:
        values = getattr(expected, COLUMNS[ours])
        assert unit.get(ours)[0] == pytest.approx(values[-1], abs=WITHIN * np.abs(values).max()), ours
    unit.fmu.freeInstance()


ALONG = {"mount.tangential_stiffness_n_per_m": 1e5, "mount.tangential_damping_n_s_per_m": 50.0}
ON_CARRIERS: dict[str, dict[str, float]] = {
    "heavy carrier": {"modes.0.recoil_kg": 2e-3},
    "along the rotor, and capacitance between the groups": {
        "modes.0.recoil_kg": 2e-3, "modes.1.recoil_x_kg": 0.01, **ALONG, "piezo.capacitance_ab_f": 2e-10
    },
    "light carrier": {"modes.0.recoil_kg": 1e-3, "mount.mass_kg": 2e-3, "mount.stiffness_n_per_m": 1e6},
}  # fmt: skip


@pytest.mark.parametrize(
    "name", mostly(pytest.mark.soak, ON_CARRIERS, ["along the rotor, and capacitance between the groups"])
)
@pytest.mark.soak
def test_a_motor_that_shakes_its_carrier_is_that_of_simulate_averaged(
    name: str, motor: pr.Motor, tmp_path: Path
) -> None:
    shaking = motor.updated(ON_CARRIERS[name])
    drive = pr.TwoPhaseDrive(voltage=110.0, frequency=40.6e3, phase_deg=120.0)
    unit = Unit(pr.export_motor(shaking, tmp_path / "motor.fmu"))
    unit.set(amplitude_a=110.0, amplitude_b=110.0, phase=120.0, frequency=40.6e3)
    for _ in range(10):
        unit.advance()
    expected = simulate_averaged(shaking, drive, 0.01, engine="spice")  # at a constant temperature
    ends_as(unit, expected, COLUMNS.keys() - {"temperature"})


def test_preload_and_friction_may_change_while_the_motor_runs(unit: Unit, motor: pr.Motor) -> None:
    """The preload as in a course of ``simulate_averaged``; without friction the rotor is not driven."""
    for _ in range(4):
        unit.advance(0.5e-3)
    unit.set(preload=5.0)
    unit.advance()
    course = {"preload": [(2e-3, 6.5), (2e-3 + 1e-9, 5.0)]}
    expected = simulate_averaged(motor, pr.default_drive(motor), 3e-3, courses=course)
    assert unit.get("speed")[0] == pytest.approx(expected.rotor_speed_rad_s[-1], rel=2e-3)  # other steps
    unit.set(friction=1e-4)
    unit.advance()
    assert abs(unit.get("torque")[0]) < 2e-4 * 6.5 * motor.rotor.radius_m


def test_phase_of_the_currents_and_power_agree(unit: Unit) -> None:
    unit.advance(5e-3)
    names = ("amplitude_a", "current_amplitude_a", "current_phase_a", "amplitude_b", "current_amplitude_b")
    u_a, i_a, phase_a, u_b, i_b, phase_b, power = unit.get(*names, "current_phase_b", "electrical_power")
    cosines = np.cos(np.radians([phase_a, phase_b]))
    assert power == pytest.approx(0.5 * (u_a * i_a * cosines[0] + u_b * i_b * cosines[1]), rel=1e-12)


def trajectory(unit: Unit) -> list[list[float]]:
    found = []
    for number in range(15):
        unit.set(amplitude_a=100.0 - number, load_torque=1e-4 * number)
        unit.advance()
        found.append(unit.get(*COLUMNS))
    return found


def test_a_run_after_a_reset_is_identical(unit: Unit) -> None:
    first = trajectory(unit)
    unit.fmu.reset()
    unit.begin()
    assert trajectory(unit) == first


def test_two_instances_in_two_threads_run_as_one_alone_does(file: Path, unit: Unit) -> None:
    alone = trajectory(unit)
    together: list[list[list[float]]] = []
    units = [Unit(file), Unit(file)]
    threads = [threading.Thread(target=lambda one=one: together.append(trajectory(one))) for one in units]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert together == [alone, alone]
    for one in units:
        one.fmu.freeInstance()


def test_a_state_that_was_kept_is_continued(unit: Unit) -> None:
    unit.advance(3e-3)
    kept = unit.fmu.getFMUState()
    content = unit.fmu.serializeFMUState(kept)
    first = trajectory(unit)
    for state in (kept, unit.fmu.deserializeFMUState(content)):
        unit.fmu.setFMUState(state)
        unit.time = 3e-3
        assert trajectory(unit) == first
        unit.fmu.freeFMUState(state)


@pytest.mark.soak
def test_the_tolerance_and_the_search_of_the_forces_change_the_speed_little(tmp_path: Path) -> None:
    """At 1 ms by the first steps, which are a period of the drive; then by 0.02 %; forces have an error of 1e-13."""
    for path, text in fmu_texts(pr.load_motor("bimodal40")).items():
        (tmp_path / Path(path).name).write_text(text, encoding="utf-8")
    core = (tmp_path / CORE).read_text(encoding="utf-8")
    (tmp_path / "run.c").write_text(RUN, encoding="utf-8")
    speeds = []
    for name, usual, value in (("TOLERANCE", "1e-4", "1e-4"), ("TOLERANCE", "1e-4", "1e-6"), ("SWEEPS", "8", "0")):
        assert f"{name} {usual} " in core
        (tmp_path / "core.c").write_text(core.replace(f"{name} {usual} ", f"{name} {value} "), encoding="utf-8")
        library = tmp_path / f"{name}{value}.so"
        compile_library(tmp_path, ["core.c", "run.c"], library)
        speed = ctypes.CDLL(str(library)).speed_at
        speed.restype = ctypes.c_double
        speeds.append(np.array([speed(count) for count in (1, 5, 20)]))
    assert np.all(np.abs(speeds[0] / speeds[1] - 1.0) < [5e-3, 1e-3, 2e-4])
    assert speeds[2] == pytest.approx(speeds[0], rel=1e-10)


def test_a_rotor_that_sticks_comes_to_rest(motor: pr.Motor, tmp_path: Path) -> None:
    """A method without damping lets the contact ring with some 0.05 rad/s, as ngspice's trapezoidal rule does."""
    weak = pr.export_motor(motor.updated({"rotor.inertia_kg_m2": 4e-6}), tmp_path / "motor.fmu")
    unit = Unit(weak)
    unit.set(amplitude_a=20.0, amplitude_b=20.0, frequency=38.2e3)
    for _ in range(20):
        unit.advance()
    assert abs(unit.get("speed")[0]) < 1e-4
    unit.fmu.freeInstance()


RUN = """
#include "piezomotor_averaged.h"
__attribute__((visibility("default"))) double speed_at(int count)
{
    struct motor motor;
    motor_default(&motor);
    motor_rest(&motor);
    for (int n = 0; n < count; n++)
        if (motor_advance(&motor, 1e-3) != 0)
            return -1.0;
    return motor.value.speed;
}
"""

# --- invalid input ---

INVALID: dict[str, tuple[Callable[[Unit], object], str]] = {
    "nan": (
        lambda unit: unit.set(amplitude_a=float("nan")),
        r"fmi2SetReal: amplitude_a = nan V is not valid: it must be between -10000 and 10000\.",
    ),
    "negative frequency": (
        lambda unit: unit.set(frequency=-40e3),
        r"frequency = -40000 Hz is not valid: it must be between 1 and 1e\+08\.",
    ),
    "step 0": (lambda unit: unit.advance(0.0), r"the step size 0 s is not valid: it must be more than 0 and at most"),
    "another time": (
        lambda unit: unit.fmu.doStep(currentCommunicationPoint=5.0, communicationStepSize=1e-3),
        r"the communication point 5 s is not valid: the instance is at 0 s\.",
    ),
    "parameter during a run": (
        lambda unit: unit.set(inertia=5.0),
        r"the parameter inertia cannot change during a run\. Reset the instance first\.",
    ),
    "an output": (lambda unit: unit.set(speed=1.0), r"value reference 8 is not that of an input or a parameter"),
    "unknown variable": (lambda unit: unit.fmu.getReal([10_000]), r"value reference 10000 is not valid"),
    "another type": (lambda unit: unit.fmu.getBoolean([0]), r"all variables are of type Real"),
    "second start": (
        lambda unit: unit.fmu.enterInitializationMode(),
        r"fmi2EnterInitializationMode is not valid now: the instance is running\.",
    ),
    "state of another motor": (lambda unit: unit.fmu.deserializeFMUState(b"12"), r"2 bytes are not a state"),
}  # fmt: skip


@pytest.mark.parametrize("case", INVALID)
def test_invalid_input_is_an_error_with_a_message_and_a_reset_helps(
    case: str, unit: Unit, capsys: pytest.CaptureFixture[str]
) -> None:
    act, message = INVALID[case]
    with pytest.raises(FMICallException, match=r"status 3 \(error\)"):
        act(unit)
    assert re.search(message, capsys.readouterr().out)
    with pytest.raises(FMICallException):
        unit.advance()
    assert "the instance is in error; reset it." in capsys.readouterr().out
    unit.fmu.reset()
    unit.begin()
    unit.advance()


@pytest.mark.fuzz
@pytest.mark.parametrize("seed", range(1, 6))
@pytest.mark.parametrize("version", [2, 3])
def test_no_order_of_calls_and_no_argument_ends_in_a_fault(
    version: Version, seed: int, motor: pr.Motor, tmp_path: Path
) -> None:
    """100,000 random calls, with the sanitizers of the compiler for addresses and undefined behaviour."""
    for path, text in fmu_texts(motor, version=version).items():
        (tmp_path / Path(path).name).write_text(text, encoding="utf-8")
    calls = Path(__file__).with_name("fmu_random_calls.c")
    flags = ["-std=c11", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=undefined", f"-I{tmp_path}"]
    flags.append(f"-DVERSION={version}")
    subprocess.run(["gcc", *flags, calls, CORE, "-lm", "-o", "calls"], cwd=tmp_path, check=True)
    done = subprocess.run([tmp_path / "calls", str(seed), "100000"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    succeeded, steps = map(int, done.stdout.split())
    assert succeeded > 10_000
    assert steps > 1000
