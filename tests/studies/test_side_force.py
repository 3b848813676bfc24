"""Studies of the side force, of tacking and of a figure: the parts of each study agree with its stated result."""

import math

import numpy as np
import pytest
import side_force
from tune_gains import log_edges

from rover_pin import ConstantDuty, load_rover, scenario, simulate
from rover_pin.simulation.command import Reading
from studies.shared.tacking import Tacking, TackingControl


@pytest.fixture(scope="module")
def across():
    laws = ("old: SideShear", "new: combined shear, flank")
    return [side_force.row("across", name, side_force.driven("across", side_force.LAWS[name], 12.0)) for name in laws]


def test_across_a_slope_the_new_law_lets_the_rover_drift_less(across):
    drift = [row["travel_to_axis_deg"] for row in across]
    assert drift == pytest.approx([3.95, 2.97], abs=0.15)


def test_side_force_carries_the_slopes_share_of_the_weight(across):
    """In equilibrium sum f_y = m g sin 10 deg, which is 0.176 of the load; the middle wheel carries slightly more."""
    for row in across:
        assert row["side_over_load"] == pytest.approx(np.tan(np.radians(10.0)), rel=0.1)


def test_a_skid_on_sand_that_softens_digs_in_and_turns_less():
    """The speeds of the sides are held and turn the cart. On sand that slip and drift soften, the cart sinks to 48 mm
    and becomes slow.
    """
    firm, soft = (side_force.driven("skid", side_force.LAWS[name], 17.0) for name in list(side_force.LAWS)[-2:])
    late = soft.t > 12.0
    assert np.ptp(soft["body_yaw"][late]) < 0.5 * np.ptp(firm["body_yaw"][late])
    assert 1e3 * np.hypot(np.ptp(soft["body_x"][late]), np.ptp(soft["body_y"][late])) < 20.0, "it does not lurch"
    assert 1e3 * soft.stack("sinkage")[late].max() == pytest.approx(46.0, abs=4.0)


LAW = Tacking(calm=2.0, delta=0.5, delta_climb=0.8)


def reading(t, fold, yaw=0.0, pitch=0.0):
    """Return a reading without true values, because the controller must not use them."""
    return Reading(t, np.zeros(6), np.ones(6), np.ones(6), np.array([0.0, fold, 0.0, fold]), (0.0, pitch, yaw), None)


@pytest.fixture
def control():
    tacking_control = TackingControl(load_rover(), LAW)
    tacking_control.reset()
    return tacking_control


def test_folded_bogies_turn_it_to_one_side_and_then_to_the_other(control):
    first = control(reading(1.0, math.radians(8)))
    assert np.max(first.duty) == pytest.approx(0.8)
    assert first.steer[0] > 0.0
    assert control(reading(2.9, 0.0)).steer[0] > 0.0
    assert set(control(reading(3.1, 0.0)).duty) == {0.5}
    assert control(reading(5.0, math.radians(8))).steer[0] < 0.0


def test_it_leaves_a_ditch_in_which_constant_duty_stays():
    """At walls of 60 deg, the bogies' wheels stay at the wall at any duty. If they reach the wall one after the other,
    they climb it.
    """
    scene = scenario("ditch", **{"soil.k": 0.01, "terrain.wall_angle_deg": 60})
    straight = [simulate(scene.model, ConstantDuty(delta), 35.0, symmetric=True) for delta in (0.55, 1.0)]
    tacking = simulate(scene.model, TackingControl(scene.model.rover), 35.0)
    assert max(float(trace["body_x"][-1]) for trace in straight) < 0.85
    assert float(tacking["body_x"][-1]) > 0.95


def test_gains_lie_in_the_cell_of_the_nearest_point_by_ratio():
    centres = np.geomspace(0.01, 10.0, 12)
    edges = log_edges(centres)
    for gain in np.geomspace(0.009, 11.0, 97):
        cell = np.searchsorted(edges, gain) - 1
        assert cell == np.argmin(np.abs(np.log(centres / gain)))
