# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests with programs that the package does not need: run by ``make kicad`` and ``make ngspice46``, not by default."""
