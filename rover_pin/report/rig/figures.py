"""Figures of the report of wheel-rig data: channels against slip, measured and predicted, and residuals against
slip.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rover_pin.estimation.wording import in_words
from rover_pin.experiments.wheel_rig.diagnostics import FitDiagnostics
from rover_pin.experiments.wheel_rig.model import RigModel, conditions, predictor
from rover_pin.measurements.channel import RIG_CHANNELS, RigChannel
from rover_pin.measurements.rig_set import SAME_LOAD, RigSet
from rover_pin.report.svg import AFTER, BEFORE, GREY
from rover_pin.report.words import key

PANEL_SIZE = (5.2, 3.0)
"""Width and height of a panel [inch]. Two panels fit next to each other on the page."""
CURVE_POINTS = 80
"""Number of points of a predicted curve. With 80 points, the straight lines between the points look like a curve."""
SAME_SLIP = 0.02
"""Two runs whose slips differ by less than this value count as runs at one slip [-]. The value equals `SAME_LEVEL`, by
which a data set without named levels is divided into slip levels."""


class Look(NamedTuple):
    """A model that a figure shows, with the colour, line style and label of its curves."""

    model: RigModel
    colour: str
    line: str
    label: str


def looks(before: RigModel, after: RigModel | None, added: str) -> list[Look]:
    """Return the models that a figure shows: the base model, and the model with added effects (`after`) unless it is
    None.

    `added` names the added effects in the legend.
    """
    drawn_models = [Look(before, BEFORE, "--", "base model, fitted")]
    return drawn_models if after is None else [*drawn_models, Look(after, AFTER, "-", key(added))]


def channel_panels(data: RigSet, drawn_models: Sequence[Look]) -> tuple[Figure, ...]:
    """Return one figure for each channel against slip: the measured points with their noise, and a curve of each
    model.
    """
    return tuple(_panel(data, channel, drawn_models) for channel in data.channels)


def _panel(data: RigSet, channel: RigChannel, drawn_models: Sequence[Look]) -> Figure:
    """Return the figure of one channel against slip.

    The labels with load and slip angle stand at the curves of one model only: the model with added effects, if there is
    one.
    """
    figure = Figure(figsize=PANEL_SIZE, layout="constrained")
    axis, (scale, unit) = figure.subplots(), in_words(channel.unit)
    measured, sd = scale * channel.measured, scale * channel.sd
    axis.errorbar(data.slip, measured, sd, fmt="ko", ms=4, capsize=2, label="measured, ±1 SD")
    for look in drawn_models:
        # Only the first curve of a model gets an entry in the legend.
        for number, (slip, values, curve_label) in enumerate(_curves(look.model, data, channel)):
            axis.plot(slip, scale * values, look.line, color=look.colour, label=None if number else look.label)
            # The label is at the last finite value of the curve.
            if curve_label and look is drawn_models[min(1, len(drawn_models) - 1)] and np.isfinite(values).any():
                end = np.flatnonzero(np.isfinite(values))[-1]
                axis.annotate(curve_label, (slip[end], scale * values[end]), fontsize=7.5, xytext=(3, 0),
                              textcoords="offset points", va="center")  # fmt: skip
    axis.set(xlabel="slip ratio S [-]", ylabel=f"{channel.name} [{unit}]")
    axis.margins(x=0.09)
    axis.grid(alpha=0.25)
    figure.legend(*axis.get_legend_handles_labels(), loc="outside upper center", ncols=2, frameon=False, fontsize=8.5)
    return figure


Curve = tuple[np.ndarray, np.ndarray, str]
"""Type of a curve: slips, predicted values and label."""


def _curves(model: RigModel, data: RigSet, channel: RigChannel) -> Iterator[Curve]:
    """Yield the curves of a model for one channel: one curve for each slip angle and each of up to three loads.

    The label of a curve states its slip angle and its load, if the runs differ in them.
    """
    angles = np.round(data.slip_angle, 2)
    for angle in np.unique(angles):
        subset = data.rows(angles == angle)
        angle_label = f"{np.degrees(angle):.0f} deg" if np.ptp(angles) > 0 else ""
        for load, load_label in _loads(subset):
            # A curve begins at slip 0, or at the smallest measured slip if that is negative or the wheel is askew.
            slip = np.linspace(min(0.0 if angle == 0.0 else 1.0, subset.slip.min()), subset.slip.max(), CURVE_POINTS)
            loads = _along(subset, slip, subset.load) if load is None else np.full(slip.size, load)
            speeds = None
            if subset.speeds is not None:
                speeds = np.column_stack([_along(subset, slip, np.asarray(subset.speeds)[:, i]) for i in range(2)])
            # Conditions as in the runs: load, slip, speeds and slip angle.
            runs = conditions(loads, slip, speeds, np.mean(subset.slip_angle))
            values = predictor(model, (), runs)(model.vector()).values
            yield slip, values[RIG_CHANNELS.index(type(channel))], ", ".join(filter(None, (angle_label, load_label)))


def _loads(data: RigSet) -> list[tuple[float | None, str]]:
    """Return the loads [N] of the curves of a model, each with the label of its curve.

    If the loads were chosen independently of the slip, these are the smallest, the median and the largest load.
    Otherwise the list has one entry, whose load is None: the curve follows the measured load along the slip, and has no
    label.
    """
    load = data.load
    if not data.loads_vary or not _loads_were_chosen(data):
        return [(None, "")]
    return [
        (float(drawn_load), f"{drawn_load:.3g} N")
        for drawn_load in np.unique(np.quantile(load, [0.0, 0.5, 1.0], method="nearest"))
    ]


def _loads_were_chosen(data: RigSet) -> bool:
    """Return whether runs at one slip had different loads, so that the loads were chosen independently of the slip.

    In this case a single curve over slip would join points under different loads.
    """
    slip, load = data.slip, data.load
    # All pairs of runs: some pair has nearly the same slip, and loads with a ratio of SAME_LOAD or more.
    same_slip = np.abs(slip[:, None] - slip) < SAME_SLIP
    return bool(np.any(same_slip & (load[:, None] >= SAME_LOAD * load)))


def _along(data: RigSet, slip: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return a quantity of the runs (`values`) at the slips `slip`.

    The quantity is interpolated linearly between its means at the slip levels.
    """
    # A slip level is a group of runs with nearly the same slip.
    levels = [data.level == number for number in range(len(data.level_names))]
    level_slips = np.array([np.mean(data.slip[is_in_level]) for is_in_level in levels])
    means = np.array([np.mean(values[is_in_level], axis=0) for is_in_level in levels])
    order = np.argsort(level_slips)
    return np.asarray(np.interp(slip, level_slips[order], means[order]))


