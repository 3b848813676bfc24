"""Which hypotheses are worth fitting: all causes alone, pairs of those that lead, triples of the best pairs."""

import itertools
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from rover_pin.base.errors import OptimisationError
from rover_pin.estimation.profile import CLEAR
from rover_pin.inference.beliefs import Beliefs
from rover_pin.inference.cause import SIZE_SD, Cause
from rover_pin.inference.error_model import Discrepancy
from rover_pin.inference.hypothesis import Fitter, Hypothesis

SHOWN = 0.3
"""Norm [SD] of what a default size moves, below which data cannot show a cause. Why: they would give 0.05 nats."""
LOOKS = 12
"""Most looks for outliers, the farthest first: it widens the scales, hides in part and makes its fold look astray."""
LEADING, LEADING_FLAT, LEADING_PAIRS = 6, 4, 3
"""Causes that are paired, by evidence and by least squares, and pairs that are taken further."""
REACH = 12.0
"""Nats behind the best at which a set is not followed."""
SHARES = 0.5, 0.1
"""Starts of a size, as shares of its default."""


@dataclass(eq=False)
class Explorer:
    """What was fitted so far."""

    fitter: Fitter
    causes: Sequence[Cause]
    progress: Callable[[str], None] = lambda message: None
    fitted: dict[frozenset[str], tuple[Hypothesis, ...]] = field(default_factory=dict)
    flat: dict[frozenset[str], tuple[np.ndarray, float]] = field(default_factory=dict)

    def beliefs(self) -> Beliefs:
        """Return what the data make of all that was fitted."""
        untried = tuple(cause.name for cause in self.causes if names_of((cause,)) not in self.fitted)
        return Beliefs(tuple(itertools.chain(*self.fitted.values())), len(self.causes), untried)

    def explore(self) -> Beliefs:
        """Return what the data make of the causes, after the hypotheses that are worth it were fitted."""
        if not self.fitted:
            self.base()
        self.causes = self._shown_causes()
        self.progress("fitting each cause alone")
        singles = [cause for cause in self.causes if self.fit((cause,))]
        for cause in singles:
            self._fit_discrepancy(self.fitted[names_of((cause,))][0])
        by_evidence = sorted(singles, key=lambda cause: -self.score((cause,)))
        by_squares = sorted(singles, key=lambda cause: self.flat[names_of((cause,))][1])
        leaders = list(dict.fromkeys([*by_evidence[:LEADING], *by_squares[:LEADING_FLAT]]))
        pairs = {names_of(pair): pair for pair in itertools.combinations(leaders, 2)}
        first = dict.fromkeys([*by_evidence[:2], *by_squares[:1]])
        with_each = ((lead, partner) for lead in first for partner in singles if partner is not lead)
        pairs |= {names_of(pair): pair for pair in with_each}
        self.progress("fitting pairs of causes")
        for pair in pairs.values():
            self.fit(pair)
        fitted_pairs = [pair for pair in pairs.values() if names_of(pair) in self.fitted]
        best_pairs = sorted(fitted_pairs, key=lambda pair: -self.score(pair))
        partners = list(dict.fromkeys([*leaders, *itertools.chain(*best_pairs[: 2 * LEADING_PAIRS])]))
        self.progress("fitting three causes at once")
        for pair in best_pairs[:LEADING_PAIRS]:
            if self.score(pair) < self.best_score() - REACH:
                break
            for partner in partners:
                if partner not in pair:
                    self.fit((*pair, partner))
        return self.beliefs()

    def score(self, causes: Sequence[Cause]) -> float:
        """Return the greatest logarithm of evidence times prior of a set of causes."""
        hypotheses = self.fitted.get(names_of(causes), ())
        return float(Beliefs(hypotheses, len(self.causes)).scores.max()) if hypotheses else -np.inf

    def best_score(self) -> float:
        """Return the greatest of all."""
        return float(self.beliefs().scores.max())

    def base(self) -> None:
        """Fit the base model, and raise the variance of outliers.

        Raises OptimisationError: no start leads to a fit.
        """
        start = self._declared_u()
        random = np.random.default_rng(0)
        starts = [start, *(start + random.uniform(-0.6, 0.6, (5, len(start))))]
        self._fit_all((), starts)
        if not self.fitted:
            raise OptimisationError("no start of the base model leads to a fit.", status=0)
        for _ in range(LOOKS):
            inflation = self._outlier_inflation()
            if inflation is None:
                return
            before = 1.0 if self.fitter.inflation is None else self.fitter.inflation
            self.fitter = replace(self.fitter, inflation=before * inflation)
            self.fitted.clear()
            self._fit_all((), [self.flat[frozenset()][0]])

    def _declared_u(self) -> np.ndarray:
        experiment, model = self.fitter.experiment, self.fitter.model
        return np.array([number.u(experiment.value(model, number.name)) for number in self.fitter.numbers])

    def _outlier_inflation(self) -> np.ndarray | None:
        """Return by how much each value's variance is raised, the farthest's; None where the others agree with all.

        Each is predicted by the others, a smooth discrepancy included; one that misses that by CLEAR SDs is an outlier.
        """
        *_, base = self.fitted[frozenset()]
        linear = base.linear
        precision = np.linalg.inv(base.covariance + linear.slopes @ linear.slopes.T)
        deviations = (precision @ linear.target) / np.sqrt(np.diag(precision))
        size = np.abs(deviations)
        return np.where(size == size.max(), (2.0 * size / CLEAR) ** 2, 1.0) if size.max() > CLEAR else None

    def _shown_causes(self) -> list[Cause]:
        """Return the causes that move what was measured at all, each of its default size."""
        fitter, start = self.fitter, self.flat[frozenset()][0]
        without, _ = fitter.predict_row(fitter.model, fitter.numbers, start)

        def moves(cause: Cause) -> bool:
            u = np.concatenate([start, _start_amplitudes(cause, 1.0)])
            response = (fitter.predict_row(*fitter.having((cause,)), u)[0] - without) / fitter.samples.sd
            return bool(np.linalg.norm(response[np.isfinite(response)]) > SHOWN)

        return [cause for cause in self.causes if moves(cause)]

    def fit(self, causes: Sequence[Cause]) -> bool:
        """Fit a set of causes, where that has a fit, and return whether it has."""
        names = names_of(causes)
        if names not in self.fitted:
            self._fit_all(tuple(causes), self._starts(causes))
        return names in self.fitted

    def _fit_all(self, causes: Sequence[Cause], starts: Sequence[np.ndarray]) -> None:
        """Fit a set that leaves nothing; of no cause or several also what leaves more, where that is near the best."""
        names = names_of(causes)
        try:
            self.flat[names] = self.fitter.flat(causes, starts)
            base_hypothesis = self.fitted[frozenset()][0] if causes else None
            plain = self.fitter.hypothesis(causes, self.flat[names][0], Discrepancy.NONE, base_hypothesis)
        except (OptimisationError, np.linalg.LinAlgError):
            return
        self.fitted[names] = (plain,)
        if len(causes) != 1:
            self._fit_discrepancy(plain)

    def _fit_discrepancy(self, plain: Hypothesis) -> None:
        """Fit a set with what it may leave besides noise, unless it is far behind."""
        if plain.causes and not self._is_near(plain.causes):
            return
        kinds = [Discrepancy.SMOOTH, *([Discrepancy.FORM] if plain.causes else [])]
        with suppress(OptimisationError, np.linalg.LinAlgError):
            more = tuple(self.fitter.hypothesis(plain.causes, plain.u, kind, plain) for kind in kinds)
            self.fitted[names_of(plain.causes)] = (plain, *more)

    def _is_near(self, causes: Sequence[Cause]) -> bool:
        """Return whether a set, leaving nothing, is within reach of the best of these, or of least squares."""
        plain = [self.fitted[names][0] for names in self.fitted]
        scores = Beliefs(tuple(plain), len(self.causes)).scores
        score = Beliefs(self.fitted[names_of(causes)], len(self.causes)).scores[0]
        closer = sum(loss < self.flat[names_of(causes)][1] for _, loss in self.flat.values())
        return bool(score > scores.max() - REACH) or closer < LEADING_FLAT

    def _starts(self, causes: Sequence[Cause]) -> list[np.ndarray]:
        """Return where fits begin: of one cause at shares of its size, of several where their parts ended."""
        base, declared = self.flat[frozenset()][0], self._declared_u()
        if len(causes) == 1:
            amplitudes = [_start_amplitudes(causes[0], share) for share in SHARES]
            return [*(np.concatenate([base, size]) for size in amplitudes), np.concatenate([declared, amplitudes[0]])]
        count = len(self.fitter.numbers)
        for cause in causes:
            self.fit((cause,))
        if any(names_of((cause,)) not in self.flat for cause in causes):
            return [np.concatenate([base, *(_start_amplitudes(cause, SHARES[0]) for cause in causes)])]
        parts = [self.flat[names_of((cause,))][0] for cause in causes]
        starts = [
            np.concatenate([lead[:count], *(part[count:] * (1.0 if part is lead else 0.3) for part in parts)])
            for lead in parts
        ]
        return starts[:2] if len(causes) == 2 else starts


def _start_amplitudes(cause: Cause, share: float) -> np.ndarray:
    """Return u of a cause's numbers with its amplitudes at a share of their default."""
    return np.array(
        [
            share / SIZE_SD if parameter.name in cause.amplitudes and not parameter.log else 0.0
            for parameter in cause.parameters
        ]
    )


def names_of(causes: Iterable[Cause]) -> frozenset[str]:
    """Return the names of causes."""
    return frozenset(cause.name for cause in causes)
