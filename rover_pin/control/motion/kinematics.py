"""How fast wheels roll, and where they point, for a motion of the body: floats or expressions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from rover_pin.base.errors import ParameterError
from rover_pin.contact import Scalar
from rover_pin.rover.rover import Rover
from rover_pin.rover.wheel_base import base_of, wheel_places


class BodyMotion(NamedTuple):
    """Of the point between the wheels, on the line on which turning centres lie."""

    speed: Scalar
    "forwards [m/s]"
    yaw_rate: Scalar
    "to the left [rad/s]"
    aside: Scalar = 0.0
    "speed to the left [m/s]"


class Rolling(NamedTuple):
    """What the wheels do for a motion."""

    speeds: list[Any]
    "of their rims [m/s]"
    angles: list[Any]
    "of those that steer [rad]"


def steers(rover: Rover) -> tuple[bool, ...]:
    """Return whether each wheel steers."""
    return tuple(wheel.steer_dof is not None for wheel in rover.wheels)


def turning_places(rover: Rover, track: float = 0.0) -> np.ndarray:
    """Return x of each wheel ahead of the line on which turning centres lie, and y, (wheels, 2) [m].

    The line is level with the mean of the wheels that do not steer, or of all. Where none steers, x is 0 and y the mean
    of the wheel's side, or what an effective `track` [m] makes of it: a turn by the sides' speeds.
    """
    places = wheel_places(rover)
    if not any(steers(rover)):
        lateral = {side: np.mean([places[w.name][1] for w in rover.wheels if w.side == side]) for side in "lr"}
        middle, scale = sum(lateral.values()) / 2, track / (lateral["l"] - lateral["r"]) if track else 1.0
        return np.array([(0.0, middle + scale * (lateral[wheel.side] - middle)) for wheel in rover.wheels])
    fixed = [places[wheel.name][0] for wheel in rover.wheels if wheel.steer_dof is None]
    level = float(np.mean(fixed or [place[0] for place in places.values()]))
    return np.array([(places[wheel.name][0] - level, places[wheel.name][1]) for wheel in rover.wheels])


def effective_track(rover: Rover, resistance: float = 0.0) -> float:
    """Return the track B' [m] of wheels that do not slip and turn as fast as those of a rover without steering do.

    Wheels at x from the middle of the axles slide sideways by Omega x and along by Omega s, the sides against each
    other. Equal loads, one friction mu against the slide, whatever its direction, and a motion resistance R against
    the rolling leave no moment where, `resistance` = R / mu,

        sum ((s B / 2 - x^2) / |(s, x)| - R B / (2 mu)) = 0,  B' = B + 2 s;  of two axles L apart, R = 0: B + L^2 / B.

    Source: quasi-static balance, as for skid-steered vehicles on firm ground. A slow build-up of shear takes more.

    Raises
    ------
    ParameterError
        R is mu or more: such a rover does not turn.
    """
    from scipy.optimize import brentq  # a steered rover has no use for it

    if not 0.0 <= resistance < 1.0:
        raise ParameterError(
            f"{rover.name} has no wheel that steers, and its motion resistance is {resistance:.3g} of what the soil "
            "holds: it does not turn by its sides' speeds; lower R, or give control.track."
        )
    length = np.array([place[0] for place in wheel_places(rover).values()])
    x, track = np.abs(length - np.mean(length)), base_of(rover).track

    def moment(s: float) -> float:
        return float(np.sum((0.5 * s * track - x**2) / np.maximum(np.hypot(s, x), 1e-12) - 0.5 * resistance * track))

    most = float(np.max(2.0 * x**2 / track + resistance * x)) / (1.0 - resistance)
    return track + (2.0 * float(brentq(moment, 0.0, most)) if most > 0.0 else 0.0)


def rolling(places: Sequence[Any], steering: Sequence[bool], motion: BodyMotion) -> Rolling:
    """Return what wheels at x, y roll like: v = (speed - yaw_rate y, aside + yaw_rate x).

    One that steers points along v, at most 90 deg from straight ahead, and runs backwards where v does: |v| and
    atan2(v_y, v_x). One that does not rolls at v_x and is dragged sideways.
    """
    speeds, angles = [], []
    for (x, y), steered in zip(places, steering, strict=True):
        along, across = motion.speed - motion.yaw_rate * y, motion.aside + motion.yaw_rate * x
        sense = 2.0 * (along >= 0.0) - 1.0
        speeds.append(sense * ca.hypot(along, across) if steered else along)
        if steered:
            angles.append(ca.atan2(sense * across, sense * along))
    return Rolling(speeds, angles)
