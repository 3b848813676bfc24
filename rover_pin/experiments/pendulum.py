"""A pendulum on a geared servo driven by voltages over time: a function of time with parameters, in one file.

Copy this file for a bench of your own: `rover-pin close-loop DATA --experiment FILE`. The arm hangs at angle 0, and a
voltage above 0 drives it forward. Motor (rate v, at the gear's output) and arm (rate w) turn against a gear that gives
way by x, the lead of the motor, and carries C:

    gear^2 rotor_inertia dv/dt = K i - C,  i = (voltage - K v) / resistance,  K = gear k_t; no inductance
    inertia dw/dt = C - T - mass g lever sin(angle),  C = stiffness x; play takes its half gap from either side of x

All friction T acts at the arm. Its sign is that of w, as tanh(w / WIDTH): it only dissipates, and what it should hold
creeps. The spring gives back what it takes, and teeth that meet lose nothing.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from rover_pin.experiments.over_time import OverTime, record
from rover_pin.parameters.gravity import EARTH
from rover_pin.simulation.model.motor import Motor

WIDTH = 0.01
"""Rate within which friction changes its sign [rad/s] (assumed: below what a tachometer tells)."""
ARM = {
    "mass": (1.0, "kg", 0.0, 1e3),
    "lever": (0.25, "m", 0.0, 10.0),
    "inertia": (0.08, "kg m^2", 1e-4, 1e3),
    "stiffness": (40.0, "N m/rad", 1.0, 300.0),
}
FALLING = {"T_s": (0.2, "N m", 0.0, 5.0), "share": (0.5, "", 0.0, 0.8), "w_s": (0.5, "rad/s", 0.2, 5.0)}


@dataclass(frozen=True, eq=False)
class Pendulum(OverTime):
    """The experiment: angle of the arm by its encoder, rate v by the motor's tachometer, and the motor's current."""

    name, states = "pendulum on a servo", 4
    columns = "time_s voltage_V angle_rad rate_radps current_A angle_sd_rad rate_sd_radps current_sd_A".split()
    units: ClassVar = {"angle": "rad", "rate": "rad/s", "current": "A"}
    parts: ClassVar = {"motor": Motor, "arm": record("Arm", "the pendulum", **ARM)}
    uncertainty: ClassVar = {
        **dict.fromkeys(("motor.k_t", "motor.resistance", "arm.lever", "arm.inertia"), 0.04),
        **dict.fromkeys(("motor.rotor_inertia", "arm.stiffness"), 0.2),
    }
    "assumed: as good as data sheets and scales"
    laws = (
        record("Coulomb", "a torque that does not depend on the rate resists", T_c=(0.1, "N m", 0.0, 5.0)),
        record("Viscous", "grease resists in proportion to the rate", b=(0.05, "N m s", 0.0, 5.0)),
        record("Stribeck", "dry friction falls with the rate to a share of what it begins with", **FALLING),
        record("LoadFriction", "teeth rub in proportion to the torque that they carry", mu=(0.1, "", 0.0, 0.9)),
        record("Play", "the gear has play", gap=(0.03, "rad", 0.0, 0.5)),
    )

    def motion(self, n: Any, state: np.ndarray, *values: np.ndarray) -> tuple[Any, Any]:
        """Return the rates of motor, v, arm and w, and the channels.

        Friction: Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 30 (1994) 1083; mu is 1 - efficiency.
        """
        (motor, v, arm, w), (voltage,) = state, values
        K, lead, half = n.gear * n.k_t, motor - arm, n.gap / 2
        current = (voltage - K * v) / n.resistance
        carried = n.stiffness * (lead - np.maximum(np.minimum(lead, half), -half))
        falling = n.T_s * (n.share + (1.0 - n.share) * np.exp(-((w / n.w_s) ** 2)))
        friction = np.tanh(w / WIDTH) * (n.T_c + falling + n.mu * np.abs(carried)) + n.b * w
        dv = (K * current - carried) / (n.gear * n.gear * n.rotor_inertia)
        dw = (carried - friction - n.mass * EARTH * n.lever * np.sin(arm)) / n.inertia
        return (v, dv, w, dw), (arm, v, current)
