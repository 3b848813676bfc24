"""A rover whose mass is not where its URDF has it."""

from dataclasses import dataclass
from typing import ClassVar

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import Ballast, BodyEffect


@dataclass(frozen=True)
class PointMass(BodyEffect):
    """A mass m on the base, and the rover's centre of mass shifted by (shift_x, shift_z) in the base's axes.

    m is a point at the centre of mass, so that each parameter says one thing and the drive is smooth at none of it; a
    mass m at r alone is the shift m (r - c) / (M + m) from the centre of mass c. Negative values are an error of the
    URDF the other way. Source: rigid-body statics. Differs from the paper: nothing, its masses are only not known.
    """

    title: ClassVar[str] = "misplaced mass"
    meaning: ClassVar[str] = "the rover's mass, or its centre, is not where its description has it"
    m: Scalar = quantity(0.2, "kg", "assumed: a battery or an instrument", -2.0, 1e3, "m")
    shift_x: Scalar = quantity(0.01, "m", "assumed: a fiftieth of the wheelbase", -1.0, 1.0, "x")
    shift_z: Scalar = quantity(0.0, "m", "assumed", -1.0, 1.0, "z")
    neutral: ClassVar[dict[str, float]] = {"m": 0.0, "shift_x": 0.0, "shift_z": 0.0}

    def ballast(self) -> Ballast:
        """Return the mass and the shift."""
        return Ballast(float(self.m), float(self.shift_x), float(self.shift_z))
