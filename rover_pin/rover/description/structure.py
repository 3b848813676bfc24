"""Faults in how a URDF joins its links: what keeps it from being one tree of turning joints."""

from collections import Counter
from collections.abc import Iterator

import numpy as np

from rover_pin.base.errors import closest
from rover_pin.rover.description.tree import Joint, UrdfTree

UNLIMITED = 1e6
"""A limit of this many rad is none: tools write the largest double, 1.8e308, or the like for a joint without stops."""
KINDS = ("fixed", "revolute", "continuous")


def structure_faults(tree: UrdfTree) -> Iterator[str]:
    """Yield the faults of the tree's names, joints and shape."""
    if not tree.links:
        yield "it has no <link>; a rover has a base and wheels."
        return
    for kind, names in (("links", [link.name for link in tree.links]), ("joints", [j.name for j in tree.joints])):
        for name, times in Counter(names).items():
            if times > 1:
                yield f"{times} {kind} are called '{name}'; give each its own name."
    for joint in tree.joints:
        yield from _joint_faults(tree, joint)
    yield from _shape_faults(tree)


def missing_links(tree: UrdfTree, joint: Joint) -> Iterator[str]:
    """Yield which ends of a joint are links that are not there."""
    links = [link.name for link in tree.links]
    for end, link in (("parent", joint.parent), ("child", joint.child)):
        if link not in links:
            yield f"joint '{joint.name}' names a {end} link '{link}' that is not there: {closest(link, links)}"


def _joint_faults(tree: UrdfTree, joint: Joint) -> Iterator[str]:
    yield from missing_links(tree, joint)
    if joint.kind in ("floating", "planar"):
        yield f"joint '{joint.name}' is {joint.kind}: leave it out, the free base is added here; its child is the root."
    elif joint.kind not in KINDS:
        yield (
            f"joint '{joint.name}' is of type '{joint.kind}'; use one of {', '.join(KINDS)}, or hold it where it is, "
            "in the TOML's [held]."
        )
    if joint.moves and np.linalg.norm(joint.axis) < 1e-6:
        yield f"joint '{joint.name}' has an axis of no length; write <axis xyz='0 1 0'/> for one across the rover."
    if joint.kind == "revolute" and not joint.limited:
        yield f"joint '{joint.name}' is revolute and has no <limit>; give lower and upper, or make it continuous."
    if joint.limited and joint.kind == "revolute" and joint.limits[0] >= joint.limits[1]:
        low, high = joint.limits
        yield f"joint '{joint.name}' has lower = {low:g} and upper = {high:g} rad; lower must be below upper."
    furthest = max((abs(limit) for limit in joint.limits if abs(limit) < UNLIMITED), default=0.0)
    if furthest > 10.0:
        yield f"joint '{joint.name}' has a limit of {furthest:g} rad; give radians, not degrees."
    others = [tree_joint.name for tree_joint in tree.joints]
    if joint.mimic is not None and joint.mimic.joint not in others:
        yield f"joint '{joint.name}' mimics '{joint.mimic.joint}', not there: {closest(joint.mimic.joint, others)}"


def _shape_faults(tree: UrdfTree) -> Iterator[str]:
    for child, times in Counter(joint.child for joint in tree.joints).items():
        if times > 1:
            names = " and ".join(f"'{joint.name}'" for joint in tree.joints if joint.child == child)
            yield (
                f"link '{child}' is the child of {times} joints ({names}), which closes a loop: a URDF is a tree, so "
                "cut the loop at one of them; a differential is named in the TOML instead."
            )
    roots = tree.roots
    if len(roots) > 1:
        names = ", ".join(f"'{root}'" for root in roots)
        yield f"links {names} are no joint's children; all but the base must be, so join them to it or leave them out."
    elif not roots:
        yield "every link is another's child, in a ring; one link, the base, must be no joint's child."
    elif lost := sorted({link.name for link in tree.links} - set(tree.placements)):
        yield f"link '{lost[0]}' cannot be reached from the base '{roots[0]}'; join it to it or leave it out."
