# SPDX-License-Identifier: GPL-3.0-or-later
"""Three hundred files that went wrong: each is read right, or refused with one clear sentence."""

import os
import random
import time
from itertools import product
from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.impedance.readers.text import MOST_BYTES
from tests.data.spectra import make
from validation.fuzz.spectra import MUTATIONS, Mutation

COUNT = 300
_ALL = list(product(make.FILES, MUTATIONS))
CASES = [(name, mutation, seed) for seed in range(2) for name, mutation in _ALL][:COUNT]


def is_right(spectrum: pr.Spectrum) -> bool:
    """Whether every point that is left is one of the circuit's."""
    places = np.abs(make.FREQUENCY[:, None] - spectrum.frequency_hz).argmin(axis=0)
    if not np.allclose(make.FREQUENCY[places], spectrum.frequency_hz, rtol=1e-9, atol=0.0):
        return False
    truth = make.two_port()[places] if spectrum.ports == 2 else make.admittance()[places, None, None]
    off = np.abs(spectrum.matrix_s - truth).max(axis=(1, 2)) / np.abs(truth).max(axis=(1, 2))
    return bool(off.max() < 1e-3)


def is_one_sentence(message: str) -> bool:
    return message.isprintable() and 20 < len(message) < 400 and message.endswith(".") and "measured.dat" in message


def fault_of(path: Path) -> str | None:
    """What is wrong with how a file was dealt with; anything but a spectrum or SpectrumError comes through."""
    try:
        spectrum = pr.read_spectrum(path)
    except pr.SpectrumError as error:
        return None if is_one_sentence(str(error)) else f"not a clear sentence: {error}"
    return None if is_right(spectrum) else f"misread: {spectrum.cautions}"


@pytest.mark.parametrize("mutation", MUTATIONS, ids=lambda mutation: mutation.__name__)
def test_a_mutated_file_is_read_right_or_refused(mutation: Mutation, tmp_path: Path) -> None:
    path = tmp_path / "measured.dat"
    for name, kind, seed in CASES:
        if kind is not mutation:
            continue
        path.write_bytes(mutation(make.FILES[name], random.Random(f"{name} {seed}")))
        assert fault_of(path) is None, f"{name}, seed {seed}"


def test_a_hundred_megabytes_are_refused_at_once(tmp_path: Path) -> None:
    path = tmp_path / "measured.dat"
    with path.open("wb") as file:
        file.write(make.FILES["plain.csv"])
        file.truncate(100 * 2**20)
    start = time.process_time()
    with pytest.raises(pr.SpectrumError, match=r"measured.dat has more than 16 MiB") as caught:
        pr.read_spectrum(path)
    assert time.process_time() - start < 1.0
    assert is_one_sentence(str(caught.value))


@pytest.mark.parametrize(
    "content",
    [
        b"frequency_hz,conductance_s,susceptance_s\n" + b" " * (MOST_BYTES - 1000),
        b"x" * (MOST_BYTES - 1000),
        b"," * (MOST_BYTES - 1000),
        b"frequency_hz,conductance_s,susceptance_s\n" + b"1" * (MOST_BYTES - 1000),
        b'4294A\n"a:' + b" " * (MOST_BYTES - 1000),
        b'4294A\n"MEASURE PARAMETER: IMPH"\n"TRACE: A' + b" " * (MOST_BYTES - 1000),
        b"# " + b"hz " * 4_000_000,
        b"chunk;timestamp;size;fieldname\n0;0;9999999;realz;" + b"1;" * 1_000_000 + b"\n",
        b"BEGIN CH1_DATA\n" + b")" * 4_000_000 + b"\nEND\n",
        b'frequency_hz,conductance_s,susceptance_s\n"' + b"1" * 4_000_000 + b'",1,1\n',
    ],
    ids=range(10),
)
@pytest.mark.fuzz
def test_large_nonsense_does_not_hang(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "measured.dat"
    path.write_bytes(content)
    busy = time.process_time()
    with pytest.raises(pr.SpectrumError) as caught:
        pr.read_spectrum(path)
    assert time.process_time() - busy < 8.0  # processor time: a busy machine is no hang
    assert is_one_sentence(str(caught.value))


def test_a_large_spectrum_is_read_in_seconds(tmp_path: Path) -> None:
    frequency = np.linspace(95e3, 110e3, 100_000)
    spectrum = pr.Spectrum.from_admittance(frequency, make.admittance(frequency))
    path = spectrum.save(tmp_path / "measured.csv")
    start = time.process_time()
    assert np.array_equal(pr.read_spectrum(path).matrix_s, spectrum.matrix_s)
    assert time.process_time() - start < 8.0


def test_places_that_are_no_file(tmp_path: Path) -> None:
    pipe = tmp_path / "measured.dat"
    os.mkfifo(pipe)
    absent = tmp_path / "absent.csv"
    places = [
        (pipe, "it is not a regular file"),
        (tmp_path, "it is not a regular file"),
        (absent, "No such file"),
        ("a\0b", "null"),
    ]
    for place, why in places:
        with pytest.raises(pr.SpectrumError, match=why) as error:
            pr.read_spectrum(place)
        assert str(error.value).count("Cannot read") == 1


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("size", [1e-300, 1e-160, 1e160, 1e290])
@pytest.mark.parametrize("names", ["conductance_s,susceptance_s", "resistance_ohm,reactance_ohm"])
def test_values_of_any_size_are_read_without_a_warning_of_numpy(names: str, size: float, tmp_path: Path) -> None:
    frequency = np.linspace(1e4, 2e4, 101)
    ratio = frequency / 1.5e4
    y = size * (1j * ratio + 1.0 / (0.02 + 1j * (ratio - 1.0 / ratio))) / 51.0
    rows = zip(frequency.tolist(), y.real.tolist(), y.imag.tolist(), strict=True)
    path = tmp_path / "measured.csv"
    lines = [f"frequency_hz,{names}", *(",".join(map(repr, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")
    assert len(pr.read_spectrum(path)) == len(frequency)
