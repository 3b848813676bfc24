"""The mutation run's changes: what is changed in Python and C, what is left alone, and no stale excuse."""

import ctypes
import importlib
import subprocess
from pathlib import Path

import numpy as np
import pytest

from rover_pin.motion.toolchain import compiler

ROOT = Path(__file__).parents[2]


@pytest.fixture
def loaded(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "studies" / "benchmarks"))
    return lambda name: importlib.import_module(f"changes.{name}")


def said(found):
    return [one.said.rpartition(": ")[2] for one in found]


def test_a_formula_is_changed_sign_by_sign_and_term_by_term(loaded):
    text = "def f(a: float = 2.0, *, b=3) -> float:\n    return a + 0.5 * b if a <= b else -max(a, b)\n"
    found = loaded("python").changes(text)
    assert said(found) == [
        "2.0 -> 2.2", "a + 0.5 * b -> (-max(a, b))", "-max(a, b) -> (a + 0.5 * b)", "<= -> >", "+ -> -",
        "a + 0.5 * b -> (a)", "a + 0.5 * b -> (0.5 * b)", "* -> /", "0.5 * b -> (0.5)", "0.5 -> 0.55",
        "-max(a, b) -> (max(a, b))", "max -> min",
    ]  # fmt: skip
    for one in found:
        changed = one.of(text)
        assert changed != text
        compile(changed, "changed", "exec")


def test_a_limit_is_touched_only_where_something_is_counted(loaded):
    """Two numbers that are worked out are never equal."""
    assert said(loaded("python").changes("one = len(a) < b\n")) == ["< -> >=", "< -> <="]
    assert said(loaded("python").changes("one = a > 0\n")) == ["> -> <=", "> -> >=", "0 -> 1"]
    assert said(loaded("python").changes("one = a > b\n")) == ["> -> <="]


def test_what_guards_a_division_is_left_alone(loaded):
    assert said(loaded("python").changes("x = max(a, 1e-9)\n")) == ["max -> min"]
    assert said(loaded("c").changes("x = fmax(a, 1e-9);\n")) == ["fmax( -> fmin("]


def test_declarations_messages_and_indices_are_left_alone(loaded):
    text = (
        'x: float = quantity(1.0, "m", "assumed", 0.0, 2.0, "x")\n'
        'def f(a):\n    """Return 1 + 1."""\n    if not a[3 - 1]:\n        raise ValueError(f"{1 + 1}" + "2")\n'
    )
    assert said(loaded("python").changes(text)) == ["not a[3 - 1] -> (a[3 - 1])"]


def test_c_is_changed_outside_of_comments_directives_and_loops_heads(loaded):
    text = (
        "#include <a + b>\n/* a + b */\nfor (int i = 0; i < 3 - 1; ++i) {\n"
        "  x = -fmin(a * 2.5, b) + 1e-7; /* - */\n  if (x > 0.0 && y) x += 1.0;\n}\n"
    )
    assert said(loaded("c").changes(text)) == [
        "= - -> =", "fmin( -> fmax(", "* -> /", "2.5 -> 2.75", "+ -> -", "> -> <=", "0.0 -> 0.1", "&& -> ||",
        "+= -> -=", "1.0 -> 1.1",
    ]  # fmt: skip


def test_named_thresholds_and_divisors_of_c_are_changed_and_sizes_are_not(loaded):
    text = (
        "#define LEAST 1e-3 /* m */\n#define N 8\n#define MOST_STEPS 300\n#define NEXT (a + b)\n"
        "static double larger(double a) { return -a / 6; }\nx = smaller(a[3], LEAST);\n"
        '_Static_assert(sizeof(A) == 8 * N, "a + b");\n'
    )
    assert said(loaded("c").changes(text)) == [
        "1e-3 -> 0.0011", "300 -> 330", "return - -> return", "/ -> *", "6 -> 7", "smaller( -> larger(",
    ]  # fmt: skip


def test_what_builds_the_kept_models_is_changed_before_they_are_built(loaded, tmp_path):
    """A model that was built without the change would hide it; of what runs later or while imported, none would."""
    file = tmp_path / "law.py"
    file.write_text("TWICE = 2.0\n\n\ndef builds(a):\n    return a + 1.5\n\n\ndef later(a):\n    return a - 2.5\n")
    found = [(file, one) for one in loaded("python").changes(file.read_text())]
    kept = loaded("kept").Kept(tmp_path / "kept.json")
    trial = loaded("trial").Trial(tmp_path, found, kept, (1.0, 0.0))
    trial._built = {"law.py": [5]}
    assert {one.line: trial._builds(path, one) for path, one in found} == {1: False, 5: True, 9: False}


def test_every_excuse_is_still_of_a_change_that_is_made(loaded):
    excused = loaded("equivalent").EQUIVALENT
    for (file, told), reason in excused.items():
        maker = loaded("python" if file.endswith(".py") else "c")
        made = [one.said for one in maker.changes((ROOT / file).read_text(encoding="latin-1"))]
        assert told in made, (file, told)
        assert reason


def test_what_is_kept_outlives_a_run_that_was_killed_while_it_wrote(loaded, tmp_path):
    file = tmp_path / "kept.json"
    kept = loaded("kept").Kept(file)
    kept.put("one", ["a test", "digest"])
    kept.put("two", [])
    kept.put("one", ["another", "digest"])
    assert loaded("kept").Kept(file).values == {"one": ["another", "digest"], "two": []}
    file.write_text(file.read_text()[:-7])
    again = loaded("kept").Kept(file)
    assert again.values == {"one": ["a test", "digest"], "two": []}
    again.put("three", 3)
    assert loaded("kept").Kept(file).get("three") == 3


