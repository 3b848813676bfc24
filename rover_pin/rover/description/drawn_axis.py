"""Check that a wheel's joint turns about the axis of the cylinder that is drawn for its link, and about the symmetry
axis of the link's inertia.

The axis of the joint, the drawing of its link and the inertia of the link all show the axis of the wheel. If they
contradict each other, the URDF has an error, and only its author knows which of them is wrong. A frequent error is a
missing `<axis>`: the joint then turns about x.
"""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from rover_pin.rover.description.joint_forms import ALONG
from rover_pin.rover.description.tree import Body, Joint, Shape, UrdfTree

MAX_OFFSET = 0.5
"""Largest distance between a joint and the axis of a cylinder that may be its wheel, divided by the cylinder's radius.
A cylinder at a larger distance does not count as a wheel, because a wheel turns about its own axis. The value allows
for inaccurate drawings."""
MAX_LENGTH = 4.0
"""Largest length of a cylinder that may be a wheel, divided by its radius. Longer cylinders are spokes or axles."""
MIN_RIM = 0.8
"""Smallest radius of a cylinder that counts as the rim of a wheel, as a fraction of the radius of the largest cylinder.
Smaller cylinders are hubs or motors. The same number is the smallest ratio of the two smaller moments of inertia of a
disc, which are equal for a perfect disc."""
MIN_DISC_RATIO = 1.3
"""Smallest ratio of a disc's moment of inertia about its axis to the larger of its two other moments. If the ratio is
smaller, as for a wide wheel, the inertia does not show the axis."""


class Cylinder(NamedTuple):
    """A cylinder that is drawn by a link and turns with a joint, so that it may be a wheel."""

    link: str
    drawn: str
    """element of the link that contains the cylinder: visual or collision"""
    radius: float
    "radius of the cylinder [m]"
    direction: np.ndarray
    "unit vector of the cylinder's axis in the joint's frame [3]"


def might_be_wheels(tree: UrdfTree) -> list[str]:
    """Return the names of the joints that may carry a wheel, judged by geometry alone.

    Such a joint can turn by a full turn, carries no other moving joint, and turns a cylinder that is not longer than
    its diameter.
    """
    moving = [joint for joint in tree.joints if joint.moves]
    return [
        joint.name
        for joint in moving
        if joint.turns_fully
        and not any(other.parent in tree.rigid_group(joint.child) for other in moving)
        # A wheel is a cylinder whose length does not exceed its diameter.
        and any(shape.kind == "cylinder" and shape.size[1] <= 2.0 * shape.size[0] for shape in _shapes_of(tree, joint))
    ]


def axis_against_drawing(tree: UrdfTree, wheels: Iterable[str]) -> Iterator[str]:
    """Yield a fault for each wheel joint whose axis contradicts the cylinder that its link draws, or the inertia of its
    link.

    `wheels` are the names of the joints. The inertia is used only if the link draws nothing and the joint has no
    `<axis>`.
    """
    for name in wheels:
        # `structure_faults` reports a joint whose axis has length 0.
        joint = tree.joint(name)
        if joint is None or not np.any(joint.axis):
            continue
        agreeing, across = _drawings(tree, joint)
        if across and not agreeing:
            yield _fault(joint, f"the cylinder of r = {across[0].radius:.3g} m", across[0].link, across[0].direction)
        elif not across and not agreeing and not joint.axis_written and not _shapes_of(tree, joint):
            # Without a drawing, the inertia of a disc shows the axis, unless the URDF states the axis itself.
            body = next((link.body for link in tree.links if link.name == joint.child), None)
            spin = None if body is None else disc_axis(body)
            if spin is not None and abs(spin @ _unit(joint.axis)) < ALONG:
                yield _fault(joint, "the axis of the disc-like inertia", joint.child, spin)


def visual_against_collision(tree: UrdfTree, wheels: Iterable[str]) -> Iterator[str]:
    """Yield a note for each wheel whose `<visual>` and `<collision>` are cylinders with different axes. `wheels` are
    the names of the wheels' joints.
    """
    for name in wheels:
        joint = tree.joint(name)
        if joint is None or not np.any(joint.axis):
            continue
        agreeing, across = _drawings(tree, joint)
        # The two drawings contradict each other only if one of them agrees with the axis.
        if across and agreeing:
            yield (
                f"link '{across[0].link}' draws its wheel twice: the <{agreeing[0]}> turns about the axis of joint "
                f"'{name}', but the cylinder of the <{across[0].drawn}> lies along {_words(across[0].direction)}; "
                f"correct the <origin rpy> of the <{across[0].drawn}>. The axis of the joint is used."
            )


