"""Readings of the test bed's sensors from the true channels [rows] of one run: first faults, then noise, then
quantisation.
"""

import numpy as np

from .vehicle import NEXUS6, WHEELS

KINDS = (
    ("wheel_rate_", 0.01, 0.005), ("rocker_", 0.003, 0.005), ("bogie_", 0.003, 0.005), ("steer_", 0.003, 0.005),
    ("current_", 0.002, 0.0), ("body_v", 0.004, 0.0), ("body_roll", 0.005, 0.0), ("body_pitch", 0.005, 0.0),
    ("body_yaw", 0.005, 0.0), ("body_", 0.0015, 0.0), ("battery_V", 0.01, 0.0),
)  # fmt: skip
"""Start of a channel's name, SD of its white noise, its step; the first that fits counts."""
TRUE_ONLY = ("slip_",)
__all__ = ["KINDS", "WHEELS", "measured"]


def measured(channels, faults, gains, random, electric=True, vehicle=NEXUS6):
    """Return the logged channels. `faults` are sensor faults by effect name, `gains` the gains of the wheels'
    tachometers.
    """
    read = {name: np.array(values) for name, values in channels.items() if not name.startswith(TRUE_ONLY)}
    read["body_yaw"] = np.unwrap(read["body_yaw"])
    if not electric:
        read = {name: values for name, values in read.items() if not name.startswith(("current_", "battery_"))}
    for wheel, gain in zip(vehicle.wheels, gains, strict=True):
        read[f"wheel_rate_{wheel}"] *= gain
    for name, fault in faults.items():
        FAULTS[name](read, **fault)
    for name in read:
        noise = random.standard_normal(len(read[name]))
        sd, step = next((kind[1:] for kind in KINDS if name.startswith(kind[0])), (0.0, 0.0))
        if sd:
            read[name] = read[name] + (vehicle.load if name.startswith("current_") else 1.0) * sd * noise
        if step:
            read[name] = step * np.round(read[name] / step)
    return read


def tacho_scale(read, e, wheel=""):
    for name in read:
        if name.startswith(f"wheel_rate_{wheel}"):
            read[name] = (1.0 + e) * read[name]


def tracking_delay(read, d):
    t = read["t_s"]
    for name in read:
        if name.startswith("body_"):
            read[name] = np.interp(t - d, t, read[name])


def velocity_filter(read, tau):
    """First-order lag, exact for a velocity that changes linearly between the rows."""
    keep = np.exp(-np.diff(read["t_s"]) / tau)
    for name in ("body_vx", "body_vy", "body_vz"):
        v = read[name]
        late = np.zeros_like(v)
        for i in range(1, len(v)):
            lag = (v[i] - v[i - 1]) / (read["t_s"][i] - read["t_s"][i - 1]) * tau
            late[i] = (late[i - 1] - lag) * keep[i - 1] + lag
        read[name] = v - late


def sensor_bias(read, bias, channel):
    read[channel] = read[channel] + bias


FAULTS = {
    "TachoScale": tacho_scale,
    "TrackingDelay": tracking_delay,
    "VelocityFilter": velocity_filter,
    "SensorBias": sensor_bias,
}
