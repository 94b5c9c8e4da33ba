# SPDX-License-Identifier: GPL-3.0-or-later
"""The walls between the packages, import circles, and the lightness of the import.

CONTRIBUTING.md says who may import what. Every ``import`` statement counts here, also inside a function and under
``TYPE_CHECKING``. Only the package itself loads modules by name: its public names, and the module that draws.
"""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

import pyspice_runner as pr

pytestmark = pytest.mark.xdist_group("walls")  # the syntax trees are shared

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "pyspice_runner"

BASE = {"display", "errors", "files", "interrupts", "result", "units"}
CORE = BASE | {"motor", "spice", "circuit", "run"}
# what a part may import of ours, beside itself; "" is the package itself
WALLS = {
    "errors": set(),
    "interrupts": set(),
    "units": set(),
    "files": {"errors", "interrupts"},
    "display": {"errors"},
    "result": {"display", "errors", "files", "units"},
    "datasets": {"files", "result", "units"},
    "motor": {"display", "errors", "files", "units"},
    "spice": {"errors", "files", "interrupts", "units"},
    "circuit": {"errors", "motor", "spice", "units"},
    "run": CORE,
    "steady": CORE | {"datasets", "drivers"},
    "drivers": CORE | {"datasets", "steady"},
    "averaged": CORE | {"drivers", "steady"},
    "trackers": CORE | {"averaged", "drivers", "steady"},
    "control": CORE | {"averaged", "drivers", "steady"},
    "export": CORE | {"averaged"},
    "impedance": CORE | {"export"},
    "designs": {"circuit", "control", "drivers", "errors", "motor", "trackers"},
    "sweeps": CORE | {"datasets", "drivers", "steady"},
    "calibration": CORE | {"averaged", "impedance", "steady", "sweeps"},
    "view": CORE
    | {"averaged", "calibration", "control", "datasets", "drivers", "export", "impedance", "steady", "trackers"},
    "operating_point": CORE | {"averaged", "drivers", "steady"},
    "commands": CORE
    | {"", "calibration", "control", "drivers", "export", "impedance", "steady", "sweeps", "trackers", "view"},
    "cli": {"commands", "interrupts", ""},
    "__main__": {"cli", "commands", "errors", "interrupts"},
}
# libraries that only some parts may know; ngspice and PySpice end at the engine and the netlists
HOMES = {
    "PySpice": {"averaged", "circuit", "control", "drivers", "spice", "steady", "trackers", "view"},
    "matplotlib": {"view", "display"},  # which names the type that ``plot`` returns
    "plotly": {"view"},
    "jinja2": {"view"},
    "subprocess": {"spice"},
    "typer": {"cli", "commands"},
    "rich": {"cli", "commands"},
    "tools": set(),  # not in the wheel
    "tests": set(),
    "validation": set(),
    "docs": set(),
}
HEAVY = ("matplotlib", "scipy", "xarray", "numpy", "PySpice", "pydantic", "pandas", "typer", "rich", "h5netcdf")
SOURCES = sorted(PACKAGE.rglob("*.py"))
FIGURES = sorted((ROOT / "figures").glob("*.py"))


def module_of(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


MODULES = {module_of(path): path for path in SOURCES}


def part_of(module: str) -> str:
    """The part of the package that a module belongs to: a subpackage, or a module on the first level."""
    return module.partition(".")[2].partition(".")[0]


@cache
def nodes(path: Path) -> tuple[ast.AST, ...]:
    """The syntax tree of a file, whole."""
    return tuple(ast.walk(ast.parse(path.read_text(encoding="utf-8"), str(path))))


def imports(path: Path) -> Iterator[tuple[str, int]]:
    """Yield every module that a file imports, and the line; of a package the submodule that is meant."""
    for node in nodes(path):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"relative import in line {node.lineno} of {path}"
            for alias in node.names:
                below = f"{node.module}.{alias.name}"
                yield (below if below in MODULES else str(node.module)), node.lineno


def public_names_used(path: Path) -> Iterator[tuple[str, int]]:
    """Yield what a file takes from the package itself: ``pr.NAME`` and ``from pyspice_runner import NAME``."""
    called = set()
    for node in nodes(path):
        if isinstance(node, ast.Import):
            called |= {alias.asname or alias.name for alias in node.names if alias.name == "pyspice_runner"}
        elif isinstance(node, ast.ImportFrom) and node.module == "pyspice_runner":
            yield from ((alias.name, node.lineno) for alias in node.names)
    for node in nodes(path):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in called:
            yield node.attr, node.lineno


def breaches(module: str, path: Path) -> Iterator[str]:
    """Yield each import of a file that its part may not have."""
    part = part_of(module)
    for name, line in imports(path):
        top = name.partition(".")[0]
        allowed = part_of(name) in WALLS[part] | {part} if top == "pyspice_runner" else part in HOMES.get(top, {part})
        if not allowed:
            yield f"{path.relative_to(ROOT)}:{line}: {part} must not import {name}"


def run(script: str) -> str:
    return subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True, timeout=60
    ).stdout


