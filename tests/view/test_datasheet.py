# SPDX-License-Identifier: GPL-3.0-or-later
"""The report opened in a browser: drawn, moving, usable without a mouse, complete, and quick to show itself."""

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import pytest
import xarray
from playwright.sync_api import Browser, Page

import pyspice_runner as pr
from pyspice_runner.calibration.result import (
    Estimate,
    Record,
    RecordedCurve,
    RecordedPoint,
    RecordedRival,
    RecordedValues,
    SetFit,
)
from pyspice_runner.circuit.motor import motor_library
from pyspice_runner.motor.circuit_file import circuit_toml
from pyspice_runner.motor.equivalent import EquivalentCircuit, MotionalArm
from pyspice_runner.motor.motor import Provenance
from pyspice_runner.steady.speed_torque import no_load_state
from pyspice_runner.units import engineering
from pyspice_runner.view import charts
from pyspice_runner.view.datasheet import Report, datasheet, downloads, parameter_rows
from tests.circuit.batch import writes_a_raw_file
from tests.motors import BEAM40, recommended
from tests.motors import motor as motor_without_a_beam
from tests.view.pages import PHONE, first_paint_share, opened
from validation.fuzz.nasty import ATTEMPTS

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("report")]

CHARTS = ["modes", "tip", "admittance", "circle", "curve", "spin-up", "electrical"]
READY = "html[data-ready]"


@pytest.fixture(scope="module")
def measured() -> pr.Spectrum:
    """A resonator on a capacitor, as an analyser might have seen it."""
    frequency = np.linspace(40e3, 60e3, 80)
    omega = 2.0 * np.pi * frequency
    arm = 1.0 / (900.0 + 1j * omega * 0.16 + 1.0 / (1j * omega * 60e-12))
    return pr.Spectrum.from_admittance(frequency, arm + 1j * omega * 2.2e-9)


@pytest.fixture(scope="module")
def report(measured: pr.Spectrum) -> Report:
    drive = pr.TwoToneDrive(voltage_1=100.0, frequency_1=18e3, voltage_2=50.0, frequency_2=54e3, phase_deg=165.0)
    motor = pr.load_motor("andersen2002").updated({"mount": None})  # on which this drive turns the rotor
    with pytest.MonkeyPatch.context() as fewer:
        fewer.setattr("pyspice_runner.view.datasheet.SPEEDS", 4)
        return pr.report(motor, drive, duration=1e-3, levels=(1.0,), measured=measured, connection="A-B")


