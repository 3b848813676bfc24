"""The faults that keep a URDF from being loaded as a rover, each in one sentence that states what to correct.

Faults are looked for in stages, because a later stage needs a URDF without faults of the earlier stages: first the tree
of links and joints, then masses and roles, then the model that Pinocchio builds, and last a second library that also
reads the file.
"""

from collections import Counter
from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from rover_pin.base.errors import UrdfError, closest
from rover_pin.rover.description.cross_check import axes_at_zero, free_tree, reader_faults
from rover_pin.rover.description.drawn_axis import axis_against_drawing, might_be_wheels
from rover_pin.rover.description.inertia_check import inertia_faults, unit_faults
from rover_pin.rover.description.joint_forms import ALONG
from rover_pin.rover.description.layout import Layout
from rover_pin.rover.description.tree import Joint, UrdfTree, read_tree

UNLIMITED = 1e6
"""Maximum angle [rad] of a stop. A joint with a larger angle counts as having no stop: tools write 1.8e308, the largest
double, for a joint without stops."""
MAX_STOP = 10.0
"""Largest angle of a stop [rad] that is accepted. A larger angle (up to UNLIMITED) is refused, because it is probably
in degrees."""
KINDS = ("fixed", "revolute", "continuous")
"""The types of joints that the URDF of a rover may have. Joints of other types must be held in the TOML."""


def refuse_faults(layout: Layout) -> None:
    """Check that a rover's URDF has no fault.

    Raises UrdfError: the URDF has faults. The error states the first fault and the number of further faults.
    """
    tree = read_tree(layout.text, layout.file)
    faults = faults_of(tree, layout.text, layout)
    if faults:
        more = f" ({len(faults) - 1} more: see `rover-pin check-urdf`.)" if len(faults) > 1 else ""
        raise UrdfError(f"{layout.file}: {faults[0]}{more}")


def faults_of(tree: UrdfTree, text: str, layout: Layout | None) -> list[str]:
    """Return the faults of a URDF, one sentence for each.

    The checks run in stages. If a stage finds faults, later stages do not run, because they need a URDF without these
    faults.

    Parameters
    ----------
    tree, text : UrdfTree, str
        The links and joints of the URDF, and its text.
    layout : Layout or None
        The roles of the joints, from the rover's TOML; None to check only the URDF itself.
    """
    # Stage 1 checks the tree of links and joints. Stage 2 checks masses, roles and drawn axes, and needs a valid tree.
    faults = list(structure_faults(tree))
    if not faults:
        faults = list(inertia_faults(tree))
        if layout is not None:
            faults += role_faults(layout, tree)
        elif not any(joint.turns_fully for joint in tree.joints):
            faults.append(
                "it has no wheel: none of its joints is continuous, or revolute with stops a full turn apart."
            )
        else:
            faults += axis_against_drawing(tree, might_be_wheels(tree))
    if faults:
        return faults
    # Stage 3 builds Pinocchio's model, and checks units and axes on it. At last, yourdfpy must place the links in the
    # same positions as Pinocchio.
    try:
        model = free_tree(text)
    except Exception as error:  # Pinocchio raises its own errors for faults that the stages above do not know
        return [f"Pinocchio cannot read the URDF ({error}); check its joints."]
    faults = list(unit_faults(tree, across(model)))
    if layout is not None:
        faults += axis_faults(layout, model, axes_at_zero(model))
    return [*faults, *reader_faults(tree, text, model)]


def across(model: pin.Model) -> float:
    """Return the diagonal of the box around all joints of a rover at zero angles [m], as a measure of the rover's
    size.
    """
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    positions = np.array([data.oMi[joint].translation for joint in range(1, model.njoints)])
    return float(np.linalg.norm(positions.max(axis=0) - positions.min(axis=0)))


# The tree of links and joints.


