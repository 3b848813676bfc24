"""The page of numbers that decide: it has what the code has, and what answers or refuses has its reason there."""

import ast
import importlib
import re
from collections.abc import Mapping
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ROOMS = "discrepancy", "inference", "estimation", "experiments", "measurements"
MOST = 132
"""Numbers, and tables of numbers, that decide or are assumed. A new one replaces another, or is argued for here."""
DECIDES = re.compile(
    r"\w+_faults|_faults|_impossible|_too_much|_signs|_work|_off_by|_gain|_is_sure|refuse_\w+|too_poor|decide|losses|equal"
    r"|_is_beyond|implausible|is_noise|outcome|_thousandths|_rates_or_positions|_in_degrees|_turns_in_degrees|_times"
)
"""Functions by which a loop answers, or data are refused, left out or called noise."""


@pytest.fixture(scope="module")
def rows():
    """The rows of the page: module, names, the cell with their values."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "docs"))
        page = importlib.import_module("deciding").page()
    found = re.findall(r"^\| `([\w.]+)`<br>(.+?) \| (.+?) \| (.+) \|$", page, re.MULTILINE)
    assert len(found) == page.count("<br>")
    return [(where, re.findall(r"`(\w+)`", names), values, said) for where, names, values, said in found]


def numbers(value):
    """Return all numbers in a value."""
    if isinstance(value, Mapping):
        return numbers(tuple(value.values()))
    if isinstance(value, tuple):
        return [number for element in value for number in numbers(element)]
    return [] if isinstance(value, bool) else [float(value)]


def module_of(where):
    (room,) = (room for room in ROOMS if (ROOT / f"rover_pin/{room}/{where.replace('.', '/')}.py").is_file())
    return importlib.import_module(f"rover_pin.{room}.{where}")


def test_the_page_has_the_values_of_the_code(rows):
    for where, names, cell, said in rows:
        written = re.findall(r"-?\d[\d.]*(?:e[+-]\d+)?", re.sub(r"[\w ]+: ", " ", cell))
        values = numbers(tuple(getattr(module_of(where), name) for name in names))
        assert [float(each) for each in written] == pytest.approx(values, rel=1e-3), (where, names)
        assert "Why: " in said or "assumed" in said
    assert sum(len(names) for _, names, *_ in rows) <= MOST


def test_what_answers_or_refuses_is_on_the_page(rows):
    listed, seen = {name for _, names, *_ in rows for name in names} | {"LARGEST"}, set()  # the terrain's
    for path in sorted(file for room in ROOMS for file in (ROOT / "rover_pin" / room).rglob("*.py")):
        module = importlib.import_module(".".join(path.relative_to(ROOT).with_suffix("").parts))
        for function in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(function, ast.FunctionDef) and DECIDES.fullmatch(function.name):
                used = {name.id for name in ast.walk(function) if isinstance(name, ast.Name) and name.id.isupper()}
                seen |= {name for name in used if type(getattr(module, name, None)) in (int, float)}
    assert len(seen) > 40
    assert seen <= listed, sorted(seen - listed)
