"""Wheels that no motor turns: castors, rollers and a track's wheels, which are recognised and refused."""

import math
import re
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from rover_pin.rover.description.tree import Joint
from rover_pin.rover.proposal.parts import Topology

TRAIL = 0.25
"""Way of a wheel's centre behind an axis that swivels, over its radius, from which it is a castor's."""
UPRIGHT = 0.3
"""Cosine between axle and swivel up to which they count as square."""
ROLLER = r"mecanum|omni|(?<![a-z])rollers?(?![a-z])"
TRACK = r"idler|sprocket|(?<![a-z])(?:tracks?|treads?|belts?)(?![a-z])"
LEVEL = (0.0, 0.0, 0.0)


def passive_wheels(view: Topology, radii: Mapping[str, float]) -> Iterator[str]:
    """Yield a sentence for the castors, the rollers and the track among joints that might be wheels', of these radii.

    A castor hangs alone on a joint that swivels without limits about an axis square to its axle, behind which it
    trails, or has the name. Rollers sit on a wheel that turns too, or have the name; a track's wheels have theirs.
    """
    joints = [view.joints[name] for name in radii]
    castors = [joint.name for joint in joints if _name_matches(joint, "castor|caster") or _trails(view, joint, radii)]
    rollers = [joint.name for joint in joints if _name_matches(joint, ROLLER) or _rides_on_a_wheel(view, joint)]
    tracks = [joint.name for joint in joints if _name_matches(joint, TRACK)]
    if castors:
        yield f"{_wheels_phrase(castors)} of castors: the ground turns them, and here motors turn all wheels"
    if rollers and not tracks:
        yield f"{_wheels_phrase(rollers)} of rollers, as omnidirectional wheels have: here wheels do not roll sideways"
    if tracks:
        yield f"{_wheels_phrase(tracks)} of a track: a belt shares its load between them, which is not simulated"


def _name_matches(joint: Joint, pattern: str) -> bool:
    return re.search(pattern, f"{joint.name} {joint.child}".lower().replace("_", " ")) is not None


def _wheels_phrase(names: Sequence[str]) -> str:
    return f"{', '.join(names)} {'is the wheel' if len(names) == 1 else 'are the wheels'}"


def _trails(view: Topology, joint: Joint, radii: Mapping[str, float]) -> bool:
    """Return whether a wheel trails an axis square to its axle that swivels it alone and without limits."""
    axle, centre = view.axis(joint, LEVEL), view.centre(joint, LEVEL)
    for up in view.ancestors(joint.name):
        swivel, way = view.axis(up, LEVEL), centre - view.centre(up, LEVEL)
        alone, square = view.below(up.name, list(radii)) == [joint.name], abs(float(swivel @ axle)) <= UPRIGHT
        if _swivels(up) and alone and square:
            return abs(float(way @ np.cross(swivel, axle))) > TRAIL * radii[joint.name]
    return False


def _swivels(joint: Joint) -> bool:
    """Return whether a joint turns all the way round, also where stops half a turn to either side were given to it."""
    low, high = joint.limits
    return joint.kind == "continuous" or (joint.kind == "revolute" and high - low >= 2.0 * math.pi - 1e-6)


def _rides_on_a_wheel(view: Topology, joint: Joint) -> bool:
    """Return whether a joint that turns without limits about its own centre carries many like this one."""
    ups = view.ancestors(joint.name)
    carried = [like for like in view.moving if ups and ups[0] in view.ancestors(like.name)[:1]]
    return bool(ups) and ups[0].kind == "continuous" and len(carried) > 3
