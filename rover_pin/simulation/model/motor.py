"""The PWM-driven DC motor of a wheel with its gear and rotor, and the assumed motors of Nexus 6.

The paper leaves one number of its motor open, the stall torque. It states one operating point, 0.05 m/s at duty 0.55,
and three properties that do not fit together. Section 2: the duty is "effectively in proportion to the driving torque".
Section 3.4: the torque follows from the duty "with the feedback of the back electromotive force". Section 5: with the
rover stuck at S = 1, the wheel "was yet rotating constantly". T = T_stall (delta - omega / omega_0) has all three
properties, and T_stall decides which of them dominates. Here T is the torque, delta the duty, omega the wheel rate and
omega_0 the wheel rate at full duty without load. With a torque in strict proportion to the duty, 0.0215 N m at full
duty would carry the rover on the flat and duty 0.55 would climb no slope; and wheels under a sixth of the weight turn
at S = 1 only with more than 0.14 N m.

The default `speed-like` motor has a stall torque of 1 N m: at cruise, back-EMF takes up 98 % of the duty, and from
S = 0.05 to S = 1 the rim slows down by 12 %. `torque-like` has 0.25 N m, about the least that turns all wheels of the
stuck rover: 91 % and 53 %. studies/motors.py compares both with the paper's statements. The torque-like motor
reaches the 12 deg of Fig 8 later than the paper, and at duties up to 0.55 the control of Fig 10 rescues nothing with
it, because wheels stop instead of spinning. Therefore the speed-like motor is the default, although section 2 reads
differently. With neither motor does Eq (9) see the slip: soil whose resistance rises with the slip slows down the rim
of any motor with back-EMF, so that S_hat falls as S rises.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Self

from rover_pin.base.errors import ParameterError, one_of
from rover_pin.base.quantity import Record, quantity
from rover_pin.contact import Scalar, Soil
from rover_pin.effects.effect import Drive
from rover_pin.parameters.gravity import EARTH
from rover_pin.rover.rover import load_rover
from rover_pin.simulation.model.cruise import CRUISE_DUTY, CRUISE_SLIP, CRUISE_SPEED
from rover_pin.soil.wheel_forces import TorqueTraction, load_traction_factor


@dataclass(frozen=True)
class Motor(Record):
    """A DC motor with gear: torque at the wheel = K i, current i = (delta V - K omega) / R. K = gear k_t is the torque
    constant at the wheel, delta the duty, V the supply voltage, omega the wheel rate and R the resistance.

    Its stall torque is K V / R, and its no-load rate V / K. At standstill the torque is proportional to the duty. When
    the wheel turns, the back-EMF K omega takes up part of the voltage. The larger the stall torque, the more the duty
    sets the speed of the wheel instead of its torque.

    Source: the paper has "a PWM controlled DC motor" with back electromotive force, a duty "effectively in proportion
    to the driving torque", and 0.05 m/s at duty 0.55. The numbers are assumed so that the stall torque at the wheel is
    1 N m, then calibrated (`nexus6_motor`).

    Examples
    --------
    >>> motor = Motor()
    >>> round(motor.stall_torque, 2), round(motor.no_load_rate, 2)
    (1.0, 2.15)
    """

    supply: Scalar = quantity(7.2, "V", "assumed: a six-cell battery", 0.1, 1e3, "V")
    resistance: Scalar = quantity(24.12, "ohm", "assumed: stall torque 1 N m", 1e-3, 1e5, "R")
    k_t: Scalar = quantity(0.0125, "N m/A", "assumed: a small DC motor", 1e-6, 1e3, "k_t")
    gear: Scalar = quantity(268.0, "", "assumed, then calibrated", 0.1, 1e5, "N")
    rotor_inertia: Scalar = quantity(1.4e-8, "kg m^2", "assumed: 1e-3 kg m^2 at the wheel", 0.0, 10.0, "J_r")

    @property
    def constant(self) -> Scalar:
        """Torque constant of motor and gear at the wheel, K = gear k_t [N m/A], with the torque constant k_t of the
        motor itself.
        """
        return self.gear * self.k_t

    @property
    def stall_torque(self) -> Scalar:
        """Torque at the wheel at full duty and standstill [N m]."""
        return self.constant * self.supply / self.resistance

    @property
    def no_load_rate(self) -> Scalar:
        """Wheel rate at full duty without load [rad/s]."""
        return self.supply / self.constant

    @property
    def armature(self) -> Scalar:
        """Inertia of the motor's rotor, referred to the wheel, gear^2 J_r [kg m^2], with the inertia J_r of the rotor
        itself.
        """
        return self.gear * self.gear * self.rotor_inertia

    def drive(self, delta: Scalar, omega: Scalar) -> Drive:
        """Return the state of the motor at the duty `delta` and the wheel rate `omega` [rad/s]. Motor effects change
        this state before the torque is computed from it.
        """
        return Drive(delta, omega, self.supply, self.resistance, self.constant)

    def with_operating_point(self, delta: float, omega: float, torque: float) -> Self:
        """Return a motor that turns its wheel at the rate `omega` [rad/s] under the load torque `torque` [N m] at the
        duty `delta`.

        Stall torque, supply voltage and armature equal the values of this motor; gear, resistance and rotor inertia are
        changed.

        Raises ParameterError: no gear gives this operating point.
        """
        # The part of the duty that back-EMF takes up, K omega / V; K follows from it, and the stall torque gives R.
        share = delta - torque / self.stall_torque
        if share <= 0.0 or omega <= 0.0:
            raise ParameterError(
                f"Motor: with a stall torque of {self.stall_torque:g} N m, no gear lets a motor turn the wheel at "
                f"{omega:g} rad/s against {torque:g} N m at duty {delta:g}; raise the stall torque or the duty, and "
                "give a positive rate."
            )
        constant = self.supply * share / omega
        gear = constant / self.k_t
        return self.replace(
            gear=gear, resistance=constant * self.supply / self.stall_torque, rotor_inertia=self.armature / gear**2
        )


MOTORS = {"speed-like": 1.0, "torque-like": 0.25}
"""Stall torque at the wheel [N m] of the two motors that are assumed for Nexus 6, by name."""


@lru_cache(maxsize=8)
def nexus6_motor(stall_torque: float = MOTORS["speed-like"]) -> Motor:
    """Return the motor with the stall torque `stall_torque` [N m] at the wheel that drives Nexus 6 at 0.05 m/s with
    duty 0.55, on level soil of Table 1 of the paper and on Earth.

    Raises ParameterError: with this stall torque, duty 0.55 does not move the rover on the flat.
    """
    rover = load_rover("nexus6")
    r = float(rover.wheels[0].wheel.r)
    load = EARTH * rover.mass / len(rover.wheels)
    # At cruise, the motor's torque is the soil's on a wheel under an equal share of the weight.
    torque = float(load_traction_factor(CRUISE_SLIP, Soil(), rover.wheels[0].wheel, TorqueTraction())) * r * load
    # Only the resistance decides the stall torque at a given gear; the gear then follows from the operating point.
    default = Motor()
    weaker = default.replace(resistance=default.resistance * float(default.stall_torque) / stall_torque)
    return weaker.with_operating_point(CRUISE_DUTY, CRUISE_SPEED / (1.0 - CRUISE_SLIP) / r, torque)


def motor_named(word: str) -> Motor:
    """Return the motor of this name, one of the motors that are assumed for Nexus 6 (MOTORS).

    Raises ParameterError: the name is unknown.
    """
    return nexus6_motor(MOTORS[one_of("motor", word, MOTORS)])
