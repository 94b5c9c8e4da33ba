# SPDX-License-Identifier: GPL-3.0-or-later
"""Frequency trackers and their loops."""