def structure_faults(tree: UrdfTree) -> Iterator[str]:
    """Yield the faults in the names and the joints of a URDF, and each reason why its links do not form one tree."""
    if not tree.links:
        yield "the URDF has no <link>; a rover has a base and wheels."
        return
    yield from name_faults(tree)
    for joint in tree.joints:
        # The links and the type of the joint are checked first, because the other faults depend on them.
        yield from missing_links(tree, joint)
        if joint.kind in ("floating", "planar"):
            yield (
                f"joint '{joint.name}' is {joint.kind}: delete it and make its child the root, because a free base is "
                "added when the URDF is read."
            )
        elif joint.kind not in KINDS:
            yield (
                f"joint '{joint.name}' is of type '{joint.kind}'; use one of {', '.join(KINDS)}, or hold the joint in "
                "the TOML's [held]."
            )
        if joint.moves and np.linalg.norm(joint.axis) < 1e-6:
            yield (
                f"joint '{joint.name}' has an axis of length 0; write <axis xyz='0 1 0'/> for an axis across the rover."
            )
        if joint.kind == "revolute" and not joint.limited:
            yield (
                f"joint '{joint.name}' is revolute and has no <limit>; give lower and upper stop, or make it "
                "continuous."
            )
        if joint.limited and joint.kind == "revolute" and joint.limits[0] >= joint.limits[1]:
            low, high = joint.limits
            yield f"joint '{joint.name}' has lower = {low:g} and upper = {high:g} rad, but lower must be below upper."
        # Stops in degrees would be tens or hundreds of radians; numbers beyond UNLIMITED mean no stop.
        furthest = max((abs(limit) for limit in joint.limits if abs(limit) < UNLIMITED), default=0.0)
        if furthest > MAX_STOP:
            yield f"joint '{joint.name}' has a limit of {furthest:g} rad; give the limit in radians, not in degrees."
        # A <mimic> must name an existing joint.
        others = [tree_joint.name for tree_joint in tree.joints]
        if joint.mimic is not None and joint.mimic.joint not in others:
            hint = closest(joint.mimic.joint, others)
            yield f"joint '{joint.name}' mimics '{joint.mimic.joint}', which does not exist: {hint}"
    # A link with two parents closes a loop, which a tree cannot have.
    for child, times in Counter(joint.child for joint in tree.joints).items():
        if times > 1:
            names = " and ".join(f"'{joint.name}'" for joint in tree.joints if joint.child == child)
            yield (
                f"link '{child}' is the child of {times} joints ({names}), which closes a loop: a URDF is a tree, so "
                "cut the loop at one of these joints; a differential is stated in the TOML instead."
            )
    # Exactly one link, the base, has no parent, and all links must be connected to it.
    roots = tree.roots
    if len(roots) > 1:
        names = ", ".join(f"'{root}'" for root in roots)
        yield (
            f"links {names} have no parent, but only the base may be without a parent: connect the other links to the "
            "base by joints, or delete them."
        )
    elif not roots:
        yield "every link is the child of a joint, so the links form a ring; one link, the base, must have no parent."
    elif lost := sorted({link.name for link in tree.links} - set(tree.placements)):
        yield (
            f"link '{lost[0]}' is not connected to the base '{roots[0]}'; connect it to the base by a joint, or delete "
            "it."
        )


def name_faults(tree: UrdfTree) -> Iterator[str]:
    """Yield a fault for each name that several links or several joints share."""
    for kind, names in (("links", [link.name for link in tree.links]), ("joints", [j.name for j in tree.joints])):
        for name, times in Counter(names).items():
            if times > 1:
                yield f"{times} {kind} are called '{name}'; give each of them a different name."


def missing_links(tree: UrdfTree, joint: Joint) -> Iterator[str]:
    """Yield a fault for each end of a joint (parent or child) that names a link which the URDF does not have."""
    links = [link.name for link in tree.links]
    for end, link in (("parent", joint.parent), ("child", joint.child)):
        if link not in links:
            yield f"joint '{joint.name}' names a {end} link '{link}' that does not exist: {closest(link, links)}"


# The roles that the TOML gives to joints.


