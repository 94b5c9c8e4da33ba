# SPDX-License-Identifier: GPL-3.0-or-later
"""A transducer: its file, admittance, runs, steady state and library, against closed forms and hand-written decks."""

import json
from math import pi
from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.drivers.design import design_driver
from pyspice_runner.export.motor import export_motor
from pyspice_runner.motor.circuit_file import circuit_toml, load_circuit
from pyspice_runner.motor.drive import OnePhaseDrive
from pyspice_runner.motor.equivalent import EquivalentCircuit, MotionalArm
from pyspice_runner.motor.motor import TransducerError
from pyspice_runner.steady.transducer import transducer_state
from tests.circuit.batch import measured
from tests.runs import simulated

# resistance, inductance, capacitance of the arm, C0: two bolt-clamped transducers and an air transducer, as their
# makers' spectra give them
REAL = {
    "SMBLTD45F28H": (20.07, 72.47e-3, 448.4e-12, 3.012e-9),
    "Skymen-60W": (7.115, 25.58e-3, 617.7e-12, 4.422e-9),
    "MA40S4S": (643.186339335, 68.8719499245e-3, 230.489066295e-12, 2.401881144e-9),
}
LOSSY = EquivalentCircuit(
    (MotionalArm(20.07, 72.47e-3, 448.4e-12), MotionalArm(60.0, 50e-3, 100e-12)), 3.012e-9, 4e-3, 28.66e3
)  # fmt: skip
TWO = """
name = "stator"
[[modes]]
name = "m1"
mass_kg = 3e-3
frequency_hz = 40e3
quality_factor = 100
coupling_a_n_per_v = 0.2
coupling_b_n_per_v = 0.2
tip_y = 1.0
[[modes]]
name = "m2"
mass_kg = 3e-3
frequency_hz = 41e3
quality_factor = 100
coupling_a_n_per_v = 0.2
coupling_b_n_per_v = -0.2
[piezo]
capacitance_a_f = 2e-9
capacitance_b_f = 2e-9
capacitance_ab_f = 1e-10
loss_tangent = 0.01
[load]
mode = "m2"
resistance_n_s_per_m = 5
"""


def fitted(folder: Path, name: str) -> pr.Motor:
    """Return a measured transducer, as the file of its fit."""
    *arm, clamped = REAL[name]
    return written(folder, circuit_toml(EquivalentCircuit((MotionalArm(*arm),), clamped, 0.0, 30e3)), name)


def written(folder: Path, text: str, name: str = "mine") -> pr.Motor:
    (folder / f"{name}.toml").write_text(text)
    return pr.load_motor(folder / f"{name}.toml")


@pytest.fixture
def loaded(tmp_path: Path) -> pr.Motor:
    """A transducer with two arms, whose face works against a tool."""
    text = circuit_toml(LOSSY).replace("capacitance_f = 4", "velocity_per_current = 0.5\ncapacitance_f = 4")
    text = text.replace("capacitance_f = 1e-10", "velocity_per_current = -0.2\ncapacitance_f = 1e-10")
    return written(tmp_path, text + "[load]\nresistance_n_s_per_m = 400.0\nmass_kg = 2e-3\nstiffness_n_per_m = 1e7\n")


@pytest.mark.parametrize("circuit", [LOSSY, EquivalentCircuit(LOSSY.arms[:1], 3e-9, 0.0, 28e3)], ids=["lossy", "ideal"])
def test_admittance_is_that_of_the_fit(tmp_path: Path, circuit: EquivalentCircuit) -> None:
    device = written(tmp_path, circuit_toml(circuit))
    assert device.is_transducer
    assert device.groups == ("a",)
    found = pr.admittance(device, start=20e3, stop=80e3, points=400)
    expected = circuit.admittance(found.frequency_hz)
    assert np.abs(found.matrix_s[:, 0, 0] / expected - 1.0).max() < 1e-9
    assert [*found.resonances] == ["A"]
    for item, arm in zip(found.resonances["A"], circuit.arms, strict=True):
        assert item.resistance_ohm == pytest.approx(arm.resistance_ohm, rel=1e-4)


def test_fit_writes_a_device(tmp_path: Path) -> None:
    frequency = np.linspace(26.5e3, 31e3, 801)
    circuit = EquivalentCircuit((MotionalArm(*REAL["SMBLTD45F28H"][:3]),), 3.012e-9, 0.0, 28e3)
    spectrum = pr.Spectrum(frequency, circuit.admittance(frequency)[:, None, None])
    pr.fit_spectrum(spectrum, 1).save(tmp_path / "bl28.toml")
    device = pr.load_motor(tmp_path / "bl28.toml")
    assert device.name == "bl28"
    own = load_circuit(tmp_path / "bl28.toml").admittance(frequency)
    assert np.abs(device.stator.admittance(2.0 * pi * frequency)[:, 0, 0] / own - 1.0).max() < 1e-9


def test_what_a_circuit_has_beside_is_said(tmp_path: Path) -> None:
    circuit = EquivalentCircuit(LOSSY.arms, 3e-9, 4e-3, 28e3, 0.1, 1e-8, loss_tangent_rising=1e-3)
    leads, rising = written(tmp_path, circuit_toml(circuit)).cautions
    assert "The leads of the fitted circuit" in leads
    assert "exact at 28000 Hz" in rising


