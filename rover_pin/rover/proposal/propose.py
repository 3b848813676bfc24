"""Search for the wheels, the axles and the front of the rover in a URDF.

`propose` returns the whole proposal for the roles of the joints. The module `suspension` adds the pivots to it.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rover_pin.base.errors import UrdfError
from rover_pin.rover.description.drawn_axis import axis_against_drawing, might_be_wheels
from rover_pin.rover.description.faults import missing_links, name_faults
from rover_pin.rover.description.joint_forms import ALONG
from rover_pin.rover.description.meshes import mesh_file
from rover_pin.rover.description.tree import Joint, UrdfTree
from rover_pin.rover.proposal.frames import FRAMES, Frame, Rpy, contradictions, named_places, place_words, rotation
from rover_pin.rover.proposal.parts import GuessedAxle, GuessedWheel, Proposal, Topology
from rover_pin.rover.proposal.suspension import add_suspension
from rover_pin.rover.proposal.wheel_shape import WheelSize, wheel_size

MAX_OFFSET = 0.25
"""Largest offset along x and z between two wheels that count as an axle, divided by their radius. Wheels with a larger
offset do not form a pair. The two wheels of an axle of a real rover are opposite each other, up to small errors in the
drawing."""
MAX_RISE = 1.0
"""Largest height of a wheel's lowest point above the lowest point of all wheels, divided by the wheel's radius. A
higher wheel is not on the ground and is ignored. A small height is allowed, because suspensions droop at zero
angles."""
AXLES = {2: "front rear", 3: "front middle rear", 4: "front second third rear", 5: "front second middle third rear"}
"""Number of axles -> names of the axles from front to rear."""
WHEEL_WORDS = ("wheel", "tyre", "tire", "rad", "drive", "hub")
"""Words in the names of wheels. They show which joints are wheels if no drawn shape is round about the joint's axis."""
MIN_TRAIL = 0.25
"""Smallest distance of a castor's centre from its swivel axis, divided by the wheel's radius. With a smaller distance,
the wheel counts as a steered wheel, because designers put the axis of steering close to the wheel's centre."""
MAX_COSINE = 0.3
"""Largest cosine of the angle between the axle and the swivel axis of a castor. If the cosine is larger, the two axes
are not at right angles, and the wheel is not a castor. The value allows a deviation of 17 deg, because the axes of real
castors can be inclined."""
ROLLER = r"mecanum|omni|(?<![a-z])rollers?(?![a-z])"
"""Pattern in the names of the rollers of an omnidirectional wheel."""
TRACK = r"idler|sprocket|(?<![a-z])(?:tracks?|treads?|belts?)(?![a-z])"
"""Pattern in the names of the wheels of a crawler track."""
LEVEL = (0.0, 0.0, 0.0)
"""Roll, pitch and yaw [rad] of the rotation that leaves the axes of the base link unchanged."""


class Option(NamedTuple):
    """A possible choice of the rover's axes, and the axles that are found with this choice.

    `frame` states which axes of the base link point forward and up.
    """

    frame: Frame
    axles: list[GuessedAxle]


