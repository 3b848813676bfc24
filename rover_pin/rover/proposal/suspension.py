"""The pivots between a rover's body and its wheels, by topology: rockers, bogies, what couples them, what is held."""

import math
import re
from collections.abc import Iterator

import numpy as np

from rover_pin.rover.description.as_driven import ALONG
from rover_pin.rover.description.tree import Joint
from rover_pin.rover.proposal.parts import Proposal, Topology

NEAR = 0.5
"""Largest offset along x and z between two pivots that are a pair, in wheel radii."""
BARS = ("diff", "bar", "brace", "balance")
"""Words in the names of what joins two rockers."""


def add_suspension(view: Topology, proposal: Proposal) -> Proposal:
    """Return the proposal with its suspension, differential, coupled and held joints."""
    wheels = [wheel.joint for wheel in proposal.wheels]
    steering = [joint for axle in proposal.axles for joint in axle.steering or ()]
    sides = ({axle.wheels[0].joint for axle in proposal.axles}, {axle.wheels[1].joint for axle in proposal.axles})
    pivots: list[Joint] = []
    unassigned: list[Joint] = []
    for joint in view.moving:
        if joint.name in (*wheels, *steering):
            continue
        below = view.below(joint.name, wheels)
        turns = joint.kind in ("revolute", "continuous")
        upright = joint.child in view.places and abs(view.axis(joint, proposal.base_rpy)[2]) >= 0.7
        swings = turns and not upright and 1 < len(below) < len(wheels)
        (pivots if swings else unassigned).append(joint)
    for name, joints in _named_pivots(view, proposal, pivots, sides):
        proposal.suspension[name] = tuple(joint.name for joint in joints)
    unassigned = [joint for joint in unassigned if not _other_half(view, proposal, joint, wheels)]
    _differential(view, proposal, sides)
    _rest(view, proposal, unassigned, wheels)
    proposal.skid = not steering
    proposal.cut = view.cut
    for name in view.cut:
        proposal.reasons[name] = "it closes a loop; a URDF is a tree"
    return proposal


def _named_pivots(
    view: Topology, proposal: Proposal, pivots: list[Joint], sides: tuple[set[str], set[str]]
) -> Iterator[tuple[str, list[Joint]]]:
    """Yield the names of pairs (left, right) of pivots, and of single ones in the middle."""
    wheels = [*sides[0], *sides[1]]
    of_left = [pivot for pivot in pivots if set(view.below(pivot.name, wheels)) <= sides[0]]
    of_right = [pivot for pivot in pivots if set(view.below(pivot.name, wheels)) <= sides[1]]
    used: list[str] = []
    for left in of_left:
        right = _partner(view, proposal, left, of_right)
        if right is None:
            proposal.held_joints[left.name] = _rest_angle(left)
            proposal.reasons[left.name] = "it carries wheels but has no partner on the other side"
            continue
        name = _level(view, left, of_left)
        used.append(name)
        yield name + (str(used.count(name)) if used.count(name) > 1 else ""), [left, right]
        of_right.remove(right)
    for right in of_right:
        proposal.held_joints[right.name] = _rest_angle(right)
        proposal.reasons[right.name] = "it carries wheels but has no partner on the other side"
    for middle in (
        pivot for pivot in pivots if pivot not in of_left and set(view.below(pivot.name, wheels)) & sides[0]
    ):
        used.append("cross")
        proposal.reasons[middle.name] = "it carries wheels of both sides"
        yield "cross" + (str(used.count("cross")) if used.count("cross") > 1 else ""), [middle]


def _partner(view: Topology, proposal: Proposal, left: Joint, others: list[Joint]) -> Joint | None:
    """Return the pivot on the right that lies beside one on the left, with as many joints above it."""
    r = proposal.wheels[0].size.r
    at, rpy = view.centre(left, proposal.base_rpy), proposal.base_rpy
    candidates = [
        candidate for candidate in others if len(view.ancestors(candidate.name)) == len(view.ancestors(left.name))
    ]
    distances = [float(np.hypot(*(view.centre(candidate, rpy) - at)[[0, 2]])) for candidate in candidates]
    return candidates[int(np.argmin(distances))] if distances and min(distances) <= NEAR * r else None


