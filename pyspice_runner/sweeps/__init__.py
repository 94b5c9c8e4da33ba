# SPDX-License-Identifier: GPL-3.0-or-later
"""Many runs: sweeps and tolerances, their workers and their store."""
