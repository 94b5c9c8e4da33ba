# SPDX-License-Identifier: GPL-3.0-or-later
"""What a motor is as data: its JSON shape, its changes by dotted paths, and what it refuses."""

import pickle
import re
from math import pi, sqrt
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from pyspice_runner.errors import ParameterError
from pyspice_runner.motor.load import load_motor
from pyspice_runner.motor.motor import Provenance
from tests.motor.toml_text import reads_well
from tests.motors import mode, motor, sliding


def leaves(document: dict[str, Any]) -> dict[str, float]:
    """Dotted path → value of every number; ``frequency_hz`` is left out where the stiffness says the same."""
    found = {f"{part}.{key}": value for part in ("piezo", "contact", "rotor") for key, value in document[part].items()}
    for index, item in enumerate(document["modes"]):
        numbers = {
            key: value for key, value in item.items() if key not in ("name", "frequency_hz") and value is not None
        }
        found |= {f"modes.{index}.{key}": value for key, value in numbers.items()}
    return found


# --- shape ---------------------------------------------------------------------------------------------------


def test_motor_is_frozen_hashable_by_value_and_survives_a_pickle() -> None:
    subject = motor()
    for owner, name in ((subject, "name"), (subject.contact, "preload_n"), (subject.modes[0], "mass_kg")):
        message = f"{type(owner).__name__}: {name} cannot be assigned. The method updated of the motor"
        with pytest.raises(ParameterError, match=message):
            setattr(owner, name, 1.0)
    assert pickle.loads(pickle.dumps(subject)) == subject == motor()


def test_frequency_and_quality_are_those_of_an_oscillator() -> None:
    item = mode("m", 33e3, 0.002, 123.0)
    assert item.frequency_hz == pytest.approx(33e3, rel=1e-14)
    assert item.quality_factor == pytest.approx(123.0, rel=1e-14)
    assert item.stiffness_n_per_m == pytest.approx(0.002 * (2 * pi * 33e3) ** 2)


# --- changes -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", leaves(motor().to_dict()))
def test_every_number_can_be_changed_by_its_path_and_nothing_else_moves(path: str) -> None:
    before = motor()
    value = leaves(before.to_dict())[path]
    changed = before.updated({path: 1.01 * value})
    after = leaves(changed.to_dict())
    assert after.pop(path) == 1.01 * value
    expected = leaves(before.to_dict())
    expected.pop(path)
    assert after == expected
    assert before == motor()
    assert changed.provenance[path] == Provenance("set", "by the user")
    assert changed.updated({path: value}).to_dict() == before.to_dict()


@pytest.mark.parametrize("which", ["1", "pull"])
def test_a_mode_is_named_or_numbered(which: str) -> None:
    changed = motor().updated({f"modes.{which}.tip_x": 3.5})
    assert [item.tip_x for item in changed.modes] == [0.1, 3.5, -0.6]
    assert changed.provenance["modes.1.tip_x"].kind == "set"


def test_new_frequency_keeps_mass_and_damping() -> None:
    before = motor()
    changed = before.updated({"modes.push.frequency_hz": 25e3, "modes.push.mass_kg": 0.005, "name": "lighter"})
    item = changed.modes[0]
    assert changed.name == "lighter"
    assert item.mass_kg == 0.005
    assert item.frequency_hz == pytest.approx(25e3, rel=1e-14)
    assert item.damping_n_s_per_m == before.modes[0].damping_n_s_per_m


SPRINGS = {"stiffness_n_per_m": 2e4, "mass_kg": 0.05, "damping_n_s_per_m": 50.0}


def test_a_mount_is_put_in_changed_and_taken_out() -> None:
    held = motor().updated({"mount": None})
    assert held.to_dict()["mount"] is None
    sprung = held.updated({"mount": SPRINGS})
    assert sprung.to_dict()["mount"] == SPRINGS
    assert sprung.to_dict() == held.updated({f"mount.{name}": value for name, value in SPRINGS.items()}).to_dict()
    softer = sprung.updated({"mount.stiffness_n_per_m": 1e4})
    assert softer.to_dict()["mount"] == SPRINGS | {"stiffness_n_per_m": 1e4}
    assert softer.mount.frequency_hz == pytest.approx(sqrt(1e4 / 0.05) / (2 * pi), rel=1e-15)
    assert softer.updated({"mount": None}).to_dict() == held.to_dict()
    with pytest.raises(ParameterError, match=r"mount\.mass_kg is missing"):
        held.updated({"mount.stiffness_n_per_m": 2e4})
    with pytest.raises(ParameterError, match=r"mount must be"):
        held.updated({"mount": 2e4})
    with pytest.raises(ParameterError, match=r"Did you mean 'mount.mass_kg'"):
        sprung.updated({"mount.mass": 0.1})
    with pytest.raises(ParameterError, match=r"mount\.stiffness_n_per_m = -1"):
        sprung.updated({"mount.stiffness_n_per_m": -1.0})


