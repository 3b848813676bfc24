"""The torque bounds of all wheels of a rover on a slope, and the slopes that the rover can climb.

The load of each wheel follows from the static balance of the rover. `torque_bounds.py` computes the bounds of one
wheel.
"""

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from rover_pin.base.errors import ParameterError
from rover_pin.contact import Soil
from rover_pin.control.torque_bounds import DEFAULT_LIMIT, BoundPulls, TorqueBounds, TractionLimit, pull_at_bounds
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.parameters.gravity import EARTH
from rover_pin.rover.rover import Rover
from rover_pin.rover.statics import wheel_loads
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.model.motor import Motor
from rover_pin.simulation.trace.record import model_attrs

MAX_SLOPE = math.radians(40.0)
"""Steepest slope, uphill and downhill, in the search for the slope that a rover can climb [rad]. If the rover climbs
this slope, the search returns this limit."""


@dataclass(frozen=True)
class RoverBounds:
    """The torque bounds of all wheels of a rover at rest on a slope, or on a steady climb.

    All arrays have one value for each wheel, in the order of `names`.
    """

    names: tuple[str, ...]
    """names of the wheels, in the order of all arrays"""
    load: np.ndarray
    """normal load W of each wheel [N]"""
    saturation: np.ndarray
    """T_sat of each wheel [N m], the torque at which the soil fails"""
    limit: np.ndarray
    """T_lim of each wheel [N m], the torque at the slip limit"""
    d_saturation: np.ndarray
    """derivative dT_sat / dW of each wheel [m], with the load W"""
    d_limit: np.ndarray
    """derivative dT_lim / dW of each wheel [m], with the load W"""
    pull_saturation: np.ndarray
    """pull of each wheel [N] if its torque is T_sat"""
    pull_limit: np.ndarray
    """pull of each wheel [N] if its torque is T_lim"""

    @property
    def first_to_slip(self) -> tuple[str, ...]:
        """Names of the wheels that slip first if equal motors run at equal duty and speed: the wheels with the smallest
        T_lim, the torque at the slip limit.
        """
        smallest = float(np.min(self.limit))
        return tuple(name for name, limit in zip(self.names, self.limit, strict=True) if limit <= smallest * (1 + 1e-6))

    def rows(self, motor: Motor | None = None) -> list[dict[str, Any]]:
        """Return the torque bounds as plain values for a file: one dict for each wheel, with the unit at the end of
        each key.

        If a motor is given, `margin_sat` and `margin_lim` are its stall torque divided by T_sat, the torque at which
        the soil fails, and by T_lim, the torque at the slip limit. If a margin is above 1, the motor can exceed this
        bound. `duty_lim` is the duty at which the motor of a wheel at rest has the torque T_lim.
        """
        table: list[dict[str, Any]] = [
            {
                "wheel": name,
                "load_N": float(self.load[i]),
                "T_sat_Nm": float(self.saturation[i]),
                "T_lim_Nm": float(self.limit[i]),
                "dT_sat_dW_m": float(self.d_saturation[i]),
                "dT_lim_dW_m": float(self.d_limit[i]),
                "pull_sat_N": float(self.pull_saturation[i]),
                "pull_lim_N": float(self.pull_limit[i]),
                "slips_first": name in self.first_to_slip,
            }
            for i, name in enumerate(self.names)
        ]
        # With a motor, the table also shows by which factor its stall torque exceeds each bound.
        if motor is not None:
            stall = float(motor.stall_torque)
            for row in table:
                # A lifted wheel has the bound 0, which any motor exceeds.
                row["margin_sat"], row["margin_lim"] = (
                    stall / row[key] if row[key] > 0.0 else math.inf for key in ("T_sat_Nm", "T_lim_Nm")
                )
                row["duty_lim"] = row["T_lim_Nm"] / stall
        return table


