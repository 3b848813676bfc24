"""Random drives through ditches and up inclines of sand, for tuning on some and evaluating on others."""

import dataclasses
import math

import numpy as np

from rover_pin.base.errors import ParameterError
from rover_pin.parameters import TABLE_1
from rover_pin.simulation.model.cruise import CRUISE_SLIP
from rover_pin.tuning.study import DriveCase

SHEAR = (10**-2.5, 10**-1.5)
"""Range of k [m], drawn on a logarithmic scale: about 3 to 32 mm."""
WALLS, INCLINES = (30.0, 65.0), (6.0, 18.0)
"""Ranges of the wall angle of a ditch (WALLS) and of the angle of an incline (INCLINES) [deg]."""
LOSSES = (0.05, 0.4)
"""Range of the strength lost past the peak. Half of the drives lose none."""
DIGS = (0.02, 0.1)
"""Range of c_d, the share of the thrown sand that deepens the hole, drawn on a logarithmic scale."""


def random_drives(
    seed: int, ditches: int, inclines: int, duration: float, digging: float = 0.0
) -> tuple[DriveCase, ...]:
    """Return drives of `duration` [s] through ditches, then up inclines that begin half a metre ahead.

    R is chosen for each sand so that its flat is cruised at CRUISE_SLIP. With Table 1's R, sand of small k would give
    energy.

    Parameters
    ----------
    digging : float
        Share of the drives in whose sand wheels dig in (`DiggingMemory`). Everything else is unchanged for a seed.

    Raises
    ------
    ParameterError
        If a number of drives is negative, or the share is outside [0, 1].
    """
    if not 0.0 <= digging <= 1.0:
        raise ParameterError(f"digging = {digging:g} is not allowed: it is a share of the drives, from 0 to 1.")
    if min(ditches, inclines) < 0:
        raise ParameterError(f"{ditches} ditches and {inclines} inclines are not allowed: give numbers of 0 or more.")
    # A second generator for the holes, so that the drives of a seed do not change with `digging`.
    rng, holes = np.random.default_rng(seed), np.random.default_rng([seed, 1])
    drawn = (_drawn(rng, i < ditches, duration, i + 1) for i in range(ditches + inclines))
    return tuple(_digging(holes, case, digging) for case in drawn)


def _digging(rng: np.random.Generator, case: DriveCase, share: float) -> DriveCase:
    """Return the drive with digging sand, for a random share of the drives."""
    digs, c_d = rng.random() < share, round(math.exp(rng.uniform(*np.log(DIGS))), 3)
    if not digs:
        return case
    settings = (*case.settings, ("add", f"DiggingMemory.c_d={c_d}"))
    return dataclasses.replace(case, name=f"{case.name}, c_d {c_d:g}", settings=tuple(sorted(settings)))


def _drawn(rng: np.random.Generator, ditch: bool, duration: float, number: int) -> DriveCase:
    """Return a random drive through a ditch or up an incline."""
    # The order of the draws is fixed, so that a seed always gives the same drives.
    k = round(math.exp(rng.uniform(*np.log(SHEAR))), 5)
    lost = round(float(rng.uniform(*LOSSES)), 3) if rng.random() < 0.5 else 0.0
    angle = round(float(rng.uniform(*(WALLS if ditch else INCLINES))), 1)
    ground = {"terrain.wall_angle_deg": angle} if ditch else {"terrain.angle_deg": angle, "terrain.start": 0.5}
    kind = "ditch" if ditch else "incline"
    name = f"{number}: {kind} {angle:g} deg, k {1e3 * k:.1f} mm, past {100 * lost:.0f} %"
    sand = {"soil.k": k, "soil.phi": float(TABLE_1.phi), "cruise_slip": CRUISE_SLIP}
    return DriveCase(name, kind, tuple(sorted({**sand, "duration": duration, **ground}.items())), lost)