def test_toml_is_read_back(loaded: pr.Motor, tmp_path: Path) -> None:
    again = written(tmp_path, loaded.to_toml(), "again")
    assert again.to_dict() == loaded.to_dict()
    assert again.load_motion == (1.0, -1.0)
    assert again.main_mode == 0
    heavier = again.updated({"load.mass_kg": 0.0, "load.resistance_n_s_per_m": 40.0})
    assert heavier.tool.resistance_n_s_per_m == 40.0


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ('[load]\nmode = "m9"\n', "load.mode = 'm9' is not valid: it must be one of arm1, arm2"),
        ("[load]\nresistance_ohm = 5\n", "load.resistance_ohm is of one arm: mode is not valid: it must be one of"),
        ("[load]\nresistance_n_s_per_m = 5\n", "acts on the face, whose motion is not known"),
        ("[rotor]\nradius_m = 1e-2\n", "has no entry 'contact'"),
        ("[mount]\nmass_kg = 1.0\nstiffness_n_per_m = 1e3\ndamping_n_s_per_m = 1.0\n", "belong to a motor"),
    ],
)  # fmt: skip
def test_a_mistake_is_named(tmp_path: Path, more: str, words: str) -> None:
    with pytest.raises(pr.ParameterError) as error:
        written(tmp_path, circuit_toml(LOSSY) + more)
    assert words in str(error.value)


def test_a_motor_has_no_tool(tmp_path: Path) -> None:
    text = pr.load_motor("andersen2002").to_toml() + "\n[load]\nresistance_n_s_per_m = 1.0\n"
    with pytest.raises(pr.ParameterError, match=r"\[load\] and piezo.reference_hz belong to a transducer"):
        written(tmp_path, text)


@pytest.mark.parametrize("name", REAL)
def test_power_is_that_of_a_hand_written_deck(tmp_path: Path, name: str) -> None:
    ohm, henry, farad, clamped = REAL[name]
    device = fitted(tmp_path, name)
    frequency = 1.0005 * device.modes[0].frequency_hz  # off resonance, where a shift by the step would show
    deck = [
        f"{name} by hand", "V1 p 0 DC 0 AC -10", f"C0 p 0 {clamped!r}", f"L1 p m {henry!r}", f"C1 m r {farad!r}",
        f"R1 r 0 {ohm!r}", f".ac lin 3 {frequency - 1.0!r} {frequency + 1.0!r}",
        f".measure ac current FIND i(V1) AT={frequency!r}", ".end",
    ]  # fmt: skip
    (folder := tmp_path / "deck").mkdir()
    by_hand = 5.0 * measured("\n".join(deck), folder)["current"]
    duration = 7.0 * device.decay_s
    run = simulated(device, OnePhaseDrive(voltage=10.0, frequency=frequency), duration=duration)
    assert run.electrical()["power_w"] == pytest.approx(by_hand, rel=0.01)
    assert run.energy_residual < 1e-3
    steady = transducer_state(device, OnePhaseDrive(voltage=10.0, frequency=frequency))
    omega = 2.0 * pi * frequency
    impedance = ohm + 1j * (omega * henry - 1.0 / (omega * farad))
    assert steady.quantities["power_w"] == pytest.approx(50.0 * (1.0 / impedance).real, rel=1e-9)