@pytest.fixture(scope="module")
def page_file(report: Report, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return report.save(tmp_path_factory.mktemp("report") / "report.html")


@pytest.fixture(scope="module")
def desktop(browser: Browser, page_file: Path) -> Iterator[tuple[Page, list[str]]]:
    page, wrong = opened(browser, page_file, READY, reduced_motion="reduce")
    yield page, wrong
    page.close()


def drawn_path(page: Page, chart: str) -> str:
    """The shape of every line and marker of a chart, as the browser has it."""
    script = "id => [...document.querySelectorAll(`#${id} .trace path`)].map(p => p.outerHTML).join()"
    return str(page.evaluate(script, chart))


def test_the_page_is_small_and_paints_before_all_charts_are_drawn(
    page_file: Path, desktop: tuple[Page, list[str]]
) -> None:
    assert page_file.stat().st_size < 8_000_000
    page, wrong = desktop
    assert wrong == []
    assert first_paint_share(page) < 0.4  # READY is the last chart; measured 0.14
    text = page_file.read_text(encoding="utf-8")
    assert not re.search(r"""<(?:script|img|iframe|link)[^>]+(?:src|href)=["'](?!data:)""", text)


def test_every_chart_is_drawn_with_every_line(desktop: tuple[Page, list[str]]) -> None:
    page, _ = desktop
    assert page.eval_on_selector_all(".chart", "all => all.map(one => one.id)") == CHARTS
    for name in CHARTS:
        wanted, seen = page.evaluate(
            """id => [document.getElementById(id).data.filter(t => t.visible !== false).length,
                      document.querySelectorAll(`#${id} .trace.scatter`).length]""",
            name,
        )
        assert seen == wanted > 0, name
        size = page.locator(f"#{name} .main-svg").first.bounding_box()
        assert size["width"] > 600
        assert size["height"] > 250
        assert re.search(r'd="M[\d.,-]+L', drawn_path(page, name)), name


def test_the_charts_show_the_numbers_of_the_run(
    report: Report, measured: pr.Spectrum, desktop: tuple[Page, list[str]]
) -> None:
    page, _ = desktop
    points = """([id, name]) => document.getElementById(id).calcdata
        .filter(([first]) => first.trace.visible === true && first.trace.name.startsWith(name))
        .map(line => line.map(point => [point.x, point.y]))"""
    curve = np.array(page.evaluate(points, ["curve", "100 %"])[0])
    assert np.allclose(curve[:, 1], 1e3 * report.curves[1.0]["torque_n_m"].values, rtol=1e-6)
    page.select_option("#connection", "A-B")
    circle = np.array(page.evaluate(points, ["circle", "measured"])[0])
    assert np.allclose(circle[:, 0] + 1j * circle[:, 1], 1e3 * measured.admittance_s, rtol=1e-6)
    page.select_option("#connection", "A")
    assert page.evaluate(points, ["circle", "measured"]) == []  # it was taken as A−B


def check_that_the_tool_bar_covers_nothing(page: Page) -> None:
    covered = """id => {
        const chart = document.getElementById(id), bar = chart.querySelector('.modebar').getBoundingClientRect();
        const over = b => b.left < bar.right && bar.left < b.right && b.top < bar.bottom && bar.top < b.bottom;
        return [...chart.querySelectorAll('.legend, .annotation, .xtick, .ytick, .xtitle, .ytitle, .bglayer .bg')]
            .filter(one => one.getBoundingClientRect().width && over(one.getBoundingClientRect()))
            .map(one => one.getAttribute('class'));
    }"""
    for name in CHARTS:
        assert page.evaluate(covered, name) == [], name


def test_the_tool_bar_covers_nothing(desktop: tuple[Page, list[str]]) -> None:
    check_that_the_tool_bar_covers_nothing(desktop[0])


def test_the_motion_plays_and_pauses_by_keyboard(desktop: tuple[Page, list[str]]) -> None:
    page, wrong = desktop
    for name in ("modes", "tip"):
        player = page.locator(f'[data-plays="{name}"]')
        button, position = player.locator("button"), player.locator("input")
        button.scroll_into_view_if_needed()
        button.focus()
        assert button.inner_text() == "Play"  # who asks for less motion starts it himself
        before = drawn_path(page, name)
        page.keyboard.press("Space")
        page.wait_for_function("([b, a]) => b.value > a", arg=[position.element_handle(), 3])
        assert button.inner_text() == "Pause"
        assert drawn_path(page, name) != before
        page.keyboard.press("Enter")
        assert button.inner_text() == "Play"
        paused = drawn_path(page, name)
        page.wait_for_timeout(150)
        assert drawn_path(page, name) == paused
        page.keyboard.press("Tab")
        page.keyboard.press("Home")
        page.keyboard.press("ArrowRight")
        assert position.input_value() == "1"
        assert drawn_path(page, name) != paused
        page.keyboard.press("Tab")
        page.keyboard.press("ArrowDown")
        assert player.locator("select").input_value() == "2"
    assert wrong == []


def test_the_keyboard_zooms_moves_and_resets_a_chart(desktop: tuple[Page, list[str]]) -> None:
    page, _ = desktop
    ranges = "() => document.getElementById('admittance')._fullLayout.xaxis.range"
    low, high = page.evaluate(ranges)
    page.locator("#admittance").focus()
    page.keyboard.press("+")
    page.wait_for_function(f"([l, h]) => (({ranges})()[1] - ({ranges})()[0]) < 0.51 * (h - l)", arg=[low, high])
    inner = page.evaluate(ranges)
    page.keyboard.press("ArrowRight")
    page.wait_for_function(f"l => ({ranges})()[0] > l", arg=inner[0])
    page.keyboard.press("0")
    page.wait_for_function(f"([l, h]) => ({ranges})()[0] < l && ({ranges})()[1] > h", arg=[low, high])  # the whole band


@pytest.mark.soak
def test_downloads_are_complete(report: Report, desktop: tuple[Page, list[str]], tmp_path: Path) -> None:
    page, _ = desktop
    names = page.eval_on_selector_all(".downloads a", "all => all.map(one => one.download)")
    for number, name in enumerate(names):
        with page.expect_download() as waiting:
            page.locator(".downloads a").nth(number).click()
        assert waiting.value.suggested_filename == name
        waiting.value.save_as(tmp_path / name)
        page.wait_for_timeout(110)  # of more than ten downloads a second Chromium drops what comes after
    text = {name: (tmp_path / name).read_text(encoding="utf-8") for name in names}
    assert text["motor.lib"] == motor_library(report.motor)
    assert text["run.cir"] == report.run.deck
    assert pr.load_motor(tmp_path / "motor.toml").to_dict() == report.motor.to_dict()
    assert json.loads(text["report.json"]) == json.loads(json.dumps(report.to_dict()))
    again = pr.read_spectrum(tmp_path / "admittance_free.csv")
    assert np.allclose(again.matrix_s, report.spectra["free"].matrix_s, rtol=1e-9)
    assert len(text["speed_torque.csv"].splitlines()) == 1 + sum(c["settled"].size for c in report.curves.values())
    periods = np.loadtxt(tmp_path / "last_periods.csv", delimiter=",", skiprows=1)
    assert np.ptp(periods[:, 0]) == pytest.approx(3 * report.drive.period, rel=0.01)
    for name in ("run.cir", "admittance_free.cir", "admittance_preloaded.cir"):
        writes_a_raw_file(tmp_path / name)


# --- what the page says ---


def test_every_parameter_has_its_unit_and_its_origin(report: Report) -> None:
    rows = {row.path: row for row in parameter_rows(report.motor)}
    assert (rows["contact.preload_n"].value, rows["contact.preload_n"].unit) == ("5", "N")
    assert rows["damping.alpha_per_s"].kind == "given"
    assert rows["patches.1.thickness_m"].note == "plate of a common thickness"  # shared by the patches
    assert rows["modes.0.mass_kg"].kind == "derived"
    changed = {row.path: row for row in parameter_rows(report.motor.updated({"contact.preload_n": 7.0}))}
    assert changed["contact.preload_n"].kind == "set"


def test_a_motor_without_a_beam_says_why_no_shape_moves(report: Report) -> None:
    page = datasheet(replace(report, motor=motor_without_a_beam(), measured=None))
    assert 'data-plays="modes"' not in page
    assert "so their shapes are not known" in page


@pytest.mark.soak
def test_the_page_has_the_loop_gain_of_a_tracker_and_the_numbers_of_track(report: Report) -> None:
    motor, drive = recommended("bimodal40")
    tracker = pr.Tracker(
        kind="pll", voltage=drive.voltage, frequency=drive.frequency, phase_deg=drive.phase_deg, offset=0.01
    )
    tracking = pr.track(motor, tracker, averaged=True)
    assert tracking.loop is not None
    # as small signals of the full motor estimate it; those of the averaged motor have no error
    tracking = replace(tracking, loop=replace(tracking.loop, margin_error_deg=0.3))
    tracked = replace(report, tracking=tracking)
    page = datasheet(tracked)
    section = unescape(page.partition('<section id="tracker"')[2].partition("</section>")[0])
    rows = dict(re.findall(r'<th scope="row">(.*?)</th><td>(.*?)</td>', section))
    assert rows == tracking.summary()
    assert (
        rows["phase margin"] == f"{tracking.loop.phase_margin_deg:.1f}° ± 0.3° at {tracking.loop.crossover_hz:.4g} Hz"
    )
    assert f"{1e-3 * tracking.end_frequency_hz:.6g} kHz, by design" in rows["frequency reached"]
    assert {"static phase error", "running resonance", "locked"} <= set(rows)
    assert 'data-figure="loop"' in section
    gain, _, phase, margin = charts.loop_gain(tracking.loop).data
    at = np.log(tracking.loop.crossover_hz)
    # between two of 100 points a decade a straight line is off by much less than 0.1 % and 0.1°
    assert np.exp(np.interp(at, np.log(gain.x), np.log(gain.y))) == pytest.approx(1.0, abs=1e-3)
    assert np.interp(at, np.log(phase.x), phase.y) == pytest.approx(tracking.loop.phase_margin_deg - 180.0, abs=0.1)
    assert list(margin.y) == [-180.0, tracking.loop.phase_margin_deg - 180.0]
    assert tracked.to_dict()["tracking"]["loop"]["crossover_hz"] == tracking.loop.crossover_hz
    assert "track.cir" in downloads(tracked)
    lost = datasheet(replace(report, tracking=replace(tracking, loop=None)))
    assert "There is no loop gain" in lost
    assert 'data-figure="loop"' not in lost
    assert 'id="tracker"' not in datasheet(report)
    with pytest.raises(pr.ParameterError, match="tracking is a run of bimodal40 with other parameters than beam40"):
        pr.report(pr.load_motor(BEAM40), drive, tracking=tracking)


@pytest.mark.soak
def test_no_text_from_outside_runs_in_the_page(
    report: Report, browser: Browser, desktop: tuple[Page, list[str]], tmp_path: Path
) -> None:
    """Where values come from, and the name of a spectrum, are the texts that may be any."""
    count = "document.querySelectorAll('script, img, iframe, link, [onerror]').length"
    usual = desktop[0].evaluate(count)
    words = "\n".join(ATTEMPTS.values())[:20_000]
    origins = dict.fromkeys(("contact.friction", "modes.0.mass_kg"), Provenance("given", words))
    assert report.measured is not None
    hostile = replace(
        report,
        motor=report.motor.model_copy(update={"provenance": origins}),
        measured=replace(report.measured, source=words),
    )
    file = hostile.save(tmp_path / "report.html")
    assert "<script>alert" not in file.read_text(encoding="utf-8")
    page, wrong = opened(browser, file, READY, reduced_motion="reduce")
    assert page.evaluate(count) == usual
    assert "<img src=x onerror=alert(1)>" in (page.text_content("#parameters") or "")  # also of what is folded
    assert wrong == []
    page.close()


@pytest.mark.soak
def test_a_calibration_has_its_section(report: Report, browser: Browser, tmp_path: Path) -> None:
    value = Estimate(
        value=0.25, standard_error=2e-3, interval_95=(0.246, 0.254), identifiable=False, start=0.3, unit="1"
    )
    torques = [(1, 0.011, 0.0112), (2, 0.0061, 0.006), (3, 0.004, None)]
    record = Record(
        motor="andersen2002", data="points.csv <b>", contact="brush", parameters={"contact.friction": value},
        rms_residual=1.1, warnings=["The data do not identify contact.friction <img src=x onerror=alert(1)>"],
        fits=[SetFit(data="points.csv", values=3, squares=5.0, expected=2.0, probability=0.08)],
        points=[RecordedPoint(point=number, quantity="torque_n_m", measured=measured, predicted=predicted, error=1e-4)
                for number, measured, predicted in torques],
        curves=[
            RecordedCurve(data="free.csv (free) <b>", along="frequency_hz", at=[40e3, 41e3], quantities={
                name: RecordedValues(measured=[1.0, 2.0], predicted=[1.1, None], error=[0.1, 0.1])
                for name in ("admittance_real_s", "admittance_imaginary_s")
            }),
            RecordedCurve(data="spinup.csv", along="time_s", at=[0.0, 1e-3], quantities={
                "speed_rad_s": RecordedValues(measured=[0.0, 2.0], predicted=[0.0, 1.8], error=[0.1, 0.1])
            }),
        ],
        rivals=[RecordedRival(contact="coulomb", aicc=None, verdict="failed: no steady state <b>")], aicc=12.0,
    )  # fmt: skip
    assert 'id="calibration"' not in datasheet(report)
    page, wrong = opened(
        browser, replace(report, calibration=record).save(tmp_path / "report.html"), READY, viewport=PHONE
    )
    told = page.inner_text("#calibration")
    assert "0.246 to 0.254" in told
    assert "onerror=alert(1)" in told
    assert page.inner_text("#calibration tbody >> nth=0").split("\t")[-1] == "no"
    values = "([id, place, axis]) => Array.from(document.getElementById(id)._fullData[place][axis])"
    for at, expected in (
        (["residuals", 0, "y"], [2.0, -1.0, np.nan]),
        (["residuals-0", 1, "y"], [1.0, np.nan]),
        (["residuals-1", 0, "y"], [0.0, -2.0]),
        (["residuals-1", 0, "x"], [0.0, 1.0]),  # ms
    ):
        assert page.evaluate(values, at) == pytest.approx(expected, nan_ok=True)
    assert "failed: no steady state <b>" in told
    assert "of a motor with other values of contact.friction" in page.inner_text("main")
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    assert wrong == []
    page.close()


@pytest.mark.soak
def test_the_motor_to_play_with_runs_in_the_report(report: Report, desktop: tuple[Page, list[str]]) -> None:
    page, _ = desktop
    page.click("#start-live")
    frame = page.frame_locator("#live iframe").locator("html[data-state=ready]")
    frame.wait_for(state="attached", timeout=60_000)
    assert report.motor.name in page.frame_locator("#live iframe").locator("#motor-choice option").inner_text()
    assert float(frame.get_attribute("data-speed") or "nan") != 0.0
    page.evaluate("document.querySelector('#live iframe').remove()")  # its further curves take 14 s of a processor


def test_what_is_missing_is_named(report: Report, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "plotly.offline", None)
    with pytest.raises(pr.ParameterError, match=r"A report needs plotly.*piezomotor\[report\]"):
        report.save(tmp_path / "report.html")


# --- what was run ---


def test_the_curves_reach_from_standstill_beyond_no_load(report: Report) -> None:
    for curve in report.curves.values():
        assert curve["speed_rad_s"].values[0] == 0.0
        assert curve["load_torque_n_m"].values[-1] < 0.0 < curve["load_torque_n_m"].values[-2]
    curve = report.curves[1.0]
    assert report.key_figures["stall_torque_n_m"] == curve["torque_n_m"].values[0] > 0.0
    assert report.key_figures["no_load_speed_rad_s"] == pytest.approx(without_load(curve), rel=0.02)


def without_load(curve: xarray.Dataset) -> float:
    """The speed at which the held shaft takes no torque, by a straight line between the last two points."""
    loads, speeds = (curve[name].values[[-1, -2]] for name in ("load_torque_n_m", "speed_rad_s"))
    return float(np.interp(0.0, loads, speeds))


def test_a_transducer_has_a_sheet_without_a_shaft(browser: Browser, tmp_path: Path) -> None:
    circuit = EquivalentCircuit((MotionalArm(643.2, 68.87e-3, 230.5e-12),), 2.402e-9, 0.0, 40e3)
    load = '[load]\nmode = "arm1"\nresistance_ohm = 643.2\n'
    (file := tmp_path / "air.toml").write_text(circuit_toml(circuit) + load)
    report = pr.report(motor := pr.load_motor(file), pr.default_drive(motor))
    assert report.key_figures["power_w"] == pytest.approx(0.5 * 50.0**2 / (2.0 * 643.2), rel=1e-4)
    assert report.run.electrical()["power_w"] == pytest.approx(report.key_figures["power_w"], rel=0.01)
    assert json.loads(json.dumps(report.to_dict()))["speed_torque"] == []
    report.plot(tmp_path / "air.png")
    page, wrong = opened(browser, report.save(tmp_path / "air.html"), READY)
    assert wrong == []
    assert page.eval_on_selector_all(".chart", "all => all.map(one => one.id)") == [
        "admittance",
        "circle",
        "electrical",
    ]
    shown = page.inner_text("body")
    page.click("#start-live")  # the page that it opens has tests of its own
    page.wait_for_function("document.querySelector('#live iframe')?.srcdoc.includes('Live model of the transducer')")
    page.close()
    assert {"without load", "under load"} <= {line.split("\t")[0] for line in shown.splitlines()}
    assert not re.search("rotor|torque|speed|tip ", shown)


@pytest.mark.soak
def test_the_headline_is_that_of_steady_states(monkeypatch: pytest.MonkeyPatch) -> None:
    """The rotor of beam40 still accelerates when the run ends."""
    monkeypatch.setattr("pyspice_runner.view.datasheet.SPEEDS", 5)
    motor, drive = recommended(BEAM40)
    report = pr.report(motor, drive, duration=1e-3)
    figures = {name: value or np.nan for name, value in report.key_figures.items()}
    # the averaged motor is within 1 % of speed and power here; the curve bends a little between its last points
    settled = pr.simulate_averaged(motor, drive, duration=0.3)
    assert figures["no_load_speed_rad_s"] == pytest.approx(settled.rotor_speed_rad_s[-1], rel=0.015)
    assert figures["electrical_power_w"] == pytest.approx(settled.electrical_power_w[-1], rel=0.015)
    assert figures["power_a_w"] + figures["power_b_w"] == figures["electrical_power_w"]
    assert f"{engineering(figures['electrical_power_w'], 'W')}</dd>" in datasheet(report)
    assert figures["no_load_speed_rad_s"] == pytest.approx(without_load(report.curves[1.0]), rel=0.01)
    half = report.curves[0.5]
    assert half["load_torque_n_m"].values[-1] < 0.0
    # the best efficiency takes most of its axis, however far the curves are driven
    driven = {
        level: curve.assign(efficiency=curve["efficiency"] - 0.8 * (level < 1.0))
        for level, curve in report.curves.items()
    }
    low, high = charts.speed_torque(driven).layout.yaxis3.range
    assert 100.0 * figures["best_efficiency"] > 0.85 * (high - low)


@pytest.mark.soak
def test_what_is_not_settled_is_not_a_headline(report: Report) -> None:
    free = report.free
    assert free is not None
    curves = {level: curve.assign(settled=curve["settled"] & False) for level, curve in report.curves.items()}
    restless = replace(report, curves=curves, free=replace(free, floquet_multipliers=np.array([1.5 + 0.0j])))
    figures = restless.key_figures
    assert all(value is None for value in figures.values())
    assert any(caution.endswith("The steady state is not stable: jump.") for caution in restless.cautions)
    assert restless.summary()["electrical power, no load"] == "–"
    assert datasheet(restless).count("<dd>–</dd>") == 5


@pytest.mark.soak
def test_dry_friction_of_the_bearing_lowers_the_speed_without_load_or_stops_the_rotor() -> None:
    motor, drive = recommended(BEAM40)
    rough = motor.updated({"rotor.bearing_friction_n_m": 1e-3})
    free = no_load_state(rough, drive)
    held = pr.speed_torque(rough, drive, speeds=[free.speed_rad_s])
    assert abs(held["load_torque_n_m"].item()) < 0.02e-3  # of the 1 mN·m; the error of the torque is 0.01 mN·m
    assert no_load_state(motor.updated({"rotor.bearing_friction_n_m": 0.05}), drive) is None
