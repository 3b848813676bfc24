"""The words for probabilities: which answer, which causes the model keeps, what the sentence says of what is left."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.decision import decide, sentence
from rover_pin.inference.beliefs import Beliefs
from rover_pin.inference.error_model import Discrepancy

DECLARED = SimpleNamespace(noise=lambda: "declared")
KINDS = {"": Discrepancy.NONE, "~": Discrepancy.SMOOTH, "'": Discrepancy.FORM}
"""How a set's name ends that leaves a smooth discrepancy, or an error of form."""


def hypothesis(text, noise):
    causes = tuple(
        SimpleNamespace(name=name, family=f"family of {name}") for name in text.rstrip("~'").replace("-", "")
    )
    kind, names = KINDS[text[-1] if text[-1] in "~'" else ""], tuple(cause.name for cause in causes)
    taken = dict(zip(("pull", "sinkage"), noise, strict=True))
    return SimpleNamespace(
        names=names,
        causes=causes,
        discrepancy=kind,
        leaves_more=kind is not Discrepancy.NONE,
        noise_taken=taken,
        experiment=DECLARED,
    )


def beliefs(text, noise=(1.0, 1.0)):
    """Sets with their probabilities, as "A .7 AB .2 - .1": `-` is nothing."""
    words = text.split()
    belief_set = Beliefs(tuple(hypothesis(word, noise) for word in words[::2]), 5)
    belief_set.__dict__["scores"] = np.log(np.array(words[1::2], dtype=float))
    return belief_set


@pytest.mark.parametrize(
    ("text", "answer", "retained"),
    [
        ("- .6 A .4", Answer.NONE_NEEDED, ""),
        ("- .4 -~ .2 A .4", Answer.NONE_NEEDED, ""),
        ("- .2 -~ .4 A .4", Answer.NONE_FITS, ""),
        ("- .4 A .3 B .3", Answer.CANNOT_TELL, ""),
        ("- .4 A .6", Answer.SET, "A"),
        ("- .3 A .25 AB .25 AC .2", Answer.SET, "A"),
        ("- .06 A .94", Answer.SET, "A"),
        ("- .02 A .98", Answer.NAMED, "A"),
        ("A .5 AB .3 AC .18 - .02", Answer.NAMED, "A"),
        ("A .2 A~ .3 A' .48 - .02", Answer.LIKE, "A"),
        ("AB .9 A .04 B .04 - .02", Answer.SET, "AB"),
        ("A .6 B .38 - .02", Answer.SET, "A"),
        ("AB .97 A .03", Answer.NAMED, "AB"),
    ],
)
def test_probabilities_decide(text, answer, retained):
    decision = decide(beliefs(text))
    assert (decision.answer, "".join(decision.retained)) == (answer, retained)


def test_nothing_stands_last_in_a_set_that_it_may_be():
    belief_set = beliefs("- .4 A .35 AB .25")
    assert decide(belief_set).sets == (("A",), ())
    assert "A (0.60) or nothing (0.40)" in sentence(decide(belief_set), belief_set, 0.8, 1.0)


def test_where_no_family_leads_it_says_how_likely_anything_is():
    belief_set = beliefs("- .4 A .3 B .3")
    assert "A (0.30) or B (0.30) or nothing (0.40)" in sentence(decide(belief_set), belief_set, 0.0, 1.0)


@pytest.mark.parametrize("text", ["A .99 - .01", "A .6 B .39 - .01", "A .9 - .1"])
def test_what_is_beyond_the_noise_is_told_after_any_answer(text):
    """No channel that is left with more than thrice its noise is passed over, whatever was named."""
    loud, quiet = (beliefs(text, noise=(1.0, times)) for times in (4.5, 2.9))
    assert re.search(r"4\.5 times .*declared.* sinkage", sentence(decide(loud), loud, 0.8, 1.0))
    assert "times" not in sentence(decide(quiet), quiet, 0.8, 1.0)


@pytest.mark.parametrize(("times", "answer"), [(3.8, Answer.NONE_FITS), (2.9, Answer.NONE_NEEDED)])
def test_learnt_noise_far_above_the_scatter_of_the_samples_is_something_that_acts(times, answer):
    """What acts below the learnt noise is not said to be below that of samples which scatter less."""
    both = beliefs("- .02 -~ .97 A .01", noise=(1.0, times))
    for hypothesis_ in both.hypotheses:
        hypothesis_.leaves_more = False
        hypothesis_.experiment = SimpleNamespace(noise=lambda: None)
    statement = sentence(decide(both), both, 0.8, 1.0)
    assert decide(both).answer is answer
    assert ("smaller than" in statement) is (answer is Answer.NONE_NEEDED)
    assert bool(re.search(r"3\.8 times .*sinkage", statement)) is (answer is Answer.NONE_FITS)
