"""What is learnt beyond the declared noise, on linear stand-ins of fits, against full matrices."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import null_space
from scipy.optimize import minimize_scalar
from scipy.stats import chi2

from rover_pin.estimation.noise import declared_noise, spread
from rover_pin.estimation.random_effects.beyond_declared import beyond_declared
from rover_pin.estimation.random_effects.drift import learnt_drift
from rover_pin.estimation.random_effects.random_field import Kind, RandomField

FOLDS, CHANNELS, SAMPLES = 9, 2, 6
SHAPE = (FOLDS, CHANNELS, SAMPLES)
COUNT = FOLDS * SAMPLES
TURN = np.random.default_rng(1).permutation(COUNT).reshape(FOLDS, SAMPLES)
SD = np.random.default_rng(2).uniform(0.5, 2.0, SHAPE)
SIZE = 0.05
STRAY = 4.0
"""Times its SD beyond which a residual counts linearly, as a fit counts it."""


def field_of(random, *kinds):
    """Columns that move one fold each, of every kind."""
    moved = np.zeros((len(kinds) * FOLDS, *SHAPE))
    for at in range(len(moved)):
        moved[at, at % FOLDS] = SD[at % FOLDS] * random.normal(size=SHAPE[1:])
    return RandomField(kinds, np.repeat(np.arange(len(kinds)), FOLDS), np.tile(np.arange(FOLDS), len(kinds)), moved)


def fit_of(residual, slopes, turn=None, field=None):
    experiment = SimpleNamespace(turns=lambda: turn, random_field=lambda model: field)
    task = SimpleNamespace(experiment=experiment, noise=declared_noise(SD, residual))
    named = {f"number {at}": one for at, one in enumerate(slopes)}
    numbers = [SimpleNamespace(name=name) for name in named]
    return SimpleNamespace(task=task, model=None, residual=residual, slopes=named, parameters=numbers)


def oracle(residual, free, moved):
    """The SD of greatest density of contrasts that no free column moves, in sizes, and its gain in -2 ln."""
    rows, free, moved = ((one / SD).reshape(-1, residual.size) for one in (residual, free, moved))
    root = np.sqrt(np.minimum(1.0, STRAY / np.maximum(np.abs(rows), 1e-12)))
    rows, free, moved = (root * rows)[0], (root * free).T, (root * moved).T
    left = null_space(np.hstack([free, moved]).T / np.linalg.norm(np.hstack([free, moved]), axis=0)[:, None])
    within = max(1.0, np.sqrt(np.mean((left.T @ rows) ** 2)))
    contrasts = null_space(free.T / np.linalg.norm(free, axis=0)[:, None])
    y, B = contrasts.T @ rows / within, contrasts.T @ moved / within

    def loss(sizes):
        V = np.eye(len(y)) + sizes**2 * B @ B.T
        return np.linalg.slogdet(V)[1] + y @ np.linalg.solve(V, y)

    best = minimize_scalar(loss, bounds=(0.0, 10.0), method="bounded", options={"xatol": 1e-8}).x
    return best, loss(0.0) - loss(best)


@pytest.mark.parametrize(("scatter", "spread_by"), [(0.5, 1.0), (1.6, 2.0)])
def test_stiffness_sd_maximises_the_restricted_likelihood(scatter, spread_by):
    """Beside numbers and candidates of any unit, values that stray, and noise that was declared too large or small."""
    random = np.random.default_rng(3)
    slopes, known = random.normal(size=(2, *SHAPE)), random.normal(size=(1, *SHAPE))
    slopes[1] *= 1e-5
    field = field_of(random, Kind("beds", SIZE, "", 0.2))
    residual = scatter * SD * random.normal(size=SHAPE) + 7.0 * slopes[0] + 2e6 * slopes[1] - 0.3 * known[0]
    residual += np.tensordot(spread_by * random.normal(size=FOLDS), field.moved, 1)
    residual[2, 1, 3] += 9.0 * SD[2, 1, 3]
    found = beyond_declared(fit_of(residual, slopes, field=field), lambda: list(known))
    (learnt,) = found.random_effects.learnt
    sizes, gain = oracle(residual, np.concatenate([slopes, known]), field.moved)
    assert learnt.sd == pytest.approx(sizes * SIZE, rel=1e-3)
    assert learnt.gain == pytest.approx(gain, rel=1e-4)


def test_least_reported_gain_is_exceeded_by_one_null_in_twenty():
    """Half of them gain nothing, so chi2 of one number at 10 %; met by bisection between alike beds and others."""
    random = np.random.default_rng(8)
    field, white = field_of(random, Kind("beds", SIZE, "", 1.0)), SD * random.normal(size=SHAPE)
    differing = np.tensordot(random.normal(size=FOLDS), field.moved, 1)
    low, high, least = 0.0, 1.0, beyond_declared(fit_of(white + differing, [], field=field), lambda: [np.ones(SHAPE)])
    for _ in range(40):
        share = (low + high) / 2
        found = beyond_declared(fit_of(white + share * differing, [], field=field), lambda: [np.ones(SHAPE)])
        low, high, least = (share, high, least) if found is None else (low, share, found)
    assert least.random_effects.learnt[0].gain == pytest.approx(chi2.isf(0.1, 1), abs=0.01)


@pytest.mark.parametrize("scatter", [1.0, 1.6])
def test_folds_beyond_1_5_times_the_inner_scatter_lack_a_law(scatter):
    """Met by bisection on the size of a law that a candidate has and the model lacks, against full matrices."""
    random = np.random.default_rng(12)
    field, known = field_of(random, Kind("beds", SIZE, "", 1.0)), SD * random.normal(size=SHAPE)
    white = np.clip(random.normal(size=SHAPE), -1.9, 1.9)  # none strays, so that all count alike
    beds = scatter * (SD * white + 0.8 * np.tensordot(random.normal(size=FOLDS), field.moved, 1))

    def learnt(law):
        return beyond_declared(fit_of(beds + law * known, [], field=field), lambda: [known])

    low, high = 0.0, 3.0
    assert learnt(low) is not None
    assert learnt(high) is None
    for _ in range(40):
        law = (low + high) / 2
        low, high = (low, law) if learnt(law) is None else (law, high)
    rows, B = ((beds + low * known) / SD).ravel(), (field.moved / SD).reshape(-1, COUNT * CHANNELS).T
    free = null_space(np.column_stack([B, (known / SD).ravel()]).T)
    within2 = max(1.0, float(np.mean((free.T @ rows) ** 2)))
    V = np.eye(len(rows)) + (learnt(low).random_effects.learnt[0].sd / SIZE) ** 2 * B @ B.T
    assert rows @ np.linalg.solve(V, rows) / len(rows) / within2 == pytest.approx(1.5, abs=0.01)


def test_empty_fold_prevents_learning_but_a_missing_cell_not():
    random = np.random.default_rng(9)
    field = field_of(random, Kind("beds", SIZE, "", 1.0))
    residual = SD * random.normal(size=SHAPE) + np.tensordot(2.0 * random.normal(size=FOLDS), field.moved, 1)
    residual[3, 1, 2] = np.nan
    assert beyond_declared(fit_of(residual, [], field=field), lambda: [np.ones(SHAPE)]) is not None
    residual[3] = np.nan
    assert beyond_declared(fit_of(residual, [], field=field), lambda: [np.ones(SHAPE)]) is None


def two_kinds(first, second, most):
    """What is learnt where folds differ by so many sizes in each of two ways."""
    random = np.random.default_rng(4)
    field = field_of(random, Kind("one", SIZE, "", most), Kind("other", SIZE, "", most))
    drawn = np.repeat([first, second], FOLDS) * random.normal(size=2 * FOLDS)
    residual = SD * random.normal(size=SHAPE) + np.tensordot(drawn, field.moved, 1)
    return beyond_declared(fit_of(residual, random.normal(size=(1, *SHAPE)), field=field), list)


def test_one_way_of_two_in_which_folds_differ_is_enough():
    one, other = two_kinds(1.5, 0.0, 1.0).random_effects.learnt
    assert (one.gain > 10.0, other.gain < 2.71) == (True, True)


def test_too_large_sd_of_one_of_two_kinds_means_a_missing_law():
    assert two_kinds(5.0, 1.0, 1.0) is not None
    assert two_kinds(5.0, 1.0, 0.15) is None


def drifting(random, rho=0.8, size=1.0):
    """Residuals in their SDs that hang together in the order of the turns."""
    time = np.arange(COUNT)
    root = np.linalg.cholesky(rho ** np.abs(time[:, None] - time))
    return size * np.stack([(root @ random.normal(size=COUNT))[TURN] for _ in range(CHANNELS)], axis=1)


@pytest.mark.parametrize(("beds", "size"), [(False, 0.5), (True, 0.5), (False, 1.2)])
def test_drift_is_learnt_from_clipped_residuals(beds, size):
    """A channel that is quieter than declared is held at three declared SDs."""
    random = np.random.default_rng(5)
    slopes, known = random.normal(size=(2, *SHAPE)), random.normal(size=(1, *SHAPE))
    field = field_of(random, Kind("beds", SIZE, "", 0.1)) if beds else None
    scaled = drifting(random, 0.9, size)
    scaled[4, 0, 2], scaled[6, 1, 1] = 6.4 * size, -6.8 * size
    most = 3.0 * np.maximum(1.0, [spread(scaled[:, row]) for row in range(CHANNELS)])[:, None]
    found = beyond_declared(fit_of(scaled * SD, slopes, TURN, field), lambda: list(known))
    free = np.concatenate([slopes, known, *([field.moved] if beds else [])]) / SD
    wanted = learnt_drift(np.clip(scaled, -most, most), free, np.ones(SHAPE, dtype=bool), TURN)
    assert found.random_effects is None
    assert found.drift.gain == pytest.approx(wanted.gain, rel=1e-12)
    np.testing.assert_array_equal(found.drift.rho, wanted.rho)


@pytest.mark.parametrize(("wide", "told"), [(1.95, True), (2.1, False)])
def test_channel_wider_than_twice_its_sd_lacks_a_law_not_drift(wide, told):
    scaled = drifting(np.random.default_rng(6))
    scaled[:, 1] *= wide / spread(scaled[:, 1])
    found = beyond_declared(fit_of(scaled * SD, [], TURN), lambda: [np.ones(SHAPE)])
    assert (found is not None) is told


def test_white_noise_or_no_random_effect_teaches_nothing():
    random = np.random.default_rng(7)
    residual, slopes = SD * random.normal(size=SHAPE), random.normal(size=(1, *SHAPE))
    assert beyond_declared(fit_of(residual, slopes, TURN), list) is None
    assert beyond_declared(fit_of(residual, slopes), lambda: pytest.fail("candidates were worked out")) is None
