"""Measure the cost of an hour of driving, from a user's CSV to the report: import-log, check-data and close-loop.

    python studies/benchmarks/long_log.py [--quick]

The recording is made by the package's own simulator: the shipped cart drives to and fro over waves and slopes for an
hour at 10 Hz. It has wheel rates and a pose with noise and drift, and nothing else is declared. `import-log` keeps the
twelve most informative parts and reports their share of the recording; `close-loop` runs on those with two workers.
Times are wall time and CPU time, workers included; if other work runs, the wall time is not meaningful.
"""

from __future__ import annotations

import argparse
import math
import os
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from former import ROOT
from process_cost import timed

from rover_pin.base.files.table import columns_text
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.rover.rover import load_rover
from rover_pin.simulation.command import Controller
from rover_pin.simulation.model.defaults import own_motor, own_soil, usual_angles, usual_slip
from rover_pin.simulation.model.model import Model, base_effects
from rover_pin.simulation.sensors import Sensors, measure
from rover_pin.simulation.simulate import simulate
from rover_pin.simulation.stepping.timing import Timing
from rover_pin.soil.wheel_forces import TorqueTraction
from rover_pin.terrain.terrain import Lanes, Profile

HOUR, LEG, HOLD = 3600.0, 40.0, 4.0
"""Duration of the whole drive (HOUR), duration of one leg in one direction (LEG), and time for which a duty is held
(HOLD) [s]."""
DRIFT = 5e-4
"""Standard deviation of the drift of the measured pose after one second [m]. The drift grows with the square root of
the time."""


def main() -> None:
    """Record the drive, run the three commands, and print their times."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="two minutes of driving instead of an hour")
    seconds = 120.0 if parser.parse_args().quick else HOUR
    with TemporaryDirectory() as folder:
        recorded(Path(folder) / "drive.csv", seconds)
        # The three commands in the order in which a user runs them.
        for words in (
            ("import-log", "drive.csv", "--rover", "cart", "--out", "log"),
            ("check-data", "log"),
            ("close-loop", "log", "--out", "out", "--workers", "2"),
        ):
            report(words, Path(folder))


def recorded(path: Path, seconds: float) -> None:
    """Write a drive to and fro as a user's CSV."""
    random, rover = np.random.default_rng(4), load_rover("cart")
    soil, x = own_soil(rover).value, np.arange(-20.0, 20.01, 0.1)
    z = 0.05 * np.sin(2 * np.pi * x / 3.1) + 0.3 * np.sin(2 * np.pi * x / 17.0)
    effects = base_effects(soil, rover, SoilTraction(TorqueTraction(), usual_angles(rover)))
    model = Model(rover, Lanes((Profile(x, z),)), (soil,), own_motor(rover).value, usual_slip(rover), effects)
    driven = simulate(model, plan(random, seconds), seconds, timing=Timing(sample=0.1), measure_error=False)
    log = measure(driven, Sensors(), 1)
    pose_columns = ("t_s", "body_x", "body_y", "body_z", "body_roll", "body_pitch", "body_yaw")
    table = {name: log[name] for name in (*pose_columns, *(f"wheel_rate_{wheel.name}" for wheel in rover.wheels))}
    # A random walk of the position, as of a tracker whose calibration drifts.
    for axis in ("body_x", "body_y"):
        table[axis] = table[axis] + np.cumsum(DRIFT * math.sqrt(0.1) * random.normal(size=len(log.t)))
    path.write_text(columns_text(table))


def plan(random: np.random.Generator, seconds: float) -> Controller:
    """Return a controller with duties that hold for HOLD seconds, forward on one leg and backward on the next."""
    duties = random.uniform(0.4, 0.85, (int(seconds / HOLD) + 1, 1)) + random.uniform(-0.05, 0.05, (1, 4))
    return lambda reading: duties[int(reading.t / HOLD)] * (1.0 if int(reading.t / LEG) % 2 == 0 else -1.0)


def report(words: tuple[str, ...], folder: Path) -> None:
    """Print the cost of a command, and the line of its output with its result."""
    completed, cpu, clock = timed(words, ROOT, folder)
    completed.check_returncode()
    print(f"{words[0]}: {clock:.0f} s on the clock, {cpu:.0f} s of CPU, load {os.getloadavg()[0]:.1f}")
    print(
        "\n".join(
            f"    {line.strip()}" for line in completed.stdout.splitlines() if "kept" in line or "log" in line[:12]
        )
    )


if __name__ == "__main__":
    main()