def test_modes_stay_sorted_and_their_provenance_moves_along() -> None:
    changed = motor().updated({"modes.0.frequency_hz": 50e3})
    assert [item.name for item in changed.modes] == ["pull", "push", "turn"]
    again = changed.updated({"modes.push.tip_y": 0.8})
    assert set(again.provenance) == {"modes.1.frequency_hz", "modes.1.tip_y"}


def test_structure_is_forgotten_when_a_mode_no_longer_follows_from_it() -> None:
    paper = load_motor("andersen2002")
    assert paper.structure is not None
    assert paper.updated({"contact.preload_n": 3.0}).structure == paper.structure
    assert paper.updated({"modes.0.damping_n_s_per_m": 10.0}).structure is None


# --- refusals ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"contact.preload": 5.0}, "There is no parameter 'contact.preload'. Did you mean 'contact.preload_n'?"),
        ({"modes.turn.tipx": 5.0}, "There is no parameter 'modes.turn.tipx'. Did you mean 'modes.2.tip_x'?"),
        ({"structure.beam.length_m": 1.0}, "Paths are those of `piezomotor show --json`"),
        ({"contact": {}}, "There is no parameter 'contact'."),
        ({"modes": []}, "There is no parameter 'modes'."),
        ({"modes.0": {}}, "There is no parameter 'modes.0'."),
        *(({f"modes.{number}.tip_x": 1.0}, "There is no parameter 'modes") for number in ("3", "-1", "²", "0x0", "")),
        ({"modes.1.name": "push"}, "two modes share a name"),
        ({"modes.0.tip_x": 1.0, "modes.push.tip_x": 2.0}, "modes.0.tip_x is changed twice"),
        ({"modes.0.frequency_hz": 2e4, "modes.push.stiffness_n_per_m": 1e7}, "the stiffness are both changed"),
        ({"modes.0.frequency_hz": 1e12}, "modes.0.frequency_hz = 1e+12 Hz is not valid: it must be a number ≥ 10 and"),
        ({"modes.1.damping_n_s_per_m": 1e8}, "mode pull has the quality factor 7.728e-06"),
        ({"modes.1.damping_n_s_per_m": 1e-6}, "mode pull has the quality factor 7.728e+08"),
        ({"modes.0.stiffness_n_per_m": 0.004 * (18.0 * pi) ** 2}, "mode push has the natural frequency 9 Hz"),
        ({"modes.0.frequency_hz": 60.0, "modes.0.damping_n_s_per_m": 0.01}, "the modes reach from 60 to 6.6e+04 Hz"),
        ({"modes.0.coupling_b_n_per_v": 2.0}, "the modes give group B a coupling k_eff² = 0.96"),
        ({"rotor.inertia_kg_m2": 5e-13}, "the rotor at its rim or the carrier has too little mass"),
        ({"contact.tangential_compliance_tip_m_per_n23": 5e-3}, "do not go together: K_t K_N^(2/3) = 1.26e+04"),
        ({"contact.preload_n": 9e4}, "contact.preload_n = 90000 N presses the tip 0.00183 m into the rotor"),
        ({"name": "a/b"}, "name = 'a/b' is not valid: it must be a text of at most 60 letters"),
    ],
)
def test_an_invalid_change_is_explained(changes: dict[Any, Any], reason: str) -> None:
    with pytest.raises(ParameterError) as caught:
        motor().updated(changes)
    assert reason in str(caught.value)
    assert reads_well(str(caught.value))


