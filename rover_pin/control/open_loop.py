"""Controllers without feedback: a constant duty, a turn about a centre, and crabbing (driving at an angle to the
heading).
"""

import math
from dataclasses import dataclass
from typing import Annotated, Self

import numpy as np

from rover_pin.base.arguments import check_arguments, spec
from rover_pin.base.errors import ParameterError
from rover_pin.base.quantity import Record, quantity
from rover_pin.contact import Scalar
from rover_pin.control.motion.kinematics import BodyMotion, rolling, steers, turning_places
from rover_pin.rover.rover import Rover
from rover_pin.simulation.command import Command, Reading
from rover_pin.simulation.native.control import CompiledController

MAX_STEER = math.radians(75.0)
"""Maximum steering angle of a wheel [rad] (assumed). A motion that needs a larger angle is refused, because most
steering mechanisms reach no larger angle."""


@dataclass(frozen=True)
class ConstantDuty(Record):
    """A controller without feedback: all wheels have one constant duty delta and are steered straight ahead.

    Source: section 5 of the paper, delta = 0.55.

    Examples
    --------
    >>> ConstantDuty(0.3).delta
    0.3
    """

    delta: Scalar = quantity(0.55, "", "paper, section 5", -1.0, 1.0, "delta")

    def __call__(self, reading: Reading) -> Command:
        """Return the command with the constant duty, whatever the reading of the sensors is."""
        return Command(self.delta)

    def native(self, wheels: int) -> CompiledController:
        """Return the controller in the form for the compiled simulation loop, which does not call Python."""
        return CompiledController(float(self.delta))


@dataclass(frozen=True)
class ConstantCommand:
    """A controller without feedback: a constant duty for each wheel, and a constant angle for each wheel that
    steers.
    """

    duty: tuple[float, ...]
    "duties (wheels,) [-]"
    steer: tuple[float, ...]
    "steering angles (wheels that steer,) [rad]"

    def __call__(self, reading: Reading) -> Command:
        """Return the command with the constant duties and angles, whatever the reading of the sensors is."""
        return Command(np.array(self.duty), np.array(self.steer))

    def native(self, wheels: int) -> CompiledController:
        """Return the controller in the form for the compiled simulation loop, which does not call Python."""
        return CompiledController(self.duty, self.steer)


@dataclass(frozen=True)
class Turn(ConstantCommand):
    """Constant duties and steering angles that turn all wheels about one centre on the rover's lateral axis.

    The centre lies at the distance `radius` to the left of the base. A negative radius turns to the right, and 0 turns
    on the spot. Along the rover, the centre lies at the mean x of the wheels that do not steer. A wheel at (x, y)
    steers by atan2(x, radius - y), and its duty is proportional to its distance from the centre (Ackermann geometry).
    In a turn on the spot, the inner wheels run backwards.

    If no wheel steers, the duty of all wheels of a side is proportional to radius - y, where y is the mean y of the
    side. The wheels are then dragged sideways, and this scrubbing uses most of the difference in duty, so that the
    rover turns less than commanded. `HeldSpeeds.turning` controls the speeds of the wheels instead of their duties.
    """

    @classmethod
    @check_arguments("control")
    def of(
        cls,
        rover: Rover,
        radius: Annotated[float, spec("m", "assumed: 0 turns on the spot, below 0 to the right", -1e6, 1e6)] = 1.0,
        delta: Annotated[float, spec("", "paper, section 5", -1.0, 1.0)] = 0.55,
    ) -> Self:
        """Return the controller for a turn of a rover with this radius [m]. The fastest wheel has the duty `delta` [-].

        Raises ParameterError: a wheel would have to steer by more than 75 deg.
        """
        # At unit yaw rate, the body's speed is the radius, so the wheel speeds are proportional to the duties.
        speeds, rolled = rolling(turning_places(rover).tolist(), steers(rover), BodyMotion(radius, 1.0))
        # The message names the wheel that would have to steer most.
        names = [wheel.name for wheel in rover.wheels if wheel.steer_dof is not None]
        angles = dict(zip(names, rolled, strict=True))
        worst = max(angles, key=lambda name: abs(angles[name]), default="")
        if worst and abs(angles[worst]) > MAX_STEER:
            raise ParameterError(
                f"In a turn of radius {radius:g} m, wheel {worst} would have to steer by "
                f"{math.degrees(angles[worst]):.0f} deg, but the largest steering angle is "
                f"{math.degrees(MAX_STEER):.0f} deg: choose a larger radius."
            )
        # For a centre on the right (radius < 0), a positive yaw rate means driving backwards, so the sign is changed.
        scale = math.copysign(1.0, radius) * delta / max(abs(speed) for speed in speeds)
        return cls(tuple(scale * speed for speed in speeds), tuple(angles.values()))


@dataclass(frozen=True)
class Crab(ConstantCommand):
    """A constant duty and one steering angle for all wheels. The rover drives at this angle to its heading without
    turning.

    Wheels that cannot steer are dragged along, and reduce the angle between the direction of travel and the heading.
    """

    @classmethod
    @check_arguments("control")
    def of(
        cls,
        rover: Rover,
        angle: Annotated[float, spec("rad", "assumed; to the left", -MAX_STEER, MAX_STEER)] = math.radians(20.0),
        delta: Annotated[float, spec("", "paper, section 5", -1.0, 1.0)] = 0.55,
    ) -> Self:
        """Return the controller that makes a rover crab: all wheels steer by `angle` [rad], positive to the left, and
        have the duty `delta`.

        Raises ParameterError: no wheel of the rover steers.
        """
        steering = steers(rover)
        if not any(steering):
            raise ParameterError(
                f"{rover.name} cannot crab (drive at an angle to its heading), because none of its wheels steers: take "
                "control = turn, or a rover that steers."
            )
        return cls((delta,) * len(steering), (angle,) * sum(steering))
