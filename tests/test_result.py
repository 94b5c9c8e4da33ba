# SPDX-License-Identifier: GPL-3.0-or-later
"""What all results have in common: one line, a notebook's table and picture, plots, files, tables, the audit."""

from pathlib import Path

import numpy as np
import pytest
import xarray
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import pyspice_runner as pr
from pyspice_runner.datasets import Curves, Dataset, as_result
from pyspice_runner.result import Audit, Result, grouped
from pyspice_runner.units import engineering
from pyspice_runner.view.draw import plain
from tests.selection import mostly

pytestmark = pytest.mark.xdist_group("results")  # they are shared

NAMES = ("run", "admittance", "spectrum", "fit", "two-port", "comparison", "curves")


def curves(settled: bool = True) -> xarray.Dataset:
    """A curve with the efficiencies of a motor that a load drives: −10.5 and −30.7 % beyond no load."""
    speed = np.array([0.0, 1.0, 2.0, 3.0])
    quantities = {
        "torque_n_m": 1e-3 * np.array([3.0, 1.0, -1.0, -3.0]), "shaft_power_w": np.array([0.0, 0.1, -0.105, -0.307]),
        "efficiency": np.array([0.0, 0.1, -0.105, -0.307]), "power_a_w": np.full(4, 0.5), "power_b_w": np.full(4, 0.5),
        "current_a_rms_a": np.full(4, 0.04), "current_b_rms_a": np.full(4, 0.08),
        "settled": np.array([True, True, settled, True]),
    }  # fmt: skip
    return xarray.Dataset(
        {name: ("speed_rad_s", values, {"units": "1"}) for name, values in quantities.items()},
        {"speed_rad_s": ("speed_rad_s", speed, {"units": "rad/s"})},
        {"title": "a motor", "audit": '{"passed": true, "findings": []}'},
    )


@pytest.fixture(scope="module")
def results() -> dict[str, Result]:
    motor = pr.load_motor("andersen2002")
    drive = pr.TwoPhaseDrive(voltage=50.0, frequency=51.7e3, phase_deg=90.0)
    y = pr.admittance(motor, start=8e3, stop=70e3, points=600)
    spectrum = pr.Spectrum.from_admittance(y.frequency_hz, y.driven("A"), source="stator")
    return {
        "run": pr.simulate(motor, drive, duration=0.2e-3),
        "admittance": y,
        "spectrum": spectrum,
        "fit": pr.fit_spectrum(spectrum, modes=2),
        "two-port": pr.fit_spectrum(pr.Spectrum.from_admittance(y.frequency_hz, y.matrix_s, source="both"), modes=2),
        "comparison": pr.compare(spectrum, spectrum, modes=2),
        "curves": as_result(curves()),
    }


@pytest.mark.parametrize("name", mostly(pytest.mark.soak, NAMES, ["run", "curves"]))
@pytest.mark.soak
def test_a_result_is_one_line_and_in_a_notebook_a_table_with_a_picture(results: dict[str, Result], name: str) -> None:
    line = repr(results[name])
    assert "\n" not in line
    assert 30 < len(line) < 300
    assert line.startswith(f"{type(results[name]).__name__}(")
    page = results[name]._repr_html_()
    assert page.count("<tr>") == len(results[name].summary()) >= 3
    assert 'src="data:image/png;base64,iVBOR' in page


@pytest.mark.parametrize("name", mostly(pytest.mark.soak, NAMES, ["admittance", "fit"]))
def test_a_plot_returns_its_axes_fills_those_given_and_writes_its_file(
    results: dict[str, Result], name: str, tmp_path: Path
) -> None:
    ax = results[name].plot(tmp_path / "plot.png")
    assert isinstance(ax, Axes)
    assert (tmp_path / "plot.png").stat().st_size > 10_000
    own = Figure().subplots()
    assert results[name].plot(ax=own) is own
    assert own.get_xlabel() or own.get_ylabel()
    assert own.has_data()
    with pytest.raises(pr.ParameterError, match=r"There is no panel 'x'. The panels are \w+"):
        results[name].plot(ax=own, panel="x")
    with pytest.raises(pr.ParameterError, match=r"let it end in .png, .svg or .pdf"):
        results[name].plot(tmp_path / "plot.gif")


def test_without_path_and_axes_pyplot_shows_the_figure(results: dict[str, Result]) -> None:
    from matplotlib import pyplot

    ax = results["run"].plot(panel="forces")
    try:
        assert pyplot.fignum_exists(ax.figure.number)  # type: ignore[union-attr]
        assert ax.figure.axes == [ax]
    finally:
        pyplot.close(ax.figure)  # type: ignore[arg-type]


def test_files_and_tables_hold_the_same_columns(results: dict[str, Result], tmp_path: Path) -> None:
    for result in results.values():
        columns = result.columns()
        if not columns:
            continue
        first, *others = columns
        table = result.to_dataframe()
        assert [table.index.name, *table.columns] == [first, *others]
        dataset = result.to_xarray()
        assert list(dataset.coords) == [first]
        assert all(values.attrs["units"] for values in dataset.variables.values())
        written = np.genfromtxt(result.save(tmp_path / "a.csv"), delimiter=",", names=True)
        assert written.dtype.names == tuple(columns)
        for name, values in columns.items():
            assert np.allclose(written[name], values, rtol=1e-11, atol=0.0)
            assert np.array_equal(dataset[name].values, values)
        assert result.save(tmp_path / "a.nc").stat().st_size > 1000


