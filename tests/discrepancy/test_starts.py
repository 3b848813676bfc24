"""From where, and of how many numbers, an exact refit starts; what it owes: by hand, on fits that are only noted."""

from types import SimpleNamespace

import numpy as np
import pytest

from rover_pin.discrepancy import exact_refits
from rover_pin.discrepancy.candidate import Candidate
from rover_pin.discrepancy.exact_refits import bearable, is_whole, rank_refits, variants, with_visible_shapes
from rover_pin.discrepancy.refit import Refit, indistinguishable_refits
from rover_pin.discrepancy.screen import null_threshold
from rover_pin.effects.post_peak import PostPeak
from rover_pin.effects.slip_sinkage import SlipSinkage
from rover_pin.estimation.parameter import Parameter

WHOLE, CUT = np.ones((4, 1, 5), dtype=bool), np.ones((4, 1, 5), dtype=bool)
CUT[2] = False
OWN = Parameter("soil.k", 1.0, 1.0, -9.0, 9.0)


def size(name="A.x", low=0.0, **more):
    return Parameter(name, 0.0, 1.0, low, 9.0, **{"prior": False, **more})


def starts_of(*own):
    numbers = (OWN, *own)
    here = np.arange(2.0, 2.0 + len(numbers))
    return [list(one) for one in exact_refits._starts(numbers, here, 1)]


def test_size_starts_small_as_it_is_and_below_neutral_if_allowed():
    """0.05 of what it is, the base's own numbers as they are; below neutral only what has no prior and may."""
    assert starts_of(size()) == [[2.0, 0.05 * 3.0], [2.0, 3.0]]
    assert starts_of(size(low=-0.1)) == [[2.0, 0.05 * 3.0], [2.0, 3.0], [2.0, -0.05 * 3.0]]
    assert starts_of(size(low=0.5)) == [[2.0, 0.05 * 3.0], [2.0, 3.0]]
    assert starts_of(size(low=-9.0, prior=True)) == [[2.0, 0.05 * 3.0], [2.0, 3.0]], "a prior tells where it is"
    both = starts_of(size(), size("A.y", low=-1.0))
    assert both == [[2.0, 0.05 * 3.0, 0.05 * 4.0], [2.0, 3.0, 4.0], [2.0, -0.05 * 3.0, -0.05 * 4.0]]


def test_a_number_on_a_logarithm_starts_where_it_is():
    logged = Parameter("A.z", 1.0, 1.0, 0.01, 9.0, log=True, prior=False)
    assert starts_of(size(), logged) == [[2.0, 0.05 * 3.0, 4.0], [2.0, 3.0, 4.0]]
    assert starts_of(logged) == [[2.0, 3.0], [2.0, 3.0]], "of it alone nothing is turned round"


def test_new_numbers_of_a_fit_start_small_and_shapes_published():
    fitted = SimpleNamespace(parameters=(OWN, size()), u=np.array([0.7, -0.4]))
    shape = Parameter("A.s", 1.0, 1.0, 0.1, 9.0, log=True)
    loose = Parameter("A.l", 1.0, 1.0, 0.1, 9.0, log=True, prior=False)
    numbers = (OWN, size(), size("B.x"), size("B.p", prior=True), shape, loose)
    assert list(exact_refits._of(numbers, fitted)) == [0.7, -0.4, 0.05, 0.0, 0.0, 0.0]


def based(good=WHOLE, count=40, own=(OWN,)):
    model = SimpleNamespace(having=lambda effect: model)
    experiment = SimpleNamespace(value=lambda model, name: 0.5)
    noise = SimpleNamespace(good=good, count=count, inflation=1.0)
    task = SimpleNamespace(experiment=experiment, noise=noise)
    return SimpleNamespace(model=model, task=task, u=np.zeros(len(own)), parameters=own)


def test_a_fold_is_left_out_where_nothing_of_it_is_compared():
    assert is_whole(based())
    assert not is_whole(based(CUT))
    part = WHOLE.copy()
    part[2, 0, 1] = False
    assert is_whole(based(part)), "a block of it is not compared, the others are"


