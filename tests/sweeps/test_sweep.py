# SPDX-License-Identifier: GPL-3.0-or-later
"""Sweeps: each result is at its place, and failures, kills and interrupts lose none."""

import contextlib
import json
import os
import random
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import AbstractContextManager
from multiprocessing import get_context
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np
import pytest
import xarray

import pyspice_runner as pr
from pyspice_runner.cli import run
from pyspice_runner.steady.speed_torque import held_point
from pyspice_runner.sweeps.plan import named
from pyspice_runner.sweeps.sweep import met
from pyspice_runner.sweeps.task import Task, versions_here
from tests import points, processes

DRIVE = pr.TwoPhaseDrive(voltage=50.0, frequency=51.7e3, phase_deg=90.0)
MOTOR = pr.load_motor("andersen2002")
NOMINAL = MOTOR.contact
AT_SPEED = ["sweep", "andersen2002", "--speed", "1"]
COMMAND = [*AT_SPEED, "--duration", "5e-5"]
ALONE = ["--workers", "1"]  # where a second process would show no more and takes a second to load


@pytest.fixture(scope="module")
def threads() -> Iterator[Executor]:
    with ThreadPoolExecutor(2) as pool:
        yield pool


@pytest.fixture
def quick(threads: Executor, tmp_path: Path) -> dict[str, Any]:
    """Settings of a sweep whose points take no time."""
    return {
        "analysis": points.formula,
        "quantities": ["torque_n_m"],
        "executor": threads,
        "store": tmp_path / "store",
        "duration": 1.0,
    }


# --- the right numbers at the right places ---


def test_a_point_may_be_an_operating_point(threads: Executor, tmp_path: Path) -> None:
    names = ["torque_n_m", "efficiency", "settled"]
    found = pr.sweep(
        MOTOR, DRIVE, over={"run.speed": [0.2]}, analysis=held_point, quantities=names,
        executor=threads, store=tmp_path, patience=4, tolerance=0.1,
    )  # fmt: skip
    alone = held_point(MOTOR, DRIVE, speed=0.2, patience=4, tolerance=0.1)
    assert [found[name].item() for name in names] == [alone[name] for name in names]


def test_operating_points_are_solved_together(tmp_path: Path) -> None:
    def alone(*_: object) -> None:
        raise AssertionError("a point was given to a worker")

    over = {"run.speed": [0.2, 0.4], "contact.friction": [0.28, 0.3]}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("pyspice_runner.sweeps.workers._processes", alone)
        found = pr.sweep(
            MOTOR, DRIVE, over=over, analysis=held_point, quantities=["torque_n_m", "settled"], store=tmp_path
        )
    assert found["settled"].values.all()
    assert len(set(found["torque_n_m"].values.ravel().tolist())) == 4
    one = held_point(MOTOR.updated({"contact.friction": 0.28}), DRIVE, speed=0.4)
    # 0.2 %: the accuracy of a steady state, which another start reaches by another way
    friction_torque = MOTOR.contact.friction * MOTOR.contact.preload_n * MOTOR.rotor.radius_m
    at = found.sel({"run.speed": 0.4, "contact.friction": 0.28})
    assert at["torque_n_m"].item() == pytest.approx(one["torque_n_m"], abs=2e-3 * friction_torque)


def test_the_result_has_units_and_provenance(quick: dict[str, Any]) -> None:
    over = {"modes.1.frequency_hz": [51e3, 52e3], "drive.frequency": [5e4], "run.speed": [1.0, 2.0, 3.0]}
    found = pr.sweep(MOTOR, DRIVE, over=over, **quick | {"quantities": ["torque_n_m", "shares.slip", "duration_s"]})
    units = {name: found[name].attrs["units"] for name in (*over, "torque_n_m", "shares.slip", "duration_s")}
    assert list(units.values()) == ["Hz", "Hz", "rad/s", "N·m", "1", "s"]
    assert found["drive.frequency"].attrs["long_name"] == "frequency f"
    assert found.attrs["parameter_set"] == "andersen2002"
    assert json.loads(found.attrs["motor"]) == MOTOR.to_dict()
    assert json.loads(found.attrs["drive"])["kind"] == "TwoPhaseDrive"
    assert json.loads(found.attrs["run"]) == {"duration": 1.0}
    assert found.attrs["pyspice_runner_version"] == pr.__version__
    assert int(found.attrs["ngspice_version"].split(".")[0]) >= 36
    assert len(found.attrs["deck_sha256"]) == 64


