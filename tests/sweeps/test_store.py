# SPDX-License-Identifier: GPL-3.0-or-later
"""The store returns what was stored, or nothing: never a part of it, and never another entry."""

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pyspice_runner as pr
from pyspice_runner.sweeps.store import Store, fingerprint

CONTENT = {"motor": {"preload_n": 5.0}, "run": {"duration": 1e-3}}
RESULT = {"numbers": {"torque_n_m": 0.1 + 0.2, "efficiency": float("inf")}, "deck_sha256": "ab"}


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path / "points")


def entry(store: Store) -> Path:
    (path,) = store.folder.rglob("*.json")
    return path


def test_the_store_returns_a_result_to_the_last_digit(store: Store) -> None:
    assert store.get(CONTENT) is None
    store.put(CONTENT, RESULT)
    assert store.get(CONTENT) == RESULT
    assert store.get(dict(reversed(CONTENT.items()))) == RESULT  # whatever the order
    assert Store(store.folder).get(CONTENT) == RESULT


def test_another_content_has_another_result(store: Store) -> None:
    store.put(CONTENT, RESULT)
    assert store.get(CONTENT | {"run": {"duration": np.nextafter(1e-3, 1.0)}}) is None
    assert store.get({}) is None


def test_arrays_are_compared_by_their_values() -> None:
    assert fingerprint({"speeds": np.array([1.0, 2.0])}) == fingerprint({"speeds": [1.0, 2.0]})
    assert fingerprint({"a": 1, "b": 2}) == fingerprint({"b": 2, "a": 1}) != fingerprint({"a": 2, "b": 1})


def test_an_entry_cut_short_anywhere_counts_as_missing(store: Store) -> None:
    store.put(CONTENT, RESULT)
    path = entry(store)
    whole = path.read_bytes()
    for length in range(len(whole)):
        path.write_bytes(whole[:length])
        assert store.get(CONTENT) is None
    store.put(CONTENT, RESULT)
    assert path.read_bytes() == whole


@given(place=st.integers(0, 10_000), byte=st.integers(0, 255))
@settings(deadline=None)
def test_a_damaged_entry_never_gives_another_result(
    tmp_path_factory: pytest.TempPathFactory, place: int, byte: int
) -> None:
    store = Store(tmp_path_factory.mktemp("points"))
    store.put(CONTENT, RESULT)
    path = entry(store)
    damaged = bytearray(path.read_bytes())
    damaged[place % len(damaged)] = byte
    path.write_bytes(damaged)
    assert store.get(CONTENT) in (None, RESULT)


def test_a_foreign_entry_counts_as_missing(store: Store) -> None:
    other = CONTENT | {"run": {"duration": 2e-3}}
    store.put(other, RESULT)
    foreign = entry(store).read_bytes()
    entry(store).unlink()
    store.put(CONTENT, RESULT)
    entry(store).write_bytes(foreign)  # copied to the wrong name
    assert store.get(CONTENT) is None


@pytest.mark.parametrize("text", ["", "[]", "null", "7", "{}", '{"result": {}, "seal": 1}', "\xff", "[" * 100_000])
def test_a_file_that_is_not_an_entry_counts_as_missing(store: Store, text: str) -> None:
    store.put(CONTENT, RESULT)
    entry(store).write_text(text, encoding="latin-1")
    assert store.get(CONTENT) is None


def test_a_folder_in_the_place_of_an_entry_is_named_before_the_run(store: Store) -> None:
    store.put(CONTENT, RESULT)
    path = entry(store)
    assert json.loads(path.read_text(encoding="utf-8"))["content"] == CONTENT
    path.unlink()
    path.mkdir()
    with pytest.raises(pr.ParameterError, match=f"{path} of the store: Is a directory. Remove what is in its place"):
        store.get(CONTENT)
    path.rmdir()
    path.parent.rmdir()
    path.parent.touch()
    with pytest.raises(pr.ParameterError, match=f"{path} of the store: Not a directory. Remove"):
        store.get(CONTENT)


def test_many_threads_may_read_and_write_one_store_at_once(store: Store) -> None:
    contents = [{"point": number} for number in range(5)]

    def work(number: int) -> bool:
        content = contents[number % 5]
        expected = {"value": content["point"] * np.pi}
        store.put(content, expected)
        return Store(store.folder).get(content) == expected

    with ThreadPoolExecutor(8) as pool:
        assert all(pool.map(work, range(400)))
    assert len(list(store.folder.rglob("*"))) == 5 + len({fingerprint(content)[:2] for content in contents})


def test_the_default_store_is_in_the_users_cache_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert Store().folder == tmp_path / "piezomotor" / "points"
    assert Store().folder.is_dir()


def test_a_user_without_a_home_folder_is_asked_to_name_the_store(monkeypatch: pytest.MonkeyPatch) -> None:
    """As for a user id without an entry in the passwd file."""
    for name in ("XDG_CACHE_HOME", "HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("pwd.getpwuid", lambda number: {}[number])
    with pytest.raises(pr.ParameterError, match=r"no home folder for the store. Set HOME or XDG_CACHE_HOME, or name"):
        Store()


def test_a_place_that_cannot_be_written_is_rejected(store: Store, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    for place in (tmp_path / "file", tmp_path / "file" / "below", "a\0b", "x" * 300):
        with pytest.raises(pr.ParameterError, match="Cannot write the store"):
            Store(place)
    store.folder.rmdir()
    store.folder.touch()
    with pytest.raises(pr.ParameterError, match="Cannot write the store"):
        store.put(CONTENT, RESULT)
