"""Every write, folder and child process of every command refused once, and disks and memory with little room."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.test_refused_by_the_machine import STUDY
from tests.faults.failing import CHILD, MEMORY, ROOM, WRITE
from tests.loop.test_slip_slope import folder as slip_slope
from tests.tuning.test_improve import SMALL

ROOT = Path(__file__).parents[2]
WRITES = (
    "drive flat --set duration=1 --view",
    "new-rover my_rover.urdf",
    "init mine.csv --r 45mm --b 50mm --noise drawbar_pull=0.5N --noise sinkage=0.5mm --out other",
    "new-effect StickySoil",
    "check-data mine",
    "export out/drive/log --to mcap",
    "export-c flat --control eq9",
    "export-fmu flat",
    "curve",
    "bounds",
    "view out/drive/log",
    "watch out/drive/log",
    "demo rig",
    "identify mine",
    "sweep small.toml --workers 1",
    "tune tuning.toml --workers 1",
    "close-loop slopes",
)
CHILDREN = ("drive flat --set duration=1", "export-fmu flat", "sweep small.toml --workers 2")
HUNGRY = ("curve", "drive flat --set duration=1", "view out/drive/log", "new-effect StickySoil", "bounds")
"""Commands that are refused memory; the library that writes a sweep's tables ends its process then, with no word."""
GROWS = ".jsonl"
"""Files that grow by a line as work is finished; whole lines of them are kept."""
OF_BINARIES = ".fmu"
"""Files whose bytes depend on where they were compiled."""
ROWS_PER_PROGRESS = {"curve": 1, "new-effect StickySoil": 1, "drive flat --set duration=1 --view": 9}
"""Which events are refused in the slow tests; nightly all are."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """What commands read, and the results of a drive that none may lose."""
    folder = tmp_path_factory.mktemp("faults")
    shutil.copyfile(ROOT / "studies" / "data" / "cmu-smooth-wheel" / "points.csv", folder / "mine.csv")
    shutil.copyfile(ROOT / "urdf" / "cart.urdf", folder / "my_rover.urdf")
    (folder / "slopes").mkdir()
    slip_slope(folder / "slopes")
    (folder / "small.toml").write_text(STUDY)
    (folder / "tuning.toml").write_text(SMALL)
    for line in ("drive flat --set duration=1 -q", f"{WRITES[2].removesuffix(' --out other')} -q"):
        subprocess.run([sys.executable, "-m", "rover_pin", *line.split()], cwd=folder, check=True, capture_output=True)
    return folder


def runs(line, kind, folder, cache, every=1):
    """What became of every run of a command."""
    path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    env = {**os.environ, "PYTHONPATH": path, "BROWSER": "true", "MPLBACKEND": "Agg", "OMP_NUM_THREADS": "1"}
    if kind == CHILD:
        env["ROVER_PIN_CACHE"] = str(cache)
    words = [kind, str(every), str(cache), "--", *line.split()]
    got = subprocess.run(
        [sys.executable, "-m", "tests.faults.failing", *words],
        cwd=folder,
        env=env,
        capture_output=True,
        text=True,
        check=False,
    )
    assert got.returncode == 0, got.stderr[-2000:]
    full, *refused = map(json.loads, got.stdout.splitlines())
    assert full["code"] == 0, full["err"]
    assert kind in (ROOM, MEMORY) or full["events"] > 0 or not refused
    return refused


def faults(run):
    """What is wrong with a run of which something was refused."""
    lines = run["err"].strip().splitlines()
    problems = ["a traceback"] if "Traceback" in run["err"] else []
    if run["code"] not in (0, 2):
        problems.append(f"exit code {run['code']}")
    if run["code"] == 2 and not (lines and lines[-1].startswith("rover-pin: ")):
        problems.append("no sentence")
    if run["code"] == 0 and run["absent"]:
        problems.append(f"success without {run['absent']}")
    torn = [name for name in run["changed"] if not name.endswith(GROWS)]
    torn = [name for name in torn if run["code"] or not name.endswith(OF_BINARIES)]
    return [*problems, *(["torn: " + ", ".join(torn)] if torn else []), *(["lost"] if run["lost"] else [])]


def assert_whole(runs):
    wrong = [(run["at"], faults(run), run["err"][-300:]) for run in runs if faults(run)]
    assert not wrong


@pytest.mark.slow
@pytest.mark.parametrize("line", ROWS_PER_PROGRESS)
def test_a_write_that_is_refused_loses_nothing(line, folder, tmp_path):
    assert_whole(runs(line, WRITE, folder, tmp_path / "cache", ROWS_PER_PROGRESS[line]))


@pytest.mark.nightly
@pytest.mark.parametrize("line", WRITES)
def test_every_write_that_is_refused_loses_nothing(line, folder, tmp_path):
    assert_whole(runs(line, WRITE, folder, tmp_path / "cache"))


@pytest.mark.nightly
@pytest.mark.parametrize("line", CHILDREN)
def test_every_child_process_that_is_refused_loses_nothing(line, folder, tmp_path):
    assert_whole(runs(line, CHILD, folder, tmp_path / "cache"))


@pytest.mark.nightly
@pytest.mark.parametrize("line", HUNGRY)
def test_memory_that_is_refused_loses_nothing(line, folder, tmp_path):
    assert_whole(runs(line, MEMORY, folder, tmp_path / "cache"))


@pytest.mark.nightly
@pytest.mark.parametrize("line", WRITES)
def test_a_disk_with_little_room_loses_nothing(line, folder, tmp_path):
    assert_whole(runs(line, ROOM, folder, tmp_path / "cache"))


def test_a_fault_is_found():
    """The contract itself: each way of losing something is told."""
    sound = {"at": 1, "code": 2, "err": "rover-pin: a: no space\n", "changed": [], "lost": [], "absent": ["a"]}
    assert faults(sound) == []
    for name, value in (("code", 1), ("err", "Traceback\nrover-pin: a"), ("err", "no"), ("changed", ["a.csv"])):
        assert faults({**sound, name: value})
    assert faults({**sound, "lost": ["b"]})
    assert faults({**sound, "code": 0})
