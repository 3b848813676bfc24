"""Check the matched columns of a recording against the rover: wheel radius, wheel track and clocks.

`measured_numbers` puts three numbers into notes for the user: the ratio of rim speed to ground speed, the effective
track, and the delay between the clocks of wheels and position. A wrong radius, computed wheel rates or unsynchronised
clocks would otherwise look like properties of the soil.
"""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from rover_pin.base.formula import change
from rover_pin.importing.evidence import independent, mean_known
from rover_pin.importing.recording import Recording
from rover_pin.rover.rover import Rover
from rover_pin.rover.wheel_base import base_of, effective_track

OFFSETS = np.arange(-2.0, 2.01, 0.02)
"""Delays of the wheels' clock behind the clock of the position that are tried [s]."""
LIKELIHOOD_DROP = 0.5 * 1.96**2
"""Decrease of the log likelihood below its maximum that limits the 95 % interval of the delay."""


def measured_numbers(
    recordings: Sequence[Recording], values: Sequence[Mapping[str, np.ndarray]], rover: Rover
) -> Iterator[str]:
    """Yield a sentence for the user on each of three numbers of the recordings, with its 95 % interval.

    The numbers are the ratio of rim speed to ground speed, the effective track, and the delay of the wheels' clock
    behind the clock of the position. The first two are slopes of straight lines through zero, fitted by least squares
    to signals over one second with the effective number of independent samples. At this delay, the travel of the rims
    fits the travel over the ground best. A sentence on the delay is yielded only if its interval excludes 0.

    Parameters
    ----------
    recordings : sequence of Recording
        The recordings, each on one clock.
    values : sequence of mappings
        Channels of each recording in SI (rows,).
    rover : Rover
        Radii, sides and track of the wheels.
    """
    sides, width = {mount.name: mount.side for mount in rover.wheels}, base_of(rover).track
    rims, grounds, spins, turns, losses = [], [], [], [], []
    for recording, channels in zip(recordings, values, strict=True):
        t, good = recording.t, np.isfinite(channels["body_x"] + channels["body_y"] + channels["body_yaw"])
        speeds = {mount.name: mount.wheel.r * channels[name] for mount in rover.wheels
                  if (name := f"wheel_rate_{mount.name}") in channels}  # fmt: skip
        rim = np.nan_to_num(mean_known(list(speeds.values())))
        right, left = (mean_known([v for n, v in speeds.items() if sides[n] == side]) for side in "rl")
        at = t[0] + np.arange(1.0, t[-1] - t[0] - 1.0)
        if good.sum() < 20 or len(at) < 10:
            continue
        # Travel of the rims along x and y, and their turn without scrub, as integrals over time.
        yaw = np.interp(t, t[good], channels["body_yaw"][good])
        rates = rim * np.cos(yaw), rim * np.sin(yaw), np.nan_to_num(right - left) / width
        sums = [np.concatenate([[0.0], np.cumsum(np.diff(t) * 0.5 * (s[1:] + s[:-1]))]) for s in rates]
        moved = [np.interp(at, t, change(channels[name], t, good)) for name in ("body_x", "body_y", "body_yaw")]
        rolled = [np.interp(at + 0.5, t, series) - np.interp(at - 0.5, t, series) for series in sums]
        rims.append(rolled[0] + 1j * rolled[1])
        grounds.append(moved[0] + 1j * moved[1])
        spins.append(rolled[2])
        turns.append(moved[2])
        losses.append(_offset_loss(t, sums, at, grounds[-1]))
    if not rims:
        return
    # The slope is ground travel over rim travel, so its inverse is the ratio that is reported.
    if (fit := _slope(np.concatenate(rims), np.concatenate(grounds))) is not None:
        low, best, high = (1.0 / end for end in reversed(fit))
        times = f"{best:.3g} [{low:.3g}, {high:.3g}] times"
        yield f"rims run {times} as fast as the rover travels: the wheels slip, or their radius is wrong"
    # The slope is measured turn over turn of the rims without scrub. The track divided by the slope would give the
    # measured turn without scrub.
    if (fit := _slope(np.concatenate(spins), np.concatenate(turns))) is not None:
        low, best, high = (width / end for end in reversed(fit))
        text = f"effective track {best:.3g} [{low:.3g}, {high:.3g}] m, but the wheels' track is {width:.3g} m"
        # Wheel rates that a program computed from the rover's turn rate show the wheels' track and no scrub.
        steers = any(wheel.steer_dof is not None for wheel in rover.wheels)
        if not steers and high < (need := effective_track(rover)):
            text += (
                f"; for wheels that scrub in turns, about {need:.3g} m is expected. If the wheel rates were computed "
                f"from the rover's turn rate, they show no scrub, so compute them with a lever arm of +- "
                f"{need / 2.0:.3g} m"
            )
        yield text
    loss = np.sum(losses, axis=0)
    inside = OFFSETS[loss - loss.min() < LIKELIHOOD_DROP]
    if inside[0] > 0.0 or inside[-1] < 0.0:
        best, low, high = OFFSETS[np.argmin(loss)], inside[0], inside[-1]
        yield (
            f"the wheels' times are {best:+.2f} s [{low:+.2f}, {high:+.2f}] behind the position's times: shift one of "
            "both clocks by this delay"
        )


def _slope(x: np.ndarray, y: np.ndarray) -> tuple[float, float, float] | None:
    """Return the slope b of the line y = b x as (lower end of the 95 % interval, estimate, upper end).

    The result is None if the interval includes 0 or negative slopes.
    """
    size = float(np.sum(np.abs(x) ** 2))
    if not size > 0.0:
        return None
    # Least squares without a constant; for complex signals, the real part is the scalar product of the vectors.
    slope = float(np.real(np.sum(np.conj(x) * y))) / size
    error = 1.96 * np.sqrt(float(np.mean(np.abs(y - slope * x) ** 2)) / size * len(x) / independent(x, y))
    return (slope - error, slope, slope + error) if slope - error > 0.0 else None


def _offset_loss(t: np.ndarray, sums: Sequence[np.ndarray], at: np.ndarray, ground: np.ndarray) -> np.ndarray:
    """Return the negative log likelihood of each delay in OFFSETS between the clocks of wheels and position (delays,).

    For each delay, rim travel over one second is fitted to ground travel with a free scale.

    Parameters
    ----------
    t : array (rows,)
        Time [s].
    sums : sequence of arrays (rows,)
        Integrals of the rim velocity along x and y [m].
    at : array (seconds,)
        Middles of the seconds that are compared [s].
    ground : complex array (seconds,)
        Ground travel over each second, x + i y [m].
    """
    result = []
    for offset in OFFSETS:
        # Rim travel over one second around each middle, read at the delayed times.
        ends = [np.interp(at + offset + half, t, sums[0]) + 1j * np.interp(at + offset + half, t, sums[1])
                for half in (-0.5, 0.5)]  # fmt: skip
        rolled = ends[1] - ends[0]
        size = float(np.sum(np.abs(rolled) ** 2))
        slope = float(np.real(np.sum(np.conj(rolled) * ground))) / max(size, 1e-300)
        result.append(float(np.sum(np.abs(ground - slope * rolled) ** 2)))
    missed = np.maximum(np.array(result), 1e-300)
    # Only the variation of the ground's velocity decides between offsets, so it sets the number of samples.
    varying = ground - np.mean(ground)
    return independent(varying, varying) * np.log(missed)
