"""Names and units of what is recorded of a drive: the columns of a drive log, and the truth that only a model knows."""

from collections.abc import Iterable
from functools import lru_cache

WHEELS = ("fl", "fr", "ml", "mr", "rl", "rr")
"""Wheel names unless a log says otherwise: front, middle, rear; left, right."""

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
"""Channels named `CHANNEL_WHEEL`; the motor current is `current_WHEEL_A`, `raw_current_WHEEL` in counts of unknown
scale and zero. From slip to travel they are truth only."""
DUTIES, RATES = "duties", "rates"
"""What may be the input of a replay: duties that drive the motors, or the wheel rates that were measured."""
ODOMETRY = "odometry"
"""What a pose may be that was not measured but computed of the wheels."""
TELLING = ("duty", "wheel_rate", "steer", "slip")
"""Channels from whose names the wheels are read; others may be of something else, as a torque_sensor."""

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
"""Channels of the rover; joint angles and energies are recognised by the start of their names."""
BY_START = {"rocker_": "rad", "bogie_": "rad", "energy_": "J"}


@lru_cache(maxsize=4096)
def unit_of(name: str) -> str:
    """Return the unit of a channel by its name; empty where the name tells none."""
    if name in WHOLE:
        return WHOLE[name]
    if name.startswith("current_") and name.endswith("_A"):
        return "A"
    starts = {**BY_START, **{f"{channel}_": unit for channel, unit in PER_WHEEL.items()}}
    return next((unit for start, unit in starts.items() if name.startswith(start)), "")


def wheel_of(name: str) -> str | None:
    """Return the wheel that a channel's name ends with, or None where it tells none."""
    if name.startswith("current_") and name.endswith("_A"):
        return name[len("current_") : -len("_A")]
    for channel in TELLING:
        if name.startswith(f"{channel}_"):
            return name[len(channel) + 1 :]
    return None


def is_column(name: str, wheels: Iterable[str]) -> bool:
    """Return whether a name is that of a drive log's column, of one of these wheels where any are given."""
    if name in WHOLE or name.startswith(tuple(BY_START)):
        return True
    ends = [name[len(kind) + 1 :] for kind in PER_WHEEL if name.startswith(f"{kind}_")]
    ends += [name[len("current_") : -len("_A")]] if name.startswith("current_") and name.endswith("_A") else []
    return any(end in wheels for end in ends) if wheels else bool(ends)


def is_current(name: str) -> bool:
    """Return whether a channel is a motor's current, in amperes or in counts."""
    return name.startswith(("current_", "raw_current_"))


def wheels_in(names: Iterable[str]) -> tuple[str, ...]:
    """Return the wheels that channels are of, in order of appearance."""
    return tuple(dict.fromkeys(wheel for wheel in map(wheel_of, names) if wheel))
