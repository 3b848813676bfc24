"""The start of a drive: the rover is set down on its terrain, and its state at rest is computed."""

import ctypes
import dataclasses
import math
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, Any, NamedTuple

import numpy as np
import pinocchio as pin

from rover_pin.base.arguments import spec
from rover_pin.base.errors import SimulationError
from rover_pin.effects.slip import SIDEWAYS_SHARE
from rover_pin.rover.wheel_base import wheel_mounts, wheel_places
from rover_pin.simulation.compiled.kernel import Kernel, library
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.native.shared import SettlingStruct, fill
from rover_pin.simulation.state import DriveState
from rover_pin.terrain.shapes import FARTHEST

RESTS, SLIDES = "at rest", "slides: the soil does not hold the rover there with its wheels locked"
"""RESTS and SLIDES: the two values of the attribute `set_down` of a trace. They state whether the soil holds the rover
at rest at its start, or whether the rover slides down from there."""
AT_ORIGIN = "assumed: the base at the origin, along x"
NO_DIRECTION_SPEED = 1.0
"""Minimum speed [m/s] for a single direction of travel while a rover is set down. Below this value, the contact laws of
forward travel and of backward travel are blended. It is far larger than in a drive, because a rover at rest has no
direction of travel."""
SLIDE = [0, 1, 5]
"""Indices in the velocity v of the base's three degrees of freedom along the ground: x, y and yaw."""
LOCKING_INERTIA = 1e15
"""Inertia [kg or kg m^2] that is added to a degree of freedom to lock it. It is so large that no force moves the degree
of freedom noticeably."""
MAX_SHEAR = (1.0, 1.0 / SIDEWAYS_SHARE)
"""Largest absolute values of the slip S and of the sideways slip S_y of a wheel. A wheel that only slides, without
rolling, reaches them. The states of the slip law are limited to them while a rover is set down."""


@dataclass(frozen=True)
class Start:
    """Position and heading of the base at the start of a drive.

    Raises
    ------
    SimulationError
        A number is not finite, or far away from the origin.
    """

    x: Annotated[float, spec("m", AT_ORIGIN, -FARTHEST, FARTHEST)] = 0.0
    "x of the base in the world [m]"
    y: Annotated[float, spec("m", AT_ORIGIN, -FARTHEST, FARTHEST)] = 0.0
    "y of the base in the world [m]"
    yaw: Annotated[float, spec("rad", AT_ORIGIN, -FARTHEST, FARTHEST)] = 0.0
    "heading of the base [rad], from x towards y"

    def __post_init__(self) -> None:
        for name, unit in (("x", "m"), ("y", "m"), ("yaw", "rad")):
            value = getattr(self, name)
            if not abs(value) <= FARTHEST:
                raise SimulationError(
                    f"start.{name} = {value:g} {unit} is not allowed: give a number from {-FARTHEST:g} to {FARTHEST:g}."
                )


class SetDown(NamedTuple):
    """Result of setting a rover down: the state at rest, and whether the soil alone holds the rover in this state."""

    state: DriveState
    "state of the rover at rest"
    standing: str
    """RESTS if the soil alone holds the rover at its start, SLIDES if the rover slides from there"""


def settled_state(model: Model, start: Start, symmetric: bool = False) -> DriveState:
    """Return the state at rest of a model's rover at the position and heading `start`. `set_down` computes this
    state.
    """
    return set_down(model, start, symmetric).state


class SharedRest(NamedTuple):
    """The state at rest of one model of a rover. Other models of this rover can start from it, so that they need not be
    set down themselves.
    """

    q: np.ndarray
    """(nq,) configuration of the rover at rest"""
    shear: np.ndarray
    """(wheels, states) states of the slip law, which describe the shear of the soil under each wheel"""
    wheels: np.ndarray
    "(wheels, 3) centres of the wheels in the world [m]"
    heights: np.ndarray
    "(wheels,) height of the ground under each wheel [m]"


def shared_rest(model: Model, start: Start) -> SharedRest:
    """Return the state at rest of a model at the position and heading `start`, in a form that other models of this
    rover can take over (`taken_over`).
    """
    state = settled_state(model, start)
    # The heights of the ground let `taken_over` correct the state for a model with another terrain.
    wheels = wheel_mounts(model.rover, state.q)[1]
    heights = np.asarray(model.ground.height(*wheels.T[:2]))
    return SharedRest(state.q, state.contact[:, slip_columns(model)], wheels, heights)


