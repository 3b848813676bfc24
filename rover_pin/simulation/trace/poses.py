"""Where every link of the rover is at a row of a trace: what figures and views draw."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rover_pin.rover.rover import Rover, WheelMount
from rover_pin.rover.wheel_base import wheel_places
from rover_pin.simulation.trace.trace import Trace
from rover_pin.terrain.terrain import Terrain


class Turned(NamedTuple):
    """How far a drive turns [rad], and goes across its first heading [m]: what says from where it is to be seen."""

    turn: float
    across: float

    @classmethod
    def of(cls, trace: Trace) -> Turned:
        """Return what a trace turned; one without heading went straight on."""
        x, y, yaw = (np.nan_to_num(trace.get(f"body_{name}", np.zeros(trace.t.size))) for name in ("x", "y", "yaw"))
        return cls(float(np.ptp(yaw)), float(np.ptp(np.cos(yaw[0]) * y - np.sin(yaw[0]) * x)))

    @property
    def from_above(self) -> bool:
        """Whether it turns by more than 10 deg or goes 5 cm across, so that the view from above says something."""
        return not self.side_tells or self.turn > math.radians(10.0) or self.across > 0.05

    @property
    def side_tells(self) -> bool:
        """Whether it turns by less than 60 deg: beyond, the view from the side says nothing any more."""
        return self.turn < math.radians(60.0)


def configuration(rover: Rover, trace: Trace, row: int, turned: np.ndarray | None = None) -> np.ndarray:
    """Return the configuration q of a row of the trace; a joint that was not recorded is at zero, or at its leader's.

    Parameters
    ----------
    turned : array (wheels,), optional
        Angle of each wheel [rad] (see `wheel_angles`); 0 without.
    """
    q = pin.neutral(rover.model)
    q[:3] = [_at(trace, f"body_{axis}", row) for axis in "xyz"]
    roll, pitch, yaw = (_at(trace, f"body_{name}", row) for name in ("roll", "pitch", "yaw"))
    q[3:7] = pin.Quaternion(pin.rpy.rpyToMatrix(roll, pitch, yaw)).coeffs()
    for name, index in rover.angles.items():
        q[index] = _at(trace, name, row)
    spinning = {rover.model.joints[mount.joint].idx_q for mount in rover.wheels}
    for coupling in rover.couplings:
        if coupling.q_follower not in spinning:
            q[coupling.q_follower] = coupling.ratio * q[coupling.q_leader]
    for mount, angle in zip(rover.wheels, turned if turned is not None else (), strict=False):
        joint = rover.model.joints[mount.joint]
        at = slice(joint.idx_q, joint.idx_q + joint.nq)
        q[at] = (math.cos(angle), math.sin(angle)) if joint.nq == 2 else angle
    return q


def wheel_angles(trace: Trace, wheels: tuple[str, ...]) -> np.ndarray:
    """Return how far each wheel has turned since the first row [rad] (T, wheels); 0 where no rate is known."""
    dt = np.diff(trace.t, prepend=trace.t[:1])
    rates = [np.nan_to_num(trace.get(f"wheel_rate_{name}", np.zeros(dt.size))) for name in wheels]
    return np.cumsum(np.column_stack(rates) * dt[:, None], axis=0)


def place_links(rover: Rover, data: pin.Data, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Set the places of all joints in `data`; return the wheels' centres, and axles to the left, each (wheels, 3)."""
    pin.computeJointJacobians(rover.model, data, q)
    centres = np.array([data.oMi[mount.joint].translation for mount in rover.wheels])
    axles = np.array([data.J[3:, mount.dof] for mount in rover.wheels])
    return centres, np.asarray(axles / np.linalg.norm(axles, axis=1, keepdims=True))


def of_side(rover: Rover, side: str) -> list[int]:
    """Return the wheels of a side."""
    return [n for n, wheel in enumerate(rover.wheels) if wheel.side == side]


def around(rover: Rover) -> list[int]:
    """Return the wheels in order around the rover."""
    return of_side(rover, "l") + of_side(rover, "r")[::-1]


def footprint(mount: WheelMount, centre: np.ndarray, axle: np.ndarray) -> np.ndarray:
    """Return the corners (4, 2) of a wheel seen from above [m]."""
    left = axle[:2] / max(float(np.linalg.norm(axle[:2])), 1e-9)
    ahead = np.array([left[1], -left[0]])
    along, across = float(mount.wheel.r) * ahead, 0.5 * float(mount.wheel.b) * left
    return centre[:2] + np.array([along + across, along - across, -along - across, -along + across])


def on_the_ground(trace: Trace, rover: Rover, terrain: Terrain) -> Trace:
    """Return the trace with the height and attitude that were not recorded: those of a rover that stands on its wheels.

    The plane through the ground under the wheels' centres, by least squares, is what the rover stands on.
    """
    missing = [name for name in ("body_z", "body_roll", "body_pitch") if not _is_recorded(trace, name)]
    if not missing:
        return trace
    x, y = (np.nan_to_num(trace[f"body_{axis}"]) for axis in "xy")
    yaw = np.nan_to_num(trace.get("body_yaw", np.zeros(x.size)))
    places = np.array(list(wheel_places(rover).values()))
    radii = np.array([float(wheel.wheel.r) for wheel in rover.wheels])
    stood = [_standing_pose(terrain, places, radii, *pose) for pose in zip(x, y, yaw, strict=True)]
    estimated = dict(zip(("body_z", "body_roll", "body_pitch"), np.array(stood).T, strict=True))
    return Trace(
        {**trace.channels, **{name: estimated[name] for name in missing}}, dict(trace.units), dict(trace.attrs)
    )


def _standing_pose(
    terrain: Terrain, places: np.ndarray, radii: np.ndarray, x: float, y: float, yaw: float
) -> tuple[float, float, float]:
    """Return z [m], roll and pitch [rad] of the base at x, y and yaw."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    ground = terrain.height(x + cos * places[:, 0] - sin * places[:, 1], y + sin * places[:, 0] + cos * places[:, 1])
    lift = ground + radii - places[:, 2]
    (z, rise_x, rise_y), *_ = np.linalg.lstsq(np.column_stack([np.ones(len(places)), places[:, :2]]), lift, rcond=None)
    return float(z), math.atan(rise_y), -math.atan(rise_x)


def _is_recorded(trace: Trace, name: str) -> bool:
    return name in trace and bool(np.any(np.isfinite(trace[name])))


def _at(trace: Trace, name: str, row: int) -> float:
    value = float(trace[name][row]) if name in trace else 0.0
    return value if math.isfinite(value) else 0.0
