"""The torque bounds of a whole rover on a slope: each wheel's own load, load transfer included."""

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
from rover_pin.control.bound_pull import DEFAULT_LIMIT, BoundPulls, TractionLimit, pull_at_bounds
from rover_pin.control.torque_bounds import TorqueBounds
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.parameters.gravity import EARTH
from rover_pin.rover.rover import Rover
from rover_pin.rover.statics import wheel_loads
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.model.motor import Motor
from rover_pin.simulation.trace.record import model_attrs

STEEPEST = math.radians(40.0)
"""Slopes up and down between which `climbable_slope` searches."""


@dataclass(frozen=True)
class RoverBounds:
    """The bounds of each wheel of a standing or steadily climbing rover; arrays [n] in the order of `names`."""

    names: tuple[str, ...]
    load: np.ndarray
    "W [N]"
    saturation: np.ndarray
    "T_sat [N m]"
    limit: np.ndarray
    "T_lim [N m]"
    d_saturation: np.ndarray
    "dT_sat / dW [m]"
    d_limit: np.ndarray
    "dT_lim / dW [m]"
    pull_saturation: np.ndarray
    "f_t at T_sat [N]"
    pull_limit: np.ndarray
    "f_t at T_lim [N]"

    @property
    def first_to_slip(self) -> tuple[str, ...]:
        """The wheels with the smallest T_lim: where equal motors at equal duty turn at one speed, these slip first."""
        least = float(np.min(self.limit))
        return tuple(name for name, limit in zip(self.names, self.limit, strict=True) if limit <= least * (1 + 1e-6))

    def rows(self, motor: Motor | None = None) -> list[dict[str, Any]]:
        """Return one dict a wheel, SI units in the keys; with a motor, how its stall torque compares.

        `margin_*` = stall torque / bound: above 1 the motor can exceed the bound. `duty_limit` is the duty at which a
        standing wheel's motor gives T_lim.
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
        if motor is not None:
            stall = float(motor.stall_torque)
            for row in table:
                row["margin_sat"], row["margin_lim"] = (_ratio(stall, row[key]) for key in ("T_sat_Nm", "T_lim_Nm"))
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
    """Return the torque bounds of each wheel of a rover that stands on a slope or climbs it steadily.

    The loads are those of the rover's static balance, section 4; the bounds those of `torque_bounds`.

    Parameters
    ----------
    slope, side_slope : float
        Inclination nose up and left side up [rad].
    gravity : float
        m/s^2.
    limit : TractionLimit
        Slip limit, form of the traction factor (it decides the pulls, not the torques) and arc.

    Raises
    ------
    ParameterError
        A slope on which a wheel lifts (it says which), a slip limit outside (0, 1], a soil too soft for a load.

    Source: sections 4 and 5. Differs from the paper: it gives no formula for the bound. Statics has every wheel pull
    with one f_t / f_n; driven up 19 deg the middle wheels carry 5 % less: keep 10 % of a bound in hand.
    """
    loads = wheel_loads(rover, slope, side_slope, gravity)
    _refuse_lifted(rover, loads, slope, side_slope)
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
    """Return the slopes [rad] that the rover holds with all wheels at full shear, and with all at the slip limit.

    sum_i f_t(W_i) = m g sin(slope), the loads following the slope: beyond the second one some wheel slips more than the
    limit, beyond the first one the soil yields under all wheels. Negative where even the flat asks for more; held
    within +-40 deg.
    """
    full, slipping = (_root(_spare(which, rover, soil, limit, gravity)) for which in (0, 1))
    return full, slipping


def driven_slope(
    rover: Rover,
    soil: Soil,
    limit: TractionLimit = DEFAULT_LIMIT,
    gravity: float = EARTH,
    R: float = 0.0,
    motor: Motor | None = None,
) -> float:
    """Return the slope [rad] that a drive climbs with all wheels at the slip limit; at a limit of 1, at most.

    sum_i min(f_t(W_i), T_stall / r_i) = m g sin(slope) + R sum_i W_i: what a motion resistance R takes is paid, and no
    wheel pulls more than its motor's stall torque at full duty. Full shear (`climbable_slope`) lies beyond: at S = 1
    sand of large k / r is not sheared that far. Effects, steps and edges of the ground are left out.
    """
    most = np.inf if motor is None else float(motor.stall_torque) / rover.radii
    return _root(_spare(1, rover, soil, limit, gravity, R, most))


def _spare(
    which: int, rover: Rover, soil: Soil, limit: TractionLimit, gravity: float, R: float = 0.0, most: ArrayLike = np.inf
) -> Callable[[float], float]:
    """Return the pull that is left on a slope [N], at full shear (0) or at the slip limit (1)."""

    def at(slope: float) -> float:
        loads = np.maximum(wheel_loads(rover, slope, gravity=gravity), 0.0)
        pulls = np.array([float(pulls[which].force) for pulls in _pulls(rover, soil, loads, limit)])
        return float(np.sum(np.minimum(pulls, most) - R * loads) - rover.mass * gravity * math.sin(slope))

    return at


def _root(spare: Callable[[float], float]) -> float:
    if spare(STEEPEST) >= 0.0:
        return STEEPEST
    if spare(-STEEPEST) <= 0.0:
        return -STEEPEST
    return float(brentq(spare, -STEEPEST, STEEPEST, xtol=1e-9))


def bounds_report(
    rover: Rover,
    soil: Soil,
    slope: float = 0.0,
    gravity: float = EARTH,
    limit: TractionLimit = DEFAULT_LIMIT,
    motor: Motor | None = None,
    R: float = 0.0,
) -> dict[str, Any]:
    """Return all that is known of a rover's bounds as plain values: the slopes that it climbs, and one dict a wheel.

    Parameters and errors are those of `rover_torque_bounds`, `motor` that of `RoverBounds.rows`; the slopes are those
    of `driven_slope`, at S = 1 and at the slip limit.
    """
    bounds = rover_torque_bounds(rover, soil, slope, gravity=gravity, limit=limit)
    most, slipping = (
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
        "climbable_deg": math.degrees(most),
        "climbable_at_slip_limit_deg": math.degrees(slipping),
        "wheels": bounds.rows(motor),
    }


def bounds_of_model(model: Model, slip: float, slope: float = 0.0) -> tuple[RoverBounds, dict[str, Any]]:
    """Return the bounds of a model's rover on its first soil, with its traction law and motion resistance."""
    traction, soil = model.effect(SoilTraction), model.soils[0]
    limit = TractionLimit(slip, traction.form, traction.angles)
    R = model_attrs(model)["motion_resistance_R"]
    plain = bounds_report(model.rover, soil, slope, model.gravity, limit, model.motor, R)
    return rover_torque_bounds(model.rover, soil, slope, gravity=model.gravity, limit=limit), plain


