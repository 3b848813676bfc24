"""The pieces of a fit against linear algebra written plainly: coordinates, shares of a column, trust-region steps."""

import math

import numpy as np
import pytest

from rover_pin.estimation.descent import Point, _damped_step, _step, _step_to_bound
from rover_pin.estimation.parameter import Parameter

# --- coordinates -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("log", [True, False])
@pytest.mark.parametrize("scale", [0.4, -0.3])
def test_a_parameter_comes_back_and_keeps_to_its_bounds(log, scale):
    parameter = Parameter("x", 2.0, scale, 1.5, 3.0, log=log)
    assert parameter.value(0.0) == 2.0
    assert parameter.value(0.5) == pytest.approx(2.0 * math.exp(scale / 2) if log else 2.0 + scale / 2)
    assert parameter.u(parameter.value(0.5)) == pytest.approx(0.5)
    assert (parameter.value(50.0), parameter.value(-50.0)) == ((3.0, 1.5) if scale > 0 else (1.5, 3.0))
    low, high = parameter.bounds
    assert low < 0.0 < high
    assert sorted([parameter.value(low), parameter.value(high)]) == pytest.approx([1.5, 3.0])
    assert parameter.slope(0.5) == pytest.approx(
        (parameter.value(0.5 + 1e-6) - parameter.value(0.5 - 1e-6)) / 2e-6, rel=1e-6
    )


# --- steps of the descent --------------------------------------------------------------------------------------------

J = np.array([[3.0, 1.0], [0.0, 0.4], [1.0, 2.0]])
R = np.array([1.0, -2.0, 0.5])
NEWTON = -np.linalg.lstsq(J, R, rcond=None)[0]


@pytest.mark.parametrize("share", [3.0, 1.001, 0.5, 0.01])
def test_a_damped_step_is_the_best_of_its_length(share):
    radius = share * np.linalg.norm(NEWTON)
    step, newton = _damped_step(J, R, radius)
    assert newton == (share >= 1)
    gradient = J.T @ (R + J @ step)
    if newton:
        assert step == pytest.approx(NEWTON)
        return
    assert 0.98 * radius <= np.linalg.norm(step) <= 1.01 * radius
    damping = -(gradient @ step) / (step @ step)
    assert damping > 0
    assert gradient == pytest.approx(-damping * step), "on the sphere the slope points inwards"


@pytest.mark.parametrize("unit", [1e-15, 1e9])
def test_a_damped_step_does_not_depend_on_the_rows_unit(unit):
    draw = np.random.default_rng(2)
    A, r = draw.normal(size=(8, 3)), draw.normal(size=8)
    for radius in (0.1, 100.0):
        step, newton = _damped_step(unit * A, unit * r, radius)
        assert step == pytest.approx(_damped_step(A, r, radius)[0], rel=1e-6)
        assert newton is (radius > 1.0)


@pytest.mark.parametrize(
    ("step", "ends"),
    [([0.3, -0.2], [0.3, -0.2]), ([2.0, -0.5], [1.0, -0.25]), ([-1.0, -4.0], [-0.5, -2.0]), ([0.0, 5.0], [0.0, 2.0])],
)
def test_a_step_ends_on_the_first_bound_in_its_own_direction(step, ends):
    bound = _step_to_bound(np.zeros(2), np.array(step), np.array([-1.0, -2.0]), np.array([1.0, 2.0]))
    assert bound == pytest.approx(ends)


def test_numbers_pushed_past_their_bound_stay():
    low, high = np.array([-9.0, 0.0]), np.array([9.0, 9.0])
    u = np.zeros(2)
    uphill = J.T @ R
    free, newton = _step(Point(u, R, J, R, J.T), 100.0, (low - 1.0, high))
    assert (free == pytest.approx(NEWTON), newton) == (True, True)
    assert uphill[0] > 0
    assert NEWTON[1] > 0
    alone = -(J[:, 0] @ R) / (J[:, 0] @ J[:, 0])
    below = _step(Point(np.array([0.0, 9.0]), R, J, R, J.T), 100.0, (low, high))[0]
    assert below == pytest.approx([alone, 0.0]), "Newton would push it over its upper bound"
