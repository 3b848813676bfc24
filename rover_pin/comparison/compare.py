"""Compare two verdicts, two models or two drives. The files at the two paths decide which of the three are compared.

`compare` is the public function. A verdict and a model are read and compared here, a drive in `drives`.
"""

import json
import math
from collections.abc import Iterator
from enum import StrEnum
from pathlib import Path
from typing import Any

from rover_pin.base.errors import DataError
from rover_pin.base.files import bounded
from rover_pin.base.files.paths import is_file
from rover_pin.base.quantity import quantities
from rover_pin.base.trust import Trust
from rover_pin.comparison import drives
from rover_pin.comparison.side import ABSENT, Comparison, Side, Value, differences, number_rows, word_rows
from rover_pin.effects.names import display_name, title_of
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.estimation.wording import MAX_LISTED
from rover_pin.experiments.drive_log.model import owner_name
from rover_pin.experiments.wheel_rig.model import RigModel
from rover_pin.experiments.wheel_rig.model import read_model as read_rig_model
from rover_pin.logs.drive_log import FILE as DRIVE_FILE
from rover_pin.simulation.model.effect_files import installed_effects
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.model.toml_file import is_rig_model, read_model
from rover_pin.terrain.shapes import flat

VERDICT_FILE = "verdict.json"
"""Name of the file of a verdict in the results folder of close-loop."""
HELD_OUT = "held-out error, "
"""Beginning of the name of a held-out error in a comparison of two verdicts; the name of the channel follows."""
ADDED = "added"
"""Name of the row with the effects that a verdict added to its model."""
EQUAL_ERRORS = 0.01
"""If two held-out errors differ by at most this fraction of the first error, they count as equal. Reports print errors
with three digits, so smaller differences would hardly be visible."""


class Comparable(StrEnum):
    """The kinds of results that `compare` can compare. The value is the name of the kind in error messages."""

    VERDICT = "a verdict"
    MODEL = "a model"
    DRIVE = "a drive"


def compare(first: str | Path, second: str | Path, run: str = "", trust: Trust = Trust()) -> Comparison:
    """Compare two verdicts, two models or two drives.

    Parameters
    ----------
    first, second : path
        Two paths with results of one kind. A verdict is the results folder of a close-loop run or its verdict.json, a
        model is a model.toml, and a drive is the folder of a drive log or a trace in .parquet.
    run : str
        Name of the run to compare, for drive logs with several runs; by default the first run.
    trust : Trust
        Whether the code of user-supplied effects that a model names may run.

    Returns
    -------
    Comparison
        With `sentence`, `rows` and `as_dict()`. Differences are second minus first.

    Raises
    ------
    DataError
        If the paths hold results of different kinds or nothing that can be compared, or if a file cannot be read.

    Examples
    --------
    >>> from rover_pin.comparison.compare import compare
    >>> print(compare("out/monday/model.toml", "out/tuesday/model.toml").sentence)  # doctest: +SKIP
    """
    paths = (Path(first), Path(second))
    kinds = [kind_of(path) for path in paths]
    if kinds[0] is not kinds[1]:
        raise DataError(
            f"{first} is {kinds[0]}, but {second} is {kinds[1]}: compare two verdicts, two models or two drives."
        )
    if kinds[0] is Comparable.VERDICT:
        sides = [read_verdict(path if is_file(path) else path / VERDICT_FILE) for path in paths]
        return compare_verdicts(*sides)
    if kinds[0] is Comparable.MODEL:
        return compare_models(*(read_side(path, trust) for path in paths))
    return drives.compare_drives(*(drives.read_drive(path, run, trust) for path in paths))


def kind_of(path: Path) -> Comparable:
    """Return whether a path holds a verdict, a model or a drive.

    Raises DataError if the path holds none of these.
    """
    # A results folder also holds model.toml, so the verdict is looked for first.
    if is_file(path / VERDICT_FILE) or (path.suffix == ".json" and is_file(path)):
        return Comparable.VERDICT
    if is_file(path / DRIVE_FILE) or path.suffix == ".parquet":
        return Comparable.DRIVE
    if path.suffix == ".toml" and is_file(path):
        return Comparable.MODEL
    raise DataError(
        f"{path}: there is nothing to compare at this path. Give the folder of a close-loop ({VERDICT_FILE}), a "
        f"model.toml, the folder of a drive log ({DRIVE_FILE}) or a trace in .parquet."
    )


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
            f"of a close-loop, or its {VERDICT_FILE}."
        ) from None
    return Side(str(path), words, numbers)


