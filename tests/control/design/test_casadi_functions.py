"""CasADi functions by name: equal to the oracle and to a drive's own law, with exact derivatives."""

import casadi as ca
import mpmath as mp
import numpy as np
import pytest

from rover_pin import SOILS, Soil, Wheel, scenario
from rover_pin.base.errors import ParameterError
from rover_pin.control.design.casadi_functions import (
    bounds_function,
    rig_step_function,
    traction_function,
    wheel_function,
)
from rover_pin.simulation.compiled.laws import contact_law, numbers
from tests.oracle import terramechanics as oracle

SAND, WHEEL = SOILS["literature-sand"], Wheel(r=0.06, b=0.04)
CONSTANTS = (WHEEL.r, WHEEL.b, SAND.c, SAND.phi, SAND.k, SAND.k_1, SAND.k_2, SAND.n)


@pytest.fixture(scope="module")
def model():
    return scenario("flat", add="SlipSinkage").model


@pytest.mark.parametrize("slip", [0.05, 0.4, 0.9])
def test_traction_factor_and_its_slope_are_those_of_the_oracle(slip):
    function = traction_function(SAND, WHEEL, "torque")

    def factor(S):
        forces = oracle.Wheel(*CONSTANTS).forces(S, SAND.theta_1, SAND.theta_2)
        return float(forces["torque"] / WHEEL.r / forces["f_n"])

    assert float(function(S=slip)["F"]) == pytest.approx(factor(slip), rel=1e-6)
    S = ca.SX.sym("S")
    slope = ca.Function("slope", [S], [ca.jacobian(function(S=S)["F"], S)])
    assert float(slope(slip)) == pytest.approx((factor(slip + 1e-4) - factor(slip - 1e-4)) / 2e-4, rel=1e-4)


def test_a_number_that_is_given_replaces_the_default():
    defaults, function = traction_function(SAND, WHEEL), traction_function(SAND.replace(phi=0.6), WHEEL)
    assert float(defaults(S=0.3, phi=0.6)["F"]) == float(function(S=0.3)["F"]) != float(defaults(S=0.3)["F"])


def test_bounds_are_those_of_the_oracle_at_the_load_they_state():
    bounds = bounds_function(SAND, WHEEL)(load=12.0, slip_limit=0.3)
    # The oracle's wheel at the entry angle that carries 12 N, found by the secant rule on its own normal force.
    wheel = oracle.Wheel(*CONSTANTS)

    def forces(theta_1):
        return wheel.forces(0.3, theta_1, -SAND.exit_ratio * theta_1)

    with mp.workdps(18):
        excess = lambda y: mp.log(forces(mp.exp(y))["f_n"] / 12)  # noqa: E731
        carried = forces(mp.exp(mp.findroot(excess, (-1.0, -0.9), solver="secant", tol=1e-24)))
    assert float(bounds["T_lim"]) == pytest.approx(float(carried["torque"]), rel=1e-8)
    assert 0.0 < float(bounds["T_lim"]) < float(bounds["T_sat"])
    assert not float(bounds["refused"])
    assert float(bounds_function(SAND, WHEEL)(load=-1.0)["refused"])


def test_forces_are_those_of_the_law_that_a_drive_uses(model):
    function = wheel_function(model)
    generator = np.random.default_rng(3)
    contact_forces = contact_law(model.contact_effects)
    constants = numbers([model.rover.wheel, model.soils[0]])
    for _ in range(20):
        h, v_x, v_y, v_n, rim = generator.uniform([1e-3, -0.1, -0.03, -0.01, -0.1], [0.02, 0.1, 0.03, 0.01, 0.1])
        states = generator.uniform(-0.3, 0.3, sum(len(effect.states) for effect in model.contact_effects))
        out = np.array(
            contact_forces([h, v_x, v_y, v_n, rim, 0.0, 1.0, *constants], states, numbers(model.contact_effects))
        )
        named = [name for name in function.name_in() if name.split("_")[0] in ("RelaxedSlip", "SlipSinkage")]
        named = [name for name in named if f"d_{name}" in function.name_out()]
        result = function(h=h, v_x=v_x, v_y=v_y, v_n=v_n, rim=rim, axle=1.0, **dict(zip(named, states, strict=True)))
        forces = [float(result[name]) for name in ("f_t", "f_y", "f_n", "torque")]
        assert forces == pytest.approx(out[:4, 0].tolist(), rel=1e-12, abs=1e-12)


