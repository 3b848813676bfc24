"""Every command that README and pages print runs as printed; what it prints is kept in `studies/results`."""

import atexit
import importlib.util
import os
import re
import shlex
import subprocess
import sys
import tempfile
import tomllib
from functools import cache
from pathlib import Path
from shutil import copyfile, copytree, rmtree

import pandas as pd
import pytest
import typer.main

from rover_pin.cli.app import app

ROOT = Path(__file__).parents[1]
FILES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "SECURITY.md", *sorted((ROOT / "docs").glob("*.md"))]
spec = importlib.util.spec_from_file_location("keep_numbers", ROOT / "docs" / "keep_numbers.py")
keeper = importlib.util.module_from_spec(spec)
spec.loader.exec_module(keeper)
KEPT = {"python studies/close_the_loop.py", "rover-pin close-loop demo-drive-log", "rover-pin close-loop my-log"}
"""Minutes, and run every night with their numbers compared."""
PAGES = {path.name: path.read_text(encoding="utf-8") for path in FILES}
COMMAND = re.compile(r"`((?:rover-pin |python studies/)[^`]*|studies/[\w./]+\.py)`")
TOOL = re.compile(
    r"`((?:pip install|(?:pytest|mkdocs|jupyter|docker|pre-commit|towncrier) |python (?:docs|tests|\.ci)/|\.ci/)[^`]*)`"
)
"""Commands between backquotes, of the package and of other programs."""
GROUP = typer.main.get_group(app)
TO_FILL_IN = re.compile(
    r"\b(?:COMMAND|DATA|DATASET|EXPERIMENT|FILE|FOLDER|LOG|MyEffect|NAME|OUT|ROOM|SCENARIO|SET|VERSION)\b|/test_my_"
)
"""What a reader puts a word of his own for; `test_docs` holds the options."""
DITCH = "rover-pin drive ditch --set duration=30 --open"
NEW = "rover-pin new-rover my_rover.urdf"
INIT = "rover-pin init mine.csv --r 45mm --b 50mm --noise drawbar_pull=0.5N --noise sinkage=0.5mm"
IMPORT = "rover-pin import-log steepening-slope/climb-1.csv steepening-slope/flat-steps.csv --out imported"
SAVE = "rover-pin drive ditch --soil table-1 --set duration=5 --save my-drive.toml"
RECORDED = "rover-pin demo recording --hidden SupplySag.R_b=3"
READ = "rover-pin import-log demo-recording/recording.csv --out my-log"
OTHER = (DITCH, "rover-pin drive ditch --out other")
NEEDS = {
    "rover-pin check-data imported": (IMPORT,),
    "rover-pin check-urdf my_rover.toml": (NEW,),
    "rover-pin drive flat --set rover=my_rover.toml": (NEW,),
    "rover-pin drive my-drive.toml --set terrain.wall_angle=40deg": (SAVE,),
    "rover-pin view my-drive.toml": (SAVE,),
    "rover-pin check-data mine": (INIT,),
    "rover-pin close-loop mine": (INIT,),
    "rover-pin export out/drive/log --to mcap": (DITCH,),
    "rover-pin drive ditch --model out/close_loop/posterior": ("rover-pin close-loop cmu-smooth-wheel",),
    "rover-pin improve out/close_loop --study studies/tune_onboard.toml": ("rover-pin close-loop cmu-smooth-wheel",),
    "rover-pin drive ditch --model out/close_loop/model.toml": ("rover-pin close-loop cmu-smooth-wheel",),
    "rover-pin close-loop demo-drive-log": ("rover-pin demo drive-log --hidden SupplySag.R_b=3",),
    READ: (RECORDED,),
    "rover-pin close-loop my-log": (RECORDED, READ),
    "rover-pin compare out/drive/log other/log": OTHER,
    "rover-pin view out/drive/log --compare other/log --gif": OTHER,
}
"""What a command needs to have been run before."""
BY_HAND = {
    "python studies/blind_rig.py": "614 loops, 80 minutes of CPU; pages are made of its sets",
    "python studies/blind_test.py --sets 150 --under any": "150 loops, two hours of CPU; as well",
    "python studies/blind_pendulum.py": "30 loops, six minutes of CPU; `tests/loop/test_pendulum.py` reads its sets",
    "python studies/blind_improve.py": "40 loops and tunings, 70 minutes of CPU; pages are made of its sets",
    "python studies/next_run.py": "some 200 loops, half an hour of CPU",
    "python studies/fig10_ditch.py": "1,200 drives, ten minutes; pages are made of its table",
    "python studies/tune_gains.py": "two tunings, a minute of CPU; its table as well",
    "python studies/tune_as_driven.py": "3,000 drives, twenty minutes of CPU; pages are made of its table",
    "python studies/digging.py": "570 drives, four minutes of CPU; pages are made of its table",
    "rover-pin close-loop steepening-slope --out out/loop": "five minutes; its verdict is kept, "
    "pages are made of it and `test_fig8_log` finds it again",
    "python studies/slip_sensing.py": "100 drives with estimates beside them, three minutes of CPU",
    "python studies/slip_controllers.py": "1,500 drives, twenty minutes of CPU; pages are made of its table",
    "python studies/beliefs.py": "640 drives, five minutes of CPU; pages are made of its table",
    "python studies/monitor.py": "300 drives beside the monitor, six minutes of CPU; pages are made of its table",
    "python studies/beyond_the_paper.py": "a tuning on the full rover, three minutes of CPU; its table as well",
    "python studies/benchmarks/long_log.py": "a loop on an hour's recording, three minutes of CPU",
    "python studies/benchmarks/measure_all.py": "all of them, ten minutes alone on a machine",
    "python studies/benchmarks/close_loop_speed.py": "times, which depend on the machine",
    "python studies/benchmarks/drive_speed.py": "times",
    "python studies/benchmarks/ground_speed.py": "times",
    "python studies/benchmarks/process_cost.py --quick": "times",
    "python studies/benchmarks/replay_speed.py": "times, beside a former version of a clone with its history",
}
"""Commands that take too long for a test, run by hand before a release; `test_studies_run` runs them with --quick."""


