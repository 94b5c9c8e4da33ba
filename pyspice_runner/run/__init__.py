# SPDX-License-Identifier: GPL-3.0-or-later
"""One run of a motor: its settings, its waveforms, and whether they can be true."""
