"""Where a drive begins: a rover set down on its terrain, at rest."""

import dataclasses
import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
import pinocchio as pin

from rover_pin.base.arguments import spec
from rover_pin.base.errors import SimulationError
from rover_pin.effects.effect import BodyEffect
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.start.relaxation import Rest, relaxed, slip_columns
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


def settled(model: Model, start: Start, symmetric: bool = False) -> DriveState:
    """Return the state of `set_down` alone."""
    return set_down(model, start, symmetric).state


def shared_rest(model: Model, start: Start) -> DriveState:
    """Return the state of `set_down` as any model can take it over: of the effects' states the soil's shear alone."""
    state = settled(model, start)
    return dataclasses.replace(state, contact=state.contact[:, slip_columns(model)], motor=state.motor[:, :0])


def taken_over(model: Model, rest_state: DriveState) -> DriveState:
    """Return a model at another's `shared_rest`: same place and shear, its effects at the start of their states."""
    taken, slip = rest_state.copy(), slip_columns(model)
    wheels = len(model.rover.wheels)
    taken.contact = np.zeros((wheels, sum(len(effect.states) for effect in model.contact_effects)))
    taken.motor = np.zeros((wheels, sum(len(effect.states) for effect in model.motor_effects)))
    if rest_state.contact.shape[1] == len(slip):  # else their laws of slip know another shear
        taken.contact[:, slip] = rest_state.contact
    return taken


def set_down(model: Model, start: Start, symmetric: bool = False) -> SetDown:
    """Set the rover down at x, y and yaw of `start`, wheels locked: first held by a hand, then by the soil alone.

    Both are states of rest at exactly that place and heading. In the first the normal forces carry the rover's weight,
    and the hand takes what pulls it along the ground or turns it. In the second the soil under each wheel is sheared as
    by a slide of the whole rover that is just long enough to hold it. On ground too steep for that, or with a slip law
    that cannot hold, the rover starts as in the first: unsheared, and slides. Friction in its pivots is left out: it is
    set down where it would come to rest without; effects' own states start unused.

    Raises SimulationError: the rover does not come to rest there even when it is held.
    """
    model = dataclasses.replace(model, body_effects=tuple(map(_at_rest, model.body_effects)))
    state = hovering(model, start)
    rest_kind = relaxed(model, state, start.yaw, symmetric)
    if rest_kind is Rest.NEVER:
        raise SimulationError(
            f"The rover does not settle at x = {start.x:g} m, y = {start.y:g} m: it tips or sinks there; "
            "start on gentler ground or on stiffer soil."
        )
    return SetDown(state, RESTS if rest_kind is Rest.RESTS else SLIDES)


def _at_rest(effect: BodyEffect) -> BodyEffect:
    return effect.replace(**effect.neutral) if effect.only_resists else effect


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
    data = rover.model.createData()
    pin.forwardKinematics(rover.model, data, q)
    lift = []
    for wheel in rover.wheels:
        x, y, z = data.oMi[wheel.joint].translation
        lift.append(float(terrain.height(x, y)) + float(wheel.wheel.r) - z)
    q[2] = max(lift)
    n = len(rover.wheels)
    contact = sum(len(effect.states) for effect in model.contact_effects)
    motor = sum(len(effect.states) for effect in model.motor_effects)
    return DriveState(0.0, q, np.zeros(rover.model.nv), np.zeros((n, contact)), np.zeros((n, motor)))