@settings(max_examples=200, deadline=None)
@example(changes={". A": None})
@given(
    changes=st.dictionaries(
        st.one_of(
            st.text(max_size=20),
            st.sampled_from([*leaves(motor().to_dict()), "name", "modes.0.name", "modes.1.frequency_hz"]),
        ),
        st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=10), st.lists(st.floats())),
        max_size=4,
    )
)
def test_any_change_gives_a_motor_or_one_clear_refusal(changes: dict[str, Any]) -> None:
    sentence = None
    try:
        motor().updated(changes)
    except ParameterError as error:
        sentence = str(error)
    assert sentence is None or reads_well(sentence), sentence


@pytest.mark.parametrize("name", ["andersen2002", "bimodal40"])
def test_the_contact_follows_the_radius_of_the_rotor_and_the_materials(name: str) -> None:
    base = load_motor(name)
    pair = base.materials
    compliances = [
        (1.0 - nu**2) / modulus
        for modulus, nu in (
            (pair.tip_youngs_modulus_pa, pair.tip_poisson), (pair.rotor_youngs_modulus_pa, pair.rotor_poisson)
        )
    ]  # fmt: skip
    base = base.updated({"contact.materials.on_face": False})
    there = base.updated({"rotor.radius_m": 0.003, "contact.materials.tip_radius_m": 0.006})
    assert there.contact.effective_radius_m == pytest.approx(0.002, rel=1e-12)
    stiffness = 4.0 / 3.0 / sum(compliances) * sqrt(0.002)  # Hertz
    assert there.contact.normal_stiffness_n_per_m15 == pytest.approx(stiffness, rel=1e-12)
    ratio = 0.002 / (base.contact.effective_radius_m or 0.0)
    for body in ("tip", "rotor"):  # K_t goes with R* to the power of -1/3
        entry = f"tangential_compliance_{body}_m_per_n23"
        expected = getattr(base.contact, entry) * ratio ** (-1 / 3)
        assert getattr(there.contact, entry) == pytest.approx(expected, rel=1e-9)
    back = {"rotor.radius_m": base.rotor.radius_m, "contact.materials.tip_radius_m": pair.tip_radius_m}
    assert there.updated(back).contact == base.contact


def test_a_constant_of_the_contact_that_was_set_does_not_follow() -> None:
    own = load_motor("bimodal40").updated({"contact.normal_stiffness_n_per_m15": 2e10})
    there = own.updated({"rotor.radius_m": 0.012, "contact.materials.on_face": False})
    assert there.contact.normal_stiffness_n_per_m15 == 2e10
    assert there.contact.effective_radius_m == pytest.approx(1.0 / (1.0 / 0.01456 + 1.0 / 0.012))


def test_on_the_face_of_a_rotor_the_effective_radius_is_that_of_the_tip() -> None:
    face = load_motor("bimodal40")
    assert face.contact.effective_radius_m == pytest.approx(0.01456, rel=1e-12)
    assert face.updated({"rotor.radius_m": 0.012}).contact == face.contact
    again = load_motor("andersen2002").updated({"contact.materials.on_face": True})
    assert again.contact.effective_radius_m == pytest.approx(again.materials.tip_radius_m, rel=1e-12)


def test_the_face_of_a_rotor_is_refused_on_a_slider() -> None:
    with pytest.raises(ValueError, match=r"contact\.materials\.on_face is for a rotor.*leave it out"):
        sliding(load_motor("bimodal40"))
    off_face = load_motor("bimodal40").updated({"contact.materials.on_face": False})
    with pytest.raises(ParameterError, match=r"contact\.materials\.on_face is for a rotor.*leave it out"):
        sliding(off_face).updated({"contact.materials.on_face": True})


def test_a_saved_motor_keeps_the_materials_of_its_contact(tmp_path: Path) -> None:
    base = load_motor("andersen2002")
    (tmp_path / "saved.toml").write_text(base.to_toml())
    saved = load_motor(tmp_path / "saved.toml")
    assert saved.contact == base.contact
    change = {"rotor.radius_m": 0.003}
    assert saved.updated(change).contact == base.updated(change).contact


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("contact.effective_radius_m", "Change contact.materials.tip_radius_m or rotor.radius_m instead."),
        ("contact.poisson", "Change contact.materials.tip_poisson instead."),
        ("beam.length_m", "Change it in the file or by --set, or change the modes themselves"),
    ],
)
def test_a_value_that_follows_from_others_is_refused_with_the_path_to_use(path: str, message: str) -> None:
    with pytest.raises(ParameterError, match=re.escape(message)):
        load_motor("bimodal40").updated({path: 0.1})
