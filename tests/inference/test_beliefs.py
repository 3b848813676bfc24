"""What the data make of hypotheses: probabilities that sum up, razors, and words that hold as often as they say."""

import itertools
import math

import numpy as np
import pytest

from rover_pin.inference.beliefs import Beliefs
from rover_pin.inference.error_model import Discrepancy
from tests.inference import linear_causes as toys

NAMES = "p", "q", "r"
COUNTS = 0.5, 0.3, 0.14, 0.05, 0.01
"""Prior probability of no to four missing causes."""


def with_data(toy, amplitudes, seed):
    """The toy with data of these causes [default amplitudes] and white noise of its SD."""
    noise = toys.NOISE * np.random.default_rng(seed).normal(size=toy.sd.shape)
    toy.observed = sum((share * toy.columns[name] for name, share in amplitudes.items()), toy.columns["base"] + noise)
    return toy


def believed(toy, names, most=2):
    """Beliefs over all sets of causes up to some count, each fitted."""
    explorer = toys.explorer(toy, names)
    explorer.base()
    for count in range(1, most + 1):
        for causes in itertools.combinations(explorer.causes, count):
            assert explorer.fit(causes)
    return explorer.beliefs()


def prior_of(names, choice):
    return COUNTS[len(names)] / math.comb(choice, len(names))


@pytest.mark.parametrize("seed", range(3))
def test_probabilities_sum_up_over_hypotheses_and_sets(seed):
    toy, _ = toys.from_the_prior(seed, NAMES)
    beliefs = believed(toy, NAMES, most=3)
    assert beliefs.weights.sum() == pytest.approx(1.0, abs=1e-12)
    assert (beliefs.weights >= 0).all()
    sets = beliefs.sets
    assert sum(sets.values()) == pytest.approx(1.0, abs=1e-12)
    assert len(sets) == 8
    for name in NAMES:
        assert beliefs.inclusion(name) == pytest.approx(sum(p for names, p in sets.items() if name in names))
    assert list(beliefs.included.values()) == sorted(beliefs.included.values(), reverse=True)
    assert frozenset(beliefs.best().names) in sets
    for names in sets:
        assert 0.0 <= beliefs.leaves_more(names) <= 1.0


def test_prior_of_all_sets_sums_to_that_of_their_counts():
    toy, _ = toys.from_the_prior(1, NAMES)
    explorer = toys.explorer(toy, NAMES)
    explorer.base()
    for count in (1, 2, 3):
        for causes in itertools.combinations(explorer.causes, count):
            explorer.fit(causes)
    beliefs = explorer.beliefs()
    priors = {}
    for score, hypothesis in zip(beliefs.scores, beliefs.hypotheses, strict=True):
        count = len(hypothesis.causes)
        priors.setdefault(count, []).append(math.exp(score - hypothesis.log_evidence))
    assert sum(priors[0]) == pytest.approx(COUNTS[0])
    for count in (1, 2, 3):
        assert sum(priors[count]) == pytest.approx(COUNTS[count]) or sum(priors[count]) < COUNTS[count], "far behind"


@pytest.mark.parametrize("kind", list(Discrepancy))
def test_a_cause_that_moves_nothing_keeps_its_prior(kind):
    toy = with_data(toys.design(3, ("p",)), {}, 3)
    toy.columns["p"] = 0.0 * toy.columns["p"]
    explorer = toys.explorer(toy, ("p",))
    explorer.base()
    u = explorer.flat[frozenset()][0]
    base = explorer.fitter.hypothesis((), u, Discrepancy.NONE if kind is Discrepancy.FORM else kind)
    idle = explorer.fitter.hypothesis(explorer.causes, np.append(u, 0.3), kind)
    assert idle.log_evidence == pytest.approx(base.log_evidence, abs=1e-3)
    assert idle.moments("p") == pytest.approx((0.0, 1.0), abs=1e-6)


def test_a_cause_without_effect_falls_below_its_prior():
    """In 20 sets of data without it, its ratio to the base falls below the prior one in most, and on the whole."""
    gains = []
    for seed in range(20):
        toy = with_data(toys.design(seed, ("p",), size=None), {}, seed)
        sets = believed(toy, ("p",), most=1).sets
        prior = prior_of("p", 1) / prior_of("", 1)
        gains.append(math.log(sets[frozenset("p")] / sets[frozenset()] / prior))
    assert np.mean(np.array(gains) < 0) > 0.7
    assert np.mean(gains) < -0.5
    assert max(gains) < 3.0


