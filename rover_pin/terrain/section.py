"""The terrain as a wheel's plane cuts it, and the contact patches that the cut leaves: the plain, readable reference.

A facet is a straight piece of the cut. A patch is the part of a facet's contact arc that lies between the bisectors to
its neighbours, so that patches tile the arc: one on flats and slopes, two at a lip or between floor and wall.

A wheel over the border of two lanes rests in each by the share of its width that lies over it, and the edge pushes
it sideways by what moving across would store in the soil, -dU/dy with U = f_n h / (n + 3/2), the work that pressed the
wheel in where f_n grows as h^(n + 1/2). So its forces are continuous in y, and a wheel is not lifted for nothing.
"""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from rover_pin.terrain.terrain import HeightGrid, Lanes, Terrain

_LEGENDRE = np.polynomial.legendre.leggauss(10)
NODES, WEIGHTS = 0.5 * (_LEGENDRE[0] + 1.0), 0.5 * _LEGENDRE[1]
"""Gauss-Legendre rule on [0, 1]."""

DEEPEST = 0.98
"""A wheel is reckoned sunk by this share of its radius at most; simulations stop long before."""


ONE_PLANE = 1e-11
"""Neighbours whose unit normals differ by at most this are one facet."""


class WheelFrame(NamedTuple):
    """A wheel in space: centre, axle (unit, to the left), and the upright frame of its plane."""

    centre: np.ndarray
    axle: np.ndarray
    forward: np.ndarray
    up: np.ndarray


class Facet(NamedTuple):
    """A straight piece of the cut: end points (s, t) in the wheel's plane, 3D unit normal, soil index."""

    start: np.ndarray
    end: np.ndarray
    normal: np.ndarray
    ground: int

    @property
    def in_plane(self) -> np.ndarray:
        """Unit normal (s, t) within the wheel's plane."""
        ds, dt = self.end - self.start
        return np.array([-dt, ds]) / math.hypot(ds, dt)


class Patch(NamedTuple):
    """A part of a facet's contact: sinkage h of the facet's plane, greatest depth within the part [m], shares [-].

    `side` is the push of a lane's edge along the world's y, per normal force; `depth` counts by the share of the width.
    """

    h: float
    depth: float
    share: float
    tilt: float
    turn: float
    facet: Facet
    side: float = 0.0


class Strip(NamedTuple):
    """A part of a wheel's width over one piece of ground: its facets, its share of the width, d share / dy [1/m]."""

    facets: list[Facet]
    share: float = 1.0
    slope: float = 0.0


def wheel_frame(centre: np.ndarray, axle: np.ndarray) -> WheelFrame:
    """Return the frame of a wheel whose axle points left: forward = axle x up."""
    up = np.array([0.0, 0.0, 1.0]) - axle[2] * axle
    up /= np.linalg.norm(up)
    return WheelFrame(centre, axle, np.cross(axle, up), up)


def patches(
    terrain: Terrain, frame: WheelFrame, r: float, b: float, exponents: Sequence[float]
) -> tuple[list[Patch], float]:
    """Return the contact patches of a wheel of radius `r` and width `b` [m], and its sinkage [m].

    `exponents` are n of the soils by index. The sinkage is the greatest depth, its mean over the width.
    """
    contacts, sinkage = [], 0.0
    for strip in strips(terrain, frame, r, b):
        touching = _patches_of(strip, r, exponents)
        contacts += touching
        sinkage += strip.share * max((patch.depth for patch in touching), default=0.0)
    return contacts, sinkage


def _patches_of(strip: Strip, r: float, exponents: Sequence[float]) -> list[Patch]:
    contacts = []
    for k, facet in enumerate(strip.facets):
        n = exponents[facet.ground]
        patch = patch_of(strip.facets, k, r, n)
        if patch is not None:
            side = -strip.slope * patch.share * patch.h / (n + 1.5)
            share, tilt, turn = (strip.share * part for part in (patch.share, patch.tilt, patch.turn))
            contacts.append(patch._replace(share=share, tilt=tilt, turn=turn, side=side))
    return contacts


