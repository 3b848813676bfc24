"""The page of numbers that decide an answer, refuse data, or are assumed, with the reasons in the code.

A number of the rooms below is a module's constant that has a docstring. A constant decides if the code compares
something with it. The other constants are assumed beforehand, or set the size of a computation.
"""

from __future__ import annotations

import ast
import importlib
from collections.abc import Iterator, Mapping
from enum import Enum
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[1]
ROOMS = {
    "discrepancy": "From probabilities to the answer",
    "inference": "Evidence",
    "estimation": "Fits and noise",
    "experiments": "Rigs and logs: what is compared, refused and assumed",
    "measurements": "Rig files",
}
HEAD = """# Numbers that decide

This page lists the constants of the loop, from the check of the data to the answer, with their reasons. In the first
table of each section, the code compares something with the number, so the number decides ({decide} numbers). In the
second table, the number is assumed as a prior, or sets the size of a computation ({others} numbers). The page is
generated from the code.
"""


class DocumentedNumber(NamedTuple):
    """Constants of one module that share a docstring: their values, the docstring, and whether one is compared."""

    module: str
    values: dict[str, Any]
    docstring: str
    decides: bool

    @property
    def row(self) -> str:
        """The row of the page."""
        names = ", ".join(f"`{name}`" for name in self.values)
        values = ", ".join(map(shown, self.values.values()))
        return f"| `{self.module.split('.', 1)[1]}`<br>{names} | {values} | {self.docstring} |"


def documented_numbers(room: str) -> Iterator[DocumentedNumber]:
    """Yield the documented numbers of a room, in the order of its files."""
    trees = {path: ast.parse(path.read_text(encoding="utf-8")) for path in python_files(room)}
    compared = {name for tree in trees.values() for name in compared_names(tree)}
    for path, tree in trees.items():
        module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        for node, below in zip(tree.body, tree.body[1:], strict=False):
            if not isinstance(node, ast.Assign | ast.AnnAssign) or not isinstance(below, ast.Expr):
                continue
            docstring = " ".join(str(getattr(below.value, "value", "")).split())
            names = [name.id for name in ast.walk(target_of(node)) if isinstance(name, ast.Name)]
            values = {name: getattr(importlib.import_module(module), name) for name in names if name.isupper()}
            values = {name: value for name, value in values.items() if is_number(value)}
            if docstring and values:
                yield DocumentedNumber(module, values, docstring, bool(compared & set(values)))


def python_files(room: str) -> list[Path]:
    """Return the source files of a room."""
    return sorted((ROOT / "rover_pin" / room).rglob("*.py"))


def target_of(node: ast.Assign | ast.AnnAssign) -> ast.expr:
    """Return what an assignment gives a value to."""
    return node.targets[0] if isinstance(node, ast.Assign) else node.target


def compared_names(tree: ast.AST) -> set[str]:
    """Return the upper-case names that stand in a comparison (`error > MAX_ERROR`), which are constants."""
    comparisons = (node for node in ast.walk(tree) if isinstance(node, ast.Compare))
    names = (name for comparison in comparisons for name in ast.walk(comparison) if isinstance(name, ast.Name))
    return {name.id for name in names if name.id.isupper()}


def is_number(value: Any) -> bool:
    """Return whether a value is a number, or a table of numbers that is not empty."""
    if isinstance(value, Mapping):
        value = tuple(value.values())
    if isinstance(value, tuple):
        return bool(value) and all(map(is_number, value))
    return isinstance(value, int | float) and not isinstance(value, bool)


def page() -> str:
    """Return the page."""
    numbers = {room: list(documented_numbers(room)) for room in ROOMS}
    listed = [number for room in numbers.values() for number in room]
    decide = sum(len(number.values) for number in listed if number.decides)
    others = sum(len(number.values) for number in listed) - decide
    parts = [HEAD.format(decide=decide, others=others)]
    for room, title in ROOMS.items():
        parts.append(f"\n## {title}\n")
        for decides, heading in ((True, "What is compared with it, and why"), (False, "Assumption or size, and why")):
            if rows := [number.row for number in numbers[room] if number.decides is decides]:
                parts.append(f"\n| Number | Value | {heading} |\n| --- | --- | --- |\n" + "\n".join(rows) + "\n")
    return "".join(parts)


def shown(value: Any) -> str:
    """Return a number, or a collection of numbers, in words."""
    if isinstance(value, Mapping):
        return "; ".join(f"{shown(key)}: {shown(element)}" for key, element in value.items())
    if isinstance(value, tuple):
        return ", ".join(map(shown, value))
    if isinstance(value, Enum):
        return str(value.value)
    return f"{value:.4g}" if isinstance(value, float) else str(value)
