# SPDX-License-Identifier: GPL-3.0-or-later
"""The notebook of the examples runs from top to bottom and shows tables and pictures."""

from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

from tools.notebooks import NOTEBOOKS, ROOT, notebook_of

NOTEBOOK = Path(__file__).resolve().parents[2] / "examples" / "notebook.ipynb"
SHOWN = ("Motor", "Waveforms", "Admittance", "SpectrumFit", "TwoPortFit", "Trend", "Curves", "Sweep", "SteadyState",
         "AveragedRun", "DriveReport",
         "Tracking")  # fmt: skip


@pytest.mark.soak
def test_the_notebook_shows_every_main_result_with_a_table_and_a_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))  # of the sweep
    monkeypatch.setenv("PYTHONPATH", str(NOTEBOOK.parents[1]))
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(tmp_path)}}).execute()
    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    displays = [output.data for output in outputs if "data" in output]
    shown = [data["text/html"] for data in displays if "text/html" in data]
    for name in SHOWN:
        (found,) = [text for text in shown if text.startswith(f"<div><strong>{name}<")]
        assert "<table><tr><th" in found
        assert 'src="data:image/png;base64,iVBOR' in found
    assert any("image/png" in data for data in displays)  # drawn into Axes of the user's own
    assert all(
        len(data["text/plain"].splitlines()) == 1 for data in displays if "<strong>" in data.get("text/html", "")
    )


def test_the_notebook_is_kept_without_outputs() -> None:
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    assert [cell.id for cell in notebook.cells if cell.cell_type == "code" and cell.outputs] == []


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_the_notebook_of_a_tutorial_is_its_page(name: str) -> None:
    page = (ROOT / "docs" / NOTEBOOKS[name]).read_text(encoding="utf-8")
    assert (ROOT / "examples" / name).read_text(encoding="utf-8") == notebook_of(page)


@pytest.mark.soak
@pytest.mark.parametrize("name", NOTEBOOKS)
def test_the_notebook_of_a_tutorial_runs(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    notebook = nbformat.read(ROOT / "examples" / name, as_version=4)
    NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(tmp_path)}}).execute()
    *_, last = (cell for cell in notebook.cells if cell.cell_type == "code")
    position, step = map(float, last.outputs[0].text.split())
    assert position - 0.05 == pytest.approx(-1.6e-3, abs=step)  # as the page says
