"""Candidates refitted with every nuisance parameter free, and compared: penalised gain, and levels held out."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from rover_pin.discrepancy.screen import entry_fee
from rover_pin.effects.effect import Effect
from rover_pin.errors import OptimisationError
from rover_pin.experiments.wheel_rig.calibrate import Setting, own_sizes, remains
from rover_pin.experiments.wheel_rig.candidates import shapes, sizes
from rover_pin.experiments.wheel_rig.fit import RigFit, RigProblem, fit_from
from rover_pin.experiments.wheel_rig.held_out import held_out, loss
from rover_pin.experiments.wheel_rig.screen import Screened

PLAUSIBLE = 5
"""Candidates that are refitted, at least; every one whose score pays a quarter of its fee is."""

SHOWN = 3
"""Leaders whose levels are held out even if chance explains their gain."""

PAIRED = 6
"""Singles from which pairs are made."""

FURTHER = entry_fee(1)
"""Fee of each parameter beyond an effect's first: 2 ln(1 / 0.05)."""

ODDS = 9.2
"""Candidates within this of the best are not told apart: 2 ln 100, odds of 1 in 100."""

MOST_FREE = 0.5
"""Free parameters without a prior for each measured value, at most."""

MUCH = 1.25
"""Ratio of held-out losses from which a rival is out."""

HALF = 0.5
"""Share of the best's net gain from which better held-out predictions make a rival."""

SMALL = 0.05
"""Share of the default size from which a refit starts, besides the default."""

Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Candidate:
    """One effect, or a pair, added to the base model and refitted."""

    effects: tuple[Effect, ...] = field(repr=False)
    fit: RigFit = field(repr=False)
    fee: float
    "what chance alone would gain"
    gain: float
    "fall of chi2 from the model that it is compared with, over the misfit that is left"
    loss: float
    "held-out loss, 1 is the noise; NaN where the gain is too small to ask"
    reference_loss: float
    "held-out loss of the model that it is compared with"

    @property
    def name(self) -> str:
        """Names of the effects."""
        return " + ".join(type(effect).__name__ for effect in self.effects)

    @property
    def net(self) -> float:
        """Gain minus fee: above 0, chance is not enough."""
        return self.gain - self.fee

    @property
    def accepted(self) -> bool:
        """Whether it gains more than chance and predicts held-out levels better."""
        return self.net > 0 and self.loss < self.reference_loss


@dataclass(frozen=True, eq=False)
class Comparison:
    """All candidates of one kind (singles or pairs), best first."""

    ranked: tuple[Candidate, ...] = ()
    without: float = 1.0
    "chi2 per degree of freedom of the model that they are compared with"

    @property
    def best(self) -> Candidate | None:
        """The best accepted candidate, or None."""
        return next((one for one in self.ranked if one.accepted), None)

    @property
    def alike(self) -> tuple[Candidate, ...]:
        """The candidates that the data cannot tell from the best, the best first.

        Their net gain is within `ODDS` of the best's and their held-out loss not much above the model's without them,
        or they predict held-out levels better than the best at half of its gain.
        """
        best = self.best
        if best is None:
            return ()
        enough = max(0.0, best.net - ODDS)
        near = [one for one in self.ranked if one.net > enough and one.loss < MUCH * one.reference_loss]
        better = [one for one in self.ranked if one.accepted and one.loss < best.loss and one.net > HALF * best.net]
        return (best, *(one for one in self.ranked if one is not best and (one in near or one in better)))


def compare_singles(
    setting: Setting, base: RigFit, screened: Sequence[Screened], progress: Progress = lambda said: None
) -> Comparison:
    """Return the refits of the plausible candidates."""
    fee = entry_fee(len(screened))
    told = [row for row in screened if row.told]
    plausible = [row for place, row in enumerate(told) if place < PLAUSIBLE or row.gain > fee / 4]
    reference = loss(held_out(setting.data, base))
    found = []
    for row in plausible:
        progress(f"refitting with {row.name}")
        found += _variants(setting, base, row.effect, fee)
    return _ranked(base, found, reference, setting)


def compare_pairs(
    setting: Setting,
    base: RigFit,
    singles: Comparison,
    screened: Sequence[Screened],
    progress: Progress = lambda said: None,
) -> Comparison:
    """Return the refits of pairs, compared with the best single: of the best singles, and of the best with another.

    Parameters
    ----------
    screened : sequence of Screened
        Every candidate, scored against the best single (or against the base where there is none).
    """
    parent = singles.best.fit if singles.best else base
    fee, reference = entry_fee(len(screened) + (singles.best is not None)), loss(held_out(setting.data, parent))
    found: list[Joined] = []
    if remains(parent):
        for one, other in itertools.combinations(singles.ranked[:PAIRED], 2):
            progress(f"refitting with {one.name} + {other.name}")
            found += _pair(setting, base, one, other)
    if singles.best:
        found += _joined(setting, base, singles.best, [row for row in screened if row.told and row.gain > fee / 4])
    paid = fee if singles.best else 2 * fee
    had = len(parent.problem.space.names) + (1 if singles.best else 2)
    priced = [(effects, fit, paid + FURTHER * max(len(fit.u) - had, 0)) for effects, fit in found]
    return _ranked(parent, priced, reference, setting)


Found = tuple[tuple[Effect, ...], RigFit, float]


