"""Candidates refitted with every uncertain number free, and compared: penalised gain, and runs left out."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from rover_pin.evidence.drive_candidates import Candidate
from rover_pin.evidence.drive_fit import DriveFit, fit
from rover_pin.evidence.drive_noise import huber, huber_weights
from rover_pin.evidence.drive_parameters import Parameter, value_of, with_values
from rover_pin.evidence.drive_screen import Scored, fee_of, started

REFITTED, PROMISING = 5, 0.4
"""Candidates that are refitted, at most, and the share of its fee that one must promise to pay."""
FAR_BEHIND = 0.02
"""Share of the best score below which a candidate is not refitted."""
NEAR = 0.1
"""Share of the best's net gain within which one that has gained, or had promised, so much is fitted to the end."""
POLISHED = 3
"""Leaders that are fitted to the end, every slope computed again."""
FAR = 3.0
"""Default sizes by which a size may move when a run is left out."""
SMALL = 0.1
"""Share of its first size from which a candidate is fitted again, where it did not do better than none."""
ODDS = 20.0
"""Candidates within this of the best are not told apart: odds of 1 in 100, chance gaining as much more as it does."""

Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Refit:
    """A model with one more candidate, fitted."""

    candidate: Candidate
    fit: DriveFit = field(repr=False)
    gain: float
    "fall of chi2 from the model without"
    fee: float
    "what chance alone would gain"
    held_out: float
    "fall of the held-out chi2, each run predicted from the others"

    @property
    def name(self) -> str:
        """Name of the candidate."""
        return self.candidate.name

    @property
    def net(self) -> float:
        """Gain minus fee."""
        return self.gain - self.fee

    @property
    def accepted(self) -> bool:
        """Whether it gains more than chance and predicts runs that it has not seen better."""
        return self.net > 0 and self.held_out > 0


def refit(base: DriveFit, scored: Sequence[Scored], count: int, progress: Progress) -> tuple[Refit, ...]:
    """Return the plausible candidates refitted, the best first; `count` is how many were tried."""
    best = max((row.gain for row in scored if row.told), default=0.0)
    paying = [row for row in scored if row.told and _promises(row, count, best)]
    chosen = _distinct(paying)[:REFITTED]
    without = left_out(base)
    found = []
    for row in chosen:
        progress(f"refitting with {row.candidate.name}")
        found.append(_refit(base, row, count, without, chord=True))
    ranked = sorted(found, key=lambda one: -one.net)
    promised = {row.candidate.name: row.gain - fee_of(row.candidate, count) for row in chosen}
    reach = ranked[0].net - 2 * ODDS - NEAR * abs(ranked[0].net) if ranked else 0.0
    near = [one for one in ranked if one.net > 0 and max(one.net, promised[one.name]) > reach][:POLISHED]
    for one in near if len(near) > 1 or (near and near[0].accepted) else ():
        progress(f"refitting with {one.name}, every slope anew")
        ranked[ranked.index(one)] = _polished(base, one, without)
    return tuple(sorted(ranked, key=lambda one: -one.net))


def _promises(row: Scored, count: int, best: float) -> bool:
    return row.gain > max(PROMISING * fee_of(row.candidate, count), FAR_BEHIND * best)


def _distinct(rows: Sequence[Scored]) -> list[Scored]:
    """Return the rows with only the two best places of each effect that is sought all over the ground."""
    seen: dict[str, int] = {}
    kept = []
    for row in rows:
        kind = row.candidate.kind if "@" in row.candidate.name else row.candidate.name
        seen[kind] = seen.get(kind, 0) + 1
        if seen[kind] <= 2:
            kept.append(row)
    return kept


def _refit(base: DriveFit, row: Scored, count: int, without: np.ndarray, chord: bool) -> Refit:
    candidate = row.candidate
    model = with_values(candidate.on(base.model), started(row, base.model))
    numbers, start = joined(base, candidate, model)
    refitted = fit(base.task, model, numbers, start, base.slopes, chord)
    if refitted.chi2 > base.chi2 and candidate.effect is not None:
        refitted = fit(base.task, model, numbers, _small(numbers, start, len(base.u)), base.slopes, chord)
    return _judged(base, candidate, refitted, fee_of(candidate, count), without)


