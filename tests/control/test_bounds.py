"""One wheel's torque bounds: against a search with the 30-digit oracle, against limits, and their derivatives."""

import math

import casadi as ca
import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_pin import SOILS, Soil, Wheel, torque_bounds
from rover_pin.base.errors import ParameterError
from rover_pin.control.bound_law import INPUTS
from rover_pin.control.torque_bounds import TorqueBounds
from rover_pin.soil.angles import FixedAngles
from tests.control.arc_torque import saturation_torque, torque_at_slip
from tests.oracle import terramechanics as oracle

WHEEL = Wheel()
SAND = SOILS["literature-sand"].replace(k=0.005)


class FullShear(oracle.Wheel):
    """The oracle's wheel with all of the strength in use."""

    def tau(self, theta, theta_1, S):
        return self.c + self.sigma(theta, theta_1) * mp.tan(self.phi)


def bound_gradient(load, soil, wheel, slip_limit=0.2, *angles):
    """The derivatives of both bounds by each input, of the bounds as expressions."""
    x = ca.SX.sym("x", len(INPUTS))
    W, S, r, b, *soil_constants = ca.vertsplit(x)
    both = ca.vertcat(
        *torque_bounds(W, Soil(**dict(zip(SAND.values(), soil_constants, strict=True))), Wheel(r, b), S, *angles)
    )
    slopes = ca.Function("slopes", [x], [ca.densify(ca.jacobian(both, x))])
    rows = np.array(slopes([load, slip_limit, *wheel.values().values(), *soil.values().values()]))
    return {name: tuple(row) for name, row in zip(INPUTS, rows.T.tolist(), strict=True)}


def searched(load, S, soil, kind, wheel=WHEEL):
    """T at the theta_1 whose f_n carries the load, found by the secant rule on the oracle's integrals."""
    real = kind(wheel.r, wheel.b, soil.c, soil.phi, soil.k, soil.k_1, soil.k_2, soil.n)
    at = lambda theta_1: real.forces(S, theta_1, -soil.exit_ratio * theta_1)  # noqa: E731
    spare = lambda y: mp.log(at(mp.exp(y))["f_n"] / load)  # noqa: E731
    with mp.workdps(18):
        y = mp.findroot(spare, (math.log(0.35), math.log(0.4)), solver="secant", tol=1e-26)
        return float(at(mp.exp(y))["torque"])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("soil", "load", "S"),
    [
        (SOILS["table-1"], 9.48, 0.2),
        (SOILS["literature-sand"], 2.0, 1.0),
        pytest.param(SOILS["hit-lss1"], 20.0, 0.05, marks=pytest.mark.slow),
        pytest.param(SOILS["mars-sand"], 9.48, 0.5, marks=pytest.mark.slow),
        *(
            pytest.param(SAND.replace(n=n, k=k, c=300.0, exit_ratio=0.5), load, 0.3, marks=pytest.mark.slow)
            for n, k, load in ((0.3, 0.001, 30.0), (0.3, 0.1, 0.3), (1.6, 0.001, 0.3), (1.6, 0.1, 30.0))
        ),
    ],
)
def test_bounds_agree_with_a_search_by_the_oracle(soil, load, S):
    bounds = torque_bounds(load, soil, WHEEL, S)
    assert bounds.limit == pytest.approx(searched(load, S, soil, oracle.Wheel), rel=1e-10)
    assert bounds.saturation == pytest.approx(searched(load, S, soil, FullShear), rel=1e-10)


def test_the_limit_is_the_greatest_torque_below_the_slip_limit():
    """Brute force: the torque at many slips, with the midpoint sum; none below the limit asks more than T_lim."""
    limit = torque_bounds(9.48, SAND, WHEEL, 0.3).limit
    slips = np.linspace(0.01, 1.0, 100)
    torques = np.array([torque_at_slip(9.48, float(S), WHEEL, SAND) for S in slips])
    below = slips <= 0.3 + 1e-12
    assert np.max(torques[below]) == pytest.approx(limit, rel=1e-9)
    assert np.all(torques[~below] > limit)
    assert np.all(torques < torque_bounds(9.48, SAND, WHEEL, 0.3).saturation)


@pytest.mark.parametrize("angles", [None, FixedAngles()])
def test_a_lifted_wheel_has_no_torque_and_no_slope(angles):
    more = () if angles is None else (angles,)
    assert torque_bounds(0.0, SAND, WHEEL, 0.2, *more) == (0.0, 0.0)
    assert bound_gradient(0.0, SAND, WHEEL, 0.2, *more)["load"] == (0.0, 0.0)
    W = ca.SX.sym("W")
    both = ca.vertcat(*torque_bounds(W, SAND.replace(c=100.0), WHEEL, 0.2, *more))
    curves = ca.Function("f", [W], [both, ca.jacobian(both, W)])
    for load in (-1.0, -1e-9, 0.0, 1e-12, 1e-9, 1e-6, 1e-3):
        value, slope = (np.array(curve) for curve in curves(load))
        assert np.all(np.isfinite(value))
        assert np.all(np.isfinite(slope))
        assert np.all(value > 0.0) if load > 1e-9 else np.all(value >= 0.0)
        assert load > 0.0 or np.all(value == 0.0)


soils = st.builds(
    lambda c, phi, k, k_1, n, ratio: SAND.replace(c=c, phi=phi, k=k, k_1=k_1, n=n, exit_ratio=ratio),
    st.floats(0.0, 1e3), st.floats(0.2, 0.8), st.floats(2e-3, 0.1), st.floats(4e4, 4e5), st.floats(0.5, 1.4),
    st.floats(0.0, 0.6),
)  # fmt: skip