@pytest.mark.soak
@pytest.mark.parametrize("name", REAL)
def test_from_a_spectrum_to_a_driver_and_a_loop_in_lock(tmp_path: Path, name: str) -> None:
    ohm, henry, farad, clamped = REAL[name]
    circuit = EquivalentCircuit((MotionalArm(ohm, henry, farad),), clamped, 0.0, 30e3)
    frequency = np.linspace(0.95, 1.11, 1001) * circuit.arms[0].series_resonance_hz
    noise = 1e-3 * np.random.default_rng(0).standard_normal((2, 1001))
    seen = circuit.admittance(frequency) * (1.0 + noise[0] + 1j * noise[1])
    pr.fit_spectrum(pr.Spectrum(frequency, seen[:, None, None])).save(tmp_path / "mine.toml")
    device = pr.load_motor(tmp_path / "mine.toml")
    resonance = device.modes[0].frequency_hz
    drive = OnePhaseDrive(voltage=20.0, frequency=1.002 * resonance)
    design = design_driver(device, pr.DriverSpec(drive, "linear", "inductor", rail=60.0))
    assert design.feasible
    duration, driver = device.settled_s, design.driver
    text = str(pr.drive_report(device, driver, duration).deck).rsplit(".end", 1)[0]
    text += f".measure tran power AVG par('v(a)*i(vpin_a)') FROM={duration - 20.0 / drive.frequency!r} TO={duration!r}"
    (exported := tmp_path / "exported").mkdir()
    found = measured(f"{text}\n.end\n", exported)["power"]
    parts, output = driver.values("a", "inductor"), driver.values("a", "amplifier")["output_resistance"]
    by_hand = ["by hand"]
    for n, phase in ((1, 0), (2, 90)):  # .measure gives real parts: the second copy gives the imaginary one
        by_hand += [
            f"V{n} s{n} 0 DC 0 AC {driver.voltage!r} {phase}", f"R0{n} s{n} k{n} {output + parts['resistance']!r}",
            f"L0{n} k{n} j{n} {parts['inductance']!r}", f"Cs{n} j{n} p{n} {parts['capacitance']!r}",
            f"Rs{n} j{n} p{n} {parts['bleeder']!r}", f"C0{n} p{n} 0 {clamped!r}", f"L{n} p{n} m{n} {henry!r}",
            f"C{n} m{n} r{n} {farad!r}", f"R{n} r{n} i{n} {ohm!r}", f"Vi{n} i{n} 0 0",
            f".measure ac part{n} FIND i(Vi{n}) AT={drive.frequency!r}",
        ]  # fmt: skip
    by_hand += [f".ac lin 3 {drive.frequency - 1.0!r} {drive.frequency + 1.0!r}", ".end"]
    (hand := tmp_path / "hand").mkdir()
    amperes = np.hypot(*measured("\n".join(by_hand), hand).values())
    assert found == pytest.approx(0.5 * ohm * amperes**2, rel=0.01)
    tracker = pr.Tracker(kind="pll", voltage=20.0, frequency=resonance, offset=0.005, span=0.03)
    tracked = pr.track(device, tracker, disturb="load", load_factor=2.0)
    assert tracked.locked
    ended = tracked.to_dict()
    assert ended["motional_current_before_a"] == pytest.approx(20.0 / ohm, rel=0.05)  # builds up for 4 time constants
    assert ended["motional_current_after_a"] == pytest.approx(10.0 / ohm, rel=0.02)


@pytest.mark.parametrize("which", ["one group", "two groups"])
def test_run_ends_in_the_steady_state(which: str, loaded: pr.Motor, tmp_path: Path) -> None:
    device = loaded if which == "one group" else written(tmp_path, TWO)
    drive = pr.default_drive(device).updated({"voltage": 20.0, "frequency": device.modes[0].frequency_hz})
    run = pr.simulate(device, drive, 12e-3)
    assert run.energy_residual < 1e-3
    assert run.energy.load > 0.0
    assert run.settled
    found, steady = run.electrical(), transducer_state(device, drive).quantities
    assert found.keys() <= steady.keys()
    for name, value in found.items():
        assert value == pytest.approx(steady[name], rel=2e-3), name
    parts = (steady[name] for name in ("load_power_w", "damping_loss_w", "dielectric_loss_w"))
    assert sum(parts) == pytest.approx(steady["power_w"], rel=1e-9)


def test_export_runs_in_plain_ngspice(loaded: pr.Motor, tmp_path: Path) -> None:
    drive = OnePhaseDrive(voltage=20.0, frequency=loaded.modes[0].frequency_hz)
    text = export_motor(loaded, tmp_path / "tool.lib").read_text()
    for ending in ("asy", "kicad_sym"):
        symbol = export_motor(loaded, tmp_path / f"tool.{ending}").read_text()
        assert "transducer" in symbol
        assert "load=400" in symbol
        assert "shaft" not in symbol
    step = float(next(line for line in text.splitlines() if line.startswith("* STEP")).split()[4])
    duration = 12e-3
    deck = [
        "export", text, f"Va a 0 SIN(0 20 {drive.frequency!r})", "Xpiezo a 0 transducer",
        f".tran {step!r} {duration!r} 0 {step!r} uic", ".measure tran check MAX v(xpiezo.check)",
        f".measure tran power AVG par('-v(a)*i(Va)') FROM={duration - 20.0 / drive.frequency!r} TO={duration!r}",
    ]  # fmt: skip
    (folder := tmp_path / "deck").mkdir()
    found = measured("\n".join(deck), folder)
    assert found["check"] == 0.0
    assert found["power"] == pytest.approx(transducer_state(loaded, drive).quantities["power_w"], rel=0.01)


def test_what_needs_a_rotor_is_refused(tmp_path: Path) -> None:
    device = fitted(tmp_path, "MA40S4S")
    drive = OnePhaseDrive(voltage=1.0, frequency=40e3)
    for analysis in (pr.speed_torque, pr.steady_state, pr.small_signals):
        with pytest.raises(TransducerError, match="MA40S4S is a transducer: it has no rotor"):
            analysis(device, drive, **({"frequencies": [10.0]} if analysis is pr.small_signals else {}))
    with pytest.raises(TransducerError, match="MA40S4S is a transducer"):
        pr.simulate_averaged(device, drive, 1.0)
    with pytest.raises(pr.ParameterError, match="has no shaft"):
        pr.simulate(device, drive, 1e-3, speed=1.0)
    with pytest.raises(pr.ParameterError, match="which has one group: give a OnePhaseDrive"):
        pr.simulate(device, pr.TwoPhaseDrive(voltage=1.0, frequency=40e3), 1e-3)
    assert json.loads(json.dumps(device.to_dict()))["load"] == {}
