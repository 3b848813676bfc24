"""The slip control of Fig 9 in continuous time, as CasADi expressions: what `SlipControl` does between its samples."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from rover_pin.contact import Scalar
from rover_pin.control.slip_control import Gains, pi_law
from rover_pin.control.slip_estimate import SLOWEST_RIM, TableEstimate, TrueSlip
from rover_pin.control.torque_check import PITCHES, NoLimit, TorqueLimit
from rover_pin.simulation.timing import CONTROL_PERIOD
from rover_pin.tuning.reduced_model.wheel_path import piecewise


@dataclass(frozen=True)
class Loop:
    """What closes the loop."""

    estimate: TrueSlip | TableEstimate
    limit: TorqueLimit | NoLimit

    def estimated_slip(self, S: Scalar, duty: Scalar, rim: Scalar) -> Scalar:
        """Return S_hat [-] of a wheel: the slip itself, or Eq (9)."""
        if isinstance(self.estimate, TrueSlip):
            return S
        table = self.estimate.table
        sense = ca.tanh(rim / SLOWEST_RIM)
        v_hat = piecewise(ca.fabs(duty), np.array(table.duty), np.array(table.speed)) * ca.sign(duty)
        speed = ca.fmax(ca.fabs(rim), SLOWEST_RIM)
        return ca.fmin(1.0, ca.fmax(-1.0, 1.0 - sense * v_hat / speed))

    def highest(self, axle: int, pitch: Scalar, omega: Scalar) -> Scalar:
        """Return the highest duty that the torque limit allows [-]; the axle's two wheels have the same."""
        if isinstance(self.limit, NoLimit):
            return 1.0
        motor = self.limit.motor
        torques = np.array(self.limit.torques)[:, 2 * axle]
        torque = piecewise(pitch, PITCHES, torques)
        most = torque / motor.stall_torque + omega / motor.no_load_rate
        return ca.fmin(1.0, ca.fmax(0.0, most))

    def rates(
        self, gains: Gains, S_hat: Scalar, highest: Scalar, integral: Scalar, duty: Scalar
    ) -> tuple[Scalar, Scalar]:
        """Return the time derivatives of the integral and of the duty, which follows within one control period."""
        step = pi_law(gains, S_hat, integral, highest)
        return step.rate, (step.duty - duty) / CONTROL_PERIOD
