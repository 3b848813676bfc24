"""Under what a set is driven and read, besides what it hides: Moon gravity, a tracker that drifts, coarse encoders.

Nothing of this is a finding: a log says its gravity and its encoders, and no tracker says how it drifts.
"""

import numpy as np

from .sensors import WHEELS

MOON = 1.62
DRIFT_TIME = 6.0
"""Correlation time of a drift [s]: some of it in a run, little of it within a block of half a second."""
DRIFT = {"body_x": 0.003, "body_y": 0.003, "body_z": 0.002, "body_yaw": 0.003, "body_roll": 0.002, "body_pitch": 0.002}
"""SD of the drift of a tracked pose [m, rad] (assumed: one to two SDs of its white noise)."""
COUNTS = 512
"""Counts of a coarse encoder for a turn of the wheel: 0.25 rad/s in one row, where the rover cruises at 1.1."""
COARSE_ANGLE = 0.02
"""Step of the coarse encoders of steering, rockers and bogies [rad]."""
SHARES = {"plain": 0.55, "drift": 0.15, "coarse": 0.15, "moon": 0.15}
NAMES = tuple(SHARES)


def drawn(seed, index):
    """Return the circumstance of a set."""
    random = np.random.default_rng([seed, index, 4])
    return str(random.choice(NAMES, p=list(SHARES.values())))


def numbers(name):
    """Return the numbers of a run that differ."""
    return {"gravity": MOON} if name == "moon" else {}


def read(name, channels, random):
    """Return logged channels as they are read under a circumstance."""
    if name == "drift":
        return drifting(channels, random)
    return counted(channels, random) if name == "coarse" else channels


def drifting(channels, random):
    """Return the channels with a pose that wanders, a smooth Gaussian process from 0 at the start."""
    t = channels["t_s"]
    waves = 12
    wanders = dict(channels)
    for name, sd in DRIFT.items():
        rate = random.standard_normal(waves) / DRIFT_TIME
        phase = random.uniform(0.0, 2 * np.pi, waves)
        row = np.sqrt(2.0 / waves) * np.sum(np.cos(rate * t[:, None] + phase), axis=1)
        wanders[name] = channels[name] + sd * (row - row[0])
    return wanders


def counted(channels, random):
    """Return the channels with wheel rates from whole counts between two rows, and angles in coarse steps."""
    t, found = channels["t_s"], dict(channels)
    step = 2 * np.pi / COUNTS
    for wheel in WHEELS:
        rate = channels[f"wheel_rate_{wheel}"]
        dt = np.diff(t, prepend=2 * t[0] - t[1])
        turned = np.cumsum(rate * dt) + random.uniform(0.0, step)
        counts = np.floor(np.concatenate(([turned[0] - rate[0] * dt[0]], turned)) / step)
        found[f"wheel_rate_{wheel}"] = np.diff(counts) * step / dt
    for name in channels:
        if name.startswith(("steer_", "rocker_", "bogie_")):
            found[name] = COARSE_ANGLE * np.round(channels[name] / COARSE_ANGLE)
    return found


def noise(name, sample_period=0.05):
    """Return the noise that the log declares otherwise, by kind: a count's two roundings, an angle's one."""
    if name != "coarse":
        return {}
    count = 2 * np.pi / COUNTS / sample_period
    return {"wheel_rate": round(count / np.sqrt(6.0), 4), "angle": round(COARSE_ANGLE / np.sqrt(12.0), 5)}
