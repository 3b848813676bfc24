"""A rover brought to rest in place: Newton's method on the balance of forces, kept in hand by inertia."""

import ctypes
from enum import IntEnum
from typing import Any

import numpy as np

from rover_pin.effects.slip import SIDEWAYS_SHARE
from rover_pin.rover.wheel_base import wheel_places
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.native.library import library
from rover_pin.simulation.native.shared import SettlingStruct, fill
from rover_pin.simulation.state import DriveState

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


def relaxed(model: Model, state: DriveState, yaw: float, symmetric: bool) -> Rest:
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
