# SPDX-License-Identifier: GPL-3.0-or-later
"""Files for other programs, by their ending."""
