"""The residuals of a drive log in its report: figures against time and against the signal along which the added effects
reduce them most, and the section on the remaining residual.

All values are means over half a second, which a fit compares with the model. The section describes the remaining
residual by terms: a term is an action, such as a torque on one wheel, multiplied by a function of one measured signal.
"""

import textwrap
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rover_pin.base.encode import figure_text
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.noise import rms_of
from rover_pin.estimation.residual import huber
from rover_pin.estimation.wording import MAX_LISTED, in_words
from rover_pin.experiments.drive_log.checks.channels import stretches
from rover_pin.experiments.drive_log.experiment import DriveExperiment, experiment_of_log
from rover_pin.experiments.drive_log.features import BLOCK, DRIFT, HEADING, LEAK, PATH, SPEED
from rover_pin.experiments.drive_log.free_runs import extra_of
from rover_pin.experiments.unlisted.actions import GRIP, READING, VOLTAGE, Scene
from rover_pin.experiments.unlisted.residual import DriveResidual, signals
from rover_pin.experiments.unlisted.terms import Term
from rover_pin.report.page import AWAY, Picture, ReportTable, Section, TableRow
from rover_pin.report.svg import AFTER, BEFORE, GREY, NOISE
from rover_pin.simulation.trace.channels import wheel_of

MAX_CHANNELS, MAX_OF_A_KIND, MAX_RUNS = 5, 2, 2
"""The figure of residuals shows at most MAX_CHANNELS channels, at most MAX_OF_A_KIND of them of one kind (such as wheel
rates), and at most MAX_RUNS runs. The limits keep the panels large enough to read and show different kinds of
channels."""
LOOKS = ((BEFORE, "--", "base model"), (AFTER, "-", "with added effects"))
"""Colour, line style and label for the base model (first entry) and for the model with added effects (second entry)."""
WORDS = {
    PATH: f"distance ahead in {LEAK:g} s",
    DRIFT: f"distance aside in {LEAK:g} s",
    HEADING: f"turn in {LEAK:g} s",
    SPEED: "speed ahead",
    "body_z": "elevation",
    "body_roll": "roll",
    "body_pitch": "pitch",
    "battery_V": "bus voltage",
}
"""Name of a channel that belongs to no wheel or joint -> its name in the report."""


class Sides(NamedTuple):
    """Two fits that figures compare: the fit of the base model (`before`) and of the model with added effects
    (`after`).

    Both are one fit if no effect was added.
    """

    before: Fit
    after: Fit

    @property
    def added(self) -> bool:
        """Whether an effect was added to the base model."""
        return self.after is not self.before

    @property
    def experiment(self) -> DriveExperiment:
        """The experiment that both fits describe: the runs of the drive log."""
        return experiment_of_log(self.before)


def words_of(channel: str) -> str:
    """Return the name of a channel in words for the report, such as "wheel rate fl" for wheel_rate_fl."""
    return WORDS.get(channel, channel.removesuffix("_A").replace("_", " "))


def worst_runs(fit: Fit) -> list[int]:
    """Return the numbers of the runs that a fit describes worst, the worst first; at most MAX_RUNS.

    Runs are ranked by their chi2 divided by their number of values. A value is the mean of one channel over half a
    second.
    """
    rows, owner = fit.rows, fit.task.noise.fold
    # Huber's loss instead of squares: a few outliers must not decide which run counts as the worst.
    misfit = [
        huber(rows[owner == run]) / max(int((owner == run).sum()), 1) for run, _ in enumerate(fit.task.experiment.folds)
    ]
    return [int(run) for run in np.argsort(misfit)[::-1][:MAX_RUNS]]


def telling_channels(sides: Sides) -> list[int]:
    """Return the row numbers of the channels that the figure of residuals shows, at most MAX_CHANNELS.

    If effects were added, these are the channels whose residuals changed most in units of the noise; otherwise the
    channels with the largest residuals. At most MAX_OF_A_KIND channels of one kind are shown, so that six wheels do not
    fill the figure.
    """
    rms = []
    for fit in sides:
        noise = fit.task.noise
        # `missed` is NaN after a replay has broken off, so that there is no error.
        rms.append(rms_of(fit.residual, noise.good & ~np.isnan(fit.missed)) / noise.floor)
    size = np.abs(rms[0] - rms[1]) if sides.added else rms[0]
    chosen_rows: list[int] = []
    # The channels with the largest size come first, but only a few of each kind.
    for row in np.argsort(size)[::-1]:
        kinds = [_kind(sides.experiment.channels[chosen_row]) for chosen_row in chosen_rows]
        chosen_rows += [int(row)] if kinds.count(_kind(sides.experiment.channels[row])) < MAX_OF_A_KIND else []
    return chosen_rows[:MAX_CHANNELS]


