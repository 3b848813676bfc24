"""The section of the terrain (the curve along which a wheel's plane cuts the terrain), and the wheel's contact patches
on this section.

The simulation uses compiled code for this geometry (`simulation.compiled`). This file contains the geometry in plain
Python, against which the compiled code is tested.

A facet is a straight piece of the section. The wheel touches a facet along a contact arc. A patch is the part of this
arc between the bisectors to the neighbouring facets, so that no part of the rim is counted twice: there is one patch on
flats and slopes, and there are two patches at a lip or between floor and wall.

A wheel above the border of two lanes (bands of y with one profile each) rests on each lane with a fraction of its
width. The edge between the lanes pushes the wheel sideways with the force -dU/dy, where U = f_n h / (n + 3/2) is the
work that pressed the wheel in by the sinkage h if the normal force f_n grows as h^(n + 1/2), with the sinkage exponent
n. With this force the wheel's forces are continuous in y, and crossing an edge creates no energy.
"""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from rover_pin.terrain.terrain import HeightGrid, Lanes, Terrain

_LEGENDRE = np.polynomial.legendre.leggauss(10)
NODES, WEIGHTS = 0.5 * (_LEGENDRE[0] + 1.0), 0.5 * _LEGENDRE[1]
"""Nodes and weights of the Gauss-Legendre rule with ten points on [0, 1]. The compiled step uses the same points."""

DEEPEST = 0.98
"""Maximum sinkage of a wheel in the formulas, as a fraction of its radius. A wheel that is deeper gets the forces at
this sinkage, because the formulas fail for a wheel whose centre lies below the ground. Simulations stop at a much
smaller sinkage."""

NORMAL_TOLERANCE = 1e-11
"""Maximum difference between the components of two unit normals. Up to this value, neighbouring facets of one soil are
joined to one facet. The value is far above round-off and far below every real corner."""


class WheelFrame(NamedTuple):
    """Position of a wheel's centre and directions of its axes in world coordinates, as arrays (3,).

    `centre` is in [m]. The unit vector `axle` points left, and `forward` and `up` are unit vectors in the wheel's
    plane.
    """

    centre: np.ndarray
    axle: np.ndarray
    forward: np.ndarray
    up: np.ndarray


class Facet(NamedTuple):
    """A straight piece of the terrain's section, the curve along which a wheel's plane cuts the terrain.

    `start` and `end` are points (s, t) in the wheel's plane [m], where s is measured forward and t up from the wheel's
    centre. `normal` (3,) is the unit normal of the terrain in world coordinates, and `ground` is the soil index.
    """

    start: np.ndarray
    end: np.ndarray
    normal: np.ndarray
    ground: int

    @property
    def in_plane(self) -> np.ndarray:
        """Unit normal (s, t) of the facet within the wheel's plane, pointing out of the soil."""
        ds, dt = self.end - self.start
        return np.array([-dt, ds]) / math.hypot(ds, dt)


class Patch(NamedTuple):
    """The contact of a wheel with a part of a facet, a straight piece of the ground under the wheel.

    `h` is the sinkage of the wheel below the facet's plane [m], and `depth` is the largest depth of the rim within the
    patch [m]. `share`, `tilt` and `turn` are the patch's normal force, backward force and torque, as fractions of the
    normal force and torque of a wheel that has sunk by h into a whole plane (see `patch_of`). `side` is the sideways
    force of a lane's edge along the world's y axis, per newton of normal force.
    """

    h: float
    depth: float
    share: float
    tilt: float
    turn: float
    facet: Facet
    side: float = 0.0


class Strip(NamedTuple):
    """The part of a wheel's width that is above one lane, a band of y with one profile.

    `facets` are the straight pieces of the lane's section, `share` is the fraction of the wheel's load that the lane
    carries, and `slope` is the derivative of `share` with respect to the wheel's y [1/m].
    """

    facets: list[Facet]
    share: float = 1.0
    slope: float = 0.0


def wheel_frame(centre: np.ndarray, axle: np.ndarray) -> WheelFrame:
    """Return the position and the axes of a wheel from its centre (3,) [m] and the unit vector of its axle (3,), which
    points left.

    The direction up is the world's vertical without its component along the axle, normalised; forward is the cross
    product of axle and up.
    """
    up = np.array([0.0, 0.0, 1.0]) - axle[2] * axle
    up /= np.linalg.norm(up)
    return WheelFrame(centre, axle, np.cross(axle, up), up)


