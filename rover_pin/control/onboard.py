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

from rover_pin.base.errors import ParameterError
from rover_pin.base.quantity import Record, quantity
from rover_pin.contact import Scalar
from rover_pin.control.steering import Turn, turning_places
from rover_pin.rover.rover import Rover
from rover_pin.simulation.command import Command, Reading
from rover_pin.simulation.native.control import Commands, TackLaw
from rover_pin.simulation.timing import CONTROL_PERIOD

STRAIGHT = 1e-3
"""Curvature [1/m] below which the wheels are not steered."""
FRESH = (1.0, -1.0)
"""What the control remembers at the start: the left side, and no uneven ground."""


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
    memory: np.ndarray = field(default_factory=lambda: np.array(FRESH))
    "on which side the next obstacle is taken, and until when the ground is uneven [s]"

    def reset(self) -> None:
        """Forget the past."""
        self.memory[:] = FRESH

    def __call__(self, reading: Reading) -> Command:
        """Return the duty and steering of each wheel."""
        law, (side, uneven_until) = self.law, self.memory.tolist()
        if np.max(np.abs(reading.suspension), initial=0.0) > law.alert:
            uneven_until = reading.t + law.calm
        elif 0.0 < uneven_until < reading.t:
            side, uneven_until = -side, -1.0
        self.memory[:] = side, uneven_until
        uneven = reading.t <= uneven_until
        target_yaw = side * law.heading if uneven else 0.0
        bend = min(max(law.gain * (target_yaw - reading.attitude[2]), -1.0 / law.radius), 1.0 / law.radius)
        nose_up = -reading.attitude[1]
        delta = law.delta_climb if uneven or nose_up > law.alert else law.delta
        if abs(bend) < STRAIGHT:
            return Command(delta)
        turn = Turn.of(self.rover, 1.0 / bend, delta)
        return Command(np.array(turn.duty), np.array(turn.steer))

    def native(self, wheels: int) -> Commands | None:
        """Return the same for the compiled loop, which keeps `memory`; None where a wheel may have to steer too far."""
        law, places = self.law, turning_places(self.rover)
        if not self._turns_freely(float(np.max(np.abs(places[:, 1])))):
            return None
        named = {"heading": law.heading, "bend": 1.0 / law.radius, "gain": law.gain, "alert": law.alert}
        named |= {"calm": law.calm, "delta": law.delta, "climb": law.delta_climb, "straight": STRAIGHT}
        steered = sum(wheel.steer_dof is not None for wheel in self.rover.wheels)
        tack = TackLaw({name: float(value) for name, value in named.items()}, places, self.memory)
        return Commands(np.zeros(len(places)), np.zeros(steered), tack=tack)

    def _turns_freely(self, furthest: float) -> bool:
        """Return whether every turn that may be asked for can be steered; beyond the wheels the tightest asks most."""
        try:
            for radius in (self.law.radius, -self.law.radius):
                Turn.of(self.rover, float(radius), 1.0)
        except ParameterError:
            return False
        return float(self.law.radius) > furthest
