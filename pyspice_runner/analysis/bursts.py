# SPDX-License-Identifier: GPL-3.0-or-later
"""Bursts that are too short for an averaged motor: free oscillations of the first periods are not in it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# a burst of 20 periods turns beam40 by 36 % less than the averaged motor at 70 V and by 8 % less at 110 V, one of 40 by
# 1 % more and 2 % less, one of 80 by 1 % less at both (docs/averaged.md)
FEWEST_PERIODS = 60


def short_bursts(
    time: NDArray[np.float64], amplitude: NDArray[np.float64], frequency: float, *, running: bool = False
) -> tuple[str, ...]:
    """Return a caution for the shortest burst of a drive, if it is too short for the averaged motor.

    ``amplitude`` in V is the greater one of both groups at the times in s, ``frequency`` in Hz that of the drive. A
    burst begins and ends without voltage; of a motor that is ``running``, the start of the run begins none.
    """
    on = np.concatenate([[running], amplitude != 0.0])
    begins = np.flatnonzero(~on[:-1] & on[1:])
    ends = np.flatnonzero(on[:-1] & ~on[1:])
    lengths = [(time[next_end] - time[begin], time[begin]) for begin, next_end in _paired(begins, ends)]
    if not lengths or min(lengths)[0] * frequency >= FEWEST_PERIODS:
        return ()
    length, begin = min(lengths)
    told = (
        f"The drive is on for {length * frequency:.3g} periods only, from {begin:.4g} s on. The averaged motor leaves "
        f"out free oscillations of the first periods: below {FEWEST_PERIODS} periods the angle of a burst may be off "
        "by a third. Use the full motor."
    )
    return (told,)


def _paired(begins: NDArray[np.intp], ends: NDArray[np.intp]) -> list[tuple[int, int]]:
    """Return each begin with the end after it; the last burst of a run may have none."""
    found = []
    for begin in begins:
        after = ends[ends > begin]
        if after.size:
            found.append((int(begin), int(after[0])))
    return found
