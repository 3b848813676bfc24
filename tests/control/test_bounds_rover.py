"""The bounds of a rover on a slope, the pulls they buy, and the slopes that these hold."""

import json
import math

import numpy as np
import pytest
from scipy.optimize import brentq

from rover_pin.base.errors import ParameterError
from rover_pin.cli.app import app
from rover_pin.contact import Wheel
from rover_pin.control.bound_pull import TractionLimit
from rover_pin.control.rover_bounds import climbable_slope, rover_torque_bounds
from rover_pin.control.torque_bounds import torque_bounds
from rover_pin.parameters import SOILS
from rover_pin.rover.rover import load_rover
from rover_pin.rover.statics import wheel_loads
from rover_pin.scenarios.scenario import scenario
from rover_pin.soil.angles import FixedAngles
from rover_pin.soil.traction import FORMS, TorqueTraction, load_traction_factor

ROVER, WHEEL, DEG = load_rover(), Wheel(), math.pi / 180.0
SAND = SOILS["literature-sand"].replace(k=0.005)


@pytest.mark.parametrize("slope", [0.0, 12 * DEG, -8 * DEG])
def test_each_wheel_is_bounded_at_its_own_static_load(slope):
    found = rover_torque_bounds(ROVER, SAND, slope)
    loads = wheel_loads(ROVER, slope)
    assert found.load == pytest.approx(loads)
    assert np.sum(found.load) == pytest.approx(ROVER.mass * 9.81 * math.cos(slope))
    for i, load in enumerate(loads):
        assert (found.saturation[i], found.limit[i]) == pytest.approx(
            torque_bounds(float(load), SAND, WHEEL), rel=1e-12
        )


def test_load_transfer_raises_the_bound_light_wheels_slip_first():
    flat, steep = rover_torque_bounds(ROVER, SAND), rover_torque_bounds(ROVER, SAND, 15 * DEG)
    rear = [steep.names.index(name) for name in ("rl", "rr")]
    assert np.all(steep.limit[rear] > 1.2 * flat.limit[rear])
    least = {steep.names[i] for i in np.flatnonzero(steep.load < steep.load.min() + 1e-9)}
    assert set(steep.first_to_slip) == least
    assert least.isdisjoint({"rl", "rr"})


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_the_climbable_slope_balances_the_weight(form):
    limit = TractionLimit(0.2, form)
    full, slipping = climbable_slope(ROVER, SAND, limit)
    assert slipping < full
    for slope, which in ((full, "pull_saturation"), (slipping, "pull_limit")):
        pull = getattr(rover_torque_bounds(ROVER, SAND, slope, limit=limit), which)
        assert np.sum(pull) == pytest.approx(ROVER.mass * 9.81 * math.sin(slope), rel=1e-6)


def test_every_wheel_climbs_its_factor_angle_with_fixed_angles():
    limit = TractionLimit(0.2, TorqueTraction(), FixedAngles())
    factor = load_traction_factor(0.2, SAND, WHEEL, TorqueTraction())
    assert climbable_slope(ROVER, SAND, limit)[1] == pytest.approx(math.atan(factor), rel=1e-6)


def test_a_slope_on_which_a_wheel_lifts_is_refused_by_name():
    lift = float(brentq(lambda slope: np.min(wheel_loads(ROVER, slope)), 0.0, 1.2))
    rover_torque_bounds(ROVER, SAND, lift - 0.01)
    with pytest.raises(ParameterError, match=r"50.*-.*gentler"):
        rover_torque_bounds(ROVER, SAND, 50 * DEG)


@pytest.mark.parametrize(
    "settings",
    [{"soil": "table-1"}, {"soil": "hit-lss1", "gravity": "mars"}, {"rover": "cart", "soil": "table-1"},
     {"soil": "lunar-nominal", "form": "gross"}],
    ids=str,
)  # fmt: skip
def test_the_slope_that_the_command_says_is_what_drives_climb(settings, capsys):
    """Within 0.7 deg, at full duty from a start on the slope."""
    options = [word for name, value in settings.items() for word in (f"--{name}", value)]
    with pytest.raises(SystemExit) as ended:
        app(["bounds", *options, "--json"])
    assert ended.value.code == 0
    climbable = json.loads(capsys.readouterr().out)["climbable_deg"]

    def share(slope):
        """The share of what the wheels turn that the rover travels at the end."""
        steep = {"terrain.angle_deg": slope, "terrain.start": -9.0, "control.delta": 1.0}
        trace = scenario("incline", duration=15.0, **settings, **steep).drive(measure_error=False)
        return 1.0 - np.mean(trace.stack("slip")[-1])

    assert share(climbable - 0.7) > 0.01
    assert share(climbable + 0.7) < 0.01