def rover_torque_bounds(
    rover: Rover,
    soil: Soil,
    slope: float = 0.0,
    side_slope: float = 0.0,
    gravity: float = EARTH,
    limit: TractionLimit = DEFAULT_LIMIT,
) -> RoverBounds:
    """Return the torque bounds of each wheel of a rover at rest on a slope, or on a steady climb.

    The loads of the wheels follow from the static balance of the rover (section 4 of the paper), and the bounds from
    `torque_bounds` for these loads.

    Parameters
    ----------
    rover : Rover
        The rover, whose masses and geometry determine the loads.
    soil : Soil
        Constants of the soil.
    slope, side_slope : float
        Inclination of the ground along and across the rover [rad]; positive angles raise the nose and the left side.
    gravity : float
        Gravity [m/s^2].
    limit : TractionLimit
        Slip limit, contact angles, and the definition of the traction factor, which affects the pulls and not the
        torques.

    Raises
    ------
    ParameterError
        A wheel lifts on this slope (the message names the wheel), the slip limit is outside (0, 1], or the soil is too
        soft for a load.

    Source: sections 4 and 5 of the paper. Differs from the paper: the paper gives no formula for the bound. The static
    balance assumes one common ratio of pull to normal force for all wheels. In a drive, the wheels share the pull
    unevenly and their loads differ from these static loads, so that a controller should keep a margin to the bound.

    Examples
    --------
    >>> from rover_pin import SOILS, scenario
    >>> bounds = rover_torque_bounds(scenario("flat").model.rover, SOILS["table-1"], slope=0.1)
    >>> bounds.load.shape == bounds.limit.shape == (len(bounds.names),)
    True
    """
    loads = wheel_loads(rover, slope, side_slope, gravity)
    # The static balance lets the ground pull at a wheel that would lift; the bounds of such a rover mean nothing.
    lifted = [mount.name for mount, load in zip(rover.wheels, loads, strict=True) if load < 0.0]
    if lifted:
        raise ParameterError(
            f"On a slope of {math.degrees(slope):g} deg (side slope {math.degrees(side_slope):g} deg), the rover "
            f"'{rover.name}' lifts these wheels: {', '.join(lifted)} (static load {float(np.min(loads)):.2f} N). "
            "Torque bounds need all wheels on the ground; choose a gentler slope."
        )
    # The bounds depend on the load and the size of each wheel, so they are computed wheel by wheel.
    wheels = [mount.wheel for mount in rover.wheels]
    bounds = TorqueBounds(wheels, soil, limit.slip, limit.angles)(loads)
    pulls = _pulls(rover, soil, loads, limit)
    return RoverBounds(
        names=tuple(mount.name for mount in rover.wheels),
        load=loads,
        pull_saturation=np.array([float(pull.saturation.force) for pull in pulls]),
        pull_limit=np.array([float(pull.limit.force) for pull in pulls]),
        **bounds._asdict(),
    )


def climbable_slope(
    rover: Rover, soil: Soil, limit: TractionLimit = DEFAULT_LIMIT, gravity: float = EARTH
) -> tuple[float, float]:
    """Return the two steepest slopes [rad] on which a rover holds its position: first with the soil fully sheared under
    all wheels, then with all wheels at the slip limit.

    Each slope solves sum_i f_t(W_i) = m g sin(slope). f_t is the pull of wheel i under its load W_i on this slope, with
    fully sheared soil or at the slip limit, and m g is the weight of the rover. On a slope steeper than the first
    result, the soil fails under all wheels. On a slope steeper than the second result, at least one wheel slips more
    than the limit. A result is negative if the pulls are too small even on level ground. The search is limited to
    slopes from -40 to 40 deg.

    For parameters and errors, see `rover_torque_bounds`.

    Examples
    --------
    >>> from rover_pin import SOILS
    >>> from rover_pin.rover.rover import load_rover
    >>> np.degrees(climbable_slope(load_rover("nexus6"), SOILS["table-1"])).round().tolist()
    [20.0, -7.0]
    """
    full, slipping = (_root(_spare_pull(which, rover, soil, limit, gravity)) for which in (0, 1))
    return full, slipping


