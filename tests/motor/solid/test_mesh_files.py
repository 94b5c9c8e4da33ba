# SPDX-License-Identifier: GPL-3.0-or-later
"""A stator whose mesh is read from a file of gmsh."""

import re
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from skfem import MeshHex, MeshQuad, MeshTet, MeshTri
from skfem.io.meshio import HEX_MAPPING

import pyspice_runner as pr
from pyspice_runner.motor.load import load_motor
from pyspice_runner.motor.solid import stator
from pyspice_runner.motor.solid.parameters import Solid, solid_from
from pyspice_runner.motor.solid.stator import Stator, solve_stator

PLATE = Path(__file__).parents[3] / "examples" / "plate40.toml"
MM = 1e-3
LOW, MIDDLE, HIGH, END = 0.0, 10.0, 20.0, 22.0  # in mm, of a bar with a tip
WIDTH, HEIGHT = 6.0, 4.0
Corners = tuple[tuple[float, float, float], tuple[float, float, float]]


def placed(theory: str) -> dict[str, tuple[Corners, dict[str, Any]]]:
    """Return the parts of a bar with electrodes above and below, clamped at one end: corners in mm, and entries."""
    gap = 2.0 if theory == "solid" else 0.0
    return {
        "boxes.0": (((LOW, 0, 0), (HIGH, WIDTH, HEIGHT)), {"material": "PZT-4"}),
        "boxes.1": (((HIGH, 2, 0), (END, 4, HEIGHT)), {"material": "alumina"}),
        "electrodes.0": (((LOW, 0, HEIGHT), (MIDDLE - gap, WIDTH, HEIGHT)), {"group": "A"}),
        "electrodes.1": (((MIDDLE, 0, HEIGHT), (HIGH, WIDTH, HEIGHT)), {"group": "B"}),
        "electrodes.2": (((LOW, 0, 0), (HIGH, WIDTH, 0)), {"group": "ground"}),
        "supports.0": (((LOW, 0, 0), (LOW, WIDTH, HEIGHT)), {"directions": "xyz"}),
        "contact": (((END, 2, 0), (END, 4, HEIGHT)), {"normal": "+x", "tangent": "+y"}),
    }


def table(theory: str, source: Path | None) -> dict[str, Any]:
    """Return the [solid], with coordinates, or with the groups of a mesh file."""
    entries: dict[str, Any] = {"boxes": [], "electrodes": [], "supports": []}
    entries |= {"theory": theory, "lowest_hz": 1e3, "highest_hz": 100e3, "quality_factor": 400.0}
    entries |= {"element_m": 0.002} if source is None else {"mesh": str(source), "mesh_unit_m": MM}
    for name, ((low, high), own) in placed(theory).items():
        place: dict[str, Any] = {"from_m": [MM * x for x in low], "to_m": [MM * x for x in high]}
        if source is not None:
            place = {"region": name}
            if theory == "plate" and name.startswith("boxes"):
                place["thickness_m"] = MM * HEIGHT
            if theory == "plate" and name.startswith("electrodes"):
                place["side"] = "+z" if low[2] else "-z"
        if name == "contact":
            entries[name] = place | own
        else:
            entries[name.split(".")[0]].append(place | own)
    return entries


def cut(theory: str) -> Any:
    """Return bar and tip as cells of 2 mm, in mm."""
    x, y, z = (np.arange(0.0, size + 1.0, 2.0) for size in (END, WIDTH, HEIGHT))
    mesh = MeshQuad.init_tensor(x, y) if theory == "plate" else MeshHex.init_tensor(x, y, z)
    centres = mesh.p[:, mesh.t].mean(axis=1)
    return mesh.restrict(np.flatnonzero((centres[0] < HIGH) | (abs(centres[1] - 3.0) < 1.0)))


def groups(mesh: Any, theory: str) -> Iterable[tuple[str, np.ndarray]]:
    """Yield the name of each part with the corners of its cells or facets, (n, corners)."""
    for name, ((low, high), _) in placed(theory).items():
        whole = name.startswith("boxes") or (theory == "plate" and name.startswith("electrodes"))
        corners = mesh.t if whole else mesh.facets
        inside = [(a <= x) & (x <= b) for x, a, b in zip(mesh.p, low, high, strict=False)]
        chosen = corners[:, np.all(inside, axis=0)[corners].all(axis=0)]
        yield name, (chosen[HEX_MAPPING[:8]] if isinstance(mesh, MeshHex) and whole else chosen).T


KINDS = {MeshQuad: ("quad", "line"), MeshTri: ("triangle", "line"), MeshTet: ("tetra", "triangle")}
KINDS[MeshHex] = ("hexahedron", "quad")


