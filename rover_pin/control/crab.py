"""Crabbing: every wheel that steers at one angle, every wheel at one duty."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Self

from rover_pin.base.arguments import checked, spec
from rover_pin.base.errors import ParameterError
from rover_pin.control.steering import MOST_STEER, Steady
from rover_pin.rover.rover import Rover


@dataclass(frozen=True)
class Crab(Steady):
    """Constant duties and one steering angle, so that the rover goes sideways without turning.

    Wheels that do not steer are dragged along, and take of the angle: Nexus 6, whose middle wheels do not, goes at 17
    deg where 20 are asked.
    """

    @classmethod
    @checked("control")
    def of(
        cls,
        rover: Rover,
        angle: Annotated[float, spec("rad", "assumed; to the left", -MOST_STEER, MOST_STEER)] = math.radians(20.0),
        delta: Annotated[float, spec("", "paper, section 5", -1.0, 1.0)] = 0.55,
    ) -> Self:
        """Return the crab of this rover.

        Raises
        ------
        ParameterError
            No wheel of the rover steers.
        """
        steered = [wheel for wheel in rover.wheels if wheel.steer_dof is not None]
        if not steered:
            raise ParameterError(
                f"{rover.name} cannot crab: none of its wheels steers; take control = turn, or a rover that steers."
            )
        return cls((delta,) * len(rover.wheels), (angle,) * len(steered))
