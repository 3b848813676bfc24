"""The notebooks: each runs from the top, as its cells stand, and the last cell checks what its text says."""

import json
import os
from pathlib import Path

import matplotlib
import pytest

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))


def cells(notebook, kind):
    return [cell for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == kind]


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A folder with what notebooks find in a checkout; what they write goes here."""
    for name in ("studies", "urdf"):
        (tmp_path / name).symlink_to(ROOT / name)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_there_are_three():
    assert len(NOTEBOOKS) == 3


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_stores_no_output_and_ends_with_its_checks(notebook):
    code = cells(notebook, "code")
    assert not any(cell["outputs"] or cell["execution_count"] for cell in code)
    assert "assert " in "".join(code[-1]["source"])
    assert "from the top, in the folder of the repository" in "".join(cells(notebook, "markdown")[0]["source"])


@pytest.mark.slow
@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_its_cells_run(notebook, checkout):
    names = {"__name__": "__main__"}
    with matplotlib.rc_context({"figure.max_open_warning": 0}):
        for cell in cells(notebook, "code"):
            exec(compile("".join(cell["source"]), notebook.name, "exec"), names)
        names["plt"].close("all") if "plt" in names else None


@pytest.mark.slow
@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_jupyter_runs_it(notebook, checkout, monkeypatch):
    nbclient = pytest.importorskip("nbclient")
    nbformat = pytest.importorskip("nbformat")
    pytest.importorskip("ipykernel")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]))
    monkeypatch.delenv("MPLBACKEND", raising=False)  # pictures go into the notebook
    book = nbformat.read(notebook, as_version=4)
    nbclient.NotebookClient(book, timeout=600, resources={"metadata": {"path": str(checkout)}}).execute()
    pictures = [out for cell in book.cells for out in cell.get("outputs", []) if "image/png" in out.get("data", {})]
    assert pictures
