# SPDX-License-Identifier: GPL-3.0-or-later
"""Small signals about a running motor, against transients whose drive or load is modulated, and steady states."""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from math import atan, degrees, pi, radians
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import pyspice_runner as pr
from pyspice_runner.circuit.bench import Bench
from pyspice_runner.circuit.motor import dielectric_admittance, dielectric_matrix
from pyspice_runner.circuit.source import sine
from pyspice_runner.circuit.state import Discretisation
from pyspice_runner.cli import run
from pyspice_runner.motor.drive import Tone
from pyspice_runner.run.kernel import transient
from pyspice_runner.run.point import Point
from pyspice_runner.spice.library import data_path
from pyspice_runner.steady.copies import Copy, copies_bench
from pyspice_runner.steady.period_map import PeriodMap
from pyspice_runner.steady.small_signals import _SIGNALS, INPUTS, OUTPUTS, SmallSignals, _outputs, small_signals
from pyspice_runner.steady.steady import steady_states
from pyspice_runner.trackers.loop import running_loop
from pyspice_runner.trackers.tracker import TrackedSource, propose_filter, stator_lag
from tests.motors import BEAM40, recommended

pytestmark = pytest.mark.xdist_group("small signals")  # they are shared

MOTOR = pr.load_motor("andersen2002-unintended-mode")
DRIVE = pr.TwoPhaseDrive(voltage=100.0, frequency=46e3, phase_deg=180.0)
LOAD = 5e-3  # N·m
FLAGSHIP = pr.load_motor("bimodal40")
PLATE40 = str(Path(__file__).parents[2] / "examples" / "plate40.toml")
SEVENTY = pr.TwoPhaseDrive(voltage=70.0, frequency=40571.6, phase_deg=90.0)  # a tracker's
PERIODS = (10, 60, 300)  # of the drive in one of the modulation: 4600, 767 and 153 Hz
FAST = PERIODS[:1]
SLOW = (0.05, 0.5)  # Hz, far below the rotor's and the mount's time constants
STRENGTH = {"amplitude": 0.5, "phase_deg": degrees(1e-2), "load_torque": 2e-4}  # 0.5 V, 10 mrad, 0.2 mN·m


@cache
def signals(numbers: tuple[int, ...]) -> SmallSignals:
    modulations = [*SLOW, *(DRIVE.frequency / number for number in numbers)]
    return small_signals(MOTOR, DRIVE, frequencies=modulations, load_torque=LOAD)


def strength(of: str, at: float) -> float:
    """Return the size of a modulation; that of the frequency swings the phase by 0.01 rad.

    Twice the size changes the transfer functions by up to 2 %, with its square.
    """
    return STRENGTH.get(of, 0.01 * at)


@dataclass(frozen=True)
class Probe:
    """A small sine at a group, V, or a torque on the rotor, N·m."""

    place: str
    tone: Tone


def probed_bench(copy: Copy, probes: Sequence[Sequence[Probe]], discretisation: Discretisation) -> Bench:
    """Return the bench of copies of one state, each with small sines in addition to drive and load."""
    bench = copies_bench([copy] * len(probes), discretisation)
    text, lines = bench.circuit.raw_spice, []
    for number, own in enumerate(probes):
        pins = dict.fromkeys("ab", "")
        for place, probe in enumerate(own):
            name = f"{number}_{place}"
            if probe.place == "shaft":
                lines.append(f"Iprobe{name} 0 xc{number}_shaft {sine(probe.tone)}")
                continue
            before = pins[probe.place] or f"{probe.place}0"
            pins[probe.place] = f"{probe.place}_{name}"
            lines.append(f"Vprobe{name} {pins[probe.place]} {before} {sine(probe.tone)}")
        at = f"xc{number} {pins['a'] or 'a0'} {pins['b'] or 'b0'} 0"
        assert f"xc{number} a0 b0 0" in text
        text = text.replace(f"xc{number} a0 b0 0", at)
    bench.circuit.raw_spice = "\n".join([text, *lines, ""])
    return bench


