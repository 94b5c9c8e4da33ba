# SPDX-License-Identifier: GPL-3.0-or-later
"""Calibration of random motors whose parameters are known: ``python -m validation.calibration --count 60``.

Each motor has the two modes near the drive of ``andersen2002-unintended-mode``, and values that differ at random from
those that the calibration starts with. Its measurements are twelve points of the speed–torque curve at two voltages
and two spectra, all with 1 % noise. The subject ``prediction`` calibrates with the points at 60 V alone and predicts
those at 100 V, which are compared without noise; ``law`` has a motor with a brush contact, calibrated with the
spring-slider. The outcome of a case is written at once, so that an interrupted study can be resumed.
"""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Iterator
from itertools import count
from typing import Any

import numpy as np

import pyspice_runner as pr
from pyspice_runner.circuit.law import Law
from pyspice_runner.impedance.spectrum import Spectrum
from pyspice_runner.run.paths import parameter
from pyspice_runner.run.point import Point
from pyspice_runner.steady.steady import steady_states
from validation.campaign import Campaign

SEED = 33
SUBJECTS = ("truth", "prediction", "law")
NOISE = 0.01  # of the greatest value of a quantity, and of the magnitude of an admittance
ACCURACY = 5e-4  # of the friction torque, for what is measured: a twentieth of the noise
SPREAD = 0.2  # of the logarithm of each value about that at the start
SPEEDS = (0.5, 3.0, 6.0, 9.0, 12.0, 15.0)  # rad/s
VOLTAGES = (60.0, 100.0)
MEASURED = ("torque_n_m", "current_a_rms_a")
UNDECIDED = "rotor.bearing_damping_n_m_s"  # a shaft that is held turns its bearing, which the contact does not feel
IMPROBABLE = 0.1  # of the least likely set of data: so many of the motors with the right law are expected below it
FREE = (
    "contact.friction", "contact.normal_stiffness_n_per_m15", "contact.tangential_compliance_tip_m_per_n23",
    "contact.restitution", "contact.preload_n", "modes.*.quality_factor", "modes.*.coupling_a_n_per_v",
)  # fmt: skip
BANDS = {"free": (41e3, 55e3), "preloaded": (41e3, 60e3)}  # Hz


def base() -> pr.Motor:
    """Return the motor to start from: two modes, with losses of impacts."""
    motor = pr.load_motor("andersen2002-unintended-mode").updated({"contact.restitution": 0.7})
    return motor.model_copy(update={"modes": motor.modes[1:], "provenance": {}})


def paths_of(motor: pr.Motor) -> list[str]:
    """Return the free parameters, each of its own."""
    numbers = range(len(motor.modes))
    every = ([path.replace("*", str(number)) for number in numbers] if "*" in path else [path] for path in FREE)
    return [path for several in every for path in several]


def value_of(motor: pr.Motor, path: str) -> float:
    """Return the value of a parameter."""
    found = parameter(path, motor, pr.default_drive(motor), {}).nominal
    assert found is not None
    return found


def points_of(
    motor: pr.Motor, law: Law | str, rng: np.random.Generator | None, voltages: tuple[float, ...]
) -> dict[str, Any]:
    """Return noisy points, without a generator those without noise; a point without a steady state is left out."""
    drive = pr.default_drive(motor)
    rows = [(voltage, speed) for voltage in voltages for speed in SPEEDS]
    setups = [
        Point.of(motor, drive.updated({"voltage": voltage}), speed=speed, contact=law, audit=False)
        for voltage, speed in rows
    ]
    states = steady_states(setups, accuracy=ACCURACY)
    kept = [place for place, state in enumerate(states) if state.stable]
    columns: dict[str, Any] = {
        "voltage": [rows[place][0] for place in kept], "speed_rad_s": [rows[place][1] for place in kept],
    }  # fmt: skip
    for name in MEASURED:
        values = np.array([getattr(states[place], name) for place in kept])
        error = NOISE * np.abs(values).max()
        columns[name] = values if rng is None else values + error * rng.standard_normal(len(values))
        columns[f"{name}_error"] = np.full(len(values), error)
    return columns


def spectra_of(motor: pr.Motor, rng: np.random.Generator) -> list[Any]:
    """Return noisy spectra, free and preloaded."""
    found = []
    for state, (start, stop) in BANDS.items():
        clean = pr.admittance(motor, start=start, stop=stop, points=121, state=state)  # type: ignore[arg-type]
        values = clean.driven("A")
        noise = rng.standard_normal((2, len(values)))
        values = values + NOISE * np.abs(values) * (noise[0] + 1j * noise[1])
        found.append((Spectrum.from_admittance(clean.frequency_hz, values, source=f"{state}.csv"), state))
    return found


def processor_s() -> float:
    """Return the processor time in s of this process and of the runs of ngspice that ended."""
    every = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in every)


