# SPDX-License-Identifier: GPL-3.0-or-later
"""The verified runner as a PySpice simulator.

PySpice writes the netlist. Its own runners are not used, because they may return the data of the previous run after a
netlist with a syntax error.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from PySpice.Spice.Netlist import Circuit
from PySpice.Spice.Simulation import CircuitSimulation, CircuitSimulator

from pyspice_runner.errors import ParameterError, require
from pyspice_runner.spice.ngspice import SpiceRun, run_deck
from pyspice_runner.spice.process import KeptProcesses


class BatchSimulator(CircuitSimulator):
    """A PySpice simulator that runs ``ngspice -b`` in a process of its own and verifies the result.

    ``ac``, ``transient`` and ``operating_point`` take PySpice's arguments and return the verified vectors, which are in
    :attr:`result`. The deck that would run is ``str(simulator)``. ``timeout`` is wall time in s.

    Raises:
        ParameterError: by another analysis.
        SimulationError: by every analysis that fails or cannot be trusted.
    """

    SIMULATOR = "ngspice"

    def __init__(self, circuit: Circuit, *, timeout: float | None = None) -> None:
        require(timeout is None or timeout > 0.0, "timeout", timeout, "a number > 0 s", unit="s")
        super().__init__(circuit)
        self._options.clear()  # both temperatures are ngspice's 27 degrees
        self._timeout = timeout
        self._saved_nodes: list[str] = []  # PySpice's own is a set, which Python orders anew in every process
        self.result: SpiceRun | None = None
        self.deck = ""  # the netlist that was run last

    def save(self, *names: str) -> None:
        """Add vectors to the ``.save`` line, in the order given."""
        self._saved_nodes = list(dict.fromkeys([*self._saved_nodes, *names]))

    def prepare(self, analysis: str, *values: Any, **arguments: Any) -> BatchSimulator:
        """Add an analysis (``"transient"``, ``"ac"``) for ``str(simulator)``; nothing runs."""
        self.reset_analysis()
        # PySpice's own _run also writes the deck, to log it
        getattr(CircuitSimulation, analysis)(self, *values, **arguments)
        return self

    def verified(
        self, analysis_method: str, *args: Any, progress: Callable[[float], object] | None = None,
        keep_partial: bool = False, processes: KeptProcesses | None = None, **kwargs: Any,
    ) -> SpiceRun:  # fmt: skip
        """Run an analysis and return the vectors of the raw file.

        ``progress`` and ``keep_partial`` are those of :func:`~pyspice_runner.spice.ngspice.run_deck`. A transient
        without a timeout runs in one of the ``processes``, if they are given.
        """
        self.result = None
        if analysis_method not in ("ac", "transient", "operating_point"):
            raise ParameterError(
                f"BatchSimulator does not run {analysis_method}; it runs ac, transient, operating_point."
            )
        self.deck = str(self.prepare(analysis_method, *args, **kwargs))
        parameters = next(iter(self.analysis_iter()))
        self.reset_analysis()
        self.result = run_deck(
            self.deck,
            vectors=self._saved_nodes,
            stop_time=float(parameters.end_time) if analysis_method == "transient" else None,
            stop_frequency=_last_frequency(parameters) if analysis_method == "ac" else None,
            timeout=self._timeout,
            progress=progress,
            keep_partial=keep_partial,
            processes=None if self._timeout else processes,
        )
        return self.result

    _run = verified


def _last_frequency(parameters: Any) -> float:
    """Return the frequency in Hz that a sweep must reach: its end, or one step before it for a logarithmic sweep."""
    base = {"dec": 10.0, "oct": 2.0}.get(str(parameters.variation).lower(), 1.0)
    step: float = base ** (1.0 / int(parameters.number_of_points))
    return float(parameters.stop_frequency) / step
