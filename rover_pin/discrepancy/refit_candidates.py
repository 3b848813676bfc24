"""Candidates refitted with every uncertain number free, and compared: penalised gain, and runs left out."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from rover_pin.discrepancy.calibration import DeclaredStart
from rover_pin.discrepancy.candidate import Candidate
from rover_pin.discrepancy.cross_validation import first_order_surprises, refitted_surprises, seen_again
from rover_pin.discrepancy.refit import ODDS, Progress, Refit, Threshold, best_of_each, joined, rescale_thresholds
from rover_pin.discrepancy.screen import Scored, score, signatures, started
from rover_pin.estimation.fit import Fit, fit
from rover_pin.estimation.parameter import Parameter

REFITTED, PROMISING = 5, 0.4
"""Candidates that are refitted, at most, and the share of its threshold that one must promise to gain."""
MIN_SHARE_OF_BEST = 0.02
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
    base: Fit, scored: Sequence[Scored], threshold: Threshold, progress: Progress, declared: DeclaredStart | None = None
) -> tuple[Refit, ...]:
    """Return the plausible candidates refitted, the best first; `threshold` says what one must gain.

    Each starts where the base ended; the best of `declared`, which a bent base gives, from the declared numbers too:
    from a base that has absorbed a strong effect there may be no way down to the model that has it.
    """
    without = first_order_surprises(base)
    chosen = _chosen(base, scored, threshold)
    refits_by_name = {}
    for row in chosen:
        progress(f"refitting with {row.candidate.name}")
        refits_by_name[row.candidate.name] = _refit(base, base, row, threshold, without)
    others = _from_declared(base, declared, threshold, without, progress) if declared else []
    promised = {row.candidate.name: row.gain - threshold(row.candidate) for row in chosen}
    reached = max((rival.net for rival in [*refits_by_name.values(), *others]), default=0.0)
    for row in chosen:
        name = row.candidate.name
        if promised[name] > max(reached, 0.0):
            progress(f"refitting with {name}, which gained less than promised")
            refits_by_name[name] = max(
                refits_by_name[name],
                _refit(base, base, row, threshold, without, reuse=False),
                key=lambda rival: rival.net,
            )
    ranked = sorted([*refits_by_name.values(), *others], key=lambda rival: -rival.net)
    reach = ranked[0].net - 2 * ODDS * base.task.noise.inflation - NEAR * abs(ranked[0].net) if ranked else 0.0
    close_rivals = [
        rival for rival in ranked if rival.net > 0 and max(rival.net, promised.get(rival.name, rival.net)) > reach
    ]
    leaders = list(dict.fromkeys(rival.name for rival in close_rivals))[:POLISHED]
    for rival in close_rivals:
        if rival.name in leaders:
            progress(f"refitting with {rival.name}, every slope anew")
            ranked[ranked.index(rival)] = _confirmed(base, _polished(base, rival, without))
    return rescale_thresholds(best_of_each(ranked), threshold)


def _from_declared(
    base: Fit, declared: DeclaredStart, threshold: Threshold, without: np.ndarray, progress: Progress
) -> list[Refit]:
    """Return refits of the candidates that promise most at the declared numbers, from there."""
    refits = []
    for row in _chosen(declared.start, declared.scored, threshold)[:FROM_DECLARED]:
        progress(f"refitting with {row.candidate.name} from the declared numbers")
        refits.append(_refit(base, declared.start, row, threshold, without))
    return refits


def _chosen(start: Fit, scored: Sequence[Scored], threshold: Threshold) -> list[Scored]:
    """Return the candidates that promise enough, each once, at their best places."""
    best = max((row.gain for row in scored if row.is_identifiable), default=0.0)
    paying = [row for row in scored if row.is_identifiable and _promises(row, threshold, best)]
    return list(
        {
            row.candidate.name: row
            for row in (placed(start, promising_row) for promising_row in _distinct(paying)[:REFITTED])
        }.values()
    )


def _promises(row: Scored, threshold: Threshold, best: float) -> bool:
    return row.gain > max(PROMISING * threshold(row.candidate), MIN_SHARE_OF_BEST * best)


def _distinct(rows: Sequence[Scored]) -> list[Scored]:
    """Return the rows with only the two best places of each effect that is sought all over the ground."""
    count_by_kind: dict[str, int] = {}
    distinct_rows = []
    for row in rows:
        kind = row.candidate.kind if row.candidate.place_searched else row.candidate.name
        count_by_kind[kind] = count_by_kind.get(kind, 0) + 1
        if count_by_kind[kind] <= 2:
            distinct_rows.append(row)
    return distinct_rows


def _refit(base: Fit, start: Fit, row: Scored, threshold: Threshold, without: np.ndarray, reuse: bool = True) -> Refit:
    """Return a candidate refitted from the numbers of `start`, judged against the base."""
    candidate = row.candidate
    model = base.task.experiment.with_values(candidate.on(start.model), started(row, start))
    numbers, u_start = joined(start, candidate, model)
    slopes = start.slopes if reuse else None
    refitted = fit(base.task, model, numbers, u_start, slopes, reuse)
    if refitted.chi2 > start.chi2 and candidate.effect is not None:
        small_start_fit = fit(base.task, model, numbers, _small(numbers, u_start, len(start.u)), slopes, reuse)
        refitted = min(refitted, small_start_fit, key=lambda attempt: attempt.chi2)
    return _evaluate_refit(base, candidate, refitted, threshold(candidate), without)


def _small(numbers: Sequence[Parameter], start: np.ndarray, base_count: int) -> np.ndarray:
    """Return the start with the candidate's sizes near neutral: u = 0, but for what lies on a logarithm."""
    shares = [
        SMALL if at >= base_count and not parameter.prior and not parameter.log else 1.0
        for at, parameter in enumerate(numbers)
    ]
    return start * np.array(shares)


def _polished(base: Fit, leader: Refit, without: np.ndarray) -> Refit:
    refitted = fit(base.task, leader.fit.model, leader.fit.parameters, leader.fit.u, leader.fit.slopes, stale=True)
    return _evaluate_refit(base, leader.candidate, refitted, leader.threshold, without)


def _confirmed(base: Fit, leader: Refit) -> Refit:
    """Return the candidate with what it does on runs left out found by refits, where to first order it does harm."""
    if leader.held_out > 0 or leader.net <= 0:
        return leader
    without, new_losses = (refitted_surprises(fitted) for fitted in (base, leader.fit))
    return dataclasses.replace(leader, held_out=seen_again(without, new_losses))


def _evaluate_refit(base: Fit, candidate: Candidate, refitted: Fit, threshold: float, without: np.ndarray) -> Refit:
    gain = base.chi2 - refitted.chi2
    return Refit(candidate, refitted, gain, threshold, seen_again(without, first_order_surprises(refitted)))


def placed(base: Fit, row: Scored) -> Scored:
    """Return a located candidate's row where moving neither of its edges raises the gain; others as they are.

    Which stretch of the way differs is not found by following slopes: an edge acts only where something passes it.
    """
    step = FIRST
    while step > LAST:
        neighbours = base.task.experiment.neighbours(row.candidate, step)
        if not neighbours:
            break
        best = max(score(base, signatures(base, neighbours)), key=lambda neighbour: neighbour.gain)
        if best.gain > row.gain:
            row = best
        else:
            step /= 2
    return row
