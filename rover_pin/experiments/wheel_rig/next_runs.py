"""Propose runs that a wheel rig could measure next, from a braked to a nearly spinning wheel, at half to twice the
usual load.

The loop (the search for missing effects) compares these runs by the information that they are expected to give.
"""

import dataclasses
import itertools
from collections.abc import Sequence

import numpy as np

from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.inference.next_measurement import Offer
from rover_pin.measurements.rig_set import SAME_LEVEL, SAME_LOAD, STRAIGHT, RigSet
from rover_pin.soil.slip import speed_ratio

SLIPS = (-0.3, 0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
"""Slips of the proposed runs [-]. A negative slip means that the wheel is braked."""
LOADS = (0.5, 1.0, 2.0)
"""Loads of the proposed runs, as multiples of the median of the measured loads."""


def next_runs(sets: Sequence[RigSet]) -> Offer:
    """Return the runs that could be measured next in all data sets, with the noise that the data sets state.

    The search for missing effects chooses those runs that are expected to give most information.
    """
    experiment = RigExperiment(tuple(map(runs_ahead, sets)))
    return Offer(experiment, experiment.noise())


def runs_ahead(data: RigSet) -> RigSet:
    """Return a data set of runs that could be measured next: all combinations of SLIPS, LOADS and the slip angles of
    `data`.

    The measured values in it are 0. Runs that were already measured are not proposed. If all runs were already
    measured, all are returned, although repeating a run only reduces the noise.
    """
    # The lower median is one of the measured loads.
    usual = float(np.quantile(data.load, 0.5, method="lower"))
    angles = np.unique(np.round(data.slip_angle, 2))
    table = np.array(list(itertools.product(usual * np.array(LOADS), SLIPS, angles)))
    load, slip, angle = table.T[..., None]
    # A run counts as measured if slip, slip angle and load all agree.
    near = (np.abs(slip - data.slip) < SAME_LEVEL) & (np.abs(angle - data.slip_angle) < STRAIGHT)
    new = ~np.any(near & (np.abs(np.log(load / data.load)) < np.log(SAME_LOAD)), axis=1)
    load, slip, angle = (table[new] if new.any() else table).T
    labels = tuple(
        f"one run at S = {S:g} under {W:.3g} N" + (f", {np.degrees(beta):.0f} deg askew" if beta else "")
        for W, S, beta in zip(load, slip, angle, strict=True)
    )
    blank = np.zeros(len(load))
    # The rig keeps its travel speed, and Eq (1) of the paper (slip ratio) gives the rim speed.
    travel = None if data.speeds is None else float(np.median(data.speeds[:, 0]))
    speeds = None if travel is None else np.array([(travel, travel / float(speed_ratio(S))) for S in slip])
    channels = tuple(type(channel)(blank, np.sqrt(np.mean(channel.sd**2))) for channel in data.channels)
    return dataclasses.replace(
        data, slip=slip, load=load, slip_angle=angle, channels=channels, levels=labels, trials=(), runs=labels,
        speeds=speeds,
    )  # fmt: skip
