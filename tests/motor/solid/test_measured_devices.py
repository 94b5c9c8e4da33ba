# SPDX-License-Identifier: GPL-3.0-or-later
"""Finite elements beside measured discs, rings, plates and diaphragms: the table of docs/measured.md is computed again.

The devices of ``measured_devices.toml`` are not stators, and the round ones are not boxes. They are meshed here, of the
elements and materials of ``[solid]``: a block by its quarter, what is round by a wedge whose sides move along
themselves only. With both electrodes at rest the modes are those of the short circuit; |Z| follows from all of them.
"""

import re
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from math import ceil, log, pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.optimize import brentq
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import splu
from scipy.special import j0, j1
from skfem import Basis, ElementHexS2, MeshHex

from pyspice_runner.motor.solid.elements import VOLTS, Part, assemble
from pyspice_runner.motor.solid.materials import materials

Array = NDArray[np.float64]

PAGE = Path(__file__).parents[3] / "docs" / "measured.md"
MEASURED = tomllib.loads(Path(__file__).with_name("measured_devices.toml").read_text(encoding="utf-8"))
DEVICES = {device["name"]: device for device in MEASURED["devices"]}
CERAMICS = ("PZT-4", "PZT-8", "PZT-5A", "PZT-5H")  # from which the card of an unnamed grade is taken
QUICK = ("bar 12 × 3 × 1 mm", "diaphragm FT-27T-4.3A1")
WEDGE = 0.05  # rad
PINHOLE = 0.005  # of the radius, in the middle of a disc: the edge of a wedge is no face


@dataclass(frozen=True)
class Response:
    """What the electrodes of a device see: modes of unit modal mass, of one of several equal sectors in parallel."""

    frequencies_hz: Array
    couplings: Array
    clamped_f: float
    sectors: float

    def capacitance(self, frequency_hz: Array, quality_factor: float = np.inf) -> Any:
        """Return C + Σ θ²/(ω_n² (1 + j/Q) − ω²) in farad; rigid motion has no charge."""
        elastic = self.frequencies_hz > 1e-6 * self.frequencies_hz[-1]
        stiffness = (2 * pi * self.frequencies_hz[elastic]) ** 2 * (1 + 1j / quality_factor)
        squares = (2 * pi * np.asarray(frequency_hz)[:, None]) ** 2
        return self.sectors * (self.clamped_f + np.sum(self.couplings[elastic] ** 2 / (stiffness - squares), axis=1))

    def static_f(self) -> float:
        """Return the capacitance far below all modes."""
        return float(self.capacitance(np.zeros(1))[0].real)

    def extremes_hz(self, low: float, high: float, quality_factor: float) -> tuple[float, float]:
        """Return the frequencies of the least and the greatest |Z| in a range, to 1/4000 of it."""
        frequency = np.linspace(low, high, 4001)
        admittance = np.abs(frequency * self.capacitance(frequency, quality_factor))
        return float(frequency[admittance.argmax()]), float(frequency[admittance.argmin()])


def steps(edges: tuple[float, ...], step: float) -> Array:
    """Return the edges and steps between them, none longer than ``step``."""
    pieces = [np.linspace(low, high, ceil((high - low) / step - 1e-9) + 1)[1:] for low, high in pairwise(edges)]
    return np.concatenate([edges[:1], *pieces])


def wedge(radii: tuple[float, ...], heights: tuple[float, ...], step: float, layer: float) -> tuple[MeshHex, Any]:
    """Return a wedge of straight elements with the area of the sector, and the same mesh in r, angle and z."""
    flat = MeshHex.init_tensor(steps(radii, step), np.array([-0.5, 0.5]) * WEDGE, steps(heights, layer))
    radius, angle, height = flat.p
    radius = radius * sqrt(WEDGE / np.sin(WEDGE))
    return MeshHex(np.array([radius * np.cos(angle), radius * np.sin(angle), height]), flat.t), flat


