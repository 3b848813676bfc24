"""All forces on a batch of rovers: quantities that depend on the pose only, and the rates of speeds and inner states at
that pose.
"""

from typing import NamedTuple

import numpy as np

from .bodies import Bodies, Frames, cross, dot, rotation_of
from .contact import Contact
from .ground import Ground, Pieces, touch
from .motor import Motors
from .tree import read
from .vehicle import NEXUS6
from .world import World

HELD = 1e3
"""Armature of a wheel whose brake is on."""


class State(NamedTuple):
    """The state of all runs; the last axis is the run."""

    place: np.ndarray
    "[3, runs]"
    quaternion: np.ndarray
    angles: np.ndarray
    fast: np.ndarray
    "speeds, then slips along, across, dug, windup, loss [a wheel], drawn [1]"


class Pose(NamedTuple):
    """Quantities that are constant during a Runge-Kutta-Chebyshev step."""

    frames: Frames
    inverse: np.ndarray
    "of the mass matrix [runs, speeds, speeds]"
    still: np.ndarray
    "forces that do not depend on the speeds [speeds, runs]"
    pieces: Pieces
    p: dict
    ends: np.ndarray
    "where the pieces of each wheel begin, in the order of `order`"
    order: np.ndarray
    forward: np.ndarray
    side: np.ndarray
    centre: np.ndarray
    axle: np.ndarray
    angles: np.ndarray
    over: np.ndarray
    place: np.ndarray


