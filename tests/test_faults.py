# SPDX-License-Identifier: GPL-3.0-or-later
"""Faults around the command, as a user meets them: real processes, real files, real limits.

docs/accuracy.md counts the faults. ``make test`` has one case of each class of fault,
``make soak`` has every command.
"""

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
from tests.processes import (
    LONGEST,
    ROOT,
    START,
    begun,
    command,
    gone,
    handles,
    simulators_in,
    wait_for,
    with_mounts,
    working_in,
)
from tests.said import refusal
from tests.selection import mostly

RUNS = {  # the commands that run ngspice, with the shortest possible runs
    "simulate": ["andersen2002", "--duration", "2e-4", "--step", "2e-7"],  # one run: no error is estimated
    "admittance": ["andersen2002", "--points", "20"],
    "speed-torque": ["andersen2002", "--speeds=0", "--patience", "4"],
    "sweep": ["andersen2002", "--over", "drive.voltage=10", "--duration", "2e-4", "--store", "store", "--workers", "1"],
    "drive": ["andersen2002", "--duration", "3e-4"],
    "track": ["andersen2002"],
    "report": ["andersen2002", "--output", "report.html"],
    "export": ["andersen2002", "--output", "motor.s2p"],
    "steady": ["bimodal40"],
    "map": ["bimodal40", "--over", "drive.voltage=100:150:2"],
}
SIMULATE = ["simulate", *RUNS["simulate"]]
SWEEP = ["sweep", "andersen2002", "--over", "drive.voltage=10:40:4", "--duration", "2e-4", "--store", "../store"]
# run a list of commands one after the other; the exit status is the largest of theirs
ALL = (
    "import json, sys; from pyspice_runner.cli import run; sys.exit(max([run(one) for one in json.loads(sys.argv[1])]))"
)
MOMENTS = int(os.environ.get("PIEZOMOTOR_MOMENTS", "2"))  # at which Ctrl-C is pressed while a command runs
TABLE = "energy residual"  # in the table of simulate, not in its JSON


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working folder of the command, with an empty folder beside it for temporary files."""
    for name in ("work", "tmp", "bin"):
        (tmp_path / name).mkdir()
    monkeypatch.chdir(tmp_path / "work")
    monkeypatch.setenv("TMPDIR", str(tmp_path / "tmp"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "tmp"))
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    return tmp_path / "work"


@pytest.fixture
def ngspice(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Install an ngspice that runs shell words in the folder of its deck before the real one."""
    real = subprocess.run(["sh", "-c", "command -v ngspice"], capture_output=True, text=True, check=True).stdout.strip()

    def install(words: str, version: str = f"exec {real} --version") -> None:
        script = folder.parent / "bin" / "ngspice"
        script.write_text(f'#!/bin/sh\nif [ "$1" = --version ]; then {version}; exit; fi\n{words}\nexec {real} "$@"\n')
        script.chmod(0o755)
        monkeypatch.setenv("PATH", f"{script.parent}{os.pathsep}{os.environ['PATH']}")

    return install


def temporary(folder: Path) -> list[str]:
    """The temporary files that are left, except for the netlist of a failed run, which the message names."""
    return [path.name for path in (folder.parent / "tmp").iterdir() if not (path / "deck.cir").exists()]


# --- ngspice ---