def test_quantities_may_be_renamed_or_be_functions_of_the_user(quick: dict[str, Any]) -> None:
    names = {"torque": "torque_n_m", "power_w": points.power, "settled": "settled"}
    found = pr.sweep(MOTOR, DRIVE, over={"contact.preload_n": [3.0, 6.0]}, **quick | {"quantities": names})
    assert list(found.data_vars) == [*names, "failure", "deck_sha256"]
    assert found["power_w"].values == pytest.approx(2.0 * found["torque"].values)
    assert found["power_w"].attrs["units"] == "W"
    assert found["settled"].values.tolist() == [1.0, 1.0]


def test_netcdf_is_read_back_unchanged(quick: dict[str, Any], tmp_path: Path) -> None:
    over = {"run.speed": [0.0, 5.0], "modes.*.tip_y": pr.Tolerance(0.1), "contact.friction": pr.Tolerance(0.1)}
    found = pr.sweep(MOTOR, DRIVE, over=over, samples=4, **quick)
    found.to_netcdf(tmp_path / "sweep.nc", engine="h5netcdf")
    with xarray.open_dataset(tmp_path / "sweep.nc", engine="h5netcdf") as back:
        assert back.load().identical(found)


# --- tolerances ---


def test_samples_fill_their_tolerances_evenly(quick: dict[str, Any]) -> None:
    over = {"contact.friction": pr.Tolerance(0.1), "contact.preload_n": pr.Tolerance(0.3)}
    for sampling in ("sobol", "latin-hypercube"):
        found = pr.sweep(MOTOR, DRIVE, over=over, samples=64, sampling=sampling, **quick)
        assert found["torque_n_m"].dims == ("sample",)
        for path, nominal in (("contact.friction", NOMINAL.friction), ("contact.preload_n", NOMINAL.preload_n)):
            tolerance = found[path].attrs["tolerance"]
            quantiles = (found[path].values / nominal - 1.0 + tolerance) / (2.0 * tolerance)
            assert found[path].attrs["nominal"] == nominal
            counts, _ = np.histogram(quantiles, bins=16, range=(0.0, 1.0))
            assert counts.tolist() == [4] * 16  # more evenly than chance would have it
        product = found["contact.friction"] * found["contact.preload_n"] * MOTOR.rotor.radius_m
        assert found["torque_n_m"].values == pytest.approx(product.values)


def test_a_normal_tolerance_is_three_standard_deviations(quick: dict[str, Any]) -> None:
    over = {"contact.friction": pr.Tolerance(0.15, "normal")}
    found = pr.sweep(MOTOR, DRIVE, over=over, samples=256, **quick)
    relative = found["contact.friction"].values / NOMINAL.friction - 1.0
    assert relative.std() == pytest.approx(0.05, rel=0.02)
    assert relative.mean() == pytest.approx(0.0, abs=1e-3)
    assert found["contact.friction"].attrs["distribution"] == "normal"


def test_the_seed_determines_the_samples(quick: dict[str, Any]) -> None:
    first, again, other = (
        pr.sweep(MOTOR, DRIVE, over={"contact.friction": pr.Tolerance(0.1)}, samples=8, seed=seed, **quick)
        for seed in (1, 1, 2)
    )
    xarray.testing.assert_identical(first, again)
    assert not set(first["contact.friction"].values) & set(other["contact.friction"].values)


def test_a_star_changes_all_modes_by_one_factor(quick: dict[str, Any]) -> None:
    path = "modes.*.coupling_a_n_per_v"
    names = [f"motor.modes.{mode}.coupling_a_n_per_v" for mode in (0, 1)]
    found = pr.sweep(MOTOR, DRIVE, over={path: pr.Tolerance(0.2)}, samples=4, **quick | {"quantities": names})
    for mode, name in zip(MOTOR.modes, names, strict=True):
        assert found[name].values == pytest.approx(mode.coupling_a_n_per_v * found[path].values)
    assert found[path].attrs["units"] == "1"


