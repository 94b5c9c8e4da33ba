# SPDX-License-Identifier: GPL-3.0-or-later
"""The decks of ``netlists/``: up to date, and ngspice alone runs them in any directory with the right results."""

import re
import subprocess
from collections.abc import Mapping
from functools import cache
from itertools import takewhile
from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.motor.contact import limit_ratio, static_penetration
from pyspice_runner.spice.library import data_path
from tests.circuit.batch import batch, results
from tests.reference.row import throw as exact_throw
from tests.runs import simulated
from tests.selection import mostly
from tools import decks
from tools.averaged_decks import LIBRARY, averaged_library_text
from tools.benches.hysteresis import hysteresis
from tools.benches.traction import microslip_loss, virgin_force
from tools.decks import write_decks
from validation.impact import Throw

# one value each, and a short run; the measurements then begin at t = 0
CHANGES = {
    "averaged_frequency_response": {"voltage": "90", "lowest": "40.7k", "increment": "100"},
    "averaged_operating_point": {"torque": "25m"},
    "averaged_position_loop": {"angle": "0.3", "stop": "0.25"},
    "averaged_small_signal": {"preload": "20", "highest": "10"},
    "averaged_speed_loop": {"first": "10", "stepped": "0.05", "loaded": "0.1", "stop": "0.12"},
    "averaged_speed_torque": {"phase": "80", "increment": "10m"},
    "averaged_warm_up": {"capacity": "0.05", "stop": "0.3"},
    "drive_full_bridge": {"voltage_b": "30", "stop": "50u"},
    "drive_half_bridge": {"voltage_b": "30", "stop": "50u"},
    "drive_linear": {"phase": "60", "stop": "50u"},
    "drive_llcc": {"frequency": "50k", "stop": "50u"},
    "dynamometer": {"speed": "6", "stop": "0.2m", "periods": "6"},
    "ellipse": {"preload": "8", "stop": "0.4m"},
    "fast_start": {"boost": "1.5", "boosted": "0.1m", "off": "0.3m", "stop": "0.5m"},
    "figure_eight": {"voltage_2": "40", "stop": "0.9m"},
    "first_resonance": {"frequency": "14k", "stop": "1.5m"},
    "free_admittance": {"highest": "50k", "points": "4501"},
    "hysteresis": {"amplitude": "0.1"},
    "hysteresis_varying": {"swing": "0.5"},
    "impact": {"velocity": "1.1"},
    "preloaded_admittance": {"preload": "0.1"},
    "softening": {"voltage": "3", "sweep": "1m"},
    "spin_up": {"torque": "1m", "stop": "0.6m"},
    "thermal_drift": {"resistance": "50", "stop": "1.5m"},
    "tracker_observer": {"offset": "0.02", "stop": "0.1m"},
    "tracker_pll": {"target": "20", "stop": "0.1m"},
    "tracking_loop": {"bandwidth": "600"},
}
NAMES = tuple(CHANGES)

deck_texts = cache(decks.deck_texts)


