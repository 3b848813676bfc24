"""Changes of formulas, laws and thresholds that no test notices.

    python studies/benchmarks/mutation.py [--rooms soil effects ...] [--files NAME ...] [--sample N] [--minutes M]

Operators are swapped, terms dropped, constants changed by a tenth, comparisons turned, branches exchanged, one at a
time, in a copy of the tree. The tests that belong to the changed file run on it, its own first, until one fails. What
survives is printed with its place and the change; what changes no result stands in changes/equivalent.py with the
reason. Numbers inside `quantity(...)` are declarations, not laws, and are left alone, as are messages and types.
A change takes 1 to 20 s; `--quick` tries a few of the soil.
"""

from __future__ import annotations

import argparse
import importlib
import math
import os
import random
import re
import shutil
import signal
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from changes import c, python
from changes.equivalent import EQUIVALENT

ROOT = Path(__file__).resolve().parents[2]
LIBRARIES = ("numpy", "scipy.optimize", "scipy.stats", "casadi", "pinocchio", "matplotlib.figure", "pandas", "pytest")
"""Imported once: every mutant runs in a fork that has them."""
PATIENCE, LEAST = 5.0, 60.0
"""A mutant may take so many times what its tests take on the code as it is, and at least so long [s]."""
QUICK = 4

DECIDING = (
    "discrepancy/compare discrepancy/cross_validation discrepancy/held_out discrepancy/screen discrepancy/search "
    "estimation/fit estimation/noise estimation/problem estimation/residual estimation/wording loop/drive loop/rig "
    "report/rig_cautions experiments/wheel_rig/calibrate experiments/wheel_rig/compare experiments/wheel_rig/held_out "
    "experiments/wheel_rig/reselect experiments/wheel_rig/checks experiments/wheel_rig/screen"
).split()
DECISIONS = "drive_decisions drive_noise rig_decisions rig_thresholds wording residual_sign evidence_profile"


class Room(NamedTuple):
    """Files that are changed, and the tests that belong to each, in their order; `{stem}` is the file's name."""

    files: tuple[str, ...]
    tests: tuple[str, ...]


def _named(folder: str, names: str) -> tuple[str, ...]:
    return tuple(f"tests/{folder}/test_{name}.py" for name in names.split())


ROOMS = {
    "soil": Room(("rover_pin/soil/*.py",), ("tests/soil/test_soil_[!t]*.py", "tests/soil/test_soil_t*.py")),
    "effects": Room(("rover_pin/effects/*.py",), _named("effects", "{stem} laws every_effect ballast_and_tilt")),
    "body": Room(("rover_pin/body/*.py",), ("tests/body/test_*.py", "tests/oracle/test_oracle_dynamics.py")),
    "motion": Room(
        ("rover_pin/motion/*.py", "rover_pin/motion/native/*.c"),
        _named("motion", "{stem} kernel_twin simulate [!kst]* t*"),
    ),
    "evidence": Room(
        tuple(f"rover_pin/{name}.py" for name in DECIDING),
        _named("evidence", DECISIONS),
    ),
}