def test_tolerances_and_a_grid_may_be_combined(quick: dict[str, Any]) -> None:
    over = {"contact.friction": pr.Tolerance(0.1), "run.speed": [0.0, 2.0, 4.0]}
    found = pr.sweep(MOTOR, DRIVE, over=over, samples=8, **quick)
    torque = found["torque_n_m"]
    assert torque.dims == ("run.speed", "sample")
    expected = found["contact.friction"] * NOMINAL.preload_n * MOTOR.rotor.radius_m * (1 - 0.1 * found["run.speed"])
    assert torque.values == pytest.approx(expected.transpose("run.speed", "sample").values)
    assert torque.quantile([0.05, 0.95], dim="sample").shape == (2, 3)


# --- nothing is computed twice ---


def heard(**how: Any) -> tuple[xarray.Dataset, list[tuple[int, int]]]:
    """Sweep; return the result and the calls of the progress function."""
    said: list[tuple[int, int]] = []
    found = pr.sweep(MOTOR, DRIVE, progress=lambda done, total: said.append((done, total)), **how)
    return found, said


def test_the_yield_is_the_share_of_points_within_all_limits_with_wilsons_interval() -> None:
    """8 of 10: 0.4902 to 0.9433 (L. D. Brown, T. T. Cai, A. DasGupta, Statistical Science 16, 2001, formula (4))."""
    data = xarray.Dataset({"torque_n_m": ("x", np.arange(10.0)), "power_w": ("x", [1.0] * 9 + [np.nan])})
    found = met(data, {"torque_n_m": (1.0, np.inf), "power_w": (0.0, 2.0)})
    assert (found["good"], found["points"], found["yield"]) == (8, 10, 0.8)
    assert found["each"] == {"torque_n_m": 9, "power_w": 9}
    assert found["interval_95"] == pytest.approx([0.4902, 0.9433], abs=1e-4)
    with pytest.raises(pr.ParameterError, match="speed is no quantity of the sweep"):
        met(data, {"speed": (0.0, 1.0)})


def test_a_part_that_differs_between_the_groups_has_a_tolerance_by_one_factor() -> None:
    driver = pr.Driver(
        kind="linear", voltage=50.0, frequency=51.7e3, network="inductor",
        settings={"inductor_a.inductance": 1e-3, "inductor_b.inductance": 2e-3},
    )  # fmt: skip
    both = named("drive.inductor.inductance", MOTOR, driver, {})
    assert [(one.path, one.nominal) for one in both] == [
        ("drive.inductor_a.inductance", 1e-3),
        ("drive.inductor_b.inductance", 2e-3),
    ]
    equal = driver.updated({"inductor.inductance": 3e-3})
    assert [part.values["inductance"] for group in "ab" for part in equal.parts(group)[1:]] == [3e-3, 3e-3]
    assert [one.path for one in named("drive.inductor.inductance", MOTOR, equal, {})] == ["drive.inductor.inductance"]


def test_a_plot_marks_the_points_that_are_not_settled(quick: dict[str, Any]) -> None:
    dataset = pr.sweep(MOTOR, DRIVE, over={"drive.voltage": [10.0, 20.0, 30.0]}, **quick)
    assert dataset.piezomotor.plot().get_legend() is None
    dataset["settled"].values[1:] = 0.0
    axes = dataset.piezomotor.plot()
    (words,) = axes.get_legend().get_texts()
    assert words.get_text() == "not settled"
    (rings,) = (line for line in axes.get_lines() if line.get_label() == "not settled")
    assert list(rings.get_xdata()) == [20.0, 30.0]
    assert dataset.piezomotor.cautions == ("2 of 3 points are not settled; see 'settled'.",)


def test_a_second_sweep_finds_what_the_first_has_stored(quick: dict[str, Any]) -> None:
    preloads = [1.0, 2.0, 3.0]
    first, said = heard(over={"contact.preload_n": preloads}, **quick)
    assert said == [(0, 3), (1, 3), (2, 3), (3, 3)]
    again, said = heard(over={"contact.preload_n": preloads}, **quick)
    assert said == [(3, 3)]
    xarray.testing.assert_identical(again, first)
    _, said = heard(over={"contact.preload_n": [*preloads, 4.0]}, **quick | {"quantities": ["shares.stick"]})
    assert said == [(3, 4), (4, 4)]  # other quantities of the same points are in the store too
    assert heard(over={"contact.preload_n": preloads}, **quick | {"duration": 2.0})[1][0] == (0, 3)


