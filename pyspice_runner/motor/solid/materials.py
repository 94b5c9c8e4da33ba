# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials of stators: elastic, piezoelectric and dielectric matrices, from the cards of ``cards.toml``.

The equations are those of IEEE Std 176 in the e-form, with Voigt's order 11, 22, 33, 23, 13, 12 and shear strains of
2 S₂₃. With the gradient of the potential, ∇φ = −E, they are symmetric:

    ( T )   ( cᴱ   eᵀ ) ( S  )
    ( D ) = ( e   −εˢ ) ( ∇φ )
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

VACUUM = 8.8541878128e-12  # F/m
_VOIGT = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])  # place of a pair of axes in Voigt's order
_FIRST, _SECOND = np.array([0, 1, 2, 1, 0, 0]), np.array([0, 1, 2, 2, 2, 1])  # and back


@dataclass(frozen=True)
class Material:
    """A material in its own axes, poled along axis 3."""

    name: str
    density_kg_m3: float
    specific_heat_j_per_kg_k: float
    stiffness_pa: Array  # cᴱ, at constant field: (6, 6)
    stress_constants_c_m2: Array  # e: (3, 6); zero without piezoelectricity
    permittivity_f_m: Array  # εˢ, at constant strain: (3, 3); zero in a conductor
    source: str

    def matrix(self, polarisation: str = "+z") -> Array:
        """Return the matrix of strain and gradient of the potential, (9, 9), for a sense of axis 3 such as ``"-y"``."""
        third = "xyz".index(polarisation[1])
        axes = np.array([(third + 1) % 3, (third + 2) % 3, third])  # 1, 2, 3 of the material; it turns about axis 3
        turn = np.zeros((3, 3))
        turn[axes, [0, 1, 2]] = 1.0
        sense = 1.0 if polarisation[0] == "+" else -1.0
        elastic = self.stiffness_pa[_VOIGT[:, :, None, None], _VOIGT]
        elastic = np.einsum("ia,jb,kc,ld,abcd->ijkl", turn, turn, turn, turn, elastic, optimize=True)
        piezo = np.einsum("ia,jb,kc,abc->ijk", turn, turn, turn, self.stress_constants_c_m2[:, _VOIGT], optimize=True)
        upper = elastic[_FIRST[:, None], _SECOND[:, None], _FIRST, _SECOND]
        mixed = sense * piezo[:, _FIRST, _SECOND]
        return np.block([[upper, mixed.T], [mixed, -turn @ self.permittivity_f_m @ turn.T]])


@cache
def cards() -> dict[str, Any]:
    """Return the cards of the library by name, as they are written."""
    return tomllib.loads((Path(__file__).parent / "cards.toml").read_text(encoding="utf-8"))


@cache
def materials() -> dict[str, Material]:
    """Return the materials of the library by name."""
    return {name: material_of(name, card) for name, card in cards().items()}


def material_of(name: str, card: Mapping[str, Any]) -> Material:
    """Return the material of a card in the e-form: c = s⁻¹, e = d c, εˢ = εᵀ − d eᵀ."""
    compliance = _isotropic(card["youngs_modulus_pa"], card["poisson"]) if "poisson" in card else _poled(card)
    charge = np.zeros((3, 6))
    if "charge" in card:
        given = card["charge"]
        charge[2, :3] = given["d31"], given["d31"], given["d33"]
        charge[0, 4] = charge[1, 3] = given["d15"]
    charge *= 1e-12
    relative = card.get("permittivity", {"k11": 0.0, "k33": 0.0})
    permittivity = VACUUM * np.diag([relative["k11"], relative["k11"], relative["k33"]])
    stiffness = np.asarray(np.linalg.inv(compliance), dtype=np.float64)
    stress = charge @ stiffness
    inertial = card["density_kg_m3"], card["specific_heat_j_per_kg_k"]
    return Material(name, *inertial, stiffness, stress, permittivity - charge @ stress.T, card["source"])


def _poled(card: Mapping[str, Any]) -> Array:
    """Return the compliance of a ceramic poled along axis 3, with s₆₆ = 2(s₁₁ − s₁₂), in 1/Pa."""
    s11, s12, s13, s33, s44 = (card["compliance"][name] for name in ("s11", "s12", "s13", "s33", "s44"))
    compliance = np.diag([s11, s11, s33, s44, s44, 2.0 * (s11 - s12)])
    compliance[:3, :3] = [[s11, s12, s13], [s12, s11, s13], [s13, s13, s33]]
    return 1e-12 * compliance


def _isotropic(youngs_modulus_pa: float, poisson: float) -> Array:
    compliance = np.diag([1.0, 1.0, 1.0] + 3 * [2.0 * (1.0 + poisson)])
    compliance[:3, :3] -= poisson * (1.0 - np.eye(3))
    return compliance / youngs_modulus_pa
