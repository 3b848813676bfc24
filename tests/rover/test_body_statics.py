"""Static wheel loads and the rigid rover where they have closed forms: sums, moments, payloads, balances, springs."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_pin.base.errors import ParameterError
from rover_pin.effects.spring_damper import SpringDamper
from rover_pin.rover.driven_loads import configuration, driven_loads, footing, turning
from rover_pin.rover.rover import is_symmetric, load_rover
from rover_pin.rover.statics import wheel_loads

NEXUS6 = load_rover("nexus6")
WEIGHT = 5.8 * 9.81
angles = st.floats(-0.4, 0.4)


@settings(max_examples=25)
@given(angles, angles)
def test_loads_carry_the_weight_across_the_plane(slope, side):
    loads = wheel_loads(NEXUS6, slope, side)
    assert loads.sum() == pytest.approx(WEIGHT * math.cos(slope) * math.cos(side), rel=1e-9)


@settings(max_examples=25)
@given(angles, angles)
def test_the_moments_about_the_centre_of_mass_balance(slope, side):
    """By hand: vertical forces at the lowest points, the weight at the centre of mass; positions from the URDF."""
    loads = wheel_loads(NEXUS6, slope, side)
    places = np.array([[x, y, -0.13] for x in (0.15, 0.0, -0.15) for y in (0.16, -0.16)])
    gravity = rotation(slope, side).T @ [0.0, 0.0, -1.0]
    model = NEXUS6.model
    centre = pin.centerOfMass(model, model.createData(), pin.neutral(model))
    forces = -np.outer(loads / -gravity[2], gravity)
    moment = np.cross(places - centre, forces).sum(axis=0)
    assert np.allclose(moment, 0.0, atol=1e-9)


def rotation(slope, side):
    c, s, d, t = math.cos(slope), math.sin(slope), math.cos(side), math.sin(side)
    return np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]]) @ np.array([[1, 0, 0], [0, d, -t], [0, t, d]])


def test_without_its_differential_the_rover_cannot_stand():
    loose = dataclasses.replace(NEXUS6, differential=None)
    with pytest.raises(ParameterError, match="'nexus6'"):
        wheel_loads(loose, 0.1)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((2.0,), r"slope = 114.592.*\[-80, 80\]"),
        ((0.0, float("nan")), "side_slope = nan"),
        ((0.0, 0.0, 0.0), "gravity = 0 m/s.2"),
        ((0.0, 0.0, 100.1), "gravity = 100.1 m/s.2"),
    ],
)
def test_refusals(arguments, words):
    with pytest.raises(ParameterError, match=words):
        wheel_loads(NEXUS6, *arguments)


def test_four_wheels_on_a_rigid_body_take_the_least_norm():
    """Statically indeterminate: twisting the load pattern (+ - - +) balances too, and the answer has none of it."""
    loads = wheel_loads(load_rover("cart"), 0.1, 0.15)
    assert abs(loads @ [1.0, -1.0, -1.0, 1.0]) < 1e-9 * loads.sum()


CART = load_rover("cart")


def centre_of_mass(rover):
    return pin.centerOfMass(rover.model, rover.model.createData(), pin.neutral(rover.model))


def off_centre(rover, lever):
    """The rover with its base's centre of mass elsewhere."""
    model = rover.model.copy()
    base = model.inertias[1]
    model.inertias[1] = pin.Inertia(base.mass, base.lever + np.array(lever), base.inertia)
    return dataclasses.replace(rover, model=model)


@pytest.mark.parametrize("mass", [2.5, -0.2])
def test_a_payload_is_a_point_at_the_centre_of_mass(mass):
    """Against Pinocchio's own sum of two bodies."""
    rover = off_centre(NEXUS6, (0.06, -0.03, 0.02))
    heavy = rover.carrying(mass)
    point = pin.Inertia(abs(mass), centre_of_mass(rover), np.zeros((3, 3)))
    full = rover.model.inertias[1] if mass > 0.0 else heavy.model.inertias[1]
    assert (full + point).isApprox(heavy.model.inertias[1] if mass > 0.0 else rover.model.inertias[1], 1e-10)
    assert centre_of_mass(heavy) == pytest.approx(centre_of_mass(rover), abs=1e-12)
    assert heavy.mass == pytest.approx(rover.mass + mass)


def test_shift_moves_the_centre_of_mass_and_turns_no_inertia():
    rover = off_centre(NEXUS6, (0.1, 0.0, 0.03))
    loaded = rover.carrying(1.5, shift_x=0.02, shift_z=-0.03)
    assert centre_of_mass(loaded) - centre_of_mass(rover) == pytest.approx([0.02, 0.0, -0.03], abs=1e-12)
    still = rover.carrying(1.5)
    assert loaded.model.inertias[1].inertia == pytest.approx(still.model.inertias[1].inertia, abs=1e-15)