def _kind(channel: str) -> str:
    """Return the kind of a channel, such as wheel_rate for wheel_rate_fl.

    The kind is the name without the wheel, or the first word of the name for a channel that belongs to no wheel.
    """
    wheel = wheel_of(channel)
    return channel.replace(f"_{wheel}", "") if wheel else channel.partition("_")[0]


def residual_panels(sides: Sides) -> tuple[Figure, ...]:
    """Return figures of the residuals (measured - model) against time, one figure for each of the worst-fitted runs."""
    channels, experiment = telling_channels(sides), sides.experiment
    figures = []
    for run in worst_runs(sides.before):
        times, name = experiment.runs[run].times, experiment.runs[run].name
        figure = Figure(figsize=(4.9, 1.5 * len(channels) + 1.1), layout="constrained")
        axes = figure.subplots(len(channels), 1, sharex=True, squeeze=False)[:, 0]
        for axis, row in zip(axes, channels, strict=True):
            # The unit is chosen by the size of the noise, so that the numbers on the axis are short.
            noise = float(sides.before.task.noise.floor[row])
            factor, unit = in_words(experiment.unit(experiment.channels[row]), noise)
            axis.set_ylabel(f"{figure_text(words_of(experiment.channels[row]))}\n[{unit or '-'}]", fontsize=8.5)
            # Intervals without a comparison of the channel with the model are grey. A time is the middle of its half
            # second, so the interval begins and ends a quarter of a second outside.
            out = ~np.isfinite(experiment.observed[run, row, : len(times)])
            for number, (start, end) in enumerate(stretches(out)):
                ends = times[start] - BLOCK / 2, times[end - 1] + BLOCK / 2
                axis.axvspan(*ends, color=GREY, alpha=0.25, lw=0, label=None if number else "not compared")
            axis.set_xlim(times[0] - BLOCK / 2, times[-1] + BLOCK / 2)
            axis.tick_params(labelsize=8)
            axis.grid(alpha=0.25)
            axis.axhspan(-factor * noise, factor * noise, color=NOISE, alpha=0.6, lw=0, label="±1 SD of the noise")
            axis.axhline(0, color="k", lw=0.7)
            for fit, (colour, style, label) in zip(sides, LOOKS[: 1 + sides.added], strict=False):
                residual = factor * fit.missed[run, row]
                axis.plot(times, residual[: len(times)], color=colour, ls=style, lw=1.3, label=label)
        axes[-1].set_xlabel("time [s]")
        # One legend for all panels; equal labels appear once.
        labels = (zip(*axis.get_legend_handles_labels(), strict=True) for axis in axes)
        handles = {label: handle for pairs in labels for handle, label in pairs}
        figure.legend(list(handles.values()), list(handles), loc="outside upper center", ncols=2, frameon=False,
                      title=figure_text(f"{name}: measured - model"), fontsize=8.5)  # fmt: skip
        figures.append(figure)
    return tuple(figures)


MAX_PARTS, MIN_PART_SIZE = 12, 4
"""The half-second means are divided into at most MAX_PARTS groups along a signal, and each group has at least
MIN_PART_SIZE of them. The residuals are averaged in each group. With fewer than four values, the scatter in a group,
and so the error bar of its mean, would be too uncertain."""
SIGNALS = {"duty": "mean duty [-]", "slip": "mean slip [-]", "pitch": "pitch [deg]", "place": "x [m]",
           "time": "time in the run [s]"}  # fmt: skip
"""Name of a signal along which residuals are averaged -> label of its axis."""


class ResidualAlong(NamedTuple):
    """Mean residuals of one channel along one signal, without and with the added effects.

    The half-second means of the channel are sorted along the signal and divided into groups of equal size. The
    residuals are averaged in each group.
    """

    channel: str
    signal: str
    along: np.ndarray
    """mean of the signal in each group (groups,)"""
    residual: np.ndarray
    """mean of measured - model in each group, without and with the added effects (2, groups), in the channel's unit"""
    sd: np.ndarray
    """standard deviations of the mean residuals, from the scatter in each group (2, groups)"""
    compared: int
    """number of half-second means that are compared"""

    @property
    def gain(self) -> float:
        """Decrease of the sum of squared mean residuals by the added effects, in units of the squared SDs of these
        means.

        If no effect was added, this is the sum itself.
        """
        # Both sums are in units of the SDs with the added effects, so that they can be subtracted.
        before, after = np.sum((self.residual / self.sd[-1]) ** 2, axis=1)
        return float(before - after if before != after else before)


