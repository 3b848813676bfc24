"""A ground that is not as it was declared: it bends along x."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import BodyEffect

KNOTS = 5
"""Slopes between the ends; at both ends the ground is as declared."""
CHORDS = 8
"""Straight pieces from knot to knot: off the parabola by (change of slope) x length / 3072 at most."""
STEEP, FAR = 0.5, 1e4


@dataclass(frozen=True)
class BentGround(BodyEffect):
    """The ground stands by z(x) higher than declared: dz/dx = s(x), a band across the bed.

    s is linear from knot to knot: tan s_1 ... tan s_5 at x_from + length i / 6, i = 1 ... 5, and 0 at x_from, at
    x_from + length and outside. Positive s climbs towards +x. Before x_from z = 0, beyond the band
    z = length / 6 (tan s_1 + ... + tan s_5). What lies on the ground, its walls and soils, is lifted and not turned.
    A height grid ends where it ends: beyond its border there is nothing to bend. Source: geometry; sizes assumed.
    Differs from the paper: its bed is as it was built.
    """

    title: ClassVar[str] = "bent ground"
    meaning: ClassVar[str] = "the ground is not as declared: it bends along x"
    s_1: Scalar = quantity(0.01, "rad", "assumed: 0.6 deg up, then down", -STEEP, STEEP, "s_1")
    s_2: Scalar = quantity(0.01, "rad", "assumed", -STEEP, STEEP, "s_2")
    s_3: Scalar = quantity(0.0, "rad", "assumed", -STEEP, STEEP, "s_3")
    s_4: Scalar = quantity(-0.01, "rad", "assumed", -STEEP, STEEP, "s_4")
    s_5: Scalar = quantity(-0.01, "rad", "assumed", -STEEP, STEEP, "s_5")
    x_from: Scalar = quantity(0.0, "m", "where it begins; no default is better than another", -FAR, FAR, "x_from")
    length: Scalar = quantity(1.0, "m", "assumed: some wheelbases", 1e-3, FAR, "length")
    neutral: ClassVar[dict[str, float]] = {f"s_{at + 1}": 0.0 for at in range(KNOTS)}
    places: ClassVar[tuple[str, ...]] = ("x_from", "length")

    def bend(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return x [m] and the rise beside the declared ground there [m]."""
        values = self.values()
        slopes = np.tan([0.0, *(float(values[name]) for name in self.neutral), 0.0])
        if not slopes.any():
            return (), ()
        share = np.linspace(0.0, 1.0, (KNOTS + 1) * CHORDS + 1)
        slope = np.interp(share, np.linspace(0.0, 1.0, len(slopes)), slopes)
        step = float(values["length"]) / (len(share) - 1)
        rise = np.concatenate([[0.0], np.cumsum((slope[1:] + slope[:-1]) / 2.0 * step)])
        return tuple((float(values["x_from"]) + float(values["length"]) * share).tolist()), tuple(rise.tolist())
