"""A tether: the force by hand, its work, nothing at rest."""

import pytest

from rover_pin.control.constant import ConstantDuty
from rover_pin.effects.effect import Body
from rover_pin.effects.tether_drag import TetherDrag
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.simulate import simulate

FLAT = scenario("flat").model


def test_the_force_by_hand():
    effect = TetherDrag(f_0=0.5, f_1=0.2, x_0=1.0, y_0=2.0, v_0=1e-5)
    body = Body(4.0, 6.0, *[0.0] * 10, (), (), ())._replace(v_x=0.03, v_y=-0.04)
    push = effect.push(body)
    assert (float(push.f_x), float(push.f_y)) == pytest.approx((-1.5 * 0.6, 1.5 * 0.8), rel=1e-5)
    assert push[2:] == (0.0,) * 4 + ((), 0.0)
    still = effect.push(body._replace(v_x=0.0, v_y=0.0))
    assert (float(still.f_x), float(still.f_y)) == (0.0, 0.0)


@pytest.mark.parametrize("duty", [0.55, -0.55])
def test_what_it_takes_is_force_times_way(duty):
    """A constant pull on the straight; a growing one, int (f_0 + f_1 s) ds."""
    trace = simulate(FLAT.having(TetherDrag(f_0=1.0, f_1=0.5, v_0=1e-4)), ConstantDuty(duty), 10.0)
    way = abs(trace["body_x"][-1])
    assert way > 0.3
    assert trace["energy_body"][-1] == pytest.approx(1.0 * way + 0.25 * way**2, rel=0.01)
