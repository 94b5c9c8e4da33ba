# SPDX-License-Identifier: GPL-3.0-or-later
"""The commands of ``piezomotor``, one module a subject; :mod:`pyspice_runner.cli` puts them together."""
