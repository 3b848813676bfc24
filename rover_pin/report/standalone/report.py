"""A test bench's verdict as a page: the sections that any verdict has, and its channels sample by sample."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from rover_pin.discrepancy.standalone import Standalone
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.effects.names import display_name
from rover_pin.estimation.experiment import Experiment
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.wording import format_value, in_words
from rover_pin.report.page import Picture
from rover_pin.report.svg import AFTER, BEFORE
from rover_pin.report.verdict_page import write_verdict
from rover_pin.report.words import Labels, as_text, key, kinds_of, listing

LABELS = Labels("where it was not fitted", "folds")


def write_report(verdict: Verdict, standalone: Standalone, out: Path) -> list[Path]:
    """Write report.html and its figures, and return their paths."""
    count = int(np.isfinite(standalone.observed).any(axis=1).sum())
    kicker = f"{count} points in {len(standalone.folds)} folds; {listing(standalone.channels)}"
    along = standalone.along()
    caption = f"Each point once{'' if along else ', fold after fold; a fold begins at each line'}."
    picture = ("points", points_picture(verdict, standalone, caption, along))
    return write_verdict(verdict, LABELS, out, standalone.name, kicker, picture, model_file=False)


Side = tuple[Fit, str, str, str]
Along = tuple[str, np.ndarray]


def points_picture(
    verdict: Verdict, experiment: Experiment, caption: str, along: Along | None = None
) -> Picture | None:
    """Return what was measured and modelled, a panel for each channel; None where nothing could be fitted."""
    if verdict.before is None or verdict.after is None:
        return None
    errors = listing(
        f"{score.name} {format_value(score.before, score.unit)} to {format_value(score.after, score.unit)}"
        for score in verdict.scores
    )
    alt = f"Measured and modelled {listing(experiment.channels)}, point by point; error where not fitted: {errors}."
    added = listing(display_name(name, kinds_of(verdict)) for name in verdict.named)
    sides: list[Side] = [(verdict.before.fit, BEFORE, "_", "base model, fitted")]
    sides += [(verdict.after.fit, AFTER, "x", key(added))] if added else []
    panels = (panel(experiment, row, sides, along) for row in range(len(experiment.channels)))
    return Picture(tuple(panels), alt, caption)


def panel(standalone: Experiment, row: int, sides: list[Side], along: Along | None = None) -> Figure:
    """Return a channel's picture: measured and modelled, over `along`, else sample by sample."""
    figure = Figure(figsize=(4.6, 3.6), layout="constrained")
    axis, factor, unit = figure.subplots(), *in_words(standalone.unit(standalone.channels[row]))
    recorded = np.isfinite(standalone.observed[:, row])
    words, values = along or ("point", np.cumsum(recorded).reshape(recorded.shape) - 1)
    axis.plot(values[recorded], factor * standalone.observed[:, row][recorded], "ko", ms=4, label="measured")
    for fitted, colour, marker, label in sides:
        modelled = factor * fitted.predicted[:, row][recorded]
        axis.plot(values[recorded], modelled, marker, color=colour, ms=8, mew=1.6, label=label)
    for begin in () if along else np.cumsum(recorded.sum(axis=1))[:-1]:
        axis.axvline(begin - 0.5, color="#b0b0b0", lw=0.7)
    axis.set(xlabel=words, ylabel=f"{as_text(standalone.channels[row])} [{unit or '-'}]")
    axis.grid(alpha=0.25, axis="y")
    figure.legend(*axis.get_legend_handles_labels(), loc="outside upper center", ncols=2, frameon=False, fontsize=8.5)
    return figure
