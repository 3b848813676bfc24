"""Angles of a base, against Pinocchio's own; a copy of a state is another one."""

import math

import numpy as np
import pinocchio as pin
import pytest

from rover_pin.simulation.state import base_rotation, roll_pitch_yaw


def configured(rotation, scale=1.0):
    return np.concatenate([[1.0, 2.0, 3.0], scale * pin.Quaternion(rotation).coeffs(), [0.5]])


@pytest.mark.parametrize("seed", range(20))
def test_angles_turn_about_z_then_y_then_x(seed):
    roll, pitch, yaw = np.random.default_rng(seed).uniform([-3.1, -1.5, -3.1], [3.1, 1.5, 3.1])
    rotation = pin.rpy.rpyToMatrix(roll, pitch, yaw)
    assert roll_pitch_yaw(configured(rotation)) == pytest.approx((roll, pitch, yaw), abs=1e-9)
    assert base_rotation(configured(rotation)) == pytest.approx(rotation, abs=1e-12)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_rover_on_its_nose_has_a_pitch_despite_a_sine_beyond_1(side):
    rotation = pin.rpy.rpyToMatrix(0.0, side * math.pi / 2, 0.0)
    assert roll_pitch_yaw(configured(rotation, 1.0 + 1e-12))[1] == pytest.approx(side * math.pi / 2)