def patches(
    terrain: Terrain, frame: WheelFrame, r: float, b: float, exponents: Sequence[float]
) -> tuple[list[Patch], float]:
    """Return the contact patches of a wheel on a terrain, and the wheel's sinkage [m].

    The sinkage is the largest depth of the rim on each lane, averaged over the lanes with the fraction of the load that
    each lane carries.

    Parameters
    ----------
    terrain : Terrain
        The terrain under the wheel.
    frame : WheelFrame
        Position and axes of the wheel, as `wheel_frame` returns them.
    r, b : float
        Radius and width of the wheel [m].
    exponents : sequence of float
        Sinkage exponent n of each soil, by soil index.

    Examples
    --------
    >>> from rover_pin.terrain.shapes import flat
    >>> frame = wheel_frame(np.array([0.0, 0.0, 0.09]), np.array([0.0, 1.0, 0.0]))
    >>> contacts, sinkage = patches(flat(), frame, 0.1, 0.05, [1.0])
    >>> len(contacts), round(sinkage, 3)
    (1, 0.01)
    """
    # Each lane under the wheel contributes its patches, and its sinkage in proportion to the load that it carries.
    contacts, sinkage = [], 0.0
    for strip in strips(terrain, frame, r, b):
        touching = _patches_of(strip, r, exponents)
        contacts += touching
        sinkage += strip.share * max((patch.depth for patch in touching), default=0.0)
    return contacts, sinkage


def _patches_of(strip: Strip, r: float, exponents: Sequence[float]) -> list[Patch]:
    """Return the contact patches of a wheel of radius r [m] on one lane. Their forces are multiplied by the fraction of
    the wheel's load that the lane carries.
    """
    contacts = []
    for k, facet in enumerate(strip.facets):
        n = exponents[facet.ground]
        patch = patch_of(strip.facets, k, r, n)
        if patch is not None:
            # The edge pushes with -dU/dy for each newton of normal force; see the top of this file.
            side = -strip.slope * patch.share * patch.h / (n + 1.5)
            share, tilt, turn = (strip.share * part for part in (patch.share, patch.tilt, patch.turn))
            contacts.append(patch._replace(share=share, tilt=tilt, turn=turn, side=side))
    return contacts


def strips(terrain: Terrain, frame: WheelFrame, r: float, b: float) -> list[Strip]:
    """Return the strips of a wheel of radius r and width b [m], one strip for each lane under the wheel.

    A lane is a band of y with one profile. A strip has the facets (straight pieces of the terrain's section in the
    wheel's plane) near the wheel, ordered from behind the wheel to ahead of it. A height grid has a single strip.
    """
    if not isinstance(terrain, Lanes):
        assert isinstance(terrain, HeightGrid)
        return [Strip(cut_grid(terrain, frame, r))]
    shares = (lane_share(terrain, frame, r, b, lane) for lane in range(len(terrain.profiles)))
    return [
        Strip(cut_lane(terrain, frame, r, lane), share, slope)
        for lane, (share, slope) in enumerate(shares)
        if share > 0.0
    ]


def lane_share(terrain: Lanes, frame: WheelFrame, r: float, b: float, lane: int) -> tuple[float, float]:
    """Return the fraction of a wheel's load that a lane carries, and the derivative of this fraction with respect to
    the wheel's y [1/m].

    The wheel covers the width b |axle_y| + r |forward_y| along y: the width of its rim, and about the length of its
    contact if it heads across the lanes. Over this width, the load is distributed as 6 s (1 - s), where s runs from 0
    on the right to 1 on the left. The middle carries most of the load, so that an edge pushes softly at first
    (assumed).
    """
    full = b * abs(frame.axle[1]) + r * abs(frame.forward[1])
    low, ends = frame.centre[1] - 0.5 * full, (-math.inf, *terrain.borders, math.inf)
    # The integral of 6 u (1 - u) up to s is the fraction on the right of the border at s.
    s_right, s_left = (min(max((end - low) / full, 0.0), 1.0) for end in ends[lane : lane + 2])
    right, left = (s * s * (3.0 - 2.0 * s) for s in (s_right, s_left))
    right_slope, left_slope = (6.0 * s * (1.0 - s) for s in (s_right, s_left))
    return left - right, (right_slope - left_slope) / full


