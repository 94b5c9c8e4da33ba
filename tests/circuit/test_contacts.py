# SPDX-License-Identifier: GPL-3.0-or-later
"""Motors with several contacts in ngspice."""

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.run.paths import parameter
from pyspice_runner.spice.library import data_path
from tests.rings import loaded, plain, ring, with_contacts
from tests.runs import simulated

MOTORS = ("bimodal40", "examples/plate40.toml")
DURATION = 4e-4


def tail(motor, **settings):
    """Return a run from rest, without its estimate."""
    return simulated(motor, pr.default_drive(motor), duration=DURATION, **settings)


def difference(run, other):
    """Return the largest difference of two runs in any column, over the maximum of the column."""
    columns = ("rotor_speed_rad_s", "normal_force_n", "friction_force_n", "current_a_a", "tip_x_m")
    pairs = [(getattr(run, column), getattr(other, column)) for column in columns]
    return max(np.abs(ours - theirs).max() / np.abs(theirs).max() for ours, theirs in pairs)


@pytest.mark.parametrize("name", MOTORS)
def test_one_entry_is_the_motor_itself(name, tmp_path):
    motor = pr.load_motor(name)
    document = plain(motor)
    same = with_contacts(motor, {})
    assert same.model_dump() == document
    with pytest.raises(pr.ParameterError, match=r"contacts must be one or more tables \[\[contacts\]\]"):
        with_contacts(motor)
    with pytest.raises(pr.ParameterError, match="no mode moves the tip"):
        motor.updated({f"modes.{mode.name}.{axis}": 0.0 for mode in motor.modes for axis in ("tip_x", "tip_y")})
    text = same.to_toml()
    assert loaded(tmp_path, text).model_dump() == document


@pytest.mark.parametrize("name", MOTORS)
def test_two_equal_contacts_are_one_with_twice_the_points(name):
    motor = pr.load_motor(name)
    both, twice = with_contacts(motor, {}, {}), with_contacts(motor, {"multiplicity": 2})
    runs = [tail(one, load_torque=1e-3) for one in (both, twice)]
    assert difference(*runs) < 1e-5  # the iteration closes to 1e-6
    halves = [runs[0].of_contacts[f"normal_force_contact{number}_n"] for number in (1, 2)]
    assert halves[0] == pytest.approx(halves[1], abs=1e-9)
    assert sum(halves) == pytest.approx(runs[0].normal_force_n, abs=1e-9)


@pytest.mark.parametrize("name", MOTORS)
def test_a_law_given_at_each_contact_is_that_of_the_motor(name, tmp_path):
    copied, motor = tmp_path / "copied.lib", with_contacts(pr.load_motor(name), {"name": "left"}, {"name": "right"})
    file = data_path("behavioral") / "piezomotor_coulomb.lib"
    copied.write_text(file.read_text(encoding="utf-8"), encoding="utf-8")
    reference = tail(motor.updated({"law.creep": 0.02}), load_torque=1e-3, contact="coulomb")
    for left, right in (("coulomb", "coulomb"), ("coulomb", str(copied)), (str(file), str(copied))):
        own = {"contacts.left.law": {"name": left, "creep": 0.02}, "contacts.1.law": right}
        run = tail(motor.updated(own | {"contacts.right.law.creep": 0.02}), load_torque=1e-3)
        assert run.summary()["contact law"] == f"spring-slider, left: {left}, right: {right}"
        assert difference(run, reference) <= 1e-12


def test_a_ring_mirrors_with_its_phase_and_turns_with_its_electrodes(tmp_path):
    motor = ring(tmp_path)
    drive = pr.default_drive(motor)
    ahead = simulated(motor, drive, duration=1.5e-3)
    behind = simulated(motor, drive.updated({"phase_deg": -90.0}), duration=1.5e-3)
    turned = simulated(ring(tmp_path, turn=0.25 * np.pi), drive, duration=1.5e-3)
    speed = ahead.rotor_speed_rad_s
    assert speed[-1] > 0.5
    assert np.abs(speed + behind.rotor_speed_rad_s).max() < 2e-5 * speed.max()
    assert np.abs(speed - turned.rotor_speed_rad_s).max() < 2e-5 * speed.max()  # by one point of eight


