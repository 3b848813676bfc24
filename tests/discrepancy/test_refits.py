"""What a search adds, confirms and calls alike, on refits made by hand."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest

from rover_pin.base.errors import OptimisationError
from rover_pin.base.quantity import Record, quantity
from rover_pin.discrepancy import calibration, refit_candidates, search
from rover_pin.discrepancy.candidate import Candidate
from rover_pin.discrepancy.refit import Refit, indistinguishable_refits
from rover_pin.discrepancy.screen import ABSORBED, STILL, Scored, Signature, _unconstrained_signature, started
from rover_pin.estimation.numbers import profiles
from rover_pin.estimation.parameter import Parameter
from tests.experiments.drive_log import linear_drive as linear

NOTHING = Signature(Candidate("A", object(), ()), {}, np.zeros(1))


def named(name):
    return Candidate(name, object(), ())


def refit(name, net=1.0, held_out=1.0):
    return Refit(named(name), SimpleNamespace(), net + 10.0, 10.0, held_out)


def searched(*rounds):
    return search.Search(None, tuple(SimpleNamespace(indistinguishable=each) for each in rounds), ())


# --- what a search says of itself ------------------------------------------------------------------------------------


def test_added_effects_are_each_rounds_best():
    assert searched((refit("A"), refit("E")), (refit("B"),), ()).names == "A + B"
    assert searched((refit("A"),), (refit("B"),), (refit("C"),)).names == "A + B + C"
    assert searched(()).names == searched().names == ""
    assert searched(()).indistinguishable == searched().indistinguishable == ()


def test_a_search_counts_what_its_first_round_scored():
    first, second = (search.Round(scored, ()) for scored in (("A", "B", "C"), ("A",)))
    assert search.Search(None, (first, second), ()).count == 3
    assert search.Search(None, (), ()).count == 0


def test_rivals_of_every_round_remain():
    assert searched((refit("A"), refit("E"))).indistinguishable == ("A", "E")
    rounds = ((refit("A"), refit("E")), (refit("B"), refit("F")))
    assert searched(*rounds).indistinguishable == ("A + B", "A + F", "E + B")


def test_an_exact_experiment_is_calibrated_from_several_starts(monkeypatch):
    seen = []
    monkeypatch.setattr(calibration, "scattered", lambda numbers, centre, starts, seed: [(starts, seed, *centre)])
    monkeypatch.setattr(calibration, "best_of", lambda task, model, numbers, starts: seen.append(starts[0]) or "best")
    monkeypatch.setattr(calibration, "fit", lambda task, model, numbers: "once")
    monkeypatch.setattr(calibration, "again", lambda fitted: f"{fitted} more")
    experiment = lambda exact: SimpleNamespace(is_exact=exact, noise=lambda: "declared", value=lambda model, name: 3.0)  # noqa: E731
    one = Parameter("k", 1.0, 0.5, 0.0, 9.0)
    assert calibration.calibrated(experiment(True), "model", [one], 7) == "best"
    assert [list(one) for one in seen] == [[calibration.STARTS, 7, 4.0]]
    assert calibration.calibrated(experiment(False), "model", [one], 7) == "once more"


# --- what is tried ---------------------------------------------------------------------------------------------------


def test_second_start_has_small_sizes_and_keeps_other_numbers():
    kinds = ({"prior": True}, {"prior": False}, {"prior": True}, {"prior": False, "log": True})
    numbers = [Parameter("x", 1.0, 0.5, 0.1, 9.0, **kind) for kind in ({"prior": False}, *kinds)]
    assert refit_candidates._small(numbers, np.full(5, 2.0), 1) == pytest.approx([2.0, 2.0, 0.2, 2.0, 2.0])


@pytest.mark.parametrize(
    ("net", "held_out", "again"),
    [
        (5.0, -1.0, True),
        (5.0, 0.0, True),
        (0.5, -1.0, True),
        (5.0, 0.5, False),
        (5.0, 1.0, False),
        (0.0, -1.0, False),
        (-5.0, -1.0, False),
    ],
)
def test_harmful_first_order_result_is_checked_on_every_fold(monkeypatch, net, held_out, again):
    losses = {"base": np.array([50.0, 60.0]), "fit": np.array([52.0, 55.0])}
    monkeypatch.setattr(refit_candidates, "refitted_surprises", losses.get)
    one = Refit(named("A"), "fit", net + 10.0, 10.0, held_out)
    assert refit_candidates._confirmed("base", one).held_out == (3.0 if again else held_out)


def scored(name, gain, place="", fee=10.0, told=True):
    one = Candidate(name, object(), (), place=place, place_searched=bool(place))
    return Scored(one, NOTHING, gain, 1.0, 1.0 if told else 0.0, 0.0)


def test_two_places_of_a_kind_and_five_candidates_are_refitted(monkeypatch):
    monkeypatch.setattr(refit_candidates, "placed", lambda start, row: row)
    rows = [scored("P", 100.0 - at, f"{at}") for at in range(4)] + [scored(name, 50.0) for name in "ABCD"]
    chosen = refit_candidates._chosen(None, rows, lambda one: 10.0)
    assert [row.candidate.name for row in chosen] == ["P@0", "P@1", "A", "B", "C"]


@pytest.mark.parametrize(
    ("gain", "best", "enough"), [(4.1, 9.0, True), (3.9, 9.0, False), (9.9, 500.0, False), (10.1, 500.0, True)]
)
def test_candidate_must_promise_shares_of_threshold_and_best(monkeypatch, gain, best, enough):
    monkeypatch.setattr(refit_candidates, "placed", lambda start, row: row)
    rows = [scored("A", best), scored("B", gain), scored("C", 1e9, told=False)]
    chosen = [row.candidate.name for row in refit_candidates._chosen(None, rows, lambda one: 10.0)]
    assert chosen == (["A", "B"] if enough else ["A"])


def polished_of(monkeypatch, *nets, inflation=2.25, promised=()):
    """The candidates that are fitted to the end, of refits A, B, ... with these net gains."""
    rows = [scored(name, 10.0 + gain) for name, gain in zip("ABCDEF", promised or nets, strict=False)]
    made = {row.candidate.name: refit(row.candidate.name, net=net) for row, net in zip(rows, nets, strict=True)}
    said = []
    patches = {
        "first_order_surprises": lambda base: 0.0,
        "_chosen": lambda base, scored, fee: rows,
        "_refit": lambda base, start, row, fee, without, reuse=True: made[row.candidate.name],
        "_polished": lambda base, one, without: one,
        "_confirmed": lambda base, one: one,
        "rescale_thresholds": lambda refits, fee: refits,
    }
    for name, instead in patches.items():
        monkeypatch.setattr(refit_candidates, name, instead)
    base = SimpleNamespace(task=SimpleNamespace(noise=SimpleNamespace(inflation=inflation)))
    refit_candidates.refit(base, rows, lambda one: 10.0, said.append)
    return "".join(line.split()[2].rstrip(",") for line in said if line.endswith("every slope anew"))


def test_those_within_reach_of_the_best_are_fitted_to_the_end(monkeypatch):
    """By twice the odds in units of the noise, 2 x 9.2 x 2.25 = 41.4, and a tenth of the best besides: 138.6 of 200."""
    assert polished_of(monkeypatch, 200.0, 139.0, 138.0) == "AB"
    assert polished_of(monkeypatch, 200.0, 162.0, 161.0, inflation=1.0) == "AB"
    assert polished_of(monkeypatch, 200.0, 190.0, 180.0, 170.0) == "ABC", "three at most"
    assert polished_of(monkeypatch, 20.0, 1.0, -1.0) == "AB", "what does not pay is left"
    assert polished_of(monkeypatch, 200.0, 100.0, promised=(200.0, 150.0)) == "AB", "or by what was promised"


def test_what_pays_nothing_is_not_fitted_to_the_end(monkeypatch):
    assert polished_of(monkeypatch, 5.0, 0.0) == "A"


def test_refit_below_its_promise_is_repeated_and_the_best_kept(monkeypatch):
    """Where it promised more than any reached, and more than nothing."""
    for promised, better, asked, kept in ((6.0, 7.0, True, 7.0), (6.0, 1.0, True, 3.0), (2.9, 7.0, False, 3.0)):
        made = {True: refit("A", net=3.0), False: refit("A", net=better)}
        assert refitted_of(monkeypatch, made, promised) == (asked, kept)
    made = {True: refit("A", net=-5.0), False: refit("A", net=-4.0)}
    assert refitted_of(monkeypatch, made, 0.05) == (True, -4.0)
    assert refitted_of(monkeypatch, made, -0.05) == (False, -5.0)


def refitted_of(monkeypatch, made, promised):
    """Whether the one candidate, which promises so much net, is refitted again, and the net gain that is kept."""
    asked = []

    def refitted(base, start, row, fee, without, reuse=True):
        asked.append(reuse)
        return made[reuse]

    patches = {
        "first_order_surprises": lambda base: 0.0,
        "_chosen": lambda base, scored, fee: scored,
        "_refit": refitted,
        "_polished": lambda base, one, without: one,
        "_confirmed": lambda base, one: one,
        "rescale_thresholds": lambda refits, fee: refits,
    }
    for name, instead in patches.items():
        monkeypatch.setattr(refit_candidates, name, instead)
    base = SimpleNamespace(task=SimpleNamespace(noise=SimpleNamespace(inflation=1.0)))
    [found] = refit_candidates.refit(base, [scored("A", 10.0 + promised)], lambda one: 10.0, lambda said: None)
    return asked == [True, False], found.net


def test_three_at_most_are_refitted_from_the_declared_numbers(monkeypatch):
    rows = [scored(name, 50.0) for name in "ABCDE"]
    monkeypatch.setattr(refit_candidates, "_chosen", lambda start, scored, fee: rows)
    monkeypatch.setattr(refit_candidates, "_refit", lambda base, start, row, fee, without, reuse=True: (start, reuse))
    declared = SimpleNamespace(start="declared", scored=rows)
    found = refit_candidates._from_declared("base", declared, None, None, lambda said: None)
    assert found == [("declared", True)] * 3


def test_every_wheel_is_a_place_of_its_own(monkeypatch):
    """Only of what is sought all over the ground two places are enough."""
    monkeypatch.setattr(refit_candidates, "placed", lambda start, row: row)
    wheels = [Candidate("Weak", object(), (), place=f"{at}") for at in range(3)]
    rows = [Scored(each, NOTHING, 50.0, 1.0, 1.0, 0.0) for each in wheels]
    assert len(refit_candidates._chosen(None, rows, lambda one: 10.0)) == 3


def test_a_leader_is_fitted_to_the_end_with_every_slope_anew(monkeypatch):
    seen = []

    def fit(task, model, numbers, u, slopes, stale=False):
        seen.append((model, numbers, u, slopes, stale))
        return SimpleNamespace(chi2=90.0)

    monkeypatch.setattr(refit_candidates, "fit", fit)
    monkeypatch.setattr(refit_candidates, "first_order_surprises", lambda fitted: np.zeros(2))
    fitted = SimpleNamespace(model="model", parameters="numbers", u="u", slopes="old")
    one = Refit(named("A"), fitted, 5.0, 7.0, 1.0)
    found = refit_candidates._polished(SimpleNamespace(task=None, chi2=100.0), one, np.array([3.0, 1.0]))
    assert seen == [("model", "numbers", "u", "old", True)]
    assert (found.gain, found.threshold, found.held_out) == (10.0, 7.0, 4.0)


@pytest.mark.parametrize(
    ("chi2", "started_with", "kept"),
    [((90.0,), [1.0], 90.0), ((110.0, 95.0), [1.0, 0.1], 95.0), ((110.0, 120.0), [1.0, 0.1], 110.0)],
)
def test_refit_without_improvement_restarts_near_zero(monkeypatch, chi2, started_with, kept):
    made, starts, slopes = iter(chi2), [], []

    def fit(task, model, numbers, here, given, reuse):
        starts.append(here[-1])
        slopes.append(given)
        return SimpleNamespace(chi2=next(made))

    one = Candidate("Kind", made_kind(0.2, 0.0, 0.0, 9.0), ("Kind.x",))
    monkeypatch.setattr(refit_candidates, "fit", fit)
    monkeypatch.setattr(refit_candidates, "started", lambda row, start: {})
    monkeypatch.setattr(refit_candidates, "first_order_surprises", lambda fitted: np.zeros(2))
    model = SimpleNamespace(having=lambda effect: model)
    experiment = SimpleNamespace(with_values=lambda model, values: model, value=lambda model, name: 0.2)
    base = SimpleNamespace(
        task=SimpleNamespace(experiment=experiment), model=model, parameters=(), u=np.zeros(0), chi2=100.0, slopes="old"
    )
    row = Scored(one, NOTHING, 1.0, 1.0, 1.0, 0.0)
    for reuse, given in ((True, "old"), (False, None)):
        made, starts[:], slopes[:] = iter(chi2), [], []
        found = refit_candidates._refit(base, base, row, lambda candidate: 7.0, np.array([3.0, 1.0]), reuse)
        assert (found.gain, found.threshold, found.held_out) == (100.0 - kept, 7.0, 4.0)
        assert starts == pytest.approx(started_with)
        assert set(slopes) == {given}
    made, slopes[:] = iter(chi2), []
    refit_candidates._refit(base, base, row, lambda candidate: 7.0, np.zeros(2))
    assert set(slopes) == {"old"}, "with the slopes of the start, unless told"


@pytest.mark.parametrize(("share", "value"), [(0.5, 0.85), (-0.5, 1.15), (9.0, 0.1), (-9.0, 1.9)])
def test_refit_starts_at_the_best_share_capped_at_three_sizes(share, value):
    signature = Signature(named("A"), {"A.m": 0.7}, np.zeros(1), {"A.m": 1.0})
    assert started(Scored(named("A"), signature, 1.0, share, 1.0, 0.0), None) == {"A.m": pytest.approx(value)}
    far = Signature(named("A"), {"A.m": 0.7}, np.zeros(1), {"A.m": 36.0})
    assert started(Scored(named("A"), far, 1.0, share, 1.0, 0.0), None) == {"A.m": 0.7}
    near = Signature(named("A"), {"A.m": 0.7}, np.zeros(1), {"A.m": 34.0})
    assert started(Scored(named("A"), near, 1.0, 0.5, 1.0, 0.0), None) == {"A.m": pytest.approx(17.35)}


def test_a_rival_of_a_weak_best_gains_something():
    """Nine units of the noise below the best, or nothing, whichever is more."""
    names = lambda *made: [one.name for one in indistinguishable_refits(made)]  # noqa: E731
    assert names(refit("A", net=5.0), refit("B", net=0.05), refit("C", net=-0.05)) == ["A", "B"]
    assert names(refit("A", net=30.0), refit("B", net=16.3), refit("C", net=16.1)) == ["A", "B"]


def test_searched_place_is_one_rival_but_every_wheel_is_its_own():
    def at(kind, place, sought, net):
        return Refit(
            Candidate(kind, object(), (), place=place, place_searched=sought), SimpleNamespace(), net + 9, 9.0, 1.0
        )

    ground = [at("P", "1.0", True, 9.0), at("P", "2.0", True, 8.0), at("Q", "1", True, 7.0), at("Q", "2", True, 6.0)]
    wheels = [at("Weak", "0", False, 5.0), at("Weak", "1", False, 4.0), at("P", "", False, 3.0)]
    assert [one.name for one in indistinguishable_refits([*ground, *wheels])] == [
        "P@1.0",
        "Q@1",
        "Weak[0]",
        "Weak[1]",
        "P",
    ]
    assert [one.name for one in indistinguishable_refits([*wheels, *ground])] == [
        "Weak[0]",
        "Weak[1]",
        "P",
        "P@1.0",
        "Q@1",
    ]


# --- what can be told ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("visible", "left", "told"),
    [
        (1.01 * STILL, 1.0, True),
        (0.99 * STILL, 1.0, False),
        (9.0, 1.01 * ABSORBED**2, True),
        (9.0, 0.99 * ABSORBED**2, False),
    ],
)
def test_candidate_is_identifiable_if_visible_and_not_imitated(visible, left, told):
    assert Scored(NOTHING.candidate, NOTHING, 1.0, 1.0, visible, 1 - left).is_identifiable == told
    assert (STILL, ABSORBED) == (0.3, 0.02)


def test_a_freed_number_moves_by_one_sd_of_its_prior():
    one = Parameter("g", 0.1, 0.02, -1.0, 1.0)
    base = SimpleNamespace(
        parameters=(Parameter("k", 1.0, 0.5, 0.0, 9.0), one), u=np.array([0.0, 1.5]), slopes={"g": np.ones(3)}
    )
    made = _unconstrained_signature(base, Candidate("A", None, ("g",)))
    assert made.neutral == {"g": pytest.approx(0.13)}
    assert made.amplitudes == {"g": pytest.approx(0.15)}
    assert made.shift is base.slopes["g"]


# --- coordinates of sizes and shapes ---------------------------------------------------------------------------------


def made_kind(default, neutral, low, high, unit="m"):
    @dataclass(frozen=True)
    class Kind(Record):
        """An effect of one number."""

        x: float = quantity(default, unit, "made", low, high, "x")
        neutral: ClassVar[dict[str, float]] = {"x": 0.0}

    Kind.neutral = {"x": neutral}
    return Kind()


@pytest.mark.parametrize(
    ("default", "neutral", "log", "scale"),
    [(0.1, 10.0, True, 1.0), (10.0, 100.0, False, -90.0), (0.3, 0.0, False, 0.3), (0.0, 0.0, False, 0.01)],
)
def test_size_scale_is_linear_from_neutral_or_logarithmic_if_far(default, neutral, log, scale):
    """Far off is beyond fifty times the default; a size without a default goes by a hundredth."""
    effect = made_kind(default, neutral, 0.0, 1e3)
    found = Candidate("Kind", effect, ("Kind.x",)).size("Kind.x")
    assert (found.log, found.scale, found.prior) == (log, pytest.approx(scale), False)
    assert found.value(0.0) == (default if log else neutral)


@pytest.mark.parametrize(
    ("value", "low", "log", "sd"),
    [
        (0.5, 0.0, True, 0.5),
        (2.0, 0.0, True, 0.5),
        (0.0, 0.0, False, 0.3),
        (0.5, -1.0, False, 0.15),
        (-0.5, -1.0, False, 0.15),
    ],
)
def test_shape_prior_is_half_its_logarithm_or_three_tenths_of_it(value, low, log, sd):
    effect = made_kind(0.1, 0.0, low, 9.0).replace(x=value)
    found = Candidate("Kind", effect, (), ("Kind.x",)).shape("Kind.x")
    assert (found.log, found.scale, found.prior) == (log, pytest.approx(sd), True)
    assert found.value(0.0) == value


# --- profiles --------------------------------------------------------------------------------------------------------


def test_a_profile_is_the_parabola_of_a_linear_fit():
    """rise = (u - u_best)^2 / variance over the noise's inflation and a misfit above 1."""
    random, free = np.random.default_rng(3), linear.nuisances()
    columns = linear.slopes(random, free)
    for size in (1.0, 2.5):
        fitted = linear.fitted(np.clip(size * random.normal(size=linear.SHAPE), -2.2, 2.2), columns)
        for at, one in enumerate(fitted.parameters):
            (found,) = profiles(fitted, (one.name,))
            off = np.array([one.u(value) for value in found.values]) - fitted.u[at]
            half = 1.959964 * fitted.spread[at]
            assert off == pytest.approx(half * np.array([-1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5]), abs=1e-9)
            unit = fitted.task.noise.inflation * max(fitted.misfit, 1.0)
            assert found.rises == pytest.approx(off**2 / fitted.covariance[at, at] / unit, rel=1e-5, abs=1e-8)


def test_a_profile_has_no_rise_where_the_others_do_not_settle(monkeypatch):
    """Such a point once ended the whole loop: a hole's length, depth and rest imitate one another."""
    random, free = np.random.default_rng(3), linear.nuisances()
    columns = linear.slopes(random, free)
    fitted = linear.fitted(np.clip(random.normal(size=linear.SHAPE), -2.2, 2.2), columns)

    def unsettled(*asked, **named):
        raise OptimisationError("a refit did not settle", status=400)

    monkeypatch.setattr("rover_pin.estimation.numbers.fit", unsettled)
    (found,) = profiles(fitted, (fitted.parameters[0].name,))
    assert [rise == 0.0 for rise in found.rises] == [False, False, False, True, False, False, False]
    assert np.isnan(found.rises).sum() == 6
