"""Sensitivities of a whole drive: the derivative of every channel by a number among the settings.

Most derivatives are tangents: the drive is computed with dual numbers (`simulation/tangents.py`). Where a drive has no
tangent, the derivatives are differences between neighbouring drives. A simulation that chooses its own time steps gives
a result that jumps a little whenever a changed number changes this choice. Therefore tangents and neighbouring drives
take the time steps of the first drive, and their result is a smooth function of every number. Source: Bock, Recent
advances in parameter identification techniques for ODE (1983), internal differentiation.
"""

from __future__ import annotations

import dataclasses
import logging
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_pin.base.errors import ParameterError, closest
from rover_pin.base.public import brief, public
from rover_pin.scenarios.scenario import Scenario, scenario, settings_of
from rover_pin.simulation.driving import RunningDrive, run_compiled
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.replay import StepsTaken
from rover_pin.simulation.simulate import set_out
from rover_pin.simulation.stepping.step_error import complete_steps
from rover_pin.simulation.tangents import MAX_NUMBERS, Neighbour, NoTangentError, TangentDrive
from rover_pin.simulation.trace.record import channels_of, elastic_energies, finite, trace_of
from rover_pin.simulation.trace.trace import Trace

log = logging.getLogger(__name__)

RELATIVE_WIDTH = 5e-6
"""Default width h of a finite difference, as a fraction of the number; if the number is 0, the width in the number's
unit.

Drives are reproducible to about 1e-14 of a channel, and derivatives change noticeably if a number changes by about 1e-4
of its value. The width lies between these two limits."""
INPUT_WIDTH = 1e-4
"""Width of the differences that give the derivatives of a drive's inputs, as a fraction of the number; if the number is
0, in the number's unit.

The inputs (constants of soil and rover, state at rest, control law) are reproducible to about 1e-14 and are smoother
functions of a number than the drive is, so that a width larger than RELATIVE_WIDTH is more accurate: about 1e-8."""
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
    """name of a channel -> estimated error of its derivative (T,); 0 for a tangent, whose only error is round-off"""
    tangent: bool = False
    """whether the derivatives are tangents; otherwise they are differences between drives"""

    def __getitem__(self, channel: str) -> np.ndarray:
        return self.channels[channel]


