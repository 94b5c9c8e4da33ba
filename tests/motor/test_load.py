# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading a motor: three ways to state it, provenance, and one clear sentence for every mistake."""

from __future__ import annotations

import copy
import tomllib
from collections.abc import Callable, Iterator
from math import pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pyspice_runner.errors import ParameterError
from pyspice_runner.motor import beam as beam_model
from pyspice_runner.motor import contact as law
from pyspice_runner.motor.load import SETS, available_motors, load_motor
from pyspice_runner.motor.motor import Motor, Provenance
from pyspice_runner.motor.parameters import Beam, Damping, Patch, Tip
from tests.motor.toml_text import reads_well, toml
from tests.motors import within
from tests.selection import mostly

Document = dict[str, Any]

CONTACT = {
    "normal_stiffness_n_per_m15": 3e9,
    "tangential_compliance_tip_m_per_n23": 1.5e-7,
    "tangential_compliance_rotor_m_per_n23": 2.5e-7,
    "friction": 0.22,
    "preload_n": 7.0,
}
ROTOR = {"radius_m": 0.012, "inertia_kg_m2": 2e-6, "bearing_damping_n_m_s": 3e-6}
LOSS = {"loss_tangent": 0.015}
CAPACITANCES = {"capacitance_a_f": 1.7e-9, "capacitance_b_f": 2.1e-9}
MATERIALS = {
    "tip_radius_m": 0.004,
    "tip_youngs_modulus_pa": 300e9,
    "tip_poisson": 0.21,
    "rotor_youngs_modulus_pa": 110e9,
    "rotor_poisson": 0.34,
}
MODE = {
    "name": "up",
    "mass_kg": 0.006,
    "stiffness_n_per_m": 1.1e8,
    "damping_n_s_per_m": 9.0,
    "coupling_a_n_per_v": 0.13,
    "coupling_b_n_per_v": 0.12,
    "tip_x": 0.0,
    "tip_y": 1.1,
}
SIDE = MODE | {"name": "side", "stiffness_n_per_m": 9e8, "coupling_b_n_per_v": -0.1, "tip_x": 1.3, "tip_y": 0.1}
ARM = {
    "name": "up",
    "resistance_ohm": 450.0,
    "inductance_h": 0.31,
    "capacitance_f": 2e-10,
    "coupling_ratio": 0.9,
    "mass_kg": 0.005,
    "tip_x": 0.0,
    "tip_y": 1.0,
}
PATCH = {
    "group": "A",
    "faces": "both",
    "start_m": 0.002,
    "end_m": 0.011,
    "width_m": 0.006,
    "thickness_m": 0.0005,
    "layers": 3,
    "youngs_modulus_pa": 65e9,
    "density_kg_m3": 7700.0,
    "piezoelectric_constant_m_per_v": -1.6e-10,
    "permittivity_f_m": 1.4e-8,
}
BEAM: Document = {
    "name": "by its beam",
    "description": "a beam off the defaults",
    "beam": {
        "length_m": 0.025, "width_m": 0.008, "thickness_m": 0.0021,
        "youngs_modulus_pa": 190e9, "density_kg_m3": 7900.0,
    },
    "patches": [PATCH, PATCH | {"group": "B", "start_m": 0.013, "end_m": 0.022}],
    "tip": {"position_m": 0.012, "length_m": 0.004, "mass_kg": 2e-4, "rotary_inertia_kg_m2": 3e-9},
    "damping": {"alpha_per_s": 900.0, "beta_s": 3e-8},
    "piezo": LOSS,
    "contact": CONTACT,
    "rotor": ROTOR,
}  # fmt: skip
MODES: Document = {
    "name": "by its modes", "modes": [MODE, SIDE], "piezo": LOSS | CAPACITANCES, "contact": CONTACT, "rotor": ROTOR,
}  # fmt: skip
SLIDER = {"mass_kg": 0.2, "guide_damping_n_s_per_m": 0.4, "guide_friction_n": 0.3, "guide_presliding_m": 2e-5}
SLIDES: Document = {name: value for name, value in MODES.items() if name != "rotor"} | {"slider": SLIDER}
ARMS: Document = {
    "name": "by its arms",
    **MODES,
    "modes": None,
    "arms": [ARM, ARM | {"name": "side", "capacitance_f": 4e-11}],
}
del ARMS["modes"]
WAYS = {"beam": BEAM, "modes": MODES, "arms": ARMS}
STATED = "beam, solid, ring, modes, arms"


