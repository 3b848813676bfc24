"""A drive as it is shown: where every link is at each frame, the wheels' slip, forces and tracks."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin

from rover_pin.base.errors import DataError
from rover_pin.rover.rover import Rover
from rover_pin.simulation.trace.poses import configuration, on_the_ground, place_links, wheel_angles
from rover_pin.simulation.trace.trace import Trace
from rover_pin.terrain.terrain import Extent, Terrain

FRAMES_PER_SECOND = 20.0
MOST_FRAMES = 600
AROUND = 0.4
"""Ground that is shown beyond the way of the body, along and across, besides the rover itself [m]."""


@dataclass(frozen=True, eq=False)
class Film:
    """A drive, frame by frame.

    Parameters
    ----------
    t : array (F,)
        Time of the frames [s], from the trace.
    links : dict of name -> (positions (F, 3), quaternions w x y z (F, 4))
        Of every link in the world.
    centres : array (F, W, 3)
        Of the wheels [m].
    left : array (F, W, 3)
        Along the wheels' axles, as they are steered.
    rows : array (F,)
        The rows of the trace.
    """

    rover: Rover
    terrain: Terrain
    trace: Trace
    t: np.ndarray
    links: dict[str, tuple[np.ndarray, np.ndarray]]
    centres: np.ndarray
    left: np.ndarray
    rows: np.ndarray

    @classmethod
    def of(cls, trace: Trace, rover: Rover, terrain: Terrain) -> Film:
        """Return the film of a trace: at most 20 frames a second, and 600 in all.

        Raises DataError: a trace of fewer than two rows, or without the body's x and y.
        """
        if len(trace.t) < 2:
            raise DataError("The trace has fewer than two rows, so there is nothing to see: look at its `stop`.")
        trace.need("body_x", "body_y")
        trace = on_the_ground(trace, rover, terrain)
        rows = _rows(trace.t)
        names = tuple(wheel.name for wheel in rover.wheels)
        angles = wheel_angles(trace, names)
        data, model = rover.model.createData(), rover.model
        bodies = [i for i, frame in enumerate(model.frames) if frame.type == pin.FrameType.BODY]
        places, turns, centres, axles = [], [], [], []
        for row in rows:
            centre, axle = place_links(rover, data, configuration(rover, trace, int(row), angles[row]))
            centres.append(centre)
            axles.append(axle)
            pin.updateFramePlacements(model, data)
            places.append([np.array(data.oMf[i].translation) for i in bodies])
            turns.append([np.roll(pin.Quaternion(data.oMf[i].rotation).coeffs(), 1) for i in bodies])
        where, turned = np.array(places), np.array(turns)
        links = {str(model.frames[i].name): (where[:, n], turned[:, n]) for n, i in enumerate(bodies)}
        return cls(rover, terrain, trace, trace.t[rows], links, np.array(centres), np.array(axles), rows)

    @cached_property
    def slip(self) -> np.ndarray | None:
        """Slip of the wheels (F, W), where it was recorded."""
        return self.of_wheels("slip")

    @cached_property
    def forces(self) -> np.ndarray | None:
        """The soil's force on each wheel in the world (F, W, 3) [N], or None where it was not recorded.

        A trace has normal, tangential and side force; they are drawn along the ground's normal under the wheel's
        centre, the wheel's heading along that ground, and to its left. On an edge, where a wheel stands on several
        facets, the direction is that of one of them.
        """
        parts = [self.of_wheels(name) for name in ("normal", "tangential", "lateral")]
        if any(part is None for part in parts):
            return None
        up = self.terrain.normal(self.centres[..., 0], self.centres[..., 1])
        ahead = np.cross(self.left, up)
        ahead /= np.maximum(np.linalg.norm(ahead, axis=-1, keepdims=True), 1e-9)
        normal, tangential, lateral = (np.nan_to_num(part)[..., None] for part in parts if part is not None)
        return np.asarray(normal * up + tangential * ahead + lateral * np.cross(up, ahead))

    def of_wheels(self, channel: str) -> np.ndarray | None:
        """Return a channel of the wheels (F, W), or None where it was not recorded of all."""
        names = [f"{channel}_{wheel.name}" for wheel in self.rover.wheels]
        if not all(name in self.trace for name in names):
            return None
        return np.column_stack([self.trace[name][self.rows] for name in names])

    @cached_property
    def box(self) -> Extent:
        """The ground that is shown: the way of the wheels and some more."""
        low, high = self.centres.min(axis=(0, 1)) - AROUND, self.centres.max(axis=(0, 1)) + AROUND
        return Extent(float(low[0]), float(high[0]), float(low[1]), float(high[1]))

    @cached_property
    def tracks(self) -> np.ndarray:
        """Where the wheels' centres pass over the ground (F, W, 3) [m]."""
        x, y = self.centres[..., 0], self.centres[..., 1]
        return np.stack([x, y, self.terrain.height(x, y)], axis=-1)

    @cached_property
    def rods(self) -> np.ndarray:
        """The left side as one line through its joints and wheels (F, N, 3) [m], broken by NaN."""
        model = self.rover.model
        names = {frame.parentJoint: str(frame.name) for frame in model.frames if frame.type == pin.FrameType.BODY}
        left = [wheel.joint for wheel in self.rover.wheels if wheel.side == "l"]
        joints = sorted({joint for wheel in left for joint in model.supports[wheel] if joint > 1})
        gap = np.full((self.t.size, 1, 3), np.nan)
        parts = []
        for joint in joints:
            ends = (self.links[names[index]][0][:, None] for index in (model.parents[joint], joint))
            parts += [*ends, gap]
        return np.concatenate(parts, axis=1)

    @cached_property
    def beside(self) -> np.ndarray:
        """The ground just outside of each wheel (F, W, 3) [m], where an arrow is not hidden."""
        out = np.array(
            [(1.0 if wheel.side == "l" else -1.0) * 0.7 * float(wheel.wheel.b) for wheel in self.rover.wheels]
        )
        return np.asarray(self.tracks + out[:, None] * self.left)

    def refuse_other(self, ghost: Film) -> None:
        """Refuse a ghost of another rover, which could not be drawn with this one's shapes.

        Raises DataError: its links are others.
        """
        if set(ghost.links) != set(self.links):
            raise DataError(
                f"Rover '{ghost.rover.name}' cannot be the ghost of '{self.rover.name}': compare drives of one rover."
            )

    def frame_at(self, t: float) -> int:
        """Return the last frame that is not after a time [s]."""
        return int(np.clip(np.searchsorted(self.t, t + 1e-9, side="right") - 1, 0, self.t.size - 1))


def _rows(t: np.ndarray) -> np.ndarray:
    """Return the rows that are shown: evenly in time, the first and the last among them."""
    count = int(np.clip((t[-1] - t[0]) * FRAMES_PER_SECOND + 1, 2, MOST_FRAMES))
    return np.unique(np.clip(np.searchsorted(t, np.linspace(t[0], t[-1], count)), 0, t.size - 1))