@pytest.fixture
def noted(monkeypatch):
    """Fits are noted: how many numbers they have and from how many starts; every second ends."""
    asked = []

    def best_of(task, model, numbers, starts):
        asked.append((tuple(one.name for one in numbers), len(starts)))
        return SimpleNamespace(parameters=numbers, u=np.zeros(len(numbers)))

    monkeypatch.setattr(exact_refits, "best_of", best_of)
    monkeypatch.setattr(exact_refits, "with_visible_shapes", lambda fitted, one: one)
    return asked


LAW = Candidate("PostPeak", PostPeak(), ("PostPeak.fraction",), ("PostPeak.S_w",))


@pytest.mark.parametrize(("good", "first", "second"), [(WHOLE, 2, 3), (CUT, 1, 2)])
def test_law_is_refitted_as_published_and_then_with_shapes_freed(good, first, second, noted):
    """Where a fold is left out it starts from what it is on all data alone."""
    found = variants(based(good), LAW)
    assert [one.free_shapes for one, _ in found] == [(), ("PostPeak.S_w",)]
    own = ("soil.k", "PostPeak.fraction")
    assert noted == [(own, first), ((*own, "PostPeak.S_w"), second)]


def test_a_law_without_shapes_is_refitted_once(noted):
    bare = LAW.bare
    assert [one for one, _ in variants(based(), bare)] == [bare]
    assert len(noted) == 1


def fitted_line(values, moves, bound):
    """A fit at some values, each of which moves the one row by so much; SDs of 0.5."""

    class Line:
        def value(self, model, name):
            return model[name]

        def with_values(self, model, given):
            assert all(value <= bound for value in given.values())
            return model | given

        def predict(self, models):
            return np.array([[sum(moves[name] * value for name, value in one.items())] for one in models])

    line, noise = Line(), SimpleNamespace(white=lambda moved: moved / 0.5)
    task = SimpleNamespace(experiment=line, noise=noise)
    return SimpleNamespace(task=task, model=values, predicted=line.predict([values])[0])


@pytest.mark.parametrize(("moves", "told"), [(0.0, False), (0.29, False), (0.31, True), (-0.31, True)])
@pytest.mark.parametrize("S_w", [0.4, 9.0])
def test_shape_is_visible_if_one_prior_sd_moves_the_data(S_w, moves, told):
    """ln S_w has a prior SD of 1/2; where that is beyond its bound it is moved the other way."""
    law = Candidate("PostPeak", PostPeak(S_w=S_w), ("PostPeak.fraction",), ("PostPeak.S_w",))
    step = S_w * (np.exp(0.5) - 1.0) if S_w * np.exp(0.5) <= 10.0 else S_w * (1.0 - np.exp(-0.5))
    fitted = fitted_line({"PostPeak.S_w": S_w}, {"PostPeak.S_w": moves * 0.5 / step}, bound=10.0)
    assert with_visible_shapes(fitted, law).shapes == (("PostPeak.S_w",) if told else ())
    assert with_visible_shapes(fitted, law).amplitudes == law.amplitudes


def test_a_law_whose_shapes_move_nothing_is_refitted_once(noted, monkeypatch):
    monkeypatch.setattr(exact_refits, "with_visible_shapes", lambda fitted, one: one.bare)
    assert [one.free_shapes for one, _ in variants(based(), LAW)] == [()]
    assert len(noted) == 1


def test_half_a_free_number_for_each_block_is_borne():
    free = tuple(size(f"A.x{at}") for at in range(10))
    assert bearable(based(count=20), (OWN, *free))
    assert not bearable(based(count=19), (OWN, *free))