def side_bands(of: str, at: float, sign: float) -> tuple[Probe, ...]:
    """Return the sines that modulate drive or load by a cosine of the frequency ``at``, to first order."""
    size = sign * strength(of, at)
    if of == "load_torque":
        return (Probe("shaft", Tone(-size, at, 0.5 * pi)),)
    probes = []
    for group, ratio, phase in (("a", 1.0, 0.0), ("b", DRIVE.ratio_b, radians(DRIVE.phase_deg))):
        if of == "amplitude":  # m cos(ωt) sin(Ωt + φ) = m/2 [sin((Ω+ω)t + φ) + sin((Ω−ω)t + φ)]
            half = 0.5 * ratio * size
            bands = ((half, at, phase), (half, -at, phase))
        elif of == "phase_deg" and group == "a":
            continue
        elif of == "phase_deg":  # ψ cos(ωt) cos(Ωt + φ)
            half = 0.5 * ratio * DRIVE.voltage * radians(size)
            bands = ((half, at, phase + 0.5 * pi), (half, -at, phase + 0.5 * pi))
        else:  # the phase is (δf/f_m) sin(ωt): ψ sin(ωt) cos(Ωt + φ) = ψ/2 [sin((Ω+ω)t + φ) − sin((Ω−ω)t + φ)]
            half = 0.5 * ratio * DRIVE.voltage * size / at
            bands = ((half, at, phase), (-half, -at, phase))
        probes += [Probe(group, Tone(half, DRIVE.frequency + shift, angle)) for half, shift, angle in bands]
    return tuple(probes)


def modulated(
    of: str, numbers: Sequence[int], rest: int, window: int, finer: int = 2
) -> dict[tuple[str, int], complex]:
    """Return the transfer functions that a transient with finite modulation shows, at several frequencies at once.

    Two copies have modulations of opposite sign, so that the curvature drops out. The carrier vibrates on the contact
    at 1.75 kHz for 25 ms; a window of four terms (Harris 1978) suppresses what is more than four lines away.

    Args:
        of: what is modulated.
        numbers: periods of the drive in one of the modulation.
        rest: periods before the window.
        window: its periods, a multiple of all numbers.
        finer: number of its steps in one of the steady state.
    """
    state, period = signals(FAST).state, 1.0 / DRIVE.frequency
    step = PeriodMap(period, finer * round(period / state.step_s))
    frequencies = {number: DRIVE.frequency / number for number in numbers}
    copy = Copy(state.solution.plant, state.solution.state)
    every = [[probe for at in frequencies.values() for probe in side_bands(of, at, sign)] for sign in (1.0, -1.0)]
    velocities = [f"i(v.{{}}.xmode{number}.vvelocity)" for number in range(1, len(MOTOR.modes) + 1)]
    names = ["v({}_shaft)", "v({}.friction)", *velocities]
    count = window * step.steps
    found = transient(
        probed_bench(copy, every, step.discretisation),
        [name.format(one) for one in ("xc0", "xc1") for name in names],
        step=step.step, duration=rest * period + (count + 3) * step.step, record_from=0.9 * rest * period,
    ).vectors()  # fmt: skip
    time = rest * period + np.arange(count) * step.step
    turn = 2.0 * pi * np.arange(count) / count
    weights = sum(share * np.cos(order * turn) for order, share in enumerate((0.35875, -0.48829, 0.14128, -0.01168)))
    up, down = (
        np.array([np.interp(time, found["time"], found[name.format(copy)]) for name in names])
        for copy in ("xc0", "xc1")
    )
    mean, change = 0.5 * (up + down), 0.5 * (up - down)

    def component(values: NDArray[np.float64], frequency: float) -> complex:
        return complex(2.0 * np.average(values * np.exp(-2j * pi * frequency * time), weights=weights))

    def voltage(group: str, probes: Sequence[Probe]) -> NDArray[np.float64]:
        own = {"a": (DRIVE.voltage, 0.0), "b": (DRIVE.voltage_b, radians(DRIVE.phase_deg))}[group]
        tones = [Tone(own[0], DRIVE.frequency, own[1])]
        tones += [probe.tone for probe in probes if probe.place == group]
        return np.asarray(sum(tone.amplitude * np.sin(2.0 * pi * tone.frequency * time + tone.phase) for tone in tones))

    result: dict[tuple[str, int], complex] = {}
    for number, at in frequencies.items():
        result["speed", number] = component(change[0], at)
        result["torque", number] = MOTOR.rotor.radius_m * component(change[1], at)
        for group in "ab":  # the envelope is I + above e^{jωt} + below e^{-jωt}
            couplings = np.array([getattr(mode, f"coupling_{group}_n_per_v") for mode in MOTOR.modes])
            carrier = component(couplings @ mean[2:], DRIVE.frequency)
            above, below = (component(couplings @ change[2:], DRIVE.frequency + side) for side in (at, -at))
            result[f"motional_phase_{group}_deg", number] = (
                degrees(1) * -1j * (above / carrier - (below / carrier).conjugate())
            )
            # the copies have no clamped capacitances, whose currents the known voltages determine
            first, second = (voltage(group, probes) for probes in every)
            clamped = [
                component(values, frequency) * dielectric_admittance(MOTOR, group, frequency)
                for values, frequency in (
                    (0.5 * (first + second), DRIVE.frequency),
                    (0.5 * (first - second), DRIVE.frequency + at),
                    (0.5 * (first - second), DRIVE.frequency - at),
                )
            ]
            carrier, above, below = (one + two for one, two in zip((carrier, above, below), clamped, strict=True))
            result[f"current_phase_{group}_deg", number] = (
                degrees(1) * -1j * (above / carrier - (below / carrier).conjugate())
            )
            grown = above * carrier.conjugate() + below.conjugate() * carrier
            result[f"current_amplitude_{group}", number] = grown / abs(carrier)
    return {(name, number): value / strength(of, frequencies[number]) for (name, number), value in result.items()}


