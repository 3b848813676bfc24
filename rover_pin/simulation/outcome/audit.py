"""What a finished drive must say about itself: that it is not to be believed, and why."""

import contextlib
import math

import numpy as np

from rover_pin.simulation.model.model import Model
from rover_pin.simulation.trace.trace import Trace

LOAD_BAND = (0.99, 1.01)
"""`mean_load` within which a drive is believed: 0.9997 to 1.005 in 300 random drives that resolve it, 6 to
137 in drives that did not."""
SHORTEST = 0.5
"""Time [s] below which a drive is too short for its mean load to say anything."""
MOST_UNBALANCED, AT_REST = 0.01, 1e-6
"""Error of the energy's balance beyond which a drive is not believed; and energy over weight times a wheel's radius
that is none."""


def load_warning(model: Model, rows: np.ndarray) -> str:
    """Return a sentence where the soil carried more or less than the weight, or nothing."""
    load = mean_load(model, rows)
    if LOAD_BAND[0] <= load <= LOAD_BAND[1]:
        return ""
    return (
        f"the soil carried {load:.3g} times the rover's weight on average, which no body can: the step "
        "is too coarse for this ground; give a smaller dt."
    )


def balance_warning(trace: Trace) -> str:
    """Return a sentence where the account of a drive's energy does not balance, or nothing; at rest there is none."""
    if len(trace.t) < 2:
        return ""
    most = max(float(np.ptp(values)) for name, values in trace.channels.items() if name.startswith("energy_"))
    weight = float(np.mean(np.sum(trace.stack("normal"), axis=1)))
    off = trace.energy_error()
    if off <= MOST_UNBALANCED or most <= AT_REST * weight * float(np.min(trace.attrs["wheel_radii_m"])):
        return ""
    return f"its energy does not balance, by {off:.2g} of the greatest: the step is too coarse; give a smaller dt."


def pivot_warning(steps: int) -> str:
    """Return a sentence where the equations were nearly singular in some steps, or nothing."""
    if not steps:
        return ""
    return (
        f"the equations of motion were nearly singular in {steps} steps, which were solved with exchanged rows: "
        "look for a joint that moves next to no mass, or give a smaller dt."
    )


def mean_load(model: Model, rows: np.ndarray) -> float:
    """Return the mean of the soil's forces against gravity over the weight [-], less what the rover gained in momentum.

    (I . up / T - m dv/dt) / (m g), I the impulse of all wheels' forces as each step began: 1 by Newton's second law
    where the steps resolve them, whatever the ground. 1 for a drive of less than SHORTEST.
    """
    if not len(rows) or rows["t"][-1] - rows["t"][0] < SHORTEST:
        return 1.0
    rover, first, last = model.built, rows[0], rows[-1]
    climb = [float(rover.up @ row["velocity"]) for row in (first, last)]
    force = float(rover.up @ (last["impulse"] - first["impulse"])) - rover.mass * (climb[1] - climb[0])
    load = force / (last["t"] - first["t"]) / (rover.mass * model.gravity)
    return load if math.isfinite(load) else math.inf


def radii_of(trace: Trace) -> np.ndarray:
    """Return the wheels' radii [m]; NaN where a file has none, or no such numbers."""
    with contextlib.suppress(KeyError, TypeError, ValueError):
        return np.asarray(trace.attrs["wheel_radii_m"], dtype=float).reshape(len(trace.wheels), 1)[:, 0]
    return np.full(len(trace.wheels), math.nan)
