"""Where a drive begins: a rover set down on its terrain, let settle until it is at rest."""

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
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.native.library import library
from rover_pin.simulation.native.shared import SettlingStruct, fill
from rover_pin.simulation.state import DriveState
from rover_pin.terrain.shapes import FARTHEST

RESTS, SLIDES = "at rest", "slides: the soil does not hold the rover there with its wheels locked"
"""What a trace says of its start: `attrs["start"]`."""

AT_ORIGIN = "assumed: the base at the origin, along x"


@dataclass(frozen=True)
class Start:
    """Where the base starts: x, y [m] and yaw [rad] in the world."""

    x: Annotated[float, spec("m", AT_ORIGIN, -FARTHEST, FARTHEST)] = 0.0
    y: Annotated[float, spec("m", AT_ORIGIN, -FARTHEST, FARTHEST)] = 0.0
    yaw: Annotated[float, spec("rad", AT_ORIGIN, -FARTHEST, FARTHEST)] = 0.0

    def __post_init__(self) -> None:
        for name, unit in (("x", "m"), ("y", "m"), ("yaw", "rad")):
            value = getattr(self, name)
            if not abs(value) <= FARTHEST:
                raise SimulationError(
                    f"start.{name} = {value:g} {unit} is not allowed: give a number within {FARTHEST:g} of 0."
                )


class SetDown(NamedTuple):
    """A rover set down: its state, without speed, and whether the soil holds it there (`RESTS` or `SLIDES`)."""

    state: DriveState
    standing: str


def settled_state(model: Model, start: Start, symmetric: bool = False) -> DriveState:
    """Return the state of `set_down` alone."""
    return set_down(model, start, symmetric).state


class SharedRest(NamedTuple):
    """Where one model of a rover comes to rest, as others take it over."""

    q: np.ndarray
    shear: np.ndarray
    "of the soil, the slip's own states (wheels, states)"
    wheels: np.ndarray
    "centres in the world (wheels, 3) [m]"
    heights: np.ndarray
    "of the ground under each wheel (wheels,) [m]"


def shared_rest(model: Model, start: Start) -> SharedRest:
    """Return the state of `set_down` as any model can take it over."""
    state = settled_state(model, start)
    wheels = wheel_mounts(model.rover, state.q)[1]
    heights = np.asarray(model.ground.height(*wheels.T[:2]))
    return SharedRest(state.q, state.contact[:, slip_columns(model)], wheels, heights)


def taken_over(model: Model, shared: SharedRest) -> DriveState:
    """Return a model at another's rest: same place and shear, its effects at the start of their states.

    Where its ground is another, the base stands higher and turns as the plane through the change dz under the wheels,
    z_0 + a x + b y: by the rotation vector (b, -a, 0), its x and y as they were.
    """
    state, slip = _not_moving(model, shared.q.copy()), slip_columns(model)
    if shared.shear.shape[1] == len(slip):  # else their laws of slip know another shear
        state.contact[:, slip] = shared.shear
    change = np.asarray(model.ground.height(*shared.wheels.T[:2])) - shared.heights
    if change.any():
        x, y, _ = (shared.wheels - shared.q[:3]).T
        rise, along_x, along_y = np.linalg.lstsq(np.column_stack([np.ones_like(x), x, y]), change)[0]
        turn = pin.Quaternion(pin.exp3(np.array([along_y, -along_x, 0.0])))
        state.q[2] += rise
        state.q[3:7] = (turn * pin.Quaternion(shared.q[3:7])).normalized().coeffs()
    return state


def _not_moving(model: Model, q: np.ndarray) -> DriveState:
    """Return a state without speed, its effects at the start of theirs."""
    wheels, effects = len(model.rover.wheels), (model.contact_effects, model.motor_effects)
    contact, motor = (np.zeros((wheels, sum(len(effect.states) for effect in of_kind))) for of_kind in effects)
    return DriveState(0.0, q, np.zeros(model.rover.model.nv), contact, motor)


def set_down(model: Model, start: Start, symmetric: bool = False) -> SetDown:
    """Set the rover down at x, y and yaw of `start`, wheels locked: first held by a hand, then by the soil alone.

    Both are states of rest at exactly that place and heading. In the first the normal forces carry the rover's weight,
    and the hand takes what pulls it along the ground or turns it. In the second the soil under each wheel is sheared as
    by a slide of the whole rover that is just long enough to hold it. On ground too steep for that, or with a slip law
    that cannot hold, the rover starts as in the first: unsheared, and slides. Friction in its pivots is left out: it is
    set down where it would come to rest without; effects' own states start unused.

    Raises SimulationError: the rover does not come to rest there even when it is held.
    """
    effects = model.body_effects
    body = tuple(effect.replace(**effect.neutral) if effect.only_resists else effect for effect in effects)
    model = dataclasses.replace(model, body_effects=body)
    state = hovering(model, start)
    rest_kind = relax_state(model, state, start.yaw, symmetric)
    if rest_kind is Rest.NEVER:
        raise SimulationError(
            f"The rover does not settle at x = {start.x:g} m, y = {start.y:g} m: it tips or sinks there; "
            "start on gentler ground or on stiffer soil."
        )
    return SetDown(state, RESTS if rest_kind is Rest.RESTS else SLIDES)


