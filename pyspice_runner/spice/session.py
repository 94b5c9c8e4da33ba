# SPDX-License-Identifier: GPL-3.0-or-later
"""A transient that pauses at sample times to be read and altered: for a controller in the loop.

One process ``ngspice -p`` runs from beginning to end and keeps the exact state of the circuit. Only checked names and
numbers are written to its standard input, so that no user text reaches ngspice's control language.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from math import isfinite

from pyspice_runner.errors import SimulationError
from pyspice_runner.spice.deck_lint import silent_fault
from pyspice_runner.spice.pipe import Pipe
from pyspice_runner.spice.rawfile import RawFile, RawFileError, read_rawfile

_NAME = re.compile(r"[a-z][a-z0-9_]*", re.ASCII)
_VECTOR = re.compile(r"[vi]\([a-z][a-z0-9_.]*\)", re.ASCII)
_STOPPED = re.compile(r"(\d+) *: condition met: stop")
_ALMOST = 1.0 - 1e-9  # of a sample time: ngspice's own sum of steps may end a rounding before it
_DEFAULT_TIMEOUT = 600.0  # s of wall time between two samples


class Session(Pipe):
    """A running transient.

    The deck has ``.save`` and one ``.tran``; one of its sources must have edges at the sample times, so that ngspice
    has a time point there. ``timeout`` is wall time in s between two samples.

    Raises:
        SimulationError: if ngspice fails; the process is ended.
    """

    def __init__(self, deck: str, vectors: Sequence[str], *, timeout: float | None = None) -> None:
        fault = silent_fault(deck)
        if fault:
            raise SimulationError(fault)
        for name in vectors:
            if not _VECTOR.fullmatch(name):
                raise SimulationError(
                    f"The vector {name!r} cannot be read in a session: it must be v(node) or i(source)."
                )
        super().__init__(_DEFAULT_TIMEOUT if timeout is None else timeout)
        self._vectors = list(vectors)
        self._begun = False
        (self.folder / "deck.cir").write_text(deck, encoding="utf-8")
        try:
            self.tell("source deck.cir", "set numdgt=15")
        except BaseException:
            self.close()
            raise

    def advance(self, until: float) -> dict[str, float]:
        """Run to a sample time in s, and return the vectors there.

        Raises:
            SimulationError: if ngspice fails, stops early, or takes longer than the timeout.
        """
        goal = until * _ALMOST
        said = self.tell(f"stop when time >= {goal!r}", "resume" if self._begun else "run")
        self._begun = True
        stop = next((match.group(1) for line in said if (match := _STOPPED.search(line))), None)
        if stop is None:
            raise self.failure(f"ngspice did not stop at {until:g} s", said)
        prints = [f"print {name}[length({name})-1]" for name in ("time", *self._vectors)]
        answers = self.tell(f"delete {stop}", *prints)
        values = [line.rpartition(" = ")[2] for line in answers if " = " in line]
        try:
            numbers = [float(value) for value in values]
        except ValueError:
            numbers = []
        if len(numbers) != len(prints) or not all(map(isfinite, numbers)):
            raise self.failure(f"ngspice gave no finite sample at {until:g} s", answers)
        return dict(zip(("time", *self._vectors), numbers, strict=True))

    def alter(self, source: str, value: float) -> None:
        """Set the value of an independent source from the present time on.

        Raises:
            SimulationError: for a name that is not that of a source, a value that is not finite, or if ngspice fails.
        """
        if not (_NAME.fullmatch(source) and source[0] in "vi" and isfinite(value)):
            raise SimulationError(f"{source!r} cannot be set to {value!r}: it takes the name of a source and a number.")
        self.tell(f"alter {source} = {float(value)!r}")

    def finish(self) -> RawFile:
        """Return all saved vectors up to the last sample, and end ngspice.

        Raises:
            SimulationError: if the vectors cannot be read.
        """
        said = self.tell("set filetype=binary", "write out.raw")
        try:
            return read_rawfile(self.folder / "out.raw")
        except RawFileError as error:
            raise self.failure(f"ngspice gave no usable result: {error}", said) from None
        finally:
            self.close()