def driven_slope(
    rover: Rover,
    soil: Soil,
    limit: TractionLimit = DEFAULT_LIMIT,
    gravity: float = EARTH,
    R: float = 0.0,
    motor: Motor | None = None,
) -> float:
    """Return the slope [rad] that a rover climbs steadily with all wheels at the slip limit.

    With a slip limit of 1, the result is an upper limit: the rover stands still on this slope, and creeps on slopes
    that are a few degrees gentler. The slope solves

        sum_i min(f_t(W_i), T_stall / r_i) = m g sin(slope) + R sum_i W_i,

    where f_t is the pull of wheel i under its load W_i, T_stall the stall torque of its motor, r_i its radius, and m g
    the weight of the rover. The pull must thus also overcome the motion resistance R W_i, and no wheel pulls more than
    the stall torque of its motor allows. The result is smaller than the first result of `climbable_slope`: sand with a
    large ratio k / r of shear displacement modulus to wheel radius is not fully sheared even at a slip of 1. Other
    effects, steps and edges of the ground are not included.

    Parameters
    ----------
    rover, soil, limit, gravity
        See `rover_torque_bounds`.
    R : float
        Motion resistance divided by the load [-].
    motor : Motor, optional
        Motor of each wheel. If no motor is given, the torque of the motors is not limited.
    """
    # At the steepest slope, the pull of the rover just equals the pull that it needs.
    max_pull = np.inf if motor is None else float(motor.stall_torque) / rover.radii
    return _root(_spare_pull(1, rover, soil, limit, gravity, R, max_pull))


def _spare_pull(
    which: int,
    rover: Rover,
    soil: Soil,
    limit: TractionLimit,
    gravity: float,
    R: float = 0.0,
    max_pull: ArrayLike = np.inf,
) -> Callable[[float], float]:
    """Return a function slope [rad] -> spare pull [N]: the pull of the rover minus the pull that it needs to climb this
    slope.

    If `which` is 0, the pull of the rover is its pull on fully sheared soil; if `which` is 1, it is the pull at the
    slip limit. R is the motion resistance divided by the load, and `max_pull` the largest pull that the motor of each
    wheel allows [N].
    """

    def spare_at(slope: float) -> float:
        # Beyond the slope on which a wheel lifts, statics gives a negative load; such a wheel pulls nothing.
        loads = np.maximum(wheel_loads(rover, slope, gravity=gravity), 0.0)
        pulls = np.array([float(pulls[which].force) for pulls in _pulls(rover, soil, loads, limit)])
        return float(np.sum(np.minimum(pulls, max_pull) - R * loads) - rover.mass * gravity * math.sin(slope))

    return spare_at


def _root(spare: Callable[[float], float]) -> float:
    """Return the slope [rad] at which the function `spare` is 0, or the end of the search, plus or minus MAX_SLOPE, if
    its sign does not change.
    """
    # The spare pull falls with the slope, because the rover's weight pulls it down more strongly.
    if spare(MAX_SLOPE) >= 0.0:
        return MAX_SLOPE
    if spare(-MAX_SLOPE) <= 0.0:
        return -MAX_SLOPE
    return float(brentq(spare, -MAX_SLOPE, MAX_SLOPE, xtol=1e-9))


