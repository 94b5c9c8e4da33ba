# SPDX-License-Identifier: GPL-3.0-or-later
"""The parameters of a motor from measurements of its operating points and spectra.

:mod:`.points` reads the measurements, :mod:`.unknowns` has the free parameters, :mod:`.prediction` computes what the
motor would show, :mod:`.estimate` finds the values and their intervals, and :mod:`.result` holds these.
"""
