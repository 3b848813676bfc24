"""All numbers in a ROS bag as one table: every topic's fields, on one clock."""

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from rover_pin.base.errors import DataError
from rover_pin.logs.one_clock import FEWEST, Series, on_one_clock
from rover_pin.logs.ros_bag import field_names, nanoseconds, opened

LONGEST_ARRAY = 16
"""Arrays with more entries, as images, scans and covariances, are left out."""
APART = 3600 * 10**9
"""Stamps that are off the times of receipt by more [ns] are of another clock."""


def bag_table(path: Path) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Return every number of a bag as columns `/topic.field`, interpolated on even steps of `t_s`, and what was done.

    Raises DataError: it is no bag, or no topic in it has numbers.
    Raises MissingExtraError: the extra `ros` is not installed.
    """
    with opened(path) as bag:
        series, skipped, stale = _read(bag)
    if not series:
        raise DataError(f"{path}: no topic of the bag has numbers in {FEWEST} messages or more.")
    table, period = on_one_clock(path, series)
    omissions = [f"topics of unknown type are left out: {', '.join(skipped)}"] if skipped else []
    if stale:
        omissions.append(
            f"stamps stand still or are of another clock, so times of receipt are taken: {', '.join(stale)}"
        )
    return table, (f"{len(series)} fields of the bag, interpolated every {period:g} s", *omissions)


def _read(bag: Any) -> tuple[Series, list[str], list[str]]:
    """Return the fields, the topics that cannot be read, and those whose stamps are no times."""
    samples_of: dict[str, list[tuple[int, int, float]]] = {}
    skipped: set[str] = set()
    for connection, received, raw in bag.messages():
        if connection.topic in skipped:
            continue
        try:
            message = bag.deserialize(raw, connection.msgtype)
        except Exception:
            skipped.add(connection.topic)
            continue
        stamp = getattr(getattr(message, "header", None), "stamp", None)
        at = received if stamp is None else nanoseconds(stamp)
        for field, value in _leaves(message, ""):
            samples_of.setdefault(f"{connection.topic}{field}", []).append((at, received, value))
    series: Series = {}
    stale: dict[str, None] = {}
    for field, samples in ((field, samples) for field, samples in samples_of.items() if len(samples) >= FEWEST):
        stamps, receipts = (np.array([sample[at] for sample in samples]) for at in (0, 1))
        if np.mean(np.diff(stamps) > 0) < 0.5 or abs(np.median(stamps - receipts)) > APART:
            stale[field.split(".")[0]] = None
            stamps = receipts
        series[field] = (stamps, np.array([sample[2] for sample in samples]))
    return series, sorted(skipped), list(stale)


def _leaves(value: Any, path: str) -> Iterator[tuple[str, float]]:
    """Yield every number in a message with its path; entries of an array by the names beside it, else by place."""
    if isinstance(value, (bool, int, float, np.number)):
        yield path, float(value)
    elif dataclasses.is_dataclass(value):
        names = getattr(value, "name", None)
        for field in field_names(value):
            if field not in ("header", "name"):
                yield from _member(getattr(value, field), f"{path}.{field}", names)


def _member(value: Any, path: str, names: Any) -> Iterator[tuple[str, float]]:
    if isinstance(value, (str, bytes)) or not hasattr(value, "__len__"):
        yield from _leaves(value, path)
    elif len(value) <= LONGEST_ARRAY:
        labels = list(names) if isinstance(names, list) and len(names) == len(value) else range(len(value))
        for label, element in zip(labels, value, strict=True):
            yield from _leaves(element, f"{path}[{label}]")
