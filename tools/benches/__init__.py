# SPDX-License-Identifier: GPL-3.0-or-later
"""Closed forms and benches that validate the model, for tests and figures."""
