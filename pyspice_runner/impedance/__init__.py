# SPDX-License-Identifier: GPL-3.0-or-later
"""Impedance spectra: read, fitted, compared with a motor, and written for other programs."""
