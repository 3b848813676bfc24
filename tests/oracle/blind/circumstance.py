"""Circumstances of a data set in addition to the hidden effect: another rover, the Moon, a poor tracker, or coarse
encoders.

None of these is a finding. A log states its rover, its gravity and its encoders. No tracker states its drift, the times
at which it lost the rover or followed another object, and no logger states its delays.
"""

import numpy as np

from .vehicle import KNOWN, NEXUS6

MOON = 1.62
CURRENT = 0.002
"""SD of the current sensors of Nexus 6's motors [A]."""
DRIFT_TIME = 6.0
"""Correlation time of a drift [s]: some of it in a run, little of it within a block of half a second."""
DRIFT = {"body_x": 0.003, "body_y": 0.003, "body_z": 0.002, "body_yaw": 0.003, "body_roll": 0.002, "body_pitch": 0.002}
"""SD of the drift of a tracked pose [m, rad] (assumed: one to two SDs of its white noise)."""
COUNTS = 512
"""Counts of a coarse encoder for a turn of the wheel: 0.25 rad/s in one row, where the rover cruises at 1.1."""
COARSE_ANGLE = 0.02
"""Step of the coarse encoders of steering, rockers and bogies [rad]."""
LATE, LATEST = 0.006, 0.02
"""SD of when a row is read about its time, and the most [s]; the row says when it was read."""
LOST_S, MISSED_S = (0.3, 1.2), (0.15, 0.5)
"""How long a tracker is blind, twice a run, and a logger silent, once [s]."""
SPIKES, SPIKE = (2, 4), {"m": 0.05, "rad": 0.05}
"""How many single poses of a run are another's, and how far that is away [SD]."""
SHARES = {"plain": 0.4, "drift": 0.1, "coarse": 0.1, "moon": 0.1, "patchy": 0.1, "heavy": 0.1, "cart": 0.1}
NAMES = tuple(SHARES)


def drawn(seed, index, hidden=()):
    """Return a random circumstance whose rover has the parts in which the hidden effects act."""
    random = np.random.default_rng([seed, index, 4])
    while not fits(name := str(random.choice(NAMES, p=list(SHARES.values()))), hidden):
        pass
    return name


def fits(name, hidden):
    """Return whether the rover of a circumstance has the parts in which the hidden effects act."""
    return all(vehicle(name).has(hidden_effect["effect"], hidden_effect["numbers"]) for hidden_effect in hidden)


def vehicle(name):
    """Return the rover of a circumstance."""
    return KNOWN.get(name, NEXUS6)


def numbers(name):
    """Return the numbers of a run that the circumstance changes."""
    return {"gravity": MOON} if name == "moon" else {}


def sampled(name, channels, random):
    """Return the true channels at the rows that a circumstance records. Duties are constant from row to row."""
    if name != "patchy":
        return channels
    t = channels["t_s"]
    late = np.clip(LATE * random.standard_normal(len(t)), -LATEST, LATEST)
    at = np.clip(t + late, None, t[-1])
    rows = np.searchsorted(t, at)
    resampled = {}
    for name, values in channels.items():
        full = np.unwrap(values) if name == "body_yaw" else values
        resampled[name] = values[rows] if name.startswith("duty_") else np.interp(at, t, full)
    return resampled | {"t_s": at}


def read(name, channels, random):
    """Return the logged channels with the errors of a circumstance."""
    change = {"drift": drifting, "coarse": counted, "patchy": patched}.get(name)
    return channels if change is None else change(channels, random)


def patched(channels, random):
    """Return the channels with missing or foreign poses, and without the rows that the logger lost."""
    t, pose = channels["t_s"], [name for name in channels if name.startswith("body_")]
    changed = {name: values.copy() for name, values in channels.items()}
    count = int(random.integers(SPIKES[0], SPIKES[1] + 1))
    for row in random.choice(len(t), count, replace=False):
        for name in DRIFT:
            unit = "m" if name in ("body_x", "body_y", "body_z") else "rad"
            changed[name][row] += SPIKE[unit] * random.standard_normal()
    for _ in range(2):
        blind = within(t, random, LOST_S)
        for name in pose:
            changed[name][blind] = np.nan
    silent = within(t, random, MISSED_S)
    return {name: values[~silent] for name, values in changed.items()}


def within(t, random, duration):
    """Return a mask of the rows that lie in a stretch of this duration [s], between its smallest and largest value."""
    begin, length = random.uniform(t[0], t[-1]), random.uniform(*duration)
    return (t > begin) & (t < begin + length)


def drifting(channels, random):
    """Return the channels with a pose that drifts: a smooth Gaussian process that begins at 0."""
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
    """Return the channels with wheel rates from whole encoder counts between two rows, and with angles in
    coarse steps.
    """
    t, encoded = channels["t_s"], dict(channels)
    step = 2 * np.pi / COUNTS
    for name in [name for name in channels if name.startswith("wheel_rate_")]:
        rate = channels[name]
        dt = np.diff(t, prepend=2 * t[0] - t[1])
        turned = np.cumsum(rate * dt) + random.uniform(0.0, step)
        counts = np.floor(np.concatenate(([turned[0] - rate[0] * dt[0]], turned)) / step)
        encoded[name] = np.diff(counts) * step / dt
    for name in channels:
        if name.startswith(("steer_", "rocker_", "bogie_")):
            encoded[name] = COARSE_ANGLE * np.round(channels[name] / COARSE_ANGLE)
    return encoded


def noise(name, sample_period=0.05):
    """Return the noise that the log declares differently, by kind: two roundings of a count, one rounding of
    an angle.
    """
    if name in KNOWN:
        return {"current": round(CURRENT * KNOWN[name].load, 5)}
    if name != "coarse":
        return {}
    count = 2 * np.pi / COUNTS / sample_period
    return {"wheel_rate": round(count / np.sqrt(6.0), 4), "angle": round(COARSE_ANGLE / np.sqrt(12.0), 5)}
