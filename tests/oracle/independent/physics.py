"""All forces on the rover and the rates of its state. Every method is one part of the physics, which a derived class
may replace.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from . import soil as soils
from .bodies import Bodies, cross, rotation_of
from .rim import Ground, Pieces, Rim
from .urdf import read

WHEELS = ("fl", "fr", "ml", "mr", "rl", "rr")
STEERED = ("fl", "fr", "rl", "rr")


@dataclass(frozen=True)
class Motor:
    """A brushed motor at the wheel: torque K (delta V - K omega) / R. The armature is the rotor's inertia, referred to
    the wheel.
    """

    supply: float
    resistance: float
    constant: float
    armature: float


@dataclass(frozen=True)
class World:
    """Every number of a drive except the commands."""

    urdf: str
    motor: Motor
    ground: Ground
    soil: soils.Soil = field(default_factory=soils.Soil)
    r: float = 0.045
    b: float = 0.05
    gravity: float = 9.81
    relaxation: float = 0.031
    "length over which slip builds up [m]"
    ringing: float = 0.1
    "its damping time T [s]"
    damping: float = 10.0
    "of the normal force [s/m]"
    resistance: float = 0.0
    "to rolling, as a share of the load"
    resistance_speed: float = 0.005
    side: float = 1.0
    "scale of the side shear"
    travel_speed: float = 0.005
    "below which driving and reversing are blended [m/s]"
    sideways_share: float = 0.05
    wheels: tuple = WHEELS
    "of links wheel_NAME_link on joints wheel_NAME"
    steered: tuple = STEERED
    "those of them on joints steer_NAME"
    own_arc: bool = False
    "whether the traction too is that of the sinkage's arc, not of the paper's fixed one"
    servo: tuple = (20.0, 0.2)
    stop: tuple = (50.0, 1.0)


class State(NamedTuple):
    """The parts of y = (position 3, quaternion w x y z, angles 13, speeds 19, slips along 6, slips across 6)."""

    place: np.ndarray
    quaternion: np.ndarray
    angles: np.ndarray
    speeds: np.ndarray
    along: np.ndarray
    across: np.ndarray


class Load(NamedTuple):
    """Loads on each piece: forces, torque, slips, and rates of the wheel's slips."""

    f_t: np.ndarray
    f_y: np.ndarray
    f_n: np.ndarray
    torque: np.ndarray
    S: np.ndarray
    along_rate: np.ndarray
    across_rate: np.ndarray


