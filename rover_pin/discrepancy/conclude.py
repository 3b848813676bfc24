"""The whole loop for any kind of data: fit the base model, search the missing causes, decide the answer, and test the
kept model on held-out data.

A cause is an effect that the model lacks, a wrong declared number, or an error of the measurement. The kept model is
the base model with the causes of the answer.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from rover_pin.base.errors import OptimisationError
from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.candidate import is_effect
from rover_pin.discrepancy.confirm import confirmed, declared_fit
from rover_pin.discrepancy.decision import beyond_noise, likeliest, sentence
from rover_pin.discrepancy.draft import Draft, draft_of, score_draft
from rover_pin.discrepancy.equivalents import equivalents
from rover_pin.discrepancy.held_out_errors import HeldOut, fold_errors, held_out, lost_folds, taken_share
from rover_pin.discrepancy.question import Progress, Question
from rover_pin.discrepancy.search import Search, calibrate
from rover_pin.discrepancy.signature import signatures
from rover_pin.discrepancy.verdict import Alternative, Side, Verdict
from rover_pin.estimation.experiment import Differentiable
from rover_pin.estimation.fit import Fit, again
from rover_pin.estimation.numbers import BOUND_TOLERANCE, Number, implausible
from rover_pin.estimation.parameter import Parameter
from rover_pin.estimation.profile import NORMAL_95
from rover_pin.estimation.random_effects.learnt_noise import with_learnt_noise
from rover_pin.estimation.wording import MAX_NAMED
from rover_pin.inference.beliefs import Beliefs, Hypothesis, chosen_without, errors_without
from rover_pin.inference.cause import reading_error
from rover_pin.inference.explore import Explorer
from rover_pin.inference.hypothesis import Fitter
from rover_pin.inference.next_measurement import next_measurement, open_sets
from rover_pin.inference.samples import samples_of

PRIOR_WIDENING = 2.0
"""Prior SD of a parameter that was declared without a prior, as a multiple of the parameter's scale.