@public
def sensitivities(
    name: str, numbers: Sequence[str], /, widths: Mapping[str, float] = {}, **settings: Any
) -> tuple[Trace, dict[str, Slope]]:
    """Return a ready-made drive, and the derivatives of all its channels by some of its numbers.

    The derivatives are exact tangents: the compiled drive (step, contact laws, motors, control law, terrain) is
    computed once more with dual numbers, for up to seven numbers together. A tangent belongs to the branches that the
    drive takes, and to its time steps (which become shorter where forces need it). The drive has no derivative by a
    number at those values at which one of these events moves to another step or sample: a wheel touches down or lifts
    off; a patch of a wheel meets an edge of the ground; a duty meets its limit; a joint meets its end stop; a law
    changes its branch, for example at zero slip. There the tangent is the derivative on one side.

    A drive has no tangent by a number in four cases: its controller is called from Python; its control uses the
    on-board slip estimate; a changed number changes whole numbers, such as the points of the ground; or `widths` names
    the number. The derivative is then a difference between drives that all take the time steps of the drive itself.
    Let p be the number, h the width of the difference, and f_i the channel at p + i h:

        df/dp = (f_1 - f_-1) / 2 h,    error = |D(h) - D(2 h)| + |R - L| / 2

    D(h) and D(2 h) are the differences with the widths h and 2 h. R and L are the one-sided derivatives on the right
    and on the left, (4 f_1 - f_2 - 3 f_0) / 2 h and (3 f_0 - 4 f_-1 + f_-2) / 2 h. If the channel f is a smooth
    function of the number, the first part of the error is three times the true error, which is of second order in h.
    Within 2 h of one of the events above the error is an upper bound of the effect of the event. At the event itself
    the derivative is the mean of R and L.

    The derivatives are derivatives of the computed drive. Long drives through ditches are so sensitive that their
    derivatives hold only for extremely small changes of a number; give `widths` for them.

    Parameters
    ----------
    name, **settings
        Name and settings of the drive, as for `scenario`. A quantity that is derived from a number, for instance the
        motion resistance R from the soil, changes with the number here too, unless a setting states the quantity.
    numbers : sequence of str
        Settings that are numbers: "soil.k", "terrain.wall_angle", "motor.gear" or "control.k_p", for example.
    widths : mapping
        Number -> h, in the number's unit, for numbers whose derivative shall be a difference over this width. Other
        differences have the width RELATIVE_WIDTH times the number, or RELATIVE_WIDTH if the number is 0.

    Returns
    -------
    Trace
        The drive.
    dict
        For each number a `Slope` with `value`, `unit`, `channels`, `errors` and `tangent`; `slope["body_x"]` is a
        derivative [T]. Rows that a neighbouring drive did not reach are NaN.

    Raises
    ------
    ParameterError
        A setting is unknown, is no number, or is so close to its bound that no difference fits; or a width is not
        positive or belongs to none of the numbers.
    SimulationError
        The drive fails, as in `simulate`.

    Source: forward mode of algorithmic differentiation, Griewank and Walther, Evaluating Derivatives (2008); internal
    differentiation, Bock, Recent advances in parameter identification techniques for ODE (1983). For up to seven
    numbers the drive with dual numbers takes about six times as long as the drive; a difference takes four drives a
    number.

    Examples
    --------
    >>> drive, slopes = sensitivities("incline", ["soil.phi", "start.x"], duration=3.0)
    >>> x = slopes["soil.phi"]["body_x"]
    >>> x.shape == drive.t.shape, slopes["soil.phi"].tangent, round(float(slopes["start.x"]["body_x"][-1]), 6)
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

    def changed(number: str, change: float) -> Scenario:
        """Return the scenario with a slightly changed number. It replaces a setting of the same angle in degrees."""
        others = {key: setting for key, setting in settings.items() if key != f"{number}_deg"}
        return scenario(name, **{**others, number: known[number][0] + change})

    tangents = tangent_slopes(scene, course, trace, {n: known[n] for n in numbers if n not in widths}, changed)
    slopes = {}
    for number in numbers:
        value, unit = known[number]
        if number in tangents:
            slopes[number] = tangents[number]
            continue
        width = widths.get(number, RELATIVE_WIDTH * abs(value) or RELATIVE_WIDTH)
        # Two neighbours on each side give the difference over h, over 2 h, and the one-sided derivatives.
        around = [drive_along(changed(number, i * width), course) for i in (-2, -1, 1, 2)]
        slopes[number] = _slope(trace, around, value, width, unit)
    return trace, slopes


def tangent_slopes(
    scene: Scenario,
    course: StepsTaken,
    trace: Trace,
    numbers: Mapping[str, tuple[float, str]],
    changed: Callable[[str, float], Scenario],
) -> dict[str, Slope]:
    """Return the derivatives of a drive by some numbers as tangents. Numbers without a tangent are missing.

    Parameters
    ----------
    scene, course, trace : Scenario, StepsTaken, Trace
        The drive, its time steps and its trace.
    numbers : mapping
        Name of a number -> its value and unit.
    changed : callable
        Function (name of a number, change) -> the scenario with this number changed.
    """
    try:
        drive = TangentDrive(drive_at_start(scene, course), float(course.lengths.sum()))
    except NoTangentError as reason:
        log.debug("no tangents: %s", reason)
        return {}
    # Neighbouring drives that have not moved yet give the derivatives of all inputs of the drive.
    inputs, neighbours = {}, {}
    for number, (value, _) in numbers.items():
        width = INPUT_WIDTH * abs(value) or INPUT_WIDTH
        pair = [
            Neighbour(side / (2.0 * width), drive_at_start(changed(number, side * width), course)) for side in (-1, 1)
        ]
        try:
            inputs[number], neighbours[number] = drive.input_slopes(pair), pair
        except NoTangentError as reason:
            log.debug("no tangent by %s: %s", number, reason)
    slopes = {}
    names = list(inputs)
    for first in range(0, len(names), MAX_NUMBERS):
        group = names[first : first + MAX_NUMBERS]
        rows, row_slopes = drive.rows([inputs[number] for number in group])
        for number, row_slope in zip(group, row_slopes, strict=True):
            channels = tangent_channels(scene.model, rows, row_slope, neighbours[number])
            # A tangent that is no number belongs to a point at which a law has no derivative.
            if len(rows) >= len(trace.t) and all(np.isfinite(channel).all() for channel in channels.values()):
                columns = {name: channels[name][: len(trace.t)] for name in set(trace) - {"t_s"}}
                errors = {name: np.zeros(len(trace.t)) for name in columns}
                slopes[number] = Slope(*numbers[number], columns, errors, tangent=True)
    return slopes


def tangent_channels(
    model: Model, rows: np.ndarray, row_slopes: np.ndarray, neighbours: Sequence[Neighbour]
) -> dict[str, np.ndarray]:
    """Return the derivatives of all channels of a drive, from the derivatives of its rows."""
    channels, _ = channels_of(model, row_slopes)
    if model.body_effects:
        # The energy of springs is a function of the rows and of the number itself: a difference along both.
        channels["energy_elastic"] = np.zeros(len(rows))
        for weight, neighbour in neighbours:
            moved = rows.copy()
            moved["q"] += row_slopes["q"] / (len(neighbours) * weight)
            channels["energy_elastic"] += weight * elastic_energies(neighbour.model, moved)
    return channels


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
    drive = drive_at_start(scene, course)
    run = run_compiled(drive, float(course.lengths.sum()), None)
    return trace_of(scene.model, finite(run.rows), {})


def drive_at_start(scene: Scenario, course: StepsTaken) -> RunningDrive:
    """Return the drive of a scenario at its start, which will take the given time steps."""
    drive = _set_out(scene)
    drive.stepper.set_step(course.dt)
    return drive._replace(timing=dataclasses.replace(drive.timing, dt=course.dt), followed=course.lengths)


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
