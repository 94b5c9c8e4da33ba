# SPDX-License-Identifier: GPL-3.0-or-later
"""Steady states behind a driver as its designer sees them: fundamentals at the pins, at the stage and in the parts."""

from __future__ import annotations

from dataclasses import replace
from math import pi
from typing import Any

import numpy as np

from pyspice_runner.circuit.law import PAPER_LAW, ContactLaw
from pyspice_runner.circuit.source import GROUPS
from pyspice_runner.drivers.design import GroupPoint, RangePoint
from pyspice_runner.drivers.driver import Driver
from pyspice_runner.drivers.networks import CABLE, Passed, passed
from pyspice_runner.errors import SimulationError
from pyspice_runner.motor.drive import TwoPhaseDrive, two_phases
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.refusal import checked
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.run.point import Point
from pyspice_runner.steady.steady import SteadyState, steady_states

ACCURACY = 1e-2  # of the torque, of the friction torque under the preload: the design needs voltages and currents


def _phasor(values: Any, time: Any, frequency: float) -> complex:
    """Return the phasor of the fundamental over one period."""
    return complex(2j * frequency * np.trapezoid(values * np.exp(-2j * pi * frequency * time), time))


def range_point(name: str, state: SteadyState, driver: Driver | None) -> RangePoint:
    """Return a steady state with the power factor at the outputs of the stages; without a driver that of the pins."""
    waves = state.waveforms
    assert waves is not None
    frequency = 1.0 / waves.drive_period_s
    groups, real, apparent = {}, 0.0, 0.0
    for group in GROUPS:
        volts = _phasor(getattr(waves, f"voltage_{group}_v"), waves.time_s, frequency)
        amperes = _phasor(getattr(waves, f"current_{group}_a"), waves.time_s, frequency)
        source, through = at_stage(driver, group, volts, amperes)
        power, product = (source * through.conjugate()).real, abs(source) * abs(through)
        impedance = volts / amperes
        groups[group] = GroupPoint(abs(volts), abs(amperes), impedance.real, impedance.imag, power / product)
        real, apparent = real + 0.5 * power, apparent + 0.5 * product
    power_w = state.power_a_w + state.power_b_w
    factor, speed = real / apparent, state.speed_rad_s
    return RangePoint(name, speed, state.torque_n_m, power_w, real, factor, groups["a"], groups["b"])


def network_of(driver: Driver, group: str, frequency: float | None = None) -> tuple[complex, complex]:
    """Return the series impedance, stage and transformer included, and the admittance across the pin.

    They are those of the source at the pin: an admittance in front of a cable's inductance counts at its end.
    ``frequency`` in Hz is by default that of the driver; below 0 the values are those of a conjugate phasor.
    """
    open_v, _ = _before(driver, group, 1.0, 0.0, frequency)
    series, _ = _before(driver, group, 0.0, 1.0, frequency)
    return complex(series), complex((open_v - 1.0) / series)


def _before(
    driver: Driver, group: str, volts: complex, amperes: complex, frequency: float | None = None
) -> tuple[complex, complex]:
    """Return voltage and current of the lossless stage behind its transformer, for those of the pin."""
    omega = 2.0 * pi * (driver.frequency if frequency is None else frequency)
    for found in _passed(driver.equivalent(), group, volts, amperes, omega):
        volts, amperes = found.volts, found.amperes
    return volts, amperes


def _passed(driver: Driver, group: str, volts: Any, amperes: Any, omega: float) -> list[Passed]:
    """Return the network of a group from the pin to the stage for phasors of the pin: a cable first."""
    found = []
    for part in reversed(driver.parts(group)):
        before = passed(part.label, part.values, volts, amperes, omega)
        if before is None:
            break
        found.append(before)
        volts, amperes = before.volts, before.amperes
    return found


def load_of(driver: Driver, group: str, load: complex) -> complex:
    """Return the impedance in front of the cable, if there is one, for that of the group at its pin."""
    for part in driver.parts(group):
        if part.label == CABLE and (found := passed(CABLE, part.values, load, 1.0, 2.0 * pi * driver.frequency)):
            return complex(found.volts / found.amperes)
    return load


def at_stage(driver: Driver | None, group: str, volts: complex, amperes: complex) -> tuple[complex, complex]:
    """Return voltage and current of the lossless stage behind its transformer, for those of the pin."""
    return _before(driver, group, volts, amperes) if driver else (volts, amperes)


def impedance(point: RangePoint, group: str) -> complex:
    """Return the impedance of a group at its pin."""
    return complex(point.group(group).resistance_ohm, point.group(group).reactance_ohm)


