# SPDX-License-Identifier: GPL-3.0-or-later
"""The elastic foot and stem between a beam and the rigid head of its tip.

The foot stands on the face of the beam, at the height z₀ above the neutral axis, the stem reaches from there to z₁. The
head is rigid. Relative to the beam it has four unknowns: φ, by which the foot turns in the face; s, by which the end of
the stem moves towards −x in bending and shear, and ϑ, by which it turns; v, by which it rises. With the mean deflection
w and rotation ψ of the beam over the foot,

    rotation ψ + φ + ϑ
    −x(z) = z ψ + (z − z₀) φ + s + (z − z₁) ϑ
    y = w + v

The mass of the stem moves with the head; a third of it would be right in bending, the whole is right along y. The stem
has the foot's width f and the width b of the beam. It is a Timoshenko cantilever of length l, with κG = E/3, which a
rectangle of ν = 0.3 has, and one of 0.2 to 0.35 within 6 per cent:

    s = l³/3EI F + 3l/EA F + l²/2EI M,   ϑ = l²/2EI F + l/EI M,   v = l/EA N

The foot turns by φ = 16.67 M/(π E_b b f²): a cantilever on a half-plane in plane stress (W. J. O'Donnell, "The
Additional Deflection of a Cantilever Due to the Elasticity of the Support", J. Appl. Mech. 27 (1960) 461). The beam
strains the root of the stem, too, which stiffens the beam: it acts as a layer of 0.1 f on its face. This factor is that
of finite elements of slender beams with feet of half and of all of the beam's height (docs/physics.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.errors import ParameterError
from pyspice_runner.motor.parameters import Beam, Patch, Tip

Array = NDArray[np.float64]
ODONNELL = 16.67 / pi
STRAINED = 0.1  # of the foot's width


@dataclass(frozen=True)
class Stem:
    """Stiffness of the unknowns φ, s, ϑ, v, or φ alone of a foot without a stem, or none; rows of motion over them."""

    stiffness: Array
    foot_m: float
    end_m: float

    @classmethod
    def of(cls, beam: Beam, tip: Tip) -> Stem:
        """Return foot and stem of a tip."""
        foot, length, width = 0.5 * beam.thickness_m, tip.stem_length_m, tip.foot_width_m
        if not width:
            return cls(np.empty((0, 0)), foot, foot)
        stiffness = np.zeros((4, 4))
        stiffness[0, 0] = beam.youngs_modulus_pa * beam.width_m * width**2 / ODONNELL
        if tip.stem_youngs_modulus_pa is None:
            return cls(stiffness[:1, :1], foot, foot)
        stretch = tip.stem_youngs_modulus_pa * beam.width_m * width  # EA
        bend = stretch * width**2 / 12  # EI
        sideways = length**3 / (3 * bend) + 3 * length / stretch
        across = length**2 / (2 * bend)
        stiffness[1:3, 1:3] = np.linalg.inv([[sideways, across], [across, length / bend]])
        stiffness[3, 3] = stretch / length
        return cls(stiffness, foot, foot + length)

    @property
    def turn(self) -> Array:
        """Rotation of the head per unknown."""
        return np.array([1.0, 0.0, 1.0, 0.0])[: len(self.stiffness)]

    @property
    def rise(self) -> Array:
        """Its motion along y."""
        return np.array([0.0, 0.0, 0.0, 1.0])[: len(self.stiffness)]

    def sideways(self, height_m: float) -> Array:
        """Motion towards −x at a height above the beam's neutral axis."""
        return np.array([height_m - self.foot_m, 1.0, height_m - self.end_m, 0.0])[: len(self.stiffness)]


def footprint(beam: Beam, tip: Tip) -> tuple[float, float]:
    """Return where the foot starts and ends along the beam in m."""
    low, high = tip.position_m - 0.5 * tip.foot_width_m, tip.position_m + 0.5 * tip.foot_width_m
    return max(low, 0.0), min(high, beam.length_m)


def require_room(beam: Beam, patches: Sequence[Patch], tip: Tip) -> None:
    """Raise ParameterError unless foot and stem fit between beam, patches and contact."""
    low, high = tip.position_m - 0.5 * tip.foot_width_m, tip.position_m + 0.5 * tip.foot_width_m
    slack, foot = 1e-9 * beam.length_m, f"tip.foot_width_m = {tip.foot_width_m:g} m"
    if low < -slack or high > beam.length_m + slack:
        raise ParameterError(
            f"{foot} reaches from {low:g} m to {high:g} m, beyond the beam from 0 to beam.length_m = "
            f"{beam.length_m:g} m; move the tip or make its foot narrower."
        )
    for index, patch in enumerate(patches):
        if patch.faces != "bottom" and min(high, patch.end_m) - max(low, patch.start_m) > slack and high > low:
            raise ParameterError(
                f"{foot} reaches from {low:g} m to {high:g} m, onto patches.{index}; the foot stands on the beam "
                "itself, so make it narrower or move the patch."
            )
    if high > low and (end := Stem.of(beam, tip).end_m) > tip.length_m:
        raise ParameterError(
            f"tip.stem_length_m = {tip.stem_length_m:g} m ends {end:g} m above the neutral axis, beyond tip.length_m = "
            f"{tip.length_m:g} m; the stem starts at half of beam.thickness_m, so shorten it."
        )
