"""Search the sets of causes for experiments without exact derivatives of the prediction by the parameters: fit the most
promising set, estimate the evidence of the other sets, and repeat.

A fit takes minutes on a drive log, so that only a few of the many sets can be fitted. Around each fit the prediction is
treated as linear: the signatures of the candidates (the changes of the prediction that they make) give the evidence of
every set that adds one or two candidates to the fit. The most promising set is fitted next. Its fit gives its true
evidence and new estimates of the sets that extend it. The search ends when no estimate of an unfitted set comes near
the best fit.

An effect that may act at any place along the path has the prior probability of any other effect, divided among its
places.
"""

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from rover_pin.base.errors import OptimisationError
from rover_pin.discrepancy.question import Progress
from rover_pin.discrepancy.signature import Option, Signature, alone, options, signatures, singles
from rover_pin.estimation.columns import Columns
from rover_pin.estimation.experiment import Experiment, model_at, slopes_at
from rover_pin.estimation.fit import Fit, again, fit
from rover_pin.estimation.least_squares import Task
from rover_pin.estimation.minimum import to_minimum
from rover_pin.estimation.noise import first_noise
from rover_pin.estimation.parameter import Parameter
from rover_pin.estimation.profile import CLEAR_SDS, CONFIDENCE, MAX_CHI_SQUARE
from rover_pin.estimation.random_effects.learnt_noise import with_noise
from rover_pin.estimation.residual import residual
from rover_pin.inference.beliefs import Beliefs, SearchEnd
from rover_pin.inference.cause import Cause
from rover_pin.inference.expansion import Expansion
from rover_pin.inference.linear_hypothesis import LinearHypothesis, linear_hypothesis, with_function
from rover_pin.inference.priors import COUNT_PRIORS
from rover_pin.inference.residual_function import with_functions

FIRST_EDGE_STEP, LAST_EDGE_STEP = 0.08, 0.02
"""First and last displacement [m] of the edges of a local effect's stretch of path, in the search for its best place.

The last step is near the distance that a rover drives between two samples (0.025 m in half a second); the data cannot
place an edge more finely."""
RETRY_SIZE = 0.1
"""Initial size of a cause in a repeated fit, as a fraction of its estimated size. A fit is repeated if it ended with a
larger chi2 than the fit without the cause. The estimated size was then too large for the linear model; at a tenth of
this size the linear model is accurate enough for a start."""


def fitted_with(
    estimate: LinearHypothesis, options: Mapping[str, Option], reuse: bool
) -> tuple[tuple[Cause, ...], Fit] | None:
    """Fit a set of causes whose evidence was only estimated so far, and return the causes with the fit; None if no fit
    converges.

    Parameters
    ----------
    estimate : LinearHypothesis
        The set of causes. The new fit starts from the fit around which the set was estimated, with the added causes at
        their estimated sizes.
    options : mapping
        Name of each candidate -> the candidate at its best place.
    reuse : bool
        Whether the new fit keeps the derivatives of the prediction from the earlier fit instead of computing them
        again.
    """
    # The posterior lists the estimated sizes last.
    start, u_added = estimate.fit, estimate.posterior.mean[len(estimate.parameters) - len(estimate.extra) :]
    experiment, model = start.task.experiment, start.model
    causes = [cause for cause in estimate.causes if cause.name not in estimate.added]
    numbers, u, slopes = list(start.parameters), list(start.u), dict(start.slopes)
    first_added = len(numbers)
    for name, size in zip(estimate.added, u_added, strict=True):
        # Add the cause at its best place, with its size from the linear model as the start of the fit.
        signature = place_edges(start, options[name])
        cause = signature.candidate.cause
        model = experiment.with_values(cause.on(model), signature.start_numbers(float(size)))
        # A number that a cause frees is replaced by the cause's own version of it, which has a wider prior.
        for released in [number for number in numbers if number.name in cause.amplitudes]:
            position = numbers.index(released)
            numbers.pop(position), u.pop(position), slopes.pop(released.name)
            first_added -= 1
        numbers += cause.parameters
        u += [number.u(experiment.value(model, number.name)) for number in cause.parameters]
        causes.append(replace(cause, name=name))
    try:
        fitted = fit(start.task, model, numbers, np.array(u), slopes, reuse)
        if fitted.chi2 > start.chi2:
            # The estimated size was too large for the linear model, so the fit is repeated from a small size.
            small = [
                x * RETRY_SIZE if position >= first_added and not numbers[position].log else x
                for position, x in enumerate(u)
            ]
            attempt = fit(start.task, model, numbers, np.array(small), slopes, reuse)
            fitted = min(fitted, attempt, key=lambda ending: ending.chi2)
    except OptimisationError:
        return None
    return tuple(causes), fitted


