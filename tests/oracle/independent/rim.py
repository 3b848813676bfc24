"""The contact of wheels with polylines of ground, by sums over many points of each rim.

Every point of the rim belongs to the straight piece of ground between whose corner bisectors it lies; its depth is its
distance below the line of this piece. A piece presses on the wheel like a whole wheel that has sunk into the piece's
plane, times the ratio of its sum of depth x cosine to that of the whole wheel. The sum of depth x sine tilts the force,
and the sum of the depth turns the wheel.
"""

from typing import NamedTuple

import numpy as np

from .bodies import cross

FAR = 1000.0
REACH = np.radians(115.0)
"""Rim points lie this far to either side of the lowest."""


class Ground:
    """Polylines z(x), one for each lane from right to left, between borders in y. The end pieces continue without
    limit.
    """

    def __init__(self, lanes, borders=()):
        self.borders = np.array(borders, dtype=float)
        self.lanes = [extended(np.array(x, dtype=float), np.array(z, dtype=float)) for x, z in lanes]
        longest = max(len(x) for x, _ in self.lanes)
        self.x, self.z = (
            np.array([np.pad(lane[i], (0, longest - len(lane[i])), mode="linear_ramp", end_values=end(lane, i, 10.0))
                      for lane in self.lanes]) for i in (0, 1)
        )  # fmt: skip

    def height(self, x, y):
        return float(np.interp(x, *self.lanes[int(np.searchsorted(self.borders, y))]))

    def near(self, centre, reach):
        """Return the corners (x, z) of the pieces within reach of every wheel, and one more on each side."""
        lane = np.searchsorted(self.borders, centre[:, 1])
        low = np.array([np.searchsorted(self.x[k], x - reach) - 2 for k, x in zip(lane, centre[:, 0], strict=True)])
        high = np.array([np.searchsorted(self.x[k], x + reach) + 2 for k, x in zip(lane, centre[:, 0], strict=True)])
        count = min(int((high - low).max()), self.x.shape[1])
        first = np.clip(low, 0, self.x.shape[1] - count)
        index = first[:, None] + np.arange(count)
        return self.x[lane[:, None], index], self.z[lane[:, None], index]


def extended(x, z):
    ends = np.array([x[0] - FAR, x[-1] + FAR])
    slopes = np.array([(z[1] - z[0]) / (x[1] - x[0]), (z[-1] - z[-2]) / (x[-1] - x[-2])])
    heights = np.array([z[0], z[-1]]) + slopes * [-FAR, FAR]
    return np.concatenate([ends[:1], x, ends[1:]]), np.concatenate([heights[:1], z, heights[1:]])


def end(lane, axis, more):
    """Return the point that the last piece reaches if it is continued."""
    along = lane[axis][-1] - lane[axis][-2]
    return lane[axis][-1] + more * along


class Pieces(NamedTuple):
    """The pieces that press on the wheels, one row for each."""

    wheel: np.ndarray
    h: np.ndarray
    deepest: np.ndarray
    share: np.ndarray
    lean: np.ndarray
    turn: np.ndarray
    normal: np.ndarray
    inward: np.ndarray
    "unit normal of the cut within the wheel's plane, in the world"


