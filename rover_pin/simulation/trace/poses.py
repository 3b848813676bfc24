"""Poses of the rover's wheels and links at the rows of a trace, for figures and views."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rover_pin.rover.rover import Rover, WheelMount
from rover_pin.rover.wheel_base import wheel_places
from rover_pin.simulation.trace.trace import Trace
from rover_pin.terrain.terrain import Terrain


class PathExtent(NamedTuple):
    """Two numbers on the path of a drive: the rover's total turn, and its distance sideways. Figures use these numbers
    to decide whether to show the drive from the side or from above.
    """

    turn: float
    """difference between the largest and the smallest heading [rad]"""
    across: float
    """width of the path across the initial heading [m]"""

    @classmethod
    def of(cls, trace: Trace) -> PathExtent:
        """Return the extent of a trace's path. A trace without a heading counts as a straight drive."""
        x, y, yaw = (np.nan_to_num(trace.get(f"body_{name}", np.zeros(trace.t.size))) for name in ("x", "y", "yaw"))
        return cls(float(np.ptp(yaw)), float(np.ptp(np.cos(yaw[0]) * y - np.sin(yaw[0]) * x)))

    @property
    def from_above(self) -> bool:
        """Whether a figure needs a view from above, because the rover turns by more than 10 deg, or moves more than 5
        cm across its initial heading.
        """
        return not self.from_the_side or self.turn > math.radians(10.0) or self.across > 0.05

    @property
    def from_the_side(self) -> bool:
        """Whether a view from the side shows the drive well, because the rover turns by less than 60 deg."""
        return self.turn < math.radians(60.0)


def configuration(rover: Rover, trace: Trace, row: int, turned: np.ndarray | None = None) -> np.ndarray:
    """Return the configuration q (nq,) of a rover at one row of a trace, for drawing.

    A joint whose angle is not in the trace gets the angle zero. A joint that is coupled to another joint gets the angle
    that follows from the coupling.

    Parameters
    ----------
    rover : Rover
        The rover.
    trace : Trace
        A simulated or measured drive.
    row : int
        The row.
    turned : array (wheels,), optional
        Angle of each wheel [rad] (`wheel_angles`); if missing, all angles are 0.
    """
    q = pin.neutral(rover.model)
    q[:3] = [_number(trace, f"body_{axis}", row) for axis in "xyz"]
    roll, pitch, yaw = (_number(trace, f"body_{name}", row) for name in ("roll", "pitch", "yaw"))
    q[3:7] = pin.Quaternion(pin.rpy.rpyToMatrix(roll, pitch, yaw)).coeffs()
    for name, index in rover.angles.items():
        q[index] = _number(trace, name, row)
    # A coupled joint follows its leader, unless it is a wheel, whose angle comes with `turned`.
    spinning = {rover.model.joints[mount.joint].idx_q for mount in rover.wheels}
    for coupling in rover.couplings:
        if coupling.q_follower not in spinning:
            q[coupling.q_follower] = coupling.ratio * q[coupling.q_leader]
    for mount, angle in zip(rover.wheels, turned if turned is not None else (), strict=False):
        joint = rover.model.joints[mount.joint]
        place = slice(joint.idx_q, joint.idx_q + joint.nq)
        q[place] = (math.cos(angle), math.sin(angle)) if joint.nq == 2 else angle
    return q


def wheel_angles(trace: Trace, wheels: tuple[str, ...]) -> np.ndarray:
    """Return the rotation of each wheel since the first row (T, wheels) [rad]; 0 for a wheel whose rate was not
    recorded.
    """
    # A gap in the rates counts as standing still.
    dt = np.diff(trace.t, prepend=trace.t[:1])
    rates = [np.nan_to_num(trace.get(f"wheel_rate_{name}", np.zeros(dt.size))) for name in wheels]
    return np.cumsum(np.column_stack(rates) * dt[:, None], axis=0)


