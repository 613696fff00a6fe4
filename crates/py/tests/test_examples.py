"""Every example is run, and so is every cell of the notebooks."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from conftest import ROOT

EXAMPLES = ROOT / "examples" / "python"
#: Takes minutes, and has a test of its own.
LONG = {"learn_to_balance"}
SCRIPTS = sorted(path for path in EXAMPLES.glob("*.py") if path.stem not in LONG)
NOTEBOOKS = sorted(EXAMPLES.glob("*.ipynb"))


def test_there_are_examples():
    assert len(SCRIPTS) >= 5 and len(NOTEBOOKS) == 2


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_an_example_runs(path, tmp_path):
    pytest.importorskip("matplotlib")
    if "distributed" in path.read_text():
        pytest.importorskip("distributed")
    if "parquet" in path.read_text():
        pytest.importorskip("pyarrow")
    done = subprocess.run(
        [sys.executable, "-W", "error::FutureWarning", str(path)],
        cwd=tmp_path,
        env={**os.environ, "MPLBACKEND": "Agg"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() and "Warning" not in done.stderr
    # What it says of itself that it writes.
    docs = path.read_text().split('"""')[1]
    for word in docs.replace(",", " ").split():
        if word.endswith((".png", ".json", ".parquet")):
            assert (tmp_path / word).stat().st_size > 100, word


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_every_cell_of_a_notebook_runs(path, tmp_path, monkeypatch):
    nbformat = pytest.importorskip("nbformat")
    nbclient = pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    pytest.importorskip("matplotlib")
    # Backend of notebooks, whatever the shell says.
    monkeypatch.delenv("MPLBACKEND", raising=False)
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    # Kept without outputs: they are made afresh, here and wherever it is opened.
    assert all(not cell.outputs and cell.execution_count is None for cell in cells)
    client = nbclient.NotebookClient(
        notebook, timeout=120, kernel_name="python3", resources={"metadata": {"path": str(tmp_path)}}
    )
    client.execute()
    pictures = [output for cell in cells for output in cell.outputs if "image/png" in output.get("data", {})]
    said = "".join(output.get("text", "") for cell in cells for output in cell.outputs if output.get("name") == "stderr")
    assert len(pictures) >= 4 and not said, said
