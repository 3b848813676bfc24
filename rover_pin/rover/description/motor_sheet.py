"""The motor of a wheel as its data sheet has it."""

from dataclasses import dataclass

from rover_pin.base.quantity import Record, quantity
from rover_pin.contact import Scalar

UNSTATED = "a data sheet has it: see [motor] in the rover's TOML"


@dataclass(frozen=True)
class MotorSheet(Record):
    """Stall torque and no-load speed of the shaft at full voltage, and the gear between shaft and wheel.

    At the wheel: T_stall = efficiency gear stall_torque, omega_0 = no_load_speed / gear. A sheet of a gear motor states
    its output, gear = 1. Source: the straight line of a DC motor between the two points that every sheet has.
    Simplified: the gear's losses are in proportion to the torque and act alike when the wheel drives the motor.
    """

    stall_torque: Scalar = quantity(1.0, "N m", UNSTATED, 1e-6, 1e5)
    no_load_speed: Scalar = quantity(2.0, "rad/s", UNSTATED, 1e-3, 1e5)
    voltage: Scalar = quantity(12.0, "V", "assumed: only currents depend on it", 0.1, 1e3)
    gear: Scalar = quantity(1.0, "", "assumed: the sheet is of the geared motor's output", 1e-2, 1e5)
    efficiency: Scalar = quantity(1.0, "", "assumed: the sheet is of the geared motor's output", 0.05, 1.0)
    rotor_inertia: Scalar = quantity(0.0, "kg m^2", "assumed: none", 0.0, 10.0)
