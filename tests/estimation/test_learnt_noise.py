"""Noise that nobody declares: what neither numbers, nor candidates, nor random effects explain, by dense algebra."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from rover_pin.estimation.parameter import Parameter
from rover_pin.estimation.random_effects.learnt_noise import residuals, with_learnt_noise
from tests.inference import linear_search as toys

RHO, SD, COMMON = np.array([0.6, 0.0, 0.3]), np.array([0.2, 1.0, 3.0]), 0.7


def autoregressive(seed, shape=(6, 3, 300)):
    """Blocks of AR(1) noise, the innovations of the first two channels correlated by COMMON."""
    draw = np.random.default_rng(seed)
    steps = draw.normal(size=shape)
    steps[:, 1] = COMMON * steps[:, 0] + np.sqrt(1 - COMMON**2) * steps[:, 1]
    noise = steps.copy()
    for at in range(1, shape[2]):
        noise[..., at] = RHO[:, None].T * noise[..., at - 1] + np.sqrt(1 - RHO**2) * steps[..., at]
    return SD[:, None] * noise


def learnt(visible, columns, shifts=()):
    base = toys.fitted(toys.Sums(visible, columns, None))
    return with_learnt_noise(base, shifts).task.noise


@pytest.mark.parametrize("hidden", [0.0, 2.0])
def test_noise_of_a_log_is_learnt_as_it_is(hidden):
    """Also beside a hidden effect whose signature is known."""
    draw = np.random.default_rng(1)
    series = autoregressive(0)
    columns = {name: SD[:, None] * draw.normal(size=series.shape) for name in ("base", "q")}
    noise = learnt(0.5 * columns["base"] + hidden * columns["q"] + series, columns, [columns["q"]])
    assert noise.sd == pytest.approx(SD, rel=0.06)
    assert noise.rho == pytest.approx(RHO, abs=0.06)
    lower = np.linalg.inv(noise.mixing)
    covariance = lower @ lower.T
    size = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(size, size)
    assert correlation[0, 1] == pytest.approx(0.8 * COMMON, abs=0.05), "drawn to 0 by a fifth"
    assert np.abs(correlation[2, :2]).max() < 0.05
    rows = noise.white(series)
    assert rows.std() == pytest.approx(1.0, abs=0.05)


def test_what_candidates_span_is_no_noise_else_it_is():
    draw = np.random.default_rng(1)
    series = autoregressive(0)
    columns = {name: SD[:, None] * draw.normal(size=series.shape) for name in ("base", "q")}
    drawn_values = 2.0 * columns["q"] + series
    with_it, without = (learnt(drawn_values, columns, shifts) for shifts in ([columns["q"]], []))
    assert without.sd == pytest.approx(np.sqrt(5.0) * SD, rel=0.1)
    assert with_it.sd == pytest.approx(SD, rel=0.06)


def test_many_candidates_take_no_share_of_the_noise():
    """200 signatures of nothing on 720 rows explain a quarter of the squares, and none of the noise."""
    draw = np.random.default_rng(3)
    white = draw.normal(size=(3, 2, 120))
    shifts = list(draw.normal(size=(200, *white.shape)))
    noise = learnt(white, {"base": draw.normal(size=white.shape)}, shifts)
    assert noise.sd == pytest.approx([1.0, 1.0], rel=0.1)
    assert noise.rho == pytest.approx([0.0, 0.0], abs=0.1)


# --- by dense algebra ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class White:
    """Noise of SD 1 without memory, and no chance beside it."""

    random_effects: None = None
    good: None = None

    def white(self, values):
        return np.reshape(values, (*np.shape(values)[:-3], -1))


def based(random, distance=0.5, shape=(3, 2, 7)):
    """A fit away from its optimum: rows are measured minus predicted; the noise is white."""
    slopes = {name: random.normal(size=shape) for name in ("a", "b")}
    residual = distance * random.normal(size=shape)
    parameters = (Parameter("a", 0.0, 1.0, -9, 9), Parameter("b", 0.0, 1.0, -9, 9, prior=False))
    task = SimpleNamespace(noise=White())
    return SimpleNamespace(rows=residual.ravel(), residual=residual, slopes=slopes, parameters=parameters, task=task)


def weights_of(rows):
    """Rows beyond 4 SDs count by 4 over their size."""
    return np.minimum(1.0, 4.0 / np.abs(rows))


@pytest.mark.parametrize("distance", [0.5, 3.0])
@pytest.mark.parametrize("rng", [False, True])
def test_what_nothing_explains_is_what_least_squares_leave(distance, rng):
    """Next to no prior on numbers and shifts; a random field's columns have SD 1, each in its own size."""
    random = np.random.default_rng(4)
    base, shifts = based(random, distance), list(3.0 * random.normal(size=(2, 3, 2, 7)))
    field = SimpleNamespace(moved=random.normal(size=(2, 3, 2, 7)), kind=np.array([0, 1]), kinds=("grip", "slope"))
    left, absorbed = residuals(base, shifts, field if rng else None)
    free_columns = np.array([base.slopes["a"], base.slopes["b"], *shifts, *(field.moved if rng else ())])
    X = free_columns.reshape(len(free_columns), -1).T
    root = np.sqrt(weights_of(base.rows))
    prior = np.diag(np.where(np.arange(len(free_columns)) < 4, 1e-2 * np.linalg.norm(X, axis=0), 1.0))
    stacked = np.vstack([root[:, None] * X, prior])
    share, *_ = np.linalg.lstsq(stacked, np.concatenate([root * base.rows, np.zeros(len(free_columns))]), rcond=None)
    np.testing.assert_allclose(left.ravel(), base.rows - X @ share, atol=1e-8)
    spread = (X @ np.linalg.inv(stacked.T @ stacked) @ X.T).reshape(*left.shape, *left.shape)
    for at in np.ndindex(left.shape):
        run, channel, block = at
        before = spread[*at, run, channel, block - 1] if block else 0.0
        assert absorbed.variance[at] == pytest.approx(spread[*at, *at])
        assert absorbed.lagged[at] == pytest.approx(before, abs=1e-12)
