# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameters of the motor's subcircuit, as an engineer uses them in a deck of their own."""

import re
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PySpice.Spice.Netlist import Circuit

import pyspice_runner as pr
from pyspice_runner.circuit.law import LAWS, Law
from pyspice_runner.circuit.motor import add_motor, motor_library
from pyspice_runner.circuit.source import TRANSIENT_OPTIONS
from pyspice_runner.spice.library import check_parameters, parse_library
from pyspice_runner.spice.ngspice import run_deck
from tests.circuit.batch import batch
from tests.motors import motor as odd_motor

STEP, DURATION, FREQUENCY = 1e-7, 3e-4, 51.7e3
OPTIONS = ".options " + " ".join(f"{name}={value}" for name, value in TRANSIENT_OPTIONS.items())
CHANGES = {
    "contact.preload_n": 6.0,
    "contact.friction": 0.2,
    "contact.normal_stiffness_n_per_m15": 6e9,
    "rotor.inertia_kg_m2": 3e-6,
    "rotor.bearing_damping_n_m_s": 4e-5,
    "rotor.radius_m": 0.008,
}
SETTINGS = "preload=6 friction=0.2 normal_stiffness=6e9 inertia=3e-6 bearing=4e-5 radius=0.008"
SAVED = ("i(va)", "v(shaft)", "v(xmotor.x)", "v(xmotor.normal)", "v(xmotor.friction)", "v(xmotor.slider)")


def symmetric() -> pr.Motor:
    # its contact is given by constants, as that of a library is: they do not follow the rotor's radius
    return pr.load_motor("andersen2002").model_copy(update={"materials": None})


def run(library: str, line: str, *saved: str, more: str = "") -> dict[str, NDArray[np.float64]]:
    deck = f"""a deck of one's own
{library}
{more}
Va a 0 SIN(0 100 {FREQUENCY})
Vb b 0 SIN(0 100 {FREQUENCY} 0 0 90)
Xmotor a b 0 shaft {line}
{OPTIONS}
.ic v(xmotor.xgroup_b.plate)=100
.save {" ".join(saved)}
.tran {STEP} {DURATION} 0 {STEP} uic
.end
"""
    vectors = run_deck(deck, vectors=saved, stop_time=DURATION).raw.vectors
    return {name: np.asarray(vectors[name].real, dtype=float) for name in saved}


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("subject", [symmetric(), odd_motor()], ids=["symmetric", "bent sideways by the preload"])
def test_a_parameter_of_the_x_line_does_what_it_does_in_the_package(subject: pr.Motor, law: str) -> None:
    by_line = run(motor_library(subject, contact=law), f"piezomotor {SETTINGS}", *SAVED)
    by_package = run(motor_library(subject.updated(CHANGES), contact=law), "piezomotor", *SAVED)
    untouched = run(motor_library(subject, contact=law), "piezomotor", *SAVED)
    for name in SAVED:
        scale = np.abs(by_package[name]).max()
        # the same circuit, but for the tenth digit of what is written as an expression
        np.testing.assert_allclose(by_line[name], by_package[name], atol=1e-6 * scale, err_msg=name)
        if scale:
            assert np.abs(untouched[name] - by_package[name]).max() > 1e-3 * scale, name


def test_a_parameter_of_the_deck_reaches_the_motor_and_agrees_with_simulate() -> None:
    subject = symmetric()
    more = ".param preload=6 mu=0.2\n.param heavy={3*1e-6}"
    line = "piezomotor preload={preload} friction={mu} inertia={heavy} slider_time={0.5*1e-7}"
    found = run(motor_library(subject), line, "v(shaft)", "v(xmotor.normal)", more=more)
    changed = subject.updated({name: CHANGES[name] for name in list(CHANGES)[:2]} | {"rotor.inertia_kg_m2": 3e-6})
    drive = pr.TwoPhaseDrive(voltage=100.0, frequency=FREQUENCY, phase_deg=90.0)
    wave = pr.simulate(changed, drive, duration=DURATION, step=STEP, exact_resonance=False)
    # simulate puts the known start in front of the points of ngspice
    np.testing.assert_allclose(found["v(xmotor.normal)"], wave.normal_force_n[1:], rtol=1e-6)
    np.testing.assert_allclose(found["v(shaft)"], wave.rotor_speed_rad_s[1:], atol=1e-6 * wave.rotor_speed_rad_s.max())


