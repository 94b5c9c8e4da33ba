# SPDX-License-Identifier: GPL-3.0-or-later
"""Ways in which a measured file goes wrong, each drawn at random from a seed."""

from __future__ import annotations

import random
import re
from collections.abc import Callable

Mutation = Callable[[bytes, random.Random], bytes]

_NUMBER = re.compile(rb"(?<![\w.])[+-]?[0-9][0-9.,]*(?:e[+-]?[0-9]+)?(?![\w.])")
_NOT_DIGITS = b"xyzXYZ?*~\xe9\xb0\xff\x00\x07\x1b"


def _lines(data: bytes) -> tuple[list[bytes], bytes]:
    end = b"\r\n" if b"\r\n" in data else b"\n"
    return data.split(end), end


def _rows(lines: list[bytes]) -> list[int]:
    """Places of the lines that are points."""
    return [place for place, line in enumerate(lines) if re.match(rb"\s*[+-]?[0-9]", line)]


def _marks(data: bytes) -> bytes:
    return next(mark for mark in (b";", b"\t", b", ", b",", b" ") if mark in _lines(data)[0][-3])


def truncated(data: bytes, rng: random.Random) -> bytes:
    """End the file anywhere."""
    return data[: rng.randrange(len(data))]


def truncated_between_lines(data: bytes, rng: random.Random) -> bytes:
    """End the file after some line."""
    lines, end = _lines(data)
    return end.join([*lines[: rng.randrange(len(lines))], b""])


def _neighbours(cells: int, rng: random.Random) -> tuple[int, int]:
    """Two columns: the frequency and any other, or two side by side."""
    second = rng.randrange(1, cells)
    return rng.choice([0, second - 1]), second


def columns_swapped(data: bytes, rng: random.Random) -> bytes:
    """Exchange two columns in the points, not in the header."""
    lines, end = _lines(data)
    mark, rows = _marks(data), _rows(lines)
    count = len(lines[rows[-1]].split(mark))
    first, second = _neighbours(3 if b"Memory" in data else count, rng)  # data and memory alike make sense
    for place in rows:
        cells = lines[place].split(mark)
        if len(cells) > max(first, second):
            cells[first], cells[second] = cells[second], cells[first]
            lines[place] = mark.join(cells)
    return end.join(lines)


def columns_moved(data: bytes, rng: random.Random) -> bytes:
    """Exchange two columns together with their headings."""
    lines, end = _lines(data)
    mark, rows = _marks(data), _rows(lines)
    first, second = _neighbours(len(lines[rows[-1]].split(mark)), rng)
    headers = {place - 1 for place in rows if place and place - 1 not in rows}
    for place in [*headers, *rows]:
        cells = lines[place].split(mark)
        if len(cells) > max(first, second):
            cells[first], cells[second] = cells[second], cells[first]
            lines[place] = mark.join(cells)
    return end.join(lines)


def wrong_unit(data: bytes, rng: random.Random) -> bytes:
    """Replace a unit in the text above the points by one that does not fit, or degrees by radians."""
    lines, end = _lines(data)
    head = end.join(lines[: _rows(lines)[0]])
    swaps = [
        (b"Hz", b"s"),
        (b"Ohm", b"F"),
        ("Ω".encode(), b"V"),
        (b"deg", b"rad"),
        (b"DEG", b"RAD"),
        ("°".encode(), b"rad"),
    ]
    swaps += [(b"(deg)", b"()"), (b"(Ohm)", b""), (b"_hz", b""), (b"_s", b"_f"), (b"_s", b""), (b"(Hz)", b"(parsec)")]
    there = [swap for swap in swaps if swap[0] in head]
    if not there:
        return data
    old, new = rng.choice(there)
    return head.replace(old, new) + data[len(head) :]


def not_a_number(data: bytes, rng: random.Random) -> bytes:
    """Replace some numbers by something else."""
    word = rng.choice(
        [b"nan", b"NaN", b"", b"inf", b"-inf", b"---", b"1e999", b"abc", b"0x1F", b"1_000", b"=1+1", "٣".encode()]
    )
    share = rng.choice([0.002, 0.02, 0.5, 1.0])
    start = len(_lines(data)[1].join(_lines(data)[0][: _rows(_lines(data)[0])[0]]))
    return data[:start] + _NUMBER.sub(lambda match: word if rng.random() < share else match[0], data[start:])


def binary(data: bytes, rng: random.Random) -> bytes:
    """Replace the file by bytes, or put bytes into it."""
    noise = bytes(rng.randrange(256) for _ in range(rng.choice([200, 5000])))
    place = rng.randrange(len(data))
    return rng.choice([noise, b"\x89PNG\r\n\x1a\n" + noise, b"PK\x03\x04" + noise, data[:place] + noise + data[place:]])


def empty(_: bytes, rng: random.Random) -> bytes:
    """Return nothing but blanks or a byte-order mark."""
    return rng.choice([b"", b"\n", b" \r\n\t\r\n", b"\xef\xbb\xbf", b"\xff\xfe", b"\x1a"])


def header_alone(data: bytes, rng: random.Random) -> bytes:
    """Leave out all points but one at most."""
    lines, end = _lines(data)
    return end.join([*lines[: _rows(lines)[0] + rng.randrange(2)], b""])


def letters(data: bytes, rng: random.Random) -> bytes:
    """Put in single bytes that are no part of a number."""
    changed = bytearray(data)
    for _ in range(rng.choice([1, 1, 1, 10])):
        changed[rng.randrange(len(changed))] = rng.choice(_NOT_DIGITS)
    return bytes(changed)


def lines_repeated(data: bytes, rng: random.Random) -> bytes:
    """Repeat a point."""
    lines, end = _lines(data)
    place = rng.choice(_rows(lines))
    return end.join(lines[:place] + [lines[place]] * rng.choice([2, 3]) + lines[place + 1 :])


def lines_lost(data: bytes, rng: random.Random) -> bytes:
    """Leave some lines out."""
    lines, end = _lines(data)
    lost = set(rng.sample(range(len(lines)), rng.choice([1, 3, 10])))
    return end.join(line for place, line in enumerate(lines) if place not in lost)


def lines_shuffled(data: bytes, rng: random.Random) -> bytes:
    """Reverse the points, or put them in any order."""
    lines, end = _lines(data)
    rows = _rows(lines)
    order = rows[::-1] if rng.random() < 0.5 else rng.sample(rows, len(rows))
    moved = dict(zip(rows, order, strict=True))
    return end.join(lines[moved.get(place, place)] for place in range(len(lines)))


def encoded(data: bytes, rng: random.Random) -> bytes:
    """Write another encoding and other line ends."""
    text = data.decode("utf-8-sig").replace("Ω", "Ohm")
    ends = rng.choice(["\n", "\r\n", "\r"])
    return ends.join([*text.splitlines(), ""]).encode(
        rng.choice(["utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "latin-1"])
    )


MUTATIONS: tuple[Mutation, ...] = (
    truncated,
    truncated_between_lines,
    columns_swapped,
    columns_moved,
    wrong_unit,
    not_a_number,
    binary,
    empty,
    header_alone,
    letters,
    lines_repeated,
    lines_lost,
    lines_shuffled,
    encoded,
)
