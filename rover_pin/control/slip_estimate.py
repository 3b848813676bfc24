"""The slip as the controller knows it: Eq (9) from a table of duty and speed, or the truth of an external tracker."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Protocol

import numpy as np

from rover_pin.base.errors import ParameterError
from rover_pin.control.constant import ConstantDuty
from rover_pin.simulation.command import Reading
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.native.control import SlipTable
from rover_pin.simulation.simulate import simulate
from rover_pin.terrain.shapes import flat

SLOWEST_RIM = 1e-3
"""Rim speed [m/s] below which Eq (9) is evaluated at this speed: it has no value at rest."""


class SlipEstimate(Protocol):
    """A way to know the slip of each wheel; one that remembers has a `reset()`, called at the start of a drive.

    For a `HoleLaw` it has besides `travel(reading)`, the speed of each wheel over the ground [m/s], or `hole`, how deep
    the hole of each wheel is that it dug [m].
    """

    def slip(self, reading: Reading) -> np.ndarray:
        """Return S_hat, one value a wheel [-]."""


@dataclass(frozen=True)
class TrueSlip:
    """The slip of Eq (1) itself, as an external tracking system would give it."""

    def slip(self, reading: Reading) -> np.ndarray:
        """Return the true slip [-]."""
        return reading.truth.slip

    def travel(self, reading: Reading) -> np.ndarray:
        """Return the true speed of each wheel over the ground [m/s]: a slip that relaxes lags behind it."""
        return reading.truth.travel


@dataclass(frozen=True)
class SpeedTable:
    """The empirical table of section 5: steady speed [m/s] against duty [-], linear in between, odd in the duty."""

    duty: tuple[float, ...]
    speed: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(self.duty) != len(self.speed) or len(self.duty) < 2 or np.any(np.diff(self.duty) <= 0.0):
            raise ParameterError(
                f"SpeedTable: needs two or more duties in increasing order and one speed each; got {len(self.duty)} "
                f"duties and {len(self.speed)} speeds."
            )

    def speed_at(self, duty: np.ndarray) -> np.ndarray:
        """Return v_hat(delta) [m/s]."""
        return np.sign(duty) * np.interp(np.abs(duty), self.duty, self.speed)


@dataclass(frozen=True)
class TableEstimate:
    """S_hat = (r omega - v_hat(delta)) / (r omega), Eq (9), with the duty now applied.

    Differs from the paper: |r omega| is kept above 1 mm/s and S_hat within [-1, 1]. The estimate knows neither the true
    speed nor the load: a wheel that spins under load turns slower at the same duty, and reads as gripping.
    """

    table: SpeedTable
    r: float

    def slip(self, reading: Reading) -> np.ndarray:
        """Return the estimated slip [-]."""
        rim = self.r * reading.wheel_rate
        sense = np.where(rim < 0.0, -1.0, 1.0)
        speed = np.maximum(np.abs(rim), SLOWEST_RIM)
        return np.clip(1.0 - sense * self.travel(reading) / speed, -1.0, 1.0)

    def travel(self, reading: Reading) -> np.ndarray:
        """Return v_hat(delta) [m/s]."""
        return self.table.speed_at(reading.duty)

    def native(self) -> SlipTable:
        """Return the table for the compiled loop."""
        return SlipTable(self.table.duty, self.table.speed, self.r)


DUTIES = (0.1, 0.2, 0.3, 0.4, 0.55, 0.7, 0.85, 1.0)
STEADY = 6.0
"""Time driven at each duty [s]; the speed is the mean over the last second."""


def calibrated_table(model: Model, duties: Sequence[float] = DUTIES) -> SpeedTable:
    """Return the table measured by driving the rover on `model`'s terrain, which should be flat, at each duty for 6 s.

    The table starts at duty 0 and standstill.

    Raises ParameterError: the model does not run faster at a higher duty: Eq (9) has no table for it.
    """
    speeds = [0.0, *(_steady_speed(model, duty) for duty in duties)]
    if not np.all(np.diff(speeds) > 0.0):
        text = ", ".join(f"{speed:.2g}" for speed in speeds[1:])
        raise ParameterError(
            f"Eq (9) needs a speed for every duty, and on flat ground of its soil this model runs at {text} m/s at "
            f"duties {', '.join(f'{duty:g}' for duty in duties)}: it has no such table; take another soil or form, or "
            "control = 'onboard' or 'true'."
        )
    return SpeedTable((0.0, *map(float, duties)), tuple(speeds))


def _steady_speed(model: Model, duty: float) -> float:
    trace = simulate(model, ConstantDuty(duty), STEADY, measure_error=False)
    if trace.t[-1] < STEADY - 0.5:
        return math.nan
    return float(np.mean(trace["body_vx"][trace.t > STEADY - 1.0]))


def flat_table(model: Model) -> SpeedTable:
    """Return Eq (9)'s table of the rover that is driven: its soil, motor, gravity and effects on flat ground.

    Measured once for models that are alike.

    Raises ParameterError: as `calibrated_table`.

    Source: section 5, "we estimate the value of v_w from delta using an empirical function table".
    """
    body = [inertia.toDynamicParameters().tolist() for inertia in model.rover.model.inertias]
    identity = (model.rover.urdf, body, model.soils[0], model.motor, model.gravity, model.all_effects)
    return _flat_table(_OnFlat(repr(identity), model.replace(terrain=flat())))


@dataclass(frozen=True)
class _OnFlat:
    """A model on flat ground, the same as another where its `identity` is."""

    identity: str
    model: Model = field(compare=False)


@lru_cache(maxsize=64)
def _flat_table(ground: _OnFlat) -> SpeedTable:
    return calibrated_table(ground.model)
