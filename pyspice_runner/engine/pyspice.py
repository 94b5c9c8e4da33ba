# SPDX-License-Identifier: GPL-3.0-or-later
"""The verified runner as a PySpice simulator: whoever knows PySpice calls ``.transient()`` and ``.ac()`` on it.

PySpice writes the netlist; its own runners are left aside, because they may return the previous run's data after a
netlist that did not parse.
"""

from __future__ import annotations

from typing import Any

from PySpice.Probe.WaveForm import AcAnalysis, OperatingPoint, TransientAnalysis, WaveForm
from PySpice.Spice.Netlist import Circuit
from PySpice.Spice.Simulation import CircuitSimulator

from pyspice_runner.engine.ngspice import Result, run_deck


class BatchSimulator(CircuitSimulator):
    """A PySpice simulator that runs ``ngspice -b`` in a process of its own and verifies what comes back.

    ``operating_point``, ``ac`` and ``transient`` take PySpice's arguments and return PySpice's analyses; the verified
    vectors are in :attr:`result`. The deck that would run is ``str(simulator)``.

    Args:
        circuit: a PySpice circuit.
        timeout: wall time in s after which a run is ended.

    Raises:
        SimulationError: by every analysis that fails or cannot be trusted.
    """

    SIMULATOR = "ngspice"

    def __init__(self, circuit: Circuit, *, timeout: float | None = None, **kwargs: Any) -> None:
        super().__init__(circuit, **kwargs)
        for name in (
            "TEMP",
            "TNOM",
        ):  # no element here depends on them, and PySpice writes them with a degree sign
            if name not in kwargs:
                self._options.pop(name, None)
        self._timeout = timeout
        self._saved_nodes = _InOrder()
        self.result: Result | None = None

    def save(self, *names: Any) -> None:
        """Add vectors to the ``.save`` line, in the order given."""
        for name in names:
            self._saved_nodes.extend([name] if isinstance(name, str) else name)

    def prepare(self, analysis: str, **arguments: Any) -> BatchSimulator:
        """Add an analysis (``"transient"``, ``"ac"``, ``"operating_point"``) for ``str(simulator)``; nothing runs."""
        super()._run(analysis, **arguments)
        return self

    def _run(self, analysis_method: str, *args: Any, **kwargs: Any) -> Any:
        super()._run(analysis_method, *args, **kwargs)
        deck = str(self)
        stop_time = None
        if analysis_method == "transient":
            stop_time = float(next(iter(self.analysis_iter())).end_time)
        self.reset_analysis()
        asked = [str(name) for name in self._saved_nodes if name != "all"]
        self.result = run_deck(deck, vectors=asked, stop_time=stop_time, timeout=self._timeout)
        return self._analysis(analysis_method, self.result)

    def _analysis(self, method: str, result: Result) -> Any:
        vectors = dict(result.raw.vectors)
        abscissa = {"transient": "time", "ac": "frequency"}.get(method)
        axis = vectors.pop(abscissa).real if abscissa else None
        waves = {name: _waveform(_plain(name), values) for name, values in vectors.items()}
        common: dict[str, Any] = {
            "simulation": self,
            "nodes": [wave for name, wave in waves.items() if name.startswith("v(")],
            "branches": [wave for name, wave in waves.items() if name.startswith("i(")],
            "internal_parameters": [wave for name, wave in waves.items() if name.startswith("@")],
        }
        if method == "transient":
            return TransientAnalysis(time=_waveform("time", axis), **common)
        if method == "ac":
            return AcAnalysis(frequency=_waveform("frequency", axis), **common)
        return OperatingPoint(**common)


class _InOrder(list[str]):
    """A list that PySpice takes for its set of saved names: it asks for truth, iteration and removal."""


def _waveform(name: str, values: Any) -> WaveForm:
    """Return PySpice's waveform, complex where the values are (its own ``from_array`` casts to real)."""
    waveform = WaveForm(name, None, values.shape, dtype=values.dtype)
    waveform[...] = values
    return waveform


def _plain(name: str) -> str:
    """Return ``x`` for ``v(x)`` and ``i(x)``, as PySpice names its waveforms."""
    return name[2:-1] if name[:2] in ("v(", "i(") and name.endswith(")") else name