def compare(of: str, numbers: tuple[int, ...], rest: int, window: int) -> None:
    shown = signals(numbers)
    for (output, number), value in modulated(of, numbers, rest, window).items():
        place = int(np.argmin(np.abs(shown.modulation_hz - DRIVE.frequency / number)))
        ours = complex(shown.transfer(output, of)[place])
        if "_phase_" in output:  # the transient shows it against the drive without modulation
            ours += {
                "phase_deg": float("_b_" in output),
                "frequency": degrees(1) * number / (1j * DRIVE.frequency),
            }.get(of, 0.0)
        assert abs(ours - value) < 0.02 * abs(value), (of, number, output, ours, value)  # required


@pytest.mark.soak
def test_a_modulated_transient_shows_the_transfer_functions() -> None:
    compare("load_torque", FAST, rest=40, window=80)


@pytest.mark.soak
@pytest.mark.parametrize("of", INPUTS)
def test_modulated_transients_show_all_transfer_functions(of: str) -> None:
    compare(of, PERIODS, rest=300, window=600)


@pytest.mark.soak
def test_short_steps_of_a_transient_show_the_extrapolated_transfer_functions() -> None:
    """At 1 kHz; 0.02 % was measured, and 0.3 % for the derivative at the finest step of the steady state."""
    numbers = (46,)
    shown = signals(numbers)
    place = int(np.argmin(np.abs(shown.modulation_hz - DRIVE.frequency / numbers[0])))
    for (output, _), value in modulated("amplitude", numbers, rest=300, window=598, finer=8).items():
        assert shown.transfer(output, "amplitude")[place] == pytest.approx(value, rel=1e-3), output


def test_the_slow_gain_is_that_of_two_steady_states() -> None:
    """Measured 0.05 %; test_every_effect.py has the motor with every effect."""
    motor, drive = recommended(BEAM40)
    found = small_signals(motor, drive, frequencies=[0.01], speed=15.0)
    ends = [Point.of(motor, drive.updated({"voltage": drive.voltage + step}), speed=15.0) for step in (-2.0, 2.0)]
    low, high = (state.torque_n_m for state in steady_states(ends))
    assert found.transfer("torque", "amplitude")[0].real == pytest.approx((high - low) / 4.0, rel=0.01)


