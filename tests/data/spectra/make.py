# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes the spectra beside this script: one known circuit in every format that is read.

    python tests/data/spectra/make.py

The circuit: 1 nF with a loss tangent of 0.01, and two motional arms. `admittance` is the truth that tests compare with.
The layouts are those of real exports and of the makers' documentation; the values are ours.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

FREQUENCY = np.linspace(95e3, 110e3, 61)
CLAMPED, LOSS = 1e-9, 0.01
ARMS = ((100e3, 200.0, 50e-12), (105e3, 150.0, 8e-12))  # series resonance, quality factor, capacitance


def admittance(frequency: Floats = FREQUENCY) -> Complexes:
    w = 2.0 * np.pi * frequency
    y = 1j * w * CLAMPED * (1.0 - 1j * LOSS)
    for resonance, quality, capacitance in ARMS:
        ws = 2.0 * np.pi * resonance
        inductance, resistance = 1.0 / (ws**2 * capacitance), 1.0 / (ws * capacitance * quality)
        y = y + 1.0 / (resistance + 1j * w * inductance + 1.0 / (1j * w * capacitance))
    return y


def two_port(frequency: Floats = FREQUENCY) -> Complexes:
    """The stator's kind: equal groups, coupled with the one sign by the first arm and with the other by the second."""
    one = admittance(frequency)
    other = 0.3 * (one - 1j * 2.0 * np.pi * frequency * CLAMPED * (1.0 - 1j * LOSS))
    return np.stack([np.stack([one, other], -1), np.stack([other, 1.1 * one], -1)], -2)


def quantities(frequency: Floats, y: Complexes) -> dict[str, Floats]:
    """What an analyser shows of an admittance, in SI units and degrees."""
    z, w = 1.0 / y, 2.0 * np.pi * frequency
    return {
        "|Z|": np.abs(z),
        "θz": np.angle(z, deg=True),
        "R": z.real,
        "X": z.imag,
        "|Y|": np.abs(y),
        "θy": np.angle(y, deg=True),
        "G": y.real,
        "B": y.imag,
        "Ls": z.imag / w,
        "Cs": -1.0 / (w * z.imag),
        "Lp": -1.0 / (w * y.imag),
        "Cp": y.imag / w,
        "Rp": 1.0 / y.real,
        "Xp": -1.0 / y.imag,
        "Q": np.abs(z.imag) / z.real,
        "D": z.real / np.abs(z.imag),
    }


# --- formats ---


def e4990a(names: Sequence[str] = ("|Z|(Ohm)", "theta-z(deg)"), keys: Sequence[str] = ("|Z|", "θz")) -> str:
    shown = quantities(FREQUENCY, admittance())
    lines = [
        "!Keysight Technologies,E4990A,MY00000000,A.04.00",
        "!Date: Thu Jan 01 12:00:00 2026",
        "",
        "BEGIN CH1_DATA",
    ]
    lines.append(", ".join(["Frequency(Hz)", *(f"{name}-data" for name in names)]))
    lines += [
        ", ".join(f"{value:+.11e}".replace("e+", "e+0").replace("e-", "e-0") for value in row)
        for row in zip(FREQUENCY, *(shown[key] for key in keys), strict=True)
    ]
    return "\n".join([*lines, "END", ""])


# GPIB mnemonic → name as the file gives it, trace A, trace B
PAIRS_4294A = {
    "IMPH": ("IMPEDANCE MAG PHASE (DEG)", "|Z|", "θz"),
    "IRIM": ("R-X", "R", "X"),
    "LSR": ("Ls-Rs", "Ls", "R"),
    "LSQ": ("Ls-Q", "Ls", "Q"),
    "CSR": ("Cs-Rs", "Cs", "R"),
    "CSQ": ("Cs-Q", "Cs", "Q"),
    "CSD": ("Cs-D", "Cs", "D"),
    "AMPH": ("ADMITTANCE MAG PHASE (DEG)", "|Y|", "θy"),
    "ARIM": ("G-B", "G", "B"),
    "LPG": ("Lp-G", "Lp", "G"),
    "LPQ": ("Lp-Q", "Lp", "Q"),
    "CPG": ("Cp-G", "Cp", "G"),
    "CPQ": ("Cp-Q", "Cp", "Q"),
    "CPD": ("Cp-D", "Cp", "D"),
    "COMP": ("COMPLEX Z-Y", "Z", "Y"),
    "IMLS": ("|Z|-Ls", "|Z|", "Ls"),
    "IMCS": ("|Z|-Cs", "|Z|", "Cs"),
    "IMLP": ("|Z|-Lp", "|Z|", "Lp"),
    "IMCP": ("|Z|-Cp", "|Z|", "Cp"),
    "LPR": ("Lp-Rp", "Lp", "Rp"),
    "CPR": ("Cp-Rp", "Cp", "Rp"),
}


