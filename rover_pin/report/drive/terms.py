"""Pictures of what a drive model leaves: the functions that describe it best."""

import textwrap
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rover_pin.estimation.wording import in_words
from rover_pin.experiments.unlisted.actions import GRIP, READING, VOLTAGE
from rover_pin.experiments.unlisted.term import Term
from rover_pin.report.svg import AFTER
from rover_pin.report.words import as_text

RUN_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
"""Of curves that each run has for itself. Source: Okabe and Ito 2008, distinct for the colour-blind."""


def term_panels(terms: Sequence[Term]) -> tuple[Figure, ...]:
    """Return the estimated functions of the best terms, with +-1 SD."""
    return tuple(map(_panel, terms))


def _panel(term: Term) -> Figure:
    figure = Figure(figsize=(3.9, 3.4), layout="constrained")
    axis = figure.subplots()
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
