"""The torque check of the paper (Fig 9): the highest duty at which a motor's torque stays below the soil's bound."""

import dataclasses
from dataclasses import dataclass
from typing import Self

import numpy as np

from rover_pin.base.public import brief
from rover_pin.control.torque_bounds import SLIP_LIMIT, TorqueBounds, WheelBounds
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.rover.statics import wheel_loads
from rover_pin.simulation.command import Command, Controller, Reading
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.model.motor import Motor
from rover_pin.simulation.native.control import CompiledController, TorqueTable, commands_of

PITCHES = np.radians(np.arange(-40.0, 41.0, 5.0))
"""Pitch angles of the body at which the torque limits are computed [rad]. Between these angles, the limits are linear
in the pitch; beyond the first and the last angle, they are constant."""

LOST_SLIP = 0.5
"""Default slip limit of the torque check (assumed).

The paper distinguishes two states of a wheel, "slip ratio around 0" and "around 1". The check keeps a wheel out of the
second state, while the PI control holds the desired slip S_d = 0.1 in the first state. The limit therefore lies between
the two states. A limit near S_d would forbid the pull that a slope needs, because the pull of sand with a large shear
displacement modulus k still increases far beyond S = 0.1."""


@dataclass(frozen=True)
class NoLimit:
    """A torque limit that never acts, for a controller without a torque check."""

    def duty(self, reading: Reading) -> np.ndarray | float:
        """Return the highest duty of each wheel [-], which is 1."""
        return 1.0

    def clip_duty(self, duty: np.ndarray | float, reading: Reading) -> np.ndarray | float:
        """Return the duty unchanged, because there is no limit."""
        return duty


@brief
@dataclass(frozen=True)
class TorqueLimit:
    """A limit of the duty that keeps the torque of each motor below a bound T(W) of the soil under its wheel.

    The limit is |delta| <= (T + K^2 |omega| / R) / (K V / R), where delta is the duty, omega the rate of the wheel, and
    K, R and V are the torque constant, the resistance and the supply voltage of the motor. W is the static load of each
    wheel at the present pitch of the body ("the normal load is evaluated from the body attitude ... considering static
    balance", section 4 of the paper). T is a bound of `torque_bounds` for the soil of the model. Two bounds can be
    chosen.

    - `saturation` is the paper's check, "if the resultant torque will exceed the maximum share". It uses T_sat, the
      torque if the shear stress equals the soil's strength, Eq (3), along the whole contact arc. A wheel in steady
      motion does not reach T_sat: the largest torque of the soil is its torque at a slip of 1, which is far below T_sat
      if the shear displacement modulus k is large. This check then acts only while a wheel accelerates.
    - `at_slip` uses the torque at a slip limit. A wheel that turns steadily below this torque slips less than the
      limit.

    By default, a slip control has `saturation`, as in the paper. A torque limit without slip control has `at_slip`,
    because `saturation` alone would hardly act. If the slip is measured, the choice hardly matters. If the slip is
    estimated by Eq (9), which does not depend on the true slip, `at_slip` prevents more burials and costs some distance
    (studies/digging.py).

    Differs from the paper: the paper does not state how the check is computed, and also computes W from link angles.
    The load W from the pitch alone is less accurate over hills. In a ditch, both loads are inaccurate, because neither
    computation considers the slope of the ground under a wheel. The limit considers the traction law and no other
    effects. For example, on soil that loses strength past a peak (`PostPeak`), a wheel may slip without ever reaching
    the bound.
    """

    motor: Motor
    torques: tuple[tuple[float, ...], ...]
    """largest torques (pitches, wheels) [N m], one row for each pitch angle of PITCHES"""

    @classmethod
    def saturation(cls, model: Model) -> Self:
        """Return the torque limit for a model with the bound T_sat, the torque at which the soil fails along the whole
        contact arc.
        """
        return cls(model.motor, tuple(tuple(bounds.saturation) for bounds in _bounds(model, SLIP_LIMIT)))

    @classmethod
    def at_slip(cls, model: Model, slip_limit: float = LOST_SLIP) -> Self:
        """Return the torque limit for a model with the bound T_lim, the torque at which the slip of a wheel is
        `slip_limit`.

        Raises ParameterError: the slip limit is outside (0, 1].
        """
        return cls(model.motor, tuple(tuple(bounds.limit) for bounds in _bounds(model, slip_limit)))

    def scaled(self, factor: float) -> Self:
        """Return the torque limit with all torques multiplied by a factor, for a soil that may be stronger."""
        return dataclasses.replace(
            self, torques=tuple(tuple(factor * torque for torque in row) for row in self.torques)
        )

    def torque(self, pitch: float) -> np.ndarray:
        """Return the largest torque of each wheel [N m] at a pitch of the body [rad].

        The pitch is positive with the nose down.
        """
        return np.array([np.interp(pitch, PITCHES, column) for column in np.array(self.torques).T])

    def duty(self, reading: Reading) -> np.ndarray:
        """Return the highest duty of each wheel [-] for driving forwards."""
        return self._max_duty(reading, 1.0)

    def clip_duty(self, duty: np.ndarray | float, reading: Reading) -> np.ndarray:
        """Return the duties of the wheels, clipped so that the torque of each motor stays below the bound, both
        forwards and backwards.
        """
        return np.clip(duty, -self._max_duty(reading, -1.0), self._max_duty(reading, 1.0))

    def _max_duty(self, reading: Reading, sense: float) -> np.ndarray:
        """Return the largest absolute duty of each wheel [-] in one direction: `sense` is 1 for forwards, -1 for
        backwards.
        """
        # T = K (delta V - K omega) / R: with the back-EMF, the same torque needs a higher duty at a higher rate.
        back = sense * reading.wheel_rate / float(self.motor.no_load_rate)
        duty = self.torque(reading.attitude[1]) / float(self.motor.stall_torque) + back
        return np.clip(duty, 0.0, 1.0)


