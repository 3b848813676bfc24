"""The search on linear experiments: what was hidden is found, estimates are fits, words are true as often as said."""

import math
from dataclasses import dataclass, replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.special import logsumexp

from rover_pin.base.errors import OptimisationError
from rover_pin.discrepancy import search as module
from rover_pin.discrepancy.conclude import left_out, noise_at_bound
from rover_pin.discrepancy.search import Search, is_bent
from rover_pin.discrepancy.signature import options, signatures, singles
from rover_pin.estimation.columns import Columns
from rover_pin.estimation.fit import STRETCH_BLOCKS
from rover_pin.inference.beliefs import chosen_without
from rover_pin.inference.error_model import PRIORS, Discrepancy
from rover_pin.inference.priors import COUNT_PRIORS, DISCREPANCY_PRIORS, log_prior
from tests.inference import linear_causes
from tests.inference import linear_search as toys
from tests.inference.test_beliefs import assert_as_often_as_said, calibration

NAMES = "pqrstu"
HIDDEN = {"none": {}, "single": {"r": -1.4}, "pair": {"q": -1.3, "t": 1.5}}
"""Sizes of what is hidden, over the default."""


@cache
def found(case):
    return toys.searched(toys.made(NAMES, HIDDEN[case], seed=1, size=12.0), NAMES)


@pytest.mark.parametrize("case", HIDDEN)
def test_what_is_hidden_is_found(case):
    beliefs = found(case).beliefs()
    names, probability = next(iter(beliefs.sets.items()))
    assert names == frozenset(HIDDEN[case])
    assert probability > 0.5
    for name in NAMES:
        assert (beliefs.inclusion(name) > 0.5) == (name in HIDDEN[case])
    assert beliefs.choice == len(NAMES)
    for name, size in HIDDEN[case].items():
        mean, sd = beliefs.moments(beliefs.best(tuple(names)), f"{name}.a")
        assert 2.0 * mean == pytest.approx(size, abs=8.0 * sd)


def test_estimates_of_sets_are_their_fits():
    """Rows within 4 SDs: the model is linear and the loss quadratic, so that one fit says all."""
    experiment = toys.made("pqrt", {"q": 0.5, "t": -0.5}, seed=2)
    search = toys.searched(experiment, "pqrt")
    assert np.abs(search.base.rows).max() < 4.0
    estimated = dict(search.estimates)
    for names, estimate in estimated.items():
        search.fit(names)
        fitted = search.fitted[names][0]
        assert fitted.is_fitted
        assert fitted.log_evidence == pytest.approx(estimate.log_evidence, abs=1e-3)
        for name in names:
            assert fitted.moments(f"{name}.a")[0] == pytest.approx(estimate.moments(f"{name}.a")[0], abs=1e-3)
    assert len(estimated) >= 10


@pytest.mark.parametrize("size", [6.0, 12.0, 30.0])
def test_two_that_do_the_same_share_the_probability(size):
    """However far off the base model is: about it, where strays count little, estimates lie far below fits."""
    experiment = toys.made("pqrs", {"q": 1.5}, size=size)
    experiment.columns["r"] = experiment.columns["q"].copy()
    beliefs = toys.searched(experiment, "pqrs").beliefs()
    assert beliefs.inclusion("q") == pytest.approx(beliefs.inclusion("r"), abs=0.02)
    assert beliefs.sets[frozenset()] < 0.01


# --- places ----------------------------------------------------------------------------------------------------------


def places(count):
    return [f"Patch@{at}" for at in range(count)]


def test_places_share_the_prior_of_their_kind():
    names = places(12)
    experiment = toys.made([*names, "q"], {"Patch@7": 0.9}, seed=3)
    base = toys.fitted(experiment)
    rows = signatures(base, [toys.candidate(name) for name in [*names, "q"]])
    alone = singles(base, rows)
    patch, second = options(base, rows)
    assert patch.candidate.name == "Patch@7"
    assert patch.log_places == pytest.approx(logsumexp(alone[:12]) - math.log(12) - alone[:12].max())
    assert (second.candidate.name, second.log_places) == ("q", 0.0)
    search = Search(base)
    beliefs = search.run(rows)
    assert beliefs.choice == 2
    estimate = search.estimates[frozenset({"Patch@7"})]
    assert estimate.log_evidence == pytest.approx(logsumexp(alone[:12]) - math.log(12))


