"""What is worked out once for a rover stays as it was, whatever is driven, and is not taken for another's."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from rover_pin.effects.gravity_tilt import GravityTilt
from rover_pin.effects.point_mass import PointMass
from rover_pin.rover.rover import load_rover
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.compiled.rover_numbers import armed, rover_fields
from rover_pin.simulation.model.motor import Motor
from rover_pin.simulation.simulate import simulate
from rover_pin.simulation.start.place import Start, settled


def kernel_of(model):
    return Kernel(model, settled(model, Start()), 0.005, symmetric=False)


def test_a_drive_and_a_rest_write_nothing_that_drives_share():
    case = scenario("turn", duration=1.0)
    shared = kernel_of(case.model).fixed
    before = {name: array.copy() for name, array in shared.keep.items()}
    plain = bytes(shared.struct)
    trace = case.drive()
    assert kernel_of(case.model).fixed is shared
    assert bytes(shared.struct) == plain
    assert all(np.array_equal(array, before[name]) for name, array in shared.keep.items())
    assert np.array_equal(case.drive()["body_x"], trace["body_x"])


@pytest.mark.parametrize(
    "change",
    [
        lambda model: model.having(PointMass(m=1.0, shift_x=0.02)),
        lambda model: model.having(GravityTilt(rise_x=0.05)),
        lambda model: dataclasses.replace(model, gravity=1.62),
        lambda model: dataclasses.replace(model, motor=Motor(gear=100.0, rotor_inertia=2e-8)),
    ],
    ids=["ballast", "tilt", "moon", "rotor"],
)
def test_a_drive_between_two_others_of_the_rover_changes_neither(change):
    model = scenario("flat").model
    drives = [simulate(each, lambda reading: np.full(6, 0.5), 0.5)["body_x"] for each in (model, change(model), model)]
    assert np.array_equal(drives[0], drives[2])
    assert not np.array_equal(drives[0], drives[1])


# --- what a rover decides of the step, against Pinocchio --------------------------------------------------------------


@pytest.fixture(scope="module", params=["nexus6", "cart", "nexus6_links"])
def rover(request):
    path = Path(__file__).parents[2] / "urdf" / "nexus6_links.toml"
    return load_rover(path if request.param == "nexus6_links" else request.param)


def fields_of(rover, rigid=True, pushed=False):
    found = rover_fields(rover, 2e-3, 1.5, rigid, pushed)
    return found, {name: np.asarray(array) for name, array in found.keep.items()}


def joint_at(rover, dof):
    return next(each for each in list(rover.model.joints)[2:] if each.idx_v == dof)


def test_wheel_is_moved_by_the_joints_above_it_and_turns_its_rim(rover):
    found, keep = fields_of(rover)
    model, random = armed(rover, 2e-3), np.random.default_rng(1)
    data, q = model.createData(), pin.randomConfiguration(model, -np.ones(model.nq), np.ones(model.nq))
    M = pin.crba(model, data, q)
    q = pin.integrate(model, q, random.normal(size=model.nv))
    pin.computeJointJacobians(model, data, q)
    struct, wheels = found.struct, rover.wheels
    assert (struct.n_wheels, struct.nq, struct.nv) == (len(wheels), model.nq, model.nv)
    assert struct.n_axles == len({mount.axle for mount in wheels})
    columns = keep["cols"].reshape(len(wheels), struct.n_cols)
    for at, mount in enumerate(wheels):
        J = pin.getJointJacobian(model, data, mount.joint, pin.LOCAL_WORLD_ALIGNED)
        moves = np.flatnonzero(np.abs(J).max(axis=0) > 1e-12)
        assert sorted(columns[at][: keep["col_count"][at]]) == moves.tolist()
        assert (keep["wheel_dof"][at], keep["axle"][at], keep["radius"][at]) == (mount.dof, mount.axle, mount.wheel.r)
        assert keep["rim_inertia"][at] == pytest.approx(M[mount.dof, mount.dof])
        own = keep["kinds"].reshape(struct.n_kinds, -1)[keep["kind"][at]]
        assert own.tolist() == [float(value) for value in mount.wheel.values().values()]
    assert struct.n_cols == max(keep["col_count"])
    assert struct.n_kinds == len({(float(mount.wheel.r), float(mount.wheel.b)) for mount in wheels})
    assert np.array(model.armature).tolist() == [2e-3 * (dof in keep["wheel_dof"]) for dof in range(model.nv)]
    assert not np.array(rover.model.armature).any(), "the rover's own model is left alone"


def test_joints_have_their_places_and_their_images(rover):
    found, keep = fields_of(rover)
    joints = list(rover.model.joints)[2:]
    assert found.struct.n_joints == len(joints)
    assert keep["joint_dof"].tolist() == [each.idx_v for each in joints]
    assert keep["joint_q"].tolist() == [each.idx_q for each in joints]
    assert keep["joint_unbounded"].tolist() == [int(each.nq == 2) for each in joints]
    perm, sign = rover.mirror
    assert keep["mirror_index"].tolist() == list(perm)
    assert keep["mirror_sign"].tolist() == list(sign)


@pytest.mark.parametrize("rigid", [True, False])
@pytest.mark.parametrize("pushed", [True, False])
def test_differential_and_links_tie_joints_in_solving_order(rover, rigid, pushed):
    """Each pair follows its leader, a rocker the other backwards: the others are free, each once."""
    found, keep = fields_of(rover, rigid, pushed)
    ties = [(each.follower, each.leader, each.ratio) for each in rover.couplings]
    differential = rover.differential if rigid else None
    if differential is not None:
        ties.append((differential.right, differential.left, -1.0))
    count = found.struct.n_coupled
    assert count == len(ties)
    pairs = keep["coupled_dof"].reshape(-1, 2)[:count].tolist()
    assert list(zip(pairs, keep["coupled_ratio"][:count], strict=True)) == [([a, b], ratio) for a, b, ratio in ties]
    assert found.struct.differential_left == (-1 if differential is None else differential.left)
    free, above = keep["free_order"].tolist(), keep["free_above"].reshape(found.struct.n_free, -1)
    assert sorted(free) == sorted(set(range(rover.model.nv)) - {follower for follower, _, _ in ties})
    for row, number, dof in zip(above, keep["free_count"], free, strict=True):
        left = row[:number].tolist()
        assert len(set(left)) == number
        assert {free.index(each) for each in left} <= set(range(free.index(dof) + 1, len(free)))
    if pushed:
        body = [*range(6), *keep["stop_dof"][: found.struct.n_stops]]
        inside = [dof for dof in free if dof in body]
        for dof in inside[:-1]:
            row = free.index(dof)
            later = set(inside[inside.index(dof) + 1 :])
            assert later <= set(above[row][: keep["free_count"][row]]), "what pushes the body ties all of it together"


def test_servos_and_stops_are_those_of_the_joints(rover):
    found, keep = fields_of(rover, pushed=True)
    struct, model = found.struct, rover.model
    servos = [mount.steer_dof for mount in rover.wheels if mount.steer_dof is not None]
    driven = {mount.dof for mount in rover.wheels} | set(servos)
    stops = [dof for dof in range(6, model.nv) if dof not in driven]
    assert (struct.n_servos, struct.n_stops, struct.n_body) == (len(servos), len(stops), 6 + len(stops))
    assert fields_of(rover)[0].struct.n_body == 0
    places = {dof: joint_at(rover, dof).idx_q for dof in (*servos, *stops)}
    assert keep["servo_dof"][: len(servos)].tolist() == servos
    assert keep["servo_q"][: len(servos)].tolist() == [places[dof] for dof in servos]
    assert keep["stop_dof"][: len(stops)].tolist() == stops
    assert keep["stop_q"][: len(stops)].tolist() == keep["body_q"][: len(stops)].tolist() == [places[d] for d in stops]
    assert keep["body_dof"].tolist() == [*range(6), *stops]
    limits = [each[places[dof]] for dof in stops for each in (model.lowerPositionLimit, model.upperPositionLimit)]
    assert keep["stop_limits"][: 2 * len(stops)].tolist() == limits
    gains = [*keep["servo_gain"], *keep["stop_gain"]]
    assert gains == pytest.approx([1.5 * 20.0, 1.5 * 0.2, 1.5 * 50.0, 1.5 * 1.0])


@pytest.mark.parametrize("pushed", [False, True])
@pytest.mark.parametrize("name", ["nexus6", "cart"])
def test_free_velocities_couple_by_supports_and_common_pushes(name, pushed):
    """A tree's zeros stay zeros: what moves a joint is what its Jacobian says. Neither rover has links."""
    rover = load_rover(name)
    found, keep = fields_of(rover, rigid=False, pushed=pushed)
    assert found.struct.n_coupled == 0
    model, random = rover.model, np.random.default_rng(2)
    data, q = model.createData(), pin.integrate(model, pin.neutral(model), random.normal(size=model.nv))
    pin.computeJointJacobians(model, data, q)
    above = {dof: set(range(dof)) for dof in range(6)}
    for joint in range(2, model.njoints):
        dof = model.joints[joint].idx_v
        moves = np.flatnonzero(np.abs(pin.getJointJacobian(model, data, joint, pin.LOCAL)).max(axis=0) > 1e-12)
        above[dof] = set(moves.tolist()) - {dof}
    together = {*range(6), *keep["stop_dof"].tolist()} if pushed else set()
    for dof in together:
        above[dof] |= {each for each in together if each < dof}
    rows = keep["free_above"].reshape(found.struct.n_free, -1)
    for dof, number, row in zip(keep["free_order"].tolist(), keep["free_count"], rows, strict=True):
        assert set(row[:number].tolist()) == above[dof], dof


def test_what_drives_of_a_rover_share_cannot_be_written(rover):
    for array in fields_of(rover)[0].keep.values():
        assert not array.flags.writeable
