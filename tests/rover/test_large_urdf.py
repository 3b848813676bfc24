"""A URDF of any size is read in bounded time, or refused with the limit that it exceeds."""

import time

import numpy as np
import pytest

from rover_pin.base.errors import UrdfError
from rover_pin.rover.description.tree import MAX_LINKS, MAX_MOVING, MAX_URDF, read_tree
from rover_pin.rover.urdf_check import check_urdf

LINK = (
    '<link name="l{0}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    "</link>"
)
JOINT = (
    '<joint name="j{0}" type="{2}"><parent link="l{1}"/><child link="l{0}"/><origin xyz="0 0 0.1"/><axis xyz="0 1 0"/>'
    "</joint>"
)


def chain(count, kind, order=1):
    """Return a chain of links, its joints in the file from the root outwards or the other way."""
    joints = [JOINT.format(at, at - 1, kind) for at in range(1, count)]
    return "<robot name='x'>" + "".join([*(LINK.format(at) for at in range(count)), *joints[::order]]) + "</robot>"


@pytest.mark.parametrize(
    ("count", "kind", "limit"),
    [(MAX_LINKS + 1, "fixed", MAX_LINKS), (5_000, "fixed", MAX_LINKS), (MAX_MOVING + 2, "continuous", MAX_MOVING)],
)
def test_a_longer_chain_is_refused_with_the_limit(tmp_path, count, kind, limit):
    (tmp_path / "x.urdf").write_text(chain(count, kind))
    begin = time.process_time()
    (fault,) = check_urdf(tmp_path / "x.urdf").faults
    assert time.process_time() - begin < 20.0
    assert f"{limit} is the maximum" in fault


def test_a_longer_text_is_refused():
    with pytest.raises(UrdfError, match=str(MAX_URDF)):
        read_tree(f"<robot name='x'>{' ' * MAX_URDF}</robot>", "x.urdf")


@pytest.mark.parametrize("order", [1, -1], ids=["outwards", "inwards"])
def test_the_longest_chain_is_placed_link_by_link(order):
    tree = read_tree(chain(MAX_LINKS, "fixed", order), "x.urdf")
    placements = tree.placements
    assert len(placements) == len(tree.rigid_group("l0")) == MAX_LINKS
    assert np.allclose([placements[f"l{at}"][2, 3] for at in range(MAX_LINKS)], 0.1 * np.arange(MAX_LINKS))


def test_the_longest_chain_that_moves_is_checked_within_seconds(tmp_path, monkeypatch):
    """Both readers compare every link at five configurations, which took a minute."""
    monkeypatch.setenv("ROVER_PIN_CACHE", str(tmp_path / "own_cache"))
    (tmp_path / "x.urdf").write_text(chain(MAX_MOVING + 1, "continuous"))
    begin = time.process_time()
    assert check_urdf(tmp_path / "x.urdf").ok
    assert time.process_time() - begin < 20.0