def cut_lane(terrain: Lanes, frame: WheelFrame, r: float, lane: int) -> list[Facet]:
    """Return the facets (straight pieces of the terrain's section in the wheel's plane) of one lane near a wheel of
    radius r [m], ordered from behind the wheel to ahead of it.

    A straight run of the profile is one facet, however many points describe the run. If the run were divided into
    several facets, the forces would differ under a wheel that is sunk deep at a steep lip, because the lip's bisector
    would then reach beyond the facet next to the lip.
    """
    profile = terrain.profiles[lane].without_collinear_points()
    x, z, ground = profile.extended_points()
    # The profile is extruded sideways, so that its corners are level lines along y. Such a line meets the wheel's plane
    # at one point, unless the wheel runs along the line.
    across = frame.axle[1] if abs(frame.axle[1]) >= 1e-3 else math.copysign(1e-3, frame.axle[1])
    dx, dz = x - frame.centre[0], z - frame.centre[2]
    corners = np.column_stack([dx, -(frame.axle[0] * dx + frame.axle[2] * dz) / across, dz])
    points = np.column_stack([corners @ frame.forward, corners @ frame.up])
    # The next piece on either side of the nearby pieces is kept, because its bisector cuts the arc of a nearby piece.
    nearby = np.flatnonzero((x[1:] > frame.centre[0] - 1.05 * r) & (x[:-1] <= frame.centre[0] + 1.05 * r))
    pieces = range(max(nearby[0] - 1, 0), min(nearby[-1] + 2, len(ground)))
    facets = []
    for k in pieces:
        length = math.hypot(x[k + 1] - x[k], z[k + 1] - z[k])
        normal = np.array([-(z[k + 1] - z[k]), 0.0, x[k + 1] - x[k]]) / length
        facets.append(Facet(points[k], points[k + 1], normal, int(ground[k])))
    # A wheel that heads towards -x meets the facets in the opposite order.
    if frame.forward[0] < 0.0:
        facets = [facet._replace(start=facet.end, end=facet.start) for facet in reversed(facets)]
    return facets


def cut_grid(terrain: HeightGrid, frame: WheelFrame, r: float) -> list[Facet]:
    """Return up to eight facets (straight pieces of the terrain's section in the wheel's plane) of a height grid near a
    wheel of radius r [m].

    The facets join nine points of the terrain below and around the wheel, from behind it to ahead of it. Neighbouring
    facets of one soil in one plane become one facet.
    """
    points = []
    for s in 1.2 * r * np.linspace(-1.0, 1.0, 9):
        # Newton's method finds where the terrain meets the wheel's up direction, from the bottom of the wheel.
        t = -r
        for _ in range(3):
            x, y, z = frame.centre + s * frame.forward + t * frame.up
            slope_x, slope_y = terrain.gradient(x, y)
            lean = frame.up[2] - slope_x * frame.up[0] - slope_y * frame.up[1]
            t += (terrain.height(x, y) - z) / lean
        points.append(np.array([s, t]))
    facets: list[Facet] = []
    for start, end in pairwise(points):
        # The facet's normal is perpendicular to the section, and to the terrain's direction across the wheel in the
        # middle of the facet.
        s, t = 0.5 * (start + end)
        x, y, _ = frame.centre + s * frame.forward + t * frame.up
        slope_x, slope_y = terrain.gradient(x, y)
        ds, dt = end - start
        sideways = np.array([frame.axle[0], frame.axle[1], slope_x * frame.axle[0] + slope_y * frame.axle[1]])
        normal = np.cross(ds * frame.forward + dt * frame.up, sideways)
        facet = Facet(start, end, normal / np.linalg.norm(normal), int(terrain.ground_at(x, y)))
        # Facets of one plane and soil become one facet, because the bisector between them would cut the arc for
        # nothing.
        before = facets[-1] if facets else None
        is_same_soil = before is not None and before.ground == facet.ground
        if before and is_same_soil and float(np.max(np.abs(before.normal - facet.normal))) <= NORMAL_TOLERANCE:
            facets[-1] = before._replace(end=facet.end)
        else:
            facets.append(facet)
    return facets


