# SPDX-License-Identifier: GPL-3.0-or-later
"""Amplifiers and drivers: circuit, design, report."""
