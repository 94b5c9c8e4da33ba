# SPDX-License-Identifier: GPL-3.0-or-later
"""A steel beam with two pairs of PZT-4 plates, by the theory of beams and by finite elements in three dimensions."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.motor.beam import Resonator, solve_resonator
from pyspice_runner.motor.parameters import Beam, Patch, Tip
from pyspice_runner.motor.solid.materials import VACUUM
from pyspice_runner.motor.solid.parameters import Box, Electrode, Face, Solid, Support
from pyspice_runner.motor.solid.stator import solve_stator

Array = NDArray[np.float64]
WIDTH = 1e-3  # in m: narrow, as the theory of beams has no stress across the width


@dataclass(frozen=True)
class PatchedBeam:
    """Group A from ``start`` to ``end``, group B its mirror image, on both faces; in m."""

    length: float
    height: float
    plate: float
    start: float
    end: float

    @property
    def spans(self) -> tuple[tuple[str, float, float], ...]:
        return ("A", self.start, self.end), ("B", self.length - self.end, self.length - self.start)

    def parts(self, theory: str = "timoshenko") -> tuple[Beam, tuple[Patch, ...], Tip]:
        """Return beam, patches and a tip without mass at a quarter of the length, where both modes move."""
        beam = Beam.model_validate(
            {"length_m": self.length, "width_m": WIDTH, "thickness_m": self.height, "youngs_modulus_pa": 211.9e9,
             "density_kg_m3": 7860.0, "theory": theory, "poissons_ratio": 0.291}
        )  # fmt: skip
        ceramic = {
            "faces": "both", "width_m": WIDTH, "thickness_m": self.plate, "layers": 1, "poissons_ratio": 0.33,
            "youngs_modulus_pa": 1 / 12.3e-12, "density_kg_m3": 7500.0, "piezoelectric_constant_m_per_v": -123e-12,
            "permittivity_f_m": 1300 * VACUUM,
        }  # fmt: skip
        patches = tuple(
            Patch.model_validate({"group": group, "start_m": start, "end_m": end, **ceramic})
            for group, start, end in self.spans
        )
        return beam, patches, Tip(position_m=self.length / 4, length_m=0.0, mass_kg=0.0, rotary_inertia_kg_m2=0.0)

    def beam(self, theory: str = "timoshenko") -> tuple[Array, Array]:
        """Return frequencies in Hz and |force factors| of group A, over the motion at a quarter, of two modes."""
        found: Resonator = solve_resonator(*self.parts(theory))
        return found.frequencies_hz, np.abs(found.couplings_n_per_v[0] / found.tip_y)

    def solid(self, element: float) -> tuple[Array, Array]:
        """Return the same by finite elements of half of the width; the end faces move along the beam only."""
        half, side, top = 0.5 * self.height, 0.5 * WIDTH, 0.5 * self.height + self.plate
        boxes = [
            Box(material="steel", from_m=(0.0, 0.0, -half), to_m=(self.length, side, 0.0)),
            Box(material="steel", from_m=(0.0, 0.0, 0.0), to_m=(self.length, side, half)),
        ]
        electrodes = []
        for group, start, end in self.spans:
            boxes += [
                Box(material="PZT-4", from_m=(start, 0.0, low), to_m=(end, side, low + self.plate), polarisation="+z")
                for low in (half, -top)
            ]
            electrodes += [
                Electrode.model_validate({"group": name, "from_m": (start, 0.0, z), "to_m": (end, side, z)})
                for name, z in ((group, top), (group, -top), ("ground", half), ("ground", -half))
            ]
        supports = (
            *(Support(from_m=(x, 0.0, -half), to_m=(x, side, half), directions="z") for x in (0.0, self.length)),
            Support(from_m=(0.0, 0.0, -top), to_m=(self.length, 0.0, top), directions="y"),
            Support(from_m=(self.length / 2, 0.0, 0.0), to_m=(self.length / 2, 0.0, 0.0), directions="x"),
        )
        quarter = self.length / 4
        found = solve_stator(
            Solid(
                element_m=element, lowest_hz=10.0, highest_hz=1.1 * self.beam()[0][1], quality_factor=1e3,
                boxes=tuple(boxes), electrodes=tuple(electrodes), supports=supports,
                contact=Face(from_m=(quarter, 0.0, 0.0), to_m=(quarter, side, 0.0), normal="+z", tangent="+x"),
            )
        )  # fmt: skip
        bending = np.flatnonzero(np.abs(found.tip_y) > 0.1)[[0, -1]]  # not the mode along the beam
        forces = np.abs(found.couplings_n_per_v[0, bending] / found.tip_y[bending])
        return found.frequencies_hz[bending], 2 * forces  # of the whole width


@dataclass(frozen=True)
class Headed:
    """A steel beam with a steel stem, ``foot`` wide and 4 mm long, and a head in its middle; in m."""

    length: float
    height: float
    foot: float
    head: float = 4e-3
    head_height: float = 3e-3
    stem: float = 4e-3

    def beam(self) -> tuple[tuple[float, float], ...]:
        """Return frequency in Hz, and motion of the contact per √kg, of the mode that moves up and the one sideways."""
        modulus, density, width, half = 211.9e9, 7860.0, 8e-3, 0.5 * self.height
        parts = (self.foot, self.stem, half + 0.5 * self.stem), (
            self.head, self.head_height, half + self.stem + 0.5 * self.head_height,
        )  # fmt: skip
        masses = [density * width * wide * high for wide, high, _ in parts]
        centre = sum(mass * z for mass, (_, _, z) in zip(masses, parts, strict=True)) / sum(masses)
        inertia = sum(
            mass * ((wide**2 + high**2) / 12 + z**2) for mass, (wide, high, z) in zip(masses, parts, strict=True)
        )
        beam = Beam(
            length_m=self.length, width_m=width, thickness_m=self.height, youngs_modulus_pa=modulus,
            density_kg_m3=density, poissons_ratio=0.291,
        )  # fmt: skip
        tip = Tip(
            position_m=self.length / 2, length_m=half + self.stem + self.head_height, mass_kg=sum(masses),
            rotary_inertia_kg_m2=inertia, foot_width_m=self.foot, centre_m=centre, stem_length_m=self.stem,
            stem_youngs_modulus_pa=modulus,
        )  # fmt: skip
        found = solve_resonator(beam, (), tip)
        return self._two(found.frequencies_hz, found.tip_x, found.tip_y, found.masses_kg)

    def solid(self, element: float) -> tuple[tuple[float, float], ...]:
        """Return the same by finite elements in plane stress."""
        half, middle, width = 0.5 * self.height, 0.5 * self.length, 8e-3
        top = half + self.stem
        corners = [
            (0.0, -half, self.length, 0.0), (0.0, 0.0, self.length, half),
            (middle - self.foot / 2, half, middle + self.foot / 2, top),
            (middle - self.head / 2, top, middle + self.head / 2, top + self.head_height),
        ]  # fmt: skip
        sides = ("A", 0.0, middle, width), ("B", middle, self.length, width), ("ground", 0.0, self.length, 0.0)
        found = solve_stator(
            Solid(
                theory="plate", element_m=element, lowest_hz=10.0, highest_hz=45e3, quality_factor=1e3,
                boxes=tuple(
                    Box(material="steel", from_m=(x, y, 0.0), to_m=(to, up, width)) for x, y, to, up in corners
                ),
                electrodes=tuple(
                    Electrode.model_validate({"group": name, "from_m": (x, -half, z), "to_m": (to, half, z)})
                    for name, x, to, z in sides
                ),
                supports=(
                    *(Support(from_m=(x, -half, 0.0), to_m=(x, half, 0.0), directions="y") for x in (0.0, self.length)),
                    Support(from_m=(0.0, 0.0, 0.0), to_m=(0.0, 0.0, 0.0), directions="x"),
                ),
                contact=Face(
                    from_m=(middle, top + self.head_height, 0.0), to_m=(middle, top + self.head_height, 0.0),
                    normal="+y", tangent="+x",
                ),
            )
        )  # fmt: skip
        return self._two(found.frequencies_hz, found.tip_x, found.tip_y, found.masses_kg)

    def _two(self, frequencies: Array, x: Array, y: Array, masses: Array) -> tuple[tuple[float, float], ...]:
        root = np.sqrt(masses)
        return tuple(
            (float(frequencies[best]), float(motion[best]))
            for motion in (np.abs(y) / root, np.abs(x) / root)
            for best in [int(np.argmax(motion))]
        )
