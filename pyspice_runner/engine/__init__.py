# SPDX-License-Identifier: GPL-3.0-or-later
"""Netlist text in, verified waveforms out; knows nothing of motors."""
