"""The study of the side force: its ways are those that it says, and each law holds the rover as its result says."""

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

STUDIES = Path(__file__).parents[2] / "studies"


@pytest.fixture(scope="module")
def study():
    sys.path.insert(0, str(STUDIES))
    yield importlib.import_module("side_force")
    sys.path.remove(str(STUDIES))


@pytest.fixture(scope="module")
def across(study):
    laws = ("old: SideShear", "new: combined shear, flank")
    return [study.row("across", name, study.driven("across", study.LAWS[name], 12.0)) for name in laws]


def test_across_a_slope_the_new_law_lets_the_rover_drift_less(across):
    drift = [row["travel_to_axis_deg"] for row in across]
    assert drift == pytest.approx([3.95, 2.97], abs=0.15)


def test_side_force_carries_the_slopes_share_of_the_weight(across):
    """In equilibrium sum f_y = m g sin 10 deg: 0.176 of the load, the middle wheel a little more."""
    for row in across:
        assert row["side_over_load"] == pytest.approx(np.tan(np.radians(10.0)), rel=0.1)


def test_a_skid_on_sand_that_softens_digs_in_and_turns_less(study):
    """Held side speeds turn the cart on; where slip and drift soften the sand it sinks to 48 mm and is slow."""
    firm, soft = (study.driven("skid", study.LAWS[name], 17.0) for name in list(study.LAWS)[-2:])
    late = soft.t > 12.0
    assert np.ptp(soft["body_yaw"][late]) < 0.5 * np.ptp(firm["body_yaw"][late])
    assert 1e3 * np.hypot(np.ptp(soft["body_x"][late]), np.ptp(soft["body_y"][late])) < 20.0, "it does not lurch"
    assert 1e3 * soft.stack("sinkage")[late].max() == pytest.approx(46.0, abs=4.0)