def channel_to_show(sides: Sides) -> ResidualAlong | None:
    """Return the mean residuals of one channel along one signal: the pair whose residuals the added effects reduce
    most.

    The result is None if too few half-second means are compared.
    """
    # Every channel is tried along every signal.
    table = signals(Scene(sides.after))
    candidates = [
        _along(sides, row, name, table[name]) for row in range(len(sides.experiment.channels)) for name in SIGNALS
    ]
    return max(filter(None, candidates), key=lambda candidate: candidate.gain, default=None)


def _along(sides: Sides, row: int, name: str, signal: np.ndarray) -> ResidualAlong | None:
    """Return the mean residuals of one channel in groups along one signal.

    The result is None if the signal is constant or if too few half-second means are compared. `row` is the number of
    the channel, `name` is the name of the signal, and `signal` holds its values.
    """
    residual = np.array([np.where(fit.task.noise.good[:, row], fit.missed[:, row], np.nan) for fit in sides])
    compared = np.isfinite(residual).all(axis=0) & np.isfinite(signal)
    count = min(MAX_PARTS, int(compared.sum()) // MIN_PART_SIZE)
    if count < 2 or np.ptp(signal[compared]) == 0.0:
        return None
    # Groups with equal numbers of half-second means, in the order of the signal.
    parts = np.array_split(np.argsort(signal[compared], kind="stable"), count)
    values = [residual[:, compared][:, part] for part in parts]
    means, sds = (np.array([of(value, axis=1) for value in values]).T for of in (np.mean, np.std))
    # SD of a mean is the SD of the values divided by the square root of their number; tiny avoids a division by 0.
    sds = np.maximum(sds, np.finfo(float).tiny) / np.sqrt([len(part) for part in parts])
    along = np.array([signal[compared][part].mean() for part in parts])
    return ResidualAlong(sides.experiment.channels[row], name, along, means, sds, int(compared.sum()))


def effect_picture(sides: Sides) -> Picture | None:
    """Return the picture of the channel and the signal whose mean residuals the added effects reduce most.

    The result is None if too few half-second means are compared.
    """
    shown = channel_to_show(sides)
    if shown is None:
        return None
    channel, signal = words_of(shown.channel), SIGNALS[shown.signal]
    factor, unit = in_words(sides.experiment.unit(shown.channel), float(np.abs(shown.residual).max()))
    figure = Figure(figsize=(5.4, 3.2), layout="constrained")
    axis = figure.subplots()
    # A pitch is shown in degrees.
    along = np.degrees(shown.along) if shown.signal == "pitch" else shown.along
    looks = LOOKS[: 1 + sides.added]
    for missed, sd, (colour, style, label) in zip(shown.residual, shown.sd, looks, strict=False):
        axis.errorbar(along, factor * missed, factor * sd, color=colour, ls=style, marker="o", ms=4, lw=1.3, capsize=2,
                      label=label)  # fmt: skip
    axis.axhline(0, color="k", lw=0.9, label="as measured")
    axis.set(xlabel=signal, ylabel=f"{figure_text(channel)}:\nmeasured - model [{unit or '-'}]")
    axis.grid(alpha=0.25)
    figure.legend(loc="outside upper center", ncols=3, frameon=False, fontsize=8.5)
    where = f"The added effects change {channel} most" if sides.added else f"{channel} has the largest residual"
    blocks = f"{shown.compared} blocks of half a second from {len(sides.experiment.runs)} runs, in {len(along)} parts"
    errors = [f"{factor * float(np.sqrt(np.mean(residual**2))):.2g} {unit}" for residual in shown.residual]
    alt = f"Measured minus model of {channel} against {signal}, RMS of the means: {errors[0]}"
    alt += f" before, {errors[1]} after." if sides.added else "."
    return Picture((figure,), alt, f"{where[:1].upper()}{where[1:]}. Means with their SDs: {blocks}.")


MAX_RESIDUAL_CHANNELS = 12
"""Maximum number of channels in the table of residuals. A rover with six wheels has about 20 channels; the table lists
only those with the largest residuals, so that it remains short."""


def residual_section(verdict: Verdict) -> Section | None:
    """Return the section on the remaining residual of a drive model: the terms that describe it best, and its
    correlations.

    A term is an action multiplied by a function of a signal. The result is None if the residual was not analysed.
    """
    residual = extra_of(verdict).residual
    if residual is None:
        return None
    # A term has three decreases of chi2: by the term in the fitted runs, by chance, and by the term in held-out runs.
    terms = []
    for term in residual.terms[:MAX_LISTED]:
        held_out = "" if term.held_out is None else f"{term.held_out:+.1f}"
        gains = (f"{term.gain:.1f}", f"{term.detection_threshold:.1f}", held_out, f"{term.strength:+.1f}")
        terms.append(TableRow((f"the residual {term.description}", *gains)))
    heads = ("description of the residual", "decrease of chi2", "by chance", "in held-out runs", "net decrease")
    # If the residual is only noise, no terms are shown: they would describe the noise.
    content = {
        "description": residual.description,
        "terms": ReportTable(heads, tuple(terms)) if not residual.is_noise else None,
        "channels": channel_table(residual),
        "draft": verdict.draft,
    }
    # The curves are drawn only if they describe more than noise.
    pictures = {}
    if residual.terms and not residual.is_noise:
        alt = f"Estimated functions of the best terms: the residual {residual.best.description}."
        caption = (
            "Each term is an action of an unknown effect, such as a torque on a wheel, times a function of a signal. "
            "The function is estimated from measured - model; the band is one SD. The net decrease is the decrease of "
            "chi2 minus the decrease by chance, or the decrease in held-out runs if that decrease is smaller."
        )
        pictures["terms"] = Picture(tuple(map(_panel, residual.terms[:MAX_LISTED])), alt, caption)
    return Section("Remaining residual", "drive/residual.html", content, pictures)


def channel_table(residual: DriveResidual) -> ReportTable:
    """Return the table of the residuals of each channel with their correlations. The largest residual comes first."""
    # The RMS is in units of the channel's noise, so that channels of different units can be ranked.
    ranked = sorted(residual.channels, key=lambda channel: -channel.rms)[:MAX_RESIDUAL_CHANNELS]
    signals = tuple(residual.channels[0].correlations) if residual.channels else ()
    rows = [
        TableRow(
            (
                words_of(channel.name),
                f"{channel.rms:.2f}",
                f"{channel.memory:+.2f}",
                *(f"{value:+.2f}" for value in channel.correlations.values()),
                "noise"
                if channel.is_noise
                else f"{channel.worst_run}, {channel.worst_time:.1f} s, x = {channel.worst_place:.2f} m",
            ),
            "" if channel.is_noise else AWAY,
        )
        for channel in ranked
    ]
    heads = ("channel", "times the noise", "with the next block", *signals, "largest residual")
    return ReportTable(heads, tuple(rows), "Correlations of the residual (measured - model)")


RUN_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
"""Colours of the curves of single runs, which colour-blind readers can distinguish. Source: Okabe and Ito 2008."""


def _panel(term: Term) -> Figure:
    """Return the figure of the estimated function of a term that describes the residual, with +-1 SD as a band or as
    bars.
    """
    figure = Figure(figsize=(3.9, 3.4), layout="constrained")
    axis = figure.subplots()
    if term.argument.name == "run":
        # One number for each run, such as a different grip in each run.
        curve, runs = term.curve, term.runs
        axis.errorbar(range(len(runs)), curve.value[:, 0], curve.sd[:, 0], fmt="o", color=AFTER, capsize=3)
        axis.set_xticks(range(len(runs)), [figure_text(run) for run in runs], rotation=45, ha="right", fontsize=8)
    else:
        _curves(axis, term)
    axis.axhline(0, color="k", lw=0.7)
    # Actions without a unit are fractions: of the friction coefficient, of the full duty, or of the reading.
    relative_units = {GRIP: "share of tan phi", VOLTAGE: "of full duty", READING: "-"}
    axis.set_ylabel(f"size [{term.act.unit or relative_units.get(term.act.kind, '-')}]")
    axis.set_title(textwrap.fill(figure_text(term.act.description), 34), fontsize=10)
    axis.grid(alpha=0.25)
    return figure


def _curves(axis: Axes, term: Term) -> None:
    """Draw the estimated function of a term, or one function for each run, where the data determine the function.

    Angles are drawn in degrees.
    """
    curve, per_run = term.curve, term.argument.per_run
    # Angles are shown in degrees.
    factor, unit = in_words(term.argument.unit) if term.argument.unit == "rad" else (1.0, term.argument.unit)
    rows = np.atleast_2d(curve.value)
    for number, (value, sd) in enumerate(zip(rows, np.atleast_2d(curve.sd), strict=True)):
        shade = RUN_COLOURS[number % len(RUN_COLOURS)] if per_run else AFTER
        # The SD is 0 where no data depend on the value.
        value = np.where(sd > 0, value, np.nan)
        axis.plot(
            factor * curve.at, value, color=shade, lw=1.4, label=figure_text(term.runs[number]) if per_run else None
        )
        axis.fill_between(factor * curve.at, value - sd, value + sd, color=shade, alpha=0.2, lw=0)
    if per_run and len(rows) <= len(RUN_COLOURS):
        axis.legend(fontsize=7, frameon=False)
    name = "all the time" if term.argument.name == "nothing" else term.argument.name
    axis.set_xlabel(f"{name} [{unit or '-'}]" if name != "all the time" else name)
