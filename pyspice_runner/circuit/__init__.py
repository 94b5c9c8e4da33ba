# SPDX-License-Identifier: GPL-3.0-or-later
"""A motor and its benches as PySpice circuits, built from the libraries of ``behavioral/``."""
