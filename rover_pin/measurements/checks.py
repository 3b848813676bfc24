"""Checks of measured columns, conversions between definitions of slip, and the findings that a check of data reports.

Each check refuses bad values with a `DataError` that names the column, the row and the remedy. Rows are counted from 1
without the header.
"""

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np

from rover_pin.base.errors import DataError, closest
from rover_pin.base.files.table_layout import MISSING
from rover_pin.estimation.wording import MAX_NAMED

MAX_RATIO = 10.0
"""Largest slip that can be a slip divided by the travel speed. Larger slips look like percent.

Reason: a slip of 10, divided by the travel speed, is S = 0.91 of Eq (1), and few tests go further. A table in percent
has slips above 10."""
ROUNDED_ONE = 1.2
"""Largest absolute slip that counts as the error of a single row. Absolute slips between 1 and this value come from the
sensors' errors at a wheel that spins on the spot or is locked. Larger ones look like slips of another definition. The
value allows a sensor error of 20 % (assumed)."""
FORMULAS = {"over-travel-speed": "(r omega - v) / v", "over-rim-speed": "(r omega - v) / (r omega)"}
"""Formulas of the definitions of slip other than Eq (1) of the paper, (r omega - v) / max(r omega, v), by the names
that rig.toml uses for them. r omega is the rim speed and v the travel speed."""
MAX_DEPTH_RATIO = 10.0
"""Largest accepted ratio of sinkage to wheel radius. A larger sinkage must be in another unit: a sinkage in millimetres
that is read as metres is 1000 times too large, and a sinkage in centimetres 100 times."""


def column(values: Any, name: str, where: str, gaps: bool = False) -> np.ndarray:
    """Return the cells of a column as a read-only array of floats (points,); refuse the column if a cell is not a
    number.

    Parameters
    ----------
    values : sequence
        The cells of the column.
    name, where : str
        Name of the column, and the file or record that holds it, for error messages.
    gaps : bool
        Whether NaN is allowed as a missing cell. Infinite values are never allowed.

    Raises
    ------
    DataError
        Text, an empty column, several dimensions, or a missing or infinite value.

    Examples
    --------
    >>> column([0.1, 0.2], "slip", "points.csv").tolist()
    [0.1, 0.2]
    """
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError):
        # The message names the first cell that is not a number, with its row. Empty cells are passed over.
        culprit = "something that is not a number"
        for row, value in enumerate(values if np.ndim(values) else [], 1):
            if str(value).strip().lower() in MISSING:
                continue
            try:
                float(value)
            except (TypeError, ValueError):
                culprit = f"{str(value)!r} in row {row}, which is not a number"
                break
        raise DataError(f"{where}: {name} holds {culprit}; give numbers only.") from None
    if array.ndim != 1 or array.size == 0:
        raise DataError(f"{where}: {name} has no data; give at least one measured point, as a plain list of numbers.")
    # Missing cells are allowed with `gaps`; infinite ones never.
    bad = np.isinf(array) if gaps else ~np.isfinite(array)
    _refuse_where(bad, array, f"{where}: {name}", "is missing or not finite", "remove or fill that row")
    if np.isnan(array).all():
        raise DataError(f"{where}: {name} has no number in any row; leave that column out.")
    array.setflags(write=False)
    return array


def same_length(where: str, **columns: np.ndarray) -> None:
    """Raise DataError if the columns have different lengths; the message lists the length of each column."""
    lengths = {name: len(values) for name, values in columns.items()}
    if len(set(lengths.values())) > 1:
        length_list = ", ".join(f"{name} {length}" for name, length in lengths.items())
        raise DataError(
            f"{where}: the columns have different lengths ({length_list}); give one value for each point in "
            "every column."
        )


