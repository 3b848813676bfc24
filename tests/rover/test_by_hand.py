"""Statics, inertias, symmetry and proposed roles once more by hand, from numbers of the description alone."""

import math
import re

import numpy as np
import pinocchio as pin
import pytest

from rover_pin.base.errors import UrdfError
from rover_pin.rover.description.faults import across
from rover_pin.rover.description.inertia_check import inertia_faults, inertia_notes, small_parts, unit_faults
from rover_pin.rover.description.tree import read_tree
from rover_pin.rover.forward_dynamics import angle_rows, constraint_rows
from rover_pin.rover.proposal.propose import propose
from rover_pin.rover.rover import is_symmetric, load_rover
from rover_pin.rover.statics import hanging_wheels, wheel_loads
from rover_pin.rover.wheel_base import base_of, effective_track, reach_of, wheel_places
from tests.rover.farm import ROCKERS, THREE_AXLES, TWO_AXLES, Farm, cart, rocker_bogie, write

G = 9.81

# Statics of the made rover: rocker pivots at x = 0, front wheels at 0.5, bogie pivots at -0.3, their wheels 0.25 away.
WHEEL, BOGIE, ROCKER, BODY, CENTRE = 1.0, 1.0, 2.0, 40.0, 0.05
FRONT, MIDDLE, REAR, PIVOT = 0.5, -0.05, -0.55, -0.3


def loads_by_hand():
    """Return the loads of front, middle and rear wheel of either side on the flat [N], from three balances of a side.

    Upright forces; moments about the bogie's pivot; moments of rocker, bogie, wheels and half the body about the
    rocker's pivot, where the differential takes nothing, since both sides turn alike.
    """
    weight = 3 * WHEEL + BOGIE + ROCKER + 0.5 * BODY
    balance = np.array([[1.0, 1.0, 1.0], [0.0, MIDDLE - PIVOT, REAR - PIVOT], [FRONT, MIDDLE, REAR]])
    moment = WHEEL * (FRONT + MIDDLE + REAR) + BOGIE * PIVOT + 0.5 * BODY * CENTRE
    return G * np.linalg.solve(balance, [weight, 0.0, moment])


@pytest.fixture
def six(tmp_path):
    return load_rover(write(tmp_path, rocker_bogie(), {**THREE_AXLES, **ROCKERS}))


def test_static_loads_of_a_rocker_bogie_are_those_of_three_balances_a_side(six):
    loads = dict(zip([wheel.name for wheel in six.wheels], wheel_loads(six, 0.0), strict=True))
    for name, load in zip("fmr", loads_by_hand(), strict=True):
        assert [loads[f"{name}l"], loads[f"{name}r"]] == pytest.approx([load, load], rel=1e-9)


def test_a_load_off_the_middle_goes_to_its_side_and_not_to_an_end(tmp_path):
    """The body's weight 0.1 m to the left: each side's rocker carries its lever's share, the differential the rest."""
    farm = rocker_bogie()
    farm.centre = "0.05 0.1 0.3"
    six = load_rover(write(tmp_path, farm, {**THREE_AXLES, **ROCKERS}))
    loads = wheel_loads(six, 0.0).reshape(3, 2)
    assert (loads[:, 0] - loads[:, 1]).sum() * 0.4 == pytest.approx(BODY * G * 0.1, rel=1e-9)
    assert loads.sum() == pytest.approx((6 * WHEEL + 2 * BOGIE + 2 * ROCKER + BODY) * G)


def test_loads_are_the_slopes_of_the_potential_energy(six):
    """Virtual work, by differences: a joint's angle raises masses and wheels, and no free joint may gain energy."""
    loads, free = wheel_loads(six, 0.0), six.free_dofs
    model = six.under(G).model

    def energy(v):
        data = model.createData()
        q = pin.integrate(model, pin.neutral(model), v)
        pin.forwardKinematics(model, data, q)
        lowest = [data.oMi[wheel.joint].translation[2] for wheel in six.wheels]
        return pin.computePotentialEnergy(model, data, q), np.array(lowest)

    works = {}
    for place in free:
        step = np.zeros(model.nv)
        step[place] = 1e-5
        (up, high), (down, low) = energy(step), energy(-step)
        works[place] = (up - down - loads @ (high - low)) / 2e-5
    # The differential lets the rockers turn against each other alone.
    rockers = works.pop(six.differential.left) - works.pop(six.differential.right)
    assert [*works.values(), rockers] == pytest.approx([0.0] * (len(works) + 1), abs=1e-3)


