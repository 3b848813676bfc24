"""Folds left out: fits to the others, what is compared, and what has no prediction."""

from types import SimpleNamespace

import numpy as np

from rover_pin.base.errors import OptimisationError
from rover_pin.discrepancy import cross_validation
from rover_pin.discrepancy.cross_validation import FAR, fall_of, held_out_residual
from rover_pin.estimation.parameter import Parameter

RUNS = 3


def test_fold_fits_start_at_the_whole_fit_a_lost_run_costs_most(monkeypatch):
    """A number without a prior is held at what it is: there u = 0."""
    seen = []

    def fit(task, model, held, start, slopes, reuse):
        assert reuse, "the whole fit's slopes are those of the start"
        assert {name: list(one) for name, one in slopes.items()} == {"a": [1.0], "b": [FAR]}
        seen.append((task.noise.good.copy(), [one.origin for one in held], list(start)))
        if len(seen) == 2:
            raise OptimisationError("it does not end")
        return SimpleNamespace(missed=np.full((RUNS, 2, 1), float(len(seen))))

    parameters = (Parameter("a", 2.0, 0.5, -9, 9), Parameter("b", 1.0, 0.25, -9, 9, prior=False))
    noise = SimpleNamespace(good=np.ones((RUNS, 2, 1), dtype=bool), floor=np.array([0.1, 0.3]))
    noise.good[0, 1, 0] = False
    fitted = SimpleNamespace(
        residual=np.full((RUNS, 2, 1), 9.0), missed=None, predicted=np.zeros((RUNS, 2, 1)), parameters=parameters,
        u=np.array([0.4, -1.0]), slopes={"a": np.ones(1), "b": np.ones(1)}, model=None,
        task=SimpleNamespace(experiment=None, noise=noise),
    )  # fmt: skip
    monkeypatch.setattr(cross_validation, "fit", fit)
    monkeypatch.setattr(cross_validation, "Task", lambda experiment, noise: SimpleNamespace(noise=noise))
    monkeypatch.setattr(cross_validation.dataclasses, "replace", replaced)
    left = held_out_residual(fitted)
    np.testing.assert_equal(left[:, :, 0], [[1.0, 1.0], [np.nan, np.nan], [3.0, 3.0]])
    for run, (good, origins, start) in enumerate(seen):
        assert list(good.any(axis=(1, 2))) == [run != each for each in range(RUNS)], "also what is compared in part"
        assert origins == [2.0, 0.75]
        assert start == [0.4, 0.0]


def replaced(record, **values):
    """As `dataclasses.replace`, for records and for stand-ins."""
    return type(record)(**(vars(record) | values))


def test_whole_model_replaces_a_fold_fit_that_fails(monkeypatch):
    whole, other = SimpleNamespace(model="whole"), SimpleNamespace(model="other")
    monkeypatch.setattr(cross_validation, "_fold_fits", lambda fitted: iter([other, None]))
    assert cross_validation.fold_models(whole) == ["other", "whole"]


def test_folds_that_only_one_model_predicts_are_not_compared():
    """What the second loses keeps both from being compared; what only the first loses counts for neither."""
    without, found, lost = np.array([9.0, 7.0, 5.0]), np.array([3.0, 6.0, 1.0]), np.array([np.nan, 0.0, 0.0])
    assert fall_of(without, found) == 11.0
    assert fall_of(without + lost, found) == fall_of(without + lost, found + lost) == 5.0
    assert np.isnan(fall_of(without, found + lost))
