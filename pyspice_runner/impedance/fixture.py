# SPDX-License-Identifier: GPL-3.0-or-later
r"""Compensation of a fixture by measurements of the open, the short and a load in place of the device.

.. math::
    Z = \frac{Z_m - Z_s}{1 - (Z_m - Z_s)\,Y_o}, \qquad
    Z = Z_L \frac{(Z_o - Z_l)(Z_m - Z_s)}{(Z_l - Z_s)(Z_o - Z_m)}

The first with open and short (the admittance of the open is :math:`Y_o = 1/(Z_o - Z_s)`), the second with a load Z_L
besides (Keysight, Impedance Measurement Handbook, 6th edition, appendix B). Without the open, Y_o is 0; without the
short, Z_s is 0. A port extension by the delay τ of a lossless line of 50 Ω between port and device turns the reflection
coefficient by 2ωτ, as the signal passes the line twice.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.errors import ParameterError, SpectrumError, require
from pyspice_runner.impedance.noise import REFERENCE_OHM
from pyspice_runner.impedance.spectrum import Spectrum
from pyspice_runner.motor.refusal import checked


@checked
def without_fixture(
    measured: Spectrum,
    *,
    opened: Spectrum | None = None,
    short: Spectrum | None = None,
    load: Spectrum | None = None,
    load_ohm: float = 50.0,
    port_extension_s: float = 0.0,
) -> Spectrum:
    """Return the spectrum of a device without its fixture.

    Args:
        measured: one-port spectrum of the device in its fixture.
        opened: the fixture without the device.
        short: the fixture with a short in place of the device.
        load: the fixture with a resistor in place of the device; needs ``opened`` and ``short`` too.
        load_ohm: resistance of the resistor in Ω.
        port_extension_s: delay of the line in s, one way; of the device's spectrum and of the fixture's.

    Raises:
        ParameterError: for a load without the open and the short, or a resistance or a delay out of range.
        SpectrumError: if a spectrum of the fixture has two ports or does not cover the band of the device.
    """
    if load is not None and (opened is None or short is None):
        raise ParameterError(
            "The load compensates a fixture only together with its open and its short; give these too."
        )
    require(load_ohm > 0.0, "load_ohm", load_ohm, "a resistance > 0 Ω")
    longest = 1.0 / float(measured.frequency_hz[-1])
    valid = 0.0 <= port_extension_s <= longest
    require(valid, "port_extension_s", port_extension_s, f"a delay from 0 to {longest:.3g} s, one period")
    if port_extension_s:
        measured = _behind_line(measured, port_extension_s)
        opened, short, load = (part and _behind_line(part, port_extension_s) for part in (opened, short, load))
    z = measured.impedance_ohm
    at_open, at_short, at_load = (_at(part, measured) for part in (opened, short, load))
    with np.errstate(all="ignore"):
        zero = at_short if at_short is not None else np.zeros_like(z)
        if at_load is not None and at_open is not None:
            device = load_ohm * (at_open - at_load) * (z - zero) / ((at_load - zero) * (at_open - z))
        else:
            stray = 1.0 / (at_open - zero) if at_open is not None else 0.0
            device = (z - zero) / (1.0 - (z - zero) * stray)
        y = 1.0 / device
    if not np.isfinite(y).all():
        raise SpectrumError(
            f"{measured.source or 'The spectrum'} cannot be compensated: at a frequency it equals that of the fixture. "
            "Check which file is the open, the short and the load."
        )
    return replace(measured, matrix_s=y[:, None, None])


def _behind_line(measured: Spectrum, delay_s: float) -> Spectrum:
    """Return the spectrum at the far end of a lossless line of 50 Ω."""
    y = REFERENCE_OHM * measured.admittance_s
    reflected = (1.0 - y) / (1.0 + y) * np.exp(4j * np.pi * measured.frequency_hz * delay_s)
    with np.errstate(all="ignore"):
        beyond = (1.0 - reflected) / (1.0 + reflected) / REFERENCE_OHM
    return replace(measured, matrix_s=beyond[:, None, None])


def _at(part: Spectrum | None, measured: Spectrum) -> NDArray[np.complex128] | None:
    """Return the impedance of the fixture in Ω at the frequencies of the device."""
    if part is None:
        return None
    here, there = measured.frequency_hz, part.frequency_hz
    if there[0] > here[0] * (1.0 + 1e-9) or there[-1] < here[-1] * (1.0 - 1e-9):
        raise SpectrumError(
            f"{part.source or 'The fixture'} covers {there[0]:g} Hz to {there[-1]:g} Hz, the device {here[0]:g} Hz to "
            f"{here[-1]:g} Hz; measure the fixture over the device's band."
        )
    return np.interp(here, there, part.impedance_ohm)
