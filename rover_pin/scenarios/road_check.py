"""Whether a rover stands on its soil and whether its motors move it: statics and torques against the soil's bounds."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from rover_pin.base.errors import ParameterError
from rover_pin.contact import Soil
from rover_pin.control.bound_pull import TractionLimit
from rover_pin.control.rover_bounds import driven_slope
from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.parameters.gravity import EARTH
from rover_pin.rover.rover import Rover
from rover_pin.rover.statics import hanging_wheels, wheel_loads
from rover_pin.simulation.model.cruise import CRUISE_DUTY
from rover_pin.simulation.model.defaults import driven_soil, own_motor, usual_angles
from rover_pin.simulation.model.model import BURIED, base_effects
from rover_pin.simulation.model.motor import Motor
from rover_pin.soil.sinkage import entry_angle, sinkage
from rover_pin.soil.wheel_forces import TorqueTraction


@dataclass(frozen=True)
class RoadCheck:
    """What a rover does on the flat of its soil, in a sentence each; `faults` say why it does not."""

    stands: str
    moves: str
    assumed: tuple[str, ...]
    faults: tuple[str, ...] = ()


def road_check(rover: Rover) -> RoadCheck:
    """Return whether the rover stands on the soil of its TOML and whether its motors move it there, on the Earth.

    It stands where static loads are carried before any wheel is buried (BURIED r deep at S = 0). It moves where the
    motors at duty 0.55, held still, exceed the torque R W r that the flat takes. Torque form, the wheel's usual arc.

    Raises ParameterError: a soil or motor that its TOML names and that is not known.
    """
    (soil, of_soil), (motor, of_motor) = driven_soil(rover), own_motor(rover)
    assumed = (*of_soil, *of_motor)
    try:
        stands = _stance(rover, soil)
        resistance = _resistance(rover, soil)
    except ParameterError as error:
        answer = f"no: {error}"
        return RoadCheck(answer, "no: it does not stand", assumed, (f"it does not stand on its soil: {error}",))
    moves, fault = _motion(rover, soil, motor, resistance)
    return RoadCheck(stands, moves, assumed, (fault,) if fault else ())


def _stance(rover: Rover, soil: Soil) -> str:
    gaps, loads, depths = hanging_wheels(rover), wheel_loads(rover, 0.0), []
    if gaps:
        sinks = sinkage(entry_angle(float(loads.max()), 0.0, rover.wheels[0].wheel, soil), rover.wheels[0].wheel)
        gaps = {name: gap for name, gap in gaps.items() if gap > float(sinks)}
        loads = wheel_loads(rover, 0.0, hanging=gaps)
    loaded = [(load, mount) for load, mount in zip(loads, rover.wheels, strict=True) if mount.name not in gaps]
    for load, mount in loaded:
        depth = float(sinkage(entry_angle(float(load), 0.0, mount.wheel, soil), mount.wheel))
        if depth > BURIED * float(mount.wheel.r):
            raise ParameterError(
                f"wheel {mount.name} under {load:.3g} N is buried, {1e3 * depth:.0f} mm deep: over {BURIED:g} r; "
                "name a firmer soil, in the TOML's [soil], or take wider wheels."
            )
        depths.append(depth)
    least, shallow, deep = min(load for load, _ in loaded), 1e3 * min(depths), 1e3 * max(depths)
    return (
        f"yes: {least:.3g} to {loads.max():.3g} N a wheel, {shallow:.2g} to {deep:.2g} mm deep on the flat"
        f"{_carrying_nothing(gaps)}"
    )


def _carrying_nothing(gaps: dict[str, float]) -> str:
    """Return what is to be said of wheels that hang above the ground."""
    if not gaps:
        return ""
    carry = "carries" if len(gaps) == 1 else "carry"
    return f"; {', '.join(gaps)} {carry} nothing, {1e3 * min(gaps.values()):.2g} mm or more above it"


def _resistance(rover: Rover, soil: Soil) -> float:
    effects = base_effects(soil, rover, SoilTraction(TorqueTraction(), usual_angles(rover)))
    return sum(float(effect.R) for effect in effects if isinstance(effect, MotionResistance))


def _motion(rover: Rover, soil: Soil, motor: Motor, R: float) -> tuple[str, str]:
    """Return what is said of the motion, and the fault where there is none."""
    weight, stall = rover.mass * EARTH, float(motor.stall_torque)
    needed, torque = R * weight * float(rover.radii.mean()) / len(rover.wheels), CRUISE_DUTY * stall
    if torque <= needed:
        why = f"its motors stall: {torque:.3g} N m a wheel at duty {CRUISE_DUTY:g}, and the flat takes {needed:.3g} N m"
        return f"no: {why}", f"{why}; a stronger motor or gear goes into the TOML's [motor]."
    by_motor = _held_slope(stall * float(np.sum(1.0 / rover.radii)), R, weight)
    most, slipping = (
        math.degrees(driven_slope(rover, soil, TractionLimit(slip, TorqueTraction(), usual_angles(rover)), R=R))
        for slip in (1.0, 0.2)
    )
    first = "the motors" if by_motor < most else "the soil"
    return (
        f"yes: the flat takes {needed:.3g} N m a wheel, the motor gives {torque:.3g} N m at duty {CRUISE_DUTY:g}; "
        f"motors hold {by_motor:.0f} deg at full duty, the soil {most:.0f} deg at S = 1 and {slipping:.0f} deg at "
        f"S = 0.2: "
        f"{first} give{'' if first == 'the motors' else 's'} first"
    ), ""


def _held_slope(thrust: float, R: float, weight: float) -> float:
    """Return the slope [deg] at which thrust = weight (sin + R cos)."""

    def spare(slope: float) -> float:
        return thrust - weight * (math.sin(slope) + R * math.cos(slope))

    return 90.0 if spare(math.pi / 2) >= 0.0 else math.degrees(brentq(spare, -math.pi / 2, math.pi / 2))
