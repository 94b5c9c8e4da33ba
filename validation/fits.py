# SPDX-License-Identifier: GPL-3.0-or-later
"""Fits of spectra of eight classes, 200 of each, whose truth is known: ``python -m validation.fits``.

The fit was developed with other seeds (1 to 31, 1807 and 42001 to 42006) than :data:`SEED`. The truth is written down
here by its formulas and shares no code with the package. Each spectrum is fitted without any settings, and by a
least-squares fit that knows the right model and the noise and starts at the truth.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.optimize import least_squares

import pyspice_runner as pr
from validation.campaign import Campaign

CLASSES = (
    "lossless",
    "series loss",
    "constant loss tangent",
    "leads",
    "two close modes",
    "S11 noise",
    "proportional noise",
    "leads, constant loss tangent",
)
SERIES = ("series loss", "leads")
BEHIND_LEADS = ("leads", "leads, constant loss tangent")
TRIALS = 200  # 1,000 intervals: at 95 % their share has a standard deviation below 1 %
SEED = 42007  # first used after the last change of the fit
Z0 = 50.0


def admittance(f: np.ndarray, arms: np.ndarray, device: np.ndarray, kind: str) -> np.ndarray:
    """Y in S: arms as rows of R, L, C; device as C0, loss tangent (or R in series), R and L of the leads.

    A loss tangent is that of a constant-phase element: by Kramers and Kronig its capacitance falls with frequency, as
    that of every dielectric whose loss tangent is constant. C0 is that at the centre of the band.
    """
    jw = 2j * np.pi * f
    clamped, loss, ohm, henry = device
    falling = (f / np.sqrt(f[0] * f[-1])) ** (-2.0 / np.pi * np.arctan(loss))
    y = 1.0 / (loss + 1.0 / (jw * clamped)) if kind in SERIES else jw * clamped * falling * (1.0 - 1j * loss)
    for r, inductance, c in arms:
        y = y + 1.0 / (r + jw * inductance + 1.0 / (jw * c))
    return 1.0 / (ohm + jw * henry + 1.0 / y)


def draw(kind: str, trial: int, seed: int = SEED) -> dict[str, Any]:
    """Draw a device, its band and its noise."""
    rng = np.random.default_rng([seed, CLASSES.index(kind), trial])
    centre = float(np.exp(rng.uniform(np.log(2e5 if kind in BEHIND_LEADS else 2e4), np.log(2e6))))
    quality = float(np.exp(rng.uniform(np.log(50.0), np.log(800.0))))
    clamped = float(np.exp(rng.uniform(np.log(5e-10 if kind in BEHIND_LEADS else 1e-10), np.log(3e-9))))
    ratio = float(np.exp(rng.uniform(np.log(0.01), np.log(0.1)))) + 2.0 / quality
    loss = 0.0 if kind == "lossless" else float(rng.uniform(0.002, 0.02))
    device = np.array([clamped, loss, 0.0, 0.0])
    if kind in SERIES:
        device[1] = loss / (2 * np.pi * centre * clamped)
    frequencies, qualities, ratios = [centre], [quality], [ratio]
    if kind == "two close modes":
        frequencies.append(centre * (1.0 + float(rng.uniform(1.0, 4.0)) / quality))
        qualities.append(quality * float(rng.uniform(0.7, 1.4)))
        ratios.append(ratio * float(rng.uniform(0.3, 1.0)))
    arms = []
    for f, q, k in zip(frequencies, qualities, ratios, strict=True):
        c, w = k * clamped, 2 * np.pi * f
        arms.append([1 / (w * c * q), 1 / (w**2 * c), c])
    if kind in BEHIND_LEADS:
        device[2:] = rng.uniform(0.2, 2.0), float(np.exp(rng.uniform(np.log(1e-7), np.log(2e-6))))
    half = max(0.1, 6.0 / quality)
    points = int(min(max(401, 2 * half * quality * 4), 1601))
    f = np.linspace(centre * (1 - half), centre * (1 + half), points)
    y = admittance(f, np.array(arms), device, kind)
    error = (rng.standard_normal(points) + 1j * rng.standard_normal(points)) / np.sqrt(2.0)
    sigma = 1e-3
    if kind == "S11 noise":
        sigma = float(10.0 ** rng.uniform(-5, -3))
        s = (1 - Z0 * y) / (1 + Z0 * y) + sigma * error
        measured = (1 - s) / (1 + s) / Z0
        deviation = sigma * np.abs(1 + Z0 * y) ** 2 / (2 * Z0)
    else:
        if kind == "proportional noise":
            sigma = float(10.0 ** rng.uniform(-3, -2))
        measured = y * (1 + sigma * error)
        deviation = sigma * np.abs(y)
    return {
        "f": f, "measured": measured, "deviation": deviation, "arms": np.array(arms), "device": device, "kind": kind,
        "sigma": sigma,
    }  # fmt: skip


def informed(case: dict[str, Any]) -> np.ndarray:
    """Fit the right model from the truth, with the true weights; return the arms."""
    arms, device, kind, f = case["arms"], case["device"], case["kind"], case["f"]
    with_leads, with_loss = kind in BEHIND_LEADS, kind != "lossless"

    def values(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        found = device.copy()
        found[0] *= np.exp(x[0])
        if with_loss:
            found[1] = device[1] * (1 + x[1])
        if with_leads:
            found[2:] = device[2:] * (1 + x[2:4])
        # ln X, ln Q and the frequency in bandwidths, which keeps the problem well scaled
        scaled = []
        for (r, inductance, c), step in zip(arms, x[4:].reshape(-1, 3), strict=True):
            q, w = np.sqrt(inductance / c) / r, 1 / np.sqrt(inductance * c)
            impedance, w = np.sqrt(inductance / c) * np.exp(step[0]), w * (1 + step[1] / q)
            scaled.append([impedance / (q * np.exp(step[2])), impedance / w, 1 / (impedance * w)])
        return np.array(scaled), found

    active = [0, *([1] if with_loss else []), *([2, 3] if with_leads else []), *range(4, 4 + 3 * len(arms))]

    def residual(part: np.ndarray) -> np.ndarray:
        x = np.zeros(4 + 3 * len(arms))
        x[active] = part
        return ((admittance(f, *values(x), kind) - case["measured"]) / case["deviation"]).view(float)

    x = np.zeros(4 + 3 * len(arms))
    x[active] = least_squares(residual, np.zeros(len(active)), method="lm").x
    return values(x)[0]


def outcome(key: str) -> dict[str, Any]:
    """Fit the spectrum of a key such as ``"leads 3"``; return arms, deviations over their errors, and errors of L."""
    kind, _, number = key.rpartition(" ")
    case = draw(kind, int(number))
    fit = pr.fit_spectrum(pr.Spectrum.from_admittance(case["f"], case["measured"]))
    truth = case["arms"]
    undecided = any("do not distinguish" in caution for caution in fit.cautions)
    result: dict[str, Any] = {
        "index": key, "arms": len(fit.arms), "true_arms": len(truth), "leads": fit.leads is not None,
        "undecided": undecided,
    }  # fmt: skip
    if len(fit.arms) != len(truth):
        return result
    by_informed = informed(case)[0, 1]
    main = fit.arms[0]
    deviations = []
    for arm, (r, inductance, c) in zip(fit.arms, truth, strict=True):
        true = (r, inductance, c, 1 / (2 * np.pi * np.sqrt(inductance * c)), np.sqrt(inductance / c) / r)
        for name, value in zip(
            ("resistance_ohm", "inductance_h", "capacitance_f", "series_resonance_hz", "quality_factor"),
            true,
            strict=True,
        ):
            error = arm.standard_errors[name]
            deviations.append(None if error is None else float((getattr(arm, name) - value) / error))
    return result | {
        "deviations": deviations,
        "inductance": float(main.inductance_h / truth[0, 1] - 1),
        "informed": float(by_informed / truth[0, 1] - 1),
    }


def covered(scores: np.ndarray) -> float:
    """Return the share of the 95 % intervals that contain the true value."""
    return round(float(np.mean(np.abs(scores[np.isfinite(scores)]) < 1.96)), 4)


def of_class(trials: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Condense the trials of a class."""
    right = [item for item in trials if "deviations" in item]
    scores = np.array([item["deviations"] for item in right], dtype=float)
    decided = np.array([not item["undecided"] for item in right])
    fitted = np.array([item["inductance"] for item in right])
    known = np.array([item["informed"] for item in right])
    return {
        "trials": len(trials),
        "extra": sum(item["arms"] > item["true_arms"] for item in trials),
        "missed": sum(item["arms"] < item["true_arms"] for item in trials),
        "with_leads": sum(item["leads"] for item in trials),
        "undecided": int(np.count_nonzero(~decided)),
        "coverage": covered(scores),
        "coverage_decided": covered(scores[decided]),
        "coverage_undecided": covered(scores[~decided]) if np.count_nonzero(~decided) else None,
        "bias_over_error": [round(float(value), 3) for value in np.nanmean(scores, axis=0)],
        "inductance_error_over_informed": round(float(np.sqrt(np.mean(fitted**2) / np.mean(known**2))), 3),
    }


def summary(record: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the counts, coverage, bias and errors of each class."""
    classes = {kind: [one for one in record if one["index"].rpartition(" ")[0] == kind] for kind in CLASSES}
    return {kind: of_class(trials) for kind, trials in classes.items() if trials}


def passes(found: Mapping[str, Any]) -> bool:
    """Whether every class is within the limits that the fit is built for, as docs/impedance.md says.

    Where the data do not distinguish descriptions of loss and leads, an interval contains the values of all of them,
    and the true value in more than 95 % of cases: a class with many such spectra exceeds the upper limit.
    """
    return all(
        item["extra"] <= 3
        and item["missed"] == 0
        and 0.90 <= item["coverage"] <= 0.98
        and max(map(abs, item["bias_over_error"])) < 0.5
        and item["inductance_error_over_informed"] <= 1.5
        for item in found.values()
    )


def keys() -> list[str]:
    """Return the spectra, one of each class after the other."""
    return [f"{kind} {number}" for number in range(TRIALS) for kind in CLASSES]


CAMPAIGN = Campaign("fits", outcome, summary, passes, count=len(CLASSES) * TRIALS, keys=keys)

if __name__ == "__main__":
    sys.exit(CAMPAIGN.main())