def changed(document: Document, path: str, value: Any) -> Document:
    """A copy of a document with one entry replaced; ``...`` takes it out."""
    document = copy.deepcopy(document)
    place: Any = document
    *parents, last = path.split(".")
    for key in parents:
        place = place[int(key) if isinstance(place, list) else key]
    if value is ...:
        del place[last]
    else:
        place[int(last) if isinstance(place, list) else last] = value
    return document


@pytest.fixture
def load(tmp_path: Path) -> Callable[[Document], Motor]:
    def read(document: Document) -> Motor:
        path = tmp_path / "mine.toml"
        path.write_text(toml(document), encoding="utf-8")
        return load_motor(path)

    return read


def refusal(load: Callable[[Document], Motor], document: Document) -> str:
    with pytest.raises(ParameterError) as caught:
        load(document)
    sentence = str(caught.value)
    assert reads_well(sentence), sentence
    return sentence


# --- three ways ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("way", WAYS)
def test_name_contact_rotor_and_losses_are_as_stated(way: str, load: Callable[[Document], Motor]) -> None:
    subject = load(WAYS[way])
    document = subject.to_dict()
    assert document["name"] == WAYS[way]["name"]
    assert document["contact"] == CONTACT
    assert document["rotor"] == ROTOR
    assert {key: document["piezo"][key] for key in LOSS} == LOSS
    assert (subject.structure is not None) == (way == "beam")


def test_beam_gives_the_modes_and_capacitances_of_rayleigh_ritz(load: Callable[[Document], Motor]) -> None:
    subject = load(BEAM)
    structure = (Beam(**BEAM["beam"]), tuple(Patch(**p) for p in BEAM["patches"]))
    modes = beam_model.resonator_modes(*structure, Tip(**BEAM["tip"]), Damping(**BEAM["damping"]))
    assert subject.modes == modes
    assert (subject.piezo.capacitance_a_f, subject.piezo.capacitance_b_f) == beam_model.clamped_capacitances(*structure)
    assert subject.structure is not None
    assert (subject.structure.beam, subject.structure.patches) == structure


def test_the_ceramic_table_states_the_shared_values_of_all_patches(load: Callable[[Document], Motor]) -> None:
    shared = {key: PATCH[key] for key in ("width_m", "thickness_m", "layers", "youngs_modulus_pa", "density_kg_m3")}
    patches = [{k: v for k, v in patch.items() if k not in shared} for patch in BEAM["patches"]]
    assert load(BEAM | {"ceramic": shared, "patches": patches}).modes == load(BEAM).modes
    own = load(BEAM | {"ceramic": shared | {"layers": 1}, "patches": [patches[0], patches[1] | {"layers": 3}]})
    assert own.structure is not None
    assert [patch.layers for patch in own.structure.patches] == [1, 3]


MOTION = {f"motion_{axis}_{group}_m_per_v": 0.0 for axis in "xy" for group in "ab"}


def test_modes_are_taken_as_stated_and_sorted(load: Callable[[Document], Motor]) -> None:
    subject = load(MODES | {"modes": [SIDE, MODE]})
    linear = {"softening_per_m2": 0.0, "damping_growth_per_m2": 0.0, "recoil_kg": None, "recoil_x_kg": None}
    assert [item.model_dump() for item in subject.modes] == [MODE | linear, SIDE | linear]
    assert subject.piezo.model_dump() == LOSS | CAPACITANCES | {"capacitance_ab_f": 0.0} | MOTION


def test_frequency_and_quality_factor_replace_stiffness_and_damping(load: Callable[[Document], Motor]) -> None:
    plain = {k: v for k, v in MODE.items() if k not in ("stiffness_n_per_m", "damping_n_s_per_m")}
    item = load(MODES | {"modes": [plain | {"frequency_hz": 23e3, "quality_factor": 77.0}]}).modes[0]
    assert item.stiffness_n_per_m == pytest.approx(0.006 * (2 * pi * 23e3) ** 2, rel=1e-14)
    assert item.damping_n_s_per_m == pytest.approx(0.006 * 2 * pi * 23e3 / 77.0, rel=1e-14)
    assert (item.frequency_hz, item.quality_factor) == (pytest.approx(23e3), pytest.approx(77.0))


