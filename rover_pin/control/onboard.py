"""Beyond the paper: take obstacles at an angle, one wheel after another, by what the rover feels on board.

Where all soil laws of the package let thrust only grow or fall with slip, no play with the duty helps a rover whose two
front wheels stand at a wall: all wheels pull as hard as the soil allows. Turned by some 35 degrees it lifts one wheel
at a time while five push, and the wall is less steep along its way. Nothing outside the rover is needed to know when:
uneven ground folds the bogies, a smooth slope does not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from rover_pin.body.rover import Rover
from rover_pin.contact import Scalar
from rover_pin.control.steering import Turn
from rover_pin.motion.command import Command, Reading
from rover_pin.motion.timing import CONTROL_PERIOD
from rover_pin.quantity import Record, quantity

STRAIGHT = 1e-3
"""Curvature [1/m] below which the wheels are not steered."""


@dataclass(frozen=True)
class Tacking(Record):
    """How the rover tacks: kappa = gain (psi_d - psi) within 1 / radius, psi_d = +-heading on uneven ground, else 0.

    Ground is uneven from when a suspension angle exceeds `alert` until `calm` after it last did; there, and where the
    nose points up by more than `alert`, the duty is `delta_climb`.
    Source: none; found with the package's own optimisation (studies/beyond_the_paper.py).
    """

    heading: Scalar = quantity(math.radians(34.0), "rad", "tuned", 0.0, math.radians(80.0), "psi")
    radius: Scalar = quantity(0.58, "m", "tuned", 0.4, 100.0, "R")
    gain: Scalar = quantity(4.0, "1/m", "assumed: full lock at 30 deg off", 0.0, 100.0)
    alert: Scalar = quantity(math.radians(7.9), "rad", "tuned: bogies fold by 10 deg and more in a ditch", 0.0, 1.0)
    calm: Scalar = quantity(6.0, "s", "assumed: a rover's length at 0.05 m/s", 0.0, 1e3)
    delta: Scalar = quantity(0.55, "", "paper, section 5", 0.0, 1.0, "delta")
    delta_climb: Scalar = quantity(0.55, "", "the duty without control", 0.0, 1.0)


@dataclass
class TackingControl:
    """The controller: reads yaw, pitch and suspension angles only, commands the duty and the steering.

    Every obstacle is taken on the other side than the one before, so that the rover keeps its course on the whole.
    Source: none. Differs from the paper: it knows no slip, and it steers.
    """

    rover: Rover
    law: Tacking = field(default_factory=Tacking)
    period: float = CONTROL_PERIOD
    side: float = 1.0
    uneven_until: float = -1.0

    def reset(self) -> None:
        """Forget the past."""
        self.side, self.uneven_until = 1.0, -1.0

    def __call__(self, reading: Reading) -> Command:
        """Return the duty and steering of each wheel."""
        law = self.law
        if np.max(np.abs(reading.suspension), initial=0.0) > law.alert:
            self.uneven_until = reading.t + law.calm
        elif 0.0 < self.uneven_until < reading.t:
            self.side, self.uneven_until = -self.side, -1.0
        uneven = reading.t <= self.uneven_until
        asked = self.side * law.heading if uneven else 0.0
        bend = min(max(law.gain * (asked - reading.attitude[2]), -1.0 / law.radius), 1.0 / law.radius)
        nose_up = -reading.attitude[1]
        delta = law.delta_climb if uneven or nose_up > law.alert else law.delta
        if abs(bend) < STRAIGHT:
            return Command(delta)
        turn = Turn.of(self.rover, 1.0 / bend, delta)
        return Command(np.array(turn.duty), np.array(turn.steer))
