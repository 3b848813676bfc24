"""What a rover drives with where nothing is said: motor, soil and sizes by its own weight and wheels, each reported.

The numbers of Nexus 6 are its own: another rover takes over none of them but as a ratio that is stated here.
"""

import math
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from rover_pin.base.errors import ParameterError
from rover_pin.base.quantity import record_from
from rover_pin.contact import Soil, Wheel
from rover_pin.effects.slip import RelaxedSlip
from rover_pin.parameters import NEXUS6_WHEEL, SLOPE_SAND, TABLE_1, name_of, soil_named
from rover_pin.parameters.bekker import at_width
from rover_pin.parameters.gravity import EARTH
from rover_pin.rover.description.motor_sheet import MotorSheet
from rover_pin.rover.rover import Rover
from rover_pin.rover.wheel_base import base_of, wheel_places
from rover_pin.simulation.model.cruise import CRUISE_DUTY, CRUISE_SPEED
from rover_pin.simulation.model.motor import Motor
from rover_pin.simulation.model.motors import motor_named
from rover_pin.soil.angles import ANGLES, FixedAngles, SinkageAngles
from rover_pin.soil.wheel_forces import wheel_forces

HOLDS = math.radians(25.0)
"""Slope on which the sized motors hold the rover at duty 0.55: above the 20 deg of the paper's test field, assumed."""
FROUDE = CRUISE_SPEED / CRUISE_DUTY / math.sqrt(EARTH * float(NEXUS6_WHEEL.r))
"""Full speed over sqrt(g r), of the paper's 0.05 m/s at duty 0.55 with wheels of 45 mm: 0.14."""
NEXUS6_MASS = 5.8
"""Mass of the paper's rover [kg]."""
ROTOR = 1e-3 / (NEXUS6_MASS / 6 * float(NEXUS6_WHEEL.r) ** 2)
"""Rotor inertia at the wheel over (mass / wheels) r^2, of the motor assumed for Nexus 6."""
SUPPLY, GEAR = 12.0, 100.0
"""Supply [V] and gear of a sized motor, assumed: only currents depend on them."""


Kind = TypeVar("Kind")


class Chosen(NamedTuple, Generic[Kind]):
    """A motor or soil, and the sentence that says how it was chosen; none where the TOML states it."""

    value: Kind
    assumed: tuple[str, ...] = ()


def scale(rover: Rover) -> float:
    """Return the size of the rover's largest wheel over that of Nexus 6, for which ready-made terrains are made."""
    return float(rover.radii.max()) / float(NEXUS6_WHEEL.r)


def pace(rover: Rover, motor: Motor) -> float:
    """Return by how much longer the rover takes over a terrain of its size than Nexus 6 over its own.

    Source: way over speed at full duty without load; 1 for the paper's wheels whatever the motor.
    """
    if scale(rover) == 1.0:
        return 1.0
    return FROUDE * math.sqrt(EARTH / float(NEXUS6_WHEEL.r)) / float(motor.no_load_rate)


def has_papers_wheel(rover: Rover) -> bool:
    """Return whether all wheels have the size of Nexus 6's, for which Table 1's angles hold."""
    nexus6_size = (float(NEXUS6_WHEEL.r), float(NEXUS6_WHEEL.b))
    return all((float(mount.wheel.r), float(mount.wheel.b)) == nexus6_size for mount in rover.wheels)


def usual_angles(rover: Rover, name: str = "") -> FixedAngles | SinkageAngles:
    """Return the angles of this word, else Table 1's fixed ones for the paper's wheel, the sinkage's for any other."""
    return ANGLES.get(name) or ANGLES["fixed" if has_papers_wheel(rover) else "sinkage"]


def usual_slip(rover: Rover) -> RelaxedSlip:
    """Return the paper's wheels' relaxation, its length in the proportion of the wheel: a contact is as long."""
    relaxed, size = RelaxedSlip(), scale(rover)
    return relaxed if size == 1.0 else relaxed.replace(length=size * relaxed.length)


def own_motor(rover: Rover) -> Chosen[Motor]:
    """Return the motor of the rover's TOML: named, of its data sheet, or sized by its weight where it states none.

    Sized: T_stall = m g r max(sin(25 deg), `scrub_share`) / (0.55 n), omega_0 = FROUDE sqrt(g / r).

    Raises ParameterError: an unknown name.
    """
    if isinstance(rover.motor, str):
        return Chosen(motor_named(rover.motor))
    if rover.motor is not None:
        return Chosen(_of_sheet(rover.motor))
    n, r = len(rover.wheels), float(rover.radii.max())
    scrub = scrub_share(rover)
    share, rate = max(math.sin(HOLDS), scrub), FROUDE * math.sqrt(EARTH / r)
    stall = rover.mass * EARTH * r * share / CRUISE_DUTY / n
    constant = SUPPLY / rate
    inertia = ROTOR * rover.mass / n * r**2
    motor = Motor(SUPPLY, constant * SUPPLY / stall, constant / GEAR, GEAR, inertia / GEAR**2)
    holds = (
        f"holds {rover.mass:.3g} kg on {math.degrees(HOLDS):.0f} deg"
        if share > scrub
        else (f"turns {rover.mass:.3g} kg on the spot by the sides' speeds, its wheels dragged sideways,")
    )
    return Chosen(
        motor,
        (
            f"motor: none in the TOML's [motor], so one of {stall:.3g} N m stalled and {rate:.3g} rad/s without load "
            f"a wheel, which {holds} at duty {CRUISE_DUTY:g} and drives {FROUDE:.2g} sqrt(g r) at full duty",
        ),
    )


