"""The score test's parts against dense linear algebra: reach, score, what no candidate explains, where it is tried."""

import math
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from rover_pin.base.quantity import quantities
from rover_pin.discrepancy import refit_candidates, screen, search
from rover_pin.discrepancy.calibration import is_bent
from rover_pin.discrepancy.candidate import Candidate
from rover_pin.discrepancy.screen import Scored, Signature, _reachable, saturated, score, started, trials
from rover_pin.effects.gravity_tilt import GravityTilt
from rover_pin.effects.hard_patch import HardPatch
from rover_pin.effects.rate_dependence import RateDependence
from rover_pin.effects.torque_saturation import TorqueSaturation
from rover_pin.estimation.parameter import Parameter

RATE = Candidate("RateDependence", RateDependence(), ("RateDependence.c_r",))
BOUNDS = quantities(RateDependence)["c_r"]


def signature(size, neutral, moved=np.zeros(1)):
    return Signature(RATE, {"RateDependence.c_r": size}, moved, {"RateDependence.c_r": neutral})


@pytest.mark.parametrize(("size", "neutral"), [(0.05, 0.0), (0.3, 0.1), (-0.1, 0.0), (-0.05, 0.2)])
def test_a_step_ends_where_the_size_meets_its_bounds(size, neutral):
    """neutral + share (size - neutral) within the bounds, on either side of neutral; inside it is as asked."""
    ends = sorted(neutral + _reachable(signature(size, neutral), share) * (size - neutral) for share in (1e9, -1e9))
    assert ends == pytest.approx([BOUNDS.low, BOUNDS.high])
    assert _reachable(signature(size, neutral), 0.4) == 0.4
    assert _reachable(signature(size, neutral), -0.05) == -0.05


def test_neutral_size_is_unbounded_and_a_freed_number_two_sided():
    assert _reachable(signature(0.1, 0.1), 1e9) == 1e9
    freed = Candidate("soil.k", None, ("soil.k",))
    assert _reachable(Signature(freed, {"soil.k": 1.0}, np.zeros(1), {"soil.k": 0.5}), -1e9) == -1e9


@dataclass(frozen=True)
class White:
    """Noise of SD 1 without memory, and no chance beside it."""

    random_effects: None = None

    def white(self, values):
        return np.reshape(values, (*np.shape(values)[:-3], -1))


def based(random, runs=3, channels=2, blocks=7, u=(0.4, -0.7), far=0.5):
    """A fit away from its optimum: one number with a prior, one without. Rows are measured minus predicted,
    columns what they change by with u; the noise is white."""
    shape = (runs, channels, blocks)
    slopes = {name: random.normal(size=shape) for name in ("a", "b")}
    residual = far * random.normal(size=shape)
    flat = White().white
    parameters = (Parameter("a", 0.0, 1.0, -9, 9), Parameter("b", 0.0, 1.0, -9, 9, prior=False))
    noise = White()
    return SimpleNamespace(
        rows=flat(residual), residual=residual, slopes=slopes, columns=-flat(np.array([slopes["a"], slopes["b"]])).T,
        parameters=parameters, u=np.array(u), task=SimpleNamespace(noise=noise),
    )  # fmt: skip


def weights_of(rows):
    """Rows beyond 4 SDs count by 4 over their size."""
    return np.minimum(1.0, 4.0 / np.abs(rows))


@pytest.mark.parametrize("far", [0.5, 3.0])
def test_candidate_scores_the_residual_with_numbers_and_priors(far):
    """Gain and step of the quadratic in (du, share), solved whole: the prior pulls u back to 0, where there is one."""
    random = np.random.default_rng(3)
    base, moved = based(random, far=far), random.normal(size=(3, 2, 7))
    [row] = score(base, [Signature(Candidate("soil.k", None, ("soil.k",)), {"soil.k": 1.0}, moved)])
    J, d, W = -base.columns, moved.ravel(), np.diag(weights_of(base.rows))
    X, prior = np.column_stack([J, d]), np.diag([1.0, 0.0, 0.0])
    normal = X.T @ W @ X + prior
    right = X.T @ W @ base.rows - prior @ np.array([*base.u, 0.0])
    step = np.linalg.solve(normal, right)
    alone = np.linalg.solve(normal[:2, :2], right[:2])
    assert row.share == pytest.approx(step[2])
    assert row.gain == pytest.approx(right @ step - right[:2] @ alone)
    assert row.visible == pytest.approx(1.0 / math.sqrt(np.linalg.inv(normal)[2, 2]))
    assert row.absorbed == pytest.approx(1.0 - row.visible**2 / (d @ W @ d))


