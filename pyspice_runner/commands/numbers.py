# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers of the command line with engineering suffixes: ``40.7k``, ``2ms``, ``10u``."""

from __future__ import annotations

import re

import pyspice_runner as pr

_SCALES = {"p": 1e-12, "n": 1e-9, "u": 1e-6, "µ": 1e-6, "μ": 1e-6, "m": 1e-3, "k": 1e3, "meg": 1e6, "G": 1e9, "": 1.0}
_UNITS = {  # as it is typed → as the help of an option names it
    "Hz": "Hz", "s": "s", "V": "V", "N.m": "N.m", "Nm": "N.m", "N·m": "N.m", "N": "N", "rad/s": "rad/s", "m/s": "m/s",
    "deg": "degrees", "°": "degrees", "ohm": "Ω", "Ω": "Ω", "A": "A",
}  # fmt: skip
_NUMBER = re.compile(
    rf"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(meg|[pnuµμmkG]?)({'|'.join(map(re.escape, _UNITS))})?"
)


def number(text: str, units: str = "") -> float:
    """Return the number that a text states, with an SI prefix (p, n, u, m, k, meg, G) and a unit if it has them.

    Args:
        text: such as ``40.7k``, ``2ms`` or ``1e-3``.
        units: a text that has the allowed units behind a comma or a colon, as the help of an option: "Speed, rad/s
            (slider: m/s)". Without them a unit is refused.

    Raises:
        ParameterError: for another text, or for another unit.
    """
    try:
        return float(text)
    except ValueError:
        match = _NUMBER.fullmatch(text.strip().replace(" ", ""))
    if match is None:
        raise pr.ParameterError(
            f"{text!r} is not a number. Write it as 2e-3 or 2m; p, n, u, m, k, meg and G are 1e-12 to 1e9."
        )
    value, prefix, unit = match.groups()
    named = _UNITS.get(unit or "")
    if named is not None and not re.search(rf"[,:] {re.escape(named)}(?![\w/])", units):
        raise pr.ParameterError(f"{text!r} has the unit {unit}, which this value does not have. Leave it out.")
    return float(value) * _SCALES[prefix]