def test_rayleigh_damping_applies_to_modes_without_their_own(load: Callable[[Document], Motor]) -> None:
    free = {k: v for k, v in MODE.items() if k != "damping_n_s_per_m"}
    damping = {"alpha_per_s": 700.0, "beta_s": 2e-8}
    subject = load(MODES | {"modes": [free, SIDE], "damping": damping})
    assert subject.modes[0].damping_n_s_per_m == pytest.approx(700.0 * 0.006 + 2e-8 * 1.1e8)
    assert subject.modes[1].damping_n_s_per_m == 9.0


def test_arms_draw_the_current_that_they_state(load: Callable[[Document], Motor]) -> None:
    """Y = 1/(R + sL + 1/sC) at group A with B shorted; B's transfer admittance is that times the ratio."""
    subject = load(ARMS)
    for item, arm in zip(subject.modes, ARMS["arms"], strict=True):
        s = 2j * pi * np.linspace(0.5, 1.5, 21) * item.frequency_hz
        stated = 1.0 / (arm["resistance_ohm"] + s * arm["inductance_h"] + 1.0 / (s * arm["capacitance_f"]))
        velocity = s / (item.stiffness_n_per_m + s * item.damping_n_s_per_m + s**2 * item.mass_kg)  # per newton
        np.testing.assert_allclose(item.coupling_a_n_per_v**2 * velocity, stated, rtol=1e-9)
        both = item.coupling_a_n_per_v * item.coupling_b_n_per_v
        np.testing.assert_allclose(both * velocity, 0.9 * stated, rtol=1e-9)
        assert item.frequency_hz == pytest.approx(1 / (2 * pi * sqrt(arm["inductance_h"] * arm["capacitance_f"])))
        assert item.mass_kg == 0.005


def test_contact_by_materials_has_hertz_and_mindlins_constants(load: Callable[[Document], Motor]) -> None:
    subject = load(MODES | {"contact": {"friction": 0.2, "preload_n": 3.0, "materials": MATERIALS}})
    modulus = law.effective_modulus(300e9, 0.21, 110e9, 0.34)
    radius = law.effective_radius(0.004, 0.012)
    assert subject.contact.normal_stiffness_n_per_m15 == pytest.approx(4 / 3 * modulus * sqrt(radius))
    tip = law.tangential_compliance(300e9, 0.21, modulus, radius)
    rotor = law.tangential_compliance(110e9, 0.34, modulus, radius)
    assert subject.contact.tangential_compliance_tip_m_per_n23 == pytest.approx(tip)
    assert subject.contact.tangential_compliance_rotor_m_per_n23 == pytest.approx(rotor)


LAYER = {"youngs_modulus_pa": 3e9, "thickness_m": 3e-4, "area_m2": 2e-6}
SOFT, BULK = {"stiffness_n_per_m": 1e7}, {"stiffness_ratio": 1.2, "stiffness_n_per_m3": 1e12}
STIFF = {"stiffness_n_per_m": 1e13, "stiffness_ratio": 1.0}
ROUGH = LAYER | {"exponent": 2.0, "poisson": 0.3}
LININGS = [  # lining, exponent, K_N, normal over tangential stiffness
    ({"stiffness_n_per_m": 1e7, "tangential_stiffness_n_per_m": 8e6}, (1.0, 1e7, 1.25)),
    ({"exponent": 2.0, "stiffness_n_per_m3": 2e18, "area_m2": 2e-6, "stiffness_ratio": 1.2}, (2.0, 4e12, 1.2)),
    (LAYER | {"stiffness_ratio": 2.0}, (1.0, 2e7, 2.0)),
    (LAYER | {"poisson": 1 / 3}, (1.0, 3e7, 4.0)),  # E (1 − ν)/((1 + ν)(1 − 2ν)) is 3/2 E, and G 3/8 E
]