def taken_over(model: Model, shared: SharedRest) -> DriveState:
    """Return the initial state of a model that starts from the state at rest of another model. The configuration and
    the shear of the soil are taken over; all other states of effects are 0.

    If the ground of the two models has different heights under the wheels, the base is moved with the ground: the plane
    z_0 + a x + b y is fitted to the differences of the heights, the base is raised by z_0, and it is turned by the
    rotation vector (b, -a, 0). x and y of the base do not change.

    Parameters
    ----------
    model : Model
        The model that starts.
    shared : SharedRest
        State at rest of the other model.
    """
    state, slip = _state_at_rest(model, shared.q.copy()), slip_columns(model)
    if shared.shear.shape[1] == len(slip):  # else the slip laws differ, and so do their states
        state.contact[:, slip] = shared.shear
    change = np.asarray(model.ground.height(*shared.wheels.T[:2])) - shared.heights
    # Plane through the change of height under the wheels, relative to the base.
    if change.any():
        x, y, _ = (shared.wheels - shared.q[:3]).T
        rise, along_x, along_y = np.linalg.lstsq(np.column_stack([np.ones_like(x), x, y]), change)[0]
        turn = pin.Quaternion(pin.exp3(np.array([along_y, -along_x, 0.0])))
        state.q[2] += rise
        state.q[3:7] = (turn * pin.Quaternion(shared.q[3:7])).normalized().coeffs()
    return state


def _state_at_rest(model: Model, q: np.ndarray) -> DriveState:
    """Return the state with the configuration q (nq,). All speeds and all states of the effects are 0."""
    wheels, effects = len(model.rover.wheels), (model.contact_effects, model.motor_effects)
    contact, motor = (np.zeros((wheels, sum(len(effect.states) for effect in of_kind))) for of_kind in effects)
    return DriveState(0.0, q, np.zeros(model.rover.model.nv), contact, motor)


def set_down(model: Model, start: Start, symmetric: bool = False) -> SetDown:
    """Return the state of a rover that is set down at rest on its terrain, with its wheels locked.

    The state is computed in two stages, both at exactly the position and heading `start`. In the first stage, the rover
    is held as if by hand: the normal forces carry its weight, and the hand takes all forces that pull the rover along
    the ground or turn it. In the second stage, the hand lets go: the soil under each wheel is sheared as if the whole
    rover had slid just far enough for the soil to hold it. If the soil cannot hold the rover, because the ground is too
    steep or the slip law cannot hold a wheel at rest, the result is the state of the first stage, with unsheared soil,
    and the rover slides from there. Friction in pivots is ignored, so that the suspension takes the angles at which it
    would come to rest without friction.

    Parameters
    ----------
    model : Model
        The model to set down.
    start : Start
        Position and heading of the base.
    symmetric : bool
        Keep the state mirror-symmetric about the x-z plane.

    Raises
    ------
    SimulationError
        The rover does not come to rest there, even when it is held.
    """
    # Friction in the pivots would hold the suspension at any angle, so that these effects are set to neutral.
    effects = model.body_effects
    body = tuple(effect.replace(**effect.neutral) if effect.only_resists else effect for effect in effects)
    model = dataclasses.replace(model, body_effects=body)
    # The search begins with the wheels just touching the ground.
    state = hovering(model, start)
    rest = relax_state(model, state, start.yaw, symmetric)
    if rest is Rest.NEVER:
        raise SimulationError(
            f"The rover does not settle at its start x = {start.x:g} m, y = {start.y:g} m: it does not come to rest "
            "there, because it tips over or sinks too deep. Choose a start on gentler ground, or give a firmer soil."
        )
    return SetDown(state, RESTS if rest is Rest.RESTS else SLIDES)


def hovering(model: Model, start: Start) -> DriveState:
    """Return a state of the rover above the position `start`: pitched and rolled like the terrain there, and lowered
    until the first wheel touches the ground. The search for the state at rest begins with this state.
    """
    # The base's axes: forward along the heading in the plane of the ground, up along its normal.
    rover, terrain = model.rover, model.ground
    normal = np.asarray(terrain.normal(start.x, start.y))
    heading = np.array([math.cos(start.yaw), math.sin(start.yaw), 0.0])
    forward = heading - np.array([0.0, 0.0, (heading @ normal) / normal[2]])
    forward /= np.linalg.norm(forward)
    rotation = np.column_stack([forward, np.cross(normal, forward), normal])
    q = pin.neutral(rover.model)
    q[3:7] = pin.Quaternion(rotation).coeffs()
    q[:3] = start.x, start.y, 0.0
    # The highest ground under any wheel decides the height.
    x, y, z = wheel_mounts(rover, q)[1].T
    q[2] = np.max(terrain.height(x, y) + rover.radii - z)
    return _state_at_rest(model, q)


