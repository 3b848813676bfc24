"""Integration by RK4 with fixed steps and held commands, and the channels that it records."""

import numpy as np

from .bodies import rotation_of

STEP, HOLD, SAMPLE = 0.00125, 0.05, 0.05


def drive(physics, y, command, duration, step=STEP):
    """Return the sampled channels. command(t) returns the duties of six wheels and the angles of four servos."""
    y, rows = np.array(y, dtype=float), []
    per_hold, per_sample = round(HOLD / step), round(SAMPLE / step)
    for k in range(round(duration / step)):
        t = k * step
        if k % per_hold == 0:
            duty, steer = command(t)
        first = physics.rates(t, y, duty, steer)
        second = physics.rates(t + step / 2, y + step / 2 * first, duty, steer)
        third = physics.rates(t + step / 2, y + step / 2 * second, duty, steer)
        fourth = physics.rates(t + step, y + step * third, duty, steer)
        y = y + step / 6 * (first + 2 * second + 2 * third + fourth)
        y[3:7] /= np.linalg.norm(y[3:7])
        if k % per_sample == per_sample - 1:
            rows.append(sample(physics, t + step, y))
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def sample(physics, t, y):
    """Return one row: the channels of a log and of a tracker, and the true values of the last evaluation of
    the step.
    """
    state = physics.unpack(y)
    R = rotation_of(state.quaternion)
    angles = physics.bodies.collect @ state.angles
    return {
        "t_s": t,
        "y": y.copy(),
        "place": state.place,
        "velocity": state.speeds[:3],
        "roll": np.arctan2(R[2, 1], R[2, 2]),
        "pitch": -np.arcsin(R[2, 0]),
        "yaw": np.arctan2(R[1, 0], R[0, 0]),
        "wheel_rate": state.speeds[6 + physics.wheel_angle],
        "joints": angles,
        **physics.record,
    }
