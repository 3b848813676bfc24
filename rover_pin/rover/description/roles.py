"""Faults in what the TOML says of the URDF: joints that are not there, of the wrong kind, axis or side."""

from collections import Counter
from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from rover_pin.base.errors import closest
from rover_pin.rover.description.as_driven import ALONG
from rover_pin.rover.description.layout import Layout
from rover_pin.rover.description.tree import Joint, UrdfTree


def role_faults(layout: Layout, tree: UrdfTree) -> Iterator[str]:
    """Yield roles that do not fit the URDF's joints, by name and kind."""
    if layout.base not in tree.rigid_group(tree.roots[0]):
        yield f"the TOML's base '{layout.base}' is not its root link or fixed to it; write base = \"{tree.roots[0]}\"."
    kinds = {joint.name: joint.kind for joint in tree.joints}
    roles = [*((joint, "wheel") for joint in layout.wheel_joints), *((j, "pivot") for j in layout.angles.values())]
    for joint, times in Counter(joint for joint, _ in roles).items():
        if times > 1:
            yield f"joint '{joint}' has {times} roles in the TOML; name it once."
    for joint, role in roles:
        if joint not in kinds:
            yield f"there is no joint '{joint}', which the TOML names: {closest(joint, kinds)}"
        elif role == "wheel" and kinds[joint] != "continuous":
            yield f"wheel joint '{joint}' is {kinds[joint]}; a wheel turns without end, write type=\"continuous\"."
        elif role == "pivot" and kinds[joint] != "revolute":
            yield f"joint '{joint}' is {kinds[joint]}; suspension and steering need type=\"revolute\" with a <limit>."
    for joint in (moving_joint.name for moving_joint in tree.joints if moving_joint.moves):
        if joint not in dict(roles):
            yield f"joint '{joint}' moves but the TOML gives it no role; name it in [suspension], or in [held]."
    yield from _mimic_faults(layout, tree)


def _mimic_faults(layout: Layout, tree: UrdfTree) -> Iterator[str]:
    differential, sides = set(layout.differential or ()), [set(pair) for pair in layout.suspension.values()]
    for joint in tree.joints:
        if joint.mimic is None or not joint.moves:
            continue
        pair = {joint.name, joint.mimic.joint}
        if pair == differential and (joint.mimic.multiplier, joint.mimic.offset) != (-1.0, 0.0):
            yield (
                f"joint '{joint.name}' mimics with multiplier {joint.mimic.multiplier:g} and offset "
                f"{joint.mimic.offset:g} where both axes point to the left; a differential turns its rockers by "
                "opposite angles, -1 and 0."
            )
        elif pair != differential and pair in sides and joint.mimic.multiplier == -1.0:
            yield (
                f"joint '{joint.name}' mimics '{joint.mimic.joint}', but the TOML's [differential] does not join them; "
                "name the pair there or take the <mimic> out."
            )
        elif pair != differential:
            yield from _coupling_faults(joint, layout)


def _coupling_faults(joint: Joint, layout: Layout) -> Iterator[str]:
    """Yield why a joint cannot follow another."""
    assert joint.mimic is not None
    name, leader, ratio = joint.name, joint.mimic.joint, joint.mimic.multiplier
    steering = {joint for axle in layout.axles for joint in axle.steering}
    pivots, wheels = {*layout.angles.values()} - steering, layout.wheel_joints
    if name in wheels and leader in wheels:
        if ratio <= 0.0:
            yield f"wheel '{name}' would turn against '{leader}' ({ratio:g} : 1); tie wheels that turn the same way."
    elif not {name, leader} <= steering:
        for joint_name in (name, leader):
            if joint_name not in pivots:
                yield f"joint '{name}' mimics '{leader}'; name '{joint_name}' in the TOML's [suspension], as a pivot."
    if joint.mimic.offset != 0.0 or ratio == 0.0:
        yield (
            f"joint '{name}' mimics with multiplier {ratio:g} and offset {joint.mimic.offset:g}; one "
            'that follows has multiplier="1", "-1" or another but 0, and offset="0".'
        )


def axis_faults(layout: Layout, model: pin.Model, axes: np.ndarray) -> Iterator[str]:
    """Yield joints whose axis [nv, 3] points wrong, and wheels on the wrong side or out of order."""
    wanted = [(joint, "wheel", 1) for joint in layout.wheel_joints]
    wanted += [(joint, "rocker of the differential", 1) for joint in layout.differential or ()]
    wanted += [(joint, "steering", 2) for axle in layout.axles for joint in axle.steering if joint is not None]
    for joint, role, direction in wanted:
        axis = axes[model.joints[model.getJointId(joint)].idx_v]
        if axis[direction] < ALONG:
            xyz, name = " ".join(f"{component:.3g}" for component in axis + 0.0), "xyz"[direction]
            yield (
                f"{role} joint '{joint}' turns about ({xyz}) in the base's axes; it must be +{name}, so that a "
                f"positive {'angle turns left' if direction == 2 else 'rate rolls forward'}: mend <axis> or rpy."
            )
    yield from _place_faults(layout, model)


def _place_faults(layout: Layout, model: pin.Model) -> Iterator[str]:
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    where = {joint: data.oMi[model.getJointId(joint)].translation for joint in layout.wheel_joints}
    radius = max(float(axle.wheel.r) for axle in layout.axles)
    lowest = min(place[2] for place in where.values()) - radius
    if (height := float(pin.centerOfMass(model, data, pin.neutral(model))[2])) < lowest:
        yield (
            f"its centre of mass lies {lowest - height:.3g} m below its lowest wheel's rim: the base's z must point "
            "up; where it points down write base_rpy = [3.14159265, 0, 0] in the TOML."
        )
    for axle in layout.axles:
        left, right = axle.wheels
        if where[left][1] <= where[right][1]:
            yield f"axle '{axle.name}': '{left}' is not to the left (+y) of '{right}'; write [left, right]."
    if all(where[axle.wheels[0]][1] <= where[axle.wheels[1]][1] for axle in layout.axles):
        yield (
            "left is right on every axle: the base's axes must be x forward, y left, z up; where the base link's z "
            "points down write base_rpy = [3.14159265, 0, 0] in the TOML, where its x points back [0, 0, 3.14159265]."
        )
    middles = [(where[axle.wheels[0]][0] + where[axle.wheels[1]][0]) / 2.0 for axle in layout.axles]
    for front, rear, x_front, x_rear in zip(layout.axles, layout.axles[1:], middles, middles[1:], strict=False):
        if x_front <= x_rear:
            yield f"axle '{front.name}' is not ahead (+x) of '{rear.name}'; list axles from front to rear."
