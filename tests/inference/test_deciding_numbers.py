"""What the deciding numbers of the inference decide: a case just on either side of each, computed by hand."""

import itertools
import math
from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import pytest

from rover_pin.estimation.noise import declared_noise
from rover_pin.inference.beliefs import Beliefs
from rover_pin.inference.error_model import Discrepancy, ErrorModel
from rover_pin.inference.evidence import Linear, posterior
from rover_pin.inference.explore import Explorer, names_of
from rover_pin.inference.linear_hypothesis import with_function
from rover_pin.inference.next_measurement import Offer, next_measurement, open_sets
from rover_pin.inference.priors import log_prior
from rover_pin.inference.residual_function import FunctionEvidence
from tests.inference import linear_causes as causes
from tests.inference import linear_toy as toys
from tests.inference.test_expansion import expansion, hypothesis
from tests.inference.test_next_measurement import Ahead, table

COUNTED = [Fraction(share, 100) for share in (50, 30, 14, 5, 1)]
"""Prior probability of no to four missing causes."""
LEFT = {Discrepancy.NONE: (70, 60), Discrepancy.FORM: (0, 20), Discrepancy.SMOOTH: (30, 20)}
"""What a model leaves [%], without a cause and with some."""


def row(names, log_evidence, kind=Discrepancy.NONE):
    """A hypothesis of which only names, evidence and discrepancy are looked at."""
    local = tuple(SimpleNamespace(name=name, family="") for name in names)
    return SimpleNamespace(
        causes=local, names=tuple(names), log_evidence=log_evidence, discrepancy=kind, gain_shares={}
    )


@pytest.mark.parametrize("choice", [4, 7, 20])
def test_prior_probabilities_of_all_sets_and_kinds_sum_to_one(choice):
    total = Fraction(0)
    for count, share in enumerate(COUNTED):
        for kind, percent in LEFT.items():
            if percent[count > 0]:
                probability = share * Fraction(percent[count > 0], 100) / math.comb(choice, count)
                assert math.exp(log_prior(count, choice, kind)) == pytest.approx(float(probability))
                total += probability * math.comb(choice, count)
    assert total == 1


PRIOR_ODDS = {
    (Discrepancy.NONE, 1, Discrepancy.NONE): Fraction(50 * 70, 30 * 60),
    (Discrepancy.NONE, 8, Discrepancy.NONE): Fraction(50 * 70 * 8, 30 * 60),
    (Discrepancy.SMOOTH, 8, Discrepancy.NONE): Fraction(50 * 30 * 8, 30 * 60),
    (Discrepancy.NONE, 8, Discrepancy.FORM): Fraction(50 * 70 * 8, 30 * 20),
}


@pytest.mark.parametrize(("kinds", "odds"), PRIOR_ODDS.items())
def test_a_cause_leads_from_the_evidence_on_that_outweighs_its_prior_odds(kinds, odds):
    plain, choice, kind = kinds
    for more, leads in ((0.02, True), (-0.02, False)):
        rows = (row((), 0.0, plain), row(("p",), math.log(odds) + more, kind))
        assert (Beliefs(rows, choice).best().names == ("p",)) is leads


def test_what_is_only_seen_in_half_a_set_counts_with_half_its_gain():
    """ln Z of p rises by 6 over none; p counts with a share of 1/2, so that none is as probable as if it had 3 more."""
    lone = row(("p",), 6.0)
    lone.gain_shares = {"p": 0.5}
    beliefs = Beliefs((row((), 0.0), lone), 1)
    odds = beliefs.weights[1] / beliefs.weights[0]
    assert odds == pytest.approx(math.exp(3.0) * (0.3 * 0.6) / (0.5 * 0.7))


def test_the_noise_s_scale_is_sought_within_four_sds():
    """Data 20 times their declared noise: s ends at exp(4 * 0.15)."""
    toy = toys.random_toy(1, False, channels=1, folds=6, longest=1, numbers=1)
    toy.observed = 20.0 * toy.sd * np.sign(np.random.default_rng(2).normal(size=toy.sd.shape))
    samples = toy.samples()
    errors = ErrorModel(samples, Discrepancy.NONE)
    posterior_found = posterior(errors, Linear(samples.value, np.zeros((len(samples.value), 1))))
    assert np.exp(posterior_found.scales[errors.scales.index(("s", 0))]) == pytest.approx(math.exp(0.6), rel=1e-3)


