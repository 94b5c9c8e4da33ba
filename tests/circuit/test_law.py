# SPDX-License-Identifier: GPL-3.0-or-later
"""The libraries of the contact laws: one face, and the brush as it is generated."""

import re
from pathlib import Path

import numpy as np
import pytest
from PySpice.Spice.Netlist import Circuit

from pyspice_runner.circuit.bench import AC_OPTIONS
from pyspice_runner.circuit.law import (
    LAWS,
    PINS,
    Law,
    contact_library,
    contact_values,
    law_of,
    row_library,
    touching_law,
)
from pyspice_runner.circuit.motor import MotorSubCircuit, add_motor
from pyspice_runner.errors import ParameterError
from pyspice_runner.motor import contact as law
from pyspice_runner.motor.load import load_motor
from pyspice_runner.spice.library import Library, data_path, definitions, parse_library, read_library
from pyspice_runner.spice.ngspice import BatchSimulator, run_deck
from tests.circuit.batch import measured
from tests.motors import BEAM40

ROW = read_library("piezomotor_brush")


def test_brush_in_the_folder_is_what_the_package_writes() -> None:
    assert row_library(ROW, 8) == ROW.text


@pytest.mark.parametrize("name", LAWS.values())
def test_all_laws_have_the_same_face(name: str) -> None:
    library, first = read_library(name), read_library("piezomotor_contact")
    assert tuple(pin.name for pin in library.pins) == PINS
    for ours, theirs in zip(library.pins[:9], first.pins[:9], strict=True):
        assert ours == theirs
    shared = {parameter.name: parameter for parameter in first.parameters}
    for parameter in library.parameters:
        if parameter.name in shared and parameter.name != "slider_time":
            assert parameter == shared[parameter.name]


def test_friction_of_the_spring_slider_falls_with_the_slip_velocity(tmp_path: Path) -> None:
    """A tip pressed and dragged at the velocity of Stribeck's curve: μ F₀ (0.6 + 0.4/e)."""
    library = read_library("piezomotor_contact")
    usage = library.usage.replace("Vvx vx 0 0.01", "Vvx vx 0 0.05").replace("preload=4", "preload=4 sliding=0.6")
    found = measured(f"Stribeck\n{definitions(library)}\n{usage}.end\n", tmp_path)
    assert found["friction_end_n"] == pytest.approx(0.25 * 4.0 * (0.6 + 0.4 * np.exp(-1.0)), rel=1e-5)
    assert found["state_end"] == pytest.approx(2.0)


TOUCH = """touch: four tips that approach by 0.1 m/s, each by a part of a step later than the one before
{library}
Vvx vx 0 {along}
Vvy vy 0 0.1
Vshaft shaft 0 0
Vx x 0 PWL(0 0 100u {x})
{tips}
.options reltol=1e-6 vntol=1e-9 trtol=1e9
.tran 100n 9u 0 100n uic
.end
"""


@pytest.mark.parametrize("along", [0.02, -0.02])  # m/s; the limit of the slider grows by 0.036 m/s
def test_a_slider_that_sticks_is_displaced_by_the_motion_since_the_tip_touched(along: float) -> None:
    gaps = [0.6 + 1e-3 * part for part in (1, 3, 5, 9)]  # µm; a step of 0.1 µs takes 0.01 µm
    seat = 1e6 * (5.0 / 7e9) ** (2.0 / 3.0)
    tips = "\n".join(
        f"Vy{at} y{at} 0 PWL(0 {-seat - gap!r} 100u {10.0 - seat - gap!r})\n"
        f"Xtip{at} x y{at} vx vy fx{at} fy{at} shaft n{at} f{at} slider{at} s{at} piezomotor_contact slider_time=50n"
        for at, gap in enumerate(gaps)
    )
    text = TOUCH.format(
        library=definitions(read_library("piezomotor_contact")), along=along, x=100.0 * along, tips=tips
    )
    names = [f"v(slider{at})" for at in range(len(gaps))]
    vectors = run_deck(text, vectors=names, stop_time=9e-6).raw.vectors
    for name, gap in zip(names, gaps, strict=True):
        # the rotor's curvature and the tilt of the tangent are 1e-5; from touch by a step it would be up to 0.002 µm
        assert float(vectors[name][-1].real) == pytest.approx(along * (9.0 - gap / 0.1), rel=2e-4)


