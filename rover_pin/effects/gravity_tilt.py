"""A test bed that is not level, although its log assumes level ground."""

from dataclasses import dataclass
from typing import ClassVar

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import BodyEffect


@dataclass(frozen=True)
class GravityTilt(BodyEffect):
    """The ground that counts as level is tilted: it rises by the angle rise_x towards +x and by rise_y towards +y.

    In the frame of the test bed, gravity has the components -g sin rise_x and -g sin rise_y along x and y: a drive
    along +x climbs, and the drive back descends. Terrain, heights and attitudes stay in the frame of the bed.

    Source: geometry; the sizes are assumed. Differs from the paper: its bed is level.
    """

    title: ClassVar[str] = "tilted table"
    meaning: ClassVar[str] = "the table is tilted, although the log assumes that it is level"
    rise_x: Scalar = quantity(0.01, "rad", "assumed: 0.6 deg, a bed levelled by hand", -0.5, 0.5, "rise_x")
    rise_y: Scalar = quantity(0.0, "rad", "assumed", -0.5, 0.5, "rise_y")
    neutral: ClassVar[dict[str, float]] = {"rise_x": 0.0, "rise_y": 0.0}

    def rise(self) -> tuple[float, float]:
        """Return the slope [rad] of the ground that the log assumes to be level, towards +x and towards +y; a positive
        slope rises.
        """
        return float(self.rise_x), float(self.rise_y)
