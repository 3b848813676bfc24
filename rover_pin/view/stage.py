"""The 3D scene of a drive in viser: ground, rover, ghosts, force arrows and tracks. The scene can show each frame of a
film.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from rover_pin.view.colours import in_bytes, slip_colour
from rover_pin.view.film import Film
from rover_pin.view.triangles import LinkShape, patches, ruled_lines

SOILS = ((201, 176, 130), (128, 124, 122), (176, 140, 110), (150, 160, 140))
"""Colours of the soils by soil index: sand, hard ground, and two more. All further soils have the last colour."""
BLUE, ORANGE = (70, 110, 190), (205, 100, 40)
"""Colours of the ghosts, the transparent second drives (red, green, blue from 0 to 255)."""
FORCE = (20, 120, 80)
"""Colour of the arrows for the soil's forces."""
FORCE_LENGTH = 0.15
"""Length [m] of the arrow for a force that equals the rover's weight on Earth, divided by the number of wheels."""
WORLD = "/world"
"""Path of the scene's root node. This node moves opposite to the rover, so that the rover stays at the origin, where
the camera looks."""
PIECES = 60
"""Number of pieces into which the track of each wheel is divided. A piece appears when the wheel has passed its end.
More pieces would let the track grow more smoothly, but each piece makes the page larger."""


class Ghost(NamedTuple):
    """Another drive of the scene's rover, which the scene draws transparent in one colour (red, green, blue from 0 to
    255).
    """

    film: Film
    colour: tuple[int, int, int] = BLUE


