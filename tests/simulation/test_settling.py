"""Setting down in one call of the compiled step, against the same method step by step in Python."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pinocchio as pin
import pytest

from rover_pin.base.errors import SimulationError
from rover_pin.effects.pivot_friction import PivotFriction
from rover_pin.effects.point_mass import PointMass
from rover_pin.effects.slip import SIDEWAYS_SHARE
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.start.place import LOCKED, Rest, Start, _fields, hovering, relaxed, settled
from rover_pin.terrain.terrain import HeightGrid
from tests.simulation import plain_relaxation as plain

CASES = {
    "flat": ("flat", {}, Start()),
    "ditch, with the front wheels in it": ("ditch", {}, Start(0.45, 0.0, 0.0)),
    "ditch, aslant": ("ditch", {}, Start(0.4, 0.0, 0.7)),
    "stiff shear": ("flat", {"soil.k": 0.0005}, Start(0.0, 0.0, 0.2)),
    "soft ground": ("flat", {"soil.k_1": 2e4}, Start()),
    "a slope that holds": ("incline", {"terrain.angle_deg": 5.0}, Start()),
    "a slope that does not": ("park", {"terrain.angle_deg": 25.0}, Start()),
    "across a slope": ("incline", {"terrain.angle_deg": 4.0}, Start(0.0, 0.0, 1.2)),
    "along a slope to the side": ("cross-slope", {"terrain.angle_deg": 4.0}, Start(0.0, 0.0, 0.6)),
    "cart": ("flat", {"rover": "cart"}, Start(0.0, 0.0, -0.4)),
    "rocks": ("rocks", {}, Start(0.7, 0.0, 0.0)),
}


@pytest.mark.parametrize("name", CASES)
def test_one_call_comes_to_the_rest_of_the_method_in_python(name):
    shape, options, start = CASES[name]
    model = scenario(shape, soil="table-1", **options).model
    ends, how = [], []
    for rest in (relaxed, plain.set_down):
        state = hovering(model, start)
        how.append(rest(model, state, start.yaw, False))
        ends.append(state)
    assert Rest(how[0]).name == how[1]
    for part in ("q", "v", "contact", "motor"):
        assert getattr(ends[0], part) == pytest.approx(getattr(ends[1], part), rel=0.0, abs=1e-11), part


def test_every_way_to_stand_is_met():
    found = set()
    for shape, options, start in CASES.values():
        model = scenario(shape, soil="table-1", **options).model
        found.add(relaxed(model, hovering(model, start), start.yaw, False))
    assert found == {Rest.RESTS, Rest.SLIDES}


def test_a_rover_that_cannot_stand_is_refused_by_both():
    model = scenario("flat", soil="table-1").model
    heavy = model.having(PointMass(m=20.0, shift_x=0.9))
    state, other = hovering(heavy, Start()), hovering(heavy, Start())
    assert relaxed(heavy, state, 0.0, False) is Rest.NEVER
    assert plain.set_down(heavy, other, 0.0, False) == "NEVER"
    with pytest.raises(SimulationError, match=r"does.*settle"):
        settled(heavy, Start())


def test_heights_that_overflow_are_no_crash():
    """A place is looked up in a grid although the rover was thrown away by a step: it is taken again, shorter."""
    model = scenario("flat", soil="table-1").model
    z = np.zeros((40, 40))
    z[::2] = 1e-3
    grid = dataclasses.replace(model, terrain=HeightGrid(-1.0, -1.0, 0.05, 0.05, z))
    assert np.isfinite(settled(grid, Start()).q).all()


@pytest.mark.parametrize("case", ["flat", "ditch, aslant", "across a slope", "cart", "rocks"])
def test_a_rover_is_set_down_from_where_its_lowest_wheel_touches(case):
    """Its centre a radius above the ground under it, whatever the slope, and none of the others below that."""
    shape, options, start = CASES[case]
    model = scenario(shape, soil="table-1", **options).model
    state, data = hovering(model, start), model.rover.model.createData()
    pin.forwardKinematics(model.rover.model, data, state.q)
    gaps = []
    for mount in model.rover.wheels:
        x, y, z = data.oMi[mount.joint].translation
        gaps.append(z - float(mount.wheel.r) - float(model.terrain.height(x, y)))
    assert min(gaps) == pytest.approx(0.0, abs=1e-12)
    assert state.q[:2].tolist() == [start.x, start.y]
    assert not state.v.any()


@pytest.mark.parametrize("name", ["nexus6", "cart"])
def test_speeds_and_slides_are_counted_in_wheels(name):
    """A turn moves the furthest wheel by its distance; what holds slides by at most ten k of the stiffest shear."""
    model = scenario("bump", rover=name, **{"soil.k": 0.02}).model
    model = model.replace(soils=(*model.soils[:-1], model.soils[-1].replace(k=0.007)))
    state, rover = hovering(model, Start()), model.rover
    data = rover.model.createData()
    pin.forwardKinematics(rover.model, data, pin.neutral(rover.model))
    far = max(math.hypot(*data.oMi[mount.joint].translation) for mount in rover.wheels)
    kernel = Kernel(model, state, 1.0, False)
    usual = np.array(kernel.armature)
    fields = _fields(model, state, kernel)
    held = np.isin(np.arange(rover.model.nv), [0, 1, 5, *(mount.dof for mount in rover.wheels)])
    expected = np.where(np.arange(rover.model.nv) < 3, 1.0, far)
    np.testing.assert_allclose(fields["lengths"], np.where(held, 0.0, expected))
    np.testing.assert_allclose(fields["free_lengths"], [1.0, 1.0, far])
    np.testing.assert_array_equal(fields["free_rotors"], usual[[0, 1, 5]])
    np.testing.assert_array_equal(kernel.armature, np.where(held, LOCKED, usual))
    radius = float(rover.wheels[0].wheel.r)
    assert fields["radius"] == radius
    assert fields["most_slid"] == pytest.approx(10.0 * 0.007 / radius)
    assert fields["most_shear"].tolist() == [1.0, 1.0 / SIDEWAYS_SHARE]


def test_pivot_friction_is_ignored_while_a_rover_is_placed():
    """So much that its bogies would stay where they were in the air."""
    model = scenario("rocks", soil="table-1").model
    bare, stiff = (settled(each, Start(0.7)) for each in (model, model.having(PivotFriction(tau_c=0.2, b=5.0))))
    assert np.array_equal(bare.q, stiff.q)
    assert np.array_equal(bare.contact, stiff.contact)