@pytest.mark.soak
def test_slow_modulation_follows_the_steady_states() -> None:
    slow = signals(FAST)
    volt = {"voltage": DRIVE.voltage + 1.0}, {"voltage": DRIVE.voltage - 1.0}
    up, down = (pr.steady_state(MOTOR, DRIVE.model_copy(update=one), load_torque=LOAD) for one in volt)
    # 1 %: the curvature of the speed over the voltage between the two
    expected = 0.5 * (up.speed_rad_s - down.speed_rad_s)
    assert slow.transfer("speed", "amplitude")[1].real == pytest.approx(expected, rel=1e-2)
    # the balance of torques: d load = d torque - (C_R + jωJ) d speed
    bearing = MOTOR.rotor.bearing_damping_n_m_s
    torque, speed = (slow.transfer(name, "load_torque")[1] for name in ("torque", "speed"))
    inertia = 2j * pi * 0.5 * MOTOR.rotor.inertia_kg_m2
    assert torque - (bearing + inertia) * speed == pytest.approx(1.0, rel=1e-3)
    # the phase of both groups changes nothing, so that the slow response to a frequency does not grow with its integral
    for output in ("speed", "current_phase_a_deg"):
        near, far = slow.transfer(output, "frequency")[:2]
        assert near == pytest.approx(far, rel=0.02)


@pytest.mark.soak
def test_where_effects_cancel_a_transfer_function_is_that_of_steady_states() -> None:
    """Two modes meet: the drive of the set is near the frequency of the greatest speed."""
    motor, drive = recommended(BEAM40)
    found = small_signals(motor, drive, frequencies=[0.02])
    up, down = (
        pr.steady_state(motor, drive.updated({"frequency": drive.frequency + shift}), accuracy=2e-5).speed_rad_s
        for shift in (4.0, -4.0)
    )
    ours, error = found.transfer("speed", "frequency")[0], found.errors["speed", "frequency"][0]
    # 1 %: the differences of steady states over ±2, ±4 and ±8 Hz differ by as much
    assert ours.real == pytest.approx((up - down) / 8.0, rel=0.01)
    assert 0.0 < error < 0.01 * abs(ours)
    assert not any("transfer functions" in caution for caution in found.cautions)
    worse = replace(found, errors={**found.errors, ("torque", "frequency"): np.array([0.06 * abs(ours)])})
    share = 6.0 * abs(ours) / abs(found.transfer("torque", "frequency")[0])
    assert f"exceeds 5 %: torque per frequency ({share:.2g} % at 0.02 Hz)" in worse.cautions[-1]
    assert found.units["speed_per_phase_deg_re"] == ("rad/s/deg", "speed per phase_deg, real part")
    assert found.to_xarray()["current_phase_a_deg_per_frequency_error"].attrs["units"] == "deg/Hz"


@pytest.mark.soak
@pytest.mark.parametrize("name", ["bimodal40", PLATE40])
def test_the_small_signals_of_recommended_drives_are_accurate(name: str) -> None:
    """That of plate40 to the phase has a peak in a hundredth of a step, which takes a quarter of it."""
    motor, drive = recommended(name)
    found = small_signals(motor, drive, frequencies=[0.02, *np.geomspace(10.0, 3e3, 6)])
    assert not any("transfer functions" in caution for caution in found.cautions)
    # differences over a phase or a voltage have errors of 1 to 50 %, because the steady states have errors
    ends = [Point.of(motor, drive.updated({"frequency": drive.frequency + shift})) for shift in (-1.0, 1.0)]
    low, high = (state.speed_rad_s for state in steady_states(ends, accuracy=2e-5))
    assert found.transfer("speed", "frequency")[0].real == pytest.approx(0.5 * (high - low), rel=0.01)


@pytest.mark.soak
def test_the_hot_admittance_of_a_motor_that_sticks_is_that_of_the_preloaded_stator() -> None:
    weak = DRIVE.model_copy(update={"voltage": 0.5})
    found = small_signals(MOTOR, weak, frequencies=[2300.0], speed=0.0)
    assert not any(of == "load_torque" for _, of in found.transfers)  # a held shaft takes any
    for place, frequency in enumerate(found.probe_hz.tolist()):
        band: Any = {"start": frequency - 1.0, "stop": frequency + 1.0, "points": 3}
        preloaded = pr.admittance(MOTOR, state="preloaded", **band).matrix_s[1]
        # 1 %: the stiffness of the contact changes by as much in the swing
        assert np.abs(found.hot_admittance_s[place] - preloaded).max() < 1e-2 * np.abs(preloaded).max()
        free = pr.admittance(MOTOR, state="free", **band).matrix_s[1]
        assert np.abs(found.cold_admittance_s[place] - free).max() < 1e-4 * np.abs(free).max()
        error = found.hot_admittance_error_s[place].max()
        assert 0.0 < error < 1e-3 * np.abs(preloaded).max()  # nothing slips, so that no event is late
    running, cold = signals(FAST).hot_admittance_s, signals(FAST).cold_admittance_s
    assert np.abs(running - cold).max() > 0.02 * np.abs(cold).max()


