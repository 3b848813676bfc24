"""The path of a wheel's centre over a terrain, as a few straight pieces."""

from typing import NamedTuple

import casadi as ca
import numpy as np

from rover_pin.contact import Scalar
from rover_pin.terrain.terrain import Terrain

STEP = 0.001
"""Spacing [m] at which the path is found."""
SOFTNESS = 0.004
"""Standard deviation [m] over which corners are rounded: half the sinkage of a wheel on Table 1's sand."""
SLOPE_ERROR, HEIGHT_ERROR = 0.02, 0.001
"""Largest error of the pieces: in dz/dx [-], in z [m]."""


class WheelPath(NamedTuple):
    """Knots of the slope dz/dx and of the height z [m] of the centre over x [m]; straight in between."""

    slope_x: np.ndarray
    slope: np.ndarray
    height_x: np.ndarray
    height: np.ndarray

    def slope_at(self, x: Scalar) -> Scalar:
        """Return dz/dx at x [m]; the end values go on without end."""
        return piecewise(x, self.slope_x, self.slope)

    def height_at(self, x: Scalar) -> Scalar:
        """Return z at x [m]."""
        return piecewise(x, self.height_x, self.height)


def wheel_path(terrain: Terrain, radius: float, lateral: float, low: float, high: float) -> WheelPath:
    """Return the path of the centre of a circle that rolls over the ground, the mean of the left and the right track.

    z(x) = max over |d| <= radius of ground(x + d) + sqrt(radius^2 - d^2); its slope is then smoothed over `SOFTNESS`.

    Parameters
    ----------
    radius : float
        Rolling radius [m]: the wheel's less its sinkage.
    lateral : float
        Distance of the tracks from the middle [m].
    low, high : float
        Range of x [m].
    """
    reach = np.arange(-radius, radius + STEP / 2, STEP)
    arch = np.sqrt(np.maximum(radius**2 - reach**2, 0.0))
    x = np.arange(low, high, STEP)
    tracks = [
        np.max(np.asarray(terrain.height(x[:, None] + reach, np.full((1, 1), y))) + arch, axis=1)
        for y in (lateral, -lateral)
    ]
    z = np.mean(tracks, axis=0)
    slope = _smooth_values(np.gradient(z, STEP))
    slope_knots, height_knots = knot_indices(slope, SLOPE_ERROR), knot_indices(z, HEIGHT_ERROR)
    return WheelPath(x[slope_knots], slope[slope_knots], x[height_knots], z[height_knots])


def _smooth_values(values: np.ndarray) -> np.ndarray:
    span = np.arange(-4 * SOFTNESS, 4 * SOFTNESS + STEP / 2, STEP)
    kernel = np.exp(-0.5 * (span / SOFTNESS) ** 2)
    padded = np.pad(values, len(span) // 2, mode="edge")
    return np.convolve(padded, kernel / kernel.sum(), mode="valid")


def knot_indices(values: np.ndarray, error: float) -> np.ndarray:
    """Return the indices of the knots that keep straight pieces within `error` of evenly spaced values."""
    keep, todo = {0, len(values) - 1}, [(0, len(values) - 1)]
    while todo:
        first, last = todo.pop()
        line = np.linspace(values[first], values[last], last - first + 1)
        off = np.abs(values[first : last + 1] - line)
        worst = int(np.argmax(off))
        if off[worst] > error:
            keep.add(first + worst)
            todo += [(first, first + worst), (first + worst, last)]
    return np.array(sorted(keep))


def piecewise(x: Scalar, knots: np.ndarray, values: np.ndarray) -> Scalar:
    """Return the piecewise straight line through the knots at x, the end values beyond them.

    As a sum of clipped ramps: every piece is there once, and the derivative is the slope of the piece.
    """
    total: Scalar = float(values[0])
    for start, end, rise in zip(knots[:-1], knots[1:], np.diff(values), strict=True):
        if rise != 0.0:
            total = total + rise / (end - start) * (ca.fmin(ca.fmax(x, start), end) - start)
    return total
