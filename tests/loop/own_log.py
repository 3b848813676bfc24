"""Drive logs as a user writes them: any scenario and rover, duties of one's own, read by sensors or exactly."""

import dataclasses

import numpy as np

from rover_pin import scenario
from rover_pin.logs.drive_log import read_drive_log, write_drive_log
from rover_pin.simulation.sensors import Sensors, measure
from tests.experiments.drive_log.drive_sets import plan


def write(folder, name="field", runs=4, seconds=16.0, seed=0, sensors=Sensors(), left_out=(), **settings):
    """Write a log of a scenario's drives with nothing hidden, and leave tables of drive.toml out; return the folder.

    `sensors` None: every digit of the drive is logged. The last run repeats the first where there are more than three.
    """
    random, scene, traces = np.random.default_rng(seed), scenario(name, **settings), {}
    plans = [plan(random, seconds, len(scene.model.rover.wheels), 2.5, 4.5) for _ in range(runs)]
    plans[-1] = plans[0] if runs > 3 else plans[-1]
    for at, controller in enumerate(plans, 1):
        changed_scene = dataclasses.replace(scene, controller=controller, duration=seconds, symmetric=False)
        trace = changed_scene.drive()
        if sensors is not None:
            trace = dataclasses.replace(
                measure(trace, sensors, int(random.integers(2**31))),
                attrs={"start": dataclasses.asdict(changed_scene.start)},
            )
        traces[f"run-{at}"] = trace
    scene.write_log(trace, folder)
    metadata = dataclasses.replace(read_drive_log(folder).metadata, **{key: {} for key in left_out})
    (folder / "run.csv").unlink()
    return write_drive_log(folder, traces, metadata)
