"""The plain contact law near rest: its derivatives are compared with differences, and backward travel with the mirror
image.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from rover_pin import Model, Motor, Soil, load_rover
from rover_pin.base.errors import ParameterError
from rover_pin.effects.digging_memory import DiggingMemory
from rover_pin.effects.multi_pass import MultiPass
from rover_pin.effects.slip import RelaxedSlip
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.simulation.compiled.kernel import DIRECTION_SPEED
from rover_pin.simulation.compiled.laws import number_of_states, numbers
from rover_pin.simulation.model.model import base_effects
from rover_pin.simulation.plain.law import TRAVEL_SIGNS, PlainLaw
from rover_pin.terrain import shapes

ROVER, SOIL = load_rover(), Soil(k=0.004)


@pytest.fixture(scope="module")
def law():
    model = Model(ROVER, shapes.flat(), (SOIL,), Motor(), RelaxedSlip(), base_effects(SOIL, ROVER, SoilTraction()))
    return PlainLaw(model.having(MultiPass()).having(DiggingMemory(c_d=0.05)))


def contact(v, rim, axle=0.0):
    """Return the contact of a wheel that is 4 mm deep, sinks and moves sideways, on one of three axles."""
    return np.array([0.004, v, -0.3 * v + 1e-3, 2e-3, rim, 0.7, axle, *numbers([ROVER.wheel, SOIL])])


def states(law, seed=0):
    return np.random.default_rng(seed).uniform(0.02, 0.2, len(law.odd))


MOVING = [(share, rim) for share in (-1.3, -0.9, -0.4, 0.0, 0.3, 0.8, 1.2) for rim in (0.5, -0.9)]
"""Of the speed at which it has a direction: of travel, and of the rim."""


@pytest.mark.parametrize(("v", "rim"), MOVING)
def test_slopes_are_those_of_load_and_rate(law, v, rim):
    """The derivatives are right for both directions, near rest and where the direction of travel is decided. The
    direction follows from travel speed and rim speed.
    """
    contact_at, x, step = (
        contact(v * DIRECTION_SPEED, rim * DIRECTION_SPEED, axle=1.0),
        states(law),
        1e-4 * DIRECTION_SPEED,
    )
    value = law(contact_at, x)
    for at in range(4):
        ends = []
        for sign in (1.0, -1.0):
            duplicate = contact_at.copy()
            duplicate[1 + at] += sign * step
            ends.append(law(duplicate, x))
        for slope, part in ((value.by_speed, "load"), (value.rate_by_speed, "rate")):
            difference = (getattr(ends[0], part) - getattr(ends[1], part)) / (2.0 * step)
            scale = np.abs(slope).max()
            np.testing.assert_allclose(slope[:, at], difference, rtol=2e-4, atol=1e-6 * scale)
    for at in range(len(x)):
        ends = [law(contact_at, x + sign * 1e-6 * np.eye(len(x))[at]) for sign in (1.0, -1.0)]
        for slope, part in ((value.load_by_state, "load"), (value.rate_by_state, "rate")):
            difference = (getattr(ends[0], part) - getattr(ends[1], part)) / 2e-6
            np.testing.assert_allclose(slope[:, at], difference, rtol=1e-5, atol=1e-6 * max(1.0, np.abs(slope).max()))


@pytest.mark.parametrize(("v", "rim"), MOVING)
def test_a_wheel_that_goes_the_other_way_is_its_mirror_image(law, v, rim):
    """In the mirror image the last axle is the first. All forces except the normal force, and all odd states, change
    their sign.
    """
    ahead, behind = (contact(sign * v * DIRECTION_SPEED, sign * rim * DIRECTION_SPEED) for sign in (1.0, -1.0))
    behind[2], behind[6] = -ahead[2], 2.0
    x, sign, odd = states(law), TRAVEL_SIGNS, law.odd
    forward, backward = law(ahead, x), law(behind, odd * x)
    expected = {
        "load": sign * forward.load, "rate": odd * forward.rate, "slip": -forward.slip,
        "by_speed": np.outer(sign, sign) * forward.by_speed,
        "rate_by_speed": np.outer(odd, sign) * forward.rate_by_speed,
        "load_by_state": np.outer(sign, odd) * forward.load_by_state,
        "rate_by_state": np.outer(odd, odd) * forward.rate_by_state,
    }  # fmt: skip
    for name, wanted in expected.items():
        np.testing.assert_allclose(getattr(backward, name), wanted, rtol=1e-9, atol=1e-9, err_msg=name)


def test_a_wheel_has_eight_states_at_most():
    states = [SimpleNamespace(states=(SimpleNamespace(name=f"s_{at}"),)) for at in range(9)]
    assert number_of_states(states[:8]) == 8
    with pytest.raises(ParameterError, match=r"9.*\(s_0, .*, s_8\);.*8"):
        number_of_states(states)
