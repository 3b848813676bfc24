"""The sets of causes that remain possible: their sizes, probabilities and held-out errors, for the first screen."""

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.decision import likeliest
from rover_pin.discrepancy.held_out_errors import ChannelScore
from rover_pin.discrepancy.rivals import RIVAL_RATIO
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.effects.names import display_name
from rover_pin.estimation.numbers import Number
from rover_pin.estimation.wording import MIN_MENTIONED, Outcome
from rover_pin.report.page import CHOSEN, ReportTable, TableRow
from rover_pin.report.words import Labels, brief, kinds_of, listing, two_digits, with_interval

BASE_MODEL = "nothing (base model)"
"""Name of the table row of the base model, to which no cause was added."""
MAX_SHOWN_CHANNELS = 2
"""Maximum number of channels whose held-out errors the first screen shows for each set of causes. With more channels, a
row of the table would not fit on one line of the page."""


class CauseSet(NamedTuple):
    """A set of causes that may act together, with its fitted sizes and held-out errors. An empty set is the base
    model.
    """

    names: tuple[str, ...]
    probability: float
    "probability of the set; NaN if no probabilities were computed"
    numbers: tuple[Number, ...] = ()
    """fitted numbers of the causes: their sizes, and the other parameters of their laws; empty if the set was not
    fitted"""
    errors: Mapping[str, float] = MappingProxyType({})
    """name of a channel -> held-out RMSE in the channel's unit; empty if the set was not fitted"""

    def times_noise(self, scores: Sequence[ChannelScore]) -> float:
        """Return the held-out error of all channels together, as a multiple of the noise.

        This is the root of the mean over the channels of (held-out RMSE / noise)^2. It is NaN if the set was not
        fitted or if some channel is not predicted. `scores` hold the noise of each channel.
        """
        if not scores or not self.errors:
            return math.nan
        squares = [score.times(self.errors.get(score.name, math.nan)) ** 2 for score in scores]
        return math.sqrt(math.fsum(squares) / len(squares))


def cause_sets(verdict: Verdict) -> list[CauseSet]:
    """Return the sets of causes that remain possible, the most probable first.

    The probability of a set is the sum over all combinations of causes that contain it and none of the sets that the
    verdict lists before it. The empty set, if it is listed, means that nothing is missing.
    """
    # The verdict stores combinations as texts, such as "SlipSinkage + TetherDrag".
    sets = [tuple(names.split(" + ")) if names != "nothing" else () for names in verdict.indistinguishable]
    sets = sets or [verdict.named]
    beliefs = verdict.deciding_beliefs
    listed = likeliest(sets, beliefs) if beliefs else [(names, math.nan) for names in sets]
    rows = []
    for names, probability in listed:
        numbers: tuple[Number, ...] = ()
        errors: dict[str, float] = {}
        if not names:
            numbers, errors = far_from_declared(verdict), {score.name: score.before for score in verdict.scores}
        elif names == verdict.named and verdict.after is not None:
            numbers, errors = verdict.after.numbers, {score.name: score.after for score in verdict.scores}
        elif (side := verdict.others.get(" + ".join(names))) is not None:
            numbers, errors = side.numbers, side.errors
        rows.append(CauseSet(names, probability, numbers, errors))
    # The sort is stable: without probabilities, the order of the verdict is kept.
    return sorted(rows, key=lambda row: 0.0 if math.isnan(row.probability) else -row.probability)


def far_from_declared(verdict: Verdict) -> tuple[Number, ...]:
    """Return the numbers of the base model that the data contradict: fitted values far from the declared ones.

    The tuple is empty unless the answer is that the base model is inadequate.
    """
    if verdict.answer is not Answer.INADEQUATE or verdict.named or verdict.before is None:
        return ()
    # The sentence of the verdict lists these numbers with their values.
    return tuple(number for number in verdict.before.numbers if f"{number.name} = " in verdict.sentence)


def best_held_out(verdict: Verdict) -> CauseSet | None:
    """Return the set of causes that predicts held-out data best; None if no set is better than the others.

    A set counts as best if its error is below RIVAL_RATIO times the errors of all other fitted sets, because smaller
    differences show little. `CauseSet.times_noise` computes the error.
    """
    errors = [(row.times_noise(verdict.scores), row) for row in cause_sets(verdict)]
    ranked = sorted((pair for pair in errors if math.isfinite(pair[0])), key=lambda pair: pair[0])
    if len(ranked) < 2 or ranked[0][0] > RIVAL_RATIO * ranked[1][0]:
        return None
    return ranked[0][1]


def in_order_of_interest(verdict: Verdict) -> list[CauseSet]:
    """Return the sets of causes in the order of the first screen: the set that predicts held-out data best, the most
    probable set, then the others by their probability.
    """
    rows, best = cause_sets(verdict), best_held_out(verdict)
    return rows if best is None else [best, *(row for row in rows if row.names != best.names)]


