"""The section on the added effects: meaning, influence on the channels, equation, and numbers with their sources."""

import inspect
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from rover_pin.base.quantity import quantities
from rover_pin.discrepancy.verdict import Side, Verdict
from rover_pin.effects.names import meaning_of, title_of
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.wording import MAX_LISTED, format_value
from rover_pin.report.page import ReportTable, Section, TableRow
from rover_pin.report.words import Labels, brief, capital


def physics_section(
    verdict: Verdict, labels: Labels, describe_size: Callable[[Any], str] = lambda effect: ""
) -> Section | None:
    """Return the section that describes each added effect; None if no effect was added.

    `describe_size` is a function that returns one more sentence on the influence of an effect, for example on a drive
    on level ground, or an empty text.
    """
    if not verdict.effects or verdict.after is None:
        return None
    fitted = verdict.after.fit
    records = fitted.task.experiment.records(fitted.model)
    effects = []
    for effect in verdict.effects:
        kind = type(effect)
        # Two effects of one class may be in the model; the equal effect is taken.
        owners = [name for name, record in records.items() if type(record) is kind]
        owner = next((name for name in owners if records[name] == effect), owners[0])
        sentences = [practical(fitted, owner, labels), describe_size(effect)]
        paragraphs = [part for part in (inspect.getdoc(kind) or "").split("\n\n") if part.strip()]
        # The keys are the variables of the template.
        effects.append(
            {
                "title": capital(title_of(kind)),
                "name": owner,
                "meaning": capital(meaning_of(kind)) + ".",
                "does": [line for line in sentences if line],
                "law": paragraphs,
                "numbers": _numbers(effect, owner, verdict.after),
            }
        )
    return Section("Added effects and their influence", "sections/physics.html", {"effects": effects})


def _numbers(effect: Any, owner: str, side: Side) -> ReportTable:
    """Return the table of an effect's parameters: fitted values, defaults, bounds, and sources of the defaults.

    `owner` is the name of the effect in the fitted model.
    """
    fitted = {number.name: number for number in side.numbers}
    rows = []
    for name, quantity in quantities(effect).items():
        # A parameter that was not fitted is shown with its value, marked as held.
        default, number = float(getattr(type(effect)(), name)), fitted.get(f"{owner}.{name}")
        held_value = f"{format_value(float(getattr(effect, name)), quantity.unit)}, held"
        bounds = f"{format_value(quantity.low, quantity.unit)} to {format_value(quantity.high, quantity.unit)}"
        rows.append(TableRow((f"{name} ({quantity.symbol})" if quantity.symbol not in ("", name) else name,
                         number.interval if number else held_value,
                         format_value(default, quantity.unit), bounds, quantity.source)))  # fmt: skip
    return ReportTable(("parameter", "fitted, 95 %", "default", "allowed", "source of the default"), tuple(rows))


MIN_INFLUENCE = 1.0
"""Smallest influence of an effect on a channel that the report describes, as a multiple of the SD of the channel's
noise. A smaller influence cannot be seen in a single measured value."""


class Influence(NamedTuple):
    """Largest influence of an effect on one channel, over all compared values of all runs or slip levels."""

    channel: str
    unit: str
    fold: str
    """name of the run or slip level with the largest influence"""
    with_it: float
    "predicted value with the effect, in the channel's unit"
    without: float
    "predicted value with the effect at its neutral values"
    in_noise: float
    """difference of the two predicted values, divided by the SD of the channel's noise"""

    def describe(self, labels: Labels) -> str:
        """Return the influence as a clause: "sinkage is 12 mm instead of 10 mm, 2.0 mm more, 20%, at S = 0.5"."""
        by = abs(self.with_it - self.without)
        share = f", {by / abs(self.without):.0%}" if abs(self.without) > by else ""
        more = "more" if self.with_it > self.without else "less"
        return (
            f"{labels.channel(self.channel)} is {brief(self.with_it, self.unit)} instead of "
            f"{brief(self.without, self.unit)}, {brief(by, self.unit)} {more}{share}, at {labels.fold(self.fold)}"
        )


def channel_changes(fitted: Fit, owner: str) -> list[Influence]:
    """Return the influence of an effect on each channel. The channel with the largest influence relative to its noise
    is first.

    The influence is the difference of two predictions: with the effect, and with the effect at its neutral values,
    where it vanishes. `owner` is the name of the effect in the fitted model.
    """
    experiment = fitted.task.experiment
    effect = experiment.records(fitted.model)[owner]
    bare = experiment.replace_record(fitted.model, owner, effect.replace(**effect.neutral))
    predicted = experiment.predict([fitted.model, bare])
    # Only values that were measured count; elsewhere nothing shows the effect.
    difference = np.where(np.isfinite(experiment.observed), predicted[0] - predicted[1], 0.0)
    changes = []
    for row, channel in enumerate(experiment.channels):
        noise = max(float(fitted.task.noise.floor[row]), 1e-300)
        # Position of the largest difference of this channel, as the fold and the sample in it.
        fold, sample = np.unravel_index(int(np.argmax(np.abs(difference[:, row]))), difference[:, row].shape)
        with_it, bare_value = (float(side[fold, row, sample]) for side in predicted)
        by = abs(with_it - bare_value) / noise
        changes.append(Influence(channel, experiment.unit(channel), experiment.folds[fold], with_it, bare_value, by))
    return sorted(changes, key=lambda influence: -influence.in_noise)


def practical(fitted: Fit, owner: str, labels: Labels) -> str:
    """Return a sentence on the channels that an effect changes most; an empty text if all changes are below the noise.

    `owner` is the name of the effect in the fitted model.
    """
    largest = channel_changes(fitted, owner)[:MAX_LISTED]
    clauses = [influence.describe(labels) for influence in largest if influence.in_noise >= MIN_INFLUENCE]
    return f"With this effect {'; '.join(clauses)}." if clauses else ""
