"""What an hour of driving costs from somebody's CSV to the report: import-log, check-data and close-loop.

    python studies/benchmarks/long_log.py [--quick]

The recording is of the package's own simulator: the shipped cart drives to and fro over waves and slopes for an hour at
10 Hz, wheel rates and a pose with noise and drift, nothing else told. `import-log` keeps the twelve parts that tell
most and says how many seconds of how many they are; `close-loop` runs on those with two workers. Times are on the clock
and of CPU, workers included; beside other work the clock says little.
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
"""Seconds of the drive, of one way, and for which a duty holds."""
DRIFT = 5e-4
"""How far the pose wanders in a second, growing with the root of time [m]."""


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="two minutes of driving instead of an hour")
    seconds = 120.0 if parser.parse_args().quick else HOUR
    with TemporaryDirectory() as folder:
        recorded(Path(folder) / "drive.csv", seconds)
        for words in (
            ("import-log", "drive.csv", "--rover", "cart", "--out", "log"),
            ("check-data", "log"),
            ("close-loop", "log", "--out", "out", "--workers", "2"),
        ):
            report(words, Path(folder))


def recorded(path: Path, seconds: float) -> None:
    """Write what a drive to and fro looks like in somebody's CSV."""
    random, rover = np.random.default_rng(4), load_rover("cart")
    soil, x = own_soil(rover).value, np.arange(-20.0, 20.01, 0.1)
    z = 0.05 * np.sin(2 * np.pi * x / 3.1) + 0.3 * np.sin(2 * np.pi * x / 17.0)
    effects = base_effects(soil, rover, SoilTraction(TorqueTraction(), usual_angles(rover)))
    model = Model(rover, Lanes((Profile(x, z),)), (soil,), own_motor(rover).value, usual_slip(rover), effects)
    driven = simulate(model, plan(random, seconds), seconds, timing=Timing(sample=0.1), measure_error=False)
    log = measure(driven, Sensors(), 1)
    told = ("t_s", "body_x", "body_y", "body_z", "body_roll", "body_pitch", "body_yaw")
    table = {name: log[name] for name in (*told, *(f"wheel_rate_{wheel.name}" for wheel in rover.wheels))}
    for axis in ("body_x", "body_y"):
        table[axis] = table[axis] + np.cumsum(DRIFT * math.sqrt(0.1) * random.normal(size=len(log.t)))
    path.write_text(columns_text(table))


def plan(random: np.random.Generator, seconds: float) -> Controller:
    """Return duties that hold for a while, ahead on one leg and back on the next."""
    held = random.uniform(0.4, 0.85, (int(seconds / HOLD) + 1, 1)) + random.uniform(-0.05, 0.05, (1, 4))
    return lambda reading: held[int(reading.t / HOLD)] * (1.0 if int(reading.t / LEG) % 2 == 0 else -1.0)


def report(words: tuple[str, ...], folder: Path) -> None:
    """Print what a command costs, and the line that says what was kept or answered."""
    ran, cpu, clock = timed(words, ROOT, folder)
    ran.check_returncode()
    print(f"{words[0]}: {clock:.0f} s on the clock, {cpu:.0f} s of CPU, load {os.getloadavg()[0]:.1f}")
    print("\n".join(f"    {line.strip()}" for line in ran.stdout.splitlines() if "kept" in line or "log" in line[:12]))


if __name__ == "__main__":
    main()
