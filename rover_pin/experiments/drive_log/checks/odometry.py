"""A pose that was computed from the wheels: it moves as they turn, and tells nothing of slip."""

from collections.abc import Iterator
from itertools import groupby
from typing import NamedTuple

import numpy as np
from scipy.stats import spearmanr

from rover_pin.experiments.drive_log.checks.driven import Driven, Remarks
from rover_pin.simulation.trace.channels import ODOMETRY

FEW = 50
"""Samples that a judgement needs. Why: chance gives SHARED to one in 60 of them."""
WITHIN = 2.0
"""Times its own noise that such a pose may be away from the wheels' way. Why: sums of noise wander (assumed)."""
ROUND_OFF = 1e-6
"""The same as a share of the way, where a pose has no noise at all. Why: digits of a log."""
RESOLVED = 0.001
"""Noise over way up to which a slip that varies by a percent would show. Why: a tenth of that slip."""
SAME, MAX_EVEN_SLIP = 0.005, 0.05
"""Mean slip up to which the pose is that of the wheels; up to which it may be, with another radius. Why: a radius is
stated to half a percent."""
SHARED = 0.3
"""Correlation of noises from which they are one: wheels on a flat may slip as evenly, but their noise is their own.
Why: the same numbers give 1, noises of their own 0."""


class Followed(NamedTuple):
    """How closely a pose follows the way of the rims."""

    slip: float
    "mean slip of the pose against the rims"
    deviation: float
    "SD of the distance between pose and rims after that slip [m]"
    noise: float
    "white noise of the pose, by its increments [m]"
    way: float
    "of the rims [m]"
    shared: float
    "rank correlation of the changes of both from sample to sample: their noise, which a tracker does not share"

    @property
    def equal(self) -> bool:
        """Whether the pose's increments are those of the rims within its noise, which would show slip."""
        within = self.deviation < max(WITHIN * self.noise, ROUND_OFF * self.way)
        return within and self.noise < RESOLVED * self.way


def odometry_faults(run: Driven) -> Remarks:
    """Yield a pose whose increments are those of the wheels: the loop would find a rover that never slips."""
    if run.trace.attrs.get("place") != ODOMETRY and any(
        comparison.equal and abs(comparison.slip) < SAME and comparison.shared > SHARED for comparison in _rim_fits(run)
    ):
        what = "body_x and body_y move as the wheels turn, within their noise: they are the wheels' odometry"
        todo = "give a pose that was measured otherwise, as by a camera, GNSS or total station; or say place = "
        yield what, f"{todo}'odometry' in drive.toml, and currents, tilts and turn rates alone are compared: no slip"


def odometry_findings(run: Driven) -> Remarks:
    """Yield a pose that may be the wheels' with another radius, or that of wheels that slip evenly all along."""
    if run.trace.attrs.get("place") == ODOMETRY:
        todo = "slip is not known, and what depends on it is as assumed; where it shifts the place bumps mislead"
        yield "the pose is the wheels' odometry", todo
        return
    close = [comparison for comparison in _rim_fits(run) if comparison.equal and abs(comparison.slip) < MAX_EVEN_SLIP]
    if close:
        what = f"body_x and body_y follow the wheels at an even slip of {100 * close[0].slip:.2g} %"
        yield what, "if they are odometry, give a measured pose; else add slopes, where slip varies"


def _rim_fits(run: Driven) -> Iterator[Followed]:
    """Yield how the pose follows the mean of all rims, and of each axle's, whose rates may hold before or after."""
    trace, t = run.trace, run.trace.t
    yaw = trace["body_yaw"]
    half = np.exp(-0.5j * (yaw[1:] + yaw[:-1]))
    step = np.real((np.diff(trace["body_x"]) + 1j * np.diff(trace["body_y"])) * half)
    for wheels in (run.trace.wheels, *_axles(run)):
        rim = run.radius * np.mean([trace[f"wheel_rate_{wheel}"] for wheel in wheels], axis=0)
        for rate in (rim[:-1], rim[1:], 0.5 * (rim[:-1] + rim[1:])):
            rolled = rate * np.diff(t)
            use = np.isfinite(step + rolled)
            if np.sum(use) >= FEW:
                yield _rim_fit(step[use], rolled[use])


def _axles(run: Driven) -> list[tuple[str, ...]]:
    axles = [tuple(wheels) for _, wheels in groupby(run.trace.wheels, key=lambda wheel: wheel[:1])]
    return axles if len(axles) < len(run.trace.wheels) else []


def _rim_fit(step: np.ndarray, rolled: np.ndarray) -> Followed:
    ahead, rims = np.cumsum(step), np.cumsum(rolled)
    spread = rims - rims.mean()
    square = float(spread @ spread)
    share = float(spread @ (ahead - ahead.mean())) / square if square > 0.0 else 0.0
    residual = ahead - share * rims
    noise = float(np.std(np.diff(residual))) / np.sqrt(2.0)
    shared = float(spearmanr(np.diff(step), np.diff(rolled)).statistic) if np.ptp(np.diff(rolled)) > 0.0 else 0.0
    return Followed(1.0 - share, float(np.std(residual)), float(noise), float(np.sum(np.abs(rolled))), shared)
