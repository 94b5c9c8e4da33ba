# SPDX-License-Identifier: GPL-3.0-or-later
"""A motor from a ``[solid]``: its modes, supports, stress and cache, and what a wrong table is told."""

import sys
import tomllib
from math import pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.linalg import eigh

import pyspice_runner as pr
from pyspice_runner.motor import strength
from pyspice_runner.motor.load import SETS, changed_motor
from pyspice_runner.motor.solid import stator
from pyspice_runner.motor.solid.elements import assemble, factor
from pyspice_runner.motor.solid.materials import cards
from pyspice_runner.motor.solid.parameters import Solid, solid_from
from pyspice_runner.motor.solid.stator import Stator, solve_stator
from pyspice_runner.motor.thermal import heat_capacity_of_boxes
from pyspice_runner.view.datasheet import parameter_rows
from tests.rings import loaded
from tools.stators import solids, write_stators

PLATE = Path(__file__).parents[3] / "examples" / "plate40.toml"
POINT = {"from_m": [0.0, 0.0, 0.0], "to_m": [0.0, 0.0, 0.003]}
CARD = cards()["PZT-4"]
SINGULAR = {"s11": 12.3, "s12": -12.3, "s13": -5.31, "s33": 15.5, "s44": 39.0}


def plate(**changes: Any) -> Solid:
    """Return the plate of the examples with some entries changed."""
    table = tomllib.loads(PLATE.read_text(encoding="utf-8"))["solid"]
    for name in ("element_m", "lowest_hz", "highest_hz", "quality_factor"):
        table[name] = table[name]["value"]
    for box in table["boxes"]:
        box["to_m"] = box["to_m"]["value"]
    return solid_from(table | changes, "plate")