def _to_float(value: float | None) -> float:
    """Return a number from a JSON file as a float. JSON has no NaN, so a verdict contains null in its place."""
    return math.nan if value is None else float(value)


def compare_verdicts(first: Side, second: Side) -> Comparison:
    """Return the comparison of two verdicts, which `read_verdict` has read.

    The sentence states the two answers, the changes of the held-out errors, and the fitted numbers whose 95 % intervals
    do not overlap.
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
    # Second sentence: the held-out errors. Each change is divided by the first verdict's error, so that channels with
    # different units can be compared. A negative share means that the second verdict has the smaller error.
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
        sentences.append("The two verdicts have no channel with a held-out error in common.")
    # Third sentence: the intervals. Rows without an interval are errors or constants, and cannot agree or disagree.
    if any("[" in row.first and "[" in row.second for row in rows):
        disjoint = [row.name for row in rows if row.note == "intervals apart"]
        sentences.append(
            f"The 95 % intervals of {', '.join(disjoint)} do not overlap."
            if disjoint
            else "All 95 % intervals overlap."
        )
    return Comparison("verdicts", first.label, second.label, " ".join(sentences), rows, changes)


def read_side(path: Path, trust: Trust) -> Side:
    """Read a model file, and return its effects in words and its numbers for a comparison.

    The terrain of a rover's model is not compared.
    """
    model: RigModel | Model = (
        read_rig_model(path, trust) if is_rig_model(path) else read_model(path, terrain=flat(), trust=trust)
    )
    effects = model.effects if isinstance(model, RigModel) else model.all_effects
    # A model is described by its kind, its forms and its effects (words), and by the numbers of all of its parts.
    words = {"of": "a wheel on a rig" if isinstance(model, RigModel) else f"a rover, {model.rover.name}"}
    # The form of the traction and of the contact angles is a word, not a number, but it changes the prediction too.
    for effect in effects:
        if isinstance(effect, SoilTraction):
            words["traction"] = f"{type(effect.form).__name__}, {type(effect.angles).__name__}"
    words |= {f"effect {owner_name(effect)}": title_of(type(effect)) for effect in effects}
    numbers = {}
    for owner, record in (*_records(model), *((owner_name(effect), effect) for effect in effects)):
        for name, quantity in quantities(record).items():
            numbers[f"{owner}.{name}"] = Value(float(getattr(record, name)), quantity.unit)
    return Side(str(path), words, numbers)


def _records(model: RigModel | Model) -> Iterator[tuple[str, Any]]:
    """Yield the wheels, soils and motor of a model as pairs of a name and a record. The names of the record's numbers
    begin with this name, as in `soil.k`.
    """
    if isinstance(model, RigModel):
        yield from (("wheel", model.wheel), ("soil", model.soil))
    else:
        yield from ((f"wheel {wheel.name}", wheel.wheel) for wheel in model.rover.wheels)
        yield from (("soil" if not n else f"soil {n}", soil) for n, soil in enumerate(model.soils))
        yield "motor", model.motor


def compare_models(first: Side, second: Side) -> Comparison:
    """Return the comparison of two models, which `read_side` has read.

    The sentence lists the effects that only one of the models has, and the first numbers that differ.
    """
    rows = (*word_rows(first, second), *number_rows(first, second))
    effects = [row for row in rows if row.name.startswith("effect ")]
    sentences = []
    # First the effects that only one of the two models has.
    for which, only_first in (("first", True), ("second", False)):
        titles = [row.first if only_first else row.second for row in effects]
        others = [row.second if only_first else row.first for row in effects]
        unshared = [title for title, other in zip(titles, others, strict=True) if other == ABSENT]
        if unshared:
            sentences.append(f"Only the {which} model has {', '.join(unshared)}.")
    if not sentences:
        sentences.append("Both models have equal effects.")
    # Then the numbers that both models have.
    shared = [row for row in rows if ABSENT not in (row.first, row.second) and not row.name.startswith("effect ")]
    changed = [row for row in rows if row.change]
    if changed:
        named = "; ".join(f"{row.name} {row.first} -> {row.second}" for row in changed[:MAX_LISTED])
        more = f" and {len(changed) - MAX_LISTED} more" if len(changed) > MAX_LISTED else ""
        sentences.append(f"{len(changed)} of the {len(shared)} common numbers differ: {named}{more}.")
    else:
        sentences.append(f"None of the {len(shared)} common numbers differs.")
    sentence = " ".join(sentences)
    return Comparison("models", first.label, second.label, sentence, rows, differences(first, second))