ELSEWHERE = {
    "python3 -m venv .venv": "`.ci/run`, as printed",
    ". .venv/bin/activate": "`.ci/run`, as printed",
    'pip install -e ".[view]"': "`.ci/run` installs what has it",
    'pip install -e ".[dev]"': "`.ci/run`, as printed",
    'pytest -n 2 -m "not nightly"': "`.ci/run`, as printed",
    "pytest -n 2": "part of it",
    "ruff check .": "`.ci/run`",
    "ruff format --check .": "`.ci/run`",
    "mypy": "`.ci/run`",
    "mkdocs build": "`.ci/run`",
    "pytest test_sticky_soil.py": "`tests/cli` runs the test of a new effect",
    "mkdocs serve": "`.ci/run`",
    "python .ci/sbom.py": "`.ci/run`",
    "pip install --require-hashes -r constraints.txt": "`.ci/versions locked`",
    "pip install --no-deps --no-build-isolation -e .": "the same",
    ".ci/run": "the CI itself",
    ".ci/versions locked": "a job that downloads other packages",
    ".ci/versions lowest": "the same",
    ".ci/versions newest": "the same, every month",
    ".ci/versions pages": "the same, every month",
    "python .ci/lock.py > constraints.txt": "by hand, if the versions change",
    "python docs/keep_numbers.py": "by hand; `test_a_command_prints_what_is_kept` compares what it keeps",
    "python docs/keep_times.py": "by hand: times",
    "pre-commit install": "by hand, once in a clone; `.ci/run` runs the same checks",
    "jupyter lab": "a server; `tests/test_notebooks.py` runs every notebook",
    "rover-pin new-rover rover.urdf": "`tests/loop/test_a_real_rover.py`, every night",
    "rover-pin check-urdf rover.toml": "the same",
    "rover-pin import-log recording.csv --rover rover.toml --out log": "the same",
    "rover-pin close-loop log --out out": "the same",
}
"""Lines for a shell that `test_a_command_of_the_pages_runs` does not run, and who runs them."""
INSTALLS = subprocess.run(
    [sys.executable, ".ci/printed.py", "installs"], cwd=ROOT, capture_output=True, text=True, check=True
).stdout.splitlines()
"""Every other `pip install` of the pages; `.ci/versions pages` runs all of them."""


