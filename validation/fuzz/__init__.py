# SPDX-License-Identifier: GPL-3.0-or-later
"""Thousands of invalid inputs for every entry point of the package: ``python -m validation.fuzz``."""