@pytest.mark.parametrize("share", [0.0, 0.6, 1.5])
def test_identical_causes_share_their_probability(share):
    toy = with_data(toys.design(5, ("p", "q"), size=None), {"p": share}, 5)
    toy.columns["q"] = toy.columns["p"]
    beliefs = believed(toy, ("p", "q"))
    assert beliefs.inclusion("p") == pytest.approx(beliefs.inclusion("q"), abs=1e-3)
    alone = [beliefs.sets[frozenset(name)] for name in "pq"]
    assert alone[0] == pytest.approx(alone[1], abs=1e-3)
    assert sum(alone) > 10.0 * beliefs.sets[frozenset()] or share < 1.0


def test_evidence_for_none_grows_faster_than_by_a_local_prior():
    """Noise along no column: ln(Z_none / Z_cause) rises as half ln n where a size may be 0, faster where it may not."""
    counts, local, full = (4, 16, 64), [], []
    for count in counts:
        toy = toys.design(8, ("p",), folds=4, each=count, size=None)
        shape = toy.sd.shape
        along = np.array([toy.columns["base"].ravel(), np.cos(np.arange(toy.sd.size))]).T
        toy.columns["p"] = 10.0 * toys.NOISE * along[:, 1].reshape(shape)
        noise = np.random.default_rng(2).normal(size=toy.sd.size)
        noise -= along @ np.linalg.lstsq(along, noise, rcond=None)[0]
        toy.observed = (toys.NOISE * noise / noise.std()).reshape(shape)
        explorer = toys.explorer(toy, ("p",))
        explorer.base()
        u = explorer.flat[frozenset()][0]
        none = explorer.fitter.hypothesis((), u, Discrepancy.NONE)
        acts = explorer.fitter.hypothesis(explorer.causes, np.append(u, 0.0), Discrepancy.NONE)
        local.append(none.posterior.log_evidence - acts.posterior.log_evidence)
        full.append(none.log_evidence - acts.log_evidence)
    rise = np.diff(local) / np.diff(np.log(counts)), np.diff(full) / np.diff(np.log(counts))
    assert rise[0] == pytest.approx([0.5, 0.5], abs=0.1)
    assert (rise[1] > rise[0] + 0.3).all()


BINS = 0.0, 0.02, 0.1, 0.3, 0.6, 0.9, 1.0


def deviations(rows):
    """By how many binomial SDs what is true differs from what was said (p, whether), bin by bin.

    A bin's SD is no less than that of one case, so that a bin of certain answers counts whole cases.
    """
    stated_probability, true = np.array(rows, dtype=float).T
    place = np.digitize(stated_probability, BINS[1:-1])
    return [
        (true[in_bin] - stated_probability[in_bin]).sum()
        / math.sqrt(max((stated_probability[in_bin] * (1 - stated_probability[in_bin])).sum(), 1.0))
        for in_bin in (place == at for at in range(len(BINS) - 1))
        if in_bin.any()
    ]


def rows_of(beliefs: Beliefs, names, true):
    """(p, whether it is true) of each cause, and of none."""
    for name in names:
        yield beliefs.inclusion(name), name in true
    yield beliefs.sets.get(frozenset(), 0.0), not true


def calibration(answered, seeds, names):
    """The deviations of what is `answered` to seeds: the beliefs, and the names of what acts."""
    answers = [answered(seed, names) for seed in seeds]
    return deviations([row for beliefs, true in answers for row in rows_of(beliefs, names, true)])


def assert_as_often_as_said(answered, names):
    """Of 70 problems; six bins: 99.7 % by probability."""
    deviation = calibration(answered, range(70), names)
    assert np.abs(deviation).max() < 3.0
    assert np.sum(np.square(deviation)) < 20.0


def answered(seed, names):
    toy, true = toys.from_the_prior(seed, names)
    return toys.explorer(toy, names).explore(), true


@pytest.mark.slow
def test_what_is_said_is_true_as_often_as_its_probability():
    assert_as_often_as_said(answered, NAMES)


def test_what_is_said_of_two_causes_is_true_as_often():
    assert np.abs(calibration(answered, range(24), NAMES[:2])).max() < 3.5
