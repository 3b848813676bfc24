"""What a finished drive must say about itself: that it is not to be believed, and why."""

from __future__ import annotations

import math

import numpy as np

from rover_pin.motion.model import Model
from rover_pin.motion.native.shared import RECORD

LOAD_BAND = (0.95, 1.05)
"""`mean_load` within which a drive is believed: 0.9997 to 1.005 in 300 random drives that resolve it, 6 to
137 in drives that did not."""
SHORTEST = 0.5
"""Time [s] below which a drive is too short for its mean load to say anything."""
MOST_MISSED = 0.005
"""Change of speed [m/s] that all misjudged forces of a drive would make together, beyond which it is doubted; those of
ready-made drives on k = 1 mm and more make less than 0.0031."""
MOST_AIRBORNE = 1.0 / 3.0
"""Share of a drive that its wheels are off the ground, on average, beyond which it hops."""


def warnings_of(model: Model, rows: np.ndarray, misjudged: float) -> list[str]:
    """Return a sentence for each reason not to believe a drive; none is the rule. `misjudged` is `Ran.missed`."""
    made = []
    load = mean_load(model, rows)
    if not LOAD_BAND[0] <= load <= LOAD_BAND[1]:
        made.append(
            f"the soil carried {load:.3g} times the rover's weight on average, which no body can: the step "
            "is too coarse for this ground; give a smaller dt."
        )
    missed = misjudged * model.gravity
    if missed > MOST_MISSED:
        made.append(
            f"wheels' forces turned faster than the steps, which misjudged them by {missed:.2g} m/s in sum: where the "
            "rover got to may depend on the step; compare with half of it, or give a smaller dt."
        )
    hopping = airborne(rows)
    if hopping > MOST_AIRBORNE:
        made.append(
            f"the wheels were off the ground {hopping:.0%} of the time: where a rover that hops lands depends on the "
            "step; compare with half of it, or give a smaller dt."
        )
    return made


def airborne(rows: np.ndarray) -> float:
    """Return the share of the drive that the wheels are off the ground, on average; 0 for one of less than SHORTEST."""
    if len(rows) < 2 or rows["t"][-1] - rows["t"][0] < SHORTEST:
        return 0.0
    return float(np.mean(rows["record"][:, :, RECORD.index("normal")] == 0.0))


def pivot_warning(steps: int) -> str:
    """Return a sentence where the equations of so many steps were nearly singular, or nothing."""
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
    if len(rows) < 2 or rows["t"][-1] - rows["t"][0] < SHORTEST:
        return 1.0
    rover, first, last = model.built, rows[0], rows[-1]
    climb = [float(rover.up @ row["velocity"]) for row in (first, last)]
    force = float(rover.up @ (last["impulse"] - first["impulse"])) - rover.mass * (climb[1] - climb[0])
    load = force / (last["t"] - first["t"]) / (rover.mass * model.gravity)
    return load if math.isfinite(load) else math.inf
