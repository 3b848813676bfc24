"""What a reader of a drive verdict should be wary of: one sentence each."""

from collections.abc import Iterator

import numpy as np

from rover_pin.discrepancy.held_out import together
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.fit import FEW
from rover_pin.experiments.drive_log.free_runs import FreeRun
from rover_pin.experiments.unlisted.residual import NOISE_LIKE
from rover_pin.simulation.model.implausible import implausible


def cautions(verdict: Verdict, free: tuple[FreeRun, ...]) -> tuple[str, ...]:
    """Return what a reader should be wary of, given how far free runs diverge."""
    return tuple(_cautions(verdict, free)) if verdict.after is not None else ()


def _cautions(verdict: Verdict, free: tuple[FreeRun, ...]) -> Iterator[str]:
    for number in verdict.drifted:
        yield f"{number.name} sits {number.away}: it may have absorbed an effect"
    for number in verdict.after.numbers if verdict.after else ():
        if number.at_bound:
            yield f"{number.name} lies at its bound: the form of the model is strained"
    if verdict.after:
        yield from implausible(verdict.after.fit.model)
    misfit = together(verdict.runs)[1]
    if misfit > NOISE_LIKE:
        yield f"runs left out are missed by {misfit:.1f} times the noise: more than noise is left"
    if len(verdict.runs) < FEW:
        yield f"{len(verdict.runs)} runs are few: what holds on one left out may not hold on the next"
    yield from _free(free, bool(verdict.named))


def _free(free: tuple[FreeRun, ...], added: bool) -> Iterator[str]:
    lost = [free_run.run for free_run in free if not np.isfinite(free_run.after)]
    if lost:
        yield f"driven freely, the model does not come to the end of {', '.join(lost)}"
    farther_runs = [free_run.run for free_run in free if added and free_run.after > free_run.before]
    if farther_runs:
        yield f"driven freely, the model diverges further than the base model in {', '.join(farther_runs)}"
