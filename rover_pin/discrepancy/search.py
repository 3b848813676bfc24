"""Which sets of causes are worth a fit, the most promising first: by the linear model about what was fitted so far.

Every candidate moves a fitted model by its signature. About each fit the evidence of any set that adds one or two
candidates is a matrix; the most promising set is fitted, which gives its evidence anew and that of the sets beyond it,
until no set that was not fitted is worth it. A cause that may be anywhere along the way is as probable as any other,
and shares that among its places.
"""

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rover_pin.discrepancy.added import fitted_with, part_of
from rover_pin.discrepancy.calibration import as_declared, is_bent
from rover_pin.discrepancy.option import Option, alone, options
from rover_pin.discrepancy.question import Progress
from rover_pin.discrepancy.signature import Signature, signatures
from rover_pin.estimation.columns import Columns
from rover_pin.estimation.fit import Fit, again
from rover_pin.estimation.profile import SURE
from rover_pin.inference.beliefs import Beliefs
from rover_pin.inference.cause import Cause
from rover_pin.inference.expansion import Expansion
from rover_pin.inference.linear_hypothesis import LinearHypothesis, linear_hypothesis, with_function
from rover_pin.inference.residual_function import with_functions
from rover_pin.inference.set_prior import COUNTS

MAX_FITS = 12
"""Sets that are fitted at most, but for those that are more probable than all of them."""
WORTH = 5.0
"""Nats behind the best at which a set is not fitted."""
FOLLOWED = 20.0
"""Nats behind the best at which a set is not followed at all."""
FROM_DECLARED = 6
"""Causes that are fitted from the declared numbers too, where a missing effect has bent the base model."""
Names = frozenset[str]


