# SPDX-License-Identifier: GPL-3.0-or-later
"""The motor: parameters, modes of the beam, closed-form contact laws. Imports no other part of the package."""
