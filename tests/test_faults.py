# SPDX-License-Identifier: GPL-3.0-or-later
"""What goes wrong around the command, as a user meets it: real processes, real files, real limits.

docs/robustness.md lists the faults and names the test of each; those of the runner, the store and the sweeps are beside
the other tests of these.
"""

from __future__ import annotations

import importlib.util
import json
import os
import random
import re
import shlex
import signal
import stat
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
import xarray

import pyspice_runner as pr
from pyspice_runner.cli import run
from tests.processes import LONGEST, ROOT, begun, command, handles, simulators_in, wait_for, working_in

RUNS = {  # the commands that run ngspice, as short as they can be
    "simulate": ["andersen2002", "--duration", "2e-4"],
    "admittance": ["andersen2002", "--points", "20"],
    "speed-torque": ["andersen2002", "--speeds=0", "--patience", "4"],
    "sweep": ["andersen2002", "--over", "drive.voltage=10", "--duration", "2e-4", "--store", "store", "--workers", "1"],
    "drive": ["andersen2002", "--duration", "3e-4"],
    "track": ["andersen2002"],
    "impact": [],
    "report": ["andersen2002", "--output", "report.html"],
    "export": ["andersen2002", "--output", "motor.s2p"],
}
SIMULATE = ["simulate", *RUNS["simulate"]]
SWEEP = ["sweep", "andersen2002", "--over", "drive.voltage=10:40:4", "--duration", "2e-4", "--store", "../store"]
# run the commands of a list one after the other, and end with the greatest status
ALL = (
    "import json, sys; from pyspice_runner.cli import run; sys.exit(max([run(one) for one in json.loads(sys.argv[1])]))"
)
MOMENTS = int(os.environ.get("PIEZOMOTOR_MOMENTS", "2"))  # at which Ctrl-C is pressed in the life of a command
TABLE = "mean rotor speed"  # in what simulate prints


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the command works, beside an empty place for its temporary files."""
    for name in ("work", "tmp", "bin"):
        (tmp_path / name).mkdir()
    monkeypatch.chdir(tmp_path / "work")
    monkeypatch.setenv("TMPDIR", str(tmp_path / "tmp"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "tmp"))
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    return tmp_path / "work"


@pytest.fixture
def ngspice(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Put something before the ngspice of this machine: shell words that are run where it works, on its deck."""
    real = subprocess.run(["sh", "-c", "command -v ngspice"], capture_output=True, text=True, check=True).stdout.strip()

    def install(words: str, version: str = f"exec {real} --version") -> None:
        script = folder.parent / "bin" / "ngspice"
        script.write_text(f'#!/bin/sh\nif [ "$1" = --version ]; then {version}; exit; fi\n{words}\nexec {real} "$@"\n')
        script.chmod(0o755)
        monkeypatch.setenv("PATH", f"{script.parent}{os.pathsep}{os.environ['PATH']}")

    return install


def temporary(folder: Path) -> list[str]:
    """What lies among the temporary files, but for the netlist of a run that failed, which its message names."""
    return [path.name for path in (folder.parent / "tmp").iterdir() if not (path / "deck.cir").exists()]


def told(words: str) -> str:
    """Text as one line, without the frames of a table."""
    return re.sub(r"[\s│]+", " ", words)


# --- ngspice ---


