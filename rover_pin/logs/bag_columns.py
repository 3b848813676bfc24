"""Which column of a run comes from where in a ROS bag.

In `drive.toml`, which column comes from where::

    [bag]
    period = { value = 40, unit = "ms" }
    [columns]
    duty_fl = { topic = "/command", field = "data[0]", scale = 0.01 }
    wheel_rate_fl = { topic = "/joint_states", field = "velocity[name=wheel_fl]", unit = "rpm", stamp = "header.stamp" }
    body_x = { topic = "/tracker", field = "pose.position.x" }
    body_yaw = { topic = "/tracker", field = "pose.orientation.yaw" }
    [[run]]
    file = "climb.mcap"

A field is a path of names; `[3]` takes an entry of an array, `[name=wheel_fl]` the entry at which the array `name`
beside it says so; `roll`, `pitch`, `yaw` (world z-y-x) follow a quaternion. `stamp` is the field with the message's
time, without it the time of its receipt. Duties keep their value until the next message, as does what has
`hold = true`; all else is interpolated, and left empty where messages fail to come.
"""

import math
import re
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from rover_pin.base.errors import DataError, ParameterError, closest
from rover_pin.base.quantity import to_si, value_and_unit
from rover_pin.simulation.trace.channels import unit_of

KEYS = ("topic", "field", "scale", "unit", "hold", "stamp")
PART = re.compile(r"(\w+)(?:\[(?:(\d+)|(\w+)=([^\]]+))\])?")
ANGLES = ("roll", "pitch", "yaw")


class Source(NamedTuple):
    """Where a column comes from."""

    topic: str
    field: str
    scale: float = 1.0
    unit: str = ""
    hold: bool = False
    stamp: str = ""


def sources_from(columns: Mapping[str, Any], where: str) -> dict[str, Source]:
    """Return the sources in a [columns] table."""
    if not columns:
        raise DataError(
            f"{where}: a bag needs the table [columns]: add duty_fl = {{ topic = '...', field = '...' }} and so on."
        )
    return {name: _source(name, entry, where) for name, entry in columns.items()}


def _source(name: str, entry: Any, where: str) -> Source:
    if not isinstance(entry, Mapping) or not {"topic", "field"} <= entry.keys():
        raise DataError(f"{where}: [columns] {name} = {entry!r}: give {{ topic = '...', field = '...' }}.")
    for key, value in entry.items():
        if key not in KEYS:
            raise DataError(f"{where}: [columns] {name} has an unknown key '{key}': {closest(key, KEYS)}")
        kind = {"scale": (int, float), "hold": (bool,)}.get(key, (str,))
        if not isinstance(value, kind) or (key == "scale" and isinstance(value, bool)):
            raise DataError(f"{where}: [columns] {name} has {key} = {value!r}: give {kind[-1].__name__}.")
    for path in (entry["field"], entry.get("stamp", "")):
        if path and not all(PART.fullmatch(part) for part in parts(path)):
            raise DataError(f"{where}: [columns] {name}: '{path}' is no field: write a.b, a[3] or a[name=b].")
    return Source(**{"hold": name.startswith("duty_"), **entry})


def parts(field: str) -> list[str]:
    """Return a path's parts; a dot inside brackets belongs to a name."""
    return re.split(r"\.(?![^\[]*\])", field)


def period_from(bag: Mapping[str, Any], where: str) -> float:
    """Return the period of a [bag] table [ns]."""
    for key in bag:
        if key != "period":
            raise DataError(f"{where}: [bag] has an unknown key '{key}': {closest(key, ('period',))}")
    entry = bag.get("period")
    value, unit = value_and_unit(entry, "s")
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 < value < math.inf:
        raise DataError(f"{where}: a bag needs [bag] period = {{ value = 40, unit = 'ms' }}, but it is {entry!r}.")
    try:
        return 1e9 * to_si(value, str(unit), "s", f"{where}: [bag] period")
    except ParameterError as error:
        raise DataError(str(error)) from error


def si(name: str, source: Source, values: np.ndarray, where: str) -> np.ndarray:
    """Return a column's values in SI, scaled first."""
    expected = unit_of(name)
    if not source.unit:
        return source.scale * values
    try:
        return source.scale * values * to_si(1.0, source.unit, expected, f"{where}: [columns] {name}")
    except ParameterError as error:
        raise DataError(str(error)) from error


def angle_of(name: str, q: Any) -> float:
    """Return an angle of the z-y-x sequence [rad] of a quaternion, whatever its length."""
    square = q.x**2 + q.y**2 + q.z**2 + q.w**2
    if not square > 0.0:
        return math.nan
    if name == "roll":
        return math.atan2(2 * (q.w * q.x + q.y * q.z), square - 2 * (q.x**2 + q.y**2))
    if name == "yaw":
        return math.atan2(2 * (q.w * q.z + q.x * q.y), square - 2 * (q.y**2 + q.z**2))
    return math.asin(max(-1.0, min(1.0, 2 * (q.w * q.y - q.z * q.x) / square)))