def role_faults(layout: Layout, tree: UrdfTree) -> Iterator[str]:
    """Yield the faults in the roles that a rover's TOML gives to the joints of the URDF, for example a wheel's joint
    that does not exist, a joint of a wrong type, or a moving joint without a role.
    """
    # The base must be the root of the tree, because the free base of the simulation is added at the root.
    if layout.base not in tree.rigid_group(tree.roots[0]):
        yield (
            f"the TOML's base '{layout.base}' is not the root link of the URDF or fixed to it; write "
            f'base = "{tree.roots[0]}".'
        )
    # A base that is the world of a simulator would not move with the rover.
    for placing in tree.world_joints:
        if placing.parent == layout.base and not np.allclose(placing.origin, np.eye(4), atol=1e-9):
            distance = float(np.linalg.norm(placing.origin[:3, 3]))
            roll_pitch_yaw = np.degrees(pin.rpy.matrixToRpy(placing.origin[:3, :3])).round(1) + 0.0
            yield (
                f"the TOML's base '{layout.base}' is the world: joint '{placing.name}' places the rover {distance:.3g} "
                f"m away from the world's origin, turned by roll, pitch and yaw of {roll_pitch_yaw.tolist()} deg; "
                "write "
                f'base = "{tree.world_joints[-1].child}".'
            )
    # Each moving joint needs exactly one role, and the type that its role needs.
    kinds = {joint.name: joint.kind for joint in tree.joints}
    roles = [*((joint, "wheel") for joint in layout.wheel_joints), *((j, "pivot") for j in layout.angles.values())]
    for joint, times in Counter(joint for joint, _ in roles).items():
        if times > 1:
            yield f"joint '{joint}' has {times} roles in the TOML; give it one role."
    for joint, role in roles:
        if joint not in kinds:
            yield f"there is no joint '{joint}', which the TOML names: {closest(joint, kinds)}"
        elif role == "wheel" and kinds[joint] != "continuous":
            yield f"wheel joint '{joint}' is {kinds[joint]}, but a wheel turns without end: write type=\"continuous\"."
        elif role == "pivot" and kinds[joint] != "revolute":
            yield f"joint '{joint}' is {kinds[joint]}, but a pivot or steering needs type=\"revolute\" with a <limit>."
    for joint in (moving_joint.name for moving_joint in tree.joints if moving_joint.moves):
        if joint not in dict(roles):
            yield f"joint '{joint}' moves, but the TOML gives it no role; name it in [suspension], or in [held]."
    yield from axis_against_drawing(tree, layout.wheel_joints)
    # A <mimic> may describe the differential, a pair, or a coupling. It must not contradict the TOML, and the equation
    # of motion must be able to represent it.
    differential, sides = set(layout.differential or ()), [set(pair) for pair in layout.suspension.values()]
    for follower in tree.joints:
        if follower.mimic is None or not follower.moves:
            continue
        pair = {follower.name, follower.mimic.joint}
        if pair == differential and (follower.mimic.multiplier, follower.mimic.offset) != (-1.0, 0.0):
            yield (
                f"joint '{follower.name}' mimics with multiplier {follower.mimic.multiplier:g} and offset "
                f"{follower.mimic.offset:g} where both axes point to the left, but a differential turns its rockers by "
                "opposite angles: multiplier -1 and offset 0."
            )
        elif pair != differential and pair in sides and follower.mimic.multiplier == -1.0:
            # Left and right of one pair that turn by opposite angles are a differential, which the TOML must name.
            yield (
                f"joint '{follower.name}' mimics '{follower.mimic.joint}', but the TOML's [differential] does not join "
                "them; name the pair in [differential] or delete the <mimic>."
            )
        elif pair != differential:
            yield from _coupling_faults(follower, layout)


