"""Runs that are driven twice, by the blind generator in one batch and by the package one after the other, from the
package's state at rest.
"""

import importlib
import importlib.util
import sys
from pathlib import Path

import numpy as np

from rover_pin.simulation.command import Command
from rover_pin.simulation.simulate import Timing, simulate
from rover_pin.simulation.start import Start, settled_state

HERE = Path(__file__).parent / "blind"
if "blind" not in sys.modules:
    _spec = importlib.util.spec_from_file_location("blind", HERE / "__init__.py")
    sys.modules["blind"] = importlib.util.module_from_spec(_spec)
    _spec.loader.exec_module(sys.modules["blind"])
campaign, drive, rover, vehicle = (
    importlib.import_module(f"blind.{name}") for name in ("campaign", "drive", "rover", "vehicle")
)

LIMITS = {"place": 0.3e-3, "angle": 0.6e-3, "rate": 2e-3, "speed": 0.8e-3, "current": 0.4e-3, "voltage": 2e-3}
"""A fifth of the noise [SI]; places and angles at their worst, the others rms over the drive."""


def tracks(seed=7):
    """Return four runs of a campaign (lanes, border, start, duty, steer): all except those on level ground."""
    random = np.random.default_rng(seed)
    heights = campaign.bed(random)
    lane_list = []
    for _, _, lane, yaw, duty, steer in campaign.drives(random)[2:]:
        pair = heights[[1, 1]] if lane == campaign.RAMP else heights[[2, 3]]
        rough = campaign.relief(random)
        lanes = tuple(
            (campaign.FINE, np.interp(campaign.FINE, campaign.X, z) + r) for z, r in zip(pair, rough, strict=True)
        )
        x = -0.5 if yaw == 0.0 else 0.5
        lane_list.append((lanes, (lane,), (x, lane, yaw), duty, steer))
    return lane_list


def both(models, runs, duration, timing=Timing(), of=vehicle.NEXUS6):
    """Return, for each run, the channels of the generator and the trace of the package, and the package's model with
    equal numbers.
    """
    theirs, rests = [], []
    for model, run in zip(models, runs, strict=True):
        state = settled_state(model, Start(*run.start))

        def command(reading, run=run):
            at = round(reading.t / 0.05)
            return Command(run.duty[at], run.steer[at]) if of.steered else Command(run.duty[at])

        theirs.append(simulate(model, command, duration, state.copy(), timing))
        rests.append((model, state))
    mine = drive.drive(runs, duration, start=states(rover.Rovers(runs, of), rests), vehicle=of)
    mine["body_yaw"] = np.unwrap(mine["body_yaw"], axis=1)
    return [({name: values[i] for name, values in mine.items()}, trace) for i, trace in enumerate(theirs)]


def states(rovers, rests):
    """Return states of the package as one state of the batch."""
    columns, count = [], rovers.count
    for model, state in rests:
        joints = [model.rover.model.joints[model.rover.model.getJointId(name)] for name in rovers.tree.names]
        angles = [
            state.q[at.idx_q] if at.nq == 1 else np.arctan2(state.q[at.idx_q + 1], state.q[at.idx_q]) for at in joints
        ]
        x, y, z, w = state.q[3:7]
        dug = state.contact[:, 2] if state.contact.shape[1] > 2 else np.zeros(count)
        fast = [np.zeros(rovers.size), state.contact[:, 0], state.contact[:, 1], dug, np.zeros(2 * count + 1)]
        columns.append((state.q[:3], [w, x, y, z], angles, np.concatenate(fast)))
    return drive.State(*(np.array(part, dtype=float).T for part in zip(*columns, strict=True)))


def difference(mine, theirs, of=vehicle.NEXUS6):
    """Return the differences by the names in LIMITS."""

    def worst(names):
        return max(float(np.abs(mine[name] - theirs[name]).max()) for name in names)

    def rms(names):
        return max(float(np.sqrt(np.mean((mine[name] - theirs[name]) ** 2))) for name in names)

    return {
        "place": worst([f"body_{axis}" for axis in "xyz"]),
        "angle": worst(["body_roll", "body_pitch", "body_yaw", *of.angles]),
        "rate": rms([f"wheel_rate_{wheel}" for wheel in of.wheels]),
        "speed": rms([f"body_v{axis}" for axis in "xyz"]),
        "current": rms([f"current_{wheel}_A" for wheel in of.wheels]),
        "voltage": rms(["battery_V"]),
    }


def assert_alike(mine, theirs, limits=LIMITS, of=vehicle.NEXUS6):
    off = {name: value for name, value in difference(mine, theirs, of).items() if value > limits[name]}
    assert off == {}, (off, limits)
