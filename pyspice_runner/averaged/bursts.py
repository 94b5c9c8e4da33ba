# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a run is not what the full motor does sample by sample: short bursts, and cycles of stopping and starting."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.motor import contact as contact_law
from pyspice_runner.motor.parameters import Contact

# a burst of 20 periods turns beam40 by 10 % less than the averaged motor at 70 V and by 4 % less at 110 V, one of 40 by
# 9 % more and 1 % less, one of 80 by 1 % more and 0.3 % less (docs/averaged.md)
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
        "by a tenth. Use the full motor."
    )
    return (told,)


# an approach and a correction end with a stop each; a loop that stops more often with its drive on is in a limit cycle
MOST_STOPS = 2


def presliding(motor: Mapping[str, Any]) -> float:
    """Return the angle in rad by which the contact gives way before it slips, of a motor as of ``to_dict``.

    With a slider it is the distance in m.
    """
    contact = Contact(**motor["contact"])
    limit = contact_law.limit_ratio(contact) * contact_law.static_penetration(contact)
    limit += contact.tangential_series_compliance_m_per_n * contact.friction * contact.preload_n
    return float(limit if "slider" in motor else limit / motor["rotor"]["radius_m"])


def limit_cycle(
    time: NDArray[np.float64], position: NDArray[np.float64], amplitude: NDArray[np.float64], angle: float
) -> tuple[str, ...]:
    """Return a caution for a rotor that stops and starts again and again with its drive on.

    ``position`` in rad at the times in s, ``amplitude`` in V from each of them on. A rotor that moves by less than
    ``angle``, rad, from one sample to the next stands: without slip the contact gives way by twice its pre-sliding.
    """
    moves = np.abs(np.diff(position)) > angle
    stops = np.flatnonzero(moves[:-1] & ~moves[1:] & (amplitude[1:-1] > 0.0)) + 2
    if stops.size <= MOST_STOPS:
        return ()
    told = (
        f"The rotor stops {stops.size} times with its drive on, from {time[stops[0]]:.4g} s on: a limit cycle through "
        "standstill, in which a small error shifts all later samples. Compensate the dead band, or lower the gains."
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
