"""A fit is taken to the minimum of chi2, also from a local minimum, and states if it did not get there."""

import math
from dataclasses import dataclass

import numpy as np
import pytest

from rover_pin.base.quantity import Record, quantity
from rover_pin.estimation import minimum as module
from rover_pin.estimation.experiment import Experiment
from rover_pin.estimation.fit import Task, fit
from rover_pin.estimation.minimum import lowest_probe, to_minimum
from rover_pin.estimation.noise import declared_noise
from rover_pin.estimation.parameter import Parameter


@dataclass(frozen=True)
class Line(Record):
    """A number that acts linearly, and a size that acts by `waved`."""

    size: float = quantity(0.0, "", "made up", -50.0, 50.0, "a")
    number: float = quantity(0.0, "", "made up", -50.0, 50.0, "b")


def waved(size):
    """Slope of the line: it falls with the size from -0.64 to 0.64, and rises on either side."""
    return size - 1.2 * math.sin(math.pi * size / 2)


class Waves(Experiment):
    """A line whose slope has a local maximum at a size of -0.64; it was measured at a size of 3."""

    channels, folds, difference = ("row",), ("all",), 1e-4
    inputs = np.linspace(0.5, 1.5, 40)
    observed = (waved(3.0) * inputs + 1.0)[None, None]

    def predict(self, models):
        return np.array([[[waved(model.size) * self.inputs + model.number]] for model in models])

    def records(self, model):
        return {"line": model}

    def replace_record(self, model, owner, record):
        return record


NUMBERS = tuple(Parameter(f"line.{name}", 0.0, sd, -50.0, 50.0) for name, sd in (("size", 2.0), ("number", 5.0)))


def started():
    bed = Waves()
    task = Task(bed, declared_noise(np.array([0.3]), bed.observed))
    return fit(task, Line(), NUMBERS, np.array([-0.3, 0.6]))


def test_a_fit_at_a_local_minimum_goes_on_to_the_minimum():
    first = started()
    end = to_minimum(first, ["line.size"])
    assert first.chi2 > 50.0, "a local minimum"
    assert end.fall == 0.0
    assert end.fit.chi2 < 3.0
    assert waved(end.fit.model.size) == pytest.approx(waved(3.0), abs=0.3)
    assert end.predictions > len(module.PROBES)


def test_a_fit_that_still_falls_says_by_how_much(monkeypatch):
    monkeypatch.setattr(module, "MAX_DESCENTS", 0)
    end = to_minimum(started(), ["line.size"])
    point, fall, tested = lowest_probe(end.fit, ["line.size"])
    assert end.fall == pytest.approx(fall)
    assert fall > module.MIN_LOWER
    assert tested == len(module.PROBES) + 1
    moved = fit(end.fit.task, end.fit.model, NUMBERS, point, end.fit.slopes)
    assert moved.chi2 <= end.fit.chi2 - fall + 1e-9


def test_without_a_tested_parameter_the_derivatives_decide():
    end = to_minimum(started(), [])
    assert lowest_probe(end.fit, [])[1:] == (0.0, 0)
    remaining = end.fit.remaining_fall
    assert end.fall == (remaining if remaining > module.MIN_LOWER else 0.0)
