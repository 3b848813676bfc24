"""A table that is not level."""

from dataclasses import dataclass
from typing import ClassVar

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import BodyEffect


@dataclass(frozen=True)
class GravityTilt(BodyEffect):
    """What the log calls level rises by rise_x towards +x, by rise_y towards +y: g -> -g (sin rise_x, sin rise_y, ..).

    In the table's frame gravity leans the other way: a drive along +x climbs, the same back descends. Terrain, heights
    and attitudes stay in the table's frame. Source: geometry; sizes assumed. Differs from the paper: its bed is level.
    """

    title: ClassVar[str] = "tilted table"
    meaning: ClassVar[str] = "the table that counts as level is not"
    rise_x: Scalar = quantity(0.01, "rad", "assumed: 0.6 deg, a bed levelled by hand", -0.5, 0.5, "rise_x")
    rise_y: Scalar = quantity(0.0, "rad", "assumed", -0.5, 0.5, "rise_y")
    neutral: ClassVar[dict[str, float]] = {"rise_x": 0.0, "rise_y": 0.0}

    def rise(self) -> tuple[float, float]:
        """Return the two angles."""
        return float(self.rise_x), float(self.rise_y)