def _variants(setting: Setting, base: RigFit, effect: Effect, fee: float) -> list[Found]:
    """Return the refit with sizes free, and with shapes free too where the data can bear them."""
    found: list[Found] = []
    for extra in dict.fromkeys((sizes(effect), (*sizes(effect), *shapes(effect)))):
        fit = _refit(setting, base, (effect,), extra, [one[1] for one in found])
        if fit is not None:
            found.append(((effect,), fit, fee + FURTHER * (len(extra) - 1)))
    return found


Joined = tuple[tuple[Effect, ...], RigFit]


def _pair(setting: Setting, base: RigFit, one: Candidate, other: Candidate) -> list[Joined]:
    """Return the refit with what was free in either single; with sizes only where that is more than the data bear."""
    effects = (*one.effects, *other.effects)
    own = set(base.problem.space.names)
    freed = [name for single in (one, other) for name in single.fit.problem.space.names if name not in own]
    for extra in dict.fromkeys((tuple(freed), tuple(name for effect in effects for name in sizes(effect)))):
        fit = _refit(setting, base, effects, extra, [one.fit, other.fit])
        if fit is not None:
            return [(effects, fit)]
    return []


def _joined(setting: Setting, base: RigFit, best: Candidate, screened: Sequence[Screened]) -> list[Joined]:
    """Return the best single with each of the most promising others."""
    own = set(base.problem.space.names)
    freed = tuple(name for name in best.fit.problem.space.names if name not in own)
    found: list[Joined] = []
    for row in screened[:PLAUSIBLE]:
        effects, extra = (*best.effects, row.effect), (*freed, *sizes(row.effect))
        fit = _refit(setting, base, effects, extra, [best.fit])
        if fit is not None:
            found.append((effects, fit))
    return found


def _refit(
    setting: Setting, base: RigFit, effects: tuple[Effect, ...], extra: tuple[str, ...], warm: Sequence[RigFit]
) -> RigFit | None:
    """Return the best fit from the base's values and from `warm` fits, or None where none is to be had."""
    model = base.model
    for effect in effects:
        model = model.having(effect)
    problem = setting.problem(model, (*own_sizes(base.model), *extra))
    if len(problem.space.names) - len(problem.priors) > MOST_FREE * problem.measured.size:
        return None
    try:
        own = _starts(problem, effects)
        return fit_from(problem, [*(own[1:2] if warm else own), *_from(problem, warm)])
    except OptimisationError:
        return None


def _starts(problem: RigProblem, effects: Sequence[Effect]) -> list[np.ndarray]:
    """Return the base's values with the effects small, at their default size, and small in the other sense."""
    names, centre = problem.space.names, problem.space.start()
    starts = []
    for share in (SMALL, 1.0, -SMALL):
        start = centre.copy()
        for effect in effects:
            for name, neutral in effect.neutral.items():
                at = names.index(f"{type(effect).__name__}.{name}")
                size = neutral + share * (float(getattr(effect, name)) - neutral)
                start[at] = problem.space.axes[at].coordinate.u(size)
        starts.append(start)
    return starts


def _from(problem: RigProblem, warm: Sequence[RigFit]) -> list[np.ndarray]:
    """Return each warm fit's values, what it does not have kept small."""
    small = 1.0 * problem.space.start()
    starts = []
    for fit in warm:
        start = small.copy()
        own = dict(zip(fit.problem.space.names, fit.problem.space.values(fit.u), strict=True))
        for at, axis in enumerate(problem.space.axes):
            if axis.name in own:
                start[at] = axis.coordinate.u(float(own[axis.name]))
            elif "." in axis.name:
                start[at] = _little(problem, axis.name)
        starts.append(start)
    return starts


def _little(problem: RigProblem, name: str) -> float:
    """Return u of a small size of an effect's parameter; of a shape, its own value."""
    kind, _, quantity = name.partition(".")
    effect = next(one for one in problem.data[0].model.effects if type(one).__name__ == kind)
    value = float(getattr(effect, quantity))
    if quantity in effect.neutral:
        value = effect.neutral[quantity] + SMALL * (value - effect.neutral[quantity])
    return problem.space.axes[problem.space.names.index(name)].coordinate.u(value)


def _ranked(parent: RigFit, found: Sequence[Found], reference: float, setting: Setting) -> Comparison:
    """Return the candidates by net gain, the better variant of each; chi2 counts in units of the best one's misfit."""
    if not found:
        return Comparison((), parent.misfit)
    left = max(1.0, min(fit.misfit for _, fit, _ in found))
    best: dict[tuple[str, ...], Found] = {}
    for one in found:
        key = tuple(type(effect).__name__ for effect in one[0])
        if key not in best or one[1].chi2 / left + one[2] < best[key][1].chi2 / left + best[key][2]:
            best[key] = one
    ranked = sorted(best.values(), key=lambda one: one[1].chi2 / left + one[2])
    made = []
    for place, (effects, fit, fee) in enumerate(ranked):
        gain = (parent.chi2 - fit.chi2) / left
        judged = gain > fee or place < SHOWN
        lost = loss(held_out(setting.data, fit)) if judged else float("nan")
        made.append(Candidate(effects, fit, fee, gain, lost, reference))
    return Comparison(tuple(made), parent.misfit)
