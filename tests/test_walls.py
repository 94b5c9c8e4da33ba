# SPDX-License-Identifier: GPL-3.0-or-later
"""The walls between the packages, and the lightness of the import; CONTRIBUTING.md says who may import what."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import pyspice_runner as pr

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "pyspice_runner"

# what a part may import of ours, beside itself; "" is the package itself, of which only public names may be used
WALLS = {
    "errors": set(),
    "interrupts": set(),
    "files": {"errors", "interrupts"},
    "model": {"errors"},
    "netlist": {"errors", "model"},
    "engine": {"errors", "interrupts"},
    "analysis": {"errors", "files", "interrupts", "model", "netlist", "engine", "plots", "pages", ""},
    "plots": {"errors", "files", "model", "netlist", "analysis"},
    "pages": {"errors", "model", "analysis", ""},
    "commands": {""},
    "cli": {"commands", "interrupts", ""},
    "__main__": {"cli", "interrupts"},
}
# libraries that only some parts may know; ngspice and PySpice end at the engine and the netlists
HOMES = {
    "PySpice": {"netlist", "engine"},
    "matplotlib": {"plots"},
    "plotly": {"pages"},
    "jinja2": {"pages"},
    "subprocess": {"engine"},
    "typer": {"cli", "commands"},
    "rich": {"cli", "commands"},
}
PLOTTING = {"matplotlib", "plotly"}
HEAVY = ("matplotlib", "scipy", "xarray", "numpy", "PySpice", "pydantic", "pandas", "typer", "rich", "h5netcdf")
SOURCES = sorted(path for path in PACKAGE.rglob("*.py") if path != PACKAGE / "__init__.py")
OUTSIDE = sorted((ROOT / "figures").glob("*.py"))


def part_of(path: Path) -> str:
    """The part of the package that a file belongs to: a subpackage, or a module on the first level."""
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def is_module(name: str) -> bool:
    return (PACKAGE / name).is_dir() or (PACKAGE / f"{name}.py").is_file()


def imports(tree: ast.AST) -> Iterator[tuple[str, int]]:
    """Every module imported anywhere in a file, also inside functions and for type checking only."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, node.lineno
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"relative import in line {node.lineno}"
            assert node.module is not None
            if node.module == "pyspice_runner":
                for alias in node.names:  # a submodule, or a public name
                    yield (
                        f"pyspice_runner.{alias.name}" if is_module(alias.name) else node.module,
                        node.lineno,
                    )
            else:
                yield node.module, node.lineno


def public_names_used(tree: ast.AST) -> Iterator[tuple[str, int]]:
    """What a file takes from the package itself: ``pr.NAME`` and ``from pyspice_runner import NAME``."""
    called = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            called |= {alias.asname or alias.name for alias in node.names if alias.name == "pyspice_runner"}
        elif isinstance(node, ast.ImportFrom) and node.module == "pyspice_runner":
            yield from ((alias.name, node.lineno) for alias in node.names)
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in called:
            yield node.attr, node.lineno


def read(path: Path) -> ast.AST:
    return ast.parse(path.read_text(encoding="utf-8"), str(path))


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def test_every_part_has_its_walls() -> None:
    assert {part_of(path) for path in SOURCES} <= WALLS.keys()


@pytest.mark.parametrize("path", SOURCES, ids=name_of)
def test_part_imports_only_what_it_may(path: Path) -> None:
    part = part_of(path)
    for module, line in imports(read(path)):
        top, _, rest = module.partition(".")
        if top == "pyspice_runner":
            target = rest.split(".")[0]
            assert target in WALLS[part] | {part}, f"{name_of(path)}:{line}: {part} must not import {module}"
        else:
            assert part in HOMES.get(top, {part}), f"{name_of(path)}:{line}: {part} must not import {module}"


@pytest.mark.parametrize("path", [*SOURCES, *OUTSIDE], ids=name_of)
def test_public_names_are_public(path: Path) -> None:
    for name, line in public_names_used(read(path)):
        assert name in {*pr.__all__, "__version__"}, f"{name_of(path)}:{line}: {name} is no public name"


@pytest.mark.parametrize("path", OUTSIDE, ids=name_of)
def test_figures_use_public_names_only(path: Path) -> None:
    for module, line in imports(read(path)):
        assert not module.startswith("pyspice_runner."), (
            f"{name_of(path)}:{line}: import pyspice_runner as pr, not {module}"
        )


@pytest.mark.parametrize("path", SOURCES, ids=name_of)
def test_plots_are_made_on_demand(path: Path) -> None:
    """Whoever may import the plots does so inside the function that draws."""
    part = part_of(path)
    if part in ("plots", "pages"):
        return
    for node in ast.iter_child_nodes(read(path)):
        for module, line in imports(node) if isinstance(node, ast.Import | ast.ImportFrom) else ():
            names = {module.partition(".")[0], module}
            assert not names & (PLOTTING | {"pyspice_runner.plots"}), f"{name_of(path)}:{line}: {module}"
            assert not module.startswith("pyspice_runner.pages"), f"{name_of(path)}:{line}: {module}"


def test_import_is_light() -> None:
    script = f"import sys, pyspice_runner; print(*[name for name in {HEAVY!r} if name in sys.modules])"
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True, timeout=60
    )
    assert done.stdout.split() == []


def test_no_plotting_library_loads_before_a_plot_is_asked_for() -> None:
    script = (
        "import sys, pyspice_runner as pr\n"
        "[getattr(pr, name) for name in pr.__all__ if not name.startswith('plot_')]\n"
        "pr.load_motor('andersen2002')\n"
        "print(*[name for name in sys.modules if name.startswith(('matplotlib', 'plotly', 'jinja2'))])\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True, timeout=60
    )
    assert done.stdout.split() == []


# --- the face of the package ---------------------------------------------------------------------------------


@pytest.mark.parametrize("name", pr.__all__)
def test_public_name_resolves_and_says_what_it_is(name: str) -> None:
    thing = getattr(pr, name)
    assert thing.__name__ == name
    assert thing.__doc__
    assert name in dir(pr)


def test_public_names_are_declared_once_and_for_type_checkers_too() -> None:
    tree = ast.parse((PACKAGE / "__init__.py").read_text(encoding="utf-8"))
    declared = {
        alias.name: node.module
        for block in ast.walk(tree)
        if isinstance(block, ast.If)
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert sorted(declared) == sorted(pr.__all__)
    assert len(set(pr.__all__)) == len(pr.__all__)
    for name, module in declared.items():
        assert getattr(pr, name).__module__ == module


def test_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="module 'pyspice_runner' has no attribute 'simulat'"):
        pr.simulat  # noqa: B018