WORN = load_motor(BEAM40).contact.model_copy(update={"worn_flat_radius_m": 60e-6, "preload_n": 4.0})


def test_the_normal_contact_of_a_worn_tip_differs_by_its_force_only() -> None:
    new, worn = (read_library(name).subcircuit.splitlines() for name in ("piezomotor_normal", "piezomotor_worn"))
    own = ("* static", "* normal force", ".param half", ".param cube", ".param wide", ".param root", ".param seat")
    own += (".subckt", ".ends", "Bdeep", "Belastic")
    assert [line for line in new if not line.startswith(own)] == [line for line in worn if not line.startswith(own)]
    lined = read_library("piezomotor_lining").subcircuit.splitlines()
    assert [line for line in new if not line.startswith(own)] == [line for line in lined if not line.startswith(own)]


@pytest.mark.parametrize("part", [0.2, 0.7, -0.5])
def test_the_spring_of_a_worn_tip_is_the_difference_of_two_normal_forces(part: float) -> None:
    """Ciavarella and Jäger: F_T = μ (F_N(δ) − F_N(δ − |u|/κ)), from a run that drags the tip."""
    values = contact_values(Law(), WORN, radius=0.015, preload=4.0)
    given = " ".join(f"{name}={value!r}" for name, value in values.items())
    depth = law.static_penetration(WORN)
    speed = part * law.limit_ratio(WORN) * depth / 40e-6
    text = deck_of(contact_library(Law(), WORN), speed, span=0, more=given)
    text = text.replace("piezomotor_brush span=0", "piezomotor_contact_worn")
    vectors = run_deck(text, vectors=list(SAVED), stop_time=40e-6).raw.vectors
    normal, friction, slider = (float(vectors[name][-1].real) for name in SAVED[:3])
    assert normal == pytest.approx(4.0, rel=1e-6)
    left = np.array([depth - abs(1e-6 * slider) / law.limit_ratio(WORN)])
    expected = np.sign(part) * WORN.friction * (4.0 - law.elastic_force(WORN, left)[0])
    assert friction == pytest.approx(expected, rel=1e-5)
    assert abs(friction) == pytest.approx(abs(part) * WORN.friction * 4.0, rel=0.2)  # almost a punch: a linear spring


@pytest.mark.parametrize(
    ("flat", "sliders", "error"), [(0.0, 8, 6e-3), (2e-5, 8, 0.02), (6e-5, 8, 0.01), (2e-5, 32, 1e-3)]
)
def test_the_brush_of_a_worn_tip_has_the_forces_of_its_profile(flat: float, sliders: int, error: float) -> None:
    """First loading as Ciavarella and Jäger, within the cells; stiffness 2 G* a and gross slip are exact."""
    contact, row = WORN.model_copy(update={"worn_flat_radius_m": flat}), Law("brush", sliders)
    values = contact_values(row, contact, radius=0.015, preload=4.0)
    given = " ".join(f"{name}={value!r}" for name, value in values.items())
    depth, ratio = law.static_penetration(contact), law.limit_ratio(contact)
    library = contact_library(row, contact)

    def friction(part: float) -> float:
        deck = deck_of(library, part * ratio * depth / 40e-6, span=0, more=given)
        text = deck.replace("piezomotor_brush span=0", library.name)
        return float(run_deck(text, vectors=list(SAVED), stop_time=40e-6).raw.vectors[SAVED[1]][-1].real)

    left = law.elastic_force(contact, np.array([0.5 * depth]))[0]
    limit = contact.friction * 4.0
    assert friction(0.5) == pytest.approx(contact.friction * (4.0 - left), abs=error * limit)
    assert friction(2.0) == pytest.approx(limit, rel=1e-6)
    radius = law.contact_radius(contact, 4.0)
    modulus = 0.75 * contact.normal_stiffness_n_per_m15 / float(contact.effective_radius_m or 0.0) ** 0.5
    shear = modulus * contact.friction / ratio  # E*/G* = κ/μ
    assert friction(1e-3) == pytest.approx(2.0 * shear * radius * 1e-3 * ratio * depth, rel=3e-3)


