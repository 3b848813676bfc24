"""Checks of a finished drive. Each reason not to believe the simulation becomes a warning. A note lists the end stops
of the suspension that yielded.
"""

import contextlib
import math

import numpy as np

from rover_pin.simulation.model.model import Model
from rover_pin.simulation.state import suspension_places
from rover_pin.simulation.trace.trace import Trace

LOAD_BAND = (0.99, 1.01)
"""Smallest and largest credible value of `mean_load`, the mean force of the soil divided by the rover's weight. By
Newton's second law the value is 1. Outside this range a warning is given; steps that are too long for stiff ground give
several times 1."""
MIN_DURATION = 0.5
"""Shortest drive [s] whose mean load is checked. In a shorter drive a single bounce would decide the mean."""
MIN_YIELD = math.radians(0.1)
"""Smallest angle [rad] beyond an end stop that gives a note. The note states that the end stop yielded. A smaller angle
is the usual compression of the stiff spring that represents the end stop."""
MAX_ENERGY_ERROR, MIN_ENERGY = 0.01, 1e-6
"""MAX_ENERGY_ERROR is the largest credible relative error of the energy balance of a drive (assumed); beyond it, a
warning is given. MIN_ENERGY is the smallest ratio of the drive's largest energy to weight times wheel radius at which
the balance is checked. Below it, the rover counts as at rest, and round-off would decide the error."""


def load_warning(model: Model, rows: np.ndarray) -> str:
    """Return a warning if the soil carried more or less than the rover's weight on average, or an empty string if it
    carried the weight.
    """
    load = mean_load(model, rows)
    if LOAD_BAND[0] <= load <= LOAD_BAND[1]:
        return ""
    return (
        f"the soil carried {load:.3g} times the rover's weight on average, which is physically impossible: the step "
        "is too coarse for this ground; give a smaller dt."
    )


def balance_warning(trace: Trace) -> str:
    """Return a warning if the energies of a drive do not balance (work of the motors against mechanical energy and
    losses), or an empty string if they do.
    """
    if len(trace.t) < 2:
        return ""
    largest = max(float(np.ptp(values)) for name, values in trace.channels.items() if name.startswith("energy_"))
    weight = float(np.mean(np.sum(trace.stack("normal"), axis=1)))
    # Energies are compared with the work of lifting the rover by one wheel radius.
    error = trace.energy_error()
    # At rest the energies are round-off, whose balance means nothing.
    if error <= MAX_ENERGY_ERROR or largest <= MIN_ENERGY * weight * float(np.min(trace.attrs["wheel_radii_m"])):
        return ""
    return (
        f"its energy does not balance: the error is {error:.2g} of the largest energy, which shows that the step is "
        "too coarse; give a smaller dt."
    )


def stops_note(model: Model, trace: Trace) -> str:
    """Return a note on the suspension joints that went beyond their end stops, or an empty string if no joint did.

    Example: "stops yielded: bogie_l 2.0 deg past its stop at 5.7 deg (t = 3.1 s)". The end stops of the simulation are
    stiff springs with dampers, because a rigid stop would be hit within one step. They therefore yield under load. The
    angle of a joint is compared with the limit that the URDF states.
    """
    limits, notes = model.rover.model, []
    joints = set(suspension_places(model.rover).tolist())
    for name, place in model.rover.angles.items():
        if place not in joints or name not in trace or not len(trace.t):
            continue
        low, high = float(limits.lowerPositionLimit[place]), float(limits.upperPositionLimit[place])
        angle = trace[name]
        # The row with the largest excess over either limit.
        past = np.maximum(angle - high, low - angle)
        row = int(np.nanargmax(past)) if np.any(np.isfinite(past)) else 0
        if past[row] > MIN_YIELD:
            # The stop on the side to which the joint has moved is the one that yielded.
            stop = high if angle[row] > high else low
            notes.append(
                f"{name} {math.degrees(past[row]):.2g} deg past its stop at {math.degrees(stop):.3g} deg "
                f"(t = {trace.t[row]:.3g} s)"
            )
    return f"stops yielded: {', '.join(notes)}" if notes else ""


def pivot_warning(steps: int) -> str:
    """Return a warning if the equations of motion were nearly singular in at least one step, or an empty string.
    `steps` is the number of such steps.
    """
    if not steps:
        return ""
    return (
        f"the equations of motion were nearly singular in {steps} steps, which were solved with exchanged rows: "
        "look for a joint that carries hardly any mass, or give a smaller dt."
    )


def mean_load(model: Model, rows: np.ndarray) -> float:
    """Return the mean supporting force of the soil in a drive, divided by the rover's weight [-]. Forces that
    accelerated the rover upwards are subtracted, so that a correct simulation gives 1.

    The result is (I . up / T - m dv/dt) / (m g), where I is the impulse of the soil's forces on all wheels in the
    duration T, computed from the forces at the beginning of each step, and m dv/dt is the mean rate of change of the
    upward momentum. By Newton's second law the result is 1 on every ground, if the steps resolve the forces. For a
    drive shorter than MIN_DURATION the function returns 1. If the mean is not a number, it returns infinity.

    Parameters
    ----------
    model : Model
        The model of the drive.
    rows : array (`row_type`)
        The rows of the drive.
    """
    if not len(rows) or rows["t"][-1] - rows["t"][0] < MIN_DURATION:
        return 1.0
    # Impulse and upward velocity are compared between the first and the last row.
    rover, first, last = model.built, rows[0], rows[-1]
    climb = [float(rover.up @ row["velocity"]) for row in (first, last)]
    force = float(rover.up @ (last["impulse"] - first["impulse"])) - rover.mass * (climb[1] - climb[0])
    load = force / (last["t"] - first["t"]) / (rover.mass * model.gravity)
    return load if math.isfinite(load) else math.inf


def radii_of(trace: Trace) -> np.ndarray:
    """Return the radii of the wheels (wheels,) [m] from the attributes of a trace; NaN if the trace, which may come
    from a file, does not have such numbers.
    """
    with contextlib.suppress(KeyError, TypeError, ValueError):
        return np.asarray(trace.attrs["wheel_radii_m"], dtype=float).reshape(len(trace.wheels), 1)[:, 0]
    return np.full(len(trace.wheels), math.nan)
