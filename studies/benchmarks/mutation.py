"""Changes of formulas, numbers and decisions that no test notices, made by cosmic-ray, one at a time.

    python studies/benchmarks/mutation.py soil [--sample 40] [--seed 0] [--files slip.py ...] [--again]

A copy of the tree is changed: + and -, * and / are swapped, comparisons turned, conditions negated, whole numbers
moved by one either way and others multiplied by each of FACTORS; numbers that are declared with a source are left
alone. Each change is tried on the quick tests of its room that import its file, on all of the room where none does;
what none notices is printed. The room's row of mutation.csv and its rows of mutation_survivors.csv are written anew.
`--again` tries what stands there, on all tests of the room; `--quick` tries two changes of Eq (1).
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
"""Folders of rover_pin."""


DECLARING = ("quantity", "spec", "lru_cache")
"""Calls whose numbers are defaults and bounds with a source, or the size of a memory."""


class Scaled(NumberReplacer):
    """Whole numbers and 0.0 by one up and down, others by each of FACTORS."""

    def mutation_positions(self, node) -> Iterator[tuple[tuple[int, int], tuple[int, int]]]:
        """Yield the number's place once for each of its changes."""
        if is_number(node) and not _is_declared(node):
            yield from [(node.start_pos, node.end_pos)] * len(changes(node.value))

    def mutate(self, node, index: int) -> Number:
        """Return the number changed."""
        return Number(f" {changes(node.value)[index]}", node.start_pos)


def changes(text: str) -> list[str]:
    """Return what a number is changed to."""
    value = ast.literal_eval(text)
    return (
        [repr(value * by) for by in FACTORS] if isinstance(value, float) and value else [f"{value + 1}", f"{value - 1}"]
    )


def _is_declared(node) -> bool:
    while node := node.search_ancestor("atom_expr"):
        if node.children[0].get_code().strip() in DECLARING:
            return True
    return False


