"""Why to believe a verdict, why to doubt it, and what to drive or measure next: one sentence each."""

from collections.abc import Iterable, Iterator

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.profile import SURE
from rover_pin.estimation.wording import AT_FLOOR, NOISE_LIKE, Outcome, share
from rover_pin.report.headline import by_outcome, choices, worst
from rover_pin.report.words import Labels, capital, human, kinds_of, listing, two_digits

MAY_ACT = 1.0 - SURE
"""Probability from which a cause that was not added is a reason to doubt."""

WRITE_IT = (
    "look at what is left, write it as an effect of your own (rover-pin new-effect), and close the loop again with "
    "--effects"
)
NEXT = {
    Answer.NAMED: "no rival is left to tell it from: drive where it matters most, and see whether it predicts that",
    Answer.NONE_NEEDED: "drive where more is asked of the model: steeper, faster, with more slip",
    Answer.CANNOT_TELL: "measure what the sentence above asks for",
    Answer.NONE_FITS: WRITE_IT,
    Answer.INADEQUATE: f"measure those numbers alone and declare what you find; if they are as declared, {WRITE_IT}",
    Answer.LIKE: "measure where its law and the data part most: see where the error lives",
    Answer.SET: "no candidate run distinguishes these",
}
"""What to do next where no run was found that would tell more."""


def supporting_reasons(verdict: Verdict, labels: Labels) -> list[str]:
    """Return what speaks for a verdict."""
    lines = (*_added_reasons(verdict, labels), *_nothing_added(verdict, labels))
    return _as_sentences(verdict, map(labels.placed, (*lines[:1], *labels.evidence, *lines[1:])))


def opposing_reasons(verdict: Verdict, labels: Labels) -> list[str]:
    """Return what speaks against it, the weightiest first."""
    return _as_sentences(verdict, map(labels.placed, _doubts(verdict, labels)))


def next_run(verdict: Verdict) -> list[str]:
    """Return what to drive or measure next."""
    if verdict.experiments:
        return _as_sentences(verdict, (experiment.sentence for experiment in verdict.experiments))
    return [capital(WRITE_IT if verdict.rival else NEXT[verdict.answer]) + "."]


def _as_sentences(verdict: Verdict, lines: Iterable[str]) -> list[str]:
    kinds = kinds_of(verdict)
    return [capital(human(line, kinds)).rstrip(".") + "." for line in dict.fromkeys(lines)]


def _added_reasons(verdict: Verdict, labels: Labels) -> Iterator[str]:
    if not verdict.named or verdict.before is None or verdict.after is None:
        return
    better, worse = (by_outcome(verdict.scores, outcome) for outcome in (Outcome.BETTER, Outcome.WORSE))
    if better:
        score = better[0]
        change = f"{labels.channel(score.name)} by {share(score.change)} [{share(score.low)}, {share(score.high)}]"
        yield (
            f"{labels.unseen} {len(better)} of {len(verdict.scores)} channels are predicted better beyond their "
            f"scatter, {len(worse)} worse: {change}"
        )
    yield from _choice_reasons(verdict, labels, True)
    if verdict.share > 0:
        yield f"it takes {verdict.share:.0%} of what the base model misses beyond the noise {labels.unseen}"
    before, after = two_digits(verdict.before.misfit), two_digits(verdict.after.misfit)
    yield f"chi2 for each number measured falls from {before} to {after}; 1 is the noise"


def _nothing_added(verdict: Verdict, labels: Labels) -> Iterator[str]:
    if verdict.named or verdict.before is None:
        return
    yield f"chi2 for each number measured is {two_digits(verdict.before.misfit)}, where 1 is the noise"
    yield f"{verdict.tried} candidates were weighed, alone and together, with all uncertain numbers free"


def _choice_reasons(verdict: Verdict, labels: Labels, agreeing: bool) -> Iterator[str]:
    """Yield that most folds choose the same again, or, if not `agreeing`, that they do not."""
    agree, folds = verdict.agreeing_folds, len(verdict.chosen)
    if folds and (2 * agree > folds) is agreeing:
        yield f"it is chosen anew in {agree} of {folds} cases when one of the {labels.folds} is left out"


def _doubts(verdict: Verdict, labels: Labels) -> Iterator[str]:
    yield from verdict.vetoes
    for score in by_outcome(verdict.scores, Outcome.WORSE):
        yield f"{labels.channel(score.name)} is predicted worse by {share(score.change)} {labels.unseen}"
    if verdict.named:
        yield from _choice_reasons(verdict, labels, False)
        others = [" + ".join(names) for names, _ in choices(verdict)[1:] if names]
        if others:
            yield f"{listing(others, 'or')} cannot be distinguished from it by these data"
    worst_run = max(verdict.runs, key=lambda run_score: run_score.after / max(run_score.before, 1e-9), default=None)
    if verdict.named and worst_run is not None and worst_run.after > AT_FLOOR * worst_run.before:
        yield (
            f"{labels.fold(worst_run.run)} is predicted worse with it by the others (chi2 for each number "
            f"{two_digits(worst_run.before)} -> {two_digits(worst_run.after)}): what it tells they do not"
        )
    loud = [score for score in worst(verdict.scores) if score.after > NOISE_LIKE * score.floor]
    if loud and (verdict.named or verdict.answer is Answer.NONE_NEEDED):
        score, still = loud[0], "still " if verdict.named else ""
        times = two_digits(score.times(score.after))
        yield f"{labels.channel(score.name)} is {still}missed by {times} times its noise"
    yield from (caution for caution in verdict.cautions if caution.partition(":")[0] not in verdict.vetoes)
    for finding in verdict.findings:
        yield f"the data check says: {finding}"
    if verdict.named:
        yield f"only the {verdict.tried} candidates of the list were weighed: something outside of it may do the same"
    elif verdict.answer is Answer.NONE_NEEDED:
        yield from _may_act(verdict)
        yield "an effect too small to show in these data may act; 'what could not be told' has the sizes that would"


def _may_act(verdict: Verdict) -> Iterator[str]:
    """Yield the most probable cause of all that were not added, where that is worth a word."""
    name, probability = next(iter(verdict.beliefs.included.items()), ("", 0.0)) if verdict.beliefs else ("", 0.0)
    if probability > MAY_ACT:
        yield f"{name} may act all the same: probability {probability:.2f}"