def main() -> None:
    """Change, test, and print what survives."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--rooms", nargs="*", choices=ROOMS, default=list(ROOMS))
    options.add_argument("--files", nargs="*", default=[], help="only files of these names, as traction.py")
    options.add_argument("--sample", type=int, default=0, help="changes that are tried; 0 for all")
    options.add_argument("--seed", type=int, default=0, help="of the order in which they are tried")
    options.add_argument("--minutes", type=float, default=math.inf, help="none is begun after so long")
    options.add_argument("--quick", action="store_true", help=f"{QUICK} changes of the soil")
    asked = options.parse_args()
    rooms, sample = (["soil"], QUICK) if asked.quick else (asked.rooms, asked.sample)
    for name in LIBRARIES:
        importlib.import_module(name)
    with tempfile.TemporaryDirectory() as folder:
        tree = copied(Path(folder) / "tree")
        chosen = [each for room in rooms for each in mutants(tree, room, asked.files)]
        random.Random(asked.seed).shuffle(chosen)
        trial, end, results = Trial(tree), time.monotonic() + 60 * asked.minutes, list[str]()
        for each in chosen[: sample or None]:
            if time.monotonic() < end:
                results.append(trial.survives(each))
    for name in sorted(trial.failing):
        print(f"left out, as it fails without any change: {name}")
    missed = sum(map(bool, results))
    told = f"{len(results)} of {len(chosen)} changes in {', '.join(rooms)}"
    print(f"{told}: {len(results) - missed} noticed, {missed} not")


def copied(tree: Path) -> Path:
    """Return a copy of what the tests need."""
    ignored = shutil.ignore_patterns("__pycache__", ".*", "out")
    for name in ("rover_pin", "tests", "studies", "urdf"):
        shutil.copytree(ROOT / name, tree / name, ignore=ignored)
    for name in ("pyproject.toml", "README.md"):
        shutil.copy(ROOT / name, tree)
    return tree


Change = tuple[Path, tuple[str, ...], python.Mutant]


def mutants(tree: Path, room: str, files: list[str]) -> list[Change]:
    """Return the changes of a room's files with the tests that belong to each, but those that change no result."""
    found: list[Change] = []
    for path in sorted(each for pattern in ROOMS[room].files for each in tree.glob(pattern)):
        if files and path.name not in files:
            continue
        patterns = [pattern.format(stem=path.stem) for pattern in ROOMS[room].tests]
        tests = tuple(dict.fromkeys(str(each) for pattern in patterns for each in sorted(tree.glob(pattern))))
        text = path.read_text(encoding="latin-1")
        made = c.changes(text) if path.suffix == ".c" else python.changes(text)
        name = str(path.relative_to(tree))
        found += [(path, tests, one) for one in made if (name, one.said) not in EQUIVALENT]
    return found


class Trial:
    """Runs tests on a changed tree; remembers how long they take on the tree as it is, and which fail there."""

    def __init__(self, tree: Path):
        self.tree, self.said = tree, tree.parent / "said.txt"
        self.taken: dict[str, float] = {}
        self.failing: set[str] = set()

    def survives(self, change: Change) -> str:
        """Return the change in words where its tests pass with it, and print it; an empty string where they fail."""
        path, tests, mutant = change
        for test in tests:
            if test not in self.taken:
                self._try((test,))
        text = path.read_text(encoding="latin-1")
        path.write_text(mutant.of(text), encoding="latin-1")
        try:
            code = self._run(tests, max(LEAST, PATIENCE * sum(self.taken[test] for test in tests)))
        finally:
            path.write_text(text, encoding="latin-1")
        told = f"{path.relative_to(self.tree)}:{mutant.line}: {mutant.said}"
        if code == 0:
            print(told, flush=True)
        return told if code == 0 else ""

    def _try(self, tests: tuple[str]) -> None:
        """Run a file of tests on the tree as it is: how long it takes, and what fails there anyway."""
        begun = time.monotonic()
        code = self._run(tests, 3600.0, stop="--maxfail=1000")
        self.taken[tests[0]] = time.monotonic() - begun
        self.failing |= set(re.findall(r"^(?:FAILED|ERROR) (\S+)", self.said.read_text(), re.MULTILINE))
        if code and self._run(tests, 3600.0):
            raise SystemExit(f"{tests[0]} fails without any change:\n{self.said.read_text()[-3000:]}")

    def _run(self, tests: tuple[str, ...], limit: float, stop: str = "-x") -> int:
        """Return pytest's exit code in a fork, or -1 where it takes longer than the limit [s]."""
        child = os.fork()
        if child == 0:
            os.setsid()
            self._test(tests, stop)
        end = time.monotonic() + limit
        while time.monotonic() < end:
            done, status = os.waitpid(child, os.WNOHANG)
            if done:
                return os.waitstatus_to_exitcode(status)
            time.sleep(0.02)
        os.killpg(child, signal.SIGKILL)
        os.waitpid(child, 0)
        return -1

    def _test(self, tests: tuple[str, ...], stop: str) -> None:
        """Run the tests on this tree's package and end the process."""
        import pytest

        os.chdir(self.tree)
        sys.path[0], sys.dont_write_bytecode = str(self.tree), True
        os.environ |= {"PYTHONPATH": str(self.tree), "ROVER_PIN_CACHE": str(self.tree.parent / "cache")}
        said = os.open(self.said, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(said, 1)
        os.dup2(said, 2)
        code, left_out = 1, [f"--deselect={name}" for name in sorted(self.failing)]
        try:
            package = importlib.import_module("rover_pin").__file__ or ""
            code = int(pytest.main([stop, "-q", "-p", "no:cacheprovider", *left_out, *tests]))
            code = code if package.startswith(str(self.tree)) else 99
        finally:
            os._exit(code)


if __name__ == "__main__":
    main()