def test_each_part_imports_only_the_parts_and_libraries_that_it_may() -> None:
    inside = {name: path for name, path in MODULES.items() if name != "pyspice_runner"}
    assert {part_of(module) for module in inside} == WALLS.keys()
    assert [line for module, path in inside.items() for line in breaches(module, path)] == []


def test_a_forbidden_import_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(f"{__name__}.ROOT", tmp_path)
    (tmp_path / "x.py").write_text("def f():\n    from pyspice_runner.run import audit\n    import matplotlib\n")
    found = list(breaches("pyspice_runner.motor.x", tmp_path / "x.py"))
    assert [line.split(": ")[0] for line in found] == ["x.py:2", "x.py:3"]


def test_no_two_files_import_each_other_on_any_way_round() -> None:
    graph = {module: {name for name, _ in imports(path) if name in MODULES} for module, path in MODULES.items()}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(f"import circle: {' → '.join(error.args[1])}")


def test_only_the_package_itself_loads_modules_of_its_own_by_name() -> None:
    loading = {module for module, path in MODULES.items() if "import_module(" in path.read_text(encoding="utf-8")}
    assert loading == {"pyspice_runner", "pyspice_runner.cli"}  # which loads the command that is asked for


def test_only_public_names_are_taken_from_the_package() -> None:
    known = {*pr.__all__, "__version__"}
    assert [
        f"{path.relative_to(ROOT)}:{line}: {name} is not a public name"
        for path in (*SOURCES, *FIGURES)
        for name, line in public_names_used(path)
        if name not in known
    ] == []


def test_import_is_light() -> None:
    assert run(f"import sys, pyspice_runner; print(*[name for name in {HEAVY!r} if name in sys.modules])").split() == []


@pytest.mark.parametrize(
    ("words", "unused"),
    [
        (["show", "andersen2002"], ["scipy", "pyspice_runner.steady.shooting", "pyspice_runner.commands.calibrate"]),
        (["simulate", "bimodal40", "--duration", "1e-4"], ["scipy", "pyspice_runner.steady.shooting"]),
        (["steady", "bimodal40", "--speed", "20"], ["scipy", "pyspice_runner.commands.simulate"]),
    ],
)
def test_a_command_loads_what_it_needs(words: list[str], unused: list[str]) -> None:
    loaded = f"print(*[name for name in {unused!r} if name in sys.modules], 'checked')"
    said = run(f"import sys\nfrom pyspice_runner.cli import run\nassert run({words!r}) == 0\n{loaded}")
    assert said.splitlines()[-1] == "checked"


def test_no_plotting_library_loads_before_a_plot_is_asked_for() -> None:
    assert (
        run(
            "import sys, pyspice_runner as pr\n"
            "[getattr(pr, name) for name in pr.__all__]\n"
            "pr.load_motor('andersen2002')\n"
            "print(*[name for name in sys.modules if name.startswith(('matplotlib', 'plotly', 'jinja2'))])\n"
        ).split()
        == []
    )


# --- the public names ---


def test_every_public_name_resolves_and_has_a_docstring() -> None:
    for name in pr.__all__:
        thing = getattr(pr, name)
        assert thing.__name__ == name
        assert thing.__doc__
        assert name in dir(pr)


def test_each_public_name_is_declared_once_at_its_home() -> None:
    tree = ast.parse((PACKAGE / "__init__.pyi").read_text(encoding="utf-8"))
    declared = [(alias.name, node) for node in tree.body if isinstance(node, ast.ImportFrom) for alias in node.names]
    assert sorted(name for name, _ in declared) == sorted(pr.__all__)
    assert len(set(pr.__all__)) == len(pr.__all__)
    for name, node in declared:
        assert getattr(pr, name).__module__ == f"pyspice_runner.{node.module}"


def test_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="No pyspice_runner attribute simulat"):
        pr.simulat  # noqa: B018