def test_constraint_rows_hold_the_differential_and_couplings(six):
    links = load_rover("nexus6_links")
    for rover in (six, links):
        rows, angles = constraint_rows(rover), angle_rows(rover)
        assert rows[0, rover.differential.left] == rows[0, rover.differential.right] == 1.0
        assert angles[0, rover.differential.q_left] == angles[0, rover.differential.q_right] == 1.0
        assert np.count_nonzero(rows[0]) == 2
        for row, coupling in zip(rows[1:], rover.couplings, strict=True):
            velocity = np.zeros(rover.model.nv)
            velocity[coupling.leader], velocity[coupling.follower] = 1.0, coupling.ratio
            assert row @ velocity == 0.0
            assert row[coupling.follower] == 1.0


def test_a_raised_wheel_hangs_by_its_height(tmp_path):
    """Middle wheels 30 mm up on a rigid body carry nothing; on bogies they come down, and nothing hangs."""
    farm = cart().wheel("ml", "body", "0 0.35 0.03").wheel("mr", "body", "0 -0.35 0.03")
    rigid = load_rover(write(tmp_path, farm, THREE_AXLES))
    assert hanging_wheels(rigid) == pytest.approx({"ml": 0.03, "mr": 0.03}, abs=1e-9)
    loads = wheel_loads(rigid, 0.0, hanging=("ml", "mr"))
    assert loads[2:4] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert loads.sum() == pytest.approx(26.0 * G)


# Where wheels stand.


def test_wheel_base_and_places_are_those_of_the_description(six):
    places = wheel_places(six)
    assert places["fl"] == pytest.approx([0.5, 0.4, 0.0])
    assert places["mr"] == pytest.approx([-0.05, -0.4, 0.0])
    assert tuple(base_of(six)) == pytest.approx((1.05, 0.8))


@pytest.mark.parametrize("resistance", [0.0, 0.3])
def test_the_effective_track_leaves_no_moment(tmp_path, resistance):
    """Four wheels, axles L and sides B apart: without resistance B + L^2 / B; else the moment once more by hand."""
    rover = load_rover(write(tmp_path, cart(), TWO_AXLES))
    L, B = 0.8, 0.7
    track = effective_track(rover, resistance)
    if not resistance:
        assert track == pytest.approx(B + L**2 / B)
    s = 0.5 * (track - B)
    turning, scrubbing = 0.5 * B * s / math.hypot(s, 0.5 * L), (0.5 * L) ** 2 / math.hypot(s, 0.5 * L)
    assert turning - scrubbing == pytest.approx(0.5 * resistance * B, abs=1e-9)


def test_the_reach_is_that_of_the_cuboid_of_mass_and_inertia(tmp_path):
    """The farm's inertias, 0.1 m s^2, are those of cubes of side s sqrt(0.6); wheels reach along x, the body up."""
    low, high = reach_of(load_rover(write(tmp_path, cart(), TWO_AXLES)))
    wheel, body = 0.5 * 0.15 * math.sqrt(0.6), 0.5 * 0.5 * math.sqrt(0.6)
    assert high == pytest.approx([0.4 + wheel, 0.35 + wheel, 0.2 + body])
    assert low == pytest.approx([-0.4 - wheel, -0.35 - wheel, -max(wheel, body - 0.2)])


@pytest.mark.parametrize(("change", "symmetric"), [("", True), ('mass value="1.001"', False)])
def test_a_wheel_of_another_weight_ends_the_symmetry(tmp_path, change, symmetric):
    farm = cart()
    if change:
        farm.parts[0] = farm.parts[0].replace('mass value="1.0"', change)
    rover = load_rover(write(tmp_path, farm, TWO_AXLES))
    assert is_symmetric(rover.model, rover.mirror) is symmetric
    # Left and right wheels are exchanged, and with them nothing changes sign: all roll forward.
    for left, right in (("fl", "fr"), ("rl", "rr")):
        mounts = rover.mount(left), rover.mount(right)
        assert rover.mirror.perm[mounts[0].dof] == mounts[1].dof
        assert rover.mirror.sign[mounts[0].dof] == 1.0
    assert rover.mirror.sign[:6].tolist() == [1.0, -1.0, 1.0, -1.0, 1.0, -1.0]


