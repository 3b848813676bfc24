"""The loop by evidence: hypotheses explored, their answer read, and the model that is kept judged where not fitted."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from rover_pin.base.errors import OptimisationError
from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.calibration import calibrate
from rover_pin.discrepancy.candidate import is_effect
from rover_pin.discrepancy.decision import Decision, decide, likeliest, sentence
from rover_pin.discrepancy.draft import Draft, draft_of, score_draft
from rover_pin.discrepancy.held_out_errors import fold_errors, held_out, lost_folds, taken_share
from rover_pin.discrepancy.question import Progress, Question
from rover_pin.discrepancy.search import Search
from rover_pin.discrepancy.signature import signatures
from rover_pin.discrepancy.verdict import Alternative, Side, Verdict
from rover_pin.estimation.experiment import Differentiable
from rover_pin.estimation.fit import Fit, again
from rover_pin.estimation.numbers import AT_BOUND, Number, implausible
from rover_pin.estimation.parameter import Parameter
from rover_pin.estimation.profile import NORMAL_95
from rover_pin.estimation.random_effects.learnt_noise import with_learnt_noise
from rover_pin.estimation.task import Task
from rover_pin.inference.beliefs import Beliefs, Hypothesis
from rover_pin.inference.cause import reading_error
from rover_pin.inference.explore import Explorer
from rover_pin.inference.hypothesis import Fitter
from rover_pin.inference.next_measurement import next_measurement, open_sets
from rover_pin.inference.samples import samples_of
from rover_pin.inference.weighed_anew import chosen_without, errors_without

LOOSE = 2.0
"""How many times as far as its starts a number may lie that nobody declares: k and k_1 within a factor of 25, phi
within half its range. Why: soils of the literature lie within (assumed)."""


def conclude(question: Question, progress: Progress, seed: int = 0) -> Verdict:
    """Return what a model lacks, as a graded answer.

    Raises OptimisationError: the base model cannot be fitted at all.
    """
    search = fits_of(question, progress)
    if isinstance(search, Search):
        return with_next(question, verdict_of(question, search.beliefs(), progress, seed), progress)
    verdict = with_next(question, verdict_of(question, search.explore(), progress, seed), progress)
    return with_draft(verdict, lambda fitted: _try_draft(question, search, verdict.named, fitted), seed)


def fits_of(question: Question, progress: Progress) -> Explorer | Search:
    """Return what was fitted of a question: where slopes are exact the base model, else every set that is worth it."""
    progress("calibrating the base model")
    by_slopes = explorer_of if isinstance(question.experiment, Differentiable) else search_of
    return by_slopes(question, progress)


def with_next(question: Question, verdict: Verdict, progress: Progress) -> Verdict:
    """Return a verdict with what to measure next, where it leaves open which set of causes acts."""
    if verdict.answer not in (Answer.SET, Answer.CANNOT_TELL) or verdict.beliefs is None:
        return verdict
    leading = open_sets(verdict.beliefs)
    offers = question.offers([hypothesis for _, hypothesis in leading])
    proposed = next_measurement(leading, offers, progress)
    return verdict if proposed is None else replace(verdict, experiments=(proposed,))


def with_draft(verdict: Verdict, drafted: Callable[[Fit], Draft | None], seed: int) -> Verdict:
    """Return a verdict with the draft of what its model leaves, if that is more than noise, beside its errors."""
    if verdict.after is None or verdict.answer not in (Answer.NONE_FITS, Answer.LIKE):
        return verdict
    draft = drafted(verdict.after.fit)
    return verdict if draft is None else replace(verdict, draft=score_draft(draft, verdict.after.fit, seed))


def _try_draft(question: Question, explorer: Explorer, named: tuple[str, ...], fitted: Fit) -> Draft | None:
    """Return what the kept model leaves as a draft, tried beside its causes; None where nothing describes it."""
    drafted = question.draft(fitted)
    if drafted is None:
        return None
    text, candidate = drafted
    without = explorer.beliefs().best(named)
    if not explorer.fit((*without.causes, candidate.cause)):
        return draft_of(text, fitted, None, -math.inf)
    with_it = explorer.beliefs().best((*named, candidate.name))
    return draft_of(text, fitted, with_it.fit, with_it.log_evidence - without.log_evidence)


def search_of(question: Question, progress: Progress) -> Search:
    """Return what was fitted of a question whose slopes are differences, its noise learnt where none is declared."""
    base = calibrate(question.experiment, question.model, tuple(map(proper, question.numbers)))
    candidates = question.candidates(base)
    progress(f"how each of {len(candidates)} candidates would show")
    rows = signatures(base, candidates)
    if question.experiment.noise() is None:
        progress("learning the noise")
        base = with_learnt_noise(base, [row.shift for row in rows])
    progress("fitting the base model to the end")
    search = Search(again(base, stale=True), progress)
    search.run(rows)
    progress("weighing what is on no list")
    search.leave(question.functions(base))
    return search


def explorer_of(question: Question, progress: Progress) -> Explorer:
    """Return what explores a question, its base model fitted."""
    experiment, model, noise = question.experiment, question.model, question.experiment.noise()
    numbers = tuple(map(proper, question.numbers))
    assert isinstance(experiment, Differentiable)
    assert noise is not None
    samples = samples_of(experiment, noise.sd, experiment.varied)
    explorer = Explorer(Fitter(experiment, samples, model, numbers), (), progress)
    try:
        explorer.base()
    except OptimisationError as error:
        lost = experiment.unpredicted_part(model)
        why = f"{lost}; start from a model that does, or mend that run" if lost else "free fewer numbers"
        message = f"{experiment.name}: no start of the fit of the base model converged: {why}."
        raise OptimisationError(message, status="") from error
    base = explorer.beliefs().best(()).fit
    readings = [reading_error(parameter.name, parameter) for parameter in experiment.reading_errors(model)]
    explorer.causes = [*(candidate.cause for candidate in question.candidates(base)), *readings]
    return explorer


def proper(parameter: Parameter) -> Parameter:
    """Return a number with a prior: what nobody knows of it lies LOOSE times as far as its starts."""
    if parameter.prior:
        return parameter
    return replace(parameter, scale=LOOSE * parameter.scale, prior=True)


def verdict_of(question: Question, beliefs: Beliefs, progress: Progress, seed: int = 0) -> Verdict:
    """Return the verdict that the beliefs give, with the errors on what was left out."""
    decision = decide(beliefs)
    base, best = beliefs.best(decision.otherwise), beliefs.best(decision.retained)
    progress("intervals, and errors on what was left out")
    before = side_of(beliefs, base)
    after = side_of(beliefs, best) if decision.retained else before
    errors = held_out(before.fit, after.fit, question.experiment.noise() or before.fit.task.noise, seed)
    share = taken_share(errors.channels) if decision.retained else 0.0
    answer, far = decision.answer, implausible(before.fit)
    if answer is Answer.NONE_NEEDED and far:
        answer = Answer.INADEQUATE
    otherwise = tuple(number.text for number in before.numbers if number.name in decision.otherwise) or far
    records = question.experiment.records(after.model)
    owners = [cause.owner for cause in best.causes if cause.owner]
    names = tuple(" + ".join(names) or "nothing" for names in decision.sets)
    folds = question.experiment.folds
    return Verdict(
        question.kind,
        answer,
        question.name,
        sentence(decision._replace(answer=answer, otherwise=otherwise), beliefs, share, before.misfit),
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
        _numbers_at_bound(after, decision),
        lost_folds(errors.channels, question.experiment.no_value),
        beliefs=beliefs,
        errors_anew=dict(zip(question.experiment.channels, errors_without(beliefs), strict=True)),
        others=_others(beliefs, decision),
    )


def side_of(beliefs: Beliefs, hypothesis: Hypothesis) -> Side:
    """Return a hypothesis as a side of the verdict, its intervals over all hypotheses that contain it."""
    fitted = hypothesis.fit
    noise = hypothesis.experiment.noise()
    declared = fitted if noise is None else replace(fitted, task=Task(hypothesis.experiment, noise))
    numbers = tuple(_number(beliefs, hypothesis, place) for place in range(len(fitted.parameters)))
    return Side(fitted.model, numbers, declared.misfit, fitted)


def _number(beliefs: Beliefs, hypothesis: Hypothesis, place: int) -> Number:
    """Return a number with its 95 % interval, the hypotheses that contain this one weighed."""
    fitted = hypothesis.fit
    parameter, u = fitted.parameters[place], float(fitted.u[place])
    mean, sd = beliefs.moments(hypothesis, parameter.name)
    low, high = (float(np.clip(end, *parameter.bounds)) for end in (mean - NORMAL_95 * sd, mean + NORMAL_95 * sd))
    low, high = min(low, u), max(high, u)
    ends = sorted((parameter.value(low), parameter.value(high)))
    unit = hypothesis.experiment.quantity(fitted.model, parameter.name).unit
    at_bound = min(u - parameter.bounds[0], parameter.bounds[1] - u) <= AT_BOUND
    closed = low > parameter.bounds[0] and high < parameter.bounds[1]
    covered = (high - low) / (parameter.bounds[1] - parameter.bounds[0])
    drift = math.nan if _is_amplitude(hypothesis, parameter.name) else u
    prior_facts = (parameter.beforehand, covered, parameter.declared, parameter.source)
    return Number(parameter.name, unit, parameter.value(u), ends[0], ends[1], drift, closed, at_bound, *prior_facts)


def _is_amplitude(hypothesis: Hypothesis, name: str) -> bool:
    return any(name in cause.amplitudes for cause in hypothesis.causes)


def _numbers_at_bound(after: Side, decision: Decision) -> tuple[str, ...]:
    """Return which numbers of what was added lie at their bounds."""
    prefixes = tuple(f"{name}." for name in decision.retained)
    rows = [number for number in after.numbers if number.at_bound and number.name.startswith(prefixes)]
    return tuple(f"{number.name} lies at its bound" for number in rows) if prefixes else ()


def _others(beliefs: Beliefs, decision: Decision) -> dict[str, Alternative]:
    """Return the fitted sets of causes that the data leave besides what is kept."""
    sets = [names for names, _ in likeliest(decision.sets, beliefs) if names and names != decision.retained]
    rivals = [rival for rival in map(beliefs.best, sets) if rival.is_fitted]
    return {" + ".join(rival.names): _alternative(beliefs, rival) for rival in rivals}


def _alternative(beliefs: Beliefs, rival: Hypothesis) -> Alternative:
    names = [parameter.name for parameter in rival.fit.parameters]
    numbers = tuple(_number(beliefs, rival, at) for at, name in enumerate(names) if _is_amplitude(rival, name))
    return Alternative(numbers, fold_errors(rival.fit))
