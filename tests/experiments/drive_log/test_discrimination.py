"""How far apart two models are on a run that was not driven yet: against whole matrices, on hand-made drives."""

from types import SimpleNamespace

import numpy as np
import pytest

from rover_pin.base.errors import SimulationError
from rover_pin.estimation.noise import Noise
from rover_pin.experiments.drive_log import discrimination as contrasts
from rover_pin.experiments.drive_log.candidate_runs import CandidateRun
from rover_pin.experiments.drive_log.discrimination import (
    Instruments,
    PredictedDifference,
    _root,
    predict_difference,
    with_currents,
)
from rover_pin.experiments.drive_log.experiment import DriveExperiment
from rover_pin.experiments.drive_log.parameters import parameter
from rover_pin.simulation.replay import PERIOD, Replay
from tests.experiments.drive_log import linear_drive as linear

MODEL = linear.MODEL

# --- what two models differ by, in SDs -------------------------------------------------------------------------------

SHAPE = (1, 2, 16)
LATE = np.arange(16) >= 5
SD, RHO, MIXING = np.array([0.5, 2.0]), np.array([0.3, 0.0]), np.array([[1.0, 0.0], [-0.4, 1.2]])
INSTRUMENTS = Instruments(linear.CHANNELS, SD, RHO, MIXING)


def fit_of(model, numbers, random):
    root = random.normal(size=(len(numbers), len(numbers)))
    return SimpleNamespace(
        parameters=numbers, u=random.normal(size=len(numbers)), covariance=0.1 * root @ root.T, model=model,
        task=SimpleNamespace(noise=linear.white(SHAPE), experiment=SimpleNamespace(jobs=1)),
    )  # fmt: skip


@pytest.fixture
def apart():
    random = np.random.default_rng(5)
    phi, g = linear.nuisances()
    gear = parameter(MODEL, "motor.gear", 2.0)
    numbers = (phi, g), (gear, phi)
    columns = linear.slopes(random, (phi, g, gear), SHAPE, 3.0)
    experiment = linear.LinearExperiment(np.zeros(SHAPE), columns)
    fits = tuple(fit_of(MODEL, each, random) for each in numbers)
    difference = 4.0 * random.normal(size=SHAPE)
    return PredictedDifference(None, fits, (MODEL, MODEL), experiment, difference, (np.ones(16, dtype=bool), LATE))


def columns_of(one, numbers):
    return np.array([each.scale * one.experiment.slopes[each.name][1] for each in numbers])


def test_a_fit_s_doubt_shifts_the_features_by_its_covariance(apart):
    """One SD along each axis: their squares add to J^T C J. What both have is worked out once."""
    for at, fit in enumerate(apart.fits):
        shifts = apart.uncertainties[2 * at : 2 * at + 2].reshape(2, -1)
        J = columns_of(apart, fit.parameters).reshape(2, -1)
        np.testing.assert_allclose(shifts.T @ shifts, J.T @ fit.covariance @ J, atol=1e-9 * np.abs(J).max() ** 2)
    assert apart.experiment.asked == [3, 2]
    assert apart.uncertainties.shape == (4, *SHAPE)


def test_a_second_model_with_the_same_numbers_is_not_asked(apart):
    same = PredictedDifference(
        None, (apart.fits[0],) * 2, apart.models, apart.experiment, apart.difference, apart.moving
    )
    np.testing.assert_array_equal(same.uncertainties[:2], same.uncertainties[2:])
    assert apart.experiment.asked == [3]


@pytest.mark.parametrize("values", [(4.0, 1.0, 0.25), (1e-4, 0.0, 0.0)])
def test_the_root_of_a_covariance_gives_it_back(values):
    axes = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    covariance = axes @ np.diag(values) @ axes.T
    np.testing.assert_allclose(_root(covariance) @ _root(covariance).T, covariance, atol=1e-12)
    assert np.isfinite(_root(np.diag([1.0, -1e-18]))).all(), "0, but for round-off"


def judged_by(one, usable):
    """d, A and whose rows they are, whitened by hand: AR(1) first, then the mixing of channels."""
    steps = lambda row: np.where(np.r_[False, usable[:-1]], row - RHO[:, None] * np.roll(row, 1, -1),  # noqa: E731
                                 np.sqrt(1 - RHO[:, None] ** 2) * row)  # fmt: skip
    white = lambda part: (MIXING @ (steps(part) / (SD * np.sqrt(1 - RHO**2))[:, None]))[:, usable].ravel()  # noqa: E731
    return white(one.difference[0]), np.array([white(each[0]) for each in one.uncertainties]).T


def test_separation_is_the_mean_expected_chi2_if_either_is_true(apart):
    plain, found, parts = 0.0, 0.0, np.zeros(2)
    for usable in apart.moving:
        d, A = judged_by(apart, usable)
        weighed = np.linalg.solve(np.eye(len(d)) + A @ A.T, d)
        plain, found = plain + 0.5 * d @ d, found + 0.5 * d @ weighed
        parts += 0.5 * (d * weighed).reshape(2, -1).sum(axis=1)
    chi2, channel = apart.expected_chi2(INSTRUMENTS)
    assert chi2 == pytest.approx(found)
    assert channel == linear.CHANNELS[int(parts.argmax())]
    assert apart.plain(INSTRUMENTS) == pytest.approx(plain)
    assert found < 0.9 * plain


