# SPDX-License-Identifier: GPL-3.0-or-later
"""Stators by finite elements: materials, geometry, and the modes of a piezoelectric solid."""
