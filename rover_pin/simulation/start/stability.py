"""Whether a rover that was set down at rest is only marginally stable: a push far below its driving speed tells."""

from __future__ import annotations

import math

from rover_pin.simulation.driving import Drive

PUSH = 1e-4
"""Speed [m/s] of the push: a 500th of THROWN."""
THROWN = 0.05
"""Speed [m/s] that no push may bring within WATCHED: the paper's 0.05 m/s, at which a rover drives."""
WATCHED = 0.05
"""Time [s] after the push, some ten of the default steps; ready-made drives that are pushed so stay below 0.02 m/s."""


def thrown_by_a_push(drive: Drive) -> str:
    """Return a doubt where a push forwards or backwards throws the rover off, or nothing; the drive is used up.

    A rest of the soil need not be stable: where F(S) falls, slip that lags behind the speeds gives energy, and whether
    the rover stays is decided by what the first steps round off.
    """
    begun = drive.stepper.saved()
    fastest = 0.0
    for push in (PUSH, -PUSH):
        drive.stepper.restore(begun)
        drive.state.v[0] += push
        fastest = max(fastest, _fastest(drive))
    if fastest <= THROWN:
        return ""
    return f"a push of {1e3 * PUSH:g} mm/s throws the rover off where it stands"


def _fastest(drive: Drive) -> float:
    """Return the greatest speed along the ground [m/s] that follows, no further than THROWN; infinite: a step fails."""
    fastest = 0.0
    for _ in range(max(1, round(WATCHED / drive.timing.dt))):
        if drive.stepper.step():
            return math.inf
        fastest = max(fastest, math.hypot(*drive.state.v[:2]))
        if fastest > THROWN:
            break
    return fastest