def propose(tree: UrdfTree, folder: Path, front: str = "", size: WheelSize | None = None) -> Proposal:
    """Return the proposed roles of the joints of a URDF, with a reason for each guess.

    Parameters
    ----------
    tree : UrdfTree
        The URDF.
    folder : path
        The folder of the URDF, which is searched for its meshes.
    front : str
        The axis of the base link that points forward, for example "-x"; if empty, the names of the wheels decide.
    size : WheelSize, optional
        The size of all wheels. If None, the drawings or inertias of the wheels' links show their sizes.

    Raises
    ------
    UrdfError
        Two parts share a name; a joint's axis lies across its drawn wheel; there are fewer than two pairs of wheels;
        wheels have no size or cannot have a motor; or names contradict the positions of the wheels.
    """
    faults = [*name_faults(tree), *(fault for joint in tree.joints for fault in missing_links(tree, joint))]
    # The checks build on each other: a check of axes needs unique names and existing links, and a search for wheels
    # needs right axes.
    faults = faults or list(axis_against_drawing(tree, might_be_wheels(tree)))
    view = Topology(tree)
    # A joint without an `<axis>` turns about x. It has a fault if the mesh of its link is round about another axis.
    for joint in [] if faults else leaves(view):
        if joint.axis_written or wheel_size(tree, joint, folder, drawn_only=True) is not None:
            continue
        for axis in np.eye(3):
            drawn = wheel_size(tree, joint._replace(axis=axis), folder, drawn_only=True)
            if drawn is not None:
                faults.append(
                    f"joint '{joint.name}' has no <axis>, so that the joint turns about x, but {drawn.source} is "
                    f"round about {'xyz'[int(np.argmax(axis))]}: write the <axis> in the joint."
                )
                break
    if faults:
        more = f" ({len(faults) - 1} more of this kind.)" if len(faults) > 1 else ""
        raise UrdfError(f"{tree.file}: {faults[0]}{more}")
    candidates = candidates_of(view, folder, size)
    for refusal in passive_wheels(view, {joint.name: size.r for joint, size in candidates}):
        raise UrdfError(f"{tree.file}: {refusal}; remove them, or use a rover whose wheels are all driven.")
    # The positions of the wheels may allow several frames of the base link. Only the frames with the most axles are
    # kept.
    options = []
    for frame in FRAMES:
        axles = axles_of(view, candidates, frame.rpy)
        if len(axles) >= 2 and upright(view, axles, frame.rpy) and front in ("", frame.forward):
            options.append(Option(frame, axles))
    if not options:
        raise UrdfError(_no_axles(view, folder, candidates, front))
    axle_count = max(len(option.axles) for option in options)
    option, reason = _front(view, [option for option in options if len(option.axles) == axle_count], front)
    proposal = Proposal(view.base, option.frame.rpy, tuple(option.axles))
    proposal.reasons |= {"base_rpy": option.frame.words, "front": reason}
    return add_suspension(view, proposal)


def _no_axles(view: Topology, folder: Path, candidates: list[tuple[Joint, WheelSize]], front: str) -> str:
    """Return the error message for a URDF with fewer than two recognised axles, with the probable reason.

    The reasons are tested in this order: wheels of unknown size; joints with a wheel's name that do not turn by a full
    turn; no pairs of wheels opposite each other (if `front` is given: with this axis forward).
    """
    # First reason: joints with a wheel's name whose size nothing shows.
    sized = {joint.name for joint, _ in candidates}
    unsized = [joint for joint in leaves(view) if joint.name not in sized and looks_like_a_wheel(view, joint, folder)]
    if len(sized) < 4 and unsized:
        links = {link.name: link for link in view.tree.links}
        meshes = dict.fromkeys(mesh for joint in unsized for mesh in links[joint.child].meshes)
        reason = (
            f"the meshes {', '.join(meshes)} are not found or cannot be read" if meshes else "their links draw nothing"
        )
        return (
            f"{view.tree.file}: {', '.join(joint.name for joint in unsized)} turn like wheels, but nothing states "
            f"their size: {reason}, and their inertia does not belong to a wheel. Put the meshes into the URDF's "
            "folder, or give the radius and the width of the wheels: --r 0.1 --b 0.08."
        )
    # Second reason: joints with a wheel's name that are fixed, or have stops less than a full turn apart.
    stopped = [
        f"'{joint.name}' is {joint.kind}"
        + (f", {joint.limits[1] - joint.limits[0]:.3g} rad between its stops" if joint.kind == "revolute" else "")
        for joint in view.joints.values()
        if joint.kind in ("fixed", "revolute", "prismatic")
        and joint.name not in {leaf.name for leaf in leaves(view)}
        and re.search("wheel|tyre|tire", f"{joint.name} {joint.child}".lower())
    ]
    if len(sized) < 4 and stopped:
        return (
            f"{view.tree.file}: no two axles of wheels are found, because joints with a wheel's name do not turn "
            f"fully: {'; '.join(stopped)}. Make these joints continuous, or give them stops a full turn apart."
        )
    names = f" ({', '.join(joint.name for joint, _ in candidates)})" if candidates else ""
    forward = f" with {front} forward" if front else ""
    return (
        f"{view.tree.file}: no two axles of wheels are found{forward}. A wheel's joint must be continuous or turn by a "
        "full turn, carry no other moving joint, have a partner on the other side, and have an axis across the base "
        f"(+y or -y); its link must be round about this axis. {len(candidates)} joints might be wheels{names}. Write "
        "the TOML by hand; urdf/cart.toml is an example."
    )