def bounds_table(bounds: RoverBounds, motor: Motor | None = None) -> str:
    """Return the bounds as lines to print, one a wheel, torques in mN m."""
    head = f"{'wheel':>5} {'W/N':>7} {'T_lim/mNm':>10} {'T_sat/mNm':>10} {'pull_lim/N':>11} {'pull_sat/N':>11}"
    tail = f" {'stall/T_lim':>12} {'stall/T_sat':>12} {'duty at T_lim':>14}" if motor else ""
    lines = [head + tail]
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
    return [
        pull_at_bounds(float(load), soil, mount.wheel, limit) for load, mount in zip(loads, rover.wheels, strict=True)
    ]


def _refuse_lifted(rover: Rover, loads: np.ndarray, slope: float, side_slope: float) -> None:
    lifted = [mount.name for mount, load in zip(rover.wheels, loads, strict=True) if load < 0.0]
    if lifted:
        raise ParameterError(
            f"On a slope of {math.degrees(slope):g} deg (side slope {math.degrees(side_slope):g} deg) rover "
            f"'{rover.name}' lifts {', '.join(lifted)} (load {float(np.min(loads)):.2f} N): not all wheels stand; "
            "choose a gentler slope."
        )


def _ratio(stall: float, bound: float) -> float:
    return stall / bound if bound > 0.0 else math.inf
