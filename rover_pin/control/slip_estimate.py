"""Slip estimates for a controller: by Eq (9) of the paper from a table of speeds, or the true slip.

Estimates from sensors on board are in `sensing`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Protocol

import numpy as np

from rover_pin.base.errors import ParameterError
from rover_pin.control.open_loop import ConstantDuty
from rover_pin.simulation.command import Reading
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.native.control import SlipTable
from rover_pin.simulation.simulate import simulate
from rover_pin.terrain.shapes import flat

MIN_RIM_SPEED = 1e-3
"""Minimum rim speed in the slip estimate of Eq (9) [m/s]. Eq (9) divides by the rim speed; a slower rim counts as
having this speed."""


class SlipEstimate(Protocol):
    """An object that estimates the slip of each wheel for `SlipControl`.

    An estimate with a memory also has a method `reset()`, which is called at the start of a drive. For use with a
    `HoleLaw`, an estimate may have a method `travel(reading)`, which returns the speed of each wheel over the ground
    [m/s], or an attribute `hole`, the depth of the hole that each wheel has dug [m].
    """

    def slip(self, reading: Reading) -> np.ndarray:
        """Return the estimated slip S_hat of each wheel (wheels,) [-] for a reading of the sensors."""


@dataclass(frozen=True)
class TrueSlip:
    """The true slip of each wheel by Eq (1) in the place of an estimate, as an external tracking system without errors
    would measure it.
    """

    def slip(self, reading: Reading) -> np.ndarray:
        """Return the true slip of each wheel [-]."""
        return reading.truth.slip

    def travel(self, reading: Reading) -> np.ndarray:
        """Return the true speed of each wheel over the ground (wheels,) [m/s].

        If the slip of the model relaxes with a delay, the true slip lags behind this speed.
        """
        return reading.truth.travel


@dataclass(frozen=True)
class SpeedTable:
    """The empirical table of section 5 of the paper: the steady speed of the rover for each duty.

    The speed is linear in the duty between the entries of the table. A negative duty has the negative speed of the
    positive duty.

    Raises ParameterError: the duties do not increase, or the numbers of duties and speeds differ.
    """

    duty: tuple[float, ...]
    "duties [-], increasing"
    speed: tuple[float, ...]
    "steady speed at each duty [m/s]"

    def __post_init__(self) -> None:
        if len(self.duty) != len(self.speed) or len(self.duty) < 2 or np.any(np.diff(self.duty) <= 0.0):
            raise ParameterError(
                "A SpeedTable needs two or more duties in increasing order, and one speed for each duty. It has "
                f"{len(self.duty)} duties and {len(self.speed)} speeds."
            )

    def speed_at(self, duty: np.ndarray) -> np.ndarray:
        """Return the speed [m/s] that the table gives for the duty of each wheel (wheels,) [-]."""
        return np.sign(duty) * np.interp(np.abs(duty), self.duty, self.speed)


@dataclass(frozen=True)
class TableEstimate:
    """The slip estimate of the paper from a table of speeds: S_hat = (r omega - v_hat(delta)) / (r omega), Eq (9).

    r is the wheel radius, delta the duty that is now applied, omega the measured wheel rate, and v_hat the speed that
    the table gives for the duty. The estimate uses neither the true speed nor the load. A wheel that spins under load
    turns more slowly at a given duty, so that its estimated slip is too small. Differs from the paper: |r omega| is at
    least 1 mm/s, and S_hat is clipped to [-1, 1].
    """

    table: SpeedTable
    """the steady speed of the rover for each duty"""
    r: float
    "radius of the wheels [m]"

    def slip(self, reading: Reading) -> np.ndarray:
        """Return the estimated slip of each wheel (wheels,) [-]."""
        # Eq (9) for both directions: a wheel in reverse has the slip of its mirror image.
        rim = self.r * reading.wheel_rate
        sense = np.where(rim < 0.0, -1.0, 1.0)
        speed = np.maximum(np.abs(rim), MIN_RIM_SPEED)
        return np.clip(1.0 - sense * self.travel(reading) / speed, -1.0, 1.0)

    def travel(self, reading: Reading) -> np.ndarray:
        """Return the speed of each wheel (wheels,) [m/s] that the table gives for the duties that are now applied."""
        return self.table.speed_at(reading.duty)

    def native(self) -> SlipTable:
        """Return the estimate as a table in the form for the compiled simulation loop, which does not call Python."""
        return SlipTable(self.table.duty, self.table.speed, self.r)


CALIBRATION_DUTIES = (0.1, 0.2, 0.3, 0.4, 0.55, 0.7, 0.85, 1.0)
"""Duties at which `calibrated_table` measures the steady speed [-]."""
CALIBRATION_TIME = 6.0
"""Duration of the drive at each of the CALIBRATION_DUTIES [s]. The steady speed is the mean over the last second."""


def calibrated_table(model: Model, duties: Sequence[float] = CALIBRATION_DUTIES) -> SpeedTable:
    """Return the table of steady speeds for the slip estimate of Eq (9), measured by simulated drives at constant
    duties.

    The rover of the model drives at each duty for 6 s. The terrain of the model should be level. The table begins with
    duty 0 and speed 0.

    Raises ParameterError: a higher duty does not give a higher speed, for example because the soil buries the rover.
    """
    # The table begins at rest, so that small duties are interpolated from zero.
    speeds = [0.0]
    for duty in duties:
        trace = simulate(model, ConstantDuty(duty), CALIBRATION_TIME, measure_error=False)
        # A drive that ends early, as on soil that buries the rover, has no steady speed.
        ended = trace.t[-1] < CALIBRATION_TIME - 0.5
        last_second = trace.t > CALIBRATION_TIME - 1.0
        speeds.append(math.nan if ended else float(np.mean(trace["body_vx"][last_second])))
    if not np.all(np.diff(speeds) > 0.0):
        text = ", ".join(f"{speed:.2g}" for speed in speeds[1:])
        raise ParameterError(
            "The slip estimate of Eq (9) needs a table of steady speeds that increase with the duty. On flat ground of "
            f"its soil, this model drives at {text} m/s for the duties {', '.join(f'{duty:g}' for duty in duties)}. "
            "Choose another soil or another definition of the traction factor (form), or control = 'onboard' or 'true'."
        )
    return SpeedTable((0.0, *map(float, duties)), tuple(speeds))


def flat_table(model: Model) -> SpeedTable:
    """Return the table of steady speeds for the slip estimate of Eq (9), measured on level ground for the rover, soil,
    motor, gravity and effects of a model.

    The terrain of the model is not used. The table is measured once, and is kept for all models with an equal rover,
    soil, motor, gravity and effects.

    Raises ParameterError: a higher duty does not give a higher speed.

    Source: section 5 of the paper, "we estimate the value of v_w from delta using an empirical function table".
    """
    # Everything on which the table depends. The inertias are included because a rover may differ from its URDF file.
    body = [inertia.toDynamicParameters().tolist() for inertia in model.rover.model.inertias]
    identity = (model.rover.urdf, body, model.soils[0], model.motor, model.gravity, model.all_effects)
    return _cached_table(_KeyedFlatModel(repr(identity), model.replace(terrain=flat())))


@dataclass(frozen=True)
class _KeyedFlatModel:
    """A model on level ground, as the key of a cache. Two keys are equal if their values of `identity` are equal."""

    identity: str
    model: Model = field(compare=False)


@lru_cache(maxsize=64)
def _cached_table(key: _KeyedFlatModel) -> SpeedTable:
    """Return the table of steady speeds of a model. The table is measured on the first call with an equal key."""
    return calibrated_table(key.model)
