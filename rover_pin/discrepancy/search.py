"""The search for what a model lacks: calibrate, learn the noise, screen, refit, add, and look again."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from rover_pin.base.errors import OptimisationError
from rover_pin.base.public import brief
from rover_pin.discrepancy.candidate import Candidate
from rover_pin.discrepancy.compare import refit
from rover_pin.discrepancy.exact_refits import Tried, as_published, exactly_refitted, paired, rank_refits
from rover_pin.discrepancy.refit import Progress, Refit, Threshold, indistinguishable_refits
from rover_pin.discrepancy.restart import declared_start, is_bent
from rover_pin.discrepancy.screen import (
    Scored,
    Signature,
    candidate_threshold,
    is_lost,
    saturated,
    score,
    signatures,
    with_noise,
    with_random_effects,
)
from rover_pin.estimation.exact import scattered
from rover_pin.estimation.experiment import Experiment, residual
from rover_pin.estimation.fit import Fit, best_of, fit
from rover_pin.estimation.noise import COLOURED, first_noise
from rover_pin.estimation.numbers import is_adequate
from rover_pin.estimation.parameter import Parameter
from rover_pin.estimation.random_effects.beyond_declared import beyond_declared
from rover_pin.estimation.random_effects.random_field import RandomField
from rover_pin.estimation.task import Task

MOST = 3
"""Effects that are added at most."""
FOLDS_EACH = 4
"""Levels that each effect needs where a fit is exact: on nine levels three laws imitated a drag that is on no list; and
each of a pair that is tried where no single effect holds. A freed shape takes the level that tells it."""
FOLDS_OF_TWO = 5
"""Levels from which a second effect is looked for once one was found whose law holds as published: with its shapes
freed, on seven levels, one imitated that drag together with another."""
LEARNT = 2
"""How often noise and base are fitted in turn."""
STARTS, WIDER = 6, (1.0, 2.0, 4.0)
"""Starts of the base model's fit where it is exact, and how many times as far they lie where none of them ends."""


@brief
@dataclass(frozen=True, eq=False)
class Round:
    """One look for something missing: all candidates scored, the plausible ones refitted."""

    scored: tuple[Scored, ...] = field(repr=False)
    refits: tuple[Refit, ...]

    @property
    def indistinguishable(self) -> tuple[Refit, ...]:
        """The candidates that the data cannot tell from the best; empty where none is accepted."""
        return indistinguishable_refits(self.refits)


@brief
@dataclass(frozen=True, eq=False)
class Search:
    """The calibrated base model, and one round for each effect that was added, then the last that found none."""

    base: Fit
    rounds: tuple[Round, ...]
    signatures: tuple[Signature, ...] = field(repr=False)
    "how each candidate moves the base model"
    random_field: RandomField | None = field(default=None, repr=False)
    "what of the experiment differs from fold to fold by chance"

    @property
    def best_refits(self) -> tuple[Refit, ...]:
        """The best of every round that found something, in turn."""
        return self.before(len(self.rounds))

    def before(self, number: int) -> tuple[Refit, ...]:
        """The best of every round before this one that found something."""
        return tuple(
            search_round.indistinguishable[0] for search_round in self.rounds[:number] if search_round.indistinguishable
        )

    @property
    def added(self) -> tuple[Candidate, ...]:
        """What was added, in turn."""
        path: tuple[Candidate, ...] = ()
        for best_refit in self.best_refits:
            path = (*(best_refit.instead or path), best_refit.candidate)
        return path

    @property
    def names(self) -> str:
        """What was added, in words; empty where nothing was."""
        return " + ".join(candidate.name for candidate in self.added)

    @property
    def indistinguishable(self) -> tuple[str, ...]:
        """What was added, then what cannot be distinguished from it; empty where nothing was added."""
        *firsts, last = [
            search_round.indistinguishable for search_round in self.rounds if search_round.indistinguishable
        ] or [()]
        before = [candidate.name for candidate in replace(self, rounds=self.rounds[: len(firsts)]).added]
        ways = [[*([c.name for c in tied_refit.instead] or before), tied_refit.candidate.name] for tied_refit in last]
        if not self.base.task.experiment.is_exact:  # else every round but the last was looked at again by pairs
            added_names = self.names.split(" + ")
            ways += [
                [*added_names[:at], tied_refit.name, *added_names[at + 1 :]]
                for at, tied_refits in enumerate(firsts)
                for tied_refit in tied_refits[1:]
            ]
        return tuple(" + ".join(way) for way in ways)

    @property
    def last(self) -> Fit:
        """The fit with everything that was added."""
        return self.best_refits[-1].fit if self.best_refits else self.base

    @property
    def count(self) -> int:
        """How many candidates were tried."""
        return len(self.rounds[0].scored) if self.rounds else 0


