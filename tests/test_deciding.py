"""The page of numbers that decide: it has the values of the code, and every number that something is compared with."""

import ast
import importlib
import re
from collections.abc import Mapping
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ROOMS = "discrepancy", "inference", "estimation", "experiments", "measurements"
MAX_DECIDING = 170
"""Numbers that something is compared with. A new number replaces another, or is argued for here."""


@pytest.fixture(scope="module")
def page():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "docs"))
        return importlib.import_module("deciding").page()


@pytest.fixture(scope="module")
def rows(page):
    """The rows of the page: module, names, the cell with their values, the reason."""
    matches = re.findall(r"^\| `([\w.]+)`<br>(.+?) \| (.+?) \| (.+) \|$", page, re.MULTILINE)
    assert len(matches) == page.count("<br>")
    return [(where, re.findall(r"`(\w+)`", names), values, reason) for where, names, values, reason in matches]


def numbers(value):
    """Return all numbers in a value."""
    if isinstance(value, Mapping):
        return numbers(tuple(value.values()))
    if isinstance(value, tuple):
        return [number for element in value for number in numbers(element)]
    return [float(value)]


def module_of(where):
    return importlib.import_module(f"rover_pin.{where}")


def test_the_page_has_the_values_of_the_code(rows, page):
    for where, names, cell, reason in rows:
        matches = re.findall(r"-?\d[\d.]*(?:e[+-]\d+)?", re.sub(r"[\w ]+: ", " ", cell))
        values = numbers(tuple(getattr(module_of(where), name) for name in names))
        assert [float(number) for number in matches] == pytest.approx(values, rel=1e-3), (where, names)
        assert len(reason.split()) >= 4, (where, names)
    decide, others = map(int, re.search(r"\((\d+) numbers\).+?\((\d+) numbers\)", page, re.DOTALL).groups())
    assert decide + others == sum(len(names) for _, names, *_ in rows)
    assert decide <= MAX_DECIDING


def test_every_number_that_something_is_compared_with_is_on_the_page(rows):
    """A number in a comparison decides something. Numbers of other rooms, as the soil's, have pages of their own."""
    listed = {name for _, names, *_ in rows for name in names}
    assigned, compared = set(), set()
    for path in sorted(file for room in ROOMS for file in (ROOT / "rover_pin" / room).rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        module = importlib.import_module(".".join(path.relative_to(ROOT).with_suffix("").parts))
        is_known = {name for name in vars(module) if name.isupper() and type(getattr(module, name)) in (int, float)}
        for node in ast.walk(tree):
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                assigned.add(node.id)
            if isinstance(node, ast.Compare):
                compared |= is_known & {name.id for name in ast.walk(node) if isinstance(name, ast.Name)}
    assert len(compared & assigned) > 100
    assert compared & assigned <= listed, sorted(compared & assigned - listed)
