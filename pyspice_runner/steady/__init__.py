# SPDX-License-Identifier: GPL-3.0-or-later
"""Periodic steady states, curves, maps, small signals."""
