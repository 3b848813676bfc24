"""Channels of a plain kinematic rover with noisy sensors, and logs of them: to test what the checks of a log say."""

import math
from pathlib import Path

import numpy as np

from rover_pin.logs.drive_log import DriveLog, LogMetadata
from rover_pin.simulation.trace.channels import WHEELS
from rover_pin.simulation.trace.trace import Trace

R = 0.045
MOTOR = {
    "supply": {"value": 7.2, "unit": "V"},
    "resistance": {"value": 24.0, "unit": "ohm"},
    "k_t": {"value": 0.0125, "unit": "N m/A"},
    "gear": {"value": 268.0},
    "note": "bench",
}
SOIL = {"phi": {"value": 30.0, "unit": "deg"}, "k": {"value": 5.0, "unit": "mm"}, "k_1": {"value": 54.2, "unit": "kPa"}}


def commands(seed, duration, dt=0.04, constant=None):
    """Duties (T, 6): holds of 3 s with a little for every wheel, a pause, a reversal, a staircase down at the end."""
    random, t = np.random.default_rng(seed), np.arange(0.0, duration, dt)
    if constant is not None:
        return t, np.full((len(t), 6), constant)
    hold = (t // 3.0).astype(int)
    duty = random.uniform(0.45, 0.85, hold.max() + 1)[hold][:, None] + random.uniform(-0.09, 0.09, 6)
    late = t > 0.6 * duration
    duty[(t > 0.4 * duration) & (t < 0.4 * duration + 7.0)] = 0.0
    duty[late & (t < 0.75 * duration)] *= -1.0
    low = t > 0.9 * duration
    duty[low] = (0.3 - 0.24 * (t[low] - 0.9 * duration) / (0.1 * duration))[:, None].round(2)
    return t, duty


def drive(seed=0, duration=60.0, yaw=0.0, noise=1.0, constant=None, hill=0.12):
    """A plain kinematic rover: rates follow duties, slip grows with the slope, sensors are noisy."""
    t, duty = commands(seed, duration, constant=constant)
    random, dt = np.random.default_rng(seed + 100), t[1] - t[0]
    rate = 2.2 * duty
    s, z, pitch = np.zeros(len(t)), np.zeros(len(t)), np.zeros(len(t))
    for i in range(1, len(t)):
        slope = hill * math.sin(4.0 * s[i - 1] + 0.3)
        slip = 0.04 + 2.0 * max(slope, 0.0)
        s[i] = s[i - 1] + dt * R * rate[i].mean() * (1.0 - slip) * math.cos(slope)
        z[i], pitch[i] = z[i - 1] + (s[i] - s[i - 1]) * math.tan(slope), -slope
    sees = lambda sd: noise * sd * random.standard_normal(len(t))  # noqa: E731
    channels = {"t_s": t}
    for i, wheel in enumerate(WHEELS):
        channels[f"duty_{wheel}"] = duty[:, i]
        channels[f"wheel_rate_{wheel}"] = rate[:, i] + sees(0.01)
        channels[f"current_{wheel}_A"] = 0.1 * duty[:, i] + sees(0.002)
    channels |= {"body_x": s * math.cos(yaw) + sees(0.0015), "body_y": s * math.sin(yaw) + sees(0.0015)}
    channels |= {"body_z": z + sees(0.0015), "body_yaw": yaw + sees(0.005), "body_roll": sees(0.005)}
    channels |= {"body_pitch": pitch + sees(0.005), "battery_V": 7.2 + sees(0.01)}
    rocker = 0.02 * np.sin(t)
    channels |= {"rocker_l": rocker + sees(0.003), "rocker_r": -rocker + sees(0.003)}
    return channels


def log_of(*runs, **changes):
    changes = {"motor": MOTOR, "soil": SOIL, **changes}
    wheels = list(changes.get("wheels", WHEELS))
    traces = tuple(Trace(run, {}, {"file": f"run-{i}.csv", "wheels": wheels}) for i, run in enumerate(runs, 1))
    return DriveLog(Path("field"), LogMetadata("field", **changes), traces)


GOOD = [drive(0), drive(1, yaw=math.pi), drive(0)]
"""Both headings, a repeat, a pause, a reversal, a staircase."""


def changed(**changes):
    """The good log with channels of its first run changed; None takes one out."""
    first = {name: values for name, values in {**GOOD[0], **changes}.items() if values is not None}
    return log_of(first, *GOOD[1:])


def starting(prefix, change):
    return {name: change(values) for name, values in GOOD[0].items() if name.startswith(prefix)}


def gap(values, begin, end):
    values = np.array(values)
    values[begin:end] = np.nan
    return values


def held(name, begin, end, value=None):
    values = np.array(GOOD[0][name])
    values[begin:end] = values[begin] if value is None else value
    return values