def patch_of(facets: list[Facet], k: int, r: float, exponent: float) -> Patch | None:
    """Return the contact patch of a wheel on the facet with index `k`; None if the wheel does not touch the facet.

    theta is the angle from the facet's in-plane normal, and theta_0 the angle at which the rim leaves the facet's line.
    At theta the rim is d = r (cos theta - cos theta_0) below this line, and the pressure grows as d^n, where n is the
    sinkage exponent. The patch is the part of the arc between the bisectors to the neighbouring facets. Three integrals
    over this part give the patch's fractions of the forces on the whole arc, from -theta_0 to theta_0, of a wheel that
    has sunk by h into an endless plane:

        share = int d^n cos theta dtheta  (normal force), divided by the same integral over the whole arc
        turn = int d^n dtheta  (torque), divided by the same integral over the whole arc
        tilt = int d^n sin theta dtheta  (backward force of the radial pressure), divided by the normal force's integral
               over the whole arc

    The patches of a plane that is divided into facets therefore add up to the forces on the whole plane, for every n.

    Parameters
    ----------
    facets : list of Facet
        The section from behind the wheel to ahead of it.
    k : int
        Index of the facet.
    r : float
        Radius of the wheel [m].
    exponent : float
        Sinkage exponent n of the facet's soil.
    """
    facet = facets[k]
    n = facet.in_plane
    # The depth of the lowest point of a full circle below the facet's line; theta_0 needs it to be below 2 r.
    h = min(float(r + facet.start @ n), 1.999 * r)
    if h <= 0.0 or max(facet.start[0], facet.end[0]) < -r or min(facet.start[0], facet.end[0]) > r:
        return None
    # The whole arc in contact with the facet's line goes from -theta_0 to theta_0; the neighbours cut it.
    theta_0 = math.acos(1.0 - h / r)
    low, high = -theta_0, theta_0
    if k > 0:
        low, high = clip_at_bisector(n, facets[k - 1].in_plane, facet.start, r, (low, high), 1.0)
    if k < len(facets) - 1:
        low, high = clip_at_bisector(n, facets[k + 1].in_plane, facet.end, r, (low, high), -1.0)
    if low >= high:
        return None
    cosine = math.cos(theta_0)
    deepest = math.cos(min(max(0.0, low), high)) - cosine
    sunk = min(h, DEEPEST * r)
    # On an undivided plane the integrals below would return exactly these fractions.
    if (low, high) == (-theta_0, theta_0):
        return Patch(sunk, r * deepest, 1.0, 0.0, 1.0, facet)
    if deepest <= 1e-12:
        return None
    # Fractions of the force and torque of the whole plane that the part of the arc has.
    full_arc = depth_integrals(0.0, math.acos(1.0 - sunk / r), exponent)
    part = depth_integrals(low, theta_0, exponent) - depth_integrals(high, theta_0, exponent)
    share, turn = 0.5 * part / full_arc
    # The integral of d^n sin theta has a closed form, because the derivative of cos theta is -sin theta.
    rise = [max(math.cos(theta) - cosine, 0.0) ** (exponent + 1.0) for theta in (low, high)]
    tilt = 0.5 * (rise[0] - rise[1]) / ((exponent + 1.0) * full_arc[0])
    return Patch(sunk, r * deepest, float(share), float(tilt), float(turn), facet)


def depth_integrals(theta: float, theta_0: float, exponent: float) -> np.ndarray:
    """Return two integrals over the angle t from theta to theta_0 [rad], as an array (2,).

    The integrands are (cos t - cos theta_0)^n cos t and (cos t - cos theta_0)^n, with n = `exponent`.

    The quadrature nodes are graded by u^2 towards theta_0. There the integrand behaves as a power with the exponent n,
    and the quadrature would converge slowly on ungraded nodes.
    """
    # Both integrands are even in t, so that a negative start is reduced to positive angles.
    if theta < 0.0:
        return 2.0 * depth_integrals(0.0, theta_0, exponent) - depth_integrals(-theta, theta_0, exponent)
    back = (theta_0 - theta) * NODES**2
    depth = 2.0 * np.sin(theta_0 - 0.5 * back) * np.sin(0.5 * back)
    part = WEIGHTS * 2.0 * (theta_0 - theta) * NODES * depth**exponent
    return np.array([part @ np.cos(theta_0 - back), part.sum()])


def clip_at_bisector(
    normal: np.ndarray, neighbour: np.ndarray, corner: np.ndarray, r: float, arc: tuple[float, float], side: float
) -> tuple[float, float]:
    """Return the part of a facet's contact arc that lies on the facet's side of the bisector to a neighbouring facet.

    A point of the rim at theta is a + r sin(theta - delta) ahead of the bisector, where a is the distance of the
    wheel's centre ahead of the bisector [m], and delta is the angle from the facet's normal to the bisector [rad].

    Parameters
    ----------
    normal, neighbour : arrays (2,)
        In-plane unit normals (s, t) of the facet and of its neighbour, s forward and t up.
    corner : array (2,)
        Common point (s, t) of the two facets [m], from the wheel's centre.
    r : float
        Radius of the wheel [m].
    arc : (low, high)
        The contact arc before it is clipped [rad], from the facet's normal.
    side : float
        1 if the neighbour lies behind the facet, -1 if the neighbour lies ahead of the facet.

    Returns
    -------
    (low, high)
        The remaining arc [rad]; low > high if nothing remains.
    """
    # The bisector points out of the soil, midway between the two normals; `ahead` is perpendicular to it.
    bisector = (normal + neighbour) / np.linalg.norm(normal + neighbour)
    ahead = np.array([bisector[1], -bisector[0]])
    a = -float(corner @ ahead)
    # A wheel that lies wholly on one side of the bisector keeps its arc, or has no arc on this facet.
    if side * a >= r:
        return arc
    if side * a <= -r:
        return 1.0, -1.0
    edge, turn = math.asin(-a / r), math.copysign(math.pi, side)
    delta = math.atan2(normal @ ahead, normal @ bisector)
    return max(arc[0], min(edge, turn - edge) + delta), min(arc[1], max(edge, turn - edge) + delta)
