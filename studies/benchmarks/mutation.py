"""Changes of formulas, laws and thresholds that no test notices.

    python studies/benchmarks/mutation.py [--rooms soil effects ...] [--files NAME[:LINE] ...] [--sample N]
                                          [--longest S] [--minutes M] [--tally studies/results/mutation.csv]

Operators are swapped, terms dropped, constants changed by a tenth, comparisons turned, branches exchanged, one at a
time, in a copy of the tree. Each is tried on the tests that run its statement, those first that cost least for what
they noticed of its file, until one fails. All changes of the compiled step's functions stand in one library, chosen by
a number (changes/switch.py). What survives is printed with its place and change, with `--killers` also what noticed the
others; what changes no result stands in changes/equivalent.py with the reason. Numbers inside
`quantity(...)` are declarations, not laws, and are left alone, as are messages and types. Results are kept in `--keep`,
good as long as the changed file and the test that noticed are the same (of what survives: all tests), so that a run
that was stopped goes on; `--tally` puts into a table what is known of each room and what was not tried. `--quick` tries
a few of Eq (1).
"""

from __future__ import annotations

import argparse
import importlib
import math
import os
import random
import resource
import shutil
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from changes import c, python
from changes.equivalent import EQUIVALENT
from changes.kept import Kept
from changes.tally import Row, commit, put
from changes.trial import OPTIONS, Trial

ROOT = Path(__file__).resolve().parents[2]
LIBRARIES = ("numpy", "scipy.optimize", "scipy.stats", "casadi", "pinocchio", "matplotlib.figure", "pandas", "coverage")
"""Imported once, whatever the rooms."""
KEEP = ROOT / "out" / "mutation.json"
QUICK = 4

LINEAR = "drive_anchor drive_decisions drive_left_out"
"""Tests of what the loop decides on linear models, whose answers are known."""
DRIVEN = (
    "drive_blocks drive_candidates drive_contrast drive_declared drive_experiment drive_numbers drive_place drive_rows "
    "drive_runs loop_first_steps"
)
"""Tests of what a drive log is taken for."""


class Room(NamedTuple):
    """Files that are changed, and the tests that are asked."""

    files: tuple[str, ...]
    tests: tuple[str, ...]


def _named(folder: str, names: str) -> tuple[str, ...]:
    return tuple(f"tests/{folder}/test_{name}.py" for name in names.split())


def _files(folder: str, names: str) -> tuple[str, ...]:
    return tuple(f"rover_pin/{folder}/{name}.py" for name in names.split())


