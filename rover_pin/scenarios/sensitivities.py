"""Sensitivities of a whole drive: the derivative of every channel by a number among the settings, with its error.

A simulation that chooses its own time steps gives a result that jumps a little whenever a changed number changes this
choice. Therefore the neighbouring drives take the time steps of the first drive, and their result is a smooth function
of every number. Source: Bock, Recent advances in parameter identification techniques for ODE (1983), internal
differentiation.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_pin.base.errors import ParameterError, closest
from rover_pin.base.public import brief, public
from rover_pin.scenarios.scenario import Scenario, scenario, settings_of
from rover_pin.simulation.driving import RunningDrive, run_compiled
from rover_pin.simulation.replay import StepsTaken
from rover_pin.simulation.simulate import set_out
from rover_pin.simulation.stepping.step_error import complete_steps
from rover_pin.simulation.trace.record import finite, trace_of
from rover_pin.simulation.trace.trace import Trace

RELATIVE_WIDTH = 5e-6
"""Default width h of a finite difference, as a fraction of the number; if the number is 0, the width in the number's
unit.

Drives are reproducible to about 1e-14 of a channel, and derivatives change noticeably if a number changes by about 1e-4
of its value. The width lies between these two limits."""
FIXED = ("dt", "duration")
"""Settings without a sensitivity, because no channel depends on them if the time steps are fixed."""


@brief
@dataclass(frozen=True, eq=False)
class Slope:
    """Derivatives of all channels of a drive by one number, a setting of the drive, at T recorded times.

    Each derivative is in the channel's unit divided by the number's unit. `slope["body_x"]` is
    `slope.channels["body_x"]`.
    """

    value: float
    "value of the number at which the derivatives are taken"
    unit: str
    "unit of the number"
    channels: Mapping[str, np.ndarray]
    """name of a channel -> derivative of the channel by the number (T,)"""
    errors: Mapping[str, np.ndarray]
    """name of a channel -> estimated error of its derivative (T,)"""

    def __getitem__(self, channel: str) -> np.ndarray:
        return self.channels[channel]


@public
def sensitivities(
    name: str, numbers: Sequence[str], /, widths: Mapping[str, float] = {}, **settings: Any
) -> tuple[Trace, dict[str, Slope]]:
    """Return a ready-made drive, and the derivatives of all its channels by some of its numbers.

    The derivatives are differences between drives that all take the time steps of the drive itself (the steps become
    shorter where forces need it). Let p be the number, h the width of the difference, and f_i the channel at p + i h:

        df/dp = (f_1 - f_-1) / 2 h,    error = |D(h) - D(2 h)| + |R - L| / 2

    D(h) and D(2 h) are the differences with the widths h and 2 h. R and L are the one-sided derivatives on the right
    and on the left, (4 f_1 - f_2 - 3 f_0) / 2 h and (3 f_0 - 4 f_-1 + f_-2) / 2 h. If the channel f is a smooth
    function of the number, the first part of the error is three times the true error, which is of second order in h. f
    has a bend, for example, if a changed number makes a wheel touch down, or meet the edge of a cell of `hills`, one
    step earlier or later, or makes a duty meet its limit at another sample. Within 2 h of a bend the error is an upper
    bound of the effect of the bend. At the bend itself the derivative is the mean of R and L.

    The derivatives are derivatives of the computed drive. Long drives through ditches are so sensitive that their
    derivatives hold only for extremely small changes of a number; give larger `widths` for them.

    Parameters
    ----------
    name, **settings
        Name and settings of the drive, as for `scenario`. A quantity that is derived from a number, for instance the
        motion resistance R from the soil, changes with the number here too, unless a setting states the quantity.
    numbers : sequence of str
        Settings that are numbers: "soil.k", "terrain.wall_angle", "motor.gear" or "control.k_p", for example.
    widths : mapping
        Number -> h, in the number's unit. Other numbers have the width RELATIVE_WIDTH times the number, or
        RELATIVE_WIDTH if the number is 0.

    Returns
    -------
    Trace
        The drive.
    dict
        For each number a `Slope` with `value`, `unit`, `channels` and `errors`; `slope["body_x"]` is a derivative [T].
        Rows that a neighbouring drive did not reach are NaN.

    Raises
    ------
    ParameterError
        A setting is unknown, is no number, or is so close to its bound that no difference fits; or a width is not
        positive or belongs to none of the numbers.
    SimulationError
        The drive fails, as in `simulate`.

    Source: internal differentiation, Bock, Recent advances in parameter identification techniques for ODE (1983); each
    number takes four drives.

    Examples
    --------
    >>> drive, slopes = sensitivities("incline", ["soil.phi", "start.x"], duration=3.0)
    >>> x, error = slopes["soil.phi"]["body_x"], slopes["soil.phi"].errors["body_x"]
    >>> x.shape == drive.t.shape, bool(error[-1] < 1e-6 * abs(x[-1])), round(float(slopes["start.x"]["body_x"][-1]), 6)
    (True, True, 1.0)
    """
    if isinstance(numbers, str):
        raise ParameterError(f"numbers = {numbers!r} is not allowed: give a list of names such as [{numbers!r}].")
    for number, width in widths.items():
        if number not in numbers:
            raise ParameterError(f"widths has '{number}', which is not one of `numbers`: {closest(number, numbers)}")
        if not 0.0 < width < math.inf:
            raise ParameterError(f"widths['{number}'] = {width:g} is not allowed: give a positive number.")
    known = {}
    # The settings of the drive show which names exist, and which of them are numbers.
    for setting in settings_of(name, **settings):
        number = setting.value
        # Words and switches are settings without a derivative.
        is_number = isinstance(number, (int, float)) and not isinstance(number, bool) and math.isfinite(number)
        if is_number and setting.name not in FIXED:
            known[setting.name] = (number, setting.unit)
    for number in numbers:
        if number not in known:
            raise ParameterError(f"'{number}' is not a numeric setting of this drive: {closest(number, known)}")
    scene = scenario(name, **settings)
    trace = scene.drive()
    course = course_of(scene, trace)
    slopes = {}
    for number in numbers:
        value, unit = known[number]
        width = widths.get(number, RELATIVE_WIDTH * abs(value) or RELATIVE_WIDTH)
        # The number replaces a setting of the same angle in degrees.
        others = {key: setting for key, setting in settings.items() if key != f"{number}_deg"}
        # Two neighbours on each side give the difference over h, over 2 h, and the one-sided derivatives.
        neighbours = (scenario(name, **{**others, number: value + i * width}) for i in (-2, -1, 1, 2))
        around = [drive_along(neighbour, course) for neighbour in neighbours]
        slopes[number] = _slope(trace, around, value, width, unit)
    return trace, slopes


def course_of(scene: Scenario, trace: Trace) -> StepsTaken:
    """Return the time steps that a scenario's drive has taken, so that `drive_along` can repeat the drive with these
    steps.

    `trace` is the trace of this drive. If the drive was refined to measure its error, its steps are divided here too.
    """
    # The drive is repeated once without measuring its error, to learn the lengths of its steps.
    drive, duration = _set_out(scene), len(trace.t) * scene.timing.sample
    dt, parts = drive.timing.dt, round(drive.timing.dt / trace.attrs["dt_s"])
    # The trace may come from a refined drive: each step was divided into `parts` equal parts.
    lengths = complete_steps(run_compiled(drive, duration, None).lengths, dt, duration)
    return StepsTaken(dt / parts, np.repeat(lengths / parts, parts))


def drive_along(scene: Scenario, course: StepsTaken) -> Trace:
    """Return the trace of a scenario's drive that takes the given time steps, and ends after the last of these steps.

    `course` are the time steps of another drive, from `course_of`. Because the steps do not depend on the numbers of
    the scenario, the trace is a smooth function of every number.
    """
    drive = _set_out(scene)
    drive.stepper.set_step(course.dt)
    timing = dataclasses.replace(drive.timing, dt=course.dt)
    run = run_compiled(drive._replace(timing=timing, followed=course.lengths), float(course.lengths.sum()), None)
    return trace_of(scene.model, finite(run.rows), {})


def _set_out(scene: Scenario) -> RunningDrive:
    """Return the drive of a scenario at its start. The controller is reset, so that no earlier drive influences it."""
    if hasattr(scene.controller, "reset"):
        scene.controller.reset()
    return set_out(scene.model, scene.controller, scene.duration, scene.start, scene.timing, scene.symmetric)


def _slope(trace: Trace, around: Sequence[Trace], value: float, width: float, unit: str) -> Slope:
    """Return the derivatives of all channels by one number, from four drives with slightly changed numbers.

    Parameters
    ----------
    trace : Trace
        The drive with the unchanged number.
    around : sequence of Trace (4,)
        The drives with the number changed by -2, -1, 1 and 2 widths.
    value, width, unit : float, float, str
        The number, the width of the difference in the number's unit, and this unit.
    """
    channels: dict[str, np.ndarray] = {}
    errors: dict[str, np.ndarray] = {}
    for channel in set(trace) - {"t_s"}:
        # One-sided changes of the channel from the drive to each neighbour, over the width.
        minus_2, minus, plus, plus_2 = (_change(trace, neighbour, channel) / width for neighbour in around)
        channels[channel] = (plus - minus) / 2
        # The error is the difference to the doubled width, and half the difference of the one-sided derivatives.
        wide, bend = (plus_2 - minus_2) / 4, (4 * plus - plus_2) / 2 - (minus_2 - 4 * minus) / 2
        errors[channel] = np.abs(channels[channel] - wide) + np.abs(bend) / 2
    return Slope(value, unit, channels, errors)


def _change(trace: Trace, neighbour: Trace, channel: str) -> np.ndarray:
    """Return the values of a channel in a neighbouring drive minus those in the drive itself (T,).

    Differences of angles are reduced to the range from -pi to pi. Rows that the neighbouring drive did not reach are
    NaN.
    """
    change = np.full(len(trace.t), np.nan)
    rows = min(len(trace.t), len(neighbour.t))
    change[:rows] = neighbour[channel][:rows] - trace[channel][:rows]
    return np.remainder(change + np.pi, 2 * np.pi) - np.pi if trace.unit(channel) == "rad" else change