def respond(
    mesh: MeshHex,
    flat: MeshHex,
    layers: list[tuple[str, float, float, float]],
    free: Callable[[Array], list[tuple[float, float, float]]],
    sectors: float,
) -> Response:
    """Return the response of layers: material, density, and the heights between which it lies; the last is the ceramic.

    ``free`` gives the directions in which a node moves, from its place in ``flat``.
    """
    basis, places = Basis(mesh, ElementHexS2(), intorder=4), Basis(flat, ElementHexS2(), intorder=4).doflocs
    middle = flat.p[2, flat.t].mean(axis=0)
    parts = [
        Part(np.flatnonzero((low < middle) & (middle < high)), materials()[name].matrix(), density)
        for name, density, low, high in layers
    ]
    everything = 4 * basis.N
    stiffness, mass = assemble(basis, parts, np.append(np.arange(everything), [-1, -1, -1]), everything)
    entries: list[tuple[int, int, float]] = []
    for node, place in enumerate(places.T):
        for direction in free(place):
            column = entries[-1][1] + 1 if entries else 0
            entries += [(4 * node + axis, column, part) for axis, part in enumerate(direction) if part]
    moving = entries[-1][1] + 1
    _, _, low, high = layers[-1]
    ceramic = np.unique(basis.element_dofs[:, parts[-1].cells])
    near = 1e-6 * (high - low)
    upper = np.abs(places[2, ceramic] - high) < near
    between = ceramic[~upper & (np.abs(places[2, ceramic] - low) > near)]
    entries += [(4 * node + 3, moving + index, 1.0) for index, node in enumerate(between)]
    live = moving + len(between)
    entries += [(4 * node + 3, live, 1.0) for node in ceramic[upper]]
    rows, columns, values = zip(*entries, strict=True)
    kept = coo_matrix((values, (rows, columns)), shape=(everything, live + 1)).tocsc()
    system, inertia = (kept.T @ stiffness @ kept).tocsc(), (kept.T @ mass @ kept)[:moving, :moving].toarray()
    inner, outer = slice(moving, live), [*range(moving), live]  # the potentials between the electrodes are eliminated
    mixed = system[inner][:, outer].toarray()
    whole = system[outer][:, outer].toarray() - mixed.T @ splu(system[inner, inner].tocsc()).solve(mixed)
    squares, vectors = eigh(whole[:-1, :-1], inertia)
    frequencies = np.sqrt(np.maximum(squares, 0.0)) / (2 * pi)
    return Response(frequencies, whole[-1, :-1] @ vectors / VOLTS, -whole[-1, -1] / VOLTS**2, sectors)


def block(device: dict[str, Any], card: str, density: float) -> Response:
    """Return the response of a quarter of a block, its sides in the planes of symmetry held along their normals."""
    length, width, thickness = (device[f"{side}_m"] for side in ("length", "width", "thickness"))
    mesh = MeshHex.init_tensor(
        *(steps((0.0, 0.5 * side), thickness * 0.75) for side in (length, width)),
        steps((0.0, thickness), thickness / 2),
    )

    def free(place: Array) -> list[tuple[float, float, float]]:
        across = [(1.0, 0.0, 0.0)] * bool(place[0]) + [(0.0, 1.0, 0.0)] * bool(place[1])
        return [*across, (0.0, 0.0, 1.0)]

    return respond(mesh, mesh, [(card, density, 0.0, thickness)], free, 4.0)


def along(place: Array) -> list[tuple[float, float, float]]:
    """Return the directions of axisymmetric motion."""
    return [(float(np.cos(place[1])), float(np.sin(place[1])), 0.0), (0.0, 0.0, 1.0)]


def disc(device: dict[str, Any], card: str, density: float) -> Response:
    """Return the response of a disc or a ring; the modes through its thickness need the short elements."""
    radius, thickness = 0.5 * device["diameter_m"], device["thickness_m"]
    inner = 0.5 * device.get("hole_m", 2 * PINHOLE * radius)
    shortest = thickness / 6 if device["modes"][0]["name"] == "thickness" else min(thickness, radius / 20)
    mesh, flat = wedge((inner, radius), (0.0, thickness), shortest, min(shortest, thickness / 2))
    return respond(mesh, flat, [(card, density, 0.0, thickness)], along, 2 * pi / WEDGE)


