# SPDX-License-Identifier: GPL-3.0-or-later
"""Questions put to a motor: transient runs, admittance."""
