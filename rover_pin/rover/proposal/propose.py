"""Which joint of a URDF plays which part: what `new-rover` proposes."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rover_pin.base.errors import UrdfError
from rover_pin.rover.description.as_driven import ALONG
from rover_pin.rover.description.tree import Joint, UrdfTree
from rover_pin.rover.proposal.parts import FRAMES, GuessedAxle, GuessedWheel, Proposal, Topology, rotation
from rover_pin.rover.proposal.passive import passive_wheels
from rover_pin.rover.proposal.suspension import add_suspension
from rover_pin.rover.proposal.wheel_shape import WheelSize, wheel_size


def propose(tree: UrdfTree, folder: Path) -> Proposal:
    """Return the roles of a URDF's joints; `folder` is where its meshes are looked for.

    Raises UrdfError: fewer than two pairs of wheels are found, or some that no motor turns.
    """
    view = Topology(tree)
    best: list[tuple[int, tuple[float, float, float], list[GuessedAxle]]] = []
    candidates = candidates_of(view, folder)
    for refusal in passive_wheels(view, {joint.name: size.r for joint, size in candidates}):
        raise UrdfError(f"{tree.file}: {refusal}; take them off, or a rover whose wheels are all driven.")
    for rpy in FRAMES:
        axles = axles_of(view, candidates, rpy)
        if len(axles) >= 2 and upright(view, axles, rpy):
            best.append((len(axles), rpy, axles))
    if not best:
        raise UrdfError(
            f"{tree.file}: no two axles of wheels are found: joints that turn without end or by a full turn, with "
            "nothing moving below them, in pairs left and right of each other, axes across the base (+-y), round "
            f"about them. {len(candidates)} joints might be wheels"
            + (f" ({', '.join(joint.name for joint, _ in candidates)})" if candidates else "")
            + ": write the TOML by hand, as urdf/cart.toml."
        )
    _, rpy, axles = max(best, key=lambda option: option[0])
    return add_suspension(view, Proposal(view.base, rpy, tuple(axles)))


BESIDE = 0.25
"""Largest offset along x and z between the wheels of an axle, over their radius."""
LOW = 1.0
"""How far a wheel's lowest point may lie above the lowest of all, over its radius: suspensions droop at zero angles."""
AXLES = {2: "front rear", 3: "front middle rear", 4: "front second third rear", 5: "front second middle third rear"}
TIRED = ("wheel", "tyre", "tire", "rad", "drive", "hub")
"""Words in the names of wheels, where neither shape nor inertia says whether it is one."""


def candidates_of(view: Topology, folder: Path) -> list[tuple[Joint, WheelSize]]:
    """Return the joints that might be wheels': they turn far, nothing moves below, they are round about the axis."""
    carriers = {up.name for joint in view.moving for up in view.ancestors(joint.name)}
    candidates: list[tuple[Joint, WheelSize]] = []
    for joint in view.moving:
        turns = joint.kind == "continuous" or (joint.kind == "revolute" and _far(joint))
        if not turns or joint.name in carriers or joint.child not in view.places or not np.any(joint.axis):
            continue
        size = wheel_size(view.tree, joint, folder)
        named = any(word in f"{joint.name} {joint.child}".lower() for word in TIRED)
        if size is not None and (named or "inertia" not in size.source):
            candidates.append((joint, size))
    return candidates


def _far(joint: Joint) -> bool:
    low, high = joint.limits
    return not joint.limited or high - low >= 2.0 * math.pi or high == low


def axles_of(
    view: Topology, candidates: list[tuple[Joint, WheelSize]], rpy: tuple[float, float, float]
) -> list[GuessedAxle]:
    """Return the axles from front to rear, in the frame that `rpy` turns the base to."""
    across = [
        GuessedWheel(joint.name, view.centre(joint, rpy), size)
        for joint, size in candidates
        if abs(view.axis(joint, rpy)[1]) >= ALONG
    ]
    pairs = _pairs(across)
    if not pairs:
        return []
    lowest = min(wheel.centre[2] - wheel.size.r for pair in pairs for wheel in pair)
    pairs = [pair for pair in pairs if all(w.centre[2] - w.size.r <= lowest + LOW * w.size.r for w in pair)]
    pairs.sort(key=lambda pair: -pair[0].centre[0])
    names = AXLES.get(len(pairs), " ".join(f"{letter}_axle" for letter in "abcdefghijkl"[: len(pairs)])).split()
    joints = [wheel.joint for pair in pairs for wheel in pair]
    return [
        GuessedAxle(name, pair, _steering(view, pair, joints, rpy)) for name, pair in zip(names, pairs, strict=False)
    ]


def _pairs(wheels: list[GuessedWheel]) -> list[tuple[GuessedWheel, GuessedWheel]]:
    """Return the wheels (left, right) that lie beside each other and are of one size; the nearest partner first."""
    options = [
        (float(np.hypot(*(a.centre - b.centre)[[0, 2]])), i, k)
        for i, a in enumerate(wheels)
        for k, b in enumerate(wheels)
        if a.centre[1] - b.centre[1] > a.size.r and abs(a.size.r - b.size.r) < 0.1 * a.size.r
    ]
    taken: set[int] = set()
    pairs = []
    for distance, i, k in sorted(options):
        if distance <= BESIDE * wheels[i].size.r and not {i, k} & taken:
            taken |= {i, k}
            pairs.append((wheels[i], wheels[k]))
    return pairs


def _steering(
    view: Topology, pair: tuple[GuessedWheel, GuessedWheel], wheels: Sequence[str], rpy: tuple[float, float, float]
) -> tuple[str, str] | None:
    """Return the joints that turn each of two wheels, and no other wheel, about an upright axis."""
    joints = []
    for wheel in pair:
        for up in view.ancestors(wheel.joint):
            if view.below(up.name, wheels) == [wheel.joint] and abs(view.axis(up, rpy)[2]) >= ALONG:
                joints.append(up.name)
                break
    return (joints[0], joints[1]) if len(joints) == 2 else None


def upright(view: Topology, axles: list[GuessedAxle], rpy: tuple[float, float, float]) -> bool:
    """Return whether the centre of mass lies above the wheels' lowest points; where nothing weighs, the joints."""
    lowest = min(wheel.centre[2] - wheel.size.r for axle in axles for wheel in axle.wheels)
    bodies = [(link.body, view.places[link.name]) for link in view.tree.links if link.body and link.name in view.places]
    mass = sum(body.mass for body, _ in bodies)
    if not mass > 0.0:
        heights = [float((rotation(rpy) @ place[:3, 3])[2]) for place in view.places.values()]
        return bool(np.mean(heights) > np.mean([wheel.centre[2] for axle in axles for wheel in axle.wheels]))
    middle = sum(body.mass * (place[:3, :3] @ body.centre + place[:3, 3]) for body, place in bodies) / mass
    return bool((rotation(rpy) @ middle)[2] > lowest)
