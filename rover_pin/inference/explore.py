"""Search the sets of causes for experiments with exact derivatives of the prediction: fit each cause alone, then pairs
of the leading causes, then the best triples.

A cause is an effect that the model lacks, a wrong declared number, or an error of the measurement. With exact
derivatives of the prediction by the parameters, a fit takes a fraction of a second, so that hundreds of sets are
fitted. Without exact derivatives, `discrepancy/search.py` fits only the promising sets.
"""

import itertools
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from rover_pin.base.errors import OptimisationError
from rover_pin.base.jobs.time_left import showing_progress
from rover_pin.estimation.profile import CLEAR_SDS
from rover_pin.inference.beliefs import Beliefs
from rover_pin.inference.cause import SIZE_SD, Cause
from rover_pin.inference.error_model import Discrepancy
from rover_pin.inference.hypothesis import Fitter, Hypothesis

MIN_VISIBLE_CHANGE = 0.3
"""Smallest change of the prediction by a cause of default size that is tried, as a norm over all samples in SDs of the
noise.

The data cannot show a cause with a smaller change: it would raise the log evidence by less than 0.05 nats (half the
squared norm)."""
MAX_OUTLIER_PASSES = 12
"""Maximum number of outlier passes. Each pass raises the variance of the largest outlier only, because the largest
outlier inflates the estimated noise and hides the others. Data with more outliers are fitted with the remaining ones; a
dozen passes suffice for the number of faulty samples that a data check lets through."""
LEADING, LEADING_FLAT, LEADING_PAIRS = 6, 4, 3
"""Limits of the search for sets of causes.

LEADING causes with the largest evidence, and LEADING_FLAT causes with the smallest loss of a least-squares fit, are
paired with each other. LEADING_PAIRS pairs are extended to triples. Larger numbers cost time in proportion to their
square and seldom find a better set (assumed)."""
MAX_SCORE_GAP = 12.0
"""Largest difference between the score of the best set of causes and the score of another set [nats]. Up to this value,
the other set is extended by further causes and is fitted with a discrepancy. A set farther behind is e^12, or 160,000,
times less probable, which one further cause seldom makes up."""
START_SIZES = 0.5, 0.1
"""Start values for the size of a cause in a fit, as fractions of its default size. The second start finds the minimum
if the linear model overestimates the size."""


