"""Candidates refitted with every uncertain number free, and compared: penalised gain, and runs left out."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from rover_pin.discrepancy.anchor import Anchor
from rover_pin.discrepancy.candidate import Candidate
from rover_pin.discrepancy.cross_validation import left_out, left_out_by_refits, seen_again
from rover_pin.discrepancy.refit import ODDS, Fee, Progress, Refit, best_of_each, counted, joined
from rover_pin.discrepancy.screen import Scored, score, signatures, started
from rover_pin.estimation.fit import Fit, fit
from rover_pin.estimation.parameter import Parameter

REFITTED, PROMISING = 5, 0.4
"""Candidates that are refitted, at most, and the share of its fee that one must promise to pay."""
FAR_BEHIND = 0.02
"""Share of the best score below which a candidate is not refitted."""
FROM_DECLARED = 3
"""Candidates that are refitted from the declared numbers, at most."""
NEAR = 0.1
"""Share of the best's net gain within which one that has gained, or had promised, so much is fitted to the end."""
POLISHED = 3
"""Leaders that are fitted to the end, every slope computed again."""
FIRST, LAST = 0.08, 0.02
"""First and last step by which an edge is moved [m]; half a second's drive is 0.025 m."""
SMALL = 0.1
"""Share of its first size from which a candidate is fitted again, where it did not do better than none."""


def refit(
    base: Fit, scored: Sequence[Scored], fee: Fee, progress: Progress, declared: Anchor | None = None
) -> tuple[Refit, ...]:
    """Return the plausible candidates refitted, the best first; `fee` says what one must gain.

    Each starts where the base ended; the best of `declared`, which a bent base gives, from the declared numbers too:
    from a base that has absorbed a strong effect there may be no way down to the model that has it.
    """
    without = left_out(base)
    chosen = _chosen(base, scored, fee)
    found = {}
    for row in chosen:
        progress(f"refitting with {row.candidate.name}")
        found[row.candidate.name] = _refit(base, base, row, fee, without)
    others = _from_declared(base, declared, fee, without, progress) if declared else []
    promised = {row.candidate.name: row.gain - fee(row.candidate) for row in chosen}
    reached = max((one.net for one in [*found.values(), *others]), default=0.0)
    for row in chosen:
        name = row.candidate.name
        if promised[name] > max(reached, 0.0):
            progress(f"refitting with {name}, which gained less than promised")
            found[name] = max(found[name], _refit(base, base, row, fee, without, reuse=False), key=lambda one: one.net)
    ranked = sorted([*found.values(), *others], key=lambda one: -one.net)
    reach = ranked[0].net - 2 * ODDS * base.task.noise.inflation - NEAR * abs(ranked[0].net) if ranked else 0.0
    near = [one for one in ranked if one.net > 0 and max(one.net, promised.get(one.name, one.net)) > reach]
    leaders = list(dict.fromkeys(one.name for one in near))[:POLISHED]
    for one in near:
        if one.name in leaders:
            progress(f"refitting with {one.name}, every slope anew")
            ranked[ranked.index(one)] = _confirmed(base, _polished(base, one, without))
    return counted(best_of_each(ranked), fee)


def _from_declared(base: Fit, declared: Anchor, fee: Fee, without: np.ndarray, progress: Progress) -> list[Refit]:
    """Return refits of the candidates that promise most at the declared numbers, from there."""
    found = []
    for row in _chosen(declared.start, declared.scored, fee)[:FROM_DECLARED]:
        progress(f"refitting with {row.candidate.name} from the declared numbers")
        found.append(_refit(base, declared.start, row, fee, without))
    return found


def _chosen(start: Fit, scored: Sequence[Scored], fee: Fee) -> list[Scored]:
    """Return the candidates that promise enough, each once, at their best places."""
    best = max((row.gain for row in scored if row.told), default=0.0)
    paying = [row for row in scored if row.told and _promises(row, fee, best)]
    return list(
        {row.candidate.name: row for row in (placed(start, one) for one in _distinct(paying)[:REFITTED])}.values()
    )


def _promises(row: Scored, fee: Fee, best: float) -> bool:
    return row.gain > max(PROMISING * fee(row.candidate), FAR_BEHIND * best)


def _distinct(rows: Sequence[Scored]) -> list[Scored]:
    """Return the rows with only the two best places of each effect that is sought all over the ground."""
    seen: dict[str, int] = {}
    kept = []
    for row in rows:
        kind = row.candidate.kind if row.candidate.sought else row.candidate.name
        seen[kind] = seen.get(kind, 0) + 1
        if seen[kind] <= 2:
            kept.append(row)
    return kept


def _refit(base: Fit, start: Fit, row: Scored, fee: Fee, without: np.ndarray, reuse: bool = True) -> Refit:
    """Return a candidate refitted from the numbers of `start`, judged against the base."""
    candidate = row.candidate
    model = base.task.experiment.with_values(candidate.on(start.model), started(row, start))
    numbers, here = joined(start, candidate, model)
    slopes = start.slopes if reuse else None
    refitted = fit(base.task, model, numbers, here, slopes, reuse)
    if refitted.chi2 > start.chi2 and candidate.effect is not None:
        other = fit(base.task, model, numbers, _small(numbers, here, len(start.u)), slopes, reuse)
        refitted = min(refitted, other, key=lambda one: one.chi2)
    return _judged(base, candidate, refitted, fee(candidate), without)


def _small(numbers: Sequence[Parameter], start: np.ndarray, own: int) -> np.ndarray:
    """Return the start with the candidate's sizes near neutral: u = 0, but for what lies on a logarithm."""
    shares = [SMALL if at >= own and not one.prior and not one.log else 1.0 for at, one in enumerate(numbers)]
    return start * np.array(shares)


def _polished(base: Fit, one: Refit, without: np.ndarray) -> Refit:
    refitted = fit(base.task, one.fit.model, one.fit.parameters, one.fit.u, one.fit.slopes, stale=True)
    return _judged(base, one.candidate, refitted, one.fee, without)


def _confirmed(base: Fit, one: Refit) -> Refit:
    """Return the candidate with what it does on runs left out found by refits, where to first order it does harm."""
    if one.held_out > 0 or one.net <= 0:
        return one
    without, found = (left_out_by_refits(each) for each in (base, one.fit))
    return dataclasses.replace(one, held_out=seen_again(without, found))


def _judged(base: Fit, candidate: Candidate, refitted: Fit, fee: float, without: np.ndarray) -> Refit:
    gain = base.chi2 - refitted.chi2
    return Refit(candidate, refitted, gain, fee, seen_again(without, left_out(refitted)))


def placed(base: Fit, row: Scored) -> Scored:
    """Return a located candidate's row where moving neither of its edges raises the gain; others as they are.

    Which stretch of the way differs is not found by following slopes: an edge acts only where something passes it.
    """
    step = FIRST
    while step > LAST:
        near = base.task.experiment.neighbours(row.candidate, step)
        if not near:
            break
        best = max(score(base, signatures(base, near)), key=lambda one: one.gain)
        if best.gain > row.gain:
            row = best
        else:
            step /= 2
    return row
