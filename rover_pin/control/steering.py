"""Steered drives: every wheel square to the line to one turning centre, at the speed of its own path."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
import pinocchio as pin

from rover_pin.body.rover import Rover
from rover_pin.errors import ParameterError
from rover_pin.motion.command import Command, Reading
from rover_pin.quantity import Length

MOST_STEER = math.radians(75.0)


@dataclass(frozen=True)
class Turn:
    """Constant duties and steering angles of a turn about a point on the rover's lateral axis.

    The centre lies `radius` to the left of the base (right where negative; 0 turns on the spot), level with the mean of
    the wheels that do not steer. A wheel at (x, y) steers by atan2(x, radius - y) and runs at a duty in proportion to
    its distance from the centre (Ackermann geometry); inner wheels of a turn on the spot run backwards.
    """

    duty: tuple[float, ...]
    steer: tuple[float, ...]

    @classmethod
    def of(cls, rover: Rover, radius: Length = 1.0, delta: float = 0.55) -> Self:
        """Return the turn of this rover; `delta` is the duty of the fastest wheel.

        Raises
        ------
        ParameterError
            The rover cannot steer, or would have to steer beyond 75 deg for this radius.
        """
        steered = [wheel for wheel in rover.wheels if wheel.steer_dof is not None]
        if not steered:
            raise ParameterError(f"Rover '{rover.name}' has no steered wheel: it cannot drive a turn.")
        places = wheel_places(rover)
        fixed = [places[wheel.name][0] for wheel in rover.wheels if wheel.steer_dof is None]
        level = float(np.mean(fixed)) if fixed else float(np.mean([place[0] for place in places.values()]))
        angles, speeds = {}, []
        for wheel in rover.wheels:
            x, y = places[wheel.name][0] - level, places[wheel.name][1]
            sense = 1.0 if radius - y >= 0.0 else -1.0
            angles[wheel.name] = math.atan2(sense * x, sense * (radius - y))
            speeds.append(sense * math.hypot(x, radius - y))
        worst = max(steered, key=lambda wheel: abs(angles[wheel.name]))
        if abs(angles[worst.name]) > MOST_STEER:
            raise ParameterError(
                f"A turn of radius {radius:g} m wants wheel {worst.name} at {math.degrees(angles[worst.name]):.0f} "
                f"deg; at most {math.degrees(MOST_STEER):.0f} deg are allowed: widen the turn."
            )
        direction = 1.0 if radius >= 0.0 else -1.0
        scale = direction * delta / max(abs(speed) for speed in speeds)
        return cls(tuple(scale * speed for speed in speeds), tuple(angles[wheel.name] for wheel in steered))

    def __call__(self, reading: Reading) -> Command:
        """Return the command."""
        return Command(np.array(self.duty), np.array(self.steer))


def wheel_places(rover: Rover) -> dict[str, np.ndarray]:
    """Return the place of each wheel's centre in the base frame, all joints at zero [m]."""
    data = rover.model.createData()
    pin.forwardKinematics(rover.model, data, pin.neutral(rover.model))
    return {wheel.name: np.array(data.oMi[wheel.joint].translation) for wheel in rover.wheels}