def place_edges(start: Fit, option: Option) -> Signature:
    """Move the edges of a local effect's stretch along the path to the best place, and return the signature of the
    effect there.

    `option` is a candidate that may be added to the fit `start`; a candidate without a searched place keeps its
    signature. The search goes by steps, because an edge changes the prediction only when a wheel passes the edge, so
    that the derivative of the prediction by the position of the edge is zero or jumps.
    """
    signature, step, gain = option.signature, FIRST_EDGE_STEP, -math.inf
    # The step is halved when no neighbour is better; the present stretch is evaluated in the first pass only.
    while step > LAST_EDGE_STEP and (neighbours := start.task.experiment.neighbours(signature.candidate, step)):
        rows = signatures(start, [*neighbours, *([signature.candidate] if gain == -math.inf else [])])
        gains = singles(start, rows)
        best = int(np.argmax(gains))
        if gains[best] > gain:
            signature, gain = rows[best], gains[best]
        else:
            step /= 2
    return signature


def part_of(base: Fit, whole: LinearHypothesis, part: frozenset[str]) -> tuple[tuple[Cause, ...], Fit | None]:
    """Fit a subset of a set's causes, starting from the fit of the whole set.

    Parameters
    ----------
    base : Fit
        Fit of the base model.
    whole : LinearHypothesis
        The whole set, fitted.
    part : frozenset of str
        Names of the causes of the subset.

    Returns
    -------
    tuple
        The causes of the subset, and their fit, or None instead of the fit if it does not converge.
    """
    # The subset is built anew from the base model; its parameters start at the values that they have in the whole set.
    causes = tuple(cause for cause in whole.causes if cause.name in part)
    added = [parameter for cause in causes for parameter in cause.parameters]
    others = [number for number in base.parameters if number.name not in {parameter.name for parameter in added}]
    numbers, model = (*others, *added), base.model
    for cause in causes:
        model = cause.on(model)
    u = np.array([number.u(whole.fit.value(number.name)) for number in numbers])
    slopes = {number.name: whole.fit.slopes[number.name] for number in whole.fit.parameters if number in numbers}
    try:
        return causes, fit(base.task, model, numbers, u, slopes)
    except OptimisationError:
        return causes, None


def calibrate(experiment: Experiment, model: Any, numbers: Sequence[Parameter]) -> Fit:
    """Fit the uncertain parameters of the base model, and return the fit.

    If the experiment declares no noise, the noise is estimated twice: first from the residual of the model with its
    declared parameters, then from the smaller residual of the first fit.
    """
    declared = experiment.noise()
    if declared is not None:
        return again(fit(Task(experiment, declared), model, numbers))
    # No declared noise: the residual of the declared model gives a first, too large noise.
    initial_residual = residual(experiment.observed, experiment.predict([model])[0])
    minimum = experiment.least_noise(model)
    base = fit(Task(experiment, first_noise(initial_residual, minimum)), model, numbers)
    return again(with_noise(base, base.residual, minimum))


def is_bent(fitted: Fit) -> bool:
    """Return whether at least one fitted parameter lies more than CLEAR_SDS prior SDs from its prior mean.

    Such a parameter may compensate for a missing effect.
    """
    return any(parameter.prior and abs(u) > CLEAR_SDS for parameter, u in zip(fitted.parameters, fitted.u, strict=True))


