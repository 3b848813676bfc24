"""What of a rover's tree decides the generated rigid body, and what stays a number: exact, round and nearly so."""

import numpy as np
import pinocchio as pin

from rover_pin.simulation.native.compiled_body import KeyedModel, compiled_body

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
