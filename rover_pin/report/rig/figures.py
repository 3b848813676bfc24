"""The pictures of a rig's report: channels against slip, measured, before and after, and what each model leaves."""

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

PANEL = (5.2, 3.0)
POINTS = 80


class Look(NamedTuple):
    """How one model is drawn."""

    model: RigModel
    colour: str
    line: str
    label: str


def looks(before: RigModel, after: RigModel | None, added: str) -> list[Look]:
    """Return the models that are drawn: the base model, and that with what was added."""
    drawn_models = [Look(before, BEFORE, "--", "base model, fitted")]
    return drawn_models if after is None else [*drawn_models, Look(after, AFTER, "-", key(added))]


def channel_panels(data: RigSet, drawn_models: Sequence[Look]) -> tuple[Figure, ...]:
    """Return one panel a channel: measured points with their noise, and the models under the load of each point."""
    return tuple(_panel(data, channel, drawn_models) for channel in data.channels)


def _panel(data: RigSet, channel: RigChannel, drawn_models: Sequence[Look]) -> Figure:
    figure = Figure(figsize=PANEL, layout="constrained")
    axis, (scale, unit) = figure.subplots(), in_words(channel.unit)
    measured, sd = scale * channel.measured, scale * channel.sd
    axis.errorbar(data.slip, measured, sd, fmt="ko", ms=4, capsize=2, label="measured, ±1 SD")
    for look in drawn_models:
        for number, (slip, values, curve_label) in enumerate(_curves(look.model, data, channel)):
            axis.plot(slip, scale * values, look.line, color=look.colour, label=None if number else look.label)
            if curve_label and look is drawn_models[-1] and np.isfinite(values).any():
                end = np.flatnonzero(np.isfinite(values))[-1]
                axis.annotate(curve_label, (slip[end], scale * values[end]), fontsize=7.5, xytext=(3, 0),
                              textcoords="offset points", va="center")  # fmt: skip
    axis.set(xlabel="slip ratio S [-]", ylabel=f"{channel.name} [{unit}]")
    axis.margins(x=0.09)
    axis.grid(alpha=0.25)
    figure.legend(*axis.get_legend_handles_labels(), loc="outside upper center", ncols=2, frameon=False, fontsize=8.5)
    return figure


Curve = tuple[np.ndarray, np.ndarray, str]


def _curves(model: RigModel, data: RigSet, channel: RigChannel) -> Iterator[Curve]:
    """Yield the model against slip, what its channel is, and what the curve is of: an angle, a load, or nothing."""
    angles = np.round(data.slip_angle, 2)
    for angle in np.unique(angles):
        subset = data.rows(angles == angle)
        of = f"{np.degrees(angle):.0f} deg" if np.ptp(angles) > 0 else ""
        for load, load_label in _loads(subset):
            slip = np.linspace(min(0.0 if angle == 0.0 else 1.0, subset.slip.min()), subset.slip.max(), POINTS)
            under = _along(subset, slip, subset.load) if load is None else np.full(slip.size, load)
            runs = conditions(under, slip, _speeds(subset, slip), np.mean(subset.slip_angle))
            values = predictor(model, (), runs)(model.vector()).values
            yield slip, values[RIG_CHANNELS.index(type(channel))], ", ".join(filter(None, (of, load_label)))


def _loads(data: RigSet) -> list[tuple[float | None, str]]:
    """Return the loads of curves: three where several were set, else that of the points at each slip."""
    load = data.load
    if not data.loads_vary or not _set_apart(data):
        return [(None, "")]
    return [
        (float(drawn_load), f"{drawn_load:.3g} N")
        for drawn_load in np.unique(np.quantile(load, [0.0, 0.5, 1.0], method="nearest"))
    ]


def _set_apart(data: RigSet) -> bool:
    """Return whether loads differ at one slip: then they were set, and no curve through them has a meaning."""
    slip, load = data.slip, data.load
    same_slip = np.abs(slip[:, None] - slip) < 0.02
    return bool(np.any(same_slip & (load[:, None] >= SAME_LOAD * load)))


def _along(data: RigSet, slip: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the mean of a quantity at the levels, between them in a straight line."""
    levels = [data.level == number for number in range(len(data.level_names))]
    at = np.array([np.mean(data.slip[at_level]) for at_level in levels])
    means = np.array([np.mean(values[at_level], axis=0) for at_level in levels])
    order = np.argsort(at)
    return np.asarray(np.interp(slip, at[order], means[order]))


def _speeds(data: RigSet, slip: np.ndarray) -> np.ndarray | None:
    if data.speeds is None:
        return None
    return np.column_stack([_along(data, slip, np.asarray(data.speeds)[:, i]) for i in range(2)])


def load_caption(data: RigSet) -> str:
    """Return under which load the models are drawn."""
    load = data.load
    if (drawn := len(_loads(data))) > 1:
        count = {2: "two", 3: "three"}[drawn]
        which = f"the {count} loads" if np.unique(load).size == drawn else f"{count} of the loads"
        return f"The models are drawn at {which} that were set, as written at their ends."
    if np.ptp(load) < 0.01 * load.mean():
        return f"The models are drawn under the mean load, {load.mean():.3g} N."
    return f"The models are drawn under the load that each level had: {load.min():.3g} to {load.max():.3g} N."


def residual_panels(data: RigSet, before: FitDiagnostics, after: FitDiagnostics | None) -> tuple[Figure, ...]:
    """Return one panel a channel: the mean of measured - model at each level, with its noise, before and after."""
    line = "" if _set_apart(data) or np.ptp(data.slip_angle) > 0 else "-"  # no line through loads
    return tuple(_residual_panel(row, channel, before, after, line) for row, channel in enumerate(data.channels))


def _residual_panel(
    row: int, channel: RigChannel, before: FitDiagnostics, after: FitDiagnostics | None, line: str
) -> Figure:
    figure = Figure(figsize=(PANEL[0], 3.1), layout="constrained")
    axis, (scale, unit) = figure.subplots(), in_words(channel.unit)
    noise = scale * float(np.sqrt(np.mean(channel.sd**2)))
    axis.axhspan(-noise, noise, color=GREY, alpha=0.2, lw=0, label="±1 SD of one run")
    _levels(axis, before, row, scale, (BEFORE, "o", "before", line))
    if after is not None:
        _levels(axis, after, row, scale, (AFTER, "s", "after", line))
    axis.axhline(0, color="k", lw=0.8)
    axis.set(xlabel="slip ratio S [-]", ylabel=f"{channel.name}:\nmeasured - model [{unit}]")
    axis.grid(alpha=0.25)
    figure.legend(*axis.get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False, fontsize=8.5)
    return figure


def _levels(axis: Axes, side: FitDiagnostics, row: int, scale: float, style: tuple[str, str, str, str]) -> None:
    levels = sorted(side.residuals[row].levels, key=lambda level: level.slip)
    colour, marker, label, line = style
    axis.errorbar(
        [level.slip for level in levels],
        [scale * level.mean for level in levels],
        [scale * level.noise for level in levels],
        color=colour, marker=marker, ls=line, ms=5, lw=1.2, capsize=2, label=label,
    )  # fmt: skip
