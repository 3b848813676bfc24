"""What of a rover's tree decides the generated rigid body, and what stays a number: exact, round and nearly so."""

import math

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from rover_pin.rover.rover import load_rover
from rover_pin.simulation.native.compiled_body import KeyedModel, compiled_body
from rover_pin.simulation.native.rigid_body import SAME, _revolves, inertia_places, rigid_body, tree_of

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


def test_only_0_1_and_minus_1_are_no_parameters():
    """A tenth and eleven tenths are lengths as any other."""
    turned = np.diag([1.0, -1.0, -1.0])
    model = tree((pin.JointModelRX(), shifted(0.1, 1.1, -0.1, turned=turned), UNEVEN))
    joint = tree_of(model).joints[1]
    assert joint.numbers[ROTATION] == (1, 0, 0, 0, -1, 0, 0, 0, -1)
    assert joint.numbers[PLACE] == (None, None, None)
    assert tree_of(tree((pin.JointModelRX(), shifted(0.0, 1.0, -1.0), UNEVEN))).joints[1].numbers[PLACE] == (0, 1, -1)
    assert_like_pinocchio(model)


def test_zeros_of_a_body_are_known_except_for_the_loaded_base():
    plain = pin.Inertia(1.3, np.zeros(3), np.diag([0.02, 0.03, 0.04]))
    base, joint = tree_of(tree((pin.JointModelRX(), shifted(0.3, 0.0, 0.0), plain))).joints
    assert joint.numbers[12:] == (None, 0, 0, 0, None, 0, 0, None, 0, None)
    assert base.numbers[12:] == (None,) * 10
    assert base.numbers[:12] == (1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0)


def test_inertia_entries_are_listed_once_and_cover_all_nonzero():
    model = load_rover("nexus6").model
    places = inertia_places(tree_of(model).joints)
    seen = np.zeros((model.nv, model.nv), dtype=bool)
    for seed in range(3):
        random = np.random.default_rng(seed)
        q = pin.integrate(model, pin.neutral(model), random.normal(size=model.nv))
        seen |= np.abs(np.triu(pin.crba(model, model.createData(), q))) > 1e-14
    assert len(set(places)) == len(places)
    assert {*zip(*np.nonzero(seen), strict=True)} <= set(places)
    assert all(row <= column for row, column in places)


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


@pytest.mark.parametrize(
    ("place", "kept"), [((500.0, 2e-13, 0.0), False), ((0.002, 2e-13, 0.0), True), ((0.002, 1e-18, 0.0), False)]
)
def test_length_is_rounded_off_beside_one_1e15_times_as_long(place, kept):
    joint = tree_of(tree((pin.JointModelRX(), shifted(*place), UNEVEN))).joints[1]
    assert joint.numbers[PLACE] == (None, None if kept else 0, 0)


def rim(axle, across, off=0.0, lever=(0.1, 0.0, 0.0)):
    """A joint's numbers of a body with these inertias along and across its axle."""
    return np.array([*np.eye(3).ravel(), 0.0, 0.0, 0.0, 1.0, *lever, axle, 0.0, 0.0, across + off, 0.0, across])


@pytest.mark.parametrize(("axle", "across"), [(1e-3, 4e-4), (4e-4, 1e-3), (70.0, 20.0)])
def test_wheel_is_axisymmetric_to_1e_13_of_its_largest_inertia(axle, across):
    """Its centre lies on its axle, too."""
    share = SAME * max(axle, across)
    assert SAME == 1e-13
    assert _revolves(rim(axle, across))
    assert _revolves(rim(axle, across, 0.7 * share))
    assert not _revolves(rim(axle, across, 1.4 * share))
    assert not _revolves(rim(axle, across, lever=(0.1, 1e-9, 0.0)))
    assert not _revolves(rim(axle, across, lever=(0.1, 0.0, -1e-9)))


def test_a_joint_that_slides_is_none_of_the_step():
    with pytest.raises(AssertionError, match="revolute joints"):
        tree_of(tree((pin.JointModelPZ(), shifted(0.1, 0.0, 0.0), UNEVEN)))


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
