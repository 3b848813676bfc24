"""A wheel pressed in without turning, as rows of the same fit: the logarithm of the force at each sinkage."""

from collections.abc import Sequence

import casadi as ca
import numpy as np

from rover_pin.experiments.wheel_rig.model import RigModel
from rover_pin.experiments.wheel_rig.steady_law import pressed_law
from rover_pin.measurements.pressed import Trial

PRESSED = "logarithm of pressing force"
"""The channel; each trial is a fold of it, as sand is prepared anew and may be stiffer by chance."""
GIVES_WAY, LEVEL = 0.05, 0.001
"""SD of a force over it, as sand gives way in steps, and SD of the depth, as it is level [m] (assumed)."""
PRESSING = "rig.pressing_scale"
PRESSING_SD = 0.3
"""SD of ln of how much stiffer sand is under a wheel that is pressed in than under one that rolls (assumed)."""


def log_forces(trials: Sequence[Trial]) -> np.ndarray:
    """Return ln of the forces (trials, 1, samples)."""
    return np.log([[trial.force] for trial in trials])


def log_force_sds(trials: Sequence[Trial]) -> np.ndarray:
    """Return the SD of ln of each force (trials, 1, samples): its own, and the depth's by the trial's slope."""
    slopes = np.array([[np.gradient(np.log(trial.force), trial.sinkage)] for trial in trials])
    return np.hypot(GIVES_WAY, LEVEL * slopes)


def places(trials: Sequence[Trial], inputs: np.ndarray) -> np.ndarray:
    """Return where each sample stands (trials, inputs, samples): its depth over its range where slip is over its own.

    `inputs` [inputs, runs] are those of runs, slip first: a press has none of the others.
    """
    depth = np.array([trial.sinkage for trial in trials])
    share = (depth - depth.min()) / np.ptp(depth)
    table = np.tile(inputs.min(axis=1)[:, None], (len(depth), 1, depth.shape[1]))
    table[:, 0] += share * np.ptp(inputs[0])
    return table


def pressed_in(
    model: RigModel, free: Sequence[str], vector: np.ndarray, trials: Sequence[Trial]
) -> tuple[np.ndarray, np.ndarray]:
    """Return ln of the forces (trials, 1, samples) at these values of all parameters, and slopes (free, ...)."""
    if not trials:
        return np.zeros((0, 1, 0)), np.zeros((len(free), 0, 1, 0))
    depth = np.array([trial.sinkage for trial in trials])
    law = pressed_law(model.structure, tuple(free), depth.size)
    rows = law(ca.DM(depth.reshape(1, -1)), ca.DM(vector)).full().reshape(-1, len(trials), 1, depth.shape[1])
    return rows[0], rows[1:]
