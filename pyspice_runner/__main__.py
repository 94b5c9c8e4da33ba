# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m pyspice_runner`` is the command ``piezomotor``."""

from __future__ import annotations

from pyspice_runner.cli import main

main()
