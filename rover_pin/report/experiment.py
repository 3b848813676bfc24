"""The report of an experiment that a user's file defines: the sections of all kinds of data, and a figure of its
channels.
"""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from rover_pin.base.encode import figure_text
from rover_pin.discrepancy.experiment import FileExperiment
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.effects.names import display_name
from rover_pin.estimation.experiment import Experiment
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.wording import format_value, in_words
from rover_pin.report.page import Picture
from rover_pin.report.svg import AFTER, BEFORE
from rover_pin.report.verdict_page import VerdictPage, write_verdict
from rover_pin.report.words import Labels, key, kinds_of, listing

LABELS = Labels("in folds that were not fitted", "folds")
"""Words that the report uses for the held-out folds of an experiment that a user's file defines."""


def write_report(verdict: Verdict, experiment: FileExperiment, out: Path) -> list[Path]:
    """Write the report of a user's experiment, report.html, and its figures into the folder `out`, and return all
    paths.
    """
    count = int(np.isfinite(experiment.observed).any(axis=1).sum())
    kicker = f"{count} points in {len(experiment.folds)} folds; {listing(experiment.channels)}"
    along = experiment.along()
    caption = (
        "Each point is drawn once."
        if along
        else "Each point is drawn once, fold after fold. A vertical line marks the beginning of a fold."
    )
    picture = ("points", points_picture(verdict, experiment, caption, along))
    return write_verdict(verdict, VerdictPage(LABELS, experiment.name, kicker, picture, model_file=False), out)


DrawnFit = tuple[Fit, str, str, str]
"""Type of a fit with the colour, the marker and the label of its values in a figure."""
Along = tuple[str, np.ndarray]
"""Type of the horizontal axis of a figure: its label, and its values (folds, samples)."""


def points_picture(
    verdict: Verdict, experiment: Experiment, caption: str, along: Along | None = None
) -> Picture | None:
    """Return the picture of measured and predicted values, with one panel for each channel; None if no model was
    fitted.

    The horizontal axis is `along`, or the number of the point if `along` is None.
    """
    if verdict.before is None or verdict.after is None:
        return None
    # The alternative text states the numbers, because a screen reader cannot see the picture.
    errors = listing(
        f"{score.name} {format_value(score.before, score.unit)} to {format_value(score.after, score.unit)}"
        for score in verdict.scores
    )
    alt = f"Measured and predicted {listing(experiment.channels)}, point by point; held-out errors: {errors}."
    added = listing(display_name(name, kinds_of(verdict)) for name in verdict.named)
    sides: list[DrawnFit] = [(verdict.before.fit, BEFORE, "_", "base model, fitted")]
    sides += [(verdict.after.fit, AFTER, "x", key(added))] if added else []
    panels = (panel(experiment, row, sides, along) for row in range(len(experiment.channels)))
    return Picture(tuple(panels), alt, caption)


def panel(experiment: Experiment, row: int, sides: list[DrawnFit], along: Along | None = None) -> Figure:
    """Return the panel of one channel: measured and predicted values against `along`, or against the number of the
    point.

    `row` is the number of the channel, and `sides` are the drawn fits.
    """
    figure = Figure(figsize=(4.6, 3.6), layout="constrained")
    axis, factor, unit = figure.subplots(), *in_words(experiment.unit(experiment.channels[row]))
    recorded = np.isfinite(experiment.observed[:, row])
    # Without an axis of the experiment, the points are numbered from 0 in the order of the folds.
    words, values = along or ("point", np.cumsum(recorded).reshape(recorded.shape) - 1)
    axis.plot(values[recorded], factor * experiment.observed[:, row][recorded], "ko", ms=4, label="measured")
    for fitted, colour, marker, label in sides:
        modelled = factor * fitted.predicted[:, row][recorded]
        axis.plot(values[recorded], modelled, marker, color=colour, ms=8, mew=1.6, label=label)
    # Without an axis of its own, each fold begins at a vertical line.
    for begin in () if along else np.cumsum(recorded.sum(axis=1))[:-1]:
        axis.axvline(begin - 0.5, color="#b0b0b0", lw=0.7)
    axis.set(xlabel=words, ylabel=f"{figure_text(experiment.channels[row])} [{unit or '-'}]")
    axis.grid(alpha=0.25, axis="y")
    figure.legend(*axis.get_legend_handles_labels(), loc="outside upper center", ncols=2, frameon=False, fontsize=8.5)
    return figure
