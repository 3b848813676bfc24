"""The notebooks: each runs where a user opens it, is stored with its outputs, and its last cell checks its text."""

import re
from pathlib import Path
from shutil import copyfile

import nbformat
import pytest
from nbclient import NotebookClient

ROOT = Path(__file__).parents[1]
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))


def code_cells(book):
    return [cell for cell in book.cells if cell.cell_type == "code"]


def printed(book):
    """What the cells print: the words, and the numbers."""
    text = "".join(out.text for cell in code_cells(book) for out in cell.outputs if out.output_type == "stream")
    return NUMBER.sub("0", text).splitlines(), [float(number) for number in NUMBER.findall(text)]


def pictures(book):
    return [out for cell in code_cells(book) for out in cell.outputs if "image/png" in out.get("data", {})]


def test_there_are_six():
    assert len(NOTEBOOKS) == 6


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_is_stored_as_it_ran_and_ends_with_checks(path):
    book = nbformat.read(path, as_version=4)
    assert [cell.execution_count for cell in code_cells(book)] == list(range(1, len(code_cells(book)) + 1))
    assert not [out for cell in code_cells(book) for out in cell.outputs if out.output_type == "error"]
    assert pictures(book)
    assert "assert " in code_cells(book)[-1].source


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_runs_in_a_folder_of_its_own(path, tmp_path, monkeypatch):
    """A kernel starts in the notebook's folder; that the stored outputs are what is printed today is asked too."""
    monkeypatch.delenv("MPLBACKEND", raising=False)  # pictures go into the notebook
    copyfile(path, tmp_path / path.name)
    book = nbformat.read(tmp_path / path.name, as_version=4)
    stored = printed(book)
    NotebookClient(book, timeout=600, resources={"metadata": {"path": str(tmp_path)}}).execute()
    assert pictures(book)
    words, numbers = printed(book)
    assert words == stored[0]
    assert numbers == pytest.approx(stored[1], rel=0.02, abs=1e-6)