DRIVE_LOG = "calibrate candidates contrast experiment features free_runs parameters places"
"""What decides; the other files read, predict, design and describe."""
LAWS = ("tests/effects/test_[!e]*.py", *_named("effects", "every_effect exit_angle"))
"""All but whole drives with every effect, which take minutes and say little of one law."""
STEP = (
    "step_parts kernel_twin kernel_alone rigid_body elimination stiff_motor lanes native_ground native_control "
    "compiled_loop going_on failure resolution simulate independent joint_gains settling native_pace native_commands "
    "many_patches"
)
"""Tests that run the compiled step: its twin first, then what is known of it otherwise."""
MOTION = (
    "audit body_law compiled_laws compiled_run driving failure going_on half_step happened hoist instant kernel "
    "kernel_rover kernel_terrain laws log_terrain motor motors pace place plain plain_law plain_run poise relaxation "
    "replay resolution run_terrain sensors shear_store simulate soil_energy state suspension timing"
)
"""Laws, decisions and the drive itself."""
SOURCES = tuple(f"rover_pin/motion/native/{name}" for name in ("*.c", "drive.h", "types.h"))
LOGS = (
    "bag_columns built channels column_map command defaults draw drive_log effect_files effect_words library_cache "
    "model model_toml poses processor record ros_bag rows saved toolchain trace trace_files"
)
"""What reads, writes and names models and logs."""
ROOMS = {
    "soil": Room(("rover_pin/soil/*.py",), ("tests/soil/test_*.py",)),
    "effects": Room(("rover_pin/effects/*.py", "rover_pin/contact.py"), LAWS),
    "body": Room(
        ("rover_pin/body/*.py",),
        (
            "tests/body/test_*.py",
            "tests/oracle/test_oracle_dynamics.py",
            "tests/motion/test_native_ground.py",
            "tests/effects/test_bent_ground.py",
        ),
    ),
    "motion": Room(_files("motion", MOTION), ("tests/motion/test_*.py",)),
    "logs": Room(_files("motion", LOGS), ("tests/motion/test_*.py",)),
    "step": Room(SOURCES, _named("motion", STEP)),
    "native": Room(("rover_pin/motion/native/*.py",), _named("motion", f"{STEP} native_shared kernel_rover")),
    "estimation": Room(
        ("rover_pin/estimation/*.py", "rover_pin/estimation/by_chance/*.py"),
        ("tests/estimation/test_*.py", *_named("evidence", f"descent drive_noise evidence_profile wording {LINEAR}")),
    ),
    "identification": Room(
        ("rover_pin/identification/*.py",),
        (
            "tests/identification/test_*.py",
            *_named("evidence", "evidence_fit evidence_posterior evidence_profile uncertain_slip"),
            *_named("loop", "identify_several"),
        ),
    ),
    "discrepancy": Room(
        ("rover_pin/discrepancy/*.py",),
        (
            "tests/discrepancy/test_*.py",
            *_named("evidence", f"drive_place wording {LINEAR}"),
            *_named("loop", "fail_on provenance"),
        ),
    ),
    "drive_log": Room(_files("experiments/drive_log", DRIVE_LOG), _named("evidence", DRIVEN)),
    "quick": Room(("rover_pin/soil/slip.py",), _named("soil", "soil_slip")),
}


def main() -> None:
    """Change, test, and print what survives."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--rooms", nargs="*", choices=list(ROOMS)[:-1], default=list(ROOMS)[:-1])
    options.add_argument(
        "--files", nargs="*", default=[], help="only files of these names, or lines: slip.py slip.py:40"
    )
    options.add_argument("--tests", nargs="*", default=[], help="only tests of these files or patterns")
    options.add_argument("--sample", type=int, default=0, help="changes of a room that are tried; 0 for all")
    options.add_argument("--seed", type=int, default=0, help="of the order in which they are tried")
    options.add_argument("--longest", type=float, default=math.inf, help="only tests that take less, in s of CPU")
    options.add_argument(
        "--minutes", type=float, default=math.inf, help="none is begun after so long; 0: tell what is kept"
    )
    options.add_argument("--keep", type=lambda name: Path(name).resolve(), default=KEEP, help="file of what is known")
    options.add_argument("--killers", action="store_true", help="print what noticed each change")
    options.add_argument(
        "--tally", type=lambda name: Path(name).resolve(), help="table into which each room's row is put"
    )
    options.add_argument("--quick", action="store_true", help=f"{QUICK} changes of Eq (1)")
    asked = options.parse_args()
    if asked.quick:
        asked.rooms, asked.sample, asked.files = ["quick"], QUICK, []
    for name in LIBRARIES:
        importlib.import_module(name)
    with tempfile.TemporaryDirectory() as folder:
        tree, at = copied(Path(folder) / "tree"), commit(ROOT)
        end, kept = time.monotonic() + 60 * asked.minutes, Kept(Path(folder) / "kept" if asked.quick else asked.keep)
        for room in asked.rooms:
            changes = mutants(tree, room)
            chosen = [each for each in changes if not asked.files or {*_names(each)} & {*asked.files}]
            random.Random(asked.seed).shuffle(chosen)
            child = os.fork()
            if child == 0:
                trial = Trial(tree, chosen[: asked.sample or None], kept, (asked.longest, end))
                tried(tree, asked.tests or ROOMS[room].tests, trial, room, asked.killers)
                if asked.tally:
                    put(asked.tally, row_of(tree, room, trial, at))
                os._exit(0)
            if os.waitpid(child, 0)[1]:
                raise SystemExit(f"{room}: the run ended early.")
            kept = Kept(kept.file)


def tried(tree: Path, asked: Sequence[str], trial: Trial, room: str, killers: bool) -> None:
    """Try a room's changes in one session of its tests, and print what became of them."""
    import pytest

    begun = time.monotonic()
    os.chdir(tree)
    sys.path[0:0], sys.dont_write_bytecode = [str(tree)], True
    os.environ |= {"PYTHONPATH": str(tree), "ROVER_PIN_CACHE": str(tree.parent / "cache")}
    tests = sorted({str(each.relative_to(tree)) for pattern in asked for each in tree.glob(pattern)})
    code = pytest.main([*OPTIONS, "-qq", *tests], plugins=[trial])
    if not str(sys.modules["rover_pin"].__file__).startswith(str(tree)):
        raise SystemExit("Another rover_pin than that of this tree was imported.")
    for name in trial.broken:
        print(f"left out, as it fails without any change: {name}")
    for one in trial.tried if killers else ():
        print(f"  {one.path.name}:{one.mutant.line}: {one.mutant.said}: {one.killer or 'NOTHING'}")
    files = Counter(one.path.name for one in trial.tried)
    missed = Counter(one.path.name for one in trial.tried if not one.killer)
    for name, count in sorted(files.items()):
        print(f"  {room}/{name}: {count} changes, {missed[name]} not noticed")
    used = sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    told = f"{len(trial.tried)} of {len(trial.changes)} changes in {room}"
    print(f"{told}: {sum(files.values()) - missed.total()} noticed, {missed.total()} not; "
          f"{time.monotonic() - begun:.0f} s, {used:.0f} s of CPU", flush=True)  # fmt: skip
    if code and not trial.tried:
        raise SystemExit(f"pytest: {code}")


