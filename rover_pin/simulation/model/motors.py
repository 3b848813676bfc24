"""Assumed motors of Nexus 6 by name: what the paper leaves open of them is one number, their stall torque.

The paper ties down one point, 0.05 m/s at duty 0.55, and says three things that do not go together. Section 2: the
duty is "effectively in proportion to the driving torque". Section 3.4: the torque comes of the duty "with the feedback
of the back electromotive force". Section 5: with the rover stuck at S = 1, the wheel "was yet rotating constantly".
T = T_stall (delta - omega / omega_0) has them all, and T_stall says which weighs more. In strict proportion, 0.0215 N m
at full duty carry the flat, and duty 0.55 climbs nothing; wheels under a sixth of the weight turn at S = 1 only with
more than 0.14 N m.

`speed-like`, the default, is 1 N m: at cruise back-EMF takes 98 % of the duty, and from S = 0.05 to 1 the rim slows by
12 %. `torque-like` is 0.25 N m, about the weakest with which all wheels of the stuck rover turn: 91 % and 53 %.
studies/motors.py takes both through the paper's sentences. Torque-like, 12 deg of Fig 8 come at 68 s, not at 56 s, and
at duties up to 0.55 the control of Fig 10 rescues nothing where the speed-like one is rescued, because wheels are held
instead of spun: so the default is the speed-like one, against the words of section 2. Neither lets Eq (9) see the slip:
soil that resists more at more slip slows the rim of any motor with back-EMF, and S_hat falls as S rises.
"""

from functools import lru_cache

from rover_pin.base.errors import one_of
from rover_pin.contact import Soil
from rover_pin.parameters.gravity import EARTH
from rover_pin.rover.rover import load_rover
from rover_pin.simulation.model.cruise import CRUISE_DUTY, CRUISE_SLIP, CRUISE_SPEED
from rover_pin.simulation.model.motor import Motor
from rover_pin.soil.wheel_forces import TorqueTraction, load_traction_factor

MOTORS = {"speed-like": 1.0, "torque-like": 0.25}
"""Stall torque at the wheel [N m] by name (assumed)."""


@lru_cache(maxsize=8)
def nexus6_motor(stall_torque: float = MOTORS["speed-like"]) -> Motor:
    """Return the motor of this stall torque [N m] whose duty 0.55 drives Nexus 6 at 0.05 m/s, Table 1, Earth.

    Raises ParameterError: a stall torque with which duty 0.55 does not carry the rover over the flat.
    """
    rover = load_rover("nexus6")
    r = float(rover.wheels[0].wheel.r)
    load = EARTH * rover.mass / len(rover.wheels)
    torque = float(load_traction_factor(CRUISE_SLIP, Soil(), rover.wheels[0].wheel, TorqueTraction())) * r * load
    default = Motor()
    weaker = default.replace(resistance=default.resistance * float(default.stall_torque) / stall_torque)
    return weaker.with_operating_point(CRUISE_DUTY, CRUISE_SPEED / (1.0 - CRUISE_SLIP) / r, torque)


def motor_named(word: str) -> Motor:
    """Return the motor of this name.

    Raises ParameterError: an unknown name, with the close ones.
    """
    return nexus6_motor(MOTORS[one_of("motor", word, MOTORS)])
