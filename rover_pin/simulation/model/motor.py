"""The PWM-driven DC motor of a wheel, with its gear and rotor."""

from dataclasses import dataclass
from typing import Self

from rover_pin.base.errors import ParameterError
from rover_pin.base.quantity import Record, quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import Drive


@dataclass(frozen=True)
class Motor(Record):
    """torque = K i, i = (delta V - K omega) / R with K = gear k_t: stall torque K V / R, no-load rate V / K.

    Held still, the torque is in proportion to the duty; a turning wheel's is less by what back-EMF takes. The stronger
    the motor, the more its duty sets the speed and the less the torque: `model.motors` weighs the paper's words.
    Source: the paper has "a PWM controlled DC motor" with back electromotive force, a duty "effectively in proportion
    to the driving torque", and 0.05 m/s at duty 0.55; the numbers are assumed so that the stall torque at the wheel is
    1 N m, then calibrated.

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
        """Torque constant at the wheel, gear k_t [N m/A]."""
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
        """Rotor inertia seen at the wheel, gear^2 J_r [kg m^2]."""
        return self.gear * self.gear * self.rotor_inertia

    def drive(self, delta: Scalar, omega: Scalar) -> Drive:
        """Return what the motor knows at duty `delta` and wheel rate `omega` [rad/s]."""
        return Drive(delta, omega, self.supply, self.resistance, self.constant)

    def with_operating_point(self, delta: float, omega: float, torque: float) -> Self:
        """Return the motor whose wheel turns at `omega` [rad/s] under `torque` [N m] at duty `delta`.

        The stall torque, supply and armature are kept; gear, resistance and rotor inertia follow.
        """
        share = delta - torque / self.stall_torque
        if share <= 0.0 or omega <= 0.0:
            raise ParameterError(
                f"Motor: duty {delta:g} cannot hold {torque:g} N m at {omega:g} rad/s with a stall torque of "
                f"{self.stall_torque:g} N m; raise the stall torque or the duty, and ask for a positive rate."
            )
        constant = self.supply * share / omega
        gear = constant / self.k_t
        return self.replace(
            gear=gear, resistance=constant * self.supply / self.stall_torque, rotor_inertia=self.armature / gear**2
        )
