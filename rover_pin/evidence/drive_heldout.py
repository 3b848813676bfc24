"""Errors on runs that were not fitted: every run predicted from the others, and driven freely from its start."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rover_pin.evidence.drive_bench import Bench
from rover_pin.evidence.drive_fit import STRETCH, DriveFit
from rover_pin.evidence.drive_left_out import refitted_left_out
from rover_pin.evidence.heldout import ChannelScore
from rover_pin.motion.channels import unit_of
from rover_pin.motion.model import Model
from rover_pin.motion.replay import Commands

DRAWS = 2000
"""Resamplings of the bootstrap."""
MADE = {"path": "m", "drift": "m", "heading": "rad", "speed": "m/s"}
"""Units of the features that are made of several channels."""


def drive_scores(before: DriveFit, after: DriveFit, seed: int) -> tuple[ChannelScore, ...]:
    """Return held-out RMSE of every channel before and after, with a block bootstrap of the paired change.

    Every run is predicted from a fit to the others.
    """
    good, noise = after.task.noise.good, after.task.noise
    first = refitted_left_out(before)
    pairs = [np.where(good, one, np.nan) for one in (first, first if after is before else refitted_left_out(after))]
    stretches = _stretches(good.shape[2])
    random = np.random.default_rng(seed)
    draws = random.integers(0, good.shape[0] * len(stretches), (DRAWS, good.shape[0] * len(stretches)))
    found = []
    for row, name in enumerate(after.task.bench.channels):
        squares = [np.nan_to_num(one[:, row] ** 2) for one in pairs]
        sums = [np.array([s[:, part].sum(axis=1) for part in stretches]).ravel() for s in squares]
        count = max(int(good[:, row].sum()), 1)
        drawn = [one[draws].sum(axis=1) for one in sums]
        ratio = np.sqrt(drawn[1] / np.maximum(drawn[0], 1e-300)) - 1
        was, now = (float(np.sqrt(one.sum() / count)) for one in sums)
        low, high = np.quantile(ratio, [0.025, 0.975])
        unit = MADE.get(name) or unit_of(name)
        change = now / max(was, 1e-300) - 1
        found.append(ChannelScore(name, unit, float(noise.sd[row]), was, now, change, float(low), float(high)))
    return tuple(found)


def _stretches(length: int) -> list[slice]:
    return [slice(start, start + STRETCH) for start in range(0, length, STRETCH)]


class FreeRun(NamedTuple):
    """One run driven freely from its start, without being drawn to the log: how far off the place was."""

    run: str
    distance: float
    "driven in the log [m]"
    before: float
    "RMS of the distance from the logged place, base model [m]"
    after: float
    "the same with what was added [m]"


def free_runs(bench: Bench, before: Model, after: Model) -> tuple[FreeRun, ...]:
    """Return how far the free simulations of all runs stray from the log, before and after."""
    strayed = [
        [
            _strayed(run.commands, replay.channels)
            for run, replay in zip(bench.runs, bench.free.replays(model), strict=True)
        ]
        for model in (before, after)
    ]
    return tuple(
        FreeRun(run.name, _distance(run.commands), was, now)
        for run, was, now in zip(bench.runs, strayed[0], strayed[1], strict=True)
    )


def _strayed(run: Commands, channels: dict[str, np.ndarray]) -> float:
    if "body_x" not in channels:
        return float("nan")
    off = np.hypot(channels["body_x"] - run.place[:, 0], channels["body_y"] - run.place[:, 1])
    return float(np.sqrt(np.nanmean(off**2)))


def _distance(run: Commands) -> float:
    steps = run.place[:: max(1, round(1.0 / run.period)), :2]
    return float(np.nansum(np.hypot(*np.diff(steps, axis=0).T)))