def test_a_rooms_tally_takes_the_place_of_its_last(loaded, tmp_path):
    tally, file = loaded("tally"), tmp_path / "tally.csv"
    rows = (
        ("soil", 9, 7, 2, 1, "arc.py:1", "", "abc"),
        ("effects", 5, 5, 0, 0, "", "2", "abc"),
        ("soil", 10, 10, 3, 0, "", "", "d+"),
    )
    for row in rows:
        tally.put(file, tally.Row(*row))
    assert file.read_text().splitlines() == [
        "room,tried,noticed,survived,excused,left,untried,longest,commit",
        "effects,5,5,0,0,0,,2,abc", "soil,10,10,0,3,0,,,d+",
    ]  # fmt: skip
    assert tally.commit(ROOT).rstrip("+").isalnum()


def test_a_test_is_known_by_its_own_text_and_what_it_shares(loaded, tmp_path):
    """A test that comes beside it, or changes, leaves what it noticed standing."""
    digest, shared = loaded("kept").test_digest, "import os\n\n\ndef helps():\n    return {}\n"
    other = "\n\n@mark\ndef test_other(a):\n    assert {}\n"
    own = "\n\ndef test_own():\n    assert {}\n"
    texts = {
        "as it is": shared.format(1) + other.format(1) + own.format(1),
        "another": shared.format(1) + other.format(2) + own.format(1),
        "before": shared.format(1) + own.format(1) + other.format(1),
        "alone": shared.format(1) + own.format(1),
        "changed": shared.format(1) + other.format(1) + own.format(2),
        "helped": shared.format(2) + other.format(1) + own.format(1),
    }
    found = {}
    for name, text in texts.items():
        file = tmp_path / f"test_{name}.py"
        file.write_text(text)
        found[name] = digest(file, "test_own")
    assert found["as it is"] == found["another"] == found["before"] == found["alone"]
    assert len({found["as it is"], found["changed"], found["helped"]}) == 3


def test_no_change_survives_in_the_last_runs(loaded):
    """Of what a row says was tried; the run says so with the command at the head of studies/benchmarks/mutation.py."""
    rows = loaded("tally").read(ROOT / "studies" / "results" / "mutation.csv")
    whole = {"soil", "effects", "body", "estimation", "drive_log"}
    assert whole <= {row["room"] for row in rows}
    for row in rows:
        assert int(row["tried"]) == int(row["noticed"]) + int(row["survived"])
        assert int(row["survived"]) == 0, row["room"]
        assert int(row["tried"]) > 50, row["room"]
        untried = [int(each.rpartition(":")[2]) for each in row["untried"].split()]
        assert int(row["left"]) == sum(untried), row["room"]
        if row["room"] in whole:
            assert not untried, row["room"]
            assert int(row["tried"]) > 300, row["room"]


def test_the_page_tells_the_last_run_of_every_room(loaded):
    rows = loaded("tally").read(ROOT / "studies" / "results" / "mutation.csv")
    page = (ROOT / "CONTRIBUTING.md").read_text().partition("## What the tests notice")[2].partition("\n## ")[0]
    told = [[each.strip() for each in line.strip("|").split("|")] for line in page.splitlines() if line.startswith("|")]
    assert told[2:] == [[row[name] for name in ("room", "tried", "survived", "excused", "left")] for row in rows]


C_TEXT = """
static double twice(double x) { return 2.0 * x; }

/* Sum + more. */
static double sum(const double *x, int n, double room[2]) {
  double total = -twice(x[0]);
  for (int i = 1; i < n; ++i) {
    total += x[i] * 0.5;
  }
  room[1] = total > 3.0 ? total : 3.5;
  return total;
}

void fill(double *out) {
  const double x[3] = {1.0, 2.0, 3.0};
  out[0] = sum(x, 3, out + 1);
}
"""


def test_a_switch_holds_every_change_of_a_function_as_it_would_be_alone(loaded, tmp_path):
    """All in one library, chosen by a number in memory, against one library for each."""
    switch, found = loaded("switch"), loaded("c").changes(C_TEXT)
    numbered = list(enumerate(found, 1))
    text, numbers = switch.switched(C_TEXT, numbered)
    assert numbers == {number for number, _ in numbered}
    together, told = compiled(text, tmp_path / "together"), set()
    for number, one in [(0, None), *numbered]:
        switch.CHOSEN.value = number
        wanted = filled(compiled(one.of(C_TEXT) if one else C_TEXT, tmp_path / f"alone{number}"))
        assert filled(together) == wanted, one
        told.add(str(wanted))
    switch.CHOSEN.value = 0
    assert len(told) > 8


def compiled(text, stem):
    stem.with_suffix(".c").write_text(text)
    command = [*compiler(), "-shared", "-fPIC", "-w", "-o", str(stem.with_suffix(".so")), str(stem.with_suffix(".c"))]
    subprocess.run(command, check=True)
    return ctypes.CDLL(str(stem.with_suffix(".so")))


def filled(library):
    out = np.zeros(3)
    library.fill(ctypes.c_void_p(out.ctypes.data))
    return out.tolist()
