"""The torque check of Fig 9: the duty at which a motor would ask more of the soil than its bound."""

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
from rover_pin.simulation.native.control import Commands, TorqueTable, commands_of

PITCHES = np.radians(np.arange(-40.0, 41.0, 5.0))
"""Pitches [rad] at which the limits are prepared; linear in between, the end values beyond."""

LOST_SLIP = 0.5
"""Default slip limit of the torque check (assumed).

The paper knows two states, "slip ratio around 0" and "around 1", and lets the check keep a wheel out of the second
while the PI control holds S_d = 0.1 in the first: the limit lies halfway. Nearer to S_d it would forbid the pull that a
slope needs: on Table 1's sand T_lim(0.2) holds 1.7 deg and T_lim(0.5) 4.7 deg, of 8.8 deg at S = 1 (atan(F(S) - R)).
"""


@dataclass(frozen=True)
class NoLimit:
    """No torque limit."""

    def duty(self, reading: Reading) -> np.ndarray | float:
        """Return the highest duty allowed [-]."""
        return 1.0

    def clip_duty(self, duty: np.ndarray | float, reading: Reading) -> np.ndarray | float:
        """Return the duty as it is."""
        return duty


@brief
@dataclass(frozen=True)
class TorqueLimit:
    """|delta| <= (T + K^2 |omega| / R) / (K V / R): the motor's torque stays below a bound T(W) of the soil.

    W is the static load of each wheel at the body's present pitch ("the normal load is evaluated from the body attitude
    ... considering static balance", section 4), T the bound of `torque_bounds` on the model's ground and contact arc.

    `saturation` is the paper's check, "if the resultant torque will exceed the maximum share": T_sat, Eq (3) all along
    the arc. A wheel in steady motion never gets there, because the soil resists it with no more than its torque at
    S = 1, which is far below T_sat where k is large (Table 1: 34 %); the check then acts only while a wheel speeds up.
    `at_slip` bounds by the torque at a slip: a wheel that turns steadily below it slips less.

    Which by default: beside a slip law `saturation`, the paper's words; alone `at_slip`, as `saturation` then does
    nothing. Where the slip is known either changes no outcome. Where it is Eq (9)'s, which does not see it, choose
    `at_slip`: on 12 inclines that dig it leaves 6 buried instead of 11, loses no ditch, and where nothing digs it costs
    a tenth of the way (studies/digging.py).

    Differs from the paper: it does not say how the check is computed, and evaluates W from link angles too. Over hills
    W at the pitch alone is off by 10 % RMS, with link angles (`driven_loads`) by 1 %; in a ditch of 30-deg walls by 26
    and 38 %, since there neither knows the ground's slope under a wheel. In the five drives tried (ditch on two sands,
    hills, one-sided bump, incline) the limit by link angles came to the same end. Effects besides the traction law are
    not known to it: where soil loses strength past a peak (`PostPeak`), a wheel may never reach the bound.
    """

    motor: Motor
    torques: tuple[tuple[float, ...], ...]
    "at each of PITCHES, one value a wheel [N m]"

    @classmethod
    def saturation(cls, model: Model) -> Self:
        """Return the limit at the soil's greatest shear, T_sat."""
        return cls(model.motor, tuple(tuple(bounds.saturation) for bounds in _bounds(model, SLIP_LIMIT)))

    @classmethod
    def at_slip(cls, model: Model, slip_limit: float = LOST_SLIP) -> Self:
        """Return the limit at a slip, T_lim.

        Raises ParameterError: a slip limit outside (0, 1].
        """
        return cls(model.motor, tuple(tuple(bounds.limit) for bounds in _bounds(model, slip_limit)))

    def torque(self, pitch: float) -> np.ndarray:
        """Return the greatest torque of each wheel [N m] at a body pitch [rad], nose down positive."""
        return np.array([np.interp(pitch, PITCHES, column) for column in np.array(self.torques).T])

    def duty(self, reading: Reading) -> np.ndarray:
        """Return the highest duty allowed to a wheel that drives forwards, one value a wheel [-]."""
        return self._most(reading, 1.0)

    def clip_duty(self, duty: np.ndarray | float, reading: Reading) -> np.ndarray:
        """Return the duty of each wheel with its magnitude limited, forwards or backwards; none is raised."""
        return np.clip(duty, -self._most(reading, -1.0), self._most(reading, 1.0))

    def _most(self, reading: Reading, sense: float) -> np.ndarray:
        """Return the greatest |duty| in a sense of driving: what the torque asks for and what back-EMF takes up."""
        back = sense * reading.wheel_rate / float(self.motor.no_load_rate)
        most = self.torque(reading.attitude[1]) / float(self.motor.stall_torque) + back
        return np.clip(most, 0.0, 1.0)


@dataclass(frozen=True)
class TorqueLimited:
    """Any controller under a torque limit; the limit senses wheel rates and the body's pitch, no slip."""

    controller: Controller
    limit: TorqueLimit | NoLimit

    def reset(self) -> None:
        """Let the controller forget the past."""
        if hasattr(self.controller, "reset"):
            self.controller.reset()

    def __call__(self, reading: Reading) -> Command:
        """Return the controller's command, its duties held."""
        command = self.controller(reading)
        if not isinstance(command, Command):
            command = Command(command)
        return command._replace(duty=self.limit.clip_duty(command.duty, reading))

    def native(self, wheels: int) -> Commands | None:
        """Return the same for the compiled loop, where the controller commands fixed duties."""
        inner, limit = commands_of(self.controller, wheels), native_limit(self.limit)
        if inner is None or inner.slip or inner.limit or limit is CUSTOM_LIMIT:
            return None
        if inner.law and inner.law.looks_at_limits:
            return None
        return dataclasses.replace(inner, limit=limit)


CUSTOM_LIMIT = TorqueTable(np.zeros(0), (), 0.0, 0.0)
"""Stands for a limit that is not one of this file's."""


def native_limit(limit: TorqueLimit | NoLimit) -> TorqueTable | None:
    """Return a limit for the compiled loop: None for no limit, `CUSTOM_LIMIT` for one of another class."""
    if type(limit) is NoLimit:
        return None
    if type(limit) is not TorqueLimit:
        return CUSTOM_LIMIT
    return TorqueTable(PITCHES, limit.torques, float(limit.motor.stall_torque), float(limit.motor.no_load_rate))


def _bounds(model: Model, slip_limit: float) -> list[WheelBounds]:
    """Return the bounds on the model's ground at each of PITCHES; a wheel that statics would lift is unloaded."""
    wheels = [mount.wheel for mount in model.rover.wheels]
    bounds = TorqueBounds(wheels, model.soils[0], slip_limit, model.effect(SoilTraction).angles)
    loads = [wheel_loads(model.rover, -float(pitch), gravity=model.gravity) for pitch in PITCHES]
    return [bounds(np.maximum(load, 0.0)) for load in loads]
