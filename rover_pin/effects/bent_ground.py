"""A ground that is higher or lower than declared, because it bends along x."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import BodyEffect

KNOTS = 5
"""Number of points in the band at which the slope is a free parameter. The slope is 0 at both ends of the band, so that
it changes without a jump."""
CHORDS = 8
"""Number of straight pieces that approximate the height between two such points. A piece deviates from the exact
parabola by at most (change of slope) x length / 3072."""
MAX_SLOPE, MAX_POSITION = 0.5, 1e4
"""Bounds of the slopes (MAX_SLOPE) [rad], and of the position and length of the band (MAX_POSITION) [m]. A fit stays
within them."""


@dataclass(frozen=True)
class BentGround(BodyEffect):
    """The ground bends along x: in a band across the test bed it is higher than declared by z(x), with the slope dz/dx
    = tan s(x).

    The band begins at `x_from` and has the length `length`. tan s is linear between seven knots: 0 at x_from, tan s_i
    at x_from + i length / 6 for i = 1 to 5, and 0 at x_from + length. A positive slope climbs towards +x. In front of
    the band z = 0; behind it z keeps its last value, length / 6 (tan s_1 + ... + tan s_5). Walls and soils on the
    ground are lifted with it and are not turned. A height grid has no ground beyond its border, and nothing is added
    there.

    Source: geometry; the sizes are assumed. Differs from the paper: its test bed is not bent.
    """

    title: ClassVar[str] = "bent ground"
    meaning: ClassVar[str] = "the ground bends along x, which its declaration leaves out"
    s_1: Scalar = quantity(0.01, "rad", "assumed: 0.6 deg up, then down", -MAX_SLOPE, MAX_SLOPE, "s_1")
    s_2: Scalar = quantity(0.01, "rad", "assumed", -MAX_SLOPE, MAX_SLOPE, "s_2")
    s_3: Scalar = quantity(0.0, "rad", "assumed", -MAX_SLOPE, MAX_SLOPE, "s_3")
    s_4: Scalar = quantity(-0.01, "rad", "assumed", -MAX_SLOPE, MAX_SLOPE, "s_4")
    s_5: Scalar = quantity(-0.01, "rad", "assumed", -MAX_SLOPE, MAX_SLOPE, "s_5")
    x_from: Scalar = quantity(
        0.0, "m", "beginning of the band; the default is arbitrary", -MAX_POSITION, MAX_POSITION, "x_from"
    )
    length: Scalar = quantity(1.0, "m", "assumed: some wheelbases", 1e-3, MAX_POSITION, "length")
    neutral: ClassVar[dict[str, float]] = {f"s_{at + 1}": 0.0 for at in range(KNOTS)}
    places: ClassVar[tuple[str, ...]] = ("x_from", "length")

    def bend(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return positions x [m] in increasing order, and the height of the true ground above the declared ground at
        each of them [m].

        Both tuples are empty if all slopes are 0.
        """
        # The slope is 0 at both ends of the band.
        values = self.values()
        slopes = np.tan([0.0, *(float(values[name]) for name in self.neutral), 0.0])
        if not slopes.any():
            return (), ()
        # The height is the integral of the slope over x. The trapezoidal rule gives it exactly at the ends of each
        # piece, because the slope is linear between the knots.
        fraction = np.linspace(0.0, 1.0, (KNOTS + 1) * CHORDS + 1)
        slope = np.interp(fraction, np.linspace(0.0, 1.0, len(slopes)), slopes)
        step = float(values["length"]) / (len(fraction) - 1)
        rise = np.concatenate([[0.0], np.cumsum((slope[1:] + slope[:-1]) / 2.0 * step)])
        return tuple((float(values["x_from"]) + float(values["length"]) * fraction).tolist()), tuple(rise.tolist())
