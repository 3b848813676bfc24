"""Pictures of a drive report along time: what was measured and modelled, what is left of it, and free runs."""

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rover_pin.estimation.fit import Fit
from rover_pin.estimation.noise import huber, rms_of
from rover_pin.estimation.wording import in_words
from rover_pin.experiments.drive_log.checks.columns import stretches
from rover_pin.experiments.drive_log.experiment import DriveExperiment, experiment_of_log
from rover_pin.experiments.drive_log.features import BLOCK, DRIFT, HEADING, LEAK, PATH, SPEED
from rover_pin.experiments.unlisted.actions import Scene
from rover_pin.experiments.unlisted.residual import signals
from rover_pin.report.page import Picture
from rover_pin.report.svg import AFTER, BEFORE, GREY, NOISE
from rover_pin.report.words import as_text
from rover_pin.simulation.trace.channels import wheel_of

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
        return experiment_of_log(self.before)


def words_of(channel: str) -> str:
    """Return a channel's name for a reader: wheel_rate_fl is 'wheel rate fl'."""
    return WORDS.get(channel, channel.removesuffix("_A").replace("_", " "))


def worst_runs(fit: Fit) -> list[int]:
    """Return the runs that the model misses most, by chi2 a block, the worst first."""
    rows, owner = fit.rows, fit.task.noise.fold
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
    return rms_of(fit.residual, noise.good & ~np.isnan(fit.missed)) / noise.floor  # no error where a run breaks off


def residual_panels(sides: Sides) -> tuple[Figure, ...]:
    """Return measured - model of the telling channels against time, a panel for each of the worst runs."""
    return tuple(_residuals(sides, run) for run in worst_runs(sides.before))


def _residuals(sides: Sides, run: int) -> Figure:
    """Return the channels of a run, one above the other, what is not compared shaded."""
    channels, experiment = telling_channels(sides), sides.experiment
    figure = Figure(figsize=(4.9, 1.5 * len(channels) + 1.1), layout="constrained")
    axes = figure.subplots(len(channels), 1, sharex=True, squeeze=False)[:, 0]
    for axis, row in zip(axes, channels, strict=True):
        noise = float(sides.before.task.noise.floor[row])
        factor, unit = in_words(experiment.unit(experiment.channels[row]), noise)
        axis.set_ylabel(f"{as_text(words_of(experiment.channels[row]))}\n[{unit or '-'}]", fontsize=8.5)
        _shade_gaps(axis, experiment, run, row)
        axis.axhspan(-factor * noise, factor * noise, color=NOISE, alpha=0.6, lw=0, label="±1 SD of the noise")
        axis.axhline(0, color="k", lw=0.7)
        for fit, (colour, style, label) in zip(sides, LOOKS[: 1 + sides.added], strict=False):
            times, residual = experiment.runs[run].times, factor * fit.missed[run, row]
            axis.plot(times, residual[: len(times)], color=colour, ls=style, lw=1.3, label=label)
    axes[-1].set_xlabel("time [s]")
    handles = {label: handle for axis in axes for handle, label in zip(*axis.get_legend_handles_labels(), strict=True)}
    figure.legend(list(handles.values()), list(handles), loc="outside upper center", ncols=2, frameon=False,
                  title=as_text(f"{experiment.runs[run].name}: measured - model"), fontsize=8.5)  # fmt: skip
    return figure


def _shade_gaps(axis: Axes, experiment: DriveExperiment, run: int, row: int) -> None:
    """Shade the stretches of a run in which a channel is not compared."""
    times = experiment.runs[run].times
    out = ~np.isfinite(experiment.observed[run, row, : len(times)])
    for number, (start, end) in enumerate(stretches(out)):
        ends = times[start] - BLOCK / 2, times[end - 1] + BLOCK / 2
        axis.axvspan(*ends, color=GREY, alpha=0.25, lw=0, label=None if number else "not compared")
    axis.set_xlim(times[0] - BLOCK / 2, times[-1] + BLOCK / 2)
    axis.tick_params(labelsize=8)
    axis.grid(alpha=0.25)