def calibrated(experiment: Experiment, model: Any, numbers: Sequence[Parameter], seed: int = 0) -> Fit:
    """Return the model with its uncertain numbers fitted, the noise as declared, or taken as large as what is left.

    Raises
    ------
    OptimisationError
        An exact experiment, and none of several starts ends.
    """
    declared = experiment.noise()
    if declared is not None and experiment.is_exact:
        centre = np.array([parameter.u(experiment.value(model, parameter.name)) for parameter in numbers])
        starts = np.array(scattered(numbers, centre, STARTS, seed))
        for times in WIDER:
            best_fit = best_of(Task(experiment, declared), model, numbers, [*(centre + times * (starts - centre))])
            if best_fit is not None:
                return best_fit
        lost = experiment.unpredicted(model)
        why = f"{lost}; start from a model that does, or mend that run" if lost else "free fewer numbers"
        message = f"{experiment.name}: no start of the fit of the base model converged: {why}."
        raise OptimisationError(message, status="")
    if declared is not None:
        return again(fit(Task(experiment, declared), model, numbers))
    initial_residual, least = (
        residual(experiment.observed, experiment.predict([model])[0]),
        experiment.least_noise(model),
    )
    base = fit(Task(experiment, first_noise(initial_residual, least)), model, numbers)
    return again(with_noise(base, base.residual, least))


def again(base: Fit) -> Fit:
    """Return the fit taken up where it was, as after a change of the noise."""
    return fit(base.task, base.model, base.parameters, base.u, base.slopes)


def _with_residual_noise(
    base: Fit, candidate_signatures: Sequence[Signature], random_field: RandomField | None, least: np.ndarray
) -> Fit:
    """Return the fit with noise, and chance, as large as what nothing explains."""
    unexplained, absorbed = saturated(base, candidate_signatures, random_field)
    noisy = with_noise(base, unexplained, least, absorbed)
    return noisy if random_field is None else with_random_effects(noisy, candidate_signatures, random_field)


def search(base: Fit, tried: Sequence[Candidate], progress: Progress) -> Search:
    """Return what the calibrated model lacks of the candidates that are tried.

    Nothing is looked for in what is left where that is no more than the least noise, the error of predictions.
    Where a fit is exact and its noise declared, what folds have by chance beyond it is learnt of what the search
    leaves, and the search made again in that noise.
    """
    candidate_signatures = _known(base, tried, progress)
    if base.task.experiment.noise() is None:
        experiment = base.task.experiment
        least, random_field = experiment.least_noise(base.model), experiment.random_field(base.model)
        if np.all(base.rms <= least):
            return Search(
                base, (Round(tuple(score(base, candidate_signatures)), ()),), tuple(candidate_signatures), random_field
            )
        for _ in range(LEARNT):
            base = again(_with_residual_noise(base, candidate_signatures, random_field, least))
        return _rounds(Search(base, (), tuple(candidate_signatures), random_field), tried, progress)
    search_result = _rounds(Search(base, (), tuple(candidate_signatures)), tried, progress)
    for _ in range(LEARNT if base.task.experiment.is_exact else 0):
        before, noise = (
            search_result,
            beyond_declared(search_result.last, partial(_remaining_shifts, search_result, tried)),
        )
        if noise is None:
            break
        base = again(replace(base, task=replace(base.task, noise=noise)))
        search_result = _rounds(Search(base, (), tuple(_known(base, tried, progress))), tried, progress)
        if search_result.names == before.names:
            break
    return search_result


def _remaining_shifts(search_result: Search, tried: Sequence[Candidate]) -> list[np.ndarray]:
    return [
        signature.shift
        for signature in _remaining_signatures(search_result, tried)
        if not is_lost(search_result.last, signature.shift)
    ]


def _known(base: Fit, tried: Sequence[Candidate], progress: Progress) -> list[Signature]:
    progress(f"score test of {len(tried)} candidates")
    return signatures(base, tried)


def _rounds(search_result: Search, tried: Sequence[Candidate], progress: Progress) -> Search:
    """Return the search with its rounds, until one finds nothing."""
    base = search_result.base
    while len(search_result.rounds) < _most(base.task.experiment) and len(search_result.best_refits) == len(
        search_result.rounds
    ):
        search_result = replace(search_result, rounds=(*search_result.rounds, _round(search_result, tried, progress)))
    if not search_result.best_refits and _bears_pairs(base.task.experiment) and not is_adequate(base):
        search_result = replace(
            search_result, rounds=(*search_result.rounds, _pairs(search_result, len(tried), progress))
        )
    return search_result


def attempted(current_fit: Fit, tried: Sequence[Candidate], progress: Progress) -> tuple[Refit, ...]:
    """Return a few candidates of any kind refitted on a fit as one round would, the best first."""
    return _round(Search(current_fit, (), tuple(signatures(current_fit, tried))), tried, progress).refits


