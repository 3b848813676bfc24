"""The contact of wheels with polylines of ground, in closed form for n = 1.

A point of the rim belongs to the piece of ground between whose corner bisectors the point lies. A piece pushes like a
whole wheel that has sunk into the piece's plane, times the share of depth x cosine over its part of the rim. The sum of
depth x sine tilts the force, and the sum of the depth turns the wheel. With the depth r (cos t - cos theta), all three
sums have antiderivatives.
"""

from typing import NamedTuple

import numpy as np

from .bodies import cross, dot

BESIDE = 2
"""Pieces looked at on either side of the one under the axle: enough for 20 mm pieces and 15 mm of Nexus 6's sinkage."""
DEEPEST = 0.98
FAR = 1000.0


class Ground:
    """Polylines x, z [lanes, points, runs] from right to left, between borders [lanes - 1, runs] in y."""

    def __init__(self, runs, beside=BESIDE):
        """Every run is (lanes as (x, z), borders)."""
        self.beside = beside
        lanes = max(len(run[0]) for run in runs)
        points = max(len(x) for run in runs for x, _ in run[0]) + 2 * beside + 2
        self.x = np.empty((lanes, points, len(runs)))
        self.z = np.empty_like(self.x)
        self.borders = np.full((lanes - 1, len(runs)), np.inf)
        for b, (profiles, borders) in enumerate(runs):
            self.borders[: len(borders), b] = borders
            for i in range(lanes):
                self.x[i, :, b], self.z[i, :, b] = padded(*profiles[min(i, len(profiles) - 1)], points)
        self.run = np.arange(len(runs))

    def around(self, x, y):
        """Return the corners X, Z [pieces + 1, wheels, runs] near wheels at x, y."""
        lane = (y[None] > self.borders[:, None]).sum(axis=0)
        if len(self.x) == 1:
            index = (self.x[0][:, None] <= x).sum(axis=0) - 1
        else:
            index = np.zeros(x.shape, dtype=int)
            for i in range(len(self.x)):
                inside = lane == i
                index += np.where(inside, (self.x[i][:, None] <= x).sum(axis=0) - 1, 0)
        first = np.clip(index - self.beside, 0, self.x.shape[1] - 2 * self.beside - 2)
        at = first + np.arange(2 * self.beside + 2)[:, None, None]
        return self.x[lane, at, self.run], self.z[lane, at, self.run]

    def height(self, x, y):
        X, Z = self.around(x, y)
        k = np.clip((x >= X).sum(axis=0) - 1, 0, len(X) - 2)[None]
        x0, x1, z0, z1 = (np.take_along_axis(a, k + i, 0)[0] for a in (X, Z) for i in (0, 1))
        return z0 + (x - x0) * (z1 - z0) / (x1 - x0)


def padded(x, z, points):
    """Return a polyline with `points` points, whose end pieces are continued in equal steps."""
    x, z = np.asarray(x, dtype=float), np.asarray(z, dtype=float)
    missing = points - len(x)
    left, right = missing // 2, missing - missing // 2
    first, last = (z[1] - z[0]) / (x[1] - x[0]), (z[-1] - z[-2]) / (x[-1] - x[-2])
    low = x[0] - FAR * np.arange(left, 0, -1)
    high = x[-1] + FAR * np.arange(1, right + 1)
    heights = (z[0] + first * (low - x[0]), z, z[-1] + last * (high - x[-1]))
    return np.concatenate((low, x, high)), np.concatenate(heights)


class Pieces(NamedTuple):
    """The pieces that press on wheels, one entry for each piece. `wheel` is wheel x runs + run."""

    wheel: np.ndarray
    h: np.ndarray
    share: np.ndarray
    lean: np.ndarray
    turn: np.ndarray
    normal: np.ndarray
    inward: np.ndarray
    "unit normal of the piece within the wheel's plane [3, pieces]"
    deepest: np.ndarray


