# SPDX-License-Identifier: GPL-3.0-or-later
"""Long runs: what is recorded, progress, and what is left of a run that was interrupted."""

import json
import signal
from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.errors import Interrupted
from pyspice_runner.run.waveforms import COLUMNS, Waveforms
from tests.processes import begun, wait_for

MOTOR = pr.load_motor("andersen2002")
DRIVE = pr.TwoPhaseDrive(voltage=50.0, frequency=51.7e3, phase_deg=90.0)


@pytest.fixture(scope="module")
def whole() -> Waveforms:
    return pr.simulate(MOTOR, DRIVE, duration=1e-3)


@pytest.mark.parametrize("every", [1, 7])
def test_what_is_recorded_is_what_the_whole_run_has(whole: Waveforms, every: int) -> None:
    signals = ("tip_x_m", "contact_displacement_m", "rotor_speed_rad_s")
    run = pr.simulate(MOTOR, DRIVE, duration=1e-3, signals=signals, record_every=every)
    assert run.recorded == ["time_s", *signals]
    assert (
        len(run.deck.split(".save ")[1].splitlines()[0].split()) == 5
    )  # and no more is stored: the slider takes three
    for name in run.recorded:
        # the start stands in front, then every so-many-th point
        expected = np.concatenate((getattr(whole, name)[:1], getattr(whole, name)[1::every]))
        assert getattr(run, name) == pytest.approx(expected, rel=1e-12, abs=1e-20)


def test_a_window_at_the_end_is_that_of_the_whole_run(whole: Waveforms) -> None:
    run = pr.simulate(MOTOR, DRIVE, duration=1e-3, record_from=6e-4)
    assert run.time_s[0] == pytest.approx(6e-4, abs=run.provenance["run"]["step_s"])
    same = whole.time_s >= run.time_s[0] - 1e-12
    for name in COLUMNS:
        assert getattr(run, name) == pytest.approx(getattr(whole, name)[same], rel=1e-9, abs=1e-15)
    assert run.mean_rotor_speed_rad_s == pytest.approx(whole.mean_rotor_speed_rad_s, rel=1e-6)
    assert run.energy_residual < 1e-3  # from the window's first point on
    assert run.state_fractions == pytest.approx(whole.state_fractions, abs=1e-3)


def test_what_was_not_recorded_is_said_and_left_out(tmp_path: Path) -> None:
    run = pr.simulate(MOTOR, DRIVE, duration=1e-4, signals=["rotor_speed_rad_s"])
    with pytest.raises(pr.ParameterError, match="tip_x_m was not recorded in this run; name it among the signals"):
        _ = run.tip_x_m
    with pytest.raises(pr.ParameterError, match="takes all signals at every step"):
        _ = run.energy_residual
    assert not hasattr(run, "normal_force_n")
    summary = json.loads(run.save(tmp_path / "run.json").read_text(encoding="utf-8"))
    assert summary["mean_rotor_speed_rad_s"] == pytest.approx(run.mean_rotor_speed_rad_s)
    assert summary["mean_torque_n_m"] is summary["state_fractions"] is summary["energy_residual"] is None
    assert summary["audit"] == {"passed": None, "findings": []}
    header = run.save(tmp_path / "run.csv").read_text(encoding="utf-8").splitlines()[0]
    assert header == "time_s,rotor_speed_rad_s"
    assert list(run.to_xarray().data_vars) == ["rotor_speed_rad_s"]


def test_a_duration_with_endless_steps_is_refused() -> None:
    with pytest.raises(pr.ParameterError, match=r"records inf points; at most 2e\+07 fit in memory"):
        pr.simulate(MOTOR, DRIVE, duration=1e308)


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"signals": ["speed"]}, "signals: 'speed' is not valid: it must be one of time_s, voltage_a_v"),
        ({"record_from": 1e-3}, "record_from = 0.001 s is not valid"),
        ({"record_from": -1e-3}, "record_from = -0.001 s is not valid"),
        ({"record_every": 0}, "record_every = 0 is not valid"),
        ({"record_every": 10_000}, "record_every = 10000 is not valid: it must be a whole number of steps from 1"),
        ({"record_every": 10**400}, "is not valid: it must be a whole number of steps from 1"),
    ],
)
def test_errors_say_what_is_allowed(settings: dict[str, object], says: str) -> None:
    with pytest.raises(pr.ParameterError) as refusal:
        pr.simulate(MOTOR, DRIVE, duration=1e-3, **settings)  # type: ignore[arg-type]
    assert says in str(refusal.value)


def test_progress_rises_and_what_it_raises_stops_the_run_with_what_was_done() -> None:
    told = []

    def progress(done: float, left: float) -> None:
        told.append((done, left))
        if len(told) == 2:
            raise KeyboardInterrupt

    with pytest.raises(Interrupted, match=r"The run was interrupted at .* of 10 s") as stopped:
        pr.simulate(MOTOR, DRIVE, duration=10.0, record_every=10, signals=["tip_x_m"], progress=progress)
    (first, _), (second, left) = told
    assert 0.0 < first < second < 1.0
    assert left > 0.0
    partial = stopped.value.partial
    assert not partial.complete
    assert partial.to_dict()["complete"] is False
    assert partial.time_s[-1] >= 0.9 * 10.0 * second
    # and it is the beginning of the same motion
    beginning = pr.simulate(MOTOR, DRIVE, duration=1e-4, record_every=10, signals=["tip_x_m"])
    assert partial.tip_x_m[:50] == pytest.approx(beginning.tip_x_m[:50], rel=1e-9)


def test_ctrl_c_keeps_what_the_command_has_done(tmp_path: Path) -> None:
    target = tmp_path / "run.csv"
    words = ["simulate", "andersen2002", "--duration", "1", "--json", "--output", str(target)]
    with begun(*words, cwd=tmp_path, TMPDIR=str(tmp_path)) as command:
        wait_for(lambda: any(raw.stat().st_size > 100_000 for raw in tmp_path.glob("*/out.raw")), command)
        command.send_signal(signal.SIGINT)
        out, err = command.communicate(timeout=60)
    assert command.returncode == 130, err
    assert "The run was interrupted at" in err
    summary = json.loads(out)
    assert summary["complete"] is False
    assert summary["energy_residual"] < 1e-3
    assert len(target.read_text(encoding="utf-8").splitlines()) == summary["points"] + 1
    assert list(tmp_path.iterdir()) == [target]


def test_a_voltage_at_the_start_moves_the_contact_at_once() -> None:
    motor = pr.load_motor("examples/plate40.toml")
    run = pr.simulate(motor, pr.default_drive(motor).updated({"voltage": 0.1}), duration=2e-4)
    assert run.energy_residual < 5e-3  # second order in the step; F₀ S U without that motion is more than 5 %