def write(path: Path, mesh: Any, theory: str) -> Path:
    """Write a mesh in version 2.2, where a cell stands once for each of its groups."""
    blocks, tags, names = [], [], {}
    for tag, (name, corners) in enumerate(groups(mesh, theory), start=1):
        whole = corners.shape[1] == len(mesh.t)
        kind = next(KINDS[each] for each in KINDS if isinstance(mesh, each))[0 if whole else 1]
        blocks.append((kind, corners))
        tags.append(np.full(len(corners), tag))
        names[name] = np.array([tag, mesh.dim() - (0 if whole else 1)])
    points = np.zeros((mesh.p.shape[1], 3))
    points[:, : mesh.dim()] = mesh.p.T
    data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
    meshio.gmsh.write(str(path), meshio.Mesh(points, blocks, cell_data=data, field_data=names), "2.2", binary=False)
    return path


def write_41(path: Path, mesh: Any) -> Path:
    """Write a plate of quadrilaterals as gmsh does by default: version 4.1, second order, groups by entities."""
    parts = dict(groups(mesh, "plate"))
    member: dict[tuple[int, ...], list[int]] = {}
    for tag, corners in enumerate(parts.values(), start=1):
        for part in corners.tolist():
            member.setdefault(tuple(part), []).append(tag)
    entities: dict[tuple[int, tuple[int, ...]], list[tuple[int, ...]]] = {}
    for part, tags in member.items():
        entities.setdefault((len(part) // 2, tuple(tags)), []).append(part)
    points, elements = [(*point, 0.0) for point in mesh.p.T.tolist()], []
    described: dict[int, list[str]] = {1: [], 2: []}
    for number, ((dimension, tags), own) in enumerate(entities.items(), start=1):
        described[dimension].append(f"{number} 0 0 0 0 0 0 {len(tags)} {' '.join(map(str, tags))} 0")
        elements.append(f"{dimension} {number} {8 if dimension == 1 else 16} {len(own)}")
        for part in own:
            nodes = list(part)
            for first, second in zip(part, [*part[1:], part[0]], strict=True):
                if dimension == 2 or len(nodes) == 2:
                    points.append(tuple(np.mean([points[first], points[second]], axis=0).tolist()))
                    nodes.append(len(points) - 1)
            elements.append(" ".join(str(node + 1) for node in (-1, *nodes)))
    count, total = len(points), len(elements) - len(entities)
    names = [f'{len(part[0]) // 2} {tag} "{name}"' for tag, (name, part) in enumerate(parts.items(), start=1)]
    sections = {
        "MeshFormat": ["4.1 0 8"],
        "PhysicalNames": [str(len(names)), *names],
        "Entities": [f"0 {len(described[1])} {len(described[2])} 0", *described[1], *described[2]],
        "Nodes": [f"1 {count} 1 {count}", f"2 {len(entities)} 0 {count}", *(str(n + 1) for n in range(count))]
        + [" ".join(map(repr, point)) for point in points],
        "Elements": [f"{len(entities)} {total} 1 {total}", *elements],
    }
    text = "".join("\n".join([f"${name}", *lines, f"$End{name}\n"]) for name, lines in sections.items())
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def boxes() -> dict[str, Stator]:
    """Return the same stators from coordinates, with the capacitances of the same cells."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stator, "clamped_capacitance", lambda solid, coarse_f: coarse_f)  # noqa: ARG005
        return {theory: solve_stator(solid_from(table(theory, None), "boxes")) for theory in ("plate", "solid")}


def read(theory: str, source: Path, /, **changes: Any) -> Solid:
    return solid_from(table(theory, source) | changes, "mesh")


def assert_same(found: Stator, wanted: Stator, rel: float) -> None:
    assert found.frequencies_hz == pytest.approx(wanted.frequencies_hz, rel=rel)
    for name in ("couplings_n_per_v", "tip_x", "tip_y", "masses_kg", "clamped_f"):
        size = np.abs(getattr(wanted, name)).max()
        got, expected = np.abs(getattr(found, name)), np.abs(getattr(wanted, name))
        assert got == pytest.approx(expected, abs=10.0 * rel * size), name


@pytest.mark.parametrize("theory", ["plate", "solid"])
def test_a_mesh_file_of_the_same_cells_has_the_modes_of_the_boxes(
    theory: str, tmp_path: Path, boxes: dict[str, Stator]
) -> None:
    # the same elements: what differs is the order of the unknowns, and rounding by the condition of the matrix, 1e-8
    found = solve_stator(read(theory, write(tmp_path / "bar.msh", cut(theory), theory)))
    assert_same(found, boxes[theory], 1e-7)
    assert found.mass_kg == pytest.approx(boxes[theory].mass_kg, rel=1e-12)


def test_the_default_version_of_gmsh_and_second_order_are_read(tmp_path: Path, boxes: dict[str, Stator]) -> None:
    assert_same(solve_stator(read("plate", write_41(tmp_path / "bar.msh", cut("plate")))), boxes["plate"], 1e-7)


@pytest.mark.parametrize(("theory", "rel"), [("plate", 2e-3), ("solid", 1e-2)])
def test_triangles_and_tetrahedra_have_the_modes_of_boxes(
    theory: str, rel: float, tmp_path: Path, boxes: dict[str, Stator]
) -> None:
    # other elements of 2 mm: quadratic ones have an error of some (edge/half wave)⁴, and the clamp is singular
    mesh = cut(theory).to_meshtri() if theory == "plate" else cut(theory).to_meshtet()
    found = solve_stator(read(theory, write(tmp_path / "bar.msh", mesh, theory)))
    # a mesh without symmetry also has modes that symmetry keeps from the contact
    assert len(boxes[theory].frequencies_hz) <= len(found.frequencies_hz) <= len(boxes[theory].frequencies_hz) + 1
    for wanted in boxes[theory].frequencies_hz:
        assert min(found.frequencies_hz, key=lambda f, wanted=wanted: abs(f - wanted)) == pytest.approx(wanted, rel=rel)
    assert found.mass_kg == pytest.approx(boxes[theory].mass_kg, rel=1e-12)
    assert np.diag(found.clamped_f) == pytest.approx(np.diag(boxes[theory].clamped_f), rel=0.02)


def motor_file(folder: Path, theory: str = "plate") -> Path:
    """Write a motor's TOML beside its mesh ``bar.msh``, and return its path."""
    lines = PLATE.read_text(encoding="utf-8").splitlines()
    start, end = lines.index("[solid]"), lines.index("[piezo]")
    entries = table(theory, Path("bar.msh"))
    written = ["[solid]"] + [f"{k} = {v!r}" for k, v in entries.items() if not isinstance(v, list | dict)]
    for name in ("contact", "boxes", "electrodes", "supports"):
        for entry in [entries[name]] if name == "contact" else entries[name]:
            written += ["[solid.contact]" if name == "contact" else f"[[solid.{name}]]"]
            written += [f"{key} = {value!r}" for key, value in entry.items()]
    path = folder / "motor.toml"
    path.write_text("\n".join(lines[:start] + written + lines[end:]))
    return path


def test_a_changed_file_gives_another_stator(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    path, mesh = motor_file(tmp_path), cut("plate")
    write(tmp_path / "bar.msh", mesh, "plate")
    first = load_motor(path)
    assert first.solid is not None
    other = tmp_path / "moved"
    other.mkdir()
    write(other / "bar.msh", mesh, "plate")
    moved = load_motor(motor_file(other))
    assert moved.solid is not None
    assert stator.bundled_name(moved.solid) == stator.bundled_name(first.solid)
    assert len(list((tmp_path / "cache").rglob("*.npz"))) == 1  # the same content, elsewhere
    mesh.p[0] *= 1.01
    parts = placed("plate")
    stretched = {k: (tuple((1.01 * x, y, z) for x, y, z in v[0]), v[1]) for k, v in parts.items()}
    monkeypatch.setattr(sys.modules[__name__], "placed", lambda _: stretched)
    write(tmp_path / "bar.msh", mesh, "plate")
    longer = load_motor(path)
    # the first mode bends: f ∝ 1/L² of a slender bar, and less of a short one
    ratio = longer.modes[0].frequency_hz / first.modes[0].frequency_hz
    assert 1.01**-2.05 < ratio < 1.01**-1.5
    with pytest.raises(pr.ParameterError, match="has changed since the motor was read; read the motor again"):
        solve_stator(first.solid)


@pytest.mark.parametrize("theory", ["plate", "solid"])
def test_a_mesh_is_drawn_with_its_materials_and_electrodes(
    theory: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    mesh = cut(theory).to_meshtri() if theory == "plate" else cut(theory)
    write(tmp_path / "bar.msh", mesh, theory)
    motor = load_motor(motor_file(tmp_path, theory))
    assert len(motor.plot(panel="mode-1").collections[0].get_paths()) == mesh.nelements
    ax = motor.plot(panel="geometry")
    texts = {text.get_text(): text.get_position() for text in ax.texts}
    assert set(texts) == {"PZT-4", "alumina", "A", "B", "normal", "tangent", ""}
    extents = [collection.get_datalim(ax.transData).bounds for collection in ax.collections]
    drawn = np.array([(x, y, x + w, y + h) for x, y, w, h in extents])  # both boxes, then both groups
    wanted = [placed(theory)[name][0] for name in ("boxes.0", "boxes.1", "electrodes.0", "electrodes.1")]
    assert drawn == pytest.approx(np.array([(*low[:2], *high[:2]) for low, high in wanted]))
    assert texts["A"][0] < MIDDLE < texts["B"][0]
    assert texts["normal"][0] > END


def without(name: str) -> dict[str, Any]:
    entries = table("plate", Path("bar.msh"))[name]
    entry = {"region": "tip"} | {key: value for key, value in entries[0].items() if key not in ("region", "side")}
    return {name: [entry, *entries[1:]]}


CONTACT = {"normal": "+x", "tangent": "+y"}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mesh": "none.msh"}, r"solid.mesh: Cannot read the mesh 'none.msh': No such file.*Give the path"),
        ({"mesh": 3}, r"solid.mesh = 3 is not valid: it must be the path of a file"),
        ({"element_m": 0.001}, r"element_m .* or a mesh is needed; specify one of them"),
        ({"contact": CONTACT | {"region": "tip"}}, r"region = 'tip' is not a physical group .* 'boxes.0', 'boxes.1'"),
        ({"contact": CONTACT | {"region": "boxes.1"}}, r"'boxes.1' is a group of surfaces; it must be one of curves"),
        ({"contact": CONTACT}, r"solid.contact.from_m is missing .* or with a mesh the region"),
        ({"contact": CONTACT | {"from_m": [0, 0, 0], "to_m": [0, 0, 0]}}, r"contact: a region goes with a mesh"),
        ({"contact": CONTACT | {"region": "contact", "to_m": [0, 0, 0]}}, r"'contact' takes the place of to_m"),
        ({"theory": "solid"}, r"The mesh has surfaces, and theory solid takes volumes"),
        ({"mesh_unit_m": 1.0}, r"The mesh is 22 m long; the limit is 2 m. Specify solid.mesh_unit_m"),
        (without("electrodes"), r'electrodes.0.side is missing: the face of the plate, "\+z" or "-z"'),
    ],
)  # fmt: skip
def test_a_mesh_that_does_not_fit_is_refused_with_what_to_do(
    changes: dict[str, Any], message: str, tmp_path: Path
) -> None:
    source = write(tmp_path / "bar.msh", cut("plate"), "plate")
    with pytest.raises(pr.ParameterError, match=message):
        solve_stator(read("plate", source, **changes))


def test_a_file_that_is_no_mesh_or_has_other_cells_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "bar.msh"
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [2.0, 0.0, 0.0]])
    mixed = meshio.Mesh(points, [("quad", np.array([[0, 1, 2, 3]])), ("triangle", np.array([[1, 4, 2]]))])
    meshio.gmsh.write(str(path), mixed, "2.2", binary=False)
    with pytest.raises(pr.ParameterError, match="kind quad and triangle; it must have one kind, triangle or quad"):
        solve_stator(read("plate", path))
    whole = write(path, cut("plate"), "plate").read_bytes()
    for content in (b"", b"solid\n", whole[: len(whole) // 2], whole.replace(b"2.2 0 8", b"9.9 0 8")):
        path.write_bytes(content)
        with pytest.raises(pr.ParameterError, match=r"is not a mesh that can be read .*Save it with gmsh"):
            solve_stator(read("plate", path))


@pytest.mark.parametrize("theory", ["plate", "solid"])
@pytest.mark.parametrize(("place", "message"), [("nan", "coordinates are no numbers"), ("6.5", "flat or folded cell")])
def test_a_mesh_with_an_unfit_corner_is_refused(place: str, message: str, theory: str, tmp_path: Path) -> None:
    path = write(tmp_path / "bar.msh", cut(theory), theory)
    text = path.read_text(encoding="utf-8")  # a line of a corner: number, x, y and z in mm
    moved = re.sub(r"(?m)^(\d+) 4\S* 2\S* (?=0\S*$)", rf"\1 {place} 2.0 ", text)
    assert moved != text
    path.write_text(moved, encoding="utf-8")
    with pytest.raises(pr.ParameterError, match=message):
        solve_stator(read(theory, path))


def test_a_region_without_a_mesh_is_refused() -> None:
    entries = table("plate", None)
    entries["contact"] = CONTACT | {"region": "tip"}
    with pytest.raises(pr.ParameterError, match=r"contact: a region goes with a mesh"):
        solid_from(entries, "motor")


def test_without_meshio_the_message_says_how_to_install_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "meshio", None)
    with pytest.raises(pr.ParameterError, match=r"needs meshio. Install it: `pip install 'piezomotor\[solid\]'`"):
        solve_stator(read("plate", write(tmp_path / "bar.msh", cut("plate"), "plate")))