def test_many_places_are_no_more_probable_than_one():
    """Of ten sets of noise, each with the best of ten places."""
    probabilities = [
        toys.searched(toys.made(places(10), seed=seed, shape=(3, 1, 20)), places(10)).beliefs() for seed in range(10)
    ]
    assert np.mean([1.0 - beliefs.sets[frozenset()] for beliefs in probabilities]) < 0.25, "beforehand a half"


@dataclass(frozen=True, eq=False)
class Sliding(toys.Sums):
    """A patch whose place may lie anywhere: its columns are those of its begin, in hundredths."""

    def neighbours(self, candidate, step):
        """Return the patch earlier and later by a step."""
        if not candidate.place:
            return []
        places = [round(float(candidate.place) + move, 3) for move in (-step, step)]
        return [toys.candidate(f"Patch@{place:.3f}") for place in places]

    def sum_of(self, model):
        """What one model predicts."""
        (base, number), *more = model.records
        total = super().sum_of(toys.Model(((base, number),)))
        for _, record in more:
            begin = float(record.name.partition("@")[2])
            total = total + record.a * 4.0 * (np.abs(self.varied[:, None, :, 0] - begin) < 0.15)
        return total


def test_an_edge_is_moved_until_it_gains_no_more():
    """First tried at 0.4 and 0.7, the patch lies about 0.55."""
    draw = np.random.default_rng(0)
    shape = (3, 2, 201)
    columns = {"base": draw.normal(size=shape)}
    empty = Sliding(np.zeros(shape), columns)
    drawn_values = empty.sum_of(toys.Model().having(toys.Effect("Patch@0.55", 0.8)))
    experiment = Sliding(drawn_values + draw.normal(size=shape), columns)
    search = toys.searched(experiment, ["Patch@0.400", "Patch@0.700"])
    (patch,) = [rows[0] for names, rows in search.fitted.items() if names]
    effect = dict(patch.model.records)["Patch"]
    assert float(effect.name.partition("@")[2]) == pytest.approx(0.55, abs=0.03)
    assert effect.a == pytest.approx(0.8, abs=0.1)
    assert patch.names[0] in ("Patch@0.400", "Patch@0.700"), "by the place at which it was listed"
    assert (module.FIRST_EDGE_STEP, module.LAST_EDGE_STEP) == (0.08, 0.02)


# --- what cannot be fitted -------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Losing(toys.Sums):
    """Nothing is predicted with the effect p: a number that is far off stands for it."""

    stand_in = 1e3

    def sum_of(self, model):
        """What one model predicts."""
        lost = any(owner == "p" and record.a for owner, record in model.records)
        return np.full(self.observed.shape, self.stand_in) if lost else super().sum_of(model)


def test_what_loses_predictions_is_not_chosen():
    beliefs = toys.searched(toys.made(NAMES, {"q": 1.5}, of=Losing, size=12.0), NAMES).beliefs()
    assert beliefs.inclusion("p") < 1e-3
    assert beliefs.inclusion("q") > 0.99


def test_what_no_fit_ends_with_is_said_to_be_untried(monkeypatch):
    real = module.fit

    def fit(task, model, *more, **options):
        if "q" in dict(model.records):
            raise OptimisationError("it does not end", status="")
        return real(task, model, *more, **options)

    monkeypatch.setattr(module, "fit", fit)
    beliefs = toys.searched(toys.made(NAMES, {"q": 1.5}, size=12.0), NAMES).beliefs()
    assert beliefs.untried == ("q",)
    assert beliefs.inclusion("q") < 0.2, "of sets that were estimated only, which are improbable"