@pytest.mark.parametrize(("lining", "constants"), LININGS)
def test_contact_by_a_lining_has_its_stiffnesses(
    lining: Document, constants: tuple[float, float, float], load: Callable[[Document], Motor]
) -> None:
    """The loss factor is ω c/k where ω times the static penetration is the velocity of the restitution."""
    given = {
        "friction": 0.2,
        "preload_n": 3.0,
        "restitution_velocity_m_s": 0.2,
        "lining": {"loss_factor": 0.08} | lining,
    }
    subject = load(MODES | {"contact": given})
    found = subject.contact
    along, towards = law.stiffnesses_at_preload(found)
    assert (found.exponent, found.normal_stiffness_n_per_m15, towards / along) == pytest.approx(constants)
    lost = 0.2 / law.static_penetration(found) * law.normal_damping(found) * 3.0 / towards
    assert lost == pytest.approx(0.08, rel=1e-9)
    again = load(tomllib.loads(subject.to_toml()))
    assert again.contact == found
    assert again.updated({"contact.lining.loss_factor": 0.04}).contact.restitution > found.restitution
    with pytest.raises(
        ParameterError, match=r"follows from \[contact.lining\]. Change contact.lining.exponent instead"
    ):
        again.updated({"contact.exponent": 1.5})


# --- provenance ----------------------------------------------------------------------------------------------


def test_provenance_is_recorded_and_plain_numbers_are_just_stated(load: Callable[[Document], Motor]) -> None:
    document = changed(MODES, "contact.friction", {"value": 0.22, "assumed": "ceramic on steel"})
    document = changed(document, "modes.1.tip_x", {"value": 1.3, "given": "table 2"})
    document = changed(document, "name", {"value": "noted", "derived": "by its author"})
    subject = load(document)
    assert subject.provenance["contact.friction"] == Provenance("assumed", "ceramic on steel")
    assert subject.provenance["modes.1.tip_x"] == Provenance("given", "table 2")
    assert subject.provenance["rotor.radius_m"] == Provenance("stated", "")
    assert subject.name == "noted"
    assert subject == load(MODES).model_copy(update={"name": "noted", "provenance": subject.provenance})


def test_a_value_that_a_file_omits_has_its_default(load: Callable[[Document], Motor]) -> None:
    subject = load(MODES)
    assert subject.provenance["contact.restitution"] == Provenance("default", "not stated")
    lossy = subject.updated({"contact.restitution": 0.8})
    assert lossy.provenance["contact.restitution"].kind == "set"
    assert lossy.provenance["contact.restitution_velocity_m_s"].kind == "default"


def test_provenance_stays_with_its_mode_when_modes_are_sorted(load: Callable[[Document], Motor]) -> None:
    late = changed(MODES | {"modes": [SIDE, MODE]}, "modes.0.tip_x", {"value": 1.3, "given": "table 2"})
    subject = load(late)
    assert subject.modes[1].name == "side"
    assert subject.provenance["modes.1.tip_x"] == Provenance("given", "table 2")
    assert subject.provenance["modes.0.tip_x"] == Provenance("stated", "")


def test_every_value_of_the_papers_motor_says_where_it_comes_from() -> None:
    provenance = load_motor("andersen2002").provenance
    stated = {path for path, origin in provenance.items() if origin.kind == "stated"}
    assert {path.rpartition(".")[2] for path in stated} == {"name", "group", "faces", "kind"}
    assert all(origin.note for path, origin in provenance.items() if path not in stated)
    assert {path for path, origin in provenance.items() if origin.kind == "given"} == {
        "beam.theory", "beam.recoil", "damping.alpha_per_s", "damping.beta_s", "drive.phase_deg",
    }  # fmt: skip


NOTED = {"value": 0.3, "given": "here"}


@pytest.mark.parametrize(
    "table",
    [{"value": 0.3}, {"given": "here"}, NOTED | {"assumed": "there"}, NOTED | {"given": 5}, NOTED | {"unit": "1"}],
)
def test_malformed_provenance_is_rejected(table: Document, load: Callable[[Document], Motor]) -> None:
    assert refusal(load, changed(MODES, "contact.friction", table)) == (
        'mine.toml: contact.friction must read { value = …, given | derived | assumed = "why" }, one of the three.'
    )


# --- names and files -----------------------------------------------------------------------------------------


def test_every_parameter_set_of_the_package_loads() -> None:
    assert "andersen2002" in available_motors()
    for name in available_motors():
        assert load_motor(name) == load_motor(SETS / f"{name}.toml") == load_motor(str(SETS / f"{name}.toml"))


