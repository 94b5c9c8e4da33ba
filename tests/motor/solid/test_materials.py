# SPDX-License-Identifier: GPL-3.0-or-later
"""The library of materials against the constants of stress and stiffness that its sources print beside the others."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pyspice_runner.motor.solid.materials import VACUUM, materials

# B. A. Auld, Acoustic Fields and Waves in Solids, appendix 2, and Morgan TP-226; of PIC181 the source of its card: c11,
# c12, c13, c33, c44 in GPa, e31, e33, e15 in C/m², relative permittivities at constant strain. The sets were rounded
# independently: within 3 % (the permittivities, differences of rounded numbers, within 6 %), e31 within 0.25 C/m².
PRINTED = {
    "PZT-4": ((139.0, 77.8, 74.3, 115.0, 25.6), (-5.2, 15.1, 12.7), (730.0, 635.0)),
    "PZT-5A": ((121.0, 75.4, 75.2, 111.0, 21.1), (-5.4, 15.8, 12.3), (916.0, 830.0)),
    "PZT-5H": ((126.0, 79.5, 84.1, 117.0, 23.0), (-6.5, 23.3, 17.0), (1700.0, 1470.0)),
    "PZT-8": ((149.0, 81.1, 81.1, 132.0, 31.3), (-4.1, 14.0, 10.3), (900.0, 600.0)),
    "PIC181": ((152.3, 89.1, 85.5, 134.0, 28.3), (-4.5, 14.7, 11.0), (740.0, 634.0)),
}


@pytest.mark.parametrize("name", PRINTED)
def test_stiffness_stress_constants_and_clamped_permittivity_are_the_printed_ones(name: str) -> None:
    card, (elastic, stress, dielectric) = materials()[name], PRINTED[name]
    c, e, permittivity = card.stiffness_pa, card.stress_constants_c_m2, card.permittivity_f_m / VACUUM
    assert_allclose([c[0, 0], c[0, 1], c[0, 2], c[2, 2], c[3, 3]], 1e9 * np.array(elastic), rtol=0.03)
    assert_allclose([e[2, 2], e[0, 4]], stress[1:], rtol=0.03)
    assert abs(e[2, 0] - stress[0]) <= 0.25
    assert_allclose([permittivity[0, 0], permittivity[2, 2]], dielectric, rtol=0.065)


def test_every_material_is_stable_and_names_its_source() -> None:
    assert set(materials()) == {
        "PZT-4",
        "PZT-8",
        "PZT-5A",
        "PZT-5H",
        "PIC181",
        "steel",
        "alumina",
        "aluminium",
        "brass",
    }
    for card in materials().values():
        assert np.linalg.eigvalsh(card.stiffness_pa)[0] > 0.0
        assert not card.permittivity_f_m.any() or np.linalg.eigvalsh(card.permittivity_f_m)[0] > 0.0
        assert card.source


def test_a_material_turns_with_its_polarisation() -> None:
    card = materials()["PZT-4"]
    along_x = card.matrix("+x")
    assert_allclose([along_x[0, 0], along_x[1, 1], along_x[1, 2]], card.stiffness_pa[[2, 0, 0], [2, 0, 1]])
    # a field along x stretches along x by e33, and shears the planes that contain x by e15
    assert_allclose(along_x[6, :3], card.stress_constants_c_m2[2, [2, 0, 0]])
    assert_allclose([along_x[7, 5], along_x[8, 4]], 2 * [card.stress_constants_c_m2[0, 4]])
    assert_allclose(-along_x[6, 6], card.permittivity_f_m[2, 2])
    assert_allclose(card.matrix("-x")[6:, :6], -along_x[6:, :6])
    assert_allclose(card.matrix("-x")[:6, :6], along_x[:6, :6])


@pytest.mark.parametrize("name", ["steel", "alumina", "aluminium", "brass"])
def test_metals_and_alumina_are_the_same_in_all_directions(name: str) -> None:
    card = materials()[name]
    assert_allclose(card.matrix("+y"), card.matrix("-z"), rtol=1e-12, atol=1e-3)
