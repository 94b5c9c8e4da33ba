# SPDX-License-Identifier: GPL-3.0-or-later
"""Netlist text in, verified waveforms out; knows nothing of motors."""

from typing import Literal

#: what evaluates the equations: B-sources, which ngspice interprets, or a compiled module; ``auto`` chooses
Engine = Literal["spice", "compiled", "auto"]
