"""Find changes of formulas, numbers and decisions that no test detects, made by cosmic-ray, one at a time.

    python studies/benchmarks/mutation.py soil [--sample 40] [--seed 0] [--files slip.py ...] [--again]

The script changes a copy of the tree: it swaps + and -, * and /, inverts comparisons, negates conditions, moves whole
numbers by one in both directions, and multiplies other numbers by each of FACTORS. Numbers that are declared with a
source stay unchanged. Each change is tried on the quick tests of its room that import its file, or on all tests of the
room if no test imports the file. The script prints each change that no test detects. The room's row of mutation.csv and
its rows of mutation_survivors.csv are replaced. `--again` tries the changes listed there on all tests of the room;
`--quick` tries two changes of Eq (1).
"""

from __future__ import annotations

import argparse
import ast
import math
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import pandas as pd
from cosmic_ray.ast import is_number
from cosmic_ray.commands import execute, init
from cosmic_ray.config import ConfigDict
from cosmic_ray.operators.number_replacer import NumberReplacer
from cosmic_ray.plugins import OPERATOR_PROVIDERS
from cosmic_ray.testing import run_tests
from cosmic_ray.work_db import use_db
from parso.python.tree import Number

ROOT = Path(__file__).resolve().parents[2]
FACTORS = (0.5, 0.9, 1.1, 4.0)
CORE = """
    ReplaceBinaryOperator_Add_Sub ReplaceBinaryOperator_Sub_Add ReplaceBinaryOperator_Mul_Div
    ReplaceBinaryOperator_Div_Mul ReplaceBinaryOperator_Pow_Mul ReplaceUnaryOperator_Delete_USub
    ReplaceUnaryOperator_Delete_Not ReplaceComparisonOperator_Lt_GtE ReplaceComparisonOperator_LtE_Gt
    ReplaceComparisonOperator_Gt_LtE ReplaceComparisonOperator_GtE_Lt ReplaceComparisonOperator_Eq_NotEq
    ReplaceComparisonOperator_NotEq_Eq ReplaceComparisonOperator_Is_IsNot ReplaceComparisonOperator_IsNot_Is
    ReplaceAndWithOr ReplaceOrWithAnd AddNot ReplaceTrueWithFalse ReplaceFalseWithTrue
"""
ROOMS = (
    "soil effects terrain rover simulation logs control scenarios measurements experiments/wheel_rig "
    "experiments/drive_log estimation inference discrepancy loop sweep tuning base "
    "rover/proposal importing"
).split()
"""Folders of rover_pin that can be tested."""


DECLARING = ("quantity", "spec", "lru_cache")
"""Calls whose numbers are defaults and bounds with a source, or the size of a cache."""


class Scaled(NumberReplacer):
    """A mutation of numbers in the source code: whole numbers and 0.0 are increased and decreased by one, and all other
    numbers are multiplied by each of FACTORS.
    """

    def mutation_positions(self, node) -> Iterator[tuple[tuple[int, int], tuple[int, int]]]:
        """Yield the position of each number in the source once for every changed value that is tried for the number."""
        if is_number(node) and not _is_declared(node):
            yield from [(node.start_pos, node.end_pos)] * len(changes(node.value))

    def mutate(self, node, index: int) -> Number:
        """Return the changed number."""
        return Number(f" {changes(node.value)[index]}", node.start_pos)


def changes(text: str) -> list[str]:
    """Return the changed values of a number, as source text."""
    value = ast.literal_eval(text)
    return (
        [repr(value * by) for by in FACTORS] if isinstance(value, float) and value else [f"{value + 1}", f"{value - 1}"]
    )


def _is_declared(node) -> bool:
    """Return whether a number is the argument of one of the DECLARING calls."""
    while node := node.search_ancestor("atom_expr"):
        if node.children[0].get_code().strip() in DECLARING:
            return True
    return False


