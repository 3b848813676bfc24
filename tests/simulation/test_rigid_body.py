"""The generated rigid body is compared with Pinocchio's own algorithms, for every rover and for random trees
of joints."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_pin import Model, Motor, Soil, load_rover
from rover_pin.effects.slip import RelaxedSlip
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.simulation.compiled.drive_fields import model_with_armature
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.model.model import base_effects
from rover_pin.simulation.native.compiled_body import KeyedModel, compiled_body
from rover_pin.simulation.native.rigid_body import inertia_places, rigid_body, tree_of
from rover_pin.simulation.start import Start, hovering
from rover_pin.terrain import shapes

TIGHT = 1e-12


def parts(model, q, v):
    """Return the parts of the generated output, computed by CasADi's interpreter: inertia, bias, axes, points,
    rotation, potential.
    """
    tree = tree_of(model)
    function = rigid_body(tree.joints, model.nq, model.nv)
    out = np.array(function(np.concatenate([q, v, model.gravity.linear]), [], tree.parameters)).ravel()
    places, joints = inertia_places(tree.joints), 3 * (model.njoints - 2)
    sizes = [len(places), model.nv, joints, joints, 9]
    inertia, bias, axes, points, rotation, potential = np.split(out, np.cumsum(sizes))
    M = np.zeros((model.nv, model.nv))
    for (row, column), value in zip(places, inertia, strict=True):
        M[row, column] = M[column, row] = value
    return M, bias, axes.reshape(-1, 3), points.reshape(-1, 3), rotation.reshape(3, 3).T, float(potential[0])


def same(ours, theirs):
    scale = max(1.0, float(np.max(np.abs(theirs), initial=0.0)))
    assert np.asarray(ours) == pytest.approx(np.asarray(theirs), rel=0.0, abs=TIGHT * scale)


def compare(model, q, v):
    data = model.createData()
    M, bias, axes, points, rotation, potential = parts(model, q, v)
    upper = np.triu(pin.crba(model, data, q))
    theirs = upper + np.triu(upper, 1).T - np.diag(model.armature)
    same(M, theirs)
    same(bias, pin.nonLinearEffects(model, data, q, v))
    same(potential, pin.computePotentialEnergy(model, data, q))
    pin.computeJointJacobians(model, data, q)
    same(rotation, data.oMi[1].rotation)
    for i in range(2, model.njoints):
        same(points[i - 2], data.oMi[i].translation)
        same(axes[i - 2], pin.getJointJacobian(model, data, i, pin.WORLD)[3:, model.joints[i].idx_v])
    torque = np.cos(np.arange(model.nv))
    ours = np.linalg.solve(M + np.diag(model.armature), torque - bias)
    acceleration = pin.aba(model, data, q, v, torque)
    off = np.abs(theirs + np.diag(model.armature)) @ np.abs(ours - acceleration)
    assert np.max(off) < TIGHT * np.linalg.cond(theirs) * max(1.0, float(np.max(np.abs(bias))))


def random_state(model, rng):
    q = pin.integrate(model, pin.neutral(model), rng.uniform(-1.5, 1.5, model.nv))
    return q, rng.normal(0.0, 1.5, model.nv)


@pytest.mark.parametrize("name", ["nexus6", "cart", "nexus6_links"])
@pytest.mark.parametrize("load", [0.0, 7.0])
def test_rovers(name, load):
    rover = load_rover(name)
    model = (rover.carrying(load) if load else rover).model
    rng = np.random.default_rng(1)
    for _ in range(3):
        compare(model, *random_state(model, rng))


def test_an_added_mass_needs_no_new_function():
    plain, loaded = (tree_of(rover.model) for rover in (load_rover("nexus6"), load_rover("nexus6").carrying(3.0)))
    assert plain.joints == loaded.joints
    assert not np.array_equal(plain.parameters, loaded.parameters)


KINDS = (
    pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ, pin.JointModelRUBX, pin.JointModelRUBY, pin.JointModelRUBZ,
)  # fmt: skip


@st.composite
def trees(draw):
    """Return random rovers: a free base with up to 42 joints and rotors in any tree, branch after branch as in
    Pinocchio.
    """
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    model = pin.Model()
    at = [model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")]
    for k in range(draw(st.sampled_from([1, 2, 3, 5, 8, 13, 20, 42]))):
        parent, slanted = int(rng.choice(list(model.supports[at[-1]])[1:])), rng.random() < 0.3
        joint = pin.JointModelRevoluteUnaligned(*_direction(rng)) if slanted else KINDS[rng.integers(6)]()
        turned = pin.SE3.Random() if rng.random() < 0.5 else pin.SE3.Identity()
        turned.translation = rng.uniform(-0.3, 0.3, 3) * (rng.random(3) < 0.7)
        at.append(model.addJoint(parent, joint, turned, f"j{k}"))
    for i in at:
        round_body = rng.random() < 0.4
        inertia = pin.Inertia.FromCylinder(rng.uniform(0.1, 3.0), 0.1, 0.05) if round_body else pin.Inertia.Random()
        model.appendBodyToJoint(i, inertia, pin.SE3.Identity())
    model.armature = rng.uniform(0.0, 0.01, model.nv)
    return model, rng


def _direction(rng):
    axis = rng.normal(size=3)
    return axis / np.linalg.norm(axis)


@settings(max_examples=20)
@given(trees())
def test_random_trees(made):
    model, rng = made
    pin.seed(int(rng.integers(2**31)))
    compare(model, *random_state(model, rng))


@pytest.mark.parametrize("name", ["nexus6", "cart"])
def test_the_compiled_body_agrees_with_pinocchio(name):
    """The energies and the inputs of the step come from the compiled form of the generated function."""
    rover = load_rover(name)
    soil = Soil()
    model_built = Model(
        rover, shapes.flat(), (soil,), Motor(), RelaxedSlip(), base_effects(soil, rover, SoilTraction())
    )
    state = hovering(model_built, Start(0.1, 0.2, 0.3))
    q, v = random_state(rover.model, np.random.default_rng(2))
    state.q[:], state.v[:] = q, v
    kernel = Kernel(model_built, state, 0.005, symmetric=False)
    model = model_with_armature(model_built.built, float(model_built.motor.armature))
    data = model.createData()
    kinetic, potential = kernel.energies()
    same(kinetic, pin.computeKineticEnergy(model, data, q, v))
    same(potential, pin.computePotentialEnergy(model, data, q))
    model_built = compiled_body(KeyedModel.of(rover.model))
    rotors = np.diag(model.armature)
    inertia = kernel.keep["rigid"][: len(model_built.rows)]
    same(inertia, (np.triu(pin.crba(model, data, q)) - rotors)[model_built.rows, model_built.columns])
    same(kernel.keep["nle"][: model.nv], pin.nonLinearEffects(model, data, q, v))