@pytest.mark.parametrize("held", [False, True], ids=["on a carrier", "at a distance"])
def test_the_energy_of_unequal_contacts_balances(held):
    motor = pr.load_motor("bimodal40").updated({"contact.tangential_series_compliance_m_per_n": 2e-9})
    motor = motor.updated({"mount": None}) if held else motor
    back = {mode.name: -0.8 * mode.tip_x for mode in motor.modes}
    places = (
        {"name": "front", "share": 0.6},
        {"name": "back", "share": 0.4, "radius_m": 0.012, "direction": -1, "tip_x": back, "height_m": -5e-8,
         "contact": {"friction": 0.5, "restitution": 0.8}},
    )  # fmt: skip
    run = tail(motor := with_contacts(motor, *places))
    assert run.energy_residual < 2e-3
    assert pr.drive_report(motor, pr.Driver("linear", voltage=60.0, frequency=40.7e3), DURATION).audit.passed
    assert run.audit.passed
    forces = [run.of_contacts[f"normal_force_{name}_n"] for name in ("front", "back")]
    assert forces[1][0] < 0.4 * motor.contact.preload_n  # it stands back
    assert sum(run.state_fractions.values()) == pytest.approx(1.0)
    torque = run.of_contacts["friction_force_front_n"] + 0.8 * run.of_contacts["friction_force_back_n"]
    assert torque == pytest.approx(run.friction_force_n, abs=1e-6)


@pytest.mark.parametrize(("name", "height"), [("examples/plate40.toml", 0.0), ("bimodal40", 1e-7), ("bimodal40", 1e-3)])
def test_contacts_rest_at_their_shares_and_heights_at_once(name, height):
    shares, drive = {"left": 0.3, "right": 0.7}, pr.TwoPhaseDrive(0.0, 40e3, 90.0)
    motor = with_contacts(pr.load_motor(name), *({"name": side, "share": share} for side, share in shares.items()))
    own, total, motor = motor.contact, motor.contact.preload_n, motor.updated({"contacts.left.height_m": height})
    run = pr.simulate(motor, drive, duration=1e-4)
    assert run.error_estimate == 0.0  # of a tip that does not move
    forces = np.array([run.of_contacts[f"normal_force_{side}_n"] for side in shares])
    assert forces[:, 0].sum() == pytest.approx(total, rel=1e-9)
    assert forces == pytest.approx(np.tile(forces[:, :1], forces.shape[1]), abs=1e-6 * total)
    assert parameter("contacts.left.height_m", motor, drive, {}).nominal == height
    settled = [contact["normal_force_n"] for contact in pr.steady_state(motor, drive, speed=0.0).contacts]
    assert settled == pytest.approx(forces[:, 0], abs=3e-6 * total)  # the iteration of ngspice
    # how much deeper the left tip is than the right one, which moves alike, by Hertz's law and what is in series
    borne = np.array([forces[:, 0], [share * total for share in shares.values()]])
    deep = (borne / own.normal_stiffness_n_per_m15) ** (2.0 / 3.0) + own.series_compliance_m_per_n * borne
    stands = deep[0, 0] - deep[1, 0] - deep[0, 1] + deep[1, 1]
    touches = height < 1e-3
    assert stands == pytest.approx(height, abs=1e-12) if touches else stands < height
    assert [forces[1, 0] > 0.0, "from the rotor" not in str(motor.cautions)] == [touches, touches]


def test_the_pressed_admittance_follows_from_the_matrices(tmp_path):
    motor = ring(tmp_path).updated({"contact.restitution": 1.0, "piezo.loss_tangent": 0.0})
    found = pr.admittance(motor, start=35e3, stop=45e3, points=201, state="preloaded")
    expected = motor.pressed_stator.admittance(2.0 * np.pi * found.frequency_hz)
    assert np.abs(found.matrix_s[:, 0, 0] - expected[:, 0, 0]).max() < 1e-3 * np.abs(expected[:, 0, 0]).max()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"contacts.p2.share": 0.3}, "sum to 0.3, without one for p1, p3"),
        ({"contacts.p2.contact.preload_n": 1.0}, "specify share"),
        ({"contacts.p1.direction": -1}, "the first contact defines forward"),
        ({"contacts.p2.contact.friction": -1.0}, "contacts.p2.contact.friction = -1"),
        ({"modes.0.tip_x": 1.0}, "follows from contacts.0"),
        ({"contacts.p2.direction": True}, "contacts.p2.direction = 'true' is not valid: it must be one of 1, -1"),
        ({"contacts.p9.height_m": 0.0}, "The contacts of .* are p1, p2"),
        ({"contacts.p2.tip_x.sine": 1e9}, r"p2.tip_x.sine = 1e\+09 is not valid: it must be a number ≥ -10000 and ≤"),
        ({"contacts.p2.law": "brush"}, "The contact brush of p2 is for a motor with one contact"),
        ({"contacts.p2.law": "sandpaper"}, "contacts.p2.law: contact = 'sandpaper' is not valid"),
        ({"contacts.p2.law.creep": 0.02}, "contacts.p2.law: law.creep is not a parameter of the contact law spring-sl"),
        ({"contacts.p2.law": "coulomb"}, "contacts.p2.law = 'coulomb' has no averaged model"),
    ],
)
def test_a_mistake_in_a_contact_is_named(changes, words, tmp_path):
    motor = ring(tmp_path)
    with pytest.raises(pr.ParameterError, match=words):
        pr.simulate_averaged(motor.updated(changes), pr.default_drive(motor), DURATION)