@pytest.mark.parametrize("most", [1, 2])
def test_what_leads_is_always_fitted(most, monkeypatch):
    """However many were: an estimate is no verdict, and its sizes are in no model."""
    monkeypatch.setattr(module, "MAX_FITS", most)
    sizes = {name: 1.0 for name in "pqr"}
    beliefs = toys.searched(toys.made(NAMES, sizes, size=15.0), NAMES).beliefs()
    assert beliefs.best().is_fitted
    assert set(beliefs.best().names) == set(sizes)


def test_a_spent_budget_ends_the_search_and_is_said():
    """No fit at all but of the base model: what is more probable by its estimate is named as left out, and not kept."""
    experiment = toys.made(NAMES, {"q": 1.5}, size=12.0)
    base = toys.fitted(experiment)
    search = Search(base, budget=0)
    beliefs = search.run(signatures(base, [toys.candidate(name) for name in NAMES]))
    assert set(search.fitted) == {frozenset()}
    assert beliefs.best().names == ()
    assert ("q",) in beliefs.end.unfitted
    (said,) = left_out(beliefs)
    assert "q" in said
    whole = toys.searched(experiment, NAMES)
    assert whole.beliefs().end.unfitted == ()
    assert left_out(whole.beliefs()) == ()
    assert 0 < whole.predictions == whole.beliefs().end.predictions <= experiment_predictions(experiment)


def experiment_predictions(experiment):
    """Models that were predicted, those of candidates and of the base model's fit included."""
    return sum(experiment.asked)


@pytest.mark.parametrize("times", [1.0, 6.0])
def test_a_residual_beyond_its_declared_noise_is_stated_by_channel(times):
    """The noise scale of the evidence stays within its prior; the ratio of a channel does not."""
    experiment = toys.made("pq", seed=4)
    louder = experiment.observed.copy()
    louder[:, 1] *= times
    beliefs = toys.searched(replace(experiment, observed=louder), "pq").beliefs()
    taken = beliefs.noise_taken(())
    bound = math.exp(3.0 * PRIORS["s"].sd) if times > 1.0 else 0.0
    assert beliefs.best(()).noise_at_bound == pytest.approx(bound)
    assert len(noise_at_bound(beliefs.best(()))) == (times > 1.0)
    assert taken["c0"] == pytest.approx(1.0, abs=0.4), "the fit also follows the louder channel"
    assert taken["c1"] == pytest.approx(times, rel=0.4), "large residuals count less than squared"


def test_a_set_is_ended_only_while_it_is_likely(monkeypatch):
    """The smaller of two likely sets comes first, and at its end the larger is not likely any more: it is left."""
    small, large = frozenset("p"), frozenset("pq")
    search = replace(
        toys.searched(toys.made(NAMES), NAMES), fitted={large: [], small: []}, finished=set(), parted=set()
    )
    ended_sets = []

    def end(self, names):
        ended_sets.append(names)
        self.finished.add(names)

    def beliefs(self):
        return SimpleNamespace(sets={small: 0.99, large: 0.01} if ended_sets else {large: 0.5, small: 0.5})

    monkeypatch.setattr(Search, "_end", end)
    monkeypatch.setattr(Search, "beliefs", beliefs)
    while search._end_likely():
        assert len(ended_sets) < 3
    assert ended_sets == [small]


def test_a_candidate_that_moves_nothing_is_no_option():
    experiment = toys.made("pq", seed=2)
    experiment.columns["p"] *= 1e-6
    search = toys.searched(experiment, "pq")
    assert list(search.options) == ["q"]
    assert search.beliefs().choice == 1
    assert toys.searched(experiment, "p").beliefs().sets == {frozenset(): 1.0}


# --- bent numbers ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Stuck(toys.Sums):
    """The effect p acts about the declared number alone: where the rover does not move, it changes nothing."""

    def sum_of(self, model):
        """What one model predicts."""
        (_, number), *more = model.records
        acts = math.exp(-((number.b / 2.0) ** 4))
        return number.b * self.columns["base"] + acts * sum(record.a * self.columns[name] for name, record in more)