@dataclass(eq=False)
class Explorer:
    """Searches for the sets of causes that explain the residual. It fits sets, keeps all fits, and decides which sets
    are fitted next.
    """

    fitter: Fitter
    causes: Sequence[Cause]
    progress: Callable[[str], None] = lambda message: None
    fitted: dict[frozenset[str], tuple[Hypothesis, ...]] = field(default_factory=dict)
    """names of the causes of a fitted set -> its hypotheses; the hypothesis without a discrepancy comes first"""
    flat: dict[frozenset[str], tuple[np.ndarray, float]] = field(default_factory=dict)
    """result of a first, cheap fit of each set of causes that treats all errors as independent: fitted parameters u and
    loss, by the names of the causes"""

    def beliefs(self) -> Beliefs:
        """Return the probabilities of all hypotheses that were fitted so far."""
        untried = tuple(cause.name for cause in self.causes if names_of((cause,)) not in self.fitted)
        return Beliefs(tuple(itertools.chain(*self.fitted.values())), len(self.causes), untried)

    def explore(self) -> Beliefs:
        """Fit the base model and all promising sets of causes, and return the probabilities of the hypotheses."""
        if not self.fitted:
            self.base()
        # Causes that cannot be seen are dropped first, because each costs a fit and dilutes the prior of the others.
        # A cause counts as visible if its default size changes the prediction by more than MIN_VISIBLE_CHANGE.
        fitter, start = self.fitter, self.flat[frozenset()][0]
        without, _ = fitter.predict_row(fitter.model, fitter.numbers, start)
        visible = []
        for cause in self.causes:
            u = np.concatenate([start, _start_amplitudes(cause, 1.0)])
            response = (fitter.predict_row(*fitter.having((cause,)), u)[0] - without) / fitter.samples.sd
            if np.linalg.norm(response[np.isfinite(response)]) > MIN_VISIBLE_CHANGE:
                visible.append(cause)
        self.causes = visible
        self.progress("fitting each cause alone")
        singles = [
            cause
            for cause in showing_progress(self.causes, len(self.causes), "fitting each cause alone")
            if self.fit((cause,))
        ]
        # Discrepancies are fitted only after all causes, because only then the best cause alone is known.
        for cause in showing_progress(singles, len(singles), "fitting the discrepancy of each cause"):
            self._fit_discrepancy(self.fitted[names_of((cause,))][0])
        # A cause that is poor alone can be part of the best pair. So causes that lead by least squares are paired as
        # well, because only the prior of their size may lower their evidence. The best causes are paired with all
        # others.
        by_evidence = sorted(singles, key=lambda cause: -self.score((cause,)))
        by_squares = sorted(singles, key=lambda cause: self.flat[names_of((cause,))][1])
        leaders = list(dict.fromkeys([*by_evidence[:LEADING], *by_squares[:LEADING_FLAT]]))
        pairs = {names_of(pair): pair for pair in itertools.combinations(leaders, 2)}
        first = dict.fromkeys([*by_evidence[:2], *by_squares[:1]])
        with_each = ((lead, partner) for lead in first for partner in singles if partner is not lead)
        pairs |= {names_of(pair): pair for pair in with_each}
        self.progress("fitting pairs of causes")
        for pair in showing_progress(pairs.values(), len(pairs), "fitting pairs of causes"):
            self.fit(pair)
        # The best pairs are extended by causes that lead alone or in other good pairs.
        fitted_pairs = [pair for pair in pairs.values() if names_of(pair) in self.fitted]
        best_pairs = sorted(fitted_pairs, key=lambda pair: -self.score(pair))
        partners = list(dict.fromkeys([*leaders, *itertools.chain(*best_pairs[: 2 * LEADING_PAIRS])]))
        self.progress("fitting three causes at once")
        for place, pair in enumerate(best_pairs[:LEADING_PAIRS], 1):
            # The pairs are sorted, so that all further pairs are too improbable as well.
            if self.score(pair) < self.best_score() - MAX_SCORE_GAP:
                break
            others = [partner for partner in partners if partner not in pair]
            what = f"fitting three causes at once, pair {place} of {min(len(best_pairs), LEADING_PAIRS)}"
            for partner in showing_progress(others, len(others), what):
                self.fit((*pair, partner))
        return self.beliefs()

    def score(self, causes: Sequence[Cause]) -> float:
        """Return the score of a set of causes: its largest log evidence plus log prior [nats] over all kinds of
        discrepancy.

        The score is -inf if no fit of the set converged.
        """
        hypotheses = self.fitted.get(names_of(causes), ())
        return float(Beliefs(hypotheses, len(self.causes)).scores.max()) if hypotheses else -np.inf

    def best_score(self) -> float:
        """Return the largest score (log evidence plus log prior) of all hypotheses that were fitted so far [nats]."""
        return float(self.beliefs().scores.max())

    def base(self) -> None:
        """Fit the base model, and raise the noise variance of outliers, one outlier after the other.

        Raises OptimisationError if the fit converges from none of its start values.
        """
        # Several starts around the declared numbers, because the loss of a wheel's laws has local minima.
        start = self._declared_u()
        random = np.random.default_rng(0)
        starts = [start, *(start + random.uniform(-0.6, 0.6, (5, len(start))))]
        self._fit_all((), starts)
        if not self.fitted:
            raise OptimisationError(
                "the fit of the base model converged from none of its start values; fit fewer parameters.", status=0
            )
        for _ in range(MAX_OUTLIER_PASSES):
            inflation = self._outlier_inflation()
            if inflation is None:
                return
            # With another variance all evidence changes, so that everything is fitted again.
            before = 1.0 if self.fitter.inflation is None else self.fitter.inflation
            fitter, self.fitter = self.fitter, replace(self.fitter, inflation=before * inflation)
            fitted = self.fitted.pop(frozenset())
            self._fit_all((), [self.flat[frozenset()][0]])
            if frozenset() not in self.fitted:
                # If no fit converges with the larger variance, the last successful fit is kept.
                self.fitter, self.fitted[frozenset()] = fitter, fitted
                return

    def _declared_u(self) -> np.ndarray:
        """Return the declared parameters of the base model, before any fit, as u (parameters,) in units of their prior
        SD.
        """
        experiment, model = self.fitter.experiment, self.fitter.model
        return np.array([number.u(experiment.value(model, number.name)) for number in self.fitter.numbers])

    def _outlier_inflation(self) -> np.ndarray | None:
        """Return the factor (n,) on the noise variance of each sample that outliers require, or None if no outlier
        remains.

        Only the largest outlier gets a factor above 1; it hides the others. An outlier is a sample that deviates by
        more than CLEAR_SDS SDs from its prediction by the base model with a smooth discrepancy, fitted to all other
        samples.
        """
        *_, base = self.fitted[frozenset()]
        linear = base.linear
        # For Q = (C + J J')^-1, the residual of sample i against the prediction of all other samples is (Q r)_i / Q_ii,
        # with the variance 1 / Q_ii.
        precision = np.linalg.inv(base.covariance + linear.slopes @ linear.slopes.T)
        deviations = (precision @ linear.target) / np.sqrt(np.diag(precision))
        size = np.abs(deviations)
        return np.where(size == size.max(), (2.0 * size / CLEAR_SDS) ** 2, 1.0) if size.max() > CLEAR_SDS else None

    def fit(self, causes: Sequence[Cause]) -> bool:
        """Fit a set of causes unless it was fitted before, and return whether the set has a converged fit."""
        names = names_of(causes)
        if names not in self.fitted:
            self._fit_all(tuple(causes), self._starts(causes))
        return names in self.fitted

    def _fit_all(self, causes: Sequence[Cause], starts: Sequence[np.ndarray]) -> None:
        """Fit a set of causes without a discrepancy; if the set is promising, also fit it with each kind of
        discrepancy.

        A single cause is fitted with discrepancies only later, after all single causes have been fitted. `starts` are
        the initial parameters u of the descent.
        """
        names = names_of(causes)
        try:
            # A cheap fit finds the region of the minimum, a fit with the full covariance of the errors refines it.
            self.flat[names] = self.fitter.flat(causes, starts)
            base_hypothesis = self.fitted[frozenset()][0] if causes else None
            plain = self.fitter.hypothesis(causes, self.flat[names][0], Discrepancy.NONE, base_hypothesis)
        except (OptimisationError, np.linalg.LinAlgError):
            return
        self.fitted[names] = (plain,)
        if len(causes) != 1:
            self._fit_discrepancy(plain)

    def _fit_discrepancy(self, plain: Hypothesis) -> None:
        """Fit a set of causes with each kind of discrepancy, unless the set is far behind the best set (see
        `_is_near`).

        `plain` is the fitted hypothesis of the set without a discrepancy.
        """
        if plain.causes and not self._is_near(plain.causes):
            return
        # An error of form needs a law of a cause; the base model alone has none.
        kinds = [Discrepancy.SMOOTH, *([Discrepancy.FORM] if plain.causes else [])]
        with suppress(OptimisationError, np.linalg.LinAlgError):
            more = tuple(self.fitter.hypothesis(plain.causes, plain.u, kind, plain) for kind in kinds)
            self.fitted[names_of(plain.causes)] = (plain, *more)

    def _is_near(self, causes: Sequence[Cause]) -> bool:
        """Return whether a set of causes, without a discrepancy, is close enough to the best set to be fitted with a
        discrepancy.

        The set is close if its score is within MAX_SCORE_GAP of the best score. It is also close if fewer than
        LEADING_FLAT sets have a smaller loss in the first fit, which treats all errors as independent.
        """
        hypotheses = [self.fitted[names][0] for names in self.fitted]
        scores = Beliefs(tuple(hypotheses), len(self.causes)).scores
        score = Beliefs(self.fitted[names_of(causes)], len(self.causes)).scores[0]
        # A set may be poor only because its errors look correlated without a discrepancy; its least-squares loss shows
        # that.
        closer = sum(loss < self.flat[names_of(causes)][1] for _, loss in self.flat.values())
        return bool(score > scores.max() - MAX_SCORE_GAP) or closer < LEADING_FLAT

    def _starts(self, causes: Sequence[Cause]) -> list[np.ndarray]:
        """Return the initial points of the fit of a set of causes, each as an array u (parameters,).

        A single cause starts from several sizes, at the fitted and at the declared parameters of the base model.
        Several causes start from the fits of each cause alone.
        """
        base, declared = self.flat[frozenset()][0], self._declared_u()
        if len(causes) == 1:
            amplitudes = [_start_amplitudes(causes[0], share) for share in START_SIZES]
            return [*(np.concatenate([base, size]) for size in amplitudes), np.concatenate([declared, amplitudes[0]])]
        count = len(self.fitter.numbers)
        for cause in causes:
            self.fit((cause,))
        if any(names_of((cause,)) not in self.flat for cause in causes):
            return [np.concatenate([base, *(_start_amplitudes(cause, START_SIZES[0]) for cause in causes)])]
        # Start from the fit of each cause alone, with the other causes at 30 % of their size: together they share what
        # each explained alone.
        parts = [self.flat[names_of((cause,))][0] for cause in causes]
        starts = [
            np.concatenate([lead[:count], *(part[count:] * (1.0 if part is lead else 0.3) for part in parts)])
            for lead in parts
        ]
        return starts[:2] if len(causes) == 2 else starts


def _start_amplitudes(cause: Cause, share: float) -> np.ndarray:
    """Return start values u (parameters,) for the parameters of a cause.

    A size starts at the fraction `share` of its default size, every other parameter at the mean of its prior.
    """
    return np.array(
        [
            share / SIZE_SD if parameter.name in cause.amplitudes and not parameter.log else 0.0
            for parameter in cause.parameters
        ]
    )


def names_of(causes: Iterable[Cause]) -> frozenset[str]:
    """Return the names of some causes as a frozenset, the key of their fit in `Explorer.fitted`."""
    return frozenset(cause.name for cause in causes)
