"""Map a rover's slip, energy and risk of getting stuck on a terrain.

For the map, short drives are simulated: one from each place of a grid in each of several headings.
"""

import dataclasses
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from rover_pin.base.errors import ParameterError, SimulationError
from rover_pin.base.trust import Trust
from rover_pin.comparison.bands import FAILED
from rover_pin.control.motion.servo import cruise_speed
from rover_pin.plot.ground_map import map_figure
from rover_pin.plot.sheet import save, write_csv
from rover_pin.rover.wheel_base import base_of, corners
from rover_pin.scenarios.assumptions import Assumption
from rover_pin.scenarios.drive_file import with_drive_file
from rover_pin.scenarios.scenario import Scenario, scenario
from rover_pin.simulation.outcome.outcome import drive_outcome, wheel_paths
from rover_pin.simulation.start import Start
from rover_pin.sweep.plan import Grid, Values
from rover_pin.sweep.run import sweep
from rover_pin.sweep.study import Case, Study, canonical
from rover_pin.terrain.raster import GEOTIFF, write_geotiff
from rover_pin.terrain.terrain import HeightGrid, slope_and_roughness

START = ("start.x", "start.y", "start.yaw")
"""Names of the sweep's parameters for the place and the heading at which a drive starts [m, m, rad]."""
USUAL_PLACES = 200
"""Approximate number of places of a map if the user gives no spacing. With 8 headings at each place, the drives take
half a minute to a minute of CPU time for each model."""


@dataclass(frozen=True)
class MapSettings:
    """Settings of a map: the distance between places, the number of headings at each place, and the mapped area."""

    spacing: float = 0.0
    """distance between neighbouring places [m]; 0 means the rover's length, or on a large terrain the longer distance
    that gives about USUAL_PLACES places"""
    headings: int = 8
    """number of headings at each place, evenly spaced from 0 (along x)"""
    box: tuple[float, float, float, float] = (-math.inf, math.inf, -math.inf, math.inf)
    "limits of the places: x from, x to, y from, y to [m]; by default the whole terrain"


class Places(NamedTuple):
    """Grid of places at which the drives of a map start.

    `x` and `y` are the coordinates of the grid's lines [m], `spacing` is the distance between neighbouring places [m],
    and `headings` is the number of headings at each place.
    """

    x: np.ndarray
    y: np.ndarray
    spacing: float
    headings: int


