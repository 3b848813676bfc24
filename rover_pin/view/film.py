"""The drive that a view shows: a trace with its rover and terrain (`Subject`), and the drive frame by frame (`Film`).

A film has the pose of every link, and slip, forces and tracks of the wheels.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pinocchio as pin

from rover_pin.base.errors import DataError
from rover_pin.logs.drive_log import DriveLog
from rover_pin.rover.description.layout import rover_folder, urdf_folder
from rover_pin.rover.rover import Rover
from rover_pin.simulation.trace.poses import configuration, on_the_ground, place_links, wheel_angles
from rover_pin.simulation.trace.trace import Trace
from rover_pin.terrain.terrain import Extent, Terrain

FRAMES_PER_SECOND, MAX_FRAMES = 20.0, 600
"""Number of frames of a film per second of the drive, and maximum number of frames. A drive of more than 30 s has fewer
frames per second, because each frame makes the page larger."""
AROUND = 0.4
"""Width of the strip of terrain that views show on each side of the paths of the wheels [m]. It is about the length of
a rover, so that the rover is never at the edge of the terrain."""


@dataclass(frozen=True, eq=False)
class Film:
    """A drive as a film, with the data that views show, for F frames and W wheels.

    Parameters
    ----------
    rover, terrain, trace
        The rover, its terrain and its trace. Height and attitude of the body are estimated in the trace if they were
        not recorded.
    t : array (F,)
        Times of the frames [s], as in the trace.
    links : dict of name -> (positions (F, 3) [m], quaternions w x y z (F, 4))
        Pose of every link in the world.
    centres : array (F, W, 3)
        Centres of the wheels [m].
    left : array (F, W, 3)
        Unit vectors along the wheels' axles that point to the left; they turn with the steering.
    rows : array (F,)
        Rows of the trace that the frames show.

    Examples
    --------
    >>> from rover_pin.scenarios.scenario import scenario
    >>> drive = scenario("flat", rover="cart", duration=1.0)
    >>> film = Film.of(drive.drive(), drive.model.rover, drive.model.terrain)
    >>> film.centres.shape[1:]
    (4, 3)
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
        """Return the film of a trace.

        Raises DataError: the trace has fewer than two rows, or no x and y of the body.
        """
        if len(trace.t) < 2:
            raise DataError(
                "A trace with fewer than two rows cannot be shown: its attribute `stop` states why the drive ended."
            )
        trace.need("body_x", "body_y")
        # A log without heights or attitudes is set on the ground.
        trace = on_the_ground(trace, rover, terrain)
        # Frames are evenly spaced in time, whatever the steps of the trace, with the first and the last row among them.
        t = trace.t
        count = int(np.clip((t[-1] - t[0]) * FRAMES_PER_SECOND + 1, 2, MAX_FRAMES))
        rows = np.unique(np.clip(np.searchsorted(t, np.linspace(t[0], t[-1], count)), 0, t.size - 1))
        angles = wheel_angles(trace, tuple(wheel.name for wheel in rover.wheels))
        data, model = rover.model.createData(), rover.model
        bodies = [i for i, frame in enumerate(model.frames) if frame.type == pin.FrameType.BODY]
        positions, quaternions, centres, axles = [], [], [], []
        for row in rows:
            centre, axle = place_links(rover, data, configuration(rover, trace, int(row), angles[row]))
            centres.append(centre)
            axles.append(axle)
            pin.updateFramePlacements(model, data)
            positions.append([np.array(data.oMf[i].translation) for i in bodies])
            # Pinocchio has x, y, z, w; the page takes w first.
            quaternions.append([np.roll(pin.Quaternion(data.oMf[i].rotation).coeffs(), 1) for i in bodies])
        where, turned = np.array(positions), np.array(quaternions)
        links = {str(model.frames[i].name): (where[:, n], turned[:, n]) for n, i in enumerate(bodies)}
        return cls(rover, terrain, trace, trace.t[rows], links, np.array(centres), np.array(axles), rows)

    @cached_property
    def slip(self) -> np.ndarray | None:
        """Slip of the W wheels at the F frames (F, W); None if the trace does not have the slip of each wheel."""
        return self.of_wheels("slip")

    @cached_property
    def forces(self) -> np.ndarray | None:
        """Force of the soil on each of the W wheels at the F frames, in the world frame (F, W, 3) [N]; None if the
        trace has no forces.

        The normal force of a trace points along the normal of the terrain under the wheel's centre, the tangential
        force along the wheel's heading on the terrain, and the side force to the left. A wheel at an edge touches
        several facets of the terrain; the directions then follow one of these facets.
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
        """Return a channel of all wheels, such as "slip", at the F frames for the W wheels (F, W); None if the channel
        was not recorded for every wheel.
        """
        names = [f"{channel}_{wheel.name}" for wheel in self.rover.wheels]
        if not all(name in self.trace for name in names):
            return None
        return np.column_stack([self.trace[name][self.rows] for name in names])

    @cached_property
    def box(self) -> Extent:
        """Rectangle of the terrain that views show: the area of all wheels' paths, with a margin of AROUND."""
        low, high = self.centres.min(axis=(0, 1)) - AROUND, self.centres.max(axis=(0, 1)) + AROUND
        return Extent(float(low[0]), float(high[0]), float(low[1]), float(high[1]))

    @cached_property
    def tracks(self) -> np.ndarray:
        """Points of the terrain below the centres of the W wheels at the F frames (F, W, 3) [m], which form the
        tracks.
        """
        x, y = self.centres[..., 0], self.centres[..., 1]
        return np.stack([x, y, self.terrain.height(x, y)], axis=-1)

    @cached_property
    def rods(self) -> np.ndarray:
        """Points of a line through the joints and wheels of the rover's left side, for the side view, at the F frames
        (F, N, 3) [m]. NaN separates the pieces of the line.
        """
        model = self.rover.model
        names = {frame.parentJoint: str(frame.name) for frame in model.frames if frame.type == pin.FrameType.BODY}
        left_wheels = [wheel.joint for wheel in self.rover.wheels if wheel.side == "l"]
        # Joint 1 is the free flyer: the line begins at the body.
        joints = sorted({joint for wheel in left_wheels for joint in model.supports[wheel] if joint > 1})
        gap = np.full((self.t.size, 1, 3), np.nan)
        parts = []
        # A gap (NaN) after each piece keeps the pieces of the line apart.
        for joint in joints:
            ends = (self.links[names[index]][0][:, None] for index in (model.parents[joint], joint))
            parts += [*ends, gap]
        return np.concatenate(parts, axis=1)

    @cached_property
    def beside(self) -> np.ndarray:
        """Points of the terrain next to each of the W wheels, on its outer side, at the F frames (F, W, 3) [m]. The
        arrows that show forces start at these points.
        """
        outwards = [(1.0 if wheel.side == "l" else -1.0) * 0.7 * float(wheel.wheel.b) for wheel in self.rover.wheels]
        return np.asarray(self.tracks + np.array(outwards)[:, None] * self.left)

    def refuse_other(self, ghost: Film) -> None:
        """Raise an error if a second drive (ghost) has other links than this drive. A ghost is drawn with the shapes of
        this rover, so that it must be a drive of this rover.

        Raises DataError: the ghost is a drive of another rover.
        """
        if set(ghost.links) != set(self.links):
            raise DataError(
                f"Rover '{ghost.rover.name}' cannot be the ghost of '{self.rover.name}': compare drives of one rover."
            )

    def frame_at(self, t: float) -> int:
        """Return the index of the last frame that is not later than the time `t` [s]; 0 for a time before the first
        frame.
        """
        return int(np.clip(np.searchsorted(self.t, t + 1e-9, side="right") - 1, 0, self.t.size - 1))


@dataclass(frozen=True)
class Subject:
    """The drive that a view shows: a trace, its rover, its terrain, and the folder of the rover's meshes (None: no
    meshes are drawn).
    """

    name: str
    trace: Trace
    rover: Rover
    terrain: Terrain
    meshes: Path | None


def subject_of_log(log: DriveLog, run: str = "") -> Subject:
    """Return one run of a drive log, with its rover and terrain, as the subject of a view. `run` is the name of the
    run; if it is empty, the first run is taken.
    """
    trace = log.run(run) if run else log.runs[0]
    name = Path(str(trace.attrs.get("file", log.metadata.name))).stem
    return Subject(
        log.metadata.name if len(log.runs) == 1 else f"{log.metadata.name}, {name}",
        trace,
        log.load_rover(),
        log.terrain(),
        mesh_folder(log.rover),
    )


def mesh_folder(rover: str) -> Path | None:
    """Return the base folder of the relative paths of meshes in a rover's URDF. `rover` is the name of a rover of the
    package, or the path of a rover's TOML.
    """
    path = Path(rover)
    return urdf_folder(path) if path.suffix else rover_folder()