@pytest.mark.soak
def test_a_group_that_moves_no_mode_has_no_phase_of_its_motional_current() -> None:
    bands = np.ones((len(_SIGNALS), 3), complex)
    carriers = {"current_a": 1j, "current_b": 1j, "motional_a": 1j, "motional_b": 0.0}
    solution = signals(FAST).state.solution
    found = _outputs(bands, carriers, "amplitude", solution.plant)
    assert OUTPUTS.keys() - found.keys() == {"motional_phase_b_deg"}
    partial = replace(signals(FAST), transfers={("speed", "amplitude"): np.ones(1, complex)})
    with pytest.raises(pr.ParameterError, match="the phases only where there is a current"):
        partial.transfer("motional_phase_b_deg", "amplitude")
    with pytest.raises(pr.ParameterError, match="There is no transfer from volume to speed"):
        partial.transfer("speed", "volume")


@pytest.mark.soak
def test_the_error_of_the_hot_admittance_is_that_of_the_time_step() -> None:
    motor = pr.load_motor(BEAM40)
    drive, at = pr.default_drive(motor), [100.0, 1000.0]
    found = small_signals(motor, drive, frequencies=at)
    finer = small_signals(motor, drive, frequencies=at, step=0.5 * found.state.step_s)
    size, change, error, small = (
        np.abs(values).max(axis=(1, 2))
        for values in (
            found.hot_admittance_s, found.hot_admittance_s - finer.hot_admittance_s, found.hot_admittance_error_s,
            finer.hot_admittance_error_s,
        )
    )  # fmt: skip
    assert np.all(change < 3.0 * (error + small))  # both are the spread of a few copies; measured 1.0 times at most
    assert np.all(error < 1e-3 * size)  # measured 4e-4 next to the resonance, against a quarter of the step 8e-4
    worse = replace(found, hot_admittance_error_s=np.abs(0.06 * found.hot_admittance_s))
    assert "hot admittance of A (6 % at " in worse.cautions[-1]


def test_a_law_of_the_users_own_has_the_small_signals_of_its_statements(tmp_path: Path) -> None:
    text = (data_path("behavioral") / "piezomotor_coulomb.lib").read_text(encoding="ascii")
    path = tmp_path / "copy.lib"
    path.write_text(re.sub(r"\* FORMS .*\n", "", text).replace("piezomotor_coulomb", "copied"), encoding="ascii")
    known, found = (
        small_signals(FLAGSHIP, SEVENTY, frequencies=[500.0], speed=27.8, contact=law) for law in ("coulomb", str(path))
    )
    np.testing.assert_allclose(found.hot_admittance_s, known.hot_admittance_s, rtol=1e-9)
    diode = path.read_text(encoding="ascii").replace(
        ".ends copied", "Dopen slip 0 open\n.model open D(is=1e-30)\n.ends copied"
    )
    path.write_text(diode, encoding="ascii")
    with pytest.raises(pr.ParameterError, match=r"law '.*copy\.lib' are not known. For small signals it may have"):
        small_signals(FLAGSHIP, SEVENTY, frequencies=[500.0], speed=27.8, contact=str(path))


