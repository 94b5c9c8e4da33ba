# SPDX-License-Identifier: GPL-3.0-or-later
"""What changed since a commit: ``python -m tests.quantities c5d14ed`` runs commands in both trees and compares numbers.

The commands print JSON; each number in it is a quantity, of a list the first, the middle and the last. Both trees run
on the same machine with the same ngspice, so that equal circuits give equal bits: a relative difference above 1e-6
comes from a change of the code. Numbers that only one of the trees has are counted.
A set that was renamed is given as ``--motor bimodal40=beam40``, its name at the commit first.
"""

import argparse
import contextlib
import io
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from tests.motors import BEAM40

ROOT = Path(__file__).resolve().parent.parent
MOTORS = ("andersen2002", "andersen2002-unintended-mode", BEAM40, "bimodal40")
SAME = 1e-6  # relative; below it are rounding and the order of sums
SHOWN = 5
AS_COMMAND = {"OPENBLAS_NUM_THREADS": "1"}  # as the command sets it: sums in threads have another order
# no quantities: times, counts of the solver, and what is rounding only
IGNORED = re.compile(r"seconds|simulated_s|sha256|version|iterations|period_maps|residual|stored_power|floquet")
OF_A_MOTOR = (
    "show {}",
    "steady {} --speed 3 --no-audit",
    "steady {} --no-audit",
    "steady {} --speed 3 --contact brush --no-audit",
    "steady {} --speed 3 --contact coulomb --no-audit",
    "speed-torque {} --speeds=-5,0,5",
    "simulate {} --duration 5e-4 --no-audit",
    "simulate {} --duration 5e-4 --speed 3 --contact brush --no-audit",
    "simulate {} --duration 5e-4 --contact none",
    "simulate {} --duration 2e-2 --averaged",
    "admittance {} --start 10e3 --stop 60e3 --points 51",
    "admittance {} --start 10e3 --stop 60e3 --points 51 --state preloaded",
    "small-signals {} --speed 3 --frequencies 1000",
    "map {} --over drive.phase_deg=60,90,120 --speed 3",
    "sweep {} --over drive.phase_deg=60,120 --duration 3e-4",
    "drive {} --driver linear --duration 5e-4",
)
OTHERS = (
    "fit tests/data/spectra/bode100.csv",
    "fit tests/data/spectra/e4990a.csv",
    "track andersen2002 --duration 3e-3",
)


def commands(motors: tuple[str, ...]) -> list[str]:
    """Return the commands, without ``--json``."""
    return [*(command.format(motor) for motor in motors for command in OF_A_MOTOR), *OTHERS]


def numbers(value: object, name: str = "") -> Iterator[tuple[str, float]]:
    """Return the numbers of a JSON value by their names; of a long list the first, the middle and the last."""
    if IGNORED.search(name) or isinstance(value, bool | str | None):
        return
    if isinstance(value, dict):
        for key, one in value.items():
            yield from numbers(one, f"{name}.{key}")
    elif isinstance(value, list):
        for place in sorted({0, len(value) // 2, len(value) - 1} if len(value) > 3 else range(len(value))):
            yield from numbers(value[place], f"{name}[{place}]")
    elif isinstance(value, int | float):
        yield name, float(value)


def measured(motors: tuple[str, ...]) -> dict[str, float]:
    """Return the quantities of the package that is on the path; a command that fails has its exit status."""
    from pyspice_runner.cli import run  # of the tree

    found = {}
    for command in commands(motors):
        with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()):
            try:
                status = run([*command.split(), "--json"])
            except SystemExit as end:
                status = end.code if isinstance(end.code, int) else 1
        found[f"{command}: exit status"] = float(status)
        with contextlib.suppress(ValueError):
            found |= {f"{command}: {name[1:]}": value for name, value in numbers(json.loads(out.getvalue()))}
    return found


def of_tree(tree: Path, motors: tuple[str, ...]) -> dict[str, float]:
    """Return the quantities of a tree, from a process of its own."""
    done = subprocess.run(
        [sys.executable, str(Path(__file__).resolve()), "--print", *(f"--motor={one}" for one in motors)],
        cwd=tree, env={**os.environ, **AS_COMMAND, "PYTHONPATH": str(tree)}, capture_output=True, text=True, check=True,
    )  # fmt: skip
    found: dict[str, float] = json.loads(done.stdout)
    return found


def main() -> None:
    """Compare this tree with a commit."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("commit", nargs="?", default="HEAD")
    parser.add_argument("--motor", action="append")
    parser.add_argument("--all", action="store_true", help=f"list more than {SHOWN} of a command")
    parser.add_argument("--print", action="store_true", help="print the quantities of the package on the path")
    chosen = parser.parse_args()
    named = [one.partition("=") for one in chosen.motor or MOTORS]
    former, motors = tuple(first for first, _, _ in named), tuple(second or first for first, _, second in named)
    if chosen.print:
        print(json.dumps(measured(motors)))
        return
    with tempfile.TemporaryDirectory() as folder:
        archive = subprocess.run(["git", "archive", chosen.commit], cwd=ROOT, capture_output=True, check=True)
        subprocess.run(["tar", "x", "-C", folder], input=archive.stdout, check=True)
        found = of_tree(Path(folder), former)
    names = dict(zip(commands(former), commands(motors), strict=True))
    before = {f"{names[(parts := name.split(': ', 1))[0]]}: {parts[1]}": value for name, value in found.items()}
    now = of_tree(ROOT, motors)
    common = [name for name in now if name in before]
    away = {name: abs(now[name] - before[name]) / max(abs(now[name]), abs(before[name]), 1e-300) for name in common}
    far = [name for name in common if away[name] > SAME]
    for command in commands(motors):
        of = sorted((name for name in far if name.startswith(f"{command}: ")), key=away.__getitem__, reverse=True)
        if of:
            print(f"{command}: {len(of)} differ")
        for name in of if chosen.all else of[:SHOWN]:
            print(f"    {name.split(': ', 1)[1]}: {before[name]:.9g} → {now[name]:.9g} ({100.0 * away[name]:.3g} %)")
    equal = sum(now[name] == before[name] for name in common)
    print(
        f"{len(common)} quantities of both, {equal} equal in every bit, {len(far)} differ by more than {SAME:g}; "
        f"{len(before) - len(common)} only at {chosen.commit}, {len(now) - len(common)} only now"
    )


if __name__ == "__main__":
    main()