def lines():
    """Every line for a shell: of blocks, between backquotes, and those whose times a page is made of."""
    yield from pd.read_csv(ROOT / "studies" / "results" / "times.csv").command
    for text in PAGES.values():
        for block in re.findall(r"```sh\n(.*?)```", text, re.DOTALL):
            for line in filter(None, (line.split("#")[0].strip() for line in block.splitlines())):
                yield from line.split(" && ")
        prose = " ".join(re.sub(r"```.*?```", "", text, flags=re.DOTALL).split())
        for match in COMMAND.findall(prose):
            yield match if match.startswith(("rover-pin", "python")) else f"python {match}"
        for match in TOOL.findall(prose):
            yield from match.split(" && ")


def only_named(line):
    """Whether a line names the program, or a command of it that wants more, as `rover-pin check-data`."""
    words = line.split()
    if words == ["rover-pin"] or line == "pip install":
        return True
    if words[0] != "rover-pin" or len(words) != 2 or words[1].startswith("-"):
        return False
    return any(param.required and param.param_type_name == "argument" for param in GROUP.commands[words[1]].params)


def commands():
    """Every command of README and pages, once, as it is printed."""
    commands_listed = dict.fromkeys(line for line in lines() if not TO_FILL_IN.search(line) and not only_named(line))
    return [line for line in commands_listed if not is_run_elsewhere(line)]


def is_run_elsewhere(line):
    """Whether something else runs a line. CI runs every test, and thus those of a line for pytest with paths."""
    if line.startswith("pytest ") and line not in ELSEWHERE:
        paths = [word for word in shlex.split(line)[1:] if word.startswith("tests/")]
        return bool(paths) and all((ROOT / path).exists() for path in paths)
    return line in ELSEWHERE or line in INSTALLS


@cache
def prepared(needs):
    """A folder with what a reader is said to have, and what these commands left there."""
    folder = Path(tempfile.mkdtemp(prefix="pages-"))
    atexit.register(rmtree, folder, ignore_errors=True)
    copyfile(ROOT / "studies" / "data" / "cmu-smooth-wheel" / "points.csv", folder / "mine.csv")
    copyfile(ROOT / "urdf" / "cart.urdf", folder / "my_rover.urdf")
    for command in needs:
        run(command, folder)
    return folder


def run_after_its_needs(command, folder):
    copytree(prepared(NEEDS.get(command, ())), folder, dirs_exist_ok=True)
    run(command, folder)


def run(command, folder):
    for name in ("studies", "urdf"):  # of a checkout only what is named
        if f"{name}/" in command and not (folder / name).exists():
            (folder / name).symlink_to(ROOT / name)
    program, *words = shlex.split(command)
    start = ["-m", "rover_pin.cli.app"] if program == "rover-pin" else []
    path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    env = {**os.environ, "PYTHONPATH": path, "COLUMNS": "200", "BROWSER": "true"}  # opens nothing
    got = subprocess.run(
        [sys.executable, *start, *words], cwd=folder, env=env, capture_output=True, text=True, timeout=1800, check=False
    )
    assert got.returncode == 0, got.stderr[-2000:]
    assert "Traceback" not in got.stderr


def test_every_line_for_a_shell_is_accounted_for():
    assert [line for line in commands() if not line.startswith(("rover-pin ", "python studies/"))] == []
    assert set(ELSEWHERE) <= set(lines())


def test_what_is_run_by_hand_is_a_command_of_the_pages():
    assert set(BY_HAND) | set(NEEDS) <= set(commands())


RUN = [command for command in commands() if command not in {*BY_HAND, *KEPT}]
STUDIES = [line for line in RUN if line.startswith("python ")]


@pytest.mark.slow
@pytest.mark.parametrize("command", [line for line in RUN if line not in STUDIES])
def test_a_command_of_the_pages_runs(command, tmp_path):
    run_after_its_needs(command, tmp_path)


@pytest.mark.nightly
@pytest.mark.parametrize("command", STUDIES)
def test_a_study_of_the_pages_runs(command, tmp_path):
    """In full; CI runs each with --quick in `tests/studies`."""
    run_after_its_needs(command, tmp_path)


@pytest.mark.nightly
@pytest.mark.parametrize("name", keeper.COMMANDS)
def test_a_command_prints_what_is_kept(name, tmp_path):
    """The numbers that the pages show; a command of these runs here alone."""
    stored = tomllib.loads(keeper.KEPT.read_text(encoding="utf-8"))[name]
    command = stored.pop("command")
    assert command in [line.removesuffix(" --open") for line in commands()]
    assert keeper.measure(name, tmp_path) == pytest.approx(stored, rel=0.02)
