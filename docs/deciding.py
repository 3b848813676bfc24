"""The page of numbers that decide an answer, refuse data, or are assumed beforehand, as the code has them with reasons.

A number of the rooms below is one whose docstring says `Why:` or `assumed`; the others are tolerances and layout.
"""

from __future__ import annotations

import ast
import importlib
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from enum import Enum
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[1]
ROOMS = {
    "discrepancy": "From probabilities to the answer",
    "inference": "Evidence",
    "estimation": "Fits, noise and words",
    "experiments": "Rigs and logs: what is compared, refused and assumed",
    "measurements": "Rig files",
}
HEAD = """# Numbers that decide

Each number that decides an answer or refuses data stands here with its reason ({decide}), and so does what is assumed
beforehand ({assumed}). The page is made from the code: a number without a reason beside it is a tolerance, a layout,
or a word of a finding.
"""


class Deciding(NamedTuple):
    """Numbers of the code that share a docstring, by module and name, and what it says."""

    module: str
    values: dict[str, Any]
    said: str

    @property
    def row(self) -> str:
        """A row of the page."""
        names = ", ".join(f"`{name}`" for name in self.values)
        values = ", ".join(map(shown, self.values.values()))
        return f"| `{self.module.split('.', 2)[2]}`<br>{names} | {values} | {self.said} |"


def deciding(room: str) -> Iterator[Deciding]:
    """Yield the numbers of a room that decide, or are assumed, in the order of its files."""
    for path in sorted((ROOT / "rover_pin" / room).rglob("*.py")):
        body, module = ast.parse(path.read_text(encoding="utf-8")).body, ".".join(path.relative_to(ROOT).parts)[:-3]
        for node, below in zip(body, body[1:], strict=False):
            if not isinstance(node, ast.Assign) or not isinstance(below, ast.Expr):
                continue
            said = " ".join(str(getattr(below.value, "value", "")).split())
            if re.search(r"\bWhy: |\bassumed\b", said):
                names = [name.id for name in ast.walk(node.targets[0]) if isinstance(name, ast.Name)]
                values = {name: getattr(importlib.import_module(module), name) for name in names}
                yield Deciding(module, {name: one for name, one in values.items() if not isinstance(one, str)}, said)


def page() -> str:
    """Return the page."""
    numbers = {room: list(deciding(room)) for room in ROOMS}
    counts = Counter("Why: " in number.said for listed in numbers.values() for number in listed for _ in number.values)
    parts = [HEAD.format(decide=counts[True], assumed=counts[False])]
    for room, title in ROOMS.items():
        rows = "\n".join(number.row for number in numbers[room])
        parts.append(f"\n## {title}\n\n| Number | Value | What it is, and why |\n| --- | --- | --- |\n{rows}\n")
    return "".join(parts)


def shown(value: Any) -> str:
    """Return a number, or a collection of numbers, in words."""
    if isinstance(value, Mapping):
        return "; ".join(f"{shown(key)}: {shown(element)}" for key, element in value.items())
    if isinstance(value, tuple):
        return ", ".join(map(shown, value))
    if isinstance(value, bool):
        return "yes" if value else "no"
    return str(value.value) if isinstance(value, Enum) else f"{value:.4g}" if isinstance(value, float) else str(value)