def part_phasors(driver: Driver, points: tuple[RangePoint, ...]) -> dict[str, Any]:
    """Return phasors of the vectors of :func:`.part_loads`, an entry for each point, in a lossless stage's network."""
    found: dict[str, Any] = {}
    for group in GROUPS:
        pin = np.array([complex(point.group(group).voltage_v) for point in points])
        amperes = pin / np.array([impedance(point, group) for point in points])
        line, through = pin, amperes
        for before in _passed(driver, group, pin, amperes, 2.0 * pi * driver.frequency):
            stores, instance = before.stores, f"xnetwork_{group}"
            if "lline" in stores:
                found |= {
                    f"i(v.xcable_{group}.vcurrent)": stores["lline"],
                    f"v({driver.network}_{group})": before.volts,
                }
            else:
                found |= {
                    f"v({instance}.inner)": before.inner, f"i(v.{instance}.vcurrent)": before.amperes,
                    f"i(v.{instance}.vcoil)": stores["lseries"], f"i(v.{instance}.vparallel)": stores["lparallel"],
                }  # fmt: skip
            line, through = before.volts, before.amperes
        found |= {
            f"v({group})": pin, f"i(vpin_{group})": amperes, f"v(line_{group})": line,
            f"v(transformer_{group})": line,
            f"i(vout_{group})": through * (1.0 if driver.kind == "push-pull" else driver.ratio(group)),
        }  # fmt: skip
    return found


def warmed(point: Point, rise_k: float) -> Point:
    """Return an operating point behind a driver with a warmer motor, which a tracker follows by the frequency."""
    thermal, driver = Thermal.of(point.motor), point.source
    assert isinstance(driver, Driver)
    frequency = driver.frequency * thermal.frequency_factor(rise_k)
    return replace(point, motor=thermal.warmed(point.motor, rise_k), source=driver.updated({"frequency": frequency}))


@checked
def driver_state(
    motor: Motor,
    driver: Driver,
    *,
    speed: float | None = None,
    load_torque: float = 0.0,
    warmer_k: float = 0.0,
    contact: ContactLaw = PAPER_LAW,
    timeout: float | None = None,
) -> dict[str, Any]:
    """Return the steady state behind a driver with its network as it is: for sweeps over tolerances.

    The stage counts with its fundamental and its resistance (:meth:`.Driver.equivalent`).

    Args:
        motor: the motor, cold.
        driver: the driver.
        speed: at which the shaft is held, rad/s; ``None`` leaves it free.
        load_torque: torque in N·m of the load of a free shaft.
        warmer_k: temperature in K of the motor above that of its parameters; the frequency follows its resonance.
        contact: law of the contact.
        timeout: wall time in s after which a run is ended.

    Returns:
        ``torque_n_m``, ``speed_rad_s``, amplitudes ``voltage_a_v`` and ``current_a_a`` at the pins of each group,
        ``power_w`` into both, ``stage_power_w`` and ``power_factor`` of the fundamentals of the stages.

    Raises:
        ParameterError: for an invalid value.
        SimulationError: if there is no stable steady state.
    """
    cold = Point.of(
        motor, driver.equivalent(), speed=speed, load_torque=load_torque, contact=contact, timeout=timeout, audit=False
    )
    point = warmed(cold, warmer_k) if warmer_k else cold
    assert isinstance(point.source, Driver)
    # a start with the voltages of the stages at the pins, which a network that is tuned to the drive passes
    ideal = Point.of(
        point.motor, TwoPhaseDrive(**two_phases(point.source)), speed=speed, load_torque=load_torque, contact=contact,
        timeout=timeout, audit=False,
    )  # fmt: skip
    (begun,) = steady_states([ideal], accuracy=ACCURACY)
    starts = [begun.solution, None] if begun.solution is not None else [None]
    for start in starts:
        (state,) = steady_states([point], accuracy=ACCURACY, waveforms=True, starts=[start])
        if state.converged and (state.stable or state.held_by_friction):
            found = range_point("", state, driver)
            of_groups = {
                f"{name}_{group}_{unit}": getattr(found.group(group), f"{name}_{unit}")
                for group in GROUPS for name, unit in (("voltage", "v"), ("current", "a"))
            }  # fmt: skip
            names = ("speed_rad_s", "torque_n_m", "power_w", "stage_power_w", "power_factor")
            return {name: getattr(found, name) for name in names} | of_groups
    raise SimulationError("There is no stable steady state behind this driver.")
