"""Default motor and default soil for a rover whose TOML does not declare its motor or its soil, and the size of a rover
relative to Nexus 6. The defaults are derived from the rover's weight and wheels, and reported as assumed.

Numbers of Nexus 6, the paper's rover, are never used directly for another rover. They only enter the dimensionless
ratios that this module states, for example the Froude number.
"""

import math
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from rover_pin.base.errors import ParameterError
from rover_pin.base.quantity import record_from
from rover_pin.contact import Soil
from rover_pin.effects.slip import RelaxedSlip
from rover_pin.parameters import NEXUS6_WHEEL, SLOPE_SAND, TABLE_1, name_of, soil_named
from rover_pin.parameters.bekker import at_width, from_bekker
from rover_pin.parameters.gravity import EARTH
from rover_pin.rover.rover import Rover
from rover_pin.rover.wheel_base import base_of, wheel_places
from rover_pin.simulation.model.cruise import CRUISE_DUTY, CRUISE_SPEED
from rover_pin.simulation.model.motor import Motor, motor_named
from rover_pin.soil.angles import ANGLES, FixedAngles, SinkageAngles
from rover_pin.soil.wheel_forces import wheel_forces

HOLDING_SLOPE = math.radians(25.0)
"""Slope [rad] on which a default motor holds the rover at duty 0.55. The stall torque of a default motor is chosen for
this slope, which is assumed to be somewhat steeper than the 20 deg of the paper's test field."""
FROUDE = CRUISE_SPEED / CRUISE_DUTY / math.sqrt(EARTH * float(NEXUS6_WHEEL.r))
"""Froude number of the rover's speed at full duty, speed / sqrt(g r), with gravity g and wheel radius r: 0.14, from the
paper's 0.05 m/s at duty 0.55 with r = 45 mm. Default motors of other rovers get an equal Froude number."""
NEXUS6_MASS = 5.8
"""Mass of the paper's rover [kg], from section 2 of the paper."""
ROTOR_SHARE = 1e-3 / (NEXUS6_MASS / 6 * float(NEXUS6_WHEEL.r) ** 2)
"""Ratio of the inertia of a motor's rotor, referred to the wheel, to m r^2 / n, with the rover's mass m, wheel radius r
and number of wheels n. It is computed from the motor that is assumed for Nexus 6, and used for the default motors of
other rovers."""
SUPPLY, GEAR = 12.0, 100.0
"""Supply voltage [V] and gear ratio of a default motor (assumed). The stall torque and the no-load rate do not depend
on them; only the currents do."""


Kind = TypeVar("Kind")


class DefaultChoice(NamedTuple, Generic[Kind]):
    """The motor or the soil that was chosen for a rover, together with the assumptions behind the choice."""

    value: Kind
    assumed: tuple[str, ...] = ()
    """sentences that state the assumptions; empty if nothing was assumed, because the rover's TOML or the caller states
    the motor or soil"""


def scale(rover: Rover) -> float:
    """Return the size of a rover relative to Nexus 6: its largest wheel radius divided by the wheel radius of Nexus 6.
    Ready-made terrains are scaled by this ratio.
    """
    return float(rover.radii.max()) / float(NEXUS6_WHEEL.r)


def pace(rover: Rover, motor: Motor) -> float:
    """Return the ratio that scales the durations of ready-made drives for a rover: the time that it needs for a terrain
    of its size, relative to the time that Nexus 6 needs for the original terrain.

    The ratio is the size of the terrain divided by the rover's speed at full duty without load, divided by this
    quotient of Nexus 6. For wheels of the paper's size it is 1 with every motor, by definition.
    """
    if scale(rover) == 1.0:
        return 1.0
    return FROUDE * math.sqrt(EARTH / float(NEXUS6_WHEEL.r)) / float(motor.no_load_rate)


def has_papers_wheel(rover: Rover) -> bool:
    """Return whether all wheels of a rover have the radius and width of Nexus 6's wheels. Only for such wheels the
    fixed contact angles of Table 1 of the paper hold.
    """
    nexus6_size = (float(NEXUS6_WHEEL.r), float(NEXUS6_WHEEL.b))
    return all((float(mount.wheel.r), float(mount.wheel.b)) == nexus6_size for mount in rover.wheels)