@pytest.mark.parametrize("lever", [(0.2, 0.0, 0.0), (0.0, 0.15, 0.1), (0.0, 0.0, 0.25)])
def test_a_base_is_refused_exactly_when_no_body_has_its_inertia(lever):
    """An inertia is a body's when no principal moment is beyond the sum of the two others, and none below 0."""
    rover = off_centre(NEXUS6, lever)
    base, away = rover.model.inertias[1], centre_of_mass(rover) - rover.model.inertias[1].lever
    refused = []
    for mass in -base.mass * np.linspace(0.01, 0.99, 40):
        spread = base.mass * mass / (base.mass + mass)
        axes = np.sort(np.linalg.eigvalsh(base.inertia + spread * (away @ away * np.eye(3) - np.outer(away, away))))
        impossible = axes[0] <= 0.0 or axes[2] >= axes[0] + axes[1]
        refused.append(impossible)
        if impossible:
            with pytest.raises(ParameterError, match=r"inertia.*body"):
                rover.carrying(float(mass))
        else:
            rover.carrying(float(mass))
    assert any(refused)
    assert not all(refused)


@given(
    st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda axis: np.linalg.norm(axis) > 0.1),
    st.floats(0.0, 3.1),
    st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda axis: np.linalg.norm(axis) > 0.1),
)
def test_mount_rotation_is_its_rotation_vector_along_the_axle(axis, angle, axle):
    axis, axle = (np.array(vector) / np.linalg.norm(vector) for vector in (axis, axle))
    first = pin.exp3(np.array([0.3, -0.4, 0.2]))
    turned = np.array([[first], [pin.exp3(angle * axis) @ first]])
    assert turning(turned, axle[None]) == pytest.approx(np.array([[0.0], [angle * float(axis @ axle)]]), abs=1e-7)


@pytest.mark.parametrize(("bend", "seed"), [*((0.1, seed) for seed in range(6)), (0.3, 4)])
def test_driven_wheel_forces_balance_the_weight_on_bent_ground(bend, seed):
    """Loads, torques, one share of resistance and one of side force, which are means over bent ground: to 3e-3."""
    rng = np.random.default_rng(seed)
    angles = dict(zip(NEXUS6.angles, rng.uniform(-bend, bend, len(NEXUS6.angles)), strict=True))
    angles["rocker_r"] = -angles["rocker_l"]
    q = configuration(NEXUS6, tuple(rng.uniform(-0.2, 0.2, 3)), angles)
    torque = rng.uniform(0.0, 0.1, 6)
    foot, jacobians = footing(NEXUS6, q)
    loads = driven_loads(NEXUS6, q, torque, foot, jacobians)
    r = float(NEXUS6.wheel.r)
    left = NEXUS6.mass * 9.81 * NEXUS6.up - (torque / r) @ foot.forward - loads @ foot.normal
    shares = np.column_stack([loads @ foot.forward, loads @ foot.left])
    _, residual, *_ = np.linalg.lstsq(shares, left, rcond=None)
    assert math.sqrt(float(residual[0])) < 3e-3 * NEXUS6.mass * 9.81


@pytest.mark.parametrize(("k_s", "q_0"), [(2.0, 0.1), (0.05, 0.8)])
def test_a_spring_moves_the_load_between_the_wheels_of_its_bogie(k_s, q_0):
    """All wheels on the plane leave six determinate legs no angle: (N_m - N_r) a changes by k_s q_0, a = 75 mm."""
    plain = wheel_loads(NEXUS6, 0.0)
    sprung = dataclasses.replace(NEXUS6, springs=(SpringDamper(k_s=k_s, d=0.0, q_0=q_0, joint="bogie_l"),))
    load_change = dict(zip([mount.name for mount in NEXUS6.wheels], wheel_loads(sprung, 0.0) - plain, strict=True))
    assert (load_change["ml"] - load_change["rl"]) * 0.075 == pytest.approx(k_s * q_0, rel=1e-6)
    assert sum(load_change.values()) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("row", [(0, 1), (1, 2), (3, 4), (4, 5), (0, 0), (1, 1), (2, 2)])
def test_rover_is_symmetric_only_with_mass_in_mirrored_places(row):
    """Products of inertia across the x-z plane are not; others and moments on the base are."""
    base = CART.model.inertias[1]
    change = np.zeros((3, 3))
    if row[0] < 3:
        change[row], change[row[::-1]] = 1e-4, 1e-4
    lever = np.zeros(3) if row[0] < 3 else np.array([0.0, 1e-4, 0.0])
    model = CART.model.copy()
    model.inertias[1] = pin.Inertia(base.mass, base.lever + lever, base.inertia + change)
    assert is_symmetric(CART.model, CART.mirror)
    assert is_symmetric(model, CART.mirror) is (row in ((0, 0), (1, 1), (2, 2)))
    tiny = CART.model.copy()
    tiny.inertias[1] = pin.Inertia(base.mass, base.lever + 1e-4 * lever, base.inertia + 1e-9 * change)
    assert is_symmetric(tiny, CART.mirror)