def _other_half(view: Topology, proposal: Proposal, joint: Joint, wheels: list[str]) -> bool:
    """Couple a pivot of one wheel to one of several wheels on the same pin: two halves of one rocker."""
    if joint.kind not in ("revolute", "continuous") or len(view.below(joint.name, wheels)) != 1:
        return False
    rpy, r = proposal.base_rpy, proposal.wheels[0].size.r
    for pivot in (name for joints in proposal.suspension.values() if len(joints) == 2 for name in joints):
        partner = view.joints[pivot]
        distance = float(np.linalg.norm(view.centre(partner, rpy) - view.centre(joint, rpy)))
        along = float(view.axis(partner, rpy) @ view.axis(joint, rpy))
        if distance < NEAR * r and abs(along) > ALONG and partner not in view.ancestors(joint.name):
            proposal.coupled[joint.name] = (pivot, math.copysign(1.0, along))
            proposal.reasons[joint.name] = f"it turns about the same pin as '{pivot}': two halves of one rocker"
            return True
    return False


def _level(view: Topology, pivot: Joint, side: list[Joint]) -> str:
    """Return rocker for a pivot that carries others or all wheels of its side, bogie for one that another carries."""
    names = [member.name for member in side]
    above = [up.name for up in view.ancestors(pivot.name) if up.name in names]
    carries = [member for member in side if pivot.name in [up.name for up in view.ancestors(member.name)]]
    return ("bogie", "second_bogie", "third_bogie")[min(len(above), 3) - 1] if above else "rocker" if carries else "arm"


def _differential(view: Topology, proposal: Proposal, sides: tuple[set[str], set[str]]) -> None:
    """Name the pair that carries all wheels of either side: nothing but a differential (or springs) holds the body."""
    wheels = [*sides[0], *sides[1]]
    for name, joints in list(proposal.suspension.items()):
        carries_all = len(joints) == 2 and all(
            _carried_wheels(view, proposal, joint, wheels) == side for joint, side in zip(joints, sides, strict=True)
        )
        if carries_all:
            proposal.differential = name.replace("arm", "rocker")
            proposal.suspension = _rename_arms(proposal.suspension, "rocker")
            proposal.reasons["differential"] = (
                f"'{joints[0]}' and '{joints[1]}' carry all wheels of their sides: without a differential, springs or "
                "a lock between them the body falls over"
            )
            return
    proposal.suspension = _rename_arms(proposal.suspension, "bogie")


def _rename_arms(suspension: dict[str, tuple[str, ...]], word: str) -> dict[str, tuple[str, ...]]:
    """Return the suspension with its arms, which carry no other pivot, called rockers or bogies."""
    return {re.sub("^arm", word, name): joints for name, joints in suspension.items()}


def _carried_wheels(view: Topology, proposal: Proposal, joint: str, wheels: list[str]) -> set[str]:
    halves = [half for half, (pivot, _) in proposal.coupled.items() if pivot == joint]
    return {wheel for member in (joint, *halves) for wheel in view.below(member, wheels)}


def _rest(view: Topology, proposal: Proposal, unassigned: list[Joint], wheels: list[str]) -> None:
    """Couple what the URDF couples to the suspension; hold everything else within its stops."""
    roles = {*wheels, *(joint for axle in proposal.axles for joint in axle.steering or ())}
    roles |= {joint for joints in proposal.suspension.values() for joint in joints}
    linked = _linked_joints(view, roles)
    for joint in unassigned:
        if joint.name in linked and joint.kind != "prismatic":
            proposal.suspension[joint.name] = (joint.name,)
            proposal.reasons[joint.name] = "the URDF's <mimic> couples it to the suspension"
            continue
        proposal.held_joints[joint.name] = _rest_angle(joint)
        proposal.reasons[joint.name] = _why(view, joint, wheels)


def _rest_angle(joint: Joint) -> float:
    """Return the value within a joint's stops that is nearest to 0 [rad or m]."""
    low, high = joint.limits
    stops = joint.limited and joint.kind in ("revolute", "prismatic") and low < high
    return min(max(0.0, low), high) if stops else 0.0


def _linked_joints(view: Topology, roles: set[str]) -> set[str]:
    """Return what the URDF's mimics tie to joints that have a role."""
    linked_joints: set[str] = set()
    for joint in view.moving:
        if joint.mimic is not None:
            pair = {joint.name, joint.mimic.joint}
            linked_joints |= pair - roles if pair & roles else set()
    return linked_joints


def _why(view: Topology, joint: Joint, wheels: list[str]) -> str:
    below = view.below(joint.name, wheels)
    if len(below) == 1:
        return f"it carries the wheel '{below[0]}' alone: a leg or swing arm, held as a rigid one"
    if len(below) == len(wheels):
        return "all wheels hang below it"
    if below:
        return "it carries wheels but turns about an upright axis or slides"
    if any(word in joint.name.lower() for word in BARS):
        return "it may be a differential's bar: its weight counts, its motion does not"
    return "it carries no wheel: an arm, mast or the like"
