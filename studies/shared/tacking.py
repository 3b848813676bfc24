"""Beyond the paper: take obstacles at an angle, one wheel after another, by what the rover feels on board.

Where all soil laws of the package let thrust only grow or fall with slip, no play with the duty helps a rover whose two
front wheels stand at a wall: all wheels pull as hard as the soil allows. Turned by some 35 degrees it lifts one wheel
at a time while five push, and the wall is less steep along its way. Nothing outside the rover is needed to know when:
uneven ground folds the bogies, a smooth slope does not.
"""

import math
from dataclasses import dataclass, field
from functools import lru_cache

import casadi as ca
import numpy as np

from rover_pin.base.quantity import Record, quantities, quantity
from rover_pin.contact import Scalar
from rover_pin.control.motion.kinematics import BodyMotion, rolling, steers, turning_places
from rover_pin.control.motion.servo import LawControl
from rover_pin.control.open_loop import Turn
from rover_pin.control.torque_check import NoLimit, TorqueLimit
from rover_pin.rover.rover import Rover
from rover_pin.simulation.state import suspension_places

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


@lru_cache(maxsize=16)
def _law(steering: tuple[bool, ...], links: int) -> ca.Function:
    """Return the law of a rover whose wheels steer or not; its numbers are `Tacking`'s, then places of the wheels."""
    n = len(steering)
    t, read, memory = ca.SX.sym("t"), ca.SX.sym("read", 3 + 2 * n + links), ca.SX.sym("memory", 2)
    values, places = ca.SX.sym("values", len(quantities(Tacking))), ca.SX.sym("places", 2 * n)
    law = Tacking(**dict(zip(quantities(Tacking), ca.vertsplit(values), strict=True)))
    folded = ca.mmax(ca.fabs(read[3 + 2 * n :])) > law.alert if links else ca.SX(0.0)
    over = ca.logic_and(memory[1] > 0.0, memory[1] < t)
    side = ca.if_else(ca.logic_and(over, ca.logic_not(folded)), -memory[0], memory[0])
    until = ca.if_else(folded, t + law.calm, ca.if_else(over, FRESH[1], memory[1]))
    uneven = t <= until
    target_yaw = ca.if_else(uneven, side * law.heading, 0.0)
    bend = ca.fmin(ca.fmax(law.gain * (target_yaw - read[2]), -1.0 / law.radius), 1.0 / law.radius)
    delta = ca.if_else(ca.logic_or(uneven, -read[1] > law.alert), law.delta_climb, law.delta)
    pairs = [(places[2 * at], places[2 * at + 1]) for at in range(n)]
    speeds, angles = rolling(pairs, steering, BodyMotion(1.0, bend))
    fastest = ca.mmax(ca.fabs(ca.vertcat(*speeds)))
    out = [delta / fastest * ca.vertcat(*speeds), ca.vertcat(*angles), ca.vertcat(side, until)]
    inputs = [t, read, ca.SX(0, 1), memory, ca.vertcat(values, places)]
    return ca.Function("tacking", inputs, out)


@dataclass
class TackingControl(LawControl):
    """The controller: reads yaw, pitch and suspension angles only, commands the duty and the steering.

    Every obstacle is taken on the other side than the one before, so that the rover keeps its course on the whole.
    Source: none. Differs from the paper: it knows no slip, and it steers.

    Raises
    ------
    ParameterError
        Its tightest turn wants a wheel to steer beyond 75 deg.
    """

    rover: Rover
    tacking: Tacking = field(default_factory=Tacking)
    limit: TorqueLimit | NoLimit = field(default_factory=NoLimit)
    memory: np.ndarray = field(default_factory=lambda: np.array(FRESH))
    "on which side the next obstacle is taken, and until when the ground is uneven [s]"
    fresh = np.array(FRESH)

    def __post_init__(self) -> None:
        widest = float(np.max(np.abs(turning_places(self.rover)[:, 1])))
        for radius in {float(self.tacking.radius), max(float(self.tacking.radius), widest)}:
            Turn.of(self.rover, radius), Turn.of(self.rover, -radius)

    @property
    def law(self) -> ca.Function:
        """Its law as one function."""
        return _law(steers(self.rover), len(suspension_places(self.rover)))

    @property
    def numbers(self) -> np.ndarray:
        """The numbers of `Tacking`, and x, y of each wheel from the line on which turning centres lie."""
        return np.concatenate([list(self.tacking.values().values()), turning_places(self.rover).ravel()])