@pytest.mark.parametrize("channel", linear.CHANNELS)
def test_instruments_may_be_a_subset_and_the_decisive_is_named(apart, channel):
    """A channel alone whose difference is 3 SD in one block that moves if either is true, and in one of the other's."""
    at = linear.CHANNELS.index(channel)
    blank = np.zeros(SHAPE)
    blank[0, at, [2, 9]] = 3.0 * SD[at]
    one = PredictedDifference(None, apart.fits, apart.models, apart.experiment, blank, apart.moving)
    alone = Instruments((channel,), SD[[at]], np.zeros(1), np.eye(1))
    assert one.plain(alone) == pytest.approx(9.0 + 0.5 * 9.0)
    assert one.expected_chi2(alone)[1] == channel
    uncorrelated = Instruments(linear.CHANNELS, SD, np.zeros(2), np.eye(2))
    assert one.expected_chi2(uncorrelated)[1] == channel


def test_an_instrument_s_noise_is_that_of_the_blocks_that_move():
    noise = INSTRUMENTS.noise(LATE)
    assert isinstance(noise, Noise)
    assert noise.good.shape == SHAPE
    assert noise.count == 2 * 11


# --- currents that were not logged -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("rates", "worse"), [((0.03, 0.05, 0.02), 3.0), ((0.004, 0.002), 1.0), ((), 1.0)])
def test_unlogged_current_has_noise_scaled_as_the_wheel_rates(rates, worse):
    """A sample of a rate has 0.01 rad/s and of a current 2 mA; `worse` is the median rate's ratio, 1 at least."""
    names = ("path", *(f"wheel_rate_{at}" for at in range(len(rates))), "current_b_A")
    sd, rho = np.array([7.0, *rates, 0.5]), np.linspace(0.1, 0.3, len(names))
    mixing = np.random.default_rng(1).normal(size=(len(names),) * 2)
    found = with_currents(Instruments(names, sd, rho, mixing), ("a", "b", "c"))
    assert found.names == (*names, "current_a_A", "current_c_A")
    np.testing.assert_allclose(found.sd, [*sd, 0.002 * worse, 0.002 * worse])
    np.testing.assert_array_equal(found.rho, [*rho, 0.0, 0.0])
    count = len(names)
    np.testing.assert_array_equal(found.mixing[:count, :count], mixing)
    np.testing.assert_array_equal(found.mixing[count:, count:], np.eye(2))
    assert not found.mixing[count:, :count].any()
    assert not found.mixing[:count, count:].any()


# --- a run of the menu as both drive it ------------------------------------------------------------------------------

T = PERIOD * np.arange(200)
WHEELS = tuple(wheel.name for wheel in MODEL.rover.wheels)


def drive(speed, stands=99.0, stop=""):
    """A replay at this speed towards +x whose wheels stand from then on."""
    x = speed * np.minimum(T, stands)
    rate = np.where(stands > T, speed / 0.045, 0.0)
    rates = {f"wheel_rate_{wheel}": rate for wheel in WHEELS}
    return Replay({"body_x": x, "body_y": 0.0 * T, "body_yaw": 0.0 * T, **rates}, stop)


@pytest.fixture
def drawn(monkeypatch):
    """Return what contrast makes of two drives, and with what commands each was asked for."""

    def made(first, second, rest=None):
        asked, drives = [], iter((first, second))

        def replay(model, commands, rest_state=None):
            asked.append((commands, rest_state))
            found = next(drives)
            if isinstance(found, Exception):
                raise found
            return found

        monkeypatch.setattr(contrasts, "replay", replay)
        monkeypatch.setattr(contrasts, "shared_rest", lambda model, start: "at rest")
        random = np.random.default_rng(3)
        fits = tuple(fit_of(MODEL, linear.nuisances(), random) for _ in range(2))
        run = CandidateRun("on the flat", np.full((len(T), len(WHEELS)), 0.5))
        return predict_difference(run, fits, ("path", "wheel_rate_fl")), asked

    return made


def test_the_second_model_is_held_to_the_way_of_the_first(drawn):
    """Their difference is that of the features: of the rates as they are, of the way after its 2 s of memory."""
    one, ((free, rest), (held, again)) = drawn(drive(0.06), drive(0.05))
    assert rest == again == "at rest"
    assert np.isnan(free.place).all()
    np.testing.assert_allclose(held.place, np.column_stack([0.06 * T, 0.0 * T, 0.0 * T]))
    way, rate = one.difference[0]
    assert rate == pytest.approx(np.full(20, 0.01 / 0.045))
    share = np.exp(-PERIOD / 2.0)
    assert way[-1] == pytest.approx(0.01 * PERIOD / (1 - share), rel=0.03), "a leaky sum at its end"
    assert isinstance(one.experiment, DriveExperiment)
    assert one.experiment.folds == ("on the flat",)
    assert one.experiment.channels == ("path", "wheel_rate_fl")


def test_blocks_are_compared_where_the_one_that_is_true_moves(drawn):
    """After the first second, and until the wheels stand; the way is summed where either moves."""
    one, _ = drawn(drive(0.06), drive(0.05, stands=6.0))
    assert np.flatnonzero(~one.moving[0]).tolist() == [0, 1]
    assert np.flatnonzero(~one.moving[1]).tolist() == [0, 1, *range(12, 20)]
    assert one.difference[0, 0, -1] > 0.06 * 1.5, "the first drives on"


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (drive(0.06, stop="buried"), drive(0.05)),
        (drive(0.06), drive(0.05, stop="capsized")),
        (SimulationError("the rover tips."), drive(0.05)),
        (drive(0.06), SimulationError("the rover tips.")),
    ],
)
def test_a_run_that_either_cannot_drive_separates_nothing(drawn, first, second):
    assert drawn(first, second)[0] is None
