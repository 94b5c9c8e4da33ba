# SPDX-License-Identifier: GPL-3.0-or-later
"""A raw file is read as it was written, or rejected: no wrong array and no other exception."""

import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from pyspice_runner.spice.rawfile import RawFile, RawFileError, read_rawfile


def written(
    vectors: dict[str, NDArray[np.generic]], *, title: str = "a title", plot: str = "Transient Analysis"
) -> bytes:
    """The bytes that ngspice writes for one analysis."""
    table = np.column_stack(list(vectors.values()))
    kind = "complex" if np.iscomplexobj(table) else "real"
    lines = [
        f"Title: {title}",
        "Date: Sat Nov 21 12:33:02  2026",
        f"Plotname: {plot}",
        f"Flags: {kind}",
        f"No. Variables: {table.shape[1]}",
        f"No. Points: {table.shape[0]}       ",  # ngspice leaves room to write the number last
        "Variables:",
        *(f"\t{index}\t{name}\tvoltage" for index, name in enumerate(vectors)),
        "Binary:",
        "",
    ]
    return "\n".join(lines).encode() + np.ascontiguousarray(table).tobytes()


def read(data: bytes) -> RawFile:
    with tempfile.NamedTemporaryFile(suffix=".raw") as file:
        file.write(data)
        file.flush()
        return read_rawfile(Path(file.name))


def refusal(data: bytes) -> str:
    with pytest.raises(RawFileError) as caught:
        read(data)
    return str(caught.value)


TIME = np.linspace(0.0, 1.0, 7)
SAMPLE = {"time": TIME, "v(out)": np.sin(TIME), "i(v.xmotor.xmode1.vvelocity)": TIME**2}

tables = st.tuples(st.integers(1, 20), st.integers(1, 6)).flatmap(
    lambda shape: st.one_of(
        arrays(np.float64, shape, elements=st.floats(width=64)),
        arrays(np.complex128, shape, elements=st.complex_numbers()),
    )
)
names = st.text(st.characters(min_codepoint=33, max_codepoint=126), min_size=1, max_size=30)


@settings(max_examples=100, deadline=None)
@given(table=tables, data=st.data(), title=st.text(st.characters(exclude_characters="\n", codec="utf-8")))
def test_a_raw_file_is_read_as_it_was_written(table: NDArray[np.generic], data: st.DataObject, title: str) -> None:
    count = table.shape[1]
    keys = data.draw(st.lists(names, min_size=count, max_size=count, unique_by=str.lower))
    raw = read(written(dict(zip(keys, table.T, strict=True)), title=title))
    assert list(raw.vectors) == [key.lower() for key in keys]
    assert raw.points == len(table)
    assert raw.plot == "Transient Analysis"
    for key, column in zip(keys, table.T, strict=True):
        assert raw.vectors[key.lower()].dtype == table.dtype
        np.testing.assert_array_equal(raw.vectors[key.lower()], column)


def test_a_title_may_contain_words_of_the_header() -> None:
    for title in ("Binary:", "No. Points: 99", "Flags: complex", "Variables:"):
        np.testing.assert_array_equal(read(written(SAMPLE, title=title)).vectors["v(out)"], np.sin(TIME))


@settings(max_examples=50, deadline=None)
@given(lost=st.integers(1, TIME.size * 3 * 8))
def test_file_cut_in_its_data_is_rejected(lost: int) -> None:
    assert refusal(written(SAMPLE)[:-lost]) == "the raw file is cut short: it announces 7 points of 3 vectors"


def test_two_analyses_in_one_file_are_rejected() -> None:
    assert refusal(written(SAMPLE) * 2) == "the raw file holds more than one analysis"


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        (b"No. Points: 7", b"No. Points: 0", "the raw file holds no points"),
        (b"No. Points: 7", b"No. Points: -7", "the raw file holds no points"),
        (b"No. Points: 7", b"No. Points: x", "the raw file's header is broken"),
        (b"No. Points: 7", b"No. Points: 7.5", "the raw file's header is broken"),
        (b"No. Points: 7", b"Nothing: 7", "the raw file's header has no 'No. Points'"),
        (b"Plotname:", b"Plot:", "the raw file's header has no 'Plotname'"),
        (b"Flags: real", b"Flag: real", "the raw file's header has no 'Flags'"),
        (b"Variables:\n", b"Variable:\n", "the raw file's header is broken"),
        (b"\tv(out)\tvoltage", b"", "the raw file's header is broken"),
        (b"No. Variables: 3", b"No. Variables: 2", "the raw file announces 2 vectors and names 3"),
        (b"\tv(out)\t", b"\ttime\t", "the raw file announces 3 vectors and names 2"),
        (b"No. Points: 7", b"No. Points: 999999999999999999999", "the raw file is cut short"),
        (b"Flags: real", b"Flags: complex", "the raw file is cut short"),
        (b"Binary:", b"Values:", "the raw file has no binary part"),
    ],
)
def test_broken_header_is_rejected(old: bytes, new: bytes, sentence: str) -> None:
    data = written(SAMPLE)
    assert data.count(old) == 1
    assert refusal(data.replace(old, new)).startswith(sentence)


def test_no_file_and_no_regular_file_are_rejected(tmp_path: Path) -> None:
    with pytest.raises(RawFileError, match=r"no raw file was written \(No such file or directory\)"):
        read_rawfile(tmp_path / "out.raw")
    with pytest.raises(RawFileError, match=r"no raw file was written \(Is a directory\)"):
        read_rawfile(tmp_path)


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.binary(max_size=400))
def test_garbage_is_rejected(data: bytes) -> None:
    refusal(data)


@settings(max_examples=300, deadline=None)
@given(data=st.data())
def test_damaged_header_is_rejected_or_harmless(data: st.DataObject) -> None:
    good = written(SAMPLE)
    header = good.index(b"Binary:\n") + 8
    at = data.draw(st.integers(0, header - 1))
    damaged = good[:at] + data.draw(st.binary(max_size=3)) + good[at + data.draw(st.integers(0, 3)) :]
    try:
        raw = read(damaged)
    except RawFileError:
        return
    # what is still read is complete; a name may be spelt otherwise, a value can only be read at its own place
    assert raw.points * len(raw.vectors) * next(iter(raw.vectors.values())).itemsize <= TIME.nbytes * 3
    if len(raw.vectors) == 3 and next(iter(raw.vectors.values())).dtype == float and damaged.endswith(good[header:]):
        for found, expected in zip(raw.vectors.values(), SAMPLE.values(), strict=True):
            np.testing.assert_array_equal(found, expected)
