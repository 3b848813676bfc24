"""How far a fit descends: in a bent valley the usual turns do not reach the end, those of a leader do."""

from dataclasses import dataclass

import numpy as np
import pytest

from rover_pin.base.quantity import Record, quantity
from rover_pin.estimation.experiment import Experiment
from rover_pin.estimation.fit import Task, fit
from rover_pin.estimation.least_squares import LIMITS_TO_THE_END, MAX_RENEWALS, MAX_STEPS
from rover_pin.estimation.noise import declared_noise
from rover_pin.estimation.parameter import Parameter

WALL = 1.0


@dataclass(frozen=True)
class Valley(Record):
    """Rosenbrock's rows: WALL (b - a^2) and a."""

    a: float = quantity(-3.0, "", "made up", -20.0, 20.0, "a")
    b: float = quantity(9.0, "", "made up", -400.0, 400.0, "b")


class Rosenbrock(Experiment):
    """One fold of one channel with two samples: 0 and 3 were measured."""

    channels, folds, difference = ("row",), ("all",), 1e-5
    observed = np.array([[[0.0, 3.0]]])

    def predict(self, models):
        return np.array([[[[WALL * (model.b - model.a**2), model.a]]] for model in models])

    def records(self, model):
        return {"valley": model}

    def replace_record(self, model, owner, record):
        return record


def task():
    bed = Rosenbrock()
    return Task(bed, declared_noise(np.array([0.3]), bed.observed))


NUMBERS = tuple(Parameter(f"valley.{name}", 0.0, 1.0, -400.0, 400.0, prior=False) for name in "ab")
START = np.array([-3.0, 9.0])


def test_a_leader_is_fitted_to_the_end_of_a_bent_valley():
    end = fit(task(), Valley(), NUMBERS, START, fit(task(), Valley(), NUMBERS, START).slopes, stale=True)
    assert [end.model.a, end.model.b] == pytest.approx([3.0, 9.0], abs=1e-3)
    assert end.chi2 < 1.0


def test_the_usual_turns_do_not_get_there():
    short = fit(task(), Valley(), NUMBERS, START)
    assert LIMITS_TO_THE_END[0] > MAX_STEPS
    assert short.chi2 > 10.0


class Watched(Rosenbrock):
    """The same valley, that remembers how many models it was asked for, call by call."""

    def __init__(self):
        self.calls = []

    def predict(self, models):
        self.calls.append(len(models))
        return super().predict(models)


def spent(start, **options):
    """Single predictions, and sets of slopes, of a fit."""
    bed = Watched()
    fit(Task(bed, declared_noise(np.array([0.3]), bed.observed)), Valley(*start), NUMBERS, np.array(start), **options)
    return bed.calls.count(1), len(bed.calls) - bed.calls.count(1)


def test_slopes_serve_until_they_are_off():
    """At a = 3 the slope of b - a^2 along a is -6; of b it is 1: with these no other are computed."""
    right = {"valley.a": np.array([[[-6.0, 1.0]]]), "valley.b": np.array([[[1.0, 0.0]]])}
    assert spent((3.2, 9.5), slopes=right) == (2, 0)
    assert spent((3.2, 9.5), slopes=right, stale=True)[1] == 1, "new ones end it"
    wrong = {"valley.a": np.array([[[6.0, 1.0]]]), "valley.b": np.array([[[1.0, 0.0]]])}
    assert spent((3.2, 9.5), slopes=wrong, reuse=True)[1] == 0, "given ones stay"
    assert 1 <= spent((-1.0, 9.0), slopes=wrong)[1] <= MAX_RENEWALS
