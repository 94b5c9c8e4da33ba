# SPDX-License-Identifier: GPL-3.0-or-later
"""The verified runner as a PySpice simulator, with PySpice's ``.transient()`` and ``.ac()``.

PySpice writes the netlist. Its own runners are not used, because they may return the data of the previous run after a
netlist with a syntax error.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from PySpice.Probe.WaveForm import AcAnalysis, DcAnalysis, OperatingPoint, TransientAnalysis, WaveForm
from PySpice.Spice.Netlist import Circuit
from PySpice.Spice.Simulation import CircuitSimulation, CircuitSimulator

from pyspice_runner.errors import ParameterError
from pyspice_runner.spice.ngspice import SpiceRun, run_deck
from pyspice_runner.spice.process import KeptProcesses

# method → PySpice's analysis, and the name of its axis
_ANALYSES: dict[str, tuple[Any, str]] = {
    "operating_point": (OperatingPoint, ""),
    "dc": (DcAnalysis, "sweep"),
    "ac": (AcAnalysis, "frequency"),
    "transient": (TransientAnalysis, "time"),
}


class BatchSimulator(CircuitSimulator):
    """A PySpice simulator that runs ``ngspice -b`` in a process of its own and verifies the result.

    ``operating_point``, ``dc``, ``ac`` and ``transient`` take PySpice's arguments and return PySpice's analyses; the
    verified vectors are in :attr:`result`. The deck that would run is ``str(simulator)``. ``timeout`` is wall time in
    s; ``kwargs`` are PySpice's ``temperature`` and ``nominal_temperature``.

    Raises:
        ParameterError: by another analysis.
        SimulationError: by every analysis that fails or cannot be trusted.
    """

    SIMULATOR = "ngspice"

    def __init__(self, circuit: Circuit, *, timeout: float | None = None, **kwargs: Any) -> None:
        if timeout is not None and not timeout > 0.0:
            raise ParameterError(f"timeout = {timeout:g} s is not valid: it must be a number > 0 s.")
        super().__init__(circuit, **kwargs)
        for keyword, option in (("temperature", "TEMP"), ("nominal_temperature", "TNOM")):
            if keyword not in kwargs:  # both are then ngspice's 27 degrees, and the deck stays short
                self._options.pop(option)
        self._timeout = timeout
        self._saved_nodes: list[str] = []  # PySpice's own is a set, which Python orders anew in every process
        self.result: SpiceRun | None = None
        self.deck = ""  # the netlist that was run last

    def save(self, *names: Any) -> None:
        """Add vectors to the ``.save`` line, in the order given."""
        items = [str(item) for name in names for item in ([name] if isinstance(name, str) else name)]
        self._saved_nodes = list(dict.fromkeys([*self._saved_nodes, *items]))

    def __str__(self) -> str:
        saved = list(self._saved_nodes)
        try:
            return str(super().__str__())
        finally:
            self._saved_nodes = saved  # PySpice takes "all" out of it while it writes

    def prepare(self, analysis: str, *values: Any, **arguments: Any) -> BatchSimulator:
        """Add an analysis (``"transient"``, ``"ac"``, ``"operating_point"``) for ``str(simulator)``; nothing runs."""
        self.reset_analysis()
        self.save(*arguments.pop("probes", ()))
        arguments.pop("log_desk", None)
        # PySpice's own _run also writes the deck, to log it
        getattr(CircuitSimulation, analysis)(self, *values, **arguments)
        return self

    def verified(
        self, analysis_method: str, *args: Any, progress: Callable[[float], object] | None = None,
        keep_partial: bool = False, processes: KeptProcesses | None = None, **kwargs: Any,
    ) -> SpiceRun:  # fmt: skip
        """Run an analysis and return the vectors of the raw file, without a copy in PySpice's waveforms.

        ``progress`` and ``keep_partial`` are those of :func:`~pyspice_runner.spice.ngspice.run_deck`. A transient
        without a timeout runs in one of the ``processes``, if they are given.
        """
        self.result = None
        if analysis_method not in _ANALYSES:
            raise ParameterError(f"BatchSimulator does not run {analysis_method}; it runs {', '.join(_ANALYSES)}.")
        self.deck = str(self.prepare(analysis_method, *args, **kwargs))
        parameters = next(iter(self.analysis_iter()))
        self.reset_analysis()
        vectors = [name for name in self._saved_nodes if name != "all"]
        self.result = run_deck(
            self.deck,
            vectors=vectors,
            stop_time=float(parameters.end_time) if analysis_method == "transient" else None,
            stop_frequency=_last_frequency(parameters) if analysis_method == "ac" else None,
            timeout=self._timeout,
            progress=progress,
            keep_partial=keep_partial,
            processes=None if self._timeout else processes,
        )
        return self.result

    def _run(self, analysis_method: str, *args: Any, **kwargs: Any) -> Any:
        vectors = dict(self.verified(analysis_method, *args, **kwargs).raw.vectors)
        analysis, axis = _ANALYSES[analysis_method]
        common: dict[str, Any] = {"simulation": self, "nodes": [], "branches": [], "internal_parameters": []}
        if axis:
            common[axis] = _waveform(axis, vectors.pop(next(iter(vectors))).real)
        for name, values in vectors.items():
            kind = "internal_parameters" if "@" in name else "branches" if name.startswith("i(") else "nodes"
            wrapped = name[:2] in ("v(", "i(") and name.endswith(")")  # PySpice calls v(x) and i(x) x
            common[kind].append(_waveform(name[2:-1] if wrapped else name, values, common.get(axis)))
        return analysis(**common)


def _last_frequency(parameters: Any) -> float:
    """Return the frequency in Hz that a sweep must reach: its end, or one step before it for a logarithmic sweep."""
    base = {"dec": 10.0, "oct": 2.0}.get(str(parameters.variation).lower(), 1.0)
    step: float = base ** (1.0 / int(parameters.number_of_points))
    return float(parameters.stop_frequency) / step


def _waveform(name: str, values: Any, abscissa: Any = None) -> WaveForm:
    """Return PySpice's waveform, complex where the values are (its own ``from_array`` casts to real)."""
    waveform = WaveForm(name, None, values.shape, dtype=values.dtype, abscissa=abscissa)
    waveform[...] = values
    return waveform