A fitted value further away lowers the probability of a hypothesis. The value is assumed: k and k_1 then lie within a
factor of 25, and phi within half its range, as for the soils of the literature."""


def conclude(question: Question, progress: Progress, seed: int = 0) -> Verdict:
    """Answer the question which effect a model lacks: fit the base model, search the sets of causes, and return the
    verdict.

    Parameters
    ----------
    question : Question
        Data, base model and candidates for missing effects.
    progress : function
        Called with one line of text before each step.
    seed : int
        Seed of the random numbers for the bootstrap intervals.

    Raises
    ------
    OptimisationError
        The base model cannot be fitted.
    """
    # `Search` has done its work already; `Explorer` fits its sets here, and can also fit a drafted effect.
    search = fits_of(question, progress)
    if isinstance(search, Search):
        found = with_equivalents(verdict_of(question, search.beliefs(), progress, seed), search)
        return with_next(question, found, progress)
    verdict = with_next(question, verdict_of(question, search.explore(), progress, seed), progress)

    def drafted_effect(fitted: Fit) -> Draft | None:
        # The residual of the kept model is described as a drafted effect, and this effect is fitted together with the
        # causes of the model. The result is None if no formula describes the residual.
        drafted = question.draft(fitted)
        if drafted is None:
            return None
        text, candidate = drafted
        # The trial compares the evidence of the kept causes with and without the drafted effect.
        without = search.beliefs().best(verdict.named)
        if not search.fit((*without.causes, candidate.cause)):
            return draft_of(text, fitted, None, -math.inf)
        with_it = search.beliefs().best((*verdict.named, candidate.name))
        return draft_of(text, fitted, with_it.fit, with_it.log_evidence - without.log_evidence)

    return with_draft(verdict, drafted_effect, seed)


def fits_of(question: Question, progress: Progress) -> Explorer | Search:
    """Fit the base model, and return the object that searches the sets of causes.

    If the experiment gives exact derivatives of the prediction by the parameters, fits are cheap: the returned
    `Explorer` fits the sets of causes later, when its method `explore` is called. Without exact derivatives, the
    returned `Search` has fitted every promising set already.
    """
    progress("calibrating the base model")
    by_slopes = explorer_of if isinstance(question.experiment, Differentiable) else search_of
    return by_slopes(question, progress)


def with_equivalents(verdict: Verdict, search: Search) -> Verdict:
    """Return the verdict with the effects that undeclared numbers can imitate.

    If the data contain no information on the size of such an effect, they do not show whether it is missing. The answer
    is then CANNOT_TELL instead of NONE_NEEDED, because the probability that nothing is missing is only the prior one.
    """
    assert verdict.after is not None
    found = equivalents(verdict.after.fit, [*search.options.values()], verdict.named)
    verdict, unknown = replace(verdict, equivalents=found), [row for row in found if not row.has_information]
    if verdict.answer is not Answer.NONE_NEEDED or not unknown:
        return verdict
    names = tuple(row.name for row in unknown)
    sentence = (
        f"the residual of the base model is noise, but the data contain no information on {' and '.join(names)}: "
        "undeclared inputs imitate it."
    )
    return replace(verdict, answer=Answer.CANNOT_TELL, sentence=sentence, indistinguishable=("nothing", *names))


def with_next(question: Question, verdict: Verdict, progress: Progress) -> Verdict:
    """Return the verdict, with a proposal for the next measurement added if several sets of causes remain possible.

    The proposed measurement is expected to distinguish best between these sets of causes.
    """
    # Another measurement is proposed only if the data leave several sets open.
    if verdict.answer not in (Answer.SET, Answer.CANNOT_TELL) or verdict.beliefs is None:
        return verdict
    leading = open_sets(verdict.deciding_beliefs or verdict.beliefs)
    offers = question.offers([hypothesis for _, hypothesis in leading])
    proposed = next_measurement(leading, offers, progress)
    return verdict if proposed is None else replace(verdict, experiments=(proposed,))


def with_draft(verdict: Verdict, drafted: Callable[[Fit], Draft | None], seed: int) -> Verdict:
    """Return the verdict, with a drafted effect and its errors added if no known effect explains the residual.

    A drafted effect is an effect file that the search for missing effects writes from the shape of the residual.
    `drafted` is a function that takes the fit of the kept model and returns the drafted effect, or None if no formula
    describes the residual. `seed` starts the random numbers of the bootstrap.
    """
    if verdict.after is None or verdict.answer not in (Answer.NONE_FITS, Answer.LIKE):
        return verdict
    draft = drafted(verdict.after.fit)
    return verdict if draft is None else replace(verdict, draft=score_draft(draft, verdict.after.fit, seed))


def search_of(question: Question, progress: Progress) -> Search:
    """Fit the base model and search the sets of causes, for an experiment without exact derivatives of its prediction.

    If the experiment declares no noise, the noise is first estimated from the residual.
    """
    # First the base model, then one prediction for each candidate, then the noise, then the search.
    base = calibrate(question.experiment, question.model, tuple(map(proper, question.numbers)))
    candidates = question.candidates(base)
    progress(f"predicting the effect of each of {len(candidates)} candidates")
    rows = signatures(base, candidates)
    # Noise is learnt from the part of the residual that no candidate could explain.
    if question.experiment.noise() is None:
        progress("learning the noise")
        base = with_learnt_noise(base, [row.shift for row in rows])
    progress("completing the fit of the base model")
    search = Search(again(base, stale=True), progress)
    search.run(rows)
    progress("estimating the evidence of unlisted causes")
    search.leave(question.functions(base))
    return search


def explorer_of(question: Question, progress: Progress) -> Explorer:
    """Fit the base model, and return an explorer of the sets of causes, for an experiment with exact derivatives of its
    prediction.

    Raises OptimisationError if the fit converges from none of its start values; the message states which values the
    model cannot predict.
    """
    experiment, model, noise = question.experiment, question.model, question.experiment.noise()
    numbers = tuple(map(proper, question.numbers))
    assert isinstance(experiment, Differentiable)
    assert noise is not None
    # All compared values as one vector, with the set values as inputs of a possible smooth discrepancy.
    samples = samples_of(experiment, noise.sd, experiment.varied)
    explorer = Explorer(Fitter(experiment, samples, model, numbers), (), progress)
    try:
        explorer.base()
    except OptimisationError as error:
        lost = experiment.unpredicted_part(model)
        why = (
            f"{lost}; start from a model that predicts every run, or correct that run"
            if lost
            else "fit fewer parameters"
        )
        message = f"{experiment.name}: no start of the fit of the base model converged: {why}."
        raise OptimisationError(message, status="") from error
    base = explorer.beliefs().best(()).fit
    readings = [reading_error(parameter.name, parameter) for parameter in experiment.reading_errors(model)]
    explorer.causes = [*(candidate.cause for candidate in question.candidates(base)), *readings]
    return explorer


def proper(parameter: Parameter) -> Parameter:
    """Return a parameter that has a prior of finite width, because the evidence is not defined otherwise.

    A parameter without a prior gets one with an SD of PRIOR_WIDENING times its scale. A parameter with a prior is
    returned unchanged.
    """
    if parameter.prior:
        return parameter
    return replace(parameter, scale=PRIOR_WIDENING * parameter.scale, prior=True)


def verdict_of(question: Question, beliefs: Beliefs, progress: Progress, seed: int = 0) -> Verdict:
    """Return the verdict that follows from the probabilities of the hypotheses, with intervals of the parameters and
    held-out errors.
    """
    progress("computing intervals and held-out errors")
    bare = beliefs.best(()).fit
    noise = question.experiment.noise() or bare.task.noise

    @cache
    def held_out_of(hypothesis: Hypothesis) -> HeldOut:
        return held_out(bare, hypothesis.fit, noise, seed)

    # The evidence proposes an answer, and held-out data confirm it or change it.
    decision, deciding = confirmed(beliefs, held_out_of)
    # "Before" is the base model (with the wrong declared numbers freed, if nothing else is missing), "after" the kept
    # model.
    base, best = beliefs.best(decision.otherwise), deciding.best(decision.retained)
    before = side_of(deciding, base)
    after = side_of(deciding, best) if decision.retained else before
    errors = held_out_of(best) if decision.retained else held_out(before.fit, before.fit, noise, seed)
    share = taken_share(errors.channels) if decision.retained else 0.0
    # If nothing is missing but a parameter is far from its declared value, the declared base model is inadequate.
    answer, far = decision.answer, implausible(before.fit)
    if answer is Answer.NONE_NEEDED and far:
        answer = Answer.INADEQUATE
    otherwise = tuple(number.text for number in before.numbers if number.name in decision.otherwise) or far
    records = question.experiment.records(after.model)
    owners = [cause.owner for cause in best.causes if cause.owner]
    names = tuple(" + ".join(names) or "nothing" for names in decision.sets)
    folds = question.experiment.folds

    # A size at its bound means that the data ask for another law than that of the effect.
    prefixes = tuple(f"{name}." for name in decision.retained)
    strained = [number for number in after.numbers if prefixes and number.at_bound and number.name.startswith(prefixes)]
    vetoes = (*decision.doubts, *(f"{number.name} lies at its bound" for number in strained))

    # The other possible sets of causes, whose sizes and errors the report compares with those of the kept set.
    sets = [names for names, _ in likeliest(decision.sets, deciding) if names and names != decision.retained]
    rivals = [rival for rival in map(deciding.best, sets) if rival.is_fitted]
    others = {}
    for rival in rivals:
        sizes = [i for i, parameter in enumerate(rival.fit.parameters) if _is_amplitude(rival, parameter.name)]
        fitted_sizes = tuple(_number(deciding, rival, i) for i in sizes)
        others[" + ".join(rival.names)] = Alternative(fitted_sizes, fold_errors(rival.fit))
    return Verdict(
        question.kind,
        answer,
        question.name,
        sentence(decision._replace(answer=answer, otherwise=otherwise), deciding, share, before.misfit),
        after.model,
        tuple(records[owner] for owner in owners if is_effect(records[owner])) if decision.retained else (),
        decision.retained,
        names,
        share,
        before,
        after,
        errors.channels,
        errors.runs,
        {name: " + ".join(sorted(chosen)) for name, chosen in zip(folds, chosen_without(beliefs), strict=True)},
        vetoes,
        (*noise_at_bound(best), *left_out(beliefs), *lost_folds(errors.channels, question.experiment.no_value)),
        overturned=decision.reasons,
        beliefs=beliefs,
        deciding=None if deciding is beliefs else deciding,
        beyond_noise=beyond_noise(decision.retained, beliefs),
        errors_anew=dict(zip(question.experiment.channels, errors_without(beliefs), strict=True)),
        others=others,
    )


def left_out(beliefs: Beliefs) -> tuple[str, ...]:
    """Return a sentence on the sets of causes that were not fitted because the budget of predictions was spent, if
    there are any.
    """
    if beliefs.end is None or beliefs.end.predictions < beliefs.end.budget:
        return ()
    sets = [" + ".join(names) for names in beliefs.end.unfitted]
    words = f"not fitted, although they may be more probable: {'; '.join(sets[:MAX_NAMED])}"
    more = f" and {len(sets) - MAX_NAMED} more" if len(sets) > MAX_NAMED else ""
    listed = f"{words}{more}" if sets else "no other set of causes is estimated to be more probable"
    return (f"the search ended at its budget of {beliefs.end.budget} predictions of a model; {listed}",)


def noise_at_bound(hypothesis: Hypothesis) -> tuple[str, ...]:
    """Return a sentence if the noise of a hypothesis is the largest that its prior allows; otherwise nothing."""
    times = hypothesis.noise_at_bound
    if not times:
        return ()
    return (f"the noise scale of the fit lies at the bound of its prior, {times:.2f} times the declared noise",)


def side_of(beliefs: Beliefs, hypothesis: Hypothesis) -> Side:
    """Return a fitted hypothesis as one side of the verdict (the model before or after causes were added): model,
    parameters and misfit.

    The intervals of the parameters are averaged over all hypotheses that contain the causes of this hypothesis.
    """
    fitted = hypothesis.fit
    numbers = tuple(_number(beliefs, hypothesis, place) for place in range(len(fitted.parameters)))
    return Side(fitted.model, numbers, declared_fit(hypothesis).misfit, fitted)


def _number(beliefs: Beliefs, hypothesis: Hypothesis, place: int) -> Number:
    """Return the parameter with index `place` of a hypothesis, with its fitted value and its 95 % interval, for the
    verdict.

    The interval is averaged over all hypotheses that contain the causes of this hypothesis.
    """
    fitted = hypothesis.fit
    parameter, u = fitted.parameters[place], float(fitted.u[place])
    # The interval comes from the average over the hypotheses, the stated value from this hypothesis.
    mean, sd = beliefs.moments(hypothesis, parameter.name)
    low, high = (float(np.clip(end, *parameter.bounds)) for end in (mean - NORMAL_95 * sd, mean + NORMAL_95 * sd))
    if not low <= u <= high:
        # The average is centred away from the stated value. The interval is then centred on the stated value, with the
        # RMS deviation from this value, so that it does not end on the value.
        reach = NORMAL_95 * math.hypot(sd, mean - u)
        low, high = (float(np.clip(end, *parameter.bounds)) for end in (u - reach, u + reach))
    prior = [float(np.clip(end, *parameter.bounds)) for end in (-NORMAL_95, NORMAL_95)]
    narrowed = (prior[1] - prior[0]) / max(high - low, 1e-300) if parameter.prior else math.inf
    ends = sorted((parameter.value(low), parameter.value(high)))
    unit = hypothesis.experiment.quantity(fitted.model, parameter.name).unit
    at_bound = min(u - parameter.bounds[0], parameter.bounds[1] - u) <= BOUND_TOLERANCE
    closed = low > parameter.bounds[0] and high < parameter.bounds[1]
    covered = (high - low) / (parameter.bounds[1] - parameter.bounds[0])
    # A size of an effect has no declared value from which it could deviate.
    drift = math.nan if _is_amplitude(hypothesis, parameter.name) else u
    prior_facts = (parameter.beforehand, covered, parameter.declared, parameter.source, narrowed)
    return Number(parameter.name, unit, parameter.value(u), ends[0], ends[1], drift, closed, at_bound, *prior_facts)


def _is_amplitude(hypothesis: Hypothesis, name: str) -> bool:
    """Return whether the parameter with this name is a size of one of the hypothesis's causes."""
    return any(name in cause.amplitudes for cause in hypothesis.causes)
