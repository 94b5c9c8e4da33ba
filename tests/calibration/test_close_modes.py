# SPDX-License-Identifier: GPL-3.0-or-later
"""Two close modes of the flagship in a calibration: its start, its differences and its cautions."""

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.calibration.prediction import Predictor
from pyspice_runner.calibration.search import Search
from pyspice_runner.calibration.spectra import bands_of
from pyspice_runner.calibration.unknowns import unknowns_of
from pyspice_runner.run.point import Point
from validation.hidden import hidden, spectra_of

INDEX, SEED, NOISE = 0, 3, 0.003
EXCHANGED = 104, 101, *range(108, 112)  # without a start for it, the first two end in a minimum
FURTHER = SEED, *EXCHANGED[1:]
POINTS_SHOW = ("contact.friction", "modes.2.coupling_b_n_per_v", "modes.3.coupling_b_n_per_v")  # not a spectrum of A


@pytest.mark.parametrize(
    ("ports", "seed"),
    [(2, SEED), (1, EXCHANGED[0]), *(pytest.param(1, seed, marks=pytest.mark.soak) for seed in FURTHER)],
)
def test_close_modes_come_back_from_their_spectra(ports: int, seed: int) -> None:
    truth, values = hidden(INDEX if seed == SEED else 1, seed)
    if seed in EXCHANGED:
        low, high = (f"modes.{place}.frequency_hz" for place in (2, 3))
        values |= {low: values[high], high: values[low]}
        truth = truth.updated(values)
    spectra = spectra_of(truth, NOISE, np.random.default_rng(1))
    if ports == 1:
        spectra = [(spectrum.driven("A"), state) for spectrum, state in spectra]
    free = [path for path in values if path not in POINTS_SHOW]
    start = pr.load_motor("bimodal40").updated({path: values[path] for path in POINTS_SHOW})
    result = pr.calibrate(start, free=free, spectra=spectra, spectrum_error=NOISE)
    assert result.warnings == ()
    for one in result.estimates:
        assert abs(one.value - values[one.path]) < 4.0 * one.standard_error, one.path
        low, high = one.interval_95
        # the sum of squares is a parabola to a tenth
        assert high - low == pytest.approx(2.0 * 1.96 * one.standard_error, rel=0.1)


def test_a_spectrum_that_the_motor_misses_names_the_minimum_and_nothing_that_is_not_identified() -> None:
    truth, _ = hidden(INDEX, SEED)
    free = ["modes.3.quality_factor", "contact.friction"]
    result = pr.calibrate(
        pr.load_motor("bimodal40"), free=free, spectra=spectra_of(truth, NOISE, np.random.default_rng(1))[:1],
        spectrum_error=NOISE,
    )  # fmt: skip
    (warning,) = result.warnings
    assert "the search ended at a local minimum" in warning
    assert "No value holds: modes.3.quality_factor, contact.friction." in warning
    assert "give starts = 64" in warning


def test_differences_follow_a_sharp_resonance_and_close_modes_have_several_starts() -> None:
    truth, _ = hidden(INDEX, SEED)
    base = Point.of(truth, pr.default_drive(truth), audit=False)
    unknowns = unknowns_of(truth, base.drive, ["modes.2.frequency_hz"])
    bands = bands_of(spectra_of(truth, NOISE, np.random.default_rng(1)), "A", NOISE)
    predictor = Predictor(base, unknowns, None, bands)
    x, step = np.zeros(1), 1e-6
    (here,), ends = predictor.at([x]), predictor.at([x + step, x - step])
    exact = (ends[0].values - ends[1].values) / (2.0 * step)
    found = predictor.jacobian(x, here, central=True)[:, 0]
    assert np.linalg.norm(found - exact) < 0.02 * np.linalg.norm(exact)  # a difference of 0.2 % is off by half
    assert Search(predictor)._starts(x) == 16
    far = pr.load_motor("bimodal40")
    apart = Predictor(Point.of(far, pr.default_drive(far), audit=False), unknowns, None)
    assert Search(apart)._starts(np.array([np.log(0.98)])) == 1
