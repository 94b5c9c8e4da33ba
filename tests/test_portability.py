# SPDX-License-Identifier: GPL-3.0-or-later
"""The command without what only POSIX systems have, and in another encoding."""

import json
import signal
from pathlib import Path

import pytest

from tests.processes import ROOT, begun, command, handles, simulators_in, wait_for, working_in

# What Windows lacks; NumPy and multiprocessing use os.uname and SIGKILL on Linux, and ngspice is ended by killpg.
WITHOUT_POSIX = """
import os, signal, sys

os.process_cpu_count = os.cpu_count  # of Python 3.13; that of POSIX needs what is missing here

for module, names in {
    signal: "SIGHUP SIGALRM SIGUSR1 SIG_BLOCK pthread_sigmask pthread_kill alarm setitimer",
    os: "openpty ttyname getuid geteuid getpgid getsid setsid fork forkpty sched_getaffinity pread mkfifo",
}.items():
    for name in names.split():
        delattr(module, name)


class Absent:
    def find_spec(self, name, *_):
        if name in {"fcntl", "grp", "pty", "pwd", "resource", "termios", "tty"}:
            raise ModuleNotFoundError(name=name)


sys.meta_path.insert(0, Absent())
"""
RUNS = {
    "simulate bimodal40 --duration 0.1ms": "mean_torque_n_m",
    "track bimodal40 --averaged --duration 1ms": "end_frequency_hz",  # compiled C in the user's cache
}
SWEEP = ("sweep", "bimodal40", "--over", "drive.voltage=80:100:3", "--workers", "2")


@pytest.fixture
def windows(tmp_path: Path) -> dict[str, str]:
    """Return the environment of a process without POSIX, which cannot print more than ASCII."""
    place = tmp_path / "start"
    place.mkdir()
    (place / "sitecustomize.py").write_text(WITHOUT_POSIX, encoding="utf-8")
    return {"PYTHONPATH": f"{place}:{ROOT}", "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"}


@pytest.mark.parametrize(("run", "quantity"), RUNS.items())
def test_a_run_is_the_same_without_posix(run: str, quantity: str, windows: dict[str, str], tmp_path: Path) -> None:
    words, cache = (*run.split(), "--json"), str(tmp_path)
    shown = [command(*words, cwd=tmp_path, XDG_CACHE_HOME=cache, **system) for system in ({}, windows)]
    assert [status for status, *_ in shown] == [0, 0], shown
    here, there = (json.loads(text)[quantity] for _, text, _ in shown)
    assert here == there != 0.0


def test_a_sweep_with_workers_runs_without_posix(windows: dict[str, str], tmp_path: Path) -> None:
    status, shown, said = command(*SWEEP, "--duration", "0.05ms", "--store", "store", cwd=tmp_path, **windows)
    assert status == 0, said
    assert r"90\xb0 apart, quantiles of 3 points" in shown
    assert len([*(tmp_path / "store").glob("*/*.json")]) == 3


@pytest.mark.soak  # with Python 3.13 under load one run in ten ended only when its workers were killed, after 80 s
def test_an_interrupted_sweep_leaves_nothing_without_posix(windows: dict[str, str], tmp_path: Path) -> None:
    environment = windows | {"TMPDIR": str(tmp_path)}
    with begun(*SWEEP, "--duration", "1", cwd=tmp_path, **environment) as process:
        wait_for(lambda: handles(process, signal.SIGINT) and simulators_in(tmp_path), process)
        process.send_signal(signal.SIGINT)
        assert process.wait(60.0) == 130
    assert not working_in(tmp_path)