def test_the_header_states_every_parameter_with_default_and_range() -> None:
    subject = odd_motor()
    library = parse_library("piezomotor", motor_library(subject))
    declared = {parameter.name: parameter for parameter in library.parameters}
    values = {
        "preload": subject.contact.preload_n,
        "friction": subject.contact.friction,
        "normal_stiffness": subject.contact.normal_stiffness_n_per_m15,
        "radius": subject.rotor.radius_m,
        "inertia": subject.rotor.inertia_kg_m2,
        "bearing": subject.rotor.bearing_damping_n_m_s,
    }
    assert values.keys() <= declared.keys()
    for name, value in values.items():
        assert declared[name].default == pytest.approx(value, rel=1e-9)
    with pytest.raises(pr.ParameterError, match=r"friction = 9 is not valid: it must be 0\.0001 to 5\."):
        check_parameters(library.name, library.parameters, {"friction": 9.0})


@pytest.mark.soak
def test_the_coarsest_step_of_the_header_is_right_and_a_coarse_one_is_not() -> None:
    """As a user would run it, with the slider_time of the header and ngspice's default tolerances."""
    library = motor_library(symmetric())
    (coarsest,) = (float(step) for step in re.findall(r"^\* STEP +at most (\S+) s;", library, re.M))

    def current(step: float) -> float:
        deck = f"""step
{library}
Va a 0 SIN(0 50 {FREQUENCY})
Vb b 0 SIN(0 50 {FREQUENCY} 0 0 90)
Xmotor a b 0 shaft piezomotor
.save i(va)
.tran {step} 2m 1m {step} uic
.end
"""
        vectors = run_deck(deck, vectors=["i(va)"], stop_time=2e-3).raw.vectors
        time, amperes = vectors["time"].real, vectors["i(va)"].real
        return float(np.sqrt(np.trapezoid(amperes**2, time) / (time[-1] - time[0])))

    fine = current(coarsest / 4.0)
    # the trapezoidal rule shows a resonance (ωh)²/12 low: 0.03 % at 100 points a period, of a half-width of 0.85 %
    assert current(coarsest) == pytest.approx(fine, rel=0.03)
    assert current(1e-6) < 0.7 * fine


def test_two_different_exports_work_in_one_deck_in_any_order() -> None:
    """Other motor, other law, other number of sliders: each does what it does alone."""
    first = motor_library(symmetric(), contact=Law("brush", 3), name="small")
    second = motor_library(odd_motor(), contact=Law("brush", 8), name="large")
    third = motor_library(symmetric(), contact="coulomb")
    alone = {
        name: run(library, name, "v(shaft)")["v(shaft)"]
        for library, name in ((first, "small"), (second, "large"), (third, "piezomotor"))
    }
    for libraries in ((first, second, third), (third, second, first)):
        text = "\n".join(libraries)
        others = "Xone a b 0 one small\nXtwo a b 0 two large\nXthree a b 0 three piezomotor"
        together = run(text, "small", "v(shaft)", "v(one)", "v(two)", "v(three)", more=others)
        for node, name in (("shaft", "small"), ("one", "small"), ("two", "large"), ("three", "piezomotor")):
            scale = np.abs(alone[name]).max()
            # one matrix of four motors instead of one: other round-off, within the tolerance of Newton's iteration
            np.testing.assert_allclose(together[f"v({node})"], alone[name], atol=1e-5 * scale, err_msg=node)
    defined = re.findall(r"^\.subckt (\S+)", first + second + third, re.M)
    assert len(defined) == len(set(defined))


