"""What a finished drive must say about itself: that it is not to be believed, and why."""

from __future__ import annotations

import math

import numpy as np

from rover_pin.simulation.model.model import Model
from rover_pin.simulation.native.shared import RECORD
from rover_pin.simulation.trace.trace import Trace

LOAD_BAND = (0.99, 1.01)
"""`mean_load` within which a drive is believed: 0.9997 to 1.005 in 300 random drives that resolve it, 6 to
137 in drives that did not."""
SHORTEST = 0.5
"""Time [s] below which a drive is too short for its mean load to say anything."""
MOST_MISSED, MOST_MISSED_A_SECOND = 0.005, 1e-3
"""Change of speed [m/s] that all misjudged forces of a drive would make together, in all and in a second of it, beyond
which it is doubted; those of ready-made drives on k = 1 mm and more make less than 0.0031 in 20 s."""
MOST_UNBALANCED, AT_REST = 0.01, 1e-6
"""Error of the energy's balance beyond which a drive is not believed; and energy over weight times a wheel's radius
that is none."""
MOST_AIRBORNE = 1.0 / 3.0
"""Share of a drive that its wheels are off the ground, on average, beyond which it hops."""

BRAKED, MOST_BRAKED = -0.1, 0.1
"""Slip beyond which a wheel counts as braked, and the share of a drive beyond which that is a doubt: the pull bends
where it is no more than its torque pays for. Of 747 random drives 5 that half the step moves had no other sign; of the
ready-made ones the bump is braked most, 9 % of the time."""


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


def doubts_of(model: Model, rows: np.ndarray, misjudged: float) -> list[str]:
    """Return what makes it doubtful whether half the step goes the same way. `misjudged` is `Ran.missed`."""
    reasons = []
    missed = misjudged * model.gravity
    if missed > min(MOST_MISSED, MOST_MISSED_A_SECOND * _duration(rows)):
        reasons.append(f"wheels' forces turned faster than the steps, which misjudged them by {missed:.2g} m/s in sum")
    hopping = airborne(rows)
    if hopping > MOST_AIRBORNE:
        reasons.append(f"the wheels were off the ground {hopping:.0%} of the time")
    braked_share = braked(rows)
    if braked_share > MOST_BRAKED:
        reasons.append(f"the wheels were braked beyond S = {BRAKED} {braked_share:.0%} of the time")
    return reasons


def _duration(rows: np.ndarray) -> float:
    return float(rows["t"][-1] - rows["t"][0]) if len(rows) else 0.0


def airborne(rows: np.ndarray) -> float:
    """Return the share of the drive that the wheels are off the ground, on average; 0 for one of less than SHORTEST."""
    if _duration(rows) < SHORTEST:
        return 0.0
    return float(np.mean(rows["record"][:, :, RECORD.index("normal")] == 0.0))


def braked(rows: np.ndarray) -> float:
    """Return the share of the drive that its wheels are on the ground and braked beyond BRAKED, on average."""
    if not len(rows):
        return 0.0
    record = rows["record"]
    pressed = record[:, :, RECORD.index("normal")] > 0.0
    return float(np.mean(pressed & (record[:, :, RECORD.index("slip")] < BRAKED)))


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
    if _duration(rows) < SHORTEST:
        return 1.0
    rover, first, last = model.built, rows[0], rows[-1]
    climb = [float(rover.up @ row["velocity"]) for row in (first, last)]
    force = float(rover.up @ (last["impulse"] - first["impulse"])) - rover.mass * (climb[1] - climb[0])
    load = force / (last["t"] - first["t"]) / (rover.mass * model.gravity)
    return load if math.isfinite(load) else math.inf
