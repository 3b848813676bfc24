"""Setting down: from where a wheel touches, to rest or to a slide, or refused."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from rover_pin.base.errors import SimulationError
from rover_pin.effects.pivot_friction import PivotFriction
from rover_pin.effects.point_mass import PointMass
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.start.place import Rest, Start, hovering, relaxed, settled

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


def test_every_way_to_stand_is_met():
    found = set()
    for shape, options, start in CASES.values():
        model = scenario(shape, soil="table-1", **options).model
        found.add(relaxed(model, hovering(model, start), start.yaw, False))
    assert found == {Rest.RESTS, Rest.SLIDES}


def test_a_rover_that_cannot_stand_is_refused():
    heavy = scenario("flat", soil="table-1").model.having(PointMass(m=20.0, shift_x=0.9))
    assert relaxed(heavy, hovering(heavy, Start()), 0.0, False) is Rest.NEVER
    with pytest.raises(SimulationError, match=r"does.*settle"):
        settled(heavy, Start())


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


def test_pivot_friction_is_ignored_while_a_rover_is_placed():
    """So much that its bogies would stay where they were in the air."""
    model = scenario("rocks", soil="table-1").model
    bare, stiff = (settled(each, Start(0.7)) for each in (model, model.having(PivotFriction(tau_c=0.2, b=5.0))))
    assert np.array_equal(bare.q, stiff.q)
    assert np.array_equal(bare.contact, stiff.contact)
