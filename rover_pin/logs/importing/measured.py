"""What the log shows of the rover itself: the ground under its rims, its effective track, clocks that are apart."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from rover_pin.base.formula import change
from rover_pin.logs.importing.evidence import independent, mean_known
from rover_pin.logs.importing.recording import Recording
from rover_pin.rover.rover import Rover
from rover_pin.rover.wheel_base import base_of, effective_track

OFFSETS = np.arange(-2.0, 2.01, 0.02)
"""Offsets of the wheels' clock that are tried [s]."""
DROP = 0.5 * 1.96**2
"""Fall of the log likelihood at the ends of an interval of 95 %."""


def measured_numbers(
    recordings: Sequence[Recording], values: Sequence[Mapping[str, np.ndarray]], rover: Rover
) -> Iterator[str]:
    """Yield what is measured, each with its interval of 95 %.

    The factors are slopes through zero of signals over a second; the errors are those of least squares with as many
    samples as are independent. The offset is the one at which the way of the rims fits that of the place best.
    """
    sides, width = {mount.name: mount.side for mount in rover.wheels}, base_of(rover).track
    rims, grounds, spins, turns, misfits = [], [], [], [], []
    for recording, channels in zip(recordings, values, strict=True):
        t, good = recording.t, np.isfinite(channels["body_x"] + channels["body_y"] + channels["body_yaw"])
        speeds = {mount.name: mount.wheel.r * channels[f"wheel_rate_{mount.name}"] for mount in rover.wheels}
        rim = np.nan_to_num(mean_known(list(speeds.values())))
        right, left = (mean_known([v for n, v in speeds.items() if sides[n] == side]) for side in "rl")
        at = t[0] + np.arange(1.0, t[-1] - t[0] - 1.0)
        if good.sum() < 20 or len(at) < 10:
            continue
        yaw = np.interp(t, t[good], channels["body_yaw"][good])
        way = [np.concatenate([[0.0], np.cumsum(np.diff(t) * 0.5 * (s[1:] + s[:-1]))]) for s in
               (rim * np.cos(yaw), rim * np.sin(yaw), np.nan_to_num(right - left) / width)]  # fmt: skip
        took = [np.interp(at, t, change(channels[name], t, good)) for name in ("body_x", "body_y", "body_yaw")]
        rolled = [np.interp(at + 0.5, t, series) - np.interp(at - 0.5, t, series) for series in way]
        rims.append(rolled[0] + 1j * rolled[1])
        grounds.append(took[0] + 1j * took[1])
        spins.append(rolled[2])
        turns.append(took[2])
        misfits.append(_misfit(t, way, at, grounds[-1]))
    if not rims:
        return
    says = (
        (rims, grounds, 1.0, "rims run {} times as fast as the ground: slip, or wheels of another radius"),
        (spins, turns, width, f"effective track {{}} m, that of the wheels is {width:.3g} m"),
    )
    for x, y, scale, text in says:
        if (fit := _slope(np.concatenate(x), np.concatenate(y))) is not None:
            low, best, high = (scale / series for series in reversed(fit))
            yield text.format(f"{best:.3g} [{low:.3g}, {high:.3g}]") + (_skids(rover, high) if x is spins else "")
    loss = np.sum(misfits, axis=0)
    inside = OFFSETS[loss - loss.min() < DROP]
    if inside[0] > 0.0 or inside[-1] < 0.0:
        best, low, high = OFFSETS[np.argmin(loss)], inside[0], inside[-1]
        yield f"the wheels' times are {best:+.2f} s [{low:+.2f}, {high:+.2f}] behind the place's: shift one of them"


def _skids(rover: Rover, high: float) -> str:
    """Return what is wrong with a track of wheels that skid where not even the upper end is what scrub asks for."""
    if any(wheel.steer_dof is not None for wheel in rover.wheels) or high >= (need := effective_track(rover)):
        return ""
    return (
        f"; wheels that skid need some {need:.3g} m: rates that were computed of the rover's own turn say nothing of "
        f"scrub, so compute them with +- {need / 2.0:.3g} m"
    )


def _slope(x: np.ndarray, y: np.ndarray) -> tuple[float, float, float] | None:
    """Return the ends and the middle of y / x, where zero lies outside."""
    size = float(np.sum(np.abs(x) ** 2))
    if not size > 0.0:
        return None
    slope = float(np.real(np.sum(np.conj(x) * y))) / size
    error = 1.96 * np.sqrt(float(np.mean(np.abs(y - slope * x) ** 2)) / size * len(x) / independent(x, y))
    return (slope - error, slope, slope + error) if slope - error > 0.0 else None


def _misfit(t: np.ndarray, way: Sequence[np.ndarray], at: np.ndarray, ground: np.ndarray) -> np.ndarray:
    """Return the negative log likelihood of each offset, least squares over the scale of the way."""
    result = []
    for offset in OFFSETS:
        ends = [np.interp(at + offset + half, t, way[0]) + 1j * np.interp(at + offset + half, t, way[1])
                for half in (-0.5, 0.5)]  # fmt: skip
        rolled = ends[1] - ends[0]
        size = float(np.sum(np.abs(rolled) ** 2))
        slope = float(np.real(np.sum(np.conj(rolled) * ground))) / max(size, 1e-300)
        result.append(float(np.sum(np.abs(ground - slope * rolled) ** 2)))
    missed = np.maximum(np.array(result), 1e-300)
    varying = ground - np.mean(ground)
    return independent(varying, varying) * np.log(missed)