def diaphragm(device: dict[str, Any], card: str, density: float) -> Response:
    """Return the response of a ceramic disc on a metal one, free."""
    radius, outside = 0.5 * device["diameter_m"], 0.5 * device["metal_diameter_m"]
    below, top = device["metal_thickness_m"], device["metal_thickness_m"] + device["thickness_m"]
    mesh, flat = wedge((PINHOLE * radius, radius, outside), (0.0, below, top), outside / 12, top)
    r, _, z = flat.p[:, flat.t].mean(axis=1)
    there = np.flatnonzero((z < below) | (r < radius))
    metal = (device["metal"], materials()[device["metal"]].density_kg_m3, 0.0, below)
    return respond(
        mesh.restrict(there), flat.restrict(there), [metal, (card, density, below, top)], along, 2 * pi / WEDGE
    )


@cache
def response(name: str, card: str) -> Response:
    """Return the response of a device of a material, with its own density if that is known."""
    device = DEVICES[name]
    density = device.get("density_kg_m3", materials()[card].density_kg_m3)
    if "mass_kg" in device:
        area = 0.25 * pi * (device["diameter_m"] ** 2 - device.get("hole_m", 0.0) ** 2)
        density = device["mass_kg"] / (area * device["thickness_m"])
    shapes = {"block": block, "disc": disc, "diaphragm": diaphragm}
    return shapes[device["shape"]](device, card, density)


def row(name: str, mode: dict[str, Any]) -> str:
    """Return the row of a mode in the table of docs/measured.md."""
    device = DEVICES[name]
    found = response(name, device["card"])
    resonance, antiresonance = found.extremes_hz(*mode["between_hz"], device["quality_factor"])
    cells = [f"{name}, {mode['name']}", device["card"]]
    cells.append(cell(1e-3 * resonance, 1e-3 * mode["resonance_hz"], 1e-3 * mode.get("tolerance_hz", 0.0)))
    cells.append(cell(1e-3 * antiresonance, 1e-3 * mode["antiresonance_hz"]) if "antiresonance_hz" in mode else "")
    if "capacitance_f" in device:
        measured = 1e9 * device["capacitance_f"]
        cells.append(cell(1e9 * found.static_f(), measured, measured * device.get("capacitance_tolerance", 0.0)))
    else:
        cells.append("")
    return "|" + "".join(f" {item} |" if item else " |" for item in cells)


def cell(predicted: float, measured: float, tolerance: float = 0.0) -> str:
    """Return what was predicted, what was measured with its tolerance, and the error in per cent."""
    spread = f" ± {tolerance:.2g}" if tolerance else ""
    error = 100 * (predicted / measured - 1)
    return f"{predicted:#.4g}".removesuffix(".") + f" / {measured:.6g}{spread} ({error:+.1f})"


CASES = [
    pytest.param(name, mode, id=f"{name}, {mode['name']}", marks=[] if name in QUICK else [pytest.mark.soak])
    for name, device in DEVICES.items()
    for mode in device["modes"]
]


@pytest.mark.parametrize(("name", "mode"), CASES)
def test_a_row_of_the_page_is_what_the_elements_give(name: str, mode: dict[str, Any]) -> None:
    wanted = row(name, mode)
    title = wanted.split("|")[1]
    printed = [line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith(f"|{title}|")]
    assert len(printed) == 1, wanted
    numbers = [re.findall(r"[-+]?\d+\.?\d*", line.removeprefix(f"|{title}|")) for line in (wanted, printed[0])]
    # the fourth digit, and the grid of the frequencies
    expected = [float(item) for item in numbers[0]]
    assert [float(item) for item in numbers[1]] == pytest.approx(expected, rel=1e-3, abs=0.11)
    assert printed[0].count("|") == wanted.count("|")


