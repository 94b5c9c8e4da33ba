# SPDX-License-Identifier: GPL-3.0-or-later
"""The scan of current over frequency that a Thorlabs Elliptec module sends over its serial port.

The command ``c1`` (or ``c2``, of the second motor) is answered by the address, ``C1``, and 522 bytes in hexadecimal: of
each of 87 frequencies the period in 1/14.74 MHz and the current in 1/1866 A, in six bytes. The ELLx protocol manual has
the messages. Two public drivers agree on these numbers but not on the six bytes, and no module was at hand: one
(TapyrLabs/tl_elliptec) has a period of two bytes and one current of four, the low byte first; the other, a driver of
the ELL14 in Rust, a period and the currents forward and backward of two bytes each, the high byte first. The numbers
tell which it is: a period from 40 to 200 kHz is below 512, so that its order of bytes is plain, and of one current of
four bytes two are 0 at every point.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from pyspice_runner.errors import ParameterError, require
from pyspice_runner.motor.document import read_document

POINTS = 87
CLOCK_HZ, COUNTS_PER_AMPERE = 14.74e6, 1866.0
SUPPLY_V = 5.0  # of the modules
_BYTES = 6  # of a point
_LOWEST, _HIGHEST = 40e3, 200e3  # Hz, wider than the scan from 70 to 120 kHz
_MOST = 10.0  # A, ten times the limit of a module


def read_current_scan(
    path: str | Path, motor: int = 1, *, supply_v: float = SUPPLY_V, backward: bool = False
) -> dict[str, list[float]]:
    """Return the points of a scan: ``frequency`` (Hz) and ``power_w``, for :func:`~pyspice_runner.calibrate`.

    The power is that from the supply, so that it has the losses of the module's bridge.

    Args:
        path: a log of the serial port, a message in each line.
        motor: 1 or 2.
        supply_v: voltage of the supply in V.
        backward: whether the current is that of the backward direction, of an answer with one for each.

    Raises:
        ParameterError: for a file without the message, or a message with other contents.
    """
    if motor not in (1, 2):
        raise ParameterError(f"motor = {motor!r} is not valid: an Elliptec module has the motors 1 and 2.")
    require(0.0 < supply_v < 100.0, "supply_v", supply_v, "a voltage > 0 and < 100 V")
    name = Path(path).name
    text = read_document(Path(path), "the path of a log of the serial port")
    found = re.search(rf"^\s*[0-9A-Fa-f]C{motor}([0-9A-Fa-f]*)\s*$", text, re.MULTILINE)
    if found is None:
        raise ParameterError(f"{name} has no answer C{motor} in hexadecimal. Send c{motor} and keep the whole answer.")
    digits = found[1]
    if len(digits) != 2 * _BYTES * POINTS:
        raise ParameterError(
            f"{name}: the answer C{motor} has {len(digits)} digits; it must have {2 * _BYTES * POINTS}, six bytes for "
            f"each of {POINTS} points. Read for 12 s."
        )
    data = bytes.fromhex(digits)
    big = data[0] < data[1]
    words = np.frombuffer(data, ">u2" if big else "<u2").reshape(POINTS, _BYTES // 2)
    zero, only = (1, 2) if big else (2, 1)  # halves of one current of four bytes
    directions = words[:, zero].any()
    if backward and not directions:
        raise ParameterError(f"{name}: the answer C{motor} has one current for each frequency. Leave out backward.")
    place = (2 if backward else 1) if directions else only
    periods, currents = words[:, 0].tolist(), (words[:, place] / COUNTS_PER_AMPERE).tolist()
    for number, (period, current) in enumerate(zip(periods, currents, strict=True), start=1):
        if not CLOCK_HZ / _HIGHEST <= period <= CLOCK_HZ / _LOWEST or current > _MOST:
            raise ParameterError(
                f"{name}: point {number} of C{motor} is a period of {period} and {current:.4g} A; a module scans from "
                f"{_LOWEST:g} to {_HIGHEST:g} Hz below {_MOST:g} A. The answer has another layout, or was cut."
            )
    return {"frequency": [CLOCK_HZ / period for period in periods], "power_w": [supply_v * one for one in currents]}
