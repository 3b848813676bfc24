"""What a drive model leaves: how it acts, and what the residuals go with."""

import textwrap

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.wording import MAX_LISTED, in_words
from rover_pin.experiments.drive_log.free_runs import extra_of
from rover_pin.experiments.unlisted.actions import GRIP, READING, VOLTAGE
from rover_pin.experiments.unlisted.residual import DriveResidual
from rover_pin.experiments.unlisted.term import Term
from rover_pin.report.drive.runs import words_of
from rover_pin.report.page import AWAY, Picture, Row, Section, Table
from rover_pin.report.svg import AFTER
from rover_pin.report.words import as_text

MAX_RESIDUAL_CHANNELS = 12
"""Channels whose residual is listed."""


def residual_section(verdict: Verdict) -> Section | None:
    """Return what is left: the terms that describe it best, and the channels with what they go with."""
    residual = extra_of(verdict).residual
    if residual is None:
        return None
    terms = tuple(Row((f"it {term.description}", *_gains(term))) for term in residual.terms[:MAX_LISTED])
    heads = ("what is left", "gain in chi2", "chance", "on runs left out", "net gain")
    content = {
        "left": residual.description,
        "terms": Table(heads, terms) if not residual.is_noise else None,
        "channels": channel_table(residual),
        "draft": verdict.draft,
    }
    pictures = {} if residual.is_noise or not residual.terms else {"terms": _picture(residual)}
    return Section("What is left", "drive/residual.html", content, pictures)


def _picture(residual: DriveResidual) -> Picture:
    """Return the estimated functions."""
    alt = f"Estimated functions of the terms that describe what is left best: it {residual.best.description}."
    caption = (
        "What acts, times a function of what it depends on, as estimated from measured - model; shaded: one SD. "
        "Net gain: what it takes beyond chance, no more than on runs on which it was not fitted."
    )
    return Picture(tuple(map(_panel, residual.terms[:MAX_LISTED])), alt, caption)


def _gains(term: Term) -> tuple[str, ...]:
    held_out_gain = "" if term.held_out is None else f"{term.held_out:+.1f}"
    return (f"{term.gain:.1f}", f"{term.detection_threshold:.1f}", held_out_gain, f"{term.strength:+.1f}")


def channel_table(residual: DriveResidual) -> Table:
    """Return what the channels leave, the most first, with what it goes with."""
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
    heads = ("channel", "times the noise", "one block with the next", *signals, "most of it")
    return Table(heads, tuple(rows), "What measured - model goes with")


RUN_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
"""Of curves that each run has for itself. Source: Okabe and Ito 2008, distinct for the colour-blind."""


def _panel(term: Term) -> Figure:
    """Return the estimated function of a term, with +-1 SD."""
    figure = Figure(figsize=(3.9, 3.4), layout="constrained")
    axis = figure.subplots()
    if term.argument.name == "run":
        _by_run(axis, term)
    else:
        _curves(axis, term)
    axis.axhline(0, color="k", lw=0.7)
    axis.set_ylabel(f"size [{_unit(term)}]")
    axis.set_title(textwrap.fill(as_text(term.act.description), 34), fontsize=10)
    axis.grid(alpha=0.25)
    return figure


def _unit(term: Term) -> str:
    shares = {GRIP: "share of tan phi", VOLTAGE: "of full duty", READING: "-"}
    return term.act.unit or shares.get(term.act.kind, "-")


def _by_run(axis: Axes, term: Term) -> None:
    curve, runs = term.curve, term.runs
    axis.errorbar(range(len(runs)), curve.value[:, 0], curve.sd[:, 0], fmt="o", color=AFTER, capsize=3)
    axis.set_xticks(range(len(runs)), [as_text(run) for run in runs], rotation=45, ha="right", fontsize=8)


def _curves(axis: Axes, term: Term) -> None:
    """Draw the function, or every run's own, where the data tell it; angles in degrees."""
    curve, per_run = term.curve, term.argument.per_run
    factor, unit = in_words(term.argument.unit) if term.argument.unit == "rad" else (1.0, term.argument.unit)
    rows = np.atleast_2d(curve.value)
    for number, (value, sd) in enumerate(zip(rows, np.atleast_2d(curve.sd), strict=True)):
        shade = RUN_COLOURS[number % len(RUN_COLOURS)] if per_run else AFTER
        value = np.where(sd > 0, value, np.nan)
        axis.plot(factor * curve.at, value, color=shade, lw=1.4, label=as_text(term.runs[number]) if per_run else None)
        axis.fill_between(factor * curve.at, value - sd, value + sd, color=shade, alpha=0.2, lw=0)
    if per_run and len(rows) <= len(RUN_COLOURS):
        axis.legend(fontsize=7, frameon=False)
    name = "all the time" if term.argument.name == "nothing" else term.argument.name
    axis.set_xlabel(f"{name} [{unit or '-'}]" if name != "all the time" else name)
