"""What a whole drive makes of its numbers: the slope of every channel to a setting, with its error."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_pin.base.errors import ParameterError, closest
from rover_pin.base.public import brief, public
from rover_pin.scenarios.along import course_of, drive_along
from rover_pin.scenarios.scenario import scenario, settings_of
from rover_pin.simulation.trace.trace import Trace

WIDTH = 5e-6
"""Width of a difference over the number, or in its unit where that is 0: drives are equal to some 1e-14, and what bends
their slopes lies some 1e-4 of a number apart."""
FIXED = ("dt", "duration")
"""Numbers that say how long and how finely is driven: along fixed steps nothing depends on them."""


@brief
@dataclass(frozen=True, eq=False)
class Slope:
    """How a drive depends on one number: by channel, each (T,), in the channel's unit over that of the number."""

    value: float
    "of the number"
    unit: str
    channels: Mapping[str, np.ndarray]
    errors: Mapping[str, np.ndarray]

    def __getitem__(self, channel: str) -> np.ndarray:
        return self.channels[channel]


@public
def sensitivities(
    name: str, numbers: Sequence[str], /, widths: Mapping[str, float] = {}, **settings: Any
) -> tuple[Trace, dict[str, Slope]]:
    """Return a ready-made drive, and d(channel)/d(number) all along it, by differences along the drive's own steps.

    With f_i the channel at p + i h, all driven by the very steps, shorter where forces ask for it, that the drive
    at p took,

        df/dp = (f_1 - f_-1) / 2 h,    error = |D(h) - D(2 h)| + |R - L| / 2

    D the difference over this width and over twice of it, R and L the slopes to the right and to the left alone,
    (4 f_1 - f_2 - 3 f_0) / 2 h and (3 f_0 - 4 f_-1 + f_-2) / 2 h. Where f is smooth the first part is three times the
    error of second order; at a bend (a wheel touches down, or meets the edge of a cell of `hills`, in another step; a
    duty meets its limit at another sample) within 2 h the sum bounds what the bend adds. A slope at a bend itself is
    the mean of R and L. Slopes are those of the drive as it is computed: long drives through ditches part so fast that
    theirs hold for next to no change of a number; give wider `widths` there.

    Parameters
    ----------
    name, **settings
        As of `scenario`. What follows from a number, as the resistance R from the soil, follows it here, unless it is
        set itself.
    numbers : sequence of str
        Dotted settings that are numbers, as "soil.k", "terrain.wall_angle", "motor.gear" or "control.k_p".
    widths : mapping
        h of some of them, in their units; of the others it is WIDTH times the number, or WIDTH where that is 0.

    Returns
    -------
    Trace
        The drive.
    dict
        By number a `Slope` with `value`, `unit`, `channels` and `errors`, each (T,), and `slope["body_x"]`. Rows that
        a drive beside this one did not reach are not a number.

    Raises
    ------
    ParameterError
        A setting that is unknown, no number, or so near its bound that no difference fits; a width of no number that is
        asked for, or not positive.
    SimulationError
        As `simulate`.

    Source: internal differentiation, Bock, Recent advances in parameter identification techniques for ODE (1983); four
    drives a number.

    Examples
    --------
    >>> drive, slopes = sensitivities("incline", ["soil.phi", "start.x"], duration=3.0)
    >>> x, error = slopes["soil.phi"]["body_x"], slopes["soil.phi"].errors["body_x"]
    >>> x.shape == drive.t.shape, bool(error[-1] < 1e-6 * abs(x[-1])), round(float(slopes["start.x"]["body_x"][-1]), 6)
    (True, True, 1.0)
    """
    if isinstance(numbers, str):
        raise ParameterError(f"numbers = {numbers!r} is not allowed: give a list of names, as [{numbers!r}].")
    _refuse_widths(widths, numbers)
    values = _values(name, numbers, settings)
    scene = scenario(name, **settings)
    trace = scene.drive()
    course = course_of(scene, trace)
    slopes = {}
    for number, (value, unit) in values.items():
        width = widths.get(number, WIDTH * abs(value) or WIDTH)
        others = {key: setting for key, setting in settings.items() if key != f"{number}_deg"}
        beside = (scenario(name, **{**others, number: value + i * width}) for i in (-2, -1, 1, 2))
        around = [drive_along(scene, course) for scene in beside]
        slopes[number] = _slope(trace, around, value, width, unit)
    return trace, slopes


def _refuse_widths(widths: Mapping[str, float], numbers: Sequence[str]) -> None:
    for number, width in widths.items():
        if number not in numbers:
            raise ParameterError(f"widths has '{number}', which is none of the numbers: {closest(number, numbers)}")
        if not 0.0 < width < math.inf:
            raise ParameterError(f"widths['{number}'] = {width:g} is not allowed: give a positive number.")


def _values(name: str, numbers: Sequence[str], settings: Mapping[str, Any]) -> dict[str, tuple[float, str]]:
    """Return the numbers as they are set, with their units."""
    known = {
        setting.name: (setting.value, setting.unit)
        for setting in settings_of(name, **settings)
        if _is_number(setting.value) and setting.name not in FIXED
    }
    for number in numbers:
        if number not in known:
            raise ParameterError(f"'{number}' is no number of this drive: {closest(number, known)}")
    return {number: known[number] for number in numbers}


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _slope(trace: Trace, around: Sequence[Trace], value: float, width: float, unit: str) -> Slope:
    """Return the slopes from drives at -2, -1, 1 and 2 widths."""
    channels: dict[str, np.ndarray] = {}
    errors: dict[str, np.ndarray] = {}
    for channel in set(trace) - {"t_s"}:
        minus_2, minus, plus, plus_2 = (_change(trace, beside, channel) / width for beside in around)
        channels[channel] = (plus - minus) / 2
        wide, bend = (plus_2 - minus_2) / 4, (4 * plus - plus_2) / 2 - (minus_2 - 4 * minus) / 2
        errors[channel] = np.abs(channels[channel] - wide) + np.abs(bend) / 2
    return Slope(value, unit, channels, errors)


def _change(trace: Trace, beside: Trace, channel: str) -> np.ndarray:
    """Return by how much a channel is another in a drive beside this one; an angle goes the short way round."""
    change = np.full(len(trace.t), np.nan)
    rows = min(len(trace.t), len(beside.t))
    change[:rows] = beside[channel][:rows] - trace[channel][:rows]
    return np.remainder(change + np.pi, 2 * np.pi) - np.pi if trace.unit(channel) == "rad" else change