class Physics:
    def __init__(self, world):
        self.world = world
        self.tree = tree = read(world.urdf)
        self.wheel_link = np.array([tree.links.index(f"wheel_{name}_link") for name in world.wheels])
        self.wheel_angle = np.array([tree.names.index(f"wheel_{name}") for name in world.wheels])
        self.steer_angle = np.array([tree.names.index(f"steer_{name}") for name in world.steered], dtype=int)
        self.count = len(world.wheels)
        armature = np.zeros(6 + len(tree.names))
        armature[6 + self.wheel_angle] = world.motor.armature
        self.bodies = Bodies(tree, world.gravity, armature)
        self.rim = Rim(world.r)
        self.sprung = np.array([name.startswith(("rocker", "bogie")) for name in tree.joints])
        self.cuts = np.cumsum([3, 4, len(tree.names), 6 + len(tree.names), self.count])
        self.record = {}

    def unpack(self, y):
        return State(*np.split(y, self.cuts))

    def rates(self, t, y, duty, steer):
        """Return dy/dt."""
        state = self.unpack(y)
        unit = state.quaternion / np.sqrt(state.quaternion @ state.quaternion)
        u = state.speeds
        motion = self.bodies.motion(state.place, rotation_of(unit), state.angles, u)
        force = self.steering(state, steer) + self.stops(state)
        force[6 + self.wheel_angle] += self.motors(t, state, np.asarray(duty))
        soil, along, across = self.contact(t, state, motion)
        force += soil + self.further(t, state, motion)
        du = np.linalg.solve(motion.mass_matrix, force - motion.bias)
        w, v = unit[0], unit[1:]
        turn = 0.5 * np.concatenate([[-u[3:6] @ v], w * u[3:6] + cross(u[3:6], v)])
        return np.concatenate([u[:3], turn, u[6:], du, along, across])

    def motors(self, t, state, duty):
        motor, omega = self.world.motor, state.speeds[6 + self.wheel_angle]
        return motor.constant * (duty * motor.supply - motor.constant * omega) / motor.resistance

    def steering(self, state, target):
        force, stiff = np.zeros(len(state.speeds)), self.world.servo
        at = self.steer_angle
        force[6 + at] = -stiff[0] * (state.angles[at] - target) - stiff[1] * state.speeds[6 + at]
        return force

    def stops(self, state):
        """Return the torques of the suspension's end stops: a spring and a damper at every joint beyond its limit."""
        collect, stiff = self.bodies.collect, self.world.stop
        angle, rate = collect @ state.angles, collect @ state.speeds[6:]
        over = np.where(self.sprung, angle - np.clip(angle, *self.tree.limits.T), 0.0)
        torque = np.where(over != 0.0, -stiff[0] * over - stiff[1] * rate, 0.0)
        return np.concatenate([np.zeros(6), collect.T @ torque])

    def further(self, t, state, motion):
        """Return further generalised forces; here there are none."""
        return 0.0

    def contact(self, t, state, motion):
        """Return the soil's generalised force and the rates of the slips."""
        links, r = len(self.tree.links), self.world.r
        centre = motion.place[self.wheel_link]
        axle = motion.axis[self.wheel_link - 1]
        to_velocity = motion.by_point[links + self.wheel_link]
        to_spin = motion.by_spin[self.wheel_link]
        pieces, air = self.touching(centre, axle)
        w, n = pieces.wheel, pieces.normal
        axle, velocity, spin = axle[w], (to_velocity @ state.speeds)[w], (to_spin @ state.speeds)[w]
        forward = cross(axle, n)
        forward /= np.sqrt(np.sum(forward**2, axis=1))[:, None]
        side = cross(n, forward)
        speeds = np.stack([dot(forward, velocity), dot(side, velocity), -dot(n, velocity), r * dot(axle, spin)])
        load = self.blended(t, state, pieces, speeds, centre)
        share, lean = pieces.share[:, None], pieces.lean[:, None]
        push = load.f_t[:, None] * (share * forward + lean * n) + load.f_y[:, None] * share * side
        push += load.f_n[:, None] * (share * n - lean * forward)
        arm = -r * pieces.inward
        moment = cross(arm, load.f_y[:, None] * side + load.f_n[:, None] * n)
        moment -= dot(moment, axle)[:, None] * axle
        moment = share * moment - pieces.turn[:, None] * load.torque[:, None] * axle
        force = np.einsum("pij,pi->j", to_velocity[w], push) + np.einsum("pij,pi->j", to_spin[w], moment)
        weight = np.maximum(pieces.share * load.f_n, 1e-12)
        total = np.bincount(w, weight, self.count)

        def mean(values):
            return np.bincount(w, weight * values, self.count) / total

        self.record = {
            "slip": mean(load.S),
            "travel": mean(speeds[0]),
            "normal": np.bincount(w, pieces.share * load.f_n, self.count),
            "tangential": np.bincount(w, pieces.share * load.f_t, self.count),
            "lateral": np.bincount(w, pieces.share * load.f_y, self.count),
            "sinkage": np.where(air, 0.0, np.array([pieces.deepest[w == i].max() for i in range(self.count)])),
        }
        return force, mean(load.along_rate), mean(load.across_rate)

    def touching(self, centre, axle):
        """Return the pieces under all wheels. A wheel in the air gets a piece that does not press."""
        contact = self.rim.contact(self.world.ground, centre, axle)
        air = np.bincount(contact.wheel, minlength=self.count) == 0
        if not air.any():
            return contact, air
        up = np.array([0.0, 0.0, 1.0]) - axle[air][:, 2:] * axle[air]
        up /= np.linalg.norm(up, axis=1)[:, None]
        count = int(air.sum())
        none = Pieces(np.flatnonzero(air), *np.full((2, count), 1e-9), *np.zeros((3, count)), up, up)
        return Pieces(*(np.concatenate(parts) for parts in zip(contact, none, strict=True))), air

    def blended(self, t, state, pieces, speeds, centre):
        """Return the load in the direction of travel. A wheel that reverses is a wheel that is turned about
        the normal.
        """
        z = np.clip(0.5 * (speeds[0] + speeds[3]) / self.world.travel_speed, -1.0, 1.0)
        ahead = 0.5 + 0.25 * z * (3.0 - z * z)
        along, across = state.along[pieces.wheel], state.across[pieces.wheel]
        back = np.array([-1.0, -1.0, 1.0, -1.0])[:, None] * speeds
        law_of_contact = self.law(t, pieces, speeds, along, across, centre)
        if np.all(ahead == 1.0):
            return law_of_contact
        two = self.law(t, pieces, back, -along, -across, centre)
        sign = (-1.0, -1.0, 1.0, -1.0, -1.0, -1.0, -1.0)
        return Load(*(ahead * a + (1.0 - ahead) * s * b for s, a, b in zip(sign, law_of_contact, two, strict=True)))

    def law(self, t, pieces, speeds, along, across, centre):
        """Return the load on pieces that travel forwards at these speeds (along, left, approach, rim)."""
        world, soil = self.world, self.world.soil
        v, v_y, approach, rim = speeds
        rolling = np.maximum(np.abs(rim), np.abs(v))
        along_rate = (rim - v - rolling * along) / world.relaxation
        across_rate = (v_y - np.maximum(rolling, world.sideways_share * np.abs(v_y)) * across) / world.relaxation
        S = np.clip(along + world.ringing * along_rate, -1.0, 1.0)
        S_y = across + world.ringing * across_rate
        f_n, factor = soils.load_and_factor(S, pieces.h, soil, world.r, world.b, world.own_arc)
        f_n = f_n * np.maximum(0.0, 1.0 + world.damping * approach)
        fades = world.resistance_speed**2 / np.hypot(world.resistance_speed, rim)
        pull = np.minimum(factor, (1.0 + np.minimum(S, 0.0)) * factor)  # no more than the torque pays for
        f_t = pull * f_n - world.resistance * f_n * v / np.hypot(v, fades)
        f_y = self.side_force(S_y, f_n, f_t, pieces.h)
        return Load(f_t, f_y, f_n, factor * world.r * f_n, S, along_rate, across_rate)

    def side_force(self, S_y, f_n, f_t, h):
        world, soil = self.world, self.world.soil
        length = world.r * (1.0 + soil.exit_ratio) * soils.entry_angle(h, world.r)
        j = 0.5 * S_y * length
        strength = soil.c * world.b * length + f_n * np.tan(soil.phi)
        left = np.sqrt(np.maximum(strength**2 - f_t**2, (0.05 * strength) ** 2))
        return -np.sign(j) * world.side * left * (1.0 - np.exp(-np.abs(j) / soil.k))


def dot(a, b):
    return np.sum(a * b, axis=-1)