def _drawings(tree: UrdfTree, joint: Joint) -> tuple[list[str], list[Cylinder]]:
    """Compare the two drawings of a joint's wheel, its visual and its collision shapes, with the axis of the joint.

    Returns
    -------
    agreeing : list of str
        The drawings ("visual", "collision") with a cylinder of the size of the rim along the axis of the joint.
    across : list of Cylinder
        For each drawing without such a cylinder along the axis: its largest cylinder.

    A drawing with a mesh is in neither list, because the mesh may be the tyre, and the cylinder a motor.
    """
    links, places = {link.name: link for link in tree.links}, tree.placements
    # Shapes of all links that are fixed to the wheel's link count, seen from the joint.
    is_placed = joint.child in places
    group = [name for name in tree.rigid_group(joint.child) if is_placed and name in links and name in places]
    to_joint = np.linalg.inv(places[joint.child]) if is_placed else np.eye(4)
    agreeing, across = [], []
    for drawn in ("visual", "collision"):
        # Only a cylinder that is short and centred on the joint's axis may be the wheel.
        cylinders: list[Cylinder] = []
        for name in group:
            for shape in links[name].shapes:
                if shape.kind != "cylinder" or shape.drawn != drawn or shape.size[1] > MAX_LENGTH * shape.size[0]:
                    continue
                placement = to_joint @ places[name] @ shape.placement
                direction, centre = placement[:3, 2], placement[:3, 3]
                if np.linalg.norm(np.cross(direction, centre)) <= MAX_OFFSET * shape.size[0]:
                    cylinders.append(Cylinder(name, drawn, shape.size[0], direction))
        # Only the largest cylinders are compared with the axis, because a hub may be a cylinder in another direction.
        cylinders.sort(key=lambda cylinder: -cylinder.radius)
        others = {shape.kind for shape in _shapes_of(tree, joint) if shape.drawn == drawn} - {"cylinder", "box"}
        if not cylinders or others:
            continue
        rims = [cylinder for cylinder in cylinders if cylinder.radius >= MIN_RIM * cylinders[0].radius]
        if any(abs(cylinder.direction @ _unit(joint.axis)) >= ALONG for cylinder in rims):
            agreeing.append(drawn)
        else:
            across.append(rims[0])
    return agreeing, across


def _shapes_of(tree: UrdfTree, joint: Joint) -> list[Shape]:
    """Return the shapes of all links that turn with a joint: its child link, and all links that are fixed to it."""
    group = tree.rigid_group(joint.child)
    return [shape for link in tree.links if link.name in group for shape in link.shapes]


def disc_axis(body: Body) -> np.ndarray | None:
    """Return the axis of a disc-like body in the link's frame [3], found from the body's inertia; None if the inertia
    does not belong to a disc.

    The moment of inertia of a disc is largest about its own axis, and equal about the two other axes.
    """
    moments, axes = np.linalg.eigh(body.inertia)
    # The two smaller moments of a real wheel differ a little, by spokes and lugs.
    is_disc = moments[2] >= MIN_DISC_RATIO * moments[1] and moments[0] >= MIN_RIM * moments[1]
    return np.asarray(body.axes @ axes[:, 2]) if is_disc else None


def _fault(joint: Joint, what: str, link: str, direction: np.ndarray) -> str:
    """Return the sentence that reports a contradiction between the axis of a joint and a part of a link.

    Parameters
    ----------
    joint : Joint
        The joint.
    what, link : str
        Name of the part in words, such as "the cylinder of r = 0.1 m", and name of its link.
    direction : array [3]
        Axis of the part.
    """
    written = "" if joint.axis_written else " (it has no <axis>, and the default of a URDF is x)"
    sign = np.sign(direction[np.argmax(np.abs(direction))])
    xyz = " ".join(f"{component:.3g}" for component in np.round(sign * direction, 6) + 0.0)
    return (
        f"joint '{joint.name}' turns about {_words(joint.axis)}{written}, but {what} of link '{link}' lies along "
        f"{_words(direction)}: one of the two is wrong. Write <axis xyz='{xyz}'/> in the joint, or correct the link."
    )


def _words(direction: np.ndarray) -> str:
    """Return a direction [3] in words: the letter of the axis along which it lies, such as "y", or its three components
    if it lies along none.
    """
    unit = np.abs(_unit(direction))
    if unit.max() > 0.999:
        return "xyz"[int(np.argmax(unit))]
    return "({})".format(" ".join(f"{component:.3g}" for component in direction))


def _unit(vector: np.ndarray) -> np.ndarray:
    """Return a vector [3] divided by its length."""
    return np.asarray(vector / np.linalg.norm(vector))
