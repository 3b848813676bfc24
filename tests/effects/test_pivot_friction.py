"""Pivot friction: the level by hand, energy only taken, a bogie in the air that stays where it is."""

import math

import numpy as np
import pytest

from rover_pin.control.constant import ConstantDuty
from rover_pin.effects.effect import Body
from rover_pin.effects.pivot_friction import PivotFriction
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.simulate import simulate
from rover_pin.simulation.start.place import Start, hovering


def test_the_level_by_hand():
    rates = (0.5, -0.5, 0.02, 0.0)
    body = Body(*[0.0] * 12, (0.0,) * 4, rates, rates)
    torques = [float(each) for each in PivotFriction(tau_c=0.03, b=0.01, w_s=0.02).push(body).joints]
    assert torques == pytest.approx([-0.035, 0.035, -0.03 * math.tanh(1.0) - 0.0002, 0.0], rel=1e-9)


def falling(model, seconds):
    """A rover in free fall whose bogie is hit: no gravity on the joints, no ground."""
    state = hovering(model, Start())
    state.q[2] += 50.0
    state.v[model.rover.mirror.perm[7]] = state.v[7] = 1.0
    kernel = Kernel(model, state, 0.005, symmetric=False)
    rates = []
    for _ in range(round(seconds / 0.005)):
        assert kernel.step() == 0
        rates.append(abs(state.v[7]))
    return np.array(rates), kernel.energy[-1], state


def test_a_bogie_that_was_hit_comes_to_rest_and_stays():
    """Without friction it goes on turning, up to its stop; with it the rate only falls, however short the step."""
    flat = scenario("flat").model
    free, nothing, _ = falling(flat, 0.3)
    held, taken, state = falling(flat.having(PivotFriction(tau_c=0.5, b=0.0)), 0.3)
    assert free[-1] > 0.5
    assert nothing == 0.0
    assert held[-1] < 1e-3
    assert np.all(np.diff(held) <= 1e-5)
    assert 0.0 < taken < 0.5
    assert abs(state.q[8]) < 0.05


def test_it_takes_energy_over_a_bump_and_lags_the_bogie():
    model = scenario("one-sided-bump").model
    free, rubbing = (
        simulate(each, ConstantDuty(0.55), 12.0) for each in (model, model.having(PivotFriction(tau_c=0.1)))
    )
    assert np.all(np.diff(rubbing["energy_body"]) >= -1e-12)
    assert rubbing["energy_body"][-1] > 1e-3
    assert np.abs(rubbing["bogie_r"]).max() < np.abs(free["bogie_r"]).max()
