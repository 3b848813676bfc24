"""Measure the replay of a 20 s log, against the package before its whole step was compiled, and the cold compilation.

    python studies/benchmarks/replay_speed.py [--quick] [--keep]

The log comes from the ready-made drive on the ditch (six points a lane) and on a washboard (a polyline of 243). Each
version replays its own log. Times are CPU seconds of one process for each version, alternating on one core, the minimum
of several replays. The distance is the maximum over all channels, each in its unit. Compilation starts from an empty
cache: the step, once for each machine; the rigid body, once for each tree of joints; the laws, once for each set of
effects.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from former import ROOT, checkout
from speed_table import keep, reader

BEFORE = "f624ee7"
"""The last commit whose replay called each time step from Python, took the matrices from Pinocchio, and evaluated the
contact law of one patch at a time."""
SHAPES = ("ditch", "washboard")
REPLAY = """
import json, sys, time
import numpy as np
try:
    from rover_pin.simulation.start import shared_rest as settled
    from rover_pin.simulation.replay import commands, replay
    from rover_pin.scenarios.scenario import scenario
    begun = "rest_state"
except ImportError:  # in the former version
    from rover_pin.motion.place import settled
    from rover_pin.motion.replay import commands, replay
    from rover_pin.scenarios import scenario
    begun = "rest"
shape, repeats, folder = sys.argv[1], int(sys.argv[2]), sys.argv[3]
case = scenario(shape, soil="table-1", duration=20.0)
rover = case.model.rover
steered = tuple(wheel.name for wheel in rover.wheels if wheel.steer_dof is not None)
run = commands(case.drive(), tuple(wheel.name for wheel in rover.wheels), steered)
rest, times = settled(case.model, run.start), []
for _ in range(1 + repeats):
    begin = time.process_time()
    made = replay(case.model, run, **{begun: rest})
    times.append(time.process_time() - begin)
np.savez(folder, **made.channels)
print(json.dumps(min(times[1:])))
"""
COMPILE = """
import json, resource
from rover_pin.simulation.compiled.generated_laws import compiled_laws, structure_of
from rover_pin.simulation.native.compiled_body import KeyedModel, compiled_body
from rover_pin.simulation.compiled.kernel import library
from rover_pin.scenarios.scenario import scenario
model = scenario("ditch", soil="table-1").model
def spent():
    uses = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(use.ru_utime + use.ru_stime for use in uses)
told = {}
for name, make in {
    "the step": library,
    "a rigid body": lambda: compiled_body(KeyedModel.of(model.built.model)),
    "a set of laws": lambda: compiled_laws(structure_of(model)),
}.items():
    begin = spent()
    make()
    told[name] = spent() - begin
print(json.dumps(told))
"""


def main() -> None:
    """Measure replay and compilation, and print them; with --keep, store them in speed.csv."""
    options, measured = reader(__doc__, "fewer repeats").parse_args(), {}
    rounds, repeats = (1, 3) if options.quick else (3, 10)
    # One core only, so that times do not depend on migration between cores.
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    with checkout(BEFORE) as former, tempfile.TemporaryDirectory() as folder:
        for shape in SHAPES:
            times: dict[Path, list[float]] = {former: [], ROOT: []}
            for _ in range(rounds):
                for package, samples in times.items():
                    samples.append(_child(package, REPLAY, shape, str(repeats), f"{folder}/{package.name}"))
            before, now = (min(samples) for samples in times.values())
            measured |= {f"{shape} [ms]": 1e3 * now, f"{shape}, former over now [x]": before / now}
            off = _apart(*(np.load(f"{folder}/{package.name}.npz") for package in times))
            print(
                f"{shape}, 20 s replayed: {1e3 * now:.1f} ms, {20.0 / now:.0f} x real time; "
                f"at {BEFORE} {1e3 * before:.1f} ms, {before / now:.2f} times as long; "
                f"channels differ by {off:.1e} at most"
            )
    with tempfile.TemporaryDirectory() as empty:
        spent = _child(ROOT, COMPILE, cache=empty)
    parts = ", ".join(f"{name} {seconds:.1f} s" for name, seconds in spent.items())
    print(f"compiled cold, CPU with what writes the C: {parts}; {sum(spent.values()):.1f} s in all")
    if options.keep:
        keep(measured | {f"compiling {name} [s]": seconds for name, seconds in spent.items()})


def _child(package: Path, code: str, *arguments: str, cache: str = "") -> Any:
    """Run code with a version of the package; return the printed JSON value."""
    variables = {"PYTHONPATH": str(package), **({"ROVER_PIN_CACHE": cache} if cache else {})}
    command = [sys.executable, "-c", code, *arguments]
    done = subprocess.run(
        command, env={**os.environ, **variables}, cwd=package, check=True, capture_output=True, text=True
    )
    return json.loads(done.stdout.splitlines()[-1])


def _apart(first: np.lib.npyio.NpzFile, second: np.lib.npyio.NpzFile) -> float:
    """Return the maximum difference of any channel between two replays."""
    return max(float(np.nanmax(np.abs(first[name] - second[name]))) for name in first.files)


if __name__ == "__main__":
    main()