# --- the explorer ----------------------------------------------------------------------------------------------------


def test_a_cause_whose_default_moves_less_than_0_3_sds_is_not_tried():
    toy = causes.design(3, "pq", size=None)
    for name, norm in (("p", 0.29), ("q", 0.31)):
        toy.columns[name] *= norm * causes.NOISE / np.linalg.norm(toy.columns[name])
    toy.observed = toy.columns["base"] + causes.NOISE * np.random.default_rng(0).normal(size=toy.sd.shape)
    beliefs = causes.explorer(toy, "pq").explore()
    assert beliefs.choice == 1
    assert set(itertools.chain(*beliefs.sets)) == {"q"}


@pytest.mark.parametrize(("behind", "closer", "close"), [(11.9, 5, True), (12.1, 5, False), (50.0, 3, True)])
def test_a_set_12_nats_behind_is_followed_only_for_its_squares(behind, closer, close):
    """`closer`: how many sets least squares put before it; up to the fourth of them is followed all the same."""
    names = "pqrstu"
    explorer = Explorer(SimpleNamespace(), [SimpleNamespace(name=name) for name in names])
    for at, name in enumerate(names):
        explorer.fitted[frozenset(name)] = (row((name,), -behind if name == "u" else 0.0),)
        explorer.flat[frozenset(name)] = (np.zeros(0), 1.0 if at < closer else 5.0)
    explorer.flat[frozenset("u")] = (np.zeros(0), 3.0)
    assert explorer._is_near([SimpleNamespace(name="u")]) is close


class Straying(Explorer):
    """An explorer that calls another value a stray each time it is asked."""

    asked = 0

    def _outlier_inflation(self):
        self.asked += 1
        inflation = np.ones(len(self.fitter.samples.value))
        inflation[self.asked % len(inflation)] = 4.0
        return inflation


def test_no_more_than_twelve_strays_are_taken_out():
    toy = causes.design(11, "p", folds=6, each=4, size=None)
    toy.observed = toy.columns["base"] + causes.NOISE * np.random.default_rng(4).normal(size=toy.sd.shape)
    explorer = Straying(causes.explorer(toy, "p").fitter, [])
    explorer.base()
    assert int((explorer.fitter.inflation == 4.0).sum()) == explorer.asked == 12


@pytest.mark.parametrize(("off", "is_stray"), [(2.9, False), (3.1, True)])
def test_a_value_three_sds_from_what_the_others_say_is_a_stray(off, is_stray):
    """Each from its conditional normal law by the others, partitioned by hand; the variance then makes it 1.5 SD."""
    toy = causes.design(11, "p", folds=6, each=4, size=None)
    toy.observed = toy.columns["base"] + causes.NOISE * np.random.default_rng(4).normal(size=toy.sd.shape)
    explorer = causes.explorer(toy, "p")
    explorer.base()
    *_, base = explorer.fitted[frozenset()]
    K = base.covariance + base.linear.slopes @ base.linear.slopes.T
    i, others = 20, np.arange(len(K)) != 20
    pull = np.linalg.solve(K[np.ix_(others, others)], K[others, i])
    sd = math.sqrt(K[i, i] - pull @ K[others, i])
    target = base.linear.target.copy()
    target[others] *= 1e-3
    target[i] = pull @ target[others] + off * sd
    stub = SimpleNamespace(linear=Linear(target, base.linear.slopes), covariance=base.covariance)
    explorer.fitted[frozenset()] = (stub,)
    inflation = explorer._outlier_inflation()
    assert (inflation is not None) is is_stray
    if is_stray:
        assert inflation[i] == pytest.approx((off / 1.5) ** 2, rel=1e-6)
        assert (np.delete(inflation, i) == 1.0).all()


# --- the next measurement --------------------------------------------------------------------------------------------


