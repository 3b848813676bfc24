"""What sheared soil holds as a spring does while slip lags behind the speeds: it gives back what was put in."""

from functools import lru_cache
from typing import NamedTuple

import casadi as ca
import numpy as np

from rover_pin.contact import Soil, Wheel
from rover_pin.effects.slip import RelaxedSlip
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.simulation.compiled import laws
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.trace.trace import Trace
from rover_pin.soil.angles import Angles, FixedAngles
from rover_pin.soil.sinkage import sinkage
from rover_pin.soil.traction import wheel_forces

GRID = np.linspace(-1.0, 1.0, 81)
"""Slips at which the law's shear is taken; its integral is that of a smooth curve to 1e-4."""


class ShearStore(NamedTuple):
    """The account of that spring, all wheels together, at each row of a drive [J]; 0 where slip follows at once."""

    taken: np.ndarray
    "what it took since the row before, L sum f_n M(s) ds; negative while it gives back"
    stored: np.ndarray
    "what it holds, E"

    @property
    def overdrawn(self) -> float:
        """By how much it gave back more than it had held and took [J]: loads that change make it, at most."""
        balance = np.cumsum(self.taken)
        return max(0.0, float(np.max(np.maximum.accumulate(balance - self.stored) - balance)))


def shear_store(model: Model, trace: Trace) -> ShearStore:
    """Return what the shear under the wheels takes, holds and gives back over the rows of a drive.

    `RelaxedSlip` is L ds/dt = r omega - v - u s, u = max(|r omega|, |v|): of the power of a shear force f = T / r,
    f (r omega - v) = f u s + f L ds/dt, the first is lost and the second loads a spring whose stretch is L s. It holds
    E = L f_n int M ds, M = T / (r f_n) of the model's soil and angles, from the slip at which M is 0. Left out is what
    further effects add to M, soils of another ground index than 0, and the shear sideways.
    """
    slip, load = model.slip, np.maximum(trace.stack("normal"), 0.0)
    if not isinstance(slip, RelaxedSlip):
        return ShearStore(np.zeros(len(load)), np.zeros(len(load)))
    lagging = _lagging(trace.t, trace.stack("slip"), float(slip.damping))
    angles = next((effect.angles for effect in model.effects if isinstance(effect, SoilTraction)), FixedAngles())
    # As plain numbers, whatever they came as: so the soil is found again.
    soil = Soil(*laws.numbers(model.soils[:1]).tolist())
    shear = [_integral_of_shear(angles, soil, mount.wheel) for mount in model.rover.wheels]
    stretched = [np.interp(s, GRID, integral) for s, integral in zip(lagging.T, shear, strict=True)]
    stored = float(slip.length) * np.column_stack(stretched)
    return ShearStore(np.sum(load * np.diff(stored, axis=0, prepend=stored[:1]), axis=1), np.sum(load * stored, axis=1))


def _lagging(t: np.ndarray, S: np.ndarray, damping: float) -> np.ndarray:
    """Return the state s of S = s + T ds/dt, by implicit steps from row to row; it begins at S."""
    s = S.copy()
    for row, dt in enumerate(np.diff(t), start=1):
        s[row] = (damping * s[row - 1] + dt * S[row]) / (damping + dt)
    return s


@lru_cache(maxsize=64)
def _integral_of_shear(angles: Angles, soil: Soil, wheel: Wheel) -> np.ndarray:
    """Return int M ds at the slips of GRID, from where M is 0: 0 where it is least; not to be written to."""
    forces = wheel_forces(ca.DM(GRID), *angles.angles(sinkage(soil.theta_1, wheel), wheel, soil), wheel, soil)
    M = np.array(forces.torque / (wheel.r * forces.f_n)).ravel()
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (M[1:] + M[:-1]) * np.diff(GRID))])
    return integral - np.min(integral)
