"""What a reader of a drive verdict may claim, and what to be wary of: one sentence each."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.held_out import together
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.wording import Outcome
from rover_pin.experiments.drive_log.extra import extra_of
from rover_pin.report.drive_rows import at_bound
from rover_pin.report.drive_runs import Sides

FEW_RUNS = 4
"""Runs below which those left out say little."""
MISSED = 1.3
"""Misfit on runs left out from which more than the noise is left."""


def claims(verdict: Verdict, sides: Sides | None) -> list[str]:
    """Return what may be claimed, and what may not."""
    if sides is None or verdict.search is None:
        return ["Nothing may be claimed of the model: these data do not suffice to judge it."]
    tried = verdict.search.count
    return [_claim(verdict, tried), *_channels(verdict, sides)]


def _claim(verdict: Verdict, tried: int) -> str:
    names = " and ".join(verdict.named)
    if verdict.answer is Answer.NAMED:
        return (
            f"Of the {tried} candidates that were tried, {names} describes these runs; nothing else on the list "
            "does as well. That something outside of the list would not do the same cannot be claimed."
        )
    if verdict.answer is Answer.SET:
        return (
            f"{' or '.join(verdict.alike)} acts, or something like them outside of the {tried} candidates that were "
            "tried. Which one it is cannot be claimed from these runs."
        )
    if verdict.answer is Answer.NONE_NEEDED:
        return (
            f"None of the {tried} candidates that were tried is needed to describe these runs. That none acts cannot "
            "be claimed: the smallest sizes that would show are listed below."
        )
    return (
        f"Something acts that none of the {tried} candidates describes. Nothing was added, so the fitted numbers are "
        "the base model's and may have absorbed a part of it: do not use them as constants."
    )


def _channels(verdict: Verdict, sides: Sides) -> Iterator[str]:
    if not sides.added:
        return
    said = [score.worded.outcome for score in verdict.scores]
    better, worse = said.count(Outcome.BETTER), said.count(Outcome.WORSE)
    yield (
        f"On runs left out {better} of {len(said)} channels are predicted better and {worse} worse, beyond their "
        "scatter; of the others no change may be claimed."
    )


def cautions(verdict: Verdict, sides: Sides | None) -> list[str]:
    """Return what a reader should be wary of."""
    return [] if sides is None else list(_cautions(verdict, sides))


def _cautions(verdict: Verdict, sides: Sides) -> Iterator[str]:
    for one in verdict.drifted:
        yield f"{one.name} sits {one.drift:+.1f} SD from what was declared: it may have absorbed an effect"
    for parameter, u in zip(sides.after.parameters, sides.after.u, strict=True):
        if at_bound(parameter, float(u)):
            yield f"{parameter.name} lies at its bound: the form of the model is strained"
    misfit = together(verdict.runs)[1]
    if misfit > MISSED:
        yield f"runs left out are missed by {misfit:.1f} times the noise: more than noise is left"
    if len(sides.experiment.runs) < FEW_RUNS:
        yield f"{len(sides.experiment.runs)} runs are few: what holds on one left out may not hold on the next"
    yield from _free(verdict, sides)
    if sides.added:
        yield "runs were left out of the fits, not of the choice: the effect was chosen on all of them"


def _free(verdict: Verdict, sides: Sides) -> Iterator[str]:
    lost = [one.run for one in extra_of(verdict).free if not np.isfinite(one.after)]
    if lost:
        yield f"driven freely, the model does not come to the end of {', '.join(lost)}"
    further = [one.run for one in extra_of(verdict).free if sides.added and one.after > one.before]
    if further:
        yield f"driven freely, the model strays further than the base model in {', '.join(further)}"