def hovering(model: Model, start: Start) -> DriveState:
    """Return the state with the wheels just touching, pitched and rolled as the terrain is at `start`."""
    rover, terrain = model.rover, model.ground
    normal = np.asarray(terrain.normal(start.x, start.y))
    heading = np.array([math.cos(start.yaw), math.sin(start.yaw), 0.0])
    forward = heading - np.array([0.0, 0.0, (heading @ normal) / normal[2]])
    forward /= np.linalg.norm(forward)
    rotation = np.column_stack([forward, np.cross(normal, forward), normal])
    q = pin.neutral(rover.model)
    q[3:7] = pin.Quaternion(rotation).coeffs()
    q[:3] = start.x, start.y, 0.0
    x, y, z = wheel_mounts(rover, q)[1].T
    q[2] = np.max(terrain.height(x, y) + rover.radii - z)
    return _not_moving(model, q)


UNDECIDED = 1.0
"""Speed [m/s] below which no direction of travel is taken while a rover is set down: at rest there is none."""
SLIDE = [0, 1, 5]
"""The base's own x, y and yaw in v: along the ground."""
LOCKED = 1e15
"""Inertia [kg, kg m^2] of what is held still."""
MOST_SHEAR = (1.0, 1.0 / SIDEWAYS_SHARE)
"""|S| and |S_y| of a wheel that only slides."""


class Rest(IntEnum):
    """How a rover stands that was set down: the enum in native/settle.c."""

    RESTS = 0
    SLIDES = 1
    NEVER = 2


def relax_state(model: Model, state: DriveState, yaw: float, symmetric: bool) -> Rest:
    """Set a rover down in one call of the compiled step: `state`, hovering at its place, is then that of its rest.

    By implicit steps, each from no speed: q <- q + dt^2/2 (M - dt D - dt^2/2 K)^-1 Q, D and K the slopes of the
    generalised force Q with speed and with the wheels' depth. Short steps follow the force, long ones are Newton's for
    Q = 0: the step grows while the rest comes nearer, so that neither a stiff shear (small k), a stiff or a soft ground
    nor the rover's weight needs its own step. After every step the base is put back along the ground to its x, y
    and heading; the shear that the way has built up stays. Wheels are locked. First the rover is held against sliding
    and turning, the soil unsheared; a second time from a slightly other pitch, so that it does not rest where it would
    tip over. Then it is let go, and if that does not hold it comes to rest on sheared soil alone. Where the soil does
    not hold it, it is left as it was in hand.

    Source: pseudo-transient continuation (Kelley and Keyes, SIAM J. Numer. Anal. 35 (1998) 508).
    """
    kernel = Kernel(model, state, 1.0, symmetric, UNDECIDED)
    kernel.disable_energy_balance()
    struct, keep = SettlingStruct(), dict[str, Any]()
    fill(struct, keep, {"yaw": yaw, **_fields(model, state, kernel)})
    status = library().rover_pin_set_down(ctypes.addressof(kernel.struct), ctypes.addressof(struct))
    return Rest(status)


def _fields(model: Model, state: DriveState, kernel: Kernel) -> dict[str, Any]:
    """Return the fields of the struct Settling; the kernel's rotors are locked by it."""
    lengths, slip = _lengths(model), np.array(slip_columns(model), dtype=np.int64)
    free = {"free_lengths": lengths[SLIDE], "free_rotors": kernel.armature[SLIDE]}
    locked = SLIDE + [wheel.dof for wheel in model.rover.wheels]
    lengths[locked], kernel.armature[locked] = 0.0, LOCKED
    radius = min(float(wheel.wheel.r) for wheel in model.rover.wheels)
    size = sum(array.size for array in (state.q, state.v, state.contact, state.motor))
    rooms = {name: np.zeros(size) for name in ("before", "looked", "in_hand")}
    return {
        **free,
        **rooms,
        "n_slip": len(slip),
        "slip": slip,
        "gravity": model.gravity,
        "radius": radius,
        "most_slid": 10.0 * min(float(soil.k) for soil in model.soils) / radius,
        "place": state.q[:2].copy(),
        "rise": np.array(model.ground.gradient(*state.q[:2]), dtype=float),
        "lengths": lengths,
        "most_shear": np.array(MOST_SHEAR),
    }


def _lengths(model: Model) -> np.ndarray:
    """Return what makes each speed one of a wheel [m/s]: 1, or for an angle how far the furthest wheel is away."""
    reach = max(float(np.linalg.norm(place)) for place in wheel_places(model.rover).values())
    return np.array([1.0] * 3 + [reach] * (model.rover.model.nv - 3))


def slip_columns(model: Model) -> list[int]:
    """Return where the slip's own states, the shear of the soil, stand among those of all contact effects."""
    first = 0
    for effect in model.contact_effects:
        if effect is model.slip:
            break
        first += len(effect.states)
    return list(range(first, first + len(model.slip.states)))