@pytest.mark.parametrize("name", mostly(pytest.mark.soak, RUNS, ["simulate"]))
def test_a_missing_ngspice_is_reported(
    name: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("PATH", str(folder))
    monkeypatch.setenv("PIEZOMOTOR_ENGINE", "native")
    assert run([name, *RUNS[name]]) == 3
    assert "piezomotor: ngspice is not on the PATH. Install it: `sudo apt-get" in capsys.readouterr().err
    assert list(folder.iterdir()) == []


def test_a_killed_version_query_is_not_a_missing_program(
    ngspice: Callable[..., None], capsys: pytest.CaptureFixture[str]
) -> None:
    ngspice("", version="kill -9 $$")
    said = refusal(SIMULATE, capsys, 3)
    assert "ngspice --version` was killed by signal 9 (Killed). Try again." in said
    assert "Install" not in said


def test_an_old_ngspice_is_rejected(ngspice: Callable[..., None], capsys: pytest.CaptureFixture[str]) -> None:
    ngspice("", version="echo '** ngspice-34 : Circuit level simulation program'")
    assert run(SIMULATE) == 3
    assert capsys.readouterr() == ("", "piezomotor: ngspice 34 is too old; version 36 or later is needed.\n")


@pytest.mark.parametrize("name", mostly(pytest.mark.soak, RUNS, ["admittance", "sweep", "steady", "map"]))
def test_a_killed_ngspice_is_reported(
    name: str, folder: Path, ngspice: Callable[..., None], capsys: pytest.CaptureFixture[str]
) -> None:
    ngspice("kill -9 $$")
    said = refusal([name, *RUNS[name]], capsys, 3)
    assert "ngspice was killed by signal 9 (Killed), as the system does when memory runs out" in said
    assert [path.name for path in folder.iterdir()] == (["store"] if name == "sweep" else [])
    assert temporary(folder) == []


COMPLAINT = "fatal: there is no licence"


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("steady", []),
        ("speed-torque", ["--speeds=0"]),
        ("drive", ["--rail", "24", "--stage", "full-bridge", "--speed", "20"]),
        ("calibrate", ["--points", "points.csv", "--free", "contact.friction"]),
        ("calibrate", ["--transient", "run_up.csv", "--free", "contact.friction"]),
    ],
)
def test_the_words_of_an_ngspice_that_only_complains_are_reported(
    name: str, words: list[str], folder: Path, ngspice: Callable[..., None], capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "points.csv").write_text("speed_rad_s,torque_n_m\n0,0.06\n20,0.055\n", encoding="utf-8")
    rows = "".join(f"{1e-3 * number:g},{3.0 * number:g}\n" for number in range(9))
    (folder / "run_up.csv").write_text(f"time_s,speed_rad_s\n{rows}", encoding="utf-8")
    ngspice(f"echo '{COMPLAINT}' >&2; exit 1")
    assert COMPLAINT in refusal([name, "bimodal40", *words], capsys, 3)


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["simulate", "--averaged", "--duration", "20e-3"], "against the full motor is not known: "),
        (["live"], "The page has no first picture: "),
    ],
    ids=["averaged", "live"],
)
def test_what_needs_no_ngspice_says_what_its_failure_leaves_out(
    words: list[str], says: str, ngspice: Callable[..., None], capsys: pytest.CaptureFixture[str]
) -> None:
    ngspice(f"echo '{COMPLAINT}' >&2; exit 1")
    assert run([words[0], "bimodal40", *words[1:]]) == 0
    said = capsys.readouterr().err
    assert says in said
    assert COMPLAINT in said


@pytest.mark.parametrize(
    ("number", "timeout", "says"),
    [
        (signal.SIGKILL, 60, "ngspice was killed by signal 9 (Killed)"),
        (signal.SIGSTOP, 2, "ngspice did not finish within 2 s and was stopped."),
    ],
)
def test_a_run_whose_ngspice_is_killed_or_hangs_is_reported(
    number: signal.Signals, timeout: int, says: str, folder: Path
) -> None:
    # one run: a given step has no estimated error, for which two more runs would go on
    words = ["simulate", "andersen2002", "--duration", "2", "--step", "2e-7", "--timeout", str(timeout)]
    with begun(*words, cwd=folder) as process:
        at_work: list[int] = []
        wait_for(lambda: at_work.extend(simulators_in(folder.parent / "tmp")) or at_work, process)
        os.kill(at_work[0], number)
        output, said = process.communicate(timeout=LONGEST)
    assert (process.returncode, output) == (3, "")
    assert says in said
    assert working_in(folder.parent / "tmp") == []
    assert temporary(folder) == []


def test_lack_of_memory_for_ngspice_is_reported(
    folder: Path, ngspice: Callable[..., None], capsys: pytest.CaptureFixture[str]
) -> None:
    ngspice("ulimit -v 8000")  # kB
    assert run(SIMULATE) == 3
    assert re.search(
        r"ngspice (ended with status|was killed by signal) .*The netlist is kept as", capsys.readouterr().err
    )
    assert temporary(folder) == []