def in_words(names: Sequence[str], verdict: Verdict, labels: Labels) -> str:
    """Return the titles of causes that act together, such as "digging + grip of lugs"; for no causes, an empty text.

    A cause that is not an effect is a wrong value of a declared number, and is written as "another value of soil.k".
    """
    kinds = kinds_of(verdict)
    titles = ((name, display_name(labels.placed(name), kinds)) for name in names)
    return " + ".join(f"another value of {name}" if title == name else title for name, title in titles)


def numbers_of(row: CauseSet, name: str) -> tuple[Number, ...]:
    """Return the fitted numbers of the cause `name` in a set of causes; an empty tuple if the set was not fitted."""
    owner = name.partition("@")[0]
    return tuple(number for number in row.numbers if number.name == name or number.name.startswith(f"{owner}."))


def sizes_of(row: CauseSet, name: str) -> str:
    """Return the fitted numbers of the cause `name` with their 95 % intervals as text: "f_0 = 2.0 N [1.7, 2.3]".

    A single number with a unit is clear without its name: "1.2 mm [0.9, 1.5]". The text is empty if the set was not
    fitted.
    """
    numbers = numbers_of(row, name)
    if len(numbers) == 1 and (numbers[0].unit or numbers[0].name == name):
        return with_interval(numbers[0])
    return listing(f"{number.name.rpartition('.')[2]} = {with_interval(number)}" for number in numbers)


def by_outcome(scores: Sequence[ChannelScore], *outcomes: Outcome) -> list[ChannelScore]:
    """Return the channels whose held-out error changed with one of these outcomes, such as better. The largest change
    is first.

    Changes are compared in units of the channel's noise. A relative change smaller than MIN_MENTIONED is not returned,
    even if it exceeds the scatter; only the tables show it.
    """
    changed = [score for score in scores if score.worded.outcome in outcomes and abs(score.change) >= MIN_MENTIONED]
    return sorted(changed, key=lambda score: -score.times(abs(score.before - score.after)))


def worst(scores: Sequence[ChannelScore]) -> list[ChannelScore]:
    """Return the channels sorted by their held-out error in units of their noise, the largest error first.

    Channels that the model does not predict everywhere come before all others.
    """
    return sorted(scores, key=lambda score: (not score.worded.lost, -score.times(score.before)))


def cause_table(verdict: Verdict, labels: Labels) -> ReportTable | None:
    """Return the table of the first screen: the possible causes with size, probability and held-out error, and the base
    model in the last row. The result is None if no model was fitted.
    """
    if verdict.before is None:
        return None
    rows = in_order_of_interest(verdict)
    # The base model is the reference, also where it is not among the possible sets.
    if all(row.names for row in rows):
        nothing = verdict.beliefs.sets.get(frozenset(), 0.0) if verdict.beliefs is not None else math.nan
        before = {score.name: score.before for score in verdict.scores}
        rows.append(CauseSet((), nothing, (), before))
    rows.sort(key=lambda row: not row.names)
    # The held-out errors are those of the channels that the added causes improve most. If nothing is improved, they are
    # the errors of the channels with the largest errors, relative to their noise.
    better = by_outcome(verdict.scores, Outcome.BETTER) if verdict.named else []
    channels = (better or worst(verdict.scores))[:MAX_SHOWN_CHANNELS]
    cells = []
    for row in rows:
        # The row of the base model has no causes; it shows the numbers of the base model that the data contradict.
        sizes = [] if row.names else [f"{number.name} = {with_interval(number)}" for number in row.numbers]
        for name in row.names:
            # Only the sizes of causes are shown. A size has no declared value, so that its drift from it is NaN. The
            # other numbers only shape the law of the cause.
            numbers = tuple(number for number in numbers_of(row, name) if math.isnan(number.drift))
            text = sizes_of(row._replace(numbers=numbers), name)
            # If a set has several causes, each text begins with the title of its cause.
            sizes.append(f"{in_words((name,), verdict, labels)}: {text}" if text and len(row.names) > 1 else text)
        errors = [
            f"{labels.channel(score.name)} {brief(row.errors[score.name], score.unit)}"
            for score in channels
            if score.name in row.errors
        ]
        total = row.times_noise(verdict.scores)
        cells.append(
            (
                in_words(row.names, verdict, labels) or BASE_MODEL,
                "; ".join(filter(None, sizes)),
                f"{row.probability:.2f}" if math.isfinite(row.probability) else "",
                listing(errors),
                f"{two_digits(total)} times the noise" if math.isfinite(total) else "",
            )
        )
    heads = ("cause", "size, 95 % interval", "probability", "held-out error", "held-out error of all channels")
    looks = [CHOSEN * (bool(row.names) and row.names == verdict.named) for row in rows]
    return ReportTable(heads, tuple(map(TableRow, cells, looks)))
