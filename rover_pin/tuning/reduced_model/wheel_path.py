"""The path of a wheel's centre over a terrain, approximated by straight pieces between knots."""

from typing import NamedTuple

import casadi as ca
import numpy as np

from rover_pin.contact import Scalar
from rover_pin.terrain.terrain import Terrain

SPACING = 0.001
"""Distance between the points at which the path of a wheel's centre is computed [m]."""
SMOOTHING_LENGTH = 0.004
"""Standard deviation of the normal density that smooths the slope of the path [m], because soft soil rounds corners.
The value is half the sinkage of a wheel on the sand of Table 1."""
SLOPE_ERROR, HEIGHT_ERROR = 0.02, 0.001
"""Maximum deviation of the straight pieces between knots from the path, in the slope dz/dx [-] and in the height z
[m]."""


class WheelPath(NamedTuple):
    """The path of a wheel's centre over a terrain: knots of its slope dz/dx, and knots of its height z. Slope and
    height are linear in x between the knots.
    """

    slope_x: np.ndarray
    "x of the knots of the slope (knots,) [m]"
    slope: np.ndarray
    """slope dz/dx at the knots slope_x [-]"""
    height_x: np.ndarray
    "x of the knots of the height (knots,) [m]"
    height: np.ndarray
    """height z at the knots height_x [m]"""

    def slope_at(self, x: Scalar) -> Scalar:
        """Return the slope dz/dx [-] of the path at x [m]. Beyond the first and last knot, the slope is constant."""
        return piecewise(x, self.slope_x, self.slope)

    def height_at(self, x: Scalar) -> Scalar:
        """Return the height z [m] of the path at x [m]. Beyond the first and last knot, the height is constant."""
        return piecewise(x, self.height_x, self.height)


def wheel_path(terrain: Terrain, radius: float, lateral: float, low: float, high: float) -> WheelPath:
    """Return the path of the centre of a circle that rolls over the terrain, as the mean of its left and its right
    track.

    The height of the centre is z(x) = max over |d| <= radius of ground(x + d) + sqrt(radius^2 - d^2). Its slope is
    smoothed by a normal density with the standard deviation `SMOOTHING_LENGTH`.

    Parameters
    ----------
    terrain : Terrain
        The ground.
    radius : float
        Radius of the circle [m], the radius of the wheel minus its sinkage.
    lateral : float
        Distance of both tracks from the middle [m].
    low, high : float
        Range of x [m].
    """
    # At each x, the circle is lifted until it just touches the highest ground below it.
    reach = np.arange(-radius, radius + SPACING / 2, SPACING)
    arch = np.sqrt(np.maximum(radius**2 - reach**2, 0.0))
    x = np.arange(low, high, SPACING)
    tracks = [
        np.max(np.asarray(terrain.height(x[:, None] + reach, np.full((1, 1), y))) + arch, axis=1)
        for y in (lateral, -lateral)
    ]
    z = np.mean(tracks, axis=0)
    # Convolution with a normal density, cut off at 4 standard deviations; the ends are continued by their values.
    span = np.arange(-4 * SMOOTHING_LENGTH, 4 * SMOOTHING_LENGTH + SPACING / 2, SPACING)
    kernel = np.exp(-0.5 * (span / SMOOTHING_LENGTH) ** 2)
    padded = np.pad(np.gradient(z, SPACING), len(span) // 2, mode="edge")
    slope = np.convolve(padded, kernel / kernel.sum(), mode="valid")
    # Slope and height have separate knots: each is needed to its own accuracy.
    slope_knots, height_knots = knot_indices(slope, SLOPE_ERROR), knot_indices(z, HEIGHT_ERROR)
    return WheelPath(x[slope_knots], slope[slope_knots], x[height_knots], z[height_knots])


def knot_indices(values: np.ndarray, error: float) -> np.ndarray:
    """Return the indices of those values that are needed as knots, so that straight lines between the knots differ from
    no value by more than `error`.

    The values are evenly spaced. A piece is divided at its point of the largest error, until all errors are small
    enough (Ramer, Douglas and Peucker).
    """
    # The pieces that still have to be tested wait in a list; the ends of the path are always knots.
    keep, todo = {0, len(values) - 1}, [(0, len(values) - 1)]
    while todo:
        first, last = todo.pop()
        line = np.linspace(values[first], values[last], last - first + 1)
        error_at = np.abs(values[first : last + 1] - line)
        worst = int(np.argmax(error_at))
        if error_at[worst] > error:
            keep.add(first + worst)
            todo += [(first, first + worst), (first + worst, last)]
    return np.array(sorted(keep))


def piecewise(x: Scalar, knots: np.ndarray, values: np.ndarray) -> Scalar:
    """Return the value at x of a function that is linear between knots and constant beyond them, as a CasADi
    expression.

    The function is a sum of clipped ramps, one for each piece, so that its derivative is the slope of the piece.
    """
    # A piece without rise needs no term, which keeps the expression short on level ground.
    total: Scalar = float(values[0])
    for start, end, rise in zip(knots[:-1], knots[1:], np.diff(values), strict=True):
        if rise != 0.0:
            total = total + rise / (end - start) * (ca.fmin(ca.fmax(x, start), end) - start)
    return total
