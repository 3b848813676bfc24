"""Numbers and choices that a command reads and that its user did not give: value, standard deviation and source.

A result holds for all of them together. `assumptions_of` lists them, and `with_influence` repeats a drive with each
number that has a known standard deviation (SD) changed by one SD, so that the most decisive number comes first.
"""

import csv
import io
import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rover_pin.base.errors import RoverPinError
from rover_pin.base.files.whole_file import replace_file
from rover_pin.base.settings import NOT_THE_DEFAULT, Setting
from rover_pin.experiments.soil_priors import MOTOR_SD, SD, UNDECLARED_DECAY_SD, UNDECLARED_RESISTANCE_SD

FILE = "assumed.csv"
"""Name of the file with the assumptions in the results of a command."""
OF_MODEL = ("soil.", "motor.", "effect.", "gravity", "buried")
"""Beginnings of the settings that a model file states. With a model file they are given, and not assumed."""
DIFFERS = "differs between drives"
"""Value of an assumption that has another value in each drive of a study."""
DERIVED = ("effect.MotionResistance.R", "duration")
"""Settings whose value follows from soil, load and motor if the user does not give it. They keep their value while
another number is changed, so that each influence belongs to one number."""
READ_FROM = {
    "soil": "the named soil, for the wheels of this rover",
    "motor": "the motor of the rover, or a motor for its weight",
    "effect.MotionResistance.R": "derived: the slip on level ground is that of cruise_slip",
}
"""Setting, or the first part of its name -> source of its value, if the code derives the value from another setting."""


class Assumption(NamedTuple):
    """A number or a choice that a result depends on and that the user did not give."""

    name: str
    "name of the setting that changes it, such as soil.phi"
    value: float | str
    "value in SI, or a word"
    unit: str
    "unit of the value; empty for a word and for a number without a unit"
    sd: float | None
    "assumed standard deviation in the unit of the value; None if the package has none"
    source: str
    """source of the value"""
    influence: Mapping[str, float] = {}
    """name of a result -> change of this result if the number is larger by one SD; empty if it was not computed"""

    def row(self) -> dict[str, Any]:
        """Return the assumption as a dict for JSON: name, value, unit, sd, source and influence."""
        return {**self._asdict(), "influence": dict(self.influence)}


def assumptions_of(settings: Iterable[Setting], given: Collection[str]) -> tuple[Assumption, ...]:
    """Return the settings that the code has read and that the user did not give.

    Parameters
    ----------
    settings : iterable of Setting
        Every setting that the code has asked for, with the value that applies.
    given : collection of str
        Names of the settings that the user gave. An angle may be given in degrees, as `soil.phi_deg`. If the user gave
        a model file (`model`), the numbers that the file states are given too.

    Examples
    --------
    >>> from rover_pin.scenarios.scenario import scenario
    >>> assumed = {entry.name: entry for entry in scenario("flat", **{"soil.k": "5mm"}).assumptions}
    >>> "soil.k" in assumed, round(assumed["soil.phi"].sd, 3)
    (False, 0.07)
    """
    of_file = OF_MODEL if "model" in given else ()
    found = []
    for setting in settings:
        name, value = setting.name, setting.value
        # Settings without a value switch something off, and nothing is assumed about them.
        absent = value is None or value in ((), "") or (isinstance(value, float) and not math.isfinite(value))
        if absent or name in given or f"{name}_deg" in given or name.startswith(of_file or ("\0",)):
            continue
        is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
        sd = assumed_sd(name, float(value)) if is_number else None
        found.append(Assumption(name, float(value) if is_number else str(value), setting.unit, sd, _source(setting)))
    return tuple(found)


def assumed_sd(name: str, value: float) -> float | None:
    """Return the SD of a setting that nobody has measured, in the unit of the setting; None if the package has none.

    The SDs are the priors of `close-loop` for constants that a data set does not declare: soil and wheel from another
    soil (`soil_priors.SD`), the motion resistance, and a motor of a data sheet.
    """
    owner, _, number = name.rpartition(".")
    if owner == "soil" and number in SD:
        # An SD of a logarithm is relative to the value.
        return SD[number].undeclared * (abs(value) if SD[number].is_log else 1.0) or None
    if owner == "effect.MotionResistance":
        return {"R": UNDECLARED_RESISTANCE_SD, "q": UNDECLARED_DECAY_SD}.get(number)
    if owner == "motor" and number in MOTOR_SD:
        return MOTOR_SD[number] * abs(value)
    return None