@pytest.mark.parametrize("name", RUNS)
def test_ngspice_that_is_missing(
    name: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("PATH", str(folder))
    assert run([name, *RUNS[name]]) == 3
    assert "piezomotor: ngspice is not on the PATH. Install it: `sudo apt-get" in capsys.readouterr().err
    assert list(folder.iterdir()) == []


def test_ngspice_that_is_too_old(ngspice: Callable[..., None], capsys: pytest.CaptureFixture[str]) -> None:
    ngspice("", version="echo '** ngspice-34 : Circuit level simulation program'")
    assert run(SIMULATE) == 3
    assert capsys.readouterr() == ("", "piezomotor: ngspice 34 is too old; version 36 or later is needed.\n")


@pytest.mark.parametrize("name", RUNS)
def test_ngspice_that_is_killed(
    name: str, folder: Path, ngspice: Callable[..., None], capsys: pytest.CaptureFixture[str]
) -> None:
    ngspice("kill -9 $$")
    assert run([name, *RUNS[name]]) == 3
    said = capsys.readouterr().err
    assert "ngspice was killed by signal 9 (Killed), as the system does when memory runs out" in said
    assert [path.name for path in folder.iterdir()] == (["store"] if name == "sweep" else [])
    assert temporary(folder) == []


@pytest.mark.parametrize(
    ("number", "says"),
    [
        (signal.SIGKILL, "ngspice was killed by signal 9 (Killed)"),
        (signal.SIGSTOP, "ngspice did not finish within 3 s and was stopped."),
    ],
)
def test_ngspice_that_is_killed_or_hangs_in_its_run(number: signal.Signals, says: str, folder: Path) -> None:
    with begun("simulate", "andersen2002", "--duration", "2", "--timeout", "3", cwd=folder) as process:
        at_work: list[int] = []
        wait_for(lambda: at_work.extend(simulators_in(folder.parent / "tmp")) or at_work, process)
        os.kill(at_work[0], number)
        output, said = process.communicate(timeout=LONGEST)
    assert (process.returncode, output) == (3, "")
    assert says in said
    assert working_in(folder.parent / "tmp") == []
    assert temporary(folder) == []


def test_ngspice_without_memory(folder: Path, ngspice: Callable[..., None], capsys: pytest.CaptureFixture[str]) -> None:
    ngspice("ulimit -v 8000")  # kB
    assert run(SIMULATE) == 3
    assert re.search(
        r"ngspice (ended with status|was killed by signal) .*The netlist is kept as", capsys.readouterr().err
    )
    assert temporary(folder) == []


def test_a_command_without_memory_says_so(folder: Path) -> None:
    """The same command twice in one process, so that all is loaded; the second time there is room for less."""
    script = """
import resource, sys
from pathlib import Path
from pyspice_runner.cli import run
words = ["simulate", "andersen2002", "--duration", "4e-3"]
assert run([*words, "--json"]) == 0
used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + 1_000_000, -1))
sys.exit(run(words))
"""
    status, output, said = command(sys.executable, "-c", script, cwd=folder, shell=True)
    assert status == 3
    assert TABLE not in output
    assert re.fullmatch(r"piezomotor: Out of memory\. Free some, shorten the run, or record less of it .*\n", said)
    assert temporary(folder) == []


# --- one of many runs that fails ---


def test_of_two_drivers_the_one_that_is_finished_is_delivered(
    folder: Path, ngspice: Callable[..., None], capsys: pytest.CaptureFixture[str]
) -> None:
    ngspice("grep -q amplifier deck.cir && kill -9 $$")
    words = ["drive", "andersen2002", "--driver", "ideal", "--against", "linear", "--duration", "3e-4"]
    assert run([*words, "--json", "--output", "drivers.json"]) == 3
    output, said = capsys.readouterr()
    assert "Only the ideal is finished; the linear failed. ngspice was killed" in said
    (driver,) = json.loads(output)["drivers"]
    assert driver["driver"]["kind"] == "ideal"
    assert json.loads((folder / "drivers.json").read_text(encoding="utf-8"))["drivers"] == [driver]


def test_a_curve_keeps_the_points_that_are_finished(
    folder: Path, ngspice: Callable[..., None], capsys: pytest.CaptureFixture[str]
) -> None:
    ngspice("grep -q 'set 0 .*2.5' deck.cir && kill -9 $$")
    words = ["speed-torque", "andersen2002", "--speeds=0,2.5,1", "--patience", "4", "--output", "curve.nc"]
    assert run([*words, "--json"]) == 3
    output, said = capsys.readouterr()
    assert re.search(r"ngspice was killed .* [12] of 3 points are finished\.\n", said)
    with xarray.open_dataset(folder / "curve.nc", engine="h5netcdf") as curve:
        assert curve["torque_n_m"].notnull().values.tolist()[:2] == [True, False]
        assert "of 3 points are finished." in curve.attrs["incomplete"]
    assert json.loads(output)["torque_n_m"][1] is None


def test_a_report_keeps_the_parts_that_are_finished(
    folder: Path, ngspice: Callable[..., None], capsys: pytest.CaptureFixture[str]
) -> None:
    ngspice("grep -q piezomotor_dynamometer deck.cir && kill -9 $$")
    assert run(["report", "andersen2002", "--duration", "5e-4", "--speeds=0,1"]) == 3
    kept = re.search(r"ngspice was killed .* What was finished is kept in (.*)\.\n", capsys.readouterr().err)
    assert kept
    assert {path.name for path in Path(kept[1]).iterdir()} == {
        "admittance_free.csv", "admittance_preloaded.csv", "run.nc"
    }  # fmt: skip
    assert list(folder.iterdir()) == []


def test_a_report_that_could_not_be_made_is_refused_before_its_runs(
    ngspice: Callable[..., None], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    ngspice("kill -9 $$")
    find = importlib.util.find_spec
    monkeypatch.setattr(
        "pyspice_runner.commands.report.find_spec", lambda name: None if name == "plotly" else find(name)
    )
    assert run(["report", "andersen2002"]) == 2
    assert "A report needs plotly. Install it:" in capsys.readouterr().err


# --- disks ---


def on_a_disk_of(kilobytes: int, folder: Path) -> tuple[list[str], str]:
    """Words that run others on a small disk, and then copy what is there to ``seen``; and what a full one is called.

    Where no disk can be mounted, a limit on the length of files takes its place.
    """
    here, seen = shlex.quote(str(folder)), shlex.quote(str(folder.parent / "seen"))
    inside = f'cd {here} && echo old >run.nc && "$@"; status=$?; cp -a . {seen}; exit $status'
    user = [] if os.geteuid() == 0 else ["--user", "--map-root-user"]
    mounted = ["unshare", *user, "--mount", "sh", "-c", f"mount -t tmpfs -o size={kilobytes}k none {here} && {inside}"]
    if subprocess.run([*mounted, "sh", "true"], capture_output=True, check=False).returncode == 0:
        subprocess.run(["rm", "-r", folder.parent / "seen"], check=True)
        return [*mounted, "sh"], "No space left on device"
    return ["bash", "-c", f"ulimit -f {kilobytes}; {inside}", "sh"], "File too large"


def test_a_full_disk_costs_no_result(folder: Path) -> None:
    """Neither the one that finds no place, nor an older one in its place, nor the points of a sweep."""
    disk, full = on_a_disk_of(16, folder)
    commands = [
        [*SIMULATE, "--output", "run.nc", "--plot", "run.png"],
        [*SWEEP, "--workers", "1", "--output", "../full.nc"],
        [*SWEEP, "--workers", "1", "--store", "store"],
    ]
    (folder.parent / "full.nc").symlink_to("/dev/full")
    words = [*disk, sys.executable, "-c", ALL, json.dumps(commands)]
    status, output, said = command(*words, cwd=folder, shell=True)
    assert status == 2, said
    run_said, sweep_said, *store_said = said.splitlines()
    # a run, and a drawing of it
    assert TABLE in output
    kept = re.fullmatch(
        f"piezomotor: Cannot write run.nc: {full}. Cannot write run.png: {full}. It is kept in (.*).", run_said
    )
    assert kept, said
    with xarray.open_dataset(Path(kept[1], "run.nc"), engine="h5netcdf") as waves:
        assert f"{waves.sizes['time_s']} in " in output
    assert whole(Path(kept[1], "run.png"))
    seen = folder.parent / "seen"
    assert sorted(path.name for path in seen.iterdir()) == ["run.nc", "store"]
    assert (seen / "run.nc").read_text(encoding="utf-8") == "old\n"
    # a sweep whose points are stored elsewhere
    assert "andersen2002, 4 points" in output
    kept = re.fullmatch(
        r"piezomotor: Cannot write ../full.nc: No space left on device. It is kept in (.*).", sweep_said
    )
    assert kept, said
    with xarray.open_dataset(Path(kept[1], "full.nc"), engine="h5netcdf") as found:
        assert found.sizes == {"drive.voltage": 4}
    assert len(list((folder.parent / "store").rglob("*.json"))) == 4
    # a sweep whose store itself is full
    stored = list((seen / "store").rglob("*.json"))
    assert all("seal" in json.loads(entry.read_text(encoding="utf-8")) for entry in stored)
    if "unshare" in disk:
        assert store_said == [f"piezomotor: Cannot write the store store: {full}. Free it, or choose another folder."]
        assert 0 < len(stored) < 4


def test_a_full_disk_for_temporary_files_is_named(folder: Path) -> None:
    disk, full = on_a_disk_of(64, folder)
    words = ["env", "TMPDIR=.", sys.executable, "-m", "pyspice_runner", *SIMULATE]
    status, output, said = command(*disk, *words, cwd=folder, shell=True)
    assert (status, output) == (3, "")
    if full == "No space left on device":
        assert re.search(r"The disk of \S+ is full\. Free some space or set TMPDIR\.", said)
    else:
        assert "File size limit exceeded" in said


SPECTRUM = str(ROOT / "tests/data/spectra/plain.csv")


@pytest.mark.parametrize(
    "words",
    [
        ["motors"],
        ["show", "andersen2002"],
        ["admittance", *RUNS["admittance"]],
        ["speed-torque", *RUNS["speed-torque"]],
        ["drive", *RUNS["drive"], "--driver", "ideal"],
        ["impact"],
        ["fit", SPECTRUM],
        ["compare", SPECTRUM, SPECTRUM],
    ],
    ids=lambda words: words[0],
)
def test_every_command_prints_what_finds_no_place(
    words: list[str], folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """And keeps it; the other commands are above."""
    (folder / "x.json").symlink_to("/dev/full")
    assert run([*words, "--json", "--output", "x.json", "--plot", "x.png"]) == 2
    output, said = capsys.readouterr()
    assert isinstance(json.loads(output), dict)
    kept = re.search(r"piezomotor: Cannot write x\.json: No space left on device\. It is kept in (.*)\.\n", said)
    assert kept, said
    assert isinstance(json.loads(Path(kept[1], "x.json").read_text(encoding="utf-8")), dict)
    assert whole(folder / "x.png")


def test_standard_output_on_a_full_disk(folder: Path) -> None:
    words = f"$PIEZOMOTOR {shlex.join(SIMULATE)} --json >/dev/full"
    status, _, said = command("bash", "-c", words, cwd=folder, shell=True)
    kept = re.fullmatch(
        r"piezomotor: Cannot write the standard output: No space left on device. It is kept in (.*).\n", said
    )
    assert (status, kept is not None) == (2, True), said
    assert json.loads(Path(kept[1], "result.json").read_text(encoding="utf-8"))["complete"] is True  # type: ignore[index]


TARGETS = [
    *([name, *words, "--output", "x.json"] for name, words in RUNS.items() if name != "export"),
    ["export", "andersen2002", "--output", "x.lib"],
    ["show", "andersen2002", "--plot", "x.png"],
    ["motors", "--output", "x.csv"],
    ["fit", SPECTRUM, "--output", "x.json"],
    ["report", "andersen2002"],
]


def test_a_place_that_may_not_be_written_is_refused_before_any_run(folder: Path) -> None:
    """A read-only folder, for every command, with an ngspice that would tell of a run."""
    (folder.parent / "bin" / "ngspice").write_text("#!/bin/sh\ntouch $MARK\n")
    (folder.parent / "bin" / "ngspice").chmod(0o755)
    words = [sys.executable, "-c", ALL, json.dumps(TARGETS)]
    if os.geteuid() == 0:  # whom permissions do not stop
        here = shlex.quote(str(folder))
        read_only = f'mount --bind {here} {here} && mount -o remount,ro,bind {here} && cd {here} && exec "$@"'
        words = ["unshare", "--mount", "sh", "-c", read_only, "sh", *words]
    folder.chmod(0o555)
    try:
        environment = {"PATH": f"{folder.parent / 'bin'}:{os.environ['PATH']}", "MARK": str(folder.parent / "ran")}
        status, output, said = command(*words, cwd=folder, shell=True, **environment)
    finally:
        folder.chmod(0o755)
    assert (status, output) == (2, "")
    assert len(said.splitlines()) == len(TARGETS), said
    for line in said.splitlines():
        assert re.fullmatch(r"piezomotor: Cannot write \S+: permission denied\. Choose another place\.", line)
    assert not (folder.parent / "ran").exists()


def test_no_place_for_temporary_files(folder: Path) -> None:
    lock = "mount --bind $place $place && mount -o remount,ro,bind $place"
    mounts = f"for place in /tmp /var/tmp /usr/tmp .; do [ ! -d $place ] || {{ {lock}; }} || exit; done"
    user = [] if os.geteuid() == 0 else ["--user", "--map-root-user"]
    locked = ["unshare", *user, "--mount", "sh", "-c", f'{mounts}; cd "$PWD"; exec "$@"', "sh"]
    words = [*locked, sys.executable, "-m", "pyspice_runner", *SIMULATE]
    if subprocess.run([*locked, "true"], capture_output=True, check=False).returncode != 0:
        # no mounts here; nobody writes to /proc, then
        start = "import sys, tempfile; tempfile._candidate_tempdir_list = lambda: ['/proc']\n"
        words = [sys.executable, "-c", f"{start}from pyspice_runner.cli import run; sys.exit(run({SIMULATE!r}))"]
    status, output, said = command(*words, cwd=folder, shell=True)
    assert (status, output) == (3, "")
    assert re.match(r"piezomotor: Cannot write the netlist: No usable temporary directory found in .*TMPDIR\.\n", said)


def test_an_output_that_exists_is_replaced_whole_and_keeps_what_it_was(folder: Path) -> None:
    (folder / "here.json").write_text("old")
    (folder / "here.json").chmod(0o640)
    (folder / "link.json").symlink_to("here.json")
    assert run([*SIMULATE, "--output", "link.json"]) == 0
    assert (folder / "link.json").is_symlink()
    assert json.loads((folder / "here.json").read_text(encoding="utf-8"))["complete"] is True
    assert stat.S_IMODE((folder / "here.json").stat().st_mode) == 0o640
    assert sorted(path.name for path in folder.iterdir()) == ["here.json", "link.json"]


# --- the terminal ---


@pytest.mark.parametrize("words", [[*SIMULATE, "--output", "run.csv"], ["--help"]])
def test_a_reader_that_leaves_costs_nothing(words: list[str], folder: Path) -> None:
    shell = f"set -o pipefail; $PIEZOMOTOR {shlex.join(words)} | true"
    assert command("bash", "-c", shell, cwd=folder, shell=True) == (0, "", "")
    assert (folder / "run.csv").exists() == ("--output" in words)


def test_streams_that_are_closed_or_have_no_greek(folder: Path) -> None:
    shell = f"$PIEZOMOTOR {shlex.join(SIMULATE)} --output run.csv >&- 2>&-"
    assert command("bash", "-c", shell, cwd=folder, shell=True)[0] == 0
    assert whole(folder / "run.csv")
    status, output, _ = command("show", "andersen2002", cwd=folder, PYTHONIOENCODING="ascii")
    assert status == 0
    assert "rotor.inertia_kg_m2" in output


# --- Ctrl-C ---


def whole(path: Path) -> bool:
    """Whether a file has its end."""
    content = path.read_bytes()
    if path.suffix == ".nc":
        with xarray.open_dataset(path, engine="h5netcdf") as dataset:
            return bool(dataset.load().attrs)
    ends = {".csv": b"\n", ".png": b"IEND\xaeB`\x82", ".html": b"</html>", ".json": b"}\n"}
    return content.rstrip(b"\n" if path.suffix == ".html" else b"").endswith(ends[path.suffix])


def test_ctrl_c_between_two_files_keeps_the_first_and_prints_the_result(folder: Path) -> None:
    os.mkfifo("run.png")  # which nobody reads, so that the command waits there
    with begun(*SIMULATE, "--json", "--output", "run.csv", "--plot", "run.png", cwd=folder) as process:
        wait_for(lambda: (folder / "run.csv").exists(), process)
        process.send_signal(signal.SIGINT)
        output, said = process.communicate(timeout=LONGEST)
    assert (process.returncode, said) == (130, "piezomotor: interrupted; run.csv is complete.\n")
    assert json.loads(output)["points"] + 1 == len((folder / "run.csv").read_text(encoding="utf-8").splitlines())
    assert temporary(folder) == []


LIVES = {  # what is run, how much longer it takes than a simulate, and what it leaves
    "simulate": ([*SIMULATE, "--output", "run.csv", "--plot", "run.png"], 1.5, {"run.csv", "run.png"}),
    "sweep": ([*SWEEP, "--workers", "2", "--output", "sweep.nc"], 2.5, {"sweep.nc"}),
    "report": (
        ["report", "andersen2002", "--duration", "3e-4", "--speeds=0", "--levels", "1"], 2.5, {"andersen2002.html"}
    ),
}  # fmt: skip


@pytest.fixture(scope="module")
def life(tmp_path_factory: pytest.TempPathFactory) -> float:
    """How long a simulate takes here and now, s."""
    began = time.monotonic()
    assert command(*SIMULATE, cwd=tmp_path_factory.mktemp("life"))[0] == 0
    return time.monotonic() - began


@pytest.mark.parametrize("name", LIVES)
def test_ctrl_c_at_any_moment(name: str, life: float, folder: Path) -> None:
    """From the first line of ours on; before it, Python itself starts, for some hundredths of a second."""
    words, longer, complete = LIVES[name]
    chance = random.Random(f"{name} 1")
    for moment in range(MOMENTS):
        for path in folder.iterdir():
            path.unlink()
        with begun(*words, cwd=folder) as process:
            wait_for(lambda: handles(process, signal.SIGTERM), process)
            time.sleep(longer * life * (moment + chance.random()) / MOMENTS)
            for _ in range(1 + moment % 2):  # who is impatient presses twice
                if process.poll() is None:
                    os.killpg(process.pid, signal.SIGINT)  # as a terminal does
            _, said = process.communicate(timeout=LONGEST)
        assert not re.search("Traceback|Exception", said), said
        found = {path.name for path in folder.iterdir()}
        if process.returncode == 0:
            assert found == complete
        else:
            assert process.returncode == 130, said
            assert found <= complete, found
        assert all(whole(folder / one) for one in found), found
        gone(folder)
        assert temporary(folder) == []


def gone(folder: Path) -> None:
    """Wait for the workers of a sweep, which end after it, and for those who still work among its files."""
    end = time.monotonic() + 30.0
    while left := working_in(folder.parent):
        assert time.monotonic() < end, left
        time.sleep(0.01)


def test_a_terminal_that_is_closed_ends_command_and_ngspice(folder: Path) -> None:
    """By SIGHUP; as SIGTERM does, see test_interrupts.py."""
    words = ["admittance", "andersen2002", "--points", "200000", "--output", "x.csv"]
    with begun(*words, cwd=folder) as process:
        wait_for(lambda: working_in(folder.parent / "tmp"), process)
        process.send_signal(signal.SIGHUP)
        output, said = process.communicate(timeout=LONGEST)
        assert (process.returncode, output) == (129, "")
        assert said == "piezomotor: interrupted; nothing was written.\n"
        assert list(folder.iterdir()) == []
        gone(folder)
        assert temporary(folder) == []


# --- languages ---

# LC_NUMERIC of de_DE.UTF-8 as glibc's localedef writes it: six elements, 1.234,5
COMMA = bytes.fromhex(
    "14110320 06000000 20000000 22000000 24000000 28000000 2c000000 30000000"
    "2c002e00 03030000 2c000000 2e000000 5554462d3800"
)


def test_a_decimal_comma_changes_nothing(folder: Path) -> None:
    place = folder.parent / "locale" / "comma"
    place.mkdir(parents=True)
    (place / "LC_NUMERIC").write_bytes(COMMA)
    commands = [
        [*SIMULATE, "--set", "contact.preload_n=5.5", "--output", "run.csv"],
        ["admittance", "andersen2002", "--points", "20", "--output", "y.csv"],
        ["export", "andersen2002", "--output", "motor.lib"],
    ]
    in_force = "import locale; print(locale.setlocale(locale.LC_NUMERIC, ''), locale.localeconv()['decimal_point'])\n"
    environment = {"LOCPATH": str(place.parent), "LC_ALL": "", "LC_NUMERIC": "comma"}
    words = [sys.executable, "-c", in_force + ALL, json.dumps(commands)]
    status, output, said = command(*words, cwd=folder, shell=True, **environment)
    assert (status, output.splitlines()[0]) == (0, "comma ,"), said
    files = ("run.csv", "y.csv", "motor.lib")
    found = [(folder / name).read_bytes() for name in files]
    assert [run(words) for words in commands] == [0, 0, 0]  # here, with a point
    assert [(folder / name).read_bytes() for name in files] == found


def test_paths_with_spaces_and_any_letters(tmp_path: Path) -> None:
    """For the folder, the files, the temporary files and ngspice itself; one name is not even text."""
    place = tmp_path / "Größe µ – 電機 'α' $HOME"
    for name in ("tmp dir", "bin dir"):
        (place / name).mkdir(parents=True)
    real = subprocess.run(["sh", "-c", "command -v ngspice"], capture_output=True, text=True, check=True).stdout.strip()
    (place / "bin dir" / "ngspice").symlink_to(real)
    motor = "mein Motor ü.toml"
    pr.export_motor(pr.load_motor("andersen2002"), place / motor)
    odd = os.fsdecode(b"not text \xff.json")
    commands = [
        ["simulate", motor, "--duration", "2e-4", "--output", "Lauf 1 – ω.csv", "--plot", "Bild µ.png"],
        ["simulate", motor, "--duration", "2e-4", "--output", "Lauf 2.nc"],
        ["sweep", motor, "--duration", "2e-4", "--over", "drive.voltage=10,20", "--store", "Ablage é", "--workers", "1",
         "--output", "Reihe ß.nc"],
        ["admittance", motor, "--points", "300", "--output", "Y ½.csv"],
        ["show", motor, "--output", odd],
        ["export", motor, "--output", "Motor å.kicad_sym"],
    ]  # fmt: skip
    path = f"{place / 'bin dir'}{os.pathsep}{os.environ['PATH']}"
    words = [sys.executable, "-c", ALL, json.dumps(commands)]
    status, _, said = command(*words, cwd=place, shell=True, TMPDIR=str(place / "tmp dir"), PATH=path)
    assert status == 0, said
    for target in (one[one.index("--output") + 1] for one in commands):
        assert (place / target).stat().st_size > 0, target
    assert list((place / "tmp dir").iterdir()) == []
