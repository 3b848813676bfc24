"""The wheel forces against the oracle, closed forms, symmetries, limits and derivatives."""

import math
from itertools import product
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_pin.base.errors import ParameterError
from rover_pin.contact import Soil, Wheel
from rover_pin.soil.peak_stress import PeakAngle, peak_stress_forces
from rover_pin.soil.quadrature import cubic_graded, entry_graded
from rover_pin.soil.stress import full_shear
from rover_pin.soil.wheel_forces import FORMS, WheelForces, forces, pull_of_shear, wheel_forces
from tests.oracle import terramechanics as oracle

WHEEL, SOIL = Wheel(), Soil()
DEG = math.pi / 180


def exact(S, theta_1, theta_2, soil, wheel=WHEEL):
    return oracle.Wheel(wheel.r, wheel.b, soil.c, soil.phi, soil.k, soil.k_1, soil.k_2, soil.n).forces(
        S, theta_1, theta_2
    )


def error(expected, true, channels=WheelForces._fields):
    """Worst relative error; forces below 2 % of what they are summed from are measured against that."""
    worst = 0.0
    for channel in channels:
        arm = WHEEL.r if channel == "torque" else 1.0
        size = max(abs(float(true[channel])), 0.02 * float(true["scale"]) * arm)
        worst = max(worst, abs(getattr(expected, channel) - float(true[channel])) / size)
    return worst


CORNERS = [
    # n, theta_1 deg, -theta_2 / theta_1, k, S, c
    (0.3, 2, 1.0, 0.001, 1.0, 0.0),
    (0.3, 70, 1.0, 0.001, 1.0, 1000.0),
    (1.6, 70, 1.0, 0.1, 0.0, 0.0),
    (1.6, 2, 0.0, 0.1, 1e-3, 0.005),
    (0.7, 35, 1 / 7, 0.05, 0.3, 0.005),
    (1.0, 70, 0.96, 0.0012, 1.0, 1000.0),
    (0.39, 70, 1.0, 0.0011, 0.754, 1000.0),
    (0.3, 61.3, 1.0, 0.001, -0.0995, 1000.0),
    (1.26, 70, 0.786, 0.0015, -0.1716, 0.0),
    (1.1, 67, 1.0, 0.0021, -0.6676, 0.005),
    (0.8, 70, 0.413, 0.001, -0.6814, 0.005),
    (1.57, 9.5, 0.162, 0.0014, -0.999, 1000.0),
    (0.5, 45, 0.5, 0.01, -1.0, 0.0),
    (1.0, 35, 1 / 7, 0.05, -0.1, 0.005),
    (0.6, 50, 1.0, 0.001, -0.12, 0.0),
    (1.6, 2, 0.6, 0.0017, -0.0002, 1000.0),
]


def summed(S, theta_1, theta_2, soil, theta_m=None):
    """The oracle's sum over panels: f_n, f_t, torque."""
    more = (WHEEL.r, WHEEL.b, soil.c, soil.phi, soil.k, soil.k_1, soil.n)
    return oracle.panel_forces(S, theta_1, theta_2, *more, theta_m)


@pytest.mark.slow
@pytest.mark.parametrize("corner", CORNERS)
def test_the_oracles_sum_is_its_30_digit_integral_to_1e_10(corner):
    n, theta_1, ratio, k, S, c = corner
    theta_1, soil = theta_1 * DEG, SOIL.replace(n=n, k=k, c=c)
    summed_forces = WheelForces(*summed(S, theta_1, -ratio * theta_1, soil), 0.0, 0.0)
    true = exact(S, theta_1, -ratio * theta_1, soil)
    assert error(summed_forces, true, ("f_n", "f_t", "torque")) < 1e-10


@pytest.mark.parametrize(("k", "S", "tolerance"), [(0.05, 0.3, 2e-10), (0.005, 1.0, 3e-9), (0.001, 1.0, 3e-7)])
def test_the_fast_rule_is_as_good_as_its_docstring_says(k, S, tolerance):
    soil = SOIL.replace(k=k)
    fast = wheel_forces(S, soil.theta_1, soil.theta_2, WHEEL, soil)
    assert error(fast, exact(S, soil.theta_1, soil.theta_2, soil)) < tolerance


