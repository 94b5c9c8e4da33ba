# SPDX-License-Identifier: GPL-3.0-or-later
"""Recordings of oscilloscopes in the shapes that their makers write, with waveforms that are known."""

from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.impedance.scope import read_recording

FREQUENCY, RATE, COUNT = 40e3, 10e6, 2000
NOISE = 0.02  # V RMS: one step of an 8-bit converter at 5 V full scale
HEADERS = {  # lines above the rows; Rigol's rows have the number of the point
    "tektronix": "Model,MSO24\nFirmware Version,1.44\n\nPoint Format,Y,\nHorizontal Units,S,\nSample Interval,1e-07,\n"
    "Record Length,2000,\nLabels,,\nTIME,CH1,CH2\n",
    "keysight": "x-axis,1,2\nsecond,Volt,Volt\n",
    "siglent": "Record Length,Analog:2000\nSample Interval,Analog:0.0000001\nVertical Scale,CH1:50.00,CH2:1.00\n"
    "Source,CH1,CH2\nSecond,Volt,Volt\n",
    "lecroy": "LECROYHDO4024,12345,Waveform\nSegments,1,SegmentSize,2000\nTime,Ampl1,Ampl2\n",
    "rigol": "X,CH1,CH2,Start,Increment,\nSequence,Volt,Volt,-1.00e-04,1.00e-07,\n",
}


def write(path: Path, kind: str, time: np.ndarray, *channels: np.ndarray) -> Path:
    first = np.arange(len(time)) if kind == "rigol" else time
    end = ",," if kind == "rigol" else ""
    rows = [",".join(f"{value:.9g}" for value in row) + end for row in zip(first, *channels, strict=True)]
    path.write_text(HEADERS[kind] + "\n".join(rows) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize("kind", HEADERS)
def test_the_phasors_of_a_recording_give_admittance_and_power(kind: str, tmp_path: Path) -> None:
    time = -1e-4 + np.arange(COUNT) / RATE
    angle, rng = 2.0 * np.pi * FREQUENCY * time, np.random.default_rng(0)
    volts = 100.0 * np.cos(angle + 0.3) + 10.0 * np.cos(3.0 * angle) + NOISE * rng.standard_normal(COUNT)
    amperes = 0.2 * np.cos(angle + 0.3 - 1.0) + 0.03 * np.cos(3.0 * angle + 0.5)
    probe = 0.1  # A/V
    recording = read_recording(write(tmp_path / "scope.csv", kind, time, volts, amperes / probe))
    first, second = recording.channels
    found = recording.phasors(first, second, ampere_per_volt=probe)
    # standard error by white noise: D. C. Rife, R. R. Boorstyn, IEEE Trans. Inf. Theory 20, 591 (1974)
    error = np.sqrt(6.0) * NOISE / (np.pi * (COUNT / RATE) * 100.0 * np.sqrt(COUNT))
    assert abs(found.frequency_hz - FREQUENCY) < 4.0 * error
    assert found.admittance_s == pytest.approx(2e-3 * np.exp(-1j), rel=1e-3)
    # harmonics are orthogonal over whole periods: power ½ Σ U I cos φ
    assert found.power_w == pytest.approx(0.5 * (100.0 * 0.2 * np.cos(1.0) + 10.0 * 0.03 * np.cos(0.5)), rel=1e-3)
    assert found.voltage_noise_v == pytest.approx(NOISE, rel=0.1)
    point = found.point()
    assert point["current_a_rms_a"] == pytest.approx(np.hypot(0.2, 0.03) / np.sqrt(2.0), rel=1e-3)
    assert point["current_a_phase_deg"] == pytest.approx(-np.degrees(1.0), abs=0.1)  # 1e-3 of the admittance
    assert set(point) <= {"voltage", "frequency", "current_a_rms_a", "current_a_phase_deg", "power_a_w"}


def test_a_ring_down_gives_frequency_and_quality_factor_within_their_errors(tmp_path: Path) -> None:
    time, quality, rng = np.arange(4000) / 2e6, 120.0, np.random.default_rng(1)
    on = time < 2e-4
    free = np.exp(-np.pi * FREQUENCY / quality * (time - 2e-4)) * np.cos(2.0 * np.pi * FREQUENCY * (time - 2e-4))
    values = np.where(on, np.cos(2.0 * np.pi * 41e3 * time), free) + 0.1 + 0.01 * rng.standard_normal(len(time))
    found = read_recording(write(tmp_path / "decay.csv", "tektronix", time, values, values)).ring_down(
        "CH1", after_s=2e-4
    )
    assert abs(found.frequency_hz - FREQUENCY) < 4.0 * found.frequency_error_hz
    assert abs(found.quality_factor - quality) < 4.0 * found.quality_error
    assert found.quality_error < 0.01 * quality


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("no numbers at all\n", "no rows of numbers"),
        ("TIME,CH1\n" + "1e-6,1\n" * 40, "does not rise"),
        ("TIME,CH1\n" + "".join(f"{k}e-7,1\n" for k in range(5)), "at least 24 points"),
        ("TIME,CH1,CH1\n" + "".join(f"{k}e-7,1,2\n" for k in range(40)), "two channels of one name"),
        ("TIME,CH1\n" + "".join(f"{k}e-7,{'x' if k == 9 else 1}\n" for k in range(40)), "is no number"),
    ],
)
def test_a_file_that_is_no_recording_is_refused(content: str, says: str, tmp_path: Path) -> None:
    (tmp_path / "scope.csv").write_text(content, encoding="utf-8")
    with pytest.raises(pr.SpectrumError, match=says):
        read_recording(tmp_path / "scope.csv")


def test_what_a_recording_does_not_show_is_refused(tmp_path: Path) -> None:
    time = np.arange(200) / RATE
    wave = np.cos(2.0 * np.pi * FREQUENCY * time)
    recording = read_recording(write(tmp_path / "scope.csv", "keysight", time, wave, wave))
    with pytest.raises(pr.ParameterError, match="no channel 'CH1'"):
        recording.phasors("CH1", "2")
    with pytest.raises(pr.SpectrumError, match=r"has 0\.796 periods"):
        recording.phasors("1", "2", frequency_hz=FREQUENCY)
    with pytest.raises(pr.SpectrumError, match="points in a period"):
        recording.phasors("1", "2", frequency_hz=3e6)
    steady = np.arange(2000) / RATE
    wave = np.cos(2.0 * np.pi * FREQUENCY * steady) + 0.01 * np.random.default_rng(0).standard_normal(2000)
    with pytest.raises(pr.SpectrumError, match="does not decay"):
        read_recording(write(tmp_path / "steady.csv", "keysight", steady, wave, wave)).ring_down("1")
