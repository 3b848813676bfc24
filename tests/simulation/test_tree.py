"""What of a rover's tree decides the generated rigid body, and what stays a number: exact, round and nearly so."""

import math

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from rover_pin.rover.rover import load_rover
from rover_pin.simulation.native.compiled_body import KeyedModel, compiled_body
from rover_pin.simulation.native.rigid_body import rigid_body, tree_of

ROTATION, PLACE = slice(0, 9), slice(9, 12)
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


UNEVEN = pin.Inertia(1.3, np.array([0.03, 0.01, -0.02]), np.diag([0.02, 0.03, 0.04]) + 0.003)


def shifted(*place, turned=None):
    return pin.SE3(np.eye(3) if turned is None else turned, np.array(place))


def assert_like_pinocchio(model):
    random, made = np.random.default_rng(0), tree_of(model)
    q = pin.integrate(model, pin.neutral(model), random.normal(size=model.nv))
    v, data = random.normal(size=model.nv), model.createData()
    function = rigid_body(made.joints, model.nq, model.nv)
    out = np.array(function(np.concatenate([q, v, model.gravity.linear]), [], made.parameters)).ravel()
    bias = pin.nonLinearEffects(model, data, q, v)
    at = len(out) - 10 - 6 * (model.njoints - 2) - model.nv
    np.testing.assert_allclose(out[at : at + model.nv], bias, atol=1e-12 * np.abs(bias).max())
    assert out[-1] == pytest.approx(pin.computePotentialEnergy(model, data, q))


def test_a_slanted_axis_is_turned_to_by_a_rotation():
    slanted = [np.array(each) / np.linalg.norm(each) for each in ([0.6, 0.5, -0.4], [-0.2, 0.9, 0.3], [0.1, -0.3, 0.8])]
    model = tree(*((pin.JointModelRevoluteUnaligned(axis), shifted(0.2, 0.0, -0.1), UNEVEN) for axis in slanted))
    assert_like_pinocchio(model)


def test_a_wheel_of_revolution_is_not_turned():
    """What is left of Nexus 6's 14 joints are eight angles, each with a sine and a cosine."""
    model = load_rover("nexus6").model
    function = rigid_body(tree_of(model).joints, model.nq, model.nv)
    kinds = [function.instruction_id(k) for k in range(function.n_instructions())]
    assert kinds.count(ca.OP_SIN) == kinds.count(ca.OP_COS) == model.nv - 6 - 6


def test_what_round_off_leaves_of_a_right_angle_is_none():
    quarter = pin.utils.rotate("x", math.pi / 2)
    assert np.any((quarter != 0.0) & (np.abs(quarter) < 1e-15)), "as a URDF's 1.5707963 would be, but for rounding"
    joint = tree_of(tree((pin.JointModelRX(), shifted(0.3, 0.0, 0.0, turned=quarter), UNEVEN))).joints[1]
    assert joint.numbers[ROTATION] == (1, 0, 0, 0, 0, -1, 0, 1, 0)
    nearly = np.eye(3) * (1.0 - 2.0**-53)
    joint = tree_of(tree((pin.JointModelRX(), shifted(0.3, 0.0, 0.0, turned=nearly), UNEVEN))).joints[1]
    assert joint.numbers[ROTATION] == (1, 0, 0, 0, 1, 0, 0, 0, 1)


def test_equal_bodies_are_compiled_once_and_other_trees_apart():
    """One whose last joint turns freely has the same numbers."""
    joint, end = (
        (pin.JointModelRX(), shifted(0.3, 0.0, 0.0), UNEVEN),
        (pin.JointModelRX(), shifted(0.0, 0.2, 0.0), UNEVEN),
    )
    model = tree(joint, end)
    assert compiled_body(KeyedModel.of(model)) is compiled_body(KeyedModel.of(model.copy()))
    free = tree(joint, (pin.JointModelRUBX(), *end[1:]))
    assert KeyedModel.of(free) != KeyedModel.of(model)
    assert compiled_body(KeyedModel.of(free)) is not compiled_body(KeyedModel.of(model))
