# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the theory of a beam with patches ends, and by how much its modes are then wrong.

**Shear lag.** A patch is strained through its inner face, by shear. Its force N(x) rises from 0 at its ends over a
length λ: with a quadratic displacement across the thickness t, the mean lags behind the inner face by τ t/3G, so that
N″ = (N − N_∞)/λ² with

    1/λ² = (3G/t) (1/(E t) + α b/(E_b b_b h))

E, G, t, b belong to the patch, E_b, b_b and the height h to the beam; α = 6 for a pair that bends the beam, 4 for one
patch. This is the solution of E. F. Crawley, J. de Luis, "Use of Piezoelectric Actuators as Elements of Intelligent
Structures", AIAA J. 25 (1987) 1373, with the shear of the patch in place of that of their bond layer. The mean of N
over the length l of the patch is a share of what the laminate has:

    N/N_∞ = 1 − tanh(X)/X,   X = l/2λ

The estimate of the errors compares with a Timoshenko beam whose patches are shortened to that share in stiffness and
piezoelectric moment, and have their mass over the whole length. docs/physics.md compares it with finite elements.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from math import sqrt, tanh

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.errors import ParameterError
from pyspice_runner.motor.beam import SIDES, solve_resonator
from pyspice_runner.motor.parameters import Beam, Patch, Tip

Array = NDArray[np.float64]

HIGHEST = 0.1  # height over half wave: there Bernoulli–Euler is 1.6 % too high
LEAST_SHARE = 0.9  # of the laminate's force

_FADED = 1e-4  # of its stiffness: what a patch keeps where the estimate takes it away


@cache
def beam_cautions(beam: Beam, patches: tuple[Patch, ...], tip: Tip, count: int) -> tuple[str, ...]:
    """Return one sentence for height and one for shear lag, if they make the ``count`` lowest modes wrong."""
    ratios = heights_over_half_wave(beam, patches, count)
    shares = [share_of_laminate(beam, patch) for patch in patches]
    high, lagging = ratios[-1] > HIGHEST, bool(shares) and min(shares) < LEAST_SHARE
    if not (high or lagging):
        return ()
    try:
        frequencies, forces = map(_listed, estimated_errors(beam, patches, tip, count))
    except ParameterError:  # its stiffness varies too much without the ends of the patches
        frequencies = forces = "an unknown size"
    found = []
    if high:
        said = " and ".join(f"{ratio:.2g}" for ratio in ratios)
        found.append(
            f"The height of the beam is {said} of the half waves of its modes, more than {HIGHEST:g}: by its "
            f"dimensions its frequencies have an estimated error of {frequencies}."
            + (' Specify theory = "timoshenko".' if beam.theory != "timoshenko" else "")
        )
    if lagging:
        worst = patches[int(np.argmin(shares))]
        found.append(
            f"Shear lag leaves {100 * min(shares):.0f} % of the laminate's force in a patch "
            f"{(worst.end_m - worst.start_m) / worst.thickness_m:.2g} times as long as thick: by its dimensions the "
            f"force factors have an estimated error of {forces}."
        )
    return tuple(found)


def heights_over_half_wave(beam: Beam, patches: tuple[Patch, ...], count: int) -> Array:
    """Return the largest height, with the ceramic, over the half wave L/n of mode n, from 1 to ``count``."""
    edges = sorted({0.0, *(patch.start_m for patch in patches)})
    thick = [
        sum(patch.thickness_m * len(SIDES[patch.faces]) for patch in patches if patch.start_m <= x < patch.end_m)
        for x in edges
    ]
    return np.asarray((beam.thickness_m + max(thick)) * np.arange(1, count + 1) / beam.length_m)


def share_of_laminate(beam: Beam, patch: Patch) -> float:
    """Return the mean force of a patch over that of a laminate, from the header of this module."""
    thickness, both = patch.thickness_m, patch.faces == "both"
    patch_stiffness = patch.youngs_modulus_pa * thickness
    beam_stiffness = beam.youngs_modulus_pa * beam.thickness_m * beam.width_m / patch.width_m
    shear = patch.youngs_modulus_pa / (2.0 * (1.0 + patch.poissons_ratio))
    decay = sqrt(3.0 * shear / thickness * (1.0 / patch_stiffness + (6.0 if both else 4.0) / beam_stiffness))
    reach = 0.5 * (patch.end_m - patch.start_m) * decay
    return 1.0 - tanh(reach) / reach


def estimated_errors(beam: Beam, patches: tuple[Patch, ...], tip: Tip, count: int) -> tuple[Array, Array]:
    """Return the relative errors of frequencies and of force factors against the estimate with shear lag.

    A force factor is that of the group which drives the mode best.
    """
    ours = solve_resonator(beam, patches, tip, count=count)
    exact = beam.model_copy(update={"theory": "timoshenko"})
    theirs = solve_resonator(
        exact, tuple(part for patch in patches for part in _lagging(beam, patch)), tip, count=count
    )
    x = np.linspace(0.0, beam.length_m, 101)
    shapes, others = (item.deflection(x) / np.linalg.norm(item.deflection(x), axis=0) for item in (ours, theirs))
    same = np.abs(shapes.T @ others).argmax(axis=1)
    groups = np.argmax(np.abs(ours.couplings_n_per_v), axis=0)
    columns = np.arange(count)
    with np.errstate(divide="ignore", invalid="ignore"):  # a mode that no group drives
        forces = np.abs(ours.couplings_n_per_v[groups, columns] / theirs.couplings_n_per_v[groups, same]) - 1.0
    return ours.frequencies_hz / theirs.frequencies_hz[same] - 1.0, np.nan_to_num(forces, posinf=0.0)


def _lagging(beam: Beam, patch: Patch) -> tuple[Patch, Patch, Patch]:
    """Return a patch whose ends have mass only, so that the middle is its share of the length."""
    middle, half = 0.5 * (patch.start_m + patch.end_m), 0.5 * (patch.end_m - patch.start_m)
    start, end = middle - half * share_of_laminate(beam, patch), middle + half * share_of_laminate(beam, patch)
    faded = {"youngs_modulus_pa": _FADED * patch.youngs_modulus_pa, "piezoelectric_constant_m_per_v": 0.0}
    return (
        patch.model_copy(update={**faded, "end_m": start}),
        patch.model_copy(update={"start_m": start, "end_m": end}),
        patch.model_copy(update={**faded, "start_m": end}),
    )


def _listed(errors: Iterable[float]) -> str:
    return " and ".join(f"{100 * x:+.0f} %" if abs(x) >= 0.1 else f"{100 * x:+.2g} %" for x in errors)