@pytest.mark.parametrize("far", [0.5, 3.0])
def test_what_no_candidate_explains_is_what_least_squares_leave(far):
    """Weighted least squares with a hundredth of an SD of each column's own size as the only prior."""
    random = np.random.default_rng(4)
    base = based(random, far=far)
    found = [Signature(RATE, {}, 3.0 * random.normal(size=(3, 2, 7))) for _ in range(2)]
    left, absorbed = saturated(base, found)
    moved = np.array([base.slopes["a"], base.slopes["b"], *(one.shift for one in found)])
    X = moved.reshape(4, -1).T
    scale, root = np.linalg.norm(X, axis=0), np.sqrt(weights_of(base.rows))
    stacked = np.vstack([root[:, None] * X, 1e-2 * np.diag(scale)])
    share, *_ = np.linalg.lstsq(stacked, np.concatenate([root * base.rows, np.zeros(4)]), rcond=None)
    np.testing.assert_allclose(left.ravel(), base.rows - X @ share, atol=1e-8)
    spread = (X @ np.linalg.inv(stacked.T @ stacked) @ X.T).reshape(*left.shape, *left.shape)
    for at in np.ndindex(left.shape):
        run, channel, block = at
        before = spread[*at, run, channel, block - 1] if block else 0.0
        assert absorbed.variance[at] == pytest.approx(spread[*at, *at])
        assert absorbed.lagged[at] == pytest.approx(before, abs=1e-12)


# --- sizes that are tried --------------------------------------------------------------------------------------------

TILT = ("GravityTilt.rise_x", "GravityTilt.rise_y")


def test_sizes_are_tried_singly_but_jointly_in_a_place_search():
    tilt = Candidate("GravityTilt", GravityTilt(rise_x=0.02, rise_y=0.03), TILT)
    one_by_one = [{TILT[0]: 0.02, TILT[1]: 0.0}, {TILT[0]: 0.0, TILT[1]: 0.03}]
    assert trials(tilt) == [pytest.approx(each) for each in one_by_one]
    together = Candidate("GravityTilt", tilt.effect, TILT, place="1.0", place_searched=True)
    assert trials(together) == [pytest.approx({TILT[0]: 0.02, TILT[1]: 0.03})]


def test_limit_effect_is_tried_at_several_sizes_also_by_place():
    """Neutral at 1,000 A is far off: the size is sought by ratios of its default."""
    for sought in (False, True):
        limit = Candidate(
            "TorqueSaturation", TorqueSaturation(i_max=2.0), ("TorqueSaturation.i_max",), place_searched=sought
        )
        tried = [each["TorqueSaturation.i_max"] for each in trials(limit)]
        assert tried == pytest.approx([1.6, 2.4, 3.6, 5.4])


@pytest.mark.parametrize(("neutral", "far_off"), [(49.5, False), (51.0, True), (54.0, True)])
def test_size_is_logarithmic_if_neutral_is_fifty_times_as_large(neutral, far_off, monkeypatch):
    monkeypatch.setitem(TorqueSaturation.neutral, "i_max", neutral)
    limit = Candidate("TorqueSaturation", TorqueSaturation(i_max=1.0), ("TorqueSaturation.i_max",))
    assert limit.size("TorqueSaturation.i_max").log is far_off
    size = {"TorqueSaturation.i_max": 1.0}
    row = Scored(limit, Signature(limit, size, np.zeros(1), limit.neutral), 1.0, 0.5, 1.0, 0.0)
    assert started(row, None) == (size if far_off else {"TorqueSaturation.i_max": pytest.approx((neutral + 1) / 2)})


def test_a_size_has_no_prior_and_a_place_has_sd_of_15_cm():
    patch = Candidate("HardPatch", HardPatch(), ("HardPatch.g",), ("HardPatch.x_from",))
    size, place = patch.parameters
    assert (size.prior, place.prior) == (False, True)
    assert (place.scale, place.log) == (0.15, False)


@pytest.mark.parametrize(
    ("u", "prior", "bent"), [(3.1, True, True), (-3.1, True, True), (2.9, True, False), (9.0, False, False)]
)
def test_a_number_three_sd_from_what_is_declared_is_bent(u, prior, bent):
    others = (Parameter("a", 0.0, 1.0, -9, 9), Parameter("b", 0.0, 1.0, -9, 9, prior=prior))
    assert is_bent(SimpleNamespace(parameters=others, u=np.array([0.1, u]))) is bent


def test_neutral_effect_is_tried_at_the_default_of_its_class():
    for c_r, scale in ((0.0, 0.05), (0.2, 0.2)):
        one = Candidate("RateDependence", RateDependence(c_r=c_r), ("RateDependence.c_r",)).parameters[0]
        assert (one.origin, one.scale) == (0.0, scale)


# --- places ----------------------------------------------------------------------------------------------------------