PARTS, LEAST = 12, 4
"""Parts of as many half seconds each into which a signal is cut, of few half seconds fewer; half seconds of a part."""
SIGNALS = {"duty": "mean duty [-]", "slip": "mean slip [-]", "pitch": "pitch [deg]", "place": "x [m]",
           "time": "time in the run [s]"}  # fmt: skip


class Shown(NamedTuple):
    """What one channel leaves in each part along one signal, before and after."""

    channel: str
    signal: str
    along: np.ndarray
    "mean of the signal (parts,)"
    residual: np.ndarray
    "mean of measured - model (2, parts), in the channel's unit"
    sd: np.ndarray
    "of that mean, by the scatter in its part (2, parts)"
    compared: int
    "half seconds that are compared"

    @property
    def gain(self) -> float:
        """How far the sum of squares of the means, in their SDs, falls; how large it is where nothing was added."""
        before, after = np.sum((self.residual / self.sd[-1]) ** 2, axis=1)
        return float(before - after if before != after else before)


def channel_to_show(sides: Sides) -> Shown | None:
    """Return the channel and the signal along which what was added takes most; None where too little is compared."""
    table = signals(Scene(sides.after))
    chosen = [
        _along(sides, row, name, table[name]) for row in range(len(sides.experiment.channels)) for name in SIGNALS
    ]
    return max(filter(None, chosen), key=lambda section: section.gain, default=None)


def _along(sides: Sides, row: int, name: str, signal: np.ndarray) -> Shown | None:
    residual = np.array([np.where(fit.task.noise.good[:, row], fit.missed[:, row], np.nan) for fit in sides])
    compared = np.isfinite(residual).all(axis=0) & np.isfinite(signal)
    count = min(PARTS, int(compared.sum()) // LEAST)
    if count < 2 or np.ptp(signal[compared]) == 0.0:
        return None
    parts = np.array_split(np.argsort(signal[compared], kind="stable"), count)
    values = [residual[:, compared][:, part] for part in parts]
    means, sds = (np.array([of(value, axis=1) for value in values]).T for of in (np.mean, np.std))
    sds = np.maximum(sds, np.finfo(float).tiny) / np.sqrt([len(part) for part in parts])
    along = np.array([signal[compared][part].mean() for part in parts])
    return Shown(sides.experiment.channels[row], name, along, means, sds, int(compared.sum()))


def effect_picture(sides: Sides) -> Picture | None:
    """Return the means of that channel's residual with their SDs: the base model, and that with what was added."""
    section = channel_to_show(sides)
    if section is None:
        return None
    channel, signal = words_of(section.channel), SIGNALS[section.signal]
    factor, unit = in_words(sides.experiment.unit(section.channel), float(np.abs(section.residual).max()))
    figure = Figure(figsize=(7.2, 3.0), layout="constrained")
    axis = figure.subplots()
    along = np.degrees(section.along) if section.signal == "pitch" else section.along
    looks = LOOKS[: 1 + sides.added]
    for missed, sd, (colour, style, label) in zip(section.residual, section.sd, looks, strict=False):
        axis.errorbar(along, factor * missed, factor * sd, color=colour, ls=style, marker="o", ms=4, lw=1.3, capsize=2,
                      label=label)  # fmt: skip
    axis.axhline(0, color="k", lw=0.9, label="as measured")
    axis.set(xlabel=signal, ylabel=f"{as_text(channel)}:\nmeasured - model [{unit or '-'}]")
    axis.grid(alpha=0.25)
    figure.legend(loc="outside upper center", ncols=3, frameon=False, fontsize=8.5)
    where = "it shows most" if sides.added else "most is left"
    blocks = f"{section.compared} half seconds of {len(sides.experiment.runs)} runs in {len(along)} parts"
    errors = [f"{factor * float(np.sqrt(np.mean(residual**2))):.2g} {unit}" for residual in section.residual]
    alt = f"Measured minus model of {channel} against {signal}, RMS of the means: {errors[0]}"
    alt += f" before, {errors[1]} after." if sides.added else "."
    return Picture((figure,), alt, f"Where {where}: {channel}, means with their SDs; {blocks}.")