@pytest.mark.soak
@pytest.mark.parametrize("shape", ["bar", "disc", "plate", "diaphragm"])
def test_the_card_of_an_unnamed_grade_is_the_nearest_in_capacitance(shape: str) -> None:
    alike = {
        name: device
        for name, device in DEVICES.items()
        if name.startswith(shape) and device["card_by"] == "capacitance"
    }

    def off(name: str, card: str) -> float:
        found, device = response(name, card), DEVICES[name]
        if "capacitance_f" in device:
            return abs(log(found.static_f() / device["capacitance_f"]))
        frequency, ohm = device["impedance"]["frequency_hz"], device["impedance"]["ohm"]
        farad = abs(found.capacitance(np.array([frequency]), device["quality_factor"])[0])
        return abs(log(farad * 2 * pi * frequency * ohm))

    nearest = min(CERAMICS, key=lambda card: sum(off(name, card) for name in alike))
    assert {device["card"] for device in alike.values()} == {nearest}


@pytest.mark.soak
@pytest.mark.parametrize("name", [name for name, device in DEVICES.items() if device["card_by"] == "first radial"])
def test_the_card_of_a_sonar_disc_is_the_nearest_in_its_radial_mode(name: str) -> None:
    (mode,) = (mode for mode in DEVICES[name]["modes"] if mode["name"] == "first radial")

    def off(card: str) -> float:
        found, _ = response(name, card).extremes_hz(*mode["between_hz"], DEVICES[name]["quality_factor"])
        return abs(log(found / mode["resonance_hz"]))

    assert min(CERAMICS, key=off) == DEVICES[name]["card"]


def test_no_ceramic_carries_the_half_wave_of_the_large_sonar_disc() -> None:
    # thickness mode of a wide plate: c₃₃ᴰ = c₃₃ᴱ + e₃₃²/ε₃₃ˢ, the speed of sound √(c₃₃ᴰ/ρ)
    speeds = {}
    for name, card in materials().items():
        if name in (*CERAMICS, "PIC181"):
            stiffened = card.stress_constants_c_m2[2, 2] ** 2 / card.permittivity_f_m[2, 2]
            speeds[name] = sqrt((card.stiffness_pa[2, 2] + stiffened) / card.density_kg_m3)
    fastest = max(speeds, key=lambda name: speeds[name])
    device = DEVICES["sonar disc ⌀ 50 × 10 mm"]
    needed = 2.0 * device["thickness_m"] * device["modes"][0]["resonance_hz"]
    assert f"would need {needed:.0f} m/s" in PAGE.read_text(encoding="utf-8")
    assert f"(the fastest, {fastest}, {speeds[fastest]:.0f} m/s)" in PAGE.read_text(encoding="utf-8")
    assert speeds[fastest] < 0.75 * needed


def test_a_wedge_has_the_first_radial_mode_and_the_capacitance_of_the_standard() -> None:
    # IEEE Std 176-1987, 6.4: η J₀(η) = (1 − σ) J₁(η); the thickness t lowers it by (σ_t η t/2a)²/6 < 1e-3, σ_t ≈ 0.44.
    # The capacitance at constant stress is ε₃₃ᵀ πa²/t, less the pinhole.
    card, radius, thickness = materials()["PZT-4"], 0.01, 0.5e-3
    device = {"diameter_m": 2 * radius, "thickness_m": thickness, "modes": [{"name": "radial"}]}
    compliance = np.linalg.inv(card.stiffness_pa)
    sigma = -compliance[0, 1] / compliance[0, 0]
    eta = brentq(lambda x: x * j0(x) - (1 - sigma) * j1(x), 1.5, 2.5)
    wanted = eta / (2 * pi * radius) / sqrt(card.density_kg_m3 * compliance[0, 0] * (1 - sigma**2))
    found = disc(device, "PZT-4", card.density_kg_m3)
    strongest = np.argmax(np.abs(found.couplings[1:]) / found.frequencies_hz[1:]) + 1
    assert found.frequencies_hz[strongest] == pytest.approx(wanted, rel=1e-3)
    charge = card.stress_constants_c_m2 @ compliance
    permittivity = card.permittivity_f_m[2, 2] + charge[2] @ card.stress_constants_c_m2[2]
    assert found.static_f() == pytest.approx(permittivity * pi * radius**2 / thickness, rel=1e-3)
