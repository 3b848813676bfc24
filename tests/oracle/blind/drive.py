"""Fixed time steps: half a drift of the pose, a second-order Runge-Kutta-Chebyshev step of all other states, half a
drift.
"""

from functools import lru_cache

import numpy as np

from .bodies import rotation_of
from .rover import Rovers, State
from .vehicle import NEXUS6

STEP, HOLD, SAMPLE, STAGES = 0.0025, 0.05, 0.05, 4
DAMPED = 2.0 / 13.0


@lru_cache(maxsize=16)
def chebyshev(stages):
    """Return the method's coefficients (mu_1, [(mu, nu, mu_t, gamma_t)]).

    Source: Sommeijer, Shampine and Verwer, J. Comput. Appl. Math. 88 (1998) 315.
    """
    T = [np.polynomial.Chebyshev.basis(j) for j in range(stages + 1)]
    w_0 = 1.0 + DAMPED / stages**2
    w_1 = T[stages].deriv()(w_0) / T[stages].deriv(2)(w_0)
    b = [0.0, 0.0] + [T[j].deriv(2)(w_0) / T[j].deriv()(w_0) ** 2 for j in range(2, stages + 1)]
    b[0] = b[1] = b[2]
    rows = []
    for j in range(2, stages + 1):
        mu, nu, mu_t = 2 * b[j] * w_0 / b[j - 1], -b[j] / b[j - 2], 2 * b[j] * w_1 / b[j - 1]
        rows.append((mu, nu, mu_t, -(1.0 - b[j - 1] * T[j - 1](w_0)) * mu_t))
    return b[1] * w_1, rows


@lru_cache(maxsize=16)
def stage_times(stages, step):
    """Return the times of the stages, from the recursion itself applied to y' = 1."""
    first, rows = chebyshev(stages)
    at = [0.0, first * step]
    for mu, nu, mu_t, gamma_t in rows:
        at.append(mu * at[-1] + nu * at[-2] + (mu_t + gamma_t) * step)
    return at


def kick(rate, t, y, step, stages=STAGES):
    """Return y after one step, and the values that `rate(t, y)` recorded at its beginning."""
    first, rows = chebyshev(stages)
    times = stage_times(stages, step)
    start, record = rate(t, y)
    before, now = y, y + first * step * start
    for j, (mu, nu, mu_t, gamma_t) in enumerate(rows):
        slope, _ = rate(t + times[j + 1], now)
        after = (1.0 - mu - nu) * y + mu * now + nu * before + step * (mu_t * slope + gamma_t * start)
        before, now = now, after
    return now, record


def drifted(state, step, size):
    """Return the state whose pose has moved with its speeds."""
    u = state.fast[:size]
    turn = u[3:6] * step
    angle = np.sqrt(np.sum(turn**2, axis=0))
    s = 0.5 * np.sinc(angle / (2.0 * np.pi))
    (a, b, c), w0 = turn * s, np.cos(0.5 * angle)
    w, x, y, z = state.quaternion
    q = np.stack((w0 * w - a * x - b * y - c * z, w0 * x + a * w + b * z - c * y,
                  w0 * y - a * z + b * w + c * x, w0 * z + a * y - b * x + c * w))  # fmt: skip
    q /= np.sqrt(np.sum(q**2, axis=0))
    return state._replace(place=state.place + step * u[:3], quaternion=q, angles=state.angles + step * u[6:])


def rest(rovers, step=0.005, first=200, second=350, stages=6):
    """Return the rovers at rest at their starts: first lowered vertically, then held by the shear of the soil alone."""
    world, size = rovers.world, rovers.size
    x, y, yaw = np.array([run.start for run in world.runs], dtype=float).T
    state = set_down(rovers, x, y, yaw)
    vehicle = rovers.vehicle
    steer, duty = np.zeros((len(vehicle.steered), world.size)), np.zeros((len(vehicle.wheels), world.size))
    is_held = np.zeros(rovers.cuts[-1] + 1, dtype=bool)
    for count, shearing in ((first, False), (second, True)):
        is_held[:] = False
        is_held[rovers.wheels] = True
        if not shearing:
            is_held[[0, 1, 5]], is_held[size:] = True, True
        for _ in range(count):
            state = drifted(state, step / 2, size)
            pose = rovers.pose(state, steer, step, braked=True)
            fast, _ = kick(
                lambda t, y, at=pose: rovers.rates(t, y, at, duty, braked=True), 0.0, state.fast, step, stages
            )
            fast[:size] *= 0.85
            fast[is_held] = 0.0
            fast[rovers.cuts[2] :] = 0.0
            state = drifted(state._replace(fast=fast), step / 2, size)
    state.fast[:size] = 0.0
    return state


