# SPDX-License-Identifier: GPL-3.0-or-later
"""Controllers in C: shared libraries with the interface of ``piezomotor_firmware.h``, or with one function ``step``."""

from __future__ import annotations

import ctypes
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pyspice_runner.errors import ParameterError
from pyspice_runner.motor.drive import TwoPhaseDrive

MOST_LOGS = 64


class Firmware:
    """A controller in a shared library, loaded from a copy so that its variables are initialised.

    Raises:
        ParameterError: for a file that is not a library with the functions of a controller.
    """

    def __init__(self, path: str | Path, drive: TwoPhaseDrive, sample_time: float) -> None:
        try:
            with tempfile.TemporaryDirectory(prefix="piezomotor-") as folder:
                self._c = ctypes.CDLL(str(shutil.copy(path, folder)))
            self._single = hasattr(self._c, "firmware_step")
            step = self._c.firmware_step if self._single else self._c.step
            self.names = self._log_names() if self._single else []
        except (OSError, AttributeError, ValueError) as error:
            raise ParameterError(
                f"{path} cannot be used as a controller: {error}. Compile it as a shared library with the functions of "
                "piezomotor_firmware.h, or with a function step."
            ) from None
        self._step = step
        self._step.restype = None
        self.logs: list[list[float]] = []
        if self._single:
            self._out: Any = (ctypes.c_float * 4)(drive.voltage, drive.voltage_b, drive.phase_deg, drive.frequency)
            self._c.firmware_init(ctypes.c_float(sample_time), self._out)
        else:
            pointer = ctypes.POINTER(ctypes.c_double)
            self._step.argtypes = (ctypes.c_double, pointer, pointer)
            self._out = (ctypes.c_double * 3)(drive.voltage, drive.phase_deg, drive.frequency)

    def _log_names(self) -> list[str]:
        count = ctypes.c_int.in_dll(self._c, "firmware_logs").value
        if not 0 <= count <= MOST_LOGS:
            raise ValueError(f"firmware_logs = {count} must be 0 to {MOST_LOGS}")
        self._c.firmware_init, self._c.firmware_log  # noqa: B018 -- both must be there
        return [(name or b"").decode() for name in (ctypes.c_char_p * count).in_dll(self._c, "firmware_log_names")]

    def __call__(self, sample: object) -> Mapping[str, float]:
        """Return the commands of the library for a sample, whose fields are floats."""
        time, *seen = vars(sample).values()
        if not self._single:
            self._step(time, (ctypes.c_double * len(seen))(*seen), self._out)
            return dict(zip(("voltage", "phase_deg", "frequency"), map(float, self._out), strict=True))
        self._step((ctypes.c_float * (1 + len(seen)))(time, *seen), self._out)
        values = (ctypes.c_float * MOST_LOGS)()
        self._c.firmware_log(values)
        self.logs.append(list(values[: len(self.names)]))
        return dict(zip(("voltage_a", "voltage_b", "phase_deg", "frequency"), map(float, self._out), strict=True))
