"""Conditions that stop a drive: the computation has diverged, the rover has capsized, a wheel is buried in the soil, or
a suspension joint has moved far beyond its end stop ("folded").
"""

import math

import numpy as np

from rover_pin.simulation.model.model import Model
from rover_pin.simulation.native.shared import RECORD
from rover_pin.simulation.state import DriveState, roll_pitch_yaw, suspension_places

MAX_TILT = math.radians(60.0)
"""Largest angle between the body's vertical and the world's vertical [rad] (assumed). Beyond this angle the rover
counts as capsized, and the drive ends. The angle is far beyond the slopes that wheels climb on loose soil."""
MIN_UPRIGHT_COSINE = math.cos(MAX_TILT)
MAX_OVERTRAVEL = math.radians(10.0)
"""Largest excess of a suspension joint's angle over its end stop [rad] (assumed). Beyond this angle the suspension
counts as folded, and the drive ends, because no real end stop yields so far."""
MAX_SPEED = 10.0
"""Largest speed of the base along one of its axes [m/s]. Beyond this speed the computation counts as diverged, because
no rover is so fast, and the drive ends."""


def failure(model: Model, state: DriveState, record: np.ndarray) -> str | None:
    """Return the reason why a drive cannot go on from this state (diverged, capsized, buried or folded), or None if it
    can go on.

    The function `fails` in native/row.c makes these checks in the compiled loop.

    Parameters
    ----------
    model, state : Model, DriveState
        The model and its present state.
    record : array (wheels, quantities)
        Quantities of the wheels in this state; `RECORD` names the columns.
    """
    # Negated, so that a speed that is NaN fails too.
    if not float(np.abs(state.v[:3]).max()) < MAX_SPEED:
        return "diverged: the rover is faster than any rover"
    # The cosine of the tilt is the z component of the body's vertical.
    x, y = state.q[3], state.q[4]
    if 1.0 - 2.0 * (x * x + y * y) < MIN_UPRIGHT_COSINE:
        roll, pitch, _ = roll_pitch_yaw(state.q)
        return f"capsized: roll {math.degrees(roll):.0f} deg, pitch {math.degrees(pitch):.0f} deg"
    # Beyond this depth the front of the wheel pushes soil, which the contact law does not describe.
    sinkage = record[:, RECORD.index("sinkage")].tolist()
    for wheel, depth in zip(model.rover.wheels, sinkage, strict=True):
        if depth > model.buried * wheel.wheel.r:
            return f"buried: wheel {wheel.name} has sunk by {1e3 * depth:.0f} mm, over {model.buried:g} r"
    # End stops are stiff springs, so that a joint may exceed its limit by a small angle, but not by a large one.
    joints, stops = suspension_places(model.rover), model.rover.model
    angle, lower, upper = state.q[joints], stops.lowerPositionLimit[joints], stops.upperPositionLimit[joints]
    over = float(np.maximum(angle - upper, lower - angle).max(initial=0.0))
    if over > MAX_OVERTRAVEL:
        return f"folded: a suspension joint is {math.degrees(over):.0f} deg past its stop"
    return None