def stuck(size):
    experiment = toys.made("pqr", seed=5, of=Stuck)
    draw = np.random.default_rng(5)
    along, across = draw.normal(size=(2, *toys.SHAPE))
    columns = {**experiment.columns, "base": 8.0 * along, "p": -40.0 * along + 4.0 * across}
    return Stuck(size * columns["p"] + draw.normal(size=toys.SHAPE), columns)


def test_absorbed_effect_is_found_from_the_declared_numbers(monkeypatch):
    search = toys.searched(stuck(1.0), "pqr")
    assert is_bent(search.base)
    assert search.base.u[0] < -4.0
    assert search.beliefs().inclusion("p") > 0.99
    best = search.beliefs().best()
    assert dict(best.model.records)["p"].a == pytest.approx(1.0, abs=0.1)
    assert abs(best.fit.u[0]) < 1.0
    monkeypatch.setattr(module, "is_bent", lambda fitted: False)
    assert toys.searched(stuck(1.0), "pqr").beliefs().inclusion("p") > 0.99, "the residual is no noise"
    monkeypatch.setattr(module, "MAX_CHI_SQUARE", math.inf)
    assert toys.searched(stuck(1.0), "pqr").beliefs().inclusion("p") < 0.5, "from the base there is no way down"


class Jumping(toys.Sums):
    """One block of one run jumps by JUMP at any change, as that of a wheel that just stops."""

    difference = 1e-5

    def sum_of(self, model):
        """What one model predicts."""
        total = super().sum_of(model)
        total[2, :, 7] += JUMP * math.sin(
            1e9 * sum(record.b if name == "base" else record.a for name, record in model.records)
        )
        return total


JUMP = 0.02


def test_a_jump_tells_no_slope_and_makes_no_cause():
    """Slopes of 2,000 in one block made the base model's numbers so sure that any cause beside them was likelier."""
    for seed in range(2):
        steady, jumping = (toys.made(NAMES, seed=seed, size=12.0, of=kind) for kind in (toys.Sums, Jumping))
        base, fitted = toys.fitted(steady), toys.fitted(jumping)
        assert not fitted.slopes["base.b"][2, :, 7].any()
        others = np.ones(toys.SHAPE, dtype=bool)
        others[2, :, 7] = False
        assert fitted.slopes["base.b"][others] == pytest.approx(base.slopes["base.b"][others], rel=1e-4)
        assert fitted.spread == pytest.approx(base.spread, rel=0.1)
        none = toys.searched(jumping, NAMES).beliefs().sets[frozenset()]
        assert none == pytest.approx(toys.searched(steady, NAMES).beliefs().sets[frozenset()], abs=0.1)


# --- what is left ----------------------------------------------------------------------------------------------------


def test_what_is_left_is_weighed_of_all_that_was_fitted():
    search = toys.searched(toys.made(NAMES, {"q": 1.5}, size=12.0), NAMES)
    before = search.beliefs()
    draw = np.random.default_rng(0)
    search.leave([Columns(30.0 * draw.normal(size=(len(search.base.rows), 3)), (slice(None),))])
    for rows in search.fitted.values():
        assert [row.discrepancy for row in rows] == [Discrepancy.NONE, Discrepancy.SMOOTH]
    assert len(search.beliefs().hypotheses) > len(before.hypotheses)
    assert search.beliefs().leaves_more(("q",)) < 0.3, "noise leaves no function"


