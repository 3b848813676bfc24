"""A motor on a brake: duty and braking torque are set, wheel rate and current are measured once both are steady.

Copy this file for a test bed of your own: `rover-pin close-loop DATA --experiment FILE`. DATA is here a folder with
motor.toml, which declares the motor as a drive log does, and points.csv, the steady points; `run` names the folds.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import casadi as ca
import numpy as np

from rover_pin.base.files.toml_file import read_toml, table_in
from rover_pin.base.quantity import record_from
from rover_pin.discrepancy.candidate import Candidate, plain_candidate
from rover_pin.discrepancy.standalone import Parts, Standalone
from rover_pin.effects.effect import MotorEffect
from rover_pin.estimation.parameter import Parameter
from rover_pin.experiments.folded import read_folded
from rover_pin.simulation.compiled.laws import motor_law, numbers
from rover_pin.simulation.model.motor import Motor

COLUMNS = ("duty", "load_Nm", "wheel_rate_radps", "current_A", "wheel_rate_sd_radps", "current_sd_A")


@dataclass(frozen=True, eq=False)
class MotorBrake(Standalone):
    """The experiment: what was set (folds, 2, samples), what was observed then, and the SD of each channel."""

    motor: Motor
    folds: tuple[str, ...]
    inputs: np.ndarray
    observed: np.ndarray
    sd: np.ndarray
    name, channels, stand_in = "motor on a brake", ("wheel rate", "current"), 1e3

    @classmethod
    def read(cls, path: Path) -> Self:
        """Return the experiment in a folder."""
        folds, points = read_folded(path / "points.csv", "run", COLUMNS)
        motor = record_from(Motor, table_in(read_toml(path / "motor.toml"), "motor", "motor.toml"), "motor.toml")
        return cls(motor, folds, points[:, :2], points[:, 2:4], np.sqrt(np.nanmean(points[:, 4:] ** 2, axis=(0, 2))))

    def base_model(self) -> Parts:
        """Return the motor as declared."""
        return Parts({"motor": self.motor})

    def uncertain(self, model: Parts) -> tuple[Parameter, ...]:
        """Return gear and resistance, known to 4 % (assumed: data sheets)."""
        return tuple(self.parameter(model, f"motor.{n}", 0.04, True, "motor.toml") for n in ("gear", "resistance"))

    @property
    def varied(self) -> np.ndarray:
        """Duty and load."""
        return np.swapaxes(self.inputs, 1, 2)

    def unit(self, channel: str) -> str:
        """Return the unit of a channel."""
        return "rad/s" if channel == "wheel rate" else "A"

    def candidates(self, model: Parts, kinds: Sequence[type]) -> tuple[Candidate, ...]:
        """Return the effects in a motor that have no states of their own, since nothing moves here."""
        mine = [kind for kind in kinds if issubclass(kind, MotorEffect) and kind.neutral and not kind.states]
        return tuple(plain_candidate(kind()) for kind in mine)

    def predict(self, models: Sequence[Parts]) -> np.ndarray:
        """Return rate and current where the motor's torque is the brake's, found by Newton's method on the rate."""
        return np.array([self._steady(model.records["motor"], model.effects) for model in models])

    def _steady(self, motor: Motor, effects: tuple[MotorEffect, ...]) -> np.ndarray:
        law, values = motor_law(motor, effects), numbers([motor, *effects])
        duty, load = np.nan_to_num(self.inputs).transpose(1, 0, 2).reshape(2, -1)
        rate, none = np.zeros(duty.size), np.zeros(duty.size)
        for _ in range(30):
            out = np.array(law(np.array([duty, rate, none, none]), ca.DM(0, duty.size), values))
            rate = rate - (out[0] - load) / np.minimum(out[1], -1e-9)
        steady = np.array([rate, out[2]]).reshape(2, *self.inputs.shape[::2])
        return np.nan_to_num(steady.transpose(1, 0, 2), nan=self.stand_in)