def strips(terrain: Terrain, frame: WheelFrame, r: float, b: float) -> list[Strip]:
    """Return the facets near the wheel, from behind to ahead, for each part of its width that has its own ground."""
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
    """Return what share of a wheel a lane carries, and its slope by y [1/m].

    The width along y is b |axle_y| + r |forward_y|: that of the rim, and of about a contact's length where the wheel
    heads across the lanes. It carries as 6 s (1 - s) from one end to the other, most in the middle, so that an edge
    pushes softly at first (assumed).
    """
    full = b * abs(frame.axle[1]) + r * abs(frame.forward[1])
    low, ends = frame.centre[1] - 0.5 * full, (-math.inf, *terrain.borders, math.inf)
    (right, right_slope), (left, left_slope) = (_carried_share((end - low) / full) for end in ends[lane : lane + 2])
    return left - right, (right_slope - left_slope) / full


def _carried_share(s: float) -> tuple[float, float]:
    """Return what the width carries up to s of it, and the slope: int 6 s (1 - s) ds."""
    s = min(max(s, 0.0), 1.0)
    return s * s * (3.0 - 2.0 * s), 6.0 * s * (1.0 - s)


def cut_lane(terrain: Lanes, frame: WheelFrame, r: float, lane: int) -> list[Facet]:
    """Return the facets of one lane; the profile is extruded sideways, so its corners are level lines.

    A straight run is one facet, however many points describe it: its parts would add up to it only where no corner's
    bisector reaches beyond the part next to it, as it does under a wheel sunk deep at a steep lip.
    """
    profile = terrain.profiles[lane].without_collinear_points()
    x, z, ground = profile.extended_points()
    across = frame.axle[1] if abs(frame.axle[1]) >= 1e-3 else math.copysign(1e-3, frame.axle[1])
    dx, dz = x - frame.centre[0], z - frame.centre[2]
    corners = np.column_stack([dx, -(frame.axle[0] * dx + frame.axle[2] * dz) / across, dz])
    points = np.column_stack([corners @ frame.forward, corners @ frame.up])
    nearby = np.flatnonzero((x[1:] > frame.centre[0] - 1.05 * r) & (x[:-1] <= frame.centre[0] + 1.05 * r))
    pieces = range(max(nearby[0] - 1, 0), min(nearby[-1] + 2, len(ground)))
    facets = []
    for k in pieces:
        length = math.hypot(x[k + 1] - x[k], z[k + 1] - z[k])
        normal = np.array([-(z[k + 1] - z[k]), 0.0, x[k + 1] - x[k]]) / length
        facets.append(Facet(points[k], points[k + 1], normal, int(ground[k])))
    if frame.forward[0] < 0.0:
        facets = [facet._replace(start=facet.end, end=facet.start) for facet in reversed(facets)]
    return facets


def cut_grid(terrain: HeightGrid, frame: WheelFrame, r: float) -> list[Facet]:
    """Return up to eight facets between points of the height grid in the wheel's plane; those of one plane are one."""
    points = []
    for s in 1.2 * r * np.linspace(-1.0, 1.0, 9):
        t = -r
        for _ in range(3):
            x, y, z = frame.centre + s * frame.forward + t * frame.up
            slope_x, slope_y = terrain.gradient(x, y)
            lean = frame.up[2] - slope_x * frame.up[0] - slope_y * frame.up[1]
            t += (terrain.height(x, y) - z) / lean
        points.append(np.array([s, t]))
    facets: list[Facet] = []
    for facet in (_grid_facet(terrain, frame, a, b) for a, b in pairwise(points)):
        if facets and _one_plane(facets[-1], facet):
            facets[-1] = facets[-1]._replace(end=facet.end)
        else:
            facets.append(facet)
    return facets


def _one_plane(a: Facet, b: Facet) -> bool:
    return a.ground == b.ground and float(np.max(np.abs(a.normal - b.normal))) <= ONE_PLANE


