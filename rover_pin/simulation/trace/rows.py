"""The rows of a drive: one record an instant, as the compiled loop writes it."""

from typing import Any

import numpy as np

from rover_pin.simulation.model.model import Model
from rover_pin.simulation.native.shared import ENERGY, RECORD


def row_type(model: Model) -> np.dtype[Any]:
    """Return the type of a drive's rows: numbers alone, in the order of `rover_pin_row` in native/row.c."""
    rover = model.rover
    wheels = len(rover.wheels)
    steered = sum(wheel.steer_dof is not None for wheel in rover.wheels)
    shapes: dict[str, tuple[int, ...]] = {
        "t": (),
        "q": (rover.model.nq,),
        "v": (rover.model.nv,),
        "record": (wheels, len(RECORD)),
        "duty": (wheels,),
        "servo": (steered,),
        "energy": (len(ENERGY),),
        "impulse": (3,),
        "differential": (),
        "mechanical": (2,),
        "attitude": (3,),
        "velocity": (3,),
        "moved": (3,),
    }
    return np.dtype([(name, float, shape) for name, shape in shapes.items()])


def finite(rows: np.ndarray) -> np.ndarray:
    """Return the rows before the first that holds a number that is not finite: a drive that diverges overflows."""
    if not len(rows):
        return rows
    bad = ~np.isfinite(np.ascontiguousarray(rows).view(float).reshape(len(rows), -1)).all(axis=1)
    return rows[: int(bad.argmax())] if bad.any() else rows
