"""The pages do what they say: their Python runs, their commands and options are there, what they quote comes out."""

import importlib
import importlib.util
import re
import shlex
from pathlib import Path

import gallery
import pandas as pd
import pytest
import typer.main

import rover_pin
from rover_pin.cli.app import app
from rover_pin.scenarios.scenes import SCENES

ROOT = Path(__file__).parents[1]
FILES = [*sorted((ROOT / "docs").glob("*.md")), ROOT / "CONTRIBUTING.md", ROOT / "README.md"]
PAGES = {path.name: path.read_text(encoding="utf-8") for path in FILES}
GROUP = typer.main.get_group(app)


def commands(text):
    """Yield the commands in a page: lines of its blocks, and what stands between backquotes."""
    for block in re.findall(r"```sh\n(.*?)```", text, re.DOTALL):
        yield from (line.split("#")[0].strip() for line in block.splitlines() if line.startswith("rover-pin "))
    yield from re.findall(r"`(rover-pin [^`]+)`", re.sub(r"```.*?```", "", text, flags=re.DOTALL))


@pytest.mark.parametrize("name", PAGES)
def test_its_commands_and_their_options_are_there(name):
    for line in commands(PAGES[name]):
        _, command, *words = shlex.split(line)
        if command in ("COMMAND", "--help"):
            continue
        assert command in GROUP.commands, line
        is_known = {option for parameter in GROUP.commands[command].params for option in parameter.opts} | {"--help"}
        assert {word for word in words if word.startswith("-")} <= is_known, line


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, text in PAGES.items() if "```python" in text])
def test_its_python_runs(name, capsys, tmp_path, monkeypatch):
    (tmp_path / "studies").symlink_to(ROOT / "studies")
    monkeypatch.chdir(tmp_path)
    names = {"__name__": __name__}  # dataclasses look their module up by name
    for code in re.findall(r"```python\n(.*?)```", PAGES[name], re.DOTALL):
        exec(compile(code, name, "exec"), names)
        assert capsys.readouterr().out


def test_the_pictures_and_pages_it_names_are_there():
    for name, text in PAGES.items():
        home = ROOT / "docs" if (ROOT / "docs" / name).is_file() else ROOT
        for target in re.findall(r"\]\(([\w/.-]+\.(?:png|gif|md|cff))(?:#[\w-]+)?\)", text):
            is_generated = target.startswith(("catalogue/", "plots/")) or target in ("api.md", "commands.md")
            is_generated |= (ROOT / target).with_suffix(".ipynb").is_file()  # `mkdocs build` is strict about the rest
            assert is_generated or (home / target).is_file(), f"{name}: {target}"


def test_the_files_and_tests_that_contributing_names_are_there():
    """A path counts from the root, the package or the tests; `my_` and capitals stand for a name to choose."""
    text = re.sub(r"```.*?```", "", PAGES["CONTRIBUTING.md"], flags=re.DOTALL)
    words = {word for code in re.findall(r"`([^`]+)`", text) for word in code.split()}
    to_choose = re.compile(r"my_|[A-Z]{3}")
    paths = {
        word for word in words if re.fullmatch(r"[\w./-]*/[\w./-]*|[\w.-]+\.py", word) and not to_choose.search(word)
    }
    homes = (ROOT, ROOT / "rover_pin", ROOT / "tests")
    assert len(paths) > 50
    assert {path for path in paths if not any((home / path).exists() for home in homes)} == set()
    tests = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "tests").rglob("test_*.py"))
    named = {word for word in words if re.fullmatch(r"test_\w+", word)}
    assert {name for name in named if f"def {name}(" not in tests} == set()


def test_the_paper_page_is_made_of_every_strict_failure(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    rows = list(importlib.import_module("make_pages").contradictions())
    text = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "tests" / "paper").glob("test_*.py"))
    matches = re.findall(r"\bstrict=True, reason=\"|(?<!def )\b(?:differs|contradicts)\(", text)
    assert len(rows) == len(matches) > 15
    assert all(measured for *_, measured in rows)


def test_the_python_reference_has_a_page_for_each_room_and_each_public_name_once(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    pages = importlib.import_module("make_pages")._api()
    documented = re.findall(r"^::: (\S+)$", "\n".join(pages.values()), re.MULTILINE)
    assert len(documented) == len(set(documented))
    names = set(rover_pin.__all__) - {"__version__"}
    assert names <= {path.rpartition(".")[2] for path in documented}
    for path in documented:
        room = path.split(".")[1]
        assert f"::: {path}\n" in pages[f"api/{room}.md"] + "\n"
        assert f"](api/{room}.md#{path})" in pages["api.md"]


KEPT_DRIVES = pd.read_csv(ROOT / "studies" / "results" / "gallery.csv", index_col="command").outcome


@pytest.mark.slow
@pytest.mark.parametrize("command", KEPT_DRIVES.index)
def test_the_gallery_says_what_becomes_of_the_rover(command):
    outcome = gallery.drive_of(command.removeprefix("rover-pin drive ")).drive().attrs["outcome"]
    assert outcome == KEPT_DRIVES[command]


def test_the_gallery_has_every_scenario_and_picture():
    drives = {f"rover-pin drive {name}" for name in set(SCENES) - {"polyline", "grid"}}
    assert set(KEPT_DRIVES.index) == drives | {f"rover-pin drive {words}" for words in gallery.PICTURES.values()}
    assert all((ROOT / "docs" / picture).is_file() for picture in gallery.PICTURES)


def test_every_page_is_found_from_the_list_of_pages():
    listed = set(re.findall(r": ([\w/-]+\.md)$", (ROOT / "mkdocs.yml").read_text(encoding="utf-8"), re.MULTILINE))
    assert {path.name for path in (ROOT / "docs").glob("*.md")} <= listed


def test_troubleshooting_quotes_what_is_really_said():
    source = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "rover_pin").rglob("*.py"))
    quoted = re.findall(r"^\| `([^`]+)`", PAGES["troubleshooting.md"], re.MULTILINE)
    assert len(quoted) > 8
    missing = []
    for sentence in quoted:
        parts = [part.strip(" '") for part in re.split(r"\.\.\.", sentence) if len(part.strip(" '")) > 3]
        missing += [part for part in parts if part not in source]
    assert not missing