def as_declared(fitted: Fit) -> Fit:
    """Return the fit with some fitted values undone: each parameter with a prior has its declared or assumed value
    again.

    Sizes of effects, which have no prior, keep their fitted values. The prediction and its derivatives are computed
    again at these parameter values.
    """
    experiment, parameters = fitted.task.experiment, fitted.parameters
    u = np.array([0.0 if parameter.prior else x for parameter, x in zip(parameters, fitted.u, strict=True)])
    model = model_at(experiment, fitted.model, parameters, u)

    def predict_declared() -> dict[str, np.ndarray]:
        slopes = slopes_at(experiment, model, parameters, u)
        return {"predicted": experiment.predict([model])[0], "slopes": slopes}

    # The slopes of a drive log take minutes, so the experiment stores them for a loop that is stopped and continued.
    cached = experiment.cached_arrays(("as declared", model, parameters, u), predict_declared)
    slopes = dict(zip([parameter.name for parameter in parameters], cached["slopes"], strict=True))
    return Fit(fitted.task, model, parameters, u, cached["predicted"], slopes)


MAX_FITS = 12
"""Number of sets of causes that are fitted first. A further set is fitted only if its estimated score is higher than
the scores of all fitted sets. Each fit of a drive log takes minutes. The probable sets are assumed to be among the
first twelve fitted ones."""
FIT_MARGIN = 5.0
"""Largest difference between the best score of a fitted set and the estimated score of another set [nats], at which the
other set is still fitted. An estimate is assumed to be wrong by less than 5 nats, a factor of 150 in probability."""
FOLLOW_MARGIN = 20.0
"""Largest difference between the best score of a fitted set and the estimated score of another set [nats], at which the
other set is kept at all. e^-20 is 2e-9, so that even many sets beyond this margin together have no visible probability.
"""
MAX_PREDICTIONS = 3000
"""Largest number of models that the fits of a search predict. When they are spent, no further set of causes is fitted,
and the answer states which sets were left out.

The searches on the drive logs of the tests predict 190 to 290 models. A search that needs ten times as many goes from
one local minimum to the next."""
FITS_FROM_DECLARED = 6
"""Maximum number of causes whose fit is also started from the declared parameters of the base model. This is done if
fitted parameters lie far outside their priors, or if the residual of the base model is no noise. The causes with the
highest evidence at the declared values are chosen; each further fit would cost minutes."""
Names = frozenset[str]
"""Names of the causes of a set."""


