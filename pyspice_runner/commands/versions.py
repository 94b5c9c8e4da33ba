# SPDX-License-Identifier: GPL-3.0-or-later
"""The versions of the package and of ngspice, apart from all that the other commands load."""

from __future__ import annotations

import pyspice_runner as pr
from pyspice_runner.spice.ngspice import ngspice_version


def versions() -> str:
    """Return the versions as a line of text. Raise SimulationError if ngspice does not run."""
    return f"pyspice-runner {pr.__version__}, ngspice {ngspice_version()}\n"
