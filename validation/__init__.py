# SPDX-License-Identifier: GPL-3.0-or-later
"""Campaigns that validate the model against independent references. Not in the wheel, not in ``make test``."""