def test_a_motor_is_a_table_in_every_result(results: dict[str, Result]) -> None:
    motor = pr.load_motor("andersen2002")
    tracked = pr.track(motor, pr.Tracker("none", 50.0, 51.7e3), duration=2e-3)
    driven = pr.drive_report(motor, pr.Driver("ideal", 50.0, 51.7e3), duration=0.5e-3, audit=False)
    documents = [result.to_dict() for result in (*results.values(), tracked, driven)]
    found = [document["motor"] for document in documents if "motor" in document]
    assert found == [motor.to_dict()] * len(found)
    assert len(found) >= 4


def test_the_audit_of_every_result_is_at_one_place(results: dict[str, Result]) -> None:
    for result in results.values():
        assert isinstance(result.audit, Audit)
        assert result.audit.to_dict() == {"passed": True, "findings": []}
    with pytest.raises(pr.SimulationError, match=r"Energy is missing\. The run is not returned"):
        Audit(("Energy is missing.",)).withhold("run")


@pytest.mark.parametrize(("name", "meant"), [("time", "time_s"), ("rotor_speed", "rotor_speed_rad_s")])
def test_an_unknown_attribute_is_answered_with_the_nearest(results: dict[str, Result], name: str, meant: str) -> None:
    with pytest.raises(AttributeError, match=f"Waveforms has no attribute '{name}'. Did you mean '{meant}'?"):
        getattr(results["run"], name)
    with pytest.raises(AttributeError, match=r"Admittance has no attribute 'frequency'. Did you mean 'frequency_hz'?"):
        results["admittance"].frequency  # type: ignore[attr-defined]  # noqa: B018


def test_the_efficiency_is_drawn_as_the_table_says_it() -> None:
    ax = Figure().subplots()
    Curves(curves()).plot(ax=ax, panel="efficiency")
    assert ax.lines[0].get_ydata() == pytest.approx([0.0, 10.0, -10.5, -30.7])
    low, high = ax.get_ylim()
    assert low < -30.7
    assert high > 10.0


def test_points_that_did_not_settle_are_marked_and_named() -> None:
    shaky = Curves(curves(settled=False))
    (caution,) = shaky.cautions
    assert caution.startswith("1 of 4 points did not settle")
    assert caution in shaky._repr_html_()
    for panel in ("torque", "efficiency", "power", "current"):
        ax = Figure().subplots()
        shaky.plot(ax=ax, panel=panel)
        rings = [line for line in ax.lines if line.get_markerfacecolor() == "none"]
        assert {tuple(np.atleast_1d(ring.get_xdata())) for ring in rings} == {(2.0,)}
        legend = ax.get_legend()
        assert "not settled" in [text.get_text() for text in legend.get_texts()]


@pytest.mark.soak
def test_a_dataset_is_saved_plotted_and_tabled_like_a_result(tmp_path: Path) -> None:
    plain = curves(settled=False)
    data = Dataset(plain.data_vars, plain.coords, plain.attrs)
    for kept in (data, data.isel(speed_rad_s=slice(None))):
        assert kept.save(tmp_path / "curve.nc").stat().st_size > 1000
        assert isinstance(kept.plot(tmp_path / "plot.png"), Axes)
        assert kept.plot(ax=Figure().subplots(), panel="efficiency").get_ylabel() == "efficiency in %"
        assert kept.cautions == kept.piezomotor.cautions != ()
    assert list(data.to_dataframe().columns) == list(data.data_vars)
    assert repr(data).startswith("<xarray.Dataset>")
    data.plot.scatter(x="speed_rad_s", y="torque_n_m", ax=Figure().subplots())  # xarray's own plots stay
    read = xarray.open_dataset(tmp_path / "curve.nc", engine="h5netcdf")
    assert read.piezomotor.save(tmp_path / "curve.csv").read_text().startswith("speed_rad_s,torque_n_m")
    with pytest.raises(pr.ParameterError, match=r"let it end in .nc, .csv or .json"):
        data.save(tmp_path / "curve.txt")


def test_a_figure_says_what_to_know_before_using_it(tmp_path: Path) -> None:
    ax = Curves(curves(settled=False)).plot(tmp_path / "plot.svg")
    assert "Caution: 1 of 4 points did not settle" in ax.figure.get_supxlabel()  # type: ignore[union-attr]
    assert Curves(curves()).plot(tmp_path / "plot.svg").figure.get_supxlabel() == ""  # type: ignore[union-attr]


def test_values_are_written_with_the_prefix_of_their_unit() -> None:
    written = {(0.0123, "N·m"): "12.3 mN·m", (45.2e3, "Hz"): "45.2 kHz", (0.045, "rad/s"): "0.045 rad/s"}
    for (value, unit), text in written.items():
        assert engineering(value, unit).replace("\N{NO-BREAK SPACE}", " ") == text
    assert engineering(None, "V") == engineering(float("nan"), "V") == engineering(float("inf"), "V") == "–"


def test_a_value_with_its_unit_is_drawn_without_a_box() -> None:
    assert (
        plain(f"a tension of {engineering(1.9e9, 'Pa')}\x07 and $")
        == "a tension of 1.9 GPa\N{REPLACEMENT CHARACTER} and \\$"
    )


def test_cautions_of_points_are_grouped_across_prefixes_with_the_worst_value() -> None:
    """The unit has a space that does not break; the shortest time until the tip is worn is the worst."""
    tension, worn = "a tension of {}\u00a0{}Pa; its strength is 380\u00a0MPa.", "after {}\u00a0{}s it is worn."
    points = [
        [tension.format(1.9, "G"), worn.format(38.7, "")],
        [tension.format(900, "M"), worn.format(967.7, "m")],
        [],
    ]
    found = [f"2 of 3 points: {tension.format(1.9, 'G')}", f"2 of 3 points: {worn.format(967.7, 'm')}"]
    assert grouped(points) == found
    assert grouped(points[:2]) == [sentence.removeprefix("2 of 3 points: ") for sentence in found]
