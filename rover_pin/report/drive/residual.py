"""The section on the remaining residual of a drive model: the terms that describe it, and its correlations.

A term is an action, such as a torque on one wheel, multiplied by a function of one measured signal.
"""

import textwrap

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rover_pin.base.encode import figure_text
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.wording import MAX_LISTED, in_words
from rover_pin.experiments.drive_log.free_runs import extra_of
from rover_pin.experiments.unlisted.actions import GRIP, READING, VOLTAGE
from rover_pin.experiments.unlisted.residual import DriveResidual
from rover_pin.experiments.unlisted.terms import Term
from rover_pin.report.drive.runs import words_of
from rover_pin.report.page import AWAY, Picture, Row, Section, Table
from rover_pin.report.svg import AFTER

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
    terms = tuple(Row((f"the residual {term.description}", *_gains(term))) for term in residual.terms[:MAX_LISTED])
    heads = ("description of the residual", "decrease of chi2", "by chance", "in held-out runs", "net decrease")
    # If the residual is only noise, no terms are shown: they would describe the noise.
    content = {
        "description": residual.description,
        "terms": Table(heads, terms) if not residual.is_noise else None,
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


def _gains(term: Term) -> tuple[str, ...]:
    """Return the table cells of a term that describes the residual: three decreases of chi2, and the net decrease.

    The three decreases of chi2 are: by the term in the fitted runs, by chance, and by the term in held-out runs.
    """
    held_out_gain = "" if term.held_out is None else f"{term.held_out:+.1f}"
    return (f"{term.gain:.1f}", f"{term.detection_threshold:.1f}", held_out_gain, f"{term.strength:+.1f}")


def channel_table(residual: DriveResidual) -> Table:
    """Return the table of the residuals of each channel with their correlations. The largest residual comes first."""
    # The RMS is in units of the channel's noise, so that channels of different units can be ranked.
    ranked = sorted(residual.channels, key=lambda channel: -channel.rms)[:MAX_RESIDUAL_CHANNELS]
    signals = tuple(residual.channels[0].correlations) if residual.channels else ()
    rows = [
        Row(
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
    return Table(heads, tuple(rows), "Correlations of the residual (measured - model)")


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
