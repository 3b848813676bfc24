"""Routes: to the end and near the line, the same compiled and asked, mirrored, in the order of the waypoints."""

import math

import numpy as np
import pytest

from rover_pin import RoverPinError, scenario, simulate
from rover_pin.control.motion.route import RouteControl, read_route
from rover_pin.rover.wheel_base import base_of
from rover_pin.simulation.command import Reading, Truth


def drive(rover, route, **more):
    case = scenario("flat", rover=rover, control="route", **{"control.route": route, **more})
    return case, case.drive(measure_error=False)


def off_line(trace, points):
    """Distance [m] of each place driven from the route, by its pieces sampled every millimetre."""
    pieces = [np.linspace(a, b, int(1e3 * math.dist(a, b)) + 2) for a, b in zip(points[:-1], points[1:], strict=True)]
    line, places = np.vstack(pieces), np.column_stack([trace["body_x"], trace["body_y"]])[::10]
    return np.array([np.min(np.hypot(*(line - place).T)) for place in places])


@pytest.mark.parametrize(("rover", "route"), [("nexus6", "1,0 1.5,0.5"), ("cart", "2,0 3,1")])
def test_it_comes_to_the_end_near_the_line(rover, route):
    case, trace = drive(rover, route)
    end = np.array([trace["body_x"][-1], trace["body_y"][-1]])
    assert trace.attrs["warnings"] == []
    assert trace.attrs["outcome"].startswith("held still since")
    assert math.dist(end, case.controller.points[-1]) < 2.0 * case.controller.reach
    assert np.max(off_line(trace, case.controller.points)) < 0.2 * case.controller.lookahead


@pytest.mark.parametrize("slope", [12.0, -12.0])
def test_it_is_held_at_the_end_on_a_slope(slope):
    """Motors without duty would let it creep down by 150 to 300 mm."""
    words = {"control.route": "1.5,0", "terrain.angle_deg": slope, "terrain.start": -2.0}
    trace = scenario("incline", rover="cart", control="route", **words).drive(measure_error=False)
    since = trace.attrs["stands_since"]
    assert 20.0 < since < 0.6 * trace.t[-1]
    after = trace["body_x"][trace.t > since + 5.0]
    assert np.ptp(after) < 1e-3
    assert trace.attrs["outcome"].startswith("held still since")


def test_it_is_the_same_asked_as_compiled():
    case = scenario("flat", rover="cart", control="route", **{"control.route": "1,0.5 1,1"})
    compiled = simulate(case.model, case.controller, 8.0, measure_error=False)
    remembered = case.controller.memory.copy()
    case.controller.reset()
    trace = simulate(case.model, lambda reading: case.controller(reading), 8.0, measure_error=False)
    for channel in compiled.channels:
        assert compiled[channel].tobytes() == trace[channel].tobytes(), channel
    assert np.array_equal(remembered, case.controller.memory)
    assert remembered[0] > 0.3


def rolled(control, rover, place, yaw, steps):
    """Where a rover without mass or slip goes that follows the rims of its sides, sample after sample; (steps, 2)."""
    r, track = float(rover.radii[0]), control.track
    left = np.array([wheel.side == "l" for wheel in rover.wheels])
    rates, places = np.zeros(len(left)), [np.array(place)]
    for step in range(steps):
        blank = np.zeros(len(left))
        truth = Truth(blank, blank, blank, blank, np.array([*places[-1], 0.0]), np.zeros(3))
        duty = control(Reading(0.05 * step, blank, rates, blank, np.zeros(0), (0.0, 0.0, yaw), truth)).duty
        rates = float(control.motor.no_load_rate) * duty
        slow, fast = (r * float(np.mean(rates[side])) for side in (left, ~left))
        yaw += 0.05 * (fast - slow) / track
        places.append(places[-1] + 0.025 * (slow + fast) * np.array([math.cos(yaw), math.sin(yaw)]))
    return np.array(places)


def control_of(points, **more):
    model = scenario("flat", rover="cart").model
    settings = {"speed": 0.07, "lookahead": 1.0, "track": base_of(model.rover).track, **more}
    return RouteControl.of(model.rover, model.motor, np.array(points, dtype=float), **settings), model.rover


@pytest.mark.slow
def test_a_route_that_crosses_itself_is_driven_in_order():
    """A figure of eight passes its middle twice; each way-point is met after the one before."""
    points = [(0, 0), (4, 4), (4, 0), (0, 4), (0, 8)]
    control, rover = control_of(points)
    places = rolled(control, rover, (0.0, 0.0), 0.7, 8000)
    met = [int(np.argmin(np.hypot(*(places - point).T))) for point in points]
    assert met == sorted(met)
    assert all(math.dist(places[at], point) < 0.5 for at, point in zip(met, points, strict=True))
    assert control.memory[0] == pytest.approx(control.starts[-1], abs=control.reach)


def test_files_and_words_are_read(tmp_path):
    (tmp_path / "way.csv").write_text("x_m,y_m\n1,0\n2,0.5\n")
    for text in ("1,0 2,0.5", str(tmp_path / "way.csv")):
        assert read_route(text, (0.0, 0.5)) == pytest.approx(np.array([[0.0, 0.5], [1.0, 0.0], [2.0, 0.5]]))


@pytest.mark.parametrize(("text", "named"), [("1,0 2", "control.route"), ("1,a", "control.route"), ("no.csv", "no.csv"),
                                             ("0,0", "waypoints")])  # fmt: skip
def test_what_is_no_route_is_refused(text, named):
    with pytest.raises(RoverPinError, match=named):
        scenario("flat", rover="cart", control="route", **{"control.route": text})