class Rovers:
    """A batch of runs. Either all of them have a rigid differential, or all have a compliant one."""

    def __init__(self, runs, vehicle=NEXUS6):
        self.vehicle, self.world = vehicle, World(runs, vehicle)
        world = self.world
        soft = (world["DifferentialCompliance.compliance"] > 0.0) | (world["DifferentialCompliance.backlash"] > 0.0)
        assert soft.all() or not soft.any(), "keep runs with a compliant differential in a batch of their own"
        self.soft = bool(soft.any())
        self.tree = tree = read(vehicle.urdf(), rigid_differential=not self.soft)
        self.bodies = Bodies(tree, *loaded(tree, world))
        self.contact, self.motors = Contact(world), Motors(world)
        self.ground = Ground([(run.lanes, run.borders) for run in runs], vehicle.beside)
        joints = np.array([tree.joints.index(f"wheel_{name}") for name in vehicle.wheels])
        self.wheel_joint, self.wheel_link = joints, joints + 1
        self.wheels = 6 + np.array([tree.names.index(f"wheel_{name}") for name in vehicle.wheels])
        self.steers = 6 + np.array([tree.names.index(f"steer_{name}") for name in vehicle.steered], dtype=int)
        self.rows = tree.above[self.wheel_link]
        self.columns = np.ascontiguousarray(self.rows.T)
        self.sprung = np.array([j for j, name in enumerate(tree.joints) if name in vehicle.angles], dtype=int)
        self.rockers = np.array([tree.joints.index(name) for name in vehicle.angles[:2]], dtype=int)
        self.size = self.bodies.size
        self.count = len(vehicle.wheels)
        self.cuts = np.cumsum([self.size] + 5 * [self.count])
        self.side = np.array([int(name.endswith("l")) for name in vehicle.wheels])
        self.down = down(world["gravity"], world["GravityTilt.rise_x"], world["GravityTilt.rise_y"])
        start = np.array([run.start[:2] for run in runs], dtype=float).T
        self.anchor = start + np.stack((world["TetherDrag.x_0"], world["TetherDrag.y_0"]))
        self.r = world["r"] * (1.0 + world["WheelScale.e"])

    def pose(self, state, steer, step, braked=False):
        w, runs = self.world, self.world.size
        u = state.fast[: self.size]
        frames = self.bodies.frames(rotation_of(state.quaternion), state.angles)
        M, bias = self.bodies.dynamics(frames, u, self.down)
        M[self.wheels, self.wheels] += HELD if braked else w["armature"]
        still = -bias
        still[self.steers] -= w["servo_stiffness"] * (state.angles[self.steers - 6] + step * u[self.steers] - steer)
        M[self.steers, self.steers] += step * w["servo_damping"]
        sprung = self.sprung
        low, high = self.tree.limits[:, sprung, None]
        turned = (self.bodies.collect @ state.angles)[sprung]
        over = turned - np.clip(turned, low, high)
        inverse = np.linalg.inv(np.ascontiguousarray(np.moveaxis(M, 2, 0)))
        centre = state.place[:, None] + frames.place[:, self.wheel_link]
        axle = frames.axis[:, self.wheel_joint]
        pieces = touch(self.ground, centre, axle, w["r"][0])
        order = np.argsort(pieces.wheel, kind="stable")
        pieces = Pieces(*(piece[..., order] for piece in pieces))
        ends = np.searchsorted(pieces.wheel, np.arange(self.count * runs))
        wheel_axles = axle.reshape(3, -1)[:, pieces.wheel]
        forward = cross(wheel_axles, pieces.normal)
        forward /= np.sqrt(dot(forward, forward))
        side = cross(pieces.normal, forward)
        p = self.contact.place(pieces, centre[0], self.side)
        return Pose(
            frames, inverse, still, pieces, p, ends, order, forward, side, frames.place[:, self.wheel_link], axle,
            state.angles, over, state.place,
        )  # fmt: skip

    def rates(self, t, fast, pose, duty, braked=False):
        """Return d(fast)/dt at a pose, and what is recorded."""
        w, runs = self.world, self.world.size
        u, along, across, dug, windup, loss, drawn = np.split(fast, self.cuts)
        force, slipped = self.soil(u, along, across, dug, pose)
        force += pose.still
        torque, current, hub, supply, *inner = self.motors.run(
            duty, pose.angles[self.wheels - 6], u[self.wheels], windup, drawn, loss
        )
        if not braked:
            force[self.wheels] += torque
        force[self.steers] -= w["servo_damping"] * u[self.steers]
        self.hinge(force, u, pose)
        self.outside(force, t, u, pose)
        change = np.matmul(pose.inverse, np.ascontiguousarray(force.T)[:, :, None])[:, :, 0].T
        S, along_rate, across_rate, dug_rate = slipped
        rate = np.concatenate((change, along_rate, across_rate, dug_rate, inner[0], inner[2], inner[1]))
        return rate, {
            "slip": S,
            "current": current,
            "hub": hub,
            "rim": u[self.wheels],
            "supply": np.broadcast_to(supply, (1, runs))[0],
        }

    def soil(self, u, along, across, dug, pose):
        spin, velocity = self.bodies.speeds(pose.frames, u, self.rows)
        pieces, runs = pose.pieces, self.world.size
        at_centre = velocity + cross(spin, pose.centre)
        wheel_axles = pieces.wheel
        v = at_centre.reshape(3, -1)[:, wheel_axles]
        axle = pose.axle.reshape(3, -1)[:, wheel_axles]
        run = wheel_axles % runs
        rim = (self.r * dot(pose.axle, spin)).ravel()[wheel_axles]
        speeds = np.stack((dot(pose.forward, v), dot(pose.side, v), -dot(pieces.normal, v), rim))
        load = self.contact.load(pose.p, speeds, *(array.ravel()[wheel_axles] for array in (along, across, dug)))
        share, lean = pieces.share, pieces.lean
        f_t, f_y, f_n = load.f_t, load.f_y, load.f_n
        push = (share * f_t - lean * f_n) * pose.forward + share * f_y * pose.side
        push += (lean * f_t + share * f_n) * pieces.normal
        moment = cross(-self.world["r"][run] * pieces.inward, f_y * pose.side + f_n * pieces.normal)
        moment -= dot(moment, axle) * axle
        moment = share * moment - (pieces.turn * load.torque) * axle
        weight = np.maximum(share * f_n, 1e-12)
        states = np.stack((load.S, load.along_rate, load.across_rate, load.dug_rate)) * weight
        sums = np.add.reduceat(np.concatenate((push, moment, states, weight[None])), pose.ends, axis=1)
        sums = sums.reshape(11, self.count, runs)
        force, moment = sums[:3], sums[3:6]
        moment = moment + cross(pose.centre, force)
        total = np.empty((self.size, runs))
        total[:3], total[3:6] = force.sum(axis=1), moment.sum(axis=1)
        frames = pose.frames
        carried = dot(frames.axis, np.matmul(self.columns, moment)) + dot(frames.moment, np.matmul(self.columns, force))
        total[6:] = self.bodies.collect.T @ carried
        return total, sums[6:10] / sums[10]

    def hinge(self, force, u, pose):
        """Add end stops, pivot friction and a compliant differential."""
        w, C = self.world, self.bodies.collect
        rate = C @ u[6:]
        torque = np.zeros_like(rate)
        if np.any(pose.over):
            push = -w["stop_stiffness"] * pose.over - w["stop_damping"] * rate[self.sprung]
            torque[self.sprung] += np.where(push * pose.over < 0.0, push, 0.0)
        if w.has("PivotFriction.tau_c") or w.has("PivotFriction.b"):
            turning = rate[self.sprung]
            torque[self.sprung] -= w["PivotFriction.tau_c"] * np.tanh(turning / w["PivotFriction.w_s"])
            torque[self.sprung] -= w["PivotFriction.b"] * turning
        if self.soft:
            twist = (C @ pose.angles)[self.rockers].sum(axis=0)
            half = 0.5 * w["DifferentialCompliance.backlash"]
            outside = twist - np.clip(twist, -half, half)
            pull = outside + w["DifferentialCompliance.relaxation"] * rate[self.rockers].sum(axis=0)
            torque[self.rockers] -= np.where(outside != 0.0, pull, 0.0) / w["DifferentialCompliance.compliance"]
        force[6:] += C.T @ torque

    def outside(self, force, t, u, pose):
        """Add tether and snags, which are forces on the base's origin against its horizontal velocity."""
        w = self.world
        if not any(map(w.has, ("TetherDrag.f_0", "TetherDrag.f_1", "SpringTether.k", "Snag.force"))):
            return
        tether_length = np.hypot(*(pose.place[:2] - self.anchor))
        pull = w["TetherDrag.f_0"] + w["TetherDrag.f_1"] * tether_length
        pull = pull + w["SpringTether.k"] * np.maximum(tether_length - w["SpringTether.slack"], 0.0)
        pull = pull + w["Snag.force"] * snagging(w.runs, t)
        force[:2] -= pull * u[:2] / np.sqrt(u[0] ** 2 + u[1] ** 2 + w["TetherDrag.v_0"] ** 2)


