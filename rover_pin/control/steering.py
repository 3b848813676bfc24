"""Turns, every wheel square to the line to one turning centre at its path's speed, and crabbing, all at one angle."""

import math
from dataclasses import dataclass
from typing import Annotated, Self

import numpy as np

from rover_pin.base.arguments import check_arguments, spec
from rover_pin.base.errors import ParameterError
from rover_pin.control.motion.kinematics import BodyMotion, rolling, steers, turning_places
from rover_pin.rover.rover import Rover
from rover_pin.simulation.command import Command, Reading
from rover_pin.simulation.native.control import Commands

MOST_STEER = math.radians(75.0)


@dataclass(frozen=True)
class Steady:
    """Duties of all wheels and angles of those that steer, held for the whole drive."""

    duty: tuple[float, ...]
    steer: tuple[float, ...]

    def __call__(self, reading: Reading) -> Command:
        """Return the command."""
        return Command(np.array(self.duty), np.array(self.steer))

    def native(self, wheels: int) -> Commands:
        """Return the same for the compiled loop."""
        return Commands(self.duty, self.steer)


@dataclass(frozen=True)
class Turn(Steady):
    """Constant duties and steering angles of a turn about a point on the rover's lateral axis.

    The centre lies `radius` to the left of the base (right where negative; 0 turns on the spot), level with the mean of
    the wheels that do not steer. A wheel at (x, y) steers by atan2(x, radius - y) and runs at a duty in proportion to
    its distance from the centre (Ackermann geometry); inner wheels of a turn on the spot run backwards.
    Where none steers, all wheels of a side have a duty in proportion to radius - y, y the side's mean: they scrub, and
    the difference of duties goes into what they lose by that. `HeldSpeeds.turning` holds their speeds instead.
    """

    @classmethod
    @check_arguments("control")
    def of(
        cls,
        rover: Rover,
        radius: Annotated[float, spec("m", "assumed: 0 turns on the spot, below 0 to the right", -1e6, 1e6)] = 1.0,
        delta: Annotated[float, spec("", "paper, section 5", -1.0, 1.0)] = 0.55,
    ) -> Self:
        """Return the turn of this rover; `delta` is the duty of the fastest wheel.

        Raises ParameterError: the rover would have to steer beyond 75 deg for this radius.
        """
        speeds, rolled = rolling(turning_places(rover).tolist(), steers(rover), BodyMotion(radius, 1.0))
        names = [wheel.name for wheel in rover.wheels if wheel.steer_dof is not None]
        angles = dict(zip(names, rolled, strict=True))
        worst = max(angles, key=lambda name: abs(angles[name]), default="")
        if worst and abs(angles[worst]) > MOST_STEER:
            raise ParameterError(
                f"A turn of radius {radius:g} m wants wheel {worst} at {math.degrees(angles[worst]):.0f} "
                f"deg; at most {math.degrees(MOST_STEER):.0f} deg are allowed: widen the turn."
            )
        return cls(_duties(speeds, radius, delta), tuple(angles.values()))


def _duties(speeds: list[float], radius: float, delta: float) -> tuple[float, ...]:
    """Return duties in proportion to speeds, that of the fastest wheel `delta`; left of the centre all reversed."""
    scale = math.copysign(1.0, radius) * delta / max(abs(speed) for speed in speeds)
    return tuple(scale * speed for speed in speeds)


@dataclass(frozen=True)
class Crab(Steady):
    """Constant duties and one steering angle, so that the rover goes sideways without turning.

    Wheels that do not steer are dragged along, and take of the angle: Nexus 6, whose middle wheels do not, goes at 17
    deg where 20 are asked.
    """

    @classmethod
    @check_arguments("control")
    def of(
        cls,
        rover: Rover,
        angle: Annotated[float, spec("rad", "assumed; to the left", -MOST_STEER, MOST_STEER)] = math.radians(20.0),
        delta: Annotated[float, spec("", "paper, section 5", -1.0, 1.0)] = 0.55,
    ) -> Self:
        """Return the crab of this rover.

        Raises ParameterError: no wheel of the rover steers.
        """
        steering = steers(rover)
        if not any(steering):
            raise ParameterError(
                f"{rover.name} cannot crab: none of its wheels steers; take control = turn, or a rover that steers."
            )
        return cls((delta,) * len(steering), (angle,) * sum(steering))
