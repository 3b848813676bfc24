"""Pictures of a drive report along time: what was measured and modelled, what is left of it, and free runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rover_pin.discrepancy.cross_validation import run_of_rows
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.noise import huber
from rover_pin.estimation.wording import in_words
from rover_pin.experiments.drive_log.experiment import MADE, DriveExperiment, logged
from rover_pin.experiments.drive_log.features import BLOCK, DRIFT, HEADING, LEAK, PATH, SPEED, blocks
from rover_pin.report.svg import AFTER, BEFORE, GREY, NOISE
from rover_pin.report.words import as_text
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.replay import Commands
from rover_pin.simulation.trace.channels import unit_of, wheel_of

CHANNELS, OF_A_KIND, RUNS = 5, 2, 2
"""Channels that are drawn, and of one kind; runs that are drawn."""
LOOKS = ((BEFORE, "--", "base model"), (AFTER, "-", "with what was added"))
WORDS = {
    PATH: f"way ahead in {LEAK:g} s",
    DRIFT: f"way aside in {LEAK:g} s",
    HEADING: f"turn in {LEAK:g} s",
    SPEED: "speed ahead",
    "body_z": "elevation",
    "body_roll": "roll",
    "body_pitch": "pitch",
    "battery_V": "bus voltage",
}
"""What channels that are of no wheel or joint are, for a reader."""


class Sides(NamedTuple):
    """The base model and the model with what was added, on the same runs; the same fit where nothing was added."""

    before: Fit
    after: Fit

    @property
    def added(self) -> bool:
        """Whether anything was added."""
        return self.after is not self.before

    @property
    def experiment(self) -> DriveExperiment:
        """The runs."""
        return logged(self.before)


def words_of(channel: str) -> str:
    """Return a channel's name for a reader: wheel_rate_fl is 'wheel rate fl'."""
    return WORDS.get(channel, channel.removesuffix("_A").replace("_", " "))


def scale_of(channel: str) -> tuple[float, str]:
    """Return the factor to, and the name of, the unit in which a reader wants a channel."""
    return in_words(MADE.get(channel) or unit_of(channel))


def worst_runs(fit: Fit) -> list[int]:
    """Return the runs that the model misses most, by chi2 a block, the worst first."""
    rows, owner = fit.rows, run_of_rows(fit)
    misfit = [
        huber(rows[owner == run]) / max(int((owner == run).sum()), 1) for run, _ in enumerate(fit.task.experiment.folds)
    ]
    return [int(run) for run in np.argsort(misfit)[::-1][:RUNS]]


def telling_channels(sides: Sides) -> list[int]:
    """Return the channels whose residual changed most, in SDs of its noise; the largest where nothing was added."""
    rms = [_rms(side) for side in sides]
    size = np.abs(rms[0] - rms[1]) if sides.added else rms[0]
    chosen_rows: list[int] = []
    for row in np.argsort(size)[::-1]:
        kinds = [_kind(sides.experiment.channels[chosen_row]) for chosen_row in chosen_rows]
        chosen_rows += [int(row)] if kinds.count(_kind(sides.experiment.channels[row])) < OF_A_KIND else []
    return chosen_rows[:CHANNELS]


def _kind(channel: str) -> str:
    wheel = wheel_of(channel)
    return channel.replace(f"_{wheel}", "") if wheel else channel.partition("_")[0]


def _rms(fit: Fit) -> np.ndarray:
    noise = fit.task.noise
    good = noise.good & ~np.isnan(fit.missed)  # a run that breaks off has no error there
    squares = np.where(good, fit.residual, 0.0) ** 2
    count = np.maximum(good.sum(axis=(0, 2)), 1)
    return np.asarray(np.sqrt(squares.sum(axis=(0, 2)) / count) / noise.floor)


def residual_panels(sides: Sides) -> tuple[Figure, ...]:
    """Return measured - model of the telling channels against time, a panel for each of the worst runs."""
    return tuple(_residuals(sides, run) for run in worst_runs(sides.before))


def _residuals(sides: Sides, run: int) -> Figure:
    figure, rows = _column(sides, run, telling_channels(sides))
    for axis, row, factor in rows:
        noise = factor * float(sides.before.task.noise.floor[row])
        axis.axhspan(-noise, noise, color=NOISE, alpha=0.6, lw=0, label="±1 SD of the noise")
        axis.axhline(0, color="k", lw=0.7)
        for fit, look in _looks(sides):
            _line(axis, sides.experiment, run, factor * fit.missed[run, row], look)
    return _finished(figure, f"{sides.experiment.runs[run].name}: measured - model")


def measured_panels(sides: Sides, channels: Sequence[int] = (), runs: Sequence[int] = ()) -> tuple[Figure, ...]:
    """Return channels as measured and as modelled, before and after; the telling ones of the worst runs if not said."""
    rows = list(channels) or telling_channels(sides)
    return tuple(_measured(sides, run, rows) for run in runs or worst_runs(sides.before))


