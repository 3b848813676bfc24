"""Faults in the masses, inertias and units of a URDF: values that no rover of its size can have."""

import math
from collections.abc import Iterator

import numpy as np

from rover_pin.rover.description.tree import Body, UrdfTree

SPAN_LIMITS = (0.02, 20.0)
"""Smallest and largest diagonal of the box around all joints of a rover [m]. Outside this range a fault is reported,
because lengths are probably in other units."""
DENSITIES = (0.1, 5000.0)
"""Smallest and largest mass of a rover divided by the cube of its size [kg/m^3]. The size is the diagonal of the box
around all joints. Outside this range a fault is reported, because masses are probably in other units."""
GYRATION_IN_SHAPE = (0.05, 1.5)
"""Smallest and largest radius of gyration of a link, divided by the largest distance of a point of its shapes from its
centre of mass. Outside this range a fault is reported, because inertias are probably in other units."""
GYRATION_IN_ROVER = (0.003, 1.0)
"""Smallest and largest radius of gyration of a link, divided by the diagonal of the box around all joints of the rover.

The smallest value is used for links without a primitive shape. The largest value is used for all links, because some
links have only a tiny shape."""
MAX_SMALL_PART = 0.1
"""Largest mass of a small part, as a fraction of the mass of its rigid body. An impossible inertia of a small part is
only noted and is no fault, because it hardly changes the motion of the rigid body."""


def inertia_faults(tree: UrdfTree) -> Iterator[str]:
    """Yield a fault for each link with an impossible mass or inertia, and for each rigid body that moves but has no
    mass.
    """
    by_name = {link.name: link for link in tree.links}
    # If no link has a mass, the URDF is only a drawing. One sentence about this is clearer than a sentence for each
    # link.
    if not any(link.body is not None and link.body.mass != 0.0 for link in tree.links):
        yield (
            f"none of its {len(tree.links)} links has a mass, so that the URDF is only a drawing; give every moving "
            "part an <inertial> with mass, centre and inertia."
        )
        return
    # The links of a rigid body may be massless, if one of them has the body's mass.
    for start in _starts(tree):
        if all(by_name[name].body is None for name in tree.rigid_group(start)):
            yield (
                f"link '{start}' has no <inertial> and nothing fixed to it has an <inertial>; give it mass, centre and "
                "inertia, because a part that moves freely must have a mass."
            )
    # Small parts are only noted (`inertia_notes`), because their inertia matters little.
    small = small_parts(tree)
    for link in tree.links:
        if link.body is not None and link.name not in small:
            yield from _body_faults(link.name, link.body)


def inertia_notes(tree: UrdfTree) -> Iterator[str]:
    """Yield a note for each small part (`small_parts`) with an impossible mass or inertia, which is no fault."""
    small = small_parts(tree)
    for link in tree.links:
        if link.body is not None and link.name in small:
            for fault in _body_faults(link.name, link.body):
                yield f"{fault[:-1]}; the link is a small part of a body without faults, so this is only a note."


def small_parts(tree: UrdfTree) -> set[str]:
    """Return the names of the links that are small parts of their rigid bodies.

    A rigid body is a group of links that are fixed to each other. The mass of a small part is at most the fraction
    MAX_SMALL_PART of the mass of the rigid body. If the mass or the inertia of the whole rigid body is impossible, none
    of its links is returned.
    """
    bodies = {link.name: link.body for link in tree.links if link.body is not None}
    places, small_links = tree.placements, set()
    # The links of a rigid body are compared with the body as a whole.
    for start in _starts(tree):
        group = [name for name in tree.rigid_group(start) if name in bodies and name in places]
        if not group or any(bodies[name].mass < 0.0 for name in group):
            continue
        # The group as one body in the axes of the root link: first the total mass and the common centre of mass, then
        # all inertias about this centre (parallel-axis theorem).
        parts = [(bodies[name], places[name]) for name in group]
        mass = sum(body.mass for body, _ in parts)
        centres = [place[:3, :3] @ body.centre + place[:3, 3] for body, place in parts]
        weighted = sum(body.mass * centre for (body, _), centre in zip(parts, centres, strict=True))
        middle = weighted / mass if mass else np.zeros(3)
        inertia = np.zeros((3, 3))
        for (body, place), centre in zip(parts, centres, strict=True):
            axes, off = place[:3, :3] @ body.axes, centre - middle
            inertia += axes @ body.inertia @ axes.T + body.mass * (off @ off * np.eye(3) - np.outer(off, off))
        group_body = Body(mass, np.asarray(middle), inertia, np.eye(3))
        if group_body.mass > 0.0 and not list(_body_faults(start, group_body)):
            small_links |= {name for name in group if bodies[name].mass <= MAX_SMALL_PART * group_body.mass}
    return small_links