def _grid_facet(terrain: HeightGrid, frame: WheelFrame, start: np.ndarray, end: np.ndarray) -> Facet:
    s, t = 0.5 * (start + end)
    x, y, _ = frame.centre + s * frame.forward + t * frame.up
    slope_x, slope_y = terrain.gradient(x, y)
    ds, dt = end - start
    sideways = np.array([frame.axle[0], frame.axle[1], slope_x * frame.axle[0] + slope_y * frame.axle[1]])
    normal = np.cross(ds * frame.forward + dt * frame.up, sideways)
    return Facet(start, end, normal / np.linalg.norm(normal), int(terrain.ground_at(x, y)))


def patch_of(facets: list[Facet], k: int, r: float, exponent: float) -> Patch | None:
    """Return the patch of facet `k`, or None where the wheel does not touch it.

    With theta from the facet's in-plane normal, the rim is d = r (cos theta - cos theta_0) under the facet's line, and
    the pressure goes as d^n. `share` is int d^n cos theta dtheta within the bisectors over the same of the whole plane
    sunk by h, `turn` that without the cosine (torque), `tilt` that with a sine: radial pressure pushes the wheel back
    by it. Parts of one plane thus add up to the plane, whatever n.
    """
    facet = facets[k]
    n = facet.in_plane
    h = min(float(r + facet.start @ n), 1.999 * r)
    if h <= 0.0 or max(facet.start[0], facet.end[0]) < -r or min(facet.start[0], facet.end[0]) > r:
        return None
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
    if (low, high) == (-theta_0, theta_0):
        return Patch(sunk, r * deepest, 1.0, 0.0, 1.0, facet)
    if deepest <= 1e-12:
        return None
    full_arc = depth_integrals(0.0, math.acos(1.0 - sunk / r), exponent)
    part = depth_integrals(low, theta_0, exponent) - depth_integrals(high, theta_0, exponent)
    share, turn = 0.5 * part / full_arc
    rise = [max(math.cos(theta) - cosine, 0.0) ** (exponent + 1.0) for theta in (low, high)]
    tilt = 0.5 * (rise[0] - rise[1]) / ((exponent + 1.0) * full_arc[0])
    return Patch(sunk, r * deepest, float(share), float(tilt), float(turn), facet)


def depth_integrals(theta: float, theta_0: float, exponent: float) -> np.ndarray:
    """Return int_theta^theta_0 (cos t - cos theta_0)^n {cos t, 1} dt, nodes graded by u^2 towards the end theta_0."""
    if theta < 0.0:
        return 2.0 * depth_integrals(0.0, theta_0, exponent) - depth_integrals(-theta, theta_0, exponent)
    back = (theta_0 - theta) * NODES**2
    depth = 2.0 * np.sin(theta_0 - 0.5 * back) * np.sin(0.5 * back)
    part = WEIGHTS * 2.0 * (theta_0 - theta) * NODES * depth**exponent
    return np.array([part @ np.cos(theta_0 - back), part.sum()])


def clip_at_bisector(
    normal: np.ndarray, neighbour: np.ndarray, corner: np.ndarray, r: float, arc: tuple[float, float], side: float
) -> tuple[float, float]:
    """Return the arc cut where a + r sin(theta - delta) has the wrong sign; an empty arc has low > high.

    a is the centre's distance ahead of the bisector through `corner`, delta the angle from the own normal to it.
    """
    bisector = (normal + neighbour) / np.linalg.norm(normal + neighbour)
    ahead = np.array([bisector[1], -bisector[0]])
    a = -float(corner @ ahead)
    if side * a >= r:
        return arc
    if side * a <= -r:
        return 1.0, -1.0
    edge, turn = math.asin(-a / r), math.copysign(math.pi, side)
    delta = math.atan2(normal @ ahead, normal @ bisector)
    return max(arc[0], min(edge, turn - edge) + delta), min(arc[1], max(edge, turn - edge) + delta)
