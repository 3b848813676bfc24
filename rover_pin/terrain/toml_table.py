"""The `[terrain]` of a drive log: polylines or a height grid in files beside it, and stretches of other soil.

[terrain]
polyline = "ground.csv"                   # x_m, z_m[, ground], extruded sideways
# or: polylines = ["right.csv", "left.csv"] and borders = [0.0], the y [m] between them
# or: grid = "ground.npz", a .tif, or a .npy or .png with cell = 0.1 and, of a .png, relief = 2.0 [m]
patch = [{ x_from = 1.0, x_to = 2.0, ground = 1 }]
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rover_pin.base.errors import DataError, ParameterError, closest
from rover_pin.base.files.paths import is_file
from rover_pin.base.quantity import as_float
from rover_pin.base.trust import Trust
from rover_pin.terrain.files import from_grid, from_polyline, to_grid, to_polyline
from rover_pin.terrain.shapes import with_ground
from rover_pin.terrain.terrain import HeightGrid, Lanes, Terrain

KINDS = ("polyline", "polylines", "grid")
SCALES = ("cell", "relief")
KEYS = (*KINDS, *SCALES, "borders", "patch")
PATCH_KEYS = ("x_from", "x_to", "ground")


def terrain_from(table: Mapping[str, Any], file: Path, trust: Trust = Trust()) -> Terrain:
    """Return the terrain that a log's or model's `file` declares, its own files beside that unless `trust` allows more.

    Raises DataError: none or more than one kind of terrain, an unknown key, or what its files' readers refuse.
    """
    for key in table:
        if key not in KEYS:
            raise DataError(f"{file}: [terrain] has an unknown key '{key}': {closest(key, KEYS)}")
    kinds = [kind for kind in KINDS if kind in table]
    if len(kinds) != 1:
        raise DataError(
            f"{file}: [terrain] must have one of {', '.join(KINDS)}, but it has {', '.join(kinds) or 'none'}."
        )
    for key in ("polylines", "borders", "patch"):
        if not isinstance(table.get(key, []), list):
            raise DataError(f"{file}: [terrain] has {key} = {table[key]!r}: give a list.")
    try:
        terrain = _bare(kinds[0], table, file, trust)
        for patch in table.get("patch", []):
            terrain = _lay_patch(terrain, patch, file)
    except ParameterError as error:
        raise DataError(f"{file}: [terrain]: {error}") from error
    return terrain


def write_terrain(folder: str | Path, terrain: Terrain) -> dict[str, Any]:
    """Write a terrain's files into a drive log's folder; return its `[terrain]` table, for `LogMetadata`."""
    folder = Path(folder)
    if isinstance(terrain, HeightGrid):
        return {"grid": to_grid(folder / "terrain.npz", terrain).name}
    assert isinstance(terrain, Lanes)
    if len(terrain.profiles) == 1:
        return {"polyline": to_polyline(folder / "terrain.csv", terrain.profiles[0]).name}
    files = [to_polyline(folder / f"terrain-{at}.csv", profile).name for at, profile in enumerate(terrain.profiles)]
    return {"polylines": files, "borders": list(terrain.borders)}


def _bare(kind: str, table: Mapping[str, Any], file: Path, trust: Trust) -> Terrain:
    if kind == "grid":
        scales = {name: table[name] for name in SCALES if name in table}
        return from_grid(_beside(file, table["grid"], trust), **scales)
    if kind == "polyline":
        return from_polyline(_beside(file, table["polyline"], trust))
    lanes = [from_polyline(_beside(file, name, trust)).profiles[0] for name in table["polylines"]]
    return Lanes(tuple(lanes), tuple(table.get("borders", ())))


def _beside(file: Path, name: Any, trust: Trust) -> Path:
    """Return the path of a terrain's file, which must be there."""
    path = trust.within(file.parent, name, f"{file}: [terrain]")
    if not is_file(path):
        there = [each.name for each in file.parent.iterdir() if each.is_file()] if file.parent.is_dir() else []
        suggestion = closest(str(name), there)
        raise DataError(f"{file}: [terrain] names the file {name!r}, which is not there: {suggestion}")
    return path


def _lay_patch(terrain: Terrain, patch: Any, file: Path) -> Terrain:
    if not isinstance(patch, Mapping) or not set(patch) <= set(PATCH_KEYS) or "ground" not in patch:
        raise DataError(f"{file}: [terrain] has patch = {patch!r}: give {{ x_from = [m], x_to = [m], ground = 1 }}.")
    try:
        ends = [as_float(patch.get("x_from", -math.inf)), as_float(patch.get("x_to", math.inf))]
    except (TypeError, ValueError):
        raise DataError(f"{file}: [terrain] has patch = {patch!r}: x_from and x_to must be numbers [m].") from None
    return with_ground(terrain, ends[0], ends[1], patch["ground"])
