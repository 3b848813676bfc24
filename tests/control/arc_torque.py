"""The torques of Eqs (2)-(6) at the entry angle that carries a load: a plainer route to a wheel's bounds."""

from rover_pin.soil.quadrature import FAST, entry_graded
from rover_pin.soil.sinkage import entry_angle, fully_sheared
from rover_pin.soil.stress import full_shear
from rover_pin.soil.wheel_forces import forces, wheel_forces


def torque_at_slip(load, S, wheel, soil):
    theta_1 = entry_angle(load, S, wheel, soil)
    return wheel_forces(S, theta_1, -soil.exit_ratio * theta_1, wheel, soil).torque


def saturation_torque(load, wheel, soil):
    theta_1 = entry_angle(load, 1.0, wheel, soil, state=fully_sheared)
    return forces(theta_1, -soil.exit_ratio * theta_1, full_shear, wheel, soil, entry_graded(FAST)).torque
