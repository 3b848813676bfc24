"""The runs that a wheel rig could make next: from braked to nearly spinning, of half to twice the usual load."""

import dataclasses
import itertools
from collections.abc import Sequence

import numpy as np

from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.inference.outlook import Offer
from rover_pin.measurements.rig_set import SAME_LEVEL, SAME_LOAD, STRAIGHT, RigSet
from rover_pin.soil.slip import speed_ratio

SLIPS = (-0.3, 0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
LOADS = (0.5, 1.0, 2.0)
"""Loads as multiples of the usual one: the median, which runs at other loads hardly move."""


def next_runs(sets: Sequence[RigSet]) -> Offer:
    """Return what could be measured next with any of the sets."""
    experiment = RigExperiment(tuple(map(runs_ahead, sets)))
    return Offer(experiment, experiment.noise())


def runs_ahead(data: RigSet) -> RigSet:
    """Return a set of runs not made yet: every slip and load, at each slip angle of a set, by its channels, all 0.

    What was measured is left out, unless all was: what no model has there is the same, only its noise better known.
    """
    usual = float(np.quantile(data.load, 0.5, method="lower"))
    angles = np.unique(np.round(data.slip_angle, 2))
    table = np.array(list(itertools.product(usual * np.array(LOADS), SLIPS, angles)))
    load, slip, angle = table.T[..., None]
    near = (np.abs(slip - data.slip) < SAME_LEVEL) & (np.abs(angle - data.slip_angle) < STRAIGHT)
    new = ~np.any(near & (np.abs(np.log(load / data.load)) < np.log(SAME_LOAD)), axis=1)
    load, slip, angle = (table[new] if new.any() else table).T
    labels = tuple(map(_words, load, slip, angle))
    blank = np.zeros(len(load))
    channels = tuple(type(channel)(blank, np.sqrt(np.mean(channel.sd**2))) for channel in data.channels)
    return dataclasses.replace(
        data, slip=slip, load=load, slip_angle=angle, channels=channels, levels=labels, trials=(), runs=labels,
        speeds=_speeds(data, slip),
    )  # fmt: skip


def _words(load: float, slip: float, angle: float) -> str:
    askew = f", {np.degrees(angle):.0f} deg askew" if angle else ""
    return f"one run at S = {slip:g} under {load:.3g} N{askew}"


def _speeds(data: RigSet, slip: np.ndarray) -> np.ndarray | None:
    """Return travel and rim speeds, Eq (1), the rig's travel speed kept; None where it states none."""
    if data.speeds is None:
        return None
    travel = float(np.median(data.speeds[:, 0]))
    return np.array([(travel, travel / float(speed_ratio(S))) for S in slip])
