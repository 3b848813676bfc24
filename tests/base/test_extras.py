"""The commands that messages advise are those of pyproject.toml, and name no package that nobody has published."""

import re
import tomllib
from pathlib import Path

import pytest

from rover_pin.base.errors import ParameterError
from rover_pin.base.extras import EXTRAS, install_command

ROOT = Path(__file__).parents[2]
PAGES = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *(ROOT / "docs").rglob("*.md"),
    *(ROOT / "notebooks").glob("*.ipynb"),
]
SUFFIXES = (".py", ".html", ".js", ".txt", ".c", ".cpp")
SOURCES = [file for file in (ROOT / "rover_pin").rglob("*") if file.suffix in SUFFIXES]


def test_the_table_is_that_of_pyproject():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    assert {name: list(needs) for name, needs in EXTRAS.items()} == {k: v for k, v in project.items() if k != "dev"}


def test_a_command_installs_the_requirement_itself():
    assert install_command("dem") == 'pip install "rasterio>=1.4"'
    with pytest.raises(ParameterError, match="'dem'"):
        install_command("dems")


def test_no_page_and_no_message_advises_a_package_that_nobody_has_published():
    texts = {file: file.read_text(encoding="utf-8") for file in (*PAGES, *SOURCES) if file.name != "extras.py"}
    assert len(texts) > 100
    assert not [file for file, text in texts.items() if re.search(r"pip install[^\n`&;]*rover[-_]pin", text)]
