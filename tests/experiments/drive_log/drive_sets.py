"""Small drive logs of the package's own simulator, with something hidden or nothing: to test the loop's ways."""

import dataclasses
import math

import numpy as np

from rover_pin import Model, Motor, load_rover, simulate
from rover_pin.base.quantity import as_table
from rover_pin.discrepancy.search import calibrate
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.experiments.drive_log.calibrate import experiment_on
from rover_pin.experiments.drive_log.model import DRIVEN_SAND
from rover_pin.experiments.drive_log.resume import Memory
from rover_pin.logs.drive_log import LogMetadata, write_drive_log
from rover_pin.simulation.model.defaults import usual_angles, usual_slip
from rover_pin.simulation.model.model import base_effects
from rover_pin.simulation.model.motor import nexus6_motor
from rover_pin.simulation.sensors import Sensors, measure
from rover_pin.simulation.start import Start
from rover_pin.soil.wheel_forces import TorqueTraction
from rover_pin.terrain.files import write_terrain
from rover_pin.terrain.terrain import Lanes, Profile


def base(name="nexus6", waves=0.012):
    """The declared model: waves of 12 mm, then a slope of 5 deg; the cart's motors are of its own weight."""
    x = np.arange(-1.5, 1.51, 0.06)
    z = waves * np.sin(2 * np.pi * x / 0.8) + np.where(x > 0.2, (x - 0.2) * math.tan(math.radians(5)), 0.0)
    rover = load_rover(name)
    motor = nexus6_motor() if name == "nexus6" else Motor(resistance=3.0)
    effects = base_effects(DRIVEN_SAND, rover, SoilTraction(TorqueTraction(), usual_angles(rover)))
    return Model(rover, Lanes((Profile(x, z),), ()), (DRIVEN_SAND,), motor, usual_slip(rover), effects)


def plan(random, duration, wheels=6, shortest=1.5, longest=3.0):
    """Duties held for some seconds, wheels apart from each other."""
    holds, t = [], 0.0
    while t < duration:
        holds.append((t, random.uniform(0.4, 0.85) + random.uniform(-0.09, 0.09, wheels)))
        t += random.uniform(shortest, longest)
    return lambda reading: next(duty for start, duty in reversed(holds) if start <= reading.t + 1e-9)


def write(folder, hidden=(), runs=4, duration=10.0, seed=0, rover="nexus6", extra=None, waves=0.012, **truth):
    """Write a log whose soil is off by what its declared SD allows, with `extra(drive)` channels; return the folder."""
    random, model = np.random.default_rng(seed), base(rover, waves)
    soil = DRIVEN_SAND.replace(phi=DRIVEN_SAND.phi + math.radians(1.0), k=1.15 * DRIVEN_SAND.k, **truth)
    true = model.replace(soils=(soil,))
    for effect in hidden:
        true = true.having(effect)
    traces = {}
    for run in range(runs):
        start = Start(-0.5, 0.0, 0.0) if run % 2 == 0 else Start(0.6, 0.0, math.pi)
        driven = simulate(true, plan(random, duration, len(model.rover.wheels)), duration, start)
        log = measure(driven, Sensors(), 100 * seed + run, true.sensor_effects)
        channels = {**log.channels, **(extra(driven) if extra else {})}
        traces[f"run-{run}"] = dataclasses.replace(log, channels=channels, attrs={"start": dataclasses.asdict(start)})
    terrain = write_terrain(folder, model.terrain)
    declared_soil = {name: as_table(DRIVEN_SAND)[name] for name in ("phi", "k", "k_1")}
    wheels = tuple(wheel.name for wheel in model.rover.wheels)
    metadata = LogMetadata(
        "small", rover=rover, wheels=wheels, terrain=terrain, soil=declared_soil, motor=as_table(model.motor)
    )
    return write_drive_log(folder, traces, metadata)


def calibrated_on(log, model, memory=Memory()):
    """The model fitted to a log."""
    return calibrate(*experiment_on(log, model, memory=memory))
