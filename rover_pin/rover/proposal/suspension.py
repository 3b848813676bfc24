"""Proposal for the pivots between a rover's body and its wheels: rockers, bogies, their couplings, and joints that are
held at an angle.
"""

import math
import re
from collections.abc import Iterator

import numpy as np

from rover_pin.rover.description.joint_forms import ALONG
from rover_pin.rover.description.tree import Joint
from rover_pin.rover.proposal.parts import Proposal, Topology

MAX_OFFSET = 0.5
"""Largest offset along x and z between the two pivots of a pair (left, right), and largest distance between the two
halves of a rocker, divided by the wheel radius. Pivots with a larger offset do not form a pair. CAD programs export
mirrored parts with small offsets, and different pivots of one side are farther apart."""
UPRIGHT_AXIS = 0.7
"""Smallest cosine of the angle between an upright axis and the vertical. The angle is then at most 45 deg, so that the
axis is nearer to the vertical than to the ground. A joint with an upright axis steers, and is no pivot of the
suspension."""
BARS = ("diff", "bar", "brace", "balance")
"""Words in the names of bars that connect two rockers."""
LEVELS = ("bogie", "second_bogie", "third_bogie")
"""Names for a pivot of the suspension that is carried by one other pivot on its side, by two, or by three or more."""


def add_suspension(view: Topology, proposal: Proposal) -> Proposal:
    """Add the suspension, the differential, and the coupled and held joints to a proposal; return the proposal.

    Every moving joint that is neither a wheel's joint nor steers a wheel gets one of these roles, because a rover with
    a moving joint without a role would be refused.
    """
    wheels = [wheel.joint for wheel in proposal.wheels]
    steering = [joint for axle in proposal.axles for joint in axle.steering or ()]
    sides = ({axle.wheels[0].joint for axle in proposal.axles}, {axle.wheels[1].joint for axle in proposal.axles})
    # A pivot turns about an axis that is not upright, and carries more than one wheel but not all wheels.
    pivots: list[Joint] = []
    unassigned: list[Joint] = []
    for joint in view.moving:
        if joint.name in (*wheels, *steering):
            continue
        below = view.below(joint.name, wheels)
        turns = joint.kind in ("revolute", "continuous")
        upright = joint.child in view.places and abs(view.axis(joint, proposal.base_rpy)[2]) >= UPRIGHT_AXIS
        swings = turns and not upright and 1 < len(below) < len(wheels)
        (pivots if swings else unassigned).append(joint)
    for name, joints in _named_pivots(view, proposal, pivots, sides):
        proposal.suspension[name] = tuple(joint.name for joint in joints)
    # A joint that carries one wheel may be the second half of a rocker.
    unassigned = [joint for joint in unassigned if not _other_half(view, proposal, joint, wheels)]
    _find_differential(view, proposal, sides)

    # Joints that the URDF couples to a joint with a role move with it; all others are held within their stops.
    roles = {*wheels, *steering} | {joint for joints in proposal.suspension.values() for joint in joints}
    linked: set[str] = set()
    for joint in view.moving:
        if joint.mimic is not None:
            pair = {joint.name, joint.mimic.joint}
            linked |= pair - roles if pair & roles else set()
    for joint in unassigned:
        if joint.name in linked and joint.kind != "prismatic":
            proposal.suspension[joint.name] = (joint.name,)
            proposal.reasons[joint.name] = "the URDF's <mimic> couples it to the suspension"
        else:
            # The TOML gets a comment with the reason why the joint is held.
            proposal.held_joints[joint.name] = _rest_value(joint)
            below = view.below(joint.name, wheels)
            if len(below) == 1:
                reason = f"it carries only the wheel '{below[0]}': a leg or a swing arm, which is held at this angle"
            elif len(below) == len(wheels):
                reason = "it carries all wheels"
            elif below:
                reason = "it carries wheels but turns about an upright axis or slides"
            elif any(word in joint.name.lower() for word in BARS):
                reason = "it may be the bar of a differential: its weight counts, but its motion does not"
            else:
                reason = "it carries no wheel: probably an arm or a mast"
            proposal.reasons[joint.name] = reason
    proposal.skid = not steering
    proposal.cut = view.cut
    for name in view.cut:
        proposal.reasons[name] = "it closes a loop, but a URDF is a tree"
    return proposal