def slips(values: np.ndarray, name: str, where: str) -> None:
    """Raise DataError if slip ratios (points,) lie outside [-1, 1]; the message names the unit or the definition that
    they probably have.

    Percentages reach about 100. The slip (r omega - v) / v has no upper bound, and (r omega - v) / (r omega) has no
    lower bound, where r omega is the rim speed and v the travel speed.
    """
    outside = np.abs(values) > 1
    if not outside.any():
        return
    # The value farthest from 0 shows best which unit or definition was used.
    row = int(np.abs(values).argmax())
    farthest = float(values[row])
    if MAX_RATIO < abs(farthest) <= 100:
        raise DataError(
            f"{where}: {name} reaches {farthest:g} in row {row + 1}, which looks like percent; give a fraction in "
            f"[-1, 1]. If the slip was divided by the travel speed, {definition_advice('over-travel-speed')}."
        )
    # Values beyond one end of [-1, 1] only show by which speed the difference was divided.
    other = "over-travel-speed" if values.max() > 1.0 and values.min() >= -1.0 else ""
    other = "over-rim-speed" if values.min() < -1.0 and values.max() <= 1.0 else other
    if other and abs(farthest) > ROUNDED_ONE:
        raise DataError(
            f"{where}: {name} lies outside [-1, 1] of Eq (1), (r omega - v) / max(r omega, v), in row {row + 1} "
            f"({farthest:g}). The values look like {FORMULAS[other]}: {definition_advice(other)}."
        )
    _refuse_where(outside, values, f"{where}: {name}", "lies outside [-1, 1]", "give the slip of Eq (1) as a fraction")


def definition_advice(definition: str) -> str:
    """Return the advice, for an error message, how a user declares that slips have another definition than Eq (1) of
    the paper.

    `definition` is a key of FORMULAS: "over-travel-speed" or "over-rim-speed". The advice also states the formula for
    the conversion of the slips.
    """
    conversion = "S = 1 - 1 / (1 + s)" if definition == "over-travel-speed" else "S = 1 / (1 - s) - 1 below 0"
    return f"write slip_definition = '{definition}' in rig.toml, or give --slip-definition {definition} ({conversion})"


def positive(values: np.ndarray, name: str, unit: str, where: str) -> None:
    """Raise DataError if a value (points,) is zero or negative; the message names its row."""
    # NaN compares as False, so that missing cells pass.
    todo = f"{name} must be above 0 {unit}".rstrip()
    _refuse_where(values <= 0, values, f"{where}: {name}", "is not positive", todo)


def not_negative(values: np.ndarray, name: str, unit: str, where: str) -> None:
    """Raise DataError if a value (points,) is below zero; the message names its row."""
    _refuse_where(values < 0, values, f"{where}: {name}", "is negative", f"{name} must be 0 or more {unit}".rstrip())


def depths(values: np.ndarray, radius: float, name: str, where: str) -> None:
    """Raise DataError if a sinkage [m] is so large that it must be in another unit.

    A wheel may sink deeper than its axle, for example if it is pushed sideways, so that the radius itself is no limit.
    `rig_physics.suspicions` reports such a depth for a wheel that runs nearly straight.
    """
    if (values > MAX_DEPTH_RATIO * radius).any():
        row = int(np.nanargmax(values))
        raise DataError(
            f"{where}: {name} reaches {values[row]:g} m in row {row + 1}, more than {MAX_DEPTH_RATIO:g} times the "
            f"radius {radius:g} m of the wheel. Give metres: the values look like millimetres or centimetres."
        )


def _refuse_where(bad: np.ndarray, values: np.ndarray, what: str, is_wrong: str, todo: str) -> None:
    """Raise DataError if at least one value of a column is marked as bad; the message states the first bad value and
    its row.

    `bad` (points,) marks the bad values, `what` names the file and the column, `is_wrong` states the fault, and `todo`
    the remedy.
    """
    if bad.any():
        row = int(np.argmax(bad))
        raise DataError(f"{what} {is_wrong} in row {row + 1} ({values[row]:g}); {todo}.")


