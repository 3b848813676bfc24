"""Fitted numbers: what narrows a prior is determined by the data, and no interval ends on its estimate."""

import math
from types import SimpleNamespace

import pytest

from rover_pin.discrepancy.conclude import _number
from rover_pin.estimation.numbers import MIN_NARROWING, Number
from rover_pin.estimation.parameter import Parameter
from rover_pin.estimation.profile import NORMAL_95


def number(u, mean, sd, parameter=None):
    """A fitted number: its value in this hypothesis, and the average over hypotheses that contain its causes."""
    parameter = parameter or Parameter("soil.k", 5.0, 2.0, -100.0, 100.0)
    fitted = SimpleNamespace(parameters=(parameter,), u=[u], model=None)
    experiment = SimpleNamespace(quantity=lambda model, name: SimpleNamespace(unit="mm"))
    hypothesis = SimpleNamespace(fit=fitted, causes=(), experiment=experiment)
    return _number(SimpleNamespace(moments=lambda of, name: (mean, sd)), hypothesis, 0)


@pytest.mark.parametrize(("sd", "determined"), [(0.1, True), (0.49, True), (0.51, False), (1.0, False)])
def test_a_prior_that_is_hardly_narrowed_is_not_determined_by_the_data(sd, determined):
    found = number(0.3, 0.3, sd)
    assert found.narrowed == pytest.approx(1.0 / sd)
    assert found.is_determined is determined
    assert bool(found.note) is not determined
    assert found.as_dict()["narrowed"] == found.narrowed
    assert found.as_dict()["is_determined"] is determined


def test_bounds_count_for_the_prior_as_for_the_interval():
    """A number between 0 and 1 with a wide prior: the interval is half of what is allowed."""
    found = number(0.5, 0.5, 0.25 / NORMAL_95, Parameter("a.share", 0.0, 1.0, 0.0, 1.0))
    assert found.narrowed == pytest.approx(2.0)
    assert found.closed


def test_a_number_without_a_prior_is_judged_by_its_ends_only():
    free = Parameter("a.b", 0.0, 1.0, -9.0, 9.0, prior=False)
    assert math.isinf(number(0.0, 0.0, 2.0, free).narrowed)
    assert number(0.0, 0.0, 2.0, free).is_determined
    assert not number(0.0, 0.0, 9.0, free).is_determined


def test_no_interval_ends_on_its_estimate():
    """The average over the hypotheses lies 3 SD from the value of this hypothesis."""
    found = number(0.0, 0.3, 0.1)
    assert found.low < found.value < found.high
    reach = 2.0 * NORMAL_95 * math.hypot(0.1, 0.3)
    assert [found.low, found.high] == pytest.approx([5.0 - reach, 5.0 + reach])
    inside = number(0.0, 0.1, 0.1)
    assert [inside.low, inside.high] == pytest.approx(
        [5.0 + 2 * (0.1 - 0.1 * NORMAL_95), 5.0 + 2 * (0.1 + 0.1 * NORMAL_95)]
    )


def test_a_default_number_is_determined():
    assert Number("a.b", "N", 2.0, 1.0, 3.0, 0.0).is_determined
    assert MIN_NARROWING == 2.0
