"""Pictures of a drive report beside those along time: candidates, held-out errors, and what terms describe."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from rover_pin.discrepancy.held_out import ChannelScore
from rover_pin.discrepancy.refit import Fee
from rover_pin.discrepancy.screen import Scored
from rover_pin.discrepancy.search import Round, Search, fee_after
from rover_pin.estimation.wording import Outcome, in_words
from rover_pin.experiments.unlisted.actions import GRIP, READING, VOLTAGE
from rover_pin.experiments.unlisted.term import Term
from rover_pin.report.drive_runs import as_text, words_of
from rover_pin.report.page import AFTER, BEFORE, GREY

FIRST, LATER = 14, 6
"""Candidates that are drawn of the first look, and of each later one."""
LEAST_GAIN = 0.1
"""Gain in chi2 at which the axis begins."""
RUN_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
"""Of curves that each run has for itself. Source: Okabe and Ito 2008, told apart by the colour-blind."""


def candidates_figure(search: Search) -> Figure:
    """Return the gain of the leading candidates of every look against what chance gives the best of them."""
    rows = [leaders(look, FIRST if not number else LATER) for number, look in enumerate(search.rounds)]
    heights = [len(each) + 1.2 for each in rows]
    figure = Figure(figsize=(8.6, 0.3 * sum(heights) + 1.1), layout="constrained")
    axes = figure.subplots(len(rows), 1, sharex=True, squeeze=False, gridspec_kw={"height_ratios": heights})[:, 0]
    for number, (axis, look, shown) in enumerate(zip(axes, search.rounds, rows, strict=True)):
        _candidates(axis, look, shown[::-1], fee_after(search.rounds[:number], search.count))
        base = " and ".join(one.name for one in search.found[:number]) or "the base model"
        axis.set_title(f"added to {as_text(base)}", fontsize=9.5, loc="left")
    axes[-1].set_xlabel("gain in chi2")
    figure.legend(handles=_signs(), loc="outside upper center", ncols=3, frameon=False, fontsize=8.5)
    return figure


def leaders(look: Round, most: int) -> list[Scored]:
    """Return the leading candidates of a look and all refitted ones, by refitted or else promised gain.

    Of an effect that was sought all over the ground only the best place, unless another was refitted.
    """
    refitted = {one.name: one.gain for one in look.refits}
    kept: list[Scored] = []
    places = set()
    for row in look.scored:
        name, kind = row.candidate.name, row.candidate.kind
        if name not in refitted and (not row.told or ("@" in name and kind in places) or len(kept) >= most):
            continue
        places.add(kind)
        kept.append(row)
    return sorted(kept, key=lambda row: -refitted.get(row.candidate.name, row.gain))


def _candidates(axis: Axes, look: Round, rows: Sequence[Scored], must_gain: Fee) -> None:
    refits = {one.name: one for one in look.refits}
    for place, row in enumerate(rows):
        one = refits.get(row.candidate.name)
        gain = row.gain if one is None else one.gain
        colour = AFTER if one in look.alike else "#9fb8c1" if one is not None and one.accepted else "#cccccc"
        if gain > LEAST_GAIN:
            axis.barh(place, gain - LEAST_GAIN, left=LEAST_GAIN, color=colour, height=0.7)
        if one is not None:
            axis.plot(max(gain, LEAST_GAIN), place, "D", color="k", ms=4, clip_on=False)
        fee = must_gain(row.candidate)
        axis.plot([fee, fee], [place - 0.45, place + 0.45], color=BEFORE, lw=1.8)
    axis.set_yticks(range(len(rows)), [as_text(row.candidate.name) for row in rows], fontsize=8.5)
    axis.set_ylim(-0.7, len(rows) - 0.3)
    axis.set_xscale("log")
    axis.set_xlim(left=LEAST_GAIN)
    axis.grid(alpha=0.25, axis="x")


def _signs() -> list[Line2D]:
    return [
        Line2D([], [], color=AFTER, lw=7, label="accepted: the best, or not told from it"),
        Line2D([], [], color="#9fb8c1", lw=7, label="accepted, but beaten"),
        Line2D([], [], color="#cccccc", lw=7, label="not accepted, or promised only"),
        Line2D([], [], color="k", marker="D", ms=4, ls="", label="refitted"),
        Line2D([], [], color=BEFORE, lw=1.8, label="what it must gain"),
    ]


def heldout_figure(scores: Sequence[ChannelScore], added: bool) -> Figure:
    """Return each channel's held-out error in times its noise, and its change with the 95 % interval."""
    ranked = sorted(scores, key=lambda one: one.before / max(one.floor, 1e-300))
    figure = Figure(figsize=(8.6, 0.24 * len(ranked) + 1.3), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True, squeeze=False)[0] if added else (figure.subplots(), None)
    places = np.arange(len(ranked))
    before, after = (
        np.array([value / max(one.floor, 1e-300) for one, value in zip(ranked, side, strict=True)])
        for side in ([one.before for one in ranked], [one.after for one in ranked])
    )
    left.axvline(1, color="k", lw=0.8)
    left.plot(before, places, "o", color=BEFORE, ms=5, label="base model")
    if right is not None:
        told = np.array([one.worded.outcome in (Outcome.BETTER, Outcome.WORSE) for one in ranked], dtype=bool)
        left.hlines(places[told], before[told], after[told], color=GREY, lw=1, zorder=1)
        left.plot(after[told], places[told], "s", color=AFTER, ms=5, label="with what was added")
        left.plot(after[~told], places[~told], "s", color=AFTER, mfc="none", ms=5, label="the same, no change to claim")
        _changes(right, ranked)
    left.set_xscale("log")
    left.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    left.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    left.xaxis.set_minor_formatter(NullFormatter())
    left.set_xlabel("held-out RMSE / noise")
    left.set_yticks(places, [as_text(words_of(one.name)) for one in ranked], fontsize=8.5)
    left.grid(alpha=0.25)
    figure.legend(*left.get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False)
    return figure


