"""All numbers in a ROS bag as one table: every topic's fields, on one clock."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from rover_pin.base.errors import DataError
from rover_pin.logs.ros_bag import MOST_ROWS, field_names, interpolated, nanoseconds, opened

LONGEST_ARRAY = 16
"""Arrays with more entries, as images, scans and covariances, are left out."""
FEWEST = 5
"""Messages that a topic needs."""
FINEST, COARSEST = 0.02, 0.2
"""Bounds of the clock's period [s], between which it is that of the topic in the middle."""
CLOCK = "t_s"

APART = 3600 * 10**9
"""Stamps that are off the times of receipt by more [ns] are of another clock."""
Series = dict[str, tuple[np.ndarray, np.ndarray]]
"""Field -> times [ns] and values."""


def bag_table(path: Path) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Return every number of a bag as columns `/topic.field`, interpolated on even steps of `t_s`, and what was done.

    Raises
    ------
    DataError
        It is no bag, or no topic in it has numbers.
    MissingExtraError
        The extra `ros` is not installed.
    """
    with opened(path) as bag:
        series, skipped, stale = _read(bag)
    if not series:
        raise DataError(f"{path}: no topic of the bag has numbers in {FEWEST} messages or more.")
    table, period = _on_one_clock(path, series)
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
        ahead = np.concatenate([[True], stamps[1:] > np.maximum.accumulate(stamps)[:-1]])
        series[field] = (stamps[ahead], np.array([sample[2] for sample in samples])[ahead])
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


def _on_one_clock(path: Path, series: Series) -> tuple[pd.DataFrame, float]:
    steps = [1e-9 * float(np.median(np.diff(times))) for times, _ in series.values()]
    period = round(float(np.clip(np.median(steps), FINEST, COARSEST)), 3)
    begin, end = min(times[0] for times, _ in series.values()), max(times[-1] for times, _ in series.values())
    lasts = 1e-9 * (end - begin)
    rows = int(lasts / period) + 1
    if rows > MOST_ROWS:
        raise DataError(
            f"{path}: its topics span {lasts:.3g} s, {rows} rows, and {MOST_ROWS} are the most: where stamps are "
            "of different clocks, convert the bag with one."
        )
    t = period * np.arange(rows)
    columns = {name: _within(t, (times - begin) * 1e-9, values) for name, (times, values) in series.items()}
    return pd.DataFrame({CLOCK: t, **columns}), period


def _within(t: np.ndarray, times: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.where((t < times[0]) | (t > times[-1]), np.nan, interpolated(t, times, values))
