"""Two verdicts of the loop, as their verdict.json has them."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rover_pin.base.errors import DataError
from rover_pin.base.files import bounded
from rover_pin.comparison.side import Comparison, Side, Value, differences, number_rows, word_rows
from rover_pin.effects.names import display_name
from rover_pin.simulation.model.effect_files import package_effects

FILE = "verdict.json"
HELD_OUT = "held-out error, "
ADDED = "added"


def read_verdict(path: Path) -> Side:
    """Return a verdict's answer, held-out errors and fitted numbers.

    Raises DataError: not a verdict, or one that cannot be read.
    """
    try:
        table = json.loads(bounded.text(path))
        words = {
            "data": str(table["name"]),
            "answer": str(table["answer"]),
            ADDED: display_name(" + ".join(table["effects"]), package_effects()) or "nothing",
        }
        errors = {HELD_OUT + row["name"]: Value(_to_float(row["after"]), row["unit"]) for row in table["held_out"]}
        return Side(str(path), words, {**errors, **_numbers(table["after"])})
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise DataError(
            f"{path}: it is no verdict of the loop ({type(error).__name__}: {error}); give the folder of a "
            f"close-loop, or its {FILE}."
        ) from None


def _numbers(side: Mapping[str, Any]) -> dict[str, Value]:
    rows = side.get("parameters", side)
    entries = {name: (row["value"], row["low"], row["high"]) for name, row in rows.items()}
    return {
        name: Value(_to_float(v), rows[name]["unit"], _to_float(a), _to_float(b)) for name, (v, a, b) in entries.items()
    }


def _to_float(value: float | None) -> float:
    return math.nan if value is None else float(value)


def compare_verdicts(first: Side, second: Side) -> Comparison:
    """Return the two side by side: what they add, what they predict better, which numbers do not agree."""
    rows = (*word_rows(first, second), *number_rows(first, second))
    by = differences(first, second)
    sentence = " ".join(
        part for part in (_answers(first, second), _errors(first, by), _describe_intervals(rows)) if part
    )
    return Comparison("verdicts", first.label, second.label, sentence, rows, by)


def _answers(first: Side, second: Side) -> str:
    of = "" if first.words["data"] == second.words["data"] else " of other data"
    says = [f'"{side.words["answer"]}" ({side.words[ADDED]})' for side in (first, second)]
    if says[0] == says[1]:
        return f"Both{of} say {says[0]}."
    return f"The first says {says[0]}, the second{of} {says[1]}."


def _errors(first: Side, by: Mapping[str, float]) -> str:
    """Return how many channels the second predicts better, and where it differs most; by no more than 1 % is alike."""
    shares = {
        name: change / first.numbers[name].value
        for name, change in by.items()
        if name.startswith(HELD_OUT) and first.numbers[name].value > 0 and math.isfinite(change)
    }
    if not shares:
        return "They have no held-out error of one channel in common."
    better, worse = (sum(sign * share > 0.01 for share in shares.values()) for sign in (-1, 1))
    most = max(shares, key=lambda name: abs(shares[name]))
    least = "" if abs(shares[most]) <= 0.01 else f", most {most.removeprefix(HELD_OUT)} by {shares[most]:+.0%}"
    return f"Of {len(shares)} held-out errors the second's is smaller in {better} and greater in {worse}{least}."


def _describe_intervals(rows: tuple[Any, ...]) -> str:
    disjoint = [row.name for row in rows if row.note == "intervals apart"]
    shared = [row for row in rows if "[" in row.first and "[" in row.second]
    if not shared:
        return ""
    return f"The 95 % intervals of {', '.join(disjoint)} do not meet." if disjoint else "All their 95 % intervals meet."