@pytest.fixture(autouse=True)
def own_cache(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """Compute each stator once for all tests of this file, away from the user's cache."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.getbasetemp() / "stators"))


def test_a_plate_becomes_a_motor_with_its_two_modes_at_one_frequency() -> None:
    # an independent thin-plate model of the same plate: 39.64 and 40.03 kHz, 5.2 and 3.1 g at the tip, 0.109 and
    # 0.061 N/V per displacement of the tip; to the printed digits
    motor = pr.load_motor(PLATE)
    _, along, across = motor.modes
    assert [along.frequency_hz, across.frequency_hz] == pytest.approx([39.64e3, 40.03e3], rel=3e-4)
    expected = [5.2e-3, 3.1e-3]
    assert [along.mass_kg / along.tip_y**2, across.mass_kg / across.tip_x**2] == pytest.approx(expected, rel=0.02)
    assert [along.coupling_a_n_per_v, along.coupling_b_n_per_v] == pytest.approx(2 * [0.109], rel=5e-3)
    assert across.coupling_a_n_per_v / across.tip_x == pytest.approx(0.061, rel=5e-3)
    assert across.coupling_a_n_per_v == pytest.approx(-across.coupling_b_n_per_v, rel=1e-6)
    assert along.tip_x == across.tip_y == 0.0
    assert [mode.recoil_kg for mode in motor.modes] == [0.0, 0.0, 0.0]  # a free plate moves about its centre of mass
    assert along.quality_factor == pytest.approx(400.0)
    assert motor.solid is not None
    assert motor.updated({"contact.preload_n": 10.0}).solid == motor.solid
    assert motor.updated({"modes.0.quality_factor": 300.0}).solid is None
    assert pr.admittance(motor, start=30e3, stop=50e3, points=50).matrix_s.shape[0] == 50


def test_modes_and_residuals_add_up_to_the_answer_of_the_whole_solid() -> None:
    # with all modes up to 200 kHz in the motor, and with three: the same answer at 10 kHz
    answers = []
    for highest in (60e3, 200e3):
        found = solve_stator(plate(highest_hz=highest, lowest_hz=10.0))
        dynamic = found.stiffnesses_n_per_m - (2 * pi * 10e3) ** 2 * found.masses_kg
        motion = np.vstack([found.tip_y, found.tip_x])
        theta, left_out = found.couplings_n_per_v, (found.residual_m_per_n, found.residual_f, found.residual_m_per_v)
        pairs = zip(((motion, motion), (theta, theta), (motion, theta)), left_out, strict=True)
        answers.append([(one / dynamic) @ other.T + static for (one, other), static in pairs])
    few, many = np.array(answers)
    # the modes left out are static: (10 kHz)²/(63 kHz)² of the first of them
    for index in (0, 1, 2):
        assert few[index] == pytest.approx(many[index], abs=0.03 * np.abs(many[index]).max())


@pytest.mark.soak
def test_the_plate_in_its_plane_and_in_three_dimensions_agree() -> None:
    flat = solve_stator(plate())
    gap = 0.25e-3
    electrodes = []
    for electrode in plate().electrodes:
        inner = [[x, y, z] for x, y, z in (electrode.from_m, electrode.to_m)]
        if electrode.group != "ground":
            for corner, sign in ((inner[0], 1.0), (inner[1], -1.0)):
                for axis, middle in ((0, 0.0205), (1, 0.00575)):
                    corner[axis] += sign * gap * (corner[axis] == middle)
        electrodes.append({"group": electrode.group, "from_m": inner[0], "to_m": inner[1]})
    solid = solve_stator(plate(theory="solid", element_m=3e-3, electrodes=electrodes))
    for index, moves in ((1, "tip_y"), (2, "tip_x")):
        other = int(np.argmax(np.abs(getattr(solid, moves)) * (solid.frequencies_hz > 30e3)))
        assert solid.frequencies_hz[other] == pytest.approx(flat.frequencies_hz[index], rel=2e-3)
        # thickness over length, and the fringing field of electrodes with a gap: within 2 %
        expected = np.abs(flat.couplings_n_per_v[:, index])
        assert np.abs(solid.couplings_n_per_v[:, other]) == pytest.approx(expected, rel=0.02)


def test_all_modes_are_found_and_those_of_one_frequency_each_on_its_own() -> None:
    # by a dense solver, of a free and of a clamped bar of square section, which bends alike in two directions; six
    # rigid motions have one frequency. Rounding of that solver: 1e-16 of the greatest ω², which is 1e6 of the shift
    low, high = [0.0, 0.0, 0.0], [0.02, 0.004, 0.004]
    bar = {
        "theory": "solid", "element_m": 0.004,
        "boxes": [{"material": "PZT-4", "from_m": low, "to_m": high, "polarisation": "+x"}],
        "contact": {"from_m": [0.02, 0.0, 0.0], "to_m": high, "normal": "+x", "tangent": "+y"},
        "electrodes": [
            {"group": "A", "from_m": [0.02, 0.0, 0.0], "to_m": high},
            {"group": "B", "from_m": [0.008, 0.004, 0.0], "to_m": [0.012, 0.004, 0.004]},
            {"group": "ground", "from_m": low, "to_m": [0.0, 0.004, 0.004]},
        ],
    }  # fmt: skip
    for supports in ([], [{"from_m": low, "to_m": [0.0, 0.004, 0.004]}]):
        geometry = stator.build_geometry(plate(**bar, supports=supports))
        stiffness, mass = assemble(geometry.basis, geometry.parts, geometry.place, geometry.size)
        inner, count = slice(0, geometry.size - 2), geometry.displacements
        system, heavy = stiffness[inner, inner].toarray(), mass[:count, :count]
        shift, highest = -((0.5 * pi * 200e3) ** 2), (2 * pi * 200e3) ** 2
        solve = factor(stiffness[inner, inner] - shift * mass[inner, inner])
        found, vectors = stator.lowest_modes(solve, heavy.tocsr(), len(system), shift, highest)
        between = system[:count, count:] @ np.linalg.solve(system[count:, count:], system[count:, :count])
        wanted = eigh(system[:count, :count] - between, heavy.toarray(), eigvals_only=True)
        assert len(found) == max(24, (wanted < highest).sum() + 1)
        assert found == pytest.approx(wanted[: len(found)], abs=1e-8 * -shift)
        assert vectors[:count].T @ heavy @ vectors[:count] == pytest.approx(np.eye(len(found)), abs=1e-9)


def test_a_block_on_springs_swings_with_its_whole_mass() -> None:
    # √(k/M), with M the recoil of a body that moves as a whole
    held = [{"from_m": [0.0, 0.0, 0.0], "to_m": [0.0, 0.0115, 0.003], "directions": "x", "stiffness_n_per_m": 1e4}]
    held += [{"from_m": [x, 0.0, 0.0], "to_m": [x, 0.0115, 0.003], "directions": "y"} for x in (0.0, 0.041)]
    found = solve_stator(plate(supports=held, lowest_hz=10.0))
    mass = 7500 * 0.041 * 0.0115 * 0.003 + 3900 * 0.002 * 0.004 * 0.003
    assert found.mass_kg == pytest.approx(mass, rel=1e-9)
    assert found.frequencies_hz[0] == pytest.approx(sqrt(1e4 / mass) / (2 * pi), rel=1e-3)
    assert found.recoil_kg[0] == pytest.approx(mass, rel=1e-3)
    free = solve_stator(plate())  # orthogonal to it
    for recoil in (free.recoil_kg, free.recoil_x_kg):
        assert recoil == pytest.approx(np.zeros(3), abs=1e-9 * mass)
    turned = [{**support, "directions": "y" if support["directions"] == "x" else "x"} for support in held]
    sideways = solve_stator(plate(supports=turned, lowest_hz=10.0))
    assert abs(sideways.recoil_x_kg[0]) == pytest.approx(mass, rel=1e-3)
    assert sideways.recoil_kg[0] == pytest.approx(0.0, abs=0.05 * mass)


def test_the_stress_of_the_ceramic_follows_the_strain_of_a_bar() -> None:
    # u = sin(π(x − L/2)/L): σ = πu/(L s₁₁) in the middle; the mean over an element of L/40 loses 1e-3
    length, height, thickness = 0.04, 0.001, 0.001
    found = solve_stator(
        plate(
            boxes=[{"material": "PZT-4", "from_m": [0.0, 0.0, 0.0], "to_m": [length, height, thickness]}],
            contact={"from_m": [length, 0.0, 0.0], "to_m": [length, height, 0.0], "normal": "+x", "tangent": "+y"},
            electrodes=[
                {"group": group, "from_m": [a, 0.0, z], "to_m": [b, height, z]}
                for group, a, b, z in (
                    ("A", 0.0, 0.02, thickness), ("B", 0.02, length, thickness), ("ground", 0.0, length, 0.0)
                )
            ],
        )
    )  # fmt: skip
    along = int(np.argmax(found.tip_y))
    assert np.abs(found.stress_pa_per_m[:, along]).max() == pytest.approx(pi / length / 12.3e-12, rel=5e-3)
    assert np.abs(found.strain_per_m[:, along]).max() == pytest.approx(pi / length, rel=5e-3)


def test_a_motor_of_a_solid_knows_its_stress() -> None:
    found = strength.peak_of_amplitudes(pr.load_motor(PLATE), [0.0, 1e-6, 0.0])
    assert found["ceramic_stress_pa"] == pytest.approx(pi * 1e-6 / 0.041 / 12.3e-12, rel=0.1)  # a bar of that length
    assert found["ceramic_strain"] == pytest.approx(pi * 1e-6 / 0.041, rel=0.1)


def test_a_stator_is_computed_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    stator.stator_of.cache_clear()
    first = pr.load_motor(PLATE)
    stator.stator_of.cache_clear()
    with monkeypatch.context() as without:
        without.setattr(stator, "solve_stator", lambda _: pytest.fail("computed again"))
        assert pr.load_motor(PLATE).to_dict() == first.to_dict()
    (stored,) = tmp_path.rglob("*.npz")
    stored.write_bytes(stored.read_bytes()[:1000])  # a damaged file is computed again
    stator.stator_of.cache_clear()
    assert pr.load_motor(PLATE).to_dict() == first.to_dict()
    assert changed_motor(PLATE, {"solid.quality_factor": 200.0}).modes[0].quality_factor == pytest.approx(200.0)


def test_a_bundled_stator_needs_no_finite_elements(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(stator, "BUNDLED", tmp_path)
    computed = solve_stator(plate())
    (tmp_path / "0123456789abcdef.npz").write_text("of a set that has changed")
    (written,) = write_stators([PLATE], tmp_path)
    assert list(tmp_path.iterdir()) == [written]
    assert written.stat().st_size < 100_000
    monkeypatch.setitem(sys.modules, "skfem", None)
    stator.stator_of.cache_clear()
    assert pr.load_motor(PLATE).modes[1].frequency_hz == pytest.approx(39.64e3, rel=3e-4)
    assert_same(stator.stator_of(plate()), computed)
    with pytest.raises(pr.ParameterError, match="pip install"):
        changed_motor(PLATE, {"solid.element_m": 0.002})
    stator.stator_of.cache_clear()
    assert not (tmp_path / "cache").exists()


def test_the_bundled_stators_are_those_of_the_bundled_sets() -> None:
    wanted = solids(sorted(SETS.glob("*.toml")))
    assert {path.name for path in stator.BUNDLED.glob("*")} == set(wanted), "run python -m tools.stators"
    for solid in wanted.values():
        assert_same(stator.stator_of(solid), solve_stator(solid))


def assert_same(bundled: Stator, found: Stator) -> None:
    # the sums of another BLAS differ by rounding, which the condition of the matrix magnifies to some 1e-8; of float32
    # are the nodes and shapes. The sign of a mode that does not move the contact is arbitrary.
    assert bundled.frequencies_hz == pytest.approx(found.frequencies_hz, rel=1e-6)
    sign = np.sign((bundled.shapes * found.shapes).sum(axis=(0, 1)))
    signed, mesh = ("couplings_n_per_v", "tip_x", "tip_y", "shapes"), ("nodes_m", "cells", "mass_kg")
    others = ("masses_kg", "clamped_f", "residual_f", "residual_m_per_n", "residual_m_per_v", *mesh)
    pairs = [(getattr(bundled, name), getattr(found, name) * sign) for name in signed]
    pairs += [(getattr(bundled, name), getattr(found, name)) for name in others]
    pairs += [(np.abs(stator.stress_pa_per_m).max(axis=0) for stator in (bundled, found))]  # at points that may differ
    for read, computed in pairs:
        assert read == pytest.approx(computed, abs=1e-5 * np.abs(computed).max())
    for name in ("recoil_kg", "recoil_x_kg"):  # 0 of a free body but for rounding
        computed = getattr(found, name) * sign
        assert getattr(bundled, name) == pytest.approx(computed, abs=1e-6 * float(found.mass_kg))


def test_the_circuit_has_the_capacitance_matrix_of_the_solid(monkeypatch: pytest.MonkeyPatch) -> None:
    found = vars(solve_stator(plate()))
    clamped = found["clamped_f"] + np.array([[0.0, -1e-10], [-1e-10, 0.0]])
    monkeypatch.setattr("pyspice_runner.motor.load.stator_of", lambda _: Stator(**found | {"clamped_f": clamped}))
    piezo = pr.load_motor(PLATE).piezo
    matrix = clamped + found["residual_f"]
    assert [piezo.capacitance_a_f, piezo.capacitance_b_f] == pytest.approx(np.diag(matrix).tolist(), rel=1e-12)
    assert piezo.capacitance_ab_f == pytest.approx(-matrix[0, 1], rel=1e-12)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"element_m": 1e-5}, r"gives 4945000 elements; the limit is 20000, so raise it"),
        ({"lowest_hz": 70e3}, r"lowest_hz = 70000 Hz must lie below highest_hz = 60000 Hz"),
        ({"lowest_hz": 50e3}, r"no mode from solid.lowest_hz = 50000 .* its lowest are at 1.849e\+04, 3.964e\+04"),
        ({"elements": 3}, r"there is no 'solid.elements'. Did you mean 'element_m'"),
        ({"boxes": {}}, r"solid.boxes must be one or more tables \[\[solid.boxes\]\]"),
        ({"boxes": [POINT | {"material": "PZT-4"}]}, r"solid.boxes.0.from_m and to_m have the same x = 0 m"),
        ({"materials": {"PZT-4": CARD}}, r"solid.materials.PZT-4 is a material of the library; choose another name"),
        ({"materials": {"own": CARD | {"poisson": 0.3}}}, r"own.youngs_modulus_pa and poisson of a metal, or compli"),
        ({"materials": {"own": CARD | {"charge": {"d31": 1.0}}}}, r"own.charge.d33 is missing \(d₃₃, in 1e-12 C/N\)"),
        ({"materials": {"own": CARD | {"compliance": SINGULAR}}}, r"with charge and permittivity gives no stable mat"),
        ({"boxes": [POINT | {"material": "PZT4", "to_m": [0.01] * 3}]}, r"material = 'PZT4' is not known; there are"),
        ({"contact": POINT | {"normal": "+x", "tangent": "-x"}}, r"it must be at right angles to the normal"),
        ({"contact": {"from_m": [1, 2]}}, r"from_m = \[1, 2\] is not valid: it must be three coordinates in m"),
        ({"contact": POINT | {"normal": "+z", "tangent": "+x"}}, r"tangent of a plate lie in its plane"),
        (
            {"contact": {"from_m": [0.05] * 3, "to_m": [0.05] * 3, "normal": "+x", "tangent": "+y"}},
            r"solid.contact touches no box; correct its from_m and to_m",
        ),
        ({"supports": [{"from_m": [0.1] * 3, "to_m": [0.1] * 3}]}, r"solid.supports.0 touches no box"),
        ({"supports": [{"from_m": [0.1] * 3, "to_m": [0.0] * 3}]}, r"from_m has x = 0.1 m above 0 m of to_m"),
        ({"supports": [POINT | {"directions": "xw"}]}, r"solid.supports.0.directions"),
        ({"electrodes": [POINT | {"group": "A"}] * 2}, r'there is none with group = "B"'),
        ({"theory": "solid"}, r"solid.electrodes.1 of group A touches one of group A|touches one of group"),
    ],
)  # fmt: skip
def test_a_wrong_solid_is_refused_with_what_to_do(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(pr.ParameterError, match=message):
        solve_stator(plate(**changes))


def test_a_material_of_the_file_is_one_of_the_library() -> None:
    """Also in the mass, the sense of poling and the heat capacity."""
    known = plate()
    named = [box.model_dump() | ({"material": "own"} if box.material == "PZT-4" else {}) for box in known.boxes]
    own = plate(materials={"own": CARD}, boxes=named)
    assert solve_stator(own).frequencies_hz.tolist() == solve_stator(known).frequencies_hz.tolist()
    assert heat_capacity_of_boxes(own) == heat_capacity_of_boxes(known)
    dense = plate(materials={"own": CARD | {"density_kg_m3": 3e4}}, boxes=named)
    assert heat_capacity_of_boxes(dense) > 3.5 * heat_capacity_of_boxes(known)  # all but the tip


def test_a_slip_at_the_edge_of_an_electrode_is_no_gap(tmp_path: Path) -> None:
    text = (SETS / "bimodal40.toml").read_text(encoding="utf-8")
    file = tmp_path / "mine.toml"
    file.write_text(text.replace("[0.02025, 0.00565, ", "[0.0202525, 0.00565, ", 1), encoding="utf-8")
    found, right = pr.load_motor(file).piezo, pr.load_motor("bimodal40").piezo
    assert found != right
    # an edge of 2.5 um and 20 mm: 0.01 % of the area of group B
    assert found.capacitances == pytest.approx(right.capacitances, rel=3e-4)
    assert found.capacitance_ab_f == pytest.approx(right.capacitance_ab_f, rel=1e-3)
    file.write_text(text.replace("[0.02025, 0.00565, ", "[0.02025, 0.0056501, ", 1), encoding="utf-8")
    with pytest.raises(pr.ParameterError, match=r"solid\.contact has cells that are too thin .* the same coordinate"):
        pr.load_motor(file)


def test_boxes_that_do_not_touch_are_refused() -> None:
    boxes = [dict(box.model_dump(), from_m=list(box.from_m), to_m=list(box.to_m)) for box in plate().boxes]
    for name in ("from_m", "to_m"):
        boxes[1][name][0] += 0.001
    face = {"from_m": [0.044, 0.00375, 0.0], "to_m": [0.044, 0.00775, 0.003], "normal": "+x", "tangent": "+y"}
    with pytest.raises(pr.ParameterError, match="6 rigid motions, and a single body has 3: its boxes do not touch"):
        solve_stator(plate(boxes=boxes, contact=face))


def test_without_scikit_fem_the_message_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "skfem", None)
    with pytest.raises(pr.ParameterError, match=r"pip install 'piezomotor\[solid\]'"):
        solve_stator(plate())


def at(low: float, high: float) -> str:
    """Return a place on the end of the plate, from one y in m to another."""
    return f'face = {{ from_m = [0.043, {low}, 0.0], to_m = [0.043, {high}, 0.003], normal = "+x", tangent = "+y" }}'


def tips(folder: Path, *entries: str) -> pr.Motor:
    """Return the plate with these entries of [[contacts]]."""
    return loaded(folder, "\n[[contacts]]\n".join([PLATE.read_text(encoding="utf-8"), *entries]))


def test_places_on_the_end_of_the_plate_move_as_the_finite_elements_do(tmp_path: Path) -> None:
    motor, own = pr.load_motor(PLATE), at(0.00375, 0.00775)
    assert tips(tmp_path, "").model_dump() == motor.model_dump()
    same = tips(tmp_path, "", own)
    assert np.array_equal(same.stator.contact, np.tile(motor.stator.contact, (2, 1)))
    assert same.touching[0].contact == same.touching[1].contact
    low, high = tips(tmp_path, at(0.00375, 0.00475), at(0.00675, 0.00775)).stator.contact.reshape(2, 2, -1)
    even = np.sign(low[0] * high[0])  # of motion along the slider, -1 of the longitudinal mode
    assert even.tolist() == [1.0, -1.0, 1.0]
    assert low == pytest.approx(high * [even, -even], abs=1e-7)
    assert np.abs(low[1, [0, 2]]).min() > 0.1  # beside the middle, bending moves them towards the slider
    tips(tmp_path, "", own)
    moved = {"contacts.1.face.from_m": [0.043, 0.00675, 0.0], "contacts.1.face.to_m": [0.043, 0.00775, 0.003]}
    assert changed_motor(tmp_path / "motor.toml", moved).stator.contact[2:] == pytest.approx(high, abs=1e-7)


def test_a_wrong_place_is_named_as_in_the_file(tmp_path: Path) -> None:
    edge = at(0.00375, 0.00475)
    for message, *entries in (
        (r"motor\.toml: contacts\.1\.face touches no box; correct its from_m and to_m", "", at(0.02, 0.021)),
        (r"contacts\.1\.face: normal and tangent must be those of solid\.contact", "", edge.replace("+x", "-x")),
        (r"motor\.toml: contacts\.1\.face\.from_m = \[1, 2\] is not valid", "", "face = { from_m = [1, 2] }"),
        (r"contacts\.0\.face is for one of several contacts", edge),
        (r"contacts\.1\.face is .* without tip_x and tip_y", "", f"{edge}\ntip_y = {{ mode-1 = 1.0 }}"),
    ):
        with pytest.raises(pr.ParameterError, match=message):
            tips(tmp_path, *entries)


def test_a_solid_takes_the_place_of_a_beam(tmp_path: Path) -> None:
    text = PLATE.read_text(encoding="utf-8")
    path = tmp_path / "both.toml"
    path.write_text(text + "\n[damping]\nalpha_per_s = 1.0\nbeta_s = 0.0\n")
    with pytest.raises(pr.ParameterError, match=r"\[damping\] belongs to a \[beam\]; with \[solid\] leave it out"):
        pr.load_motor(path)
    path.write_text(text.replace("[piezo]", "[piezo]\ncapacitance_a_f = 1e-9"))
    with pytest.raises(pr.ParameterError, match=r"piezo.capacitance_a_f follows from \[solid\]"):
        pr.load_motor(path)


def test_the_admittance_of_a_solid_has_the_overtones_within_its_range() -> None:
    # R. Holland, E. P. EerNisse: Y = jωC (1 − k² + k² tan X/X), X = π f/(2 f_r), of a slender bar. At 2.7 f_r, near the
    # third harmonic, the width of L/40 lowers its frequency by 1e-3, and the slope there makes 1 % of it.
    length, height, thickness = 0.04, 0.001, 0.001
    bar = {
        "solid.boxes": [{"material": "PZT-4", "from_m": [0.0, 0.0, 0.0], "to_m": [length, height, thickness]}],
        "solid.contact": {"from_m": [length, 0.0, 0.0], "to_m": [length, height, 0.0], "normal": "+x", "tangent": "+y"},
        "solid.electrodes": [
            {"group": group, "from_m": [a, 0.0, z], "to_m": [b, height, z]}
            for group, a, b, z in (
                ("A", 0.0, 0.02, thickness), ("B", 0.02, length, thickness), ("ground", 0.0, length, 0.0)
            )
        ],
        "piezo.loss_tangent": 0.0,
        "solid.highest_hz": 160e3,
    }  # fmt: skip
    motor = changed_motor(PLATE, bar)
    compliance, permittivity, charge = 12.3e-12, 1300 * 8.8541878e-12, 123e-12
    squared = charge**2 / (compliance * permittivity)
    resonance = 1.0 / (2.0 * length * sqrt(7500.0 * compliance))
    found = pr.admittance(motor, start=0.3 * resonance, stop=2.7 * resonance, points=25)
    for index in (3, 11, 17, 24):
        frequency = found.frequency_hz[index]
        x = pi * frequency / (2.0 * resonance)
        wanted = permittivity * length * height / thickness * (1.0 - squared + squared * np.tan(x) / x)
        assert found.matrix_s[index].sum().imag == pytest.approx(2.0 * pi * frequency * wanted, rel=0.01)
    third = pr.admittance(motor, start=2.9 * resonance, stop=3.1 * resonance, points=401)
    peak = third.frequency_hz[np.argmax(third.matrix_s.sum(axis=(1, 2)).real)]
    assert peak == pytest.approx(3.0 * resonance, rel=5e-3)
    assert not third.cautions
    (caution,) = pr.admittance(motor, start=30e3, stop=170e3, points=3).cautions
    assert "resonances outside are missing" in caution


def test_geometry_electrodes_and_modes_are_drawn(tmp_path: Path) -> None:
    motor = pr.load_motor(PLATE)
    motor.plot(tmp_path / "plate.png")
    assert (tmp_path / "plate.png").stat().st_size > 20_000
    ax = motor.plot(panel="geometry")
    assert {text.get_text().strip() for text in ax.texts} >= {"PZT-4", "alumina", "A", "B", "normal", "tangent"}
    cells = motor.plot(panel="mode-2").collections[0].get_paths()
    assert len(cells) == solve_stator(plate()).cells.shape[1]


def test_the_report_lists_boxes_and_electrodes() -> None:
    rows = {row.path: row for row in parameter_rows(pr.load_motor(PLATE))}
    assert rows["solid.boxes.1.material"].value == "alumina"
    assert rows["solid.boxes.1.to_m"].note == "size of a small tip"
    assert rows["solid.quality_factor"].kind == "assumed"
    assert rows["solid.contact.normal"].value == "+x"
    assert "solid.boxes" not in rows


def test_a_feedback_electrode_and_its_group_together_are_the_group_from_which_it_is_cut(tmp_path: Path) -> None:
    text, corner = PLATE.read_text(encoding="utf-8"), "from_m = [0.0, 0.00575, 0.003]\nto_m = [0.0205, 0.0115, 0.003]"
    strip = corner.replace("[0.0,", "[0.018,")
    motors = {}
    for group, cable in (("feedback", "[feedback]\ncapacitance_f = 1e-10\n"), ("A", "")):
        parts = f'{corner.replace("0.0205", "0.018")}\n\n[[solid.electrodes]]\ngroup = "{group}"\n{strip}'
        (tmp_path / "plate.toml").write_text(f"{text.replace(corner, parts)}\n{cable}", encoding="utf-8")
        motors[group] = pr.load_motor(tmp_path / "plate.toml")
    cut, whole, electrode = motors["feedback"], motors["A"], motors["feedback"].feedback
    other = 1.0 - electrode.share_a  # V, on the charge of the strip at 1 V on both it and its group
    for one, both in zip(cut.modes, whole.modes, strict=True):
        force = electrode.couplings_n_per_v[one.name]
        assert one.coupling_a_n_per_v + other * force == pytest.approx(both.coupling_a_n_per_v, rel=1e-9)
        assert one.coupling_b_n_per_v - electrode.share_b * force == pytest.approx(both.coupling_b_n_per_v, rel=1e-9)
    joined = cut.piezo.capacitance_a_f + electrode.capacitance_f * other**2 - 1e-10  # without its cable
    assert joined == pytest.approx(whole.piezo.capacitance_a_f, rel=1e-9)
    between = cut.piezo.capacitance_ab_f + electrode.capacitance_f * other * electrode.share_b
    assert between == pytest.approx(whole.piezo.capacitance_ab_f, rel=1e-9)
