# SPDX-License-Identifier: GPL-3.0-or-later
"""The fit of measured spectra: of one port, of one device at several levels or temperatures, or of both groups."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pyspice_runner.errors import ParameterError
from pyspice_runner.impedance.identify.selection import Progress
from pyspice_runner.impedance.joint_fit import JointFit, fit_jointly
from pyspice_runner.impedance.one_port_fit import SpectrumFit, fit_one_port
from pyspice_runner.impedance.spectrum import Connection, Spectrum
from pyspice_runner.impedance.two_port_fit import TwoPortFit, fit_groups
from pyspice_runner.motor.refusal import checked


@checked
def fit_spectrum(
    spectrum: Spectrum | Mapping[Connection, Spectrum] | Sequence[Spectrum],
    modes: int | None = None,
    *,
    leads: bool | tuple[float, float] = True,
    voltages: Sequence[float] | None = None,
    temperatures: Sequence[float] | None = None,
    noise: Mapping[str, float] | None = None,
    timeout: float | None = None,
    progress: Progress | None = None,
) -> SpectrumFit | JointFit | TwoPortFit:
    """Fit an equivalent circuit to one spectrum, to several of one device, or to those of both groups of a motor.

    ==============================================  ===============================================================
    data                                            result
    ==============================================  ===============================================================
    a spectrum of one port                          :class:`.SpectrumFit`: clamped capacitance with loss, motional
                                                    arms and leads
    a list of spectra of one port, with             :class:`.JointFit`: one circuit, with softening and growth of
    ``voltages``, ``temperatures`` or both          damping with the level, and drifts with the temperature
    a spectrum of two ports, or spectra of one      :class:`.TwoPortFit`: modes with their couplings to both groups
    port by connection: ``"A"`` (B shorted),
    ``"B"`` (A shorted) and ``"A+B"``, ``"A-B"``
    or both, which give the signs
    ==============================================  ===============================================================

    Of a two-port, ``spectrum.driven("A")`` is the one-port. Several spectra need leads that are compensated. Their
    sweeps have rising frequency; one alone at a known voltage gives softening and growth of damping, if its resonance
    is skewed.

    Args:
        spectrum: the data, as from :func:`read_spectrum`.
        modes: number of motional arms or modes; selected by default. One that is not significant is then rejected.
        leads: whether to look for leads, of one spectrum or of each group; of one, or their known resistance in Ω and
            inductance in H.
        voltages: amplitude at the device's terminals in V, one for each of several spectra.
        temperatures: in K or °C, one for each of several spectra.
        noise: known error of the measurement: σ of ``"proportional"`` (a share of the magnitude), ``"s11"`` (the
            reflection coefficient in 50 Ω) or ``"z"`` (Ω), of the complex value; estimated by default. Not of several
            spectra.
        timeout: time limit of the search for the arms in s. A joint fit that follows is short.
        progress: callback with the next number of arms and the largest number to try.

    Raises:
        ParameterError: for an argument out of range or one that does not belong to the data.
        SpectrumError: if the data show no resonance, have too few points, no connection that gives a sign, arms that
            share losses (of several spectra), or the time limit is exceeded.
    """
    search: dict[str, Any] = {"timeout": timeout, "progress": progress}
    levels = voltages is not None or temperatures is not None
    if isinstance(spectrum, Mapping) or (isinstance(spectrum, Spectrum) and spectrum.ports == 2):
        if levels or leads not in (True, False):
            raise ParameterError("known leads, voltages and temperatures do not belong to both groups. Leave them out.")
        return fit_groups(spectrum, modes, leads=leads is not False, noise=noise, **search)
    if isinstance(spectrum, Spectrum) and not levels:
        return fit_one_port(spectrum, modes, leads=leads, noise=noise, **search)
    if noise is not None or leads not in (True, False):
        raise ParameterError("leads and noise do not belong to several spectra. Leave them out.")
    spectra = [spectrum] if isinstance(spectrum, Spectrum) else spectrum
    return fit_jointly(spectra, modes, voltages=voltages, temperatures=temperatures, **search)