def touch(ground, centre, axle, r):
    """Return the pieces under wheels with centres and axles [3, wheels, runs]. A wheel without contact gets a piece
    without load.
    """
    up = -axle[2] * axle
    up[2] += 1.0
    up /= np.sqrt(dot(up, up))
    forward = cross(axle, up)
    X, Z = ground.around(centre[0], centre[1])
    back = forward[0] < 0.0
    if back.any():
        X, Z = np.where(back, X[::-1], X), np.where(back, Z[::-1], Z)
    dx, dz = X - centre[0], Z - centre[2]
    across = np.where(np.abs(axle[1]) < 1e-3, np.copysign(1e-3, axle[1]), axle[1])
    dy = -(axle[0] * dx + axle[2] * dz) / across
    s = forward[0] * dx + forward[1] * dy + forward[2] * dz
    t = up[0] * dx + up[1] * dy + up[2] * dz
    ds, dt = s[1:] - s[:-1], t[1:] - t[:-1]
    slope = np.arctan2(dt, ds)
    n_s, n_t = -np.sin(slope), np.cos(slope)
    h = r + s[:-1] * n_s + t[:-1] * n_t
    theta = np.arccos(1.0 - np.clip(h / r, 0.0, 1.999))
    middle = 0.5 * (slope[1:] + slope[:-1])
    edge = np.arcsin(np.clip((s[1:-1] * np.cos(middle) + t[1:-1] * np.sin(middle)) / r, -1.0, 1.0)) + middle
    low, high = -theta, theta.copy()
    low[1:] = np.maximum(low[1:], edge - slope[1:])
    high[:-1] = np.minimum(high[:-1], edge - slope[:-1])
    cosine = np.cos(theta)
    deepest = np.cos(np.clip(0.0, low, np.maximum(high, low))) - cosine
    close = (np.maximum(s[1:], s[:-1]) >= -r) & (np.minimum(s[1:], s[:-1]) <= r)
    touching = (h > 1e-7 * r) & (low < high) & (deepest > 1e-12) & close
    _, wheel, run = np.nonzero(touching)
    theta, low, high, cosine = theta[touching], low[touching], high[touching], cosine[touching]
    bounded_depth = np.minimum(h[touching], DEEPEST * r)
    whole_angle = np.arccos(1.0 - bounded_depth / r)
    sine_whole, cosine_whole = np.sin(whole_angle), 1.0 - bounded_depth / r
    full_arc = whole_angle - sine_whole * cosine_whole
    whole_turn = 2.0 * (sine_whole - whole_angle * cosine_whole)
    sin_low, sin_high, cos_low, cos_high = np.sin(low), np.sin(high), np.cos(low), np.cos(high)
    pressed = 0.5 * (high - low + sin_high * cos_high - sin_low * cos_low) - cosine * (sin_high - sin_low)
    turned = sin_high - sin_low - cosine * (high - low)
    leaned = 0.5 * (np.maximum(cos_low - cosine, 0.0) ** 2 - np.maximum(cos_high - cosine, 0.0) ** 2)
    dX, dZ = (X[1:] - X[:-1])[touching], (Z[1:] - Z[:-1])[touching]
    flip = np.sign(dX) / np.hypot(dX, dZ)
    normal = np.stack((-dZ * flip, np.zeros_like(flip), dX * flip))
    inward = n_s[touching] * forward[:, wheel, run] + n_t[touching] * up[:, wheel, run]
    runs = centre.shape[2]
    pieces = Pieces(
        wheel * runs + run, bounded_depth, pressed / full_arc, leaned / full_arc, turned / whole_turn, normal, inward,
        r * deepest[touching],
    )  # fmt: skip
    free = ~touching.any(axis=0)
    return with_free(pieces, free, up) if free.any() else pieces


def with_free(pieces, free, up):
    none = np.flatnonzero(free)
    above = up.reshape(3, -1)[:, none]
    zero = np.zeros(len(none))
    added = Pieces(none, zero + 1e-9, zero, zero, zero, above, above, zero)
    return Pieces(*(np.concatenate(both, axis=-1) for both in zip(pieces, added, strict=True)))
