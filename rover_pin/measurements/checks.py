"""Checks of measured columns, and what a check of data says: what, where, what to do.

Each refuses with one sentence; rows are counted from 1, without the header.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from rover_pin.base.errors import DataError
from rover_pin.estimation.wording import MAX_NAMED


def column(values: Any, name: str, where: str, gaps: bool = False) -> np.ndarray:
    """Return `values` as a one-dimensional array of finite floats, not empty; with `gaps` NaN is a missing cell."""
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError):
        raise DataError(f"{where}: {name} holds {_no_number(values)}; give numbers only.") from None
    if array.ndim != 1 or array.size == 0:
        raise DataError(f"{where}: {name} has no data; give at least one measured point, as a plain list of numbers.")
    bad = np.isinf(array) if gaps else ~np.isfinite(array)
    _refuse_where(bad, array, f"{where}: {name}", "is missing or not finite", "remove or fill that row")
    if np.isnan(array).all():
        raise DataError(f"{where}: {name} has no number in any row; leave that column out.")
    array.setflags(write=False)
    return array


def _no_number(values: Any) -> str:
    """Return the first entry that is no number, and its row."""
    for row, value in enumerate(values if np.ndim(values) else [], 1):
        try:
            float(value)
        except (TypeError, ValueError):
            return f"{str(value)!r} in row {row}, which is not a number"
    return "something that is not a number"


def same_length(where: str, **columns: np.ndarray) -> None:
    """Refuse columns of different lengths."""
    lengths = {name: len(values) for name, values in columns.items()}
    if len(set(lengths.values())) > 1:
        length_list = ", ".join(f"{name} {length}" for name, length in lengths.items())
        raise DataError(f"{where}: the columns have different lengths ({length_list}); give one value a point in each.")


def slips(values: np.ndarray, name: str, where: str) -> None:
    """Refuse slip ratios outside [-1, 1], and say so where they look like percent."""
    outside = np.abs(values) > 1
    if not outside.any():
        return
    if 2 < np.abs(values).max() <= 100:
        raise DataError(
            f"{where}: {name} reaches {np.abs(values).max():g}, which looks like percent; give a fraction in [-1, 1]."
        )
    _refuse_where(outside, values, f"{where}: {name}", "lies outside [-1, 1]", "slip is Eq (1)'s fraction")


def positive(values: np.ndarray, name: str, unit: str, where: str) -> None:
    """Refuse values that are zero or negative."""
    todo = f"{name} must be above 0 {unit}".rstrip()
    _refuse_where(values <= 0, values, f"{where}: {name}", "is not positive", todo)


def not_negative(values: np.ndarray, name: str, unit: str, where: str) -> None:
    """Refuse values below zero."""
    _refuse_where(values < 0, values, f"{where}: {name}", "is negative", f"{name} must be 0 or more {unit}".rstrip())


def depths(values: np.ndarray, radius: float, name: str, where: str) -> None:
    """Refuse sinkages deeper than the axle, which millimetres taken for metres are."""
    if (values > radius).any():
        row = int(np.nanargmax(values))
        raise DataError(
            f"{where}: {name} reaches {values[row]:g} m in row {row + 1}, deeper than the axle of a wheel of radius "
            f"{radius:g} m; if these are millimetres, divide them by 1000."
        )


def _refuse_where(bad: np.ndarray, values: np.ndarray, what: str, is_wrong: str, todo: str) -> None:
    if bad.any():
        row = int(np.argmax(bad))
        raise DataError(f"{what} {is_wrong} in row {row + 1} ({values[row]:g}); {todo}.")


class Finding(NamedTuple):
    """One line of the data check."""

    what: str
    where: str
    todo: str

    def __str__(self) -> str:
        return f"{self.where}: {self.what}; {self.todo}."


def merge_findings(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return the findings with those that differ only in their place made one."""
    places: dict[tuple[str, str], list[str]] = {}
    for finding in findings:
        places.setdefault((finding.what, finding.todo), []).append(finding.where)
    return tuple(Finding(what, first_names(where), todo) for (what, todo), where in places.items())


def first_names(names: list[str]) -> str:
    """Return the first of some names, and how many more there are."""
    more = len(names) - MAX_NAMED
    return ", ".join(names[:MAX_NAMED]) + (f" and {more} more" if more > 0 else "")
