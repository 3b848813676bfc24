"""The torque limit's loads, the torque that a contact law asks at a slip, and Eq (9)'s table of the model driven."""

import numpy as np
import pytest

from rover_pin import scenario, simulate
from rover_pin.base.errors import ParameterError
from rover_pin.control.slip_estimate import TableEstimate, flat_table
from rover_pin.control.torque_bounds import TorqueBounds
from rover_pin.control.torque_check import LOST_SLIP, TorqueLimit
from rover_pin.control.torque_factor import torque_factors
from rover_pin.effects.post_peak import PostPeak
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.rover.driven_loads import configuration, driven_loads, footing
from rover_pin.rover.statics import wheel_loads
from rover_pin.simulation.command import Command
from rover_pin.simulation.state import suspension_places

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
        self.places = suspension_places(model.rover)
        self.errors = []

    def __call__(self, reading):
        motor = self.model.motor
        q = configuration(self.rover, reading.attitude, {})
        q[self.places] = reading.suspension
        by_links = driven_loads(self.rover, q, float(motor.constant) * reading.current, *footing(self.rover, q))
        by_pitch = wheel_loads(self.rover, -reading.attitude[1], gravity=self.model.gravity)
        normal = np.where(reading.truth.normal > 0.2, reading.truth.normal, np.nan)
        self.errors.append([estimate / normal - 1.0 for estimate in (by_pitch, by_links)])
        most = self.bounds(np.maximum(by_links, 0.0)).limit / float(motor.stall_torque)
        return Command(np.clip(most + reading.wheel_rate / float(motor.no_load_rate), 0.0, 0.55))


@pytest.mark.parametrize(
    "name", ["incline", *(pytest.param(drive, marks=pytest.mark.slow) for drive in DRIVES if drive != "incline")]
)
def test_loads_at_the_pitch_err_as_stated_with_the_same_outcome(name):
    scene, settings, expected = DRIVES[name]
    drive = scenario(scene, soil="table-1", control="limit", duration=20.0, **settings)
    by_pitch, by_links = drive.drive(), ByLinks(drive.model)
    trace = simulate(drive.model, by_links, 20.0, drive.start, drive.timing, symmetric=drive.symmetric)
    off = np.sqrt(np.nanmean(np.square(by_links.errors[SETTLED:]), axis=(0, 2)))
    assert off == pytest.approx(expected, rel=0.15, abs=0.005)
    first, second = (driven.attrs["outcome"].split(" ")[0] for driven in (by_pitch, trace))
    assert first == second
    assert trace["body_x"][-1] == pytest.approx(by_pitch["body_x"][-1], abs=0.12)


def test_beyond_forty_degrees_the_limit_is_that_of_forty():
    limit = TorqueLimit.at_slip(scenario("flat").model)
    for sign in (1.0, -1.0):
        ends = [limit.torque(sign * np.radians(degrees)) for degrees in (39.0, 40.0, 42.0, 60.0)]
        np.testing.assert_array_equal(ends[1], ends[2])
        np.testing.assert_array_equal(ends[1], ends[3])
        assert np.any(ends[0] != ends[1])


SLIPS = np.linspace(-1.0, 1.0, 9)


def factors(**settings):
    return torque_factors(scenario("flat", **settings).model, SLIPS)


def test_a_loss_past_the_peak_is_taken_off():
    lost = 0.4 * (1.0 - np.exp(-((SLIPS / float(PostPeak().S_w)) ** 2)))
    weakened = factors(add="PostPeak.fraction=0.4", **{"soil.k": 0.005})
    assert weakened == pytest.approx((1.0 - lost) * factors(**{"soil.k": 0.005}), abs=1e-12)


def test_a_hole_not_yet_dug_and_a_patch_elsewhere_change_nothing():
    plain = factors()
    assert factors(add="DiggingMemory") == pytest.approx(plain, abs=1e-12)
    assert factors(add="HardPatch.x_from=0.5,length=0.3,g=1") == pytest.approx(plain, abs=1e-9)


def test_a_measured_drive_has_it():
    """On the flat the logged torque over r f_n of a settled wheel is the factor at its logged slip."""
    scene = scenario("incline", duration=8.0, **{"soil.k": 0.01, "terrain.start": -5.0, "add": "PostPeak.fraction=0.3"})
    trace = scene.drive()
    radius, motor = float(scene.model.rover.wheel.r), float(scene.model.motor.constant)
    for wheel in ("fl", "ml", "rr"):
        (expected,) = torque_factors(scene.model, [trace[f"slip_{wheel}"][-1]])
        torque = motor * trace[f"current_{wheel}_A"][-1]
        assert torque / (radius * trace[f"normal_{wheel}"][-1]) == pytest.approx(expected, rel=0.02)


def test_eq_9s_table_is_that_of_the_driven_model():
    plain, moon, firm = (
        scenario("flat", soil="table-1", **changes).model for changes in ({}, {"gravity": "moon"}, {"soil.k": 0.005})
    )
    speeds = [float(flat_table(model).speed_at(np.array(0.55))) for model in (plain, moon, firm)]
    assert speeds[0] == pytest.approx(0.05, abs=1e-3)
    assert speeds[1] > speeds[0] + 5e-4
    assert speeds[2] < speeds[0] - 3e-3  # firmer sand resists more
    assert flat_table(scenario("slope", soil="table-1").model) is flat_table(plain)
    for name, model in (("moon", moon), ("table-1", plain)):
        drive = scenario("slope", soil="table-1", control="eq9", **({"gravity": "moon"} if name == "moon" else {}))
        assert isinstance(drive.controller.estimate, TableEstimate)
        assert drive.controller.estimate.table == flat_table(model)


def test_a_model_without_a_table_is_refused():
    """In the net form the rover does not move on its own flat ground."""
    with pytest.raises(ParameterError, match=r"\(9\).*ground"):
        scenario("slope", soil="table-1", control="eq9", form="net")
