"""The rigid rover where its formulas have closed forms: payloads, leaning worlds, turning mounts, balances, springs."""

import dataclasses
import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_pin.base.errors import ParameterError
from rover_pin.contact import Wheel
from rover_pin.effects.spring_damper import SpringDamper
from rover_pin.rover.driven_loads import configuration, driven_loads, footing, turning, wheel_mounts
from rover_pin.rover.rover import load_rover
from rover_pin.rover.statics import wheel_loads
from rover_pin.rover.symmetry import is_symmetric, mirror
from rover_pin.rover.wheel_base import base_of

NEXUS6 = load_rover("nexus6")
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
    whole = rover.model.inertias[1] if mass > 0.0 else heavy.model.inertias[1]
    assert (whole + point).isApprox(heavy.model.inertias[1] if mass > 0.0 else rover.model.inertias[1], 1e-10)
    assert centre_of_mass(heavy) == pytest.approx(centre_of_mass(rover), abs=1e-12)
    assert heavy.mass == pytest.approx(rover.mass + mass)


def test_shift_moves_the_centre_of_mass_and_turns_no_inertia():
    rover = off_centre(NEXUS6, (0.1, 0.0, 0.03))
    moved = rover.carrying(1.5, shift_x=0.02, shift_z=-0.03)
    assert centre_of_mass(moved) - centre_of_mass(rover) == pytest.approx([0.02, 0.0, -0.03], abs=1e-12)
    still = rover.carrying(1.5)
    assert moved.model.inertias[1].inertia == pytest.approx(still.model.inertias[1].inertia, abs=1e-15)


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


@pytest.mark.parametrize(
    ("rise_x", "rise_y"), [(0.0, 0.0), (0.3, 0.0), (0.0, -0.2), (0.5, 0.7), (-1.2, 0.1), (0.1, 1.2)]
)
def test_up_is_against_gravity_in_a_world_that_rises(rise_x, rise_y):
    x, y = math.sin(rise_x), math.sin(rise_y)
    up = np.array([x, y, math.sqrt(1.0 - x * x - y * y)])
    leaning = NEXUS6.rising(rise_x, rise_y)
    assert leaning.up == pytest.approx(up, abs=1e-14)
    assert np.array(leaning.model.gravity.linear) == pytest.approx(-9.81 * up, abs=1e-12)
    assert leaning.gravity == pytest.approx(9.81, rel=1e-14)
    for gravity in (1.62, -3.0):
        other = leaning.under(gravity)
        assert other.up == pytest.approx(up, abs=1e-14)
        assert other.gravity == pytest.approx(gravity, rel=1e-14)


@pytest.mark.parametrize("degrees", [(100.0, 0.0), (0.0, 100.0), (46.0, 46.0), (60.0, 60.0), (-95.0, 5.0), (90.0, 0.0)])
def test_a_world_without_an_upper_side_is_refused(degrees):
    with pytest.raises(ParameterError, match=r"leaves.*upper"):
        NEXUS6.rising(*map(math.radians, degrees))
    assert NEXUS6.rising(math.radians(44.0), math.radians(44.0)).gravity == pytest.approx(9.81)


@given(
    st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda axis: np.linalg.norm(axis) > 0.1),
    st.floats(0.0, 3.1),
    st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda axis: np.linalg.norm(axis) > 0.1),
)
def test_mount_rotation_is_its_rotation_vector_along_the_axle(axis, angle, axle):
    axis, axle = (np.array(each) / np.linalg.norm(each) for each in (axis, axle))
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
    loads, (foot, _) = driven_loads(NEXUS6, q, torque), footing(NEXUS6, q)
    r = float(NEXUS6.wheel.r)
    left = NEXUS6.mass * 9.81 * NEXUS6.up - (torque / r) @ foot.forward - loads @ foot.normal
    shares = np.column_stack([loads @ foot.forward, loads @ foot.left])
    _, residual, *_ = np.linalg.lstsq(shares, left, rcond=None)
    assert math.sqrt(float(residual[0])) < 3e-3 * NEXUS6.mass * 9.81


def test_ground_slope_is_that_of_the_line_to_its_neighbours():
    q = configuration(NEXUS6, (0.0, -0.3, 0.0), {})
    foot, _ = footing(NEXUS6, q)
    assert foot.slope == pytest.approx(np.full(6, 0.3), abs=1e-12)
    assert wheel_mounts(NEXUS6, q)[1].shape == (6, 3)


