"""Brushed motors with possible faults: torque at the wheel, current, and the rate that the tachometer measures."""

import numpy as np

ALPHA = 0.00393
"""Of copper's resistance [1/K]."""
SECTOR = 0.5
"""A loose wheel is loose where sin(angle + phase) is above this."""


class Motors:
    def __init__(self, world):
        self.world = world
        self.weak = 1.0 - world["WeakMotor.g"] * world.at_wheel("WeakMotor.wheel")
        self.eccentric = world["EccentricWheel.A"] * world.at_wheel("EccentricWheel.wheel")
        self.loose = world.at_wheel("LooseWheel.wheel") * (world["LooseWheel.hold"] < 100.0)
        self.limited = world.has("TorqueSaturation.i_max")

    def run(self, duty, angle, omega, windup, drawn, loss):
        """Return torque, current, hub rate, supply, and the rates of wind-up, drawn current and loss;
        [wheels, runs].
        """
        w = self.world
        supply = w["supply"] - w["SupplySag.R_b"] * drawn - w["SquareSag.R_2"] * drawn**2
        R = w["resistance"] * (1.0 + ALPHA * w["WindingHeating.R_th"] * loss)
        K, dead = w["constant"], w["DeadBand.delta_0"]
        reach = np.sign(duty) * np.maximum(np.abs(duty) - dead, 0.0)
        current = (reach * supply - K * omega) / R
        if self.limited:
            current = current / (1.0 + (current / w["TorqueSaturation.i_max"]) ** 8) ** 0.125
        hub = omega
        if self.loose.any():
            grip = np.where(np.sin(angle + w["LooseWheel.phase"]) > SECTOR, w["LooseWheel.hold"], 1e3) / K
            clipped = np.clip(current, -grip, grip)
            clipped = np.where(self.loose > 0.0, clipped, current)
            hub, current = omega + (current - clipped) * R / K, clipped
        torque = K * current * w["motor_gain"]
        torque = torque - w["GearFriction.tau_c"] * windup - w["ViscousFriction.b_v"] * omega
        torque = torque - w["StribeckFriction.tau_s"] * windup * np.exp(-((omega / w["StribeckFriction.w_s"]) ** 2))
        torque = torque * self.weak + self.eccentric * np.sin(angle + w["EccentricWheel.phase"])
        bus = np.sum(duty * current, axis=0)
        return (
            torque, current, hub, supply,
            (omega - np.abs(omega) * windup) / w["GearFriction.theta_c"],
            (bus - drawn) / w["SupplySag.tau"],
            (current**2 * R - loss) / w["WindingHeating.tau"],
        )  # fmt: skip
