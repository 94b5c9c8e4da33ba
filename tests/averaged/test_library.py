# SPDX-License-Identifier: GPL-3.0-or-later
"""The parts of the averaged motor against closed forms and against a period of the contact that NumPy computes."""

from math import pi
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from pyspice_runner.averaged.library import averaged_contact, check_resolution, contact_pins
from pyspice_runner.errors import ParameterError
from pyspice_runner.spice.library import definitions
from tests.circuit.batch import measured
from tests.selection import mostly

CONTACT = {"normal_stiffness": 5e9, "compliance": 4e-7, "mu": 0.25, "radius": 0.012, "preload": 6.0, "damping": 0.4}


@pytest.mark.parametrize(
    ("phases", "harmonics", "message"),
    [
        (8, 1, "phases = 8 is out of range: it must be a whole number from 16 to 512"),
        (64, 0, "harmonics = 0 is out of range: it must be a whole number from 1 to 6"),
        (16, 6, "phases = 16 cannot resolve 6 harmonics: give at least 32 phases"),
    ],
)
def test_resolution_out_of_range_is_an_error(phases: int, harmonics: int, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        check_resolution(phases, harmonics)


def contact_period(
    phases: int, x: dict[int, complex], y: dict[int, complex], speed: float, frequency: float, series: float
) -> dict[str, np.ndarray]:
    """Forces at the phases of a period that repeats, by the law itself; displacements in m, harmonic 0 is the mean."""
    angle = 2.0 * pi * np.arange(phases) / phases

    def motion(parts: dict[int, complex]) -> np.ndarray:
        return sum((part * np.exp(1j * order * angle)).real for order, part in parts.items())

    along, towards = motion(x), motion(y)
    radius, stiffness = CONTACT["radius"], CONTACT["normal_stiffness"]
    seat = (CONTACT["preload"] / stiffness) ** (2.0 / 3.0) + series * CONTACT["preload"]
    reach = seat + towards - along**2 / (2.0 * radius)
    approach = np.maximum(reach, 0.0)

    rate = 0.5 * phases * frequency
    central = [np.roll(values, -1) - np.roll(values, 1) for values in (along, towards)]
    velocity = rate * (central[1] - along / radius * central[0])

    def held(depth: float, number: int) -> float:
        """Factor of the damping at a phase, with the rate of the compression by the forces before."""
        force = stiffness * depth**1.5
        known = velocity[number] + series * rate * (4.0 * normal[number - 1] - normal[number - 2])
        factor = 1.0 + CONTACT["damping"] * known
        return max(factor / (1.0 + 3.0 * CONTACT["damping"] * series * rate * force), 0.0)

    normal, depth, hold = np.zeros((3, phases))
    for number in 3 * list(range(phases)):  # until the force repeats
        most = float(approach[number])

        def excess(at: float, number: int = number, most: float = most) -> float:
            return at + series * stiffness * at**1.5 * held(at, number) - most

        depth[number] = brentq(excess, 0.0, most, xtol=1e-20) if most else 0.0
        hold[number] = held(float(depth[number]), number)
        normal[number] = stiffness * depth[number] ** 1.5 * hold[number]
    limit = CONTACT["mu"] * CONTACT["compliance"] * stiffness ** (2.0 / 3.0) * depth * hold
    moved = along - np.roll(along, 1) - speed * radius / (phases * frequency)
    moved += 0.5 * (along + np.roll(along, 1)) / radius * (towards - np.roll(towards, 1))
    # within 1 nm of depth, the share of the interval after the contact has closed
    moved *= (depth + 1e-9) / (depth + 1e-9 + np.maximum(-np.roll(reach, 1), 0.0))
    slider = np.zeros(phases)
    last = 0.0
    for _ in range(200):  # until the slider repeats
        for number in range(phases):
            last = min(max(last + moved[number], -limit[number]), limit[number])
            slider[number] = last
    used = np.divide(np.abs(slider), limit, out=np.zeros(phases), where=limit > 0.0)
    friction = CONTACT["mu"] * normal * np.sign(slider) * (1.0 - (1.0 - used) ** 1.5)
    lean = along / radius
    return {
        "normal": normal, "friction": friction, "fx": normal * lean - friction, "fy": -normal - friction * lean,
        "angle": angle,
    }  # fmt: skip


def run_contact(
    tmp_path: Path, phases: int, harmonics: int, x: dict[int, complex], y: dict[int, complex], speed: float,
    frequency: float, series: float,
) -> dict[str, float]:  # fmt: skip
    """Settled outputs of the subcircuit for a prescribed motion of the tip."""
    pins = contact_pins(harmonics)
    values = {f"{axis}_0": 1e6 * parts.get(0, 0.0).real for axis, parts in (("x", x), ("y", y))}
    for axis, parts in (("x", x), ("y", y)):
        for order in range(1, harmonics + 1):
            part = 1e6 * parts.get(order, 0.0)
            values |= {f"{axis}_re{order}": part.real, f"{axis}_im{order}": part.imag}
    values |= {"x_own": values["x_0"], "frequency": frequency, "shaft": speed}
    sources = [f"V{name} {name} 0 {values[name]!r}" for name in pins if name in values]
    found = [name for name in pins if name not in values]
    end = 60.0 / frequency
    # the tip is on its path from the start: it does not move there at t = 0, which would take the slider along
    last = np.exp(-2j * np.pi * np.arange(harmonics + 1) / phases)
    path = 1e6 * float(sum((x.get(order, 0.0) * last[order]).real for order in range(harmonics + 1)))
    values_of = CONTACT | {"series": series}
    lines = [
        "contact",
        definitions(averaged_contact(phases, harmonics)),
        *sources,
        f"Xc {' '.join(pins)} piezomotor_averaged_contact " + " ".join(f"{k}={v!r}" for k, v in values_of.items()),
        ".options reltol=1e-6 vntol=1e-9 abstol=1e-12 method=gear",
        f".ic v(xc.moves)={path!r}",
        *(f".measure tran {name} FIND v({name}) AT={end!r}" for name in found),
        f".tran {0.1 / frequency!r} {1.01 * end!r} 0 {0.2 / frequency!r} uic",
        ".end",
    ]  # fmt: skip
    return measured("\n".join(lines) + "\n", tmp_path)


@pytest.mark.parametrize(
    ("speed", "lift", "series"),
    mostly(
        pytest.mark.soak,
        [(0.0, 0.4, 0.0), (3.0, 0.4, 0.0), (-4.0, 1.6, 0.0), (3.0, 0.6, 1e-7), (-4.0, 2.0, 1e-7)],
        [(3.0, 0.4, 0.0), (-4.0, 2.0, 1e-7)],
    ),
    ids=["standing", "turning", "contact opens", "compliance in series", "with it the contact opens"],
)
def test_contact_gives_the_sums_of_the_law_over_a_period(
    tmp_path: Path, speed: float, lift: float, series: float
) -> None:
    """Means and harmonics, with those that the model leaves out; the period that NumPy repeats until it closes.

    The compliance of 1e-7 m/N is 0.8 of that of the contact under its preload.
    """
    frequency, phases, harmonics = 40e3, 32, 2
    depth = (CONTACT["preload"] / CONTACT["normal_stiffness"]) ** (2.0 / 3.0)
    x = {0: 0.02e-6 + 0j, 1: 0.25e-6 - 0.1e-6j, 2: 0.05e-6j}
    y = {0: 0.05e-6 + 0j, 1: lift * depth * (0.8 + 0.6j), 2: 0.1 * depth + 0j}
    law = contact_period(phases, x, y, speed, frequency, series)
    found = run_contact(tmp_path, phases, harmonics, x, y, speed, frequency, series)
    scale = CONTACT["preload"]
    # the slider's memory settles over the periods of the run to below exp(-60); the force with a
    # compliance is right to 3e-5
    bound = 1e-4 * max(scale, law["normal"].max() if series else 0.0)
    for name in ("normal", "friction"):
        assert found[name] == pytest.approx(law[name].mean(), abs=bound)
    for axis in ("fx", "fy"):
        assert found[f"{axis}_0"] == pytest.approx(law[axis].mean(), abs=bound)
        for order in range(1, harmonics + 3):
            part = 2.0 * (law[axis] * np.exp(-1j * order * law["angle"])).mean()
            assert found[f"{axis}_re{order}"] == pytest.approx(part.real, abs=bound)
            assert found[f"{axis}_im{order}"] == pytest.approx(part.imag, abs=bound)
    assert found["open"] == pytest.approx((law["normal"] == 0.0).mean(), abs=1.0 / phases)
