"""Where a braking arc is cut for the certified quadrature: against bisection of the shear displacement, by hand."""

import math

import pytest
from scipy.optimize import brentq, minimize_scalar

from rover_pin.contact import Soil, Wheel
from rover_pin.soil.certified import _cuts, certified_forces, certified_peak_forces
from rover_pin.soil.peak_stress import peak_stress_forces

LONGEST = 1.8
"""Of an arc with theta_1 = 0.9 [rad], whose end mirrors its beginning."""


def shift(s, ratio, theta_1=0.9):
    """j / r = s - (v / r omega)(sin theta_1 - sin(theta_1 - s)), Eq (2)."""
    return s - ratio * (math.sin(theta_1) - math.sin(theta_1 - s))


def ratio_that_ends_at(s, theta_1=0.9):
    """v / (r omega) at which j is 0 at s."""
    return s / (math.sin(theta_1) - math.sin(theta_1 - s))


def cuts(ratio, theta_1=0.9, length=LONGEST, stiffness=45.0):
    return [float(each) for each in _cuts(ratio, theta_1, length, stiffness)]


@pytest.mark.parametrize("theta_1", [0.02, 0.9, 1.2])
@pytest.mark.parametrize("share", [0.05, 0.6, 0.95])
def test_the_arc_is_cut_at_both_sign_changes_of_the_shear(theta_1, share):
    """Between the ratio that j first reaches 0 with and the one that keeps it to the end, there are two."""
    first = minimize_scalar(ratio_that_ends_at, (0.1 * theta_1, 1.5 * theta_1, 2 * theta_1), args=(theta_1,))
    last = ratio_that_ends_at(2 * theta_1, theta_1)
    ratio = first.fun + share * (last - first.fun)
    found = [brentq(shift, *ends, (ratio, theta_1), xtol=1e-14) for ends in ((1e-3, first.x), (first.x, 2 * theta_1))]
    near, _, far = cuts(ratio, theta_1, 2 * theta_1)
    assert [near, far] == pytest.approx(found, rel=1e-7)


@pytest.mark.parametrize("zero", [1e-3, 0.2, 0.6, 0.8])
def test_where_the_shear_changes_once_it_is_backwards_to_the_end(zero):
    near, _, far = cuts(ratio_that_ends_at(zero))
    assert near == pytest.approx(zero, rel=1e-6)
    assert far == LONGEST


@pytest.mark.parametrize("ratio", [1.0001 / math.cos(0.9), 3.0, 1e14])
def test_arc_sheared_backwards_from_the_start_is_cut_there(ratio):
    assert cuts(ratio)[0] == 0.0


def by_differences(ratio, at):
    """-dj/ds and -d2j/ds2 over r at a point of the arc."""
    step = 1e-4
    before, here, after = (shift(at + side * step, ratio) for side in (-1, 0, 1))
    return (before - after) / (2 * step), -(before - 2 * here + after) / step**2


@pytest.mark.parametrize("ratio", [ratio_that_ends_at(0.3), ratio_that_ends_at(0.7), 2.0, 5.0])
@pytest.mark.parametrize("stiffness", [200.0, 3000.0])
def test_the_layer_ends_where_twenty_displacements_are_passed(ratio, stiffness):
    near, end, _ = cuts(ratio, stiffness=stiffness)
    slope, bend = by_differences(ratio, near)
    assert stiffness * (slope * (end - near) + bend * (end - near) ** 2 / 2) == pytest.approx(20.0, rel=1e-4)
    assert stiffness * shift(end, ratio) == pytest.approx(-20.0, rel=0.2 if stiffness < 1e3 else 0.02)


def test_behind_the_axle_the_layer_is_taken_as_level():
    """There j bends back, and the second-order equation may have no root."""
    ratio = ratio_that_ends_at(1.1)
    near, end, _ = cuts(ratio, stiffness=3000.0)
    assert near == pytest.approx(1.1)
    assert end - near == pytest.approx(20.0 / 3000.0 / by_differences(ratio, near)[0], rel=1e-5)


@pytest.mark.parametrize("ratio", [0.0, 0.5, 1.0, 1.1, 1.14, 1.3, 1.7, 5.0, 1e14])
@pytest.mark.parametrize("length", [0.3, 0.9, 1.5, 1.8])
def test_cuts_lie_on_the_arc_in_their_order(ratio, length):
    found = cuts(ratio, length=length)
    assert found == sorted(found)
    assert found[0] >= 0.0
    assert found[-1] <= length


@pytest.mark.parametrize(("S", "theta_1", "k", "n"), [(-0.95, 0.99, 0.0018, 0.5), (-0.92, 0.85, 0.002, 0.86)])
def test_a_cut_arc_needs_few_nodes(S, theta_1, k, n):
    """Without the layer's cut twenty nodes leave 2e-6, without any 1e-3."""
    wheel, soil, theta_2 = Wheel(), Soil(k=k, n=n, c=1000.0), -0.83 * theta_1
    for few, many in (
        [certified_forces(S, theta_1, theta_2, wheel, soil, nodes=nodes) for nodes in (20, 96)],
        [certified_peak_forces(S, (theta_1, 0.3 * theta_1, theta_2), wheel, soil, nodes=nodes) for nodes in (20, 96)],
    ):
        assert [few.f_n, few.f_t, few.torque / wheel.r] == pytest.approx(
            [many.f_n, many.f_t, many.torque / wheel.r], abs=2e-9 * many.f_n, rel=0.0
        )


@pytest.mark.parametrize(("S", "angles"), [(0.3, (0.6, 0.25, -0.1)), (1.0, (0.9, 0.2, -0.8)), (0.0, (0.4, 0.3, -0.1))])
def test_certified_peak_is_the_plain_one_where_no_cut_is_needed(S, angles):
    """Driving: `peak_stress_forces` takes either side of the peak by a rule and a formula of its own."""
    wheel, soil = Wheel(r=0.06, b=0.04), Soil(c=300.0, k=0.01, n=0.8)
    plain, certified = peak_stress_forces(S, angles, wheel, soil, 60), certified_peak_forces(S, angles, wheel, soil)
    assert list(certified) == pytest.approx(list(plain), abs=1e-7 * plain.f_n)