@cache
def measured(name: str, folder: Path) -> dict[str, float]:
    """Run a deck by ``ngspice -b FILE`` from another directory and return what it measures."""
    done = subprocess.run(
        ["ngspice", "-b", str(data_path("netlists") / f"{name}.cir")],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert not re.search("error|warning", done.stdout + done.stderr, re.I), done.stdout + done.stderr
    found = re.findall(r"^(\w+) *= +(\S+)(?: +at= +(\S+))?", done.stdout, re.M)
    return {key: float(value) for key, value, _ in found} | {f"{key} at": float(at) for key, _, at in found if at}


def test_there_are_these_decks() -> None:
    assert sorted(path.stem for path in data_path("netlists").glob("*.cir")) == sorted(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_deck_in_the_repository_is_up_to_date(name: str) -> None:
    path = data_path("netlists") / f"{name}.cir"
    assert path.read_text(encoding="utf-8") == deck_texts()[f"{name}.cir"], "python -m tools.decks"


@pytest.mark.parametrize("name", NAMES)
def test_a_deck_needs_no_other_file_but_an_averaged_one_its_library(name: str) -> None:
    included = re.findall(r"^\.(?:include|lib) +(.*)", deck_texts()[f"{name}.cir"], re.M | re.I)
    assert included == (["piezomotor_averaged.lib"] if name.startswith("averaged_") else [])


def test_decks_are_written_to_the_given_folder(tmp_path: Path) -> None:
    assert sorted(path.name for path in write_decks(tmp_path)) == [f"{name}.cir" for name in NAMES]


def test_every_transient_deck_with_a_motor_measures_its_check() -> None:
    without = {"hysteresis", "hysteresis_varying", "impact"}  # a contact alone
    without |= {"softening"}  # its modes are adapted to its step, which is longer than the coarsest of a motor
    for name in NAMES:
        text = deck_texts()[f"{name}.cir"]
        if re.search(r"^\.tran", text, re.M) and name not in without and not name.startswith("averaged_"):
            assert ".meas TRAN check MAX v(xmotor.check)\n" in text, name


@pytest.mark.parametrize(("name", "preloaded"), [("free_admittance", False), ("preloaded_admittance", True)])
def test_admittance_decks_find_resonance_and_conductance(name: str, preloaded: bool, tmp_path: Path) -> None:
    motor = pr.load_motor("andersen2002")
    result = measured(name, tmp_path)
    frequencies = [mode.frequency_hz for mode in motor.modes]
    if preloaded:  # the two lowest are the carrier and the rotor on the contact's springs
        frequencies = list(motor.pressed_stator.resonances()[2:])
    for number, (mode, frequency) in enumerate(zip(motor.modes, frequencies, strict=True), start=1):
        assert result[f"conductance_bending_{number}_s at"] == pytest.approx(frequency, abs=10.0)  # step of the sweep
        if preloaded:  # the carrier's damping takes part; pr.admittance is compared with the closed form elsewhere
            found = pr.admittance(motor, state="preloaded", start=frequency - 10.0, stop=frequency + 10.0, points=21)
            expected = found.driven("A+B" if number == 1 else "A-B").real.max()
        else:
            coupling = 2 * mode.coupling_a_n_per_v  # both groups
            dielectric = 2 * (2 * np.pi * frequency * motor.piezo.capacitance_a_f) * motor.piezo.loss_tangent
            expected = coupling**2 / mode.damping_n_s_per_m + dielectric
        # the sweep's step is 10 Hz: 5 Hz off the peak of mode 1, 238 Hz wide, cost (2·5/238)² = 0.18 %
        assert result[f"conductance_bending_{number}_s"] == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize(
    ("name", "motor", "drive", "duration", "load"),
    [
        pytest.param(  # test_a_deck_follows_the_parameters_at_its_beginning compares this deck to 1e-4
            "ellipse",
            "andersen2002",
            pr.TwoPhaseDrive(voltage=50.0, frequency=51.7e3, phase_deg=90.0),
            3e-3,
            0.0,
            marks=pytest.mark.soak,
        ),
        pytest.param(
            "figure_eight",
            "andersen2002",
            pr.TwoToneDrive(voltage_1=50.0, frequency_1=25e3, voltage_2=50.0, frequency_2=50e3),
            2e-3,
            0.0,
            marks=pytest.mark.soak,
        ),
        ("spin_up", "bimodal40", pr.default_drive(pr.load_motor("bimodal40")), 3e-3, 5e-3),
    ],
)
def test_transient_decks_agree_with_simulate(
    name: str, motor: str, drive: pr.TwoPhaseDrive, duration: float, load: float, tmp_path: Path
) -> None:
    result = run_with(name, {"stop": f"{duration:g}"}, tmp_path)
    run = simulated(pr.load_motor(motor), drive, duration=duration, load_torque=load)
    window = run.window()
    # the decks hold the physical modes; without the exact resonance their tip is off by up to 3 % at 100 ns
    assert result["tip_x_peak_to_peak_um"] == pytest.approx(1e6 * np.ptp(run.tip_x_m[window]), rel=0.03)
    assert result["tip_y_peak_to_peak_um"] == pytest.approx(1e6 * np.ptp(run.tip_y_m[window]), rel=0.03)
    assert result["normal_force_greatest_n"] == pytest.approx(run.normal_force_n[window].max(), rel=0.01)
    assert result["rotor_speed_mean_rad_s"] == pytest.approx(run.mean_rotor_speed_rad_s, rel=0.05)


def split(text: str) -> tuple[list[str], list[str]]:
    """Return the lines of the parameters at the beginning of a deck, and those of the circuit, without comments."""
    lines = [line for line in text.splitlines()[1:] if not line.startswith("*")]
    block = list(takewhile(lambda line: line.startswith(".param "), lines))
    return block, lines[len(block) :]


@pytest.mark.parametrize("name", NAMES)
def test_a_deck_begins_with_parameters_to_which_its_lines_refer(name: str) -> None:
    block, circuit = split(deck_texts()[f"{name}.cir"])
    top = re.sub(r"^\.subckt.*?^\.ends \w+$", "", "\n".join(circuit), flags=re.M | re.S)
    expressions = re.findall(r"\{([^}]*)\}|PARAM='([^']*)'", "\n".join([*block, top]))
    used = set(re.findall(r"[a-z]\w*", " ".join(map(" ".join, expressions))))
    assert block
    for line in block:
        found = re.fullmatch(r"\.param (\w+)=\S+ ; .+", line)
        assert found, f"{line}: name, value, unit and meaning"
        assert found[1] in used, line
    if name == "averaged_operating_point":
        assert "op" in circuit
        return
    analysis = next(line for line in circuit if re.match(r"\.(tran|ac|dc) ", line))
    assert not re.search(r"\d", re.sub(r"\{[^}]*\}| 0 ", "", analysis)), "a number that is not a parameter"


def run_with(name: str, values: Mapping[str, str], folder: Path) -> dict[str, float]:
    text = deck_texts()[f"{name}.cir"]
    for parameter, value in values.items():
        text, found = re.subn(rf"^\.param {parameter}=\S+", f".param {parameter}={value}", text, flags=re.M)
        assert found == 1, parameter
    place = folder / "netlists"
    place.mkdir(exist_ok=True)
    if not (place / LIBRARY).exists():
        (place / LIBRARY).symlink_to(data_path("netlists") / LIBRARY)
    log = batch(place / "deck.cir", text)
    assert not re.search(r"\b(error|failed|warning)\b", log, re.I), log
    return results(log)


# the circuits of these are in other decks too, or other tests run them
LIKE = (
    "averaged_position_loop", "averaged_small_signal", "averaged_speed_loop", "averaged_speed_torque",
    "averaged_warm_up", "drive_half_bridge", "drive_llcc", "ellipse", "figure_eight", "first_resonance",
    "thermal_drift",
)  # fmt: skip


@pytest.mark.parametrize("name", mostly(pytest.mark.soak, NAMES, [name for name in NAMES if name not in LIKE]))
def test_a_value_of_the_parameters_changes_the_result(name: str, tmp_path: Path) -> None:
    change, *short = CHANGES[name].items()
    before, after = (run_with(name, dict(values), tmp_path) for values in (short, [change, *short]))
    assert before.keys() == after.keys()
    assert before.get("check", 0.0) < 0.02, "parameters, step and pins of a deck are right"
    assert any(after[key] != pytest.approx(value, rel=1e-4, abs=1e-12) for key, value in before.items()), (
        before,
        after,
    )


def test_a_deck_follows_the_parameters_at_its_beginning(tmp_path: Path) -> None:
    found = run_with("ellipse", {"frequency": "52k", "phase": "60", "preload": "8", "stop": "1m"}, tmp_path)
    motor = pr.load_motor("andersen2002").updated({"contact.preload_n": 8.0})
    drive = pr.TwoPhaseDrive(voltage=50.0, frequency=52e3, phase_deg=60.0)
    run = pr.simulate(motor, drive, duration=1e-3, step=1e-7, exact_resonance=False)
    last = run.time_s >= 1e-3 - 20.0 / 52e3
    # the same circuit and steps; the ends of the window are between points
    assert found["tip_x_peak_to_peak_um"] == pytest.approx(1e6 * np.ptp(run.tip_x_m[last]), rel=1e-4)
    assert found["normal_force_greatest_n"] == pytest.approx(run.normal_force_n[last].max(), rel=1e-4)


@pytest.mark.soak
def test_a_boost_starts_the_motor_sooner_and_a_resistor_stops_it_sooner(tmp_path: Path) -> None:
    """The tip of the free stator rises to 0.38 of its end after 0.15 ms; the decay by the resistor is 0.46 ms."""
    fast, plain = measured("fast_start", tmp_path), run_with("fast_start", {"boost": "1", "resistance": "1"}, tmp_path)
    start, end, after = (f"tip_y_peak_to_peak_{name}_um" for name in ("start", "end", "after"))
    assert fast[end] == pytest.approx(plain[end], rel=0.1)  # the rotor has run up sooner
    assert fast[start] > 1.3 * plain[start]
    assert fast[after] < 0.5 * plain[after]


def test_first_resonance_hammers(tmp_path: Path) -> None:
    result = measured("first_resonance", tmp_path)
    preload = pr.load_motor("andersen2002").contact.preload_n
    assert result["normal_force_least_n"] == 0.0  # the contact opens
    assert result["normal_force_greatest_n"] > 2 * preload
    assert abs(result["rotor_speed_mean_rad_s"]) < 1e-6  # both groups in phase: nothing turns


@pytest.mark.soak
def test_dynamometer_deck_integrates_what_the_waveforms_of_simulate_hold(tmp_path: Path) -> None:
    motor = pr.load_motor("bimodal40")
    drive = pr.default_drive(motor)
    stop = 60 * drive.period
    result = run_with("dynamometer", {"stop": repr(stop), "periods": "20"}, tmp_path)
    run = pr.simulate(motor, drive, duration=stop, speed=10.0, step=1e-7, exact_resonance=False)  # as the deck
    # both over the last 20 periods, so that it need not have settled
    means = {
        "torque_mean_n_m": run.mean_torque_n_m,
        "load_torque_mean_n_m": run.mean_torque_n_m - 10.0 * motor.rotor.bearing_damping_n_m_s,
        "normal_force_mean_n": run.mean(run.normal_force_n),
        "power_a_w": run.mean(run.voltage_a_v * run.current_a_a),
        "power_b_w": run.mean(run.voltage_b_v * run.current_b_a),
        "shaft_power_w": 10.0 * run.mean_torque_n_m,
    }
    for name, expected in means.items():
        assert result[name] == pytest.approx(expected, rel=0.01), name
    shares = run.state_fractions
    assert result["share_in_contact"] == pytest.approx(1.0 - shares["separated"], abs=0.01)
    assert result["share_in_slip"] == pytest.approx(shares["slip"], abs=0.01)


def test_impact_deck_rebounds_as_hertz_and_the_theory_say(tmp_path: Path) -> None:
    result = measured("impact", tmp_path)
    throw = Throw(psi=1.2)
    assert result["psi_1"] == pytest.approx(1.2, rel=1e-6)
    ratio = (2 - throw.poisson) / (2 * (1 - throw.poisson))
    assert result["psi_2"] == pytest.approx(exact_throw(1.2, ratio)[0], abs=0.0065)  # eight sliders
    assert result["departure_velocity_m_s"] == pytest.approx(-throw.velocity_m_s, rel=1e-5)
    # read at the points of 1000 steps: at most (π/2000)²/2 ≈ 1e-6 off a crest
    force = throw.contact.normal_stiffness_n_per_m15 * throw.greatest_penetration_m**1.5
    assert result["greatest_force_n"] == pytest.approx(force, rel=1e-5)
    assert result["greatest_penetration_um"] == pytest.approx(1e6 * throw.greatest_penetration_m, rel=1e-5)
    assert result["duration_s"] == pytest.approx(throw.duration_s, rel=1e-5)


def test_hysteresis_decks_lose_what_the_closed_form_and_the_bench_say(tmp_path: Path) -> None:
    motor = pr.load_motor("andersen2002")
    result = measured("hysteresis", tmp_path)
    slide = motor.contact.friction * motor.contact.preload_n
    limit = limit_ratio(motor.contact) * static_penetration(motor.contact)
    assert result["loss_j"] == pytest.approx(float(microslip_loss(0.8)) * slide * limit, rel=0.03)  # eight sliders
    assert result["friction_force_greatest_n"] == pytest.approx(float(virgin_force(0.8)) * slide, rel=0.006)
    assert result["part_that_slips_greatest"] == pytest.approx(1 - np.sqrt(0.2), abs=1 / 8)
    varying = measured("hysteresis_varying", tmp_path)
    bench = hysteresis(motor, 0.8, "brush", swing=0.6, phase_deg=90.0)
    assert varying["loss_j"] == pytest.approx(bench.loss_j, rel=2e-3)  # ngspice and numpy sum other points
    assert varying["loss_j"] > 1.2 * result["loss_j"]
    assert varying["normal_force_least_n"] == pytest.approx(0.4 * motor.contact.preload_n, rel=1e-5)
    assert varying["normal_force_greatest_n"] == pytest.approx(1.6 * motor.contact.preload_n, rel=1e-5)


# --- the averaged motor ---


def test_the_averaged_library_is_what_the_package_writes() -> None:
    path = data_path("netlists") / "piezomotor_averaged.lib"
    assert path.read_text(encoding="utf-8") == averaged_library_text(), "python -m tools.decks"


def test_the_averaged_operating_point_is_the_steady_state_of_the_full_model(tmp_path: Path) -> None:
    motor = pr.load_motor("bimodal40")
    found = measured("averaged_operating_point", tmp_path)
    state = pr.steady_state(motor, pr.default_drive(motor), load_torque=20e-3)
    assert state.converged
    # what the averages leave out is 8e-4 of the static penetration; 64 phases of the contact
    assert found["speed_rad_s"] == pytest.approx(state.speed_rad_s, rel=5e-3)
    assert found["check"] < 0.02


@pytest.mark.soak
def test_analyses_of_the_averaged_decks_come_to_one_steady_state(tmp_path: Path) -> None:
    # .op and .dc are the same steady state
    family = measured("averaged_speed_torque", tmp_path)
    response = measured("averaged_frequency_response", tmp_path)
    assert family["free_speed_rad_s"] == pytest.approx(response["speed_at_frequency_rad_s"], rel=1e-3)
    # the transient without heat goes there too
    warm = run_with("averaged_warm_up", {"capacity": "10", "loaded": "0.25", "stop": "0.35"}, tmp_path)
    assert warm["free_speed_rad_s"] == pytest.approx(family["free_speed_rad_s"], rel=0.01)


@pytest.mark.soak
def test_a_small_signal_is_the_slope_of_the_operating_point(tmp_path: Path) -> None:
    low, high = (
        run_with("averaged_operating_point", {"voltage": voltage}, tmp_path)["speed_rad_s"]
        for voltage in ("100", "101")
    )
    slow = run_with("averaged_small_signal", {"lowest": "0.01", "highest": "0.1"}, tmp_path)
    # the 64 phases of the contact change from stick to slip one by one, and the slope with them: measured 2 %
    assert slow["slow_speed_in_phase"] == pytest.approx(high - low, rel=0.04)


@pytest.mark.soak
def test_the_averaged_speed_loop_reaches_its_targets(tmp_path: Path) -> None:
    loop = measured("averaged_speed_loop", tmp_path)
    assert loop["first_speed_rad_s"] == pytest.approx(20.0, rel=1e-3)
    assert loop["second_speed_rad_s"] == pytest.approx(30.0, rel=1e-3)
    assert loop["last_speed_rad_s"] == pytest.approx(30.0, rel=1e-3)
    assert loop["lowest_loaded_rad_s"] > 25.0


@pytest.mark.soak
def test_an_xspice_device_in_an_averaged_deck_costs_no_steps_with_the_lines_of_the_header(tmp_path: Path) -> None:
    deck = deck_texts()["averaged_speed_loop.cir"].replace(LIBRARY, str(data_path("netlists") / LIBRARY))
    for name, value in {"stepped": "2m", "loaded": "3m", "stop": "4m"}.items():
        deck = re.sub(rf"^\.param {name}=\S+", f".param {name}={value}", deck, flags=re.M)
    device = "Etap raw 0 shaft 0 1\nAtap raw tap gain\n.model gain gain(gain=1)\nRtap tap 0 1k\n"
    library = (data_path("netlists") / "piezomotor_averaged.lib").read_text(encoding="utf-8")
    lines = re.search(r"^\* +\.control\n(?:\*.*\n)+?\* +\.endc\n", library, re.M)
    assert lines
    control = re.sub(r"^\* +", "", lines[0], flags=re.M)

    def iterations(more: str) -> int:
        log = batch(tmp_path / "deck.cir", deck.replace(".end\n", f".options acct\n{more}.end\n"))
        return int(re.findall(r"^Transient iterations = (\d+)", log, re.M)[0])

    alone = iterations("")
    assert iterations(device) > 3 * alone  # ngspice sets trtol = 1: measured 4.2
    assert iterations(device + control) <= 1.05 * alone


@pytest.mark.soak
def test_the_averaged_position_loop_reaches_its_target(tmp_path: Path) -> None:
    place = measured("averaged_position_loop", tmp_path)
    assert place["reached_rad"] == pytest.approx(0.5, abs=0.015)  # the dead band
    assert place["returned_rad"] == pytest.approx(0.0, abs=0.015)
    assert place["greatest_rad"] < 0.51