def ground_map(
    name: str,
    settings: Mapping[str, Any],
    models: Sequence[str | Path],
    out: Path,
    chosen: MapSettings = MapSettings(),
    trust: Trust = Trust(),
    workers: int | None = None,
    scheduler: str | None = None,
) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Simulate short drives straight ahead from places all over a terrain, in several headings, and return the map.

    Each drive starts at rest in static equilibrium and uses the control of the scenario. By default, a drive lasts as
    long as a rover without slip needs for its own length at the cruise speed, so that the rear wheels reach the place
    where the front wheels started. The setting `duration` replaces this time.

    Slip is 1 minus the ratio of wheel travel to rim travel (`wheel_paths`). Energy is the electric energy per metre of
    wheel travel. A drive counts as stuck if its outcome is one of `bands.FAILED`, if its wheels do not move forward at
    all, or if the rover cannot be placed there.

    Parameters
    ----------
    name, settings
        Scenario or drive file, and settings, as for `scenario`; values are numbers or words. A duration in a drive file
        is ignored. Without models, the law of the side force is `combined` unless the settings name another law,
        because a rover that drives across a slope also slides sideways.
    models : sequence of path
        Files of equally probable models; if empty, the model of the settings is used.
    out : path
        Folder for map.csv, map.png and, if the terrain is a GeoTIFF, map.tif in the coordinates of the terrain. The
        folder also holds the drives (see `sweep`), so that a map that was stopped continues there.
    chosen : MapSettings
        Spacing of the places, number of headings, and mapped area.
    trust, workers, scheduler
        As for `scenario` and `sweep`.

    Returns
    -------
    table : DataFrame
        One row for each place: slope and roughness over the length of the rover (see `slope_and_roughness`), and the
        largest slip and energy per metre over the headings, as medians over the models. With several models, the table
        also has the 95 % quantiles and `p_stuck`, the fraction of models on which the rover is stuck. With one model
        there is `stuck`, 0 or 1.
    summary : dict
        The places, the extremes of the map, the files, and the numbers that were not given (`assumptions`).

    Raises
    ------
    ParameterError
        If `scenario`, `places_on` or `sweep` refuses a setting.

    Examples
    --------
    >>> from rover_pin.comparison.ground_map import MapSettings, ground_map
    >>> table, summary = ground_map("hills", {}, [], Path("out/map"), MapSettings(headings=4))  # doctest: +SKIP
    """
    # A drive file states the duration of its own long drive, so this duration is not used for the short drives.
    name, of_file = with_drive_file(name, settings, trust)
    settings = {key: value for key, value in of_file.items() if key != "duration" or "duration" in settings}
    settings = settings if models else {"side": "combined", **settings}
    axes = {"model": Values([str(file) for file in models])} if models else {}
    first = scenario(name, **settings, **{axis: values.values[0] for axis, values in axes.items()}, trust=trust)
    length, terrain = base_of(first.model.rover).length, first.model.terrain
    if "duration" not in settings:
        first = dataclasses.replace(first, duration=length / cruise_speed(first.model.rover, first.model.motor))

    # The drives are a sweep over model, x, y and heading, which resumes after a stop.
    places = places_on(first, chosen)
    yaws = [2.0 * math.pi * n / places.headings for n in range(places.headings)]
    axes |= dict(zip(START, map(Values, (places.x.tolist(), places.y.tolist(), yaws)), strict=True))
    study = Study("map", name, axes, Grid(), settings={**settings, "duration": first.duration}, trust=trust)
    drives = sweep(study, out, workers=workers, scheduler=scheduler, case_function=drive_from, picture=False)

    # The drives of one place and heading form a group with one row for each model. Slip and energy of a group are
    # quantiles over the models. The energy per metre of a rover that does not move forward is set to infinity, because
    # the quantiles would leave out NaN.
    numeric = dict.fromkeys(("slip", "energy_J_per_m", "stuck"), float)
    done = drives.table[drives.table["error"].isna()].astype(numeric).fillna({"energy_J_per_m": math.inf})
    headings = done.groupby(list(START))
    quantiles = {"": 0.5, "_95": 0.95} if len(models) > 1 else {"": 0.5}
    numbers = {
        f"{column}{end}": headings[column].quantile(share, interpolation="higher")
        for end, share in quantiles.items()
        for column in ("slip", "energy_J_per_m")
    }
    numbers["p_stuck" if len(models) > 1 else "stuck"] = headings["stuck"].mean()
    # Each place gets the largest values over its headings. The index has the levels x, y and heading, and the maximum
    # is taken in each group with equal x and y (levels 0 and 1).
    worst = pd.DataFrame(numbers).groupby(level=[0, 1]).max().rename_axis(["x_m", "y_m"])

    # One row per place: the terrain itself, then the worst heading.
    x, y = np.meshgrid(places.x, places.y, indexing="ij")
    slope, roughness = slope_and_roughness(terrain, x, y, length)
    ground = {"slope_deg": np.degrees(slope).ravel(), "roughness_mm": 1e3 * roughness.ravel()}
    index = pd.MultiIndex.from_product([places.x, places.y], names=["x_m", "y_m"])
    table = pd.DataFrame(ground, index=index).join(worst).reset_index()

    bands = {column: table[column].to_numpy(float).reshape(x.shape) for column in table.columns[2:]}
    used = f"{len(models)} models" if models else "one model"
    title = f"{name}: the worst of {places.headings} headings on {used}; grey: no number"
    files = [write_csv(table, out / "map.csv"), save(map_figure(terrain, *places[:3], bands, title), out / "map.png")]
    raster = Path(str(settings.get("terrain.path", "")))
    if raster.suffix.lower() in GEOTIFF:
        corner = float(places.x[0]), float(places.y[0])
        files.append(write_geotiff(out / "map.tif", raster, corner, places.spacing, bands))
    # The map itself chooses the starts. Its default law of the side force differs from that of the scenario.
    assumptions = [entry for entry in first.assumptions if entry.name not in START]
    if not models and "side" not in of_file:
        assumptions.append(Assumption("side", "combined", "", None, "usual for maps: the rover also slides sideways"))
    # The last column is the fraction of the models on which the rover gets stuck at a place.
    stuck, counts = table.columns[-1], f"{len(places.x)} by {len(places.y)}"
    alone = "" if len(models) > 1 else " (one model was driven, so this is not a probability)"
    return table, {
        "places": f"{counts}, every {places.spacing:.3g} m from x = {places.x[0]:.3g} m, y = {places.y[0]:.3g} m",
        "headings": f"{places.headings}; each number is the largest over the headings",
        "models": len(models) or 1,
        stuck: f"above 0 at {int((table[stuck] > 0.0).sum())} of {len(table)} places{alone}",
        **{f"max_{column}": float(table[column].max()) for column in ("slope_deg", "roughness_mm", "slip")},
        "median_energy_J_per_m": float(table["energy_J_per_m"].median()),
        "duration_s": first.duration,
        **drives.summary(),
        "assumed": list(first.assumed),
        "assumptions": assumptions,
        "files": [str(file) for file in files],
    }


def places_on(first: Scenario, chosen: MapSettings = MapSettings()) -> Places:
    """Return the places on a scenario's terrain at which the drives of a map start.

    If the terrain is a height grid, each place is so far from the border that a drive cannot reach the border. Along an
    axis on which the terrain is infinite, all places are at 0.

    Raises ParameterError if the spacing or the number of headings is out of bounds, or if the terrain is too small.
    """
    rover, extent = first.model.rover, first.model.terrain.extent
    # A drive needs its own length in every direction, plus the rover's size and a wheel radius at its end.
    reach = cruise_speed(rover, first.model.motor) * first.duration + float(
        np.linalg.norm(corners(rover), axis=-1).max()
    )
    margin = reach + float(rover.radii.max()) if isinstance(first.model.terrain, HeightGrid) else 0.0
    sides = []
    for terrain_ends, box_ends in ((extent[:2], chosen.box[:2]), (extent[2:], chosen.box[2:])):
        side = (max(terrain_ends[0] + margin, box_ends[0]), min(terrain_ends[1] - margin, box_ends[1]))
        sides.append(side if np.all(np.isfinite(side)) else (0.0, 0.0))
    if any(low > high for low, high in sides):
        raise ParameterError(
            f"There is no place for a drive: the ground reaches from x = {extent[0]:.3g} to {extent[1]:.3g} m and from "
            f"y = {extent[2]:.3g} to {extent[3]:.3g} m, and each drive must start at least {margin:.2g} m inside its "
            "border. Give a box inside this area, a larger terrain, or a shorter duration."
        )
    spacing, headings = chosen.spacing, chosen.headings
    if not (math.isfinite(spacing) and spacing >= 0.0 and 1 <= headings <= 360):
        raise ParameterError(
            f"spacing = {spacing:g} m with {headings} headings is not allowed: "
            "give a spacing above 0 m, or 0 for the usual spacing, and 1 to 360 headings."
        )
    # If each place gets an equal part of the area, this spacing gives USUAL_PLACES places.
    spacing_for_usual = math.sqrt(math.prod(high - low for low, high in sides) / USUAL_PLACES)
    spacing = spacing or max(base_of(rover).length, spacing_for_usual)
    # The grid is centred in the area. Without 1e-9, round-off could remove a place exactly at the border.
    counts = [int((high - low) / spacing + 1e-9) + 1 for low, high in sides]
    x, y = (
        np.round(0.5 * (low + high) + spacing * (np.arange(count) - 0.5 * (count - 1)), 6)
        for (low, high), count in zip(sides, counts, strict=True)
    )
    return Places(x, y, spacing, headings)


def drive_from(study: Study, case: Case) -> dict[str, Any]:
    """Simulate the drive of one case of the sweep, and return its results in a dict.

    The keys are `slip`, `energy_J_per_m`, `stuck` (whether the rover gets stuck) and `outcome` (a sentence). The case
    states the place, the heading and, if there are several models, the model.
    """
    settings = {**study.settings, **{name: value for name, value in case.values.items() if name not in START}}
    # The scenario is the same for all places, and only the start changes.
    start = Start(*(float(case.values[name]) for name in START))
    drive = dataclasses.replace(_cached_scenario(study.scenario, canonical(settings), study.trust), start=start)
    try:
        trace = drive.drive(measure_error=False)
    # A rover that finds no static equilibrium at this place counts as stuck there.
    except SimulationError as error:
        return {"slip": None, "energy_J_per_m": None, "stuck": True, "outcome": str(error)}
    outcome, ways, energy = drive_outcome(trace), wheel_paths(trace), float(trace["energy_electric"][-1])
    turned, travelled = float(ways.turned[-1]), float(ways.travelled[-1])
    return {
        "slip": 1.0 - travelled / turned if turned > 0.0 else None,
        "energy_J_per_m": energy / travelled if travelled > 0.0 else None,
        "stuck": travelled <= 0.0 or outcome.kind in FAILED if outcome else None,
        "outcome": outcome.sentence if outcome else None,
    }


@lru_cache(maxsize=1)
def _cached_scenario(name: str, settings: str, trust: Trust) -> Scenario:
    """Return a scenario from its name and its settings, which are given as a JSON text.

    The last scenario is kept in memory. Consecutive drives of a map use the same model, so that the scenario of each
    model is built only once.
    """
    return dataclasses.replace(scenario(name, **json.loads(settings), trust=trust), symmetric=False)