def test_a_spring_of_ones_own_has_no_worn_tip(tmp_path: Path) -> None:
    (tmp_path / "mine.lib").write_text(ROW.text.replace("piezomotor_brush", "mine"), encoding="utf-8")
    with pytest.raises(ParameterError, match=r"worn_flat_radius_m = 6e-05 m is not valid with the contact .*mine\.lib"):
        contact_values(Law(str(tmp_path / "mine.lib")), WORN, radius=0.015, preload=4.0)
    assert contact_library(Law("coulomb"), WORN).needs == ("piezomotor_worn",)


@pytest.mark.parametrize("sliders", [1, 2, 5, 40])
def test_brush_is_written_for_any_number_of_sliders(sliders: int) -> None:
    library = parse_library("piezomotor_brush", row_library(ROW, sliders))
    assert contact_library(Law("brush", sliders)) == library
    assert len(re.findall(r"^Cq\d+ ", library.subcircuit, re.M)) == sliders
    assert library.parameters == read_library("piezomotor_brush").parameters


DECK = """brush, pressed and dragged
{library}
Vx x 0 0
By y 0 V={y}
Vvx vx 0 {speed}
Vvy vy 0 0
Vshaft shaft 0 0
Xcontact x y vx vy fx fy shaft normal friction slider state piezomotor_brush span={span} {more}
.options reltol=1e-6 vntol=1e-9 abstol=1e-9 trtol=1e9
.save v(normal) v(friction) v(slider) v(state) v(xcontact.delta)
.tran 50n 40u 0 50n uic
.end
"""
SAVED = ("v(normal)", "v(friction)", "v(slider)", "v(state)", "v(xcontact.delta)")


def deck_of(library: Library, speed: float, *, span: float = 0.8, y: str = "0", more: str = "") -> str:
    """Return the deck of a library that is pressed and dragged at a speed in m/s."""
    return DECK.format(library=definitions(library), y=y, speed=speed, span=span, more=more)


def drag(sliders: int, span: float, speed: float, y: str = "0", more: str = "") -> dict[str, float]:
    """What a brush says after 40 µs of dragging at a speed in m/s."""
    text = deck_of(contact_library(Law("brush", sliders)), speed, span=span, y=y, more=more)
    vectors = run_deck(text, vectors=list(SAVED), stop_time=40e-6).raw.vectors
    return {name[2:-1]: float(vectors[name][-1].real) for name in SAVED}


@pytest.mark.parametrize("sliders", [1, 3, 8])
@pytest.mark.parametrize("span", [0.2, 0.8, 1.9])  # µm; the penetration is 0.8
def test_gross_slip_and_stick_are_exact_for_any_number_and_spread_of_sliders(sliders: int, span: float) -> None:
    slid = drag(sliders, span, 1.0)
    assert slid["normal"] == pytest.approx(5.0, rel=1e-6)
    assert slid["friction"] == pytest.approx(0.3 * 5.0, rel=1e-6)
    assert slid["state"] == pytest.approx(2.0, abs=1e-9)
    # 1e-4 m/s for 40 µs: 4 nm, u_lim is 0.29 µm; all cells stick, but for one that the contact just reaches
    stuck = drag(sliders, span, 1e-4)
    stiffness = 1.5 * 5.0 ** (1 / 3) / 3.3e-7  # Mindlin's, 3 μ F/(2 u_lim)
    assert stuck["friction"] == pytest.approx(stiffness * 4e-9, rel=2e-3)
    assert stuck["state"] == pytest.approx(1.0, abs=0.1)
    assert stuck["slider"] == pytest.approx(4e-3, rel=2e-3)  # µm


def test_brush_goes_on_from_displacements_that_ic_states() -> None:
    """A run in blocks hands the cells over; an ``ic=`` of theirs would overrule that."""
    held = drag(3, 0.79906, 0.0, more="\n.ic v(xcontact.q1)=4m v(xcontact.q2)=4m v(xcontact.q3)=4m")
    assert held["friction"] == pytest.approx(1.5 * 5.0 ** (1 / 3) / 3.3e-7 * 4e-9, rel=1e-4)
    assert held["slider"] == pytest.approx(4e-3, rel=1e-4)