def test_ngspice_sweeps_the_preload_by_alterparam_as_the_package_does(tmp_path: Path) -> None:
    """What LTspice calls .step: one deck, the preload changed in a loop of ngspice's own."""
    preloads = (3.0, 5.0, 8.0)
    deck = f"""preload sweep
.param preload=5
{motor_library(symmetric())}
Va a 0 SIN(0 100 {FREQUENCY})
Vb b 0 SIN(0 100 {FREQUENCY} 0 0 90)
Xmotor a b 0 shaft piezomotor preload={{preload}}
{OPTIONS}
.ic v(xmotor.xgroup_b.plate)=100
.tran {STEP} {DURATION} 0 {STEP} uic
.control
foreach force {" ".join(f"{value:g}" for value in preloads)}
  alterparam preload = $force
  reset
  run
  meas tran speed_rad_s FIND v(shaft) AT=2.9e-4
  meas tran normal_n FIND v(xmotor.normal) AT=2.9e-4
end
quit
.endc
.end
"""
    log = batch(tmp_path / "sweep.cir", deck)
    speeds, forces = (
        [float(value) for value in re.findall(rf"^{name} *= *(\S+)", log, re.M)] for name in ("speed_rad_s", "normal_n")
    )
    drive = pr.TwoPhaseDrive(voltage=100.0, frequency=FREQUENCY, phase_deg=90.0)
    for preload, speed, force in zip(preloads, speeds, forces, strict=True):
        subject = symmetric().updated({"contact.preload_n": preload})
        wave = pr.simulate(subject, drive, duration=DURATION, step=STEP, exact_resonance=False)
        # .measure prints six or seven digits, and interpolates between points of the same run
        assert speed == pytest.approx(float(np.interp(2.9e-4, wave.time_s, wave.rotor_speed_rad_s)), rel=1e-5)
        assert force == pytest.approx(float(np.interp(2.9e-4, wave.time_s, wave.normal_force_n)), rel=1e-5)
    assert len(set(speeds)) == 3


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("two words", "it must be at most 40 letters, digits and _, the first a letter"),
        ("x\n.control", "it must be at most 40 letters, digits and _, the first a letter"),
        ("left_mode", "ends in '_mode', like a part of the motor 'left' would"),
        ("Left_Contact", "ends in '_contact', like a part of the motor 'Left' would"),
        ("left_law", "ends in '_law', like a part of the motor 'left' would"),
    ],
)
def test_a_name_that_breaks_a_deck_is_an_error(name: str, sentence: str) -> None:
    with pytest.raises(pr.ParameterError, match=re.escape(sentence)):
        motor_library(symmetric(), name=name)


def test_a_circuit_takes_two_motors_by_two_names_and_sets_their_parameters() -> None:
    circuit = Circuit("two motors")
    nodes = ("a", "b", circuit.gnd)
    add_motor(circuit, symmetric(), (*nodes, "one"), instance="one")
    add_motor(circuit, odd_motor(), (*nodes, "two"), instance="two", name="other", settings={"preload": 9.0})
    lines = str(circuit).splitlines()
    assert "Xone a b 0 one piezomotor" in lines
    assert "Xtwo a b 0 two other preload=9.0" in lines
    assert any(line.startswith(".subckt other_contact ") for line in lines)
    for settings, sentence in (
        ({"preload": -1.0}, "preload = -1 N is not valid: it must be 1e-06 to 100000 N."),
        ({"weight": 1.0}, "Subcircuit piezomotor has no parameter 'weight'; it has preload, friction,"),
    ):
        with pytest.raises(pr.ParameterError, match=re.escape(sentence)):
            add_motor(circuit, symmetric(), (*nodes, "three"), instance="three", settings=settings)