# Inertias and units: a fault beyond each line, none short of it.


def one_body(mass, moments, shape=""):
    """A wheel's inertia on all four wheels of a cart."""
    xx, yy, zz = moments
    inertia_text = f'<mass value="{mass}"/><inertia ixx="{xx}" ixy="0" ixz="0" iyy="{yy}" iyz="0" izz="{zz}"/>'
    text = re.sub(r'<mass value="1.0"/><inertia[^>]*/>', inertia_text, cart().urdf)
    return read_tree(text if shape is None else re.sub("<collision>.*?</collision>", shape, text), "own.urdf")


@pytest.mark.parametrize(("moments", "sound"), [((1e-3, 1e-3, 1.999e-3), True), ((1e-3, 1e-3, 2.01e-3), False),
                                                ((1e-3, 0.0, 1e-3), False), ((1e-3, -1e-3, 1e-3), False)])  # fmt: skip
def test_no_body_has_a_moment_above_the_sum_of_the_others(moments, sound):
    assert (list(inertia_faults(one_body(1.0, moments))) == []) is sound


@pytest.mark.parametrize(("gyration", "sound"), [(0.0075, False), (0.0083, True), (1.04, True), (1.1, False)])
def test_a_radius_of_gyration_is_compared_with_the_shapes_and_the_rover(gyration, sound):
    """The wheel's cylinder, r = 0.15 and b = 0.1 m, reaches 0.158 m; the joints lie 1.063 m apart: corners of
    0.8 x 0.7 m. Allowed are 0.05 of the reach to the larger of 1.5 of it and all of the distance."""
    reach, size = math.hypot(0.15, 0.05), math.hypot(0.8, 0.7)
    assert (0.05 * reach < gyration < max(1.5 * reach, size)) is sound
    moment = 2.0 / 3.0 * gyration**2  # of a ball: the trace over 2 m is the square of the radius
    assert (list(unit_faults(one_body(1.0, [moment] * 3, None), size)) == []) is sound


@pytest.mark.parametrize(("gyration", "sound"), [(0.003, False), (0.0035, True)])
def test_without_shapes_a_radius_of_gyration_is_compared_with_the_rover(gyration, sound):
    size = math.hypot(0.8, 0.7)
    assert (0.003 * size < gyration) is sound
    assert (list(unit_faults(one_body(1.0, [2.0 / 3.0 * gyration**2] * 3), size)) == []) is sound


@pytest.mark.parametrize(
    ("distance", "word"), [(0.019, "origins"), (0.021, ""), (19.0, "tonnes"), (20.1, "millimetres")]
)
def test_the_distance_between_the_joints_is_a_rovers(distance, word):
    faults = list(unit_faults(read_tree(cart().urdf, "own.urdf"), distance))
    light = 24.0 / distance**3 > 5000.0
    assert any(word in fault for fault in faults) if word else not faults or light


@pytest.mark.parametrize(("density", "sound"), [(0.09, False), (0.11, True), (4900.0, True), (5100.0, False)])
def test_the_density_is_a_rovers(density, sound):
    """24 kg over the cube of the distance between the joints."""
    tree = read_tree(re.sub("<inertia [^>]*>", "", cart().urdf).replace("<mass", "<inertia ixx='1' ixy='0' ixz='0' "
                     "iyy='1' iyz='0' izz='1'/><mass"), "own.urdf")  # fmt: skip
    distance = (24.0 / density) ** (1.0 / 3.0)
    about_mass = [fault for fault in unit_faults(tree, distance) if "weighs" in fault]
    assert (about_mass == []) is sound


@pytest.mark.parametrize(("mass", "small"), [(0.1, True), (0.12, False)])
def test_a_tenth_of_its_body_is_a_small_part(mass, small):
    """A bracket fixed to a wheel of 1 kg, with an impossible inertia: a note up to a tenth of both, else a fault."""
    farm = cart().link("bracket", "fl_link", "fixed", "0 0 0", mass=0.0)
    inertia = '<inertia ixx="1e-6" ixy="0" ixz="0" iyy="1e-6" iyz="0" izz="1e-5"/>'
    inertial_text = f'<inertial><mass value="{mass}"/>{inertia}</inertial>'
    tree = read_tree(
        farm.urdf.replace('<link name="bracket_link">', f'<link name="bracket_link">{inertial_text}'), "own.urdf"
    )
    assert (mass <= 0.1 * (1.0 + mass)) is small
    assert ("bracket_link" in small_parts(tree)) is small
    assert ("bracket_link" in "".join(inertia_faults(tree))) is not small
    assert ("bracket_link" in "".join(inertia_notes(tree))) is small