class Stage:
    """The 3D scene of a drive, which viser shows. Other drives of the rover can be shown as ghosts.

    Parameters
    ----------
    scene : viser.SceneApi
        The empty scene.
    film : Film
        The drive, frame by frame.
    shapes : list of LinkShape
        The shapes of the rover, which the ghosts share.
    ghosts : sequence of Ghost
        Other drives of the rover.
    """

    def __init__(self, scene: Any, film: Film, shapes: list[LinkShape], ghosts: Sequence[Ghost] = ()):
        self.scene, self.film, self.ghosts = scene, film, tuple(ghosts)
        self.shown: dict[str, tuple[int, int, int]] = {}
        scene.set_up_direction("+z")
        # All nodes lie below one node, which moves so that the rover stays in the middle of the view.
        self.world = scene.add_frame(WORLD, show_axes=False)
        # The terrain is one mesh for each soil, and the lines that are drawn across the terrain.
        for patch in patches(film.terrain, film.box):
            scene.add_mesh_simple(
                f"{WORLD}/ground/{patch.soil}",
                _page_points(patch.vertices),
                patch.faces.astype(np.uint32),
                color=SOILS[min(patch.soil, len(SOILS) - 1)],
                flat_shading=True,
                side="double",
            )
        lines = _page_points(ruled_lines(film.terrain, film.box))
        scene.add_line_segments(f"{WORLD}/ground/lines", lines, (120, 100, 70), thickness=0.0015)
        self.frames = self._add_frames(f"{WORLD}/rover", film)
        self.rims = self._add_shapes(f"{WORLD}/rover", shapes, None)
        self.ghost_frames = []
        for number, ghost in enumerate(self.ghosts):
            root = f"{WORLD}/ghost{number}"
            self.ghost_frames.append(self._add_frames(root, ghost.film))
            self._add_shapes(root, shapes, ghost.colour)
        # The tracks of the wheels are drawn in pieces that are hidden at first. Each piece is stored with the index of
        # its first visible frame. The tracks lie 2 mm above the terrain, which would hide them.
        ends = np.unique(np.linspace(0, film.t.size - 1, PIECES + 1).astype(int))
        lifted = film.tracks + np.array([0.0, 0.0, 2e-3])
        self.tracks: list[tuple[int, Any]] = []
        for start, end in zip(ends, ends[1:], strict=False):
            for wheel in range(lifted.shape[1]):
                # A piece of a track has one colour, the slip at its beginning.
                points = lifted[start : end + 1, wheel]
                segments = _page_points(np.stack([points[:-1], points[1:]], axis=1))
                r, g, b = slip_colour(np.nan if film.slip is None else float(film.slip[start, wheel]))
                darker = in_bytes((0.8 * r, 0.8 * g, 0.8 * b))
                name = f"{WORLD}/tracks/{wheel}/{start}"
                line = scene.add_line_segments(name, segments, darker, thickness=0.006, visible=False)
                self.tracks.append((start + len(points) - 1, line))
        self.arrows = None
        if film.forces is not None:
            self.arrows = scene.add_arrows(
                f"{WORLD}/forces",
                self._force_arrows(0),
                FORCE,
                shaft_radius=0.003,
                head_radius=0.008,
                head_length=0.016,
            )

    def show(self, frame: int) -> None:
        """Change the scene so that it shows a frame of the film. Each ghost is shown at its last frame that is not
        later than this frame.
        """
        self.world.position = -self.film.centres[frame].mean(axis=0)
        # The links move with their nodes; a ghost shows its own frame of the same time.
        _place(self.frames, self.film, frame)
        for ghost, frames in zip(self.ghosts, self.ghost_frames, strict=True):
            _place(frames, ghost.film, ghost.film.frame_at(float(self.film.t[frame])))
        # Only changed properties are sent, because each message makes the page larger.
        if self.film.slip is not None:
            for wheel, slip in zip(self.film.rover.wheels, self.film.slip[frame], strict=True):
                colour = in_bytes(slip_colour(float(slip)))
                if self.shown.get(wheel.name) != colour:
                    self.shown[wheel.name] = colour
                    for mesh in self.rims.get(wheel.name, ()):
                        mesh.color = colour
        if self.arrows is not None:
            self.arrows.points = self._force_arrows(frame)
        for last_frame, line in self.tracks:
            if line.visible != (last_frame <= frame):
                line.visible = last_frame <= frame

    def _add_frames(self, root: str, film: Film) -> dict[str, Any]:
        """Add a node to the scene for each link, below the node `root`; return name of a link -> node. A node has the
        pose of its link.
        """
        return {name: self.scene.add_frame(f"{root}/{name}", show_axes=False) for name in film.links}

    def _add_shapes(
        self, root: str, shapes: list[LinkShape], ghostly: tuple[int, int, int] | None
    ) -> dict[str, list[Any]]:
        """Add shapes to the scene, below the nodes of their links; return name of a wheel -> the nodes whose colour
        shows its slip.

        If `ghostly` is a colour, the shapes are drawn transparent in this colour.
        """
        rims: dict[str, list[Any]] = {}
        for number, shape in enumerate(shapes):
            mesh = self.scene.add_mesh_simple(
                f"{root}/{shape.link}/{number}",
                _page_points(shape.vertices),
                shape.faces.astype(np.uint32),
                color=ghostly or in_bytes(shape.colour),
                opacity=0.35 if ghostly else None,
                flat_shading=True,
                side="double",
                cast_shadow=not ghostly,
            )
            if shape.wheel:
                rims.setdefault(shape.wheel, []).append(mesh)
        return rims

    def _force_arrows(self, frame: int) -> np.ndarray:
        """Return start and end of the force arrows of the W wheels at a frame (W, 2, 3) [m]. Arrows start on the
        terrain next to the wheel.
        """
        assert self.film.forces is not None
        rover = self.film.rover
        # Length of an arrow for each newton.
        scale = FORCE_LENGTH / (rover.mass * 9.81 / len(rover.wheels))
        start = self.film.beside[frame]
        return _page_points(np.stack([start, start + scale * self.film.forces[frame]], axis=1))


def _page_points(points: np.ndarray) -> np.ndarray:
    """Return points as numbers of single precision, because a page stores them so. Values beyond its range are set to
    the largest value of single precision.
    """
    largest = np.finfo(np.float32).max
    return np.clip(points, -largest, largest).astype(np.float32)


def _place(frames: dict[str, Any], film: Film, frame: int) -> None:
    """Move the nodes of the links to their poses at a frame of a film."""
    for name, node in frames.items():
        positions, quaternions = film.links[name]
        node.position, node.wxyz = positions[frame], quaternions[frame]