def _front(view: Topology, options: list[Option], front: str) -> tuple[Option, str]:
    """Return the choice of the rover's axes with which the positions of all wheels agree with their names, and a
    comment on this choice for the TOML.

    If `front` is given, or if no name states an end or a side, the first of the options is returned.

    Raises UrdfError: the names contradict the positions with every choice of axes; the error asks which axis points
    forward.
    """
    first = options[0]
    # The user's statement decides; otherwise the names of the wheels decide between the two ends.
    if front:
        return first, f"{front} of link '{view.base}' points forward, as --front states."
    names = {wheel.joint: view.joints[wheel.joint].child for axle in first.axles for wheel in axle.wheels}
    places = [named_places(list(names)), named_places(list(names.values()))]
    if not any(place.end is not None or place.side is not None for named in places for place in named):
        return first, (
            f"No wheel's name states the front: {first.frame.forward} of link '{view.base}' is taken as forward. "
            "--front=-x takes the other end."
        )
    # A choice of axes is accepted if no wheel's name contradicts its position. For each option, the wheels whose names
    # contradict their positions are listed, each with its position in words.
    joints, wrong = list(names), {}
    for option in options:
        centres = {wheel.joint: wheel.centre for axle in option.axles for wheel in axle.wheels}
        if set(centres) != set(joints):
            wrong[option.frame] = ["other joints are wheels"]
            continue
        array = np.array([centres[joint] for joint in joints])
        against = sorted({i for named in places for i in contradictions(named, array)})
        middle = array.mean(axis=0)
        wrong[option.frame] = [f"'{joints[i]}' lies at the {place_words(array[i], middle)}" for i in against]
    for option in options:
        # Names alone are not enough to turn a rover upside down. The centre of mass must also lie below the wheels'
        # centres.
        same_up = option.frame.up == first.frame.up or height_over_wheels(view, first.axles, first.frame.rpy) < 0.0
        if not wrong[option.frame] and same_up:
            return option, f"The names of the wheels agree with {option.frame.forward} of link '{view.base}' forward."
    nearest = min(options, key=lambda option: len(wrong[option.frame]))
    raise UrdfError(
        f"{view.tree.file}: the names of the wheels contradict their positions, whichever axis of link '{view.base}' "
        f"points forward. With {nearest.frame.forward} forward, {', '.join(wrong[nearest.frame])}. Which axis points "
        f"forward? Answer with --front={nearest.frame.forward} (or another of +x, -x, +y, -y), or correct the names or "
        "the origins."
    )


def leaves(view: Topology) -> list[Joint]:
    """Return the joints that may be wheels' joints: they can turn by a full turn and carry no other moving joint."""
    carriers = {up.name for joint in view.moving for up in view.ancestors(joint.name)}
    return [
        joint
        for joint in view.moving
        # For a joint without stops, some tools write a revolute joint without a limit, or with lower = upper = 0.
        if (joint.turns_fully or (joint.kind == "revolute" and (not joint.limited or len(set(joint.limits)) == 1)))
        and joint.name not in carriers
        and joint.child in view.places
        and np.any(joint.axis)
    ]


def looks_like_a_wheel(view: Topology, joint: Joint, folder: Path) -> bool:
    """Return whether a joint may be a wheel's joint, judged by names. This is asked if no drawn shape is round about
    the joint's axis.

    The result is True if the name of the joint or of its link contains a word for a wheel, or if the names state an end
    and a side and the mesh of the link is missing.
    """
    has_wheel_name = any(word in f"{joint.name} {joint.child}".lower() for word in WHEEL_WORDS)
    states_place = any(
        place.end is not None and place.side is not None for place in named_places([joint.name, joint.child])
    )
    meshes = [mesh for link in view.tree.links if link.name == joint.child for mesh in link.meshes]
    return has_wheel_name or (states_place and any(mesh_file(mesh, folder) is None for mesh in meshes))