@pytest.mark.parametrize(
    ("source", "reason"),
    [
        ("andersen2020", "There is no parameter set 'andersen2020'. Did you mean 'andersen2002'?"),
        ("zeppelin", "There is no parameter set 'zeppelin'. Give the path of a TOML file or one of andersen2002"),
        *((source, "There is no file") for source in ("", ".", "no/where.toml", Path("nothing"), "\0.toml")),
        ("x" * 300 + ".toml", f"There is no file '{'x' * 56}…. Give the path of a TOML file"),
    ],
)
def test_unknown_source_is_rejected(source: str | Path, reason: str) -> None:
    with pytest.raises(ParameterError) as caught:
        load_motor(source)
    assert reason in str(caught.value)
    assert reads_well(str(caught.value))


TOML = "mine.toml is not valid TOML:"


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"\xff\xfe\x00", "Cannot read {path}: it is not UTF-8 text. Give a readable TOML file."),
        (b"name = 'x'\nmass = = 3\n", f"{TOML} Invalid value (at line 2, column 8). Correct that line."),
        (b"[a\n", f"{TOML} Expected ']' at the end of a table declaration (at line 1, column 3). Correct that line."),
        (b"a = 1\na = 2\n", f"{TOML} Cannot overwrite a value (at line 2, column 6). Correct that line."),
        (b"a = " + b"9" * 5000, "mine.toml holds a number of thousands of digits. Write numbers as in 1e-3."),
        (
            b"name = 0x" + b"f" * 5000 + b"\n[contact]\n[rotor]\n[piezo]\n[[modes]]\nmass_kg = 0x" + b"f" * 5000,
            "mine.toml: rotor.radius_m is missing (radius R at the contact, in m). Specify it.",
        ),
        (b"a = " + b"[" * 5000, "mine.toml nests its values too deeply. Use the structure of a motor's TOML."),
        (b".".join([b"a"] * 40_000) + b" = 1", "mine.toml has a key of more than 32 dotted parts. {hint}"),
        (
            b"[" + b" . ".join([b'"a.b"', b"c"] * 20_000) + b"]",
            "mine.toml has a key of more than 32 dotted parts. {hint}",
        ),
        (b"", f"mine.toml must state its modes by exactly one of the tables {STATED}; it has none of them."),
    ],
)
def test_unreadable_file_is_rejected(content: bytes, sentence: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_bytes(content)
    with pytest.raises(ParameterError) as caught:
        load_motor(path)
    assert str(caught.value) == sentence.format(path=path, hint="Use the keys of a motor's TOML.")


# --- mistakes in a document ----------------------------------------------------------------------------------

TOP = (
    "name, description, ceramic, patches, tip, damping, law, drive, contacts, piezo, contact, rotor, slider, mount, "
    "limits, load, feedback, beam, solid, ring, modes, arms"
)
LEFT_OUT = {"friction": 0.2, "preload_n": 1.0}
MISTAKES: list[tuple[Document, str]] = [
    (changed(MODES, "rottor", {}), "there is no 'rottor'. Did you mean 'rotor'?"),
    (changed(MODES, "xyz", {}), f"there is no 'xyz'. Known are {TOP}."),
    (changed(MODES, "drive", {"kind": "three-phase"}), "drive.kind = 'three-phase' is not valid: it must be one of"),
    (changed(MODES, "drive", {"kind": ["two-phase"]}), "drive.kind = ['two-phase'] is not valid: it must be one of"),
    (changed(MODES, "drive", {"voltage": 5.0}), "[drive]: TwoPhaseDrive: frequency is missing"),
    (changed(MODES, "mount", {"mass_kg": 0.1}), "mount.stiffness_n_per_m is missing"),
    (changed(MODES, "modes.1.freq_hz", 2e4), "there is no 'modes.1.freq_hz'. Did you mean 'frequency_hz'?"),
    (changed(BEAM, "patches.0.layer", 2), "there is no 'patches.0.layer'. Did you mean 'layers'?"),
    (changed(MODES, "contact.friction", ...), "contact.friction is missing (coefficient of friction μ)."),
    (changed(MODES, "modes.0.mass_kg", ...), "modes.0.mass_kg is missing (modal mass m, "),
    (changed(MODES, "modes.0.stiffness_n_per_m", ...), "modes.0 has no frequency."),
    (changed(MODES, "modes.0.damping_n_s_per_m", ...), "modes.0 has no damping."),
    (changed(MODES, "modes.0.frequency_hz", 2e4), "modes.0 specifies both frequency_hz and stiffness_n_per_m"),
    (changed(MODES, "modes.0.quality_factor", 50.0), "modes.0 specifies both quality_factor and damping_n_s_per_m"),
    (changed(MODES, "modes.0.name", "side"), "two modes share a name"),
    (changed(MODES, "modes", {}), "modes must be one or more tables [[modes]]."),
    (changed(MODES, "modes", []), "modes must be one or more tables [[modes]]."),
    (changed(MODES, "modes.0", 5.0), "modes.0 must be a table [modes.0], not 5."),
    (changed(MODES, "modes", [MODE | {"name": f"m{i}"} for i in range(21)]), "21 entries; there may be 1 to 20."),
    (changed(MODES, "contact", [CONTACT]), "contact must be a table [contact], not ["),
    (changed(MODES, "tip", {}), "[tip] belongs to a [beam]; with [[modes]] leave it out."),
    (changed(ARMS, "ceramic", {}), "[ceramic] belongs to a [beam]; with [[arms]] leave it out."),
    (changed(BEAM, "tip", ...), "has a [beam] but no 'tip'"),
    (changed(BEAM, "patches", {}), "patches must be one or more tables [[patches]]."),
    (changed(BEAM, "patches.1.group", "C"), "patches.1.group = 'C' is not valid: it must be one of A, B."),
    (changed(BEAM, "patches.1.end_m", 0.012), "patches.1.end_m = 0.012 m must lie to the right of start_m = 0.013 m."),
    (changed(BEAM, "patches.1.end_m", 0.03), "patches.1.end_m = 0.03 m lies beyond beam.length_m = 0.025 m"),
    (changed(BEAM, "patches", [PATCH]), "none of the 1 belongs to group B"),
    (changed(BEAM, "damping", {"alpha_per_s": 0.0, "beta_s": 0.0}), "leave the modes undamped"),
    (changed(BEAM, "piezo.capacitance_a_f", 1e-9), "piezo.capacitance_a_f follows from [[patches]]"),
    (changed(MODES, "contact.materials", MATERIALS), "follows from [contact.materials]; leave out one of them."),
    (
        changed(MODES, "contact", LEFT_OUT | {"materials": MATERIALS | {"tip_poisson": 0.5}}),
        "contact.materials.tip_poisson = 0.5 is not valid",
    ),
    (changed(MODES, "contact", LEFT_OUT | {"lining": SOFT}), "[contact.lining]: specify one of stiffness_ratio"),
    (changed(MODES, "contact", LEFT_OUT | {"lining": BULK}), "area_m2 belongs to stiffness_n_per_m3 or"),
    (changed(MODES, "contact", LEFT_OUT | {"lining": ROUGH}), "exponent = 2 must be 1 with poisson"),
    (changed(MODES, "contact", LEFT_OUT | {"lining": STIFF}), "stiffness_ratio = 1: K is 1e+13 N/m^1; it must be"),
    (changed(MODES, "contact.normal_stiffness_n_per_m15", 2e13), "must be at most 1e+13 N/m^1.5 with exponent"),
    (changed(MODES, "contact.exponent", 4.0), "contact.exponent = 4 is not valid: it must be a number ≥ 1 and"),
    (changed(MODES, "contact", LEFT_OUT | {"materials": MATERIALS, "exponent": 2.0}), "exponent = 2 is not that"),
    (changed(ARMS, "arms.0.inductance_h", 1e-12), "the mode of arms.0.damping_n_s_per_m = 2.25e+12 N·s/m is not valid"),
    (changed(BEAM, "modes", [MODE]), f"exactly one of the tables {STATED}; it has beam and modes."),
    *((changed(MODES, key, ...), f"has no entry '{key}'") for key in ("name", "piezo", "contact")),
    (changed(MODES, "rotor", ...), "exactly one of the tables rotor, slider; it has none of them."),
    (changed(MODES, "slider", SLIDER), "exactly one of the tables rotor, slider; it has rotor and slider."),
    (changed(SLIDES, "slider.guide_friction_n", -1.0), "slider.guide_friction_n = -1 N is not valid"),
]


@pytest.mark.parametrize(("document", "reason"), MISTAKES, ids=[reason[:60] for _, reason in MISTAKES])
def test_a_mistake_is_named(document: Document, reason: str, load: Callable[[Document], Motor]) -> None:
    found = refusal(load, document)
    assert found.startswith("mine.toml")
    assert reason in found


def paths(document: Any, prefix: str = "") -> Iterator[str]:
    """Dotted paths of all numbers."""
    items = document.items() if isinstance(document, dict) else enumerate(document)
    for key, value in items:
        if isinstance(value, dict | list):
            yield from paths(value, f"{prefix}{key}.")
        elif not isinstance(value, str):
            yield f"{prefix}{key}"


NUMBERS = [(way, path) for way, document in WAYS.items() for path in paths(document)]
ALWAYS = [(way, path) for way, path in NUMBERS if way == "arms" or path.startswith(("beam.", "patches.0.", "modes.0."))]


@pytest.mark.parametrize(("way", "path"), mostly(pytest.mark.fuzz, NUMBERS, ALWAYS))
def test_a_wrong_number_is_named_with_its_path(way: str, path: str, load: Callable[[Document], Motor]) -> None:
    for wrong in (float("nan"), float("inf"), -1e30, 1e30, "1", True, [1.0], {}):
        sentence = refusal(load, changed(WAYS[way], path, wrong))
        assert sentence.startswith(f"mine.toml: {path} = ")
        assert " is not valid: it must be a " in sentence
        assert "number" in sentence


# --- anything at all -----------------------------------------------------------------------------------------

junk = st.recursive(
    st.one_of(
        st.booleans(), st.integers(-(2**70), 2**70), st.floats(), st.text(max_size=8), st.just("up"), st.just(""),
    ),
    lambda inner: st.one_of(
        st.lists(inner, max_size=3),
        st.dictionaries(st.one_of(st.text(max_size=8), st.just("value")), inner, max_size=3),
    ),
    max_leaves=6,
)  # fmt: skip


def loads_or_refuses(text: str, folder: Path) -> None:
    path = folder / "any.toml"
    path.write_bytes(text.encode("utf-8", errors="surrogatepass"))
    sentence = None
    try:
        subject = load_motor(path)
        assert subject.updated({}).to_dict() == subject.to_dict()
    except ParameterError as error:
        sentence = str(error)
    assert sentence is None or reads_well(sentence), sentence


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_damaged_document_loads_or_is_rejected(data: st.DataObject, tmp_path: Path) -> None:
    document: Document = copy.deepcopy(data.draw(st.sampled_from([MODES, MODES, ARMS, BEAM])))
    for _ in range(data.draw(st.integers(1, 3))):
        place: Any = document
        while True:
            keys = list(place) if isinstance(place, dict) else list(range(len(place)))
            if not keys:
                break
            key = data.draw(st.sampled_from(keys))
            if isinstance(place[key], dict | list) and data.draw(st.integers(0, 4)):
                place = place[key]
                continue
            deed = data.draw(st.sampled_from(["replace", "remove", "add"]))
            if deed == "remove":
                del place[key]
            elif deed == "add" and isinstance(place, dict):
                place[data.draw(st.text(max_size=8))] = data.draw(junk)
            else:
                place[key] = data.draw(junk)
            break
    loads_or_refuses(toml(document), tmp_path)


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(document=st.dictionaries(st.one_of(st.sampled_from(TOP.split(", ")), st.text(max_size=8)), junk, max_size=6))
def test_random_bytes_are_rejected(document: Document, tmp_path: Path) -> None:
    loads_or_refuses(toml(document), tmp_path)


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_beam_within_the_ranges_loads_or_is_rejected(data: st.DataObject, tmp_path: Path) -> None:
    beam = data.draw(within(Beam))
    length = beam["length_m"]
    patches = []
    for group, start, end in (("A", 0.0, 0.45), ("B", 0.5, 1.0)):
        patch = data.draw(within(Patch, group=st.just(group), faces=st.just("both"), layers=st.integers(1, 500)))
        patches.append(patch | {"start_m": start * length, "end_m": end * length})
    tip = data.draw(within(Tip)) | {"position_m": data.draw(st.floats(0.0, 1.0)) * length}
    document = BEAM | {"beam": beam, "patches": patches, "tip": tip, "damping": data.draw(within(Damping))}
    loads_or_refuses(toml(document), tmp_path)
