# SPDX-License-Identifier: GPL-3.0-or-later
"""Pages that show results in a browser. Plotly and Jinja2 load here and nowhere else."""