@dataclass(eq=False)
class Search:
    """Searches for the sets of causes that explain the residual: fits promising sets, and keeps the best estimate of
    every set that is not fitted.

    The score of a set is its log evidence plus its log prior [nats].
    """

    base: Fit
    progress: Progress = lambda message: None
    budget: int = MAX_PREDICTIONS
    """largest number of models that are predicted"""
    predictions: int = 0
    """number of models that were predicted so far"""
    options: dict[str, Option] = field(default_factory=dict)
    """name of each candidate -> the candidate at its best place"""
    fitted: dict[Names, list[LinearHypothesis]] = field(default_factory=dict)
    """hypotheses of each fitted set of causes: first the one without a remaining discrepancy, and after a call of
    `leave` also the one with a discrepancy"""
    estimates: dict[Names, LinearHypothesis] = field(default_factory=dict)
    """best estimate of each set of causes whose evidence was estimated from the linear model around another fit"""
    finished: set[Names] = field(default_factory=lambda: {frozenset()})
    """sets of causes whose fit was completed: the derivatives were computed again at its end. The empty set (the base
    model) counts as completed from the start"""
    parted: set[Names] = field(default_factory=set)
    """sets of causes whose subsets were also fitted, starting from the fit of the whole set"""
    shortfalls: dict[str, float] = field(default_factory=dict)
    """name of a cause -> excess [nats] of estimates with this cause: the smallest difference between the estimated log
    evidence and the log evidence of the fit. The excess is subtracted from further estimates with this cause. The
    difference arises if the change of the prediction is not proportional to the size of the effect"""
    lost: set[Names] = field(default_factory=set)
    """sets of causes for which no fit converged"""
    falls: dict[Names, float] = field(default_factory=dict)
    """sets of causes whose fit did not reach its minimum, although it was completed -> decrease of chi2 that a tested
    point near its end still shows"""

    @property
    def is_spent(self) -> bool:
        """Whether the budget of predictions is spent, so that nothing more is fitted."""
        return self.predictions >= self.budget

    def beliefs(self) -> Beliefs:
        """Return the probabilities of all sets of causes, fitted or estimated. Sets whose estimated score is more than
        FOLLOW_MARGIN below the best score are dropped.
        """
        best = self.best_score()
        estimates = [row for row in self._open() if self.score(row) > best - FOLLOW_MARGIN]
        untried = tuple(name for name in self.options if frozenset((name,)) in self.lost)
        # If the budget is spent, a set may have an estimate above every fit. Without a fit it cannot be kept, so the
        # answer names it as a set that was left out.
        left_out = [row for row in estimates if self.is_spent and self.score(row) > best]
        hypotheses = (*itertools.chain(*self.fitted.values()), *(row for row in estimates if row not in left_out))
        unfitted = tuple(row.names for row in sorted(left_out, key=lambda row: -self.score(row)))
        end = SearchEnd(self.predictions, self.budget, unfitted, dict(self.falls))
        return Beliefs(hypotheses, max(len(self.options), 1), untried, end=end)

    def _open(self) -> list[LinearHypothesis]:
        """Return the estimates of the sets of causes that are not fitted, corrected by `shortfalls`.

        The log evidence is reduced by these amounts, because earlier estimates with these causes were too high.
        """
        rows = [row for names, row in self.estimates.items() if names not in self.fitted and names not in self.lost]
        return [
            replace(row, log_evidence=row.log_evidence - sum(self.shortfalls.get(name, 0.0) for name in row.added))
            for row in rows
        ]

    def run(self, rows: Sequence[Signature]) -> Beliefs:
        """Search the sets of causes that can be formed from the given candidates, and return the probabilities of the
        hypotheses.

        `rows` are the signatures of the candidates: the changes of the prediction that they make.
        """
        self.progress("estimating the evidence of each candidate and of pairs")
        self.options = {option.candidate.name: option for option in options(self.base, rows)}
        # If fitted parameters of the base model lie far outside their priors, or if its residual is no noise, the
        # parameters may imitate the missing effect, so that the right candidate improves nothing at the fitted values:
        # a tank does not overflow at a fitted level below its rim. At the declared values the whole effect is visible,
        # so the candidates are then also estimated there, each at its best place for these values.
        declared, at_declared = self.base, list[Option]()
        if is_bent(self.base) or self.base.misfit > MAX_CHI_SQUARE:
            self.progress("estimating every candidate at the declared numbers too")
            declared = as_declared(self.base)
            candidates = list(dict.fromkeys(row.candidate for row in rows))
            at_declared = options(declared, signatures(declared, candidates), is_optimum=False)
            listed = {option.candidate.anywhere for option in self.options.values()}
            new = [option for option in at_declared if option.candidate.anywhere not in listed]
            self.options |= {option.candidate.name: option for option in new}
        self._note((), self.base)
        # The most promising causes are fitted from the declared values and, if they were estimated, from the fitted
        # ones; the better end is kept.
        estimates = alone(declared, at_declared, is_optimum=False) if at_declared else []
        for row in sorted(estimates, key=lambda row: -row.log_evidence)[:FITS_FROM_DECLARED]:
            names = frozenset(row.names)
            if row.names[0] not in self.options or self.is_spent:
                continue
            starts = [row, *([self.estimates[names]] if names in self.estimates else [])]
            ends = [fitted for fitted in (fitted_with(estimate, self.options, True) for estimate in starts) if fitted]
            self.predictions += sum(fitted.predictions for _, fitted in ends)
            if ends:
                self._note(*min(ends, key=lambda ending: ending[1].chi2))
        # Each step changes the probabilities, so the cheapest useful step is chosen again after every fit.
        while not self.is_spent and (self._end_promising() or self._fit_worthiest() or self._end_likely()):
            pass
        return self.beliefs()

    def _fit_worthiest(self) -> bool:
        """Fit the most promising set of causes, and return True. If no set has an estimated score near the best
        score, nothing is fitted, and the result is False.

        If the set is a pair of causes whose score was estimated from the fit of the base model, the more promising
        cause is fitted alone first. This cause may suffice, and its fit gives a better estimate of the pair.
        """
        # Large residuals count less than squared (Huber's loss), so an estimate from a fit with large residuals is too
        # low. `rises` has, for each expansion around a fit, the largest excess [nats] of the log evidence of another
        # fit over its estimate from this expansion. The excess is added to the further estimates from this expansion.
        rises: dict[int, float] = {}
        margin = 0.0
        # With few fits there is time for doubtful sets: the margin is wide, and estimates that were too low are raised.
        # After MAX_FITS fits, the estimated score must be higher than the best score.
        if len(self.fitted) <= MAX_FITS:
            margin = FIT_MARGIN
            for fitted_names in self.fitted.keys() & self.estimates.keys():
                estimate = self.estimates[fitted_names]
                rise, key = self.fitted[fitted_names][0].log_evidence - estimate.log_evidence, id(estimate.expansion)
                rises[key] = max(rises.get(key, 0.0), rise if rise > FIT_MARGIN else 0.0)
        tried = {
            frozenset(estimate.names): self.score(estimate) + rises.get(id(estimate.expansion), 0.0)
            for estimate in self._open()
            # A set is tried only if the added causes raise the evidence of the fit from which the set was estimated.
            if estimate.log_evidence > self.fitted[frozenset(estimate.names) - set(estimate.added)][0].log_evidence
        }
        names = max(tried, key=lambda names: tried[names], default=frozenset[str]())
        if not names or tried[names] <= self.best_score() - margin:
            return False
        # A pair is not fitted before its more promising cause was fitted alone.
        added = self.estimates[names].added
        alone = [frozenset((name,)) for name in added] if len(added) > 1 else []
        missing = [part for part in alone if part not in self.fitted and part not in self.lost]
        self.fit(max(missing, key=lambda part: self.score(self.estimates[part]), default=names))
        return True

    def _end_promising(self) -> bool:
        """Complete each unfinished fit that may still exceed the best score by more than FIT_MARGIN, and return whether
        there was such a fit.

        In an unfinished fit, the loss may still decrease by the amount that its derivatives predict.
        """
        # A fit with reused derivatives may have stopped early; only fits that can still win are continued.
        best = self.best_score()
        promising = [
            names
            for names, rows in self.fitted.items()
            if names not in self.finished and self.score(rows[0]) + rows[0].expansion.promised > best + FIT_MARGIN
        ]
        for names in promising:
            self._end(names)
        return bool(promising)

    def _end_likely(self) -> bool:
        """Complete the fit of one probable set of causes, or fit the subsets of a probable set, and return whether
        there was anything to do.

        Sets with few causes come first.
        """
        # The probabilities are computed again each time, because a completed fit of a part can make the set unlikely.
        sets = self.beliefs().sets
        likely = sorted((names for names in self.fitted if sets[names] > 1.0 - CONFIDENCE), key=len)
        unfinished = [names for names in likely if names not in self.finished][:1]
        undivided = [] if unfinished else [names for names in likely if len(names) > 1 and names not in self.parted][:1]
        for names in unfinished:
            self._end(names)
        for names in undivided:
            self.parted.add(names)
            for name in names:
                # Fit the set without one cause from the best fit of the set; other starts may have ended in a worse
                # local minimum.
                part = names - {name}
                causes, fitted = part_of(self.base, self.fitted[names][0], part)
                self.predictions += 0 if fitted is None else fitted.predictions
                if fitted is not None and (part not in self.fitted or fitted.chi2 < self.fitted[part][0].fit.chi2):
                    self.finished.discard(part)
                    self._note(causes, fitted)
        return bool(unfinished or undivided)

    def score(self, hypothesis: LinearHypothesis) -> float:
        """Return the log evidence plus the log prior of a hypothesis [nats]."""
        return float(Beliefs((hypothesis,), max(len(self.options), 1)).scores[0])

    def best_score(self) -> float:
        """Return the largest score of all fitted sets [nats]."""
        return max(self.score(rows[0]) for rows in self.fitted.values())

    def _note(self, causes: Sequence[Cause], fitted: Fit) -> None:
        """Store the fit of a set of causes, and estimate from it the evidence of every set with one more cause.

        Every set of two causes is also estimated, from the fit of the base model.
        """
        # One expansion with the columns of all candidates serves all estimates from this fit.
        columns = [option.column for option in self.options.values()]
        expansion = Expansion(fitted, np.array(columns).T if columns else np.zeros((len(fitted.rows), 0)))
        # Estimates from this fit replace estimates from fits with fewer causes, because this fit is closer to the set.
        names = frozenset(cause.name for cause in causes)
        self.fitted[names] = [self._hypothesis(causes, expansion)]
        if len(names) == len(COUNT_PRIORS) - 1:
            return
        # Sets that are far behind are not stored, except for single additional causes.
        others = [name for name in self.options if name not in names]
        sets = [(name,) for name in others] + ([] if names else [*itertools.combinations(others, 2)])
        evidence = [expansion.posterior(self._places(added)).log_evidence for added in sets]
        least = max([*evidence, self.fitted[names][0].posterior.log_evidence]) - FOLLOW_MARGIN
        for added, log_evidence in zip(sets, evidence, strict=True):
            wider = names | set(added)
            estimate = self.estimates.get(wider)
            is_nearer = estimate is None or len(estimate.causes) - len(estimate.extra) <= len(names)
            if is_nearer and (len(added) == 1 or log_evidence > least):
                self.estimates[wider] = self._hypothesis(causes, expansion, added)

    def _places(self, added: Sequence[str]) -> list[int]:
        """Return the column index of each of the candidates with the names `added` in an expansion's matrix of further
        causes.
        """
        names = [*self.options]
        return [names.index(name) for name in added]

    def _hypothesis(self, causes: Sequence[Cause], expansion: Expansion, added: Sequence[str] = ()) -> LinearHypothesis:
        """Return a hypothesis that is linear around a fit of the given causes.

        Its set of causes consists of the fitted `causes` and of the candidates named in `added`, whose sizes are
        estimated from the expansion around the fit.
        """
        # An effect with a searched place pays for the choice of the place (`log_places`).
        partial = [self.options[name].size for name in added]
        hypothesis = linear_hypothesis((*causes, *partial), expansion, self._places(added), partial)
        more = sum(self.options[name].log_places for name in hypothesis.names)
        return replace(hypothesis, log_evidence=hypothesis.log_evidence + more)

    def fit(self, names: Names) -> None:
        """Fit the set of causes with these names, starting from the fit around which the set was estimated, and store
        the fit.
        """
        self.progress(f"fitting {' + '.join(sorted(names))}")
        estimate = self.estimates[names]
        fitted = fitted_with(estimate, self.options, True)
        if fitted is None:
            self.lost.add(names)
            return
        self.predictions += fitted[1].predictions
        self._note(*fitted)
        # A fit far below its estimate may have failed because of reused slopes, so it is repeated with new slopes.
        if self.fitted[names][0].log_evidence < estimate.log_evidence - FIT_MARGIN:
            repeated = fitted_with(estimate, self.options, False)
            self.predictions += 0 if repeated is None else repeated[1].predictions
            if repeated is not None and repeated[1].chi2 < fitted[1].chi2:
                self._note(*repeated)
        # A single added cause shows how far its estimates are too optimistic.
        if len(estimate.added) == 1:
            (name,) = estimate.added
            fall = max(estimate.log_evidence - self.fitted[names][0].log_evidence, 0.0)
            self.shortfalls[name] = min(self.shortfalls.get(name, fall), fall)

    def _end(self, names: Names) -> None:
        """Complete the fit of the set of causes with these names: compute all derivatives of the prediction again,
        continue to the minimum, and test it along the parameters of the causes.
        """
        self.finished.add(names)
        self.progress(f"completing the fit of {' + '.join(sorted(names))}")
        causes = self.fitted[names][0].causes
        end = to_minimum(self.fitted[names][0].fit, [number.name for cause in causes for number in cause.parameters])
        self.predictions += end.predictions
        self.falls.pop(names, None)
        if end.fall:
            self.falls[names] = end.fall
        self._note(causes, end.fit)

    def leave(self, functions: Iterable[Columns]) -> None:
        """Add to every fitted set of causes a second hypothesis: that an unlisted function of the inputs acts in
        addition, so that a discrepancy remains.

        This can change the order of the sets: without the second hypothesis, a set with one more cause may lead only
        because the additional cause absorbs the discrepancy. `functions` are the unlisted functions, each given as
        whitened columns.
        """
        # All fits are compared with the same functions, which are generated only once.
        plain = [rows[0] for rows in self.fitted.values()]
        evidence = with_functions([(row.expansion, row.posterior) for row in plain], functions)
        for row, of_row in zip(plain, evidence, strict=bool(evidence)):
            self.fitted[frozenset(row.names)].append(with_function(row, of_row))