def candidates_of(view: Topology, folder: Path, stated: WheelSize | None = None) -> list[tuple[Joint, WheelSize]]:
    """Return the joints that may be wheels' joints, each with the size of its wheel.

    Such a joint turns a shape that is round about its axis, or has the name of a wheel. `stated` is the size of all
    wheels; if None, sizes are found from drawings and inertias. A wheel of unknown size gets the size of the first
    wheel of known size.
    """
    # Every link has an inertia, so an inertia alone does not show a wheel. Then the name must contain a word for a
    # wheel.
    candidates: list[tuple[Joint, WheelSize]] = []
    unsized: list[Joint] = []
    for joint in leaves(view):
        size = wheel_size(view.tree, joint, folder)
        looks = looks_like_a_wheel(view, joint, folder)
        if size is not None and (looks or "inertia" not in size.source):
            candidates.append((joint, stated or size))
        elif size is None and looks:
            unsized.append(joint)
    if stated is not None:
        return candidates + [(joint, stated) for joint in unsized]
    if candidates and unsized:
        r, b, _ = candidates[0][1]
        other = WheelSize(r, b, f"the wheel of joint '{candidates[0][0].name}': this wheel states no size")
        candidates += [(joint, other) for joint in unsized]
    return candidates


def axles_of(
    view: Topology, candidates: list[tuple[Joint, WheelSize]], rpy: tuple[float, float, float]
) -> list[GuessedAxle]:
    """Return the axles of a rover from front to rear, for one choice of its axes.

    Parameters
    ----------
    view : Topology
        The tree of the URDF's joints.
    candidates : list of (Joint, WheelSize)
        The joints that may be wheels' joints, each with the size of its wheel.
    rpy : tuple of float
        The choice of axes: the rotation that turns the base link's axes to x forward, y left, z up [rad].
    """
    across = [
        GuessedWheel(joint.name, view.centre(joint, rpy), size)
        for joint, size in candidates
        if abs(view.axis(joint, rpy)[1]) >= ALONG
    ]
    pairs = _pairs(across)
    if not pairs:
        return []
    # A wheel that is far above the lowest wheel does not stand on the ground.
    lowest = min(wheel.centre[2] - wheel.size.r for pair in pairs for wheel in pair)
    pairs = [pair for pair in pairs if all(w.centre[2] - w.size.r <= lowest + MAX_RISE * w.size.r for w in pair)]
    pairs.sort(key=lambda pair: -pair[0].centre[0])
    names = AXLES.get(len(pairs), " ".join(f"{letter}_axle" for letter in "abcdefghijkl"[: len(pairs)])).split()
    joints = [wheel.joint for pair in pairs for wheel in pair]
    axles = []
    for name, pair in zip(names, pairs, strict=False):
        # A steering joint carries one wheel and no other, and turns about an upright axis. Both wheels need such a
        # joint.
        steering = []
        for wheel in pair:
            for up in view.ancestors(wheel.joint):
                if view.below(up.name, joints) == [wheel.joint] and abs(view.axis(up, rpy)[2]) >= ALONG:
                    steering.append(up.name)
                    break
        axles.append(GuessedAxle(name, pair, (steering[0], steering[1]) if len(steering) == 2 else None))
    return axles


def _pairs(wheels: list[GuessedWheel]) -> list[tuple[GuessedWheel, GuessedWheel]]:
    """Return the pairs of wheels (left, right) that lie opposite each other and have equal size.

    If a wheel has several possible partners, the nearest one is taken.
    """
    # The nearest pairs are taken first, and each wheel belongs to one pair.
    options = [
        (float(np.hypot(*(a.centre - b.centre)[[0, 2]])), i, k)
        for i, a in enumerate(wheels)
        for k, b in enumerate(wheels)
        if a.centre[1] - b.centre[1] > a.size.r and abs(a.size.r - b.size.r) < 0.1 * a.size.r
    ]
    taken: set[int] = set()
    pairs = []
    for distance, i, k in sorted(options):
        if distance <= MAX_OFFSET * wheels[i].size.r and not {i, k} & taken:
            taken |= {i, k}
            pairs.append((wheels[i], wheels[k]))
    return pairs


def upright(view: Topology, axles: list[GuessedAxle], rpy: Rpy) -> bool:
    """Return whether the rover is upright with a choice of its axes.

    The rover is upright if its centre of mass is above the lowest point of its wheels. If no link has a mass, the mean
    height of the links must be above the mean height of the wheels' centres. The rotation `rpy` turns the base link's
    axes to the chosen axes.
    """
    height, has_mass = _middle_height(view, rpy)
    if not has_mass:
        return height > float(np.mean([wheel.centre[2] for axle in axles for wheel in axle.wheels]))
    return height > min(wheel.centre[2] - wheel.size.r for axle in axles for wheel in axle.wheels)