def test_contact_that_grows_in_stick_takes_up_only_what_moves_after_its_touch() -> None:
    """Mindlin and Deresiewicz: pressed and dragged at once, F_T = ∫ k_t(δ) du with k_t as δ^(1/2)."""
    y = "-0.8+0.02*time*1e6"  # from touch to 0.8 µm in 40 µs: 0.02 m/s, and the limit grows with 0.36 of that
    found = drag(5, 0.8, 0.003, y)
    ratio = 3.3e-7 * 7e9 ** (2 / 3)
    depth, moved = 1e-6 * found["xcontact.delta"], 0.003 * 40e-6
    # 2 G* ∫ (elements' u) dx = 2 G* ∫ a du, u = δ · moved/depth: two thirds of 2 G* a moved
    exact = 1.5 * 7e9 / ratio * depth**0.5 * (2 / 3) * moved
    assert found["friction"] == pytest.approx(exact, rel=2e-3)  # 800 steps, the first ones shorter
    assert found["state"] == pytest.approx(1.0, abs=1e-9)  # beside 1e-12 S


def test_separated_contact_forgets() -> None:
    found = drag(8, 0.8, 0.01, "-1.0*min(1,time/2e-5)")
    assert (found["normal"], found["state"]) == (0.0, pytest.approx(0.0, abs=1e-9))  # on 1e9 S
    assert abs(found["friction"]) < 1e-9
    assert abs(found["slider"]) < 1e-6


def test_normal_damping_is_hunt_and_crossleys() -> None:
    text = deck_of(contact_library(Law("brush")), 1.0, more="damping=0.6").replace("Vvy vy 0 0", "Vvy vy 0 0.5")
    normal = run_deck(text, vectors=list(SAVED), stop_time=40e-6).raw.vectors["v(normal)"].real
    assert normal[-1] == pytest.approx(5.0 * (1 + 0.6 * 0.5), rel=1e-6)
    pulled = run_deck(text.replace("Vvy vy 0 0.5", "Vvy vy 0 -5"), vectors=list(SAVED), stop_time=40e-6).raw.vectors
    assert pulled["v(normal)"].real[-1] == 0.0  # a contact does not pull
    assert abs(pulled["v(friction)"].real[-1]) < 1e-12  # rounding of q + l and q - l


@pytest.mark.parametrize("law", ["brush", "spring-slider"])
def test_damping_scales_the_limit_of_stick_and_not_its_stiffness(law: str) -> None:
    """A stiffness that followed the damped force would deliver power."""
    friction, library = {}, contact_library(Law(law))
    for speed, rate in ((1e-4, 0.0), (1e-4, 0.5), (1e-4, -0.5), (1.0, 0.5), (1.0, -0.5)):
        deck = deck_of(library, speed, more="damping=0.6")
        deck = deck if law == "brush" else deck.replace("piezomotor_brush span=0.8", library.name)
        run = run_deck(deck.replace("Vvy vy 0 0", f"Vvy vy 0 {rate}"), vectors=["v(friction)"], stop_time=40e-6)
        friction[speed, rate] = float(run.raw.vectors["v(friction)"].real[-1])
    # at 2 % of the limit the secant of Cattaneo and Mindlin's curve changes by 0.5 % per per cent of it
    assert friction[1e-4, 0.5] == pytest.approx(friction[1e-4, 0.0], rel=5e-3)
    assert friction[1e-4, -0.5] == pytest.approx(friction[1e-4, 0.0], rel=5e-3)
    assert friction[1.0, 0.5] == pytest.approx(0.3 * 5.0 * 1.3, rel=1e-5)
    assert friction[1.0, -0.5] == pytest.approx(0.3 * 5.0 * 0.7, rel=1e-5)