def _coupling_faults(joint: Joint, layout: Layout) -> Iterator[str]:
    """Yield the reasons why a joint with a `<mimic>` cannot follow the joint that the `<mimic>` names.

    Pivots may follow pivots, steering joints may follow steering joints, and wheels may follow wheels, each with a
    ratio and without an offset.
    """
    assert joint.mimic is not None
    name, leader, ratio = joint.name, joint.mimic.joint, joint.mimic.multiplier
    # Tied wheels must turn in one direction; any other follower and its leader must be pivots, or both steering joints.
    steering = {joint for axle in layout.axles for joint in axle.steering}
    pivots, wheels = {*layout.angles.values()} - steering, layout.wheel_joints
    if name in wheels and leader in wheels:
        if ratio <= 0.0:
            yield (
                f"wheel '{name}' would turn against '{leader}' ({ratio:g} : 1); only wheels that turn in one "
                "direction can be tied."
            )
    elif not {name, leader} <= steering:
        for joint_name in (name, leader):
            if joint_name not in pivots:
                yield (
                    f"joint '{name}' mimics '{leader}'; name '{joint_name}' in the TOML's [suspension], because only "
                    "pivots follow pivots."
                )
    # A constant offset has no place in the equation of motion, and a ratio of 0 would hold the joint.
    if joint.mimic.offset != 0.0 or ratio == 0.0:
        yield (
            f"joint '{name}' mimics with multiplier {ratio:g} and offset {joint.mimic.offset:g}; a "
            'joint that follows needs a multiplier other than 0, and offset="0".'
        )


# Axes and places in Pinocchio's model.


def axis_faults(layout: Layout, model: pin.Model, axes: np.ndarray) -> Iterator[str]:
    """Yield the faults in the geometry of a rover.

    Such faults are a joint whose axis has a wrong direction, a wheel on the wrong side, axles in a wrong order, and a
    base whose z axis points down.

    Parameters
    ----------
    layout : Layout
        The roles of the joints.
    model : pin.Model
        Pinocchio's model of the URDF.
    axes : array [nv, 3]
        Axis of each degree of freedom at zero angles, in the base's axes (`axes_at_zero`).
    """
    wanted = [(joint, "wheel", 1) for joint in layout.wheel_joints]
    wanted += [(joint, "rocker of the differential", 1) for joint in layout.differential or ()]
    wanted += [(joint, "steering", 2) for axle in layout.axles for joint in axle.steering if joint is not None]
    # The signs of rates and angles follow from the axes, so that each axis must point in its direction.
    for joint, role, direction in wanted:
        axis = axes[model.joints[model.getJointId(joint)].idx_v]
        if axis[direction] < ALONG:
            xyz, name = " ".join(f"{component:.3g}" for component in axis + 0.0), "xyz"[direction]
            yield (
                f"{role} joint '{joint}' turns about ({xyz}) in the base's axes, but the axis must be +{name}, so "
                f"that a positive {'angle turns left' if direction == 2 else 'rate rolls forward'}: correct <axis> or "
                "rpy."
            )
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    centres = {joint: data.oMi[model.getJointId(joint)].translation for joint in layout.wheel_joints}
    # A centre of mass below the rims shows that the base's z axis points down.
    radius = max(float(axle.wheel.r) for axle in layout.axles)
    lowest = min(centre[2] for centre in centres.values()) - radius
    if (height := float(pin.centerOfMass(model, data, pin.neutral(model))[2])) < lowest:
        yield (
            f"its centre of mass lies {lowest - height:.3g} m below its lowest wheel's rim, but the base's z axis must "
            "point up. If it points down, write base_rpy = [3.14159265, 0, 0] in the TOML."
        )
    for axle in layout.axles:
        left, right = axle.wheels
        if centres[left][1] <= centres[right][1]:
            yield f"axle '{axle.name}': '{left}' is not to the left (+y) of '{right}'; write [left, right]."
    if all(centres[axle.wheels[0]][1] <= centres[axle.wheels[1]][1] for axle in layout.axles):
        yield (
            "the left wheel of every axle lies on the right: the base's axes must be x forward, y left, z up. If the "
            "base link's z points down, write base_rpy = [3.14159265, 0, 0] in the TOML; if its x points back, write "
            "base_rpy = [0, 0, 3.14159265]."
        )
    # The TOML must list the axles from front to rear.
    middles = [(centres[axle.wheels[0]][0] + centres[axle.wheels[1]][0]) / 2.0 for axle in layout.axles]
    for front, rear, x_front, x_rear in zip(layout.axles, layout.axles[1:], middles, middles[1:], strict=False):
        if x_front <= x_rear:
            yield f"axle '{front.name}' is not ahead (+x) of '{rear.name}'; list axles from front to rear."
