"""The rover's state at rest, found by Newton's method on the statics without any dynamics.

First the rover is lowered vertically on unsheared soil. Then its wheels are locked, and the slip of every wheel follows
from the distance over which its rim has been dragged (ds = -(1 +- s) dx / L), until the shear holds the rover.
"""

import numpy as np

from .bodies import cross, rotation_of

TOLERANCE = 1e-9
SUNK = 0.0075
"""First guess of the sinkage [m]."""


def rest(physics, x=0.0, y=0.0, yaw=0.0):
    """Return the state vector of a rover at rest."""
    angles = len(physics.tree.names)
    spun = np.isin(np.arange(angles), physics.wheel_angle)
    start = np.zeros(6 + angles)
    start[:2], start[5] = (x, y), yaw
    start = standing(physics, start)
    down = np.flatnonzero(np.concatenate([[False, False, True, True, True, False], ~spun]))
    lowered = newton(lambda pose: unbalance(physics, pose, np.zeros((2, physics.count))), start, down)
    free = np.flatnonzero(np.concatenate([np.ones(6, dtype=bool), ~spun]))
    before = wheels(physics, lowered)
    rest_pose = newton(lambda pose: unbalance(physics, pose, dragged(physics, pose, before)), lowered, free)
    return packed(physics, rest_pose, dragged(physics, rest_pose, before))


def newton(residual, pose, free):
    for _ in range(60):
        value = residual(pose)[free]
        if np.abs(value).max() < TOLERANCE:
            return pose
        slope = slopes(lambda pose: residual(pose)[free], pose, free)
        change = np.linalg.solve(slope, value)
        pose = pose.copy()
        pose[free] -= change * min(1.0, 5e-3 / np.abs(change).max())
    raise ArithmeticError(f"no rest within 60 steps: {np.abs(value).max():.1e} N left")


def slopes(of, pose, free):
    """Return the derivatives by the free coordinates from central differences."""
    columns = []
    for index in free:
        nudge = np.zeros_like(pose)
        nudge[index] = 1e-6
        columns.append((of(pose + nudge) - of(pose - nudge)) / 2e-6)
    return np.stack(columns, axis=1)


def unbalance(physics, pose, slips):
    """Return the generalised force at rest, with servos that hold the steering straight and with locked wheels."""
    y = packed(physics, pose, slips)
    state = physics.unpack(y)
    motion = physics.bodies.motion(state.place, rotation_of(state.quaternion), state.angles, state.speeds)
    soil, _, _ = physics.contact(0.0, state, motion)
    return soil + physics.steering(state, np.zeros(len(physics.steer_angle))) + physics.stops(state) - motion.bias


def wheels(physics, pose):
    state = physics.unpack(packed(physics, pose, np.zeros((2, physics.count))))
    rotation, place = physics.bodies.frames(state.place, rotation_of(state.quaternion), state.angles)
    return rotation[physics.wheel_link], place[physics.wheel_link]


def dragged(physics, pose, before):
    """Return the slips along and across after the wheels have moved from `before` without turning in their mounts."""
    rotation, place = wheels(physics, pose)
    axle = before[0][:, :, 1]
    forward = cross(axle, np.array([0.0, 0.0, 1.0]))
    forward /= np.linalg.norm(forward, axis=1)[:, None]
    turned = before[0].transpose(0, 2, 1) @ rotation
    rolled = np.arctan2(turned[:, 0, 2] - turned[:, 2, 0], turned[:, 0, 0] + turned[:, 2, 2])
    displacement = place - before[1]
    sunk = np.stack([np.sum(displacement * forward, axis=1), np.sum(displacement * axle, axis=1)])
    slide = physics.world.r * rolled - np.hypot(sunk[0], displacement[:, 2]) * np.sign(sunk[0])
    along = np.sign(slide) * -np.expm1(-np.abs(slide) / physics.world.relaxation)
    return np.stack([along, sunk[1] / physics.world.relaxation])


def packed(physics, pose, slips):
    """Return the state vector at rest of (position, roll, pitch, yaw, angles)."""
    half = 0.5 * pose[3:6]
    (cr, cp, cy), (sr, sp, sy) = np.cos(half), np.sin(half)
    quaternion = [
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ]
    return np.concatenate([pose[:3], quaternion, pose[6:], np.zeros(len(pose)), slips[0], slips[1]])


def standing(physics, pose):
    """Return the pose in which all six wheels have sunk by SUNK, found by turning the body and the suspension."""
    sprung = [6 + i for i, name in enumerate(physics.tree.names) if name.startswith(("rocker", "bogie"))]
    free = np.array([2, 3, 4, *sprung])

    def clearance(pose):
        _, place = wheels(physics, pose)
        ground = [physics.world.ground.height(x, y) for x, y, _ in place]
        return place[:, 2] - physics.world.r + SUNK - ground

    for _ in range(20):
        pose = pose.copy()
        pose[free] -= np.linalg.lstsq(slopes(clearance, pose, free), clearance(pose), rcond=None)[0]
    return pose
