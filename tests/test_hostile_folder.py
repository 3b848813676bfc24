"""Whatever command is given in a folder of someone else, no module, program or setting that lies there runs.

The folder has a module named after each import of the package and of all that it depends on, programs named after those
that are looked for, and a matplotlibrc that names one. The console script is started there as a user does.
"""

import importlib.metadata
import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

from rover_pin.base.errors import SimulationError
from rover_pin.base.jobs.cluster import results
from rover_pin.base.jobs.safe_environment import SAFE_PATH, safe_path

ROOT = Path(__file__).parents[1]
MODULES = (sys.stdlib_module_names | importlib.metadata.packages_distributions().keys() | {"sitecustomize"}) - {
    "rover_pin", "usercustomize"
}  # fmt: skip
PROGRAMS = (
    "cc gcc clang as ld ffmpeg convert latex dvipng xdg-open xdg-settings www-browser python python3 sh uname "
    "pgrep ldconfig lscpu"
).split()
SHARE_OF_ALL = max(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") // 3, 2 << 30)
"""Bytes that each of two processes and the program that starts them may have."""
STUDY = """
name = "s"
scenario = "flat"
duration = 0.1
plan = { kind = "grid" }
[parameters]
soil.k = [0.01, 0.02]
"""
TUNING = """
[[training]]
scenario = "flat"
duration = 0.2
[[held_out]]
scenario = "flat"
duration = 0.2
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A downloaded folder: data that are asked for, and beside them what none has asked for."""
    downloads = tmp_path_factory.mktemp("downloads")
    for name in MODULES:
        (downloads / f"{name}.py").write_text(f"open({str(downloads / 'pwned')!r}, 'a').write('module {name}\\n')\n")
    for name in PROGRAMS:
        (downloads / name).write_text(f"#!/bin/sh\necho program {name} >> '{downloads / 'pwned'}'\n")
        (downloads / name).chmod(0o755)
    (downloads / "matplotlibrc").write_text(f"animation.ffmpeg_path: {downloads / 'ffmpeg'}\ntext.usetex: True\n")
    shutil.copytree(ROOT / "studies" / "data" / "cmu-smooth-wheel", downloads / "rig")
    shutil.copy(ROOT / "urdf" / "cart.urdf", downloads)
    shutil.copy(ROOT / "urdf" / "cart.toml", downloads / "own.toml")
    (downloads / "study.toml").write_text(STUDY)
    (downloads / "tuning.toml").write_text(TUNING)
    return downloads


PYTHON_PATHS = ("", ":", ":/opt/ros/lib", ".", "./", "inner", "HERE", "HERE/.", "/opt/ros/lib:HERE")
"""Values of PYTHONPATH by which Python looks for modules in the working directory, HERE."""


def entered(folder, *words, **environment):
    """What a user's console script does there, whose PATH has the working directory, as many have."""
    inherited = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    paths = {"PATH": os.pathsep.join([".", "", os.environ["PATH"]]), **environment}
    script = Path(sysconfig.get_path("scripts")) / "rover-pin"
    return subprocess.run(
        [script, *words], cwd=folder, env={**inherited, **paths}, capture_output=True, text=True, check=False
    )


def ran(folder):
    return (folder / "pwned").read_text() if (folder / "pwned").exists() else ""


QUICK = [
    ("sweep", "study.toml", "--workers", "2"),
    ("drive", "flat", "--set", "duration=0.2", "--gif", "--out", "driven"),
]
SLOW = [
    ("close-loop", "rig", "--workers", "2"),
    ("view", "log", "--gif", "--open"),
    ("tune", "tuning.toml", "--workers", "2"),
]
NIGHTLY = [
    ("list", "scenarios"),
    ("curve",),
    ("bounds",),
    ("check-data", "rig"),
    ("identify", "rig"),
    ("check-data", "log"),
    ("close-loop", "log", "--workers", "2", "--open"),
    ("compare", "log", "log"),
    ("export", "log"),
    ("import-log", "log/run-1.csv", "--out", "imported"),
    ("init", "rig/points.csv", "--r", "100mm", "--b", "50mm", "--out", "made"),
    ("check-urdf", "own.toml"),
    ("new-rover", "cart.urdf", "--out", "new/proposed.toml"),
    ("new-effect", "StickySoil", "--out", "effect"),
]


def marked(lines, mark):
    return [pytest.param(words, marks=mark) for words in lines]


@pytest.mark.slow
@pytest.mark.parametrize("words", [*QUICK, *marked(SLOW, pytest.mark.slow), *marked(NIGHTLY, pytest.mark.nightly)])
def test_nothing_of_the_folder_runs(folder, words):
    needs_log = any(word.partition("/")[0] == "log" for word in words)
    if needs_log and not (folder / "log").exists():  # another worker may have made it in its own folder
        entered(folder, "demo", "drive-log", "--out", "log")
    done = entered(folder, *words)
    assert ran(folder) == ""
    assert done.returncode == 0 or "ends stuck" in done.stderr, done.stderr


@pytest.fixture(scope="module")
def packages(tmp_path_factory):
    """A working directory with modules named after what the package imports after its own first lines.

    Those that Python itself imports before any program begins (`site`, `sitecustomize`, the console script's `re`) are
    Python's to take from PYTHONPATH; nothing of this package can come before them.
    """
    package_folder = tmp_path_factory.mktemp("packages")
    (package_folder / "inner").mkdir()
    program = [sys.executable, "-c", "import sys, re, runpy\nprint(*sys.modules, sep='\\n')"]
    loaded = subprocess.run(program, capture_output=True, text=True, check=True, cwd=package_folder).stdout.split()
    for name in MODULES - {name.partition(".")[0] for name in loaded} - {"sitecustomize", "_winapi", "nt"}:
        for place in (package_folder, package_folder / "inner"):
            (place / f"{name}.py").write_text(
                f"open({str(package_folder / 'pwned')!r}, 'a').write('module {name}\\n')\n"
            )
    (package_folder / "study.toml").write_text(STUDY)
    return package_folder


@pytest.mark.parametrize("path", PYTHON_PATHS)
def test_no_entry_of_the_pythonpath_is_the_working_directory(packages, path):
    (packages / "pwned").unlink(missing_ok=True)
    done = entered(packages, "list", "soils", PYTHONPATH=path.replace("HERE", str(packages)))
    assert ran(packages) == ""
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    "words", [("drive", "flat", "--set", "duration=0.1"), ("sweep", "study.toml", "--workers", "2")]
)
def test_neither_this_process_nor_its_workers_take_the_working_directory_from_the_pythonpath(packages, words):
    done = entered(packages, *words, PYTHONPATH=":/opt/ros/lib")
    assert ran(packages) == ""
    assert done.returncode == 0, done.stderr