def main() -> None:
    """Make the changes, run the tests, and print each change that no test detects."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("room", choices=ROOMS, nargs="?", default="soil")
    options.add_argument("--sample", type=int, default=0, help="changes that are tried; 0 for all")
    options.add_argument("--seed", type=int, default=0, help="of the sample")
    options.add_argument("--files", nargs="*", help="only changes of files of these names are tried")
    options.add_argument("--again", action="store_true", help="what the last run left, on all tests of the room")
    options.add_argument("--put", type=lambda name: Path(name).resolve(), default=ROOT / "studies" / "results")
    options.add_argument("--minutes", type=float, default=math.inf, help="after which no other file is begun")
    options.add_argument("--quick", action="store_true", help="two changes of Eq (1)")
    request = options.parse_args()
    if request.quick:
        request.sample, request.files = 2, ["slip.py"]
    # Replace the library's operators by the selected ones and by `Scaled`.
    core = OPERATOR_PROVIDERS["core"]
    OPERATOR_PROVIDERS.clear()
    OPERATOR_PROVIDERS["rover_pin"] = {"Scaled": Scaled} | {name: core[name] for name in CORE.split()}
    end = time.monotonic() + 60 * request.minutes
    table_files = {name: request.put / f"{name}.csv" for name in ("mutation", "mutation_survivors")}
    # All changes are made in a copy, so that an interrupted run cannot damage the checkout.
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(copied(Path(folder)))
        os.environ |= {"PYTHONPATH": os.getcwd(), "ROVER_PIN_CACHE": str(Path(folder) / "cache")}
        tests = tests_of(request.room)
        if request.again:
            (row,), before = (rows_of(table, request.room) for table in table_files.values())
            sound, most = passing(tests)
            missed = list(again(before, sound, most))
        else:
            files = sorted(Path("rover_pin", request.room).rglob("*.py"))
            with use_db(Path(folder) / "all.sqlite") as every:
                init(files, every, {})
                items = list(every.work_items)
            # A random sample of the changes; files are then tried in random order until the time is over.
            some = [item for item in items if not request.files or item.mutations[0].module_path.name in request.files]
            random_choice, done, missed = random.Random(request.seed), 0, []
            tried = random_choice.sample(some, min(request.sample or len(some), len(some)))
            changed = sorted({item.mutations[0].module_path for item in tried})
            sound, most = passing(sorted({test for file in changed for test in naming(tests, file)}))
            for file in random_choice.sample(changed, len(changed)):
                if time.monotonic() < end:
                    file_items = [item for item in tried if item.mutations[0].module_path == file]
                    missed += survivors(request.room, file_items, naming(sound, file), most, Path(folder))
                    done += len(file_items)
            row = {"room": request.room, "changes": len(items), "tried": done, "seed": request.seed,
                   "files": " ".join(request.files or ())}  # fmt: skip
    row |= {"not noticed": len(missed), "commit": git("rev-parse", "--short", "HEAD").strip()}
    print(f"{request.room}: {row['tried']} tried of {row['changes']}, {row['not noticed']} not noticed")
    if not request.quick:
        for table, rows in zip(table_files.values(), ([row], missed), strict=True):
            others = pd.read_csv(table).query("room != @request.room") if table.exists() else pd.DataFrame()
            all_rows = pd.concat([others, pd.DataFrame(rows)]) if rows else others
            all_rows.sort_values(["room"], kind="stable").to_csv(table, index=False)


def survivors(room: str, tried: list, tests: list[Path], most: float, folder: Path) -> Iterator[dict]:
    """Apply each mutation of one file in turn, and yield the mutations that none of the given tests detects."""
    # cosmic-ray counts a run as killed if any test fails or the time is over.
    config = ConfigDict({"timeout": most, "test-command": " ".join(command(tests)), "distributor": {"name": "local"}})
    by_job = {item.job_id: item.mutations[0] for item in tried}
    with use_db(folder / "tried.sqlite") as db:
        db.clear()
        db.add_work_items(tried)
        execute(db, config)
        for job, result in db.results:
            if result.test_outcome != "killed":
                file, line, lines = by_job[job].module_path, by_job[job].start_pos[0], result.diff.splitlines()
                # The first removed and the first added line of the diff show the change.
                both = [
                    next(diff_line[1:].strip() for diff_line in lines[4:] if diff_line[:1] == sign) for sign in "-+"
                ]
                print(f"{file}:{line}: {both[0]}  ->  {both[1]}", flush=True)
                yield {"room": room, "file": str(file), "line": line, "as it is": both[0], "changed": both[1]}


def again(missed: list[dict], tests: list[Path], most: float) -> Iterator[dict]:
    """Yield those of the given changes that no test detects when they are tried again."""
    for row in missed:
        file = Path(row["file"])
        text = file.read_text(encoding="utf-8")
        # A line that has been rewritten since the last run cannot be changed in the same way.
        if row["as it is"] in text:
            file.write_text(text.replace(row["as it is"], row["changed"], 1), encoding="utf-8")
            outcome, _ = run_tests(" ".join(command(tests)), most)
            # Restore the file before the next change.
            file.write_text(text, encoding="utf-8")
            if outcome == "survived":
                yield row


def tests_of(room: str) -> list[Path]:
    """Return the test files of a folder of the package: those in the test folder of the same name. If there is no such
    folder, return the tests that import from the folder.
    """
    every, name = sorted(Path("tests").rglob("*/test_*.py")), f"rover_pin.{room.replace('/', '.')}"
    in_room = [file for file in every if Path("tests", room) in file.parents]
    return in_room or [file for file in every if name in file.read_text(encoding="utf-8")]


def naming(tests: list[Path], file: Path) -> list[Path]:
    """Return the test files that import a source file. If no test file imports the source file, return the test files
    that import from its folder. If no test file does either, return all test files.
    """
    for folder, name in (file.with_suffix("").parts[-2:], file.parent.parts[-2:]):
        imports = re.compile(rf"{folder}(\.| import .*\b){name}\b")
        if importing := [test for test in tests if imports.search(test.read_text(encoding="utf-8"))]:
            return importing
    return tests


def command(tests: list[Path]) -> list[str]:
    """Return the command that runs these tests until one fails."""
    return [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *map(str, tests)]


def passing(tests: list[Path]) -> tuple[list[Path], float]:
    """Return the test files that pass without any change, and the time after which a run counts as hung [s]."""
    began, words = time.monotonic(), [word for word in command(tests) if word != "-x"]
    output = subprocess.run([*words, "-rfE", "--tb=no"], capture_output=True, text=True, check=False).stdout
    broken = set(re.findall(r"^(?:FAILED|ERROR) ([^:\s]+)", output, re.MULTILINE))
    if broken:
        print(f"left out, as they fail without any change: {', '.join(sorted(broken))}")
    return [test for test in tests if str(test) not in broken], 60.0 + 3.0 * (time.monotonic() - began)


def copied(tree: Path) -> Path:
    """Return the path of a copy of all tracked files."""
    for name in git("ls-files", "-z").strip("\0").split("\0"):
        (tree / "tree" / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, tree / "tree" / name)
    return tree / "tree"


def rows_of(table: Path, room: str) -> list[dict]:
    """Return the rows of a table that belong to one folder of the package."""
    return pd.read_csv(table).query("room == @room").to_dict("records")


def git(*words: str) -> str:
    """Return the output of a git command in this checkout."""
    completed = subprocess.run(["git", *words], cwd=ROOT, check=False, capture_output=True, text=True)
    if completed.returncode:
        raise SystemExit(f"{ROOT} is no clone with its history: {completed.stderr.strip()}")
    return completed.stdout


if __name__ == "__main__":
    main()
