"""A rover whose mass or centre of mass differs from its URDF."""

from dataclasses import dataclass
from typing import ClassVar

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import Ballast, BodyEffect


@dataclass(frozen=True)
class PointMass(BodyEffect):
    """The base carries a mass m that the URDF does not state, and the rover's centre of mass is shifted by (shift_x,
    shift_z).

    The shift is in the axes of the base. m is a point at the centre of mass, so that each parameter has one meaning and
    the drive is smooth in all of them. A single mass m at the position r is the shift m (r - c) / (M + m) from the
    centre of mass c of a rover of mass M. Negative values correct a URDF with too much mass or with a shift in the
    other direction.

    Source: rigid-body statics. Differs from the paper: the paper does not state its masses, so there is nothing to
    differ from.
    """

    title: ClassVar[str] = "misplaced mass"
    meaning: ClassVar[str] = "the rover's mass, or its centre of mass, differs from its URDF"
    m: Scalar = quantity(0.2, "kg", "assumed: a battery or an instrument", -2.0, 1e3, "m")
    shift_x: Scalar = quantity(0.01, "m", "assumed: a fiftieth of the wheelbase", -1.0, 1.0, "x")
    shift_z: Scalar = quantity(0.0, "m", "assumed", -1.0, 1.0, "z")
    neutral: ClassVar[dict[str, float]] = {"m": 0.0, "shift_x": 0.0, "shift_z": 0.0}

    def ballast(self) -> Ballast:
        """Return the mass [kg] that the base carries in addition to the URDF, and the displacement [m] of the rover's
        centre of mass.
        """
        return Ballast(float(self.m), float(self.shift_x), float(self.shift_z))
