"""The scene: ground, rover, ghosts, arrows and tracks as viser's nodes, set to any frame."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from rover_pin.view.colours import in_bytes, slip_colour
from rover_pin.view.film import Film
from rover_pin.view.ground import patches, ruled_lines
from rover_pin.view.shapes import Shape

SOILS = ((201, 176, 130), (128, 124, 122), (176, 140, 110), (150, 160, 140))
"""Colours of the soils by index: sand, hard ground, others."""
BLUE, ORANGE = (70, 110, 190), (205, 100, 40)
"""Colours of ghosts."""
FORCE = (20, 120, 80)
WORLD = "/world"
"""The frame of all that is seen: it moves so that the rover stays in the middle."""
PIECES = 60
"""Pieces in which a track is laid behind its wheel."""


class Ghost(NamedTuple):
    """Another film of the same rover, seen through in its colour."""

    film: Film
    colour: tuple[int, int, int] = BLUE


class Stage:
    """A film in a scene of viser, and others as its ghosts."""

    def __init__(self, scene: Any, film: Film, shapes: list[Shape], ghosts: Sequence[Ghost] = ()):
        self.scene, self.film, self.ghosts = scene, film, tuple(ghosts)
        self.shown: dict[str, tuple[int, int, int]] = {}
        scene.set_up_direction("+z")
        self.world = scene.add_frame(WORLD, show_axes=False)
        self._ground(film)
        self.frames = {name: scene.add_frame(f"{WORLD}/rover/{name}", show_axes=False) for name in film.links}
        self.rims = self._rover(f"{WORLD}/rover", shapes, None)
        self.ghost_frames = [
            self._ghost(f"{WORLD}/ghost{number}", shapes, ghost) for number, ghost in enumerate(self.ghosts)
        ]
        self.tracks = self._tracks(film)
        self.arrows = (
            None
            if film.forces is None
            else scene.add_arrows(
                f"{WORLD}/forces", self._arrows(0), FORCE, shaft_radius=0.003, head_radius=0.008, head_length=0.016
            )
        )

    def show(self, frame: int) -> None:
        """Set everything to a frame."""
        self.world.position = -self.film.centres[frame].mean(axis=0)
        _place(self.frames, self.film, frame)
        for ghost, frames in zip(self.ghosts, self.ghost_frames, strict=True):
            _place(frames, ghost.film, ghost.film.frame_at(float(self.film.t[frame])))
        if self.film.slip is not None:
            for wheel, slip in zip(self.film.rover.wheels, self.film.slip[frame], strict=True):
                self._colour(wheel.name, in_bytes(slip_colour(float(slip))))
        if self.arrows is not None:
            self.arrows.points = self._arrows(frame)
        self._lay(frame)

    def _ground(self, film: Film) -> None:
        for patch in patches(film.terrain, film.box):
            colour = SOILS[min(patch.soil, len(SOILS) - 1)]
            self.scene.add_mesh_simple(
                f"{WORLD}/ground/{patch.soil}",
                _page_points(patch.vertices),
                patch.faces.astype(np.uint32),
                color=colour,
                flat_shading=True,
                side="double",
            )
        self.scene.add_line_segments(
            f"{WORLD}/ground/lines", _page_points(ruled_lines(film.terrain, film.box)), (120, 100, 70), thickness=0.0015
        )

    def _ghost(self, root: str, shapes: list[Shape], ghost: Ghost) -> dict[str, Any]:
        frames = {name: self.scene.add_frame(f"{root}/{name}", show_axes=False) for name in ghost.film.links}
        self._rover(root, shapes, ghost.colour)
        return frames

    def _rover(self, root: str, shapes: list[Shape], ghostly: tuple[int, int, int] | None) -> dict[str, list[Any]]:
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

    def _tracks(self, film: Film) -> list[list[tuple[int, Any]]]:
        """Return the pieces of the tracks with the frame from which each is there; hidden at first."""
        ends = np.unique(np.linspace(0, film.t.size - 1, PIECES + 1).astype(int))
        lifted = film.tracks + np.array([0.0, 0.0, 2e-3])
        return [
            [self._piece(lifted[start : end + 1, w], f"{w}/{start}", start, w) for w in range(lifted.shape[1])]
            for start, end in zip(ends, ends[1:], strict=False)
        ]

    def _piece(self, points: np.ndarray, name: str, frame: int, wheel: int) -> tuple[int, Any]:
        slip = np.nan if self.film.slip is None else float(self.film.slip[frame, wheel])
        segments = _page_points(np.stack([points[:-1], points[1:]], axis=1))
        r, g, b = slip_colour(slip)
        colour = in_bytes((0.8 * r, 0.8 * g, 0.8 * b))
        line = self.scene.add_line_segments(f"{WORLD}/tracks/{name}", segments, colour, thickness=0.006, visible=False)
        return frame + len(points) - 1, line

    def _lay(self, frame: int) -> None:
        for piece in self.tracks:
            for end, line in piece:
                if line.visible != (end <= frame):
                    line.visible = end <= frame

    def _colour(self, wheel: str, colour: tuple[int, int, int]) -> None:
        if self.shown.get(wheel) != colour:
            self.shown[wheel] = colour
            for mesh in self.rims.get(wheel, ()):
                mesh.color = colour

    def _arrows(self, frame: int) -> np.ndarray:
        """Return the arrows (W, 2, 3), beside each wheel on the ground; its share of the weight is 0.15 m long."""
        assert self.film.forces is not None
        rover = self.film.rover
        scale = 0.15 / (rover.mass * 9.81 / len(rover.wheels))
        start = self.film.beside[frame]
        return _page_points(np.stack([start, start + scale * self.film.forces[frame]], axis=1))


def _page_points(points: np.ndarray) -> np.ndarray:
    """Return points as the page takes them, in single precision; what is beyond its numbers lies at their end."""
    most = np.finfo(np.float32).max
    return np.clip(points, -most, most).astype(np.float32)


def _place(frames: dict[str, Any], film: Film, frame: int) -> None:
    for name, node in frames.items():
        positions, turns = film.links[name]
        node.position, node.wxyz = positions[frame], turns[frame]