@dataclass(eq=False)
class Search:
    """What was fitted so far, and the most promising estimate of every other set."""

    base: Fit
    progress: Progress = lambda message: None
    options: dict[str, Option] = field(default_factory=dict)
    fitted: dict[Names, list[LinearHypothesis]] = field(default_factory=dict)
    estimates: dict[Names, LinearHypothesis] = field(default_factory=dict)
    finished: set[Names] = field(default_factory=lambda: {frozenset()})
    "sets whose fit was taken to its end, as the base comes"
    parted: set[Names] = field(default_factory=set)
    "sets whose parts were fitted from where they are best"
    shortfalls: dict[str, float] = field(default_factory=dict)
    "by how much fits with a cause fell short of their estimate, at least: its size shows otherwise than in proportion"
    lost: set[Names] = field(default_factory=set)
    "sets with which no fit ends"

    def beliefs(self) -> Beliefs:
        """Return what the data make of all sets that are followed."""
        least = self.best_score() - FOLLOWED
        estimates = [row for row in self._open() if self.score(row) > least]
        untried = tuple(name for name in self.options if frozenset((name,)) in self.lost)
        return Beliefs((*itertools.chain(*self.fitted.values()), *estimates), max(len(self.options), 1), untried)

    def _open(self) -> list[LinearHypothesis]:
        """Return the estimates of the sets that were not fitted, less what their causes fell short of others."""
        rows = [row for names, row in self.estimates.items() if names not in self.fitted and names not in self.lost]
        return [
            replace(row, log_evidence=row.log_evidence - sum(self.shortfalls.get(name, 0.0) for name in row.added))
            for row in rows
        ]

    def run(self, rows: Sequence[Signature]) -> Beliefs:
        """Return what the data make of candidates by their signatures, after the sets that are worth it were fitted."""
        self.progress("weighing candidates and pairs of them")
        self.options = {option.candidate.name: option for option in options(self.base, rows)}
        start, there = self._at_declared(rows) if is_bent(self.base) else (self.base, [])
        self._note((), self.base)
        if there:
            self._from_declared(start, there)
        while self._end_promising() or self._fit_worthiest() or self._end_likely():
            pass
        return self.beliefs()

    def _fit_worthiest(self) -> bool:
        """Fit the most promising set; return whether one is worth it.

        A pair that was estimated about the base model comes after its more promising cause alone, which may do as well.
        """
        names = self._worthiest()
        if names:
            added = self.estimates[names].added
            alone = [frozenset((name,)) for name in added] if len(added) > 1 else []
            missing = [part for part in alone if part not in self.fitted and part not in self.lost]
            self.fit(max(missing, key=lambda part: self.score(self.estimates[part]), default=names))
        return bool(names)

    def _end_promising(self) -> bool:
        """Take fits to their end that promise as much as the best is ahead; return whether there was one."""
        best = self.best_score()
        promising = [
            names
            for names, rows in self.fitted.items()
            if names not in self.finished and self.score(rows[0]) + rows[0].expansion.promised > best + WORTH
        ]
        for names in promising:
            self._end(names)
        return bool(promising)

    def _end_likely(self) -> bool:
        """Take the smallest likely set to its end, or fit its parts from there; return whether there was one."""
        sets = self.beliefs().sets  # anew after each: beside a part at its end a set may not be likely any more
        likely = sorted((names for names in self.fitted if sets[names] > 1.0 - SURE), key=len)
        unfinished = [names for names in likely if names not in self.finished][:1]
        undivided = [] if unfinished else [names for names in likely if len(names) > 1 and names not in self.parted][:1]
        for names in unfinished:
            self._end(names)
        for names in undivided:
            self.parted.add(names)
            for name in names:
                self._fit_part(names, names - {name})
        return bool(unfinished or undivided)

    def _fit_part(self, names: Names, part: Names) -> None:
        """Fit a part of a set from where the set is best: fits of the part may end in another valley, far above."""
        causes, fitted = part_of(self.base, self.fitted[names][0], part)
        if fitted is not None and (part not in self.fitted or fitted.chi2 < self.fitted[part][0].fit.chi2):
            self.finished.discard(part)
            self._note(causes, fitted)

    def score(self, hypothesis: LinearHypothesis) -> float:
        """Return the logarithm of evidence times prior."""
        return float(Beliefs((hypothesis,), max(len(self.options), 1)).scores[0])

    def best_score(self) -> float:
        """Return the greatest of what was fitted."""
        return max(self.score(rows[0]) for rows in self.fitted.values())

    def _worthiest(self) -> Names:
        """Return the most promising set that was not fitted; none where none is worth it, after MAX_FITS leads."""
        rises, margin = (self._rises(), WORTH) if len(self.fitted) <= MAX_FITS else ({}, 0.0)
        tried = {
            frozenset(estimate.names): self.score(estimate) + rises.get(id(estimate.expansion), 0.0)
            for estimate in self._open()
            if self._promises(estimate)
        }
        best = max(tried, key=lambda names: tried[names], default=frozenset[str]())
        return best if best and tried[best] > self.best_score() - margin else frozenset()

    def _rises(self) -> dict[int, float]:
        """Return, by what it was made about, how far fits rose at most over an estimate; 0 up to WORTH.

        Where rows are far off they count less than squared, so that about such a fit estimates of rivals are too low.
        """
        rises: dict[int, float] = {}
        for names in self.fitted.keys() & self.estimates.keys():
            estimate, expansion = self.estimates[names], id(self.estimates[names].expansion)
            rise = self.fitted[names][0].log_evidence - estimate.log_evidence
            rises[expansion] = max(rises.get(expansion, 0.0), rise if rise > WORTH else 0.0)
        return rises

    def _promises(self, estimate: LinearHypothesis) -> bool:
        """Return whether the data speak for what a set adds to the fit about which it was estimated."""
        return estimate.log_evidence > self.fitted[frozenset(estimate.names) - set(estimate.added)][0].log_evidence

    def _note(self, causes: Sequence[Cause], fitted: Fit) -> None:
        """Note a fit, and what it says of the sets that have one cause more; the base model's, of pairs too."""
        columns = [option.column for option in self.options.values()]
        expansion = Expansion(fitted, np.array(columns).T if columns else np.zeros((len(fitted.rows), 0)))
        names = frozenset(cause.name for cause in causes)
        self.fitted[names] = [self._hypothesis(causes, expansion)]
        if len(names) == len(COUNTS) - 1:
            return
        others = [name for name in self.options if name not in names]
        sets = [(name,) for name in others] + ([] if names else [*itertools.combinations(others, 2)])
        evidence = [expansion.posterior(self._places(added)).log_evidence for added in sets]
        least = max([*evidence, self.fitted[names][0].posterior.log_evidence]) - FOLLOWED
        for added, log_evidence in zip(sets, evidence, strict=True):
            wider = names | set(added)
            estimate = self.estimates.get(wider)
            is_nearer = estimate is None or len(estimate.causes) - len(estimate.extra) <= len(names)
            if is_nearer and (len(added) == 1 or log_evidence > least):
                self.estimates[wider] = self._hypothesis(causes, expansion, added)

    def _places(self, added: Sequence[str]) -> list[int]:
        """Return which of an expansion's other columns these options are."""
        names = [*self.options]
        return [names.index(name) for name in added]

    def _hypothesis(self, causes: Sequence[Cause], expansion: Expansion, added: Sequence[str] = ()) -> LinearHypothesis:
        partial = [self.options[name].size for name in added]
        hypothesis = linear_hypothesis((*causes, *partial), expansion, self._places(added), partial)
        more = sum(self.options[name].log_places for name in hypothesis.names)
        return replace(hypothesis, log_evidence=hypothesis.log_evidence + more)

    def fit(self, names: Names) -> None:
        """Fit a set of causes from where its estimate was made."""
        self.progress(f"fitting {' + '.join(sorted(names))}")
        estimate = self.estimates[names]
        fitted = fitted_with(estimate, self.options, True)
        if fitted is None:
            self.lost.add(names)
            return
        self._note(*fitted)
        if self.fitted[names][0].log_evidence < estimate.log_evidence - WORTH:
            again = fitted_with(estimate, self.options, False)
            if again is not None and again[1].chi2 < fitted[1].chi2:
                self._note(*again)
        if len(estimate.added) == 1:
            (name,) = estimate.added
            fall = max(estimate.log_evidence - self.fitted[names][0].log_evidence, 0.0)
            self.shortfalls[name] = min(self.shortfalls.get(name, fall), fall)

    def _at_declared(self, rows: Sequence[Signature]) -> tuple[Fit, list[Option]]:
        """Return the base model with the declared numbers and what shows there, which is an option where new."""
        self.progress("the numbers had to leave what is known beforehand: weighing every candidate there too")
        start = as_declared(self.base)
        candidates = list(dict.fromkeys(row.candidate for row in rows))
        there = options(start, signatures(start, candidates), is_optimum=False)
        listed = {option.candidate.anywhere for option in self.options.values()}
        self.options |= {option.candidate.name: option for option in there if option.candidate.anywhere not in listed}
        return start, there

    def _from_declared(self, start: Fit, there: Sequence[Option]) -> None:
        """Fit the causes that promise most at the declared numbers, from there."""
        rows = alone(start, there, is_optimum=False)
        for row in sorted(rows, key=lambda row: -row.log_evidence)[:FROM_DECLARED]:
            names = frozenset(row.names)
            if row.names[0] not in self.options:
                continue
            starts = [row, *([self.estimates[names]] if names in self.estimates else [])]
            ends = [fitted for fitted in (fitted_with(estimate, self.options, True) for estimate in starts) if fitted]
            if ends:
                self._note(*min(ends, key=lambda ending: ending[1].chi2))

    def _end(self, names: Names) -> None:
        """Take a fit to its end, every slope computed again."""
        self.finished.add(names)
        self.progress(f"fitting {' + '.join(sorted(names))} to the end")
        self._note(self.fitted[names][0].causes, again(self.fitted[names][0].fit, stale=True))

    def leave(self, functions: Iterable[Columns]) -> None:
        """Weigh, of all that was fitted, that something that is on no list is left besides.

        Where that is much, a set that is far behind without it may lead: others take what its law leaves.
        """
        plain = [rows[0] for rows in self.fitted.values()]
        evidence = with_functions([(row.expansion, row.posterior) for row in plain], functions)
        for row, of_row in zip(plain, evidence, strict=bool(evidence)):
            self.fitted[frozenset(row.names)].append(with_function(row, of_row))