def test_equal_points_are_computed_once(quick: dict[str, Any]) -> None:
    found, said = heard(over={"contact.preload_n": [2.0, 2.0, 3.0]}, **quick)
    assert said[-1] == (2, 2)
    assert found["torque_n_m"].values == pytest.approx(NOMINAL.friction * MOTOR.rotor.radius_m * np.array([2, 2, 3]))


def test_functions_and_versions_are_part_of_the_address(quick: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    over = {"contact.preload_n": [1.0]}
    pr.sweep(MOTOR, DRIVE, over=over, **quick)
    assert heard(over=over, **quick | {"quantities": {"power_w": points.power}})[1][0] == (0, 1)
    versions = versions_here() | {"ngspice_version": "99"}
    for module in ("sweep", "task"):
        monkeypatch.setattr(f"pyspice_runner.sweeps.{module}.versions_here", lambda: versions)
    assert heard(over=over, **quick)[1][0] == (0, 1)


def test_the_stator_from_which_modes_follow_is_part_of_the_address() -> None:
    """With modes of its own a motor has no beam, whose ceramic has a stress."""
    for name in ("andersen2002", "bimodal40"):
        motor = pr.load_motor(name)
        bare = motor.updated({"modes.0.damping_n_s_per_m": motor.modes[0].damping_n_s_per_m})
        assert bare.to_dict() == motor.to_dict()
        one, other = (Task(held_point, each, DRIVE, {}, {}, {}).address for each in (motor, bare))
        assert one != other


def test_cautions_of_the_points_are_kept_grouped_and_counted(tmp_path: Path) -> None:
    over = {"drive.voltage": [100.0, 200.0, 300.0]}
    drive, losses = DRIVE.updated({"frequency": 54e3}), ["temperature_rise_k", "dielectric_loss_w", "damping_loss_w"]
    for _ in ("computed", "stored"):
        found = pr.sweep(MOTOR, drive, over=over, analysis=held_point, speed=0.0, quantities=losses,
                         store=tmp_path)  # fmt: skip
        hottest = found["temperature_rise_k"].values
        # 100 K/W; the limit is 175 °C
        assert hottest == pytest.approx(100.0 * (found["dielectric_loss_w"] + found["damping_loss_w"]).values, rel=1e-3)
        assert (25.0 + hottest > 175.0).tolist() == [False, True, True]
        assert [caution[:13] for caution in found.cautions] == [*(one[:13] for one in MOTOR.cautions), "2 of 3 points"]
        assert f"heat the stator by {hottest[2]:.0f} K to" in found.cautions[-1]


# --- failures ---


def test_a_failing_point_is_recorded_without_its_deck_and_the_others_are_computed(
    quick: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    over = {"contact.preload_n": [5.0, 9.0, 7.0, 21.0]}
    how = quick | {"analysis": points.fails_above_8_n}
    found, said = heard(over=over, **how)
    assert np.isnan(found["torque_n_m"].values).tolist() == [False, True, False, True]
    reasons = ["", "ngspice gave up.", "", "KeyError: 'torque'"]
    assert found["failure"].values.tolist() == reasons
    assert said[-1] == (4, 4)
    assert heard(over=over, **how)[1][0] == (2, 4)  # failures are tried again
    assert not list(tmp_path.glob("piezomotor-*"))


@pytest.mark.parametrize("relative", ["10 %", None, [0.1], 10**400, float("nan")])
def test_a_tolerance_that_is_no_share_is_rejected(relative: Any) -> None:
    with pytest.raises(pr.ParameterError, match=r"A tolerance of .* is not valid: it must be > 0 and < 100 %"):
        pr.Tolerance(relative)
    with pytest.raises(pr.ParameterError, match="it must be 'uniform' or 'normal'"):
        pr.Tolerance(0.1, "flat")  # type: ignore[arg-type]


@pytest.mark.parametrize("path", ["load.speed", "run.speed", "speed"])
def test_a_setting_that_an_axis_replaces_is_rejected(path: str, quick: dict[str, Any]) -> None:
    with pytest.raises(pr.ParameterError, match=r"load.speed is given twice, by speed and as an axis. Give it once."):
        pr.sweep(MOTOR, DRIVE, over={path: [1.0, 2.0]}, speed=3.0, **quick)
    assert pr.sweep(MOTOR, DRIVE, over={"run.duration": pr.Tolerance(0.1)}, samples=2, **quick).sizes == {"sample": 2}


def test_a_worker_with_other_versions_refuses_to_work(threads: Executor) -> None:
    task = Task(points.formula, MOTOR, DRIVE, {"duration": 1.0}, {}, versions_here() | {"ngspice_version": "12"})
    with pytest.raises(pr.SimulationError, match=r"other versions .* than the sweep .*ngspice 12"):
        threads.submit(task).result()


@pytest.mark.soak
def test_a_killed_worker_loses_no_point(quick: dict[str, Any], tmp_path: Path) -> None:
    how = quick | {"analysis": points.kills_one_worker, "executor": None, "workers": 2}
    mark = tmp_path / "killed"
    found = pr.sweep(MOTOR, DRIVE, over={"contact.preload_n": np.arange(1.0, 11.0)}, mark=str(mark), **how)
    assert mark.exists()
    assert found["failure"].values.tolist() == [""] * 10


@pytest.mark.soak
def test_a_point_that_kills_its_worker_fails_alone(quick: dict[str, Any]) -> None:
    how = quick | {"analysis": points.kills_its_worker_at_7_n, "executor": None, "workers": 2}
    found = pr.sweep(MOTOR, DRIVE, over={"contact.preload_n": np.arange(1.0, 11.0)}, **how)
    failed = found["failure"] != ""
    assert found["contact.preload_n"].values[failed].tolist() == [7.0]
    assert "The worker was lost" in found["failure"].sel({"contact.preload_n": 7.0}).item()


def test_a_broken_executor_loses_no_finished_point(quick: dict[str, Any]) -> None:
    over = {"contact.preload_n": [1.0, 2.0, 7.0, 3.0]}
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        how = quick | {"analysis": points.kills_its_worker_at_7_n, "executor": pool}
        found = pr.sweep(MOTOR, DRIVE, over=over, **how)
    assert (found["failure"] == "").values.tolist()[:2] == [True, True]
    assert "The worker was lost" in found["failure"].values[2]


# --- interrupts and kills ---


def test_an_interrupt_keeps_what_is_finished_and_says_how_to_go_on(quick: dict[str, Any]) -> None:
    def interrupt(done: int, _: int) -> None:
        if done == 3:
            raise KeyboardInterrupt

    over = {"contact.preload_n": np.arange(1.0, 9.0)}
    with pytest.raises(KeyboardInterrupt, match=r"3 of 8 points are finished .*store; start the same sweep"):
        pr.sweep(MOTOR, DRIVE, over=over, progress=interrupt, **quick)
    assert heard(over=over, **quick)[1][0] == (3, 8)


def in_this_process(folder: Path, *words: str) -> None:
    """The command to its end in this process, which has loaded all already."""
    with contextlib.chdir(folder):
        assert run([*COMMAND, *words]) == 0


@pytest.mark.soak
def test_ctrl_c_ends_all_processes_and_says_how_to_resume(tmp_path: Path) -> None:
    words = ["--over", "drive.voltage=1:50:2000", "--store", "points", "--output", "sweep.nc"]
    with processes.begun(*COMMAND, *words, cwd=tmp_path, TMPDIR=str(tmp_path)) as sweeping:
        processes.wait_for(lambda: list(tmp_path.glob("points/*/*.json")), sweeping)
        assert processes.working_in(tmp_path)
        os.killpg(sweeping.pid, signal.SIGINT)  # as a terminal does
        output, said = sweeping.communicate(timeout=30.0)
    assert (sweeping.returncode, output) == (130, "")
    told = re.fullmatch(
        r"piezomotor: interrupted; (\d+) of 2000 points are finished and kept in points; "
        r"start the same sweep again to continue it\.\n",
        said,
    )
    assert told, said
    kept = len(list(tmp_path.glob("points/*/*.json")))
    assert 0 <= kept - int(told[1]) <= 1  # one may have been stored in the moment of the interrupt
    processes.gone(tmp_path)
    assert not (tmp_path / "sweep.nc").exists()


@pytest.mark.soak
@pytest.mark.parametrize(("kills", "values"), [(1, 4), (10, 40)])
def test_a_sweep_that_is_killed_and_resumed_gives_the_same_file(kills: int, values: int, tmp_path: Path) -> None:
    words = ["--over", f"drive.voltage=1:50:{values}", "--over", "contact.preload_n=5,10", *ALONE]
    in_this_process(tmp_path, *words, "--store", "alone", "--output", "alone.nc")
    moments = random.Random(kills)

    def stored() -> int:
        return len(list(tmp_path.glob("points/*/*.json")))

    def begin(target: str) -> AbstractContextManager[subprocess.Popen[str]]:
        given = [*COMMAND, *words, "--store", "points", "--output", target]
        return processes.begun(*given, cwd=tmp_path, TMPDIR=str(tmp_path))

    for kill in range(kills):
        before = stored()
        with begin("killed.nc") as sweeping:
            if kill % 2 == 0:  # one in two while it works, the others wherever they fall
                processes.wait_for(lambda: stored() > before, sweeping)  # noqa: B023
                time.sleep(moments.uniform(0.0, 0.3))
            else:
                time.sleep(moments.uniform(0.0, 2.0))
            assert sweeping.poll() is None, "it was finished before it could be killed"
            sweeping.kill()
        processes.gone(tmp_path)  # workers do not outlive their sweep
    assert 0 < stored() < 2 * values
    with begin("killed-0.nc") as other:
        in_this_process(tmp_path, *words, "--store", "points", "--output", "killed-1.nc")  # two at once, to end it
        _, said = other.communicate(timeout=300.0)
    assert other.returncode == 0, said
    for number in (0, 1):
        assert (tmp_path / f"killed-{number}.nc").read_bytes() == (tmp_path / "alone.nc").read_bytes()
    assert stored() == 2 * values


def test_workers_execute_no_file_of_the_working_folder(tmp_path: Path) -> None:
    """Not even one named as a module that Python imports when it starts a worker, nor a script without a guard."""
    for name in ("signal", "pickle", "socket", "queue", "tempfile", "multiprocessing"):
        (tmp_path / f"{name}.py").write_text("open('executed', 'a').write(__name__)\n", encoding="utf-8")
    command = tmp_path / "bin" / "piezomotor"  # as pip writes it; `python -m` would search the working folder itself
    command.parent.mkdir()
    command.write_text("print('once')\nfrom pyspice_runner.__main__ import main\nmain()\n")
    words = [sys.executable, command, *COMMAND, "--over", "drive.voltage=10", "--store", "points", "--workers", "1"]
    environment = {**os.environ, "PYTHONPATH": str(processes.ROOT)}
    done = subprocess.run(words, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert not (tmp_path / "executed").exists()
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("once") == 1


# --- a Dask cluster ---


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """Address of a Dask scheduler on the loopback, and its two workers, each a process of its own."""
    place = tmp_path / "scheduler.json"
    common = {
        "cwd": tmp_path,
        "env": {**os.environ, "PYTHONPATH": str(processes.ROOT)},
        "stdout": subprocess.DEVNULL,
        "stderr": subprocess.DEVNULL,
    }
    dask = [sys.executable, "-m", "dask"]
    here = ["--host", "127.0.0.1", "--scheduler-file", str(place), "--local-directory", str(tmp_path)]
    quiet = ["--dashboard-address", "127.0.0.1:0"]
    running = []
    try:
        running.append(subprocess.Popen([*dask, "scheduler", *here[:4], "--port", "0", *quiet], **common))
        processes.wait_for(lambda: place.exists() and place.stat().st_size, running[0])
        worker = [*dask, "worker", *here, "--nthreads", "1", "--no-nanny", *quiet]
        running += [subprocess.Popen(worker, **common) for _ in range(2)]
        yield str(json.loads(place.read_text(encoding="utf-8"))["address"]), running[1:]
    finally:
        for process in running:
            process.kill()
            process.wait()


@pytest.mark.slow
@pytest.mark.soak
def test_a_dask_cluster_gives_the_same_file_and_may_lose_a_worker(
    cluster: tuple[str, list[subprocess.Popen[bytes]]], tmp_path: Path
) -> None:
    address, (lost, _) = cluster
    words = ["--over", "drive.voltage=10:50:16"]
    stored = []

    def lose() -> None:
        processes.wait_for(lambda: list(tmp_path.glob("there/*/*.json")), lost)
        lost.kill()
        stored.append(len(list(tmp_path.glob("there/*/*.json"))))

    losing = Thread(target=lose)
    losing.start()
    in_this_process(tmp_path, *words, "--store", "there", "--output", "there.nc", "--scheduler", address)
    losing.join()
    assert 0 < stored[0] < 16, "the worker was lost too late to matter"
    in_this_process(tmp_path, *words, "--store", "here", "--output", "here.nc", *ALONE)
    assert (tmp_path / "there.nc").read_bytes() == (tmp_path / "here.nc").read_bytes()


# --- the command ---


@pytest.fixture
def in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("PYTHONPATH", str(processes.ROOT))
    return tmp_path


def test_sweep_prints_one_json_object_and_writes_the_requested_files(
    in_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [*COMMAND, "--over", "drive.voltage=10:50:3", "--tolerance", "contact.friction=10%", "--samples", "2"]
    for ending in ("nc", "csv", "json"):
        plot = ["--plot", "sweep.png"] if ending == "nc" else []
        assert run([*words, "--json", "--output", f"sweep.{ending}", *plot]) == 0
        captured = capsys.readouterr()
        document = json.loads(captured.out)
        moving = np.count_nonzero(np.equal(document["quantities"]["settled"], 0))
        assert moving > 0
        assert captured.err.startswith(f"piezomotor: {moving} of 6 points are not settled; see 'settled'.\n")
        assert all(f"piezomotor: {caution}\n" in captured.err for caution in MOTOR.cautions)
    assert document["points"] == 6
    assert document["dimensions"] == {"drive.voltage": 3, "sample": 2}
    assert np.shape(document["quantities"]["mean_torque_n_m"]) == (3, 2)
    assert document["failures"] == []
    assert document["provenance"]["motor"] == MOTOR.to_dict()
    assert json.loads((in_folder / "sweep.json").read_text(encoding="utf-8")) == document
    assert len((in_folder / "sweep.csv").read_text(encoding="utf-8").splitlines()) == 7
    assert (in_folder / "sweep.png").stat().st_size > 20_000
    assert (in_folder / "cache" / "piezomotor" / "points").is_dir()
    assert run([*words, "--quantity", "state_fractions.slip"]) == 0
    assert "state_fractions.slip" in capsys.readouterr().out


FROM_PYTHON = """
import sys
import pyspice_runner as pr
motor = pr.load_motor("bimodal40")
pr.sweep(motor, pr.default_drive(motor), over={"drive.voltage": [10.0]}, duration=5e-5, speed=1.0, store=sys.argv[1],
         workers=1, progress=lambda done, total: print(done, total))
"""


@pytest.mark.soak
def test_a_sweep_stored_by_the_command_is_found_from_python_with_more_threads(in_folder: Path) -> None:
    words = ["sweep", "bimodal40", "--duration", "5e-5", "--speed", "1", "--over", "drive.voltage=10", *ALONE]
    assert processes.command(*words, "--store", "points", cwd=in_folder, OPENBLAS_NUM_THREADS="1")[0] == 0
    script = [sys.executable, "-c", FROM_PYTHON, "points"]
    status, said, _ = processes.command(*script, cwd=in_folder, shell=True, OPENBLAS_NUM_THREADS="2")
    assert (status, said) == (0, "1 1\n")  # finished before it begins


def test_a_failing_point_shows_in_the_exit_status(in_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = [*AT_SPEED, "--over", "run.duration=5e-5,1e-8", "--json", "--output", "sweep.nc", *ALONE]
    assert run(words) == 3
    captured = capsys.readouterr()
    assert "1 of 2 points failed; the first: duration = 1e-08 s is shorter" in captured.err
    document = json.loads(captured.out)
    assert document["quantities"]["mean_torque_n_m"][1] is None
    assert document["failures"][0]["at"] == {"run.duration": 1e-8}
    assert (in_folder / "sweep.nc").exists()


def test_a_simulator_that_fails_everywhere_ends_with_3(in_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    # 10 ms of the motor take ngspice a second; a run of a few ms can end before the timeout is looked at
    long = ("--duration", "1e-2", "--timeout", "1e-3")
    assert run([*AT_SPEED, "--over", "drive.voltage=10,20", *long, *ALONE]) == 3
    assert "2 of 2 points failed; the first: ngspice did not finish within 0.001 s" in capsys.readouterr().err
    assert in_folder.exists()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ([], "goes over nothing"),
        (["--over", "drive.voltage"], "--over 'drive.voltage' has no values"),
        (["--over", "drive.voltage=much"], "Write values as 2,5,9"),
        (["--over", "drive.voltage=1:100:many"], "'1:100:many' is not valid"),  # not an emoji
        (["--over", "contact.prelod_n=1"], "Did you mean 'contact.preload_n'?"),
        (["--over", "modes.0.name=1"], "is not a number"),
        (["--over", "contact.preload_n=5,-1"], "contact.preload_n = -1 N is not valid"),
        (["--over", "drive.voltage=-1"], "voltage = -1 V is not valid"),
        (["--over", "modes.*.tip_x=1", "--over", "modes.0.tip_x=1"], "modes.0.tip_x twice"),
        (["--over", "drive.voltage=1", "--quantity", "mean_torque"], "Did you mean 'mean_torque_n_m'?"),
        (["--over", "drive.voltage=1", "--limit", "nothing=1:5"], "--limit nothing: there is no such quantity"),
        (["--over", "drive.voltage=1", "--limit", "mean_torque_n_m=5:1"], "LOW must be at most HIGH"),
        (["--over", "drive.voltage=1", "--workers", "0"], "workers = 0 is not valid"),
        (["--over", "drive.voltage=1", "--duration", "nan"], "duration = nan s is not valid"),
        (["--over", "drive.voltage=1:2:1001", "--over", "contact.friction=0.1:1:1000"], "at most 1e+06"),
        (["--tolerance", "contact.friction=0.1"], "is not a percentage"),
        (["--tolerance", "contact.friction=10%", "--samples", "100"], "Give 128"),
        (["--tolerance", "modes.0.tip_x=10%"], "has no tolerance"),
        (["--tolerance", "contact.friction=10%", "--over", "contact.friction=1"], "to --over and to --tolerance"),
        (["--over", "drive.voltage=1", "--store", "/dev/null"], "Cannot write the store"),
        (["--over", "drive.voltage=1", "--analysis", "operating-point"], "--duration has no effect on --analysis"),
        (["--over", "drive.voltage=1", "--scheduler", "tcp://x:1", "--workers", "1"], "exclude each other"),
        (["--over", "drive.voltage=1", "--scheduler", "somewhere"], "There is no Dask scheduler at somewhere"),
    ],
)
def test_a_message_says_what_is_wrong_and_what_to_do(
    words: list[str], says: str, in_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    common = COMMAND[:2] if "--duration" in words else COMMAND
    assert run([*common, *words]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert says in captured.err
    assert len(captured.err.splitlines()) == 1
    assert not list(in_folder.rglob("*.nc"))


@pytest.mark.parametrize(
    ("how", "says"),
    [
        ({"quantities": {"x": lambda _: 1.0}}, "with a name in a module"),
        ({"analysis": lambda *_: {}}, "with a name in a module"),
        ({"analysis": points.refuses}, "duration = 1 s is not valid"),
        ({"sampling": "dice"}, "it must be 'sobol' or 'latin-hypercube'"),
        ({"samples": 2**40}, "samples = 1099511627776 is not valid: it must be a whole number > 0"),
        ({"samples": 4, "seed": -1}, "seed = -1 is not valid: it must be a whole number ≥ 0"),
        ({"speed": 1j}, "run.speed = 1j is not valid: it must be numbers, texts, and lists"),
        ({"duration": None}, "The setting duration is missing"),
    ],
)
def test_the_function_rejects_what_the_command_rejects(quick: dict[str, Any], how: dict[str, Any], says: str) -> None:
    settings = {name: value for name, value in {**quick, **how}.items() if value is not None}
    with pytest.raises(pr.ParameterError, match=says):
        pr.sweep(MOTOR, DRIVE, over={"contact.friction": pr.Tolerance(0.1)}, **settings)
