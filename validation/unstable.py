# SPDX-License-Identifier: GPL-3.0-or-later
"""Time averages of unstable motions, and a calibration with them: ``python -m validation.unstable``.

The first cases are long runs on the dynamometer from rest at half the default step, whose means are taken by
integrators in the circuit. The next ones compare the torque of ``steady_state`` with such a run. The last one
calibrates friction and contact stiffness of ``andersen2002-unintended-mode`` with twelve points, six of which have the
torques of the first cases, of quasi-periodic motions; it takes about 15 minutes of CPU time.
"""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import pyspice_runner as pr
from pyspice_runner.circuit.bench import dynamometer_bench
from pyspice_runner.run.dynamometer import Dynamometer, off_beat
from pyspice_runner.run.kernel import transient
from pyspice_runner.run.point import Point
from pyspice_runner.steady.steady import steady_states
from validation.campaign import Campaign

SET, PLATE = "andersen2002-unintended-mode", str(Path(__file__).parents[1] / "examples" / "plate40.toml")
FREE = ("contact.friction", "contact.normal_stiffness_n_per_m15")
FRICTION, STIFFER = 0.24, 1.2  # true friction, and true normal stiffness over that of the set
BLOCKS, COUNTED = 40, 0.375  # decay times of a long run, and the share at its end that counts
NOISE = 5e-5  # N·m, of a measured torque: 0.4 % of the friction torque
UNSTABLE, STABLE = (0.0, 2.5, 5.0, 7.5, 10.0, 12.5), (0.0, 2.0, 4.0, 6.0, 8.0, 10.0)  # rad/s, at 100 V and at 60 V
MEASURED = {f"long run, {speed:g} rad/s": (SET, 100.0, 46e3, 180.0, speed) for speed in UNSTABLE}
COMPARED = {  # set, V, Hz, degrees, rad/s (slider: m/s)
    "andersen": (SET, 100.0, 46e3, 180.0, 0.0),
    "bimodal40": ("bimodal40", 60.0, 40e3, 90.0, 0.0),
    "plate40": (PLATE, 60.0, 40.9e3, 70.0, 0.0048),
}


def motor_of(name: str) -> pr.Motor:
    """Return a motor; that of the calibration with its true values."""
    motor = pr.load_motor(name)
    if name != SET:
        return motor
    return motor.updated(dict(zip(FREE, (FRICTION, STIFFER * motor.contact.normal_stiffness_n_per_m15), strict=True)))


def long_run(point: Point) -> tuple[float, float]:
    """Return the mean torque of a long run from rest in N·m, and how much those of its halves differ."""
    bench = Dynamometer(off_beat(point.with_step(0.5 * point.step)))
    setup, duration, period = bench.setup, BLOCKS * bench.duration, point.source.period
    circuit = dynamometer_bench(
        setup.motor, setup.source, speed=bench.speed, law=setup.law, meters=False,
        discretisation=setup.discretisation, start=bench.rest(), begun=0.0,
    )  # fmt: skip
    found = transient(circuit, bench.integrals(False), step=setup.step, duration=duration, uniform=True).vectors()
    edges = period * np.arange(round(duration / period) + 1)
    integral = np.interp(edges, found["time"], found["v(xbrake.v_friction)"])
    torques = setup.motor.rotor.radius_m * 1e-6 * np.diff(integral) / period
    counted = torques[round((1.0 - COUNTED) * len(torques)) :]
    first, last = (_weighted(half) for half in np.array_split(counted, 2))
    return _weighted(counted), abs(last - first)


def _weighted(values: Any) -> float:
    return float(np.average(values, weights=np.sin(np.pi * (np.arange(len(values)) + 0.5) / len(values)) ** 2))


def outcome(key: str) -> dict[str, Any]:
    """Return the torque of a long run, its comparison with the time average, or the calibration."""
    began, used = time.monotonic(), _cpu_s()
    if key in MEASURED:
        found = dict(zip(("long_run_n_m", "spread_n_m"), long_run(point_of(*MEASURED[key])), strict=True))
    else:
        found = _compared(point_of(*COMPARED[key])) if key in COMPARED else _calibrated()
    return found | {"seconds": round(time.monotonic() - began), "cpu_seconds": round(_cpu_s() - used)}


def _cpu_s() -> float:
    return sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


def point_of(name: str, voltage: float, frequency: float, phase: float, speed: float) -> Point:
    """Return the operating point of a case."""
    drive = pr.TwoPhaseDrive(voltage=voltage, frequency=frequency, phase_deg=phase)
    return Point.of(motor_of(name), drive, speed=speed, audit=False)


def _compared(point: Point) -> dict[str, Any]:
    (state,), (orbit,) = steady_states([point]), steady_states([point], accuracy=None)
    torque, spread = long_run(point)
    return {
        "method": state.method, "multiplier": state.largest_multiplier, "instability": state.instability,
        "periodic_n_m": orbit.torque_n_m, "torque_n_m": state.torque_n_m, "error_n_m": state.torque_error_n_m,
        "long_run_n_m": torque, "spread_n_m": spread,
    }  # fmt: skip


def _calibrated() -> dict[str, Any]:
    true, rng = motor_of(SET), np.random.default_rng(49)
    measured = {one["index"]: one for one in CAMPAIGN.cases()}
    torques = [measured[key]["long_run_n_m"] for key in MEASURED]
    periodic = steady_states([point_of(SET, 60.0, 46e3, 180.0, speed) for speed in STABLE])
    torques += [state.torque_n_m for state in periodic]
    data = {
        "voltage": [100.0] * len(UNSTABLE) + [60.0] * len(STABLE), "speed_rad_s": [*UNSTABLE, *STABLE],
        "torque_n_m": (torques + NOISE * rng.standard_normal(len(torques))).tolist(),
        "torque_n_m_error": [NOISE] * len(torques),
    }  # fmt: skip
    found = pr.calibrate(pr.load_motor(SET), data, free=FREE, drive=point_of(*COMPARED["andersen"]).drive)
    ends = {one.path: [one.value, *one.interval_95] for one in found.estimates}
    truth = {path: float(getattr(true.contact, path.rpartition(".")[2])) for path in FREE}
    return {
        "data": data, "values": ends, "true": truth, "rms_residual": found.rms_residual,
        "errors": found.errors.tolist(), "time_averages": found.summary().get("time averages", "none"),
        "warnings": list(found.warnings),
    }  # fmt: skip


def summary(record: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return stated over true error of each average, and whether the intervals of the calibration have the truth."""
    found: dict[str, Any] = {}
    for one in record:
        if "values" in one:
            inside = [low < one["true"][path] < high for path, (_, low, high) in one["values"].items()]
            found[one["index"]] = {"inside": inside, "time_averages": one["time_averages"]}
        elif "torque_n_m" in one:
            found[one["index"]] = one["error_n_m"] / abs(one["torque_n_m"] - one["long_run_n_m"])
    return found


def passes(found: Mapping[str, Any]) -> bool:
    """Return whether no average is farther off than its error, and the intervals have the true values."""
    return all(all(one["inside"]) if isinstance(one, dict) else one >= 1.0 for one in found.values())


CAMPAIGN = Campaign("unstable", outcome, summary, passes, keys=lambda: [*MEASURED, *COMPARED, "calibration"])

if __name__ == "__main__":
    sys.exit(CAMPAIGN.main())
