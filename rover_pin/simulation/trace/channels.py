"""Names and units of the channels of a drive: the columns of a drive log, and channels that only a simulator can
record.
"""

from collections.abc import Iterable
from functools import lru_cache

WHEELS = ("fl", "fr", "ml", "mr", "rl", "rr")
"""Names of the wheels of a log that declares none: f, m, r for front, middle, rear, then l, r for left, right."""

PER_WHEEL = {
    "duty": "-",
    "wheel_rate": "rad/s",
    "steer": "rad",
    "slip": "-",
    "sinkage": "m",
    "normal": "N",
    "tangential": "N",
    "lateral": "N",
    "torque": "N m",
    "travel": "m/s",
    "raw_current": "-",
}
"""Channels that exist for each wheel, with their units. The name of such a channel in a log is `CHANNEL_WHEEL`, for
example `slip_fl`. The motor current is `current_WHEEL_A`, or `raw_current_WHEEL` if it is recorded in counts of unknown
scale and zero. No sensor measures the channels from slip to travel."""
DUTIES, RATES = "duties", "rates"
"""Words of a log for the inputs of its replay: the duties that drive the motors, or the measured wheel rates."""
ODOMETRY = "odometry"
"""Word with which a log declares that its pose was computed from the wheel rates and not measured."""
WHEEL_NAMING = ("duty", "wheel_rate", "steer", "slip")
"""Channels from whose names the names of the wheels are read. The names of other channels, such as torque_sensor, may
end with a word that is not a wheel."""

WHOLE = {
    "t_s": "s",
    **{f"body_{axis}": "m" for axis in "xyz"},
    **{f"body_{angle}": "rad" for angle in ("roll", "pitch", "yaw")},
    **{f"body_v{axis}": "m/s" for axis in "xyz"},
    "battery_V": "V",
    **{f"gyro_{axis}": "rad/s" for axis in "xyz"},
    **{f"accelerometer_{axis}": "m/s^2" for axis in "xyz"},
    "differential_torque": "N m",
}
"""Channels that exist once for the whole rover, with their units."""
BY_START = {"rocker_": "rad", "bogie_": "rad", "energy_": "J"}
"""Beginning of a channel's name -> its unit, for joint angles and energies. A rover may have any number of them."""


@lru_cache(maxsize=4096)
def unit_of(name: str) -> str:
    """Return the unit of a channel by its name; an empty string if the name is not known."""
    if name in WHOLE:
        return WHOLE[name]
    if name.startswith("current_") and name.endswith("_A"):
        return "A"
    starts = {**BY_START, **{f"{channel}_": unit for channel, unit in PER_WHEEL.items()}}
    return next((unit for start, unit in starts.items() if name.startswith(start)), "")


def wheel_of(name: str) -> str | None:
    """Return the name of the wheel in a channel's name, or None if the channel does not belong to a wheel."""
    if name.startswith("current_") and name.endswith("_A"):
        return name[len("current_") : -len("_A")]
    for channel in WHEEL_NAMING:
        if name.startswith(f"{channel}_"):
            return name[len(channel) + 1 :]
    return None


def is_column(name: str, wheels: Iterable[str]) -> bool:
    """Return whether `name` can be the name of a column in a drive log.

    If `wheels` are given, the name of a column for a wheel is accepted only if its wheel is among them.
    """
    if name in WHOLE or name.startswith(tuple(BY_START)):
        return True
    ends = [name[len(kind) + 1 :] for kind in PER_WHEEL if name.startswith(f"{kind}_")]
    ends += [name[len("current_") : -len("_A")]] if name.startswith("current_") and name.endswith("_A") else []
    return any(end in wheels for end in ends) if wheels else bool(ends)


def is_current(name: str) -> bool:
    """Return whether a channel is a motor current, either in amperes or in counts."""
    return name.startswith(("current_", "raw_current_"))


def wheels_in(names: Iterable[str]) -> tuple[str, ...]:
    """Return the names of the wheels that occur in the channels' names, in the order of their first occurrence."""
    return tuple(dict.fromkeys(wheel for wheel in map(wheel_of, names) if wheel))