class Rim:
    def __init__(self, r, points=721):
        self.r = r
        self.phi = np.linspace(-REACH, REACH, points)
        self.gap = self.phi[1] - self.phi[0]
        self.point = r * np.stack([np.sin(self.phi), -np.cos(self.phi)])
        self.floor = self.wholes(np.linspace(0.0, 1.0, 401) ** 2 * np.pi / 2)

    def wholes(self, theta):
        """Return a table of h and of the sum of depth x cosine over a whole wheel that has sunk by h."""
        fine = np.linspace(-1.0, 1.0, 2001)
        angle = theta[:, None] * fine
        depth = np.cos(angle) - np.cos(theta)[:, None]
        return theta, np.trapezoid(depth * np.cos(angle), angle, axis=1)

    def whole(self, h):
        """Return the sum of a whole wheel by interpolation in theta cubed, in which the table is nearly straight."""
        theta, total = self.floor
        at = np.arccos(1.0 - np.minimum(h / self.r, 1.0))
        ratio = np.interp(at, theta[1:], total[1:] / theta[1:] ** 3)
        return ratio * at**3

    def contact(self, ground, centre, axle):
        """Return the pieces under wheels with these centres and axles [wheels, 3]."""
        up = np.array([0.0, 0.0, 1.0]) - axle[:, 2:] * axle
        up /= np.sqrt(np.sum(up**2, axis=1))[:, None]
        forward = cross(axle, up)
        heading = np.sign(forward[:, 0])[:, None]
        x, z = ground.near(centre, 1.05 * self.r)
        dx, dz = x - centre[:, :1], z - centre[:, 2:]
        dy = -(axle[:, :1] * dx + axle[:, 2:] * dz) / axle[:, 1:2]
        s = forward[:, :1] * dx + forward[:, 1:2] * dy + forward[:, 2:] * dz
        t = up[:, :1] * dx + up[:, 1:2] * dy + up[:, 2:] * dz
        run, rise = heading * (s[:, 1:] - s[:, :-1]), heading * (t[:, 1:] - t[:, :-1])
        length = np.hypot(run, rise)
        across = np.stack([-rise / length, run / length])
        deepest, total, leaning, turning = self._sums(s, t, across, heading)
        h = s[:, :-1] * across[0] + t[:, :-1] * across[1] + self.r
        reached = (np.maximum(s[:, 1:], s[:, :-1]) >= -self.r) & (np.minimum(s[:, 1:], s[:, :-1]) <= self.r)
        keep = reached & (deepest > 1e-12 * self.r)
        wheel, piece = np.nonzero(keep)
        h = np.minimum(h[keep], 0.98 * self.r)
        full, at = self.whole(h), np.arccos(1.0 - h / self.r)
        turn = turning[keep] / (2.0 * (np.sin(at) - at * np.cos(at)))
        dx, dz = x[wheel, piece + 1] - x[wheel, piece], z[wheel, piece + 1] - z[wheel, piece]
        normal = np.stack([-dz, np.zeros(len(wheel)), dx], axis=1) / np.hypot(dx, dz)[:, None]
        inward = across[0][keep][:, None] * forward[wheel] + across[1][keep][:, None] * up[wheel]
        return Pieces(wheel, h, deepest[keep], total[keep] / full, leaning[keep] / full, turn, normal, inward)

    def _sums(self, s, t, across, heading):
        """Return the deepest point and the sums of depth x cosine, depth x sine and depth of each piece [wheels,
        pieces].
        """
        n_s, n_t = across[0][:, :, None], across[1][:, :, None]
        toward = n_s * self.point[0] + n_t * self.point[1]
        depth = (s[:, :-1] * across[0] + t[:, :-1] * across[1])[:, :, None] - toward
        weight = (depth > 0.0).astype(float)
        if s.shape[1] > 2:
            half = across[:, :, 1:] + across[:, :, :-1]
            half = (half / np.hypot(half[0], half[1]))[:, :, :, None]
            ahead = half[1] * (self.point[0] - s[:, 1:-1, None]) - half[0] * (self.point[1] - t[:, 1:-1, None])
            over = np.clip(0.5 + heading[:, :, None] * ahead / (self.r * self.gap), 0.0, 1.0)
            weight[:, 1:] *= over
            weight[:, :-1] *= 1.0 - over
        inside = np.where(weight > 0.0, depth, 0.0)
        pressed = weight * inside * (self.gap / self.r**2)
        sine = n_t * self.point[0] - n_s * self.point[1]
        sums = (-np.sum(pressed * toward, axis=2), np.sum(pressed * sine, axis=2), self.r * np.sum(pressed, axis=2))
        return inside.max(axis=2), *sums