def told_by(square):
    """Nats that two equally probable sets are told apart by, of equal errors and a squared distance [SD^2]."""
    return -math.log((1.0 + math.exp(-square / 8.0)) / 2.0)


def distance_of(nats):
    return math.sqrt(-8.0 * math.log(2.0 * math.exp(-nats) - 1.0))


def proposed(folds, unmeasured=(), slopes=None, sd=1e3):
    """What is proposed of folds, an offer each, in which two sets differ by (pull, torque)."""
    offers, spread = [], np.full((1, 1), sd**2)
    hypotheses = []
    for names in ((), ("law",)):
        fit = SimpleNamespace(
            model=names, parameters=(toys.number("shared"),), u=np.zeros(1),
            task=SimpleNamespace(noise=SimpleNamespace(floor=np.ones(2))),
        )  # fmt: skip
        hypotheses.append(
            SimpleNamespace(names=names, fit=fit, posterior=SimpleNamespace(covariance=spread), experiment=None)
        )
    for at, difference in enumerate(folds):
        laws = {(): table([0.0, 0.0]), ("law",): table(difference)}
        slope = table([0.0, 0.0]) if slopes is None else table(slopes[at])
        ahead = Ahead(slope, (f"fold {at}",))
        meets = laws.__getitem__
        offers.append(Offer(ahead, declared_noise(np.ones(2), np.zeros((1, 2, 1))), meets, unmeasured))
        hypotheses[0].experiment = hypotheses[1].experiment = ahead
    return next_measurement([(0.5, law_of_errors) for law_of_errors in hypotheses], offers)


@pytest.mark.parametrize(("ratio", "what"), [(0.51, "fold 0"), (0.49, "fold 0, with torque too")])
def test_a_new_channel_is_asked_for_where_the_others_tell_less_than_half(ratio, what):
    pull = 1.5
    torque = math.sqrt(distance_of(told_by(pull**2) / ratio) ** 2 - pull**2)
    assert proposed([(pull, torque)], ("torque",)).what == what


@pytest.mark.parametrize(("share", "worth"), [(0.0105, True), (0.0095, False)])
def test_a_measurement_that_tells_less_than_a_hundredth_is_not_proposed(share, worth):
    proposal = proposed([(distance_of(share * math.log(2.0)), 0.0)])
    assert (proposal is not None) is worth


@pytest.mark.parametrize(("rank", "what"), [(3, "fold 3"), (4, None)])
def test_four_offers_are_worked_out_with_uncertain_numbers(rank, what):
    """Offers that would tell most if a number were known, which may be anything: only one differs across it."""
    folds = [(6.0 - 0.5 * at, 0.0) for at in range(rank)] + [(0.0, 2.0)]
    proposal = proposed(folds, slopes=[(1.0, 0.0)] * len(folds))
    assert (proposal and proposal.what) == what


@pytest.mark.parametrize(("second", "count"), [(0.045, 2), (0.035, 3)])
def test_sets_are_told_apart_that_hold_95_percent(second, count):
    shares = [0.91, second, 0.09 - second]
    sets = {frozenset(f"{at}"): share for at, share in enumerate(shares)}
    beliefs = SimpleNamespace(sets=sets, best=lambda names: SimpleNamespace(names=names, is_fitted=True))
    assert len(open_sets(beliefs)) == count


@pytest.mark.parametrize(("rms", "more"), [(0.99, False), (1.01, True)])
def test_a_function_left_is_more_than_noise_from_one_sd_on(rms, more):
    """RMS over the samples of one channel of one fold, the function being none elsewhere."""
    plain = hypothesis(expansion(None), ())
    good = plain.fit.task.noise.good
    rows = np.zeros(good.shape)
    rows[2, 1] = rms * np.sign(np.random.default_rng(3).normal(size=rows.shape[2]))
    sampled = plain.posterior
    evidence = FunctionEvidence(1.0, sampled.mean, sampled.covariance, rows[good], plain.fit.rows, 1.0)
    assert with_function(plain, evidence).leaves_more is more


def test_names_do_not_depend_on_the_order_of_causes():
    assert names_of([SimpleNamespace(name=name) for name in "qp"]) == frozenset("pq")
