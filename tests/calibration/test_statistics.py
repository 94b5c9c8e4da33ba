# SPDX-License-Identifier: GPL-3.0-or-later
"""The test for misfit, against data whose noise is known."""

import numpy as np

from pyspice_runner.calibration.result import SetFit
from pyspice_runner.calibration.statistics import fits_of, misfits


def fits_of_noise(rng: np.random.Generator, wrong: float = 0.0) -> tuple[SetFit, ...]:
    """Fits of 24 points and 200 values of a spectrum by nine parameters; ``wrong`` bends the points, in errors."""
    slope = rng.standard_normal((224, 9)) * np.geomspace(1.0, 100.0, 9)
    data = rng.standard_normal(224)
    data[:24] += wrong * np.cos(np.arange(24.0))
    residuals = data - slope @ np.linalg.lstsq(slope, data, rcond=None)[0]
    return fits_of([("points", np.arange(24)), ("spectrum", np.arange(24, 224))], residuals, slope)


def test_the_probability_of_a_set_is_uniform_where_the_model_holds() -> None:
    rng = np.random.default_rng(1)
    found = np.array([[fit.probability for fit in fits_of_noise(rng)] for _ in range(1000)])
    for level in (0.05, 0.5):
        share = (found < level).mean(axis=0)
        # four standard errors of 1000 cases; residuals beyond three errors count less, which lowers the share
        assert np.all(np.abs(share - level) < 4.0 * np.sqrt(level * (1.0 - level) / 1000) + 0.1 * level), level


def test_points_that_the_model_does_not_explain_are_not_lost_among_those_of_a_spectrum() -> None:
    fits = fits_of_noise(np.random.default_rng(2), wrong=3.0)
    assert [fit.data for fit in misfits(fits)] == ["points"]


def test_one_wrong_reading_is_not_a_misfit() -> None:
    residuals = np.zeros(24)
    residuals[3] = 30.0
    (fit,) = fits_of([("points", np.arange(24))], residuals, np.eye(24)[:, :2])
    assert not misfits([fit])
    residuals[4] = 30.0
    (fit,) = fits_of([("points", np.arange(24))], residuals, np.eye(24)[:, :2])
    assert misfits([fit])