def place_links(rover: Rover, data: pin.Data, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compute the poses of all links of a rover at the configuration q, and return the centres and axles of its wheels.

    The poses are stored in Pinocchio's `data`. Centres and axles are arrays (wheels, 3): positions in the world [m],
    and unit vectors along the axles that point to the left.
    """
    pin.computeJointJacobians(rover.model, data, q)
    centres = np.array([data.oMi[mount.joint].translation for mount in rover.wheels])
    axles = np.array([data.J[3:, mount.dof] for mount in rover.wheels])
    return centres, np.asarray(axles / np.linalg.norm(axles, axis=1, keepdims=True))


def of_side(rover: Rover, side: str) -> list[int]:
    """Return the indices of the wheels on one side of a rover; `side` is "l" (left) or "r" (right)."""
    return [n for n, wheel in enumerate(rover.wheels) if wheel.side == side]


def around(rover: Rover) -> list[int]:
    """Return the indices of the wheels in their order around the rover: the left side, then the right side in reverse
    order. Lines through the wheels in this order draw the outline of a rover seen from above.
    """
    return of_side(rover, "l") + of_side(rover, "r")[::-1]


def footprint(mount: WheelMount, centre: np.ndarray, axle: np.ndarray) -> np.ndarray:
    """Return the four corners x, y (4, 2) [m] of the rectangle that a wheel covers if it is seen from above.

    Parameters
    ----------
    mount : WheelMount
        The wheel, with its radius and width.
    centre, axle : arrays (3,)
        Centre of the wheel [m] and unit vector along its axle, in the world.
    """
    # Horizontal unit vectors to the left and ahead of the wheel; a steeply tilted axle must not divide by zero.
    left = axle[:2] / max(float(np.linalg.norm(axle[:2])), 1e-9)
    ahead = np.array([left[1], -left[0]])
    along, across = float(mount.wheel.r) * ahead, 0.5 * float(mount.wheel.b) * left
    return centre[:2] + np.array([along + across, along - across, -along - across, -along + across])


def on_the_ground(trace: Trace, rover: Rover, terrain: Terrain) -> Trace:
    """Return the trace with estimates of height, roll and pitch of the base, if these were not recorded.

    At each row, the rover is set on the plane that fits the ground under its wheels' centres best (least squares).
    """
    missing = [
        name
        for name in ("body_z", "body_roll", "body_pitch")
        if name not in trace or not np.any(np.isfinite(trace[name]))
    ]
    if not missing:
        return trace
    # NaN would make the least-squares fit fail, so that a row without a position is treated as if it were at the
    # origin.
    x, y = (np.nan_to_num(trace[f"body_{axis}"]) for axis in "xy")
    yaw = np.nan_to_num(trace.get("body_yaw", np.zeros(x.size)))
    places = np.array(list(wheel_places(rover).values()))
    radii = np.array([float(wheel.wheel.r) for wheel in rover.wheels])
    terms, poses = np.column_stack([np.ones(len(places)), places[:, :2]]), []
    for x_0, y_0, heading in zip(x, y, yaw, strict=True):
        cos, sin = math.cos(heading), math.sin(heading)
        # Compute the height of the base above the ground under each wheel, and fit a plane to these heights.
        wheel_x, wheel_y = x_0 + cos * places[:, 0] - sin * places[:, 1], y_0 + sin * places[:, 0] + cos * places[:, 1]
        lift = terrain.height(wheel_x, wheel_y) + radii - places[:, 2]
        (z, rise_x, rise_y), *_ = np.linalg.lstsq(terms, lift, rcond=None)
        # A plane that rises towards +y rolls the rover to the right; one that rises towards +x lifts the nose.
        poses.append((float(z), math.atan(rise_y), -math.atan(rise_x)))
    estimated = dict(zip(("body_z", "body_roll", "body_pitch"), np.array(poses).T, strict=True))
    return Trace(
        {**trace.channels, **{name: estimated[name] for name in missing}}, dict(trace.units), dict(trace.attrs)
    )


def _number(trace: Trace, name: str, row: int) -> float:
    """Return the value of a channel at a row; 0 if the channel was not recorded, or if it has a gap at this row."""
    value = float(trace[name][row]) if name in trace else 0.0
    return value if math.isfinite(value) else 0.0