def hp4294a(
    mnemonic: str = "IMPH",
    *,
    memory: bool = False,
    turned: bool = False,
    named: str | None = None,
    arrays: bool = False,
) -> str:
    """A 4294A's file; ``turned`` is the trap of a phase off by 180°, ``memory`` holds twice the admittance."""
    name, *keys = PAIRS_4294A[mnemonic]
    sources = [admittance(), 2.0 * admittance()] if memory else [admittance()]
    lines = ["4294A REV1.11", '"DATE: Jan 01 2026"', "", ""]
    lines += [f'"MEASURE PARAMETER: {named or name}"', '"ADAPTER: NONE"', '"SWEEP TYPE: LIN FREQ"']
    lines += [f'"NUMBER of POINTS: {FREQUENCY.size}"', '"POINT DELAY TIME:  0 Sec"', '"SWEEP DELAY TIME:  0 Sec"']
    lines += [
        '"OSC LEVEL:  500 mVolt"',
        '"DC BIAS: OFF"',
        '"BW: 5"',
        '"SWEEP AVERAGING: OFF"',
        '"POINT AVERAGING: OFF"',
    ]
    heads = [
        '"Frequency"',
        *(['"Data Real"', '"Data Imag"'] if arrays else []),
        '"Data Trace Real"',
        '"Data Trace Imag"',
    ]
    heads += ['"Memory Trace Real"', '"Memory Trace Imag"'] if memory else []
    for trace, key in zip("AB", keys, strict=True):
        lines += ["", "", f'"TRACE: {trace}"', '"FORMAT: LINEAR"', "", "\t".join(heads)]
        columns = [1.0 / sources[0]] if arrays else []
        for y in sources:
            shown = quantities(FREQUENCY, y) | {"Z": 1.0 / y, "Y": y}
            values = shown[key]
            columns.append(np.where(values > 0.0, values - 180.0, values + 180.0) if turned and "θ" in key else values)
        for place, frequency in enumerate(FREQUENCY):
            cells = [f"{part:.6e}" for column in columns for part in (column[place].real, column[place].imag)]
            lines.append("\t".join([f"{frequency:.11e}", *cells]))
    return "\n".join([*lines, ""])


def bode100(mark: str = ";", decimal: str = ",", *, settings: bool = False, polar: bool = False) -> str:
    shown = quantities(FREQUENCY, admittance())
    parts = ["Trace 1: Impedance: Real (Ω)", "Trace 1: Impedance: Imaginary (Ω)", "Trace 1: Impedance: Magnitude (Ω)"]
    parts += ["Trace 2: Impedance: Real (Ω)", "Trace 2: Impedance: Imaginary (Ω)", "Trace 2: Impedance: Phase (°)"]
    keys = ["R", "X", "|Z|", "R", "X", "θz"]
    if polar:
        parts, keys = [parts[2], parts[5]], [keys[2], keys[5]]
    above = ["---Measurement settings---", f"Receiver bandwidth: 100 Hz{mark}", "", "---Results---"] if settings else []
    lines = [*above, mark.join(["Frequency (Hz)", *parts])]
    lines += [
        mark.join(f"{value:.15g}".replace(".", decimal) for value in row)
        for row in zip(FREQUENCY, *(shown[key] for key in keys), strict=True)
    ]
    return "\r\n".join([*lines, ""])


def waveforms(names: Sequence[str] = ("th (deg)", "|Z| (Ohm)", "Rs (Ohm)", "Xs (Ohm)")) -> str:
    keys = {"th": "θz", "|Z|": "|Z|", "Rs": "R", "Xs": "X", "Cp": "Cp", "D": "D", "|Y|": "|Y|", "Gp": "G", "Bp": "B"}
    shown = quantities(FREQUENCY, admittance())
    lines = ["#Digilent WaveForms Impedance Analyzer", "#Device Name: Discovery2", "#Serial Number: SN:000000000000"]
    lines += ["#Date Time: 2026-01-01 12:00:00.000", "#Resistor: 1 kOhm", "#Amplitude: 1 V", ""]
    lines.append(",".join(["Frequency (Hz)", *(f"Trace {name}" for name in names)]))
    for row in zip(FREQUENCY, *(shown[keys[name.split()[0]]] for name in names), strict=True):
        lines.append(",".join(f"{value:.15g}" for value in row))
    return "\r\n".join([*lines, ""])


def nanovna() -> str:
    """Tenths of an ohm, as the instrument's programs print."""
    y = admittance()
    shown = quantities(FREQUENCY, y)
    reflection = (1.0 - 50.0 * y) / (1.0 + 50.0 * y)
    lines = ["Frequency(Hz),Return Loss(dB),Phase(deg),Rs,SWR,Xs,|Z|,Theta"]
    for place, frequency in enumerate(FREQUENCY):
        size = abs(reflection[place])
        loss, angle, swr = 20 * np.log10(size), np.angle(reflection[place], deg=True), (1 + size) / (1 - size)
        r, x, z, theta = (shown[key][place] for key in ("R", "X", "|Z|", "θz"))
        lines.append(f"{frequency:.0f},{loss:.2f},{angle:.2f},{r:.1f},{swr:.2f},{x:.1f},{z:.1f},{theta:.1f}")
    return "\n".join([*lines, ""])


