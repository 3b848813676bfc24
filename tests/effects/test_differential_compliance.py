"""A soft differential: free within its play, a spring beyond, and the rigid one in the limit."""

import numpy as np
import pytest

from rover_pin.control.constant import ConstantDuty
from rover_pin.effects.differential_compliance import DifferentialCompliance
from rover_pin.effects.effect import Body
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.simulate import simulate

BUMP = scenario("one-sided-bump").model


def drive(effect):
    return simulate(BUMP.having(effect), ConstantDuty(0.55), 12.0)


def torque(effect, twist, rate=0.0):
    body = Body(*[0.0] * 12, (twist, 0.0), (rate, 0.0), (rate, 0.0), twist, rate)
    return float(effect.push(body).differential)


@pytest.mark.parametrize(
    ("twist", "expected"), [(0.004, 0.0), (-0.0049, 0.0), (0.006, -0.2), (-0.015, 2.0), (0.0, 0.0)]
)
def test_the_torque_by_hand(twist, expected):
    assert torque(DifferentialCompliance(compliance=0.005, backlash=0.01), twist) == pytest.approx(expected, abs=1e-12)
    assert torque(DifferentialCompliance(compliance=0.005, backlash=0.01), 0.004, rate=3.0) == 0.0


def test_soft_differential_tends_to_the_rigid_one():
    rigid = drive(DifferentialCompliance(compliance=0.0, backlash=0.0))
    off = []
    for compliance in (1e-2, 1e-3, 1e-4, 1e-5):
        trace = drive(DifferentialCompliance(compliance=compliance, backlash=0.0))
        off.append(np.abs(trace["rocker_l"] - rigid["rocker_l"]).max())
        late = trace["t_s"] > 1.0
        assert trace["differential_torque"][late] == pytest.approx(
            rigid["differential_torque"][late], abs=40 * compliance + 1e-3
        )
    assert off[0] < 1e-3
    assert np.divide(off[1:], off[:-1]) == pytest.approx(0.1, rel=0.2)
    without = simulate(BUMP, ConstantDuty(0.55), 12.0)
    assert all(np.array_equal(rigid[name], without[name]) for name in without.channels)


def test_the_twist_is_the_compliance_times_the_torque():
    """Where it does not change by more than 1 mrad/s: its damping adds T_d = 10 ms of the rate."""
    trace = drive(DifferentialCompliance(compliance=0.02, backlash=0.0))
    twist = trace["rocker_l"] + trace["rocker_r"]
    steady = (trace["t_s"] > 0.5) & (np.abs(np.gradient(twist, trace["t_s"])) < 1e-3)
    assert steady.mean() > 0.8
    assert twist[steady] == pytest.approx(-0.02 * trace["differential_torque"][steady], abs=2e-5)


def test_within_the_play_the_rockers_are_free():
    """Torque only at the ends of the play, which the twist passes by no more than the stiffness allows."""
    trace = drive(DifferentialCompliance(compliance=0.001, backlash=0.03))
    twist = trace["rocker_l"] + trace["rocker_r"]
    inside = np.abs(twist) < 0.0149
    assert inside.any()
    assert np.abs(trace["differential_torque"][inside]).max() < 1e-12
    assert np.abs(twist).max() > 0.0149
    assert np.abs(twist).max() < 0.015 + 0.001


def test_play_lets_the_body_pitch_by_half_of_it():
    """Standing, the base leans on one end of the play: both rockers turn alike, by a quarter of the backlash each."""
    model = scenario("flat").model.having(DifferentialCompliance(compliance=0.0, backlash=0.04))
    from rover_pin.simulation.start.place import Start, settled

    q, differential = settled(model, Start()).q, model.rover.differential
    angles = q[[differential.q_left, differential.q_right]]
    assert np.abs(angles) == pytest.approx(0.01, abs=1e-3)