@settings(max_examples=60)
@given(soils, st.floats(0.1, 20.0), st.floats(0.02, 1.0))
def test_bounds_agree_with_the_soils_own_slower_route(soil, load, S):
    bounds = torque_bounds(load, soil, WHEEL, S)
    assert bounds.saturation == pytest.approx(saturation_torque(load, WHEEL, soil), rel=1e-8)
    assert bounds.limit == pytest.approx(torque_at_slip(load, S, WHEEL, soil), rel=1e-7)
    assert 0.0 < bounds.limit < bounds.saturation


@settings(max_examples=40)
@given(soils, st.floats(0.5, 20.0), st.floats(0.05, 0.95))
def test_gradients_are_central_differences(soil, load, S):
    gradient = bound_gradient(load, soil, WHEEL, S)
    values = {"load": load, "slip_limit": S, **WHEEL.values(), **soil.values()}

    def at(**change):
        new = {**values, **change}
        wheel = Wheel(r=new["r"], b=new["b"])
        changed = soil.replace(**{key: new[key] for key in soil.values()})
        return torque_bounds(new["load"], changed, wheel, new["slip_limit"])

    checked = 0
    for name in set(INPUTS) - {"theta_1", "theta_2"}:
        step = 1e-4 * max(abs(values[name]), {"c": 10.0, "k_2": 1e3, "exit_ratio": 0.1}.get(name, 0.0))
        if name in ("c", "exit_ratio") and values[name] < step:
            continue
        checked += 1
        high, low = (at(**{name: values[name] + sign * step}) for sign in (1.0, -1.0))
        for slope, above, below in zip(gradient[name], high, low, strict=True):
            # round-off and the bounds' own 1e-10, over the step
            assert slope == pytest.approx((above - below) / (2 * step), rel=2e-5, abs=1e-9 * above / step)
    assert checked >= 9
    assert gradient["theta_1"] == gradient["theta_2"] == (0.0, 0.0)


def test_fixed_angles_give_torque_in_proportion_to_the_load():
    single, two = (torque_bounds(W, SAND, WHEEL, 0.2, FixedAngles()) for W in (3.0, 6.0))
    assert two == pytest.approx((2.0 * single.saturation, 2.0 * single.limit), rel=1e-12)
    real = oracle.Wheel(WHEEL.r, WHEEL.b, SAND.c, SAND.phi, SAND.k, SAND.k_1, SAND.k_2, SAND.n)
    at = real.forces(0.2, SAND.theta_1, SAND.theta_2)
    assert single.limit == pytest.approx(float(3.0 * at["torque"] / at["f_n"]), rel=1e-10)
    full = FullShear(WHEEL.r, WHEEL.b, SAND.c, SAND.phi, SAND.k, SAND.k_1, SAND.k_2, SAND.n)
    at = full.forces(0.2, SAND.theta_1, SAND.theta_2)
    assert single.saturation == pytest.approx(float(3.0 * at["torque"] / at["f_n"]), rel=1e-10)


@pytest.mark.parametrize("angles", [None, FixedAngles()])
def test_the_prepared_bounds_are_those_of_each_wheel(angles):
    more = () if angles is None else (angles,)
    wheels = [WHEEL, Wheel(r=0.06), WHEEL, Wheel(b=0.08), WHEEL, WHEEL]
    loads = np.array([4.0, 9.0, 0.0, 12.0, 1e-3, 20.0])
    prepared = TorqueBounds(wheels, SAND, 0.3, *more)(loads)
    for i, (load, wheel) in enumerate(zip(loads, wheels, strict=True)):
        wheel_bounds = torque_bounds(float(load), SAND, wheel, 0.3, *more)
        slope = bound_gradient(float(load), SAND, wheel, 0.3, *more)["load"]
        assert (prepared.saturation[i], prepared.limit[i]) == pytest.approx(wheel_bounds, rel=1e-12, abs=1e-300)
        assert (prepared.d_saturation[i], prepared.d_limit[i]) == pytest.approx(slope, rel=1e-8, abs=1e-300)


@pytest.mark.parametrize("slip_limit", [0.0, -0.1, 1.0001, math.nan])
def test_a_slip_that_cannot_be_reached_is_refused(slip_limit):
    for call in (lambda: torque_bounds(9.0, SAND, WHEEL, slip_limit), lambda: TorqueBounds([WHEEL], SAND, slip_limit)):
        with pytest.raises(ParameterError, match=r"slip_limit =.*\(0, 1\]"):
            call()


@pytest.mark.parametrize(("load", "says"), [(-1.0, " = -1 N.*0"), (math.nan, " = nan N"), (math.inf, " = inf N")])
def test_a_load_that_is_none_is_refused(load, says):
    with pytest.raises(ParameterError, match="load" + says):
        torque_bounds(load, SAND, WHEEL)
    with pytest.raises(ParameterError, match=r"load\[1\]" + says):
        TorqueBounds([WHEEL] * 2, SAND)([1.0, load])


def test_a_load_that_the_soil_cannot_carry_is_refused():
    for call in (lambda: torque_bounds(1e4, SAND, WHEEL), lambda: TorqueBounds([WHEEL] * 2, SAND)([1.0, 1e4])):
        with pytest.raises(ParameterError, match="load = 10000 N"):
            call()


def test_wrong_numbers_of_wheels_and_loads_are_refused():
    with pytest.raises(ParameterError, match=r"wheels.*given"):
        TorqueBounds([], SAND)
    for loads in ([1.0, 2.0, 3.0], "some"):
        with pytest.raises(ParameterError, match="give 2 numbers"):
            TorqueBounds([WHEEL] * 2, SAND)(loads)
