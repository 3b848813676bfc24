"""The classes that describe a proposed rover (wheels, axles, roles of joints), and the tree of a URDF's joints.

The tree (`Topology`) answers which joints another joint carries.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from rover_pin.rover.description.tree import Joint, UrdfTree
from rover_pin.rover.proposal.frames import rotation
from rover_pin.rover.proposal.wheel_shape import WheelSize


@dataclass(frozen=True)
class GuessedWheel:
    """A joint that is proposed as a wheel's joint, with the centre and the size of the wheel."""

    joint: str
    centre: np.ndarray
    "centre of the wheel in axes x forward, y left, z up [3] (m)"
    size: WheelSize


@dataclass(frozen=True)
class GuessedAxle:
    """A proposed axle: two wheels opposite each other, and the joints that steer them."""

    name: str
    wheels: tuple[GuessedWheel, GuessedWheel]
    "the left wheel and the right wheel"
    steering: tuple[str, str] | None
    """joints that steer the left and the right wheel; None if the wheels are not steered"""


@dataclass
class Proposal:
    """The proposed roles of the joints of a URDF (wheel, steering, suspension, held), with the reason for each
    guess.
    """

    base: str
    "link whose frame is the base frame"
    base_rpy: tuple[float, float, float]
    """rotation (roll, pitch, yaw) that turns the base link's axes to x forward, y left, z up [rad]"""
    axles: tuple[GuessedAxle, ...]
    suspension: dict[str, tuple[str, ...]] = field(default_factory=dict)
    """name of a suspension angle -> its joints (left, right), or its one joint in the middle"""
    differential: str = ""
    """name in `suspension` of the pair of rockers that a differential joins; empty if there is no differential"""
    coupled: dict[str, tuple[str, float]] = field(default_factory=dict)
    """name of a joint -> the joint of the suspension that it follows, and the ratio of their angles"""
    held_joints: dict[str, float] = field(default_factory=dict)
    """name of a joint -> angle [rad] or travel [m] at which it is fixed"""
    cut: tuple[str, ...] = ()
    """joints that close a loop, and are removed because a URDF is a tree"""
    reasons: dict[str, str] = field(default_factory=dict)
    """name of a joint, or of an entry such as "front" -> reason for the guess, for the comments in the TOML"""
    skid: bool = False
    """whether the rover has no steering, and turns by different speeds of its two sides"""

    @property
    def wheels(self) -> list[GuessedWheel]:
        """Return the proposed wheels, in the order from front to rear, left before right."""
        return [wheel for axle in self.axles for wheel in axle.wheels]


class Topology:
    """The tree of a URDF's joints, with positions in the frame of the rover's base link.

    Joints between a world link and the rover are left out. If several joints lead to one link, which closes a loop,
    only the first of these joints is kept, and the others are in `cut`.

    Attributes
    ----------
    tree : UrdfTree
        The URDF.
    base : str
        Name of the base link.
    places : dict
        Link -> transform to the frame of the base link at zero angles [4, 4].
    joints : dict
        Name -> joint, without the joints in `cut`.
    above : dict
        Link -> the joint that leads to it.
    cut : tuple of str
        Joints that close a loop.
    dropped : set of str
        Joints between a world link and the rover.
    """

    def __init__(self, tree: UrdfTree):
        self.tree, self.places = tree, tree.placements
        # If several joints have one child link, the first joint of the file is kept: in reversed order, it overwrites
        # the others.
        first = {joint.child: joint.name for joint in reversed(tree.joints)}
        self.cut = tuple(joint.name for joint in tree.joints if first[joint.child] != joint.name)
        self.joints = {joint.name: joint for joint in tree.joints if joint.name not in self.cut}
        self.above = {joint.child: joint for joint in self.joints.values()}
        # A simulator may put world links above the base. All positions are measured from the base.
        world = tree.world_joints or [j for j in tree.joints if j.kind == "floating" and j.parent in tree.roots][:1]
        self.base = world[-1].child if world else (tree.roots or [""])[0]
        self.dropped = {joint.name for joint in world}
        if self.base in self.places:
            inverse = np.linalg.inv(self.places[self.base])
            self.places = {name: inverse @ place for name, place in self.places.items()}

    def ancestors(self, joint: str) -> list[Joint]:
        """Return the moving joints that carry a joint, in the order from the nearest one to the base."""
        ancestors: list[Joint] = []
        link = self.joints[joint].parent
        # The number of joints bounds the loop, because the joints of a faulty URDF may form a ring.
        while link in self.above and len(ancestors) <= len(self.joints):
            up = self.above[link]
            if up.moves and up.name not in self.dropped:
                ancestors.append(up)
            link = up.parent
        return ancestors

    @property
    def moving(self) -> list[Joint]:
        """Return the joints that move. The joints between a world link and the rover are not returned."""
        return [joint for joint in self.joints.values() if joint.moves and joint.name not in self.dropped]

    def below(self, joint: str, wheels: Sequence[str]) -> list[str]:
        """Return those wheels that a joint carries. `wheels` are the names of the joints of all wheels that are
        considered.
        """
        return [wheel for wheel in wheels if joint in [up.name for up in self.ancestors(wheel)]]

    def axis(self, joint: Joint, rpy: tuple[float, float, float]) -> np.ndarray:
        """Return the unit vector of a joint's axis [3] in axes that point x forward, y left, z up.

        `rpy` is the rotation (roll, pitch, yaw) that turns the base link's axes to these axes [rad].
        """
        unit = joint.axis / max(float(np.linalg.norm(joint.axis)), 1e-12)
        return np.asarray(rotation(rpy) @ self.places[joint.child][:3, :3] @ unit)

    def centre(self, joint: Joint, rpy: tuple[float, float, float]) -> np.ndarray:
        """Return the position of a joint [3] (m) in axes that point x forward, y left, z up.

        `rpy` is the rotation (roll, pitch, yaw) that turns the base link's axes to these axes [rad].
        """
        return np.asarray(rotation(rpy) @ self.places[joint.child][:3, 3])