@pytest.mark.parametrize("restitution", [0.1, 0.5, 0.9, 0.999])
def test_constant_of_hunt_and_crossley_solves_its_equation(restitution: float) -> None:
    speed = 0.7
    z = speed * law.hunt_crossley_damping(restitution, speed)
    # ∫ v dv/(1 + a v) between touch and lift-off vanishes: a v − ln(1 + a v) is the same at both
    before, after = z - np.log1p(z), -restitution * z - np.log1p(-restitution * z)
    assert before == pytest.approx(after, rel=1e-9)
    assert z >= 0.75 * (1 - restitution**2)  # not the root z = 0; there is one more
    assert law.hunt_crossley_damping(1.0, speed) == 0.0


def test_a_motor_names_its_law_and_what_it_needs() -> None:
    motor = load_motor("andersen2002")
    for name in LAWS:
        text = str(MotorSubCircuit(motor, law=Law(name)))
        assert f" {LAWS[name]} " in text
        assert ("compliance=" in text) == (name != "coulomb")
        assert ("span=" in text) == (name == "brush")
        assert "damping=" not in text.split("Xcontact")[1].split("\n")[0]
    lossy = motor.updated({"contact.restitution": 0.8})
    values = contact_values(Law("coulomb"), lossy.contact, radius=0.01, preload=5.0)
    assert values["damping"] == pytest.approx(law.hunt_crossley_damping(0.8, 0.1))
    assert motor.to_dict()["contact"].keys() < lossy.to_dict()["contact"].keys()


def test_linearised_where_it_sticks_a_brush_is_the_papers_spring() -> None:
    """Hence the preloaded admittance does not ask for the law."""
    motor, found = load_motor("andersen2002"), {}
    for name in ("spring-slider", "brush"):
        circuit = Circuit("preloaded")
        circuit.V("a", "a", circuit.gnd, "DC 0 AC 1")
        circuit.V("b", "b", circuit.gnd, "DC 0 AC 0")
        add_motor(circuit, motor, ("a", "b", circuit.gnd, "shaft"), law=Law(name))
        simulator = BatchSimulator(circuit)
        simulator.options(**AC_OPTIONS)
        simulator.save("i(va)", "v(xmotor.friction)")
        simulator.ac(variation="lin", number_of_points=200, start_frequency=5e3, stop_frequency=100e3)
        found[name] = simulator.result.raw.vectors
    for vector in ("i(va)", "v(xmotor.friction)"):
        np.testing.assert_allclose(found["brush"][vector], found["spring-slider"][vector], rtol=1e-5)


def test_an_unknown_law_and_sliders_that_are_invalid_or_idle_are_errors() -> None:
    with pytest.raises(ParameterError) as caught:
        Law("glue")
    assert str(caught.value) == (
        "contact = 'glue' is not valid: it must be 'spring-slider', 'brush', 'coulomb', None (free tip) or the path of "
        "a .lib file."
    )
    assert law_of(None) is None
    assert law_of("brush") == Law("brush") == Law("brush", 8)
    with pytest.raises(ParameterError, match=r"contact = None \(free tip\) is not valid here: It has none\. Give"):
        touching_law(None, "It has none.")
    with pytest.raises(ParameterError, match=r"sliders = 8 has no effect on the law 'spring-slider'\. Leave it out"):
        Law("spring-slider", 8)
    for sliders in (0, 201, 2.5):
        with pytest.raises(ParameterError, match="it must be a whole number from 1 to 200"):
            Law("brush", sliders)  # type: ignore[arg-type]


def test_generator_writes_the_library(tmp_path: Path) -> None:
    (tmp_path / "mine.lib").write_text(row_library(ROW, 3), encoding="utf-8")
    normal = data_path("behavioral") / "piezomotor_normal.lib"
    includes = f".include {normal}\n.include {tmp_path / 'mine.lib'}\n"
    deck = f"include\n{includes}{read_library('piezomotor_brush').usage}.save v(state)\n.end\n"
    deck = re.sub(r"^\.measure.*\n", "", deck, flags=re.M)
    state = run_deck(deck, vectors=["v(state)"], stop_time=100e-6).raw.vectors["v(state)"].real
    assert state[-1] == pytest.approx(2.0, abs=1e-9)