def test_derivatives_by_soil_and_effect_numbers_are_those_of_differences(model):
    function = wheel_function(model)
    point = {"h": 0.009, "v_x": 0.05, "rim": 0.06, "RelaxedSlip_S": 0.17}
    for name in ("phi", "k", "k_1", "MotionResistance_R"):
        position = function.index_in(name)
        value = float(function.default_in(position))
        symbol, change = ca.SX.sym(name), 1e-5 * value
        exact = ca.Function("exact", [symbol], [ca.jacobian(function(**point, **{name: symbol})["f_t"], symbol)])
        high, low = (float(function(**point, **{name: value + sign * change})["f_t"]) for sign in (1, -1))
        assert float(exact(value)) == pytest.approx((high - low) / (2 * change), rel=1e-5), name


def test_a_loaded_wheel_on_a_rig_settles_where_the_soil_carries_the_load(model):
    step = rig_step_function(model, period=0.02, mass=1.5)
    names = [name.removeprefix("next_") for name in step.name_out() if name.startswith("next_")]
    state = dict.fromkeys(names, 0.0)
    for _ in range(1500):
        end = step(**state, v_x=0.05, rim=0.0625, W=10.0)
        state = {name: float(end[f"next_{name}"]) for name in names}
    assert state["RelaxedSlip_S"] == pytest.approx(0.2, abs=1e-6)  # Eq (1): 1 - 0.05 / 0.0625
    assert abs(state["v_n"]) < 1e-9
    assert float(end["f_n"]) == pytest.approx(10.0, abs=1e-6)


def test_half_the_period_ends_nearer_to_the_settling_wheel(model):
    """The step is of first order: half the period halves the error of the sinkage after 0.1 s."""

    def sinkage(period):
        step = rig_step_function(model, period, mass=1.5)
        state = {"h": 0.002, "v_n": 0.0}
        for _ in range(round(0.1 / period)):
            end = step(**state, v_x=0.05, rim=0.05, W=10.0)
            state = {name: float(end[f"next_{name}"]) for name in state}
        return state["h"]

    reference = sinkage(1e-4)
    errors = [abs(sinkage(period) - reference) for period in (8e-3, 4e-3, 2e-3)]
    assert errors[0] > 1.6 * errors[1] > 2.5 * errors[2]


def test_functions_are_stored_mapped_and_generated(tmp_path, monkeypatch):
    function = traction_function(SAND, WHEEL)
    again = ca.Function.deserialize(function.serialize())
    assert again.name_in() == function.name_in()
    assert float(again(S=0.3)["F"]) == float(function(S=0.3)["F"])
    # A map takes matrices of one column for each evaluation, and no defaults: the constants are repeated.
    slips = np.linspace(0.0, 1.0, 5)
    columns = [np.full(5, function.default_in(position)) for position in range(function.n_in())]
    columns[0] = slips
    mapped = np.array(function.map(5)(*[column[None, :] for column in columns])).ravel()
    assert mapped == pytest.approx([float(function(S=slip)["F"]) for slip in slips], rel=1e-12)
    monkeypatch.chdir(tmp_path)
    assert "traction" in (tmp_path / function.generate("traction.c")).read_text()


@pytest.mark.parametrize(
    ("call", "word"),
    [
        (lambda model: wheel_function(model, ground=7), "7"),
        (lambda model: rig_step_function(model, 0.0, 1.0), "period"),
        (lambda model: rig_step_function(model, 0.01, -1.0), "mass"),
        (lambda model: traction_function(Soil(), Wheel(), "nett"), "nett"),
    ],
)
def test_what_is_not_allowed_is_named(call, word, model):
    with pytest.raises(ParameterError, match=word):
        call(model)