def main() -> None:
    """Change, test, and print what no test notices."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("room", choices=ROOMS, nargs="?", default="soil")
    options.add_argument("--sample", type=int, default=0, help="changes that are tried; 0 for all")
    options.add_argument("--seed", type=int, default=0, help="of the sample")
    options.add_argument("--files", nargs="*", help="only changes of files of these names are tried")
    options.add_argument("--again", action="store_true", help="what the last run left, on all tests of the room")
    options.add_argument("--put", type=lambda name: Path(name).resolve(), default=ROOT / "studies" / "results")
    options.add_argument("--minutes", type=float, default=math.inf, help="after which no other file is begun")
    options.add_argument("--quick", action="store_true", help="two changes of Eq (1)")
    asked = options.parse_args()
    if asked.quick:
        asked.sample, asked.files = 2, ["slip.py"]
    core = OPERATOR_PROVIDERS["core"]
    OPERATOR_PROVIDERS.clear()
    OPERATOR_PROVIDERS["rover_pin"] = {"Scaled": Scaled} | {name: core[name] for name in CORE.split()}
    end = time.monotonic() + 60 * asked.minutes
    kept = {name: asked.put / f"{name}.csv" for name in ("mutation", "mutation_survivors")}
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(copied(Path(folder)))
        os.environ |= {"PYTHONPATH": os.getcwd(), "ROVER_PIN_CACHE": str(Path(folder) / "cache")}
        tests = tests_of(asked.room)
        if asked.again:
            (row,), before = (rows_of(table, asked.room) for table in kept.values())
            sound, most = passing(tests)
            missed = list(again(before, sound, most))
        else:
            files = sorted(Path("rover_pin", asked.room).rglob("*.py"))
            with use_db(Path(folder) / "all.sqlite") as every:
                init(files, every, {})
                items = list(every.work_items)
            some = [one for one in items if not asked.files or one.mutations[0].module_path.name in asked.files]
            chance, done, missed = random.Random(asked.seed), 0, []
            tried = chance.sample(some, min(asked.sample or len(some), len(some)))
            changed = sorted({one.mutations[0].module_path for one in tried})
            sound, most = passing(sorted({test for file in changed for test in naming(tests, file)}))
            for file in chance.sample(changed, len(changed)):
                if time.monotonic() < end:
                    own = [one for one in tried if one.mutations[0].module_path == file]
                    missed += survivors(asked.room, own, naming(sound, file), most, Path(folder))
                    done += len(own)
            row = {"room": asked.room, "changes": len(items), "tried": done, "seed": asked.seed,
                   "files": " ".join(asked.files or ())}  # fmt: skip
    row |= {"not noticed": len(missed), "commit": git("rev-parse", "--short", "HEAD").strip()}
    print(f"{asked.room}: {row['tried']} tried of {row['changes']}, {row['not noticed']} not noticed")
    if not asked.quick:
        for table, rows in zip(kept.values(), ([row], missed), strict=True):
            others = pd.read_csv(table).query("room != @asked.room") if table.exists() else pd.DataFrame()
            found = pd.concat([others, pd.DataFrame(rows)]) if rows else others
            found.sort_values(["room"], kind="stable").to_csv(table, index=False)


def survivors(room: str, tried: list, tests: list[Path], most: float, folder: Path) -> Iterator[dict]:
    """Try changes of one file, and yield those that none of these tests notices."""
    config = ConfigDict({"timeout": most, "test-command": " ".join(command(tests)), "distributor": {"name": "local"}})
    own = {item.job_id: item.mutations[0] for item in tried}
    with use_db(folder / "tried.sqlite") as db:
        db.clear()
        db.add_work_items(tried)
        execute(db, config)
        for job, result in db.results:
            if result.test_outcome != "killed":
                file, line, lines = own[job].module_path, own[job].start_pos[0], result.diff.splitlines()
                told = [next(each[1:].strip() for each in lines[4:] if each[:1] == sign) for sign in "-+"]
                print(f"{file}:{line}: {told[0]}  ->  {told[1]}", flush=True)
                yield {"room": room, "file": str(file), "line": line, "as it is": told[0], "changed": told[1]}


def again(missed: list[dict], tests: list[Path], most: float) -> Iterator[dict]:
    """Yield those of these changes that still no test notices."""
    for row in missed:
        file = Path(row["file"])
        text = file.read_text(encoding="utf-8")
        if row["as it is"] in text:
            file.write_text(text.replace(row["as it is"], row["changed"], 1), encoding="utf-8")
            outcome, _ = run_tests(" ".join(command(tests)), most)
            file.write_text(text, encoding="utf-8")
            if outcome == "survived":
                yield row


def tests_of(room: str) -> list[Path]:
    """Return the files of tests of a room: of its folder of tests, or else those that name it."""
    every, name = sorted(Path("tests").rglob("*/test_*.py")), f"rover_pin.{room.replace('/', '.')}"
    own = [file for file in every if Path("tests", room) in file.parents]
    return own or [file for file in every if name in file.read_text(encoding="utf-8")]


def naming(tests: list[Path], file: Path) -> list[Path]:
    """Return those of these tests that import a file, else those that import from its folder, else all."""
    for folder, name in (file.with_suffix("").parts[-2:], file.parent.parts[-2:]):
        imports = re.compile(rf"{folder}(\.| import .*\b){name}\b")
        if found := [test for test in tests if imports.search(test.read_text(encoding="utf-8"))]:
            return found
    return tests


def command(tests: list[Path]) -> list[str]:
    """Return the command that runs these tests until one fails."""
    return [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *map(str, tests)]


def passing(tests: list[Path]) -> tuple[list[Path], float]:
    """Return the files of tests that pass on what is unchanged, and after how long a run of them counts as hung [s]."""
    began, words = time.monotonic(), [word for word in command(tests) if word != "-x"]
    told = subprocess.run([*words, "-rfE", "--tb=no"], capture_output=True, text=True, check=False).stdout
    broken = set(re.findall(r"^(?:FAILED|ERROR) ([^:\s]+)", told, re.MULTILINE))
    if broken:
        print(f"left out, as they fail without any change: {', '.join(sorted(broken))}")
    return [test for test in tests if str(test) not in broken], 60.0 + 3.0 * (time.monotonic() - began)


def copied(tree: Path) -> Path:
    """Return a copy of what is tracked."""
    for name in git("ls-files", "-z").strip("\0").split("\0"):
        (tree / "tree" / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, tree / "tree" / name)
    return tree / "tree"


def rows_of(table: Path, room: str) -> list[dict]:
    """Return a room's rows of a table."""
    return pd.read_csv(table).query("room == @room").to_dict("records")


def git(*words: str) -> str:
    """Return what git says of this checkout."""
    said = subprocess.run(["git", *words], cwd=ROOT, check=False, capture_output=True, text=True)
    if said.returncode:
        raise SystemExit(f"{ROOT} is no clone with its history: {said.stderr.strip()}")
    return said.stdout


if __name__ == "__main__":
    main()