def _small(numbers: Sequence[Parameter], start: np.ndarray, own: int) -> np.ndarray:
    """Return the start with the candidate's sizes near neutral: u = 0, but for what lies on a logarithm."""
    shares = [SMALL if at >= own and not one.prior and not one.log else 1.0 for at, one in enumerate(numbers)]
    return start * np.array(shares)


def joined(base: DriveFit, candidate: Candidate, model: object) -> tuple[tuple[Parameter, ...], np.ndarray]:
    """Return the base's numbers and the candidate's, and where the fit starts; freed numbers lose their prior."""
    freed = [] if candidate.effect is not None else list(candidate.sizes)
    old = [dataclasses.replace(one, prior=False) if one.name in freed else one for one in base.parameters]
    own = () if candidate.effect is None else candidate.parameters(model)  # type: ignore[arg-type]
    start = [one.u(value_of(model, one.name)) for one in own]  # type: ignore[arg-type]
    return (*old, *own), np.concatenate([base.u, start])


def _polished(base: DriveFit, one: Refit, without: np.ndarray) -> Refit:
    refitted = fit(base.task, one.fit.model, one.fit.parameters, one.fit.u, one.fit.slopes, stale=True)
    return _judged(base, one.candidate, refitted, one.fee, without)


def _judged(base: DriveFit, candidate: Candidate, refitted: DriveFit, fee: float, without: np.ndarray) -> Refit:
    gain = base.chi2 - refitted.chi2
    return Refit(candidate, refitted, gain, fee, float(np.sum(without - left_out(refitted))))


def left_out(fitted: DriveFit) -> np.ndarray:
    """Return the robust chi2 of every run (runs,) as the others predict it.

    The numbers without a run are one Gauss-Newton step from the optimum, its rows left out: to first order what a
    whole fit to the other runs would give, without replaying anything.
    """
    rows, owner = fitted.rows, run_of_rows(fitted)
    columns, losses = fitted.columns, []
    for run, step in enumerate(steps_without(fitted)):
        at = owner == run
        losses.append(huber(rows[at] + columns[at] @ step))
    return np.array(losses)


def steps_without(fitted: DriveFit) -> list[np.ndarray]:
    """Return how u moves when the rows of each run in turn are left out.

    A size that the other runs hardly tell stays within some FAR of where it was: one step is no guide further off.
    """
    rows, columns, owner = fitted.rows, fitted.columns, run_of_rows(fitted)
    prior = np.array([1.0 if one.prior else FAR**-2 for one in fitted.parameters])
    held = np.array([fitted.u[i] if one.prior else 0.0 for i, one in enumerate(fitted.parameters)])
    weights = huber_weights(rows)
    steps = []
    for run in range(len(fitted.task.bench.runs)):
        use = weights * (owner != run)
        normal = (columns * use[:, None]).T @ columns + np.diag(prior)
        steps.append(-np.linalg.lstsq(normal, columns.T @ (use * rows) + held, rcond=None)[0])
    return steps


def run_of_rows(fitted: DriveFit) -> np.ndarray:
    """Return to which run each whitened row belongs."""
    good = fitted.task.noise.good
    return np.broadcast_to(np.arange(good.shape[0])[:, None, None], good.shape)[good]


def alike(found: Sequence[Refit]) -> tuple[Refit, ...]:
    """Return the candidates that the data cannot tell from the best, the best first; empty where none is accepted."""
    accepted = [one for one in found if one.accepted]
    if not accepted:
        return ()
    best = accepted[0]
    near = [one for one in found if one is not best and one.net > max(0.0, best.net - ODDS)]
    kinds = {best.candidate.kind + str("@" in best.name)}
    kept = []
    for one in near:
        key = one.candidate.kind if "@" in one.name else one.name
        if key not in kinds and not ("@" in one.name and one.candidate.kind == best.candidate.kind):
            kept.append(one)
            kinds.add(key)
    return (best, *kept)