class Finding(NamedTuple):
    """One line of a data check: the observation, its place (such as file and column), and the remedy."""

    what: str
    where: str
    todo: str

    def __str__(self) -> str:
        return f"{self.where}: {self.what}; {self.todo}."


def merge_findings(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Merge the findings of a data check that differ only in their place into one finding, and return the
    shorter list.
    """
    # Findings of several runs or sets often differ in their place only.
    places: dict[tuple[str, str], list[str]] = {}
    for finding in findings:
        places.setdefault((finding.what, finding.todo), []).append(finding.where)
    return tuple(Finding(what, first_names(where), todo) for (what, todo), where in places.items())


def first_names(names: list[str]) -> str:
    """Return the first few names of a list as text, followed by the number of the remaining names: "a, b
    and 3 more".
    """
    more = len(names) - MAX_NAMED
    return ", ".join(names[:MAX_NAMED]) + (f" and {more} more" if more > 0 else "")


PAPER_DEFINITION = "eq-1"
"""Name, in rig.toml, of the paper's definition of slip, Eq (1): (r omega - v) / max(r omega, v), with the rim speed r
omega and the travel speed v."""


def from_over_travel_speed(s: np.ndarray) -> np.ndarray:
    """Convert slips s = (r omega - v) / v to the slip ratio S of Eq (1) of the paper.

    S = 1 - 1 / (1 + s) if s > 0, else S = s.

    r omega is the rim speed and v the travel speed; Eq (1) divides by the larger of both.
    """
    return np.where(s > 0.0, 1.0 - 1.0 / (1.0 + np.maximum(s, 0.0)), s)


def from_over_rim_speed(s: np.ndarray) -> np.ndarray:
    """Convert slips s = (r omega - v) / (r omega) to the slip ratio S of Eq (1) of the paper.

    S = 1 / (1 - s) - 1 if s < 0, else S = s. r omega is the rim speed and v the travel speed; Eq (1) divides by the
    larger of both.
    """
    return np.where(s < 0.0, 1.0 / (1.0 - np.minimum(s, 0.0)) - 1.0, s)


SLIP_DEFINITIONS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    PAPER_DEFINITION: np.asarray,
    "over-travel-speed": from_over_travel_speed,
    "over-rim-speed": from_over_rim_speed,
}
"""Functions that convert slips to the slip ratio of Eq (1) of the paper, by the name of the definition that the slips
have. The definitions differ in the speed that divides r omega - v."""


def slip_by_definition(slip: np.ndarray, definition: object, where: str) -> np.ndarray:
    """Convert slips of another definition to the slip ratio of Eq (1) of the paper (points,); NaN stays NaN.

    Parameters
    ----------
    slip : array (points,)
        Slips as measured.
    definition : str
        A name in SLIP_DEFINITIONS, from rig.toml or an option.
    where : str
        The file, for error messages.

    Raises
    ------
    DataError
        The definition is unknown, or a slip is impossible under it.

    Examples
    --------
    >>> slip_by_definition(np.array([1.0]), "over-travel-speed", "points.csv").tolist()
    [0.5]
    """
    if not isinstance(definition, str) or definition not in SLIP_DEFINITIONS:
        raise DataError(
            f"{where}: there is no slip_definition {definition!r}: {closest(str(definition), SLIP_DEFINITIONS)}"
        )
    if definition == PAPER_DEFINITION:
        return slip
    # The conversions hold if rim and wheel move in the same direction.
    impossible = slip < -1.0 if definition == "over-travel-speed" else slip > 1.0
    if impossible.any():
        row = int(np.argmax(impossible))
        raise DataError(
            f"{where}: slip is {slip[row]:g} in row {row + 1}. With slip_definition = '{definition}', this is "
            "impossible while rim and wheel move in the same direction. Check that row, or the definition."
        )
    return SLIP_DEFINITIONS[definition](slip)
