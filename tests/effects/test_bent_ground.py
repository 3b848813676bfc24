"""A bent ground: its height by quadrature, what it leaves alone, and drives over it as over that ground declared."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from rover_pin import ConstantDuty, scenario, simulate
from rover_pin.base.errors import ParameterError
from rover_pin.effects.bent_ground import BentGround
from rover_pin.simulation.model.toml_file import read_model, write_model
from rover_pin.simulation.replay import commands, replay
from rover_pin.simulation.start import Start, settled_state, shared_rest, taken_over
from rover_pin.simulation.state import roll_pitch_yaw
from rover_pin.terrain import shapes
from rover_pin.terrain.edits import bend_terrain
from rover_pin.terrain.terrain import HeightGrid, Lanes, Profile

FLAT = scenario("flat").model
SLOPES = (0.03, -0.02, 0.05, 0.0, -0.04)
BEND = BentGround(*SLOPES, x_from=-0.2, length=1.2)
KNOTS = np.linspace(-0.2, 1.0, 7)
CHORD = 0.07 * 1.2 / 3072
"""What a chord leaves of the parabola between two knots whose slopes differ most [m]."""


def rise(x):
    """The height at x by quadrature of the slope, straight between the knots."""
    tan = np.tan([0.0, *SLOPES, 0.0])
    stops = [knot for knot in KNOTS if -0.2 < knot < x]
    return quad(lambda at: np.interp(at, KNOTS, tan, 0.0, 0.0), -0.2, x, points=stops or None)[0] if x > -0.2 else 0.0


@pytest.mark.parametrize("ground", [shapes.flat(), HeightGrid(-3.0, -2.0, 0.5, 1.0, np.zeros((13, 5)))])
def test_the_rise_is_the_integral_of_the_slope(ground):
    bent = FLAT.replace(terrain=ground).having(BEND).ground
    for x in (-1.0, -0.2, 0.0, 0.13, 0.41, 0.8, 1.0, 2.5):
        assert bent.height(x, 0.3) == pytest.approx(rise(x), abs=CHORD if isinstance(ground, Lanes) else 4 * CHORD)
    assert bent.gradient(0.4, 0.0)[0] == pytest.approx(math.tan(0.05), abs=0.07 / 16)
    assert bent.gradient(-0.7, 0.0)[0] == bent.gradient(1.6, 0.0)[0] == 0.0


def test_what_lies_on_the_ground_is_lifted_and_keeps_its_soil():
    """Lips and soils stay where they are: only the height differs, by the same at every y."""
    lanes = Lanes(
        (Profile([-1.0, 0.3, 0.302, 2.0], [0.0, 0.0, -0.05, -0.05], [0, 1, 2]), Profile([0, 1], [0, 0.2])), (0.0,)
    )
    grid = HeightGrid(-1.0, -1.0, 0.6, 1.0, np.outer(np.arange(4.0), [0.1, 0.2, 0.0]), np.arange(6).reshape(3, 2))
    x = np.linspace(-0.99, 0.75, 177)
    for ground in (lanes, grid):
        bent = bend_terrain(ground, *BEND.bend())
        for y in (-0.5, 0.5):
            assert bent.ground_at(x, y) == pytest.approx(ground.ground_at(x, y))
            wanted = ground.height(x, y) + np.array([rise(float(place)) for place in x])
            assert bent.height(x, y) == pytest.approx(wanted, abs=4 * CHORD if ground is grid else CHORD)


@pytest.mark.parametrize(("dx", "lines"), [(0.1, 21), (0.25, 17), (0.5, 17)])
def test_grid_gets_no_more_lines_than_the_closest_bend_needs(dx, lines):
    """0.125 m apart at their closest: none between lines 0.1 m apart, one between 0.25, three between 0.5 m."""
    places, lift = [3.0, 3.5, 3.625, 4.0], [0.0, 0.01, 0.02, 0.03]
    terrain = bend_terrain(HeightGrid(2.5, -1.0, dx, 2.0, np.zeros((round(2.0 / dx) + 1, 2))), places, lift)
    assert terrain.z.shape == (lines, 2)
    assert terrain.height(4.2, 0.0) == pytest.approx(0.03)


def test_a_drive_over_it_is_one_over_the_same_ground_declared():
    x = np.linspace(-0.2, 1.0, 601)
    unchanged = FLAT.replace(terrain=Lanes((Profile(x, [rise(float(place)) for place in x]),)))
    there, back = (
        [simulate(model, ConstantDuty(0.6), 8.0, Start(x=at, yaw=yaw)) for model in (FLAT.having(BEND), unchanged)]
        for at, yaw in ((0.1, 0.0), (0.7, math.pi))
    )
    for bended, declared in (there, back):
        for name in ("body_x", "body_z", "body_pitch", "slip_fl"):
            swing = np.ptp(declared[name])
            assert bended[name] == pytest.approx(declared[name], abs=0.02 * swing), name
    assert there[0]["body_z"][-1] - there[0]["body_z"][0] > 3e-3


def test_without_slopes_the_ground_is_the_declared_one(tmp_path):
    assert FLAT.having(BEND.replace(**BentGround.neutral)).ground is FLAT.terrain
    model = FLAT.having(BEND)
    again = read_model(write_model(model, tmp_path / "model.toml"), FLAT.terrain)
    assert again.terrain == FLAT.terrain
    assert again.ground == model.ground


def test_a_grid_far_larger_than_the_bend_is_refused():
    grid = HeightGrid(-1e4, -1.0, 1e4, 2.0, np.zeros((3, 2)))
    with pytest.raises(ParameterError, match=r"2400003.*20000"):
        bend_terrain(grid, *BEND.replace(length=0.4).bend())


@pytest.mark.parametrize("yaw", [0.0, 2.0, math.pi])
def test_a_shared_rest_stands_as_a_rover_set_down_on_a_bend(yaw):
    """It began where the declared ground was: a rise of 28 mm buried wheels at once, and no fit went past that."""
    start, rest_state = Start(0.5, 0.1, yaw), shared_rest(FLAT, Start(0.5, 0.1, yaw))
    climbing = FLAT.having(BentGround(0.04, 0.04, 0.04, 0.04, 0.04, x_from=-0.7, length=2.4))
    carried_over, settled = taken_over(climbing, rest_state), settled_state(climbing, start)
    assert settled.q[2] - rest_state.q[2] == pytest.approx(0.04, abs=0.002)
    assert np.hypot(*roll_pitch_yaw(settled.q)[:2]) == pytest.approx(0.04, abs=0.005)
    assert carried_over.q[:3] == pytest.approx(settled.q[:3], abs=3e-4)
    # A yaw of pi and one of -pi are the same; which one round-off gives differs between versions of NumPy.
    difference = np.array(roll_pitch_yaw(carried_over.q)) - roll_pitch_yaw(settled.q)
    assert np.angle(np.exp(1j * difference)) == pytest.approx(np.zeros(3), abs=2e-3)
    assert (taken_over(FLAT, rest_state).q == rest_state.q).all()


def test_a_replay_from_a_rest_on_level_ground_drives_on_the_bend():
    """But for the way by which sand shears that held it on the slope: under 1 mm."""
    climbing, start = FLAT.having(BentGround(0.04, 0.04, 0.04, 0.04, 0.04, x_from=-0.7, length=2.4)), Start(0.4)
    drive = simulate(climbing, ConstantDuty(0.6), 3.0, start)
    run = commands(drive, tuple(wheel.name for wheel in FLAT.rover.wheels), ("fl", "fr", "rl", "rr"))
    again = replay(climbing, run, rest_state=shared_rest(FLAT, start))
    assert not again.stop
    for name, off in {"body_x": 1e-3, "body_z": 1e-4, "body_pitch": 3e-4, "wheel_rate_ml": 5e-3}.items():
        assert again.channels[name][4:] == pytest.approx(drive[name][4:], abs=off), name
