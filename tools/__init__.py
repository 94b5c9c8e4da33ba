# SPDX-License-Identifier: GPL-3.0-or-later
"""Tools of the project, which are not part of the package: they write the files in ``netlists/`` and ``examples/``."""