@pytest.mark.soak
def test_the_hot_admittance_of_the_flagship_is_that_of_a_transient() -> None:
    """A small sine at group A; 0.2 % was measured, by the place of the steps in the period. The slider slips."""
    number, volts, rest = 81, 0.2, 1500  # periods of the drive in one of the modulation; ten time constants in periods
    side, other = (SEVENTY.frequency * (1.0 + sign / number) for sign in (1.0, -1.0))
    found = small_signals(FLAGSHIP, SEVENTY, frequencies=[SEVENTY.frequency / number], speed=27.8)
    solution, period = found.state.solution, SEVENTY.period
    step = PeriodMap(period, 2 * round(period / found.state.step_s))
    probes = [(Probe("a", Tone(sign * volts, side, 0.5 * pi)),) for sign in (1.0, -1.0)]
    names = [f"i(v.{{}}.xmode{mode + 1}.vvelocity)" for mode in range(len(FLAGSHIP.modes))]
    names += ["v({}.friction)", "v({}.normal)"]
    count = 2 * number * step.steps
    run = transient(
        probed_bench(Copy(solution.plant, solution.state), probes, step.discretisation),
        [name.format(copy) for copy in ("xc0", "xc1") for name in names],
        step=step.step, duration=rest * period + (count + 3) * step.step, record_from=0.9 * rest * period,
    ).vectors()  # fmt: skip
    time = rest * period + np.arange(count) * step.step
    up, down = (
        np.array([np.interp(time, run["time"], run[name.format(copy)]) for name in names]) for copy in ("xc0", "xc1")
    )
    change = 0.5 * (up - down) / volts
    currents = FLAGSHIP.stator.coupling.T @ change[: len(FLAGSHIP.modes)]
    currents -= FLAGSHIP.stator.residual_per_volt.T @ np.gradient(change[-2:], time, axis=1)
    above, image = (2.0 * currents @ np.exp(-2j * pi * at * time) / count for at in (side, other))
    hot = above + dielectric_matrix(FLAGSHIP, side)[:, 0]
    size = np.abs(found.hot_admittance_s).max()
    assert np.abs(found.hot_admittance_s[1, :, 0] - hot).max() < 5e-3 * size
    assert np.abs(found.image_admittance_s[1, :, 0] - image).max() < 5e-3 * size


def test_wrong_requests_say_what_is_allowed() -> None:
    with pytest.raises(
        pr.ParameterError, match=r"frequencies has 30000 Hz: the modulation must be > 0 and ≤ 2.07e\+04"
    ):
        small_signals(MOTOR, DRIVE, frequencies=[30e3])
    tones = pr.TwoToneDrive(voltage_1=1.0, frequency_1=2e4, voltage_2=1.0, frequency_2=4e4)
    with pytest.raises(pr.ParameterError, match="give a TwoPhaseDrive"):
        small_signals(MOTOR, tones, frequencies=[1.0])


@pytest.mark.soak
def test_the_loop_gain_of_a_motor_that_sticks_is_that_of_its_resonance() -> None:
    paper = pr.load_motor("andersen2002").updated({"mount": None})
    lag = stator_lag(paper, 1, 0.2 * 2.0 * paper.modes[1].coupling_a_n_per_v)
    weak = pr.TwoPhaseDrive(voltage=0.2, frequency=lag.resonance_hz, phase_deg=180.0)  # moves the second mode alone
    tracker = pr.Tracker(kind="pll", voltage=0.2, frequency=lag.resonance_hz, bandwidth_hz=500.0)
    chosen = propose_filter(tracker, lag)
    source = TrackedSource(tracker, 1, chosen)
    running = running_loop(paper, source, Point.of(paper, weak, speed=0.0, contact="spring-slider"))
    # harmonic balance of the slider, which the closed form of the lag has, gives the loaded Q to some per cent
    assert running.crossover_hz == pytest.approx(500.0, rel=0.05)
    assert running.phase_margin_deg == pytest.approx(90.0 - degrees(atan(1.0 / 6.0)), abs=2.0)


@pytest.mark.soak
def test_the_command_prints_transfers_and_admittances(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    words = ["small-signals", MOTOR.name, "--voltage", "100", "--frequency", "46e3", "--speed", "6"]
    assert run([*words, "--frequencies", "1000", "--json", "--plot", str(tmp_path / "bode.png")]) == 0
    document = json.loads(capsys.readouterr().out)
    assert np.shape(document["hot_admittance_s"]) == (2, 2, 2, 2)
    assert np.shape(document["hot_admittance_error_s"]) == (2, 2, 2)
    assert np.shape(document["transfers"]["torque_per_amplitude"]) == (1, 2)
    assert document["units"]["speed_per_phase_deg"] == "rad/s/deg"
    assert (tmp_path / "bode.png").stat().st_size > 10_000