@pytest.mark.parametrize(("k_s", "q_0"), [(2.0, 0.1), (0.05, 0.8)])
def test_a_spring_moves_the_load_between_the_wheels_of_its_bogie(k_s, q_0):
    """All wheels on the plane leave six determinate legs no angle: (N_m - N_r) a changes by k_s q_0, a = 75 mm."""
    plain = wheel_loads(NEXUS6, 0.0)
    sprung = dataclasses.replace(NEXUS6, springs=(SpringDamper(k_s=k_s, d=0.0, q_0=q_0, joint="bogie_l"),))
    moved = dict(zip([mount.name for mount in NEXUS6.wheels], wheel_loads(sprung, 0.0) - plain, strict=True))
    assert (moved["ml"] - moved["rl"]) * 0.075 == pytest.approx(k_s * q_0, rel=1e-6)
    assert sum(moved.values()) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("gravity", [1e-5, 0.05, 99.0])
def test_whether_a_rover_stands_does_not_depend_on_gravity(gravity):
    loose = dataclasses.replace(NEXUS6, differential=None)
    assert wheel_loads(NEXUS6, 0.0, gravity=gravity).sum() == pytest.approx(NEXUS6.mass * gravity)
    with pytest.raises(ParameterError, match=r"cannot.*wheels"):
        wheel_loads(loose, 0.1, gravity=gravity)


def test_springs_at_the_rockers_stand_for_a_differential():
    """Of equal springs on even ground each rocker carries what a differential would leave it."""
    loose = dataclasses.replace(NEXUS6, differential=None)
    springs = tuple(SpringDamper(k_s=40.0, d=0.0, q_0=0.0, joint=f"rocker_{side}") for side in "lr")
    sprung = wheel_loads(dataclasses.replace(loose, springs=springs), 0.1)
    assert sprung.sum() == pytest.approx(NEXUS6.mass * 9.81 * math.cos(0.1))
    assert sprung[::2] == pytest.approx(sprung[1::2])


def test_standing_does_not_depend_on_the_rovers_mass():
    """Round-off grows with the weight: of a million megatonnes it is more than one kilogramme's whole limit."""
    heavy = NEXUS6.carrying(1e15)
    assert wheel_loads(heavy, 0.1).sum() == pytest.approx(heavy.mass * 9.81 * math.cos(0.1))
    with pytest.raises(ParameterError, match=r"cannot.*wheels"):
        wheel_loads(dataclasses.replace(heavy, differential=None), 0.1)


def test_a_rotor_on_one_side_alone_is_not_symmetric():
    """Its inertia stands on the diagonal of the mass matrix only."""
    model = NEXUS6.model.copy()
    model.armature = model.armature + 1e-3 * np.isin(np.arange(model.nv), [mount.dof for mount in NEXUS6.wheels])
    assert is_symmetric(model, NEXUS6.mirror)
    for mount in NEXUS6.wheels:
        lopsided = model.copy()
        lopsided.armature[mount.dof] += 1e-4
        assert not is_symmetric(lopsided, NEXUS6.mirror), mount.name


def test_symmetry_does_not_depend_on_the_rovers_mass():
    """The limit is a share of the greatest entry: of a million tonnes a gram that stands aside is round-off."""
    model = CART.model.copy()
    model.inertias[1] = pin.Inertia(1e9, np.array([0.0, 1e-8, 0.0]), 1e9 * CART.model.inertias[1].inertia)
    assert is_symmetric(model, CART.mirror)
    model.inertias[1] = pin.Inertia(1e-6, np.array([0.0, 1e-3, 0.0]), 1e-6 * CART.model.inertias[1].inertia)
    light = pin.buildReducedModel(model, list(range(2, model.njoints)), pin.neutral(model))
    light.inertias[1] = pin.Inertia(1e-6, np.array([0.0, 1e-3, 0.0]), 1e-6 * CART.model.inertias[1].inertia)
    alone = mirror(light, [])
    assert not is_symmetric(light, alone)


def test_a_rover_stands_between_its_outer_axles_and_its_wheels():
    """From the URDF: axles 150 mm apart and wheels 160 mm from the middle; moved in the world it is as wide."""
    assert base_of(NEXUS6) == pytest.approx((0.3, 0.32))
    shifted = NEXUS6.model.copy()
    for joint in shifted.children[1]:
        place = shifted.jointPlacements[joint]
        place.translation = place.translation + np.array([0.05, 0.4, 0.0])
    assert base_of(dataclasses.replace(NEXUS6, model=shifted)) == pytest.approx((0.3, 0.32))


def test_a_rover_of_two_sizes_of_wheels_has_no_one_size():
    front, *others = NEXUS6.wheels
    mixed = dataclasses.replace(NEXUS6, wheels=(dataclasses.replace(front, wheel=Wheel(r=0.05, b=0.07)), *others))
    with pytest.raises(ParameterError, match=r"50.*70.*45"):
        mixed.wheel  # noqa: B018


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


def test_the_mirror_image_of_an_axis_along_y_is_itself():
    pairs = [(f"wheel_{end}l", f"wheel_{end}r") for end in "fmr"]
    names = list(NEXUS6.model.names)
    found = [(a, b) for a, b in pairs if a in names and b in names]
    image = mirror(NEXUS6.model, found)
    assert set(np.unique(image.sign)) == {-1.0, 1.0}
