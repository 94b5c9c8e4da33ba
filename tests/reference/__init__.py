# SPDX-License-Identifier: GPL-3.0-or-later
"""An independent integrator of the standing-wave piezomotor: the yardstick of the SPICE model."""
