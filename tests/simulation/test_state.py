"""Angles of a base against Pinocchio's, and what of a rover's tree decides the generated rigid body."""

import math

import numpy as np
import pinocchio as pin
import pytest

from rover_pin.simulation.native.compiled_body import KeyedModel, compiled_body
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


"""Where they stand among a joint's numbers."""


def tree(*joints):
    """A free base and joints one behind the other, each (kind, placement, inertia)."""
    model, at = pin.Model(), 0
    at = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
    model.appendBodyToJoint(
        at, pin.Inertia(5.0, np.array([0.1, -0.02, 0.05]), np.diag([0.2, 0.3, 0.4])), pin.SE3.Identity()
    )
    for k, (kind, placement, inertia) in enumerate(joints):
        at = model.addJoint(at, kind, placement, f"j{k}")
        model.appendBodyToJoint(at, inertia, pin.SE3.Identity())
    return model


UNEVEN_SHARE = pin.Inertia(1.3, np.array([0.03, 0.01, -0.02]), np.diag([0.02, 0.03, 0.04]) + 0.003)


def shifted(*place, turned=None):
    return pin.SE3(np.eye(3) if turned is None else turned, np.array(place))


def test_equal_bodies_are_compiled_once_and_other_trees_apart():
    """One whose last joint turns freely has the same numbers."""
    joint, end = (
        (pin.JointModelRX(), shifted(0.3, 0.0, 0.0), UNEVEN_SHARE),
        (pin.JointModelRX(), shifted(0.0, 0.2, 0.0), UNEVEN_SHARE),
    )
    model = tree(joint, end)
    assert compiled_body(KeyedModel.of(model)) is compiled_body(KeyedModel.of(model.copy()))
    free = tree(joint, (pin.JointModelRUBX(), *end[1:]))
    assert KeyedModel.of(free) != KeyedModel.of(model)
    assert compiled_body(KeyedModel.of(free)) is not compiled_body(KeyedModel.of(model))
