"""The suspension as the body's law counts it: joints, names and what the differential ties."""

import pytest

from rover_pin.rover.rover import load_rover
from rover_pin.simulation.compiled.suspension import joint_strength, joints_of, suspension_dofs, suspension_places


def test_the_differential_ties_the_rockers_of_the_paper_s_rover():
    rover = load_rover("nexus6")
    joints = joints_of(rover)
    assert joints.number == len(joints.names) == len(suspension_dofs(rover)) == 4
    assert joints.rockers is not None
    assert [joints.names[at] for at in joints.rockers] == ["rocker_l", "rocker_r"]
    assert {rover.angles[name]: name for name in joints.names} == dict(
        zip(suspension_places(rover), joints.names, strict=True)
    )


def test_a_rover_without_joints_has_no_suspension():
    joints = joints_of(load_rover("cart"))
    assert joints.rockers is None
    assert joints.number == 0
    assert joints.names == ()


@pytest.mark.parametrize("name", ["nexus6", "cart"])
def test_gains_scale_with_mass_and_wheel_from_5_8_kg_on_45_mm(name):
    rover = load_rover(name)
    wanted = rover.mass * float(rover.wheels[0].wheel.r) / (5.8 * 0.045)
    assert joint_strength(rover) == pytest.approx(wanted, rel=1e-5)
