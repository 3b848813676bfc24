"""The densities by which particles are weighed: they integrate to 1, and say what they are there for."""

import numpy as np
import pytest
from scipy.integrate import quad

from rover_pin.control.hole_law import HoleLaw
from rover_pin.control.sensing.laws import FACTORS, ReadingTrust, fold_law, still_law, torque_law, wheel_law
from rover_pin.effects.slip import RelaxedSlip

PERIOD = 0.05


def wheel(u, s, D, ahead=0.0, level=1.0, rim=0.05, r=0.045):
    law = wheel_law(HoleLaw(), RelaxedSlip(), PERIOD)
    return np.array(law([u, s, D], [ahead, level, rim, r])).ravel()


def test_a_particle_s_slip_settles_at_eq_1():
    s, D = 0.0, 0.0
    for _ in range(200):
        s, D = wheel(0.03, s, D)
    assert s == pytest.approx(0.4, abs=1e-6)
    assert pytest.approx(0.15 * 0.02 / (0.03 / 0.04 + 0.15 * 0.02 / 0.0225), rel=0.02) == D, "thrown in, climbed out"


@pytest.mark.parametrize("share", [0.0025, 0.04])
def test_a_torque_s_density_is_one_but_for_strays(share):
    law = torque_law(ReadingTrust())
    total, _ = quad(lambda factor: float(law(0.3, [factor, share])), -3.0, 3.0, points=[0.3])
    assert total == pytest.approx(0.9 + 0.1 * 6.0 / FACTORS, rel=1e-6)
    assert float(law(0.3, [1.5, share])) == pytest.approx(0.05, rel=1e-6), "a wall may read anything"


def fold_and_still(wall=0.0):
    """Both laws as functions of (speed or way, (rise or change, bend))."""
    fold, still = fold_law(ReadingTrust()), still_law(ReadingTrust())
    return (lambda u, read: fold(u, [*read, wall])), still


def test_a_wheel_at_a_wall_climbs_or_the_rover_stands():
    away, at_wall = (fold_and_still(wall)[0] for wall in (0.0, 1.0))
    for law in (away, at_wall):
        assert float(law(0.025, [0.009, 0.05])) > float(law(0.0, [0.009, 0.05])) + 2.0, "what rises so is no noise"
    odds = [float(law(0.0, [0.001, 0.1])) - float(law(0.025, [0.001, 0.1])) for law in (away, at_wall)]
    assert odds[1] > odds[0] > 0.0, "at a wall, to rise by nothing is to stand"


@pytest.mark.parametrize("bend", [0.0, 0.05, 0.3])
def test_densities_of_what_is_read_are_one(bend):
    fold, still = fold_and_still(0.3)
    assert quad(lambda rise: np.exp(float(fold(0.05, [rise, bend]))), 0.0, 1.0, points=[0.01])[0] == pytest.approx(1.0)
    total = quad(lambda change: np.exp(float(still(0.08, [change, bend]))), 0.0, 0.5, points=[0.001, 0.02])[0]
    assert total == pytest.approx(1.0, abs=1e-6)
