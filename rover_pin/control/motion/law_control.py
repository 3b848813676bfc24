"""A control whose law is one function of what is read: asked here, and compiled into the step."""

from typing import Protocol

import casadi as ca
import numpy as np

from rover_pin.control.torque_check import CUSTOM_LIMIT, NoLimit, TorqueLimit, native_limit
from rover_pin.simulation.command import Command, Reading
from rover_pin.simulation.native.control import Commands, DriveLaw


class LawControl(Protocol):
    """A control by `law`: (place, read, limits), memory, numbers -> duties, steering angles, memory.

    `place` is t, x, y; `read` roll, pitch, yaw, wheel rates, currents and suspension angles; `limits` the lowest and
    then the highest duties that the torque limit allows. A law that looks at the first of them, or at none, has
    no more.
    """

    limit: TorqueLimit | NoLimit
    memory: np.ndarray

    @property
    def law(self) -> ca.Function:
        """The function."""

    @property
    def numbers(self) -> np.ndarray:
        """What the law needs besides."""

    @property
    def fresh(self) -> np.ndarray:
        """What it remembers at the start."""

    def reset(self) -> None:
        """Forget the past."""
        self.memory[:] = self.fresh

    def __call__(self, reading: Reading) -> Command:
        """Return the duty and the steering angle of each wheel."""
        law, ones = self.law, np.ones(len(reading.wheel_rate))
        place = [reading.t, *(reading.truth.position[:2] if law.size1_in(0) > 1 else ())]
        read = np.concatenate([reading.attitude, reading.wheel_rate, reading.current, reading.suspension])
        limits = np.concatenate([self.limit.clip_duty(sense * ones, reading) for sense in (-1.0, 1.0)])
        out = law(place, read[: law.size1_in(1)], limits[: law.size1_in(2)], self.memory, self.numbers)
        duty, steer, self.memory[:] = (values.full().ravel() for values in out)
        return Command(duty, steer if steer.size else 0.0)

    def native(self, wheels: int) -> Commands | None:
        """Return the same for the compiled loop, which keeps the memory; None under a limit of your own."""
        limit, law = native_limit(self.limit), self.law
        if limit is CUSTOM_LIMIT:
            return None
        duty, steer = (np.zeros(law.size1_out(at)) for at in (0, 1))
        return Commands(duty, steer, limit=limit, law=DriveLaw(law, self.numbers, self.memory))
