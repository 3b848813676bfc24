"""The ready-made scenes by name: a terrain of the rover's size with its usual settings, and how long it is driven."""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from rover_pin.base.arguments import arguments_of
from rover_pin.terrain import shapes
from rover_pin.terrain.field import paper_field
from rover_pin.terrain.files import from_grid, from_polyline
from rover_pin.terrain.shapes import DEG
from rover_pin.terrain.terrain import Terrain


@dataclass(frozen=True)
class Scene:
    """A terrain with its usual settings, and what is driven on it."""

    terrain: Callable[..., Terrain]
    duration: float = 20.0
    terrain_settings: Mapping[str, Any] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    symmetric: bool = False
    askew: bool = False
    "whether wheels go sideways on it"
    summary: str = ""
    "what it is, where the terrain's own docstring does not say it"


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
        summary="A turn of 1 m radius on level ground, wheels steered",
    ),
    "point-turn": Scene(
        shapes.flat,
        20.0,
        settings={"control": "point-turn"},
        askew=True,
        summary="A turn on the spot on level ground, wheels steered",
    ),
    "crab": Scene(
        shapes.flat,
        20.0,
        settings={"control": "crab"},
        askew=True,
        summary="Sideways at 20 deg on level ground, the wheels that steer all at one angle",
    ),
    "polyline": Scene(from_polyline, 30.0, {"path": "terrain.csv"}, summary="Your own ground: x_m, z_m of a CSV file"),
    "grid": Scene(
        from_grid, 30.0, {"path": "terrain.npz"}, summary="Your own ground: heights in .npz, CSV, GeoTIFF, .npy or .png"
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
"""Power of a length in the units of a terrain's arguments."""


def scale_arguments(terrain: Callable[..., Terrain], arguments: Mapping[str, Any], size: float) -> dict[str, Any]:
    """Return the arguments of a terrain for wheels `size` times as large as those that it is made for.

    An argument's unit says whether it is a length. What is no argument (`field` has its own distances) grows by the
    argument `size`, where there is one.
    """
    if size == 1.0:
        return dict(arguments)
    units = {name: argument.quantity.unit for name, argument in arguments_of(terrain).items()}
    parameters = inspect.signature(terrain).parameters
    defaults = {
        name: parameter.default
        for name, parameter in parameters.items()
        if parameter.default is not inspect.Parameter.empty
    }
    return {
        name: _scale_value(value, _power(name, units.get(name, "")), size)
        for name, value in {**defaults, **arguments}.items()
    }


def _power(name: str, unit: str) -> int:
    return 1 if name == "size" else POWERS.get(unit, 0)


def _scale_value(value: Any, power: int, size: float) -> Any:
    if isinstance(value, tuple):
        return tuple(_scale_value(element, power, size) for element in value)
    return value if power == 0 else size**power * value