def _measured(sides: Sides, run: int, channels: Sequence[int]) -> Figure:
    figure, rows = _column(sides, run, channels)
    for axis, row, factor in rows:
        black = {"color": "k", "marker": "o", "ms": 2.2, "ls": "", "label": "measured"}
        _line(axis, sides.experiment, run, factor * sides.experiment.observed[run, row], black)
        for fit, look in _looks(sides):
            lost = np.abs(fit.predicted[run, row]) == sides.experiment.stand_in
            _line(axis, sides.experiment, run, factor * np.where(lost, np.nan, fit.predicted[run, row]), look)
    return _finished(figure, sides.experiment.runs[run].name)


def _looks(sides: Sides) -> list[tuple[Fit, dict[str, Any]]]:
    before: dict[str, Any] = {"color": BEFORE, "ls": "--", "lw": 1.3, "label": "base model"}
    after: dict[str, Any] = {"color": AFTER, "ls": "-", "lw": 1.3, "label": "with what was added"}
    return [(sides.before, before), *([(sides.after, after)] if sides.added else [])]


Panel = tuple[Axes, int, float]


def _column(sides: Sides, run: int, channels: Sequence[int]) -> tuple[Figure, list[Panel]]:
    """Return a figure of channels of a run, one above the other, what is not compared shaded."""
    figure = Figure(figsize=(4.9, 1.5 * len(channels) + 1.1), layout="constrained")
    axes = figure.subplots(len(channels), 1, sharex=True, squeeze=False)[:, 0]
    panels = []
    for axis, row in zip(axes, channels, strict=True):
        name = sides.experiment.channels[row]
        factor, unit = scale_of(name)
        axis.set_ylabel(f"{as_text(words_of(name))}\n[{unit or '-'}]", fontsize=8.5)
        _shaded(axis, sides.experiment, run, row)
        panels.append((axis, row, factor))
    axes[-1].set_xlabel("time [s]")
    return figure, panels


def _shaded(axis: Axes, experiment: DriveExperiment, run: int, row: int) -> None:
    """Shade the stretches of a run in which a channel is not compared."""
    times = experiment.runs[run].times
    out = ~np.isfinite(experiment.observed[run, row, : len(times)])
    edges = np.flatnonzero(np.diff(np.concatenate([[False], out, [False]]).astype(int)))
    for number, (start, end) in enumerate(edges.reshape(-1, 2)):
        ends = times[start] - BLOCK / 2, times[end - 1] + BLOCK / 2
        axis.axvspan(*ends, color=GREY, alpha=0.25, lw=0, label=None if number else "not compared")
    axis.set_xlim(times[0] - BLOCK / 2, times[-1] + BLOCK / 2)
    axis.tick_params(labelsize=8)
    axis.grid(alpha=0.25)


def _line(axis: Axes, experiment: DriveExperiment, run: int, values: np.ndarray, look: dict[str, Any]) -> None:
    times = experiment.runs[run].times
    axis.plot(times, values[: len(times)], **look)


def _finished(figure: Figure, title: str) -> Figure:
    handles = {
        label: handle for axis in figure.axes for handle, label in zip(*axis.get_legend_handles_labels(), strict=True)
    }
    figure.legend(list(handles.values()), list(handles), loc="outside upper center", ncols=2, frameon=False,
                  title=as_text(title), fontsize=8.5)  # fmt: skip
    return figure


def strayed(experiment: DriveExperiment, model: Model) -> list[np.ndarray]:
    """Return the distance of each run's free simulation from the logged place [m], by means over half a second."""
    replays = experiment.free.replays(model)
    return [_off(run.commands, replay.channels) for run, replay in zip(experiment.runs, replays, strict=True)]


def _off(run: Commands, channels: dict[str, np.ndarray]) -> np.ndarray:
    if "body_x" not in channels:
        return blocks(np.full(len(run.t), np.nan), run.period)
    x, y = (blocks(channels[f"body_{axis}"] - run.place[:, at], run.period) for at, axis in enumerate("xy"))
    return np.asarray(np.hypot(x, y))


def free_panels(experiment: DriveExperiment, models: Sequence[Model]) -> tuple[Figure, ...]:
    """Return how far free simulations diverge from the log over time, a panel a run: the base model, and that after."""
    ways = [strayed(experiment, model) for model in models]
    highest = max(
        (1e3 * float(np.nanmax(way)) for distances in ways for way in distances if np.isfinite(way).any()), default=1.0
    )
    return tuple(
        _strayed_panel(run.name, run.times, [distances[at] for distances in ways], 1.05 * highest)
        for at, run in enumerate(experiment.runs)
    )


def _strayed_panel(name: str, times: np.ndarray, ways: Sequence[np.ndarray], highest: float) -> Figure:
    figure = Figure(figsize=(3.2, 2.4), layout="constrained")
    axis = figure.subplots()
    for off, (colour, style, label) in zip(ways, LOOKS, strict=False):
        axis.plot(times, 1e3 * off, color=colour, ls=style, lw=1.4, label=label)
    axis.set(xlabel="time [s]", ylabel="distance from the\nlogged place [mm]", ylim=(0, highest))
    axis.set_title(as_text(name), fontsize=10)
    axis.legend(fontsize=7, frameon=False)
    axis.grid(alpha=0.25)
    return figure
