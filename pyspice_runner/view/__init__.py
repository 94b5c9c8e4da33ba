# SPDX-License-Identifier: GPL-3.0-or-later
"""What a person looks at: plots, charts and the report page. Plotting libraries load here and nowhere else."""