def test_no_compiler_of_the_folder_runs(folder, tmp_path):
    source = (
        "from rover_pin.base.jobs.safe_environment import leave_folder_out\nleave_folder_out()\n"
        "from rover_pin.simulation.compiled.toolchain import shared_library\n"
        "shared_library('int one(void) { return 1; }', 'one')\n"
    )
    (tmp_path / "start.py").write_text(source)
    entries = {**os.environ, "PATH": f".:{os.environ['PATH']}", "ROVER_PIN_CACHE": str(tmp_path / "cache")}
    subprocess.run([sys.executable, str(tmp_path / "start.py")], cwd=folder, env=entries, check=True)
    assert ran(folder) == ""
    assert list((tmp_path / "cache").glob("one-*.so"))


def test_a_worker_gets_no_more_memory_than_its_share():
    assert [len(taken) for taken in results(bytearray, [(1 << 20,)] * 2, 2)] == [1 << 20] * 2
    with pytest.raises(SimulationError, match="2 processes"):
        list(results(bytearray, [(1 << 20,), (SHARE_OF_ALL,)], 2))


def test_safe_paths_may_end_in_any_order(monkeypatch):
    monkeypatch.delenv(SAFE_PATH, raising=False)
    first, second = safe_path(), safe_path()
    first.__enter__()
    second.__enter__()
    first.__exit__(None, None, None)
    assert os.environ[SAFE_PATH] == "1"
    second.__exit__(None, None, None)
    assert SAFE_PATH not in os.environ