def bounds_report(
    rover: Rover,
    soil: Soil,
    slope: float = 0.0,
    gravity: float = EARTH,
    limit: TractionLimit = DEFAULT_LIMIT,
    motor: Motor | None = None,
    R: float = 0.0,
) -> dict[str, Any]:
    """Return a rover's torque bounds on a slope, and the limits of the slope, as plain values for a JSON file.

    The dict has the settings, the slopes on which the pull at a slip of 1 and at the slip limit balances weight and
    motion resistance (`driven_slope`), and under the key `wheels` the rows of `RoverBounds.rows`. For parameters and
    errors, see `rover_torque_bounds` and `driven_slope`.
    """
    bounds = rover_torque_bounds(rover, soil, slope, gravity=gravity, limit=limit)
    # At S = 1, the pull is the largest that the soil gives in driving.
    steepest, at_slip_limit = (
        driven_slope(rover, soil, dataclasses.replace(limit, slip=slip), gravity, R, motor)
        for slip in (1.0, limit.slip)
    )
    return {
        "rover": rover.name,
        "slope_deg": math.degrees(slope),
        "gravity_mps2": gravity,
        "slip_limit": limit.slip,
        "form": limit.form.name,
        "first_to_slip": list(bounds.first_to_slip),
        "motion_resistance_R": R,
        "climbable_deg": math.degrees(steepest),
        "climbable_at_slip_limit_deg": math.degrees(at_slip_limit),
        "wheels": bounds.rows(motor),
    }


def bounds_of_model(model: Model, slip: float, slope: float = 0.0) -> tuple[RoverBounds, dict[str, Any]]:
    """Return the torque bounds of a model's rover on a slope [rad], first as a record, then as the plain values of
    `bounds_report`.

    The bounds are for the slip limit `slip` on the first soil of the model. The contact angles, the traction factor,
    the motor and the motion resistance are taken from the model.
    """
    # The settings of the bounds follow the model, so that they agree with its simulated drives.
    traction, soil = model.effect(SoilTraction), model.soils[0]
    limit = TractionLimit(slip, traction.form, traction.angles)
    R = model_attrs(model)["motion_resistance_R"]
    plain = bounds_report(model.rover, soil, slope, model.gravity, limit, model.motor, R)
    return rover_torque_bounds(model.rover, soil, slope, gravity=model.gravity, limit=limit), plain


def bounds_table(bounds: RoverBounds, motor: Motor | None = None) -> str:
    """Return the torque bounds of a rover as a text table with one line for each wheel and torques in mN m.

    If a motor is given, the table has three more columns: the stall torque divided by each of the two bounds, and the
    duty at which the motor has the torque T_lim, the torque at the slip limit.

    Examples
    --------
    >>> from rover_pin import SOILS
    >>> from rover_pin.rover.rover import load_rover
    >>> table = bounds_table(rover_torque_bounds(load_rover("cart"), SOILS["table-1"]))
    >>> table.splitlines()[0].split()
    ['wheel', 'W/N', 'T_lim/mNm', 'T_sat/mNm', 'pull_lim/N', 'pull_sat/N']
    """
    head = f"{'wheel':>5} {'W/N':>7} {'T_lim/mNm':>10} {'T_sat/mNm':>10} {'pull_lim/N':>11} {'pull_sat/N':>11}"
    tail = f" {'stall/T_lim':>12} {'stall/T_sat':>12} {'duty at T_lim':>14}" if motor else ""
    lines = [head + tail]
    # Torques are printed in mN m, because the bounds of small wheels are far below 1 N m.
    for row in bounds.rows(motor):
        line = (
            f"{row['wheel']:>5} {row['load_N']:7.2f} {1e3 * row['T_lim_Nm']:10.1f} {1e3 * row['T_sat_Nm']:10.1f} "
            f"{row['pull_lim_N']:11.2f} {row['pull_sat_N']:11.2f}"
        )
        if motor:
            line += f" {row['margin_lim']:12.2f} {row['margin_sat']:12.2f} {row['duty_lim']:14.3f}"
        lines.append(line + ("  slips first" if row["slips_first"] else ""))
    return "\n".join(lines)


def _pulls(rover: Rover, soil: Soil, loads: np.ndarray, limit: TractionLimit) -> list[BoundPulls]:
    """Return the pull of each wheel of a rover at each of its two torque bounds, for the loads `loads` [N]."""
    return [
        pull_at_bounds(float(load), soil, mount.wheel, limit) for load, mount in zip(loads, rover.wheels, strict=True)
    ]
