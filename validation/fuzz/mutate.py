# SPDX-License-Identifier: GPL-3.0-or-later
"""Mutations of bytes, of the lines, fields and numbers of a text, and of the leaves of a document."""

from __future__ import annotations

import copy
import random
import re
from collections.abc import Callable
from typing import Any

from validation.fuzz.nasty import ATTEMPTS, EDGES, NUMBERS, VALUES

_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_FIELD = re.compile(r"[^\s,;=]+")
_NOISE = "\0\x1b\x7f\x85\ufeff\u202e'\"`$\\{}[]()<>=#*;%&|~^!?,.:\n\r\t "
_ATTEMPTS = tuple(ATTEMPTS.values())
_LONGEST = 3 * 2**20  # characters; a longer text is cut


def nasty(rng: random.Random) -> str:
    """A hostile text; rarely a long one, which would take all the time."""
    text = rng.choice(_ATTEMPTS + NUMBERS)
    return text if len(text) < 10_000 or rng.random() < 0.05 else text[: rng.randrange(1, 300)]


def value(rng: random.Random) -> Any:
    """A Python value of a wrong type or size."""
    if rng.random() < 0.3:
        edge = float(rng.choice(EDGES))
        return int(edge) if edge.is_integer() else edge
    return rng.choice(VALUES) if rng.random() < 0.7 else nasty(rng)


def _span(size: int, rng: random.Random) -> tuple[int, int]:
    start = rng.randrange(size + 1)
    return start, min(size, start + rng.choice([0, 1, 2, 8, 64, 512]))


def _truncated(text: str, rng: random.Random) -> str:
    return text[: rng.randrange(len(text) + 1)]


def _spliced(text: str, rng: random.Random) -> str:
    """Replace one part of the text by another."""
    (start, stop), (first, last) = _span(len(text), rng), _span(len(text), rng)
    return text[:start] + text[first:last] + text[stop:]


def _repeated(text: str, rng: random.Random) -> str:
    start, stop = _span(len(text), rng)
    return text[:start] + text[start:stop] * rng.choice([2, 3, 50, 1000]) + text[stop:]


def _noisy(text: str, rng: random.Random) -> str:
    at = rng.randrange(len(text) + 1)
    sign = rng.choice(_NOISE) if rng.random() < 0.7 else chr(rng.choice([*range(0x80, 0xD7FF, 97), 0xFFFD, 0x1F4A3]))
    return text[:at] + sign + text[at + rng.randrange(2) :]


def _injected(text: str, rng: random.Random) -> str:
    start, stop = _span(len(text), rng)
    return text[:start] + nasty(rng) + text[stop if rng.random() < 0.5 else start :]


def _of(pattern: re.Pattern[str], new: Callable[[str, random.Random], str]) -> Callable[[str, random.Random], str]:
    """Replace one match of a pattern, or all of them."""

    def mutation(text: str, rng: random.Random) -> str:
        found = list(pattern.finditer(text[:200_000]))
        if not found:
            return text
        if rng.random() < 0.1:
            word = new("", rng)
            return pattern.sub(lambda _: word, text[:20_000])
        match = rng.choice(found)
        return text[: match.start()] + new(match[0], rng) + text[match.end() :]

    return mutation


def _number_gone(text: str, rng: random.Random) -> str:
    if text and rng.random() < 0.4:
        return rng.choice(["-" + text, text + "0" * 12, text + "e9", text + "e-9", "." + text, text[:-1], text * 2])
    word = rng.choice(NUMBERS)
    return word if len(word) < 10_000 or rng.random() < 0.05 else word[:60]


def _fields_swapped(text: str, rng: random.Random) -> str:
    found = list(_FIELD.finditer(text[:200_000]))
    if len(found) < 2:
        return text
    first, second = sorted(rng.sample(range(len(found)), 2))
    one, other = found[first], found[second]
    return text[: one.start()] + other[0] + text[one.end() : other.start()] + one[0] + text[other.end() :]


def _lines_changed(text: str, rng: random.Random) -> str:
    lines = text.split("\n")
    one, other = rng.randrange(len(lines)), rng.randrange(len(lines))
    deed = rng.randrange(4)
    if deed == 0:
        lines[one], lines[other] = lines[other], lines[one]
    elif deed == 1:
        del lines[one]
    elif deed == 2:
        lines.insert(other, lines[one])
    else:
        lines[one] = lines[one].swapcase() if rng.random() < 0.5 else ""
    return "\n".join(lines)


def _nested(text: str, rng: random.Random) -> str:
    left, right = rng.choice(["[]", "{}", "()", "''", '""'])
    at, depth = rng.randrange(len(text) + 1), rng.choice([3, 100, 2000, 100_000])
    return text[:at] + left * depth + (right * depth if rng.random() < 0.5 else "") + text[at:]


TEXT_MUTATIONS: tuple[Callable[[str, random.Random], str], ...] = (
    _truncated,
    _spliced,
    _repeated,
    _noisy,
    _noisy,
    _injected,
    _of(_NUMBER, _number_gone),
    _of(_NUMBER, _number_gone),
    _of(_FIELD, lambda _, rng: nasty(rng)),
    _fields_swapped,
    _lines_changed,
    _lines_changed,
    _nested,
)


def text(original: str, rng: random.Random) -> str:
    """The text with one to four mutations."""
    for _ in range(rng.choice([1, 1, 2, 4])):
        original = rng.choice(TEXT_MUTATIONS)(original, rng)[:_LONGEST]
    return original


def data(original: bytes, rng: random.Random) -> bytes:
    """The file with mutations of its text, its bytes or its encoding."""
    if rng.random() < 0.6:
        mutated = text(original.decode("utf-8", "surrogateescape"), rng)
        encoding = rng.choice(["utf-8"] * 12 + ["utf-16", "utf-8-sig", "latin-1"])
        return mutated.encode(encoding, "surrogatepass" if encoding == "utf-8" else "replace")
    changed = bytearray(original)
    for _ in range(rng.choice([1, 2, 8])):
        at, size = rng.randrange(len(changed) + 1), rng.choice([0, 1, 4, 100])
        fresh = [b"", rng.randbytes(rng.choice([1, 4, 300])), b"\0" * 8, b"\xff" * 8, changed[at : at + size] * 3]
        changed[at : at + size] = rng.choice(fresh)
    return bytes(changed[: rng.randrange(len(changed) + 1)] if rng.random() < 0.2 else changed)


def document(original: dict[str, Any], rng: random.Random) -> dict[str, Any]:
    """The document with a few leaves or branches replaced, lost, moved or added."""
    changed = copy.deepcopy(original)
    for _ in range(rng.choice([1, 1, 2, 5])):
        place: Any = changed
        while True:
            keys = list(place) if isinstance(place, dict) else list(range(len(place)))
            if not keys:
                break
            key = rng.choice(keys)
            if isinstance(place[key], dict | list) and rng.random() < 0.85:
                place = place[key]
                continue
            deed = rng.randrange(6)
            if deed == 0:
                del place[key]
            elif deed == 1 and isinstance(place, dict):
                place[nasty(rng)] = place.pop(key)
            elif deed == 2 and isinstance(place, dict):
                place[rng.choice(list(original))] = copy.deepcopy(place[key])
            elif deed == 3 and isinstance(place[key], float):
                place[key] = place[key] * rng.choice([-1, 0, 1e-30, 1e-6, 0.1, 3, 1e6, 1e30])
            else:
                place[key] = value(rng)
            break
    return changed
