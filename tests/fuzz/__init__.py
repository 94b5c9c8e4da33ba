# SPDX-License-Identifier: GPL-3.0-or-later
"""Input gone wrong, by the thousand, at every door of the package: ``python -m tests.fuzz``."""
