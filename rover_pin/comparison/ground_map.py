"""Ground as a rover finds it: a short drive of the whole model at each place and heading, on one model or several."""

import dataclasses
import json
import math
from collections.abc import Mapping, Sequence
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
from rover_pin.scenarios.scenario import Scenario, scenario
from rover_pin.simulation.outcome.outcome import drive_outcome, ways_of
from rover_pin.simulation.start.place import Start
from rover_pin.sweep.axis import Values
from rover_pin.sweep.plan import Grid
from rover_pin.sweep.run import sweep
from rover_pin.sweep.study import Case, Study, canonical
from rover_pin.terrain.raster import GEOTIFF, write_geotiff
from rover_pin.terrain.roughness import slope_and_roughness
from rover_pin.terrain.terrain import HeightGrid

PLACE = ("start.x", "start.y", "start.yaw")
USUAL_PLACES = 200
"""Places about, where no spacing is given: half a minute to a minute of CPU a model."""


class Places(NamedTuple):
    """Where drives begin: x and y [m], evenly `spacing` [m] apart, and how many headings around each place."""

    x: np.ndarray
    y: np.ndarray
    spacing: float
    headings: int = 8


def ground_map(
    name: str,
    settings: Mapping[str, Any],
    models: Sequence[str | Path],
    out: Path,
    places: Mapping[str, Any] = {},
    trust: Trust = Trust(),
    workers: int | None = None,
    scheduler: str | None = None,
) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Drive a scenario's rover from places all over its ground, straight on in several headings, on each model.

    A drive begins at rest, as soil and load have it, under the scenario's control, and lasts until rims at their speed
    without load would have come the rover's length, the last wheels to where the first stood; or as long as the
    setting `duration`. Slip is 1 less the wheels' way over what their rims turn, as of `drive_outcome`; energy is
    electric, per metre that the wheels travel; stuck is who does not get on in the end (`bands.FAILED`), whose wheels
    come no way on, or who cannot be set down there.

    Parameters
    ----------
    name, settings
        As of `scenario`; plain numbers and words. The side force is `combined` where nothing else is said: across a
        slope wheels go sideways.
    models : sequence of path
        Files of equally probable models; none: that of the settings.
    out : path
        Of map.csv, map.png and, where the ground is a GeoTIFF, map.tif in its coordinates; and of the drives, as of
        `sweep`: a map that was stopped goes on there.
    places : mapping
        As of `places_on`.
    trust, workers, scheduler
        As of `scenario` and `sweep`.

    Returns
    -------
    table : DataFrame
        A row a place: slope and roughness over the rover's length (`slope_and_roughness`), and the largest over the
        headings of slip and energy per metre, medians over the models, with several of them also what 95 % stay
        below, and of the share of them on which it is stuck: `p_stuck`. One model gives `stuck`, 0 or 1.
    summary : dict
        What the map is of, its extremes, and the files.

    Raises
    ------
    ParameterError
        What `scenario`, `places_on` and `sweep` refuse.
    """
    settings = settings if models else {"side": "combined", **settings}
    axes = {"model": Values([str(file) for file in models])} if models else {}
    first = scenario(name, **settings, **{axis: values.values[0] for axis, values in axes.items()}, trust=trust)
    length, terrain = base_of(first.model.rover).length, first.model.terrain
    if "duration" not in settings:
        first = dataclasses.replace(first, duration=length / cruise_speed(first.model.rover, first.model.motor))
    chosen = places_on(first, **places)
    yaws = [2.0 * math.pi * at / chosen.headings for at in range(chosen.headings)]
    axes |= dict(zip(PLACE, map(Values, (chosen.x.tolist(), chosen.y.tolist(), yaws)), strict=True))
    study = Study("map", name, axes, Grid(), settings={**settings, "duration": first.duration}, trust=trust)
    drives = sweep(study, out, workers=workers, scheduler=scheduler, case_function=drive_from, picture=False)
    at_x, at_y = np.meshgrid(chosen.x, chosen.y, indexing="ij")
    slope, roughness = slope_and_roughness(terrain, at_x, at_y, length)
    ground = {"slope_deg": np.degrees(slope).ravel(), "roughness_mm": 1e3 * roughness.ravel()}
    index = pd.MultiIndex.from_product([chosen.x, chosen.y], names=["x_m", "y_m"])
    table = pd.DataFrame(ground, index=index).join(_worst(drives.table, len(models))).reset_index()
    bands = {column: table[column].to_numpy(float).reshape(at_x.shape) for column in table.columns[2:]}
    summary = {**_summary(table, chosen, len(models)), "duration_s": first.duration, **drives.summary()}
    on = f"{len(models)} models" if models else "one model"
    title = f"{name}: the worst of {chosen.headings} headings on {on}; grey: no number"
    files = [write_csv(table, out / "map.csv"), save(map_figure(terrain, *chosen[:3], bands, title), out / "map.png")]
    raster = Path(str(settings.get("terrain.path", "")))
    if raster.suffix.lower() in GEOTIFF:
        corner = float(chosen.x[0]), float(chosen.y[0])
        files.append(write_geotiff(out / "map.tif", raster, corner, chosen.spacing, bands))
    return table, {**summary, "assumed": list(first.assumed), "files": [str(file) for file in files]}


def places_on(
    first: Scenario, spacing: float = 0.0, headings: int = 8, box: Sequence[float] = (-math.inf, math.inf) * 2
) -> Places:
    """Return places all over a scenario's ground, or in a box: x from, to, y from, to [m].

    They keep a drive's reach from the border of a height grid; ground without end along y is driven at y = 0. Spacing 0
    is the rover's length, or more where that were over USUAL_PLACES.

    Raises ParameterError: numbers out of bounds, or ground too small for a drive.
    """
    rover, extent = first.model.rover, first.model.terrain.extent
    reach = cruise_speed(rover, first.model.motor) * first.duration + float(
        np.linalg.norm(corners(rover), axis=-1).max()
    )
    margin = reach + float(rover.radii.max()) if isinstance(first.model.terrain, HeightGrid) else 0.0
    sides = [
        (max(at[0] + margin, at[2]), min(at[1] - margin, at[3]))
        for at in (extent[:2] + tuple(box[:2]), extent[2:] + tuple(box[2:]))
    ]
    sides = [side if np.all(np.isfinite(side)) else (0.0, 0.0) for side in sides]
    if any(low > high for low, high in sides):
        raise ParameterError(
            f"There is no place for a drive: the ground reaches from x = {extent[0]:.3g} to {extent[1]:.3g} m and y = "
            f"{extent[2]:.3g} to {extent[3]:.3g} m, and a drive needs {margin:.2g} m to its border; give a box within, "
            "larger ground, or a shorter duration."
        )
    if not (math.isfinite(spacing) and spacing >= 0.0 and 1 <= headings <= 360):
        raise ParameterError(
            f"spacing = {spacing:g} m with {headings} headings is not allowed: give metres above 0, and 1 to 360."
        )
    widest = math.sqrt(math.prod(high - low for low, high in sides) / USUAL_PLACES)
    spacing = spacing or max(base_of(rover).length, widest)
    x, y = (
        np.round(0.5 * (low + high) + spacing * (np.arange(count) - 0.5 * (count - 1)), 6)
        for low, high in sides
        for count in [int((high - low) / spacing + 1e-9) + 1]
    )
    return Places(x, y, spacing, headings)


def drive_from(study: Study, case: Case) -> dict[str, Any]:
    """Return slip, energy per metre and whether it does not get on, of the study's drive from the case's place."""
    settings = {**study.settings, **{name: value for name, value in case.values.items() if name not in PLACE}}
    start = Start(*(float(case.values[name]) for name in PLACE))
    drive = dataclasses.replace(_of_model(study.scenario, canonical(settings), study.trust), start=start)
    try:
        trace = drive.drive(measure_error=False)
    except SimulationError as error:
        return {"slip": None, "energy_J_per_m": None, "stuck": True, "outcome": str(error)}
    outcome, ways, energy = drive_outcome(trace), ways_of(trace), float(trace["energy_electric"][-1])
    turned, travelled = float(ways.turned[-1]), float(ways.travelled[-1])
    return {
        "slip": 1.0 - travelled / turned if turned > 0.0 else None,
        "energy_J_per_m": energy / travelled if travelled > 0.0 else None,
        "stuck": travelled <= 0.0 or outcome.kind in FAILED if outcome else None,
        "outcome": outcome.sentence if outcome else None,
    }


@lru_cache(maxsize=1)
def _of_model(name: str, settings: str, trust: Trust) -> Scenario:
    """Return the scenario on a model, whose places come one after the other."""
    return dataclasses.replace(scenario(name, **json.loads(settings), trust=trust), symmetric=False)


def _worst(drives: pd.DataFrame, models: int) -> pd.DataFrame:
    """Return the largest numbers over the headings by place, quantiles over the models; no way on costs infinitely."""
    numeric = dict.fromkeys(("slip", "energy_J_per_m", "stuck"), float)
    done = drives[drives["error"].isna()].astype(numeric).fillna({"energy_J_per_m": math.inf})
    headings = done.groupby(list(PLACE))
    quantiles = {"": 0.5, "_95": 0.95} if models > 1 else {"": 0.5}
    numbers = {
        f"{name}{end}": headings[name].quantile(share, interpolation="higher")
        for end, share in quantiles.items()
        for name in ("slip", "energy_J_per_m")
    }
    numbers["p_stuck" if models > 1 else "stuck"] = headings["stuck"].mean()
    return pd.DataFrame(numbers).groupby(level=[0, 1]).max().rename_axis(["x_m", "y_m"])


def _summary(table: pd.DataFrame, places: Places, models: int) -> dict[str, Any]:
    stuck, counts = table.columns[-1], f"{len(places.x)} by {len(places.y)}"
    alone = "" if models > 1 else ": by one model's numbers alone, which is no probability"
    return {
        "places": f"{counts}, every {places.spacing:.3g} m from x = {places.x[0]:.3g} m, y = {places.y[0]:.3g} m",
        "headings": f"{places.headings}, each number the largest of them",
        "models": models or 1,
        stuck: f"above 0 at {int((table[stuck] > 0.0).sum())} of {len(table)} places{alone}",
        **{f"max_{name}": float(table[name].max()) for name in ("slope_deg", "roughness_mm", "slip")},
        "median_energy_J_per_m": float(table["energy_J_per_m"].median()),
    }