def usual_angles(rover: Rover, name: str = "") -> FixedAngles | SinkageAngles:
    """Return the contact angles with this name, "fixed" or "sinkage". Without a name, return the usual angles of the
    rover: fixed angles for wheels of the paper's size, because the paper states them, and angles that follow the
    sinkage for all other wheels.

    Examples
    --------
    >>> from rover_pin.rover.rover import load_rover
    >>> type(usual_angles(load_rover("nexus6"))).__name__  # wheels of the paper's size
    'FixedAngles'
    >>> type(usual_angles(load_rover("cart"))).__name__
    'SinkageAngles'
    """
    return ANGLES.get(name) or ANGLES["fixed" if has_papers_wheel(rover) else "sinkage"]


def usual_slip(rover: Rover) -> RelaxedSlip:
    """Return the default law of slip. Its relaxation length, the distance over which the slip follows the speeds, is
    proportional to the wheel radius, because the length of the contact is.
    """
    relaxed, size = RelaxedSlip(), scale(rover)
    return relaxed if size == 1.0 else relaxed.replace(length=size * relaxed.length)


def own_motor(rover: Rover) -> DefaultChoice[Motor]:
    """Return the motor that the rover's TOML names or describes by a data sheet. If the TOML has no motor, return a
    default motor that is sized by the rover's weight.

    The default motor has the stall torque T_stall = m g r max(sin(25 deg), `scrub_share`) / (0.55 n) and the no-load
    rate omega_0 = FROUDE sqrt(g / r), for a rover of mass m with n wheels of radius r under gravity g.

    Raises ParameterError: the TOML names an unknown motor.
    """
    if isinstance(rover.motor, str):
        return DefaultChoice(motor_named(rover.motor))
    if rover.motor is not None:
        # The data sheet of the motor alone: k_t = V / omega_0, and the resistance that gives its stall torque.
        sheet = rover.motor
        k_t = float(sheet.voltage) / float(sheet.no_load_speed)
        stall = float(sheet.efficiency) * float(sheet.gear) * float(sheet.stall_torque)
        resistance = float(sheet.gear) * k_t * float(sheet.voltage) / stall
        return DefaultChoice(Motor(sheet.voltage, resistance, k_t, sheet.gear, sheet.rotor_inertia))
    # No motor is declared: size one by the rover's weight and wheels.
    n, r = len(rover.wheels), float(rover.radii.max())
    scrub = scrub_share(rover)
    share, rate = max(math.sin(HOLDING_SLOPE), scrub), FROUDE * math.sqrt(EARTH / r)
    stall = rover.mass * EARTH * r * share / CRUISE_DUTY / n
    # Supply voltage and gear are assumed; the torque constant and the resistance follow from rate and stall torque.
    constant = SUPPLY / rate
    inertia = ROTOR_SHARE * rover.mass / n * r**2
    motor = Motor(SUPPLY, constant * SUPPLY / stall, constant / GEAR, GEAR, inertia / GEAR**2)
    # The sentence names the condition that decided the stall torque: the slope, or the turn on the spot.
    holds = (
        f"hold {rover.mass:.3g} kg on a slope of {math.degrees(HOLDING_SLOPE):.0f} deg"
        if share > scrub
        else f"turn {rover.mass:.3g} kg on the spot by different speeds of the two sides, which drags wheels sideways"
    )
    return DefaultChoice(
        motor,
        (
            f"motor: none in the TOML's [motor], so every wheel gets a motor with the stall torque {stall:.3g} N m and "
            f"the no-load rate {rate:.3g} rad/s; at duty {CRUISE_DUTY:g} these motors {holds}, and at full duty they "
            f"drive the rover at {FROUDE:.2g} sqrt(g r)",
        ),
    )


def scrub_share(rover: Rover) -> float:
    """Return the ratio of thrust to load [-] that the wheels need to turn the rover on the spot by different speeds of
    its two sides (skid-steering).

    The ratio is 0 for a rover with steered wheels. A wheel that is dragged sideways resists with tan phi times its
    load, at the distance |x| from the middle of the axles; phi is the friction angle of the soil. The thrusts of the n
    wheels act with the lever arm B / 2, half the track B. The moments balance if the ratio is tan phi sum |x| / (n B /
    2).

    Source: moments about the middle under equal loads, as for tracks (Wong, Theory of Ground Vehicles, skid-steering);
    slope-sand gives phi, whatever the soil.
    """
    if any(wheel.steer_dof is not None for wheel in rover.wheels):
        return 0.0
    # Distances of the wheels from the middle of the axles, along x.
    x = np.array([place[0] for place in wheel_places(rover).values()])
    return float(math.tan(float(SLOPE_SAND.phi)) * np.mean(np.abs(x - np.mean(x))) / (0.5 * base_of(rover).track))