class Rest(IntEnum):
    """Result of the search for the state at rest of a rover (`relax_state`). The enum in native/settle.c has equal
    numbers.
    """

    RESTS = 0
    """the soil alone holds the rover at rest"""
    SLIDES = 1
    """the rover comes to rest only if it is held against sliding; without being held, it slides"""
    NEVER = 2
    """the rover does not come to rest, even if it is held against sliding"""


def relax_state(model: Model, state: DriveState, yaw: float, symmetric: bool) -> Rest:
    """Find the state at rest of a rover with the compiled step, write it into `state`, and return whether the rover
    comes to rest.

    The search takes implicit steps dt. Each step begins with zero speed: q <- q + dt^2/2 (M - dt D - dt^2/2 K)^-1 Q.
    Here q is the configuration, M the mass matrix, Q the generalised force, and D and K its derivatives by the speeds
    and by the sinkage of the wheels. Short steps move along the force; long steps are Newton's steps for Q = 0. The
    step grows while the rover approaches its rest, so that stiff shear (small k), stiff or soft ground and the rover's
    weight need no individual choice of the step. After each step the base is moved back along the ground to its x, y
    and heading, but the shear of the soil that the displacement has caused is kept.

    The wheels are locked. First the rover is held against sliding and turning, with the soil unsheared. A second search
    begins at a slightly different pitch: if the rest was unstable, so that the rover would tip over, this search moves
    away from it. Then the rover is released. If it is not at rest, a third search finds a state of rest on the sheared
    soil alone. If there is no such state, the result is the state of the held rover.

    Parameters
    ----------
    model, state : Model, DriveState
        The model, and the state of its rover above the ground at its start (`hovering`); this state is overwritten.
    yaw : float
        Heading of the base [rad].
    symmetric : bool
        Keep the state mirror-symmetric about the x-z plane.

    Source: pseudo-transient continuation (Kelley and Keyes, SIAM J. Numer. Anal. 35 (1998) 508).
    """
    kernel = Kernel(model, state, 1.0, symmetric, NO_DIRECTION_SPEED)
    kernel.disable_energy_balance()
    # Speeds are compared as speeds of a wheel: angular ones times the distance of the furthest wheel.
    reach = max(float(np.linalg.norm(place)) for place in wheel_places(model.rover).values())
    lengths = np.array([1.0] * 3 + [reach] * (model.rover.model.nv - 3))
    free = {"free_lengths": lengths[SLIDE], "free_rotors": kernel.armature[SLIDE]}
    # A large inertia locks wheels and slide; a length of 0 leaves them out of the search for the rest.
    locked = SLIDE + [wheel.dof for wheel in model.rover.wheels]
    lengths[locked], kernel.armature[locked] = 0.0, LOCKING_INERTIA
    # Numbers and work space of the search in C (native/settle.c).
    slip = np.array(slip_columns(model), dtype=np.int64)
    radius = min(float(wheel.wheel.r) for wheel in model.rover.wheels)
    size = sum(array.size for array in (state.q, state.v, state.contact, state.motor))
    fields: dict[str, Any] = {
        **free,
        **{name: np.zeros(size) for name in ("before", "looked", "in_hand")},
        "yaw": yaw,
        "n_slip": len(slip),
        "slip": slip,
        "gravity": model.gravity,
        "radius": radius,
        "most_slid": 10.0 * min(float(soil.k) for soil in model.soils) / radius,
        "place": state.q[:2].copy(),
        "rise": np.array(model.ground.gradient(*state.q[:2]), dtype=float),
        "lengths": lengths,
        "most_shear": np.array(MAX_SHEAR),
    }
    struct, keep = SettlingStruct(), dict[str, Any]()
    fill(struct, keep, fields)
    return Rest(library().rover_pin_set_down(ctypes.addressof(kernel.struct), ctypes.addressof(struct)))


def slip_columns(model: Model) -> list[int]:
    """Return the indices of the slip law's states in a row of `DriveState.contact`, which holds the states of all
    contact effects of a wheel. The states of the slip law describe the shear of the soil.
    """
    first = 0
    for effect in model.contact_effects:
        if effect is model.slip:
            break
        first += len(effect.states)
    return list(range(first, first + len(model.slip.states)))
