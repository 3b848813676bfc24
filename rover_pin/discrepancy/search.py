"""The search for what a model lacks: calibrate, learn the noise, screen, refit, add, and look again."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from rover_pin.discrepancy.anchor import anchor, is_bent
from rover_pin.discrepancy.candidate import Candidate
from rover_pin.discrepancy.compare import refit
from rover_pin.discrepancy.exact_refits import Tried, as_published, exactly_refitted, judged, paired
from rover_pin.discrepancy.refit import Fee, Progress, Refit, alike
from rover_pin.discrepancy.screen import (
    Scored,
    Signature,
    fee_of,
    is_lost,
    saturated,
    score,
    signatures,
    with_chance,
    with_noise,
)
from rover_pin.errors import OptimisationError
from rover_pin.estimation.by_chance.beyond_declared import beyond_declared
from rover_pin.estimation.by_chance.random_field import RandomField
from rover_pin.estimation.exact import scattered
from rover_pin.estimation.experiment import Experiment, residual
from rover_pin.estimation.fit import Fit, best_of, fit
from rover_pin.estimation.noise import COLOURED, first_noise
from rover_pin.estimation.numbers import is_adequate
from rover_pin.estimation.parameter import Parameter
from rover_pin.estimation.task import Task
from rover_pin.public import brief

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
    def alike(self) -> tuple[Refit, ...]:
        """The candidates that the data cannot tell from the best; empty where none is accepted."""
        return alike(self.refits)


@brief
@dataclass(frozen=True, eq=False)
class Search:
    """The calibrated base model, and one round for each effect that was added, then the last that found none."""

    base: Fit
    rounds: tuple[Round, ...]
    known: tuple[Signature, ...] = field(repr=False)
    "how each candidate moves the base model"
    chance: RandomField | None = field(default=None, repr=False)
    "what of the experiment differs from fold to fold by chance"

    @property
    def found(self) -> tuple[Refit, ...]:
        """The best of every round that found something, in turn."""
        return self.before(len(self.rounds))

    def before(self, number: int) -> tuple[Refit, ...]:
        """The best of every round before this one that found something."""
        return tuple(each.alike[0] for each in self.rounds[:number] if each.alike)

    @property
    def added(self) -> tuple[Candidate, ...]:
        """What was added, in turn."""
        path: tuple[Candidate, ...] = ()
        for one in self.found:
            path = (*(one.instead or path), one.candidate)
        return path

    @property
    def names(self) -> str:
        """What was added, in words; empty where nothing was."""
        return " + ".join(one.name for one in self.added)

    @property
    def alike(self) -> tuple[str, ...]:
        """What was added, then what cannot be distinguished from it; empty where nothing was added."""
        *firsts, last = [each.alike for each in self.rounds if each.alike] or [()]
        before = [one.name for one in replace(self, rounds=self.rounds[: len(firsts)]).added]
        ways = [[*([c.name for c in one.instead] or before), one.candidate.name] for one in last]
        if not self.base.task.experiment.is_exact:  # else every round but the last was looked at again by pairs
            rest = self.names.split(" + ")
            ways += [[*rest[:at], other.name, *rest[at + 1 :]] for at, each in enumerate(firsts) for other in each[1:]]
        return tuple(" + ".join(way) for way in ways)

    @property
    def last(self) -> Fit:
        """The fit with everything that was added."""
        return self.found[-1].fit if self.found else self.base

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
        centre = np.array([one.u(experiment.value(model, one.name)) for one in numbers])
        starts = np.array(scattered(numbers, centre, STARTS, seed))
        for times in WIDER:
            found = best_of(Task(experiment, declared), model, numbers, [*(centre + times * (starts - centre))])
            if found is not None:
                return found
        lost = experiment.unpredicted(model)
        why = f"{lost}; start from a model that does, or mend that run" if lost else "free fewer numbers"
        said = f"{experiment.name}: no start of the fit of the base model converged: {why}."
        raise OptimisationError(said, status="")
    if declared is not None:
        return again(fit(Task(experiment, declared), model, numbers))
    left, least = residual(experiment.observed, experiment.predict([model])[0]), experiment.least_noise(model)
    base = fit(Task(experiment, first_noise(left, least)), model, numbers)
    return again(with_noise(base, base.residual, least))


def again(base: Fit) -> Fit:
    """Return the fit taken up where it was, as after a change of the noise."""
    return fit(base.task, base.model, base.parameters, base.u, base.slopes)


def _with_what_is_left(base: Fit, known: Sequence[Signature], chance: RandomField | None, least: np.ndarray) -> Fit:
    """Return the fit with noise, and chance, as large as what nothing explains."""
    left, absorbed = saturated(base, known, chance)
    noisy = with_noise(base, left, least, absorbed)
    return noisy if chance is None else with_chance(noisy, known, chance)


def search(base: Fit, tried: Sequence[Candidate], progress: Progress) -> Search:
    """Return what the calibrated model lacks of the candidates that are tried.

    Nothing is looked for in what is left where that is no more than the least noise, the error of predictions.
    Where a fit is exact and its noise declared, what folds have by chance beyond it is learnt of what the search
    leaves, and the search made again in that noise.
    """
    known = _known(base, tried, progress)
    if base.task.experiment.noise() is None:
        experiment = base.task.experiment
        least, chance = experiment.least_noise(base.model), experiment.random_field(base.model)
        if np.all(base.rms <= least):
            return Search(base, (Round(tuple(score(base, known)), ()),), tuple(known), chance)
        for _ in range(LEARNT):
            base = again(_with_what_is_left(base, known, chance, least))
        return _rounds(Search(base, (), tuple(known), chance), tried, progress)
    found = _rounds(Search(base, (), tuple(known)), tried, progress)
    for _ in range(LEARNT if base.task.experiment.is_exact else 0):
        before, noise = found, beyond_declared(found.last, partial(_moved, found, tried))
        if noise is None:
            break
        base = again(replace(base, task=replace(base.task, noise=noise)))
        found = _rounds(Search(base, (), tuple(_known(base, tried, progress))), tried, progress)
        if found.names == before.names:
            break
    return found


def _moved(found: Search, tried: Sequence[Candidate]) -> list[np.ndarray]:
    return [each.moved for each in _left(found, tried) if not is_lost(found.last, each.moved)]


def _known(base: Fit, tried: Sequence[Candidate], progress: Progress) -> list[Signature]:
    progress(f"score test of {len(tried)} candidates")
    return signatures(base, tried)


def _rounds(found: Search, tried: Sequence[Candidate], progress: Progress) -> Search:
    """Return the search with its rounds, until one finds nothing."""
    base = found.base
    while len(found.rounds) < _most(base.task.experiment) and len(found.found) == len(found.rounds):
        found = replace(found, rounds=(*found.rounds, _round(found, tried, progress)))
    if not found.found and _bears_pairs(base.task.experiment) and not is_adequate(base):
        found = replace(found, rounds=(*found.rounds, _pairs(found, len(tried), progress)))
    return found


def attempted(here: Fit, tried: Sequence[Candidate], progress: Progress) -> tuple[Refit, ...]:
    """Return a few candidates of any kind refitted on a fit as one round would, the best first."""
    return _round(Search(here, (), tuple(signatures(here, tried))), tried, progress).refits


def _most(experiment: Experiment, path: Sequence[Candidate] = ()) -> int:
    """Return how many rounds there are at most; where a fit is exact, as many effects as there are levels for.

    The freed shapes of a path of effects take levels.
    """
    if not experiment.is_exact:
        return MOST + 1
    freed = sum(len(one.freed) for one in path)
    levels = len(experiment.folds) - freed
    return min(max(levels // FOLDS_EACH, 2 if levels >= FOLDS_OF_TWO and not freed else 1), MOST)


def _borne(found: Search, tried: Tried) -> bool:
    """Return whether there are levels for all effects of what is tried: for one alone there always are."""
    instead, one, _ = tried
    path = (*(instead or found.added), one)
    return len(path) <= _most(found.base.task.experiment, path)


def _bears_pairs(experiment: Experiment) -> bool:
    """Return whether two effects may be tried together where no single one holds: an exact fit, levels for both."""
    return experiment.is_exact and len(experiment.folds) >= 2 * FOLDS_EACH


def _round(found: Search, tried: Sequence[Candidate], progress: Progress) -> Round:
    here, known = found.last, _left(found, tried)
    scored = tuple(score(here, known))
    fee = fee_after(found.rounds, len(tried), here.task.noise.inflation)
    if here.task.experiment.is_exact:
        further = scored if len(found.added) < _most(here.task.experiment, found.added) else ()
        refits = exactly_refitted(here, further, fee, progress, _second(found, tried, fee, progress))
        return Round(scored, judged(here, [one for one in refits if _borne(found, one)], fee))
    declared = None
    if is_bent(here):
        progress("the numbers had to leave what is known beforehand: scoring every candidate there too")
        declared = anchor(here, [each.candidate for each in known])
    return Round(scored, refit(here, scored, fee, progress, declared))


def _second(found: Search, tried: Sequence[Candidate], fee: Fee, progress: Progress) -> list[Tried] | None:
    """Return pairs for the second round, where the first leaves more than the noise; None in the first."""
    if len(found.rounds) == 1 and not is_adequate(found.last):
        pairs = paired(found.base, found.rounds[0].refits, found.found[0], progress)
        return [*pairs, *_after_plain_laws(found, tried, fee, progress)]
    return [] if found.rounds else None


def _after_plain_laws(found: Search, tried: Sequence[Candidate], fee: Fee, progress: Progress) -> list[Tried]:
    """Return second steps from laws as published, where what was found best has its shapes freed and imitates two.

    Alone the second of two may gain nothing, so that it is not among the leaders of which pairs are made.
    """
    best = found.found[0].candidate
    if not best.freed:
        return []
    others = ((one.candidate, one.fit) for one in found.rounds[0].refits if not one.candidate.freed)
    steps: list[Tried] = []
    for first, here in (*as_published(found.base, best), *itertools.islice(others, 1)):
        known = signatures(here, [one for one in tried if one.kind != first.kind])
        after = exactly_refitted(here, score(here, known), fee, progress, [])
        steps += [((first,), one, fitted) for _, one, fitted in after]
    return steps


def _left(found: Search, tried: Sequence[Candidate]) -> Sequence[Signature]:
    """Return the signatures of what has not been added; where a fit is exact, on the model with what has."""
    added = {one.kind for one in found.added}
    if added and found.base.task.experiment.is_exact:
        return signatures(found.last, [one for one in tried if one.kind not in added])
    return [each for each in found.known if each.candidate.kind not in added]


def _pairs(found: Search, count: int, progress: Progress) -> Round:
    """Return the round of pairs where no single candidate was accepted: each pays for both."""
    singles = found.rounds[0].refits
    first = singles[0].fee / singles[0].unit if singles else 0.0
    fee = fee_after((), count, found.base.task.noise.inflation)
    return Round((), judged(found.base, paired(found.base, singles, None, progress), fee, first))


def fee_after(before: Sequence[Round], count: int, inflation: float = COLOURED) -> Fee:
    """Return what each of `count` candidates must gain once these rounds have added theirs."""
    taken = sum(one.gain for each in before for one in each.alike[:1])
    return partial(fee_of, count=count, taken=taken, inflation=inflation)