def height_over_wheels(view: Topology, axles: list[GuessedAxle], rpy: Rpy) -> float:
    """Return the height of the rover's centre of mass above the mean height of the wheels' centres [m]. The rotation
    `rpy` turns the base link's axes to axes whose z points up.
    """
    return _middle_height(view, rpy)[0] - float(np.mean([wheel.centre[2] for axle in axles for wheel in axle.wheels]))


def _middle_height(view: Topology, rpy: Rpy) -> tuple[float, bool]:
    """Return a mean height of the rover [m], and whether its links have masses.

    The height is the height of the centre of mass, or the mean height of the links if no link has a mass. The rotation
    `rpy` turns the base link's axes to axes whose z points up.
    """
    bodies = [(link.body, view.places[link.name]) for link in view.tree.links if link.body and link.name in view.places]
    mass = sum(body.mass for body, _ in bodies)
    if not mass > 0.0:
        return float(np.mean([(rotation(rpy) @ place[:3, 3])[2] for place in view.places.values()])), False
    middle = sum(body.mass * (place[:3, :3] @ body.centre + place[:3, 3]) for body, place in bodies) / mass
    return float((rotation(rpy) @ middle)[2]), True


def passive_wheels(view: Topology, radii: Mapping[str, float]) -> Iterator[str]:
    """Yield a sentence for each kind of passive wheels among the given joints: castors, rollers, and wheels of a track.

    No motor turns such wheels, so that a rover with them is refused.

    A castor is the only wheel on a joint that swivels without limits. The swivel axis is at right angles to the axle
    and has a distance (trail) from the wheel's centre; a wheel with castor in its name counts too. Rollers are carried
    by a joint without limits that carries more than three joints, as in an omnidirectional wheel, or have the word in
    their names. The wheels of a track are recognised by their names only.

    Parameters
    ----------
    view : Topology
        The tree of the URDF's joints.
    radii : mapping
        Name of a joint that may be a wheel's joint -> radius of the wheel [m].
    """
    joints = [view.joints[name] for name in radii]
    castors = []
    for joint in joints:
        if _name_matches(joint, "castor|caster"):
            castors.append(joint.name)
            continue
        axle, centre = view.axis(joint, LEVEL), view.centre(joint, LEVEL)
        # The nearest joint above the wheel that carries no other wheel, swivels without limits, and has its axis at
        # right angles to the axle decides whether there is a trail.
        for up in view.ancestors(joint.name):
            swivel, offset = view.axis(up, LEVEL), centre - view.centre(up, LEVEL)
            alone, square = view.below(up.name, list(radii)) == [joint.name], abs(float(swivel @ axle)) <= MAX_COSINE
            if up.turns_fully and alone and square:
                if abs(float(offset @ np.cross(swivel, axle))) > MIN_TRAIL * radii[joint.name]:
                    castors.append(joint.name)
                break
    # Rollers sit on a wheel, which is a joint without limits that carries more than three joints.
    rollers = []
    for joint in joints:
        ups = view.ancestors(joint.name)
        carried = [other for other in view.moving if ups and ups[0] in view.ancestors(other.name)[:1]]
        rides_on_wheel = bool(ups) and ups[0].kind == "continuous" and len(carried) > 3
        if _name_matches(joint, ROLLER) or rides_on_wheel:
            rollers.append(joint.name)
    tracks = [joint.name for joint in joints if _name_matches(joint, TRACK)]
    if castors:
        yield f"{_wheels_phrase(castors)} of castors, which have no motor, but the simulation needs driven wheels"
    if rollers and not tracks:
        yield (
            f"{_wheels_phrase(rollers)} of rollers (omnidirectional wheels), but simulated wheels cannot roll sideways"
        )
    if tracks:
        yield (
            f"{_wheels_phrase(tracks)} of a track, whose belt distributes the load over its wheels, but the simulation "
            "has no belts"
        )


def _name_matches(joint: Joint, pattern: str) -> bool:
    """Return whether the name of a joint or of its child link contains the regular expression `pattern`."""
    return re.search(pattern, f"{joint.name} {joint.child}".lower().replace("_", " ")) is not None


def _wheels_phrase(names: Sequence[str]) -> str:
    """Return the beginning of a sentence about wheels: "NAME is the wheel", or for several wheels "NAME, NAME are the
    wheels".
    """
    return f"{', '.join(names)} {'is the wheel' if len(names) == 1 else 'are the wheels'}"
