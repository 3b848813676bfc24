"""The rules by which the loop answers: what stands, what speaks against a lone name, and what that leaves of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import chi2 as chi2_law

from rover_pin.discrepancy.answer import TAKES_MOST, Answer
from rover_pin.discrepancy.bed import Bed
from rover_pin.discrepancy.candidate import Candidate
from rover_pin.discrepancy.conclusion import Conclusion
from rover_pin.discrepancy.cross_validation import loss_of, refitted_left_out
from rover_pin.discrepancy.held_out import ChannelScore, held_out
from rover_pin.discrepancy.search import Search, again, calibrated, search
from rover_pin.estimation.fit import Fit, fit
from rover_pin.estimation.noise import huber
from rover_pin.estimation.wording import Outcome

SURPRISE = 1e-3
"""A chi2 less probable than this by the declared noise means that the model's form is not that of the data."""
AWAY = 5.0
"""Prior SDs beyond which a number has left what is plausible of it."""
AT_BOUND = 1e-6
"""A number this near to a bound, in u, stands at it; at its default, u = 1, a law is as published and not strained."""


def concluded(bed: Bed, kinds: Sequence[type], progress: Callable[[str], None], seed: int = 0) -> Conclusion:
    """Return what the model of a test bed lacks of these kinds of effects, as a graded answer."""
    model, poor = bed.base_model(), bed.insufficient()
    if poor:
        return Conclusion(Answer.CANNOT_TELL, bed.name, poor, model)
    progress("calibrating the base model")
    base = calibrated(bed, model, bed.uncertain(model))
    tried = bed.candidates(model, kinds)
    found = search(base, tried, progress)
    progress("choosing again without each fold")
    chosen = reselected(found.base, tried)
    return _judged(bed.name, found, chosen, seed)


def reselected(base: Fit, tried: Sequence[Candidate]) -> dict[str, str]:
    """Return what the whole search chooses on all folds but one, by the name of the fold left out."""
    chosen = {}
    for at, name in enumerate(base.task.experiment.folds):
        good = base.task.noise.good.copy()
        good[at] = False
        task = replace(base.task, noise=replace(base.task.noise, good=good))
        without = again(fit(task, base.model, base.parameters, base.u, base.slopes))
        chosen[name] = " + ".join(one.name for one in search(without, tried, lambda said: None).found)
    return chosen


def _judged(name: str, found: Search, chosen: dict[str, str], seed: int) -> Conclusion:
    base, last = found.base, found.last
    scores = held_out(base, last, seed).channels
    share, named = held_out_share(base, last), tuple(one.name for one in found.found)
    against = vetoes(found, chosen, scores) if named else []
    answer = answer_of(found, share, against)
    alike = tuple(one.name for one in found.rounds[0].alike)
    if answer is Answer.INADEQUATE:
        last, named, share = base, (), 0.0
        scores = held_out(base, base, seed).channels
    said = sentence(answer, found, share)
    return Conclusion(
        answer, name, said, last.model, named, alike, share, base, last, scores, chosen, tuple(against), found
    )


def is_adequate(fitted: Fit) -> bool:
    """Return whether what is left is as large as it may be by the declared noise."""
    free = sum(not one.prior for one in fitted.parameters)
    return bool(huber(fitted.rows) <= chi2_law.isf(SURPRISE, max(fitted.task.noise.count - free, 1)))


def implausible(fitted: Fit) -> tuple[str, ...]:
    """Return the numbers that had to leave what is plausible of them."""
    rows = zip(fitted.parameters, fitted.u, strict=True)
    return tuple(f"{one.name} {u:+.1f} SD" for one, u in rows if one.prior and abs(u) > AWAY)


def held_out_share(base: Fit, last: Fit) -> float:
    """Return the share of the held-out chi2 beyond the noise that what was added takes; at least 0."""
    was, now = (loss_of(base, refitted_left_out(one)) for one in (base, last))
    beyond = was - base.task.noise.count
    return float(np.clip((was - now) / beyond, 0.0, 1.0)) if beyond > 0 else float(now < was)


def vetoes(found: Search, chosen: dict[str, str], scores: Sequence[ChannelScore]) -> list[str]:
    """Return what keeps a lone name from standing, one sentence each."""
    last = found.last
    said = []
    for one, u in zip(last.parameters, last.u, strict=True):
        usual = not one.prior and abs(u - 1.0) <= AT_BOUND
        if min(u - one.bounds[0], one.bounds[1] - u) <= AT_BOUND and not usual:
            said.append(f"{one.name} lies at its bound")
    said += [f"{one} from what is declared of it" for one in implausible(last)]
    names = " + ".join(one.name for one in found.found)
    same = sum(set(name.split(" + ")) == set(names.split(" + ")) for name in chosen.values())
    if 2 * same <= len(chosen):
        said.append(f"{names} is chosen in {same} of {len(chosen)} folds only")
    worse = [score.name for score in scores if score.worded.outcome is Outcome.WORSE]
    return said + [f"{name} is predicted worse where it was not fitted" for name in worse]


def answer_of(found: Search, share: float, against: Sequence[str]) -> Answer:
    """Return what may be said: a name stands where its law holds, alone where nothing speaks against it."""
    if not found.found:
        fits = is_adequate(found.base) and not implausible(found.base)
        return Answer.NONE_NEEDED if fits else Answer.INADEQUATE
    if not is_adequate(found.last):
        return Answer.LIKE if share >= TAKES_MOST else Answer.INADEQUATE
    if any(len(each.alike) > 1 for each in found.rounds):
        return Answer.SET
    return Answer.LIKE if against else Answer.NAMED


def sentence(answer: Answer, found: Search, share: float) -> str:
    """Return the answer as a sentence for a reader."""
    names = " and ".join(one.name for one in found.found)
    takes = f"takes {share:.0%} of what the base model misses beyond the noise where it was not fitted"
    if answer is Answer.NAMED:
        return f"the data are consistent with {names}, which {takes}."
    if answer is Answer.SET:
        alike = "; ".join(" or ".join(one.name for one in each.alike) for each in found.rounds if each.alike)
        return f"these cannot be distinguished: {alike}; {names} {takes}."
    if answer is Answer.LIKE:
        left = f"reduced chi-square {found.base.misfit:.3g} -> {found.last.misfit:.3g}"
        return f"something like {names} is missing: it {takes} ({left}), but the name does not stand alone."
    if answer is Answer.INADEQUATE:
        if is_adequate(found.base):
            away = ", ".join(implausible(found.base))
            return f"the base model meets the data only with numbers far from what is declared of them: {away}."
        missed = f"reduced chi-square {found.base.misfit:.3g}"
        return f"the base model misses the data by more than their noise ({missed}), and no candidate describes it."
    return "the base model meets the data within their declared noise, and no candidate gains more than chance."