@dataclass(frozen=True)
class TorqueLimited:
    """A controller that clips the duties of another controller to a torque limit.

    The limit depends on the wheel rates and on the pitch of the body, so that the slip need not be known.
    """

    controller: Controller
    limit: TorqueLimit | NoLimit

    def reset(self) -> None:
        """Call the `reset` method of the controller, if there is such a method, at the start of a drive."""
        if hasattr(self.controller, "reset"):
            self.controller.reset()

    def __call__(self, reading: Reading) -> Command:
        """Return the command of the controller for a reading of the sensors, with its duties clipped to the torque
        limit.
        """
        command = self.controller(reading)
        if not isinstance(command, Command):
            command = Command(command)
        return command._replace(duty=self.limit.clip_duty(command.duty, reading))

    def native(self, wheels: int) -> CompiledController | None:
        """Return the control in the form for the compiled simulation loop, which does not call Python.

        The result is None if the controller cannot run in the compiled loop, or has a torque limit already.
        """
        inner, limit = commands_of(self.controller, wheels), native_limit(self.limit)
        # A compiled controller with a slip law or a limit of its own cannot take a second limit.
        if inner is None or inner.slip or inner.limit or limit is CUSTOM_LIMIT:
            return None
        if inner.law and inner.law.looks_at_limits:
            return None
        return dataclasses.replace(inner, limit=limit)


CUSTOM_LIMIT = TorqueTable(np.zeros(0), (), 0.0, 0.0)
"""Result of `native_limit` for a torque limit of a class that a user has written, which the compiled simulation loop
cannot use."""


def native_limit(limit: TorqueLimit | NoLimit) -> TorqueTable | None:
    """Return a torque limit as a table, the form for the compiled simulation loop.

    The result is None for `NoLimit`, and `CUSTOM_LIMIT` for a class that a user has written.
    """
    if type(limit) is NoLimit:
        return None
    if type(limit) is not TorqueLimit:
        return CUSTOM_LIMIT
    return TorqueTable(PITCHES, limit.torques, float(limit.motor.stall_torque), float(limit.motor.no_load_rate))


def _bounds(model: Model, slip_limit: float) -> list[WheelBounds]:
    """Return the torque bounds of all wheels of a model on its first soil, one record for each pitch angle of
    PITCHES.
    """
    wheels = [mount.wheel for mount in model.rover.wheels]
    bounds = TorqueBounds(wheels, model.soils[0], slip_limit, model.effect(SoilTraction).angles)
    loads = [wheel_loads(model.rover, -float(pitch), gravity=model.gravity) for pitch in PITCHES]
    # The static balance gives a negative load for a wheel that lifts; such a wheel has no load.
    return [bounds(np.maximum(load, 0.0)) for load in loads]