def test_a_set_far_behind_may_lead_with_what_its_law_leaves():
    """Most of the data is a function of the list; without it r and s stand in for that, and q is far behind them."""
    experiment = toys.made(NAMES, {"q": 1.5}, size=12.0)
    noise, draw = experiment.noise(), np.random.default_rng(1)
    left = 0.6 * experiment.columns["r"] + 0.6 * experiment.columns["s"] + 3.0 * draw.normal(size=toys.SHAPE)
    search = toys.searched(replace(experiment, observed=experiment.observed + 4.0 * left), NAMES)
    search.fit(frozenset("q"))
    plain = search.beliefs()
    assert "r" in plain.best().names
    assert plain.sets[frozenset("q")] < 1e-3
    search.leave([Columns(100.0 * noise.white(left[None]).T, (slice(None),))])
    assert search.beliefs().best().names == ("q",)
    assert search.beliefs().leaves_more(("q",)) > 0.99
    assert chosen_without(search.beliefs()).count(frozenset("q")) >= 4, "of five folds"


# --- rows that hang together -----------------------------------------------------------------------------------------


def gain_of(experiment):
    """What q adds to ln Z: as it counts, and plain."""
    beliefs = toys.searched(experiment, NAMES).beliefs()
    places = {row.names: at for at, row in enumerate(beliefs.hypotheses)}
    at, none = places["q",], places[()]
    prior = log_prior(1, len(NAMES), Discrepancy.NONE) - log_prior(0, len(NAMES), Discrepancy.NONE)
    plain = beliefs.hypotheses[at].log_evidence - beliefs.hypotheses[none].log_evidence
    return beliefs.scores[at] - beliefs.scores[none] - prior, plain


def test_repeated_rows_count_as_often_as_they_are_independent():
    """Each value stands STRETCH_BLOCKS times in a row: what q adds is what it adds to the values, once each."""
    counted, plain, expected = [], [], []
    for seed in range(6):
        once = toys.made(NAMES, {"q": 0.5}, seed=seed, size=12.0, shape=(6, 2, 12))
        observed, *columns = (
            np.repeat(table, STRETCH_BLOCKS, axis=2) for table in (once.observed, *once.columns.values())
        )
        often = replace(once, observed=observed, columns=dict(zip(once.columns, columns, strict=True)))
        for row, gain in zip((counted, plain, expected), (*gain_of(often), gain_of(once)[1]), strict=True):
            row.append(gain)
    assert min(plain) > 6.0 * min(expected)
    assert np.sum(counted) == pytest.approx(np.sum(expected), rel=0.35)
    assert np.array(counted) == pytest.approx(np.array(expected), rel=0.6)


@pytest.mark.parametrize("seed", range(3))
def test_independent_rows_count_in_full(seed):
    counted, plain = gain_of(toys.made(NAMES, {"q": 0.5}, seed=seed, size=12.0, shape=(6, 2, 96)))
    assert 0.7 * plain < counted < plain + 1e-9


# --- calibration -----------------------------------------------------------------------------------------------------

SHARES = [share * DISCREPANCY_PRIORS[count > 0][Discrepancy.NONE] for count, share in enumerate(COUNT_PRIORS)]
"""Prior probability of no to four causes, where nothing else is left."""


def drawn(seed, names):
    """An experiment with data drawn from the priors, noise's scale included, and the names of what acts."""
    draw = np.random.default_rng(seed)
    toy = linear_causes.design(seed + 10**6, names, channels=2)
    count = linear_causes.spread(seed * 0.6180340, SHARES[: len(names) + 1])
    true = [names[at] for at in draw.permutation(len(names))[:count]]
    parts = [linear_causes.size(draw) * toy.columns[name] for name in true]
    scale = linear_causes.NOISE * math.exp(PRIORS["s"].sd * draw.normal())
    observed = draw.normal() * toy.columns["base"] + sum(parts) + scale * draw.normal(size=toy.sd.shape)
    return toys.Sums(observed, toy.columns, linear_causes.NOISE), true


def answered(seed, names):
    experiment, true = drawn(seed, names)
    return toys.searched(experiment, names).beliefs(), true


@pytest.mark.slow
def test_what_is_said_is_true_as_often_as_its_probability():
    assert_as_often_as_said(answered, NAMES)


def test_what_is_said_of_two_causes_is_true_as_often():
    assert np.abs(calibration(answered, range(12), NAMES[:2])).max() < 3.5