def set_down(rovers, x, y, yaw):
    """Return states slightly above the ground, pitched like the ground between the outer wheels."""
    world, reach = rovers.world, 0.15 * rovers.vehicle.length
    c = np.cos(yaw)
    ahead, behind = (rovers.ground.height((x + i * reach * c)[None], y[None])[0] for i in (1, -1))
    pitch = -np.arctan2(ahead - behind, 2 * reach)
    q = np.stack((np.cos(yaw / 2) * np.cos(pitch / 2), -np.sin(yaw / 2) * np.sin(pitch / 2),
                  np.cos(yaw / 2) * np.sin(pitch / 2), np.sin(yaw / 2) * np.cos(pitch / 2)))  # fmt: skip
    angles = np.zeros((rovers.size - 6, world.size))
    frames = rovers.bodies.frames(rotation_of(q), angles)
    at = frames.place[:, rovers.wheel_link]
    floor = rovers.ground.height(x + at[0], y + at[1])
    z = np.max(floor + world["r"] - at[2], axis=0) - 0.004
    fast = np.zeros((rovers.cuts[-1] + 1, world.size))
    return State(np.stack((x, y, z)), q, angles, fast)


def drive(runs, duration, step=STEP, stages=STAGES, start=None, vehicle=NEXUS6):
    """Return the true channels of all runs of a rover, each [runs, rows], with a row every SAMPLE seconds."""
    rovers = Rovers(runs, vehicle)
    state, size = rest(rovers) if start is None else start, rovers.size
    per_hold, per_sample = round(HOLD / step), round(SAMPLE / step)
    duties = np.stack([run.duty for run in runs], axis=-1)
    steers = np.stack(
        [np.zeros((len(run.duty), len(vehicle.steered))) if run.steer is None else run.steer for run in runs], axis=-1
    )
    rows = []
    for i in range(round(duration / step)):
        duty, steer = duties[i // per_hold], steers[i // per_hold]
        t = i * step
        state = drifted(state, step / 2, size)
        pose = rovers.pose(state, steer, step)
        fast, record = kick(
            lambda t, y, at=pose, d=duty: rovers.rates(t, y, at, d), t, state.fast, step, stages
        )  # fmt: skip
        state = drifted(state._replace(fast=fast), step / 2, size)
        if i % per_sample == per_sample - 1:
            rows.append(sampled(rovers, t + step, state, record, duty))
    return {name: np.stack([row[name] for row in rows], axis=-1) for name in rows[0]}


def sampled(rovers, t, state, record, duty):
    """Return one row of the channels, named as in a drive log, and the slip."""
    u, tree, vehicle = state.fast[: rovers.size], rovers.tree, rovers.vehicle
    R = rotation_of(state.quaternion)
    row = {"t_s": np.full(rovers.world.size, t)}
    turned = rovers.bodies.collect @ state.angles
    slack = record["hub"] - record["rim"]
    for i, name in enumerate(vehicle.wheels):
        row[f"duty_{name}"] = duty[i]
        row[f"wheel_rate_{name}"] = u[rovers.wheels[i]] + slack[i]
        row[f"current_{name}_A"] = record["current"][i]
        row[f"slip_{name}"] = record["slip"][i]
    for name in (*vehicle.angles, *(f"steer_{wheel}" for wheel in vehicle.steered)):
        row[name] = turned[tree.joints.index(name)]
    for i, axis in enumerate("xyz"):
        row[f"body_{axis}"], row[f"body_v{axis}"] = state.place[i], u[i]
    row["body_roll"] = np.arctan2(R[2, 1], R[2, 2])
    row["body_pitch"] = -np.arcsin(R[2, 0])
    row["body_yaw"] = np.arctan2(R[1, 0], R[0, 0])
    row["battery_V"] = record["supply"]
    return row
