"""The pages do what they say: their Python runs, their commands and options are there, what they quote comes out."""

import importlib
import importlib.util
import math
import re
import shlex
from pathlib import Path

import gallery
import pandas as pd
import pytest
import typer.main

import rover_pin
from rover_pin.cli.app import app
from rover_pin.experiments.pendulum import Pendulum
from rover_pin.experiments.slip_slope import SlipSlope
from rover_pin.logs.drive_log import read_drive_log
from rover_pin.logs.run_terrain import run_terrain
from rover_pin.rover.rover import load_rover
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


READ_BY = {
    "command-line.md": ("tests/scenarios/test_drive_file.py",),
    "data-slip-slope.md": ("tests/test_docs.py",),
    "logs.md": ("tests/test_docs.py",) * 2,
    "own-experiment.md": ("tests/test_docs.py",) * 2,
    "own-package.md": ("tests/base/test_installed_packages.py",),
    "own-rover.md": ("tests/test_readme.py",) * 2,
}
"""Page -> for each of its blocks that is a file, the test that gives this file to the package."""


def files_on(name):
    """Return the blocks of a page that are files: TOML, or text such as a CSV."""
    return re.findall(r"```(?:toml|text)\n(.*?)```", PAGES[name], re.DOTALL)


def test_each_block_is_a_program_or_a_file_that_a_test_reads():
    """Programs for a shell are run by `test_commands_of_pages`, Python by the test above."""
    for name, text in PAGES.items():
        fences = re.findall(r"^```(.*)$", text, re.MULTILINE)
        assert set(fences[::2]) <= {"sh", "python", "toml", "text"}, name
        assert set(fences[1::2]) <= {""}, name
        assert len(files_on(name)) == len(READ_BY.get(name, ())), name
    for name, tests in READ_BY.items():
        for test in tests:
            text = (ROOT / test).read_text(encoding="utf-8")
            assert f'"{name}"' in text, f"{test} does not read {name}"


def test_the_table_of_slip_against_slope_is_read_with_its_units(tmp_path):
    (tmp_path / "slope.toml").write_text(files_on("data-slip-slope.md")[0], encoding="utf-8")
    (tmp_path / "rover.toml").write_text(files_on("own-rover.md")[0], encoding="utf-8")
    (tmp_path / "cart.urdf").write_text((ROOT / "urdf" / "cart.urdf").read_text(encoding="utf-8"), encoding="utf-8")
    rows = [f"{run},{slope},{slope / 50},0.01" for run in ("one", "two") for slope in (0, 5, 10)]
    (tmp_path / "points.csv").write_text("\n".join(["run,slope_deg,slip,slip_sd", *rows]) + "\n", encoding="utf-8")
    experiment = SlipSlope.read(tmp_path)
    assert (experiment.name, experiment.gravity, len(experiment.rover.wheels)) == ("our rover on dry sand", 9.81, 4)
    soil = experiment.base_model().records["soil"]
    assert (float(soil.phi), float(soil.k)) == pytest.approx((math.radians(34.0), 0.040))
    phi = next(number for number in experiment.uncertain(experiment.base_model()) if number.name == "soil.phi")
    assert phi.scale == pytest.approx(math.radians(2.0))


def test_the_columns_and_the_ground_of_a_log_are_read_with_their_units(tmp_path):
    columns, ground = files_on("logs.md")
    head = 'kind = "drive-log"\nname = "field"\n'
    (tmp_path / "drive.toml").write_text(head + columns + ground + '[[run]]\nfile = "run.csv"\n', encoding="utf-8")
    header = "t_s,Position X [mm],lat,lon,qx,qy,qz,qw,v,omega,raw_1"
    half_turn = f"{math.sin(math.pi / 8)},{math.cos(math.pi / 8)}"  # of a quaternion for 45 deg about z
    rows = ["0.0,0,48.0,11.0,0,0,0,1,0,0,250", f"0.1,500,48.00001,11.0,0,0,{half_turn},0.37,1.0,350"]
    (tmp_path / "run.csv").write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    log = read_drive_log(tmp_path)
    (run,) = log.runs
    assert run["body_x"].tolist() == [0.0, 0.5]
    assert run["body_y"][1] == pytest.approx(1e-5 / 180 * math.pi * 6.37e6, rel=0.01)
    assert run["body_yaw"][1] == pytest.approx(math.pi / 4)
    assert run["wheel_rate_fl"][1] == pytest.approx((0.37 - 0.26) / 0.11)
    assert run["current_fl_A"].tolist() == pytest.approx([0.0, 1.0])
    plane = run_terrain(log.metadata.terrain, run, load_rover(), "logs.md")
    assert plane.height(1.0, 0.0) - plane.height(0.0, 0.0) == pytest.approx(math.tan(math.radians(12.0)))


def test_the_files_of_a_bench_are_read(tmp_path):
    for file, text in zip(("bench.toml", "runs.csv"), files_on("own-experiment.md"), strict=True):
        (tmp_path / file).write_text(text, encoding="utf-8")
    bench = Pendulum.read(tmp_path)
    parts = bench.base_model().records
    assert (float(parts["motor"].gear), float(parts["arm"].lever)) == (60.0, 0.25)
    assert bench.folds == ("gentle",)
    assert bench.sd.tolist() == pytest.approx([0.0018, 0.02, 0.01])


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
