"""Why a drive cannot go on: capsized, buried, folded or diverged."""

import math

import numpy as np

from rover_pin.simulation.compiled.suspension import suspension_places
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.native.shared import RECORD
from rover_pin.simulation.state import DriveState, roll_pitch_yaw

CAPSIZED = math.radians(60.0)
UPRIGHT = math.cos(CAPSIZED)
"""The body's own vertical must stay within CAPSIZED of the world's."""
FOLDED = math.radians(10.0)
"""How far past its stop a suspension joint may go [rad]."""
FASTEST = 10.0
"""Speed [m/s] beyond which a run counts as diverged."""


def failure(model: Model, state: DriveState, record: np.ndarray) -> str | None:
    """Return why the run cannot go on, or None."""
    if not float(np.abs(state.v[:3]).max()) < FASTEST:
        return "diverged: the rover is faster than any rover"
    x, y = state.q[3], state.q[4]
    if 1.0 - 2.0 * (x * x + y * y) < UPRIGHT:
        roll, pitch, _ = roll_pitch_yaw(state.q)
        return f"capsized: roll {math.degrees(roll):.0f} deg, pitch {math.degrees(pitch):.0f} deg"
    sinkage = record[:, RECORD.index("sinkage")].tolist()
    for wheel, depth in zip(model.rover.wheels, sinkage, strict=True):
        if depth > model.buried * wheel.wheel.r:
            return f"buried: wheel {wheel.name} has sunk by {1e3 * depth:.0f} mm, over {model.buried:g} r"
    joints, stops = suspension_places(model.rover), model.rover.model
    angle, lower, upper = state.q[joints], stops.lowerPositionLimit[joints], stops.upperPositionLimit[joints]
    over = float(np.maximum(angle - upper, lower - angle).max(initial=0.0))
    return f"folded: a suspension joint is {math.degrees(over):.0f} deg past its stop" if over > FOLDED else None
