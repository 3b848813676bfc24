"""The bend that all runs of a log share, as an effect: what their slopes have in common along x."""

from collections.abc import Sequence

import numpy as np

from rover_pin.effects.bent_ground import KNOTS, STEEP, BentGround
from rover_pin.experiments.drive_log.features import LoggedRun
from rover_pin.simulation.replay import filled

SHARED = 0.5
"""Share of the slopes' sum of squares from which runs have a bend in common; the rest is each run's own raking."""
SHORTEST = 0.2
"""Way along x from which a bend is identified [m]: the rover's own length smooths what is shorter (assumed)."""
WEIGHT = 1e-3
"""Of a knot's slope being 0 against one run over it: knots that nothing passed stay as declared."""


def shared_bend(runs: Sequence[LoggedRun], slopes: Sequence[np.ndarray]) -> BentGround | None:
    """Return the bend along x whose slope along each heading is nearest to these slopes (T,) beside the declared [rad].

    Least squares over all rows of sum (s(x) cos(heading) - slope)^2, s as `BentGround` has it, its knots along all of
    the way. None where that takes less than SHARED of what they have, or where nothing was driven along x.
    """
    x = np.concatenate([filled(run.commands.place[:, 0]) for run in runs])
    low, high = float(np.min(x)), float(np.max(x))
    if not high - low > SHORTEST:
        return None
    ahead = np.cos(np.concatenate([np.asarray(run.heading, dtype=float) for run in runs]))
    knots = np.linspace(low, high, KNOTS)
    spacing = float(knots[1] - knots[0])
    rows = np.maximum(0.0, 1.0 - np.abs(x[:, None] - knots) / spacing) * ahead[:, None]
    right = np.concatenate(list(slopes))
    finite = np.isfinite(right) & np.isfinite(rows).all(axis=1)
    rows, right = rows[finite], right[finite]
    penalty = WEIGHT * len(right) / len(runs)
    knot_slopes = np.linalg.solve(rows.T @ rows + penalty * np.eye(KNOTS), rows.T @ right)
    residual_sum = float(np.sum((rows @ knot_slopes - right) ** 2))
    if not residual_sum < (1.0 - SHARED) * float(np.sum(right**2)):
        return None
    slope_by_knot = {
        name: float(np.clip(slope, -STEEP, STEEP)) for name, slope in zip(BentGround.neutral, knot_slopes, strict=True)
    }
    return BentGround(**slope_by_knot, x_from=low - spacing, length=(KNOTS + 1) * spacing)