def load_caption(data: RigSet) -> str:
    """Return the sentence of a caption that states the loads of the models' curves."""
    load = data.load
    if (drawn := len(_loads(data))) > 1:
        count = {2: "two", 3: "three"}[drawn]
        which = f"the {count} loads" if np.unique(load).size == drawn else f"{count} of the loads"
        return f"The models are drawn under {which} of the runs, which the ends of the curves state."
    if np.ptp(load) < 0.01 * load.mean():
        return f"The models are drawn under the mean load, {load.mean():.3g} N."
    return f"The models are drawn under the load that each level had: {load.min():.3g} to {load.max():.3g} N."


def residual_panels(data: RigSet, before: FitDiagnostics, after: FitDiagnostics | None) -> tuple[Figure, ...]:
    """Return one figure for each channel: the mean residual at each slip level, with its noise.

    `before` and `after` are the diagnostics of the base model and of the model with added effects; `after` is None if
    no effect was added.
    """
    # A line through the levels would join different loads or slip angles.
    line = "" if _loads_were_chosen(data) or np.ptp(data.slip_angle) > 0 else "-"
    figures = []
    for row, channel in enumerate(data.channels):
        figure = Figure(figsize=(PANEL_SIZE[0], 3.1), layout="constrained")
        axis, (scale, unit) = figure.subplots(), in_words(channel.unit)
        # The band shows the noise of a single run; the bars show the noise of the mean of a level.
        noise = scale * float(np.sqrt(np.mean(channel.sd**2)))
        axis.axhspan(-noise, noise, color=GREY, alpha=0.2, lw=0, label="±1 SD of one run")
        # Each model has a point for the mean residual of each level.
        _levels(axis, before, row, scale, (BEFORE, "o", "before", line))
        if after is not None:
            _levels(axis, after, row, scale, (AFTER, "s", "after", line))
        axis.axhline(0, color="k", lw=0.8)
        axis.set(xlabel="slip ratio S [-]", ylabel=f"{channel.name}:\nmeasured - model [{unit}]")
        axis.grid(alpha=0.25)
        labels = axis.get_legend_handles_labels()
        figure.legend(*labels, loc="outside upper center", ncols=3, frameon=False, fontsize=8.5)
        figures.append(figure)
    return tuple(figures)


def _levels(axis: Axes, side: FitDiagnostics, row: int, scale: float, style: tuple[str, str, str, str]) -> None:
    """Draw the mean residuals of one model at each slip level. `style` is the colour, marker, label and line style.

    `row` is the number of the channel, and `scale` converts its residuals from SI to the unit of the axis.
    """
    levels = sorted(side.residuals[row].levels, key=lambda level: level.slip)
    colour, marker, label, line = style
    axis.errorbar(
        [level.slip for level in levels],
        [scale * level.mean for level in levels],
        [scale * level.noise for level in levels],
        color=colour, marker=marker, ls=line, ms=5, lw=1.2, capsize=2, label=label,
    )  # fmt: skip
