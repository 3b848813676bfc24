"""The ready-made scenes, which are found by their names: each is a terrain with its usual settings and the usual
duration of a drive on this terrain.

`scale_arguments` scales a terrain to the size of a rover.
"""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from rover_pin.base.arguments import arguments_of
from rover_pin.terrain import shapes
from rover_pin.terrain.files import from_grid, from_polyline
from rover_pin.terrain.shapes import DEG, paper_field
from rover_pin.terrain.terrain import Terrain


@dataclass(frozen=True)
class Scene:
    """A terrain with its usual numbers, and the usual settings of a drive on it."""

    terrain: Callable[..., Terrain]
    "function that returns the terrain; its arguments are the settings `terrain.NAME`"
    duration: float = 20.0
    """usual duration of a drive of the rover Nexus 6 [s]; slower rovers drive longer"""
    terrain_settings: Mapping[str, Any] = field(default_factory=dict)
    "arguments of the terrain function that differ from the function's defaults"
    settings: Mapping[str, Any] = field(default_factory=dict)
    "settings of the drive that differ from its defaults"
    symmetric: bool = False
    "whether terrain and drive are mirror-symmetric about y = 0"
    askew: bool = False
    """whether the wheels slide sideways, so that the law of the side force matters"""
    summary: str = ""
    "one line about the scene; if empty, the first line of the terrain function's docstring is shown"


SCENES: dict[str, Scene] = {
    "flat": Scene(shapes.flat, 10.0, symmetric=True),
    "incline": Scene(shapes.incline, 20.0, {"angle": 6 * DEG}, symmetric=True),
    "slope": Scene(shapes.growing_slope, 60.0, symmetric=True),
    "bump": Scene(shapes.bump, 30.0, symmetric=True),
    "one-sided-bump": Scene(shapes.one_sided_bump, 30.0),
    "ditch": Scene(shapes.ditch, 20.0, {"wall_angle": 30 * DEG}, symmetric=True),
    "step": Scene(shapes.step, 20.0, symmetric=True),
    "rocks": Scene(shapes.rocks, 30.0),
    "field": Scene(paper_field, 120.0),
    "washboard": Scene(shapes.washboard, 20.0, symmetric=True),
    "cross-slope": Scene(shapes.cross_slope, 20.0, {"angle": 6 * DEG}, askew=True),
    "hills": Scene(shapes.hills, 30.0),
    "turn": Scene(
        shapes.flat,
        30.0,
        settings={"control": "turn"},
        askew=True,
        summary="A turn of 1 m radius on level ground with steered wheels",
    ),
    "point-turn": Scene(
        shapes.flat,
        20.0,
        settings={"control": "point-turn"},
        askew=True,
        summary="A turn on the spot on level ground with steered wheels",
    ),
    "crab": Scene(
        shapes.flat,
        20.0,
        settings={"control": "crab"},
        askew=True,
        summary="Sideways at 20 deg on level ground, all steered wheels at one angle",
    ),
    "polyline": Scene(from_polyline, 30.0, {"path": "terrain.csv"}, summary="Your own ground: x_m, z_m of a CSV file"),
    "grid": Scene(
        from_grid,
        30.0,
        {"path": "terrain.npz"},
        summary="Your own ground: heights in .npz, CSV, GeoTIFF, .asc, .npy, .mat or .png",
    ),
    "park": Scene(
        shapes.incline,
        10.0,
        {"angle": 6 * DEG, "start": -5.0},
        {"control.delta": 0.0, "gear_friction": 0.1},
        summary="Motors off on a slope of 6 deg, held by gear friction",
    ),
}

POWERS = {"m": 1, "rad/m": -1}
"""Unit of an argument of a terrain function -> power of length in this unit. Arguments in other units are not
scaled."""


def scale_arguments(terrain: Callable[..., Terrain], arguments: Mapping[str, Any], size: float) -> dict[str, Any]:
    """Return all arguments of a terrain function, scaled to wheels that are `size` times as large as Nexus 6's wheels.

    The unit of an argument shows whether the argument is a length. A terrain with lengths that are not arguments, such
    as `field`, has an argument `size` for these lengths.

    Parameters
    ----------
    terrain : callable
        The terrain function.
    arguments : mapping
        Arguments that differ from the function's defaults; they are also scaled.
    size : float
        Size of the rover's wheels divided by the size of Nexus 6's wheels. With 1, only `arguments` are returned.
    """
    if size == 1.0:
        return dict(arguments)
    units = {name: argument.quantity.unit for name, argument in arguments_of(terrain).items()}
    # Defaults are lengths for Nexus 6 as well, so they are scaled together with the scene's own numbers.
    parameters = inspect.signature(terrain).parameters
    defaults = {
        name: parameter.default
        for name, parameter in parameters.items()
        if parameter.default is not inspect.Parameter.empty
    }
    return {
        name: _scale_value(value, 1 if name == "size" else POWERS.get(units.get(name, ""), 0), size)
        for name, value in {**defaults, **arguments}.items()
    }


def _scale_value(value: Any, power: int, size: float) -> Any:
    """Return a value, or each value of a tuple, multiplied by size^power."""
    if isinstance(value, tuple):
        return tuple(_scale_value(element, power, size) for element in value)
    return value if power == 0 else size**power * value
