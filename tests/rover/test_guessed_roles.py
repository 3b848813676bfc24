"""Where `new-rover` draws its lines: what is a wheel, which wheels are an axle, what is held and where."""

import math
import re

import pytest

from rover_pin.base.errors import UrdfError
from rover_pin.rover.description.tree import read_tree
from rover_pin.rover.proposal.new_rover import new_rover
from rover_pin.rover.proposal.propose import propose
from tests.rover import farm as made

Farm = made.Farm


@pytest.fixture
def roles(tmp_path):
    """Return what is proposed of a URDF's text."""

    return lambda urdf: propose(read_tree(urdf, "own.urdf"), tmp_path)


def stops(low, high):
    return f'<limit lower="{low}" upper="{high}" effort="9" velocity="9"/>'


@pytest.mark.parametrize(("back", "r"), [(0.5, 0.15), (0.0, 0.17)])
def test_wheels_half_a_radius_apart_or_of_two_sizes_are_none(roles, back, r):
    farm = made.cart().wheel("ml", "body", "0 0.35 0").wheel("mr", "body", f"{back * 0.15} -0.35 0", r=r)
    assert len(roles(farm.urdf).axles) == 2
    farm = Farm().wheel("fl", "body", "0.4 0.3 0").wheel("fr", "body", f"{0.4 - back * 0.15} -0.3 0", r=r)
    farm.wheel("rl", "body", "-0.4 0.3 0").wheel("rr", "body", "-0.4 -0.3 0")
    with pytest.raises(UrdfError, match="4 joints"):
        roles(farm.urdf)


@pytest.mark.parametrize(("roll", "base"), [(0.0, 0.0), (math.pi, math.pi)])
def test_of_what_weighs_nothing_the_joints_tell_which_side_is_up(roles, roll, base):
    """A mast stands on a body without masses, whose base link is turned over or not."""
    farm = Farm().link("mast", "body", "fixed", "0 0 0.6")
    for name, x, y in (("fl", 0.4, 0.3), ("fr", 0.4, -0.3), ("rl", -0.4, 0.3), ("rr", -0.4, -0.3)):
        farm.wheel(name, "body", f"{x} {y} -0.4")
    text = re.sub("<inertial>.*?</inertial>", "", farm.urdf)
    text = text.replace('name="body"', 'name="hull"').replace('link="body"', 'link="hull"')
    joint = '<joint name="s" type="fixed"><parent link="body"/><child link="hull"/>'
    turned = f'<link name="body"/>{joint}<origin rpy="{roll} 0 0"/></joint></robot>'
    assert roles(text.replace("</robot>", turned)).base_rpy == (base, 0.0, 0.0)


@pytest.mark.parametrize("side", ["l", "r"])
@pytest.mark.parametrize(("low", "high", "at"), [(-0.8, 0.8, 0.0), (0.2, 0.8, 0.2), (-0.8, -0.1, -0.1)])
def test_a_bogie_on_one_side_alone_is_held_within_its_stops(roles, side, low, high, at):
    farm = Farm()
    for local, y in (("l", 0.4), ("r", -0.4)):
        parent, back = "body", 0.0
        if local == side:
            farm.link("bogie", "body", "revolute", f"0.25 {y} 0", mass=1.0, limit=stops(low, high))
            parent, back = "bogie_link", 0.25
        for name, x, hangs in (("f", 0.5, parent), ("m", 0.0, parent), ("r", -0.5, "body")):
            at_x, at_y = (x - back, 0.0) if hangs != "body" else (x, y)
            farm.wheel(f"{name}{local}", hangs, f"{at_x} {at_y} 0")
    role_table = roles(farm.urdf)
    assert role_table.held_joints == {"bogie": at}
    assert role_table.reasons["bogie"] == "it carries wheels but has no partner on the other side"


@pytest.mark.parametrize(("b", "has_own_table"), [(0.1015, False), (0.103, True)])
def test_an_axle_of_another_width_alone_gets_a_table_of_its_own(tmp_path, b, has_own_table):
    """By more than a fiftieth: less is how a mesh was cut."""
    farm = Farm().wheel("fl", "body", "0.4 0.3 0").wheel("fr", "body", "0.4 -0.3 0")
    farm.wheel("rl", "body", "-0.4 0.3 0", b=b).wheel("rr", "body", "-0.4 -0.3 0", b=b)
    (tmp_path / "own.urdf").write_text(farm.urdf)
    new_rover(tmp_path / "own.urdf")
    assert ("[wheel.rear]" in (tmp_path / "own.toml").read_text()) is has_own_table