def _most(experiment: Experiment, path: Sequence[Candidate] = ()) -> int:
    """Return how many rounds there are at most; where a fit is exact, as many effects as there are levels for.

    The freed shapes of a path of effects take levels.
    """
    if not experiment.is_exact:
        return MOST + 1
    free_shape_count = sum(len(candidate.free_shapes) for candidate in path)
    levels = len(experiment.folds) - free_shape_count
    return min(max(levels // FOLDS_EACH, 2 if levels >= FOLDS_OF_TWO and not free_shape_count else 1), MOST)


def _has_enough_folds(search_result: Search, tried: Tried) -> bool:
    """Return whether there are levels for all effects of what is tried: for one alone there always are."""
    instead, candidate, _ = tried
    path = (*(instead or search_result.added), candidate)
    return len(path) <= _most(search_result.base.task.experiment, path)


def _bears_pairs(experiment: Experiment) -> bool:
    """Return whether two effects may be tried together where no single one holds: an exact fit, levels for both."""
    return experiment.is_exact and len(experiment.folds) >= 2 * FOLDS_EACH


def _round(search_result: Search, tried: Sequence[Candidate], progress: Progress) -> Round:
    current_fit, candidate_signatures = search_result.last, _remaining_signatures(search_result, tried)
    scored = tuple(score(current_fit, candidate_signatures))
    threshold = threshold_after(search_result.rounds, len(tried), current_fit.task.noise.inflation)
    if current_fit.task.experiment.is_exact:
        eligible = scored if len(search_result.added) < _most(current_fit.task.experiment, search_result.added) else ()
        refits = exactly_refitted(
            current_fit, eligible, threshold, progress, _second(search_result, tried, threshold, progress)
        )
        return Round(
            scored,
            rank_refits(
                current_fit, [attempt for attempt in refits if _has_enough_folds(search_result, attempt)], threshold
            ),
        )
    declared = None
    if is_bent(current_fit):
        progress("the numbers had to leave what is known beforehand: scoring every candidate there too")
        declared = declared_start(current_fit, [signature.candidate for signature in candidate_signatures])
    return Round(scored, refit(current_fit, scored, threshold, progress, declared))


def _second(
    search_result: Search, tried: Sequence[Candidate], threshold: Threshold, progress: Progress
) -> list[Tried] | None:
    """Return pairs for the second round, where the first leaves more than the noise; None in the first."""
    if len(search_result.rounds) == 1 and not is_adequate(search_result.last):
        pairs = paired(search_result.base, search_result.rounds[0].refits, search_result.best_refits[0], progress)
        return [*pairs, *_after_plain_laws(search_result, tried, threshold, progress)]
    return [] if search_result.rounds else None


def _after_plain_laws(
    search_result: Search, tried: Sequence[Candidate], threshold: Threshold, progress: Progress
) -> list[Tried]:
    """Return second steps from laws as published, where what was found best has its shapes freed and imitates two.

    Alone the second of two may gain nothing, so that it is not among the leaders of which pairs are made.
    """
    best = search_result.best_refits[0].candidate
    if not best.free_shapes:
        return []
    others = (
        (single.candidate, single.fit) for single in search_result.rounds[0].refits if not single.candidate.free_shapes
    )
    steps: list[Tried] = []
    for first, current_fit in (*as_published(search_result.base, best), *itertools.islice(others, 1)):
        candidate_signatures = signatures(
            current_fit, [candidate for candidate in tried if candidate.kind != first.kind]
        )
        after = exactly_refitted(current_fit, score(current_fit, candidate_signatures), threshold, progress, [])
        steps += [((first,), candidate, fitted) for _, candidate, fitted in after]
    return steps


def _remaining_signatures(search_result: Search, tried: Sequence[Candidate]) -> Sequence[Signature]:
    """Return the signatures of what has not been added; where a fit is exact, on the model with what has."""
    added = {candidate.kind for candidate in search_result.added}
    if added and search_result.base.task.experiment.is_exact:
        return signatures(search_result.last, [candidate for candidate in tried if candidate.kind not in added])
    return [signature for signature in search_result.signatures if signature.candidate.kind not in added]


def _pairs(search_result: Search, count: int, progress: Progress) -> Round:
    """Return the round of pairs where no single candidate was accepted: each pays for both."""
    singles = search_result.rounds[0].refits
    first = singles[0].threshold / singles[0].unit if singles else 0.0
    threshold = threshold_after((), count, search_result.base.task.noise.inflation)
    return Round(
        (), rank_refits(search_result.base, paired(search_result.base, singles, None, progress), threshold, first)
    )


def threshold_after(before: Sequence[Round], count: int, inflation: float = COLOURED) -> Threshold:
    """Return what each of `count` candidates must gain once these rounds have added theirs."""
    taken = sum(best_refit.gain for search_round in before for best_refit in search_round.indistinguishable[:1])
    return partial(candidate_threshold, count=count, taken=taken, inflation=inflation)