def aim(header: str = "Freq(MHz),SWR,Rs,Xs,Zmag,Theta,RefCoef,RL,Pwr%") -> str:
    y = admittance()
    shown = quantities(FREQUENCY, y)
    size = np.abs((1.0 - 50.0 * y) / (1.0 + 50.0 * y))
    rows = zip(
        FREQUENCY / 1e6, (1 + size) / (1 - size), shown["R"], shown["X"], shown["|Z|"], shown["θz"], size,
        -20 * np.log10(size), 100 * size**2, strict=True,
    )  # fmt: skip
    return "\r\n".join([header, *(",".join(f"{value:.8f}" for value in row) for row in rows), ""])


def mfia(fields: Sequence[str] = ("frequency", "grid", "realz", "imagz", "absz", "phasez"), sweeps: int = 2) -> str:
    lines = ["chunk;timestamp;size;fieldname"]
    for sweep in range(sweeps):
        shown = quantities(FREQUENCY, (1.0 + sweep) * admittance())
        values = {"frequency": FREQUENCY, "grid": FREQUENCY, "realz": shown["R"], "imagz": shown["X"]}
        values |= {"absz": shown["|Z|"], "phasez": np.deg2rad(shown["θz"])}
        for field in fields:
            cells = [f"{value:.12g}" for value in values[field]] + ["nan", "nan"]
            lines.append(";".join([str(sweep), "1234567890", str(len(cells)), field, *cells]))
    return "\n".join([*lines, ""])


_FORMS: dict[str, Callable[[complex], tuple[float, float]]] = {
    "RI": lambda value: (value.real, value.imag),
    "MA": lambda value: (abs(value), float(np.angle(value, deg=True))),
    "DB": lambda value: (20.0 * np.log10(abs(value)), float(np.angle(value, deg=True))),
}


def touchstone(option: str = "# Hz S RI R 50", ports: int = 1) -> str:
    _, unit, side, form, _, resistance = option.upper().split()
    reference = float(resistance)
    y = two_port() if ports == 2 else admittance()[:, None, None]
    eye = np.eye(ports)
    normal = y * reference
    matrix = {
        "S": lambda: np.linalg.solve(eye + normal, eye - normal),
        "Y": lambda: normal,
        "Z": lambda: np.linalg.inv(normal),
    }[side]()
    scale = {"hz": 1.0, "khz": 1e3, "mhz": 1e6, "ghz": 1e9}[unit.lower()]
    order = ((0, 0), (1, 0), (0, 1), (1, 1)) if ports == 2 else ((0, 0),)
    lines = ["! made for tests", option]
    for frequency, values in zip(FREQUENCY, matrix, strict=True):
        cells = [part for entry in order for part in _FORMS[form](complex(values[entry]))]
        lines.append(" ".join([f"{frequency / scale:.12g}", *(f"{cell:.15e}" for cell in cells)]))
    return "\n".join([*lines, ""])


def plain(
    header: str = "frequency_hz,conductance_s,susceptance_s",
    keys: Sequence[str] = ("G", "B"),
    *,
    mark: str = ",",
    decimal: str = ".",
    scales: Sequence[float] = (1.0, 1.0, 1.0),
) -> str:
    """A table; what is printed are SI units and degrees divided by ``scales``."""
    shown = quantities(FREQUENCY, admittance())
    lines = [header]
    for row in zip(FREQUENCY, *(shown[key] for key in keys), strict=True):
        cells = (f"{value / scale:.15g}" for value, scale in zip(row, scales, strict=True))
        lines.append(mark.join(cell.replace(".", decimal) for cell in cells))
    return "\n".join([*lines, ""])


def two_port_csv() -> str:
    names = [f"y_{into}{by}_{part}_s" for into in "ab" for by in "ab" for part in ("real", "imag")]
    lines = [",".join(["frequency_hz", *names])]
    for frequency, matrix in zip(FREQUENCY, two_port(), strict=True):
        cells = [part for entry in matrix.ravel() for part in (entry.real, entry.imag)]
        lines.append(",".join(f"{value:.12g}" for value in (frequency, *cells)))
    return "\n".join([*lines, ""])


FILES = {
    "aim.csv": aim().encode(),
    "bode100.csv": b"\xef\xbb\xbf" + bode100().encode(),
    "bode100_settings.csv": b"\xef\xbb\xbf" + bode100(",", ".", settings=True).encode(),
    "e4990a.csv": e4990a().encode(),
    "hp4294a_cs_d.txt": hp4294a("CSD", memory=True).encode(),
    "hp4294a_turned.txt": hp4294a("AMPH", turned=True).encode(),
    "mfia.csv": mfia().encode(),
    "nanovna.csv": nanovna().encode(),
    "one_port.s1p": touchstone().encode(),
    "plain.csv": plain().encode(),
    "two_port.csv": two_port_csv().encode(),
    "two_port.s2p": touchstone("# kHz S MA R 50", 2).encode(),
    "waveforms.csv": waveforms().encode(),
}

if __name__ == "__main__":
    for file, content in FILES.items():
        (Path(__file__).parent / file).write_bytes(content)