def copied(tree: Path) -> Path:
    """Return a copy of what the tests need."""
    ignored = shutil.ignore_patterns("__pycache__", ".*", "out")
    for name in ("rover_pin", "tests", "studies", "urdf"):
        shutil.copytree(ROOT / name, tree / name, ignore=ignored)
    for name in ("pyproject.toml", "README.md"):
        shutil.copy(ROOT / name, tree)
    return tree


def _names(change: tuple[Path, python.Mutant]) -> tuple[str, str]:
    path, mutant = change
    return path.name, f"{path.name}:{mutant.line}"


def row_of(tree: Path, room: str, trial: Trial, at: str) -> Row:
    """Return a room's row of the table: what a run tried, and what it left."""
    every = Counter(path.name for path, _ in mutants(tree, room))
    every.subtract(one.path.name for one in trial.tried)
    untried = " ".join(f"{name}:{count}" for name, count in sorted(every.items()) if count)
    noticed, longest = sum(bool(one.killer) for one in trial.tried), trial.longest
    told = "" if longest == math.inf else f"{longest:g}"
    return Row(room, len(trial.tried), noticed, excused(tree, room), every.total(), untried, told, at)


def mutants(tree: Path, room: str) -> list[tuple[Path, python.Mutant]]:
    """Return the changes of a room's files, but those that change no result."""
    return [(path, one) for path, one in made(tree, room) if (str(path.relative_to(tree)), one.said) not in EQUIVALENT]


def excused(tree: Path, room: str) -> int:
    """Return how many of a room's changes change no result."""
    return len(made(tree, room)) - len(mutants(tree, room))


def made(tree: Path, room: str) -> list[tuple[Path, python.Mutant]]:
    """Return all changes of a room's files."""
    found: list[tuple[Path, python.Mutant]] = []
    for path in sorted(each for pattern in ROOMS[room].files for each in tree.glob(pattern)):
        text = path.read_text(encoding="latin-1")
        found += [(path, one) for one in (python.changes(text) if path.suffix == ".py" else c.changes(text))]
    return found


if __name__ == "__main__":
    main()
