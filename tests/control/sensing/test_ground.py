"""What the compiled expression says of the ground, against Pinocchio's own statics and finite differences."""

import numpy as np
import pytest

from rover_pin.control.sensing.ground import UnderWheels, ground_law
from rover_pin.rover.driven_loads import configuration, footing, loads_on, turning
from rover_pin.rover.wheel_base import wheel_mounts
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.failure import suspension_of

STEP = 1e-5


@pytest.mark.parametrize(("rover", "off"), [("nexus6", 1e-6), ("cart", 2e-4)])
def test_slopes_loads_and_rates_are_those_of_the_posture(rover, off):
    """On four wheels statics leave a load open: there the least of the solutions is approached to 0.1 mN."""
    model = scenario("flat", rover=rover).model
    places, wheels, chance = suspension_of(model).places, len(model.rover.wheels), np.random.default_rng(3)
    law = ground_law(model.built, places)

    def configured(posture):
        q = configuration(model.built, (posture[0], posture[1], 0.0), {})
        q[places] = posture[2:]
        return q

    for _ in range(5):
        posture = chance.uniform(-0.2, 0.2, 2 + len(places))
        rates, torque = chance.uniform(-0.1, 0.1, posture.size), chance.uniform(0.0, 0.15, wheels)
        under = UnderWheels(*np.array(law(posture, rates, torque)).reshape(-1, wheels))
        foot, jacobians = footing(model.built, configured(posture))
        level = np.hypot(foot.forward[:, 0], foot.forward[:, 1])
        assert under.level == pytest.approx(level)
        assert under.slope == pytest.approx(foot.forward[:, 2] / level)
        assert under.load == pytest.approx(loads_on(model.built, configured(posture), torque, foot, jacobians), abs=off)
        (before, there), (after, here) = (
            wheel_mounts(model.built, configured(posture + sign * STEP * rates)) for sign in (-1.0, 1.0)
        )
        speed = (here - there) / (2.0 * STEP)
        assert under.ahead == pytest.approx(speed[:, 0], abs=1e-8)
        assert under.rise == pytest.approx(speed[:, 2], abs=1e-8)
        assert under.swing == pytest.approx(turning([before, after], foot.left)[1] / (2.0 * STEP), abs=1e-8)
        assert under.height == pytest.approx(wheel_mounts(model.built, configured(posture))[1][:, 2])
