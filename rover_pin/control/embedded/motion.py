"""Held speeds to take away: C from a commanded body motion to duties and steering, equal to the package's own."""

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from rover_pin.base.errors import ParameterError
from rover_pin.base.files.paths import text_of_package
from rover_pin.control.embedded.source import BEGIN, c_header, casadi_functions
from rover_pin.control.motion.kinematics import BodyMotion, rolling, steers, turning_places
from rover_pin.control.motion.servo import HeldSpeeds, servo_duties
from rover_pin.control.torque_check import NoLimit
from rover_pin.rover.rover import Rover
from rover_pin.simulation.command import Reading, Truth

STRUCTS = """#define ROVER_STEERED {steered}
typedef struct {{ /* wheels in the order {names} */
  rover_real motion[3]; /* commanded: forwards [m/s], yaw rate to the left [rad/s], sideways to the left [m/s] */
  rover_real wheel_rate[ROVER_WHEELS]; /* of the wheels' joints [rad/s] */
}} RoverReading;
typedef struct {{
  rover_real duty[ROVER_WHEELS]; /* to apply until the next sample [-] */
  rover_real steer[ROVER_STEERED + 1]; /* angles of the wheels that steer [rad]; the last is not used */
}} RoverCommand;
typedef struct {{
  rover_real integral[ROVER_WHEELS];
}} RoverControl;"""
MEMORY, ANEW = 0.9, 100
"""Correlation of a reading with the one before; samples after which the control begins anew."""
SPREADS = np.array([0.4, 0.5, 0.1])
"""SD of speed, of yaw rate times a metre, and of speed aside, over that of the rims at full duty."""
NOTHING = Truth(*(np.zeros(0) for _ in Truth._fields))
"""What such a control does not look at."""


@dataclass(frozen=True)
class EmbeddedMotion:
    """Held speeds of a rover to take away; the motion is commanded at every sample."""

    control: HeldSpeeds
    rover: Rover

    @cached_property
    def expressions(self) -> list[ca.Function]:
        """What it computes: (motion, wheel rates, integrals) -> duties, steering angles, integrals."""
        control, n = self.control, len(self.rover.wheels)
        motion, rates_now = ca.SX.sym("motion", 3), ca.SX.sym("rates", n)
        limits, integrals = ca.vertcat(-ca.SX.ones(n), ca.SX.ones(n)), ca.SX.sym("integrals", n)
        places = turning_places(self.rover, control.track)
        speeds, angles = rolling(places.tolist(), steers(self.rover), BodyMotion(*ca.vertsplit(motion)))
        rates = ca.vertcat(*speeds) / self.rover.radii
        duties, after = servo_duties(
            control.servo, rates, rates_now, integrals, limits, control.omega_0, control.period
        )
        return [ca.Function("cmd_vel", [motion, rates_now, integrals], [duties, ca.vertcat(*angles), after])]

    @property
    def header(self) -> str:
        """The C header."""
        names = ", ".join(wheel.name for wheel in self.rover.wheels)
        structs = STRUCTS.format(steered=len(self.control.angles), names=names)
        return c_header("Held speeds", self.rover, self.control.period, [structs])

    @property
    def source(self) -> str:
        """The C source."""
        step = text_of_package("rover_pin.control.embedded", "motion.c")
        return "\n".join([BEGIN, casadi_functions(self.expressions), step])

    @property
    def heads(self) -> list[str]:
        """The names of the vectors' columns."""
        wheels = [wheel.name for wheel in self.rover.wheels]
        steered = [name for name, on in zip(wheels, steers(self.rover), strict=True) if on]
        before = ["anew", "speed", "yaw_rate", "aside", *(f"wheel_rate_{name}" for name in wheels)]
        return [*before, *(f"duty_{name}" for name in wheels), *(f"steer_{name}" for name in steered)]

    def vectors(self, count: int, seed: int = 0) -> Iterator[list[float]]:
        """Yield rows: 1 where the control begins anew, else 0; motion, wheel rates; the class's duties and angles."""
        random, twin, n = np.random.default_rng(seed), dataclasses.replace(self.control), len(self.rover.wheels)
        places, steering = turning_places(self.rover, twin.track).tolist(), steers(self.rover)
        full, state, blank = twin.omega_0 * float(self.rover.radii.min()), random.standard_normal(3 + n), np.zeros(n)
        for at in range(count):
            if at % ANEW == 0:
                twin.reset()
            state = MEMORY * state + math.sqrt(1.0 - MEMORY**2) * random.standard_normal(3 + n)
            motion, rates = full * SPREADS * state[:3], 0.5 * twin.omega_0 * state[3:]
            speeds, angles = rolling(places, steering, BodyMotion(*motion.tolist()))
            twin.rates, twin.angles = tuple((np.array(speeds) / self.rover.radii).tolist()), tuple(angles)
            command = twin(Reading(0.0, blank, rates, blank, np.zeros(0), (0.0, 0.0, 0.0), NOTHING))
            yield [float(at % ANEW == 0), *motion.tolist(), *rates.tolist(), *np.ravel(command.duty).tolist(), *angles]


def embedded_motion(control: HeldSpeeds, rover: Rover) -> EmbeddedMotion:
    """Return held speeds as they can be taken away.

    Raises ParameterError: rates of wheels, which are for no motion of the body, or a torque limit.
    """
    if control.motion is None or not isinstance(control.limit, NoLimit):
        raise ParameterError(
            "Speeds of the body alone can be taken away: choose control = cmd-vel, control.limit = none."
        )
    return EmbeddedMotion(control, rover)
