"""Checks whether the soil carries a rover, and whether its motors can move it there, by statics and torque bounds."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from rover_pin.base.errors import ParameterError
from rover_pin.contact import Soil
from rover_pin.control.rover_bounds import driven_slope
from rover_pin.control.torque_bounds import TractionLimit
from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.parameters.gravity import EARTH
from rover_pin.rover.rover import Rover
from rover_pin.rover.statics import hanging_wheels, wheel_loads
from rover_pin.simulation.model.cruise import CRUISE_DUTY
from rover_pin.simulation.model.defaults import driven_soil, own_motor, usual_angles
from rover_pin.simulation.model.model import BURIED, base_effects
from rover_pin.soil.sinkage import entry_angle, sinkage
from rover_pin.soil.wheel_forces import TorqueTraction


@dataclass(frozen=True)
class RoadCheck:
    """Result of the check on level ground: whether the soil carries the rover and whether it can move, in sentences for
    the user.
    """

    stands: str
    "whether the soil carries the rover, with loads and depths of the wheels; begins with yes or no"
    moves: str
    "whether the motors move the rover, with torques and slopes; begins with yes or no"
    assumed: tuple[str, ...]
    """sentences on numbers of soil and motor that are assumed, because the rover's TOML does not state them"""
    faults: tuple[str, ...] = ()
    "faults of the rover: the soil does not carry it, or it cannot move; empty without a fault"


def road_check(rover: Rover) -> RoadCheck:
    """Return whether the soil of a rover's TOML carries the rover, and whether its motors can move it, under Earth's
    gravity.

    The soil carries the rover if every wheel bears its static load without slip at a sinkage of at most BURIED r, where
    r is the wheel radius. The rover can move if the stall torque of its motors at the usual duty (CRUISE_DUTY) exceeds
    the torque R W r that level ground needs, where W is the load of a wheel and R the motion resistance as a fraction
    of W. The check uses the traction factor T / (r f_n) (`TorqueTraction`) with the usual contact angles of the wheel.

    Raises ParameterError: the TOML names an unknown soil or motor.

    Examples
    --------
    >>> from rover_pin import load_rover
    >>> road_check(load_rover("nexus6")).faults
    ()
    """
    (soil, soil_notes), (motor, motor_notes) = driven_soil(rover), own_motor(rover)
    assumed = (*soil_notes, *motor_notes)
    # The stance fails if a wheel sinks too deep; the rover can then not move either.
    try:
        stands = _stance(rover, soil)
        effects = base_effects(soil, rover, SoilTraction(TorqueTraction(), usual_angles(rover)))
        resistance = sum(float(effect.R) for effect in effects if isinstance(effect, MotionResistance))
    except ParameterError as error:
        fault = f"the rover does not stand on its soil: {error}"
        return RoadCheck(f"no: {error}", "no: the rover does not stand", assumed, (fault,))
    # Torque that one wheel needs on level ground, R W r with its share W of the weight, and torque of its motor.
    weight, stall = rover.mass * EARTH, float(motor.stall_torque)
    needed, torque = resistance * weight * float(rover.radii.mean()) / len(rover.wheels), CRUISE_DUTY * stall
    if torque <= needed:
        reason = (
            f"its motors stall: at duty {CRUISE_DUTY:g} a motor gives {torque:.3g} N m, but the flat takes "
            f"{needed:.3g} N m a wheel"
        )
        fault = f"{reason}. State a stronger motor or gear in the TOML's [motor]."
        return RoadCheck(stands, f"no: {reason}", assumed, (fault,))

    def spare(slope: float) -> float:
        """Return the thrust of all wheels [N] that remains at full duty on a slope [rad].

        The slope needs the force weight (sin(slope) + R cos(slope)), where R is the motion resistance as a fraction of
        the load.
        """
        return stall * float(np.sum(1.0 / rover.radii)) - weight * (math.sin(slope) + resistance * math.cos(slope))

    # The steepest slope by the motors is where the thrust at full duty equals the demand. The steepest slope by the
    # soil depends on the slip: at S = 0.2 the rover still advances well, and at S = 1 it only holds its place.
    by_motor = 90.0 if spare(math.pi / 2) >= 0.0 else math.degrees(brentq(spare, -math.pi / 2, math.pi / 2))
    by_soil, slipping = (
        math.degrees(
            driven_slope(rover, soil, TractionLimit(slip, TorqueTraction(), usual_angles(rover)), R=resistance)
        )
        for slip in (1.0, 0.2)
    )
    first = "the motors give" if by_motor < by_soil else "the soil gives"
    moves = (
        f"yes: the flat takes {needed:.3g} N m a wheel, and at duty {CRUISE_DUTY:g} a motor gives {torque:.3g} N m. "
        f"The motors hold {by_motor:.0f} deg at full duty, the soil {by_soil:.0f} deg at S = 1 and {slipping:.0f} deg "
        f"at S = 0.2: {first} way first"
    )
    return RoadCheck(stands, moves, assumed, ())


def _stance(rover: Rover, soil: Soil) -> str:
    """Return a sentence with the smallest and largest load and sinkage of the wheels on level ground.

    Raises ParameterError: the soil cannot carry the rover, or a wheel is buried.
    """
    # A wheel that hangs higher than the most loaded wheel sinks does not reach the ground; the other wheels carry its
    # load.
    gaps, loads, depths = hanging_wheels(rover), wheel_loads(rover, 0.0), []
    if gaps:
        deepest = sinkage(entry_angle(float(loads.max()), 0.0, rover.wheels[0].wheel, soil), rover.wheels[0].wheel)
        gaps = {name: gap for name, gap in gaps.items() if gap > float(deepest)}
        loads = wheel_loads(rover, 0.0, hanging=gaps)
    loaded = [(load, mount) for load, mount in zip(loads, rover.wheels, strict=True) if mount.name not in gaps]
    # Without slip, the depth follows from the load alone.
    for load, mount in loaded:
        depth = float(sinkage(entry_angle(float(load), 0.0, mount.wheel, soil), mount.wheel))
        if depth > BURIED * float(mount.wheel.r):
            raise ParameterError(
                f"wheel {mount.name} under {load:.3g} N is buried: it sinks {1e3 * depth:.0f} mm, more than {BURIED:g} "
                "r. Choose a firmer soil in the TOML's [soil], or wider wheels."
            )
        depths.append(depth)
    # Loads in newtons, depths in millimetres for the reader.
    smallest, shallow, deep = min(load for load, _ in loaded), 1e3 * min(depths), 1e3 * max(depths)
    stance = (
        f"yes: on level ground the wheels carry {smallest:.3g} to {loads.max():.3g} N and sink {shallow:.2g} to "
        f"{deep:.2g} mm"
    )
    if not gaps:
        return stance
    carry = "carries" if len(gaps) == 1 else "carry"
    return f"{stance}; {', '.join(gaps)} {carry} nothing, {1e3 * min(gaps.values()):.2g} mm or more above the ground"
