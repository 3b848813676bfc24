"""All numbers in a ROS bag as one table: every topic's fields, on one clock."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from rover_pin.errors import DataError, MissingExtraError

LONGEST_ARRAY = 16
"""Arrays with more entries, as images, scans and covariances, are left out."""
FEWEST = 5
"""Messages that a topic needs."""
FINEST, COARSEST = 0.02, 0.2
"""Bounds of the clock's period [s], between which it is that of the topic in the middle."""
MISSED = 5.0
"""Between messages that are this many usual intervals apart nothing is interpolated."""
CLOCK = "t_s"

Series = dict[str, tuple[list[float], list[float]]]


def bag_table(path: Path) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Return every number of a bag as columns `/topic.field`, interpolated on even steps of `t_s`, and what was done.

    Raises
    ------
    DataError
        It is no bag, or no topic in it has numbers.
    MissingExtraError
        The extra `ros` is not installed.
    """
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise MissingExtraError(
            f"{path}: a ROS bag needs the extra 'ros': pip install 'rover-pin[ros]', or convert it to CSV."
        ) from error
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as bag:
            series, skipped = _read(bag)
    except Exception as error:
        raise DataError(f"{path}: the bag cannot be read: {(str(error) or repr(error)).splitlines()[0]}") from error
    series = {name: each for name, each in series.items() if len(each[0]) >= FEWEST}
    if not series:
        raise DataError(f"{path}: no topic of the bag has numbers in {FEWEST} messages or more.")
    table, period = _on_one_clock(series)
    left = (f"topics of unknown type are left out: {', '.join(skipped)}",) if skipped else ()
    return table, (f"{len(series)} fields of the bag, interpolated every {period:g} s", *left)


def _read(bag: Any) -> tuple[Series, list[str]]:
    series: Series = {}
    skipped: set[str] = set()
    for connection, received, raw in bag.messages():
        if connection.topic in skipped:
            continue
        try:
            message = bag.deserialize(raw, connection.msgtype)
        except Exception:
            skipped.add(connection.topic)
            continue
        at = 1e-9 * _time(message, received)
        for field, value in _leaves(message, ""):
            times, values = series.setdefault(f"{connection.topic}{field}", ([], []))
            if not times or at > times[-1]:
                times.append(at)
                values.append(value)
    return series, sorted(skipped)


def _time(message: Any, received: int) -> int:
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    told = int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec) if stamp is not None else 0
    return told or received


def _leaves(value: Any, path: str) -> Iterator[tuple[str, float]]:
    """Yield every number in a message with its path; entries of an array by the names beside it, else by place."""
    if isinstance(value, (bool, int, float, np.number)):
        yield path, float(value)
    elif dataclasses.is_dataclass(value):
        names = getattr(value, "name", None)
        for each in dataclasses.fields(value):
            if each.name.startswith("__") or each.name in ("header", "name"):
                continue
            yield from _member(getattr(value, each.name), f"{path}.{each.name}", names)


def _member(value: Any, path: str, names: Any) -> Iterator[tuple[str, float]]:
    if isinstance(value, (str, bytes)) or not hasattr(value, "__len__"):
        yield from _leaves(value, path)
    elif len(value) <= LONGEST_ARRAY:
        labels = list(names) if isinstance(names, list) and len(names) == len(value) else range(len(value))
        for label, each in zip(labels, value, strict=True):
            yield from _leaves(each, f"{path}[{label}]")


def _on_one_clock(series: Series) -> tuple[pd.DataFrame, float]:
    steps = [float(np.median(np.diff(times))) for times, _ in series.values()]
    period = round(float(np.clip(np.median(steps), FINEST, COARSEST)), 3)
    begin = min(times[0] for times, _ in series.values())
    t = begin + period * np.arange(int((max(times[-1] for times, _ in series.values()) - begin) / period) + 1)
    made = {name: _interpolated(t, np.array(times), np.array(values)) for name, (times, values) in series.items()}
    return pd.DataFrame({CLOCK: t - begin, **made}), period


def _interpolated(t: np.ndarray, times: np.ndarray, values: np.ndarray) -> np.ndarray:
    found = np.interp(t, times, values, left=np.nan, right=np.nan)
    after = np.clip(np.searchsorted(times, t), 1, len(times) - 1)
    apart = times[after] - times[after - 1] > MISSED * float(np.median(np.diff(times)))
    return np.where(apart & (t > times[after - 1]) & (t < times[after]), np.nan, found)