def compared(subject: str, index: int) -> dict[str, Any]:
    """Return the outcome of a case."""
    rng = np.random.default_rng((SEED, index))
    start = base()
    paths = paths_of(start)
    factors = np.exp(SPREAD * rng.uniform(-1.0, 1.0, len(paths)))
    truth = start.updated({path: factor * value_of(start, path) for path, factor in zip(paths, factors, strict=True)})
    law: Law | str = "brush" if subject == "law" else "spring-slider"
    points = points_of(truth, law, rng, VOLTAGES[:1] if subject == "prediction" else VOLTAGES)
    began = processor_s(), time.perf_counter()
    free = [*paths, UNDECIDED] if subject == "truth" else paths
    result = pr.calibrate(start, points, free=free, spectra=spectra_of(truth, rng))
    found: dict[str, Any] = {
        "subject": subject, "index": index, "seconds": round(time.perf_counter() - began[1], 1),
        "processor_seconds": round(processor_s() - began[0], 1), "points": len(points["voltage"]),
        "steady_states": result.steady_states, "rms_residual": result.rms_residual,
        "misfit": any("does not explain" in text or "differs from" in text for text in result.warnings),
        "least_probability": min(fit.probability for fit in result.fits) * len(result.fits),
        "named": [one.path for one in result.estimates if not one.identifiable],
        "parameters": {
            one.path: [one.value, one.standard_error, *one.interval_95, value_of(truth, one.path)]
            for one in result.estimates
        },
    }  # fmt: skip
    if subject == "prediction":
        truths = points_of(truth, law, None, VOLTAGES[1:])
        curve = result.predict(truths)
        known = np.isfinite(curve.values)
        inside = (curve.low <= curve.measured) & (curve.measured <= curve.high)
        found["inside"] = float(np.mean(inside[known]))
        within = (curve.low_of_all <= curve.measured) & (curve.measured <= curve.high_of_all)
        found["whole"] = bool(within[known].all())
        torque = known & np.equal(curve.quantities, "torque_n_m")
        half_widths = 0.5 * (curve.high_of_all - curve.low_of_all)[torque]
        found["half_width"] = float(np.median(half_widths) / curve.measured[torque].max())
    return found


def summary(record: list[dict[str, Any]]) -> dict[str, Any]:
    """Return coverage, bias and counts of each subject."""
    found: dict[str, Any] = {}
    for subject in dict.fromkeys(case["subject"] for case in record):
        every = [case for case in record if case["subject"] == subject]
        cases = [case for case in every if "failed" not in case]
        rows: dict[str, list[list[float]]] = {}
        for case in cases:
            for path, values in case["parameters"].items():
                if path not in case["named"]:
                    rows.setdefault(path, []).append(values)
        found[subject] = {
            "cases": len(every), "failed": len(every) - len(cases), "misfits": sum(case["misfit"] for case in cases),
            "improbable": sum(case["least_probability"] < IMPROBABLE for case in cases),
            "undecided_named": sum(UNDECIDED in case["named"] for case in cases),
            "median_processor_seconds": float(np.median([case["processor_seconds"] for case in cases])),
            "parameters": {
                path: {
                    "count": len(values),
                    "covered": float(np.mean([low <= true <= high for _, _, low, high, true in values])),
                    "bias_over_interval": float(
                        np.mean([np.log(value / true) for value, *_, true in values])
                        / np.mean([np.log(high / low) for _, _, low, high, _ in values])
                    ),
                }
                for path, values in rows.items()
            },
        }  # fmt: skip
        if subject == "prediction":
            found[subject] |= {
                "mean_inside": float(np.mean([case["inside"] for case in cases])),
                "predicted": sum(case["whole"] for case in cases),
                "median_half_width": float(np.median([case["half_width"] for case in cases])),
            }
    return found


def table(found: dict[str, Any]) -> str:
    """Return the tables of a summary."""
    truth, law, prediction = (found[subject] for subject in ("truth", "law", "prediction"))
    rows = [
        "| parameter | motors | 95 % intervals that hold | bias over the width of the interval |", "|---|---|---|---|",
        *(f"| `{path}` | {one['count']} | {100.0 * one['covered']:.0f} % | {one['bias_over_interval']:+.2f} |"
          for path, one in truth["parameters"].items()),
    ]  # fmt: skip
    counts = {
    "bearing's damping, which a held shaft does not show, named as not decided": (truth["undecided_named"], truth),
    "misfit told, motor with the law of the calibration (nominally one in 1,000)": (truth["misfits"], truth),
    "the same at a level of 10 %": (truth["improbable"], truth),
    "the same, calibrated at 60 V": (prediction["improbable"], prediction),
    "misfit told, motor with a brush contact calibrated with the spring-slider": (law["misfits"], law),
    "calibrated at 60 V: torques and currents at 100 V, all twelve within their common 95 % band": (
        prediction["predicted"], prediction,
    ),
    }  # fmt: skip
    rows += ["", "| | motors |", "|---|---|"]
    rows += [f"| {words} | {count} of {of['cases']} |" for words, (count, of) in counts.items()]
    rows += [
        f"| values at 100 V within their own 95 % intervals | {100.0 * prediction['mean_inside']:.0f} % |",
        f"| median half width of the common band | {100.0 * prediction['median_half_width']:.1f} % of the peak |",
        f"| processor time, median | {truth['median_processor_seconds']:.1f} s |",
    ]
    return "\n".join(rows)


def outcome(key: str) -> dict[str, Any]:
    """Return the outcome of a case ``SUBJECT-INDEX``; a calibration that fails is one."""
    subject, _, index = key.partition("-")
    try:
        return compared(subject, int(index))
    except (pr.ParameterError, pr.SimulationError) as error:
        return {"subject": subject, "failed": str(error)}


def keys() -> Iterator[str]:
    """Return the cases: of each index all subjects."""
    return (f"{subject}-{index}" for index in count() for subject in SUBJECTS)


CAMPAIGN = Campaign("calibration", outcome, summary, count=60 * len(SUBJECTS), keys=keys)

if __name__ == "__main__":
    sys.exit(CAMPAIGN.main())