def with_influence(
    assumptions: Sequence[Assumption], results: Callable[[Mapping[str, float]], Mapping[str, float]]
) -> tuple[Assumption, ...]:
    """Return the assumptions with their influence on some results, the most decisive assumption first.

    Each number with an SD is changed by one SD, all other numbers keep their values, and the results are computed
    again. A number whose sum with its SD is beyond its bounds is reduced by one SD instead, and the change of the
    results is reversed. If this is impossible too, the influence stays empty.

    Parameters
    ----------
    assumptions : sequence of Assumption
        The assumptions of the results.
    results : callable
        Takes changed numbers (name -> value in SI), and returns the results (name -> value). Without changes it must
        return the results that the user sees. The first result decides the order of the assumptions.
    """
    usual = dict(results({}))
    # A number that is derived from another one must stay at its value while the other changes.
    held = {entry.name: float(entry.value) for entry in assumptions if entry.name in DERIVED}
    weighed = []
    for entry in assumptions:
        influence: dict[str, float] = {}
        for sign in (1.0, -1.0) if entry.sd else ():
            try:
                changed = results({**held, entry.name: float(entry.value) + sign * float(entry.sd or 0.0)})
            except RoverPinError:
                continue
            changes = {name: sign * (changed[name] - value) for name, value in usual.items() if name in changed}
            influence = {name: change for name, change in changes.items() if math.isfinite(change)}
            break
        weighed.append(entry._replace(influence=influence))
    first = next(iter(usual), "")
    return tuple(sorted(weighed, key=lambda entry: -abs(entry.influence.get(first, 0.0))))


def shared_by(drives: Iterable[Sequence[Assumption]]) -> tuple[Assumption, ...]:
    """Return the assumptions that several drives have in common.

    A number whose value differs between the drives, because the code derives it from a number that differs, gets the
    words "differs between drives" as its value. A number that one of the drives gives is left out.

    Parameters
    ----------
    drives : iterable of sequences of Assumption
        The assumptions of each drive.
    """
    first, *others = drives
    shared = []
    for entry in first:
        same_name = [next((found for found in other if found.name == entry.name), None) for other in others]
        if None in same_name:
            continue
        varies = any(found is not None and found.value != entry.value for found in same_name)
        shared.append(entry._replace(value=DIFFERS, sd=None) if varies else entry)
    return tuple(shared)


def most_decisive(
    assumptions: Sequence[Assumption], result: str, unit: str, error: float = 0.0, count: int = 3
) -> list[str]:
    """Return one sentence for each of the assumptions that change a result most, the largest change first.

    Parameters
    ----------
    assumptions : sequence of Assumption
        Assumptions with their influence, from `with_influence`.
    result, unit : str
        Name of the result, such as distance_m, and its unit.
    error : float
        Numerical error of the result, in its unit. A change that is not larger may be an error of the computation, and
        is left out.
    count : int
        Maximum number of sentences.
    """
    words = (result.removesuffix(f"_{unit}") if unit else result).replace("_", " ")
    weighed = [entry for entry in assumptions if entry.sd and abs(entry.influence.get(result, 0.0)) > error]
    ordered = sorted(weighed, key=lambda entry: -abs(entry.influence[result]))
    return [
        f"{entry.name} = {entry.value:.4g} {entry.unit} +- {entry.sd:.2g}".replace("  ", " ")
        + f": one SD more changes the {words} by {entry.influence[result]:+.2g} {unit}".rstrip()
        for entry in ordered[:count]
    ]


def write_assumptions(assumptions: Sequence[Assumption], folder: Path) -> Path:
    """Write the assumptions to assumed.csv in a folder, one row for each, and return the path of the file.

    The columns are name, value, unit, sd and source, and one column `change_of_RESULT` for each result of the
    influences. Cells without a number are empty.
    """
    results = list(dict.fromkeys(name for entry in assumptions for name in entry.influence))
    content = io.StringIO()
    table = csv.writer(content, lineterminator="\n")
    table.writerow(["name", "value", "unit", "sd", "source", *(f"change_of_{name}" for name in results)])
    for name, value, unit, sd, source, influence in assumptions:
        table.writerow([name, value, unit, sd, source, *(influence.get(result) for result in results)])
    return replace_file(folder / FILE, content.getvalue())


def _source(setting: Setting) -> str:
    """Return the source of a setting's value. A value that the code derived is explained by its origin."""
    if not setting.source.startswith(NOT_THE_DEFAULT):
        return setting.source
    return READ_FROM.get(setting.name) or READ_FROM.get(setting.name.partition(".")[0]) or setting.source