def test_edge_moves_by_eight_centimetres_then_halves_down_to_two(monkeypatch):
    """Neighbours that gain more are taken and asked again at the same step; a step of 2 cm is not tried."""
    gains, steps = {0: 5.0, 1: 7.0, 2: 6.9, 3: 8.0}, []

    def neighbours(candidate, step):
        steps.append((candidate, step))
        return [candidate + 1, candidate + 2] if candidate < 3 else [0]

    row = lambda at: SimpleNamespace(candidate=at, gain=gains.get(at, 0.0))  # noqa: E731
    monkeypatch.setattr(refit_candidates, "signatures", lambda base, near: near)
    monkeypatch.setattr(refit_candidates, "score", lambda base, near: [row(at) for at in near])
    base = SimpleNamespace(task=SimpleNamespace(experiment=SimpleNamespace(neighbours=neighbours)))
    assert refit_candidates.placed(base, row(0)).candidate == 3
    assert steps == [(0, 0.08), (1, 0.08), (3, 0.08), (3, 0.04)]
    steps.clear()
    base.task.experiment.neighbours = lambda candidate, step: []
    assert refit_candidates.placed(base, row(1)).candidate == 1


def test_a_neighbour_that_gains_no_more_is_left_where_it_is(monkeypatch):
    monkeypatch.setattr(refit_candidates, "signatures", lambda base, near: near)
    monkeypatch.setattr(refit_candidates, "score", lambda base, near: [SimpleNamespace(candidate=9, gain=5.0)])
    base = SimpleNamespace(task=SimpleNamespace(experiment=SimpleNamespace(neighbours=lambda one, step: [9])))
    assert refit_candidates.placed(base, SimpleNamespace(candidate=1, gain=5.0)).candidate == 1


# --- chance beside the noise -----------------------------------------------------------------------------------------


def field_of(random):
    """A random field of two columns (shares of SD 1, each at its own size)."""
    return SimpleNamespace(moved=random.normal(size=(2, 3, 2, 7)), kind=np.array([0, 1]), kinds=("grip", "slope"))


def test_a_random_field_explains_as_much_as_its_sds_allow():
    """Least squares with a prior of SD 1 on each of its columns, next to none on the others."""
    random = np.random.default_rng(6)
    base, field = based(random, far=3.0), field_of(random)
    left, _ = saturated(base, [Signature(RATE, {}, random.normal(size=(3, 2, 7)))], field)
    moved = np.array([base.slopes["a"], base.slopes["b"], random_signature(6), *field.moved])
    X, root = moved.reshape(5, -1).T, np.sqrt(weights_of(base.rows))
    prior = np.diag([*(1e-2 * np.linalg.norm(X[:, :3], axis=0)), 1.0, 1.0])
    share, *_ = np.linalg.lstsq(
        np.vstack([root[:, None] * X, prior]), np.concatenate([root * base.rows, np.zeros(5)]), rcond=None
    )
    np.testing.assert_allclose(left.ravel(), base.rows - X @ share, atol=1e-8)


def random_signature(seed):
    """The signature that is drawn after the base and the field."""
    random = np.random.default_rng(seed)
    based(random, far=3.0)
    field_of(random)
    return random.normal(size=(3, 2, 7))


def test_sds_are_learnt_from_weighted_rows_beside_candidates(monkeypatch):
    random, seen = np.random.default_rng(7), []
    base, field, moved = based(random, far=6.0), field_of(random), random.normal(size=(3, 2, 7))
    monkeypatch.setattr(screen, "learnt_sds", lambda *given: seen.extend(given) or ())
    monkeypatch.setattr(screen, "random_effects_filter", lambda *given: None)
    monkeypatch.setattr(screen.dataclasses, "replace", lambda record, **values: record)
    base.task.noise.__dict__["good"] = None
    screen.with_random_effects(base, [Signature(RATE, {}, moved)], field)
    rows, free, columns, given = seen
    W = np.diag(weights_of(base.rows)) ** 0.5
    X = np.array([base.slopes["a"], base.slopes["b"], moved]).reshape(3, -1).T
    assert given is field
    np.testing.assert_allclose(rows, W @ base.rows)
    np.testing.assert_allclose(free, W @ X)
    np.testing.assert_allclose(columns, W @ field.moved.reshape(2, -1).T)


@pytest.mark.parametrize("field", [None, "field"])
def test_random_effects_are_learnt_with_the_noise_given_a_field(field, monkeypatch):
    monkeypatch.setattr(search, "saturated", lambda base, known, chance: ("left", "absorbed"))
    monkeypatch.setattr(search, "with_noise", lambda base, left, least, absorbed: "noisy")
    monkeypatch.setattr(search, "with_random_effects", lambda noisy, known, chance: (noisy, chance))
    assert search._with_residual_noise("base", [], field, "least") == ("noisy" if field is None else ("noisy", field))
