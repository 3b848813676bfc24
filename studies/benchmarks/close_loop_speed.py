"""Measure the cost of closing the loop on drive logs: 8 runs of 30 s with a hidden effect, from command to report.

    python studies/benchmarks/close_loop_speed.py [--quick] [--keep] [--against COMMIT]

The logs are made by the package's own simulator: waves and a slope, duties that differ from wheel to wheel, noisy
sensors, soil with an error within its declared SD, and an undeclared tether. `rover-pin close-loop` runs as a separate
process with two workers. CPU seconds include the workers. The wall time is meaningful on two free cores only. An
earlier version (--against) runs on the same logs.
"""

from __future__ import annotations

import dataclasses
import math
import os
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from former import ROOT, checkout
from process_cost import timed
from speed_table import keep, reader

from rover_pin.base.quantity import as_table
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.effects.tether_drag import TetherDrag
from rover_pin.experiments.drive_log.model import DRIVEN_SAND
from rover_pin.logs.drive_log import LogMetadata, write_drive_log
from rover_pin.rover.rover import load_rover
from rover_pin.simulation.command import Reading
from rover_pin.simulation.model.model import Model, base_effects
from rover_pin.simulation.model.motor import nexus6_motor
from rover_pin.simulation.sensors import Sensors, measure
from rover_pin.simulation.simulate import simulate
from rover_pin.simulation.start import Start
from rover_pin.soil.angles import FixedAngles
from rover_pin.soil.wheel_forces import TorqueTraction
from rover_pin.terrain.files import write_terrain
from rover_pin.terrain.terrain import Lanes, Profile

WORKERS = 2


def main() -> None:
    """Measure the cost of the command and print it; with --keep, store it in speed.csv."""
    parser = reader(__doc__, "2 runs of 12 s")
    parser.add_argument("--against", help="an earlier version, from the repository's history")
    options = parser.parse_args()
    runs, duration = (2, 12.0) if options.quick else (8, 30.0)
    with TemporaryDirectory() as folder:
        # All versions run on the same logs, which the present version writes.
        logs = write(Path(folder) / "logs", runs, duration)
        seconds, clock = report(f"close-loop on {runs} runs of {duration:g} s", ROOT, logs)
        if options.against:
            with checkout(options.against) as earlier:
                report(f"the same at {options.against}", earlier, logs)
    if options.keep:
        keep({"close-loop, CPU [s]": seconds, "close-loop, clock [s]": clock})


def write(folder: Path, runs: int, duration: float) -> Path:
    """Write the drive logs of a rover that drags a tether, and return their folder."""
    random, model = np.random.default_rng(11), declared_model()
    soil = DRIVEN_SAND.replace(phi=DRIVEN_SAND.phi + math.radians(1.0), k=1.15 * DRIVEN_SAND.k)
    true = model.replace(soils=(soil,)).having(TetherDrag(f_0=2.0))
    traces = {}
    for run in range(runs):
        # Runs alternate in direction, so that slope and tether can be distinguished.
        start = Start(-1.0, 0.0, 0.0) if run % 2 == 0 else Start(1.0, 0.0, math.pi)
        driven = simulate(true, plan(random, duration), duration, start)
        log = measure(driven, Sensors(), run, true.sensor_effects)
        traces[f"run-{run}"] = dataclasses.replace(log, attrs={"start": dataclasses.asdict(start)})
    declared = {name: as_table(DRIVEN_SAND)[name] for name in ("phi", "k", "k_1")}
    wheels = tuple(wheel.name for wheel in model.rover.wheels)
    terrain = write_terrain(folder, model.terrain)
    metadata = LogMetadata(
        "tether", rover="nexus6", wheels=wheels, terrain=terrain, soil=declared, motor=as_table(model.motor)
    )
    return write_drive_log(folder, traces, metadata)


def declared_model() -> Model:
    """Return the model that the logs declare: waves of 24 mm, then a slope of 5 deg, with a point every 60 mm."""
    x = np.arange(-2.0, 2.81, 0.06)
    z = 0.012 * np.sin(2 * np.pi * x / 0.8) + np.where(x > 0.2, (x - 0.2) * math.tan(math.radians(5.0)), 0.0)
    rover = load_rover("nexus6")
    effects = base_effects(DRIVEN_SAND, rover, SoilTraction(TorqueTraction(), FixedAngles()))
    return Model(rover, Lanes((Profile(x, z),)), (DRIVEN_SAND,), nexus6_motor(), effects=effects)


def plan(random: np.random.Generator, duration: float) -> Callable[[Reading], np.ndarray]:
    """Return a controller with random duties, which hold for 1.5 to 3 s and differ between wheels."""
    holds, t = [], 0.0
    while t < duration:
        holds.append((t, random.uniform(0.4, 0.85) + random.uniform(-0.09, 0.09, 6)))
        t += random.uniform(1.5, 3.0)
    return lambda reading: next(duty for begin, duty in reversed(holds) if begin <= reading.t + 1e-9)


def report(label: str, package: Path, logs: Path) -> tuple[float, float]:
    """Print the cost and the answer of a version of the package on these logs; return CPU and wall time [s]."""
    with TemporaryDirectory() as out:
        words = ["close-loop", str(logs), "--out", out, "--workers", str(WORKERS)]
        completed, seconds, clock = timed(words, package, logs.parent)
    # The answer shows that all versions did the same work.
    answer = next(
        (line for line in completed.stdout.splitlines() if "log" in line or "list" in line), completed.stderr[-300:]
    )
    print(
        f"{label}: {seconds:.0f} s of CPU, {clock:.0f} s on the clock, load {os.getloadavg()[0]:.1f}; {answer.strip()}"
    )
    return seconds, clock


if __name__ == "__main__":
    main()