@pytest.mark.soak
def test_lack_of_memory_for_the_command_is_reported(folder: Path) -> None:
    """The same command twice in one process; the second time, when all is loaded, memory is limited."""
    script = """
import resource, sys
from pathlib import Path
from pyspice_runner.cli import run
words = ["simulate", "andersen2002", "--duration", "4e-3", "--step", "2e-7"]
assert run([*words, "--json"]) == 0
used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + 1_000_000, -1))
sys.exit(run(words))
"""
    status, output, said = command(sys.executable, "-c", script, cwd=folder, shell=True)
    assert status == 3
    assert TABLE not in output
    assert re.fullmatch(r"piezomotor: Out of memory\. Free some memory, shorten the run, or record less .*\n", said)
    assert temporary(folder) == []


# --- one failure among many runs ---


def test_the_finished_one_of_two_drivers_is_delivered(
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


@pytest.mark.soak
def test_a_curve_keeps_its_finished_points(
    folder: Path, ngspice: Callable[..., None], capsys: pytest.CaptureFixture[str]
) -> None:
    ngspice("grep -q 'copies of\\|set 0 .*2.5' deck.cir && kill -9 $$")  # Newton's method, and the settling of a point
    words = ["speed-torque", "andersen2002", "--speeds=0,2.5", "--patience", "4", "--output", "curve.nc"]
    assert run([*words, "--json"]) == 3
    output, said = capsys.readouterr()
    assert "ngspice was killed by signal 9" in said
    assert re.search(r"^piezomotor: 1 of 2 points are finished\.$", said, re.M)
    with xarray.open_dataset(folder / "curve.nc", engine="h5netcdf") as curve:
        assert curve["torque_n_m"].notnull().values.tolist() == [True, False]
        assert "1 of 2 points are finished." in curve.attrs["incomplete"]
    assert json.loads(output)["torque_n_m"][1] is None


@pytest.mark.soak
def test_a_report_keeps_its_finished_parts(
    folder: Path, ngspice: Callable[..., None], capsys: pytest.CaptureFixture[str]
) -> None:
    ngspice("grep -q 'copies of\\|piezomotor_dynamometer' deck.cir && kill -9 $$")  # all of the speed-torque curve
    assert run(["report", "andersen2002", "--duration", "5e-4", "--speeds=0,1"]) == 3
    kept = re.search(r"ngspice was killed .* What was finished is kept in (.*)\.\n", capsys.readouterr().err)
    assert kept
    assert {path.name for path in Path(kept[1]).iterdir()} == {
        "admittance_free.csv", "admittance_preloaded.csv", "run.nc"
    }  # fmt: skip
    assert list(folder.iterdir()) == []


def test_a_report_without_plotly_is_rejected_before_its_runs(
    ngspice: Callable[..., None], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    ngspice("kill -9 $$")
    find = importlib.util.find_spec
    monkeypatch.setattr(
        "pyspice_runner.commands.pages.find_spec", lambda name: None if name == "plotly" else find(name)
    )
    assert "A report needs plotly. Install it:" in refusal(["report", "andersen2002"], capsys)


# --- disks ---


def on_a_disk_of(kilobytes: int, folder: Path) -> tuple[list[str], str]:
    """A command that runs another on a small disk and then copies the files to ``seen``; and the error of a full disk.

    Where nothing may be mounted, a limit of the file size replaces it.
    """
    here, seen = shlex.quote(str(folder)), shlex.quote(str(folder.parent / "seen"))
    inside = f'cd {here} && echo old >run.nc && "$@"; status=$?; cp -a . {seen}; exit $status'
    mounted = with_mounts(f"mount -t tmpfs -o size={kilobytes}k none {here} && {inside}")
    tried = subprocess.run([*mounted, "true"], capture_output=True, text=True, check=False)
    if tried.returncode == 0:
        subprocess.run(["rm", "-r", folder.parent / "seen"], check=True)
        return mounted, "No space left on device"
    assert not may_mount(), f"This process may mount, but no disk was mounted: {tried.stderr}"
    # a module compiled under the limit would be left truncated
    return ["bash", "-c", f"export PYTHONDONTWRITEBYTECODE=1; ulimit -f {kilobytes}; {inside}", "sh"], "File too large"


def may_mount() -> bool:
    """Whether this process is root's and has the capability to mount, CAP_SYS_ADMIN, by what /proc says."""
    effective = re.search(r"^CapEff:\s*(\w+)$", Path("/proc/self/status").read_text(encoding="ascii"), re.M)
    return os.geteuid() == 0 and effective is not None and bool(int(effective[1], 16) >> 21 & 1)


@pytest.mark.soak
def test_a_full_disk_loses_no_result(folder: Path) -> None:
    """Neither the new result, nor an older file of that name, nor the points of a sweep."""
    disk, full = on_a_disk_of(16, folder)
    if full == "File too large":  # everywhere, so that a result cannot be kept elsewhere
        pytest.skip("this process may not mount: it has no CAP_SYS_ADMIN, and the system allows no user namespace")
    commands = [
        [*SIMULATE, "--output", "run.nc", "--plot", "run.png"],
        [*SWEEP, "--workers", "1", "--output", "../full.nc"],
        [*SWEEP[:-2], "--workers", "1", "--store", "store"],
    ]
    (folder.parent / "full.nc").symlink_to("/dev/full")
    words = [*disk, sys.executable, "-c", ALL, json.dumps(commands)]
    status, output, said = command(*words, cwd=folder, shell=True)
    assert status == 2, said
    run_said, *lines = said.splitlines()
    (sweep_said,) = (line for line in lines if "full.nc" in line)
    # a run and its plot
    assert TABLE in output
    kept = re.fullmatch(
        f"piezomotor: Cannot write run.nc: {full}. Cannot write run.png: {full}. It is kept in (.*).", run_said
    )
    assert kept, said
    with xarray.open_dataset(Path(kept[1], "run.nc"), engine="h5netcdf") as waves:
        assert re.search(rf"points +│ {waves.sizes['time_s']} ", output)
    assert whole(Path(kept[1], "run.png"))
    seen = folder.parent / "seen"
    assert sorted(path.name for path in seen.iterdir()) == ["run.nc", "store"]
    assert (seen / "run.nc").read_text(encoding="utf-8") == "old\n"
    # a sweep whose points are stored elsewhere
    assert "4 points" in output
    assert "piezomotor: 4 of 4 points are not settled; see 'settled'." in lines
    assert "piezomotor: 2 of 4 points are not accurate; see 'accurate'." in lines
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
    assert sum("Cannot write" in line for line in lines) == 2
    assert lines[-1:] == [f"piezomotor: Cannot write the store store: {full}. Free it, or choose another folder."]
    assert 0 < len(stored) < 4


def test_a_full_disk_of_temporary_files_is_reported(folder: Path) -> None:
    disk, full = on_a_disk_of(64, folder)
    words = ["env", "TMPDIR=.", sys.executable, "-m", "pyspice_runner", *SIMULATE]
    status, output, said = command(*disk, *words, cwd=folder, shell=True)
    assert (status, output) == (3, "")
    if full == "No space left on device":
        assert re.search(r"The disk of \S+ is full\. Free some space or set TMPDIR\.", said)
    else:
        assert "File size limit exceeded" in said


SPECTRUM = str(ROOT / "tests/data/spectra/plain.csv")


UNWRITTEN = {
    "show": ["andersen2002"],
    "admittance": RUNS["admittance"],
    "speed-torque": RUNS["speed-torque"],
    "drive": [*RUNS["drive"], "--driver", "ideal"],
    "fit": [SPECTRUM],
    "compare": [SPECTRUM, SPECTRUM],
}


@pytest.mark.parametrize("name", mostly(pytest.mark.soak, UNWRITTEN, ["admittance"]))
def test_a_command_prints_and_keeps_a_result_that_it_cannot_write(
    name: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The commands that have no test of their own above."""
    (folder / "x.json").symlink_to("/dev/full")
    assert run([name, *UNWRITTEN[name], "--json", "--output", "x.json", "--plot", "x.png"]) == 2
    output, said = capsys.readouterr()
    assert isinstance(json.loads(output), dict)
    kept = re.search(r"piezomotor: Cannot write x\.json: No space left on device\. It is kept in (.*)\.\n", said)
    assert kept, said
    assert isinstance(json.loads(Path(kept[1], "x.json").read_text(encoding="utf-8")), dict)
    assert whole(folder / "x.png")


def test_a_result_is_kept_when_standard_output_is_full(folder: Path) -> None:
    words = f"{shlex.join([*START, *SIMULATE])} --json >/dev/full"
    status, _, said = command("bash", "-c", words, cwd=folder, shell=True)
    kept = re.fullmatch(
        r"piezomotor: Cannot write the standard output: No space left on device. It is kept in (.*).\n", said
    )
    assert (status, kept is not None) == (2, True), said
    assert json.loads(Path(kept[1], "result.json").read_text(encoding="utf-8"))["complete"] is True  # type: ignore[index]


TARGETS = [
    *([name, *words, *([] if "--output" in words else ["--output", "x.json"])] for name, words in RUNS.items()),
    ["show", "andersen2002", "--plot", "x.png"],
    ["motors", "--output", "x.csv"],
    ["fit", SPECTRUM, "--output", "x.json"],
    ["report", "andersen2002"],
]


def test_a_read_only_folder_is_rejected_before_any_run(folder: Path) -> None:
    """A read-only folder, for every command, with an ngspice that would tell of a run."""
    (folder.parent / "bin" / "ngspice").write_text("#!/bin/sh\ntouch $MARK\n")
    (folder.parent / "bin" / "ngspice").chmod(0o755)
    words = [sys.executable, "-c", ALL, json.dumps(TARGETS)]
    if os.geteuid() == 0:  # permissions do not stop root, except without these two capabilities
        words = ["setpriv", "--bounding-set=-dac_override,-dac_read_search", *words]
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


def test_a_link_that_leads_nowhere_is_rejected_before_any_run(
    folder: Path, ngspice: Callable[..., None], capsys: pytest.CaptureFixture[str]
) -> None:
    ngspice("kill -9 $$")
    (folder / "x.json").symlink_to("missing/y.json")
    assert run([*SIMULATE, "--output", "x.json"]) == 2
    reason = "it is in a folder that does not exist"
    assert capsys.readouterr().err == f"piezomotor: Cannot write x.json: {reason}. Choose another place.\n"


@pytest.mark.parametrize("name", ["in.csv", "symbolic.csv", "hard.csv"])
@pytest.mark.parametrize("words", [["fit", "in.csv"], ["compare", "in.csv", SPECTRUM], ["compare", SPECTRUM, "in.csv"]])
def test_an_input_file_is_never_overwritten(
    words: list[str], name: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    content = Path(SPECTRUM).read_bytes()
    (folder / "in.csv").write_bytes(content)
    (folder / "symbolic.csv").symlink_to("in.csv")
    (folder / "hard.csv").hardlink_to("in.csv")
    assert run([*words, "--output", name]) == 2
    assert f"{name} is an input file, and writing would replace it. Choose another" in capsys.readouterr().err
    assert (folder / "in.csv").read_bytes() == content


def test_an_export_does_not_overwrite_its_motor(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["export", "andersen2002", "--output", "mine.toml"]) == 0
    content = (folder / "mine.toml").read_bytes()
    assert run(["export", "mine.toml", "--set", "contact.preload_n=8", "--output", "mine.toml"]) == 2
    assert "mine.toml is an input file" in capsys.readouterr().err
    assert (folder / "mine.toml").read_bytes() == content


def test_too_many_open_files_are_named(folder: Path) -> None:
    words = f"ulimit -n 16; {shlex.join([*START, *SWEEP, '--workers', '4'])}"
    status, output, said = command("bash", "-c", words, cwd=folder, shell=True)
    assert (status, output) == (2, "")
    assert said == "piezomotor: Too many files are open. Raise the limit, as by `ulimit -n 1024`.\n"


def test_a_missing_folder_for_temporary_files_is_reported(folder: Path) -> None:
    lock = "mount --bind $place $place && mount -o remount,ro,bind $place"
    mounts = f"for place in /tmp /var/tmp /usr/tmp .; do [ ! -d $place ] || {{ {lock}; }} || exit; done"
    locked = with_mounts(f'{mounts}; cd "$PWD"; exec "$@"')
    words = [*locked, sys.executable, "-m", "pyspice_runner", *SIMULATE]
    if subprocess.run([*locked, "true"], capture_output=True, check=False).returncode != 0:
        # without mounts, /proc serves as a folder that is not writable
        start = "import sys, tempfile; tempfile._candidate_tempdir_list = lambda: ['/proc']\n"
        words = [sys.executable, "-c", f"{start}from pyspice_runner.cli import run; sys.exit(run({SIMULATE!r}))"]
    status, output, said = command(*words, cwd=folder, shell=True)
    assert (status, output) == (3, "")
    assert re.match(r"piezomotor: Cannot write the netlist: No usable temporary directory found in .*TMPDIR\.\n", said)


def test_an_existing_output_is_replaced_whole_and_keeps_its_link_and_permissions(folder: Path) -> None:
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
def test_a_closed_pipe_is_no_failure(words: list[str], folder: Path) -> None:
    shell = f"set -o pipefail; {shlex.join([*START, *words])} | true"
    assert command("bash", "-c", shell, cwd=folder, shell=True) == (0, "", "")
    assert (folder / "run.csv").exists() == ("--output" in words)


def test_closed_streams_and_ascii_streams_are_no_failure(folder: Path) -> None:
    shell = f"{shlex.join([*START, *SIMULATE])} --output run.csv >&- 2>&-"
    assert command("bash", "-c", shell, cwd=folder, shell=True)[0] == 0
    assert whole(folder / "run.csv")
    status, output, _ = command("show", "andersen2002", cwd=folder, PYTHONIOENCODING="ascii")
    assert status == 0
    assert "rotor.inertia_kg_m2" in output


# --- Ctrl-C ---


def whole(path: Path) -> bool:
    """Whether a file is complete."""
    content = path.read_bytes()
    if path.suffix == ".nc":
        with xarray.open_dataset(path, engine="h5netcdf") as dataset:
            return bool(dataset.load().attrs)
    ends = {".csv": b"\n", ".png": b"IEND\xaeB`\x82", ".html": b"</html>", ".json": b"}\n"}
    return content.rstrip(b"\n" if path.suffix == ".html" else b"").endswith(ends[path.suffix])


def test_ctrl_c_between_two_files_keeps_the_first_and_prints_the_result(folder: Path) -> None:
    os.mkfifo("run.png")  # no process reads it, so that the command waits there
    with begun(*SIMULATE, "--json", "--output", "run.csv", "--plot", "run.png", cwd=folder) as process:
        wait_for(lambda: (folder / "run.csv").exists(), process)
        process.send_signal(signal.SIGINT)
        output, said = process.communicate(timeout=LONGEST)
    assert (process.returncode, said) == (130, "piezomotor: interrupted; run.csv is complete.\n")
    assert json.loads(output)["points"] + 1 == len((folder / "run.csv").read_text(encoding="utf-8").splitlines())
    assert temporary(folder) == []


LIVES = {  # command, duration relative to that of a simulate, and the files that it writes
    "simulate": ([*SIMULATE, "--output", "run.csv", "--plot", "run.png"], 1.5, {"run.csv", "run.png"}),
    "sweep": ([*SWEEP, "--workers", "2", "--output", "sweep.nc"], 2.5, {"sweep.nc"}),
    "report": (
        ["report", "andersen2002", "--duration", "3e-4", "--speeds=0", "--levels", "1"], 2.5, {"andersen2002.html"}
    ),
}  # fmt: skip


@pytest.fixture(scope="module")
def life(tmp_path_factory: pytest.TempPathFactory) -> float:
    """Duration of a simulate on this machine, s."""
    began = time.monotonic()
    assert command(*SIMULATE, cwd=tmp_path_factory.mktemp("life"))[0] == 0
    return time.monotonic() - began


@pytest.mark.parametrize("name", mostly(pytest.mark.soak, LIVES, ["sweep"]))
def test_ctrl_c_at_any_moment(name: str, life: float, folder: Path) -> None:
    """From the first line of the package on; before it, Python itself starts."""
    words, longer, complete = LIVES[name]
    chance = random.Random(f"{name} 1")
    for moment in range(MOMENTS):
        for path in folder.iterdir():
            path.unlink()
        with begun(*words, cwd=folder) as process:
            wait_for(lambda: handles(process, signal.SIGTERM), process)
            time.sleep(longer * life * (moment + chance.random()) / MOMENTS)
            for _ in range(1 + moment % 2):  # every second time, press twice
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
        gone(folder.parent)
        assert temporary(folder) == []


def test_sighup_ends_the_command_and_ngspice(folder: Path) -> None:
    """As when a terminal is closed."""
    words = ["admittance", "andersen2002", "--points", "200000", "--output", "x.csv"]
    with begun(*words, cwd=folder) as process:
        wait_for(lambda: working_in(folder.parent / "tmp"), process)
        process.send_signal(signal.SIGHUP)
        output, said = process.communicate(timeout=LONGEST)
        assert (process.returncode, output) == (129, "")
        assert said == "piezomotor: interrupted; nothing was written.\n"
        assert list(folder.iterdir()) == []
        gone(folder.parent)
        assert temporary(folder) == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("name", ["simulate", "speed-torque", "sweep"])
def test_the_exit_status_tells_which_signal_came(
    name: str, number: signal.Signals, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where an analysis raises an interrupt of its own, with what it has finished."""

    def interrupted(*_: object, **__: object) -> None:
        try:
            signal.raise_signal(number)
        except KeyboardInterrupt:
            raise KeyboardInterrupt from None

    monkeypatch.setattr(pr, name.replace("-", "_"), interrupted)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        assert run([name, *RUNS[name]]) == 128 + number
    finally:
        signal.signal(signal.SIGINT, before)
    assert list(folder.iterdir()) == []


# --- languages ---

# LC_NUMERIC of de_DE.UTF-8 as glibc's localedef writes it: six elements, 1.234,5
COMMA = bytes.fromhex(
    "14110320 06000000 20000000 22000000 24000000 28000000 2c000000 30000000"
    "2c002e00 03030000 2c000000 2e000000 5554462d3800"
)


def test_a_locale_with_decimal_commas_changes_no_file(folder: Path) -> None:
    place = folder.parent / "locale" / "comma"
    place.mkdir(parents=True)
    (place / "LC_NUMERIC").write_bytes(COMMA)
    commands = [
        [*SIMULATE, "--set", "contact.preload_n=5.5", "--output", "run.csv"],
        ["export", "andersen2002", "--output", "motor.lib"],
    ]
    in_force = "import locale; print(locale.setlocale(locale.LC_NUMERIC, ''), locale.localeconv()['decimal_point'])\n"
    environment = {"LOCPATH": str(place.parent), "LC_ALL": "", "LC_NUMERIC": "comma"}
    words = [sys.executable, "-c", in_force + ALL, json.dumps(commands)]
    status, output, said = command(*words, cwd=folder, shell=True, **environment)
    assert (status, output.splitlines()[0]) == (0, "comma ,"), said
    files = ("run.csv", "motor.lib")
    found = [(folder / name).read_bytes() for name in files]
    assert [run(words) for words in commands] == [0, 0]  # in this process, with a point
    assert [(folder / name).read_bytes() for name in files] == found


@pytest.mark.soak
def test_paths_may_hold_spaces_and_any_characters(tmp_path: Path) -> None:
    """The paths of the folder, the files, the temporary files and ngspice; one name is not valid text."""
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
        ["sweep", motor, "--duration", "2e-4", "--over", "drive.voltage=10,20", "--store", "Ablage é", "--workers", "1",
         "--output", "Reihe ß.nc"],
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


def test_a_matplotlibrc_with_tex_in_the_working_folder_changes_no_plot(folder: Path) -> None:
    words = ["-m", "pyspice_runner", "show", "bimodal40", "--plot"]
    assert command(sys.executable, *words, "plain.png", cwd=folder, shell=True)[0] == 0
    (folder / "matplotlibrc").write_text("text.usetex: True\n", encoding="utf-8")
    status, _, said = command(sys.executable, *words, "tex.png", cwd=folder, shell=True)
    assert (status, (folder / "tex.png").read_bytes() == (folder / "plain.png").read_bytes()) == (0, True), said
