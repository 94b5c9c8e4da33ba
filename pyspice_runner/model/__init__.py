# SPDX-License-Identifier: GPL-3.0-or-later
"""What a motor is: parameters, beam to modes, closed-form contact laws; imports nothing else of the package."""
