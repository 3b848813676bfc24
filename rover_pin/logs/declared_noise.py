"""What a drive log declares of its sensors: the SD of a sample for each kind of channel, and the time between two."""

from collections.abc import Mapping
from typing import Any

from rover_pin.base.errors import DataError, closest
from rover_pin.base.quantity import refuse_strange, to_si, value_and_unit

SAMPLE_PERIOD = "sample_period"
NOISE = {
    "wheel_rate": "rad/s",
    "angle": "rad",
    "current": "A",
    "body_position": "m",
    "body_attitude": "rad",
    "body_velocity": "m/s",
    "battery": "V",
    "gyro": "rad/s",
    "accelerometer": "m/s^2",
    SAMPLE_PERIOD: "s",
}
"""Keys of `[noise]` and their units; an angle is one of steering, rockers and bogies."""
STARTS = {
    "wheel_rate_": "wheel_rate",
    "rocker_": "angle",
    "bogie_": "angle",
    "current_": "current",
    "body_v": "body_velocity",
    "body_x": "body_position",
    "body_y": "body_position",
    "body_z": "body_position",
    "body_roll": "body_attitude",
    "body_pitch": "body_attitude",
    "body_yaw": "body_attitude",
    "battery_V": "battery",
    "gyro_": "gyro",
    "accelerometer_": "accelerometer",
}
"""How the names of channels begin, and their kinds; the longer beginning stands."""


def read_declared_noise(table: Mapping[str, Any], where: str) -> dict[str, float]:
    """Return the SDs of a table `[noise]` in SI by kind, and the time between samples, where it is declared.

    Raises DataError: a key that is none of NOISE, or what is not a number above 0.
    Raises ParameterError: a unit of another kind, or an entry with a strange key.
    """
    noise = {}
    for key, entry in table.items():
        if key not in NOISE:
            raise DataError(f"{where}: there is no key '{key}' in [noise]: {closest(key, NOISE)}")
        noise[key] = _number(entry, NOISE[key], f"{where}: [noise] {key}")
    return noise


def kind_of(channel: str) -> str:
    """Return the kind of a channel as `[noise]` calls it; empty where it has none."""
    prefixes = [start for start in STARTS if channel.startswith(start)]
    return STARTS[max(prefixes, key=len)] if prefixes else ""


def _number(entry: Any, unit: str, where: str) -> float:
    if isinstance(entry, Mapping):
        refuse_strange(entry, where)
    value, declared_unit = value_and_unit(entry, unit)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 < value < float("inf"):
        raise DataError(f"{where} has no number above 0; write {{ value = 0.01, unit = '{unit}' }}.")
    return to_si(value, declared_unit, unit, where)
