"""Additional results of a verdict on a drive log: errors of free simulations, the remaining residual, and cautions.

In a free simulation the rover drives from its start with the logged commands, without the corrections to the logged
place that a replay gets. Its error therefore grows with the distance.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from rover_pin.discrepancy.held_out_errors import together
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.fit import MIN_RUNS
from rover_pin.estimation.wording import FLOOR_RATIO
from rover_pin.experiments.drive_log.experiment import DriveExperiment
from rover_pin.experiments.drive_log.features import PATH
from rover_pin.experiments.drive_log.ground_variability import GroundVariability
from rover_pin.experiments.unlisted.residual import DriveResidual
from rover_pin.simulation.model.model import Model, implausible


class FreeRun(NamedTuple):
    """Errors of the free simulations of one run: with the base model, and with the model that has the added effects.

    In a free simulation the rover drives from its start with the logged commands, without corrections to the logged
    place.
    """

    run: str
    distance: float
    """distance that the rover drove in the logged run [m]"""
    before: float
    """RMS distance of the simulated place from the logged place with the base model [m]; NaN if the simulation did not
    start"""
    after: float
    """RMS distance of the simulated place from the logged place with the added effects [m]; NaN if the simulation did
    not start"""


def free_runs(experiment: DriveExperiment, before: Model, after: Model) -> tuple[FreeRun, ...]:
    """Simulate all runs of a log freely, with the base model and with the added effects, and return the errors of each
    run.

    The result is empty if the log has no place, or if its place is wheel odometry.

    Parameters
    ----------
    experiment : DriveExperiment
        The runs of the log as an experiment.
    before, after : Model
        The base model, and the model with the added effects.
    """
    # Without a measured place there is nothing to compare the simulated place with.
    if PATH not in experiment.channels:
        return ()
    errors: list[list[float]] = []
    for model in (before, after):
        errors.append([])
        for run, replay in zip(experiment.runs, experiment.free.replays(model), strict=True):
            # A replay without channels did not start, for example because the rover does not settle.
            if "body_x" not in replay.channels:
                errors[-1].append(float("nan"))
                continue
            x, y = (replay.channels[f"body_{axis}"] - run.commands.place[:, i] for i, axis in enumerate("xy"))
            errors[-1].append(float(np.sqrt(np.nanmean(np.hypot(x, y) ** 2))))
    free = []
    for run, error_before, error_after in zip(experiment.runs, *errors, strict=True):
        # The driven distance is summed over steps of a second, so that the tracker's noise does not add up.
        steps = run.commands.place[:: max(1, round(1.0 / run.commands.period)), :2]
        distance = float(np.nansum(np.hypot(*np.diff(steps, axis=0).T)))
        free.append(FreeRun(run.name, distance, error_before, error_after))
    return tuple(free)


def distances_of(free: tuple[FreeRun, ...]) -> tuple[float, float]:
    """Return the RMS distance of all free simulations from the logged place [m], as (with base model, with added
    effects).

    In a free simulation the rover drives with the logged commands and without corrections to the logged place. Runs
    whose distance is NaN do not count. If no run remains, the result is NaN.
    """
    rows = np.array([(free_run.before, free_run.after) for free_run in free])
    before, after = (
        float(np.sqrt(np.nanmean(side**2))) if np.isfinite(side).any() else float("nan") for side in rows.T
    )
    return before, after


class DriveExtra(NamedTuple):
    """Additional results of a verdict on a drive log: errors of free simulations, remaining residual, ground
    variability.
    """

    free: tuple[FreeRun, ...] = ()
    """errors of the free simulations of each run"""
    residual: DriveResidual | None = None
    """description of the residual that remains after the last model was fitted"""
    ground: GroundVariability | None = None
    """variability of the ground, or None if the fit has not learnt one"""

    def lines(self, added: bool) -> list[str]:
        """Return the additional results as lines of text for the summary of a verdict. The argument `added` is not
        used.
        """
        lines = []
        if self.free:
            # Without added effects, both distances are equal and only one is printed.
            before, after = distances_of(self.free)
            change = "" if before == after else f" -> {1e3 * after:.1f} mm"
            text = f"RMS distance from the logged place {1e3 * before:.1f} mm{change}"
            lines.append(f"free run: {text} over {len(self.free)} runs")
        lines += self.ground.lines if self.ground else []
        return [*lines, f"left: {self.residual.description}"] if self.residual else lines

    def as_dict(self) -> dict[str, Any]:
        """Return the additional results as numbers, texts and lists, for verdict.json."""
        return {
            "free_runs": [run._asdict() for run in self.free],
            "remainder": self.residual.description if self.residual else "",
            "ground": self.ground.as_dict() if self.ground else None,
        }


def extra_of(verdict: Verdict) -> DriveExtra:
    """Return the additional results of a verdict on a drive log; an empty DriveExtra if the log was insufficient for an
    answer.
    """
    return verdict.extra if isinstance(verdict.extra, DriveExtra) else DriveExtra()


def cautions(verdict: Verdict, free: tuple[FreeRun, ...]) -> Iterator[str]:
    """Yield one sentence for each reason to distrust a verdict on a drive log.

    Reasons are implausible fitted values, a large held-out error, few runs, and free simulations (`free`) that break
    off or diverge. If nothing could be fitted, nothing is yielded.
    """
    if verdict.after is None:
        return
    for number in verdict.drifted:
        yield f"{number.name} lies {number.away}: it may have absorbed an effect"
    for number in verdict.after.numbers:
        if number.at_bound:
            yield f"{number.name} lies at its bound: the form of the model may be wrong"
    yield from implausible(verdict.after.fit.model)
    # After the fitted numbers follow the size of the residual, the number of runs, and the free simulations.
    misfit = together(verdict.runs)[1]
    if misfit > FLOOR_RATIO:
        yield f"the residual of held-out runs is {misfit:.1f} times the noise: the model does not explain all of it"
    if len(verdict.runs) < MIN_RUNS:
        yield f"there are only {len(verdict.runs)} runs: the held-out errors may not hold for the next run"
    # A free simulation gets no corrections from the log, so that its error grows where the held-out error stays small.
    incomplete = [free_run.run for free_run in free if not np.isfinite(free_run.after)]
    if incomplete:
        yield f"driven freely, the model does not reach the end of {', '.join(incomplete)}"
    farther = [free_run.run for free_run in free if verdict.named and free_run.after > free_run.before]
    if farther:
        yield f"driven freely, the model diverges further than the base model in {', '.join(farther)}"