def loaded(tree, world):
    """Return masses and centres of mass with a point mass and a shifted centre on the base, or unchanged ones."""
    if not any(world.has(f"PointMass.{name}") for name in ("m", "shift_x", "shift_z")):
        return None, None
    mass = np.repeat(tree.mass[:, None], world.size, axis=1)
    com = np.repeat(tree.com[:, :, None], world.size, axis=2)
    base, added = tree.mass[0], world["PointMass.m"]
    total_mass = tree.mass.sum()
    shift = np.stack((world["PointMass.shift_x"], np.zeros(world.size), world["PointMass.shift_z"]))
    centre = rest_centre(tree)
    mass[0] += added
    com[:, 0] = (base * tree.com[:, :1] + added * centre[:, None] + (total_mass + added) * shift) / (base + added)
    return mass, com


def rest_centre(tree):
    """Return the centre of mass of the whole rover at zero angles, in the base's axes."""
    place = np.zeros((3, len(tree.links)))
    for j, up in enumerate(tree.parent):
        place[:, j + 1] = place[:, up] + tree.place[:, j]
    return (place + tree.com) @ tree.mass / tree.mass.sum()


def down(g, rise_x, rise_y):
    """Return the gravity on a table that is tilted by these angles."""
    x, y = np.sin(rise_x), np.sin(rise_y)
    return -g * np.stack((x, y, np.sqrt(1.0 - x * x - y * y)))


def snagging(runs, t):
    """Return the share of each run's largest pull at time t: half a sine wave over each snag."""
    share = np.zeros(len(runs))
    for b, run in enumerate(runs):
        for begin, duration in run.snags:
            if begin < t < begin + duration:
                share[b] += np.sin(np.pi * (t - begin) / duration)
    return share
