"""Where a wheel stands on the border of two lanes of other heights: what carries it there, no log declares."""

import numpy as np

from rover_pin.logs.drive_log import DriveLog
from rover_pin.logs.run_terrain import is_of_run
from rover_pin.rover.rover import Rover
from rover_pin.rover.wheel_base import wheel_places
from rover_pin.simulation.replay import Commands
from rover_pin.simulation.trace.trace import Trace
from rover_pin.terrain.terrain import Lanes, Terrain

STEP = 1e-3
"""Step between lanes [m] from which a wheel on both feels it (assumed: raked sand is no more even)."""


def lanes_under(log: DriveLog, trace: Trace, shared: Terrain) -> Terrain:
    """Return what is declared to lie under a run, its own or the log's `shared`; what is estimated has no lanes."""
    own = trace.attrs.get("terrain")
    declared = log.terrain_of(trace) if own and not is_of_run(own) else None
    return declared or shared


def on_borders(run: Commands, rover: Rover, terrain: Terrain | None) -> np.ndarray:
    """Return in which rows of a run (T,) some wheel, as wide as it is, stands over a step between two lanes."""
    rows = np.zeros(len(run.t), dtype=bool)
    if not isinstance(terrain, Lanes) or not terrain.borders:
        return rows
    x, y, yaw = run.place.T
    places = wheel_places(rover)
    for wheel in rover.wheels:
        ahead, left = places[wheel.name][:2]
        wheel_x, wheel_y = x + ahead * np.cos(yaw) - left * np.sin(yaw), y + ahead * np.sin(yaw) + left * np.cos(yaw)
        for border, right_lane, left_lane in zip(terrain.borders, terrain.profiles, terrain.profiles[1:], strict=False):
            step = np.abs(left_lane.height(wheel_x) - right_lane.height(wheel_x))
            rows |= (np.abs(wheel_y - border) < float(wheel.wheel.b) / 2) & (step > STEP)
    return rows
