"""Compare two verdicts of close-loop runs, which are read from their verdict.json."""

import json
import math
from pathlib import Path

from rover_pin.base.errors import DataError
from rover_pin.base.files import bounded
from rover_pin.comparison.side import Comparison, Side, Value, differences, number_rows, word_rows
from rover_pin.effects.names import display_name
from rover_pin.simulation.model.effect_files import installed_effects

FILE = "verdict.json"
HELD_OUT = "held-out error, "
ADDED = "added"
EQUAL_ERRORS = 0.01
"""If two held-out errors differ by no more than this fraction of the first error, they count as equal."""


def read_verdict(path: Path) -> Side:
    """Read a verdict.json, and return its answer, its held-out errors and its fitted numbers for a comparison.

    Raises DataError if the file is not a verdict or cannot be read.
    """
    try:
        table = json.loads(bounded.text(path))
        words = {
            "data": str(table["name"]),
            "answer": str(table["answer"]),
            ADDED: display_name(" + ".join(table["effects"]), installed_effects()) or "nothing",
        }
        numbers = {HELD_OUT + row["name"]: Value(_to_float(row["after"]), row["unit"]) for row in table["held_out"]}
        # A drive log's verdict has its numbers one level deeper, under "parameters".
        fitted = table["after"].get("parameters", table["after"])
        for name, row in fitted.items():
            ends = (_to_float(row["low"]), _to_float(row["high"]))
            numbers[name] = Value(_to_float(row["value"]), row["unit"], *ends)
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise DataError(
            f"{path}: this is not a verdict of close-loop ({type(error).__name__}: {error}); give the results folder "
            f"of a close-loop, or its {FILE}."
        ) from None
    return Side(str(path), words, numbers)


def _to_float(value: float | None) -> float:
    """Return a number from a JSON file as a float. JSON has no NaN, so a verdict contains null in its place."""
    return math.nan if value is None else float(value)


def compare_verdicts(first: Side, second: Side) -> Comparison:
    """Compare two verdicts: their answers, their held-out errors, and the fitted numbers whose intervals do not
    overlap.
    """
    rows = (*word_rows(first, second), *number_rows(first, second))
    changes = differences(first, second)
    # First sentence: the two answers, and whether they come from the same data.
    answers = [f'"{side.words["answer"]}" ({side.words[ADDED]})' for side in (first, second)]
    other_data = "" if first.words["data"] == second.words["data"] else " (on other data)"
    if answers[0] == answers[1]:
        sentences = [f"Both verdicts{other_data} are {answers[0]}."]
    else:
        sentences = [f"The first verdict is {answers[0]}, the second{other_data} {answers[1]}."]
    # Second sentence: the held-out errors. Their changes are fractions of the first verdict's error, so that channels
    # in different units can be compared; a negative share is a smaller error in the second verdict.
    shares = {
        name: change / first.numbers[name].value
        for name, change in changes.items()
        if name.startswith(HELD_OUT) and first.numbers[name].value > 0 and math.isfinite(change)
    }
    if shares:
        smaller, larger = (sum(sign * share > EQUAL_ERRORS for share in shares.values()) for sign in (-1, 1))
        largest = max(shares, key=lambda name: abs(shares[name]))
        most = ""
        if abs(shares[largest]) > EQUAL_ERRORS:
            most = f"; {largest.removeprefix(HELD_OUT)} changes most, by {shares[largest]:+.0%}"
        sentences.append(
            f"{len(shares)} held-out errors are compared: the second verdict's error is smaller in {smaller} and "
            f"larger in {larger}{most}."
        )
    else:
        sentences.append("They have no held-out error of one channel in common.")
    # An interval is in the row's text. Rows without an interval are constants or errors, and state no agreement.
    if any("[" in row.first and "[" in row.second for row in rows):
        disjoint = [row.name for row in rows if row.note == "intervals apart"]
        sentences.append(
            f"The 95 % intervals of {', '.join(disjoint)} do not overlap."
            if disjoint
            else "All 95 % intervals overlap."
        )
    return Comparison("verdicts", first.label, second.label, " ".join(sentences), rows, changes)