def driven_soil(rover: Rover, name: str = "") -> DefaultChoice[Soil]:
    """Return the soil for a simulated drive of a rover: the soil that the caller or the rover's TOML names, otherwise
    slope-sand with a shear displacement k that is scaled with the wheel radius (`own_soil`).

    On this default soil, all rovers of the package have similar slip on a slope. Fits of measured data start from the
    soil of Table 1 of the paper instead.
    """
    return own_soil(rover, name, SLOPE_SAND.replace(k=scale(rover) * SLOPE_SAND.k))


def own_soil(rover: Rover, name: str = "", default: Soil = TABLE_1) -> DefaultChoice[Soil]:
    """Return the soil with this name, otherwise the soil in the rover's TOML, otherwise the default soil, which is made
    firm enough to carry the rover.

    A named soil is converted to the width of the rover's wheels. The constant k_1 of the default soil follows from Eq
    (6) of the paper, the normal force: a wheel under an equal share of the weight sinks to the soil's entry angle
    theta_1 at the slip S = 0. Nexus 6 on the soil of Table 1 fulfils this condition.

    Parameters
    ----------
    rover : Rover
        The rover.
    name : str
        Name of a soil. If empty, the soil in the rover's TOML is used, or `default` if the TOML has none.
    default : Soil
        Soil that is assumed if neither `name` nor the TOML states a soil; only its k_1 is adapted.

    Raises
    ------
    ParameterError
        A name, field, unit or value is unknown or beyond its limits.
    """
    # A soil that the caller or the TOML names, with the constants that the TOML changes.
    constants = {key: value for key, value in rover.soil.items() if key != "name"}
    if name or rover.soil:
        named = soil_named(str(name or rover.soil.get("name", "table-1")))
        b = float(rover.wheels[0].wheel.b)
        soil = at_width(named, b, float(NEXUS6_WHEEL.b))
        if name or not constants:
            return DefaultChoice(soil)
        where = f"rover '{rover.name}': [soil]"
        # Bekker's constants of the TOML are converted to the wheel's width.
        constants = from_bekker(constants, b, where)
        declared_soil = record_from(type(named), constants, where)
        return DefaultChoice(soil.replace(**{key: getattr(declared_soil, key) for key in constants}))
    # Nothing is named: make the default soil firm enough for the wheel that needs it most. The normal force f_n at S =
    # 0 and theta_1 is linear in k_1, so two values of k_1 give the straight line f_n(k_1), which is solved for the
    # load.
    load, k_1 = rover.mass * EARTH / len(rover.wheels), 0.0
    for wheel in (mount.wheel for mount in rover.wheels):
        forces = [
            float(wheel_forces(0.0, default.theta_1, default.theta_2, wheel, default.replace(k_1=trial)).f_n)
            for trial in (1e4, 1e6)
        ]
        slope = (forces[1] - forces[0]) / (1e6 - 1e4)
        needed = 1e4 + (load - forces[0]) / slope
        if not 0.0 < needed < 1e9:
            raise ParameterError(
                "A default soil cannot be derived for this rover, because no soil constant k_1 below 1e9 Pa carries "
                f"{load:.3g} N on a wheel of r = {float(wheel.r):g} m and b = {float(wheel.b):g} m: name a soil, in "
                "[soil] of the rover's TOML or with --soil."
            )
        k_1 = max(k_1, needed)
    sand = f"{name_of(default)} with k = {1e3 * float(default.k):.3g} mm and k_1 = {k_1:.3g} Pa"
    return DefaultChoice(
        default.replace(k_1=k_1),
        (
            f"soil: none named, so {sand}, in which a wheel under {load:.3g} N sinks to the entry angle theta_1 = "
            f"{math.degrees(float(default.theta_1)):.0f} deg, as the wheels of Nexus 6 do",
        ),
    )
