"""What was added: its meaning, how much it does, its equation, and its numbers with their sources."""

import inspect
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from rover_pin.base.quantity import quantities
from rover_pin.discrepancy.verdict import Side, Verdict
from rover_pin.effects.names import meaning_of, title_of
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.wording import MAX_LISTED, format_value
from rover_pin.report.page import Row, Section, Table
from rover_pin.report.words import Labels, brief, capital


def physics_section(
    verdict: Verdict, labels: Labels, describe_size: Callable[[Any], str] = lambda effect: ""
) -> Section | None:
    """Return each added effect, None where there is none.

    `describe_size` says more of how much one does, where a kind of data can.
    """
    if not verdict.effects or verdict.after is None:
        return None
    effects = [_effect(effect, verdict.after, labels, describe_size) for effect in verdict.effects]
    return Section("What was added, and how much it does", "sections/physics.html", {"effects": effects})


def _effect(effect: Any, side: Side, labels: Labels, describe_size: Callable[[Any], str]) -> dict[str, Any]:
    kind, fitted = type(effect), side.fit
    records = fitted.task.experiment.records(fitted.model)
    owners = [name for name, record in records.items() if type(record) is kind]
    owner = next((name for name in owners if records[name] == effect), owners[0])
    sentences = [practical(fitted, owner, labels), describe_size(effect)]
    paragraphs = [part for part in (inspect.getdoc(kind) or "").split("\n\n") if part.strip()]
    return {
        "title": capital(title_of(kind)),
        "name": owner,
        "meaning": capital(meaning_of(kind)) + ".",
        "does": [line for line in sentences if line],
        "equation": paragraphs[0] if paragraphs else "",
        "more": paragraphs[1:],
        "numbers": _numbers(effect, owner, side),
    }


def _numbers(effect: Any, owner: str, side: Side) -> Table:
    fitted = {number.name: number for number in side.numbers}
    rows = []
    for name, quantity in quantities(effect).items():
        default, number = float(getattr(type(effect)(), name)), fitted.get(f"{owner}.{name}")
        held_value = f"{format_value(float(getattr(effect, name)), quantity.unit)}, held"
        bounds = f"{format_value(quantity.low, quantity.unit)} to {format_value(quantity.high, quantity.unit)}"
        rows.append(Row((f"{name} ({quantity.symbol})" if quantity.symbol not in ("", name) else name,
                         number.interval if number else held_value,
                         format_value(default, quantity.unit), bounds, quantity.source)))  # fmt: skip
    return Table(("parameter", "fitted, 95 %", "default", "allowed", "source of the default"), tuple(rows))


SMALL = 1.0
"""SDs of its noise below which what an effect does to a channel is not worth a word."""


class Size(NamedTuple):
    """What an effect does to one channel where it does most [the channel's unit]."""

    channel: str
    unit: str
    fold: str
    with_it: float
    without: float
    in_noise: float

    def describe(self, labels: Labels) -> str:
        """One clause for a reader."""
        by = abs(self.with_it - self.without)
        share = f", {by / abs(self.without):.0%}" if abs(self.without) > by else ""
        more = "more" if self.with_it > self.without else "less"
        return (
            f"{labels.channel(self.channel)} is {brief(self.with_it, self.unit)} instead of "
            f"{brief(self.without, self.unit)}, {brief(by, self.unit)} {more}{share}, at {labels.fold(self.fold)}"
        )


def channel_changes(fitted: Fit, owner: str) -> list[Size]:
    """Return what an effect of a fitted model does to each channel, the most in SDs of its noise first."""
    experiment = fitted.task.experiment
    effect = experiment.records(fitted.model)[owner]
    bare = experiment.replace_record(fitted.model, owner, effect.replace(**effect.neutral))
    predicted = experiment.predict([fitted.model, bare])
    difference = np.where(np.isfinite(experiment.observed), predicted[0] - predicted[1], 0.0)
    changes = []
    for at, channel in enumerate(experiment.channels):
        noise = max(float(fitted.task.noise.floor[at]), 1e-300)
        fold, sample = np.unravel_index(int(np.argmax(np.abs(difference[:, at]))), difference[:, at].shape)
        with_it, bare_value = (float(side[fold, at, sample]) for side in predicted)
        by = abs(with_it - bare_value) / noise
        changes.append(Size(channel, experiment.unit(channel), experiment.folds[fold], with_it, bare_value, by))
    return sorted(changes, key=lambda size: -size.in_noise)


def practical(fitted: Fit, owner: str, labels: Labels) -> str:
    """Return in one sentence what an effect does to the channels where it does most; empty where to none."""
    clauses = [size.describe(labels) for size in channel_changes(fitted, owner)[:MAX_LISTED] if size.in_noise >= SMALL]
    return f"With it {'; '.join(clauses)}." if clauses else ""
