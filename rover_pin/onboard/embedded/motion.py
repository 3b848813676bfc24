"""Export of held speeds as C: the C code computes duties and steering angles from a commanded motion of the body."""

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from rover_pin.base.encode import c_comment
from rover_pin.base.errors import ParameterError
from rover_pin.base.files.paths import text_of_package
from rover_pin.control.motion.kinematics import BodyMotion, rolling, steers, turning_places
from rover_pin.control.motion.servo import HeldSpeeds, servo_duties
from rover_pin.control.torque_check import NoLimit
from rover_pin.onboard.embedded.source import BEGIN, c_header, casadi_functions
from rover_pin.rover.rover import Rover
from rover_pin.simulation.command import Reading, Truth

STRUCTS = """#define ROVER_STEERED {steered}
typedef struct {{ /* readings of one sample; wheels in the order {names} */
  rover_real motion[3]; /* commanded forward speed [m/s], yaw rate to the left [rad/s], speed to the left [m/s] */
  rover_real wheel_rate[ROVER_WHEELS]; /* rates of the wheel joints [rad/s] */
}} RoverReading;
typedef struct {{
  rover_real duty[ROVER_WHEELS]; /* duties to apply until the next sample [-] */
  rover_real steer[ROVER_STEERED + 1]; /* angles of the wheels that steer [rad]; the last entry is not used */
}} RoverCommand;
typedef struct {{
  rover_real integral[ROVER_WHEELS];
}} RoverControl;"""
"""C declarations of the structs that the user's program and the control use to exchange readings and commands."""
CORRELATION = 0.9
"""Correlation of successive readings in the test vectors. The readings are random but change slowly, as measurements
do."""
SAMPLES_BETWEEN_RESETS = 100
"""Number of samples in the test vectors after which the control is reset, so that the C code of the reset is also
compared."""
COMMAND_SD = np.array([0.4, 0.5, 0.1])
"""Standard deviations of forward speed, yaw rate times 1 m, and sideways speed in the random commands of the test
vectors, divided by the rim speed at full duty. Some commands then exceed the rim speed, so that the limit of the duty
is also compared."""
NO_TRUTH = Truth(*(np.zeros(0) for _ in Truth._fields))
"""Empty values for the part of a reading that only a simulation has (true slips and speeds); this control does not use
them."""


@dataclass(frozen=True)
class EmbeddedMotion:
    """The export of held speeds as C: its header, its source and its test vectors.

    In the C code, the commanded motion of the body is a part of the reading and may change at every sample, like the
    message `cmd_vel` of ROS.
    """

    control: HeldSpeeds
    rover: Rover

    @cached_property
    def expressions(self) -> list[ca.Function]:
        """A list with the CasADi function that the C code evaluates.

        The function's inputs are the commanded motion, the wheel rates and the servos' integrals. Its outputs are the
        duties, the steering angles and the integrals after the sample.
        """
        # Kinematics turn the motion into rates of the wheels, and the servos turn the rates into duties from -1 to 1.
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
        """The text of the C header of the exported control."""
        names = c_comment(", ".join(wheel.name for wheel in self.rover.wheels))
        structs = STRUCTS.format(steered=len(self.control.angles), names=names)
        return c_header("Held speeds", self.rover, self.control.period, [structs])

    @property
    def source(self) -> str:
        """The text of the C source of the exported control."""
        step = text_of_package("rover_pin.onboard.embedded", "motion.c")
        return "\n".join([BEGIN, casadi_functions(self.expressions), step])

    @property
    def heads(self) -> list[str]:
        """Names of the columns in the test vectors, in their order."""
        wheels = [wheel.name for wheel in self.rover.wheels]
        steered = [name for name, on in zip(wheels, steers(self.rover), strict=True) if on]
        before = ["anew", "speed", "yaw_rate", "aside", *(f"wheel_rate_{name}" for name in wheels)]
        return [*before, *(f"duty_{name}" for name in wheels), *(f"steer_{name}" for name in steered)]

    def vectors(self, count: int, seed: int = 0) -> Iterator[list[float]]:
        """Yield `count` rows of test vectors, one for each sample, with random readings; `seed` is the seed of the
        random numbers.

        A row begins with 1 if the control is reset before the sample, and with 0 otherwise. The commanded motion, the
        wheel rates, the duties and the steering angles follow. The duties and angles are computed by `HeldSpeeds`
        itself, so that the C code is compared with the control that simulations use.
        """
        random, twin, n = np.random.default_rng(seed), dataclasses.replace(self.control), len(self.rover.wheels)
        places, steering = turning_places(self.rover, twin.track).tolist(), steers(self.rover)
        full, state, blank = twin.omega_0 * float(self.rover.radii.min()), random.standard_normal(3 + n), np.zeros(n)
        for sample in range(count):
            resets = sample % SAMPLES_BETWEEN_RESETS == 0
            if resets:
                twin.reset()
            # Commands and rates are autoregressive processes of first order, scaled to the speed of the motors.
            state = CORRELATION * state + math.sqrt(1.0 - CORRELATION**2) * random.standard_normal(3 + n)
            motion, rates = full * COMMAND_SD * state[:3], 0.5 * twin.omega_0 * state[3:]
            speeds, angles = rolling(places, steering, BodyMotion(*motion.tolist()))
            twin.rates, twin.angles = tuple((np.array(speeds) / self.rover.radii).tolist()), tuple(angles)
            command = twin(Reading(0.0, blank, rates, blank, np.zeros(0), (0.0, 0.0, 0.0), NO_TRUTH))
            yield [float(resets), *motion.tolist(), *rates.tolist(), *np.ravel(command.duty).tolist(), *angles]


def embedded_motion(control: HeldSpeeds, rover: Rover) -> EmbeddedMotion:
    """Return the export of held speeds as C.

    Raises ParameterError: the control holds given rates of the wheels instead of a motion of the body, or it has a
    torque limit.
    """
    if control.motion is None or not isinstance(control.limit, NoLimit):
        raise ParameterError(
            "Held speeds can be exported only for a motion of the body, not for given wheel rates, and only without a "
            "torque limit. Choose control = cmd-vel and control.limit = none."
        )
    return EmbeddedMotion(control, rover)