def _named_pivots(
    view: Topology, proposal: Proposal, pivots: list[Joint], sides: tuple[set[str], set[str]]
) -> Iterator[tuple[str, list[Joint]]]:
    """Yield the name of each pivot in the table [suspension], and its joints: a pair (left, right), or a single joint
    in the middle.

    A pivot without a partner on the other side becomes a held joint of the proposal. `sides` are the joints of the left
    wheels and of the right wheels.
    """
    wheels = [*sides[0], *sides[1]]
    of_left = [pivot for pivot in pivots if set(view.below(pivot.name, wheels)) <= sides[0]]
    of_right = [pivot for pivot in pivots if set(view.below(pivot.name, wheels)) <= sides[1]]
    r, rpy = proposal.wheels[0].size.r, proposal.base_rpy
    used: list[str] = []
    for left in of_left:
        # The partner on the right side lies opposite, and the same number of joints carries it.
        depth = len(view.ancestors(left.name))
        opposite = [pivot for pivot in of_right if len(view.ancestors(pivot.name)) == depth]
        offsets = [view.centre(pivot, rpy) - view.centre(left, rpy) for pivot in opposite]
        distances = [float(np.hypot(*offset[[0, 2]])) for offset in offsets]
        if not distances or min(distances) > MAX_OFFSET * r:
            proposal.held_joints[left.name] = _rest_value(left)
            proposal.reasons[left.name] = "it carries wheels but has no partner on the other side"
            continue
        right = opposite[int(np.argmin(distances))]
        # A rocker carries other pivots, and another pivot carries a bogie. Any other pivot is called arm for now:
        # `_find_differential` shows whether the arms carry all wheels of their sides, and are then rockers.
        names = [member.name for member in of_left]
        above = [up.name for up in view.ancestors(left.name) if up.name in names]
        carries = any(left.name in [up.name for up in view.ancestors(member.name)] for member in of_left)
        name = LEVELS[min(len(above), 3) - 1] if above else "rocker" if carries else "arm"
        used.append(name)
        yield name + (str(used.count(name)) if used.count(name) > 1 else ""), [left, right]
        of_right.remove(right)
    for right in of_right:
        proposal.held_joints[right.name] = _rest_value(right)
        proposal.reasons[right.name] = "it carries wheels but has no partner on the other side"
    # The remaining pivots carry wheels of both sides.
    for middle in (
        pivot for pivot in pivots if pivot not in of_left and set(view.below(pivot.name, wheels)) & sides[0]
    ):
        used.append("cross")
        proposal.reasons[middle.name] = "it carries wheels of both sides"
        yield "cross" + (str(used.count("cross")) if used.count("cross") > 1 else ""), [middle]


def _other_half(view: Topology, proposal: Proposal, joint: Joint, wheels: list[str]) -> bool:
    """Couple a joint that carries one wheel to a pivot on the same pin, and return whether there is such a pivot.

    Some URDFs divide a rocker into a front arm and a rear arm. Both arms turn about one pin, but each has its own
    joint.
    """
    if joint.kind not in ("revolute", "continuous") or len(view.below(joint.name, wheels)) != 1:
        return False
    rpy, r = proposal.base_rpy, proposal.wheels[0].size.r
    # Two joints are halves of one rocker if they are close to each other and their axes are parallel.
    for pivot in (name for joints in proposal.suspension.values() if len(joints) == 2 for name in joints):
        partner = view.joints[pivot]
        distance = float(np.linalg.norm(view.centre(partner, rpy) - view.centre(joint, rpy)))
        along = float(view.axis(partner, rpy) @ view.axis(joint, rpy))
        if distance < MAX_OFFSET * r and abs(along) > ALONG and partner not in view.ancestors(joint.name):
            proposal.coupled[joint.name] = (pivot, math.copysign(1.0, along))
            proposal.reasons[joint.name] = f"it turns about the pin of '{pivot}': two halves of one rocker"
            return True
    return False


def _find_differential(view: Topology, proposal: Proposal, sides: tuple[set[str], set[str]]) -> None:
    """Set the differential of a proposal, if there is a pair of pivots that each carry all wheels of their side.

    Without a differential, a spring or a lock between two such pivots, nothing would hold the body upright. `sides` are
    the joints of the left wheels and of the right wheels.
    """
    wheels = [*sides[0], *sides[1]]
    word = "bogie"
    # If a rocker has two halves, the wheels of both halves count.
    for name, joints in list(proposal.suspension.items()):
        carried = []
        for joint in joints:
            halves = [half for half, (pivot, _) in proposal.coupled.items() if pivot == joint]
            carried.append({wheel for member in (joint, *halves) for wheel in view.below(member, wheels)})
        if carried == list(sides):
            proposal.differential, word = name.replace("arm", "rocker"), "rocker"
            proposal.reasons["differential"] = (
                f"'{joints[0]}' and '{joints[1]}' carry all wheels of their sides: without a differential, springs or "
                "a lock between them the body falls over"
            )
            break
    # Arms (pivots that carry no other pivot) get their final name: rockers if they carry all wheels, else bogies.
    proposal.suspension = {re.sub("^arm", word, name): joints for name, joints in proposal.suspension.items()}


def _rest_value(joint: Joint) -> float:
    """Return the angle [rad] or travel [m] at which a joint is held: 0, or the stop nearest to 0 if 0 lies beyond the
    stops.
    """
    low, high = joint.limits
    stops = joint.limited and joint.kind in ("revolute", "prismatic") and low < high
    return min(max(0.0, low), high) if stops else 0.0
