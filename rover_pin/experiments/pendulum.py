"""An example of an experiment of your own in one file: a pendulum on a geared servo, driven by a voltage over time.

Copy this file for an experiment of your own, which runs by `rover-pin close-loop DATA --experiment FILE`. The arm hangs
down at angle 0, and a positive voltage drives it forward. At the output of the gear the motor has the rate v, and the
arm has the rate w. The elastic gear transmits the torque C and is twisted by x, the angle of the motor minus the angle
of the arm:

    gear^2 rotor_inertia dv/dt = K i - C,  i = (voltage - K v) / resistance,  K = gear k_t (inductance neglected)
    inertia dw/dt = C - T - mass g lever sin(angle),  C = stiffness x; play reduces |x| by half its gap

i is the current and k_t the torque constant of the motor. All friction T acts at the arm with the sign of w, smoothed
as tanh(w / WIDTH). Friction therefore only dissipates energy. An arm that dry friction should hold still creeps
instead. The elastic gear and the impact of its teeth lose no energy.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from rover_pin.experiments.over_time import OverTime, record
from rover_pin.parameters.gravity import EARTH
from rover_pin.simulation.model.motor import Motor

WIDTH = 0.01
"""Minimum rate of the arm [rad/s] with full friction. Below this value, the smoothed friction changes its sign
gradually (assumed: below the resolution of a tachometer)."""
ARM = {
    "mass": (1.0, "kg", 0.0, 1e3),
    "lever": (0.25, "m", 0.0, 10.0),
    "inertia": (0.08, "kg m^2", 1e-4, 1e3),
    "stiffness": (40.0, "N m/rad", 1.0, 300.0),
}
FALLING = {"T_s": (0.2, "N m", 0.0, 5.0), "share": (0.5, "", 0.0, 0.8), "w_s": (0.5, "rad/s", 0.2, 5.0)}


@dataclass(frozen=True, eq=False)
class Pendulum(OverTime):
    """A pendulum on a geared servo, as an experiment for the fit of the model of motor and arm.

    An encoder measures the angle of the arm, and a tachometer the rate of the motor, stated at the output of the gear.
    The third channel is the current of the motor.
    """

    name, states = "pendulum on a servo", 4
    columns = "time_s voltage_V angle_rad rate_radps current_A angle_sd_rad rate_sd_radps current_sd_A".split()
    units: ClassVar = {"angle": "rad", "rate": "rad/s", "current": "A"}
    parts: ClassVar = {"motor": Motor, "arm": record("Arm", "the pendulum", **ARM)}
    uncertainty: ClassVar = {
        **dict.fromkeys(("motor.k_t", "motor.resistance", "arm.lever", "arm.inertia"), 0.04),
        **dict.fromkeys(("motor.rotor_inertia", "arm.stiffness"), 0.2),
    }
    """relative prior SD of each uncertain number (assumed: the accuracy of data sheets and scales)"""
    laws = (
        record("Coulomb", "a torque that does not depend on the rate resists", T_c=(0.1, "N m", 0.0, 5.0)),
        record("Viscous", "grease resists in proportion to the rate", b=(0.05, "N m s", 0.0, 5.0)),
        record("Stribeck", "dry friction falls with the rate to a fraction of its value at rest", **FALLING),
        record("LoadFriction", "teeth rub in proportion to the torque that they carry", mu=(0.1, "", 0.0, 0.9)),
        record("Play", "the gear has play", gap=(0.03, "rad", 0.0, 0.5)),
    )

    def motion(self, n: Any, state: np.ndarray, *values: np.ndarray) -> tuple[Any, Any]:
        """Return the time derivatives of motor angle, motor rate, arm angle and arm rate, and the values of the
        measured channels.

        Source of the friction laws: Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 30 (1994) 1083. The
        number `mu` is 1 minus the efficiency of the gear.
        """
        # K is the torque constant at the output of the gear; `lead` is the twist of the elastic gear.
        (motor, v, arm, w), (voltage,) = state, values
        K, lead, half = n.gear * n.k_t, motor - arm, n.gap / 2
        # The inductance is neglected, so the current follows the voltage at once.
        current = (voltage - K * v) / n.resistance
        # Within the play, the teeth do not touch and the gear transmits no torque.
        carried = n.stiffness * (lead - np.maximum(np.minimum(lead, half), -half))
        falling = n.T_s * (n.share + (1.0 - n.share) * np.exp(-((w / n.w_s) ** 2)))
        # Dry friction, friction that falls with the rate, tooth friction and grease all act against the motion.
        friction = np.tanh(w / WIDTH) * (n.T_c + falling + n.mu * np.abs(carried)) + n.b * w
        dv = (K * current - carried) / (n.gear * n.gear * n.rotor_inertia)
        dw = (carried - friction - n.mass * EARTH * n.lever * np.sin(arm)) / n.inertia
        return (v, dv, w, dw), (arm, v, current)