@pytest.mark.parametrize(("good", "starts"), [(WHOLE, 3), (CUT, 2)])
def test_pair_starts_from_both_singles_or_in_a_fold_the_first(good, starts, noted):
    fitted = SimpleNamespace(parameters=(OWN, size()), u=np.array([0.7, -0.4]))
    one, other = (Refit(Candidate(kind, SlipSinkage(), (f"{kind}.n_1",)), fitted, 9.0, 1.0, 1.0) for kind in "AB")
    assert len(exact_refits._pair(based(good), one, other)) == 1
    assert noted == [(("soil.k", "A.n_1", "B.n_1"), starts)]


# --- what is owed ----------------------------------------------------------------------------------------------------


def fitted(chi2, misfit):
    return SimpleNamespace(chi2=chi2, misfit=misfit)


@pytest.mark.parametrize(("misfits", "unit"), [((2.0, 3.0), 2.0), ((0.5, 3.0), 1.5)])
def test_replacement_of_the_best_pays_for_the_shapes_it_frees(misfits, unit, monkeypatch):
    """In units of what the best leaves, the noise's own at least; nothing is predicted where nothing pays."""
    monkeypatch.setattr(exact_refits, "losses_of", lambda fit: pytest.fail("nothing pays"))
    base = SimpleNamespace(chi2=100.0, task=SimpleNamespace(noise=SimpleNamespace(inflation=1.5)))
    freed = Candidate("B", object(), (), free_shapes=("B.p", "B.q"))
    tried = [
        ((), Candidate("A", object(), ()), fitted(99.0, misfits[0])),
        ((freed,), Candidate("C", object(), ()), fitted(98.0, misfits[1])),
    ]
    fee = lambda candidate, inflation: 10.0 * inflation  # noqa: E731
    found = {one.name: one for one in rank_refits(base, tried, fee, paid=7.0)}
    assert found["A"].threshold == pytest.approx(unit * 17.0)
    assert found["B + C"].threshold == pytest.approx(unit * (17.0 + 2.0 * null_threshold(1)))
    assert [one.gain for one in found.values()] == [1.0, 2.0] or [one.gain for one in found.values()] == [2.0, 1.0]
    assert {one.unit for one in found.values()} == {unit}
    assert {one.held_out for one in found.values()} == {0.0}


def test_what_gains_its_threshold_exactly_does_not_pay(monkeypatch):
    monkeypatch.setattr(exact_refits, "losses_of", lambda fit: pytest.fail("nothing pays"))
    base = SimpleNamespace(chi2=100.0, task=SimpleNamespace(noise=SimpleNamespace(inflation=1.0)))
    [found] = rank_refits(base, [((), LAW, fitted(90.0, 1.0))], lambda candidate, inflation: 10.0)
    assert (found.net, found.held_out) == (0.0, 0.0)


def test_gain_just_above_its_threshold_is_checked_on_folds(monkeypatch):
    monkeypatch.setattr(exact_refits, "losses_of", lambda fit: np.array([fit.chi2, 1.0]))
    base = SimpleNamespace(chi2=100.0, task=SimpleNamespace(noise=SimpleNamespace(inflation=1.0, good=WHOLE)))
    [found] = rank_refits(base, [((), LAW, fitted(89.5, 1.0))], lambda candidate, inflation: 10.0)
    assert (found.net, found.held_out) == (0.5, 10.5)


def test_a_pair_whose_fit_does_not_end_is_none(monkeypatch):
    monkeypatch.setattr(exact_refits, "best_of", lambda task, model, numbers, starts: None)
    one = Refit(LAW, SimpleNamespace(parameters=(OWN,), u=np.zeros(1)), 9.0, 1.0, 1.0)
    assert exact_refits._pair(based(), one, one) == []
    assert variants(based(), LAW) == []


@pytest.mark.parametrize(("net", "held_out", "accepted"), [(1.0, 1.0, True), (0.0, 1.0, False), (1.0, 0.0, False)])
def test_what_gains_nothing_is_not_accepted(net, held_out, accepted):
    one = Refit(Candidate("A", object(), ()), SimpleNamespace(), 10.0 + net, 10.0, held_out)
    assert one.accepted is accepted
    assert bool(indistinguishable_refits([one])) is accepted
