"""The pictures of a loop's report: channels before and after, residuals, and how the candidates compare."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rover_pin.discrepancy.refit import Refit
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.experiments.wheel_rig.data import RigSet
from rover_pin.experiments.wheel_rig.experiment import ROWS
from rover_pin.experiments.wheel_rig.left import Left, RigExtra
from rover_pin.experiments.wheel_rig.model import UNBALANCED, RigModel, conditions, predictor
from rover_pin.identification.identifiability import SAME_LOAD
from rover_pin.measurements.channel import RigChannel
from rover_pin.report.page import AFTER, BEFORE, GREY

MOST_BARS = 9


def channels_figure(verdict: Verdict, data: RigSet) -> Figure:
    """Return measured points with their noise, and the model before and after, against slip."""
    count = len(data.rig.channels)
    figure = Figure(figsize=(4.6 * count + 0.6, 4.0), layout="constrained")
    for axis, channel in zip(np.atleast_1d(figure.subplots(1, count)), data.rig.channels, strict=True):
        scale, unit = _scale(channel)
        axis.errorbar(
            data.rig.slip,
            scale * channel.measured,
            scale * channel.sd,
            fmt="ko",
            ms=4,
            capsize=2,
            label="measured, +-1 SD",
        )
        before = verdict.before.model if verdict.before else verdict.model
        _curves(axis, before, data, channel, (BEFORE, "--", "base model, fitted"))
        if verdict.effects:
            _curves(axis, verdict.model, data, channel, (AFTER, "-", f"with {added_names(verdict)}"))
        axis.set(xlabel="slip ratio S [-]", ylabel=f"{channel.name} [{unit}]")
        axis.grid(alpha=0.25)
    handles = figure.axes[0].get_legend_handles_labels()
    figure.legend(*handles, loc="outside upper center", ncols=3, frameon=False)
    return figure


def _scale(channel: RigChannel) -> tuple[float, str]:
    return (1e3, "mm") if channel.unit == "m" else (1.0, channel.unit)


def added_names(verdict: Verdict) -> str:
    """Return the names of the added effects."""
    return " + ".join(type(effect).__name__ for effect in verdict.effects)


def _curves(axis: Axes, model: RigModel, data: RigSet, channel: RigChannel, style: tuple[str, str, str]) -> None:
    """Draw the model against slip for each slip angle, at the mean load or, where loads differ, at three of them."""
    colour, line = style[:2]
    label: str | None = style[2]
    angles = np.round(np.asarray(data.rig.slip_angle), 2)
    for angle in np.unique(angles):
        own = data.rows(angles == angle)
        for load in _loads(own):
            slip = np.linspace(min(0.0 if angle == 0.0 else 1.0, own.rig.slip.min()), own.rig.slip.max(), 80)
            runs = conditions(np.full(slip.size, load), slip, _speeds(own, slip), np.mean(own.rig.slip_angle))
            values, _, error = predictor(model, (), runs)(model.vector())
            shown = np.where(np.abs(error) < UNBALANCED, values[ROWS.index(type(channel))], np.nan)
            axis.plot(slip, _scale(channel)[0] * shown, line, color=colour, label=label)
            label = None


def _loads(data: RigSet) -> np.ndarray:
    load = np.asarray(data.rig.load)
    varies = load.max() >= SAME_LOAD * load.min()
    return np.unique(np.quantile(load, [0.0, 0.5, 1.0], method="nearest")) if varies else np.array([load.mean()])


def _speeds(data: RigSet, slip: np.ndarray) -> np.ndarray | None:
    if data.speeds is None:
        return None
    order = np.argsort(data.rig.slip)
    return np.column_stack([np.interp(slip, data.rig.slip[order], data.speeds[order, i]) for i in range(2)])


def residuals_figure(verdict: Verdict, data: RigSet) -> Figure:
    """Return the mean of measured - model at each level, in the channel's unit, with its noise, before and after."""
    count = len(data.rig.channels)
    figure = Figure(figsize=(4.6 * count + 0.6, 3.4), layout="constrained")
    extra = verdict.extra
    sides = [(extra.before, BEFORE, "o", "before")] if isinstance(extra, RigExtra) else []
    if verdict.effects and isinstance(extra, RigExtra):
        sides.append((extra.after, AFTER, "s", "after"))
    for row, (axis, channel) in enumerate(
        zip(np.atleast_1d(figure.subplots(1, count)), data.rig.channels, strict=True)
    ):
        scale, unit = _scale(channel)
        noise = scale * float(np.sqrt(np.mean(channel.sd**2)))
        axis.axhspan(-noise, noise, color=GREY, alpha=0.2, lw=0, label="+-1 SD of one run")
        for side, colour, marker, label in sides:
            _levels(axis, side, row, scale, (colour, marker, label))
        axis.axhline(0, color="k", lw=0.8)
        axis.set(xlabel="slip ratio S [-]", ylabel=f"{channel.name}: measured - model [{unit}]")
        axis.grid(alpha=0.25)
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False)
    return figure


def _levels(axis: Axes, side: Left, row: int, scale: float, style: tuple[str, str, str]) -> None:
    levels = sorted(side.remainders[row].levels, key=lambda level: level.slip)
    colour, marker, label = style
    axis.errorbar(
        [level.slip for level in levels],
        [scale * level.mean for level in levels],
        [scale * level.noise for level in levels],
        color=colour, marker=marker, ms=5, lw=1.2, capsize=2, label=label,
    )  # fmt: skip


def refits_of(verdict: Verdict) -> list[Refit]:
    """Return all refits of all rounds."""
    return [one for each in (verdict.search.rounds if verdict.search else ()) for one in each.refits]


def candidates_figure(verdict: Verdict) -> Figure:
    """Return reduced chi-square of the leading candidates, those of later rounds hatched."""
    rows = refits_of(verdict)
    pairs = rows[len(verdict.search.rounds[0].refits) :] if verdict.search else []
    fits = sorted(rows, key=lambda one: one.fit.misfit)[:MOST_BARS][::-1]
    figure = Figure(figsize=(8.2, 0.42 * max(len(fits), 2) + 1.2), layout="constrained")
    axis = figure.subplots()
    base = verdict.search.base.misfit if verdict.search else 1.0
    for place, one in enumerate(fits):
        colour = AFTER if one.name in verdict.alike else "#9fb8c1" if one.accepted else "#cccccc"
        axis.barh(place, one.fit.misfit, color=colour, hatch="//" if one in pairs else None, edgecolor="white")
        if one.held_out:
            axis.text(one.fit.misfit, place, f" held-out chi2 {-one.held_out:+.3g}", va="center", fontsize=8)
    axis.axvline(1.0, color="k", lw=1)
    axis.axvline(base, color=BEFORE, ls="--", lw=1.2)
    axis.set_yticks(range(len(fits)), [one.name for one in fits])
    axis.set_xscale("log")
    axis.set_xlim(min(0.8, axis.get_xlim()[0]), 2.5 * max([base, *(one.fit.misfit for one in fits)]))
    axis.set_xlabel("chi2 per degree of freedom: 1 is the noise (black), the base model is dashed")
    return figure
