"""Faults in masses, inertias and units: numbers that no rover of that size can have."""

import math
from collections.abc import Iterator

import numpy as np

from rover_pin.rover.description.tree import Body, Link, UrdfTree

SPAN_LIMITS = (0.02, 20.0)
"""Distance across all joints of a rover [m]."""
DENSITIES = (0.1, 5000.0)
"""Mass over the cube of that distance [kg/m^3]; Nexus 6 has 64."""
GYRATION_IN_SHAPE = (0.05, 1.5)
"""Radius of gyration over the reach of the link's shapes."""
GYRATION_IN_ROVER = (0.003, 1.0)
"""The same over the distance across all joints: the least without primitive shapes; the most, as some draw a speck."""

SMALL = 0.1
"""Share of a rigid body's mass up to which a part's own inertia matters little."""


def inertia_faults(tree: UrdfTree) -> Iterator[str]:
    """Yield links whose mass or inertia no body can have, and moving parts that have none."""
    by_name = {link.name: link for link in tree.links}
    if not any(link.body is not None and link.body.mass != 0.0 for link in tree.links):
        yield (
            f"none of its {len(tree.links)} links has a mass: it is a drawing; give every moving part an <inertial> "
            "with mass, centre and inertia."
        )
        return
    for start in _starts(tree):
        if all(by_name[name].body is None for name in tree.rigid_group(start)):
            yield (
                f"link '{start}' has no <inertial> and nothing fixed to it has one; "
                "give it mass, centre and inertia, what moves freely must weigh something."
            )
    small = small_parts(tree)
    for link in tree.links:
        if link.body is not None and link.name not in small:
            yield from _body_faults(link.name, link.body)


def inertia_notes(tree: UrdfTree) -> Iterator[str]:
    """Yield what is wrong with the masses of small parts, which count for little in the body that they are fixed to."""
    small = small_parts(tree)
    for link in tree.links:
        if link.body is not None and link.name in small:
            for fault in _body_faults(link.name, link.body):
                yield f"{fault[:-1]}; it is a small part of a body that is sound, so it is only noted."


def small_parts(tree: UrdfTree) -> set[str]:
    """Return the links of at most SMALL of the mass of the rigid body that they are part of, where that is sound."""
    bodies = {link.name: link.body for link in tree.links if link.body is not None}
    places, small_links = tree.placements, set()
    for start in _starts(tree):
        group = [name for name in tree.rigid_group(start) if name in bodies and name in places]
        if not group or any(bodies[name].mass < 0.0 for name in group):
            continue
        group_body = _together([(bodies[name], places[name]) for name in group])
        if group_body.mass > 0.0 and not list(_body_faults(start, group_body)):
            small_links |= {name for name in group if bodies[name].mass <= SMALL * group_body.mass}
    return small_links


def _starts(tree: UrdfTree) -> list[str]:
    return [*tree.roots, *(joint.child for joint in tree.joints if joint.moves)]


def _together(parts: list[tuple[Body, np.ndarray]]) -> Body:
    """Return one body in place of several, in the axes of the root."""
    mass = sum(body.mass for body, _ in parts)
    centres = [place[:3, :3] @ body.centre + place[:3, 3] for body, place in parts]
    weighted = sum(body.mass * centre for (body, _), centre in zip(parts, centres, strict=True))
    middle = weighted / mass if mass else np.zeros(3)
    inertia = np.zeros((3, 3))
    for (body, place), centre in zip(parts, centres, strict=True):
        axes, off = place[:3, :3] @ body.axes, centre - middle
        inertia += axes @ body.inertia @ axes.T + body.mass * (off @ off * np.eye(3) - np.outer(off, off))
    return Body(mass, np.asarray(middle), inertia, np.eye(3))


def _body_faults(name: str, body: Body) -> Iterator[str]:
    if body.mass <= 0.0:
        yield f"link '{name}' has mass {body.mass:g} kg; it must be above zero, or leave its <inertial> out."
        return
    moments = np.linalg.eigvalsh(body.inertia)
    if moments[0] <= 0.0:
        yield (
            f"link '{name}' has an inertia that is not positive definite (smallest moment {moments[0]:.3g} kg m^2); "
            "state all of ixx, iyy, izz about its centre of mass."
        )
    elif moments[2] > (moments[0] + moments[1]) * (1.0 + 1e-3):
        a, b, c = moments
        yield (
            f"link '{name}' has principal moments {a:.3g}, {b:.3g}, {c:.3g} kg m^2, and no body has one above the sum "
            "of the others; take them from its drawing or from a uniform box of its size."
        )


def unit_faults(tree: UrdfTree, across: float) -> Iterator[str]:
    """Yield signs of wrong units; `across` is the distance across all joints at zero angles [m]."""
    low, high = SPAN_LIMITS
    if not low <= across <= high:
        hint = "divide lengths by 1000 if they are millimetres" if across > high else "are its joints' origins missing?"
        yield f"its joints lie {across:.3g} m apart, no rover's size ({low:g} to {high:g} m): {hint}; metres are meant."
        return
    mass = sum(link.body.mass for link in tree.links if link.body is not None)
    density, (low, high) = mass / across**3, DENSITIES
    if not low <= density <= high:
        hint = "are masses in grams?" if density > high else "are lengths in inches or masses in tonnes?"
        yield f"it weighs {mass:.4g} kg with joints {across:.3g} m apart, which is no rover: {hint} kg and m are meant."
        return
    small = small_parts(tree)
    for link in tree.links:
        if link.body is not None and link.name not in small:
            yield from _gyration_faults(link, link.body, across)


def _gyration_faults(link: Link, body: Body, across: float) -> Iterator[str]:
    gyration = math.sqrt(float(np.trace(body.inertia)) / (2.0 * body.mass))
    (low, high), (least, most) = GYRATION_IN_SHAPE, GYRATION_IN_ROVER
    smallest = low * link.reach if link.reach else least * across
    if not smallest <= gyration <= max(high * link.reach, most * across):
        size = f"its shapes reach {link.reach:.3g} m, " if link.reach else ""
        factor = "small" if gyration < smallest else "large"
        yield (
            f"link '{link.name}' has an inertia far too {factor} for its mass: radius of gyration {gyration:.3g} m, "
            f"and {size}the rover is {across:.3g} m across; kg m^2 are meant (1 kg mm^2 = 1e-6, 1 g cm^2 = 1e-7)."
        )