def off_by(points):
    """Worst of the errors of f_n, f_t and torque / r of the fast rule at points [S, theta_1, theta_2, k, phi, n, c]."""
    x = ca.SX.sym("x", 7)
    fast = wheel_forces(x[0], x[1], x[2], WHEEL, SOIL.replace(k=x[3], phi=x[4], n=x[5], c=x[6]))
    law = ca.Function("law", [x], [ca.vertcat(fast.f_n, fast.f_t, fast.torque)])
    true = np.hstack(
        [
            summed(*some[:3], SimpleNamespace(k=some[3], phi=some[4], n=some[5], c=some[6], k_1=SOIL.k_1))
            for some in np.array_split(points, 1 + points.shape[1] // 100, axis=1)
        ]
    )
    arms = [[1.0], [1.0], [WHEEL.r]]
    return np.max(np.abs(law.map(points.shape[1])(points).full() - true) / arms, axis=0) / true[0]


@pytest.mark.parametrize(("k", "declared"), [(0.05, 7e-7), (0.005, 2e-5), (0.001, 4e-4)])
def test_the_fast_rule_brakes_as_its_docstring_says(k, declared):
    """No better and no worse, at Table 1's angles; f_t and torque / r by f_n."""
    S = np.linspace(-1.0, -0.001, 1000)
    constants = [[SOIL.theta_1], [SOIL.theta_2], [k], [SOIL.phi], [1.0], [SOIL.c]]
    worst = np.max(off_by(np.vstack([S, np.tile(constants, (1, S.size))])))
    assert 0.7 * declared < worst < 1.1 * declared


def test_fast_rule_over_the_whole_box_errs_as_its_docstring_says():
    rng, count = np.random.default_rng(1), 3000

    def drawn(low, high, ends=True):
        at_end = rng.random(count) < 0.3
        return np.where(at_end & ends, rng.choice([low, high], count), rng.uniform(low, high, count))

    theta_1, ratio, k = drawn(2 * DEG, 70 * DEG), drawn(0.0, 1.0), np.exp(drawn(math.log(1e-3), math.log(0.1)))
    arguments = [theta_1, -ratio * theta_1, k, drawn(10 * DEG, 45 * DEG, False), drawn(0.3, 1.6)]
    arguments.append(rng.choice([0.0, 0.005, 1000.0], count))
    assert np.max(off_by(np.vstack([drawn(0.0, 1.0), *arguments]))) < 5e-5
    braking = off_by(np.vstack([drawn(-1.0, 0.0), *arguments]))
    assert 1e-3 < np.quantile(braking, 0.99) < 8e-3
    corner = np.array([-0.231, 1.2036, -0.9035, 0.001, 0.5458, 0.7088, 1000.0])[:, None]
    assert off_by(corner)[0] == pytest.approx(0.035, abs=2e-3)
    assert np.max(braking) < 0.06


@pytest.mark.parametrize(("n", "angles"), list(product([1, 2], [(0.6, -0.09), (0.035, -0.035), (1.2, 0.0)])))
def test_closed_forms_at_full_shear(n, angles):
    soil = SOIL.replace(n=float(n), c=0.0)
    sheared = forces(*angles, full_shear, WHEEL, soil, entry_graded(48))
    f_n, thrust, torque = oracle.full_shear_closed_form(*angles, soil.phi, n)
    patch = WHEEL.r * WHEEL.b * soil.k_1 * (WHEEL.r / WHEEL.b) ** n
    assert sheared.f_n == pytest.approx(patch * float(f_n), rel=1e-11)
    assert sheared.thrust == pytest.approx(patch * float(thrust), rel=1e-11)
    assert sheared.torque == pytest.approx(patch * WHEEL.r * float(torque), rel=1e-11)


@given(n=st.floats(0.3, 1.6), theta_1=st.floats(2, 70), ratio=st.floats(0, 1))
@settings(max_examples=30)
def test_compaction_is_the_exact_identity(n, theta_1, ratio):
    theta_1 *= DEG
    soil = SOIL.replace(n=n)
    forces_found = wheel_forces(0.2, theta_1, -ratio * theta_1, WHEEL, soil)
    _, without_shear, _ = summed(0.2, theta_1, -ratio * theta_1, soil.replace(c=0.0, phi=0.0))
    assert forces_found.compaction == pytest.approx(-without_shear, rel=1e-9, abs=1e-9 * forces_found.f_n)


def symbolic():
    """The five forces as a compiled function of S, theta_1, theta_2, r, b, c, phi, k, k_1, k_2, n."""
    x = [ca.SX.sym(name) for name in ("S", "theta_1", "theta_2", "r", "b", "c", "phi", "k", "k_1", "k_2", "n")]
    wheel = Wheel(x[3], x[4])
    soil = Soil(c=x[5], phi=x[6], k=x[7], k_1=x[8], k_2=x[9], n=x[10])
    values = ca.vertcat(*wheel_forces(*x[:3], wheel, soil))
    return ca.Function("f", [ca.vertcat(*x)], [values, ca.jacobian(values, ca.vertcat(*x))])


POINTS = [
    [0.2, 0.6, -0.1, 0.045, 0.05, 0.005, 0.52, 0.05, 54e3, 0.0, 1.0],
    [-0.2, 0.9, -0.3, 0.0625, 0.06, 300.0, 0.4, 0.01, -1e3, 2e6, 0.6],
    [0.0, 0.3, -0.3, 0.1, 0.1, 0.0, 0.7, 0.002, 1e4, 1e5, 1.4],
    [-1.0, 0.5, -0.1, 0.045, 0.05, 50.0, 0.52, 0.02, 54e3, 0.0, 1.1],
    [1.0, 0.04, -0.004, 0.045, 0.05, 50.0, 0.52, 0.02, 54e3, 0.0, 1.1],
]


def at_numbers(p):
    soil = Soil(c=p[5], phi=p[6], k=p[7], k_1=p[8], k_2=p[9], n=p[10])
    return wheel_forces(*p[:3], Wheel(p[3], p[4]), soil)


@pytest.mark.parametrize("point", POINTS)
def test_floats_equal_symbols(point):
    value, _ = symbolic()(point)
    numbers = at_numbers(point)
    assert all(isinstance(part, float) for part in numbers)
    scale = abs(numbers.f_n)
    assert np.array(value).ravel() == pytest.approx(list(numbers), rel=1e-12, abs=1e-12 * scale)


@pytest.mark.parametrize("point", [POINTS[0], POINTS[1], POINTS[4]])
def test_derivatives_equal_central_differences(point):
    jacobian = np.array(symbolic()(point)[1])
    scale = abs(at_numbers(point).f_n)
    for i, value in enumerate(point):
        step = 1e-6 * max(abs(value), 1e-2)
        up, down = list(point), list(point)
        up[i], down[i] = value + step, value - step
        if i == 0 and value == 1.0:
            continue
        difference = (np.array(at_numbers(up)) - np.array(at_numbers(down))) / (2 * step)
        size = scale / max(abs(value), 1e-2)
        assert jacobian[:, i] == pytest.approx(difference, rel=2e-6, abs=2e-7 * size), i


@pytest.mark.parametrize("S", [0.0, 0.3, 1.0])
def test_peak_stress_agrees_with_a_sum_in_numpy(S):
    soil = SOIL.replace(c=200.0, n=0.9, k=0.01)
    theta_m = PeakAngle().at(S, 0.6)
    peaked = peak_stress_forces(S, (0.6, theta_m, -0.2), WHEEL, soil)
    true = summed(S, 0.6, -0.2, soil, theta_m)
    assert [peaked.f_n, peaked.f_t, peaked.torque] == pytest.approx(true, rel=1e-6, abs=1e-6 * peaked.f_n)


@pytest.mark.parametrize(
    ("point", "tolerance"),
    [((1.0, 0.6, 0.15, 0.6, 0.7, 0.001, 1000.0), 1e-8), ((-0.18, 1.2, 0.72, 0.3, 1.3, 0.02, 0.0), 1e-4)],
)
def test_peak_stress_is_a_30_digit_integral_with_many_nodes(point, tolerance):
    """theta_m stands at `share` of the arc from the exit; braking the shear changes its sign on the way."""
    S, theta_1, ratio, share, n, k, c = point
    theta_2, soil = -ratio * theta_1, SOIL.replace(n=n, k=k, c=c)
    theta_m = theta_2 + share * (theta_1 - theta_2)
    constants = (WHEEL.r, WHEEL.b, soil.c, soil.phi, soil.k, soil.k_1, soil.k_2, soil.n)
    true = oracle.PeakedWheel(theta_m, theta_2, *constants).forces(S, theta_1, theta_2)
    assert error(peak_stress_forces(S, (theta_1, theta_m, theta_2), WHEEL, soil, 60), true) < tolerance


@pytest.mark.parametrize(
    ("S", "torque", "expected"),
    [
        # f_t / f_n = 1.5, thrust / f_n = 2, and T / (r f_n) = 2.5 where nothing is cut
        (0.3, 0.5, {"net": 1.5, "gross": 2.0, "torque": 2.5}),
        (0.0, 0.5, {"net": 1.5, "gross": 2.0, "torque": 2.5}),
        (0.3, 0.34, {"net": 1.5, "gross": 1.7, "torque": 1.7}),
        (-0.3, 0.5, {"net": 1.5, "gross": 1.75, "torque": 1.75}),
        (-0.5, 0.5, {"net": 1.25, "gross": 1.25, "torque": 1.25}),
        (-1.0, 0.5, {"net": 0.0, "gross": 0.0, "torque": 0.0}),
        (-0.5, -0.5, {"net": -1.25, "gross": -1.25, "torque": -2.5}),
    ],
)
def test_no_form_pulls_more_than_its_torque_pays_for(S, torque, expected):
    """By hand: T omega >= f_t v with r omega = (1 + S) v where it brakes, and a rim that slides its way driving."""
    given_by = WheelForces(f_n=2.0, f_t=3.0, torque=torque, thrust=4.0, compaction=1.0)
    wheel = Wheel(r=0.1)
    assert {name: form.factor(given_by, wheel, S) for name, form in FORMS.items()} == pytest.approx(expected)
    assert pull_of_shear(torque, wheel, S) == pytest.approx(2.0 * expected["torque"])


@pytest.mark.parametrize("rule", [entry_graded, cubic_graded])
def test_rules_integrate_powers(rule):
    graded = rule(20)
    for power in (0.3, 1.0, 2.5):
        sum_ = sum(w * p**power for p, w in zip(graded.psi, graded.weights, strict=True))
        assert sum_ == pytest.approx(1 / (power + 1), rel=1e-8)


@pytest.mark.parametrize("nodes", [1, 2.5, True, "16"])
def test_nodes_must_be_a_whole_number_of_two_or_more(nodes):
    with pytest.raises(ParameterError, match="whole number"):
        wheel_forces(0.1, 0.6, -0.1, WHEEL, SOIL, nodes)
