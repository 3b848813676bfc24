"""The torque limit's loads: how far those at the body's pitch are off, and what link angles would change of a drive."""

import numpy as np
import pytest

from rover_pin.control.torque_bounds import TorqueBounds
from rover_pin.control.torque_check import LOST_SLIP, TorqueLimit
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.rover.driven_loads import configuration, driven_loads
from rover_pin.rover.statics import wheel_loads
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.command import Command
from rover_pin.simulation.failure import suspension_of
from rover_pin.simulation.simulate import simulate

DRIVES = {
    "hills": ("hills", {}, (0.10, 0.01)),
    "incline": ("incline", {"terrain.angle_deg": 8.0, "soil.k": 0.01}, (0.07, 0.01)),
    "one-sided bump": ("one-sided-bump", {}, (0.05, 0.03)),
    "ditch": ("ditch", {}, (0.26, 0.38)),
    "ditch, passed": ("ditch", {"soil.k": 0.01, "effect.MotionResistance.R": 0.028}, (0.29, 0.34)),
}
SETTLED = 4
"""Controls after which a drive is no longer starting."""


class ByLinks:
    """The limit at a slip with loads from attitude, link angles and torques, as section 4 has them."""

    def __init__(self, model):
        self.model, self.rover = model, model.rover.under(model.gravity)
        wheels = [mount.wheel for mount in model.rover.wheels]
        self.bounds = TorqueBounds(wheels, model.soils[0], LOST_SLIP, model.effect(SoilTraction).angles)
        self.places = suspension_of(model).places
        self.errors = []

    def __call__(self, reading):
        motor = self.model.motor
        q = configuration(self.rover, reading.attitude, {})
        q[self.places] = reading.suspension
        by_links = driven_loads(self.rover, q, float(motor.constant) * reading.current)
        by_pitch = wheel_loads(self.rover, -reading.attitude[1], gravity=self.model.gravity)
        normal = np.where(reading.truth.normal > 0.2, reading.truth.normal, np.nan)
        self.errors.append([each / normal - 1.0 for each in (by_pitch, by_links)])
        most = self.bounds(np.maximum(by_links, 0.0)).limit / float(motor.stall_torque)
        return Command(np.clip(most + reading.wheel_rate / float(motor.no_load_rate), 0.0, 0.55))


@pytest.mark.parametrize(
    "name", ["incline", *(pytest.param(each, marks=pytest.mark.slow) for each in DRIVES if each != "incline")]
)
def test_loads_at_the_pitch_err_as_stated_with_the_same_outcome(name):
    scene, settings, expected = DRIVES[name]
    drive = scenario(scene, soil="table-1", control="limit", duration=20.0, **settings)
    by_pitch, by_links = drive.drive(), ByLinks(drive.model)
    other = simulate(drive.model, by_links, 20.0, drive.start, drive.timing, symmetric=drive.symmetric)
    off = np.sqrt(np.nanmean(np.square(by_links.errors[SETTLED:]), axis=(0, 2)))
    assert off == pytest.approx(expected, rel=0.15, abs=0.005)
    first, second = (each.attrs["happened"].split(" ")[0] for each in (by_pitch, other))
    assert first == second
    assert other["body_x"][-1] == pytest.approx(by_pitch["body_x"][-1], abs=0.12)


def test_beyond_forty_degrees_the_limit_is_that_of_forty():
    limit = TorqueLimit.at_slip(scenario("flat").model)
    for sign in (1.0, -1.0):
        ends = [limit.torque(sign * np.radians(degrees)) for degrees in (39.0, 40.0, 42.0, 60.0)]
        np.testing.assert_array_equal(ends[1], ends[2])
        np.testing.assert_array_equal(ends[1], ends[3])
        assert np.any(ends[0] != ends[1])