def _starts(tree: UrdfTree) -> list[str]:
    """Return the name of the innermost link of each rigid body: the root links, and the child links of the joints that
    move.
    """
    return [*tree.roots, *(joint.child for joint in tree.joints if joint.moves)]


def _body_faults(name: str, body: Body) -> Iterator[str]:
    """Yield a fault if no real body can have this mass and inertia. Only the first reason is given. `name` is the name
    of the link.
    """
    if body.mass <= 0.0:
        yield f"link '{name}' has mass {body.mass:g} kg; it must be above zero, or delete its <inertial>."
        return
    # For any distribution of mass I_1 + I_2 - I_3 = 2 int z^2 dm >= 0. The margin allows for rounding in files.
    moments = np.linalg.eigvalsh(body.inertia)
    if moments[0] <= 0.0:
        yield (
            f"link '{name}' has an inertia that is not positive definite (smallest moment {moments[0]:.3g} kg m^2); "
            "give ixx, iyy and izz about its centre of mass."
        )
    elif moments[2] > (moments[0] + moments[1]) * (1.0 + 1e-3):
        a, b, c = moments
        yield (
            f"link '{name}' has principal moments {a:.3g}, {b:.3g}, {c:.3g} kg m^2, but no body has a moment above "
            "the sum of the others; take the moments from its drawing or from a uniform box of its size."
        )


def unit_faults(tree: UrdfTree, across: float) -> Iterator[str]:
    """Yield a fault if the lengths, masses or inertias of a URDF are probably in wrong units.

    Lengths are checked first, because the checks of masses and inertias use them.

    Parameters
    ----------
    tree : UrdfTree
        The URDF.
    across : float
        Diagonal of the box around all joints at zero angles [m].
    """
    # Lengths come first, because the limits of masses and inertias are relative to them.
    low, high = SPAN_LIMITS
    if not low <= across <= high:
        hint = "divide lengths by 1000 if they are millimetres" if across > high else "are its joints' origins missing?"
        yield (
            f"its joints lie {across:.3g} m apart, which is no rover's size ({low:g} to {high:g} m): {hint}; lengths "
            "must be in metres."
        )
        return
    # The density of the rover shows wrong units of mass.
    mass = sum(link.body.mass for link in tree.links if link.body is not None)
    density, (low, high) = mass / across**3, DENSITIES
    if not low <= density <= high:
        hint = "are masses in grams?" if density > high else "are lengths in inches or masses in tonnes?"
        yield (
            f"it weighs {mass:.4g} kg with joints {across:.3g} m apart, which is no rover: {hint} Masses must be in kg "
            "and lengths in m."
        )
        return
    small = small_parts(tree)
    for link in tree.links:
        if link.body is not None and link.name not in small:
            # The radius of gyration must fit the reach of the link's shapes and the size of the rover.
            gyration = math.sqrt(float(np.trace(link.body.inertia)) / (2.0 * link.body.mass))
            (low, high), (rover_low, rover_high) = GYRATION_IN_SHAPE, GYRATION_IN_ROVER
            smallest = low * link.reach if link.reach else rover_low * across
            if not smallest <= gyration <= max(high * link.reach, rover_high * across):
                size = f"its shapes reach {link.reach:.3g} m, " if link.reach else ""
                factor = "small" if gyration < smallest else "large"
                yield (
                    f"link '{link.name}' has an inertia far too {factor} for its mass: its radius of gyration is "
                    f"{gyration:.3g} m, {size}the rover is {across:.3g} m across; inertias must be in kg m^2 "
                    "(1 kg mm^2 = 1e-6 kg m^2, 1 g cm^2 = 1e-7 kg m^2)."
                )