def scrub_share(rover: Rover) -> float:
    """Return the thrust, over their load, that wheels need to turn a rover on the spot by its sides' speeds; else 0.

    Wheels dragged sideways resist by tan phi of their load, x from the middle of the axles; the thrusts turn it by half
    the track B: tan phi sum |x| / (n B / 2). Source: moments about the middle, equal loads, as for tracks (Wong, Theory
    of Ground Vehicles, skid-steering); phi of slope-sand, whatever the soil.
    """
    if any(wheel.steer_dof is not None for wheel in rover.wheels):
        return 0.0
    x = np.array([place[0] for place in wheel_places(rover).values()])
    return float(math.tan(float(SLOPE_SAND.phi)) * np.mean(np.abs(x - np.mean(x))) / (0.5 * base_of(rover).track))


def _of_sheet(sheet: MotorSheet) -> Motor:
    """Return K = V / omega_0 at the wheel and the resistance that gives the stall torque there."""
    k_t = float(sheet.voltage) / float(sheet.no_load_speed)
    stall = float(sheet.efficiency) * float(sheet.gear) * float(sheet.stall_torque)
    resistance = float(sheet.gear) * k_t * float(sheet.voltage) / stall
    return Motor(sheet.voltage, resistance, k_t, sheet.gear, sheet.rotor_inertia)


def driven_soil(rover: Rover, name: str = "") -> Chosen[Soil]:
    """Return the soil of a drive: `own_soil`'s with slope-sand as usual, its k in the proportion of the wheel.

    On it every shipped rover slips 0.22 on 10 deg. What data are fitted with starts at Table 1 instead.
    """
    return own_soil(rover, name, SLOPE_SAND.replace(k=scale(rover) * SLOPE_SAND.k))


def own_soil(rover: Rover, name: str = "", default: Soil = TABLE_1) -> Chosen[Soil]:
    """Return the soil that is named, else that of the TOML's [soil], else the usual one made firm enough for the rover.

    Named soils are converted to the width of the rover's wheels. Table 1's own k_1 is assumed so that Nexus 6 sinks to
    theta_1 = 35 deg; the same is done for any other rover: Eq (6) at theta_1, S = 0, carries its share of the weight.

    Raises ParameterError: an unknown name, field, unit or value.
    """
    constants = {key: value for key, value in rover.soil.items() if key != "name"}
    if name or rover.soil:
        named = soil_named(str(name or rover.soil.get("name", "table-1")))
        soil = at_width(named, float(rover.wheels[0].wheel.b), float(NEXUS6_WHEEL.b))
        if name or not constants:
            return Chosen(soil)
        declared_soil = record_from(type(named), constants, f"rover '{rover.name}': [soil]")
        return Chosen(soil.replace(**{key: getattr(declared_soil, key) for key in constants}))
    load = rover.mass * EARTH / len(rover.wheels)
    k_1 = max(_firm_enough(mount.wheel, default, load) for mount in rover.wheels)
    sand = f"{name_of(default)} of k = {1e3 * float(default.k):.3g} mm and k_1 = {k_1:.3g} Pa"
    return Chosen(
        default.replace(k_1=k_1),
        (
            f"soil: none named, so {sand}, in which a wheel under {load:.3g} N sinks to theta_1 = "
            f"{math.degrees(float(default.theta_1)):.0f} deg as Nexus 6's does",
        ),
    )


def _firm_enough(wheel: Wheel, soil: Soil, load: float) -> float:
    """Return k_1 [Pa] at which the wheel at S = 0 carries the load at the soil's theta_1; f_n is linear in k_1."""
    forces = [
        float(wheel_forces(0.0, soil.theta_1, soil.theta_2, wheel, soil.replace(k_1=k_1)).f_n) for k_1 in (1e4, 1e6)
    ]
    slope = (forces[1] - forces[0]) / (1e6 - 1e4)
    k_1 = 1e4 + (load - forces[0]) / slope
    if not 0.0 < k_1 < 1e9:
        raise ParameterError(
            f"no k_1 below 1e9 Pa carries {load:.3g} N on a wheel of r = {float(wheel.r):g} m and "
            f"b = {float(wheel.b):g} m: name one, in the TOML's [soil] or with --soil."
        )
    return k_1
