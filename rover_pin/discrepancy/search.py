"""The search for what a model lacks: calibrate, learn the noise, screen, refit, add, and look again."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from rover_pin.base.public import brief
from rover_pin.discrepancy.calibration import again, declared_start, is_bent
from rover_pin.discrepancy.candidate import Candidate
from rover_pin.discrepancy.exact_refits import Tried, as_published, exactly_refitted, paired, rank_refits
from rover_pin.discrepancy.refit import Progress, Refit, Threshold, indistinguishable_refits
from rover_pin.discrepancy.refit_candidates import refit
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
from rover_pin.estimation.experiment import Experiment
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.noise import COLOURED
from rover_pin.estimation.numbers import is_adequate
from rover_pin.estimation.random_effects.beyond_declared import beyond_declared
from rover_pin.estimation.random_effects.random_field import RandomField

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
        return tuple(step.indistinguishable[0] for step in self.rounds[:number] if step.indistinguishable)

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
        *firsts, last = [step.indistinguishable for step in self.rounds if step.indistinguishable] or [()]
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


def _with_residual_noise(
    base: Fit, candidate_signatures: Sequence[Signature], random_field: RandomField | None, least: np.ndarray
) -> Fit:
    """Return the fit with noise, and chance, as large as what nothing explains."""
    unexplained, absorbed = saturated(base, candidate_signatures, random_field)
    noisy = with_noise(base, unexplained, least, absorbed)
    return noisy if random_field is None else with_random_effects(noisy, candidate_signatures, random_field)


def search(base: Fit, tried: Sequence[Candidate], progress: Progress) -> Search:
    """Return what the calibrated model lacks of the candidates that are tried.

    Nothing is looked for where what is left is, over all channels, no more than the error of predictions.
    Where a fit is exact and its noise declared, what folds have by chance beyond it is learnt of what the search
    leaves, and the search made again in that noise.
    """
    candidate_signatures = _known(base, tried, progress)
    if base.task.experiment.noise() is None:
        experiment = base.task.experiment
        least, random_field = experiment.least_noise(base.model), experiment.random_field(base.model)
        if np.mean((base.rms / least) ** 2) <= 1.0:
            return Search(
                base, (Round(tuple(score(base, candidate_signatures)), ()),), tuple(candidate_signatures), random_field
            )
        for _ in range(LEARNT):
            base = again(_with_residual_noise(base, candidate_signatures, random_field, least))
        return _rounds(Search(base, (), tuple(candidate_signatures), random_field), tried, progress)
    result = _rounds(Search(base, (), tuple(candidate_signatures)), tried, progress)
    for _ in range(LEARNT if base.task.experiment.is_exact else 0):
        before, noise = result, beyond_declared(result.last, partial(_remaining_shifts, result, tried))
        if noise is None:
            break
        base = again(replace(base, task=replace(base.task, noise=noise)))
        result = _rounds(Search(base, (), tuple(_known(base, tried, progress))), tried, progress)
        if result.names == before.names:
            break
    return result


def _remaining_shifts(result: Search, tried: Sequence[Candidate]) -> list[np.ndarray]:
    return [
        signature.shift
        for signature in _remaining_signatures(result, tried)
        if not is_lost(result.last, signature.shift)
    ]


def _known(base: Fit, tried: Sequence[Candidate], progress: Progress) -> list[Signature]:
    progress(f"score test of {len(tried)} candidates")
    return signatures(base, tried)


def _rounds(result: Search, tried: Sequence[Candidate], progress: Progress) -> Search:
    """Return the search with its rounds, until one finds nothing."""
    base = result.base
    while len(result.rounds) < _most(base.task.experiment) and len(result.best_refits) == len(result.rounds):
        result = replace(result, rounds=(*result.rounds, _round(result, tried, progress)))
    if not result.best_refits and _bears_pairs(base.task.experiment) and not is_adequate(base):
        result = replace(result, rounds=(*result.rounds, _pairs(result, len(tried), progress)))
    return result


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


def _has_enough_folds(result: Search, tried: Tried) -> bool:
    """Return whether there are levels for all effects of what is tried: for one alone there always are."""
    instead, candidate, _ = tried
    path = (*(instead or result.added), candidate)
    return len(path) <= _most(result.base.task.experiment, path)


def _bears_pairs(experiment: Experiment) -> bool:
    """Return whether two effects may be tried together where no single one holds: an exact fit, levels for both."""
    return experiment.is_exact and len(experiment.folds) >= 2 * FOLDS_EACH


def _round(result: Search, tried: Sequence[Candidate], progress: Progress) -> Round:
    current_fit, candidate_signatures = result.last, _remaining_signatures(result, tried)
    scored = tuple(score(current_fit, candidate_signatures))
    threshold = threshold_after(result.rounds, len(tried), current_fit.task.noise.inflation)
    if current_fit.task.experiment.is_exact:
        eligible = scored if len(result.added) < _most(current_fit.task.experiment, result.added) else ()
        refits = exactly_refitted(
            current_fit, eligible, threshold, progress, _second(result, tried, threshold, progress)
        )
        return Round(
            scored,
            rank_refits(current_fit, [attempt for attempt in refits if _has_enough_folds(result, attempt)], threshold),
        )
    declared = None
    if is_bent(current_fit):
        progress("the numbers had to leave what is known beforehand: scoring every candidate there too")
        declared = declared_start(current_fit, [signature.candidate for signature in candidate_signatures])
    return Round(scored, refit(current_fit, scored, threshold, progress, declared))


def _second(result: Search, tried: Sequence[Candidate], threshold: Threshold, progress: Progress) -> list[Tried] | None:
    """Return pairs for the second round, where the first leaves more than the noise; None in the first."""
    if len(result.rounds) == 1 and not is_adequate(result.last):
        pairs = paired(result.base, result.rounds[0].refits, result.best_refits[0], progress)
        return [*pairs, *_after_plain_laws(result, tried, threshold, progress)]
    return [] if result.rounds else None


def _after_plain_laws(
    result: Search, tried: Sequence[Candidate], threshold: Threshold, progress: Progress
) -> list[Tried]:
    """Return second steps from laws as published, where what was found best has its shapes freed and imitates two.

    Alone the second of two may gain nothing, so that it is not among the leaders of which pairs are made.
    """
    best = result.best_refits[0].candidate
    if not best.free_shapes:
        return []
    others = ((single.candidate, single.fit) for single in result.rounds[0].refits if not single.candidate.free_shapes)
    steps: list[Tried] = []
    for first, current_fit in (*as_published(result.base, best), *itertools.islice(others, 1)):
        candidate_signatures = signatures(
            current_fit, [candidate for candidate in tried if candidate.kind != first.kind]
        )
        after = exactly_refitted(current_fit, score(current_fit, candidate_signatures), threshold, progress, [])
        steps += [((first,), candidate, fitted) for _, candidate, fitted in after]
    return steps


def _remaining_signatures(result: Search, tried: Sequence[Candidate]) -> Sequence[Signature]:
    """Return the signatures of what has not been added; where a fit is exact, on the model with what has."""
    added = {candidate.kind for candidate in result.added}
    if added and result.base.task.experiment.is_exact:
        return signatures(result.last, [candidate for candidate in tried if candidate.kind not in added])
    return [signature for signature in result.signatures if signature.candidate.kind not in added]


def _pairs(result: Search, count: int, progress: Progress) -> Round:
    """Return the round of pairs where no single candidate was accepted: each pays for both."""
    singles = result.rounds[0].refits
    first = singles[0].threshold / singles[0].unit if singles else 0.0
    threshold = threshold_after((), count, result.base.task.noise.inflation)
    return Round((), rank_refits(result.base, paired(result.base, singles, None, progress), threshold, first))


def threshold_after(before: Sequence[Round], count: int, inflation: float = COLOURED) -> Threshold:
    """Return what each of `count` candidates must gain once these rounds have added theirs."""
    taken = sum(best_refit.gain for step in before for best_refit in step.indistinguishable[:1])
    return partial(candidate_threshold, count=count, taken=taken, inflation=inflation)
