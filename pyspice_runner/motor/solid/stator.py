# SPDX-License-Identifier: GPL-3.0-or-later
"""Modes of a stator by finite elements, and what the modes that are left out contribute.

With the potentials between the electrodes eliminated by the solver, K ψ = ω² M ψ with all groups shorted. A mode has
the force factors θ = −(C ψ − Q φ) at the electrodes; the charges there with all displacements held at zero are the
clamped capacitances. Each mode is scaled so that its largest displacement is 1; its sign makes the larger motion of the
contact positive.

Everything left out answers at once: the response to a voltage and to a force on the face of contact, less that of the
computed modes, is the static compliance of all higher ones; computed modes above the range of the motor add their
static response, and those below it theirs at the mean ω² of the motor's modes. Rigid motion is left to the mount.

The stator of a bundled set is in the package, found by the content of its ``[solid]`` alone, so that the set needs no
finite elements; a test computes it anew. Others are in the user's cache, which also asks for the same program.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise
from math import pi
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from pyspice_runner.errors import ParameterError
from pyspice_runner.files import cache_folder, save_by_ending
from pyspice_runner.motor.numerics import one_thread_of_scipy
from pyspice_runner.motor.solid.elements import VOLTS, Array, Indices, assemble, assemble_field, factor, strains
from pyspice_runner.motor.solid.geometry import Geometry, build_geometry
from pyspice_runner.motor.solid.parameters import Solid
from pyspice_runner.motor.solid.places import GRADING, electrode_edges
from pyspice_runner.motor.stator import MODE_COLUMNS

_RIGID = 1e-8  # ω² of a rigid motion, over that of the shift
_ZERO = 1e-7  # of its natural scale: a motion or a coupling that symmetry forbids
_SLIGHT = 1e-3  # of the largest displacement: a motion of the contact that does not count
_UNSEEN = 0.01  # of the current through the clamped capacitance: a current at resonance that does not count
_LEAST = 24  # modes that are computed
_BLOCK = 8  # more than the rigid motions of one body
_EXACT = 1e-11  # of an eigenvalue: its residual
_PER_GAP = 6.0  # cells of the finer mesh at an edge in the narrowest gap or electrode
_ONE_EDGE_M = 1e-5  # m, distance of two edges of electrodes, such as that of a rounded number, that is no gap
_DIRECTIONS = 500  # in the space of modes, in which the largest stress is sought
BUNDLED = Path(__file__).parents[1] / "sets" / "stators"
_DRAWN = ("nodes_m", "shapes")  # in single precision in a file


@dataclass(frozen=True)
class Stator:
    """The modes of a stator within the range of its motor, by rising frequency, and what the others contribute.

    The last index of a mode's arrays counts them.
    """

    frequencies_hz: Array
    masses_kg: Array
    couplings_n_per_v: Array  # (groups, modes): groups A and B, then the feedback electrode, if there is one
    tip_x: Array
    tip_y: Array
    recoil_kg: Array  # Γ = ∫ρ ψ·n dV along the normal
    recoil_x_kg: Array  # the same along the tangent
    clamped_f: Array  # (groups, groups): charges per volt, all displacements held at zero
    residual_f: Array  # (groups, groups): the same of the modes that are left out
    residual_m_per_n: Array  # (2, 2): compliance of the modes that are left out, normal and tangent
    residual_m_per_v: Array  # (2, groups): motion of the contact along normal and tangent per volt, by them
    stress_pa_per_m: Array
    """(points, modes): normal stresses of the ceramic, where some combination of modes makes them largest."""
    strain_per_m: Array  # (points, modes): the strains there
    mass_kg: Array  # of the stator: a number
    nodes_m: Array  # (axes, nodes)
    cells: Indices  # (corners, cells)
    shapes: Array  # (axes, nodes, modes): displacement per modal coordinate
    # of the faces of [[contacts]], (2k, modes + 1): motion along normal and tangent, and compliance left out in m/N
    faces: Array = field(default_factory=lambda: np.empty((0, 1)))

    @property
    def stiffnesses_n_per_m(self) -> Array:
        """Modal stiffness with both groups shorted."""
        return np.asarray(self.masses_kg * (2.0 * pi * self.frequencies_hz) ** 2)

    def tables(self, quality_factor: float) -> list[dict[str, Any]]:
        """Return the modes as tables ``[[modes]]``, named ``mode-1`` and so on."""
        damping = 2.0 * pi * self.frequencies_hz * self.masses_kg / quality_factor
        coupling = self.couplings_n_per_v[:2].T
        ends = (self.tip_x, self.tip_y, self.recoil_kg, self.recoil_x_kg)
        rows = np.column_stack([self.masses_kg, damping, self.stiffnesses_n_per_m, coupling, *ends])
        return [
            {"name": f"mode-{index}", **dict(zip(MODE_COLUMNS, row, strict=True))}
            for index, row in enumerate(rows.tolist(), start=1)
        ]


@one_thread_of_scipy()  # the modes enter decks and the addresses of stored points
def solve_stator(solid: Solid) -> Stator:
    """Return the modes of a stator. Raise ParameterError if its parts do not fit together or it has no modes there."""
    geometry = build_geometry(solid)
    stiffness, mass = assemble(geometry.basis, geometry.parts, geometry.place, geometry.size, geometry.springs)
    count = geometry.displacements
    groups = geometry.groups
    inner = slice(0, geometry.size - groups)
    system, electric = stiffness[inner, inner], stiffness[inner, -groups:].toarray()
    loads = np.hstack([-electric, _contact_loads(geometry)])
    shift = -((0.5 * pi * solid.highest_hz) ** 2)
    solve = factor(system - shift * mass[inner, inner])
    squares, vectors = lowest_modes(
        solve, mass[:count, :count].tocsr(), system.shape[0], shift, (2.0 * pi * solid.highest_hz) ** 2
    )
    generalised = loads.T @ vectors  # forces of the groups and motions of the contact, per modal coordinate

    charged = clamped = -stiffness[-groups:, -groups:].toarray()
    response = loads.T @ solve(loads)
    if system.shape[0] > count:
        between = slice(count, geometry.size - groups)
        clamped = clamped + electric[between].T @ factor(system[between, between])(electric[between])

    rigid = squares < _RIGID * -shift
    most = 3 if geometry.dimension == 2 else 6
    if rigid.sum() > most:
        raise ParameterError(
            f"The solid has {rigid.sum()} rigid motions, and a single body has {most}: its boxes do not touch. Close "
            "the gap."
        )
    shapes = _displacements(geometry, vectors)
    amplitude = np.sqrt((shapes**2).sum(axis=0)).max(axis=0)
    y, x = generalised[groups : groups + 2]
    amplitude *= np.sign(np.where(np.abs(y) >= np.abs(x), y, x) + np.finfo(float).tiny)
    squares = np.maximum(squares, 0.0)
    frequencies = np.sqrt(squares) / (2.0 * pi)
    capacitance = np.diag(clamped)[:, None] + np.finfo(float).tiny
    electrical, pushed = generalised[:groups], generalised[groups:]
    couplings = np.where(electrical**2 <= _ZERO**2 * capacitance * squares, 0.0, electrical)
    couplings = couplings / (VOLTS * amplitude)
    motion = np.where(np.abs(pushed / amplitude) <= _ZERO, 0.0, pushed / amplitude)
    seen = solid.quality_factor * electrical**2 > _UNSEEN * capacitance * squares
    takes_part = seen[:2].any(axis=0) | (np.abs(motion) > _SLIGHT).any(axis=0)
    kept = ~rigid & takes_part & (solid.lowest_hz <= frequencies) & (frequencies <= solid.highest_hz)
    if not kept.any():
        near = ", ".join(f"{frequency:.4g}" for frequency in frequencies[~rigid & takes_part][:8])
        raise ParameterError(
            f"The solid has no mode from solid.lowest_hz = {solid.lowest_hz:g} to solid.highest_hz = "
            f"{solid.highest_hz:g} Hz that its electrodes or its contact move; its lowest are at {near} Hz."
        )

    others = ~kept & ~rigid
    # at the frequency of the motor's modes those below push against the force, and those above are static
    under = np.where(squares[others] < squares[kept].min(), squares[kept].mean(), 0.0)
    at_shift = (generalised / (squares - shift)) @ generalised.T
    beyond = generalised[:, others]
    static = response - at_shift + (beyond / (squares[others] - under)) @ beyond.T
    density = _mass_of_nodes(geometry)
    stress, strain = _stress(geometry, vectors[:, kept] / amplitude[kept])
    recoils = np.einsum("n,anm,da->dm", density, shapes, geometry.contact[:2].sum(axis=1)) / amplitude
    return Stator(
        frequencies_hz=frequencies[kept],
        masses_kg=1.0 / amplitude[kept] ** 2,
        couplings_n_per_v=couplings[:, kept],
        tip_x=motion[1, kept],
        tip_y=motion[0, kept],
        recoil_kg=recoils[0, kept],
        recoil_x_kg=recoils[1, kept],
        clamped_f=clamped_capacitance(solid, clamped / VOLTS**2),
        residual_f=(charged - clamped + static[:groups, :groups]) / VOLTS**2,
        residual_m_per_n=static[groups:, groups:][:2, :2],
        residual_m_per_v=static[groups:, :groups][:2] / VOLTS,
        stress_pa_per_m=stress,
        strain_per_m=strain,
        mass_kg=np.array(density.sum()),
        nodes_m=np.asarray(geometry.basis.mesh.p),
        cells=np.asarray(geometry.basis.mesh.t),
        shapes=(shapes[..., kept] / amplitude[kept])[:, geometry.basis.nodal_dofs[0]],
        faces=np.column_stack([motion[2:, kept], np.diag(static)[groups + 2 :]]),
    )


def lowest_modes(
    solve: Callable[[Array], Array], mass: Any, rows: int, shift: float, highest: float
) -> tuple[Array, Array]:
    """Return ω² and vectors of unit modal mass, with their potentials, of all modes up to ω² = ``highest`` and more.

    Block Lanczos with full orthogonalisation and without restarts, which needs no guess of the number of modes; a block
    finds modes of the same frequency together (G. H. Golub, R. Underwood, in Mathematical Software III, 1977, 361).
    """
    size = mass.shape[0]
    block = np.random.default_rng(0).standard_normal((size, min(_BLOCK, size)))  # the same modes in every run
    basis = heavy = np.empty((size, 0))  # heavy = mass @ basis
    images, projected = None, np.empty((0, 0))
    while True:
        for _ in range(2):  # which is enough against rounding
            block = np.linalg.qr(block - basis @ (heavy.T @ block))[0]
            factor = np.linalg.cholesky(block.T @ (mass @ block))
            block = np.asarray(np.linalg.solve(factor, block.T).T, dtype=np.float64)
        basis, heavy = np.hstack([basis, block]), np.hstack([heavy, mass @ block])
        image = solve(np.vstack([heavy[:, -block.shape[1] :], np.zeros((rows - size, block.shape[1]))]))
        images = image if images is None else np.hstack([images, image])
        columns = heavy.T @ image[:size]
        projected = np.block([[projected, columns[: len(projected)]], [columns.T]])
        values, turns = (found[..., ::-1] for found in np.linalg.eigh(projected))
        rest = image[:size] - basis @ columns
        last = turns[-block.shape[1] :]
        errors = np.sqrt(np.maximum(np.einsum("im,ij,jm->m", last, rest.T @ (mass @ rest), last, optimize=True), 0.0))
        within = int((values >= 1.0 / (highest - shift)).sum())
        wanted = min(max(_LEAST, within + 1), size)
        if basis.shape[1] == size or (wanted <= len(values) and (errors <= _EXACT * values)[:wanted].all()):
            return shift + 1.0 / values[:wanted], images @ turns[:, :wanted] / values[:wanted]
        block = rest[:, : size - basis.shape[1]]


def _contact_loads(geometry: Geometry) -> Array:
    """Return unit forces on each face of contact along normal and tangent, (rows, 2k)."""
    nodes = geometry.contact.shape[1]
    rows = geometry.place[: nodes * geometry.fields].reshape(nodes, -1)[:, : geometry.dimension]
    loads = np.zeros((geometry.size - geometry.groups, len(geometry.contact)))
    loads[rows[rows >= 0]] = geometry.contact[:, rows >= 0].T
    return loads


def _unknowns(geometry: Geometry, vectors: Array) -> Array:
    """Return all unknowns, with those that are held at 0: (unknowns, modes)."""
    values = np.zeros((len(geometry.place), vectors.shape[1]))
    free = (geometry.place >= 0) & (geometry.place < len(vectors))  # with both groups shorted
    values[free] = vectors[geometry.place[free]]
    return values


def _displacements(geometry: Geometry, vectors: Array) -> Array:
    """Return the displacements of all nodes: (axes, nodes, modes)."""
    nodes = geometry.contact.shape[1]
    values = _unknowns(geometry, vectors)[: nodes * geometry.fields].reshape(nodes, geometry.fields, -1)
    return np.asarray(values[:, : geometry.dimension].transpose(1, 0, 2))


def _mass_of_nodes(geometry: Geometry) -> Array:
    """Return ∫ρN dV of each node."""
    masses = np.zeros(geometry.basis.N)
    for part in geometry.parts:
        own = geometry.basis.with_elements(part.cells)
        values = np.stack([np.asarray(field[0]) for field in own.basis])
        local = np.einsum("aeq,eq->ae", values, part.density_kg_m3 * part.thickness_m * own.dx)
        masses += np.bincount(own.element_dofs.ravel(), local.ravel(), minlength=len(masses))
    return masses


def _stress(geometry: Geometry, vectors: Array) -> tuple[Array, Array]:
    """Return normal stresses and strains of the ceramic, means over elements, where they can be the largest."""
    values, axes = _unknowns(geometry, vectors), geometry.dimension
    stresses, found = [np.zeros((1, vectors.shape[1]))], [np.zeros((1, vectors.shape[1]))]
    for part in geometry.parts:
        if part.ceramic:
            strain = strains(geometry.basis, part, values).mean(axis=1)
            stresses.append(np.einsum("rs,esc->erc", part.matrix[:axes], strain).reshape(-1, vectors.shape[1]))
            found.append(strain[:, :axes].reshape(-1, vectors.shape[1]))
    stress, strain = np.concatenate(stresses), np.concatenate(found)
    directions = np.random.default_rng(0).standard_normal((vectors.shape[1], _DIRECTIONS))
    directions /= np.abs(stress).max(axis=0)[:, None] + np.finfo(float).tiny
    points = np.unique(np.abs(stress @ directions).argmax(axis=0))
    return stress[points], strain[points]


def clamped_capacitance(solid: Solid, coarse_f: Array) -> Array:
    """Return the charges on the groups in C per volt on them, all displacements held at 0; shape (groups, groups).

    They follow from the electric field alone, on a mesh of boxes that is graded for it. At the edge of an electrode the
    field has the singularity r^(-1/2), so that the error of a capacitance is proportional to the length h of the cells
    there. It is removed by extrapolation from two meshes: (3 C(h) - C(3 h))/2. What is left of it is about a tenth of a
    per cent; half of the difference that the extrapolation makes is an upper bound.

    ``coarse_f`` is that of the mesh of the displacements. It is returned for a plate, whose field has no edges, for a
    mesh file, which is refined by its author, and if the graded mesh would have too many cells.
    """
    if solid.theory == "plate" or solid.mesh is not None:
        return coarse_f
    widths = [high - low for axis in range(3) for low, high in pairwise(electrode_edges(solid, axis))]
    finest = min((width for width in widths if width > _ONE_EDGE_M), default=0.0) / _PER_GAP
    if not finest:
        return coarse_f
    try:
        coarse, fine = _of_field(solid, GRADING * finest), _of_field(solid, finest)
    except ParameterError:
        return coarse_f
    return np.asarray(fine + (fine - coarse) / (GRADING - 1.0))


def _of_field(solid: Solid, finest_m: float) -> Array:
    """Return these capacitances on one mesh. Raise ParameterError if it has too many cells."""
    geometry = build_geometry(solid, finest_m)
    nodes, size = geometry.basis.N, geometry.size - geometry.displacements
    rows = geometry.place[: geometry.fields * nodes].reshape(nodes, -1)[:, -1] - geometry.displacements
    field = assemble_field(geometry.basis, geometry.parts, np.maximum(rows, -1), size)
    groups = geometry.groups
    between = slice(0, size - groups)
    electric = field[between, -groups:].toarray()
    return np.asarray(field[-groups:, -groups:].toarray() - electric.T @ factor(field[between, between])(electric))


# --- computed stators: those of the bundled sets in the package, others in the user's cache ---


@cache
def stator_of(solid: Solid) -> Stator:
    """Return the modes of a stator: bundled, from the user's cache, or computed.

    Raise ParameterError as :func:`solve_stator`.
    """
    bundled = _stored(BUNDLED / bundled_name(solid))
    if bundled is not None:
        return bundled
    content = hashlib.sha256(solid.model_dump_json().encode())
    for source in sorted(Path(__file__).parent.glob("*.*")):
        content.update(source.read_bytes())
    stored = None
    with suppress(ParameterError):
        stored = cache_folder("stators", ParameterError("no home")) / f"{content.hexdigest()[:32]}.npz"
    kept = stored and _stored(stored)
    if kept:
        return kept
    found = solve_stator(solid)
    with suppress(OSError, ParameterError):  # a result that cannot be kept is still one
        if stored:
            stored.parent.mkdir(parents=True, exist_ok=True)
            write_stator(stored, found)
    return found


def bundled_name(solid: Solid) -> str:
    """Return the name of a bundled stator's file; entries that a later version adds do not change it."""
    content = solid.model_dump_json(exclude_defaults=True)
    return f"{hashlib.sha256(content.encode()).hexdigest()[:16]}.npz"


def write_stator(path: Path, stator: Stator) -> None:
    """Write a stator to a compressed .npz. Raise ParameterError for a place that cannot be written."""
    arrays = vars(stator) | {name: getattr(stator, name).astype(np.float32) for name in _DRAWN}
    save_by_ending(path, {".npz": lambda place: np.savez_compressed(place, **arrays)})


def _stored(path: Path) -> Stator | None:
    """Return the stator in a file, or None if it is missing or damaged."""
    with suppress(OSError, ValueError, TypeError, BadZipFile), path.open("rb") as file, np.load(file) as arrays:
        return Stator(**arrays)
    return None
