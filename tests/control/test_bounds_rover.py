"""The bounds of a rover on a slope, the pulls they buy, and the slopes that these hold."""

import json
import math

import numpy as np
import pytest
from scipy.optimize import brentq

from rover_pin.base.errors import ParameterError
from rover_pin.cli.app import app
from rover_pin.contact import Wheel
from rover_pin.control.bound_pull import TractionLimit, pull_at_bounds
from rover_pin.control.rover_bounds import bounds_report, bounds_table, climbable_slope, rover_torque_bounds
from rover_pin.control.torque_bounds import torque_bounds
from rover_pin.parameters import SOILS
from rover_pin.rover.rover import load_rover
from rover_pin.rover.statics import wheel_loads
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.model.motor import Motor
from rover_pin.soil.angles import FixedAngles
from rover_pin.soil.sinkage import entry_angle
from rover_pin.soil.traction import (
    FORMS,
    GrossTraction,
    NetTraction,
    TorqueTraction,
    load_traction_factor,
    wheel_forces,
)

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


def test_less_gravity_means_smaller_bounds():
    earth, moon = (rover_torque_bounds(ROVER, SAND, gravity=g) for g in (9.81, 1.62))
    assert np.all(moon.limit < earth.limit * 1.62 / 9.81)


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_the_pull_at_the_limit_is_the_forms_factor_at_that_slip(form):
    limit = TractionLimit(0.3, form)
    pull = pull_at_bounds(9.48, SAND, WHEEL, limit).limit
    theta_1 = entry_angle(9.48, 0.3, WHEEL, SAND)
    at = wheel_forces(0.3, theta_1, -SAND.exit_ratio * theta_1, WHEEL, SAND, 40)
    assert pull.factor == pytest.approx(form.factor(at, WHEEL, 0.3), rel=1e-8)
    assert (pull.force, pull.slope) == pytest.approx((9.48 * pull.factor, math.atan(pull.factor)))
    fixed = pull_at_bounds(9.48, SAND, WHEEL, TractionLimit(0.3, form, FixedAngles())).limit
    assert fixed.factor == pytest.approx(load_traction_factor(0.3, SAND, WHEEL, form), rel=1e-7)


@pytest.mark.parametrize("which", ["saturation", "limit"])
def test_one_torque_buys_different_pulls(which):
    """All forms share the torque; the net pull is the gross one without compaction, the torque's own is T / r."""
    net, torque, gross = (
        getattr(pull_at_bounds(9.48, SAND, WHEEL, TractionLimit(0.3, form)), which)
        for form in (NetTraction(), TorqueTraction(), GrossTraction())
    )
    assert net.force < gross.force < torque.force
    bound = getattr(torque_bounds(9.48, SAND, WHEEL, 0.3), which)
    assert torque.force * WHEEL.r == pytest.approx(bound, rel=1e-8)


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


def test_slopes_beyond_the_search_end_at_its_ends(monkeypatch):
    firm = SAND.replace(phi=55 * DEG, k=1e-4)
    assert climbable_slope(ROVER, firm, TractionLimit(1.0, TorqueTraction())) == pytest.approx((40 * DEG, 40 * DEG))
    monkeypatch.setattr("rover_pin.control.rover_bounds.STEEPEST", DEG)
    assert climbable_slope(ROVER, SOILS["table-1"]) == pytest.approx((DEG, -DEG))


def test_rows_and_table_tell_the_margin_of_a_motor():
    motor = Motor()
    bounds = rover_torque_bounds(ROVER, SAND, 10 * DEG)
    rows = bounds.rows(motor)
    assert [row["wheel"] for row in rows] == ["fl", "fr", "ml", "mr", "rl", "rr"]
    for row in rows:
        assert row["margin_lim"] * row["T_lim_Nm"] == pytest.approx(motor.stall_torque)
        assert row["margin_sat"] < row["margin_lim"]
        assert row["duty_lim"] == pytest.approx(1.0 / row["margin_lim"])
    assert {row["wheel"] for row in rows if row["slips_first"]} == set(bounds.first_to_slip)
    json.dumps(rows)
    lines = bounds_table(bounds, motor).splitlines()
    assert len(lines) == 7
    assert "stall/T_lim" in lines[0]
    assert f"{1e3 * bounds.limit[0]:.1f}" in lines[1]
    assert sum("slips first" in line for line in lines) == len(bounds.first_to_slip)
    assert "stall" not in bounds_table(bounds)


def test_the_report_holds_plain_values():
    report = json.loads(json.dumps(bounds_report(ROVER, SAND, 10 * DEG, 3.71, TractionLimit(0.3), Motor())))
    _, slipping = climbable_slope(ROVER, SAND, TractionLimit(0.3), 3.71)
    assert report["climbable_at_slip_limit_deg"] == pytest.approx(slipping / DEG)
    assert report["climbable_deg"] > report["climbable_at_slip_limit_deg"]
    assert report["wheels"] == rover_torque_bounds(ROVER, SAND, 10 * DEG, 0.0, 3.71, TractionLimit(0.3)).rows(Motor())
    assert (report["slope_deg"], report["form"], report["first_to_slip"]) == (pytest.approx(10.0), "net", ["ml", "mr"])


def test_a_slope_on_which_a_wheel_lifts_is_refused_by_name():
    lift = float(brentq(lambda slope: np.min(wheel_loads(ROVER, slope)), 0.0, 1.2))
    rover_torque_bounds(ROVER, SAND, lift - 0.01)
    with pytest.raises(ParameterError, match=r"50.*-.*gentler"):
        rover_torque_bounds(ROVER, SAND, 50 * DEG)


def test_what_makes_no_bound_is_refused():
    with pytest.raises(ParameterError, match="slope"):
        rover_torque_bounds(ROVER, SAND, math.nan)
    with pytest.raises(ParameterError, match="slip_limit = 2"):
        rover_torque_bounds(ROVER, SAND, limit=TractionLimit(2.0))
    with pytest.raises(ParameterError, match="gravity"):
        rover_torque_bounds(ROVER, SAND, gravity=-1.0)


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