def _changes(axis: Axes, ranked: Sequence[ChannelScore]) -> None:
    for place, one in enumerate(ranked):
        colour = {Outcome.BETTER: AFTER, Outcome.WORSE: BEFORE}.get(one.worded.outcome, GREY)
        axis.plot([100 * one.low, 100 * one.high], [place, place], color=colour, lw=2)
        axis.plot(100 * one.change, place, "o", color=colour, ms=4)
    axis.axvline(0, color="k", lw=0.8)
    axis.set_xlabel("change of the RMSE [%], 95 % interval")
    axis.grid(alpha=0.25)


def terms_figure(terms: Sequence[Term]) -> Figure:
    """Return the estimated functions of the best terms, with +-1 SD."""
    figure = Figure(figsize=(4.3 * len(terms) + 0.3, 3.6), layout="constrained")
    axes = figure.subplots(1, len(terms), squeeze=False)[0]
    for axis, term in zip(axes, terms, strict=True):
        if term.argument.name == "run":
            _by_run(axis, term)
        else:
            _curves(axis, term)
        axis.axhline(0, color="k", lw=0.7)
        axis.set_ylabel(f"size [{_unit(term)}]")
        axis.set_title(textwrap.fill(as_text(term.acts), 34), fontsize=10)
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
    curve, own = term.curve, term.argument.own
    factor, unit = in_words(term.argument.unit) if term.argument.unit == "rad" else (1.0, term.argument.unit)
    rows = np.atleast_2d(curve.value)
    for number, (value, sd) in enumerate(zip(rows, np.atleast_2d(curve.sd), strict=True)):
        shade = RUN_COLOURS[number % len(RUN_COLOURS)] if own else AFTER
        value = np.where(sd > 0, value, np.nan)
        axis.plot(factor * curve.at, value, color=shade, lw=1.4, label=as_text(term.runs[number]) if own else None)
        axis.fill_between(factor * curve.at, value - sd, value + sd, color=shade, alpha=0.2, lw=0)
    if own and len(rows) <= len(RUN_COLOURS):
        axis.legend(fontsize=7, frameon=False)
    name = "all the time" if term.argument.name == "nothing" else term.argument.name
    axis.set_xlabel(f"{name} [{unit or '-'}]" if name != "all the time" else name)