def test_the_distance_across_the_joints_is_the_diagonal_of_their_box(six):
    """x from -0.55 to 0.5, y from -0.4 to 0.4, z from 0 to 0.3 m."""
    assert across(six.model) == pytest.approx(math.hypot(1.05, 0.8, 0.3))


# Proposed roles.


def roles(folder, farm):
    return propose(read_tree(farm.urdf, "own.urdf"), folder)


@pytest.mark.parametrize(("height", "axles"), [(0.14, 3), (0.16, 2)])
def test_a_pair_of_wheels_higher_than_a_radius_is_no_axle(tmp_path, height, axles):
    farm = cart().wheel("ml", "body", f"0 0.35 {height}").wheel("mr", "body", f"0 -0.35 {height}")
    assert len(roles(tmp_path, farm).axles) == axles


@pytest.mark.parametrize(("off", "paired"), [(0.07, True), (0.08, False)])
def test_pivots_half_a_radius_off_each_other_are_no_pair(tmp_path, off, paired):
    farm = Farm(mass=40.0)
    for side, y, x in (("l", 0.4, 0.0), ("r", -0.4, off)):
        farm.link(f"bogie_{side}", "body", "revolute", f"{x} {y} 0", mass=1.0)
        farm.wheel(f"f{side}", f"bogie_{side}_link", f"{0.3 - x} 0 0")
        farm.wheel(f"m{side}", f"bogie_{side}_link", f"{-0.3 - x} 0 0").wheel(f"r{side}", "body", f"-0.9 {y} 0")
    proposal = roles(tmp_path, farm)
    assert (proposal.suspension == {"bogie": ("bogie_l", "bogie_r")}) is paired
    assert set(proposal.held_joints) == (set() if paired else {"bogie_l", "bogie_r"})


@pytest.mark.parametrize(("second", "round_"), [(0.125, True), (0.115, False)])
def test_a_shape_a_fifth_out_of_round_is_no_wheel(tmp_path, second, round_):
    """An elliptic prism of half axes 0.15 m and less, as a mesh."""
    import trimesh

    turns = np.linspace(0.0, 2.0 * math.pi, 96, endpoint=False)
    ring = np.column_stack([0.15 * np.cos(turns), np.zeros(96), second * np.sin(turns)])
    trimesh.convex.convex_hull(np.vstack([ring + np.array([0.0, y, 0.0]) for y in (-0.04, 0.04)])).export(
        tmp_path / "rim.stl"
    )
    text = re.sub(r"<origin[^>]*/><geometry><cylinder[^>]*>", '<geometry><mesh filename="rim.stl"/>', cart().urdf)
    tree = read_tree(text, "own.urdf")
    assert (second >= 0.8 * 0.15) is round_
    if round_:
        size = propose(tree, tmp_path).wheels[0].size
        assert (size.r, size.b) == pytest.approx((0.15, 0.08), rel=1e-3)
    else:
        with pytest.raises(UrdfError, match=" 0 joints"):
            propose(tree, tmp_path)


def test_a_size_from_the_inertia_is_that_of_a_solid_cylinder(tmp_path):
    """m r^2 / 2 about the axle and m (3 r^2 + b^2) / 12 across it, of r = 0.12 and b = 0.07 m."""
    axial, across = 0.5 * 0.12**2, (3.0 * 0.12**2 + 0.07**2) / 12.0
    text = re.sub("<collision>.*?</collision>", "", cart().urdf)
    text = re.sub(r'<mass value="1.0"/><inertia[^>]*/>', f'<mass value="1.0"/><inertia ixx="{across}" ixy="0" ixz="0" '
                  f'iyy="{axial}" iyz="0" izz="{across}"/>', text)  # fmt: skip
    text = re.sub('name="([fr][lr])"', r'name="wheel_\1"', text)
    size = propose(read_tree(text, "own.urdf"), tmp_path).wheels[0].size
    assert (size.r, size.b) == pytest.approx((0.12, 0.07))
